"""Meshes and images from arrays."""

import re
from typing import Any

import numpy as np
import pytest

import etendue as et

VERTICES = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=np.float64)
FACES = np.array([[0, 1, 2], [0, 2, 3]])
UVS = np.array([[0, 1], [1, 1], [1, 0], [0, 0]])


def scene_of(thing: dict[str, Any]) -> dict[str, Any]:
    """A square that fills the image."""
    return {
        "type": "scene",
        "sensor": {"type": "orthographic", "film": {"type": "hdrfilm", "width": 4, "height": 4, "rfilter": {"type": "box"}},
                   "to_world": et.look_at((0, 0, 4), (0, 0, 0))},
        "thing": thing,
    }


def square(**parts: Any) -> dict[str, Any]:
    return {"type": "mesh", "vertices": VERTICES, "faces": FACES, **parts}


def lamp(texture: dict[str, Any]) -> dict[str, Any]:
    """A square that emits the texture: a pixel of the image is one of the texture."""
    return scene_of(square(uvs=UVS, emitter={"type": "area", "radiance": {"type": "bitmap", "filter_type": "nearest", **texture}}))


def image(d: et.Description) -> Any:
    return et.render(d, "path:max_depth=1", spp=2, progress=False).image


def emitted(**texture: Any) -> Any:
    return image(et.load_dict(lamp(texture)))


@pytest.mark.parametrize("real", [np.float16, np.float32, np.float64, np.int32])
@pytest.mark.parametrize("whole", [np.int16, np.int32, np.uint32, np.int64, np.uint64])
def test_meshes_of_all_types_are_the_same(real: type, whole: type) -> None:
    normals = np.tile([0, 0, 1], (4, 1))
    expected = et.load_dict(scene_of(square(normals=normals, uvs=UVS)))["thing.mesh"]
    found = et.load_dict(scene_of({
        "type": "mesh", "vertices": VERTICES.astype(real), "faces": FACES.astype(whole), "normals": normals.astype(real),
        "uvs": UVS.astype(real).tolist(),
    }))["thing.mesh"]
    assert expected.keys() == {"positions", "triangles", "normals", "uvs"}
    for name, array in expected.items():
        np.testing.assert_array_equal(array, found[name])
        assert array.dtype == found[name].dtype == (np.uint32 if name == "triangles" else np.float32)


def test_names_and_flat_arrays_of_mitsuba() -> None:
    own = et.load_dict(scene_of(square(uvs=UVS, colors=np.eye(4)[:, :3])))
    mitsuba = et.load_dict(scene_of({
        "type": "mesh", "vertex_positions": VERTICES.ravel(), "faces": FACES.ravel(), "vertex_texcoords": UVS.ravel(),
        "vertex_color": np.eye(4)[:, :3].ravel(),
    }))
    for name, array in own["thing.mesh"].items():
        np.testing.assert_array_equal(array, mitsuba["thing.mesh"][name])


def test_slices_and_other_orders_are_read_as_they_look() -> None:
    wide = np.asfortranarray(np.hstack([VERTICES, VERTICES]))
    found = et.load_dict(scene_of({"type": "mesh", "vertices": wide[:, 3:], "faces": FACES[::-1]}))["thing.mesh"]
    np.testing.assert_array_equal(found["positions"], VERTICES)
    np.testing.assert_array_equal(found["triangles"], FACES[::-1])


@pytest.mark.parametrize(
    "parts, message",
    [
        ({"vertices": np.zeros((4, 2))}, "dict: thing/vertices: expected an array of shape (N, 3) of numbers, found one of shape (4, 2) "
                                         "of float64"),
        ({"vertices": np.zeros(4)}, "dict: thing/vertices: expected an array of shape (N, 3) of numbers, found one of shape (4,)"),
        ({"vertices": np.zeros((4, 3), complex)}, "found one of shape (4, 3) of complex128"),
        ({"vertices": [[0, 0], [1]]}, "found what NumPy makes no array of"),
        ({"vertices": "many"}, "dict: thing/vertices: expected"),
        ({"faces": FACES.astype(float)}, "dict: thing/faces: expected an array of shape (N, 3) of integers, found one of shape (2, 3) of "
                                         "float64"),
        ({"faces": FACES + 2}, "triangle 0 refers to vertex 4, but there are only 4"),
        ({"faces": FACES - 1}, "dict: thing/faces: -1 is no number of a vertex"),
        ({"normals": VERTICES[:3]}, "there are 3 normals, but 4 positions"),
        ({"uvs": VERTICES}, "dict: thing/uvs: expected an array of shape (N, 2)"),
        ({"positions": VERTICES}, 'dict: thing/positions: these are "positions", which are given twice'),
        ({"vertices": np.full((4, 3), 1e300)}, "finite"),
        ({"mesh": {"positions": VERTICES, "triangles": FACES}}, 'give "vertices" or "mesh", not both'),
    ])
@pytest.mark.filterwarnings("ignore:overflow")
def test_a_wrong_mesh_says_what_was_expected(parts: dict[str, Any], message: str) -> None:
    with pytest.raises(et.SceneError, match=re.escape(message)):
        et.load_dict(scene_of(square(**parts)))


def test_a_mesh_needs_vertices_and_faces() -> None:
    with pytest.raises(et.SceneError, match='dict: thing: the mesh has no triangles: give "triangles", or "faces"'):
        et.load_dict(scene_of({"type": "mesh", "vertices": VERTICES}))
    with pytest.raises(et.SceneError, match='needs a mesh'):
        et.load_dict(scene_of({"type": "mesh"})).build()


def test_parts_of_meshes_can_be_read_and_changed() -> None:
    d = et.load_dict(scene_of(square(uvs=UVS)))
    np.testing.assert_array_equal(d["thing.vertices"], VERTICES)
    np.testing.assert_array_equal(d["thing.faces"], FACES)
    assert "thing.vertices" in d and "thing.normals" not in d
    with pytest.raises(et.SceneError):
        d["thing.normals"]
    copy = d.copy()
    for i in range(3):
        d["thing.vertices"] = VERTICES * (i + 2)
    np.testing.assert_array_equal(d["thing.mesh"]["positions"], VERTICES * 4)
    np.testing.assert_array_equal(d["thing.uvs"], UVS)
    np.testing.assert_array_equal(copy["thing.vertices"], VERTICES)
    d["thing.normals"] = np.tile([0, 0, 2.0], (4, 1))
    np.testing.assert_array_equal(d["thing.normals"], np.tile([0, 0, 1], (4, 1)))
    before = d.dump()
    with pytest.raises(et.SceneError, match="there are 4 normals, but 5 positions"):
        d["thing.vertices"] = np.vstack([VERTICES, VERTICES[:1]])
    assert d.dump() == before
    # The description holds no mesh that nothing uses.
    assert "mesh: integer 0" in d.dump()


def test_images_of_floats_are_linear_and_codes_are_srgb() -> None:
    rng = np.random.default_rng(1)
    linear = rng.random((4, 4, 3), dtype=np.float32)
    np.testing.assert_allclose(emitted(data=linear), linear, rtol=1e-5)
    np.testing.assert_allclose(emitted(bitmap=linear.astype(np.float64)), linear, rtol=1e-5)
    codes = rng.integers(0, 256, (4, 4, 3), dtype=np.uint8)
    x = codes / 255
    decoded = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(emitted(data=codes), decoded, rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(emitted(data=codes[:, ::-1]), decoded[:, ::-1], rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(emitted(data=codes, raw=True), x, rtol=1e-5, atol=1e-6)
    grey = np.repeat(linear[:, :, :1], 3, axis=2)
    np.testing.assert_allclose(emitted(data=linear[:, :, 0]), grey, rtol=1e-5)
    np.testing.assert_allclose(emitted(data=linear[:, :, :1]), grey, rtol=1e-5)


def test_images_survive_dicts_and_edits() -> None:
    linear = np.random.default_rng(2).random((4, 4, 3), dtype=np.float32)
    d = et.load_dict(lamp({"data": linear}))
    np.testing.assert_array_equal(image(d), image(et.load_dict(d.to_dict())))
    texture = "thing.emitter.radiance"
    d[f"{texture}.data"] = linear[::-1]
    np.testing.assert_allclose(image(d), linear[::-1], rtol=1e-5)
    d[f"{texture}.filename"] = "none.png"
    with pytest.raises(et.SceneError, match="none.png"):
        d.build()
    d[f"{texture}.data"] = linear
    np.testing.assert_allclose(image(d), linear, rtol=1e-5)


@pytest.mark.parametrize(
    "data, message",
    [
        (np.zeros((2, 4, 4)), "(give the alpha as an image of its own)"),
        (np.zeros((2, 4, 2), np.uint8), "found one of shape (2, 4, 2) of uint8"),
        (np.zeros((2, 4), np.int64), "found one of shape (2, 4) of int64"),
        (np.zeros(8), "expected an array of shape (H, W), (H, W, 1) or (H, W, 3), of uint8 (sRGB) or of floats (linear)"),
        (np.zeros((0, 4, 3)), "found one of shape (0, 4, 3)"),
        (np.array([[0, 1], [np.nan, 0]]), "the pixel in row 1 and column 0 is not finite"),
        ([[0, 1], [2]], "found what NumPy makes no array of"),
    ])
def test_a_wrong_image_says_what_was_expected(data: Any, message: str) -> None:
    with pytest.raises(et.SceneError, match="dict: thing/emitter/radiance/data: .*" + re.escape(message)):
        et.load_dict(lamp({"data": data}))


def test_an_image_is_a_file_or_an_array() -> None:
    with pytest.raises(et.SceneError, match='give "data" or "filename", not both'):
        et.load_dict(lamp({"data": np.ones((2, 2)), "filename": "a.png"}))


def test_normals_that_are_none_are_a_warning() -> None:
    normals = np.array([[0, 0, 1], [np.nan, 0, 0], [0, 0, 0], [0, 0, 1]])
    scene = et.load_dict(scene_of(square(normals=normals))).build()
    assert scene.warnings[0] == "dict: thing: mesh: 2 normals that were zero or not finite are computed from the triangles"
