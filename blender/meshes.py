"""Meshes: evaluated geometry as arrays, one mesh for each material."""

from __future__ import annotations

from typing import Any

import numpy as np

from .materials import Material
from .report import Report

Arrays = dict[str, np.ndarray]


def read_parts(mesh: Any, materials: list[Material], where: str, report: Report) -> list[tuple[int, Arrays]]:
    """The triangles of an evaluated mesh by the index of their material, with shading normals, texture coordinates and
    colours of face corners; vertices with several of them are split.
    """
    count = len(mesh.loop_triangles)
    if count == 0:
        return []
    corners = _read(mesh.loop_triangles, "loops", np.int32, 3)
    # In Blender 5 corner normals are an attribute, too; foreach_get reads them in both versions.
    normals = _read(mesh.corner_normals, "vector", np.float32, 3)
    points = _read(mesh.vertices, "co", np.float32, 3)
    vertices = _read(mesh.loops, "vertex_index", np.int32, 1)[:, 0]
    indices = np.minimum(_read(mesh.loop_triangles, "material_index", np.int32, 1)[:, 0], len(materials) - 1)
    parts = []
    for index in np.unique(indices):
        chosen = corners[indices == index]
        columns = {"positions": points[vertices], "normals": normals, **_coordinates(mesh, materials[index], where, report)}
        if materials[index].color_attribute is not None:
            columns.update(_colors(mesh, vertices, materials[index].color_attribute, where, report))
        parts.append((int(index), _compact(chosen, columns)))
    return parts


def _read(items: Any, name: str, kind: type, size: int) -> np.ndarray:
    values = np.empty(len(items) * size, dtype=kind)
    items.foreach_get(name, values)
    return values.reshape(-1, size)


def _compact(corners: np.ndarray, columns: Arrays) -> Arrays:
    """The corners that the triangles use; equal ones become one vertex."""
    used, local = np.unique(corners, return_inverse=True)
    rows = np.ascontiguousarray(np.hstack([column[used] for column in columns.values()]), dtype=np.float32)
    keys = rows.view(np.dtype((np.void, rows.dtype.itemsize * rows.shape[1])))[:, 0]
    _, first, number = np.unique(keys, return_index=True, return_inverse=True)
    triangles = number.reshape(-1)[local.reshape(-1)].reshape(-1, 3).astype(np.int32)
    arrays = {name: np.ascontiguousarray(column[used][first]) for name, column in columns.items()}
    if "alphas" in arrays:
        arrays["alphas"] = arrays["alphas"][:, 0]
    return {**arrays, "triangles": triangles}


def _coordinates(mesh: Any, material: Material, where: str, report: Report) -> Arrays:
    layers = mesh.uv_layers
    if not layers:
        return {}
    active = next((layer for layer in layers if layer.active_render), layers[0])
    found = {"uvs": _read(active.uv, "vector", np.float32, 2)}
    for name in material.uv_maps[:1]:
        if name in layers:
            found["second_uvs"] = _read(layers[name].uv, "vector", np.float32, 2)
        else:
            report.warn(where, f'there is no UV map "{name}"; the active one is used')
            found["second_uvs"] = found["uvs"]
    return found


def _colors(mesh: Any, vertices: np.ndarray, name: str, where: str, report: Report) -> Arrays:
    attributes = mesh.color_attributes
    attribute = attributes.get(name) if name else attributes.active_color
    if attribute is None:
        report.warn(where, f'there is no colour attribute "{name}"; the colour is black')
        return {"colors": np.zeros((len(vertices), 3), np.float32)}
    colors = _read(attribute.data, "color", np.float32, 4)
    if attribute.domain == "POINT":
        colors = colors[vertices]
    return {"colors": colors[:, :3], "alphas": colors[:, 3:]}
