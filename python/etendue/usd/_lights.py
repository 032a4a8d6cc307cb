"""UsdLux lights."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import UsdLux

from .._scenes import scale
from ._context import Context, Matrix, Object, is_authored, rgb, unscaled
from ._textures import image_source

WIDEST_SUN = 1.0  # Degrees from which a warning says that shadows are sharp.


def light_input(context: Context, prim: Any, name: str, default: Any = None) -> Any:
    """An input; in files before USD 21.02 it has no prefix."""
    if not is_authored(prim, f"inputs:{name}") and is_authored(prim, name):
        return context.get(prim, name)
    return context.get(prim, f"inputs:{name}", default)


def emitted(context: Context, prim: Any) -> NDArray[np.float64]:
    """The radiance by colour, before it is divided by an area; with the exposure of the camera."""
    color = np.array(light_input(context, prim, "color", (1, 1, 1)), dtype=np.float64)
    strength = float(light_input(context, prim, "intensity", 1)) * 2**float(light_input(context, prim, "exposure", 0))
    if light_input(context, prim, "enableColorTemperature", False):
        color = color * np.array(UsdLux.BlackbodyTemperatureAsRgb(float(light_input(context, prim, "colorTemperature", 6500))))
    if strength < 0 or color.min() < 0 or not math.isfinite(strength):
        context.warn(prim, "negative light has no effect")
    return np.maximum(color * strength, 0) * context.exposure


def is_normalized(context: Context, prim: Any) -> bool:
    """Whether the radiance is divided by the area of the light."""
    return bool(light_input(context, prim, "normalize", False))


def light(context: Context, prim: Any, to_scene: Matrix) -> Object | None:
    """The emitter, or the shape with one, of a light; `to_scene` maps its space to that of the scene."""
    kind = str(prim.GetTypeName())
    make = _MAKERS.get(kind)
    if make is None:
        context.warn(prim, f"a {kind} is not supported, and is left out")
        return None
    _check_controls(context, prim)
    return make(context, prim, to_scene)


def _check_controls(context: Context, prim: Any) -> None:
    for name in ("diffuse", "specular"):
        if float(light_input(context, prim, name, 1)) != 1:
            context.warn(prim, f"inputs:{name} has no effect")
    if not context.get(prim, "inputs:shadow:enable", True):
        context.warn(prim, "a light without shadows casts shadows")
    api = UsdLux.LightAPI(prim)
    if api.GetFiltersRel().GetTargets():
        context.warn(prim, "light filters have no effect")
    for name, collection in (("light", api.GetLightLinkCollectionAPI()), ("shadow", api.GetShadowLinkCollectionAPI())):
        if not collection.GetIncludeRootAttr().Get() or collection.GetExcludesRel().GetTargets():
            context.warn(prim, f"{name} linking has no effect")
    if float(light_input(context, prim, "shaping:focus", 0)) != 0:
        context.warn(prim, "inputs:shaping:focus has no effect")
    if light_input(context, prim, "shaping:ies:file"):
        context.refuse(prim, f"IES profiles ({light_input(context, prim, 'shaping:ies:file').path}) are not supported")


def _area_light(context: Context, prim: Any, shape: Object, area: float) -> Object:
    if is_normalized(context, prim) and not area > 0:
        context.fail(prim, "a light of no area cannot be normalized")
    radiance = emitted(context, prim) / (area if is_normalized(context, prim) else 1)
    return {**shape, "emitter": {"type": "area", "radiance": rgb(radiance)}}


def _lengths(context: Context, prim: Any) -> NDArray[np.float64]:
    """The lengths of the axes of the light in units of the stage, by which areas are measured."""
    lengths: NDArray[np.float64] = np.linalg.norm(context.stage_matrix(prim)[:3, :3], axis=0)
    return lengths


def _extent(context: Context, prim: Any, name: str, default: float) -> float:
    value = float(light_input(context, prim, name, default))
    if not value >= 0 or not math.isfinite(value):
        context.fail(prim, f"inputs:{name} is {value}, but must not be negative")
    return value


# Lights face -z; shapes have their normal along +z.
_TURNED = np.diag([-1.0, 1, -1, 1])


def _rect(context: Context, prim: Any, to_scene: Matrix) -> Object:
    width, height = _extent(context, prim, "width", 1), _extent(context, prim, "height", 1)
    x, y, _ = _lengths(context, prim)
    area = width * x * height * y
    if _cone(context, prim) is not None:
        return _spot(context, prim, to_scene, area)
    to_world = to_scene @ _TURNED @ scale(width / 2, height / 2, 1)
    made = _area_light(context, prim, {"type": "rectangle", "to_world": to_world}, area)
    asset = light_input(context, prim, "texture:file")
    image = image_source(context, prim, asset) if asset else None
    if image is not None:
        # The upper edge of the image is that of +y.
        flip = np.array([[1.0, 0, 0, 0], [0, -1, 0, 1], [0, 0, 1, 0], [0, 0, 0, 1]])
        made["emitter"]["radiance"] = {"type": "scale", "scale": made["emitter"]["radiance"],
                                       "value": {"type": "bitmap", **image, "wrap_mode": "clamp", "to_uv": flip}}
    return made


def _disk(context: Context, prim: Any, to_scene: Matrix) -> Object:
    radius = _extent(context, prim, "radius", 0.5)
    x, y, _ = _lengths(context, prim)
    area = math.pi * radius * radius * x * y
    if _cone(context, prim) is not None:
        return _spot(context, prim, to_scene, area)
    return _area_light(context, prim, {"type": "disk", "to_world": to_scene @ _TURNED @ scale(radius, radius, 1)}, area)


def _sphere(context: Context, prim: Any, to_scene: Matrix) -> Object:
    radius = _extent(context, prim, "radius", 0.5)
    # The area of an ellipsoid by Thomsen's formula, exact for spheres.
    x, y, z = _lengths(context, prim)**1.6075
    area = 4 * math.pi * radius**2 * ((x * y + x * z + y * z) / 3)**(1 / 1.6075)
    if _cone(context, prim) is not None:
        return _spot(context, prim, to_scene, area / 4)
    if light_input(context, prim, "treatAsPoint", False):
        return {"type": "point", "position": to_scene[:3, 3], "intensity": rgb(_intensity(context, prim, area, area / 4))}
    return _area_light(context, prim, {"type": "sphere", "radius": radius, "to_world": to_scene}, area)


def _intensity(context: Context, prim: Any, area: float, visible_area: float) -> NDArray[np.float64]:
    """The radiant intensity of a light whose size is left out: of the area that is seen along its axis."""
    share = visible_area / area if is_normalized(context, prim) else visible_area
    return np.asarray(emitted(context, prim) * share * context.unit**2)


def _cylinder(context: Context, prim: Any, to_scene: Matrix) -> Object:
    length, radius = _extent(context, prim, "length", 1), _extent(context, prim, "radius", 0.5)
    x, y, z = _lengths(context, prim)
    # The perimeter of the ellipse by Ramanujan's formula.
    a, b = radius * y, radius * z
    area = length * x * math.pi * (3 * (a + b) - math.sqrt((3 * a + b) * (a + 3 * b)))
    if _cone(context, prim) is not None:
        context.warn(prim, "the shaping of a cylinder has no effect")
    shape = {"type": "cylinder", "p0": [-length / 2, 0, 0], "p1": [length / 2, 0, 0], "radius": radius, "to_world": to_scene}
    return _area_light(context, prim, shape, area)


def _distant(context: Context, prim: Any, to_scene: Matrix) -> Object:
    angle = _extent(context, prim, "angle", 0.53)
    half = min(math.radians(angle) / 2, math.pi)
    solid = math.pi * (math.sin(half)**2 if half <= math.pi / 2 else 2 - math.sin(half)**2)
    # Of an infinitely narrow light, the intensity is the irradiance.
    factor = 1 if is_normalized(context, prim) or solid == 0 else solid
    if angle > WIDEST_SUN:
        context.warn(prim, f"light from a distance is parallel: the angle of {angle:g} degrees does not soften shadows")
    return {"type": "directional", "direction": -to_scene[:3, 2], "irradiance": rgb(emitted(context, prim) * factor)}


def _cone(context: Context, prim: Any) -> float | None:
    """The half angle of the shaping cone in degrees, None if it lets all light pass."""
    angle = float(light_input(context, prim, "shaping:cone:angle", 90))
    return None if angle >= 90 else max(angle, 0.01)


def _spot(context: Context, prim: Any, to_scene: Matrix, area: float) -> Object:
    """A light behind a cone, without its size; `area` is what is seen along the axis."""
    cone = _cone(context, prim)
    assert cone is not None
    if not light_input(context, prim, "treatAsPoint", False):
        context.warn(prim, "a light with a shaping cone is a spot light of no size: shadows are sharp")
    softness = min(max(float(light_input(context, prim, "shaping:cone:softness", 0)), 0), 1)
    whole = area * 4 if prim.IsA(UsdLux.SphereLight) else area
    place = unscaled(to_scene)
    if place is None:
        context.fail(prim, "the light's transform has no inverse")
    return {"type": "spot", "to_world": place @ _TURNED, "intensity": rgb(_intensity(context, prim, whole, area)),
            "cutoff_angle": cone, "beam_width": cone * (1 - softness), "falloff": "smooth"}


def _dome(context: Context, prim: Any, to_scene: Matrix) -> Object | None:
    radiance = rgb(emitted(context, prim))
    if prim.GetRelationship("portals").GetTargets():
        context.warn(prim, "portals have no effect: the whole dome shines")
    asset = light_input(context, prim, "texture:file")
    image = image_source(context, prim, asset) if asset else None
    if image is None:
        return {"type": "constant", "radiance": radiance}
    layout = str(light_input(context, prim, "texture:format", "automatic"))
    if layout not in ("automatic", "latlong"):
        context.refuse(prim, f'a dome whose texture has the format "{layout}" is not supported')
        return None
    place = unscaled(to_scene)
    if place is None:
        context.fail(prim, "the light's transform has no inverse")
    place = place @ _pole(context, prim)
    place[:3, 3] = 0
    return {"type": "envmap", **image, "tint": radiance, "to_world": place}


def _pole(context: Context, prim: Any) -> Matrix:
    """DomeLight_1 turns its pole, +y otherwise, to the axis of an attribute."""
    axis = str(context.get(prim, "poleAxis", "Y"))
    if axis == "Z" or (axis == "scene" and context.is_z_up):
        return np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    return np.eye(4)


_MAKERS = {"RectLight": _rect, "DiskLight": _disk, "SphereLight": _sphere, "CylinderLight": _cylinder, "DistantLight": _distant,
           "DomeLight": _dome, "DomeLight_1": _dome}
