"""Materials: UsdPreviewSurface, and MaterialX's standard_surface and OpenPBR, as `openpbr`."""

from dataclasses import dataclass, field
from typing import Any

from pxr import UsdGeom, UsdShade

from ._context import Context, Object, path_of, rgb
from ._networks import Inputs, product
from ._surface_models import MODELS, Model


@dataclass
class Material:
    """What a shape gets: a material, an emitter, and the primvars that its textures need."""

    bsdf: Object | None = None
    emitter: Object | None = None
    coordinates: list[str] = field(default_factory=list)  # Texture coordinates; at most two.
    color: str | None = None  # The primvar of vertex colours.
    alpha: str | None = None  # The primvar of vertex opacities.

    def primvars(self) -> dict[str, int]:
        """The primvars by name, with the number of their components."""
        found = {name: 2 for name in self.coordinates}
        if self.color:
            found[self.color] = 3
        if self.alpha:
            found[self.alpha] = 1
        return found


def bound_material(context: Context, prim: Any) -> Material:
    """The material of a prim; without one, that of its displayColor. It is made once, and then referred to."""
    bound, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    if not bound:
        return _display_color(context, prim)
    key = path_of(bound)
    if key not in context.materials:
        made = _read(context, bound)
        context.materials[key] = made
        if made.bsdf is not None:
            context.objects[key] = made.bsdf
            made.bsdf = {"type": "ref", "id": key}
    made = context.materials[key]
    return _display_color(context, prim) if made.bsdf is None else made


def _read(context: Context, bound: Any) -> Material:
    for render_context in ("", "mtlx"):
        shader, _, _ = bound.ComputeSurfaceSource(render_context)
        if not shader:
            continue
        model = MODELS.get(shader.GetIdAttr().Get() or "")
        if model is not None:
            return _surface(context, shader, model)
        context.warn(shader, f'the shader "{shader.GetIdAttr().Get() or "without an id"}" is not supported')
    context.warn(bound, "has no surface that is supported: the displayColor is used")
    return Material()


def _display_color(context: Context, prim: Any) -> Material:
    """A diffuse material of the primvars displayColor and displayOpacity."""
    mesh = prim.GetParent() if prim.IsA(UsdGeom.Subset) else prim
    made = Material()
    reflectance: Any = None
    opacity: Any = None
    color = UsdGeom.PrimvarsAPI(mesh).FindPrimvarWithInheritance("displayColor")
    value = color.Get(context.time) if color and color.HasValue() else None
    if value:
        if color.GetInterpolation() == "constant" or len(value) == 1:
            reflectance = rgb(_clamped(value[0]))
        elif mesh.IsA(UsdGeom.Mesh):
            made.color, reflectance = "displayColor", {"type": "mesh_attribute", "name": "vertex_color"}
    alpha = UsdGeom.PrimvarsAPI(mesh).FindPrimvarWithInheritance("displayOpacity")
    value = alpha.Get(context.time) if alpha and alpha.HasValue() else None
    if value:
        if alpha.GetInterpolation() == "constant" or len(value) == 1:
            opacity = float(_clamped([value[0]])[0])
        elif mesh.IsA(UsdGeom.Mesh):
            made.alpha, opacity = "displayOpacity", {"type": "mesh_attribute", "name": "vertex_alpha"}
    if reflectance is None and opacity is None:
        return made
    diffuse: Object = {"type": "diffuse"}
    if reflectance is not None:
        diffuse["reflectance"] = reflectance
    made.bsdf = {"type": "twosided", "bsdf": diffuse}
    if opacity not in (None, 1.0):
        made.bsdf = {"type": "mask", "opacity": opacity, "bsdf": made.bsdf}
    return made


def _clamped(values: Any) -> list[float]:
    return [min(max(float(v), 0.0), 1.0) for v in values]


def _surface(context: Context, shader: Any, model: Model) -> Material:
    made = Material()
    inputs = Inputs(context, shader, model.defaults, made)
    # Tangents are those of the first coordinates.
    bump = inputs.normal_map(model.normal)
    parameters = model.parameters(inputs)
    emission = parameters.pop("emission")
    opacity, pane = parameters.pop("opacity"), parameters.pop("pane")
    transmits = parameters.get("transmission_weight", 0) != 0
    bsdf: Object = {"type": "openpbr", **parameters}
    if bump is not None:
        bsdf = {"type": "normalmap", **bump, "bsdf": bsdf}
    if not transmits:
        bsdf = {"type": "twosided", "bsdf": bsdf}
    if pane:
        clear = {"type": "thindielectric", "int_ior": parameters["specular_ior"], "ext_ior": 1.0}
        bsdf = {"type": "blendbsdf", "weight": opacity, "bsdf": clear, "bsdf_2": bsdf}
    elif opacity != 1:
        bsdf = {"type": "mask", "opacity": opacity, "bsdf": bsdf}
    made.bsdf = bsdf
    if emission is not None and opacity != 0:
        made.emitter = {"type": "area", "radiance": product(emission, context.exposure)}
    for note in model.notes(inputs):
        context.warn(shader, note)
    return made

