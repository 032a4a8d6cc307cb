"""Gprims: spheres, cubes, cylinders, cones, capsules and planes."""

from typing import Any

import numpy as np

from .._scenes import scale, translate
from ._context import Context, Matrix, Object

SEGMENTS = 128  # Around the axis of cones and capsules, which are meshes.


def shapes_of_gprim(context: Context, prim: Any) -> list[tuple[str, Object]] | None:
    """The shapes in the space of the prim, each with what its key has behind the path; None for other types."""
    make = _MAKERS.get(str(prim.GetTypeName()))
    if make is None:
        return None
    shapes = make(context, prim)
    if context.get(prim, "orientation") == "leftHanded":
        for _, shape in shapes:
            shape["flip_normals"] = True
    return shapes


def _size(context: Context, prim: Any, name: str) -> float:
    value = float(context.get(prim, name))
    if not value >= 0 or not np.isfinite(value):
        context.fail(prim, f"{name} is {value}, but must not be negative")
    return value


def _axis(context: Context, prim: Any) -> Matrix:
    """A rotation from +z to the axis of the prim: the axes are exchanged in a cycle."""
    made = np.eye(4)
    made[:3, :3] = np.roll(np.eye(3), {"X": 1, "Y": 2}.get(str(context.get(prim, "axis")), 0), axis=0)
    return made


def _sphere(context: Context, prim: Any) -> list[tuple[str, Object]]:
    return [("", {"type": "sphere", "radius": _size(context, prim, "radius"), "to_world": np.eye(4)})]


def _cube(context: Context, prim: Any) -> list[tuple[str, Object]]:
    return [("", {"type": "cube", "to_world": scale(_size(context, prim, "size") / 2)})]


def _plane(context: Context, prim: Any) -> list[tuple[str, Object]]:
    half = {name: _size(context, prim, name) / 2 for name in ("width", "length")}
    # USD: the width is along x, or along z if the axis is X; the length is along y, or along z if the axis is Y.
    axis = str(context.get(prim, "axis"))
    x, y = (half["length"], half["width"]) if axis == "X" else (half["width"], half["length"])
    if axis == "Y":
        x, y = half["length"], half["width"]
    return [("", {"type": "rectangle", "to_world": _axis(context, prim) @ scale(x, y, 1)})]


def _cylinder(context: Context, prim: Any) -> list[tuple[str, Object]]:
    bottom, top = _radii(context, prim)
    height = _size(context, prim, "height")
    if bottom != top:
        return _revolved(context, prim, bottom, top, height)
    axis = _axis(context, prim)
    side = {"type": "cylinder", "p0": [0, 0, -height / 2], "p1": [0, 0, height / 2], "radius": bottom, "to_world": axis}
    return [("", side)] + _caps(axis, bottom, top, height)


def _radii(context: Context, prim: Any) -> tuple[float, float]:
    if prim.GetAttribute("radiusBottom"):
        return _size(context, prim, "radiusBottom"), _size(context, prim, "radiusTop")
    return (_size(context, prim, "radius"),) * 2


def _caps(axis: Matrix, bottom: float, top: float, height: float) -> list[tuple[str, Object]]:
    shapes = []
    if bottom > 0:
        # A half turn about x, so that the normal points down.
        down = translate(z=-height / 2) @ np.diag([1.0, -1, -1, 1]) @ scale(bottom, bottom, 1)
        shapes.append((":bottom", {"type": "disk", "to_world": axis @ down}))
    if top > 0:
        shapes.append((":top", {"type": "disk", "to_world": axis @ translate(z=height / 2) @ scale(top, top, 1)}))
    return shapes


def _cone(context: Context, prim: Any) -> list[tuple[str, Object]]:
    return _revolved(context, prim, _size(context, prim, "radius"), 0.0, _size(context, prim, "height"))


def _revolved(context: Context, prim: Any, bottom: float, top: float, height: float) -> list[tuple[str, Object]]:
    """A cone or its frustum, with caps."""
    normal = np.array([height, bottom - top]) / max(np.hypot(height, bottom - top), 1e-30)
    profile = np.array([[bottom, -height / 2], [top, height / 2]])
    axis = _axis(context, prim)
    mesh = _revolve(profile, np.array([normal, normal]))
    return [("", {"type": "mesh", "mesh": mesh, "to_world": axis})] + _caps(axis, bottom, top, height)


def _capsule(context: Context, prim: Any) -> list[tuple[str, Object]]:
    bottom, top = _radii(context, prim)
    if bottom != top:
        context.warn(prim, "the radii of a capsule differ: the mean is used")
    radius, height = (bottom + top) / 2, _size(context, prim, "height")
    angles = np.linspace(-np.pi / 2, np.pi / 2, SEGMENTS // 2 + 2)
    normals = np.stack([np.cos(angles), np.sin(angles)], 1)
    normals[[0, -1], 0] = 0
    half = len(angles) // 2
    shift = np.where(np.arange(len(angles)) < half, -height / 2, height / 2)[:, None] * [0, 1]
    return [("", {"type": "mesh", "mesh": _revolve(radius * normals + shift, normals), "to_world": _axis(context, prim)})]


def _revolve(profile: Matrix, normals: Matrix) -> Object:
    """A mesh from a profile of rows (r, z), from below, turned about the z axis."""
    turns = np.linspace(0, 2 * np.pi, SEGMENTS, endpoint=False)
    ring = np.stack([np.cos(turns), np.sin(turns)], 1)

    def turned(rows: Matrix) -> Matrix:
        xy = rows[:, None, :1] * ring[None]
        z = np.broadcast_to(rows[:, None, 1:], (len(rows), SEGMENTS, 1))
        return np.concatenate([xy, z], 2).reshape(-1, 3)

    row, column = np.meshgrid(np.arange(len(profile) - 1) * SEGMENTS, np.arange(SEGMENTS), indexing="ij")
    after = (column + 1) % SEGMENTS
    a, b, c, d = (x.reshape(-1) for x in (row + column, row + after, row + SEGMENTS + after, row + SEGMENTS + column))
    # Where a ring is a point, one of the two triangles has no area.
    rings = profile[:, 0]
    lower, upper = np.stack([a, b, c], 1)[rings[a // SEGMENTS] > 0], np.stack([a, c, d], 1)[rings[d // SEGMENTS] > 0]
    triangles = np.concatenate([lower, upper])
    return {"positions": turned(profile), "normals": turned(normals), "triangles": triangles}


_MAKERS = {"Sphere": _sphere, "Cube": _cube, "Plane": _plane, "Cylinder": _cylinder, "Cylinder_1": _cylinder, "Cone": _cone,
           "Capsule": _capsule, "Capsule_1": _capsule}
