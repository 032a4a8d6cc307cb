"""What shows the progress of work."""

import functools
import inspect
import warnings
from collections.abc import Callable
from typing import Any, ParamSpec

P = ParamSpec("P")


def _code(handler: Any) -> Any:
    """What runs when the object is called; None if it is not written in Python."""
    while isinstance(handler, functools.partial):
        handler = handler.func
    return getattr(handler if inspect.isroutine(handler) else type(handler).__call__, "__code__", None)


def _signal_handlers() -> list[Any]:
    """What runs at signals."""
    import signal

    return [_code(h) for s in signal.valid_signals() if callable(h := signal.getsignal(s))]


def _is_of(e: Exception, codes: list[Any]) -> bool:
    """Whether one of these has raised it. Python calls handlers of signals in the midst of whatever runs."""
    import traceback

    return any(frame.f_code in codes for frame, _ in traceback.walk_tb(e.__traceback__))


def harmless(show: Callable[P, Any]) -> Callable[P, None]:
    """`show`, which is called no more after it has raised an exception: a rendering is worth more than what is shown of it.
    Exceptions of signal handlers are those of the caller.
    """
    fails = False

    @functools.wraps(show)
    def shown(*args: P.args, **kwargs: P.kwargs) -> None:
        nonlocal fails
        if fails:
            return
        handlers = _signal_handlers()  # Now, since one may remove itself when it is called.
        try:
            show(*args, **kwargs)
        except Exception as e:
            if _is_of(e, handlers):
                raise
            fails = True
            text = f"the progress cannot be shown: {e}"
            try:
                warnings.warn(text, RuntimeWarning, stacklevel=2)
            except RuntimeWarning:  # Warnings are errors here (-W error), but this one ends no rendering.
                with warnings.catch_warnings():
                    warnings.simplefilter("always")
                    warnings.warn(text, RuntimeWarning, stacklevel=2)

    return shown
