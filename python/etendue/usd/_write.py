"""Writes a Description as XML of Mitsuba with its meshes and images in files: python -m etendue.usd scene.usd scene.xml."""

import os
from collections.abc import Mapping
from os import PathLike, fspath
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from .. import plugins
from .._etendue import Description

_SUFFIXES = {b"\x89PNG": ".png", b"\xff\xd8\xff": ".jpg", b"v/1\x01": ".exr", b"#?RA": ".hdr"}


def write_xml(description: Description, file: str | PathLike[str]) -> None:
    """Writes `file` and, beside it, the folder NAME_files with the meshes (PLY) and images that the description holds.

    Plug-ins and parameters keep their names, also those that Mitsuba does not have; `etendue convert` replaces these.
    """
    name = fspath(file)
    text = _Writer(name).scene(description.to_dict())
    with open(name, "w", encoding="utf-8") as f:
        f.write(text)


class _Writer:

    def __init__(self, file: str) -> None:
        self.parent = os.path.dirname(os.path.abspath(file))
        self.folder = os.path.splitext(os.path.basename(file))[0] + "_files"
        self.categories = {p["name"]: p["category"] for p in plugins()
                           if not p["category"].startswith("pbrt") and p["category"] not in ("integrator", "aov")}
        self.lines: list[str] = []

    def scene(self, d: Mapping[str, Any]) -> str:
        self.lines = ['<scene version="3.0.0">']
        for key, value in d.items():
            if key != "type":
                self._object(key, value, 1, is_root=True)
        return "\n".join([*self.lines, "</scene>", ""])

    def _line(self, depth: int, text: str) -> None:
        self.lines.append("    " * depth + text)

    def _object(self, key: str, d: Mapping[str, Any], depth: int, is_root: bool) -> None:
        if d["type"] == "ref":
            self._line(depth, f"<ref id={quoteattr(d['id'])}{self._name(key)}/>")
            return
        kind, tag = str(d["type"]), self.categories[str(d["type"])]
        named = f" id={quoteattr(key if is_root else d['id'])}" if is_root or "id" in d else ""
        embedded = {"mesh": "ply"}.get(kind, kind)
        self._line(depth, f'<{tag} type="{embedded}"{named}{"" if is_root else self._name(key)}>')
        for name, value in d.items():
            if name not in ("type", "id"):
                self._entry(name, value, depth + 1)
        self._line(depth, f"</{tag}>")

    def _name(self, key: str) -> str:
        """Keys such as shape_2 stand for objects without a name."""
        category = key.rstrip("0123456789").rstrip("_")
        return "" if category in set(self.categories.values()) else f" name={quoteattr(key)}"

    def _entry(self, name: str, value: Any, depth: int) -> None:
        if isinstance(value, Mapping):
            if "positions" in value:
                self._line(depth, f'<string name="filename" value={quoteattr(self._file(".ply", _ply(value)))}/>')
                if value.get("face_normals"):
                    self._line(depth, '<boolean name="face_normals" value="true"/>')
            elif "bytes" in value:
                name_of_file = self._file(_suffix(value), value["bytes"])
                self._line(depth, f'<string name="filename" value={quoteattr(name_of_file)}/>')
            elif value["type"] == "rgb":
                self._line(depth, f'<rgb name="{name}" value="{_numbers(value["value"])}"/>')
            else:
                self._object(name, value, depth, is_root=False)
        elif isinstance(value, bool):
            self._line(depth, f'<boolean name="{name}" value="{str(value).lower()}"/>')
        elif isinstance(value, int):
            self._line(depth, f'<integer name="{name}" value="{value}"/>')
        elif isinstance(value, float):
            self._line(depth, f'<float name="{name}" value="{value!r}"/>')
        elif isinstance(value, str):
            self._line(depth, f'<string name="{name}" value={quoteattr(value)}/>')
        elif len(value) == 3:
            self._line(depth, f'<vector name="{name}" value="{_numbers(value)}"/>')
        else:
            self._line(depth, f'<transform name="{name}"><matrix value="{_numbers(np.ravel(value))}"/></transform>')

    def _file(self, suffix: str, data: bytes) -> str:
        folder = os.path.join(self.parent, self.folder)
        os.makedirs(folder, exist_ok=True)
        number = sum(f'value="{self.folder}/' in line for line in self.lines)
        name = f"{number}{suffix}"
        with open(os.path.join(folder, name), "wb") as f:
            f.write(data)
        return f"{self.folder}/{name}"


def _suffix(image: Mapping[str, Any]) -> str:
    """Of the file of an image, by its first bytes."""
    for start, suffix in _SUFFIXES.items():
        if image["bytes"].startswith(start):
            return suffix
    return os.path.splitext(str(image["name"]))[1]


def _numbers(values: Any) -> str:
    return " ".join(repr(float(x)) for x in values)


def _ply(mesh: Mapping[str, Any]) -> bytes:
    """A binary PLY file of the arrays of a mesh."""
    names = {"positions": "x y z", "normals": "nx ny nz", "uvs": "u v", "second_uvs": "second_u second_v", "colors": "r g b",
             "alphas": "a"}
    columns = [(names[key], np.asarray(mesh[key], "<f4").reshape(len(mesh["positions"]), -1)) for key in names if key in mesh]
    triangles = np.asarray(mesh["triangles"], "<i4")
    properties = [f"property float {n}" for text, _ in columns for n in text.split()]
    head = "\n".join(["ply", "format binary_little_endian 1.0", f"element vertex {len(mesh['positions'])}", *properties,
                      f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header", ""])
    faces = np.zeros(len(triangles), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    faces["count"], faces["corners"] = 3, triangles
    return head.encode() + np.concatenate([c for _, c in columns], 1).tobytes() + faces.tobytes()
