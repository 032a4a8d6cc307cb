"""Scenes: loading, transforms, plug-ins."""

import json
from collections.abc import Mapping, Sequence
from os import PathLike, fspath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _etendue
from ._etendue import Description, Scene

Vector = tuple[float, float, float]
SceneLike = Scene | Description | dict[str, Any] | str | PathLike[str]
"""A scene, or what one can be built from: a description, a dict as load_dict() takes it, or a file."""


def load(
    file: str | PathLike[str], defines: Mapping[str, object] = {}, *, lenient: bool = False, **usd: Any
) -> Description:
    """Reads a scene file: .xml of Mitsuba 0.6 and 3, .pbrt of pbrt-v3 and v4, .gltf and .glb of glTF 2.0, or .usd, .usda, .usdc
    and .usdz of Universal Scene Description, for which the package usd-core must be installed.

        description = et.load("scenes/cornell.xml")
        scene = description.build(resolution=(64, 64))

    defines: values of the parameters of the scene ($name), like the option -D of the program.
    lenient: unknown elements are left out, with a warning in Description.warnings, instead of causing errors.
    usd: for files of USD, the other arguments of etendue.usd.load(): variants, time, camera, purposes, subdivision.

    Raises RuntimeError if the file cannot be read, and SceneError, with the line, if its contents are not valid.
    """
    if fspath(file).lower().endswith((".usd", ".usda", ".usdc", ".usdz")):
        from . import usd as reader  # Needs a package that others can do without.
        if defines:
            raise ValueError("defines: scenes of USD have no parameters")
        return reader.load(file, lenient=lenient, stacklevel=3, **usd)
    if usd:
        raise TypeError(f"{', '.join(usd)}: only for scenes of USD")
    return _etendue.load(fspath(file), {name: str(value) for name, value in defines.items()}, lenient)


def load_string(
    xml: str, defines: Mapping[str, object] = {}, *, name: str = "scene.xml", lenient: bool = False
) -> Description:
    """Reads a scene from xml, the text of a Mitsuba scene file.

        description = et.load_string('<scene version="3.0.0"><sensor type="perspective"/><emitter type="constant"/></scene>')

    defines, lenient: see load().
    name: file name for messages. Names of other files in the scene are relative to the folder of this file.

    Raises SceneError, with the line, if the text is not valid.
    """
    return _etendue.load_string(xml, {key: str(value) for key, value in defines.items()}, name, lenient)


def load_dict(
    d: dict[str, Any], *, folder: str | PathLike[str] = ".", file: str | PathLike[str] = "dict", warnings: Sequence[str] = ()
) -> Description:
    """Reads a scene from nested dicts in the format of mi.load_dict() of Mitsuba 3.

    Every object is a dict with a "type", the name of a plug-in; {"type": "ref", "id": ...} refers to another object. Values
    are numbers, texts, sequences of 3 numbers, 4x4 arrays, {"type": "rgb", "value": ...} and {"type": "spectrum", ...}.
    Keys are names of parameters and objects. An object whose key is a category ("bsdf", "shape_2") has no name.

        et.load_dict({
            "type": "scene",
            "sensor": {"type": "perspective", "to_world": et.look_at((0, 0, 4), (0, 0, 0))},
            "light": {"type": "constant"},
            "thing": {
                "type": "mesh", "vertices": vertices, "faces": faces, "uvs": uvs,
                "bsdf": {"type": "diffuse", "reflectance": {"type": "bitmap", "data": pixels}},
            },
        })

    Arrays of a mesh have a row for each vertex: vertices (N, 3), normals (N, 3), uvs (N, 2), colors (N, 3); and faces
    (M, 3), numbers of vertices from 0. Pixels have the shape (H, W) or (H, W, 3): those of uint8 are sRGB codes (linear with
    "raw": True), floats are linear. The names of Mitsuba ("vertex_positions", ...) are known, too.

    folder: folder in which the files of the scene are searched.
    file: the name of the scene in messages and reports, Description.file.
    warnings: Description.warnings, for readers of other formats.

    Raises SceneError, with the keys that lead to the place, if the dicts are not valid.
    """
    return _etendue.load_dict(d, fspath(folder), fspath(file), list(warnings))


def built(scene: SceneLike, threads: int = 0, sensor: int | str | None = None) -> Scene:
    """The scene itself, or that of a description or file."""
    if isinstance(scene, Scene):
        if sensor is not None:
            raise ValueError("sensor is for files, dicts and Descriptions: a Scene has its sensor from Description.build(sensor=...)")
        return scene
    return described(scene).build(threads=threads, sensor=sensor)


def described(scene: SceneLike) -> Description:
    """The description itself, or that of a dict or file."""
    if isinstance(scene, (str, PathLike)):
        scene = load(scene)
    if isinstance(scene, dict):
        scene = load_dict(scene)
    if not isinstance(scene, Description):
        raise TypeError(f"a scene is a Scene, a Description, a dict or the name of a file, but found {type(scene).__name__}")
    return scene


def _matrix(rows: list[Any]) -> NDArray[np.float64]:
    return np.array(rows, dtype=np.float64)


def look_at(origin: Vector, target: Vector, up: Vector = (0, 1, 0)) -> NDArray[np.float64]:
    """The to_world transform, a 4x4 matrix, of a sensor at origin that looks at target. Points are in scene units.

        description["sensor.to_world"] = et.look_at((0, 1, 5), (0, 1, 0))

    Raises ValueError if origin and target are equal, or if up points along the viewing direction.
    """
    return _matrix(_etendue.look_at(origin, target, up))


def translate(x: float = 0, y: float = 0, z: float = 0) -> NDArray[np.float64]:
    """A translation in scene units, as a 4x4 matrix. Matrices are combined by @;
    the right one is applied first.

        to_world = et.translate(y=2) @ et.rotate((0, 1, 0), 30) @ et.scale(0.5)
    """
    matrix = np.eye(4)
    matrix[:3, 3] = (x, y, z)
    return matrix


def scale(x: float, y: float | None = None, z: float | None = None) -> NDArray[np.float64]:
    """A scaling along the axes, as a 4x4 matrix.
    If only x is given, it applies to all axes. Dimensionless.

        flat = et.scale(1, 0.1, 1)
    """
    return np.diag([x, x if y is None else y, x if z is None else z, 1.0])


def rotate(axis: Vector, degrees: float) -> NDArray[np.float64]:
    """A right-handed rotation by an angle in degrees about an axis (any length except 0; otherwise ValueError), as a 4x4
    matrix.

        quarter = et.rotate((0, 0, 1), 90)
    """
    return _matrix(_etendue.rotate(axis, degrees))


def plugins(category: str = "", name: str = "") -> list[dict[str, Any]]:
    """All plug-ins with their parameters, types, defaults and descriptions, like `etendue list --json`.

        names = [plugin["name"] for plugin in et.plugins("bsdf")]

    category, name: return only these plug-ins, such as plugins("bsdf", "diffuse"). The category "integrator" contains the
        integrators of render().

    Raises RuntimeError for an unknown category or name.
    """
    result: list[dict[str, Any]] = json.loads(_etendue.plugins(category, name))
    return result
