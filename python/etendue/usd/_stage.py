"""Opens stages: variants, times, and what is missing."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pxr import Tf, Usd, UsdUtils

from .._etendue import SceneError
from ._context import Options
from ._mtlx import add_documents


@contextmanager
def diagnostics(file: str, notes: list[str]) -> Iterator[None]:
    """Collects what USD would print."""
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    finally:
        for found in delegate.TakeUncoalescedDiagnostics():
            note = f"{file}: {_one_line(found.commentary)}"
            if note not in notes:
                notes.append(note)


def open_stage(file: str, options: Options, notes: list[str]) -> Any:
    """The stage of a file with its payloads and the chosen variants, and what has to live as long as it. Missing references are
    errors, or notes if lenient.
    """
    if not os.path.isfile(file):
        raise RuntimeError(f"{file}: there is no such file")
    try:
        stage = Usd.Stage.Open(file)
    except Tf.ErrorException as e:
        raise SceneError(f"{file}: is not a USD file: {_one_line(e.args[0].commentary)}") from None
    for path, choices in options.variants.items():
        _choose_variants(file, stage, path, choices)
    documents = add_documents(stage)
    for error in stage.GetCompositionErrors():
        text = f"{file}: {_one_line(str(error))}"
        if any(name in text for name in documents):
            continue
        if not options.lenient:
            raise SceneError(text)
        notes.append(text)
    return stage, documents


def time_code(stage: Any, options: Options) -> Any:
    """The time at which attributes are read."""
    if options.time is not None:
        return Usd.TimeCode(options.time)
    if stage.HasAuthoredTimeCodeRange():
        return Usd.TimeCode(stage.GetStartTimeCode())
    return Usd.TimeCode.EarliestTime()


def _choose_variants(file: str, stage: Any, path: str, choices: dict[str, str]) -> None:
    prim = stage.GetPrimAtPath(path)
    if not prim:
        raise SceneError(f"{file}: variants: there is no prim {path}")
    # Selections in the session layer win, and change no file.
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        for name, choice in choices.items():
            known = prim.GetVariantSets().GetNames()
            if name not in known:
                raise SceneError(f'{file}: {path}: has no variant set "{name}" (known: {_list(known)})')
            known = prim.GetVariantSet(name).GetVariantNames()
            if choice not in known:
                raise SceneError(f'{file}: {path}: the variant set "{name}" has no "{choice}" (known: {_list(known)})')
            prim.GetVariantSet(name).SetVariantSelection(choice)


def _list(names: Any) -> str:
    return ", ".join(str(n) for n in names) or "none"


def _one_line(text: str) -> str:
    return re.sub(r"\s+", " ", text).strip()
