"""Surfaces: BSDFs with emission and opacity, their mixtures and sums, and normals of maps."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from .albedos import microfacets, several_times
from .nodes import Output
from .values import Value, Values, bounded, is_black, is_texture, mixture, parameter, product

SMOOTH = 0.01
"""Constant roughnesses below this one are mirrors or clear glass."""


@dataclass
class Surface:
    """What a shader computes. Light meets the BSDF with the probability `opacity`, and passes otherwise."""

    bsdf: dict[str, Any]
    emission: Value = (0.0, 0.0, 0.0)
    """Radiance where the surface is opaque."""
    opacity: Value = 1.0

    def masked(self) -> dict[str, Any]:
        """The BSDF with its opacity."""
        if self.opacity == 1.0:
            return self.bsdf
        return {"type": "mask", "opacity": parameter(self.opacity), "bsdf": self.bsdf}


def reflecting(bsdf: dict[str, Any]) -> dict[str, Any]:
    """A BSDF that reflects, made to do so on both sides, as in Blender."""
    return {"type": "twosided", "bsdf": bsdf}


def diffuse(color: Value) -> Surface:
    return Surface(reflecting({"type": "diffuse", "reflectance": parameter(bounded(color))}))


BLACK = diffuse((0.0, 0.0, 0.0))


def rough(roughness: Value, node: Output, values: Values, anisotropy: float = 0.0) -> dict[str, Any]:
    """The parameters of microfacets for a roughness of Blender, whose square is α; empty for a smooth surface."""
    if not is_texture(roughness) and roughness < SMOOTH:
        return {}
    alpha = product(roughness, roughness)
    kind = getattr(node.node, "distribution", "GGX")
    if kind == "ASHIKHMIN_SHIRLEY":
        values.warn(node, "the distribution Ashikhmin-Shirley is GGX instead")
    parameters = {"distribution": "beckmann" if kind == "BECKMANN" else "ggx"}
    if not anisotropy:
        return {**parameters, "alpha": parameter(alpha)}
    a = min(max(anisotropy, -0.99), 0.99)
    across = 1 / (1 + a) if a < 0 else 1 - a
    return {**parameters, "alpha_u": product(alpha, across), "alpha_v": product(alpha, 1 / across)}


def scatters_again(roughness: Value, node: Output) -> bool:
    """Whether light is scattered several times between the microfacets of a node."""
    return getattr(node.node, "distribution", "") == "MULTI_GGX" and not is_texture(roughness) and roughness >= SMOOTH


def glossy(bsdf: dict[str, Any], color: Value, roughness: Value, node: Output) -> Surface:
    """Microfacets that reflect this colour on average, on both sides. The distribution Multiscatter GGX adds what is scattered
    several times between them, as much as in Cycles [Turquin 2019] on average over directions, as a diffuse part.
    """
    single = reflecting(bsdf)
    if not scatters_again(roughness, node):
        return Surface(single)
    albedo = microfacets(roughness**2)[0]
    if is_texture(color):
        more = product(product(color, color), 1 - albedo)
    else:
        more = tuple(c * albedo * (several_times(c, roughness**2) - 1) for c in color)
    return Surface(weighted_sum([(1.0, single), (1.0, diffuse(more).bsdf)]))


def dielectric(ior: float, roughness: dict[str, Any], reflected: Value = 1.0, transmitted: Value = 1.0) -> dict[str, Any]:
    """Glass, smooth or rough, with factors of what it reflects and transmits."""
    return {"type": "roughdielectric" if roughness else "dielectric", **roughness, "int_ior": ior, "ext_ior": 1.0,
            "specular_reflectance": parameter(reflected), "specular_transmittance": parameter(transmitted)}


def glass_gain(ior: float, roughness: Value, node: Output) -> float:
    """The factor with which rough glass loses no light from outside, for the distribution Multiscatter GGX."""
    if not scatters_again(roughness, node):
        return 1.0
    return 1 / sum(microfacets(roughness**2, max(ior, 1 / ior))[:2])


def mixed(weight: Value, a: Surface, b: Surface) -> Surface:
    """(1 - weight) a + weight b."""
    weight = bounded(weight)
    if weight in (0.0, 1.0):
        return b if weight else a
    if a.opacity == 0.0 or b.opacity == 0.0:
        shown, share = (b, weight) if a.opacity == 0.0 else (a, mixture(weight, 1.0, 0.0))
        return replace(shown, opacity=product(share, shown.opacity))
    opacity = mixture(weight, a.opacity, b.opacity)
    # Of the light that meets the surface, the second one gets the share weight · b.opacity / opacity.
    if all(not is_texture(v) for v in (weight, opacity, b.opacity)) and opacity:
        weight = weight * b.opacity / opacity
    emission = mixture(weight, a.emission, b.emission)
    if a.bsdf == b.bsdf:
        return Surface(a.bsdf, emission, opacity)
    return Surface({"type": "blendbsdf", "weight": parameter(weight), "bsdf": a.bsdf, "bsdf_2": b.bsdf}, emission, opacity)


def weighted_sum(parts: list[tuple[float, dict[str, Any]]]) -> dict[str, Any]:
    """A sum of BSDFs, which may reflect more light than they receive."""
    bsdfs = {"bsdf" if i == 0 else f"bsdf_{i + 1}": bsdf for i, (_, bsdf) in enumerate(parts)}
    weights = ", ".join(f"{weight:.9g}" for weight, _ in parts)
    return {"type": "mixturebsdf", "weights": weights, "ensure_energy_conservation": False, **bsdfs}


def summed(a: Surface, b: Surface, node: Output, values: Values) -> Surface:
    """The sum of two shaders."""
    if a.opacity != 1.0 or b.opacity != 1.0:
        values.warn(node, "transparency in a sum is left out")
    emissions = [s.emission for s in (a, b) if not is_black(s.emission)]
    if len(emissions) < 2:
        emission = emissions[0] if emissions else (0.0, 0.0, 0.0)
    else:
        emission = product(mixture(0.5, *emissions), 2.0)
    bsdfs = [s.bsdf for s in (a, b) if s.bsdf != BLACK.bsdf]
    if len(bsdfs) < 2:
        return Surface(bsdfs[0] if bsdfs else BLACK.bsdf, emission)
    return Surface(weighted_sum([(1.0, bsdf) for bsdf in bsdfs]), emission)


def with_normal(surface: Surface, node: Output, values: Values, name: str = "Normal") -> Surface:
    """The surface with the normal that is linked to an input of its node."""
    source = node.input(name).source()
    while source is not None:
        if source.node.bl_idname == "ShaderNodeNormalMap":
            wrapper = _normal_map(source, values)
            inner = None
        elif source.node.bl_idname == "ShaderNodeBump":
            wrapper = _bump(source, values)
            inner = source.input("Normal").source()
        elif source.node.bl_idname == "ShaderNodeNewGeometry":
            return surface
        else:
            values.warn(source, f"not supported; {name} is that of the surface")
            return surface
        if wrapper:
            surface = replace(surface, bsdf={**wrapper, "bsdf": surface.bsdf})
        source = inner
    return surface


def _normal_map(node: Output, values: Values) -> dict[str, Any] | None:
    color, strength = values.color(node.input("Color")), values.constant(node.input("Strength"), node)
    if node.node.space != "TANGENT":
        values.warn(node, f"the space {node.node.space} is not supported; the normal is that of the surface")
        return None
    if not is_texture(color) or strength == 0:
        return None
    # Blender moves the normal, not only its x and y, toward that of the surface.
    normals = mixture(min(strength, 1.0), (0.5, 0.5, 1.0), color)
    return {"type": "normalmap", "normalmap": normals, "scale": max(strength, 1.0)}


def _bump(node: Output, values: Values) -> dict[str, Any] | None:
    height = values.number(node.input("Height"))
    scale = values.constant(node.input("Strength"), node) * values.constant(node.input("Distance"), node)
    if not is_texture(height) or scale == 0:
        return None
    return {"type": "bumpmap", "displacement": height, "scale": -scale if node.node.invert else scale}
