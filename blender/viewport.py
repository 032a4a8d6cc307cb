"""The preview in the viewport: rendered on a thread, and drawn as a texture whenever passes are finished."""

from __future__ import annotations

import math
import tempfile
import threading
import weakref
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
        # Blender releases the engine of a viewport without further notice.
        self._engine = weakref.ref(engine)
        weakref.finalize(engine, self.close)
        self._folder = tempfile.TemporaryDirectory(prefix="etendue-")
        self._description: dict[str, Any] | None = None
        self._view: tuple[float, ...] | None = None
        self._run: _Run | None = None
        self._error = ""

    def update(self, context: Any, depsgraph: Any) -> None:
        """Reads the scene anew."""
        self._cancel()
        self._description, self._view, self._error = None, None, ""
        try:
            self._description = SceneReader(depsgraph, Path(self._folder.name)).read(_sensor(context))
        except (Refused, RuntimeError, ValueError) as e:
            self._error = str(e)

    def draw(self, context: Any, depsgraph: Any) -> None:
        """Draws the newest image, and starts a rendering if the view has changed."""
        engine, view, settings = self._engine(), _view(context), depsgraph.scene.etendue
        if self._description is not None and view != self._view:
            self._view = view
            self._cancel()
            description = {**self._description, "sensor": _sensor(context)}
            self._run = _Run(self._engine, description, integrator_text(settings), settings.preview_samples)
        # Blender shows both in a corner of the view.
        engine.update_stats("etendue", self._error or (self._run.status if self._run else ""))
        engine.update_progress(self._run.fraction if self._run else 0.0)
        if self._run is not None and self._run.image is not None:
            _draw(engine, context, depsgraph.scene, self._run.image)

    def close(self) -> None:
        """Ends the rendering."""
        self._cancel()

    def _cancel(self) -> None:
        if self._run is not None:
            self._run.stop()
            self._run = None


class _Run:
    """A rendering on a thread of its own."""

    def __init__(self, engine: Any, description: dict[str, Any], method: str, samples: int):
        self.image: np.ndarray | None = None
        self.error = ""
        """Why there is no image."""
        self.fraction = 0.0
        """The part of the samples that is done."""
        self._progress = ""
        self._engine = engine
        self._is_stopped = threading.Event()
        self._thread = threading.Thread(target=self._render, args=(description, method, samples), daemon=True)
        self._thread.start()

    @property
    def status(self) -> str:
        """Samples and time so far, or the error."""
        return self.error or self._progress or "Building the scene"

    def stop(self) -> None:
        """Ends it, within a pass too."""
        self._is_stopped.set()
        self._thread.join()

    def _render(self, description: dict[str, Any], method: str, samples: int) -> None:
        def show(progress: Any) -> None:
            self.image, self.fraction = progress.image, progress.passes / samples
            self._progress = f"{progress.passes} of {samples} samples, {progress.seconds:.1f} s"
            self._redraw()

        try:
            import etendue as et

            with et.start(et.load_dict(description).build(), method, spp=samples, callback=show) as job:
                while not job.done and not self._is_stopped.wait(0.02):
                    pass
            if not self._is_stopped.is_set():
                job.result()
        except Exception as e:
            self.error = str(e) or type(e).__name__
            self._redraw()

    def _redraw(self) -> None:
        engine = self._engine()
        if engine is not None and not self._is_stopped.is_set():
            engine.tag_redraw()


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
    # Such views begin far behind their origin, which lies at the middle of what is looked at.
    near = np.eye(4)
    near[2, 3] = min((window[2, 3] + 1) / window[2, 2], 0.0)
    return {"type": "orthographic", "to_world": to_world @ near @ np.diag([half, half, half, 1.0]), "film": film}


def _draw(engine: Any, context: Any, scene: Any, image: np.ndarray) -> None:
    import gpu
    from gpu_extras.presets import draw_texture_2d

    height, width = image.shape[:2]
    buffer = gpu.types.Buffer("FLOAT", width * height * 4, _pixels(image).reshape(-1))
    texture = gpu.types.GPUTexture((width, height), format="RGBA16F", data=buffer)
    engine.bind_display_space_shader(scene)
    draw_texture_2d(texture, (0, 0), context.region.width, context.region.height)
    engine.unbind_display_space_shader()


def _pixels(image: np.ndarray) -> np.ndarray:
    """RGBA in single precision; the first row is the lowest one."""
    return np.concatenate([image[::-1], np.ones_like(image[..., :1])], axis=2).astype(np.float32)
