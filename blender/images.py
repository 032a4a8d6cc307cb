"""Files of images: those on disk as they are, packed and generated ones written to a folder."""

from __future__ import annotations

import os
import re
import shutil
import struct
import tempfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .report import Refused

_READABLE = {".exr", ".png", ".jpg", ".jpeg", ".hdr", ".pfm", ".tga", ".bmp"}


def plain_name(name: str) -> str:
    """A name of letters, digits, - and _ for files and ids."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", name)


def with_copies(description: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The description with copies of its image files in the folder textures of another one, to which their names are relative.
    Files that are there already stay as they are, and copies appear when all of them are complete."""
    textures = folder / "textures"
    sources = list(dict.fromkeys(_file_names(description)))
    originals = {Path(name).resolve() for name in sources}
    names: dict[str, str] = {}
    copies: list[tuple[str, Path]] = []
    number = 0
    for name in sources:
        original = Path(name).resolve()
        if original.parent == textures.resolve():
            names[name] = f"textures/{original.name}"
            continue
        while (copy := textures / f"{number}-{Path(name).name}").resolve() in originals:
            number += 1
        number += 1
        names[name] = f"textures/{copy.name}"
        copies.append((name, copy))
    _copy(copies, textures)
    renamed: dict[str, Any] = _with_names(description, names)
    return renamed


def _file_names(value: Any) -> Iterator[str]:
    """The names of image files in a description."""
    for key, inner in value.items() if isinstance(value, dict) else ():
        if key == "filename":
            yield inner
        else:
            yield from _file_names(inner)


def _with_names(value: Any, names: dict[str, str]) -> Any:
    if not isinstance(value, dict):
        return value
    return {k: names[v] if k == "filename" else _with_names(v, names) for k, v in value.items()}


def _copy(copies: list[tuple[str, Path]], folder: Path) -> None:
    """Copies all files or, where one cannot be read or written, none."""
    if not copies:
        return
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".etendue-", suffix=".part", dir=folder) as parts:
        for name, copy in copies:
            shutil.copyfile(name, Path(parts) / copy.name)
        for _, copy in copies:
            os.replace(Path(parts) / copy.name, copy)


class ImageFiles:
    """Finds or writes the file of each image, once."""

    def __init__(self, folder: Path):
        self._folder = folder
        self._files: dict[str, str] = {}

    def file_of(self, image: Any, where: str) -> str:
        """The file of an image; `where` names its user in messages."""
        key = image.name_full
        if key not in self._files:
            if image.source not in ("FILE", "GENERATED"):
                raise Refused(f'{where}: image "{image.name}" is {image.source.lower()}, but must be a single image')
            self._files[key] = self._on_disk(image) or self._written(image, where)
        return self._files[key]

    def _on_disk(self, image: Any) -> str | None:
        if image.source != "FILE" or image.packed_file or image.is_dirty or not image.filepath:
            return None
        file = Path(image.filepath_from_user())
        return str(file) if file.is_file() and file.suffix.lower() in _READABLE else None

    def _written(self, image: Any, where: str) -> str:
        """A copy in the image's own colour space: as PNG, or, where values are floats, as PFM, which has no alpha."""
        (width, height), channels = image.size, image.channels
        if width * height == 0:
            raise Refused(f'{where}: image "{image.name}" has no pixels, or its file is missing')
        pixels = np.empty(width * height * channels, dtype=np.float32)
        image.pixels.foreach_get(pixels)
        pixels = pixels.reshape(height, width, channels)
        if channels == 1:
            pixels = np.repeat(pixels, 3, axis=2)
        self._folder.mkdir(parents=True, exist_ok=True)
        file = self._folder / f"{len(self._files)}-{plain_name(image.name)}{'.pfm' if image.is_float else '.png'}"
        file.write_bytes(_pfm(pixels) if image.is_float else _png(pixels))
        return str(file)


def _pfm(pixels: np.ndarray) -> bytes:
    """A file of 32-bit colours; the first row is the lowest one, as in Blender."""
    height, width = pixels.shape[:2]
    return f"PF\n{width} {height}\n-1.0\n".encode("ascii") + pixels[..., :3].astype("<f4").tobytes()


def _png(pixels: np.ndarray) -> bytes:
    """A file of 8-bit colours, with alpha if there are four channels; the first row is the top one."""
    height, width, channels = pixels.shape
    codes = np.round(np.clip(pixels[::-1], 0, 1) * 255).astype(np.uint8).reshape(height, -1)
    rows = np.hstack([np.zeros((height, 1), np.uint8), codes])  # each row begins with its filter, none

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 6 if channels == 4 else 2, 0, 0, 0)
    end = chunk(b"IDAT", zlib.compress(rows.tobytes())) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + end
