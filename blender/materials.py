"""Materials: trees of shader nodes as etendue's BSDFs, with emission and opacity."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from .albedos import conductor, refraction_gain, rough_diffuse, schlick_mean
from .images import ImageFiles
from .nodes import Input, Output, surface_output, tree_of
from .principled import principled, stretched, warn_of_tangents
from .report import Refused, Report
from .surfaces import (BLACK, SMOOTH, Surface, diffuse, dielectric, glass_gain, glossy, mixed, reflecting, rough, summed,
                       weighted_sum, with_normal)
from .values import Values, as_color, bounded, is_black, is_texture, parameter, product


@dataclass
class Material:
    """A material as etendue's shapes use it."""

    bsdf: dict[str, Any]
    emission: Any = None
    """Radiance, a parameter of an area emitter; None without emission."""
    uv_maps: list[str] = field(default_factory=list)
    color_attribute: str | None = None
    """See Values."""


def read_material(material: Any, images: ImageFiles, report: Report) -> Material:
    """A material of Blender; None is the default one."""
    if material is None:
        return Material(reflecting({"type": "diffuse", "reflectance": 0.8}))
    values = Values(f'material "{material.name}"', images, report)
    tree = tree_of(material)
    if tree is None:
        surface = diffuse(tuple(material.diffuse_color)[:3])
    else:
        output = surface_output(tree, "ShaderNodeOutputMaterial")
        for name in ("Volume", "Displacement"):
            if output and output.input(name).source():
                report.warn(values.where, f"{name.lower()} has no effect")
        surface = read_shader(output.input("Surface"), values) if output else BLACK
    if len(values.uv_maps) > 1:
        report.warn(values.where, f'only the UV map "{values.uv_maps[0]}" is used beside the active one')
    emission = parameter(surface.emission) if _is_bright(surface.emission) else None
    return Material(surface.masked(), emission, values.uv_maps, values.color_attribute)


def _is_bright(value: Any) -> bool:
    """Whether a value, or a parameter, is not zero everywhere."""
    if not is_texture(value):
        return not is_black(value)
    if value["type"] == "rgb":
        return any(value["value"])
    if value["type"] == "scale":
        return _is_bright(value["value"]) and _is_bright(value["scale"])
    return value["type"] != "mix" or _is_bright(value["value0"]) or _is_bright(value["value1"])


def read_shader(i: Input, values: Values) -> Surface:
    """The surface that a shader input describes; black without a link."""
    source = i.source()
    if source is None or not source.socket.is_output:
        return BLACK
    read = _SHADERS.get(source.node.bl_idname)
    if read is None:
        raise Refused(f"{values.where}: node {source.name} is not supported")
    return read(source, values)


def _diffuse(node: Output, values: Values) -> Surface:
    color, roughness = bounded(values.color(node.input("Color"))), values.constant(node.input("Roughness"), node)
    if roughness > 0:
        sigma, factor, albedo = rough_diffuse(min(roughness, 1.0), (1.0, 1.0, 1.0) if is_texture(color) else color)
        bsdf = {"type": "orennayar", "sigma": math.degrees(sigma), "reflectance": parameter(color if is_texture(color) else albedo)}
        return with_normal(Surface(weighted_sum([(factor, reflecting(bsdf))])), node, values)
    return with_normal(diffuse(color), node, values)


def _anisotropy(node: Output, values: Values) -> float:
    anisotropy = values.constant(node.input("Anisotropy"), node)
    if anisotropy:
        warn_of_tangents(node, values)
        rotation = node.input("Rotation")
        if rotation.source() or rotation.value:
            values.warn(node, "Rotation has no effect")
    return anisotropy


def _glossy(node: Output, values: Values) -> Surface:
    color, roughness = values.color(node.input("Color")), values.number(node.input("Roughness"))
    anisotropy = _anisotropy(node, values)
    facets = rough(roughness, node, values, anisotropy)
    bsdf = {"type": "roughconductor" if facets else "conductor", **facets, "specular_reflectance": parameter(color)}
    return with_normal(glossy(bsdf, color, roughness, node), node, values)


def _metallic(node: Output, values: Values) -> Surface:
    roughness = values.number(node.input("Roughness"))
    if node.has("Thin Film Thickness") and node.input("Thin Film Thickness").value:
        values.warn(node, "Thin Film Thickness has no effect")
    anisotropy = _anisotropy(node, values)
    facets = rough(roughness, node, values, anisotropy)
    if node.node.fresnel_type == "F82":
        color, edge = values.color(node.input("Base Color")), values.color(node.input("Edge Tint"))
        if is_texture(color) or is_texture(edge):
            a = min(max(anisotropy, -0.99), 0.99)
            bsdf = {"type": "openpbr", "base_metalness": 1.0, "base_color": parameter(bounded(color)), "specular_color": parameter(edge),
                    **stretched(roughness, (1 + a) ** 2 if a < 0 else (1 - a) ** -2)}
            return with_normal(Surface(reflecting(bsdf)), node, values)
        # The tint is a factor of Schlick's reflectance at 82 degrees.
        pairs = [conductor(c, (c + (1 - c) * (6 / 7) ** 5) * t) for c, t in zip(color, edge)]
        eta, k = (tuple(pair[i] for pair in pairs) for i in (0, 1))
    else:
        eta, k = (as_color(values.color(node.input(name))) for name in ("IOR", "Extinction"))
    bsdf = {"type": "roughconductor" if facets else "conductor", **facets, "eta": parameter(eta), "k": parameter(k)}
    color = tuple(schlick_mean(((n - 1) ** 2 + x * x) / ((n + 1) ** 2 + x * x)) for n, x in zip(eta, k))
    return with_normal(glossy(bsdf, color, roughness, node), node, values)


def _glass(node: Output, values: Values) -> Surface:
    color, roughness = values.color(node.input("Color")), values.number(node.input("Roughness"))
    ior = values.constant(node.input("IOR"), node)
    color = product(color, glass_gain(ior, roughness, node))
    return with_normal(Surface(dielectric(ior, rough(roughness, node, values), color, color)), node, values)


def _refraction(node: Output, values: Values) -> Surface:
    """Blender's has no Fresnel term: it is that of glass, divided by the mean share that is transmitted."""
    color, roughness = values.color(node.input("Color")), values.number(node.input("Roughness"))
    ior = values.constant(node.input("IOR"), node)
    alpha = SMOOTH**2 if is_texture(roughness) else max(roughness, SMOOTH) ** 2
    color = product(color, refraction_gain(max(ior, 1 / ior), alpha))
    return with_normal(Surface(dielectric(ior, rough(roughness, node, values), 0.0, color)), node, values)


def _translucent(node: Output, values: Values) -> Surface:
    color = parameter(bounded(values.color(node.input("Color"))))
    bsdf = {"type": "diffusetransmission", "reflectance": 0.0, "transmittance": color}
    return with_normal(Surface(bsdf), node, values)


def _transparent(node: Output, values: Values) -> Surface:
    color = values.color(node.input("Color"))
    if not is_texture(color) and len(set(color)) == 1:
        return Surface(BLACK.bsdf, opacity=1 - bounded(color[0]))
    # A pane with the index of refraction of air: light passes, with the colour.
    pane = {"type": "thindielectric", "int_ior": 1.0, "ext_ior": 1.0, "specular_transmittance": parameter(color)}
    return Surface(pane)


def _subsurface(node: Output, values: Values) -> Surface:
    values.warn(node, "light does not scatter below surfaces: it is diffuse")
    return with_normal(diffuse(values.color(node.input("Color"))), node, values)


def _emission(node: Output, values: Values) -> Surface:
    return Surface(BLACK.bsdf, emission=product(values.color(node.input("Color")), values.number(node.input("Strength"))))


def _mix(node: Output, values: Values) -> Surface:
    a, b = (read_shader(i, values) for i in node.inputs()[1:3])
    return mixed(values.number(node.inputs()[0]), a, b)


def _add(node: Output, values: Values) -> Surface:
    return summed(*(read_shader(i, values) for i in node.inputs()[:2]), node, values)


_SHADERS = {
    "ShaderNodeBsdfPrincipled": principled,
    "ShaderNodeBsdfDiffuse": _diffuse,
    "ShaderNodeBsdfAnisotropic": _glossy,
    "ShaderNodeBsdfGlossy": _glossy,
    "ShaderNodeBsdfMetallic": _metallic,
    "ShaderNodeBsdfGlass": _glass,
    "ShaderNodeBsdfRefraction": _refraction,
    "ShaderNodeBsdfTranslucent": _translucent,
    "ShaderNodeBsdfTransparent": _transparent,
    "ShaderNodeSubsurfaceScattering": _subsurface,
    "ShaderNodeEmission": _emission,
    "ShaderNodeMixShader": _mix,
    "ShaderNodeAddShader": _add,
}
