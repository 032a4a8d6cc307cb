"""What all parts of the reader share: the stage, the options, the objects read so far, and messages."""

import os
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, UsdGeom

from .._etendue import SceneError

Matrix = NDArray[np.float64]
Object = dict[str, Any]  # An object in the format of et.load_dict().


@dataclass
class Options:
    """The arguments of load()."""

    variants: dict[str, Any]
    time: float | None
    camera: str | None
    purposes: tuple[str, ...]
    subdivision: int
    lenient: bool

    def __post_init__(self) -> None:
        known = ("default", "render", "proxy", "guide")
        for purpose in self.purposes:
            if purpose not in known:
                raise ValueError(f'purposes: "{purpose}" must be one of {", ".join(known)}')
        if not 0 <= self.subdivision <= 6:
            raise ValueError("subdivision must lie between 0 and 6")


class Context:
    """A stage that is being read."""

    def __init__(self, file: str, stage: Any, time: Any, options: Options, notes: list[str]) -> None:
        self.file = file
        self.folder = os.path.dirname(os.path.abspath(file))
        self.stage = stage
        self.time = time
        self.options = options
        self.notes = notes
        self.objects: dict[str, Object] = {}  # Of the scene, by their keys.
        self.materials: dict[str, Any] = {}
        self.transforms = UsdGeom.XformCache(time)
        self.unit = UsdGeom.GetStageMetersPerUnit(stage)  # One unit of the stage in metres.
        self.exposure = 1.0  # Factor on all emission, since the film has none.
        if not self.unit > 0:
            raise SceneError(f"{file}: metersPerUnit is {self.unit}, but must be positive")
        self.is_z_up = UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z
        up = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]] if self.is_z_up else np.eye(3))
        self.root = np.eye(4)  # From the space of the stage to metres and +y up.
        self.root[:3, :3] = self.unit * up

    def warn(self, prim: Any, text: str) -> None:
        """Notes what has no effect."""
        note = f"{self.file}: {path_of(prim)}: {text}"
        if note not in self.notes:
            self.notes.append(note)

    def fail(self, prim: Any, text: str) -> NoReturn:
        """For contents that are not valid."""
        raise SceneError(f"{self.file}: {path_of(prim)}: {text}")

    def refuse(self, prim: Any, text: str) -> None:
        """For valid contents that cannot be rendered: an error, or a warning if the reader is lenient."""
        if not self.options.lenient:
            self.fail(prim, text)
        self.warn(prim, text)

    def get(self, prim: Any, name: str, default: Any = None) -> Any:
        """The value of an attribute, its fallback, or `default`."""
        attribute = prim.GetAttribute(name)
        value = attribute.Get(self.time) if attribute else None
        return default if value is None else value

    def stage_matrix(self, prim: Any) -> Matrix:
        """From the space of a prim to that of the stage."""
        return column_matrix(self.transforms.GetLocalToWorldTransform(prim))


def path_of(prim: Any) -> str:
    """The path for messages."""
    return str(prim.GetPath())


def column_matrix(m: Any) -> Matrix:
    """USD multiplies row vectors by matrices; etendue multiplies matrices by column vectors."""
    return np.array(m, dtype=np.float64).T


def array(value: Any, columns: int, dtype: Any = np.float32) -> NDArray[Any]:
    """An array of USD, empty for None, with a row for each element."""
    rows = np.array(value if value is not None else [], dtype=dtype)
    return rows.reshape(-1) if columns == 1 else rows.reshape(-1, columns)


def rgb(value: Any) -> Object:
    """A colour in the format of et.load_dict()."""
    return {"type": "rgb", "value": [float(x) for x in value]}


def is_authored(prim: Any, name: str) -> bool:
    """Whether a file gives the attribute a value."""
    attribute = prim.GetAttribute(name)
    return bool(attribute) and attribute.HasAuthoredValue()


def unscaled(m: Matrix) -> Matrix | None:
    """The position and the directions of a transform without its scale; None where it has no inverse."""
    if is_singular(m):
        return None
    rotation = Gf.Matrix4d(m.T.tolist())
    made = np.eye(4)
    made[:3, :3] = column_matrix(rotation.RemoveScaleShear())[:3, :3]
    made[:3, 3] = m[:3, 3]
    return made


def inverse(m: Matrix) -> Matrix:
    """The inverse of a transform."""
    return np.asarray(np.linalg.inv(m), np.float64)


def is_singular(m: Matrix) -> bool:
    """Whether a transform has no inverse."""
    determinant = float(np.linalg.det(m[:3, :3]))
    return determinant == 0 or not np.isfinite(determinant)
