"""The preview in the viewport: rendered on a thread, and drawn as a texture whenever passes are finished."""

from __future__ import annotations

import math
import tempfile
import threading
from pathlib import Path
from typing import Any

import numpy as np

from .report import Refused
from .scene import SceneReader
from .settings import integrator_text

_TURN = np.diag([-1.0, 1.0, -1.0, 1.0])


class Viewport:
    """One viewport of an engine. Blender's data are read on the main thread only; the other one renders."""

    def __init__(self, engine: Any):
        self._engine = engine
        self._folder = tempfile.TemporaryDirectory(prefix="etendue-")
        self._description: dict[str, Any] | None = None
        self._view: tuple[float, ...] | None = None
        self._image: np.ndarray | None = None
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()

    def update(self, context: Any, depsgraph: Any) -> None:
        """Reads the scene anew."""
        self._cancel()
        try:
            self._description = SceneReader(depsgraph, Path(self._folder.name)).read(_sensor(context))
        except (Refused, RuntimeError, ValueError) as e:
            self._description = None
            self._engine.update_stats("etendue", str(e))
        self._view = None

    def draw(self, context: Any, depsgraph: Any) -> None:
        """Draws the newest image, and starts a rendering if the view has changed."""
        view = _view(context)
        if self._description is not None and view != self._view:
            self._view = view
            self._start(context, depsgraph.scene.etendue)
        if self._image is not None:
            _draw(self._engine, context, depsgraph.scene, self._image)

    def _start(self, context: Any, settings: Any) -> None:
        self._cancel()
        try:
            import etendue as et
        except ImportError as e:
            self._engine.update_stats("etendue", str(e))
            return
        description = {**self._description, "sensor": _sensor(context)}
        method, samples = integrator_text(settings), settings.preview_samples
        self._stop = stop = threading.Event()

        def show(progress: et.Progress) -> bool:
            if not stop.is_set():
                self._image = progress.image
                self._engine.tag_redraw()
            return not stop.is_set()

        def render() -> None:
            try:
                et.render(et.load_dict(description).build(), method, spp=samples, callback=show, progress=False)
            except (RuntimeError, ValueError) as e:
                self._engine.update_stats("etendue", str(e))

        self._thread = threading.Thread(target=render, daemon=True)
        self._thread.start()

    def _cancel(self) -> None:
        self._stop.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None


def _view(context: Any) -> tuple[float, ...]:
    """What determines the image beside the scene."""
    region = context.region
    matrix = context.region_data.perspective_matrix
    return (region.width, region.height, *(v for row in matrix for v in row))


def _sensor(context: Any) -> dict[str, Any]:
    """The sensor of a viewport, from its projection. Its resolution is that of the region."""
    data, region = context.region_data, context.region
    window = np.array(data.window_matrix)
    to_world = np.array(data.view_matrix.inverted()) @ _TURN
    film = {"type": "hdrfilm", "width": region.width, "height": region.height}
    if data.is_perspective:
        fov = math.degrees(2 * math.atan(1 / window[0, 0]))
        return {"type": "perspective", "to_world": to_world, "fov": fov, "fov_axis": "x", "film": film,
                "principal_point_offset_x": window[0, 2] / 2, "principal_point_offset_y": -window[1, 2] / 2}
    half = 1 / window[0, 0]
    return {"type": "orthographic", "to_world": to_world @ np.diag([half, half, half, 1.0]), "film": film}


def _draw(engine: Any, context: Any, scene: Any, image: np.ndarray) -> None:
    import gpu
    from gpu_extras.presets import draw_texture_2d

    height, width = image.shape[:2]
    pixels = np.concatenate([image[::-1], np.ones_like(image[..., :1])], axis=2).astype(np.float32)
    buffer = gpu.types.Buffer("FLOAT", width * height * 4, np.ascontiguousarray(pixels).reshape(-1))
    texture = gpu.types.GPUTexture((width, height), format="RGBA16F", data=buffer)
    engine.bind_display_space_shader(scene)
    draw_texture_2d(texture, (0, 0), context.region.width, context.region.height)
    engine.unbind_display_space_shader()
