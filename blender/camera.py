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
        move, half = np.eye(4), size[0] / 2
        move[:2, 3] = middle
        return {"type": "orthographic", "to_world": to_world @ move @ _TURN @ np.diag([half, half, half, 1.0]), "film": film}
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
        from_camera = np.array(camera.matrix_world.inverted() @ dof.focus_object.matrix_world.translation)
        distance = abs(from_camera[2])
    # The focal length is in millimetres, and units of the scene are metres.
    return {"aperture_radius": camera.data.lens * 1e-3 / (2 * dof.aperture_fstop), "focus_distance": max(distance, 1e-5)}


def resolution(render: Any) -> tuple[int, int]:
    """Width and height of the full image in pixels."""
    factor = render.resolution_percentage / 100
    return max(int(render.resolution_x * factor), 1), max(int(render.resolution_y * factor), 1)


def read_film(render: Any) -> dict[str, Any]:
    """The film, cropped to the border of the render settings."""
    width, height = resolution(render)
    film = {"type": "hdrfilm", "width": width, "height": height,
            "rfilter": {"type": "gaussian", "stddev": max(render.filter_size / 3, 0.1)}}
    if render.use_border:
        left, right = int(render.border_min_x * width), int(render.border_max_x * width)
        bottom, top = int(render.border_min_y * height), int(render.border_max_y * height)
        film.update(crop_offset_x=left, crop_offset_y=height - top,
                    crop_width=max(right - left, 1), crop_height=max(top - bottom, 1))
    return film
