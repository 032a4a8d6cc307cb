"""Worlds as equirectangular images that Cycles renders, in a second Blender: there is no rendering within a rendering."""

from __future__ import annotations

import hashlib
import json
import math
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

import bpy

from .nodes import nodes_of
from .report import Refused

_PROGRAM = Path(__file__).with_name("bake_world.py")
_WIDTH, _WIDEST = 2048, 8192
"""Columns of an image, and the most of them that a texture with more detail gets."""
_ACROSS_SUN = 6
"""Pixels across the disc of the sun, as far as the next number allows it."""
_WIDEST_SKY = 4096
_COSMETIC = {"location", "location_absolute", "width", "height", "select", "hide", "show_options", "show_preview",
             "show_texture", "label", "color", "use_custom_color", "parent", "is_active_output"}

_folder: tempfile.TemporaryDirectory[str] | None = None
_images: dict[str, str | None] = {}
"""The image of each world by a digest of its nodes, so that a viewport does not wait again for what it has; the newest last."""
_KEPT = 16


def panorama(world: Any, frame: int, threads: int, where: str) -> str | None:
    """The file with the radiance of an evaluated world, as surfaces receive it; None if it is black."""
    key = _digest(world, frame)
    image = _images.pop(key, "")
    if image == "":
        image = _render(world, f"world-{key[:12]}", frame, threads, where)
    _images[key] = image
    while len(_images) > _KEPT:
        oldest = _images.pop(next(iter(_images)))
        if oldest:
            Path(oldest).unlink(missing_ok=True)
    return image


def forget() -> None:
    """Deletes all images."""
    global _folder
    _images.clear()
    if _folder is not None:
        _folder.cleanup()
        _folder = None


def _render(world: Any, name: str, frame: int, threads: int, where: str) -> str | None:
    global _folder
    if _folder is None:
        _folder = tempfile.TemporaryDirectory(prefix="etendue-worlds-")
    image = Path(_folder.name) / f"{name}.exr"
    # A rendering and a viewport may make the same image at the same time.
    made = image.with_stem(f"{name}-{threading.get_ident()}")
    blend, original = made.with_suffix(".blend"), world.original
    bpy.data.libraries.write(str(blend), {original}, path_remap="ABSOLUTE", fake_user=True)
    order = {"blend": str(blend), "world": original.name, "image": str(made), "width": _width(world), "frame": frame,
             "threads": threads}
    program = [bpy.app.binary_path, "--background", "--factory-startup", "--python-exit-code", "1", "--python"]
    if not bpy.app.binary_path:  # Blender as a Python module
        program = [sys.executable]
    run = subprocess.run([*program, str(_PROGRAM), "--", json.dumps(order)], capture_output=True, text=True)
    blend.unlink()
    if run.returncode:
        lines = (run.stderr or run.stdout).strip().splitlines()
        raise Refused(f"{where}: Cycles does not render it as an image: {lines[-1] if lines else run.returncode}")
    if not made.exists():
        return None
    made.replace(image)
    return str(image)


def _width(world: Any) -> int:
    """As many columns as textures of the world have, and as the disc of the sun needs."""
    width = _WIDTH
    for node in nodes_of(world.node_tree):
        image = getattr(node, "image", None)
        if image is not None:
            width = max(width, min(image.size[0], _WIDEST))
        if node.bl_idname == "ShaderNodeTexSky" and node.sky_type not in ("PREETHAM", "HOSEK_WILKIE") and node.sun_disc:
            width = max(width, min(_WIDEST_SKY, math.ceil(2 * math.pi * _ACROSS_SUN / max(node.sun_size, 1e-3))))
    return width + width % 2


def _digest(world: Any, frame: int) -> str:
    """Equal for equal nodes, whatever their places in the editor; the frame counts where images have several."""
    nodes = nodes_of(world.node_tree)
    state: list[Any] = [frame for n in nodes if getattr(getattr(n, "image", None), "source", "FILE") in ("SEQUENCE", "MOVIE")]
    for node in nodes:
        sockets = [(s.identifier, _state(s)) for s in (*node.inputs, *node.outputs)]
        state.append((node.id_data.name_full, node.name, _state(node), sockets))
    links = sorted((tree.name_full, *(x for s in (link.from_socket, link.to_socket) for x in (s.node.name, s.identifier)),
                    link.is_muted) for tree in {n.id_data for n in nodes} for link in tree.links)
    return hashlib.sha256(repr((state, links)).encode()).hexdigest()


def _state(thing: Any, depth: int = 0) -> list[Any]:
    """The values of its properties, with those of ramps and curves."""
    state: list[Any] = []
    for p in thing.bl_rna.properties:
        if p.identifier == "rna_type" or isinstance(thing, bpy.types.Node) and p.identifier in _COSMETIC:
            continue
        value = getattr(thing, p.identifier, None)
        if isinstance(value, bpy.types.ID):
            state.append((p.identifier, *_state_of_block(value)))
        elif p.type == "COLLECTION":
            if p.identifier in ("elements", "curves", "points"):
                state.append((p.identifier, [_state(item, depth + 1) for item in value]))
        elif p.type == "POINTER":
            if value is not None and depth < 3 and not isinstance(value, (bpy.types.Node, bpy.types.NodeSocket)):
                state.append((p.identifier, _state(value, depth + 1)))
        else:
            state.append((p.identifier, tuple(value) if getattr(p, "is_array", False) and value is not None else value))
    return state


def _state_of_block(block: Any) -> tuple[Any, ...]:
    """Of an image the file and its age matter, of an object its place."""
    if isinstance(block, bpy.types.Image):
        file = Path(block.filepath_from_user()) if block.filepath else None
        age = file.stat().st_mtime_ns if file and file.is_file() else 0
        packed = hashlib.sha256(block.packed_file.data).digest() if block.packed_file else b""
        made = (block.generated_type, tuple(block.generated_color)) if block.source == "GENERATED" else ()
        return (block.name_full, block.source, tuple(block.size), block.colorspace_settings.name, block.alpha_mode, str(file), age,
                packed, made)
    return (block.name_full, str(getattr(block, "matrix_world", "")))
