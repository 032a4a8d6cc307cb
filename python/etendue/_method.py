"""Integrators by name."""

import numbers
from os import PathLike, fspath
from typing import Any

import numpy as np

from . import _etendue
from ._integrator import Integrator

Method = str | dict[str, Any] | Integrator
"""What render(), compare() and verify() take as an integrator."""


def integrator(name: str, /, **parameters: bool | float | str | PathLike[str]) -> str:
    """The text that stands for an integrator with parameters, which are checked as the program does:

        et.integrator("upg+bdpt", max_depth=12)      # "upg+bdpt:max_depth=12"

    render(), compare() and verify() take it, and also the dict {"type": "upg+bdpt", "max_depth": 12}. The names of all
    integrators and their parameters, with defaults and descriptions, are plugins("integrator"), or
    plugins("integrator", "upg+bdpt").

    Raises RuntimeError for an unknown name, an unknown parameter or a value that it cannot have, and TypeError for values
    that are no numbers, texts or booleans.
    """
    text = name
    for i, (parameter, value) in enumerate(parameters.items()):
        text += f"{',' if i or ':' in name else ':'}{parameter}={_text(name, parameter, value)}"
    _etendue.check_integrator(text)
    return text


def _text(name: str, parameter: str, value: object) -> str:
    where = f'integrator "{name}": parameter "{parameter}"'
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, numbers.Integral):
        return str(int(value))
    if isinstance(value, numbers.Real):
        return repr(float(value))
    if not isinstance(value, (str, PathLike)):
        raise TypeError(f"{where} must be a number, a text or a boolean, but is {value!r}")
    text = fspath(value)
    if not text or "," in text:
        raise ValueError(f"{where} must be a text without commas that is not empty, but is {text!r}")
    return text


def text_of(d: dict[str, Any]) -> str:
    """The text of an integrator that is given as a dict."""
    if not isinstance(d.get("type"), str):
        raise ValueError(f'an integrator as a dict needs a "type", such as "path", but this one is {d!r}')
    return integrator(d["type"], **{name: value for name, value in d.items() if name != "type"})
