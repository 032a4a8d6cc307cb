"""Cameras: the chosen one becomes the sensor of the scene."""

import math
from typing import Any

import numpy as np
from pxr import Usd, UsdGeom, UsdRender

from .._scenes import look_at
from ._context import Context, Matrix, Object, path_of, unscaled

HEIGHT = 720  # Of images whose resolution no file gives, in pixels.


def add_camera(context: Context) -> None:
    """Adds the sensor, and sets the exposure of the scene."""
    camera = _choose(context)
    if camera is None:
        context.objects["sensor"] = _default_sensor(context)
        return
    context.exposure = float(camera.ComputeLinearExposureScale(context.time))
    context.objects[path_of(camera)] = _sensor(context, camera.GetPrim())


def _choose(context: Context) -> Any:
    cameras = [p for p in context.stage.Traverse(Usd.TraverseInstanceProxies()) if p.IsA(UsdGeom.Camera)]
    wanted = context.options.camera
    if wanted is not None:
        fitting = [p for p in cameras if wanted in (path_of(p), p.GetName())]
        if not fitting:
            known = ", ".join(path_of(p) for p in cameras) or "none"
            context.fail(context.stage.GetPseudoRoot(), f'there is no camera "{wanted}" (known: {known})')
        return UsdGeom.Camera(fitting[0])
    settings = UsdRender.Settings.GetStageRenderSettings(context.stage)
    for path in settings.GetCameraRel().GetTargets() if settings else []:
        if context.stage.GetPrimAtPath(path).IsA(UsdGeom.Camera):
            return UsdGeom.Camera.Get(context.stage, path)
    if len(cameras) > 1:
        context.warn(cameras[0], f"the first of {len(cameras)} cameras is used")
    return UsdGeom.Camera(cameras[0]) if cameras else None


def _film(context: Context, aspect: float) -> Object:
    settings = UsdRender.Settings.GetStageRenderSettings(context.stage)
    resolution = settings.GetResolutionAttr() if settings else None
    if resolution and resolution.HasAuthoredValue():
        width, height = resolution.Get(context.time)
    else:
        width, height = max(1, round(HEIGHT * aspect)), HEIGHT
    if width < 1 or height < 1:
        context.fail(settings.GetPrim(), f"the resolution is {width} x {height}")
    return {"type": "hdrfilm", "width": int(width), "height": int(height)}


def _sensor(context: Context, prim: Any) -> Object:
    to_world = unscaled(context.root @ context.stage_matrix(prim))
    if to_world is None:
        context.fail(prim, "the camera's transform has no inverse")
    # Cameras of USD look along -z with +x to the right, sensors along +z with +x to the left.
    to_world = to_world @ np.diag([-1.0, 1, -1, 1])
    # Apertures and the focal length are in tenths of a unit of the stage.
    width, height, focal = (float(context.get(prim, name)) for name in
                            ("horizontalAperture", "verticalAperture", "focalLength"))
    for name, value in (("horizontalAperture", width), ("verticalAperture", height), ("focalLength", focal)):
        if not value > 0:
            context.fail(prim, f"{name} is {value}, but must be positive")
    film = _film(context, width / height)
    view_height = width * film["height"] / film["width"]
    offsets = {
        "principal_point_offset_x": float(context.get(prim, "horizontalApertureOffset", 0)) / width,
        "principal_point_offset_y": -float(context.get(prim, "verticalApertureOffset", 0)) / view_height,
    }
    if context.get(prim, "projection") == "orthographic":
        if any(offsets.values()):
            context.warn(prim, "the offset of an orthographic camera has no effect")
        half = width / 20 * context.unit
        return {"type": "orthographic", "to_world": to_world @ np.diag([half, half, 1, 1]), "film": film}
    made: Object = {"type": "perspective", "to_world": to_world, "fov": math.degrees(2 * math.atan(width / (2 * focal))),
                    "fov_axis": "x", "film": film, **{name: x for name, x in offsets.items() if x != 0}}
    if abs(film["width"] / film["height"] * height / width - 1) > 0.005:
        context.warn(prim, "the shape of the image differs from that of the aperture: the width of the aperture is kept")
    f_stop, distance = float(context.get(prim, "fStop", 0)), float(context.get(prim, "focusDistance", 0))
    if f_stop > 0 and distance > 0:
        made["type"] = "thinlens"
        made["aperture_radius"] = focal / 10 / (2 * f_stop) * context.unit
        made["focus_distance"] = distance * context.unit
    return made


def _default_sensor(context: Context) -> Object:
    """Sees the whole scene."""
    lo, hi = _bounds(context)
    context.notes.append(f"{context.file}: there is no camera: one is added that sees the whole scene")
    middle, radius, fov = (lo + hi) / 2, max(float(np.linalg.norm(hi - lo)) / 2, 1e-6), 45.0
    eye = middle + np.array([0.5, 0.4, 1]) / math.hypot(0.5, 0.4, 1) * radius / math.sin(math.radians(fov) / 2)
    return {"type": "perspective", "to_world": look_at(tuple(eye), tuple(middle)), "fov": fov, "fov_axis": "y",
            "film": _film(context, 16 / 9)}


def _bounds(context: Context) -> tuple[Matrix, Matrix]:
    """Corners of the box around the stage, in the space of the scene."""
    cache = UsdGeom.BBoxCache(context.time, list(context.options.purposes))
    box = cache.ComputeWorldBound(context.stage.GetPseudoRoot()).ComputeAlignedRange()
    if box.IsEmpty():
        return -np.ones(3), np.ones(3)
    corners = np.array([box.GetCorner(i) for i in range(8)]) @ context.root[:3, :3].T
    return corners.min(0), corners.max(0)
