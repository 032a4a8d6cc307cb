"""Cameras and film: field of view, shift, depth of field, resolution and the part that is rendered."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .report import Refused, Report

# Blender's cameras look along -z with x to the right, etendue's along +z with x to the left.
_TURN = np.diag([-1.0, 1.0, -1.0, 1.0])


def read_camera(camera: Any, scene: Any, report: Report) -> dict[str, Any]:
    """The sensor of an evaluated camera object, with its film."""
    data, where = camera.data, f'camera "{camera.name}"'
    if data.type not in ("PERSP", "ORTHO"):
        raise Refused(f"{where}: a camera of the type {data.type} is not supported")
    to_world = np.array(camera.matrix_world, dtype=float)
    to_world[:3, :3] /= np.linalg.norm(to_world[:3, :3], axis=0)
    low, high = _frame(data, scene)
    size, middle = high - low, (high + low) / 2
    film = read_film(scene.render)
    if data.type == "ORTHO":
        if data.dof.use_dof:
            report.warn(where, "an orthographic camera has no depth of field")
        move, half = np.eye(4), size / 2
        move[:2, 3] = middle
        # The height of an orthographic view follows from its width and the number of square pixels.
        half[1] *= film["width"] / film["height"]
        return {"type": "orthographic", "to_world": to_world @ move @ _TURN @ np.diag([*half, half[0], 1.0]), "film": film}
    sensor = {
        "type": "perspective",
        "to_world": to_world @ _TURN,
        "fov": math.degrees(2 * math.atan(size[0] / 2)),
        "fov_axis": "x",
        "aspect": size[0] / size[1],
        "principal_point_offset_x": middle[0] / size[0],
        "principal_point_offset_y": -middle[1] / size[1],
        "film": film,
    }
    if data.dof.use_dof:
        sensor.update(type="thinlens", **_lens(camera, where, report))
    return sensor


def _frame(data: Any, scene: Any) -> tuple[np.ndarray, np.ndarray]:
    """Lower left and upper right corner of the view: at distance 1, or in world units for an orthographic camera."""
    corners = np.array([tuple(v) for v in data.view_frame(scene=scene)])
    if data.type == "PERSP":
        corners /= -corners[:, 2:]
    return corners[:, :2].min(axis=0), corners[:, :2].max(axis=0)


def _lens(camera: Any, where: str, report: Report) -> dict[str, float]:
    dof = camera.data.dof
    if dof.aperture_blades or dof.aperture_ratio != 1:
        report.warn(where, "the lens is round: blades and ratio of the aperture have no effect")
    distance = dof.focus_distance
    if dof.focus_object:
        # Along the axis of the camera, whose scale has no effect.
        axis = camera.matrix_world.to_3x3().col[2].normalized()
        distance = abs(axis.dot(dof.focus_object.matrix_world.translation - camera.matrix_world.translation))
    # The focal length is in millimetres, and units of the scene are metres.
    return {"aperture_radius": camera.data.lens * 1e-3 / (2 * dof.aperture_fstop), "focus_distance": max(distance, 1e-5)}


def resolution(render: Any) -> tuple[int, int]:
    """Width and height of the full image in pixels."""
    return tuple(max(n * render.resolution_percentage // 100, 1) for n in (render.resolution_x, render.resolution_y))


def read_film(render: Any) -> dict[str, Any]:
    """The film, cropped to the border of the render settings."""
    width, height = resolution(render)
    film = {"type": "hdrfilm", "width": width, "height": height,
            "rfilter": {"type": "gaussian", "stddev": max(render.filter_size / 3, 0.1)}}
    if render.use_border:
        # Blender multiplies in single precision, in which 0.7 times 10 is 7.
        left, right = (int(np.float32(x) * np.float32(width)) for x in (render.border_min_x, render.border_max_x))
        bottom, top = (int(np.float32(y) * np.float32(height)) for y in (render.border_min_y, render.border_max_y))
        film.update(crop_offset_x=left, crop_offset_y=height - top,
                    crop_width=max(right - left, 1), crop_height=max(top - bottom, 1))
    return film
