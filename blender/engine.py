"""The render engine: final renderings with passes, progress and cancelling; the viewport is in viewport.py."""

from __future__ import annotations

import tempfile
import time
import traceback
import warnings
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from .camera import resolution
from .denoising import prepare
from .images import with_copies
from .report import Refused, Report
from .scene import SceneReader
from .settings import changed_parameters, integrator_text
from .viewport import Viewport

PASSES = (("Normal", 3, "XYZ", "VECTOR"), ("Depth", 1, "Z", "VALUE"), ("Albedo", 3, "RGB", "COLOR"))
"""Passes beside Combined: name, channels, their names, and type."""
DENOISED = "Denoised"
"""One more, if the setting says so."""
_FAR = 1e10
"""The depth where there is no surface, as in Cycles."""


class EtendueEngine(bpy.types.RenderEngine):
    bl_idname = "ETENDUE"
    bl_label = "etendue"
    bl_use_preview = False
    bl_use_shading_nodes_custom = False
    bl_use_eevee_viewport = True

    destination: Path | None = None
    """A folder to which the scene is written instead of being rendered: the operator in export.py sets it, so that the
    scene is evaluated as for a final rendering."""
    is_for_mitsuba = False
    """Whether that scene has only what Mitsuba 3 reads."""

    def update_render_passes(self, scene: Any = None, renderlayer: Any = None) -> None:
        self.register_pass(scene, renderlayer, "Combined", 4, "RGBA", "COLOR")
        if scene is not None and scene.etendue.denoise:
            self.register_pass(scene, renderlayer, DENOISED, 4, "RGBA", "COLOR")
        for name, channels, letters, kind in PASSES:
            self.register_pass(scene, renderlayer, name, channels, letters, kind)

    def render(self, depsgraph: Any) -> None:
        with tempfile.TemporaryDirectory(prefix="etendue-") as folder:
            try:
                self._render(depsgraph, Path(folder))
            except Exception as e:
                if not isinstance(e, (Refused, RuntimeError, ValueError, ImportError, MemoryError)):
                    traceback.print_exc()  # of what should not happen
                message = f"etendue: {e or type(e).__name__}"
                self.report({"ERROR"}, message)
                self.error_set(message)

    def _render(self, depsgraph: Any, folder: Path) -> None:
        self.update_stats("", "Reading the scene")
        reader, scene = SceneReader(depsgraph, folder), depsgraph.scene
        description = reader.read()
        if self.destination is not None:
            self._write(description, scene, reader.report)
        else:
            self._trace(description, depsgraph)
        for warning in reader.report.warnings:
            self.report({"WARNING"}, f"etendue: {warning}")

    def _write(self, description: dict[str, Any], scene: Any, report: Report) -> None:
        import etendue as et

        settings = scene.etendue
        description["sensor"]["sampler"] = {"type": "independent", "sample_count": settings.samples}
        description["integrator"] = {"type": settings.integrator, **changed_parameters(settings)}
        description = with_copies(description, self.destination)
        with warnings.catch_warnings(record=True) as replaced:
            warnings.simplefilter("always")
            et.load_dict(description, folder=self.destination).save(self.destination / "scene.xml", mitsuba=self.is_for_mitsuba)
        for warning in replaced:
            report.warn("Mitsuba 3" if self.is_for_mitsuba else "scene.xml", str(warning.message))

    def _trace(self, description: dict[str, Any], depsgraph: Any) -> None:
        import etendue as et

        self.update_stats("", "Building the scene")
        built, scene = et.load_dict(description).build(), depsgraph.scene
        settings = scene.etendue
        if settings.denoise:
            prepare()
            self.add_pass(DENOISED, 4, "RGBA", layer=depsgraph.view_layer.name)
        result = self.begin_result(0, 0, built.width, built.height, layer=depsgraph.view_layer.name)
        newest: list[tuple[et.Progress, np.ndarray | None]] = []

        def keep(progress: et.Progress) -> None:
            newest[:] = [(progress, None if self.is_animation else progress.image)]

        def show(progress: et.Progress, image: np.ndarray | None) -> None:
            self.update_progress(progress.fraction or 0.0)
            error = "" if progress.error is None else f", error {progress.error:.3f}"
            self.update_stats("", f"{progress.passes} samples{error}")
            if image is not None:
                _fill(result, "Combined", _with_alpha(image))
                self.update_result(result)

        is_cancelled = False
        try:
            # On a thread of its own, so that cancelling need not wait for the end of a pass.
            with et.start(
                built, integrator_text(settings), spp=settings.samples, time=settings.time or None, seed=settings.seed,
                filter_mode="sample" if settings.denoise else "spread",
                threads=scene.render.threads if scene.render.threads_mode == "FIXED" else 0,
                aovs=[name.lower() for name, *_ in PASSES], callback=keep,
            ) as job:
                while not job.done and not is_cancelled:
                    time.sleep(0.02)
                    if newest:
                        show(*newest.pop())
                    is_cancelled = self.is_cancelled()
            image = job.result()
        except et.RenderError as e:
            self.report({"WARNING"}, f"etendue: {e.__cause__}; the image is that of {e.result.passes} samples")
            image = e.result
        except BaseException:
            self.end_result(result, cancel=not is_cancelled)
            if is_cancelled:  # before the end of the first pass: the image is black
                return
            raise
        _fill(result, "Combined", _with_alpha(image.image))
        if settings.denoise:
            try:
                _fill(result, DENOISED, _with_alpha(image.denoised()))
            except (RuntimeError, MemoryError) as e:  # without it, there is still the image
                self.report({"WARNING"}, f"etendue: the image is not denoised: {e or type(e).__name__}")
        _fill(result, "Normal", image.aov["normal"])
        _fill(result, "Albedo", image.aov["albedo"])
        _fill(result, "Depth", _depth(image.aov["depth"][..., :1], description["sensor"], resolution(scene.render)))
        for warning in [*built.warnings, *image.warnings]:
            self.report({"WARNING"}, f"etendue: {warning}")
        self.end_result(result)

    def is_cancelled(self) -> bool:
        """Whether the user has cancelled the rendering; the passes so far are kept."""
        return self.test_break()

    def view_update(self, context: Any, depsgraph: Any) -> None:
        if not hasattr(self, "viewport"):
            self.viewport = Viewport(self)
        self.viewport.update(context, depsgraph)

    def view_draw(self, context: Any, depsgraph: Any) -> None:
        if hasattr(self, "viewport"):
            self.viewport.draw(context, depsgraph)


def _with_alpha(image: np.ndarray) -> np.ndarray:
    return np.concatenate([image, np.ones_like(image[..., :1])], axis=2)


def _fill(result: Any, name: str, image: np.ndarray) -> None:
    """Sets a pass of the result. Blender's first row is the lowest one."""
    found = result.layers[0].passes.find_by_name(name, "")
    if found is not None:
        found.rect.foreach_set(np.ascontiguousarray(image[::-1], dtype=np.float32).reshape(-1))


def _depth(distance: np.ndarray, sensor: dict[str, Any], size: tuple[int, int]) -> np.ndarray:
    """Distances from the lens as depths along the viewing direction, as in Cycles."""
    depth = distance
    if sensor["type"] != "orthographic":
        half = np.tan(np.radians(sensor["fov"] / 2))
        rows, columns = np.indices(distance.shape[:2])
        film = sensor["film"]
        u = (columns + film.get("crop_offset_x", 0) + 0.5) / size[0] + sensor["principal_point_offset_x"] - 0.5
        v = (rows + film.get("crop_offset_y", 0) + 0.5) / size[1] + sensor["principal_point_offset_y"] - 0.5
        squares = (2 * half * u) ** 2 + (2 * half / sensor["aspect"] * v) ** 2
        depth = distance / np.sqrt(1 + squares)[..., None]
    return np.where(distance > 0, depth, _FAR)
