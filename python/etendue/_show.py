"""The widget for notebooks: an image of radiance with exposure, tone mapping and pixel values."""

from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from ._html import auto_exposure, png_of
from ._images import _pixels


def _bytes(image: Any) -> tuple[bytes, int, int]:
    """Half floats, row by row, with width and height."""
    pixels = _pixels(image)
    limit = float(np.finfo(np.float16).max)
    half = np.clip(pixels, -limit, limit).astype("<f2")
    return half.tobytes(), int(pixels.shape[1]), int(pixels.shape[0])


def _widget(image: Any) -> Any:
    """A widget, or None without anywidget."""
    try:
        import anywidget
        import traitlets
    except ImportError:
        return None

    class Viewer(anywidget.AnyWidget):  # type: ignore[misc]
        _esm = Path(__file__).with_name("_viewer.js")
        pixels = traitlets.Bytes().tag(sync=True)
        width = traitlets.Int().tag(sync=True)
        height = traitlets.Int().tag(sync=True)
        exposure = traitlets.Float(0.0).tag(sync=True)
        tone_operator = traitlets.Unicode("aces").tag(sync=True)

        def set_image(self, image: Any) -> None:
            """Shows another image."""
            pixels, width, height = _bytes(image)
            with self.hold_sync():
                self.width, self.height, self.pixels = width, height, pixels

    pixels, width, height = _bytes(image)
    return Viewer(pixels=pixels, width=width, height=height, exposure=auto_exposure(_pixels(image)))


class _Png:
    def __init__(self, image: Any):
        self._png = png_of(_pixels(image))

    def _repr_png_(self) -> bytes:
        return self._png


def show(image: Any) -> Any:
    """Shows an image (radiance, linear RGB, shape (H, W, 3)) or a Result in a notebook, with controls for exposure in stops
    and tone mapping, and the radiance of the pixel under the pointer. Without anywidget, shows a tone-mapped PNG.

        et.show(result)
        et.show(et.read_image("a.exr"))
    """
    widget = _widget(image)
    return _Png(image) if widget is None else widget


class LiveView:
    """A view of the image during a rendering, updated at most twice per second."""

    def __init__(self) -> None:
        self._view: Any = None
        self._last = -1.0

    def update(self, image: Any, is_last: bool = False) -> None:
        now = monotonic()
        if not is_last and now - self._last < 0.5:
            return
        self._last = now
        try:
            from IPython.display import display
        except ImportError:
            return
        if hasattr(self._view, "set_image"):
            self._view.set_image(image)
        elif self._view is None:
            self._view = _widget(image) or display(_Png(image), display_id=True)  # type: ignore[no-untyped-call]
            if hasattr(self._view, "set_image"):
                display(self._view)  # type: ignore[no-untyped-call]
        else:
            self._view.update(_Png(image))
