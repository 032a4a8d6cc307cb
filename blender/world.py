"""The world: a constant colour or an environment image as it is, anything else as an image that Cycles renders."""

from __future__ import annotations

from typing import Any

import numpy as np

from .lights import rgb
from .nodes import Output, nodes_of, surface_output, tree_of
from .panorama import panorama
from .report import Report
from .values import Values, is_texture

# The middle of an image is at etendue's +z, and at Blender's +x; up is etendue's +y, and Blender's +z.
_ENVIRONMENT = np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


def read_world(world: Any, values: Values, frame: int = 1, threads: int = 0) -> dict[str, Any] | None:
    """The emitter of an evaluated world; None if it is black. `frame` and `threads`: for Cycles."""
    tree = tree_of(world)
    if tree is None:
        return _constant(tuple(world.color), 1.0)
    output = surface_output(tree, "ShaderNodeOutputWorld")
    if output and output.input("Volume").source():
        values.report.warn(values.where, "volume has no effect")
    node = output.input("Surface").source() if output else None
    if node is None:
        return None
    trial = Values(values.where, values.images, Report())
    emitter, is_plain = _plain(node, trial)
    if is_plain and not trial.report.warnings:
        return emitter
    _warn_of(tree, values)
    image = panorama(world, frame, threads, values.where)
    return {"type": "envmap", "filename": image, "to_world": _ENVIRONMENT} if image else None


def _warn_of(tree: Any, values: Values) -> None:
    """Of what an image cannot have."""
    for node in nodes_of(tree):
        if node.bl_idname == "ShaderNodeLightPath":
            values.report.warn(values.where, "all rays see what Light Path gives for diffuse ones")
        image = getattr(node, "image", None)
        if image is not None and image.is_dirty and not image.packed_file:
            values.report.warn(values.where, f'changes of the image "{image.name}" that are not saved have no effect')


def _plain(node: Output, values: Values) -> tuple[dict[str, Any] | None, bool]:
    """The emitter of a node that is a constant or an image, and whether it is one."""
    if node.node.bl_idname not in ("ShaderNodeBackground", "ShaderNodeEmission"):
        return None, False
    strength = values.constant(node.input("Strength"), node)
    source = node.input("Color").source()
    if source is not None and source.node.bl_idname == "ShaderNodeTexEnvironment":
        return _image(source, strength, values)
    color = values.color(node.input("Color"))
    return (None, False) if is_texture(color) else (_constant(color, strength), True)


def _constant(color: tuple[float, float, float], strength: float) -> dict[str, Any] | None:
    return {"type": "constant", "radiance": rgb(color, strength)} if strength > 0 and any(color) else None


def _image(node: Output, strength: float, values: Values) -> tuple[dict[str, Any] | None, bool]:
    image, vector = node.node.image, node.input("Vector").source()
    if image is None or strength <= 0:
        return None, strength <= 0
    space = image.colorspace_settings.name
    is_read = space in ("Linear Rec.709", "Non-Color") if image.is_float else space == "sRGB"
    if not is_read or image.source not in ("FILE", "GENERATED") or node.node.projection != "EQUIRECTANGULAR" \
            or node.node.interpolation == "Closest":
        return None, False
    rotation = np.eye(4)
    if vector is not None and vector.node.bl_idname == "ShaderNodeMapping":
        rotation = values.mapping(vector)
        if rotation[:3, 3].any() or not np.allclose(rotation @ rotation.T, np.eye(4), atol=1e-5):
            return None, False
        vector = vector.input("Vector").source()
    if vector is not None and (vector.node.bl_idname, vector.socket.name) != ("ShaderNodeTexCoord", "Generated"):
        return None, False
    file = values.images.file_of(image, f"{values.where}: node {node.name}")
    # Blender rotates the direction before it looks it up.
    return {"type": "envmap", "filename": file, "scale": strength, "to_world": rotation.T @ _ENVIRONMENT}, True
