"""What shows the progress of work."""

import functools
import warnings
from collections.abc import Callable
from typing import Any, ParamSpec

P = ParamSpec("P")


def harmless(show: Callable[P, Any]) -> Callable[P, None]:
    """`show`, which is called no more after it has raised an exception: a rendering is worth more than what is shown of it."""
    fails = False

    @functools.wraps(show)
    def shown(*args: P.args, **kwargs: P.kwargs) -> None:
        nonlocal fails
        if fails:
            return
        try:
            show(*args, **kwargs)
        except Exception as e:
            fails = True
            warnings.warn(f"the progress cannot be shown: {e}", RuntimeWarning, stacklevel=2)

    return shown
