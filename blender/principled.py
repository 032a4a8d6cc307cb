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
    metal = bounded(values.number(node.input("Metallic")))
    glass = bounded(values.number(node.input("Transmission Weight"))) if metal != 1.0 else 0.0
    bsdf = {
        "type": "openpbr",
        "base_color": parameter(color),
        "base_metalness": metal,
        "specular_color": parameter(_positive(values.color(node.input("Specular Tint")))),
        "specular_ior": max(values.constant(node.input("IOR"), node), 0.01),
        "specular_roughness": bounded(values.number(node.input("Roughness"))),
        "transmission_weight": glass,
        "transmission_color": parameter(color),
        **_sheen(node, values),
    }
    if node.has("Diffuse Roughness"):
        bsdf["base_diffuse_roughness"] = bounded(values.number(node.input("Diffuse Roughness")))
    coat = values.number(node.input("Coat Weight"))
    # A coat has normals of its own.
    has_own_normal = is_texture(coat) or coat > 0
    has_own_normal = has_own_normal and any(node.input(name).source() for name in ("Normal", "Coat Normal"))
    if not has_own_normal:
        bsdf.update(_coat(node, values, coat))
    surface = with_normal(Surface(_slabs(bsdf, _of_opaque_parts(node, values), metal, glass)), node, values)
    if has_own_normal:
        surface = _below_a_coat(node, values, surface, bounded(coat))
    emission = (values.color(node.input("Emission Color")), values.number(node.input("Emission Strength")))
    surface.emission = product(*(_positive(v) for v in emission))
    surface.opacity = bounded(values.number(node.input("Alpha")))
    return surface


def _positive(value: Value) -> Value:
    """A constant without negative components, which etendue refuses."""
    if is_texture(value):
        return value
    return tuple(max(c, 0.0) for c in value) if isinstance(value, tuple) else max(value, 0.0)


def _of_opaque_parts(node: Output, values: Values) -> dict[str, Any]:
    """What glass does not have: a stretched roughness, and a factor of the reflectance along the normal."""
    made: dict[str, Any] = {}
    anisotropy = min(values.constant(node.input("Anisotropic"), node), 1.0)
    if anisotropy > 0:
        # The ratio of the roughnesses α across and along; their product is that without anisotropy.
        made = stretched(values.number(node.input("Roughness")), 1 - 0.9 * anisotropy)
        warn_of_tangents(node, values)
    weight = product(_positive(values.number(node.input("Specular IOR Level"))), 2.0)
    return made if weight == 1.0 else {**made, "specular_weight": weight}


def warn_of_tangents(node: Output, values: Values) -> None:
    """Highlights are stretched along the coordinates of textures."""
    if node.has("Tangent") and node.input("Tangent").source():
        values.warn(node, "Tangent has no effect")


def stretched(roughness: Value, ratio: float) -> dict[str, Any]:
    """The roughness of facets, where α across is α along times a ratio, and their product that of round ones; etendue has the
    mean of their squares."""
    wider = product(roughness, ((ratio + 1 / ratio) / 2) ** 0.25)
    return {"specular_roughness": bounded(wider), "specular_roughness_anisotropy": 1 - ratio if ratio < 1 else 1 / ratio - 1}


def _slabs(bsdf: dict[str, Any], of_opaque: dict[str, Any], metal: Value, glass: Value) -> dict[str, Any]:
    """Metal, glass and the opaque dielectric, blended where glass differs from them in more than its weight."""
    if glass == 0.0:
        return reflecting({**bsdf, **of_opaque})
    if not of_opaque or (glass == 1.0 and metal == 0.0):
        return bsdf

    def opaque(share: Value) -> dict[str, Any]:
        return reflecting({**bsdf, **of_opaque, "transmission_weight": 0.0, "base_metalness": share})

    clear = {**bsdf, "transmission_weight": 1.0, "base_metalness": 0.0}
    if not is_texture(metal) and not is_texture(glass):
        share = (1 - metal) * glass
        return _blend(share, opaque(metal / (1 - share)), clear)
    rest = clear if glass == 1.0 else _blend(glass, opaque(0.0), clear)
    return rest if metal == 0.0 else _blend(metal, rest, opaque(1.0))


def _blend(weight: Value, a: dict[str, Any], b: dict[str, Any]) -> dict[str, Any]:
    return {"type": "blendbsdf", "weight": weight, "bsdf": a, "bsdf_2": b}


def _coat(node: Output, values: Values, weight: Value) -> dict[str, Any]:
    if weight == 0.0:
        return {}
    return {
        "coat_weight": bounded(weight),
        "coat_color": parameter(bounded(values.color(node.input("Coat Tint")))),
        "coat_roughness": bounded(values.number(node.input("Coat Roughness"))),
        "coat_ior": max(values.constant(node.input("Coat IOR"), node), 1.0),
        # What lies below is as without the coat.
        "coat_affect_ior": 0.0,
        "coat_affect_roughness": 0.0,
    }


def _sheen(node: Output, values: Values) -> dict[str, Any]:
    """Sheen takes from what lies below as much as the largest component of its colour."""
    weight = bounded(values.number(node.input("Sheen Weight")))
    tint = bounded(values.color(node.input("Sheen Tint"))) if weight != 0.0 else (0.0, 0.0, 0.0)
    if is_texture(tint):
        color = product(tint, weight)
        made = {name: {"type": "sheen_to_fuzz", "output": name, "color": color} for name in ("fuzz_weight", "fuzz_color")}
    elif (most := max(tint)) > 0:
        made = {"fuzz_weight": product(weight, most), "fuzz_color": parameter(tuple(c / most for c in tint))}
    else:
        return {}
    return {**made, "fuzz_roughness": bounded(values.number(node.input("Sheen Roughness")))}


def _below_a_coat(node: Output, values: Values, base: Surface, weight: Value) -> Surface:
    """A clear coat with other normals: its reflection is added, and the base loses the mean reflectance of the coat."""
    if values.color(node.input("Coat Tint")) != (1.0, 1.0, 1.0):
        values.warn(node, "Coat Tint has no effect beside a linked normal")
    ior, roughness = values.constant(node.input("Coat IOR"), node), values.number(node.input("Coat Roughness"))
    facets = rough(roughness, node, values)
    factors = {"diffuse_reflectance": 0.0, "glossy_reflectance": 0.0}
    factors["glossy_reflectance" if facets else "specular_reflectance"] = 1.0
    coat = with_normal(Surface({"type": "lobesum", **facets, "eta": ior, **factors}), node, values, "Coat Normal")
    share = 1.0 if is_texture(weight) else weight
    covered = weighted_sum([(1 - share * mean_reflectance(ior), base.bsdf), (share, coat.bsdf)])
    base.bsdf = _blend(weight, base.bsdf, covered) if is_texture(weight) else covered
    return base
