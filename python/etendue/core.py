"""Path space, as used by the integrators in C++: sub-paths, joins, densities, MIS weights.

A path is x_0 (on an emitter), x_1, ..., x_k (on the lens). A technique (s, t) makes it from s vertices of a light path
y_0, y_1, ... and t vertices of an eye path z_0, z_1, ... [Veach 1997, ch. 10]. Positions are in scene units, radiance and
throughputs in linear RGB. All densities are per unit area of the scene, even if a direction was sampled; at infinity
they are per steradian. Citations refer to docs/references.bib.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _etendue
from ._etendue import Counts, Join, PathPdfs, Sample, Scene, SubPath, Technique, Vertex

__all__ = [
    "Counts", "Join", "PathPdfs", "Sample", "SubPath", "Technique", "Vertex", "counts", "evaluate", "eye_path", "join",
    "light_path", "mis_weight", "sample_paths", "vertex_at",
]

_BDPT = Counts(hit=1, next_event=1, connect=1, splat=1)
Vector = tuple[float, float, float]


def eye_path(
    scene: Scene,
    pixel: tuple[int, int],
    seed: int = 0,
    pass_: int = 0,
    *,
    max_vertices: int | None = None,
    rr_depth: int | None = None,
    counts: Counts = _BDPT,
    sampler: str = "independent",
) -> SubPath:
    """Traces an eye path from the lens through a pixel, (column, row) from the upper left corner.

    With the seed, sampler and pass of a rendering, the random numbers are those of that rendering. max_vertices: limit of
    the number of vertices, including z_0. rr_depth: index of the first vertex with Russian roulette; None: no roulette.
    counts: sample counts for the MIS weights of joins. Raises IndexError for a pixel outside the image.
    """
    return _etendue.eye_path(scene, pixel, seed, pass_, max_vertices, rr_depth, counts, sampler)


def light_path(
    scene: Scene,
    path: int = 0,
    seed: int = 0,
    pass_: int = 0,
    *,
    max_vertices: int | None = None,
    rr_depth: int | None = None,
    counts: Counts = _BDPT,
    sampler: str = "independent",
) -> SubPath:
    """Traces a light path from an emitter. path: index of the light path in its pass; see eye_path() for the others."""
    return _etendue.light_path(scene, path, seed, pass_, max_vertices, rr_depth, counts, sampler)


def vertex_at(scene: Scene, o: Vector, d: Vector) -> Vertex | None:
    """The first surface that the ray from o (in scene units) in direction d (of any length) hits, as a vertex whose wo is
    the opposite direction; None if the ray hits nothing.
    """
    return _etendue.vertex_at(scene, o, d)


def join(
    scene: Scene, y: SubPath | None, s: int, z: SubPath | None, t: int, *, seed: int = 0, counts: Counts | None = None
) -> list[Join]:
    """Joins the first s vertices of y and the first t vertices of z, and tests the visibility. Returns the resulting paths:
    none if the contribution is zero, otherwise one, or for s = 0 one for each emitter at infinity. t is at least 1.

    seed: seed of the point that is sampled on an emitter (s = 1) or on a finite lens (t = 1). counts: must be the counts
    with which the sub-paths were traced, so that the MIS weights are correct; None: these counts. Raises IndexError if a
    sub-path is too short.
    """
    return _etendue.join(scene, y, s, z, t, seed, counts)


def evaluate(
    scene: Scene, x: Sequence[Vertex], delta: Sequence[bool] | None = None
) -> tuple[NDArray[np.float32], PathPdfs]:
    """Evaluates a path by the slow definition. Returns the measurement contribution f of the whole path x [Veach 1997,
    §8.2], RGB of shape (3,), without visibility, in radiance per unit area for each vertex; and the densities of its
    vertices from both sides.

    x: from the emitter to the lens, such as Join.vertices(). delta: whether the path scatters by a delta event at each
    vertex, such as Join.delta.
    """
    f, pdfs = _etendue.evaluate(scene, list(x), None if delta is None else list(delta))
    return f, pdfs


def mis_weight(pdfs: PathPdfs, technique: Technique, counts: Counts) -> float:
    """The MIS weight by the power heuristic with exponent 2, (n p)² divided by the sum of the (n_i p_i)² of all techniques
    [Veach 1997, §9.2]; dimensionless, in [0, 1].
    """
    return _etendue.mis_weight(pdfs, technique, counts)


def counts(scene: Scene, integrator: Any) -> Counts:
    """The counts of an integrator, such as "bdpt", on a scene."""
    return _etendue.counts(scene, integrator)


def sample_paths(
    scene: Scene,
    n: int,
    integrator: Any = "bdpt",
    *,
    seed: int = 0,
    max_vertices: int = 9,
    sampler: str = "independent",
) -> NDArray[Any]:
    """The first n paths with a contribution, in the order of a rendering with one thread, as a structured array, shape (n,).

    Fields: s, t; strategy, a number in the order hit, next_event, connect, splat, hit_lens, merge, gather, specular; pixel,
    its index row by row; vertices, their number; mis_weight; contribution, unweighted radiance of shape (3,); film, in
    pixels, shape (2,); x, positions in scene units, shape (max_vertices, 3), from the emitter to the lens, NaN after the
    last. Longer paths, and those of merges and gathers, are left out.
    """
    fields = [
        ("s", "<i4"), ("t", "<i4"), ("strategy", "<i4"), ("pixel", "<i4"), ("vertices", "<i4"), ("mis_weight", "<f4"),
        ("contribution", "<f4", (3,)), ("film", "<f4", (2,)),
    ]
    records, points = _etendue.sample_paths(scene, n, integrator, seed, max_vertices, sampler)
    found = np.frombuffer(records, dtype=np.dtype(fields))
    out = np.zeros(len(found), dtype=np.dtype([*fields, ("x", "<f4", (max_vertices, 3))]))
    for field in found.dtype.names or ():
        out[field] = found[field]
    out["x"] = np.frombuffer(points, dtype="<f4").reshape(len(found), max_vertices, 3)
    return out
