"""Reads stages of Universal Scene Description (.usd, .usda, .usdc, .usdz) by the package usd-core.

`load` is what et.load() calls for these files. docs/usd.md lists what is read, and what differs.
"""

import warnings
from collections.abc import Mapping, Sequence
from os import PathLike, fspath

from .._etendue import Description, load_dict

try:
    import pxr as _pxr  # noqa: F401
except ImportError as _e:
    raise RuntimeError(
        "USD files are read by the package usd-core: pip install usd-core") from _e

from ._cameras import add_camera
from ._context import Context, Options
from ._stage import diagnostics, open_stage, time_code
from ._traversal import add_prims

__all__ = ["load"]


def load(
    file: str | PathLike[str], *, variants: Mapping[str, Mapping[str, str]] = {}, time: float | None = None,
    camera: str | None = None, purposes: Sequence[str] = ("default", "render"), subdivision: int = 2, lenient: bool = False,
    stacklevel: int = 2
) -> Description:
    """Reads the stage of a USD file. Lengths become metres and up becomes +y; the keys of objects are the paths of their prims.

    variants: the variants to select, such as {"/World/Car": {"paint": "red"}}, instead of those that the file selects.
    time: the time code; by default the first of the stage, or the earliest value of each attribute.
    camera: name or path of the camera; by default that of the render settings, or else the first one.
    purposes: the purposes of the prims that are read: "default", "render", "proxy" or "guide".
    subdivision: how many times subdivision surfaces are refined, 0 to 6. Each level has four times as many faces.
    lenient: what is refused otherwise, such as IES profiles or missing references, is left out with a warning.
    stacklevel: which caller warnings are attributed to, as in warnings.warn().

    What has no effect is a UserWarning with the path of the prim, and in Description.warnings. Raises RuntimeError if there is no such file, and SceneError,
    with the file and the path of the prim, if its contents are not valid or are not supported.
    """
    options = Options(dict(variants), time, camera, tuple(purposes), subdivision, lenient)
    name = fspath(file)
    notes: list[str] = []
    with diagnostics(name, notes):
        stage, documents = open_stage(name, options, notes)
        context = Context(name, stage, time_code(stage, options), options, notes)
        add_camera(context)
        add_prims(context)
    # USD says that it cannot open them.
    notes = [note for note in notes if not any(f"{name}@" in note for name in documents)]
    for note in notes:
        warnings.warn(note, stacklevel=stacklevel)
    return load_dict({"type": "scene", **context.objects}, context.folder, name, notes)
