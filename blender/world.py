"""The world: a constant colour, an environment image, or a sky."""

from __future__ import annotations

from typing import Any

import numpy as np

from .lights import rgb
from .nodes import Output, surface_output, tree_of
from .report import Refused
from .values import Values, as_color, is_texture

# The middle of an image is at etendue's +z, and at Blender's +x; up is etendue's +y, and Blender's +z.
_ENVIRONMENT = np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


def read_world(world: Any, values: Values) -> dict[str, Any] | None:
    """The emitter of a world; None if it is black."""
    if world is None:
        return None
    tree = tree_of(world)
    if tree is None:
        return _constant(tuple(world.color), 1.0)
    output = surface_output(tree, "ShaderNodeOutputWorld")
    if output and output.input("Volume").source():
        values.report.warn(values.where, "volume has no effect")
    node = output.input("Surface").source() if output else None
    if node is None:
        return None
    if node.node.bl_idname not in ("ShaderNodeBackground", "ShaderNodeEmission"):
        raise Refused(f"{values.where}: node {node.name} is not supported")
    strength = values.constant(node.input("Strength"), node)
    source = node.input("Color").source()
    if source is not None and source.node.bl_idname == "ShaderNodeTexEnvironment":
        return _image(source, strength, values)
    if source is not None and source.node.bl_idname == "ShaderNodeTexSky" and source.node.sky_type == "HOSEK_WILKIE":
        return _sky(source, strength)
    color = values.color(node.input("Color"))
    if is_texture(color):
        values.warn(node, "Color can be an environment texture, but no other one")
        color = as_color(node.input("Color").value)
    return _constant(color, strength)


def _constant(color: tuple[float, float, float], strength: float) -> dict[str, Any] | None:
    return {"type": "constant", "radiance": rgb(color, strength)} if strength and any(color) else None


def _image(node: Output, strength: float, values: Values) -> dict[str, Any] | None:
    image, vector = node.node.image, node.input("Vector").source()
    if image is None or strength == 0:
        return None
    if node.node.projection != "EQUIRECTANGULAR":
        raise Refused(f"{values.where}: node {node.name} has the projection {node.node.projection}, which is not supported")
    rotation = np.eye(4)
    if vector is not None and vector.node.bl_idname == "ShaderNodeMapping":
        rotation = values.mapping(vector)
        rotation[:3, 3] = 0
        if not np.allclose(rotation @ rotation.T, np.eye(4), atol=1e-5):
            values.warn(vector, "only its rotation has an effect")
            rotation[:3, :3] /= np.linalg.norm(rotation[:3, :3], axis=0)
        vector = vector.input("Vector").source()
    if vector is not None and (vector.node.bl_idname, vector.socket.name) != ("ShaderNodeTexCoord", "Generated"):
        values.warn(vector, "only generated coordinates are supported")
    file = values.images.file_of(image, f"{values.where}: node {node.name}")
    # Blender rotates the direction before it looks it up.
    return {"type": "envmap", "filename": file, "scale": strength, "to_world": rotation.T @ _ENVIRONMENT}


def _sky(node: Output, strength: float) -> dict[str, Any]:
    sky = node.node
    return {
        "type": "sky",
        "turbidity": min(max(sky.turbidity, 1.0), 10.0),
        "albedo": rgb((sky.ground_albedo,) * 3),
        "sun_direction": [float(v) for v in sky.sun_direction],
        "scale": strength,
    }
