"""Refinement of subdivision surfaces: Catmull-Clark and Loop with semi-sharp creases [Catmull & Clark 1978; Loop 1987; DeRose et
al. 1998].

The rules are those of OpenSubdiv. Vertex values are smooth; varying and face-varying values are interpolated linearly.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._primvars import Floats, Integers, Topology, Values

Reals = NDArray[np.float64]
INFINITE = 10.0  # Sharpness from which creases stay sharp.


@dataclass
class Surface:
    """A control mesh, or a refinement of it."""

    topology: Topology
    vertices: Reals  # Columns: the position, and then the vertex primvars.
    edge_sharpness: dict[tuple[int, int], float]
    point_sharpness: Reals
    parents: Integers  # The face of the control mesh of each face.


@dataclass
class _Edges:
    """The edges of a mesh, with the smaller number of a point first."""

    ends: Integers  # (E, 2)
    of_corners: Integers  # From each corner to the next.
    uses: Integers  # Faces of each.
    sharpness: Reals


def _edges(surface: Surface) -> _Edges:
    t = surface.topology
    pairs = np.sort(np.stack([t.points, t.points[t.next]], 1), 1)
    ends, of_corners, uses = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    sharpness = np.array([surface.edge_sharpness.get((int(a), int(b)), 0.0) for a, b in ends]
                         if surface.edge_sharpness else np.zeros(len(ends)))
    sharpness[uses != 2] = np.inf  # Boundaries.
    return _Edges(ends, of_corners.reshape(-1), uses, sharpness)


def _sum(numbers: Integers, rows: Reals, count: int) -> Reals:
    total = np.zeros((count, rows.shape[1]))
    np.add.at(total, numbers, rows)
    return total


def refine(surface: Surface) -> Surface:
    """One level: each face of n corners becomes n quadrilaterals."""
    t, v = surface.topology, surface.vertices
    edges, count = _edges(surface), surface.topology.count_of_points
    centres = _sum(t.faces, v[t.points], len(t.counts)) / t.counts[:, None]
    middles = v[edges.ends].mean(1)
    around = _sum(edges.of_corners, centres[t.faces], len(edges.ends))
    smooth = np.where((edges.uses == 2)[:, None], (2 * middles + around) / 4, middles)
    edge_points = _blended(edges, smooth, middles)
    n = _valence(surface, edges)[:, None]
    faces = np.bincount(t.points, minlength=count)[:, None]
    mean_centres = _sum(t.points, centres[t.faces], count) / np.maximum(faces, 1)
    mean_middles = _sum(edges.ends.reshape(-1), np.repeat(middles, 2, 0), count) / n
    moved = _moved_points(surface, edges, (mean_centres + 2 * mean_middles + (n - 3) * v) / n)

    corner = np.arange(len(t.points))
    first_edge, first_face = count, count + len(edges.ends)
    quads = np.stack([t.points, first_edge + edges.of_corners, first_face + t.faces,
                      first_edge + edges.of_corners[t.previous[corner]]], 1)
    topology = Topology(np.full(len(quads), 4), quads.reshape(-1), first_face + len(t.counts))
    return _refined(surface, edges, topology, np.concatenate([moved, edge_points, centres]), surface.parents[t.faces])


def refine_triangles(surface: Surface) -> Surface:
    """One level of Loop's scheme: each triangle becomes four."""
    t, v = surface.topology, surface.vertices
    edges, count = _edges(surface), surface.topology.count_of_points
    middles = v[edges.ends].mean(1)
    opposite = _sum(edges.of_corners, v[t.points[t.previous]], len(edges.ends))
    smooth = np.where((edges.uses == 2)[:, None], (6 * middles + opposite) / 8, middles)
    n = _valence(surface, edges)[:, None]
    share = 5 / 8 - (3 / 8 + np.cos(2 * np.pi / n) / 4)**2  # Of all neighbours together.
    around = _sum(edges.ends.reshape(-1), v[edges.ends[:, ::-1].reshape(-1)], count) / n
    moved = _moved_points(surface, edges, (1 - share) * v + share * around)
    p, e = t.points.reshape(-1, 3), count + edges.of_corners.reshape(-1, 3)
    topology = Topology(np.full(4 * len(p), 3), _quartered(p, e), count + len(edges.ends))
    return _refined(surface, edges, topology, np.concatenate([moved, _blended(edges, smooth, middles)]),
                    np.repeat(surface.parents, 4))


def _quartered(corners: NDArray[Any], middles: NDArray[Any]) -> NDArray[Any]:
    """The corners of the four parts of triangles, from their own and those in the middles of the edges that follow them."""
    (a, b, c), (ab, bc, ca) = (np.moveaxis(x, 1, 0) for x in (corners, middles))
    parts = np.stack([np.stack(x, 1) for x in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))], 1)
    return parts.reshape(-1, *corners.shape[2:])


def _blended(edges: _Edges, smooth: Reals, middles: Reals) -> Reals:
    share = np.clip(edges.sharpness, 0, 1)[:, None]
    made: Reals = (1 - share) * smooth + share * middles
    return made


def _valence(surface: Surface, edges: _Edges) -> Integers:
    """Edges at each point, at least 1."""
    count: Integers = np.bincount(edges.ends.reshape(-1), minlength=surface.topology.count_of_points)
    return np.maximum(count, 1)


def _refined(surface: Surface, edges: _Edges, topology: Topology, vertices: Reals, parents: Integers) -> Surface:
    """The points of edges are those after the old ones; what is sharp is less sharp."""
    count = surface.topology.count_of_points
    sharp: dict[tuple[int, int], float] = {}
    for e in np.flatnonzero((edges.sharpness > 0) & np.isfinite(edges.sharpness)):
        left = _softer(float(edges.sharpness[e]))
        if left > 0:
            for end in edges.ends[e]:
                sharp[int(end), int(count + e)] = left
    points = np.concatenate([[_softer(float(s)) for s in surface.point_sharpness],
                             np.zeros(topology.count_of_points - count)])
    return Surface(topology, vertices, sharp, points, parents)


def _softer(sharpness: float) -> float:
    return sharpness if sharpness >= INFINITE else max(sharpness - 1, 0.0)


def _moved_points(surface: Surface, edges: _Edges, smooth: Reals) -> Reals:
    """The old points after a step; `smooth` are those without creases."""
    v, count = surface.vertices, surface.topology.count_of_points
    valence = np.bincount(edges.ends.reshape(-1), minlength=count)
    is_sharp = edges.sharpness > 0
    sharp_ends = edges.ends[is_sharp].reshape(-1)
    creases = np.bincount(sharp_ends, minlength=count)
    opposite = edges.ends[is_sharp][:, ::-1].reshape(-1)
    on_crease = (6 * v + _sum(sharp_ends, v[opposite], count)) / 8
    # The blend between two rules is by the mean sharpness of the creases, or by that of the point.
    total = np.zeros(count)
    np.add.at(total, sharp_ends, np.minimum(np.repeat(edges.sharpness[is_sharp], 2), 1))
    share = np.where(creases > 0, total / np.maximum(creases, 1), 0)[:, None]
    rule = np.where((creases == 2)[:, None], on_crease, np.where((creases > 2)[:, None], v, smooth))
    moved = (1 - share) * smooth + share * rule
    corner = np.clip(surface.point_sharpness, 0, 1)[:, None]
    moved = (1 - corner) * moved + corner * v
    return np.where((valence > 0)[:, None], moved, v)


def refine_corners(values: Values, topology: Topology, is_loop: bool) -> Values:
    """Values of the corners of a refined mesh, linear within the faces of the one before."""
    if values.interpolation in ("constant", "uniform"):
        return Values(values.rows, np.repeat(values.of_corners, 4), values.interpolation)
    rows = values.at_corners().astype(np.float64)
    if is_loop:
        middles = (rows + rows[topology.next]) / 2
        return _face_varying(_quartered(rows.reshape(-1, 3, rows.shape[1]), middles.reshape(-1, 3, rows.shape[1])))
    centres = _sum(topology.faces, rows, len(topology.counts)) / topology.counts[:, None]
    after = (rows + rows[topology.next]) / 2
    made = np.stack([rows, after, centres[topology.faces], after[topology.previous]], 1)
    return _face_varying(made.reshape(-1, rows.shape[1]))


def _face_varying(rows: Reals) -> Values:
    unique, same = np.unique(rows.astype(np.float32), axis=0, return_inverse=True)
    return Values(unique, same.reshape(-1), "faceVarying")


def smooth_normals(surface: Surface) -> Values:
    """Normals of the corners, continuous except across creases that stay sharp, weighted by area."""
    t = surface.topology
    edges = _edges(surface)
    p = surface.vertices[:, :3]
    a, b = p[t.points[t.next]] - p[t.points], p[t.points[t.previous]] - p[t.points]
    corner_normals = np.cross(a, b)
    # Corners at one point belong together if a path of faces over smooth edges joins them.
    group = np.arange(len(t.points))
    joined = (edges.uses == 2) & (edges.sharpness < INFINITE)
    order = np.argsort(edges.of_corners, kind="stable")
    order = order[joined[edges.of_corners[order]]].reshape(-1, 2)
    pairs = np.concatenate([_pair(order, t, 0), _pair(order, t, 1)]) if len(order) else np.zeros((0, 2), np.int64)
    while len(pairs):
        least = np.minimum(group[pairs[:, 0]], group[pairs[:, 1]])
        before = group.copy()
        np.minimum.at(group, pairs[:, 0], least)
        np.minimum.at(group, pairs[:, 1], least)
        if np.array_equal(before, group):
            break
    numbers, same = np.unique(group, return_inverse=True)
    total = _sum(same.reshape(-1), corner_normals, len(numbers))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    rows: Floats = (total / np.where(length > 0, length, 1)).astype(np.float32)
    return Values(rows, same.reshape(-1), "faceVarying")


def _pair(order: Integers, t: Topology, end: int) -> Integers:
    """The corners of both faces of each edge at its smaller (0) or larger (1) point."""
    found = []
    for side in (0, 1):
        corner = order[:, side]
        is_larger = t.points[corner] > t.points[t.next[corner]]
        found.append(np.where(is_larger == bool(end), corner, t.next[corner]))
    return np.stack(found, 1)
