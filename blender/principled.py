"""Blender's Principled BSDF as a blend of etendue's models.

The structure is Blender's: metal, or else glass, or else a dielectric surface over a diffuse base, under a clear coat. In
Blender the diffuse base loses what the rough surface reflects toward the viewer. Here it is that of `plastic`, which loses
what a smooth surface reflects, times a factor with which it loses as much as in Blender on average.
"""

from __future__ import annotations

import math
from typing import Any

from .albedos import mean_reflectance, microfacets, schlick_mean, several_times
from .nodes import Output
from .surfaces import (Surface, dielectric, diffuse, glass_gain, glossy, mixed, reflecting, rough, scatters_again,
                       weighted_sum, with_normal)
from .values import Value, Values, as_color, is_black, is_texture, luminance, parameter, product

_LEFT_OUT = ("Subsurface Weight", "Sheen Weight", "Thin Film Thickness", "Diffuse Roughness", "Anisotropic Rotation")


def principled(node: Output, values: Values) -> Surface:
    for name in _LEFT_OUT:
        if node.has(name) and (node.input(name).source() or node.input(name).value):
            values.warn(node, f"{name} has no effect")
    color, roughness = values.color(node.input("Base Color")), values.number(node.input("Roughness"))
    metallic, glass = values.number(node.input("Metallic")), values.number(node.input("Transmission Weight"))
    surface = mixed(glass, _plastic(node, values, color, roughness), _glass(node, values, color, roughness))
    surface = mixed(metallic, surface, _metal(node, values, color, roughness))
    surface = _coated(node, values, with_normal(surface, node, values))
    surface.emission = product(values.color(node.input("Emission Color")), values.number(node.input("Emission Strength")))
    surface.opacity = values.number(node.input("Alpha"))
    return surface


def _plastic(node: Output, values: Values, color: Value, roughness: Value) -> Surface:
    """A dielectric surface over a diffuse base; its reflectance at normal incidence is a multiple of that of the index."""
    level, ior = (values.constant(node.input(n), node) for n in ("Specular IOR Level", "IOR"))
    root = math.sqrt(min(((ior - 1) / (ior + 1)) ** 2 * 2 * max(level, 0.0), 0.98))
    tint = values.color(node.input("Specular Tint"))
    if root == 0 or is_black(tint):
        return diffuse(color)
    eta, facets = (1 + root) / (1 - root), rough(roughness, node, values)
    base = {"type": "plastic", "diffuse_reflectance": parameter(color), "int_ior": eta, "ext_ior": 1.0}
    if not facets:
        return Surface(reflecting({**base, "specular_reflectance": parameter(tint)}))
    base = reflecting({**base, "specular_reflectance": 0.0})
    smooth, share, gain = mean_reflectance(eta), 1.0, 1.0
    if not is_texture(roughness):
        gain = several_times(smooth, roughness**2) if scatters_again(roughness, node) else 1.0
        lost = microfacets(roughness**2, eta)[0] * gain * (1.0 if is_texture(tint) else luminance(tint))
        share = (1 - lost) / (1 - smooth)
    return Surface(weighted_sum([(share, base), (gain, _reflection(eta, facets, tint))]))


def _reflection(eta: float, facets: dict[str, Any], tint: Value = 1.0) -> dict[str, Any]:
    """The reflection of a dielectric surface alone, rough or, without parameters of facets, smooth."""
    factors = {"diffuse_reflectance": 0.0, "glossy_reflectance": 0.0}
    factors["glossy_reflectance" if facets else "specular_reflectance"] = parameter(tint)
    return {"type": "lobesum", **facets, "eta": eta, **factors}


def _metal(node: Output, values: Values, color: Value, roughness: Value) -> Surface:
    """Microfacets with Schlick's approximation of the Fresnel term."""
    parameters = {"metallic": 1.0, "base_color": parameter(color), "roughness": parameter(roughness)}
    anisotropy = values.constant(node.input("Anisotropic"), node)
    if anisotropy:
        parameters["anisotropic"] = anisotropy
    mean = color if is_texture(color) else tuple(schlick_mean(c) for c in color)
    return glossy({"type": "principled", **parameters}, mean, roughness, node)


def _glass(node: Output, values: Values, color: Value, roughness: Value) -> Surface:
    """Glass whose transmission has the square root of the colour, since light passes two surfaces."""
    ior = values.constant(node.input("IOR"), node)
    if is_texture(color):
        parameters = {"spec_trans": 1.0, "base_color": color, "roughness": parameter(roughness), "eta": ior}
        return Surface({"type": "principled", **parameters})
    gain = glass_gain(ior, roughness, node)
    root = tuple(math.sqrt(max(c, 0.0)) * gain for c in color)
    return Surface(dielectric(ior, rough(roughness, node, values), gain, root))


def _coated(node: Output, values: Values, base: Surface) -> Surface:
    """A clear coat: its reflection is added, and the base loses the mean reflectance of the coat."""
    weight = values.constant(node.input("Coat Weight"), node)
    if weight <= 0:
        return base
    if as_color(node.input("Coat Tint").value) != (1.0, 1.0, 1.0) or node.input("Coat Tint").source():
        values.warn(node, "Coat Tint has no effect")
    ior, roughness = values.constant(node.input("Coat IOR"), node), values.number(node.input("Coat Roughness"))
    coat = Surface(_reflection(ior, rough(roughness, node, values)))
    coated = with_normal(coat, node, values, "Coat Normal")
    base.bsdf = weighted_sum([(1 - weight * mean_reflectance(ior), base.bsdf), (weight, coated.bsdf)])
    return base
