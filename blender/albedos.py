"""Mean albedos of rough surfaces, by which models that differ from Blender's reflect as much as these."""

from __future__ import annotations

import functools
import math

import numpy as np

_SAMPLES = 1 << 14


@functools.lru_cache(maxsize=256)
def microfacets(alpha: float, ior: float = 0.0) -> tuple[float, float, float]:
    """Of GGX facets with single scattering and separable shadowing, averaged over directions from outside: what they
    reflect; what they transmit; and what they would transmit without a Fresnel term. ior 0: white metal.
    """
    wo, m, cos = _directions(alpha)
    seen = _masking(2 * cos[:, None] * m - wo, alpha)
    if not ior:
        return float(seen.mean()), 0.0, 0.0
    reflectance = fresnel(cos, ior)
    below = (np.sqrt(np.maximum(1 - (1 - cos * cos) / ior**2, 0)) - cos / ior)[:, None] * m + wo / ior
    passed = _masking(below, alpha)
    return tuple(float(x.mean()) for x in (reflectance * seen, (1 - reflectance) * passed, passed))


def _directions(alpha: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directions of a low-discrepancy sequence, in proportion to their cosines, and normals of facets that are visible from them
    [Dupuy & Benyoub 2023]; with their cosines.
    """
    i = np.arange(_SAMPLES)
    u, v, w = ((0.5 + i * a) % 1 for a in (0.8191725133961645, 0.6710436067037893, 0.5497004779019703))
    wo = np.stack([np.sqrt(1 - u), np.zeros_like(u), np.sqrt(u)], 1)
    stretched = _unit(wo * (alpha, alpha, 1))
    z = (1 - v) * (1 + stretched[:, 2]) - stretched[:, 2]
    r = np.sqrt(np.maximum(1 - z * z, 0))
    cap = np.stack([r * np.cos(2 * np.pi * w), r * np.sin(2 * np.pi * w), z], 1)
    m = _unit((cap + stretched) * (alpha, alpha, 1))
    return wo, m, np.sum(wo * m, 1)


@functools.lru_cache(maxsize=256)
def _correlated(alpha: float) -> float:
    """What white facets reflect at first with the shadowing of Cycles, which depends on heights."""
    wo, m, cos = _directions(alpha)
    wi = 2 * cos[:, None] * m - wo
    o, i = (np.maximum(_masking(w, alpha), 1e-9) for w in (wo, wi))
    return float(np.where(wi[:, 2] > 0, 1 / (1 + o / i - o), 0).mean())


def schlick_mean(normal: float) -> float:
    """The mean over directions of a metal with this reflectance along the normal."""
    return normal + (1 - normal) / 21


def _unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def _masking(w: np.ndarray, alpha: float) -> np.ndarray:
    """Smith's G1 of directions, 0 below the surface."""
    z = np.maximum(w[:, 2], 1e-9)
    return np.where(w[:, 2] > 0, 2 / (1 + np.sqrt(1 + alpha**2 * (1 / z**2 - 1))), 0)


def fresnel(cos: np.ndarray, ior: float) -> np.ndarray:
    """The reflectance of a dielectric from outside; ior is at least 1."""
    cos_t = np.sqrt(np.maximum(1 - (1 - cos * cos) / ior**2, 0))
    s, p = (cos - ior * cos_t) / (cos + ior * cos_t), (ior * cos - cos_t) / (ior * cos + cos_t)
    return (s * s + p * p) / 2


def mean_reflectance(ior: float) -> float:
    """The reflectance of a smooth dielectric averaged over cosine-weighted directions."""
    steps = (np.arange(256) + 0.5) / 256
    return float(fresnel(np.sqrt(steps), ior).mean())


def refraction_gain(ior: float, alpha: float) -> float:
    """The factor by which glass transmits as much as without a Fresnel term, through two surfaces at the same angle."""
    _, transmitted, passed = microfacets(alpha, ior)
    f = fresnel(np.sqrt((np.arange(256) + 0.5) / 256), ior)
    return passed / transmitted * float((1 - f).mean() / np.sqrt(((1 - f) ** 2).mean()))


def several_times(reflectance: float, alpha: float) -> float:
    """By what the facets of Cycles, between which light is scattered several times [Turquin 2019], reflect more than those of
    microfacets(). `reflectance`: the mean Fresnel term.
    """
    once = _correlated(alpha)
    again = reflectance * once / (1 - reflectance * (1 - once))
    return (once + again * (1 - once)) / microfacets(alpha)[0]


def rough_diffuse(roughness: float, color: tuple[float, ...]) -> tuple[float, float, tuple[float, ...]]:
    """The rough diffuse reflection of Cycles [Fujii 2012; Portsmouth et al. 2024] by `orennayar`, which has nearly the same
    directions: its sigma in radians, a factor, and its reflectance, for the same mean albedo.
    """
    sigmas = np.linspace(0, math.pi / 2, 1024)
    a, b = 1 - 0.5 * sigmas**2 / (sigmas**2 + 0.33), 0.45 * sigmas**2 / (sigmas**2 + 0.09)
    # The roughness is the ratio of the two terms in Cycles; beyond what the older model has, its largest one.
    i = int(np.argmin(np.abs(b / a - roughness)))
    single = (1 + roughness * (_FORWARD - _BACKWARD)) / (1 + (0.5 - 2 / (3 * math.pi)) * roughness)
    albedo = tuple(c * single + c * c * single * (1 - single) / (1 - c * (1 - single)) for c in color)
    return float(sigmas[i]), 1 / float(a[i] + b[i] * _FORWARD), albedo


def _second_terms() -> tuple[float, float]:
    """The means of sin i sin o |cos φ| where cos φ is positive, divided by the larger cosine, and where it is negative."""
    mu = (np.arange(256) + 0.5) / 256
    i, o = np.meshgrid(mu, mu)
    product = np.sqrt((1 - i * i) * (1 - o * o)) * i * o * 4 / np.pi
    return float((product / np.maximum(i, o)).mean()), float(product.mean())


_FORWARD, _BACKWARD = _second_terms()


def _conductor_fresnel(cos: float, n: np.ndarray, k2: np.ndarray) -> np.ndarray:
    sin2 = 1 - cos**2
    t = n * n - k2 - sin2
    both = np.sqrt(t * t + 4 * n * n * k2)
    a = np.sqrt(np.maximum((both + t) / 2, 0))
    s = (both + cos**2 - 2 * a * cos) / (both + cos**2 + 2 * a * cos)
    p = s * (cos**2 * both + sin2**2 - 2 * a * cos * sin2) / (cos**2 * both + sin2**2 + 2 * a * cos * sin2)
    return (s + p) / 2


def conductor(normal: float, edge: float) -> tuple[float, float]:
    """The index of refraction and the extinction of a metal with these reflectances along the normal and at 82 degrees from
    it, or as near as there is one to the latter.
    """
    r = min(max(normal, 0.0), 0.999)
    root = math.sqrt(r)
    n = np.linspace(max((1 - root) / (1 + root), 1e-3), (1 + root) / (1 - root), 4096)
    k2 = np.maximum((r * (n + 1) ** 2 - (n - 1) ** 2) / (1 - r), 0)
    best = int(np.argmin(np.abs(_conductor_fresnel(1 / 7, n, k2) - edge)))
    return float(n[best]), float(math.sqrt(k2[best]))
