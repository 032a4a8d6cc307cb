"""Which parameters of `openpbr` stand for the inputs of each surface shader."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ._context import rgb
from ._networks import Inputs, bounded, is_black, luminance, product

Parameters = dict[str, Any]


@dataclass
class Model:
    """A surface shader."""

    defaults: dict[str, Any]
    normal: str  # Its input for normals.
    parameters: Callable[[Inputs], Parameters]  # Those of openpbr; and emission, opacity, and pane, whether it is clear.
    ignored: tuple[str, ...]  # Inputs without an effect.
    coat: str = ""  # Its input for the weight of a coat with normals of its own,
    coat_normal: str = ""  # and for these.

    def without_effect(self, inputs: Inputs) -> list[str]:
        """Inputs that a file sets to another value than their default, and that have no effect."""
        return [name for name in self.ignored if inputs.is_changed(name) and self._has_layer(inputs, name)]

    def _has_layer(self, inputs: Inputs, name: str) -> bool:
        """Whether there is the layer of an input."""
        layer = name.split("_")[0]
        weight = next((w for w in (layer, f"{layer}_weight") if w in self.defaults), None)
        return weight is None or bool(self.defaults[weight]) or inputs.is_changed(weight)

    def notes(self, inputs: Inputs) -> list[str]:
        """What differs from the file."""
        notes = [f"inputs:{name} has no effect" for name in self.without_effect(inputs)]
        if not self.coat_normal or not inputs.is_changed(self.coat):
            return notes
        # The coat has the normals of what lies below.
        below, own = inputs.source(self.normal), inputs.source(self.coat_normal)
        if below == own:
            return notes
        if own is not None:
            notes.append(f"inputs:{self.coat_normal} has no effect")
        if below is not None:
            notes.append(f"the coat has the normals of inputs:{self.normal}, too")
        return notes


def _emission(color: Any, strength: float) -> Any:
    """The radiance, None if it is black."""
    emitted = product(color, max(strength, 0.0))
    return None if is_black(emitted) else emitted


def _ior(value: float) -> float:
    """Below 1 for what is thinner than its surroundings."""
    return max(value, 0.01)


# What lies below such a coat is as without it.
SEPARATE_COAT = {"coat_affect_ior": 0.0, "coat_affect_roughness": 0.0}


def _preview_surface(inputs: Inputs) -> Parameters:
    made: Parameters = {"specular_roughness": inputs.scalar("roughness"), "specular_ior": _ior(inputs.number("ior"))}
    diffuse = bounded(inputs.color("diffuseColor"))
    if int(inputs.number("useSpecularWorkflow")) == 1:
        specular = inputs.color("specularColor")
        for name, output in (("base_color", "base_color"), ("base_metalness", "metallic"), ("specular_weight", "specular_weight")):
            made[name] = {"type": "specular_to_metallic", "output": output, "diffuse": diffuse, "specular": specular}
        del made["specular_ior"]
    else:
        made.update(base_color=diffuse, base_metalness=inputs.scalar("metallic"))
    if inputs.is_changed("clearcoat"):
        made.update(coat_weight=inputs.scalar("clearcoat"), coat_roughness=inputs.scalar("clearcoatRoughness"), coat_ior=1.5,
                    **SEPARATE_COAT)
    opacity, threshold = inputs.scalar("opacity"), inputs.number("opacityThreshold")
    is_constant = not isinstance(opacity, dict)
    if threshold > 0:
        opacity = float(opacity >= threshold) if is_constant else {"type": "threshold", "value": opacity, "cutoff": threshold}
    pane = threshold <= 0 and is_constant and opacity < 1 and inputs.token("opacityMode") == "transparent" and \
        "specular_ior" in made
    return {**made, "emission": _emission(inputs.color("emissiveColor"), 1), "opacity": opacity, "pane": pane}


def _share(inputs: Inputs, name: str) -> float:
    return min(max(inputs.number(name), 0.0), 1.0)


def _base(inputs: Inputs, factor: str, subsurface: str, metalness: str) -> Any:
    """The base colour, blended with that of subsurface scattering, which is taken for diffuse; metal has none."""
    base, weight = bounded(product(inputs.color("base_color"), inputs.scalar(factor))), _share(inputs, subsurface)
    if weight == 0 or inputs.scalar(metalness) == 1.0:
        return base
    below = bounded(inputs.color("subsurface_color"))
    if base.get("type") == "rgb" == below.get("type"):
        return rgb([x + (y - x) * weight for x, y in zip(base["value"], below["value"])])
    return {"type": "mix", "value0": base, "value1": below, "weight": weight}


def _layers(inputs: Inputs, coat: str, ior: str, fuzz: str) -> Parameters:
    """Those of a coat and of cloth, where there are any."""
    made: Parameters = {}
    if inputs.is_changed(coat):
        prefix = coat.removesuffix("_weight")
        made.update(coat_weight=inputs.scalar(coat), coat_color=bounded(inputs.color(f"{prefix}_color")),
                    coat_roughness=inputs.scalar(f"{prefix}_roughness"), coat_ior=max(inputs.number(ior), 1.0))
    if inputs.is_changed(fuzz):
        prefix = fuzz.removesuffix("_weight")
        made.update(fuzz_weight=inputs.scalar(fuzz), fuzz_color=bounded(inputs.color(f"{prefix}_color")),
                    fuzz_roughness=inputs.scalar(f"{prefix}_roughness"))
    return made


def _toward_one(value: Any, weight: Any) -> Any:
    """The mixture (1 - weight) value + weight."""
    if weight == 0:
        return value
    if isinstance(value, dict) or isinstance(weight, dict):
        return {"type": "mix", "value0": value, "value1": 1.0, "weight": weight}
    return value + (1 - value) * weight


def _standard_roughness(inputs: Inputs) -> Any:
    """The roughness below the coat, which is blurred in another way than that of OpenPBR."""
    blur = _share(inputs, "coat_affect_roughness")
    if blur > 0:
        blur = product(product(inputs.scalar("coat"), blur), inputs.scalar("coat_roughness"))
    return _toward_one(inputs.scalar("specular_roughness"), blur)


def _standard_surface(inputs: Inputs) -> Parameters:
    layers = _layers(inputs, "coat", "coat_IOR", "sheen")
    if "coat_weight" in layers:
        layers.update(SEPARATE_COAT)
    return {
        "base_color": _base(inputs, "base", "subsurface", "metalness"),
        "base_diffuse_roughness": inputs.scalar("diffuse_roughness"),
        "base_metalness": inputs.scalar("metalness"),
        # A factor at all angles, which does not change the index.
        "specular_color": bounded(product(inputs.color("specular_color"), inputs.scalar("specular"))),
        "specular_roughness": _standard_roughness(inputs),
        "specular_roughness_anisotropy": _share(inputs, "specular_anisotropy"),
        "specular_ior": _ior(inputs.number("specular_IOR")),
        "transmission_weight": inputs.scalar("transmission"),
        "transmission_color": bounded(inputs.color("transmission_color")),
        "thin_walled": bool(inputs.number("thin_walled")),
        **layers,
        "emission": _emission(inputs.color("emission_color"), inputs.number("emission")),
        "opacity": luminance(bounded(inputs.color("opacity"))),
        "pane": False,
    }


def _open_pbr(inputs: Inputs) -> Parameters:
    return {
        "base_color": _base(inputs, "base_weight", "subsurface_weight", "base_metalness"),
        "base_diffuse_roughness": inputs.scalar("base_diffuse_roughness"),
        "base_metalness": inputs.scalar("base_metalness"),
        "specular_weight": inputs.scalar("specular_weight", most=math.inf),
        "specular_color": inputs.color("specular_color"),
        "specular_roughness": inputs.scalar("specular_roughness"),
        "specular_roughness_anisotropy": _share(inputs, "specular_roughness_anisotropy"),
        "specular_ior": _ior(inputs.number("specular_ior")),
        "transmission_weight": inputs.scalar("transmission_weight"),
        "transmission_color": bounded(inputs.color("transmission_color")),
        "thin_walled": bool(inputs.number("geometry_thin_walled")),
        **_layers(inputs, "coat_weight", "coat_ior", "fuzz_weight"),
        "emission": _emission(inputs.color("emission_color"), inputs.number("emission_luminance")),
        "opacity": inputs.scalar("geometry_opacity"),
        "pane": False,
    }


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
         "coat_affect_color": 0, "coat_affect_roughness": 0, "coat_rotation": 0, "subsurface_radius": WHITE, "subsurface_scale": 1,
         "subsurface_anisotropy": 0, "thin_film_thickness": 0, "emission": 0, "emission_color": WHITE, "opacity": WHITE,
         "thin_walled": False},
        "normal", _standard_surface,
        ("specular_rotation", "transmission_depth", "transmission_scatter", "transmission_dispersion",
         "transmission_extra_roughness", "subsurface_radius", "subsurface_scale", "subsurface_anisotropy", "coat_anisotropy",
         "coat_rotation", "coat_affect_color", "thin_film_thickness", "tangent"), "coat", "coat_normal"),
    "ND_open_pbr_surface_surfaceshader": Model(
        {"base_weight": 1, "base_color": (0.8, 0.8, 0.8), "base_diffuse_roughness": 0, "base_metalness": 0, "specular_weight": 1,
         "specular_color": WHITE, "specular_roughness": 0.3, "specular_ior": 1.5, "specular_roughness_anisotropy": 0,
         "transmission_weight": 0, "transmission_color": WHITE, "transmission_depth": 0, "transmission_scatter": (0, 0, 0),
         "transmission_dispersion_scale": 0, "subsurface_weight": 0, "subsurface_color": (0.8, 0.8, 0.8), "fuzz_weight": 0,
         "fuzz_color": WHITE, "fuzz_roughness": 0.5, "coat_weight": 0, "coat_color": WHITE, "coat_roughness": 0, "coat_ior": 1.6,
         "coat_roughness_anisotropy": 0, "coat_darkening": 1, "subsurface_radius": 1, "subsurface_radius_scale": (1, 0.5, 0.25),
         "subsurface_scatter_anisotropy": 0, "thin_film_weight": 0, "emission_luminance": 0,
         "emission_color": WHITE, "geometry_opacity": 1, "geometry_thin_walled": False},
        "geometry_normal", _open_pbr,
        ("transmission_depth", "transmission_scatter", "transmission_dispersion_scale", "subsurface_radius",
         "subsurface_radius_scale", "subsurface_scatter_anisotropy", "coat_roughness_anisotropy", "coat_darkening",
         "thin_film_weight", "geometry_tangent"), "coat_weight", "geometry_coat_normal"),
}
# As a node of MaterialX.
MODELS["ND_UsdPreviewSurface_surfaceshader"] = MODELS["UsdPreviewSurface"]
