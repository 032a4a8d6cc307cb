"""Materials and the rays of the sensor by the array."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _etendue
from ._etendue import Scene
from ._rays import Doubles, Floats, RayHits, _column, _numbers, _rows, _unit

Mode = Literal["radiance", "importance"]


@dataclass(frozen=True, eq=False)
class BsdfSamples:
    """Directions that Bsdfs.sample() has drawn. Arrays have the shape (...) of the arguments, those of vectors (..., 3)."""

    wi: Floats
    """Unit direction, shape (..., 3); NaN where the material absorbs, and the path ends."""
    weight: Floats
    """f |cos θ| / pdf as linear RGB, shape (..., 3); 0 where the path ends."""
    pdf: Floats
    """Density of wi in solid angle, 1/sr; for a mirror or clear glass the probability of this direction; 0 where the path ends."""
    is_delta: NDArray[np.bool_]
    """Whether wi is one of the directions of a mirror or of clear glass, which eval() and pdf() never have."""


@dataclass(frozen=True, eq=False)
class SensorRays:
    """Rays of the sensor, from Scene.sensor_rays(). Arrays have the shape (...) of the film points."""

    origins: Floats
    """On the lens, in scene units, shape (..., 3)."""
    directions: Floats
    """Unit vectors into the scene, shape (..., 3)."""
    pdf_position: Floats
    """Density of the origin on the lens, in 1 over the square of scene units; 1 for a pinhole and orthographic sensors."""
    pdf_direction: Floats
    """Density of the direction for a point of the film that is uniform in a pixel, 1/sr; of an orthographic sensor that of the
    ray in the plane normal to it, in 1 over the square of scene units.
    """


class Bsdfs:
    """The materials at many points of surfaces, from Scene.bsdf().

        rays = scene.sensor_rays()
        hits = scene.ray_intersect(rays.origins, rays.directions)
        wo = -rays.directions[hits.is_hit]
        bsdf = scene.bsdf(hits[hits.is_hit])
        s = bsdf.sample(wo, np.random.random(len(wo)), np.random.random((len(wo), 2)))

    Directions point away from the surface, have any length except 0, and are those of the scene. `wo` is the one toward the
    viewer, that is toward the previous vertex of the path, and `wi` the other one. All methods broadcast their arguments with
    the points, run in several threads while other Python threads continue, and raise ValueError for other shapes and for
    numbers that are not finite. Masks (bsdf "mask") have no effect: the material is that of what a ray hits.

    mode: "radiance" where wo points toward the viewer, and "importance" where it points toward the light; they differ by
        the corrections for shading normals and refraction.
    """

    def __init__(self, scene: Scene, shape: NDArray[np.int32], primitive: NDArray[np.int32], instance: NDArray[np.int32],
                 parameters: Floats) -> None:
        self._scene = scene
        self._places = (shape, primitive, instance)
        self._parameters = parameters

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape (...) of the array of points."""
        return self._places[0].shape

    def eval(self, wo: ArrayLike, wi: ArrayLike, mode: Mode = "radiance") -> Floats:
        """f |cos θ| between two directions as linear RGB, 1/sr, shape (..., 3), without mirrors and clear glass."""
        return self._eval(wo, wi, mode)[0]

    def pdf(self, wo: ArrayLike, wi: ArrayLike, mode: Mode = "radiance") -> Floats:
        """Density of sample() at wi in solid angle, 1/sr, shape (...), without mirrors and clear glass."""
        return self._eval(wo, wi, mode)[1]

    def sample(self, wo: ArrayLike, u_lobe: ArrayLike, u: ArrayLike, mode: Mode = "radiance") -> BsdfSamples:
        """Draws a direction for each wo.

        u_lobe: random numbers in [0, 1) that choose the lobe, shape (...). u: the same for the direction, shape (..., 2).
        """
        d, lobe, numbers = _unit(wo, "wo"), _uniform("u_lobe", u_lobe), _uniform("u", u, 2)
        lead = self._lead(wo=d.shape[:-1], u_lobe=lobe.shape, u=numbers.shape[:-1])
        places, n = self._columns(lead), int(np.prod(lead))
        wi, weight = np.full((n, 3), np.nan, np.float32), np.zeros((n, 3), np.float32)
        pdf, is_delta = np.zeros(n, np.float32), np.zeros(n, np.bool_)
        _etendue.sample_bsdfs(self._scene, *places, _rows(lead, d), _below_1(_column(lead, lobe)),
                              _below_1(_pairs(lead, numbers)), _is_importance(mode), wi, weight, pdf, is_delta)
        return BsdfSamples(wi.reshape(*lead, 3), weight.reshape(*lead, 3), pdf.reshape(lead), is_delta.reshape(lead))

    def _eval(self, wo: ArrayLike, wi: ArrayLike, mode: Mode) -> tuple[Floats, Floats]:
        o, i = _unit(wo, "wo"), _unit(wi, "wi")
        lead = self._lead(wo=o.shape[:-1], wi=i.shape[:-1])
        places, n = self._columns(lead), int(np.prod(lead))
        f, pdf = np.zeros((n, 3), np.float32), np.zeros(n, np.float32)
        _etendue.eval_bsdfs(self._scene, *places, _rows(lead, o), _rows(lead, i), _is_importance(mode), f, pdf)
        return f.reshape(*lead, 3), pdf.reshape(lead)

    def _lead(self, **shapes: tuple[int, ...]) -> tuple[int, ...]:
        try:
            return np.broadcast_shapes(self.shape, *shapes.values())
        except ValueError:
            found = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
            raise ValueError(f"the arrays do not fit together: points {self.shape}, {found}") from None

    def _columns(self, lead: tuple[int, ...]) -> tuple[NDArray[Any], ...]:
        numbers = (np.ascontiguousarray(np.broadcast_to(a, lead).reshape(-1)) for a in self._places)
        return (*numbers, _pairs(lead, self._parameters))

    def __repr__(self) -> str:
        return f"<Bsdfs {self.shape}>"


def _is_importance(mode: str) -> bool:
    if mode not in ("radiance", "importance"):
        raise ValueError(f'mode must be "radiance" or "importance", but is {mode!r}')
    return mode == "importance"


def _pairs(lead: tuple[int, ...], numbers: NDArray[Any]) -> Floats:
    return np.ascontiguousarray(np.broadcast_to(numbers, (*lead, 2)).reshape(-1, 2), dtype=np.float32)


def _below_1(numbers: Floats) -> Floats:
    """Without those that rounding to float32 makes 1."""
    return np.minimum(numbers, np.float32(1 - 2**-24))


def _finite(name: str, value: ArrayLike, columns: int) -> Doubles:
    array = _numbers(name, value)
    if columns and (array.ndim == 0 or array.shape[-1] != columns):
        raise ValueError(f"{name}: expected an array of shape (..., {columns}), but found one of {array.shape}")
    if not np.isfinite(array.astype(np.float32)).all():
        raise ValueError(f"{name} must be finite")
    return array


def _uniform(name: str, value: ArrayLike, columns: int = 0) -> Doubles:
    array = _finite(name, value, columns)
    if not ((array >= 0) & (array < 1)).all():
        raise ValueError(f"{name} must lie in [0, 1)")
    return array


def bsdf(scene: Scene, at: Any, uv: ArrayLike) -> Bsdfs:
    if isinstance(at, RayHits):
        if not at.is_hit.all():
            raise ValueError("some of the rays hit nothing: take hits[hits.is_hit]")
        if (at.shape >= len(scene.shapes)).any():
            raise ValueError("these are hits of another scene")
        return Bsdfs(scene, at.shape, at.primitive, at.instance, at.parameters)
    coordinates = _finite("uv", uv, 2).astype(np.float32)
    numbers = np.full(coordinates.shape[:-1], _shape_number(scene, at), np.int32)
    return Bsdfs(scene, numbers, np.full_like(numbers, -1), np.full_like(numbers, -1), coordinates)


def _shape_number(scene: Scene, at: Any) -> int:
    names = scene.shapes
    if isinstance(at, str):
        found = [i for i, name in enumerate(names) if name == at]
        if len(found) == 1:
            return found[0]
        if found:
            raise ValueError(f"{len(found)} shapes have the name {at!r}: give the number of one, such as {found[0]}")
        raise ValueError(f"there is no shape {at!r}; there are: {', '.join(sorted(set(names)))}")
    if not isinstance(at, (int, np.integer)) or isinstance(at, bool):
        raise TypeError(f"expected hits, or the name or number of a shape, but found {type(at).__name__}")
    if not 0 <= at < len(names):
        raise ValueError(f"the number of a shape lies in [0, {len(names)}), but is {at}")
    return int(at)


def sensor_rays(scene: Scene, film: ArrayLike | None, lens: ArrayLike) -> SensorRays:
    if film is None:
        x, y = scene.crop_offset
        film = np.stack(np.meshgrid(x + np.arange(scene.width) + 0.5, y + np.arange(scene.height) + 0.5), axis=-1)
    points, on_lens = _finite("film", film, 2), _uniform("lens", lens, 2)
    try:
        lead = np.broadcast_shapes(points.shape[:-1], on_lens.shape[:-1])
    except ValueError:
        raise ValueError(f"film and lens do not fit together: their shapes are {points.shape} and {on_lens.shape}") from None
    n = int(np.prod(lead))
    o, d = np.empty((n, 3), np.float32), np.empty((n, 3), np.float32)
    position, direction = np.empty(n, np.float32), np.empty(n, np.float32)
    _etendue.sensor_rays(scene, _pairs(lead, points), _below_1(_pairs(lead, on_lens)), o, d, position, direction)
    return SensorRays(o.reshape(*lead, 3), d.reshape(*lead, 3), position.reshape(lead), direction.reshape(lead))
