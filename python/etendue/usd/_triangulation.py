"""Faces of any number of corners as triangles."""

import numpy as np
from numpy.typing import NDArray

from ._primvars import Integers, Topology

Reals = NDArray[np.float64]


def triangulate(topology: Topology, points: Reals) -> tuple[Integers, Integers]:
    """Triangles as rows of three corners, and the face of each. Faces of fewer than three corners have none."""
    made, faces = [], []
    for count in np.unique(topology.counts[topology.counts > 2]):
        chosen = np.flatnonzero(topology.counts == count)
        corners = topology.starts[chosen][:, None] + np.arange(count)
        polygons = points[topology.points[corners]]
        parts = _fans(polygons, int(count))
        made.append(np.take_along_axis(corners[:, None, :], parts, axis=2).reshape(-1, 3))
        faces.append(np.repeat(chosen, count - 2))
    if not made:
        return np.zeros((0, 3), np.int64), np.zeros(0, np.int64)
    order = np.argsort(np.concatenate(faces), kind="stable")
    return np.concatenate(made)[order], np.concatenate(faces)[order]


def _fans(polygons: Reals, count: int) -> Integers:
    """The corners of the triangles of F polygons, an array of shape (F, count - 2, 3): a fan from the first corner where
    the polygon is convex, and ears elsewhere."""
    fan = np.stack([np.zeros(count - 2, np.int64), np.arange(1, count - 1), np.arange(2, count)], 1)
    parts = np.broadcast_to(fan, (len(polygons), count - 2, 3)).copy()
    if count == 3:
        return parts
    after, before = np.roll(polygons, -1, 1), np.roll(polygons, 1, 1)
    # The vector area of the polygon gives its side.
    normals = np.cross(polygons, after).sum(1)
    turns = np.einsum("fci,fi->fc", np.cross(polygons - before, after - polygons), normals)
    for f in np.flatnonzero((turns < 0).any(1)):
        parts[f] = _ears(polygons[f], normals[f])
    return parts


def _ears(polygon: Reals, normal: Reals) -> Integers:
    """Ear clipping [Meisters 1975]."""
    drop = int(np.argmax(np.abs(normal)))
    flat = np.delete(polygon, drop, 1)
    # Without one coordinate, the polygon turns the other way if its normal points down, or if y is left out.
    sign = float(np.sign(normal[drop])) * (-1 if drop == 1 else 1)

    def turn(a: int, b: int, c: int) -> float:
        u, w = flat[b] - flat[a], flat[c] - flat[a]
        return sign * float(u[0] * w[1] - u[1] * w[0])

    left, made = list(range(len(polygon))), []
    while len(left) > 3:
        ear = 0  # Of a polygon that intersects itself, any.
        for i in range(len(left)):
            a, b, c = left[i - 1], left[i], left[(i + 1) % len(left)]
            if turn(a, b, c) > 0 and not any(
                    turn(a, b, p) >= 0 and turn(b, c, p) >= 0 and turn(c, a, p) >= 0 for p in left if p not in (a, b, c)):
                ear = i
                break
        made.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    made.append((left[0], left[1], left[2]))
    return np.array(made)
