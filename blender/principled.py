"""Blender's Principled BSDF as etendue's `openpbr`, of which the structure is the same: metal, glass, or a dielectric surface over
a diffuse base, under a clear coat and sheen.
"""

from __future__ import annotations

from typing import Any

from .albedos import mean_reflectance
from .nodes import Output
from .surfaces import Surface, reflecting, rough, weighted_sum, with_normal
from .values import Value, Values, bounded, is_texture, parameter, product

_LEFT_OUT = ("Subsurface Weight", "Thin Film Thickness", "Anisotropic Rotation")


def principled(node: Output, values: Values) -> Surface:
    for name in _LEFT_OUT:
        if node.has(name) and (node.input(name).source() or node.input(name).value):
            values.warn(node, f"{name} has no effect")
    color = bounded(values.color(node.input("Base Color")))
    glass = bounded(values.number(node.input("Transmission Weight")))
    bsdf = {
        "type": "openpbr",
        "base_color": parameter(color),
        "base_metalness": bounded(values.number(node.input("Metallic"))),
        "specular_color": parameter(values.color(node.input("Specular Tint"))),
        "specular_ior": max(values.constant(node.input("IOR"), node), 0.01),
        **_facets(node, values),
        "transmission_weight": glass,
        "transmission_color": parameter(color),
        **_sheen(node, values),
    }
    if node.has("Diffuse Roughness"):
        bsdf["base_diffuse_roughness"] = bounded(values.number(node.input("Diffuse Roughness")))
    # The level is a factor of the reflectance along the normal, except of glass.
    if glass != 1.0:
        bsdf["specular_weight"] = product(values.number(node.input("Specular IOR Level")), 2.0)
    coat = values.number(node.input("Coat Weight"))
    # A coat has normals of its own.
    has_own_normal = is_texture(coat) or coat > 0
    has_own_normal = has_own_normal and any(node.input(name).source() for name in ("Normal", "Coat Normal"))
    if not has_own_normal:
        bsdf.update(_coat(node, values, coat))
    surface = with_normal(Surface(reflecting(bsdf) if glass == 0.0 else bsdf), node, values)
    if has_own_normal:
        surface = _below_a_coat(node, values, surface)
    surface.emission = product(values.color(node.input("Emission Color")), values.number(node.input("Emission Strength")))
    surface.opacity = bounded(values.number(node.input("Alpha")))
    return surface


def _facets(node: Output, values: Values) -> dict[str, Any]:
    """In Blender the ratio of the roughnesses α across and along is 1 - 0.9 · Anisotropic and their product that without it;
    here their mean square is."""
    roughness, anisotropy = values.number(node.input("Roughness")), values.constant(node.input("Anisotropic"), node)
    if anisotropy <= 0:
        return {"specular_roughness": bounded(roughness)}
    ratio = 1 - 0.9 * min(anisotropy, 1.0)
    wider = product(roughness, ((ratio + 1 / ratio) / 2) ** 0.25)
    return {"specular_roughness": bounded(wider), "specular_roughness_anisotropy": 1 - ratio}


def _coat(node: Output, values: Values, weight: Value) -> dict[str, Any]:
    if weight == 0.0:
        return {}
    return {
        "coat_weight": bounded(weight),
        "coat_color": parameter(bounded(values.color(node.input("Coat Tint")))),
        "coat_roughness": bounded(values.number(node.input("Coat Roughness"))),
        "coat_ior": max(values.constant(node.input("Coat IOR"), node), 1.0),
    }


def _sheen(node: Output, values: Values) -> dict[str, Any]:
    weight = values.number(node.input("Sheen Weight"))
    if weight == 0.0:
        return {}
    return {
        "fuzz_weight": bounded(weight),
        "fuzz_color": parameter(bounded(values.color(node.input("Sheen Tint")))),
        "fuzz_roughness": bounded(values.number(node.input("Sheen Roughness"))),
    }


def _below_a_coat(node: Output, values: Values, base: Surface) -> Surface:
    """A clear coat with other normals: its reflection is added, and the base loses the mean reflectance of the coat."""
    weight = min(values.constant(node.input("Coat Weight"), node), 1.0)
    if values.color(node.input("Coat Tint")) != (1.0, 1.0, 1.0):
        values.warn(node, "Coat Tint has no effect beside a linked normal")
    ior, roughness = values.constant(node.input("Coat IOR"), node), values.number(node.input("Coat Roughness"))
    facets = rough(roughness, node, values)
    factors = {"diffuse_reflectance": 0.0, "glossy_reflectance": 0.0}
    factors["glossy_reflectance" if facets else "specular_reflectance"] = 1.0
    coat = with_normal(Surface({"type": "lobesum", **facets, "eta": ior, **factors}), node, values, "Coat Normal")
    base.bsdf = weighted_sum([(1 - weight * mean_reflectance(ior), base.bsdf), (weight, coat.bsdf)])
    return base
