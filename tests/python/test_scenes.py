"""Descriptions: files, dicts, edits, errors."""

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import etendue as et

XML = """<scene version="3.0.0">
    <sensor type="perspective">
        <float name="fov" value="35"/>
        <transform name="to_world"><lookat origin="0, 2, 7" target="0, 1, 0" up="0, 1, 0"/></transform>
        <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="12"/></film>
    </sensor>
    <bsdf type="diffuse" id="white"><rgb name="reflectance" value="0.8, 0.7, 0.6"/></bsdf>
    <shape type="rectangle" id="floor">
        <transform name="to_world"><rotate x="1" angle="-90"/><scale value="8"/></transform>
        <ref id="white"/>
    </shape>
    <shape type="sphere" id="ball">
        <point name="center" x="0" y="1" z="0"/>
        <bsdf type="roughplastic"><ref name="nested" id="white"/>
            <texture type="checkerboard" name="diffuse_reflectance"><float name="color0" value="0.25"/></texture>
        </bsdf>
    </shape>
    <shape type="sphere">
        <point name="center" x="-2" y="4" z="-1"/><float name="radius" value="0.3"/>
        <emitter type="area"><blackbody name="radiance" temperature="3000K" scale="2"/></emitter>
    </shape>
    <shape type="sphere">
        <point name="center" x="2" y="4" z="-1"/><float name="radius" value="0.3"/>
        <emitter type="area"><spectrum name="radiance" value="400:1, 500:2, 700:3"/></emitter>
    </shape>
    <emitter type="constant"><rgb name="radiance" value="0.1, 0.15, 0.2"/></emitter>
</scene>"""

DICT = {
    "type": "scene",
    "sensor": {
        "type": "perspective", "fov": 35, "to_world": et.look_at((0, 2, 7), (0, 1, 0)),
        "film": {"type": "hdrfilm", "width": 16, "height": 12},
    },
    "white": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.8, 0.7, 0.6]}},
    "floor": {
        "type": "rectangle", "to_world": et.scale(8) @ et.rotate((1, 0, 0), -90),
        "bsdf": {"type": "ref", "id": "white"},
    },
    "ball": {
        "type": "sphere", "center": [0, 1, 0],
        "bsdf": {
            "type": "roughplastic", "nested": {"type": "ref", "id": "white"},
            "diffuse_reflectance": {"type": "checkerboard", "color0": 0.25},
        },
    },
    "shape": {
        "type": "sphere", "center": (-2, 4, -1), "radius": np.float64(0.3),
        "emitter": {"type": "area", "radiance": {"type": "blackbody", "temperature": 3000, "scale": 2}},
    },
    "shape_2": {
        "type": "sphere", "center": np.array([2, 4, -1]), "radius": 0.3,
        "emitter": {"type": "area", "radiance": {"type": "spectrum", "value": [(400, 1), (500, 2), (700, 3)]}},
    },
    "emitter": {"type": "constant", "radiance": {"type": "rgb", "value": [0.1, 0.15, 0.2]}},
}


def test_a_dict_and_its_xml_give_the_same_dump() -> None:
    assert et.load_dict(DICT).dump() == et.load_string(XML).dump()


@pytest.mark.parametrize(
    "name", ["ajar", "cornell", "demo", "environment", "furnace", "glass-caustic", "lantern", "leak", "many-lights", "ring",
             "slit", "two-rooms", "window"])
def test_every_scene_survives_the_way_through_a_dict(scenes: Path, name: str) -> None:
    d = et.load(scenes / f"{name}.xml")
    assert et.load_dict(d.to_dict(), folder=scenes).dump() == d.dump()


def test_ids_may_look_like_automatic_keys() -> None:
    """Two objects never have one key, and references find theirs."""
    d = et.load_string("""<scene version="3.0.0"><shape type="sphere" id="shape"/><shape type="rectangle"/>
        <sensor type="perspective" id="sensor"/><sensor type="orthographic"/><bsdf type="diffuse" id="bsdf_2"/>
        <shape type="cube"><ref id="bsdf_2"/></shape></scene>""")
    assert d.paths() == ["shape", "shape_2", "sensor", "sensor_2", "bsdf_2", "shape_3", "shape_3.bsdf"]
    assert d["shape_2"]["type"] == "rectangle"
    assert et.load_dict(d.to_dict()).dump() == d.dump()


def test_objects_are_replaced_for_all_that_refer_to_them() -> None:
    d = et.load_string("""<scene version="3.0.0"><bsdf type="diffuse" id="white"/>
        <shape type="cube" id="a"><ref id="white"/></shape><shape type="sphere" id="b"><ref id="white"/></shape></scene>""")
    before = d.copy()
    d["white"] = {"type": "conductor"}
    assert [d[path]["type"] for path in ("white", "a.bsdf", "b.bsdf")] == ["conductor"] * 3
    assert "diffuse" not in d.dump() and before["a.bsdf"]["type"] == "diffuse"
    for _ in range(2):
        d["white"] = {"type": "twosided", "bsdf": {"type": "conductor", "id": "inner"}}
    assert d["b.bsdf"]["type"] == "twosided"
    d["white"] = {"type": "conductor"}
    d["a.bsdf"] = {"type": "dielectric"}  # of this shape alone
    assert [d[f"{shape}.bsdf"]["type"] for shape in "ab"] == ["dielectric", "conductor"]
    text = d.dump()
    with pytest.raises(et.SceneError):
        d["white"] = {"type": "hdrfilm"}
    assert d.dump() == text


def test_names_of_plugins_tell_their_category() -> None:
    """Otherwise a dict could mean two things."""
    categories: dict[str, set[str]] = {}
    for p in et.plugins():
        if not p["category"].startswith("pbrt") and p["category"] not in ("integrator", "aov"):
            categories.setdefault(p["name"], set()).add(p["category"])
    assert {name: c for name, c in categories.items() if len(c) > 1} == {}


def test_plugins_are_those_of_the_program(program: str) -> None:
    listed = subprocess.run([program, "list", "--json"], capture_output=True, check=True).stdout
    assert et.plugins() == json.loads(listed)
    assert [p["name"] for p in et.plugins("bsdf", "diffuse")] == ["diffuse"]


def test_edits_by_path() -> None:
    d = et.load_string(XML)
    d["ball.center"] = (1, 2, 3)
    assert d["ball.center"] == [1, 2, 3]
    d["white.reflectance"] = (0.5, 0.25, 0.125)
    assert d["white.reflectance"] == {"type": "rgb", "value": [0.5, 0.25, 0.125]}
    assert d["floor.bsdf.reflectance"] == d["white.reflectance"]
    d["ball.bsdf.diffuse_reflectance.color0"] = 1
    assert d["ball.bsdf.diffuse_reflectance.color0"] == 1.0
    d["ball.bsdf.diffuse_reflectance"] = "#ff0000"
    assert d["ball.bsdf.diffuse_reflectance"] == {"type": "rgb", "value": [1, 0, 0]}
    d["ball.bsdf"] = {"type": "dielectric", "int_ior": 1.5}
    assert d["ball.bsdf"] == {"type": "dielectric", "int_ior": 1.5}
    d["lamp"] = {"type": "point", "position": [0, 3, 0]}
    assert "lamp.position" in d.paths() and "lamp" in d
    d["sensor.film.width"] = np.int64(20)
    assert d.build().width == 20
    del d["lamp"]
    assert "lamp" not in d
    before = d.dump()
    copy = d.copy()
    copy["ball.radius"] = 2
    assert d.dump() == before


@pytest.mark.parametrize(
    "path, value, message",
    [
        ("ball.radus", 1, 'ball.radus: shape "sphere" has no "radus" (did you mean "radius"?)'),
        ("bal.radius", 1, 'bal.radius: the scene has no "bal.radius" (known: '),
        ("ball.radius", "big", 'ball.radius: parameter "radius" of shape "sphere" must be a float, but is a string'),
        ("ball.center", (1, 2), "ball.center: expected a number, a text, three numbers, or a 4x4 matrix, found"),
        ("ball.center", b"abc", "ball.center: expected a number, a text, three numbers, or a 4x4 matrix, found"),
        ("white.reflectance", {"type": "rgb", 3: 1}, 'white.reflectance: names of parameters of colour "rgb" are texts, not 3'),
        ("ball.bsdf", {"type": "difuse"}, 'dict: bsdf: unknown plug-in "difuse" (did you mean "diffuse"?)'),
        ("ball.bsdf", {"type": "area"}, "dict: bsdf: "),
    ])
def test_a_wrong_edit_says_what_is_near_and_changes_nothing(path: str, value: object, message: str) -> None:
    d = et.load_string(XML)
    before = d.dump()
    if path == "ball.bsdf" and value == {"type": "area"}:
        d[path] = value  # another object beside it: an emitter may stand in a shape
        return
    with pytest.raises(et.SceneError, match="^" + re.escape(message)):
        d[path] = value
    assert d.dump() == before


@pytest.mark.parametrize(
    "d, message",
    [
        ({"type": "scene", "ball": {"type": "sphere", "bsdf": {"type": "diffuse", "reflectance": [1, 2]}}},
         "dict: ball/bsdf/reflectance: expected"),
        ({"type": "scene", "ball": {"type": "sphere", "sensor": {"type": "diffuse", "bsdf": {"type": "sphere"}}}},
         "dict: ball/sensor/bsdf: a <shape> cannot stand in a <bsdf>"),
        ({"type": "scene", "ball": {"bsdf": {}}}, 'dict: ball: expected a "type"'),
        ({"type": "scene", "ball": {"type": "sphere", "bsdf": {"type": "ref", "id": "whit"}}, "white": {"type": "diffuse"}},
         'dict: ball/bsdf: no object has the id "whit" (did you mean "white"?)'),
        ({"type": "scenes"}, 'dict: the outermost "type" must be "scene"'),
    ])
def test_a_wrong_dict_says_where(d: dict[str, object], message: str) -> None:
    with pytest.raises(et.SceneError, match="^" + re.escape(message)):
        et.load_dict(d)


def test_parameters_are_checked_when_the_scene_is_built() -> None:
    d = et.load_dict({"type": "scene", "ball": {"type": "sphere", "bsdf": {"type": "diffuse", "reflectanc": 1.0}}})
    with pytest.raises(et.SceneError, match=r'^dict: ball/bsdf/reflectanc: bsdf "diffuse" has no parameter "reflectanc" '
                                            r'\(did you mean "reflectance"\?\)'):
        d.build()


def test_a_rotation_needs_an_axis() -> None:
    with pytest.raises(ValueError, match="the axis of a rotation must not be zero"):
        et.rotate((0, 0, 0), 90)


def test_errors_of_files_are_those_of_the_program(tmp_path: Path, program: str) -> None:
    file = tmp_path / "bad.xml"
    file.write_text('<scene version="3.0.0">\n<bsdf type="difuse"/>\n<sensor type="perspective"/></scene>')
    printed = subprocess.run([program, "info", str(file)], capture_output=True, text=True).stderr
    with pytest.raises(et.SceneError) as error:
        et.load(file).build()
    assert printed == f"etendue: {error.value}\n"
    with pytest.raises(RuntimeError, match="there is no such file"):
        et.load(tmp_path / "none.xml")


def test_defines(scenes: Path) -> None:
    assert et.load(scenes / "demo.xml", {"width": 20, "height": 10}).build().width == 20


def test_objects_that_double_are_refused() -> None:
    textures: dict[str, object] = {"type": "scene", "t0": {"type": "checkerboard"}}
    for i in range(1, 61):
        before = {"type": "ref", "id": f"t{i - 1}"}
        textures[f"t{i}"] = {"type": "checkerboard", "color0": before, "color1": before}
    with pytest.raises(et.SceneError, match="contains more than .* objects"):
        et.load_dict(textures)


def test_scalars_of_numpy_are_those_of_python() -> None:
    def scene(number: Any, flag: Any, count: Any) -> et.Description:
        return et.load_dict({
            "type": "scene", "sensor": {"type": "perspective", "fov": number, "film": {"type": "hdrfilm", "width": count}},
            "ball": {"type": "sphere", "radius": number, "flip_normals": flag, "center": [number, 1, 2]},
        })

    expected = scene(0.5, True, 8).dump()
    for number, flag, count in (
        (np.float64(0.5), np.True_, np.int64(8)), (np.float32(0.5), np.bool_(True), np.uint8(8)),
        (np.array(0.5), np.array(True), np.array(8)), (np.array(0.5, np.float16), True, 8),
    ):
        assert scene(number, flag, count).dump() == expected


def test_what_was_removed_can_be_added_again() -> None:
    d = et.load_dict({"type": "scene", "ball": {"type": "sphere", "bsdf": {"type": "diffuse", "id": "paint"}}})
    before = d.dump()
    for _ in range(2):
        del d["ball"]
        d["ball"] = {"type": "sphere", "bsdf": {"type": "diffuse", "id": "paint"}}
    assert d.dump() == before
    # An object in the place of another one, which has the same id within.
    d["ball"] = {"type": "sphere", "radius": 2.0, "bsdf": {"type": "diffuse", "id": "paint"}}
    # Or that refers to what was within.
    d["ball"] = {"type": "sphere", "radius": 1.0, "bsdf": {"type": "ref", "id": "paint"}}
    d["other"] = {"type": "sphere", "bsdf": {"type": "ref", "id": "paint"}}
    with pytest.raises(et.SceneError, match='the id "paint" is taken'):
        d["ball"] = {"type": "sphere", "bsdf": {"type": "diffuse", "id": "paint"}}
    del d["other"]
    del d["ball"]
    with pytest.raises(et.SceneError, match='no object has the id "paint"'):
        d["other"] = {"type": "sphere", "bsdf": {"type": "ref", "id": "paint"}}


def test_lists_that_contain_themselves_are_refused() -> None:
    rows: list[Any] = []
    rows.append(rows)
    with pytest.raises(et.SceneError, match="expected a number, a text, three numbers, or a 4x4 matrix"):
        et.load_dict({"type": "scene", "ball": {"type": "sphere", "to_world": rows}})


def test_readers_name_their_files() -> None:
    d = et.load_dict({"type": "scene", "ball": {"type": "sphere"}}, file="a.scene", warnings=["a.scene: fog is left out"])
    assert (d.file, d.warnings) == ("a.scene", ["a.scene: fog is left out"])
    with pytest.raises(et.SceneError, match="^a.scene: ball/radios"):
        et.load_dict({"type": "scene", "ball": {"type": "sphere", "radios": 1.0}}, file="a.scene").build()
    with pytest.raises(et.SceneError, match="^a.scene: ball: unknown plug-in"):
        et.load_dict({"type": "scene", "ball": {"type": "spere"}}, file="a.scene")


def test_descriptions_are_saved(tmp_path: Path, program: str) -> None:
    """With meshes and images, under names from which other programs know their format."""
    codes = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
    image = {"uint8": codes, "colours": codes / np.float32(255), "grey": codes[..., 0] / np.float32(255)}
    square = {"vertices": [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], "faces": [[0, 1, 2], [0, 2, 3]],
              "uvs": [[0, 1], [1, 1], [1, 0], [0, 0]]}
    d = et.load_dict({
        "type": "scene", "light": {"type": "constant"},
        "sensor": {"type": "perspective", "to_world": et.look_at((0, 0, 8), (0, 0, 0)),
                   "film": {"type": "hdrfilm", "width": 32, "height": 16}},
        **{name: {"type": "mesh", **square, "to_world": et.translate(3 * i - 3, 0, 0), "bsdf": {
            "type": "diffuse", "reflectance": {"type": "bitmap", "data": data}}} for i, (name, data) in enumerate(image.items())},
    })
    d.save(tmp_path / "new" / "scene.xml")
    files = sorted(p.suffix for p in (tmp_path / "new" / "scene_files").iterdir())
    assert files == [".pfm", ".pfm", ".ply", ".ply", ".ply", ".png"]
    expected = et.render(d, "path", spp=4, progress=False).image
    np.testing.assert_array_equal(et.render(tmp_path / "new" / "scene.xml", "path", spp=4, progress=False).image, expected)
    subprocess.run([program, "render", "scene.xml", "-i", "path", "--spp", "4", "-o", "image.exr"], cwd=tmp_path / "new", check=True)
    np.testing.assert_array_equal(et.read_image(tmp_path / "new" / "image.exr"), expected)
    with pytest.raises(ValueError, match=r'saved as .xml, not as "scene.json"'):
        d.save("scene.json")


def test_descriptions_are_saved_for_mitsuba(tmp_path: Path) -> None:
    d = et.load_dict({"type": "scene", "light": {"type": "constant"}, "ball": {
        "type": "sphere", "bsdf": {"type": "orennayar", "sigma": 20.0}}})
    d.save(tmp_path / "own.xml")
    assert "orennayar" in (tmp_path / "own.xml").read_text()
    with pytest.warns(UserWarning, match="orennayar"):
        d.save(tmp_path / "plain.xml", mitsuba=True)
    assert "orennayar" not in (tmp_path / "plain.xml").read_text() and "orennayar" in d.dump()


def test_paths_are_limited() -> None:
    # Groups within groups are made once, but many paths lead to the innermost.
    groups: dict[str, object] = {"type": "scene", "g0": {"type": "shapegroup", "ball": {"type": "sphere"}}}
    for i in range(1, 26):
        before = {"type": "instance", "shape": {"type": "ref", "id": f"g{i - 1}"}}
        groups[f"g{i}"] = {"type": "shapegroup", "a": before, "b": dict(before)}
    with pytest.raises(ValueError, match="more than 1000000 paths"):
        et.load_dict(groups).paths()


def test_descriptions_are_mappings() -> None:
    d = et.load_string(XML)
    assert list(d) == list(d.keys()) == d.paths() and len(d) == len(d.paths())
    assert d._ipython_key_completions_() == d.paths()  # type: ignore[attr-defined]
    items = dict(d.items())
    assert list(items) == d.paths() and items["ball.center"] == [0, 1, 0] and items["white"]["type"] == "diffuse"
    assert list(d.values())[3] == items[d.paths()[3]]
    for path in d:
        assert path in d and path in d.keys()
    for path in ("ball.radiu", "bal", "ball.center.x", "", "white.reflectance.type"):
        assert path not in d


def test_descriptions_and_scenes_show_themselves() -> None:
    d = et.load_dict({**DICT, "<thing>": {"type": "mesh", "vertices": np.eye(3), "faces": [[0, 1, 2]]}})
    # floor.bsdf and ball.bsdf.nested are the object "white".
    objects = [p for p in d if isinstance(d[p], dict) and d[p].get("type", "rgb") != "rgb"]
    assert repr(d) == f"<Description dict, {len(objects) - 2} objects>"
    html = d._repr_html_()
    assert "ball.bsdf.diffuse_reflectance" in html and "color0 = 0.25" in html and "reflectance = 0.8, 0.7, 0.6" in html
    assert "&lt;thing&gt;" in html and "<thing>" not in html and "3 vertices, 1 triangles" in html
    scene = d.build()
    assert repr(scene) == "<Scene dict, 16 x 12, 5 shapes, 3 emitters>"
    html = scene._repr_html_()
    assert "16 x 12" in html and "<td>triangles</td><td>3</td>" in html and "perspective" in html
    many = et.load_dict({"type": "scene", **{f"ball{i}": {"type": "sphere"} for i in range(300)}})
    assert "ball199" in many._repr_html_() and "ball200" not in many._repr_html_() and "and others" in many._repr_html_()


CAMERAS = {
    **DICT,
    "left": {**DICT["sensor"], "to_world": et.look_at((-3, 2, 7), (0, 1, 0))},  # type: ignore[dict-item]
    "right": {**DICT["sensor"], "to_world": et.look_at((3, 2, 7), (0, 1, 0))},  # type: ignore[dict-item]
}


def test_sensors_are_chosen_by_number_or_name(program: str, tmp_path: Path) -> None:
    d = et.load_dict(CAMERAS)
    scenes = [d.build(sensor=i) for i in (None, 0, 1, np.int64(2), "right", "1")]
    assert [s.sensor for s in scenes] == [0, 0, 1, 2, 2, 1]
    assert scenes[0].sensors == ["perspective", "left", "right"]
    images = [et.render(s, "path", spp=1, progress=False).image for s in scenes]
    for i, chosen in enumerate(s.sensor for s in scenes):
        for k, other in enumerate(s.sensor for s in scenes):
            assert np.array_equal(images[i], images[k]) == (chosen == other)
    np.testing.assert_array_equal(et.render(d, "path", spp=1, sensor="right", progress=False).image, images[3])
    (one,) = et.render_sensors(d, "path", np.int64(2), spp=1, progress=False)
    np.testing.assert_array_equal(one.image, images[3])
    for wrong in (3, -1, "middle"):
        with pytest.raises(et.SceneError, match=rf'there is no sensor "{wrong}" \(known: 0 to 2, or by name: perspective, left, right'):
            d.build(sensor=wrong)
    with pytest.raises(ValueError, match="is empty"):
        d.build(sensor="")
    with pytest.raises(ValueError, match=r"a Scene has its sensor from Description.build\(sensor=...\)"):
        et.render(scenes[0], sensor=1)


def test_files_and_descriptions_are_rendered_as_scenes_are(scenes: Path) -> None:
    file = scenes / "cornell.xml"
    d = et.load(file)
    d["sensor.film.width"] = d["sensor.film.height"] = 8
    image = et.render(d.build(), "path", spp=1, progress=False).image
    np.testing.assert_array_equal(et.render(d, "path", spp=1, progress=False).image, image)
    for name in file, str(file):
        assert et.render(name, "path:max_depth=1", spp=1, progress=False).image.shape == (400, 400, 3)
    with pytest.raises(RuntimeError, match="there is no such file"):
        et.render("none.xml")
    as_dict = d.to_dict()
    np.testing.assert_array_equal(et.render({**as_dict}, "path", spp=1, progress=False).image, image)
    for wrong in (None, [], 3):
        with pytest.raises(TypeError, match="a scene is a Scene, a Description, a dict or the name of a file, but found"):
            et.render(wrong)  # type: ignore[arg-type]
