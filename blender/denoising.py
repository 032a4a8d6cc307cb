"""Intel Open Image Denoise, which Blender brings."""

from __future__ import annotations

import os
from pathlib import Path

import bpy
import numpy as np


def prepare() -> None:
    """Lets etendue use Blender's own library, unless ETENDUE_OIDN names another one. Raises RuntimeError if there is none."""
    import etendue as et

    program, module = bpy.app.binary_path, bpy.__file__  # the program, or Blender as a Python module
    for place in (program, module):
        folder = Path(place).parent / "lib"
        if place and (folder / "libOpenImageDenoise.so.2").exists():
            os.environ.setdefault("ETENDUE_OIDN", str(folder))
    et.denoise(np.zeros((1, 1, 3), np.float32))
