"""What plots have in common."""

from typing import Any


def axes_or_new(ax: Any) -> Any:
    """The Axes, or those of a new figure."""
    if ax is not None:
        if not hasattr(ax, "loglog"):
            raise TypeError(f"ax must be the Axes of a figure, but is {type(ax).__name__}")
        return ax
    try:
        from matplotlib import pyplot
    except ImportError:
        raise ImportError("plots need matplotlib: pip install matplotlib") from None
    return pyplot.subplots()[1]
