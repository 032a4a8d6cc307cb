"""Settings of a scene: limits, and the integrators with their parameters from the tables of etendue itself."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from .images import plain_name

_PROPERTIES = {"integer": (IntProperty, int), "float": (FloatProperty, float), "string": (StringProperty, str),
               "boolean": (BoolProperty, lambda text: text == "true")}
_COMMON = {"max_depth": "depth"}
"""Parameters of integrators that are common settings."""

_groups: dict[str, type] = {}
"""The property group of each integrator."""
_defaults: dict[str, dict[str, Any]] = {}
"""The parameters of each integrator, with their defaults."""


def integrators() -> list[str]:
    """The names of all integrators; empty if the package etendue is not installed."""
    return list(_defaults)


def group_of(settings: Any, integrator: str) -> Any:
    """The property group with the parameters of an integrator."""
    return getattr(settings, _key(integrator))


def parameters_of(integrator: str) -> list[str]:
    """The names of the parameters of an integrator that are not common settings."""
    return [name for name in _defaults[integrator] if name not in _COMMON]


def changed_parameters(settings: Any) -> dict[str, Any]:
    """The parameters of the chosen integrator that differ from their defaults."""
    group, defaults = group_of(settings, settings.integrator), _defaults[settings.integrator]
    values = {n: getattr(settings, _COMMON[n]) if n in _COMMON else getattr(group, n) for n in defaults}
    # Blender's floats have single precision.
    return {n: v for n, v in values.items() if v != defaults[n] and not (isinstance(v, float) and abs(v - defaults[n]) < 1e-6)}


def integrator_text(settings: Any) -> str:
    """The chosen integrator as et.render() takes it, such as "bdpt:max_depth=12"."""
    texts = {n: str(v).lower() if isinstance(v, bool) else f"{v:.7g}" if isinstance(v, float) else v
             for n, v in changed_parameters(settings).items()}
    return settings.integrator + "".join(f"{',' if i else ':'}{n}={v}" for i, (n, v) in enumerate(texts.items()))


def _key(integrator: str) -> str:
    return "parameters_" + plain_name(integrator)


def _make_group(plugin: dict[str, Any]) -> type:
    annotations = {}
    for p in plugin["parameters"]:
        make, parse = _PROPERTIES[p["type"]]
        default = parse(p.get("default", ""))
        _defaults[plugin["name"]][p["name"]] = default
        if p["name"] not in _COMMON:
            label = p["name"].replace("_", " ").capitalize()
            annotations[p["name"]] = make(name=label, description=p["doc"].rstrip("."), default=default)
    return type("Etendue_" + _key(plugin["name"]), (bpy.types.PropertyGroup,), {"__annotations__": annotations})


def register() -> None:
    try:
        import etendue as et

        plugins = et.plugins("integrator")
    except ImportError:
        plugins = []
    for plugin in plugins:
        _defaults[plugin["name"]] = {}
        _groups[_key(plugin["name"])] = group = _make_group(plugin)
        bpy.utils.register_class(group)
    items = [(p["name"], p["name"], p["doc"].rstrip(".")) for p in plugins] or [("none", "none", "etendue is missing")]
    default = "auto" if plugins else "none"
    annotations = {
        "integrator": EnumProperty(name="Integrator", description="Method of light transport", items=items, default=default),
        "samples": IntProperty(name="Samples", description="Samples per pixel", default=64, min=1),
        "time": FloatProperty(name="Time", description="Ends the rendering after this many seconds; 0: no limit",
                              default=0, min=0, subtype="TIME_ABSOLUTE"),
        "seed": IntProperty(name="Seed", description="Seed of all random numbers", default=0, min=0),
        "depth": IntProperty(name="Depth", description="Number of edges of the longest paths; -1: no limit", default=-1, min=-1),
        "denoise": BoolProperty(name="Denoise", description="Adds the pass Denoised, by Intel Open Image Denoise; Combined keeps its noise"),
        "preview_samples": IntProperty(name="Viewport", description="Samples per pixel in the viewport", default=16, min=1),
        **{key: PointerProperty(type=group) for key, group in _groups.items()},
    }
    settings = type("EtendueSettings", (bpy.types.PropertyGroup,), {"__annotations__": annotations})
    _groups["settings"] = settings
    bpy.utils.register_class(settings)
    bpy.types.Scene.etendue = PointerProperty(type=settings)


def unregister() -> None:
    del bpy.types.Scene.etendue
    for group in reversed(_groups.values()):
        bpy.utils.unregister_class(group)
    _groups.clear()
    _defaults.clear()
