"""Materials of USD: UsdPreviewSurface and its textures, standard_surface and OpenPBR of MaterialX."""

import re
import subprocess
import sys
import warnings
import zlib
from pathlib import Path
from struct import pack

import numpy as np
import pytest

pytest.importorskip("pxr", reason="usd-core is not installed")

from usd_stages import CAMERA, FLOOR, expect_same, image, load, write

import etendue as et

SKY = 'def DomeLight "Sky" {}\n'
QUAD = """def Mesh "Quad" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-2, -1.5, 0), (2, -1.5, 0), (2, 1.5, 0), (-2, 1.5, 0)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "faceVarying" )
    texCoord2f[] primvars:st1 = [(0, 1), (1, 1), (1, 0), (0, 0)] ( interpolation = "vertex" )
    uniform token subdivisionScheme = "none"
    rel material:binding = </Paint>
}
"""


def material(inputs: str, nodes: str = "", shader: str = "UsdPreviewSurface", outputs: str = "outputs:surface") -> str:
    return QUAD + f"""def Material "Paint" {{ token {outputs}.connect = </Paint/Surface.outputs:out>
        def Shader "Surface" {{ uniform token info:id = "{shader}"
            {inputs}
            token outputs:out }}
        {nodes}
    }}
    """


def surface(folder: Path, inputs: str, nodes: str = "", **other: str) -> dict[str, object]:
    bsdf = load(folder, CAMERA + SKY + material(inputs, nodes, **other))["/Quad.bsdf"]
    while bsdf["type"] != "openpbr":
        bsdf = bsdf["bsdf"]
    return bsdf


def test_constants(tmp_path: Path) -> None:
    p = surface(tmp_path, """color3f inputs:diffuseColor = (0.1, 0.2, 0.3)
        float inputs:metallic = 0.25
        float inputs:roughness = 0.75
        float inputs:ior = 1.25
        float inputs:clearcoat = 0.5
        float inputs:clearcoatRoughness = 0.3""")
    assert p["base_color"]["value"] == pytest.approx([0.1, 0.2, 0.3])
    names = ("base_metalness", "specular_roughness", "specular_ior", "coat_weight", "coat_roughness", "coat_ior")
    assert [p[n] for n in names] == pytest.approx([0.25, 0.75, 1.25, 0.5, 0.3, 1.5])
    plain = surface(tmp_path, "")
    assert plain["base_color"]["value"] == pytest.approx([0.18] * 3) and plain["specular_roughness"] == 0.5 and plain["specular_ior"] == 1.5
    assert load(tmp_path, CAMERA + SKY + material(""))["/Quad.bsdf"]["type"] == "twosided"


def test_the_specular_workflow(tmp_path: Path) -> None:
    p = surface(tmp_path, "int inputs:useSpecularWorkflow = 1\ncolor3f inputs:specularColor = (0.9, 0.6, 0.3)")
    metal = p["base_metalness"]
    assert metal == {"type": "specular_to_metallic", "output": "metallic", **{n: metal[n] for n in ("diffuse", "specular")}}
    image(load(tmp_path, CAMERA + SKY + material("int inputs:useSpecularWorkflow = 1")))


def test_opacity(tmp_path: Path) -> None:
    def bsdf(inputs: str) -> dict[str, object]:
        return load(tmp_path, CAMERA + SKY + material(inputs))["/Quad.bsdf"]

    assert bsdf("float inputs:opacity = 0.25\nuniform token inputs:opacityMode = \"presence\"")["opacity"] == 0.25
    assert bsdf("float inputs:opacity = 0.25\nfloat inputs:opacityThreshold = 0.5")["opacity"] == 0
    assert bsdf("float inputs:opacity = 0.75\nfloat inputs:opacityThreshold = 0.5")["type"] == "twosided"
    pane = bsdf("float inputs:opacity = 0.25")
    assert (pane["type"], pane["weight"], pane["bsdf"]["type"]) == ("blendbsdf", 0.25, "thindielectric")


def test_emission(tmp_path: Path) -> None:
    seen = image(load(tmp_path, CAMERA + material("color3f inputs:emissiveColor = (2, 1, 0.5)")))
    assert np.median(seen, axis=(0, 1)) == pytest.approx([2, 1, 0.5], rel=1e-3)


# ---- Textures

READER = 'def Shader "Reader" { uniform token info:id = "UsdPrimvarReader_float2"\nstring inputs:varname = "%s"\nfloat2 outputs:result }'


def png(file: Path, rows: np.ndarray) -> None:
    """An 8-bit image: grey, or three channels."""
    height, width = rows.shape[:2]
    kind = 2 if rows.ndim == 3 else 0
    data = b"".join(b"\0" + row.tobytes() for row in rows.astype(np.uint8))

    def chunk(name: bytes, body: bytes) -> bytes:
        return pack(">I", len(body)) + name + body + pack(">I", zlib.crc32(name + body))

    file.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0)) +
                     chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b""))


FOUR = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [128, 128, 128]]])


def texture(inputs: str = "", file: str = "four.png", primvar: str = "st", more: str = "") -> str:
    return f"""def Shader "Image" {{ uniform token info:id = "UsdUVTexture"
        asset inputs:file = @{file}@
        float2 inputs:st.connect = </Paint/Reader.outputs:result>
        {inputs}
        float3 outputs:rgb
        float outputs:r
        float outputs:a }}
        {READER % primvar}
        {more}"""


PRODUCT = """def Shader "Product" { uniform token info:id = "ND_multiply_color3"
    color3f inputs:in1.connect = </Paint/Image.outputs:rgb>
    color3f inputs:in2 = (0, 0, 0)
    color3f outputs:out }"""
EMISSIVE = "color3f inputs:emissiveColor.connect = </Paint/Image.outputs:rgb>\ncolor3f inputs:diffuseColor = (0, 0, 0)"
GREY = ((128 / 255 + 0.055) / 1.055)**2.4


def corners(folder: Path, nodes: str) -> np.ndarray:
    """What the quarters of the quad emit, from the upper left one in rows."""
    png(folder / "four.png", FOUR)
    seen = image(load(folder, CAMERA + material(EMISSIVE, nodes)), 16, "path:max_depth=1")
    return np.array([[seen[2, 2], seen[2, -3]], [seen[-3, 2], seen[-3, -3]]])


@pytest.mark.parametrize("inputs, grey", [("", GREY), ('token inputs:sourceColorSpace = "sRGB"', GREY),
                                          ('token inputs:sourceColorSpace = "raw"', 128 / 255)])
def test_images_are_upright_and_srgb_by_default(tmp_path: Path, inputs: str, grey: float) -> None:
    clamp = '\ntoken inputs:wrapS = "clamp"\ntoken inputs:wrapT = "clamp"'
    expected = np.array(FOUR, float) / 255
    expected[1, 1] = grey
    assert corners(tmp_path, texture(inputs + clamp)) == pytest.approx(expected, abs=0.02)


def test_scale_wrapping_and_the_choice_of_coordinates(tmp_path: Path) -> None:
    clamp = 'token inputs:wrapS = "clamp"\ntoken inputs:wrapT = "clamp"\n'
    red = corners(tmp_path, texture(clamp + "float4 inputs:scale = (0.5, 1, 2, 1)"))
    assert red[0, 0] == pytest.approx([0.5, 0, 0], abs=0.02) and red[1, 0] == pytest.approx([0, 0, 2], abs=0.04)
    upside_down = corners(tmp_path, texture(clamp, primvar="st1"))
    assert upside_down[0, 0] == pytest.approx([0, 0, 1], abs=0.02)
    png(tmp_path / "four.png", FOUR)
    for mode, made in (("black", "zero"), ("useMetadata", "zero"), ("mirror", "mirror"), ("repeat", None)):
        d = load(tmp_path, CAMERA + SKY + material(EMISSIVE, texture(f'token inputs:wrapS = "{mode}"\ntoken inputs:wrapT = "clamp"')))
        bitmap = d["/Quad.emitter.radiance"]
        assert bitmap.get("wrap_mode") == made and bitmap["wrap_mode_v"] == "clamp"


def test_transform_2d(tmp_path: Path) -> None:
    """A quarter turn of the coordinates, counter-clockwise: (s, t) → (1 - t, s)."""
    transform = """def Shader "Transform" { uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </Paint/Reader.outputs:result>
        float inputs:rotation = 90
        float2 inputs:translation = (1, 0)
        float2 outputs:result }"""
    nodes = texture('token inputs:wrapS = "clamp"\ntoken inputs:wrapT = "clamp"', more=transform)
    nodes = nodes.replace("inputs:st.connect = </Paint/Reader", "inputs:st.connect = </Paint/Transform")
    seen = corners(tmp_path, nodes)
    # The lower left corner (0, 0) shows (1, 0), the lower right one of the image.
    assert seen[1, 0] == pytest.approx([GREY] * 3, abs=0.02) and seen[1, 1] == pytest.approx([0, 1, 0], abs=0.02)
    assert seen[0, 1] == pytest.approx([1, 0, 0], abs=0.02)


def test_single_channels(tmp_path: Path) -> None:
    png(tmp_path / "grey.png", np.array([[0, 128], [128, 255]]))
    nodes = texture("float4 inputs:scale = (0.5, 1, 1, 1)\nfloat4 inputs:bias = (0.25, 0, 0, 0)", file="grey.png")
    p = surface(tmp_path, "float inputs:roughness.connect = </Paint/Image.outputs:r>", nodes)
    assert (p["specular_roughness"]["type"], p["specular_roughness"]["value0"], p["specular_roughness"]["value1"]) == ("mix", 0.25, 0.75)
    assert p["specular_roughness"]["weight"]["raw"] is True and p["specular_roughness"]["weight"]["channel"] == "r"
    cut = load(tmp_path, CAMERA + SKY + material(
        "float inputs:opacity.connect = </Paint/Image.outputs:a>\nfloat inputs:opacityThreshold = 0.5", texture(file="grey.png")))
    assert cut["/Quad.bsdf.opacity"]["type"] == "threshold" and cut["/Quad.bsdf.opacity.value.channel"] == "opacity"


@pytest.mark.parametrize("scale, bias, ends", [(2, -1, (0, 1)), (-1, 0.5, (0.5, 0)), (-1, 0, (0, 0)), (-1, 1, None)])
def test_scales_and_biases_below_0(tmp_path: Path, scale: float, bias: float, ends: tuple[float, float] | None) -> None:
    png(tmp_path / "grey.png", np.array([[0, 128], [128, 255]]))
    nodes = texture(f"float4 inputs:scale = ({scale}, 1, 1, 1)\nfloat4 inputs:bias = ({bias}, 0, 0, 0)", file="grey.png")
    text = CAMERA + SKY + material("float inputs:roughness.connect = </Paint/Image.outputs:r>", nodes)
    if ends is None:
        d, ends = load(tmp_path, text), (1, 0)
    else:
        with pytest.warns(UserWarning, match=f"values below 0 are not clamped: they go from {ends[0]} for black to {ends[1]} for white"):
            d = et.load(write(tmp_path, text))
    p = d["/Quad.bsdf.bsdf.specular_roughness"]
    assert (p["type"], p["value0"], p["value1"]) == ("mix", *ends)
    image(d)


def test_negative_colours_are_black(tmp_path: Path) -> None:
    """Constants, factors of textures and strengths."""
    png(tmp_path / "four.png", FOUR)
    product = PRODUCT.replace("(0, 0, 0)", "(-1, 0.5, 1)")
    for inputs, nodes in (("color3f inputs:specular_color = (1, -1, 1)", ""),
                          ("color3f inputs:specular_color.connect = </Paint/Image.outputs:rgb>", "float4 inputs:scale = (-1, 1, 1, 1)"),
                          ("color3f inputs:specular_color.connect = </Paint/Product.outputs:out>", "")):
        image(load(tmp_path, CAMERA + SKY + material(inputs, texture(nodes, more=product), **OPEN_PBR)))
    for inputs in ("color3f inputs:emission_color = (1, -1, 1)\nfloat inputs:emission_luminance = 1", "float inputs:emission_luminance = -1"):
        image(load(tmp_path, CAMERA + SKY + material(inputs, **OPEN_PBR)))


def test_normal_maps(tmp_path: Path) -> None:
    png(tmp_path / "normal.png", np.full((2, 2, 3), [128, 128, 255]))
    connect = "normal3f inputs:normal.connect = </Paint/Image.outputs:rgb>"
    standard = 'float4 inputs:scale = (2, 2, 2, 1)\nfloat4 inputs:bias = (-1, -1, -1, 0)\ntoken inputs:sourceColorSpace = "raw"'
    d = load(tmp_path, CAMERA + SKY + material(connect, texture(standard, file="normal.png")))
    assert d["/Quad.bsdf.bsdf"]["type"] == "normalmap" and d["/Quad.bsdf.bsdf.normalmap.raw"] is True
    half = standard.replace("(2, 2, 2, 1)", "(1, 1, 2, 1)").replace("(-1, -1, -1, 0)", "(-0.5, -0.5, -1, 0)")
    d = load(tmp_path, CAMERA + SKY + material(connect, texture(half, file="normal.png")))
    assert d["/Quad.bsdf.bsdf.scale"] == 0.5
    with pytest.warns(UserWarning, match=r"/Paint/Image: normals with the scale \(1.0, 1.0, 1.0, 1.0\)"):
        et.load(write(tmp_path, CAMERA + SKY + material(connect, texture(file="normal.png"))))


def test_primvars_as_colours(tmp_path: Path) -> None:
    reader = 'def Shader "Color" { uniform token info:id = "UsdPrimvarReader_float3"\nstring inputs:varname = "tint"\nfloat3 outputs:result }'
    text = material("color3f inputs:emissiveColor.connect = </Paint/Color.outputs:result>", reader)
    text = text.replace("rel material", 'color3f[] primvars:tint = [(1, 0, 0), (0, 1, 0), (0, 1, 0), (1, 0, 0)] '
                        '( interpolation = "vertex" )\n    rel material', 1)
    seen = image(load(tmp_path, CAMERA + text), 16, "path:max_depth=1")
    assert seen[6, 2, 0] > 0.7 and seen[6, -3, 1] > 0.7


def test_interfaces_of_graphs(tmp_path: Path) -> None:
    text = material("color3f inputs:diffuseColor.connect = </Paint.inputs:tint>")
    text = text.replace('def Material "Paint" {', 'def Material "Paint" { color3f inputs:tint = (0.5, 0.25, 0.125)\n', 1)
    assert load(tmp_path, CAMERA + SKY + text)["/Quad.bsdf.bsdf.base_color"]["value"] == [0.5, 0.25, 0.125]


def test_packages_hold_their_textures(tmp_path: Path) -> None:
    from pxr import UsdUtils
    png(tmp_path / "four.png", FOUR)
    et.write_image(tmp_path / "sky.exr", np.full((4, 8, 3), 0.5, np.float32))
    dome = 'def DomeLight "Dome" { asset inputs:texture:file = @sky.exr@ }\n'
    file = write(tmp_path, CAMERA + dome + material(EMISSIVE, texture()))
    assert UsdUtils.CreateNewUsdzPackage(str(file), str(tmp_path / "scene.usdz"))
    packed = et.load(tmp_path / "scene.usdz")
    assert packed["/Quad.emitter.radiance"]["image"]["bytes"].startswith(b"\x89PNG")
    expect_same(image(packed), image(et.load(file)), 1e-6)


def test_domes_of_packages_become_files(tmp_path: Path) -> None:
    """A description keeps the image of a dome, and so does the XML that another process has made of the package."""
    from pxr import UsdUtils
    pixels = np.full((8, 16, 3), 0.1, np.float32)
    pixels[2, 3] = (40, 20, 10)
    et.write_image(tmp_path / "sky.exr", pixels)
    text = 'def DomeLight "Dome" { asset inputs:texture:file = @sky.exr@\ncolor3f inputs:color = (1, 0.5, 0.25) }\n'
    file = write(tmp_path, CAMERA + text + FLOOR)
    assert UsdUtils.CreateNewUsdzPackage(str(file), str(tmp_path / "scene.usdz"))
    expected = image(et.load(file))
    packed = et.load(tmp_path / "scene.usdz")
    assert packed["/Dome.image"]["bytes"] == (tmp_path / "sky.exr").read_bytes()
    expect_same(image(packed), expected, 1e-6)
    expect_same(image(et.load_dict(packed.to_dict())), expected, 1e-6)
    for target in ("scene.xml", "plain.xml"):
        (tmp_path / "out").mkdir(exist_ok=True)
        if target == "scene.xml":
            subprocess.run([sys.executable, "-m", "etendue.usd", tmp_path / "scene.usdz", tmp_path / "out" / target], check=True)
        else:
            packed.save(tmp_path / "out" / target, mitsuba=True)
        expect_same(image(et.load(tmp_path / "out" / target)), expected, 1e-5)
    assert list((tmp_path / "out" / "scene_files").glob("*.exr"))


def test_missing_images_are_warnings(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="/Paint/Image: there is no image none.png"):
        et.load(write(tmp_path, CAMERA + SKY + material(EMISSIVE, texture(file="none.png"))))
    tiles = write(tmp_path, CAMERA + SKY + material(EMISSIVE, texture(file="four.<UDIM>.png")))
    with pytest.raises(et.SceneError, match=re.escape("/Paint/Image: tiles of images (four.<UDIM>.png) are not supported")):
        et.load(tiles)


def test_unknown_shaders_are_warnings(tmp_path: Path) -> None:
    with pytest.warns(UserWarning) as notes:
        et.load(write(tmp_path, CAMERA + SKY + material("", shader="PxrSurface")))
    assert [str(n.message).split(": ", 1)[1] for n in notes] == [
        '/Paint/Surface: the shader "PxrSurface" is not supported',
        "/Paint: has no surface that is supported: the displayColor is used"]
    with pytest.warns(UserWarning, match='/Paint/Noise: the node "ND_noise3d_float" is not supported'):
        et.load(write(tmp_path, CAMERA + SKY + material(
            "float inputs:roughness.connect = </Paint/Noise.outputs:out>",
            'def Shader "Noise" { uniform token info:id = "ND_noise3d_float"\nfloat outputs:out }')))
    with pytest.warns(UserWarning, match="/Paint/Surface: inputs:displacement has no effect"):
        et.load(write(tmp_path, CAMERA + SKY + material("float inputs:displacement = 0.1")))


# ---- MaterialX

STANDARD = {"shader": "ND_standard_surface_surfaceshader", "outputs": "outputs:mtlx:surface"}
OPEN_PBR = {"shader": "ND_open_pbr_surface_surfaceshader", "outputs": "outputs:mtlx:surface"}


def test_standard_surface(tmp_path: Path) -> None:
    p = surface(tmp_path, """float inputs:base = 0.5
        color3f inputs:base_color = (0.8, 0.4, 0.2)
        float inputs:metalness = 0.25
        float inputs:specular_roughness = 0.3
        float inputs:specular_IOR = 1.4
        float inputs:coat = 1
        float inputs:sheen = 0.5""", **STANDARD)
    assert p["base_color"]["value"] == pytest.approx([0.4, 0.2, 0.1])
    names = ("base_metalness", "specular_roughness", "specular_ior", "coat_weight", "coat_ior", "fuzz_weight", "fuzz_roughness")
    assert [p[n] for n in names] == pytest.approx([0.25, 0.3, 1.4, 1, 1.5, 0.5, 0.3])
    glass = load(tmp_path, CAMERA + SKY + material(
        "float inputs:transmission = 1\ncolor3f inputs:transmission_color = (0.5, 1, 0.5)", **STANDARD))["/Quad.bsdf"]
    assert (glass["type"], glass["transmission_weight"], glass["transmission_color"]["value"]) == ("openpbr", 1, [0.5, 1, 0.5])
    below = surface(tmp_path, """color3f inputs:base_color = (1, 0, 0)
        float inputs:subsurface = 0.25
        color3f inputs:subsurface_color = (0, 1, 0)
        color3f inputs:coat_color = (0.5, 1, 1)
        float inputs:coat = 1""", **STANDARD)
    assert below["base_color"]["value"] == pytest.approx([0.75, 0.25, 0]) and below["coat_color"]["value"] == [0.5, 1, 1]
    lamp = load(tmp_path, CAMERA + material("float inputs:emission = 3\ncolor3f inputs:emission_color = (1, 0.5, 0)", **STANDARD))
    assert lamp["/Quad.emitter.radiance"]["value"] == [3, 1.5, 0]


@pytest.mark.parametrize("model, coat, cloth, rough", [
    (STANDARD, "coat", "sheen", "diffuse_roughness"), (OPEN_PBR, "coat_weight", "fuzz_weight", "base_diffuse_roughness")])
def test_textures_of_layers(tmp_path: Path, capfd: pytest.CaptureFixture[str], model: dict[str, str], coat: str, cloth: str,
                            rough: str) -> None:
    png(tmp_path / "four.png", FOUR)
    names = [f"{layer.removesuffix('_weight')}_{end}" for layer in (coat, cloth) for end in ("color", "roughness")]
    inputs = f"float inputs:{coat} = 1\nfloat inputs:{cloth} = 1\n" + "".join(
        f"{'color3f' if n.endswith('color') else 'float'} inputs:{n}.connect = </Paint/Image.outputs:{'rgb' if n.endswith('color') else 'r'}>\n"
        for n in (*names, rough))
    p = surface(tmp_path, inputs, texture('token inputs:sourceColorSpace = "raw"'), **model)
    assert [p[n]["type"] for n in ("coat_color", "coat_roughness", "fuzz_color", "fuzz_roughness", "base_diffuse_roughness")] == ["bitmap"] * 5
    assert p["coat_roughness"]["channel"] == "r" and p["coat_roughness"]["raw"] is True and "channel" not in p["coat_color"]
    assert "no effect" not in "".join(capfd.readouterr())
    image(load(tmp_path, CAMERA + SKY + material(inputs, texture(), **model)))


def test_a_texture_of_the_roughness_of_a_preview_coat(tmp_path: Path) -> None:
    png(tmp_path / "grey.png", np.array([[0, 128], [128, 255]]))
    inputs = "float inputs:clearcoat = 1\nfloat inputs:clearcoatRoughness.connect = </Paint/Image.outputs:r>"
    assert surface(tmp_path, inputs, texture(file="grey.png"))["coat_roughness"]["type"] == "bitmap"


def test_what_a_coat_changes_below(tmp_path: Path) -> None:
    """OpenPBR's coat blurs and has an index relative to which that below it counts; others do so where they are told to."""
    names = ("coat_affect_ior", "coat_affect_roughness")
    preview = surface(tmp_path, "float inputs:clearcoat = 1\nfloat inputs:clearcoatRoughness = 0.5")
    standard = surface(tmp_path, "float inputs:coat = 1\nfloat inputs:coat_roughness = 0.5", **STANDARD)
    assert [[p[n] for n in names] for p in (preview, standard)] == [[0, 0]] * 2
    assert not any(n in surface(tmp_path, "float inputs:coat_weight = 1", **OPEN_PBR) for n in names)
    blurred = """float inputs:coat = 0.5
        float inputs:coat_affect_roughness = 0.25
        float inputs:specular_roughness = 0.2
        float inputs:coat_roughness"""
    p = surface(tmp_path, f"{blurred} = 0.4", **STANDARD)
    assert p["specular_roughness"] == pytest.approx(0.2 + 0.8 * 0.5 * 0.25 * 0.4) and p["coat_affect_roughness"] == 0
    png(tmp_path / "grey.png", np.array([[0, 128], [128, 255]]))
    text = CAMERA + SKY + material(f"{blurred}.connect = </Paint/Image.outputs:r>", texture(file="grey.png"), **STANDARD)
    rough = load(tmp_path, text)["/Quad.bsdf.bsdf.specular_roughness"]
    assert (rough["type"], rough["value0"], rough["value1"], rough["weight"]["scale"]) == ("mix", pytest.approx(0.2), 1, 0.125)
    image(load(tmp_path, text))


def test_the_specular_weight_leaves_the_index_of_glass(tmp_path: Path) -> None:
    inputs = "float inputs:transmission = 1\nfloat inputs:specular%s\ncolor3f inputs:specular_color = (1, 0.5, 2)"
    glass = load(tmp_path, CAMERA + SKY + material(inputs % " = 0.25", **STANDARD))["/Quad.bsdf"]
    assert "specular_weight" not in glass and glass["specular_color"]["value"] == pytest.approx([0.25, 0.125, 0.5])
    png(tmp_path / "grey.png", np.array([[0, 128], [128, 255]]))
    text = CAMERA + SKY + material(inputs % ".connect = </Paint/Image.outputs:r>", texture(file="grey.png"), **STANDARD)
    textured = load(tmp_path, text)["/Quad.bsdf"]
    assert "specular_weight" not in textured and textured["specular_color"]["scale"]["type"] == "bitmap"
    image(load(tmp_path, text))


def notes_of(folder: Path, inputs: str, nodes: str = "", **model: str) -> list[str]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return [str(w).split("/Paint/Surface: ")[1] for w in et.load(write(folder, CAMERA + SKY + material(inputs, nodes, **model))).warnings]


@pytest.mark.parametrize("model, weight, prefix", [(STANDARD, "coat", ""), (OPEN_PBR, "coat_weight", "geometry_")])
def test_normals_of_coats(tmp_path: Path, model: dict[str, str], weight: str, prefix: str) -> None:
    png(tmp_path / "normal.png", np.full((2, 2, 3), [128, 128, 255]))
    standard = 'float4 inputs:scale = (2, 2, 2, 1)\nfloat4 inputs:bias = (-1, -1, -1, 0)\ntoken inputs:sourceColorSpace = "raw"'
    nodes = texture(standard, file="normal.png") + texture(standard, file="normal.png").replace('"Image"', '"Other"').split("def Shader \"Reader")[0]
    coat, below, own, other = f"float inputs:{weight} = 1\n", *(
        f"float3 inputs:{prefix}{name}.connect = </Paint/{node}.outputs:rgb>\n"
        for name, node in (("normal", "Image"), ("coat_normal", "Image"), ("coat_normal", "Other")))
    shared, lost = f"the coat has the normals of inputs:{prefix}normal, too", f"inputs:{prefix}coat_normal has no effect"
    for inputs, expected in ((coat, []), (below, []), (own, []), (coat + below, [shared]), (coat + own, [lost]),
                             (coat + below + own, []), (coat + below + other, [lost, shared])):
        assert notes_of(tmp_path, inputs, nodes, **model) == expected, inputs


def test_inputs_of_layers_without_effect(tmp_path: Path) -> None:
    assert notes_of(tmp_path, "float inputs:specular_rotation = 0.25", **STANDARD) == ["inputs:specular_rotation has no effect"]
    for model, weight, names in (
            (STANDARD, "coat", ("coat_affect_color", "coat_rotation")), (STANDARD, "subsurface", ("subsurface_scale", )),
            (OPEN_PBR, "subsurface_weight", ("subsurface_radius", )), (OPEN_PBR, "coat_weight", ("coat_darkening", ))):
        inputs = "".join(f"float inputs:{name} = 0.25\n" for name in names)
        assert notes_of(tmp_path, inputs, **model) == []
        assert sorted(notes_of(tmp_path, inputs + f"float inputs:{weight} = 1", **model)) == [f"inputs:{n} has no effect" for n in names]


def test_open_pbr(tmp_path: Path) -> None:
    p = surface(tmp_path, "float inputs:base_metalness = 1\nfloat inputs:specular_weight = 0.5\nfloat inputs:coat_weight = 0.25",
                   **OPEN_PBR)
    names = ("base_metalness", "specular_weight", "coat_weight", "coat_ior", "specular_roughness")
    assert [p[n] for n in names] == pytest.approx([1, 0.5, 0.25, 1.6, 0.3])
    metal = surface(tmp_path, """color3f inputs:base_color = (1, 0, 0)
        float inputs:base_metalness = 1
        float inputs:subsurface_weight = 1""", **OPEN_PBR)
    assert metal["base_color"]["value"] == [1, 0, 0]
    bubble = surface(tmp_path, "float inputs:specular_ior = 0.75\nfloat inputs:specular_weight = 2", **OPEN_PBR)
    assert (bubble["specular_ior"], bubble["specular_weight"]) == (0.75, 2)
    thin = load(tmp_path, CAMERA + SKY + material("float inputs:transmission_weight = 1\nbool inputs:geometry_thin_walled = 1", **OPEN_PBR))
    assert thin["/Quad.bsdf.thin_walled"] is True
    image(thin)
    cut = load(tmp_path, CAMERA + SKY + material("float inputs:geometry_opacity = 0.5", **OPEN_PBR))
    assert cut["/Quad.bsdf.opacity"] == 0.5
    image(cut)


def test_colours_above_1_are_clamped(tmp_path: Path) -> None:
    bright = "(2, 0.5, -1)"
    stage = CAMERA + SKY + material(f"color3f inputs:diffuseColor = {bright}")
    image(load(tmp_path, stage))
    assert surface(tmp_path, f"color3f inputs:diffuseColor = {bright}")["base_color"]["value"] == [1, 0.5, 0]
    for model, prefix, cloth in ((STANDARD, "", "sheen"), (OPEN_PBR, "_weight", "fuzz")):
        inputs = f"float inputs:base{prefix} = 1\n" + "".join(
            f"float inputs:{name}{prefix} = 0.5\ncolor3f inputs:{name}_color = {bright}\n" for name in ("transmission", "coat", cloth))
        inputs += f"color3f inputs:base_color = {bright}"
        made = load(tmp_path, CAMERA + SKY + material(inputs, **model))
        for name in ("base_color", "transmission_color", "coat_color", "fuzz_color"):
            assert made["/Quad.bsdf"][name]["value"] == [1, 0.5, 0], name
        image(made)
    opaque = load(tmp_path, CAMERA + SKY + material("color3f inputs:opacity = (2, 2, 2)", **STANDARD))
    assert opaque["/Quad.bsdf"]["type"] == "twosided"


@pytest.mark.parametrize("strength, scale, node", [(0, 1, "Image.outputs:rgb"), (1, 0, "Image.outputs:rgb"), (1, 1, "Product.outputs:out")])
@pytest.mark.parametrize("model, name", [(STANDARD, "emission"), (OPEN_PBR, "emission_luminance")])
def test_textures_that_emit_nothing_are_no_lights(tmp_path: Path, model: dict[str, str], name: str, strength: int, scale: int,
                                                  node: str) -> None:
    """Such a stage is seen in the white environment of those without lights."""
    png(tmp_path / "four.png", FOUR)
    inputs = f"color3f inputs:emission_color.connect = </Paint/{node}>\nfloat inputs:{name} = {strength}"
    nodes = texture(f"float4 inputs:scale = ({scale}, {scale}, {scale}, 1)", more=PRODUCT)
    with pytest.warns(UserWarning, match="there is no light: a white environment is added"):
        d = et.load(write(tmp_path, CAMERA + material(inputs, nodes, **model)))
    assert "emitter" not in d["/Quad"] and image(d).mean() > 0.1


def test_nodes_of_materialx(tmp_path: Path) -> None:
    png(tmp_path / "four.png", FOUR)
    nodes = """def Shader "Image" { uniform token info:id = "ND_tiledimage_color3"
            asset inputs:file = @four.png@ ( colorSpace = "srgb_texture" )
            float2 inputs:uvtiling = (2, 3)
            color3f outputs:out }
        def Shader "Product" { uniform token info:id = "ND_multiply_color3"
            color3f inputs:in1.connect = </Paint/Image.outputs:out>
            color3f inputs:in2 = (0.5, 1, 1)
            color3f outputs:out }"""
    p = surface(tmp_path, "color3f inputs:base_color.connect = </Paint/Product.outputs:out>", nodes, **STANDARD)
    assert p["base_color"]["type"] == "scale" and p["base_color"]["scale"]["value"] == [0.5, 1, 1]
    bitmap = p["base_color"]["value"]
    assert "raw" not in bitmap and np.diag(bitmap["to_uv"])[:2] == pytest.approx([2, 3])
    image(load(tmp_path, CAMERA + SKY + material("color3f inputs:base_color.connect = </Paint/Product.outputs:out>", nodes, **STANDARD)))


DOCUMENT = """<?xml version="1.0"?>
<materialx version="1.38" colorspace="lin_rec709">
  <nodegraph name="NG_Paint">
    <input name="tint" type="color3" value="0.5, 1, 1"/>
    <tiledimage name="picture" type="color3">
      <input name="file" type="filename" value="four.png" colorspace="srgb_texture"/>
      <input name="uvtiling" type="vector2" value="2, 3"/>
    </tiledimage>
    <multiply name="product" type="color3">
      <input name="in1" type="color3" nodename="picture"/>
      <input name="in2" type="color3" interfacename="tint"/>
    </multiply>
    <output name="out" type="color3" nodename="product"/>
  </nodegraph>
  <standard_surface name="SR_Paint" type="surfaceshader">
    <input name="base" type="float" value="1"/>
    <input name="base_color" type="color3" nodegraph="NG_Paint" output="out"/>
    <input name="specular_roughness" type="float" value="0.4"/>
  </standard_surface>
  <surfacematerial name="Paint" type="material"><input name="surfaceshader" type="surfaceshader" nodename="SR_Paint"/></surfacematerial>
  <open_pbr_surface name="SR_Gold" type="surfaceshader">
    <input name="base_color" type="color3" value="0.735, 0.5, 0" colorspace="srgb_texture"/>
    <input name="base_metalness" type="float" value="1"/>
  </open_pbr_surface>
  <surfacematerial name="Gold" type="material"><input name="surfaceshader" type="surfaceshader" nodename="SR_Gold"/></surfacematerial>
</materialx>
"""
REFERRING = """def Scope "Looks" (references = @looks/looks.mtlx@</MaterialX>) {}
    def Mesh "Quad" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "vertex" )
        uniform token subdivisionScheme = "none"
        rel material:binding = </Looks/Materials/%s>
    }
    """


def test_documents_of_materialx(tmp_path: Path) -> None:
    """References to documents are those of USD's plug-in, and their nodes those of stages."""
    (tmp_path / "looks").mkdir()
    png(tmp_path / "looks" / "four.png", FOUR)
    (tmp_path / "looks" / "looks.mtlx").write_text(DOCUMENT)
    paint = load(tmp_path, CAMERA + SKY + REFERRING % "Paint")
    p = paint["/Looks/Materials/Paint.bsdf"]
    assert p["type"] == "openpbr" and p["specular_roughness"] == pytest.approx(0.4)
    assert p["base_color"]["type"] == "scale" and p["base_color"]["scale"]["value"] == [0.5, 1, 1]
    bitmap = p["base_color"]["value"]
    assert "raw" not in bitmap and np.diag(bitmap["to_uv"])[:2] == pytest.approx([2, 3])
    assert image(paint).mean() > 0.01
    gold = load(tmp_path, CAMERA + SKY + REFERRING % "Gold")["/Looks/Materials/Gold.bsdf"]
    assert gold["base_color"]["value"] == pytest.approx([0.4995, 0.2140, 0], abs=1e-3) and gold["base_metalness"] == 1


@pytest.mark.parametrize("change, message", [
    (("</materialx>", ""), "looks.mtlx: is not a MaterialX document: no element found"),
    (('nodename="product"', 'nodename="products"'), 'looks.mtlx: Paint: there is no node "products"'),
    (('nodegraph="NG_Paint"', 'nodegraph="NG"'), 'looks.mtlx: Paint: there is no output "out" of a graph "NG"'),
    (('interfacename="tint"', 'interfacename="hue"'), 'looks.mtlx: Paint: the graph "NG_Paint" has no input "hue"'),
    (('value="0.4"', 'value="rough"'), 'looks.mtlx: Paint: "rough" is no float'),
])
def test_bad_documents_of_materialx(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    (tmp_path / "looks").mkdir()
    (tmp_path / "looks" / "looks.mtlx").write_text(DOCUMENT.replace(*change))
    with pytest.raises(et.SceneError, match=message):
        load(tmp_path, CAMERA + SKY + REFERRING % "Paint")


def test_a_missing_document_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(et.SceneError, match="looks.mtlx"):
        load(tmp_path, CAMERA + SKY + REFERRING % "Paint")


def test_inputs_without_effect_are_warnings(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="/Paint/Surface: inputs:thin_film_thickness has no effect"):
        et.load(write(tmp_path, CAMERA + SKY + material("float inputs:thin_film_thickness = 300", **STANDARD)))
