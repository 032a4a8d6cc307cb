"""Lights. Blender gives their power in watts; with the energy P and the colour c:

    point, spot   I = c P / 4π, or a sphere of radius r with L = I / π r²
    area          L = c P / π A: a Lambertian emitter of radiance L and area A emits π A L
    sun           E = c P, an irradiance
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .nodes import surface_output
from .report import Refused
from .values import Color, Values, as_color, is_texture

# Blender's lights shine along -z, etendue's along +z.
_TURN = np.diag([-1.0, 1.0, -1.0, 1.0])


def read_light(light: Any, to_world: np.ndarray, values: Values) -> dict[str, Any] | None:
    """The emitter, or the shape that emits, of a light; None for the portals of Cycles, which are hints where to sample."""
    if light.type == "AREA" and getattr(getattr(light, "cycles", None), "is_portal", False):
        return None
    if not light.use_shadow:
        values.report.warn(values.where, "a light without shadows casts shadows")
    color = _color(light, values)
    if light.type == "POINT":
        return _point(light, to_world, color)
    if light.type == "SPOT":
        return _spot(light, to_world, color, values)
    if light.type == "SUN":
        if light.angle > math.radians(1):
            values.report.warn(values.where, "the sun is a point: its angle has no effect")
        return {"type": "directional", "irradiance": rgb(color), "to_world": _rigid(to_world) @ _TURN}
    return _area(light, to_world, color, values)


def rgb(color: Color, factor: float = 1.0) -> dict[str, Any]:
    return {"type": "rgb", "value": [c * factor for c in color]}


def _color(light: Any, values: Values) -> Color:
    """Colour times energy, with the exposure, the temperature and the nodes of the light."""
    factor = light.energy * 2 ** getattr(light, "exposure", 0.0)
    color = tuple(light.color)
    if getattr(light, "use_temperature", False):
        color = tuple(a * b for a, b in zip(color, light.temperature_color))
    if light.use_nodes and light.node_tree:
        color = tuple(a * b for a, b in zip(color, _of_nodes(light.node_tree, values)))
    return tuple(c * factor for c in color)


def _of_nodes(tree: Any, values: Values) -> Color:
    output = surface_output(tree, "ShaderNodeOutputLight")
    node = output.input("Surface").source() if output else None
    if node is None:
        return (0.0, 0.0, 0.0)
    if node.node.bl_idname != "ShaderNodeEmission":
        raise Refused(f"{values.where}: node {node.name} is not supported")
    color, strength = values.color(node.input("Color")), values.constant(node.input("Strength"), node)
    if is_texture(color):
        values.warn(node, "Color cannot be a texture of a light")
        color = as_color(node.input("Color").value)
    return tuple(c * strength for c in color)


def _point(light: Any, to_world: np.ndarray, color: Color) -> dict[str, Any]:
    radius = light.shadow_soft_size
    center = [float(v) for v in to_world[:3, 3]]
    if radius == 0:
        return {"type": "point", "position": center, "intensity": rgb(color, 1 / (4 * math.pi))}
    area = math.pi * radius**2 if _is_normalized(light) else 1.0
    emitter = {"type": "area", "radiance": rgb(color, 1 / (4 * math.pi * area))}
    return {"type": "sphere", "center": center, "radius": radius, "emitter": emitter}


def _spot(light: Any, to_world: np.ndarray, color: Color, values: Values) -> dict[str, Any]:
    if light.shadow_soft_size > 0:
        values.report.warn(values.where, "the spot light is a point: its radius has no effect")
    cos_cutoff = math.cos(light.spot_size / 2)
    cos_beam = cos_cutoff + (1 - cos_cutoff) * light.spot_blend
    return {
        "type": "spot",
        "intensity": rgb(color, 1 / (4 * math.pi)),
        "cutoff_angle": math.degrees(light.spot_size / 2),
        "beam_width": math.degrees(math.acos(min(cos_beam, 1.0))),
        "falloff": "smooth",
        "to_world": _rigid(to_world) @ _TURN,
    }


def _area(light: Any, to_world: np.ndarray, color: Color, values: Values) -> dict[str, Any]:
    if light.spread < math.pi - 1e-3:
        values.report.warn(values.where, "the spread has no effect: the light shines in all directions of its front")
    is_round, width = light.shape in ("DISK", "ELLIPSE"), light.size
    height = light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else width
    axes = to_world[:3, :2] * (width, height)
    area = math.prod(np.linalg.norm(axes, axis=0)) * (math.pi / 4 if is_round else 1.0)
    emitter = {"type": "area", "radiance": rgb(color, 1 / (math.pi * (area if _is_normalized(light) else 1.0)))}
    size = np.diag([width / 2, height / 2, 1.0, 1.0])
    return {"type": "disk" if is_round else "rectangle", "to_world": to_world @ _TURN @ size, "emitter": emitter}


def _is_normalized(light: Any) -> bool:
    """Whether the power does not depend on the size."""
    return getattr(light, "normalize", True)


def _rigid(matrix: np.ndarray) -> np.ndarray:
    """The matrix without its scale."""
    result = matrix.copy()
    result[:3, :3] /= np.linalg.norm(result[:3, :3], axis=0)
    return result
