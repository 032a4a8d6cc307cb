"""Stages of USD: units, variants, times, purposes, instances, cameras, errors, conversion."""

import base64
import json
import re
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pxr", reason="usd-core is not installed")

from usd_stages import CAMERA, FLOOR, FLOOR_XML, expect_same, image, image_of_xml, load, write

import etendue as et

SUN = """
def DistantLight "Sun" {
    float inputs:intensity = 2
    bool inputs:normalize = true
    float3 xformOp:rotateXYZ = (-30, 20, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}
"""
SUN_XML = """
<emitter type="directional"><rgb name="irradiance" value="2, 2, 2"/>
<vector name="direction" x="-0.296198133" y="-0.5" z="-0.813797681"/></emitter>
"""


def test_a_stage_and_its_xml_give_the_same_image(tmp_path: Path) -> None:
    expect_same(image(load(tmp_path, CAMERA + FLOOR + SUN)), image_of_xml(FLOOR_XML + SUN_XML))


def test_a_stage_and_its_gltf_give_the_same_image(tmp_path: Path) -> None:
    positions = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0.5], [-1, 1, 0]], np.float32)
    triangles = np.array([0, 1, 2, 0, 2, 3], np.uint32)
    data = positions.tobytes() + triangles.tobytes()
    (tmp_path / "scene.gltf").write_text(json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1, 2]}],
        "nodes": [{"mesh": 0}, {"camera": 0, "translation": [0, 0, 5]},
                  {"extensions": {"KHR_lights_punctual": {"light": 0}}}],
        "extensionsUsed": ["KHR_lights_punctual"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "directional", "intensity": 2}]}},
        "cameras": [{"type": "perspective", "perspective": {"yfov": 2 * np.arctan(0.3), "aspectRatio": 4 / 3, "znear": 0.1}}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 0.75, 1], "metallicFactor": 0.25,
                                                "roughnessFactor": 0.5}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "buffers": [{"uri": "data:;base64," + base64.b64encode(data).decode(), "byteLength": len(data)}],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 24}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5125, "count": 6, "type": "SCALAR"}],
    }))
    stage = load(tmp_path, CAMERA + """
        def Mesh "Quad" (prepend apiSchemas = ["MaterialBindingAPI"]) {
            int[] faceVertexCounts = [4]
            int[] faceVertexIndices = [0, 1, 2, 3]
            point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0.5), (-1, 1, 0)]
            uniform token subdivisionScheme = "none"
            rel material:binding = </Paint>
        }
        def DistantLight "Sun" { float inputs:intensity = 2
            bool inputs:normalize = true }
        def Material "Paint" {
            token outputs:surface.connect = </Paint/Surface.outputs:surface>
            def Shader "Surface" {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor = (0.5, 0.25, 0.75)
                float inputs:metallic = 0.25
                token outputs:surface
            }
        }
        """)
    assert image(stage).mean() > 0.01
    expect_same(image(stage), image(et.load(tmp_path / "scene.gltf")), 1e-6)


def test_centimetres_and_z_up_give_the_same_image(tmp_path: Path) -> None:
    """Normalized lights are measured in units of the stage: a lamp of the same radiance is not normalized."""
    metres = CAMERA + FLOOR + """
        def SphereLight "Lamp" { float inputs:radius = 0.25
            float inputs:intensity = 10
            double3 xformOp:translate = (0.5, 1, 1.5)
            uniform token[] xformOpOrder = ["xformOp:translate"] }
        """
    centimetres = """
        def Camera "Camera" { float focalLength = 50
            float horizontalAperture = 40
            float verticalAperture = 30
            double3 xformOp:translate = (0, -500, 0)
            double xformOp:rotateX = 90
            uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"] }
        def Xform "Turned" { double xformOp:rotateX = 90
            uniform token[] xformOpOrder = ["xformOp:rotateX"]
            def Plane "Floor" { double width = 400
                double length = 400
                color3f[] primvars:displayColor = [(0.5, 0.25, 0.75)] }
            def SphereLight "Lamp" { float inputs:radius = 25
                float inputs:intensity = 10
                double3 xformOp:translate = (50, 100, 150)
                uniform token[] xformOpOrder = ["xformOp:translate"] } }
        """
    a = load(tmp_path, metres)
    b = et.load(write(tmp_path, centimetres, unit=0.01, up="Z"))
    assert np.allclose(b.build().bounds, a.build().bounds, atol=1e-5)
    expect_same(image(b), image(a), 1e-3)


VARIANTS = CAMERA + SUN + """
def Xform "Thing" (variants = { string form = "ball" }
    prepend variantSets = "form") {
    variantSet "form" = {
        "ball" { def Sphere "Shape" {} }
        "box" { def Cube "Shape" {} }
    }
}
"""


def test_variants_are_chosen_by_name(tmp_path: Path) -> None:
    assert load(tmp_path, VARIANTS)["/Thing/Shape"]["type"] == "sphere"
    assert load(tmp_path, VARIANTS, variants={"/Thing": {"form": "box"}})["/Thing/Shape"]["type"] == "cube"
    # The choice stays out of the file.
    assert load(tmp_path, VARIANTS)["/Thing/Shape"]["type"] == "sphere"


@pytest.mark.parametrize("variants, message", [
    ({"/Thing": {"form": "cone"}}, '/Thing: the variant set "form" has no "cone" (known: ball, box)'),
    ({"/Thing": {"shape": "box"}}, '/Thing: has no variant set "shape" (known: form)'),
    ({"/Thin": {"form": "box"}}, "variants: there is no prim /Thin"),
])
def test_unknown_variants_are_errors(tmp_path: Path, variants: dict[str, dict[str, str]], message: str) -> None:
    with pytest.raises(et.SceneError, match=re.escape(f"scene.usda: {message}")):
        load(tmp_path, VARIANTS, variants=variants)


def test_times(tmp_path: Path) -> None:
    text = CAMERA + SUN + 'def Sphere "Ball" { double radius.timeSamples = { 3: 1, 5: 3 } }'
    radius = lambda **options: load(tmp_path, text, **options)["/Ball.radius"]  # noqa: E731
    assert radius() == 1 and radius(time=4) == 2 and radius(time=9) == 3
    assert load(tmp_path, text, "startTimeCode = 5\nendTimeCode = 6")["/Ball.radius"] == 3


def test_purposes_and_visibility(tmp_path: Path) -> None:
    text = CAMERA + SUN + """
        def Sphere "Plain" {}
        def Xform "Guides" { uniform token purpose = "guide"
            def Sphere "Ball" {} }
        def Sphere "Stand_in" { uniform token purpose = "proxy" }
        def Sphere "Final" { uniform token purpose = "render" }
        def Xform "Hidden" { token visibility = "invisible"
            def Sphere "Ball" {} }
        """

    def balls(**options: object) -> set[str]:
        d = load(tmp_path, text, **options).to_dict()
        return {key for key, o in d.items() if key != "type" and o["type"] == "sphere"}

    assert balls() == {"/Plain", "/Final"}
    assert balls(purposes=("default", "proxy", "guide")) == {"/Plain", "/Stand_in", "/Guides/Ball"}
    with pytest.raises(ValueError, match='purposes: "final" must be one of default, render, proxy, guide'):
        balls(purposes=("final",))


def test_references_and_payloads(tmp_path: Path) -> None:
    write(tmp_path, 'def Sphere "Ball" { double radius = 2 }', 'defaultPrim = "Ball"', name="ball.usda")
    d = load(tmp_path, CAMERA + SUN + 'def "A" (references = @ball.usda@) {}\ndef "B" (payload = @ball.usda@) {}')
    assert d["/A.radius"] == d["/B.radius"] == 2


TWO_BALLS = """
    def Xform "Low" { double3 xformOp:translate = (-1, -0.5, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def Sphere "Ball" { double radius = 0.5
            color3f[] primvars:displayColor = [(0.9, 0.2, 0.1)] } }
    def Xform "High" { double3 xformOp:translate = (1, 0.5, 0)
        float3 xformOp:scale = (2, 2, 2)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"]
        def Sphere "Ball" { double radius = 0.5
            color3f[] primvars:displayColor = [(0.9, 0.2, 0.1)] } }
    """
BALL = 'def Xform "Model" {\n def Sphere "Ball" { double radius = 0.5\n %s } }'
COLOR = "color3f[] primvars:displayColor = [(0.9, 0.2, 0.1)]"


def test_native_instances(tmp_path: Path) -> None:
    write(tmp_path, BALL % COLOR, 'defaultPrim = "Model"', name="ball.usda")
    instanced = """
        def "Low" (references = @ball.usda@
            instanceable = true) { double3 xformOp:translate = (-1, -0.5, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"] }
        def "High" (references = @ball.usda@
            instanceable = true) { double3 xformOp:translate = (1, 0.5, 0)
            float3 xformOp:scale = (2, 2, 2)
            uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:scale"] }
        """
    d = load(tmp_path, CAMERA + SUN + instanced)
    assert d.build().info()["instances"] == 2 and d["/Low"]["type"] == "instance"
    expect_same(image(d), image(load(tmp_path, CAMERA + SUN + TWO_BALLS)), 1e-3)


def test_instances_of_what_emits_are_copies(tmp_path: Path) -> None:
    write(tmp_path, 'def Xform "Lamp" {\n def SphereLight "Bulb" { float inputs:radius = 0.2 } }', 'defaultPrim = "Lamp"',
          name="lamp.usda")
    d = load(tmp_path, CAMERA + """
        def "A" (references = @lamp.usda@
            instanceable = true) {}
        def "B" (references = @lamp.usda@
            instanceable = true) { double3 xformOp:translate = (1, 0, 0)
            uniform token[] xformOpOrder = ["xformOp:translate"] }
        """)
    info = d.build().info()
    assert info["instances"] == 0 and info["emitters"] == 2
    assert d["/B/Bulb.to_world"][0][3] == 1


def test_point_instancers(tmp_path: Path) -> None:
    text = CAMERA + SUN + """
        def PointInstancer "Many" {
            point3f[] positions = [(-1, -0.5, 0), (9, 9, 9), (1, 0.5, 0), (3, 3, 3)]
            float3[] scales = [(1, 1, 1), (1, 1, 1), (2, 2, 2), (1, 1, 1)]
            int[] protoIndices = [0, 1, 0, 0]
            int64[] ids = [10, 11, 12, 13]
            int64[] invisibleIds = [11, 13]
            rel prototypes = [</Many/Model>, </Many/Other>]
            %s
            def Cube "Other" {}
        }
        """ % (BALL % COLOR)
    d = load(tmp_path, text)
    assert d.build().info()["instances"] == 2 and "/Many/Model/Ball" in str(d.to_dict())
    expect_same(image(d), image(load(tmp_path, CAMERA + SUN + TWO_BALLS)), 1e-3)


CAMERAS = """
def Camera "Near" { float exposure = 1
    float horizontalApertureOffset = 4
    float verticalApertureOffset = 3
    double3 xformOp:translate = (0, 0, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"] }
def Camera "Wide" { float focalLength = 20
    float horizontalAperture = 40
    float verticalAperture = 30
    float fStop = 4
    float focusDistance = 5 }
def Camera "Flat" { token projection = "orthographic"
    float horizontalAperture = 40
    float verticalAperture = 30 }
"""


def test_cameras(tmp_path: Path) -> None:
    text = CAMERAS + FLOOR + SUN
    wide = load(tmp_path, text, camera="Wide")["/Wide"]
    assert wide["type"] == "thinlens" and wide["fov"] == pytest.approx(90)
    # The lens has the diameter f / N, and the focal length is in tenths of a unit.
    assert wide["aperture_radius"] == pytest.approx(2 / 4 / 2) and wide["focus_distance"] == 5
    flat = load(tmp_path, text, camera="/Flat")["/Flat"]
    assert flat["type"] == "orthographic" and np.diag(flat["to_world"])[:2] == pytest.approx([-2, 2])
    with pytest.raises(et.SceneError, match=re.escape('there is no camera "Far" (known: /Near, /Wide, /Flat)')):
        load(tmp_path, text, camera="Far")
    with pytest.warns(UserWarning, match="/Near: the first of 3 cameras is used"):
        et.load(write(tmp_path, text))
    settings = """
        def Scope "Render" { def RenderSettings "Settings" { uniform int2 resolution = (80, 60)
            rel camera = </Wide> } }
        """
    d = load(tmp_path, text + settings, 'renderSettingsPrimPath = "/Render/Settings"')
    assert d["/Wide"]["film"] == {"type": "hdrfilm", "width": 80, "height": 60}


def test_the_exposure_of_a_camera_scales_all_light(tmp_path: Path) -> None:
    lamp = 'def DomeLight "Sky" { float inputs:intensity = 0.5 }'
    once = image(load(tmp_path, CAMERA + FLOOR + SUN + lamp))
    twice = image(load(tmp_path, CAMERA.replace("float focal", "float exposure = 1\n    float focal") + FLOOR + SUN + lamp))
    assert np.allclose(twice, 2 * once, rtol=1e-5)


def test_apertures_off_the_axis_see_what_usd_says(tmp_path: Path) -> None:
    from pxr import Gf, Usd, UsdGeom
    text = CAMERAS + FLOOR + 'def SphereLight "Dot" { float inputs:radius = 0.05\ndouble3 xformOp:translate = (0.4, -0.2, 2)\n' \
        'uniform token[] xformOpOrder = ["xformOp:translate"] }'
    d = load(tmp_path, text, camera="Near")
    pixels = et.render(d.build(resolution=(66, 48)), "path:max_depth=1", spp=16, progress=False).image[..., 0]
    y, x = np.unravel_index(int(pixels.argmax()), pixels.shape)
    stage = Usd.Stage.Open(str(tmp_path / "scene.usda"))
    frustum = UsdGeom.Camera.Get(stage, "/Near").GetCamera(Usd.TimeCode.Default()).frustum
    at = (frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()).Transform(Gf.Vec3d(0.4, -0.2, 2))
    assert (x + 0.5) / 33 - 1 == pytest.approx(at[0], abs=0.05)
    assert 1 - (y + 0.5) / 24 == pytest.approx(at[1], abs=0.05)


def test_what_is_missing_is_added(tmp_path: Path) -> None:
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        d = et.load(write(tmp_path, FLOOR))
    assert [str(n.message).split(": ", 1)[1] for n in notes] == [
        "there is no camera: one is added that sees the whole scene", "there is no light: a white environment is added"]
    assert notes[0].filename == __file__
    assert image(d).min() > 0.1


def test_unknown_prims_are_warnings(tmp_path: Path) -> None:
    text = CAMERA + SUN + 'def Blob "X" {}\ndef BasisCurves "Hair" {}\ndef Mesh "Empty" {}'
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        et.load(write(tmp_path, text))
    assert {str(n.message).split(": ", 1)[1] for n in notes} == {
        "/X: the type Blob is unknown", "/Hair: a BasisCurves is not supported, and is left out",
        "/Empty: a mesh without faces is left out"}


def test_singular_transforms_are_left_out(tmp_path: Path) -> None:
    """Animations hide things by a scale of zero."""
    flat = 'float3 xformOp:scale = (0, 1, 1)\nuniform token[] xformOpOrder = ["xformOp:scale"]'
    write(tmp_path, BALL % COLOR, 'defaultPrim = "Model"', name="ball.usda")
    text = CAMERA + SUN + f"""
        def Xform "X" {{ {flat}
            def Sphere "Ball" {{}} }}
        def "I" (references = @ball.usda@
            instanceable = true) {{ {flat} }}
        def PointInstancer "Many" {{ point3f[] positions = [(0, 0, 0), (1, 0, 0)]
            float3[] scales = [(0, 0, 0), (1, 1, 1)]
            int[] protoIndices = [0, 0]
            rel prototypes = [</Many/Ball>]
            def Sphere "Ball" {{}} }}
        """
    with pytest.warns(UserWarning) as notes:
        d = et.load(write(tmp_path, text))
    assert {str(n.message).split(": ", 1)[1] for n in notes} == {
        "/X: its transform has no inverse: it is left out with what is below it", "/I: its transform has no inverse: it is left out",
        "/Many: instances whose transforms have no inverse are left out"}
    assert d.build().info()["instances"] == 1


def test_bad_files(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="none.usda: there is no such file"):
        et.load(tmp_path / "none.usda")
    (tmp_path / "text.usda").write_text("hello")
    with pytest.raises(et.SceneError, match="text.usda: is not a USD file: "):
        et.load(tmp_path / "text.usda")
    (tmp_path / "binary.usdc").write_bytes(b"PXR-USDC" + bytes(100))
    with pytest.raises(et.SceneError, match="binary.usdc: is not a USD file: "):
        et.load(tmp_path / "binary.usdc")
    broken = CAMERA + SUN + 'def "A" (references = @missing.usda@) {}'
    with pytest.raises(et.SceneError, match="scene.usda: .*missing.usda"):
        load(tmp_path, broken)
    with pytest.warns(UserWarning, match="missing.usda"):
        assert "/Sun" in et.load(write(tmp_path, broken), lenient=True)
    with pytest.raises(et.SceneError, match="metersPerUnit is 0"):
        et.load(write(tmp_path, CAMERA, unit=0))


def test_arguments_of_other_formats(tmp_path: Path, scenes: Path) -> None:
    with pytest.raises(TypeError, match="camera: only for scenes of USD"):
        et.load(scenes / "cornell.xml", camera="A")
    with pytest.raises(ValueError, match="scenes of USD have no parameters"):
        et.load(write(tmp_path, CAMERA), {"spp": 4})
    with pytest.raises(ValueError, match="subdivision must lie between 0 and 6"):
        load(tmp_path, CAMERA, subdivision=7)


def test_usd_core_is_named_where_it_is_missing(tmp_path: Path) -> None:
    code = "import sys; sys.modules['pxr'] = None; import etendue as et; et.load('scene.usda')"
    failed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert 'RuntimeError: USD files are read by the package usd-core: pip install usd-core' in failed.stderr


def test_the_program_reads_stages(tmp_path: Path, program: str) -> None:
    text = VARIANTS + TWO_BALLS
    file, out, picture = write(tmp_path, text), tmp_path / "out.xml", tmp_path / "out.pfm"
    choice = ["-D", "/Thing:form=box"]
    method = ["-i", "path:max_depth=3", "--spp", "8", "--seed", "1", "--resolution", "16x12", "--quiet"]
    subprocess.run([program, "convert", "--keep-plugins", file, out, *choice], check=True)
    subprocess.run([program, file, "-o", picture, *choice, *method], check=True)
    expected = image(load(tmp_path, text, variants={"/Thing": {"form": "box"}}))
    expect_same(image(et.load(out)), expected, 1e-5)
    expect_same(et.read_image(picture), expected, 1e-5)
    wrong = write(tmp_path, 'def "A" (references = @missing.usda@) {}', name="wrong.usda")
    reasons = []
    for command in ([program, "convert", wrong, out], [sys.executable, "-m", "etendue.usd", wrong, out]):
        failed = subprocess.run(command, capture_output=True, text=True)
        assert failed.returncode == 1
        reasons.append(failed.stderr.split(": ", 1)[1])
    assert reasons[0] == reasons[1]


def test_the_command_writes_xml(tmp_path: Path) -> None:
    text = VARIANTS + TWO_BALLS + """
        def Mesh "Quad" { int[] faceVertexCounts = [4]
            int[] faceVertexIndices = [0, 1, 2, 3]
            point3f[] points = [(-2, -1, -1), (2, -1, -1), (2, 1, -1), (-2, 1, -1)]
            color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)] ( interpolation = "vertex" )
            uniform token subdivisionScheme = "none" }
        """
    file, out = write(tmp_path, text), tmp_path / "out.xml"
    run = subprocess.run([sys.executable, "-m", "etendue.usd", str(file), str(out), "--variant", "/Thing:form=box"],
                         capture_output=True, text=True)
    assert (run.returncode, run.stderr) == (0, "")
    expect_same(image(et.load(out)), image(load(tmp_path, text, variants={"/Thing": {"form": "box"}})), 1e-5)
    failed = subprocess.run([sys.executable, "-m", "etendue.usd", "none.usd", str(out)], capture_output=True, text=True)
    assert (failed.returncode, failed.stderr) == (1, "etendue.usd: none.usd: there is no such file\n")
