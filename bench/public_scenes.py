"""The scenes of others with which etendue was tested: where they are from, and how to recognise the copies that were used."""

import dataclasses
import hashlib
import os
import pathlib

ROOT = pathlib.Path(__file__).resolve().parent.parent


@dataclasses.dataclass
class Scene:
    """`files` has (variant, scene file, beginning of its SHA-256). `changes` are those of the copies, relative to the sources."""

    name: str
    folder: str
    checksum: str  # of all files of the folder, see checksum_of_folder()
    files: list
    by: str
    licence: str
    sources: list
    changes: str

    def labels(self):
        """(name, scene file) of each variant."""
        name = self.name.split(", with")[0]
        return [(f"{name}, {variant}" if variant else name, file) for variant, file, _ in self.files]


SCENES = [
    Scene("barcelona-pavilion", "barcelona-pavilion-pbrt3", "223156405ff6dac1",
          [("", "pavilion-day.pbrt", "0b6ed339c687085e")],
          "Hamza Cheggour", "CC BY 2.0",
          ["https://github.com/disini/pbrt-v3-scenes/tree/17b3e49d82a2/barcelona-pavilion"],
          "another sky image; other trees; textures at most 512 wide"),
    Scene("bathroom", "bathroom-pbrt4", "af367367480d1eaf",
          [("", "bathroom.pbrt", "74a692d512425ce6")],
          "Mareck, *Contemporary Bathroom*", "CC0",
          ["https://github.com/w3ntao/pbrt-minus-scenes/tree/dd1132b5b91b/bathroom", "https://github.com/gonsolo/bitterli/tree/dc0bfae2c89c/bathroom"],
          "textures at most 1024 wide; the rug has one colour"),
    Scene("cbox-with-bulb", "cbox-with-bulb-mts06", "1ed369f5fe573a97",
          [("", "scene.xml", "4349fbff861b6c76")],
          "yysun997", "free for any purpose",
          ["https://github.com/yysun997/improved-path-guiding/tree/2e1eb38723a7/scenes/cbox_with_bulb"],
          "without a second ball of rough glass"),
    Scene("cornell-box, glTF", "cornell-box-gltf", "0e028162650ee969",
          [("", "cornellBox.gltf", "af832ef553def12d")],
          "NVIDIA", "Apache 2.0",
          ["https://github.com/nvpro-samples/vk_raytracing_tutorial_KHR/tree/98a790a531eb/media/scenes"],
          ""),
    Scene("cornell-box, Mitsuba 3", "cornell-box-mts3", "059051bfdc7df31d",
          [("", "scene_v3.xml", "e8dc759d48133da5")],
          "Benedikt Bitterli", "CC0",
          ["https://github.com/gonsolo/bitterli/tree/dc0bfae2c89c/cornell-box"],
          ""),
    Scene("cornell-box, with silver, with glass, smallpt", "cornell-box-specular-pbrt4", "3582ecfc79147248",
          [("", "cornell-box.pbrt", "83336324d7ec12bc"), ("with silver", "cornell-box-silver.pbrt", "20ba6a5442012461"), ("with glass", "cornell-box-specular.pbrt", "ddcd206771d6e621"), ("smallpt", "smallpt.pbrt", "5d39aa8361cd9540")],
          "w3ntao", "Apache 2.0",
          ["https://github.com/w3ntao/pbrt-minus-scenes/tree/dd1132b5b91b/cornell-box"],
          ""),
    Scene("glass-hurricane-candle", "glass-hurricane-candle-gltf", "24d63a4a9bc0129e",
          [("", "GlassHurricaneCandleHolder.gltf", "5f09c863e598d318")],
          "Eric Chadwick, © Wayfair LLC", "CC BY 4.0",
          ["https://github.com/DRx3D/glTF-Sample-Assets-OLD/tree/02d48689ce60/Models/GlassHurricaneCandleHolder/glTF"],
          "a texture at most 1024 wide"),
    Scene("gpu-instancing", "gpu-instancing-gltf", "f8f680bff251868a",
          [("", "24_gpu_instancing.gltf", "069d6e20748a7595")],
          "Khronos", "Apache 2.0",
          ["https://github.com/KhronosGroup/glTF-Blender-IO/tree/7551a35b146a/tests/roundtrip/24_gpu_instancing"],
          ""),
    Scene("lights-punctual-lamp", "lights-punctual-lamp-gltf", "ad3406684fc5ad83",
          [("", "LightsPunctualLamp.gltf", "282d05dfaf47e80b")],
          "DGG (Teresa González Viegas)", "CC BY 4.0",
          ["https://github.com/DRx3D/glTF-Sample-Assets-OLD/tree/02d48689ce60/Models/LightsPunctualLamp/glTF"],
          "a normal map at most 1024 wide"),
    Scene("living-room", "living-room-mts06", "aeefb10a5b404f2e",
          [("", "scene.xml", "618e117d9226e4a1")],
          "Wig42, *The Grey & White Room*", "CC BY 3.0",
          ["https://github.com/jgarciapueyo/mitsuba2-transient-scenes/tree/ab67c4caa922/living-room"],
          ""),
    Scene("sms-plane", "sms-plane-mts3", "4718bfba5aa4a863",
          [("", "plane.xml", "f08d6c5708d84858")],
          "Zeltner et al. 2020", "BSD, textures CC0",
          ["https://github.com/tizian/specular-manifold-sampling/tree/1f0e40342a87/results/Figure_14_15_MainComparison"],
          "integrator; another texture of the floor"),
    Scene("sms-ring", "sms-ring-mts3", "1d826d99ba8fe224",
          [("", "ring.xml", "6821b34785a6a39c")],
          "Zeltner et al. 2020", "BSD",
          ["https://github.com/tizian/specular-manifold-sampling/tree/1f0e40342a87/results/Figure_4_5_RingSolutions"],
          "integrator"),
    Scene("staircase2", "staircase2-mts3", "d1101323f38e4c00",
          [("", "scene.xml", "e8f279a67797a6c8"), ("principled floor", "scene_principled_floor.xml", "d5b80831294b9570")],
          "NewSee2l035, *Modern Hall*", "CC BY 3.0",
          ["https://github.com/niklassanden/ReSTIR_GI_DR/tree/4e71bd940e50/scenes/staircase2"],
          "the first one: the floor of the original"),
    Scene("tire", "tire-mts3", "5d031c78fbc60f90",
          [("", "scene.xml", "7beb9c521b093024")],
          "HorusZ, *Dirty Truck Tire*; laha_pictures, *Fairy lights*", "CC BY 4.0",
          ["https://github.com/niklassanden/ReSTIR_GI_DR/tree/4e71bd940e50/scenes/tire"],
          "another environment; textures at most 1024 wide"),
    Scene("transmission-roughness", "transmission-roughness-glb", "737ee63651893d04",
          [("", "TransmissionRoughnessTest.glb", "43ace8f8dfe0b614")],
          "Ed Mackey, © Analytical Graphics", "CC BY 4.0",
          ["https://github.com/DRx3D/glTF-Sample-Assets-OLD/tree/02d48689ce60/Models/TransmissionRoughnessTest/glTF-Binary"],
          ""),
    Scene("veach-ajar, Mitsuba 3", "veach-ajar-mts3", "40bde02875c211df",
          [("", "scene.xml", "fbd22b6aed8c0666")],
          "Benedikt Bitterli", "CC0",
          ["https://github.com/niklassanden/ReSTIR_GI_DR/tree/4e71bd940e50/scenes/veach-ajar"],
          "two meshes as PLY files"),
    Scene("veach-ajar, pbrt-v3", "veach-ajar-pbrt3", "4c0cbd8f9c51effe",
          [("", "scene.pbrt", "9afc72b86a6e9348")],
          "Benedikt Bitterli", "CC0",
          ["https://github.com/deadmarston/PORenderer/tree/b3146944051a/scenes/veach-ajar"],
          "integrator, sampler, size; smaller textures"),
    Scene("veach-ajar, pbrt-v4", "veach-ajar-pbrt4", "3a3c7300415392c2",
          [("", "scene-v4.pbrt", "a398de9373f57600")],
          "Benedikt Bitterli", "CC0",
          ["https://github.com/gonsolo/bitterli/tree/dc0bfae2c89c/veach-ajar/pbrt"],
          "formats of textures"),
    Scene("veach-bidir", "veach-bidir-mts3", "3f0d1a3c87a9a7c0",
          [("", "scene.xml", "5d0d438d4f72e07d")],
          "Benedikt Bitterli", "CC0",
          ["https://github.com/takkasila/practical_path_guiding_lab/tree/c4b6605b3c78/scenes/veach-bidir"],
          "integrator"),
    Scene("water-caustic", "water-caustic-pbrt4", "a5cfc45de72670bc",
          [("", "scene-v4.pbrt", "1c3bd8a0d4e57dcf")],
          "Benedikt Bitterli", "CC0",
          ["https://github.com/gonsolo/bitterli/tree/dc0bfae2c89c/water-caustic/pbrt"],
          ""),
]


def folder():
    """Where the folders of the scenes belong."""
    return pathlib.Path(os.environ.get("ETENDUE_SCENES", ROOT.parent / "shared/scenes"))


def checksum_of(file):
    return hashlib.sha256(file.read_bytes()).hexdigest()[:16]


def checksum_of_folder(path):
    """Of the names and contents of all files that a scene may read: without licences, notes and reference images."""
    total = hashlib.sha256()
    for file in sorted(path.rglob("*")):
        name = file.relative_to(path)
        if file.is_file() and not file.name.startswith(("README", "LICENSE")) and "reference" not in name.parts:
            total.update(f"{name.as_posix()}\0{hashlib.sha256(file.read_bytes()).hexdigest()}\n".encode())
    return total.hexdigest()[:16]


def table():
    """For the manual."""
    yield "| scene | by | source | licence | checksum | changes |\n| --- | --- | --- | --- | --- | --- |"
    for s in SCENES:
        sources = ", ".join(f"[{'/'.join(url.split('/')[3:5])}]({url})" for url in s.sources)
        sums = ", ".join(f"`{value}`" if not variant or "cornell" in s.name else f"{variant} `{value}`" for variant, _, value in s.files)
        yield f"| {s.name} | {s.by} | {sources} | {s.licence} | {sums} | {s.changes} |"
