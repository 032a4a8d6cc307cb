"""Primvars: values for each corner of the faces of a mesh."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom

from ._context import Context, array

Floats = NDArray[np.float32]
Integers = NDArray[np.int64]


@dataclass
class Topology:
    """The faces of a mesh. A corner is a vertex of a face; the corners of a face are in succession."""

    counts: Integers  # Corners of each face.
    points: Integers  # Of each corner.
    count_of_points: int

    def __post_init__(self) -> None:
        self.starts = np.concatenate([[0], np.cumsum(self.counts)[:-1]]).astype(np.int64)
        self.faces = np.repeat(np.arange(len(self.counts)), self.counts)  # Of each corner.
        position = np.arange(len(self.points)) - self.starts[self.faces]
        self.next = self.starts[self.faces] + (position + 1) % self.counts[self.faces]
        self.previous = self.starts[self.faces] + (position - 1) % self.counts[self.faces]


@dataclass
class Values:
    """Values of a primvar; `of_corners` are their numbers for the corners of a mesh."""

    rows: Floats
    of_corners: Integers
    interpolation: str

    def at_corners(self) -> Floats:
        """A row for each corner."""
        return self.rows[self.of_corners]


def read_primvar(context: Context, prim: Any, name: str, columns: int, topology: Topology) -> Values | None:
    """The primvar of this name, its own or an inherited one; None where there is none, or where it has another type."""
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    if not primvar or not primvar.HasValue():
        return None
    value = primvar.Get(context.time)
    indices = primvar.GetIndices(context.time) if primvar.IsIndexed() else None
    return values_of(context, prim, f"primvars:{name}", value, indices, primvar.GetInterpolation(), columns, topology)


def values_of(
    context: Context, prim: Any, name: str, value: Any, indices: Any, interpolation: str, columns: int, topology: Topology
) -> Values | None:
    """The values of an attribute with an interpolation."""
    try:
        rows = array(value, columns).reshape(-1, columns)
    except (TypeError, ValueError):
        context.warn(prim, f"{name} has another type than {columns} numbers for each element, and has no effect")
        return None
    if len(rows) == 0:
        return None
    elements = _elements(interpolation, topology)
    if elements is None:
        context.warn(prim, f'{name} has the unknown interpolation "{interpolation}", and has no effect')
        return None
    needed = int(elements.max(initial=-1)) + 1
    if indices is not None:
        numbers = array(indices, 1, np.int64)
        if len(numbers) < needed:
            context.fail(prim, f"{name} has {len(numbers)} indices, but {interpolation} interpolation needs {needed}")
        elements = numbers[elements]
        if len(elements) and (elements.min() < 0 or elements.max() >= len(rows)):
            context.fail(prim, f"{name} has the index {_outside(elements, len(rows))} of {len(rows)} values")
    elif len(rows) < needed:
        context.fail(prim, f"{name} has {len(rows)} values, but {interpolation} interpolation needs {needed}")
    elif interpolation == "faceVarying":
        rows, same = np.unique(rows, axis=0, return_inverse=True)
        elements = same.reshape(-1)[elements]
    if not np.all(np.isfinite(rows)):
        context.fail(prim, f"{name} has values that are not finite")
    return Values(rows, elements, interpolation)


def _elements(interpolation: str, topology: Topology) -> Integers | None:
    corners = len(topology.points)
    if interpolation == "constant":
        return np.zeros(corners, np.int64)
    if interpolation == "uniform":
        return topology.faces
    if interpolation in ("vertex", "varying"):
        return topology.points
    return np.arange(corners) if interpolation == "faceVarying" else None


def _outside(indices: Integers, count: int) -> int:
    return int(indices[(indices < 0) | (indices >= count)][0])
