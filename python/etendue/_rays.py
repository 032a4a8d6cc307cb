"""Rays by the array."""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _etendue
from ._etendue import Scene

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RayHits:
    """The first surfaces that rays hit, from Scene.ray_intersect(). Arrays have the shape (...) of the rays, those of vectors
    (..., 3). hits[i], with an index or a mask, are those of some of the rays:

        hits = scene.ray_intersect(origins, directions)
        hits = hits[hits.is_hit]
        lit = ~scene.occluded(hits.origins(to_sun), to_sun)
    """

    t: Floats
    """Distance, in scene units; inf for rays that hit nothing."""
    p: Floats
    """Position, in scene units, shape (..., 3). This and what follows is NaN for rays that hit nothing."""
    ng: Floats
    """Unit geometric normal of the surface, on the same side as ns, shape (..., 3)."""
    ns: Floats
    """Unit interpolated normal of the surface, shape (..., 3)."""
    uv: Floats
    """Texture coordinates, shape (..., 2)."""
    shape: NDArray[np.int32]
    """Index of the shape, whose name is Scene.shapes[index]; -1 for rays that hit nothing."""
    primitive: NDArray[np.int32]
    """Index of the triangle in its mesh, 0 on other shapes; -1 for rays that hit nothing."""
    slack: Floats
    """Distance from p, along the normal, within which rounding may find the surface again, in scene units."""
    instance: NDArray[np.int32]
    """Number of the instance that shows the shape; -1 for shapes of the scene itself, and for rays that hit nothing."""
    parameters: Floats
    """Parameters of the position within the primitive, shape (..., 2): with them, Scene.bsdf() finds it again."""

    @property
    def is_hit(self) -> NDArray[np.bool_]:
        """Whether each ray hits a surface, shape (...)."""
        return np.isfinite(self.t)

    def origins(self, directions: ArrayLike) -> Floats:
        """Origins of rays that leave the surfaces in these directions, shape (..., 3), in scene units: p, moved off the
        surface so far that rounding does not find it again.
        """
        d = _vectors("directions", directions)
        lead = np.broadcast_shapes(self.t.shape, d.shape[:-1])
        p, ng, d_rows = _rows(lead, self.p), _rows(lead, self.ng), _rows(lead, d)
        moved = np.empty_like(p)
        _etendue.offset_origins(p, ng, _column(lead, self.slack), d_rows, moved)
        return moved.reshape(*lead, 3)

    def __getitem__(self, index: Any) -> "RayHits":
        return RayHits(*(getattr(self, field.name)[index] for field in fields(self)))


def _numbers(name: str, value: ArrayLike) -> Doubles:
    try:
        array = np.asarray(value)
    except ValueError as e:
        raise ValueError(f"{name}: expected an array of numbers ({e})") from None
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{name}: expected an array of numbers, but found one of {array.dtype}")
    return np.asarray(array, dtype=np.float64)


def _first(of: NDArray[np.bool_]) -> tuple[int, ...]:
    """The index of the first True."""
    return tuple(int(i) for i in np.unravel_index(int(np.argmax(of)), of.shape))


def _vectors(name: str, value: ArrayLike) -> Doubles:
    array = _numbers(name, value)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise ValueError(f"{name}: expected an array of shape (..., 3), but found one of {array.shape}")
    largest = np.finfo(np.float32).max
    bad = ~(np.abs(array) <= largest).all(axis=-1)
    if bad.any():
        raise ValueError(f"{name}{list(_first(bad)) or ''} is {array[_first(bad)]}: expected finite numbers of float32")
    return array


def _unit(value: ArrayLike, name: str = "directions") -> Doubles:
    d = _vectors(name, value)
    largest = np.abs(d).max(axis=-1, keepdims=True)
    if not largest.all():
        raise ValueError(f"{name}{list(_first(largest[..., 0] == 0)) or ''} is zero")
    d = d / largest  # so that squares are no denormal numbers
    return np.asarray(d / np.linalg.norm(d, axis=-1, keepdims=True))


def _rows(lead: tuple[int, ...], vectors: NDArray[Any]) -> Floats:
    return np.ascontiguousarray(np.broadcast_to(vectors, (*lead, 3)).reshape(-1, 3), dtype=np.float32)


def _column(lead: tuple[int, ...], numbers: NDArray[Any]) -> Floats:
    return np.ascontiguousarray(np.broadcast_to(numbers, lead).reshape(-1), dtype=np.float32)


def _rays(origins: ArrayLike, directions: ArrayLike, max_distance: ArrayLike) -> tuple[tuple[int, ...], Floats, Floats, Floats]:
    """The common leading shape of the arguments, and the rays as rows."""
    o, d, t = _vectors("origins", origins), _unit(directions), _numbers("max_distance", max_distance)
    if not (t >= 0).all():
        raise ValueError("max_distance must not be negative or NaN")
    try:
        lead = np.broadcast_shapes(o.shape[:-1], d.shape[:-1], t.shape)
    except ValueError:
        raise ValueError(
            f"origins, directions and max_distance do not fit together: their shapes are {o.shape}, {d.shape} and {t.shape}"
        ) from None
    t = np.where(t > np.finfo(np.float32).max, np.inf, t)
    return lead, _rows(lead, o), _rows(lead, d), _column(lead, t)


def intersect(scene: Scene, origins: ArrayLike, directions: ArrayLike, max_distance: ArrayLike) -> RayHits:
    lead, o, d, tmax = _rays(origins, directions, max_distance)
    n = len(o)

    def nan(*columns: int) -> Floats:
        return np.full((n, *columns), np.nan, dtype=np.float32)

    t = np.full(n, np.inf, dtype=np.float32)
    shape, primitive, instance = (np.full(n, -1, dtype=np.int32) for _ in range(3))
    hits = RayHits(t, nan(3), nan(3), nan(3), nan(2), shape, primitive, nan(), instance, nan(2))
    _etendue.intersect_rays(scene, o, d, tmax, *(getattr(hits, field.name) for field in fields(hits)))
    return RayHits(*(a.reshape((*lead, *a.shape[1:])) for a in (getattr(hits, field.name) for field in fields(hits))))


def occluded(scene: Scene, origins: ArrayLike, directions: ArrayLike, max_distance: ArrayLike) -> NDArray[np.bool_]:
    lead, o, d, tmax = _rays(origins, directions, max_distance)
    found = np.zeros(len(o), dtype=np.bool_)
    _etendue.occluded_rays(scene, o, d, tmax, found)
    return found.reshape(lead)
