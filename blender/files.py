"""Writes a description (see scene.py) to a folder: scene.xml of Mitsuba 3, meshes as PLY, and copies of its images."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

# The elements of plug-ins; all others are BSDFs.
_ELEMENTS = {
    "sensor": ("perspective", "thinlens", "orthographic"),
    "film": ("hdrfilm",),
    "rfilter": ("gaussian",),
    "sampler": ("independent",),
    "emitter": ("area", "point", "spot", "directional", "constant", "envmap", "sky"),
    "shape": ("ply", "sphere", "rectangle", "disk", "shapegroup", "instance"),
    "texture": ("bitmap", "scale", "mix", "checkerboard", "mesh_attribute"),
}
_ELEMENT_OF = {name: element for element, names in _ELEMENTS.items() for name in names}
_PROPERTIES = {"positions": ("x", "y", "z"), "normals": ("nx", "ny", "nz"), "uvs": ("u", "v"),
               "colors": ("r", "g", "b"), "alphas": ("a",)}


def write_scene(description: dict[str, Any], integrator: dict[str, Any], folder: Path) -> Path:
    """Writes scene.xml, with an integrator and its parameters, and the folders meshes and textures beside it."""
    writer = _Writer(folder)
    lines = [writer.element(key, value, "    ") for key, value in description.items() if key != "type"]
    file = folder / "scene.xml"
    suggestion = writer.element("integrator", integrator, "    ", "integrator")
    file.write_text('<scene version="3.0.0">\n' + "".join([suggestion, *lines]) + "</scene>\n", encoding="utf-8")
    return file


class _Writer:
    def __init__(self, folder: Path):
        self._folder = folder
        self._copies: dict[str, str] = {}
        self._meshes = 0

    def element(self, key: str, value: Any, indent: str, element: str = "") -> str:
        """The element of a parameter or an object; keys of objects in the scene itself are ids."""
        if not isinstance(value, dict):
            return indent + self._parameter(key, value)
        if value["type"] == "rgb":
            return f"{indent}<rgb name={quoteattr(key)} value={quoteattr(_numbers(value['value']))}/>\n"
        if value["type"] == "ref":
            return f"{indent}<ref id={quoteattr(value['id'])}/>\n"
        if value["type"] == "mesh":
            value = self._with_file(key, value)
        element = element or _ELEMENT_OF.get(value["type"], "bsdf")
        is_named = element == "texture" or len(indent) == 4 and key != element
        name = f" {'id' if len(indent) == 4 else 'name'}={quoteattr(key)}" if is_named else ""
        inner = "".join(self.element(k, v, indent + "    ") for k, v in value.items() if k != "type")
        return f"{indent}<{element} type={quoteattr(value['type'])}{name}>\n{inner}{indent}</{element}>\n"

    def _parameter(self, key: str, value: Any) -> str:
        name = quoteattr(key)
        if isinstance(value, bool):
            return f'<boolean name={name} value="{str(value).lower()}"/>\n'
        if isinstance(value, int):
            return f'<integer name={name} value="{value}"/>\n'
        if isinstance(value, float):
            return f'<float name={name} value="{value:.9g}"/>\n'
        if isinstance(value, str):
            text = self._copy(value) if key == "filename" and Path(value).is_absolute() else value
            return f"<string name={name} value={quoteattr(text)}/>\n"
        if isinstance(value, np.ndarray):
            return f'<transform name={name}><matrix value="{_numbers(value.ravel())}"/></transform>\n'
        return f'<vector name={name} value="{_numbers(value)}"/>\n'

    def _copy(self, source: str) -> str:
        """A copy of an image file in the folder textures, whose name is relative to the scene."""
        if source not in self._copies:
            name = f"textures/{len(self._copies)}-{Path(source).name}"
            (self._folder / "textures").mkdir(exist_ok=True)
            shutil.copyfile(source, self._folder / name)
            self._copies[source] = name
        return self._copies[source]

    def _with_file(self, key: str, shape: dict[str, Any]) -> dict[str, Any]:
        """The shape with a PLY file for its mesh."""
        name = f"meshes/{self._meshes}-{key}.ply"
        self._meshes += 1
        (self._folder / "meshes").mkdir(exist_ok=True)
        write_ply(self._folder / name, shape["mesh"])
        return {"type": "ply", "filename": name, **{k: v for k, v in shape.items() if k not in ("type", "mesh")}}


def _numbers(values: Any) -> str:
    return " ".join(f"{v:.9g}" for v in values)


def write_ply(file: Path, arrays: dict[str, np.ndarray]) -> None:
    """Writes a mesh as binary PLY, with normals, texture coordinates and colours of vertices."""
    names = [name for name in _PROPERTIES if name in arrays]
    rows = np.column_stack([arrays[name] for name in names]).astype("<f4")
    triangles = np.empty(len(arrays["triangles"]), dtype=[("count", "u1"), ("vertices", "<i4", 3)])
    triangles["count"], triangles["vertices"] = 3, arrays["triangles"]
    properties = "".join(f"property float {p}\n" for name in names for p in _PROPERTIES[name])
    header = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{properties}"
              f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n")
    with open(file, "wb") as out:
        out.write(header.encode("ascii"))
        out.write(rows.tobytes())
        out.write(triangles.tobytes())
