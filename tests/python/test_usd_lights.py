"""Lights of UsdLux against the same emitters in Mitsuba's XML."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pxr", reason="usd-core is not installed")

from usd_stages import CAMERA, FLOOR, FLOOR_XML, expect_same, image, image_of_xml, load, write

import etendue as et

PLACE = """double3 xformOp:translate = (0.5, 0.25, 2)
    float3 xformOp:rotateXYZ = (20, 30, 0)
    float3 xformOp:scale = (2, 2, 2)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ", "xformOp:scale"]"""
# XML applies the first transform first; a stage's are in the order of their matrices.
PLACE_XML = '<scale value="2"/><rotate x="1" angle="20"/><rotate y="1" angle="30"/><translate x="0.5" y="0.25" z="2"/>'
# From +z of a shape to -z of a light.
TURN = '<rotate y="1" angle="180"/>'


def lights(folder: Path, text: str, **options: object) -> np.ndarray:
    return image(load(folder, CAMERA + FLOOR + text, **options))


def emitting(shape: str, radiance: str) -> str:
    return f'{shape}<emitter type="area"><rgb name="radiance" value="{radiance}"/></emitter></shape>'


RECT = f'<shape type="rectangle"><transform name="to_world"><scale x="0.3" y="0.2"/>{TURN}{PLACE_XML}</transform>'
DISK = f'<shape type="disk"><transform name="to_world"><scale value="0.25"/>{TURN}{PLACE_XML}</transform>'
SPHERE = f'<shape type="sphere"><float name="radius" value="0.25"/><transform name="to_world">{PLACE_XML}</transform>'
TUBE = '<shape type="cylinder"><point name="p0" x="-0.4" y="0" z="0"/><point name="p1" x="0.4" y="0" z="0"/>' \
    f'<float name="radius" value="0.1"/><transform name="to_world">{PLACE_XML}</transform>'
SHAPES = {
    "RectLight": ("float inputs:width = 0.6\nfloat inputs:height = 0.4", RECT, 0.6 * 0.4 * 4),
    "DiskLight": ("float inputs:radius = 0.25", DISK, math.pi * 0.25),
    "SphereLight": ("float inputs:radius = 0.25", SPHERE, 4 * math.pi * 0.25),
    "CylinderLight": ("float inputs:length = 0.8\nfloat inputs:radius = 0.1", TUBE, 2 * math.pi * 0.2 * 1.6),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_area_lights(tmp_path: Path, kind: str) -> None:
    """The radiance is intensity * 2^exposure * colour."""
    inputs, shape, area = SHAPES[kind]
    text = f'def {kind} "Lamp" {{ {PLACE}\n{inputs}\nfloat inputs:intensity = 3\nfloat inputs:exposure = 1\n' \
        'color3f inputs:color = (1, 0.5, 0.25)\n%s }'
    expect_same(lights(tmp_path, text % ""), image_of_xml(FLOOR_XML + emitting(shape, "6, 3, 1.5")))
    # Normalized by the area in the world.
    radiance = ", ".join(str(x / area) for x in (6, 3, 1.5))
    expect_same(lights(tmp_path, text % "bool inputs:normalize = true"), image_of_xml(FLOOR_XML + emitting(shape, radiance)))


def test_the_area_is_that_in_the_units_of_the_stage(tmp_path: Path) -> None:
    """As in other renderers, which do not convert them."""
    file = write(tmp_path, CAMERA + 'def RectLight "Lamp" { float inputs:width = 50\nbool inputs:normalize = true }', unit=0.01)
    assert et.load(file)["/Lamp.emitter.radiance"]["value"] == pytest.approx([1 / 50] * 3)


def test_stretched_spheres_and_tubes_are_normalized_by_their_area(tmp_path: Path) -> None:
    text = 'def %s "Lamp" { bool inputs:normalize = true\nfloat inputs:radius = 1\nfloat3 xformOp:scale = (1, 2, 3)\n' \
        'uniform token[] xformOpOrder = ["xformOp:scale"] }'
    # The ellipsoid with the half axes 1, 2, 3 has the area 48.882; an ellipse of 2 and 3 the perimeter 15.865.
    for kind, area in (("SphereLight", 48.882), ("CylinderLight", 15.865)):
        d = load(tmp_path, CAMERA + text % kind)
        assert 1 / d["/Lamp.emitter.radiance"]["value"][0] == pytest.approx(area, rel=0.011)


def test_colour_temperature(tmp_path: Path) -> None:
    from pxr import UsdLux
    text = 'def SphereLight "Lamp" { bool inputs:enableColorTemperature = %s\nfloat inputs:colorTemperature = 3000 }'
    warm = load(tmp_path, CAMERA + text % "true")["/Lamp.emitter.radiance"]["value"]
    assert warm == pytest.approx(list(UsdLux.BlackbodyTemperatureAsRgb(3000)), rel=1e-5)
    assert load(tmp_path, CAMERA + text % "false")["/Lamp.emitter.radiance"]["value"] == [1, 1, 1]


def test_points(tmp_path: Path) -> None:
    """A point has the intensity of the sphere, radiance times the area of its disk."""
    text = f'def SphereLight "Lamp" {{ {PLACE}\nfloat inputs:radius = 0.25\nbool inputs:treatAsPoint = true\n' \
        'float inputs:intensity = 8\nbool inputs:normalize = %s }'
    xml = '<emitter type="point"><point name="position" x="0.5" y="0.25" z="2"/><rgb name="intensity" value="{0}, {0}, {0}"/></emitter>'
    expect_same(lights(tmp_path, text % "false"), image_of_xml(FLOOR_XML + xml.format(8 * math.pi * 0.25)))
    expect_same(lights(tmp_path, text % "true"), image_of_xml(FLOOR_XML + xml.format(8 / 4)))


@pytest.mark.parametrize("inputs, irradiance", [
    ("bool inputs:normalize = true", 4),
    ("float inputs:angle = 0", 4),
    ("float inputs:angle = 0.5", 4 * math.pi * math.sin(math.radians(0.25))**2),
])
def test_distant_lights(tmp_path: Path, inputs: str, irradiance: float) -> None:
    text = f'def DistantLight "Sun" {{ {PLACE}\nfloat inputs:intensity = 4\n{inputs} }}'
    xml = f'<emitter type="directional"><rgb name="irradiance" value="{irradiance}, {irradiance}, {irradiance}"/>' \
        f'<transform name="to_world">{TURN}<rotate x="1" angle="20"/><rotate y="1" angle="30"/></transform></emitter>'
    expect_same(lights(tmp_path, text), image_of_xml(FLOOR_XML + xml))


def test_a_wide_sun_is_a_warning(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="/Sun: light from a distance is parallel: the angle of 5 degrees"):
        et.load(write(tmp_path, CAMERA + 'def DistantLight "Sun" { float inputs:angle = 5 }'))


def spot(folder: Path) -> np.ndarray:
    """The image of a disk behind a cone."""
    return lights(folder, f'def SphereLight "Lamp" {{ {PLACE}\nfloat inputs:radius = 0.25\nbool inputs:treatAsPoint = true\n'
                  'float inputs:intensity = 8\nfloat inputs:shaping:cone:angle = 30\nfloat inputs:shaping:cone:softness = 0.25 }')


def test_cones_are_spots(tmp_path: Path) -> None:
    xml = f'<emitter type="spot"><transform name="to_world">{TURN}<rotate x="1" angle="20"/><rotate y="1" angle="30"/>' \
        '<translate x="0.5" y="0.25" z="2"/></transform><float name="cutoff_angle" value="30"/>' \
        '<float name="beam_width" value="22.5"/><string name="falloff" value="smooth"/>' \
        f'<rgb name="intensity" value="{8 * math.pi * 0.25}"/></emitter>'
    expect_same(spot(tmp_path), image_of_xml(FLOOR_XML + xml))
    with pytest.warns(UserWarning, match="/Lamp: a light with a shaping cone is a spot light of no size"):
        et.load(write(tmp_path, CAMERA + 'def DiskLight "Lamp" { float inputs:shaping:cone:angle = 30 }'))


def test_ies_profiles_are_refused(tmp_path: Path) -> None:
    file = write(tmp_path, CAMERA + 'def SphereLight "Lamp" { asset inputs:shaping:ies:file = @lamp.ies@ }')
    message = "/Lamp: IES profiles (lamp.ies) are not supported"
    with pytest.raises(et.SceneError, match=re.escape(message)):
        et.load(file)
    with pytest.warns(UserWarning, match=re.escape(message)):
        assert et.load(file, lenient=True)["/Lamp"]["type"] == "sphere"


def sky(folder: Path) -> Path:
    """An environment with a bright spot a quarter of the width from the left, a little above the horizon."""
    pixels = np.full((16, 32, 3), 0.1, np.float32)
    pixels[6, 8] = (200, 100, 50)
    et.write_image(folder / "sky.exr", pixels)
    return folder / "sky.exr"


def test_domes(tmp_path: Path) -> None:
    sky(tmp_path)
    plain = 'def DomeLight "Sky" { float inputs:intensity = 0.5\ncolor3f inputs:color = (1, 0.5, 1) }'
    expect_same(lights(tmp_path, plain),
                image_of_xml(FLOOR_XML + '<emitter type="constant"><rgb name="radiance" value="0.5, 0.25, 0.5"/></emitter>'))
    ball = 'def Sphere "Ball" { color3f[] primvars:displayColor = [(0.5, 0.5, 0.5)] }'
    text = 'def DomeLight "Sky" { asset inputs:texture:file = @sky.exr@\nfloat inputs:exposure = 1\n' \
        'token inputs:texture:format = "latlong"\nfloat xformOp:rotateY = 40\n' \
        'uniform token[] xformOpOrder = ["xformOp:rotateY"] }'
    xml = f'<emitter type="envmap"><string name="filename" value="{tmp_path}/sky.exr"/><float name="scale" value="2"/>' \
        '<transform name="to_world"><rotate y="1" angle="40"/></transform></emitter><shape type="sphere">' \
        '<bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>'
    expect_same(image(load(tmp_path, CAMERA + text + ball)), image_of_xml(xml))


def test_domes_are_turned_as_openexr_says(tmp_path: Path) -> None:
    """Longitude π/2, a quarter of the width from the left, points in the positive x direction."""
    sky(tmp_path)
    ball = 'def Sphere "Ball" { color3f[] primvars:displayColor = [(1, 1, 1)] }'
    dome = 'def %s "Sky" { asset inputs:texture:file = @sky.exr@\n%s }'
    pixels = image(load(tmp_path, CAMERA + ball + dome % ("DomeLight", "")), 64)[..., 0]
    assert pixels[:, 8:].sum() > 3 * pixels[:, :8].sum()
    # With its pole along +z, longitude π/2 stays +x, and the spot above the horizon moves from +y to +z, toward the camera.
    turned = image(load(tmp_path, CAMERA + ball + dome % ("DomeLight_1", 'uniform token poleAxis = "Z"')), 64)[..., 0]
    assert turned[:, 8:].sum() > 3 * turned[:, :8].sum()
    upper, lower = turned[:6].sum(), turned[6:].sum()
    assert upper == pytest.approx(lower, rel=0.15) and pixels[:6].sum() > 1.3 * pixels[6:].sum()


def test_other_dome_formats_are_refused(tmp_path: Path) -> None:
    sky(tmp_path)
    text = CAMERA + 'def DomeLight "Sky" { asset inputs:texture:file = @sky.exr@\ntoken inputs:texture:format = "angular" }'
    with pytest.raises(et.SceneError, match='/Sky: a dome whose texture has the format "angular" is not supported'):
        load(tmp_path, text)


def test_textures_of_rectangles_are_upright_from_the_front(tmp_path: Path) -> None:
    pixels = np.zeros((2, 2, 3), np.float32)
    pixels[0, 0], pixels[0, 1], pixels[1, 0] = (1, 0, 0), (0, 1, 0), (0, 0, 1)
    et.write_image(tmp_path / "four.exr", pixels)
    # The camera, at +z, sees the front of a light that is turned by a half turn about y.
    d = load(tmp_path, CAMERA + """
        def RectLight "Lamp" { float inputs:width = 4
            float inputs:height = 3
            asset inputs:texture:file = @four.exr@
            float inputs:intensity = 2
            float xformOp:rotateY = 180
            uniform token[] xformOpOrder = ["xformOp:rotateY"] }
        """)
    seen = image(d)
    corners = [seen[1, 1], seen[1, -2], seen[-2, 1], seen[-2, -2]]
    assert np.allclose(corners, [[2, 0, 0], [0, 2, 0], [0, 0, 2], [0, 0, 0]], atol=0.02)


QUAD = """def Mesh "Panel" (prepend apiSchemas = ["MeshLightAPI", "MaterialBindingAPI"]) {
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 3, 2, 1]
    point3f[] points = [(-1, -1, 2), (1, -1, 2), (1, 1, 2), (-1, 1, 2)]
    uniform token subdivisionScheme = "none"
    float inputs:intensity = 2
    %s }
"""
QUAD_XML = '<shape type="rectangle"><transform name="to_world"><rotate y="1" angle="180"/><translate z="2"/></transform>'


def test_mesh_lights(tmp_path: Path) -> None:
    seen = image(load(tmp_path, CAMERA + FLOOR + QUAD % ""), 512)
    assert seen.mean() == pytest.approx(image_of_xml(FLOOR_XML + emitting(QUAD_XML, "2, 2, 2"), 512).mean(), rel=0.01)
    normalized = load(tmp_path, CAMERA + QUAD % "bool inputs:normalize = true")
    assert normalized["/Panel.emitter.radiance"]["value"] == pytest.approx([0.5] * 3)
    both = load(tmp_path, CAMERA + QUAD % "uniform bool doubleSided = true")
    assert both["/Panel.emitter.two_sided"] is True


def test_what_a_material_emits_tints_the_light_of_a_mesh(tmp_path: Path) -> None:
    material = """
        def Material "Glow" { token outputs:surface.connect = </Glow/S.outputs:surface>
            def Shader "S" { uniform token info:id = "UsdPreviewSurface"
                color3f inputs:emissiveColor = (1, 0.5, 0)
                token outputs:surface } }
        """
    bind = "rel material:binding = </Glow>\n"
    tinted = lights(tmp_path, material + QUAD % bind)
    expect_same(tinted[..., :2], lights(tmp_path, QUAD % "color3f inputs:color = (1, 0.5, 0)")[..., :2], 0.02)
    assert tinted[..., 2].max() == 0
    alone = load(tmp_path, CAMERA + material + QUAD % (bind + 'uniform token light:materialSyncMode = "independent"'))
    assert alone["/Panel.emitter.radiance"]["value"] == [2, 2, 2]


def test_what_has_no_effect_is_a_warning(tmp_path: Path) -> None:
    text = CAMERA + """
        def SphereLight "Lamp" { float inputs:diffuse = 0
            float inputs:shaping:focus = 2
            rel light:filters = </Filter>
            rel collection:lightLink:excludes = </Camera> }
        def GeometryLight "Old" {}
        def LightFilter "Filter" {}
        """
    with pytest.warns(UserWarning) as notes:
        et.load(write(tmp_path, text))
    assert {str(n.message).split(": ", 1)[1] for n in notes} == {
        "/Lamp: inputs:diffuse has no effect", "/Lamp: inputs:shaping:focus has no effect", "/Lamp: light filters have no effect",
        "/Lamp: light linking has no effect", "/Old: a GeometryLight is not supported, and is left out"}


def test_sizes_must_not_be_negative(tmp_path: Path) -> None:
    with pytest.raises(et.SceneError, match="scene.usda: /Lamp: inputs:radius is -1.0, but must not be negative"):
        load(tmp_path, CAMERA + 'def SphereLight "Lamp" { float inputs:radius = -1 }')
