"""Meshes: polygons and subdivision surfaces, their subsets and primvars."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom, UsdShade

from ._context import Context, Object, array
from ._materials import Material, bound_material
from ._primvars import Integers, Topology, Values, read_primvar, values_of
from ._subdivision import Surface, refine, refine_corners, refine_triangles, smooth_normals
from ._triangulation import triangulate

MOST_FACES = 1 << 24  # Of a refined mesh.


@dataclass
class Part:
    """The faces of a mesh with one material."""

    key: str
    prim: Any
    faces: NDArray[np.bool_]
    material: Material


@dataclass
class _Mesh:
    topology: Topology
    points: NDArray[np.float64]
    parents: Integers
    normals: Values | None
    primvars: dict[str, Values] = field(default_factory=dict)


def parts_of_mesh(context: Context, prim: Any) -> Iterator[tuple[Part, Object]]:
    """The parts of a mesh by material, each with its arrays in the format of et.load_dict()."""
    topology = _topology(context, prim)
    if topology is None:
        return
    parts = _parts(context, prim, topology)
    wanted = {name: columns for part in parts for name, columns in part.material.primvars().items()}
    mesh = _read(context, prim, topology, wanted)
    corners, faces = triangulate(mesh.topology, mesh.points)
    if context.get(prim, "orientation") == "leftHanded":
        corners = corners[:, ::-1]
    of_control = mesh.parents[faces]
    for part in parts:
        chosen = corners[part.faces[of_control]]
        if len(chosen):
            yield part, _arrays(context, part, mesh, chosen)


def _topology(context: Context, prim: Any) -> Topology | None:
    counts = array(context.get(prim, "faceVertexCounts"), 1, np.int64)
    points = array(context.get(prim, "faceVertexIndices"), 1, np.int64)
    count = len(array(context.get(prim, "points"), 3))
    if len(counts) == 0 or count == 0:
        context.warn(prim, "a mesh without faces is left out")
        return None
    if counts.min() < 0 or counts.sum() != len(points):
        context.fail(prim, f"faceVertexCounts add up to {counts.sum()}, but there are {len(points)} faceVertexIndices")
    if len(points) and (points.min() < 0 or points.max() >= count):
        wrong = points[(points < 0) | (points >= count)][0]
        context.fail(prim, f"faceVertexIndices has the index {wrong} of {count} points")
    if counts.min() < 3:
        context.warn(prim, f"{int((counts < 3).sum())} faces of fewer than three corners are left out")
    return Topology(counts, points, count)


def _parts(context: Context, prim: Any, topology: Topology) -> list[Part]:
    """GeomSubsets of the family materialBind, and the rest of the mesh."""
    rest = np.ones(len(topology.counts), bool)
    holes = array(context.get(prim, "holeIndices"), 1, np.int64)
    _check_faces(context, prim, "holeIndices", holes, topology)
    is_hole = np.zeros(len(rest), bool)
    is_hole[holes] = True
    parts = []
    for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
        indices = array(subset.GetIndicesAttr().Get(context.time), 1, np.int64)
        if subset.GetElementTypeAttr().Get() != "face":
            context.warn(subset.GetPrim(), "only subsets of faces have materials")
            continue
        _check_faces(context, subset.GetPrim(), "indices", indices, topology)
        faces = np.zeros(len(rest), bool)
        faces[indices] = True
        faces &= rest
        rest &= ~faces
        parts.append(Part(str(subset.GetPath()), prim, faces & ~is_hole, bound_material(context, subset.GetPrim())))
    if rest.any():
        parts.append(Part(str(prim.GetPath()), prim, rest & ~is_hole, bound_material(context, prim)))
    return parts


def _check_faces(context: Context, prim: Any, name: str, indices: Integers, topology: Topology) -> None:
    count = len(topology.counts)
    if len(indices) and (indices.min() < 0 or indices.max() >= count):
        context.fail(prim, f"{name} has the index {indices[(indices < 0) | (indices >= count)][0]} of {count} faces")


def _read(context: Context, prim: Any, topology: Topology, wanted: dict[str, int]) -> _Mesh:
    points = array(context.get(prim, "points"), 3, np.float64)
    if not np.all(np.isfinite(points)):
        context.fail(prim, "points has values that are not finite")
    primvars = {}
    for name, columns in wanted.items():
        values = read_primvar(context, prim, name, columns, topology)
        if values is not None:
            primvars[name] = values
        elif columns == 2:
            context.warn(prim, f"has no primvars:{name} for the textures of its material")
    scheme = str(context.get(prim, "subdivisionScheme"))
    can_refine = topology.counts.min() > 2
    if scheme == "loop" and topology.counts.max() > 3:
        context.warn(prim, "the scheme loop is for triangles: the control mesh is rendered")
        can_refine = False
    if scheme in ("catmullClark", "loop") and context.options.subdivision > 0 and can_refine:
        return _subdivide(context, prim, topology, points, primvars, scheme == "loop")
    normals = _normals(context, prim, topology) if scheme == "none" else None
    return _Mesh(topology, points, np.arange(len(topology.counts)), normals, primvars)


def _normals(context: Context, prim: Any, topology: Topology) -> Values | None:
    """primvars:normals precede the attribute normals."""
    found = read_primvar(context, prim, "normals", 3, topology)
    if found is None:
        mesh = UsdGeom.Mesh(prim)
        value = mesh.GetNormalsAttr().Get(context.time)
        found = values_of(context, prim, "normals", value, None, mesh.GetNormalsInterpolation(), 3, topology)
    return found


def _subdivide(
    context: Context, prim: Any, topology: Topology, points: NDArray[np.float64], primvars: dict[str, Values], is_loop: bool
) -> _Mesh:
    if len(topology.points) * 4**(context.options.subdivision - 1) > MOST_FACES:
        context.fail(prim, f"{context.options.subdivision} levels of subdivision would make more than {MOST_FACES} faces")
    columns = [points]
    smooth = {name: v for name, v in primvars.items() if v.interpolation == "vertex"}
    for v in smooth.values():
        by_point = np.zeros((topology.count_of_points, v.rows.shape[1]))
        by_point[topology.points] = v.at_corners()
        columns.append(by_point)
    surface = Surface(topology, np.concatenate(columns, 1), _creases(context, prim),
                      _sharp_points(context, prim, topology), np.arange(len(topology.counts)))
    other = {name: v for name, v in primvars.items() if name not in smooth}
    for _ in range(context.options.subdivision):
        other = {name: refine_corners(v, surface.topology, is_loop) for name, v in other.items()}
        surface = refine_triangles(surface) if is_loop else refine(surface)
    made, at = dict(other), 3
    for name, v in smooth.items():
        width = v.rows.shape[1]
        rows = surface.vertices[:, at:at + width].astype(np.float32)
        made[name], at = Values(rows, surface.topology.points, "vertex"), at + width
    return _Mesh(surface.topology, surface.vertices[:, :3], surface.parents, smooth_normals(surface), made)


def _creases(context: Context, prim: Any) -> dict[tuple[int, int], float]:
    lengths = array(context.get(prim, "creaseLengths"), 1, np.int64)
    indices = array(context.get(prim, "creaseIndices"), 1, np.int64)
    sharpness = array(context.get(prim, "creaseSharpnesses"), 1)
    if lengths.sum() != len(indices):
        context.fail(prim, f"creaseLengths add up to {lengths.sum()}, but there are {len(indices)} creaseIndices")
    is_by_edge = len(sharpness) == (lengths - 1).sum() and len(sharpness) != len(lengths)
    if len(lengths) and not is_by_edge and len(sharpness) != len(lengths):
        context.fail(prim, f"there are {len(lengths)} creases, but {len(sharpness)} creaseSharpnesses")
    found: dict[tuple[int, int], float] = {}
    start = edge = 0
    for i, length in enumerate(lengths):
        for a, b in zip(indices[start:start + length - 1], indices[start + 1:start + length]):
            found[min(int(a), int(b)), max(int(a), int(b))] = float(sharpness[edge if is_by_edge else i])
            edge += 1
        start += length
    return found


def _sharp_points(context: Context, prim: Any, topology: Topology) -> NDArray[np.float64]:
    made = np.zeros(topology.count_of_points)
    indices = array(context.get(prim, "cornerIndices"), 1, np.int64)
    sharpness = array(context.get(prim, "cornerSharpnesses"), 1)
    if len(indices) != len(sharpness):
        context.fail(prim, f"there are {len(indices)} cornerIndices, but {len(sharpness)} cornerSharpnesses")
    if len(indices) and (indices.min() < 0 or indices.max() >= len(made)):
        context.fail(prim, "cornerIndices has an index of no point")
    made[indices] = sharpness
    boundary = context.get(prim, "interpolateBoundary")
    if boundary == "none":
        context.warn(prim, "interpolateBoundary is none: boundaries are smooth curves, as with edgeOnly")
    if boundary == "edgeAndCorner":
        made[np.bincount(topology.points, minlength=len(made)) == 1] = np.inf
    return made


def _arrays(context: Context, part: Part, mesh: _Mesh, corners: Integers) -> Object:
    """The mesh of et.load_dict(): vertices with the same values are one."""
    material = part.material
    attributes: dict[str, Values] = {}
    if mesh.normals is not None:
        attributes["normals"] = mesh.normals
    for key, name in zip(("uvs", "second_uvs"), material.coordinates):
        if name in mesh.primvars:
            attributes[key] = mesh.primvars[name]
    for key, primvar in (("colors", material.color), ("alphas", material.alpha)):
        if primvar and primvar in mesh.primvars:
            attributes[key] = mesh.primvars[primvar]
    used = corners.reshape(-1)
    numbers = np.stack([mesh.topology.points[used]] + [v.of_corners[used] for v in attributes.values()], 1)
    unique, first, same = np.unique(numbers, axis=0, return_index=True, return_inverse=True)
    made: Object = {"positions": mesh.points[unique[:, 0]].astype(np.float32), "triangles": same.reshape(-1, 3)}
    for i, (key, values) in enumerate(attributes.items()):
        rows = values.rows[unique[:, i + 1]]
        if key in ("uvs", "second_uvs"):
            rows = rows * np.array([1, -1], np.float32) + np.array([0, 1], np.float32)  # Images begin with their upper row.
        made[key] = rows
    return made
