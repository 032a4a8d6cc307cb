"""One scene as glTF, as a stage of USD and as XML of Mitsuba.

    python tests/python/format_scenes.py docs/figures/formats.png

writes the images of the three, and prints by how much they differ."""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from usd_stages import load

import etendue as et

# A room of 4 x 4 x 2.5 m with an emitting quad, a glossy box, a textured picture and a masked screen: positions, and what a
# quad looks like.
QUADS = {
    "floor": ([(-2, 0, 2), (2, 0, 2), (2, 0, -2), (-2, 0, -2)], "stone"),
    "ceiling": ([(-2, 2.5, -2), (2, 2.5, -2), (2, 2.5, 2), (-2, 2.5, 2)], "stone"),
    "back": ([(-2, 0, -2), (2, 0, -2), (2, 2.5, -2), (-2, 2.5, -2)], "metal"),
    "left": ([(-2, 0, 2), (-2, 0, -2), (-2, 2.5, -2), (-2, 2.5, 2)], "picture"),
    "right": ([(2, 0, -2), (2, 0, 2), (2, 2.5, 2), (2, 2.5, -2)], "stone"),
    "lamp": ([(-0.5, 2.4, -1), (0.5, 2.4, -1), (0.5, 2.4, 0), (-0.5, 2.4, 0)], "light"),
    "screen": ([(-1, 0.2, -0.5), (0.3, 0.2, -0.5), (0.3, 1.2, -0.5), (-1, 1.2, -0.5)], "veil"),
}
UVS = [(0, 0), (1, 0), (1, 1), (0, 1)]  # v points up, as in USD.
MATERIALS = {
    "stone": dict(color=(0.7, 0.6, 0.5), metallic=0.0, roughness=0.9),
    "metal": dict(color=(0.9, 0.7, 0.3), metallic=1.0, roughness=0.35),
    "picture": dict(color=(1, 1, 1), metallic=0.0, roughness=0.5, image="picture.png"),
    "light": dict(color=(0, 0, 0), metallic=0.0, roughness=1.0, emission=(8, 7, 6)),
    "veil": dict(color=(0.1, 0.3, 0.8), metallic=0.0, roughness=0.6, opacity=0.6),
}


def has_uvs(material: str) -> bool:
    """The reader of USD leaves texture coordinates out that no texture uses, and they decide the directions of tangents, by which
    the same random numbers mean others.
    """
    return "image" in MATERIALS[material]


def gltf(folder: Path) -> et.Description:
    data, views, accessors = b"", [], []

    def add(rows: list[tuple[float, ...]] | list[int], kind: str) -> int:
        nonlocal data
        array = np.array(rows, np.uint32 if kind == "SCALAR" else np.float32)
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        accessors.append({"bufferView": len(views) - 1, "componentType": 5125 if kind == "SCALAR" else 5126,
                          "count": len(rows), "type": kind})
        data += array.tobytes()
        return len(accessors) - 1

    materials = []
    for m in MATERIALS.values():
        made = {"pbrMetallicRoughness": {"baseColorFactor": [*m["color"], m.get("opacity", 1)], "metallicFactor": m["metallic"],
                                         "roughnessFactor": m["roughness"]}}
        if "image" in m:
            made["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
        if "emission" in m:
            made["emissiveFactor"] = [x / 8 for x in m["emission"]]
            made["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": 8}}
        if "opacity" in m:
            made["alphaMode"] = "BLEND"
        materials.append(made)
    names = list(MATERIALS)
    indices, uvs = add([0, 1, 2, 0, 2, 3], "SCALAR"), add([(u, 1 - v) for u, v in UVS], "VEC2")
    meshes = [{"primitives": [{"attributes": {"POSITION": add(p, "VEC3"), **({"TEXCOORD_0": uvs} if has_uvs(m) else {})},
                               "indices": indices, "material": names.index(m)}]} for p, m in QUADS.values()]
    (folder / "scene.bin").write_bytes(data)
    (folder / "scene.gltf").write_text(json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(len(meshes) + 1))}],
        "nodes": [{"mesh": i} for i in range(len(meshes))] + [{"camera": 0, "translation": [0, 1.2, 5]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 2 * np.arctan(0.3), "aspectRatio": 4 / 3, "znear": 0.1}}],
        "extensionsUsed": ["KHR_materials_emissive_strength"], "materials": materials, "meshes": meshes,
        "images": [{"uri": "picture.png"}], "textures": [{"source": 0}],
        "buffers": [{"uri": "scene.bin", "byteLength": len(data)}], "bufferViews": views, "accessors": accessors,
    }))
    return et.load(folder / "scene.gltf")


def usd(folder: Path) -> et.Description:
    text = """
        def Camera "Camera" {
            float focalLength = 50
            float horizontalAperture = 40
            float verticalAperture = 30
            double3 xformOp:translate = (0, 1.2, 5)
            uniform token[] xformOpOrder = ["xformOp:translate"]
        }
        """
    for name, m in MATERIALS.items():
        color = f'color3f inputs:diffuseColor = {m["color"]}'
        if "image" in m:
            color = f"color3f inputs:diffuseColor.connect = </{name}/Image.outputs:rgb>"
        text += f"""
        def Material "{name}" {{
            token outputs:surface.connect = </{name}/Surface.outputs:surface>
            def Shader "Surface" {{
                uniform token info:id = "UsdPreviewSurface"
                {color}
                float inputs:metallic = {m["metallic"]}
                float inputs:roughness = {m["roughness"]}
                color3f inputs:emissiveColor = {m.get("emission", (0, 0, 0))}
                float inputs:opacity = {m.get("opacity", 1)}
                token inputs:opacityMode = "presence"
                token outputs:surface
            }}
            def Shader "Image" {{
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @picture.png@
                token inputs:wrapS = "repeat"
                token inputs:wrapT = "repeat"
                float3 outputs:rgb
            }}
        }}
        """
    for name, (points, material) in QUADS.items():
        text += f"""
        def Mesh "{name}" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
            int[] faceVertexCounts = [4]
            int[] faceVertexIndices = [0, 1, 2, 3]
            point3f[] points = {points}
            texCoord2f[] primvars:st = {UVS} ( interpolation = "vertex" )
            uniform token subdivisionScheme = "none"
            rel material:binding = </{material}>
        }}
        """
    return load(folder, text)


def xml(folder: Path) -> et.Description:
    text = """<sensor type="perspective"><float name="fov" value="43.602818972703"/>
        <transform name="to_world"><lookat origin="0, 1.2, 5" target="0, 1.2, 0" up="0, 1, 0"/></transform></sensor>"""
    for name, m in MATERIALS.items():
        color = f'<rgb name="base_color" value="{", ".join(map(str, m["color"]))}"/>'
        if "image" in m:
            color = '<texture name="base_color" type="bitmap"><string name="filename" value="picture.png"/></texture>'
        surface = f"""<bsdf type="openpbr">{color}<float name="base_metalness" value="{m["metallic"]}"/>
            <float name="specular_roughness" value="{m["roughness"]}"/><float name="specular_ior" value="1.5"/></bsdf>"""
        inner = f'<bsdf type="twosided">{surface}</bsdf>'
        if "opacity" in m:
            inner = f'<bsdf type="mask"><float name="opacity" value="{m["opacity"]}"/>{inner}</bsdf>'
        text += inner.replace("<bsdf ", f'<bsdf id="{name}" ', 1)
    for name, (points, material) in QUADS.items():
        lines = [f"v {x} {y} {z}" for x, y, z in points] + [f"vt {u} {v}" for u, v in UVS]
        lines += ["f 1/1 2/2 3/3", "f 1/1 3/3 4/4"] if has_uvs(material) else ["f 1 2 3", "f 1 3 4"]
        (folder / f"{name}.obj").write_text("\n".join(lines))
        emission = MATERIALS[material].get("emission")
        emitter = f'<emitter type="area"><rgb name="radiance" value="{", ".join(map(str, emission))}"/></emitter>' if emission else ""
        text += f"""<shape type="obj"><string name="filename" value="{name}.obj"/><boolean name="face_normals" value="true"/>
            <ref id="{material}"/>{emitter}</shape>"""
    (folder / "scene.xml").write_text(f'<scene version="3.0.0">{text}</scene>')
    return et.load(folder / "scene.xml")


def images(folder: Path, resolution: tuple[int, int], spp: int) -> dict[str, NDArray[np.float32]]:
    """Of the three formats, with the same random numbers."""
    y, x = np.indices((16, 16))
    et.write_image(folder / "picture.png", np.stack([x * 16, y * 16, (x ^ y) * 16], -1).astype(np.uint8))
    return {name: et.render(make(folder).build(resolution=resolution), "path:max_depth=5", spp=spp, progress=False).image
            for name, make in {"glTF": gltf, "USD": usd, "XML": xml}.items()}


def main(figure: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        of = images(Path(folder), (240, 180), 256)
    exposed = [et.tonemap(image, exposure=0.5) for image in of.values()]
    et.write_image(figure, np.concatenate(exposed, axis=1))
    print("| format | mean (red, green, blue) | pixels that differ from glTF by more than 10⁻⁴ | largest difference |\n| --- | --- | --- | --- |")
    first = of["glTF"]
    for name, image in of.items():
        off = np.abs(image - first) > 1e-4 * (first.mean() + first)
        print(f"| {name} | {', '.join(f'{m:.5f}' for m in image.mean(axis=(0, 1)))} | {off.any(axis=2).mean():.2%} | {np.abs(image - first).max():.2g} |")


if __name__ == "__main__":
    main(sys.argv[1])
