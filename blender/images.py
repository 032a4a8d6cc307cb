"""Files of images: those on disk as they are, packed and generated ones written to a folder."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import bpy

from .report import Refused

_READABLE = {".exr", ".png", ".jpg", ".jpeg", ".hdr", ".pfm", ".tga", ".bmp"}


def plain_name(name: str) -> str:
    """A name of letters, digits, - and _ for files and ids."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", name)


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
        file = Path(bpy.path.abspath(image.filepath, library=image.library))
        return str(file) if file.is_file() and file.suffix.lower() in _READABLE else None

    def _written(self, image: Any, where: str) -> str:
        """A copy as PNG, or OpenEXR where values are floats, in the image's own colour space."""
        if not image.has_data and image.size[0] * image.size[1] == 0:
            raise Refused(f'{where}: image "{image.name}" has no pixels, or its file is missing')
        self._folder.mkdir(parents=True, exist_ok=True)
        name = f"{len(self._files)}-{plain_name(image.name)}"
        file = self._folder / (name + (".exr" if image.is_float else ".png"))
        copy = image.copy()
        try:
            copy.file_format = "OPEN_EXR" if image.is_float else "PNG"
            copy.save(filepath=str(file), save_copy=True)
        finally:
            bpy.data.images.remove(copy)
        return str(file)
