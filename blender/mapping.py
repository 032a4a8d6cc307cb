"""The transforms of Mapping nodes."""

from __future__ import annotations

import math

import numpy as np

Vector = tuple[float, float, float]


def mapping_matrix(kind: str, location: Vector, rotation: Vector, scale: Vector) -> np.ndarray:
    """The 4x4 matrix of a Mapping node of the type POINT, TEXTURE (its inverse), VECTOR or NORMAL (without a move)."""
    sizes = np.diag([*scale, 1.0])
    if kind == "TEXTURE":
        # A scale of 0 is 0 in Blender, too: everything is at one point then.
        inverse = np.diag([*(1 / s if s else 0.0 for s in scale), 1.0])
        return inverse @ _rotation(rotation).T @ _translation(tuple(-v for v in location))
    if kind == "NORMAL":
        sizes = np.diag([*(1 / s if s else 0.0 for s in scale), 1.0])
    matrix = _rotation(rotation) @ sizes
    return _translation(location) @ matrix if kind == "POINT" else matrix


def _translation(by: Vector) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = by
    return matrix


def _rotation(angles: Vector) -> np.ndarray:
    """About x, then y, then z."""
    matrix = np.eye(4)
    for axis, angle in enumerate(angles):
        s, c, (i, j) = math.sin(angle), math.cos(angle), ((1, 2), (2, 0), (0, 1))[axis]
        about = np.eye(4)
        about[i, i], about[i, j], about[j, i], about[j, j] = c, -s, s, c
        matrix = about @ matrix
    return matrix
