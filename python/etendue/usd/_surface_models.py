"""Which parameters of `principled` stand for the inputs of each surface shader."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ._context import Object
from ._networks import Inputs, luminance, product

Parameters = dict[str, Any]


@dataclass
class Model:
    """A surface shader."""

    defaults: dict[str, Any]
    normal: str  # Its input for normals.
    parameters: Callable[[Inputs], Parameters]  # Those of principled; and emission, opacity, and pane, whether it is clear.
    ignored: tuple[str, ...]  # Inputs without an effect.

    def without_effect(self, inputs: Inputs) -> list[str]:
        """Inputs that a file sets to another value than their default, and that have no effect."""
        return [name for name in self.ignored if inputs.is_changed(name)]


def _gloss(inputs: Inputs, name: str) -> float:
    """The clearcoat_gloss of a roughness: from 0 to 1 it is an α from 0.1 to 0.001."""
    alpha = inputs.number(name)**2
    return float(min(max((0.1 - alpha) / 0.099, 0.0), 1.0))


def _emission(color: Any, strength: float) -> Any:
    """The radiance, None if it is black."""
    emitted = product(color, strength)
    return None if luminance(emitted) == 0 else emitted


def _ior(value: float) -> float:
    return max(value, 1.0001)


def _preview_surface(inputs: Inputs) -> Parameters:
    made: Parameters = {"roughness": inputs.scalar("roughness"), "eta": _ior(inputs.number("ior"))}
    diffuse = inputs.color("diffuseColor")
    if int(inputs.number("useSpecularWorkflow")) == 1:
        specular = inputs.color("specularColor")
        for output in ("base_color", "metallic", "specular_weight"):
            made[output] = {"type": "specular_to_metallic", "output": output, "diffuse": diffuse, "specular": specular}
        del made["eta"]
    else:
        made.update(base_color=diffuse, metallic=inputs.scalar("metallic"))
    if inputs.is_changed("clearcoat"):
        made.update(clearcoat=inputs.scalar("clearcoat"), clearcoat_gloss=_gloss(inputs, "clearcoatRoughness"))
    opacity, threshold = inputs.scalar("opacity"), inputs.number("opacityThreshold")
    is_constant = not isinstance(opacity, dict)
    if threshold > 0:
        opacity = float(opacity >= threshold) if is_constant else {"type": "threshold", "value": opacity, "cutoff": threshold}
    pane = threshold <= 0 and is_constant and opacity < 1 and inputs.token("opacityMode") == "transparent" and "eta" in made
    return {**made, "emission": _emission(inputs.color("emissiveColor"), 1), "opacity": opacity, "pane": pane}


def _glass(made: Parameters, transmission: float, color: Any) -> None:
    """Light that is transmitted has the colour of the base in principled."""
    if transmission > 0:
        made["spec_trans"] = min(transmission, 1.0)
        made["base_color"] = color if transmission == 1 or isinstance(made["base_color"], dict) and \
            made["base_color"]["type"] != "rgb" else _mixed(made["base_color"], color, transmission)


def _mixed(a: Object, b: Any, weight: float) -> Any:
    if b.get("type") != "rgb":
        return b
    return {"type": "rgb", "value": [x + (y - x) * weight for x, y in zip(a["value"], b["value"])]}


def _standard_surface(inputs: Inputs) -> Parameters:
    made: Parameters = {
        "base_color": product(inputs.color("base_color"), inputs.number("base")),
        "metallic": inputs.scalar("metalness"),
        "roughness": inputs.scalar("specular_roughness"),
        "anisotropic": inputs.scalar("specular_anisotropy"),
        "eta": _ior(inputs.number("specular_IOR")),
        "specular_weight": inputs.scalar("specular"),
        "specular_color": inputs.color("specular_color"),
        "clearcoat": inputs.scalar("coat"),
        "clearcoat_gloss": _gloss(inputs, "coat_roughness"),
        "sheen": inputs.scalar("sheen"),
        "flatness": inputs.scalar("subsurface"),
    }
    _glass(made, inputs.number("transmission"), inputs.color("transmission_color"))
    made["emission"] = _emission(inputs.color("emission_color"), inputs.number("emission"))
    return {**made, "opacity": luminance(inputs.color("opacity")), "pane": False}


def _open_pbr(inputs: Inputs) -> Parameters:
    made: Parameters = {
        "base_color": product(inputs.color("base_color"), inputs.number("base_weight")),
        "metallic": inputs.scalar("base_metalness"),
        "roughness": inputs.scalar("specular_roughness"),
        "anisotropic": inputs.scalar("specular_roughness_anisotropy"),
        "eta": _ior(inputs.number("specular_ior")),
        "specular_weight": inputs.scalar("specular_weight"),
        "specular_color": inputs.color("specular_color"),
        "clearcoat": inputs.scalar("coat_weight"),
        "clearcoat_gloss": _gloss(inputs, "coat_roughness"),
        "sheen": inputs.scalar("fuzz_weight"),
        "flatness": inputs.scalar("subsurface_weight"),
    }
    _glass(made, inputs.number("transmission_weight"), inputs.color("transmission_color"))
    made["emission"] = _emission(inputs.color("emission_color"), inputs.number("emission_luminance"))
    return {**made, "opacity": inputs.scalar("geometry_opacity"), "pane": False}


WHITE = (1.0, 1.0, 1.0)

MODELS = {
    "UsdPreviewSurface": Model(
        {"diffuseColor": (0.18, 0.18, 0.18), "emissiveColor": (0, 0, 0), "useSpecularWorkflow": 0, "specularColor": (0, 0, 0),
         "metallic": 0, "roughness": 0.5, "clearcoat": 0, "clearcoatRoughness": 0.01, "opacity": 1, "opacityThreshold": 0,
         "opacityMode": "transparent", "ior": 1.5, "displacement": 0},
        "normal", _preview_surface, ("displacement",)),
    "ND_standard_surface_surfaceshader": Model(
        {"base": 1, "base_color": (0.8, 0.8, 0.8), "diffuse_roughness": 0, "metalness": 0, "specular": 1, "specular_color": WHITE,
         "specular_roughness": 0.2, "specular_IOR": 1.5, "specular_anisotropy": 0, "specular_rotation": 0, "transmission": 0,
         "transmission_color": WHITE, "transmission_depth": 0, "transmission_scatter": (0, 0, 0), "transmission_dispersion": 0,
         "transmission_extra_roughness": 0, "subsurface": 0, "subsurface_color": WHITE, "sheen": 0, "sheen_color": WHITE,
         "sheen_roughness": 0.3, "coat": 0, "coat_color": WHITE, "coat_roughness": 0.1, "coat_IOR": 1.5, "coat_anisotropy": 0,
         "thin_film_thickness": 0, "emission": 0, "emission_color": WHITE, "opacity": WHITE, "thin_walled": False},
        "normal", _standard_surface,
        ("diffuse_roughness", "specular_rotation", "transmission_depth", "transmission_scatter", "transmission_dispersion",
         "transmission_extra_roughness", "subsurface_color", "sheen_color", "sheen_roughness", "coat_color", "coat_IOR",
         "coat_anisotropy", "thin_film_thickness", "thin_walled", "coat_normal", "tangent")),
    "ND_open_pbr_surface_surfaceshader": Model(
        {"base_weight": 1, "base_color": (0.8, 0.8, 0.8), "base_diffuse_roughness": 0, "base_metalness": 0, "specular_weight": 1,
         "specular_color": WHITE, "specular_roughness": 0.3, "specular_ior": 1.5, "specular_roughness_anisotropy": 0,
         "transmission_weight": 0, "transmission_color": WHITE, "transmission_depth": 0, "transmission_scatter": (0, 0, 0),
         "transmission_dispersion_scale": 0, "subsurface_weight": 0, "subsurface_color": (0.8, 0.8, 0.8), "fuzz_weight": 0,
         "fuzz_color": WHITE, "fuzz_roughness": 0.5, "coat_weight": 0, "coat_color": WHITE, "coat_roughness": 0, "coat_ior": 1.6,
         "coat_roughness_anisotropy": 0, "coat_darkening": 1, "thin_film_weight": 0, "emission_luminance": 0,
         "emission_color": WHITE, "geometry_opacity": 1, "geometry_thin_walled": False},
        "geometry_normal", _open_pbr,
        ("base_diffuse_roughness", "transmission_depth", "transmission_scatter", "transmission_dispersion_scale",
         "subsurface_color", "fuzz_color", "fuzz_roughness", "coat_color", "coat_ior", "coat_roughness_anisotropy",
         "coat_darkening", "thin_film_weight", "geometry_thin_walled", "geometry_coat_normal", "geometry_tangent")),
}
# As a node of MaterialX.
MODELS["ND_UsdPreviewSurface_surfaceshader"] = MODELS["UsdPreviewSurface"]
