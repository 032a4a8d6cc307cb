"""Rendering, and its results."""

import json
import numbers
import sys
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _etendue
from ._arguments import count, whole
from ._denoiser_library import denoiser_library
from ._etendue import Description, Scene
from ._html import image_html, png_of
from ._integrator import Integrator
from ._method import Method
from ._plots import axes_or_new
from ._progress import harmless
from ._scenes import SceneLike, built, described

Image = NDArray[np.float32]


class FilmView:
    """Moments over the passes: after the rendering, read-only views of the film's memory, without copies; in callbacks, copies
    that later passes do not change. In other threads they cannot be read while it runs (RuntimeError).
    """

    def __init__(self, rendering: _etendue.Rendering | _etendue.Merged):
        self._rendering = rendering

    @property
    def sums(self) -> NDArray[np.float64]:
        """Sum of each pixel's radiance over the passes, shape (H, W, 3)."""
        return self._rendering.sums()

    @property
    def deviations(self) -> NDArray[np.float32]:
        """Root of the sum over the passes of the squared difference between a pixel's radiance and its mean, shape (H, W, 3)."""
        return self._rendering.deviations()

    @property
    def passes(self) -> int:
        """Number of passes, which is the number of samples per pixel."""
        return self._rendering.passes


@dataclass(frozen=True)
class Progress:
    """A rendering between two passes, for callbacks."""

    passes: int
    """Number of finished passes, which is the number of samples per pixel."""
    seconds: float
    """Time spent on them, in seconds."""
    fraction: float | None
    """Finished fraction of the work, in [0, 1]; None if the limits do not determine it."""
    rays_per_second: float
    """Rays per second."""
    error: float | None
    """Estimated relative error of the image, dimensionless; None before there are enough passes."""
    film: FilmView
    """The film's sums, to be read in the callback or after the rendering."""
    _rendering: _etendue.Rendering

    @property
    def image(self) -> Image:
        """The image so far: radiance, linear RGB, shape (H, W, 3)."""
        return self._rendering.image()

    def save(self, file: str | PathLike[str]) -> None:
        """Writes the state of the rendering so far, an .etd file, from which resume() goes on."""
        check_checkpoint_name(file)
        self._rendering.save_checkpoint(fspath(file))


@dataclass(frozen=True)
class TechniqueImage:
    """The image of one technique."""

    s: int
    """Number of light vertices."""
    t: int
    """Number of eye vertices."""
    kind: str
    """hit, next_event, connect, stored, splat, hit_lens, merge, gather or specular."""
    weighted: Image
    """Contribution times MIS weight: radiance, shape (H, W, 3). The images of all techniques sum to the image."""
    unweighted: Image
    """Contribution of the technique alone: radiance, shape (H, W, 3)."""


class Result:
    """The result of a rendering. Arrays are created when they are first needed, and own their memory. A result that was
    pickled has all but the scene and the auxiliary images.
    """

    def __init__(self, rendering: _etendue.Rendering | _etendue.Merged, stopped_by: str, aovs: Sequence[str]):
        self._rendering = rendering
        self._aov_names = tuple(aovs)
        self._cache: dict[str, Any] = {}
        self.stopped_by = stopped_by
        """Why the rendering ended: "samples", "time", "error", "interrupted" (Ctrl-C), "callback" (it returned False),
        "stopped" (Job.stop); of a RenderError: "failure"; of merge(): "merged"."""

    def _cached(self, name: str, make: Callable[[], Any]) -> Any:
        if name not in self._cache:
            self._cache[name] = make()
        return self._cache[name]

    @property
    def scene(self) -> Scene:
        """The scene, which the result keeps alive. Results of merge() have none (RuntimeError)."""
        return self._own("scene").scene

    def _own(self, what: str) -> _etendue.Rendering:
        if isinstance(self._rendering, _etendue.Merged):
            raise RuntimeError(f"merged results have no {what}")
        return self._rendering

    @property
    def image(self) -> Image:
        """Radiance, linear RGB, shape (H, W, 3)."""
        image: Image = self._cached("image", self._rendering.image)
        return image

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """The image, for np.asarray(result) and plt.imshow(result)."""
        image = self.image
        if dtype is not None and np.dtype(dtype) != image.dtype:
            if copy is False:
                raise ValueError(f"the image is float32: as {np.dtype(dtype)} it has to be copied")
            return image.astype(dtype)
        return image.copy() if copy else image

    @property
    def variance(self) -> Image:
        """Variance of each pixel's mean, in units of radiance squared, shape (H, W, 3); 0 with fewer than two passes. With
        the sampler "sobol" it is an upper bound.
        """
        variance: Image = self._cached("variance", self._rendering.variance)
        return variance

    @property
    def half_width(self) -> Image:
        """Half width of each pixel's 95 % confidence interval (Student's t), in units of radiance, shape (H, W, 3); NaN
        with fewer than two passes.
        """
        half_width: Image = self._cached("half_width", self._rendering.half_width)
        return half_width

    @property
    def film(self) -> FilmView:
        """Sums and deviations over the passes, without copies, of shape (H, W, 3)."""
        return FilmView(self._rendering)

    @property
    def aov(self) -> dict[str, Image]:
        """The auxiliary images requested from render(), by name: linear values of the first surface, averaged over a pixel,
        shape (H, W, 3). "depth" and "position" are in scene units; "variance" is Result.variance.
        """

        def make() -> dict[str, Image]:
            names = [n for n in self._aov_names if n != "variance"]
            images: dict[str, Image] = self._own("auxiliary images").aovs(names) if names else {}
            if "variance" in self._aov_names:
                images["variance"] = self.variance
            return images

        aov: dict[str, Image] = self._cached("aov", make)
        return aov

    @property
    def techniques(self) -> list[TechniqueImage]:
        """The images of all techniques, by path length and s; empty unless they were requested from render()."""
        techniques: list[TechniqueImage] = self._cached(
            "techniques", lambda: [TechniqueImage(*t) for t in self._rendering.techniques()]
        )
        return techniques

    def technique(self, s: int, t: int, kind: str | None = None) -> TechniqueImage:
        """The images of the technique with s light and t eye vertices.

        kind: "merge", "gather", "specular" or "stored" (s = 1 with y_0 of a light path), where another technique has the same s
        and t.
        """
        special = ("merge", "gather", "stored")
        found = [q for q in self.techniques if q.s == s and q.t == t]
        matching = [q for q in found if q.kind == kind or (kind is None and q.kind not in special)]
        if not matching:
            known = ", ".join(f"({q.s}, {q.t}, {q.kind})" for q in self.techniques)
            raise KeyError(f"there is no image of the technique ({s}, {t}, {kind}); there are: {known or 'none'}")
        return matching[0]

    @property
    def error(self) -> float | None:
        """Estimated relative error of the image, dimensionless: the root of the mean over pixels of variance / (I² + 0.01
        mean(I)²). None with too few passes.
        """
        error = self._rendering.error()
        return None if error is None else error[0]

    @property
    def error_interval(self) -> tuple[float, float] | None:
        """95 % confidence interval of Result.error, dimensionless."""
        error = self._rendering.error()
        return None if error is None else (error[1], error[2])

    def plot_convergence(self, ax: Any = None) -> Any:
        """Plots the relative error (Result.error) over the time, beside the line of an error in proportion to the inverse of
        the root of the time. Returns the Axes of matplotlib, which can be given as ax.

            et.render(scene, "bdpt", spp=256).plot_convergence()

        Raises RuntimeError for results of merge() and unpickled ones, which do not know their errors after fewer passes, and
        ImportError without matplotlib.
        """
        errors = self._own("errors of fewer passes").errors()
        if not errors:
            raise RuntimeError(f"the error is not known after {self.passes} spp: render more")
        ax = axes_or_new(ax)
        seconds, error = np.array([e[1:] for e in errors]).T
        ax.loglog(seconds, error, marker=".", label=self._rendering.integrator)
        ax.loglog(seconds, error[-1] * np.sqrt(seconds[-1] / seconds), color="0.6", linestyle="--", label="1 / √time")
        ax.set(xlabel="time [s]", ylabel="relative error")
        ax.legend()
        return ax

    @property
    def estimator(self) -> str:
        """Name of the property that the method claims: "unbiased", "consistent" or "biased"."""
        return self._rendering.estimator

    @property
    def passes(self) -> int:
        """Number of passes, which is the number of samples per pixel."""
        return self._rendering.passes

    @property
    def seconds(self) -> float:
        """Time spent on the passes, in seconds."""
        return self._rendering.seconds

    @property
    def warnings(self) -> list[str]:
        """Possible errors of the image, one sentence each."""
        return self._rendering.warnings

    @property
    def stats(self) -> dict[str, Any]:
        """Statistics with the keys of `etendue render --stats`: counts, and times in seconds."""
        stats: dict[str, Any] = self._cached("stats", lambda: json.loads(self._rendering.stats()))
        return stats

    def denoised(self) -> Image:
        """The image without its noise, and with a bias: radiance, shape (H, W, 3). See denoise()."""
        self._warn_of_correlation()
        denoised: Image = self._cached("denoised", lambda: self._rendering.denoised(denoiser_library()))
        return denoised

    def _warn_of_correlation(self) -> None:
        if self._rendering.spreads:
            warnings.warn(
                "the filter mode is \"spread\": the errors of neighbouring pixels are correlated, and denoising leaves some "
                "of them; render with filter_mode=\"sample\"",
                stacklevel=3,
            )

    def save(self, file: str | PathLike[str], *, denoised: bool = False) -> None:
        """Writes the image, like `etendue render -o`. An .exr file also contains the auxiliary images and statistics. An
        .etd file is a checkpoint: resume() goes on from it, and merge() adds it to others. The sum that merge() made is
        not written to the file of a part, which could then not go on: RuntimeError.

        denoised: writes Result.denoised() instead, like `etendue denoise`; the metadata of an .exr file say so.
        """
        if fspath(file).endswith(".etd"):
            if denoised:
                raise ValueError(f"a checkpoint is not denoised: {fspath(file)!r}")
            self._rendering.save_checkpoint(fspath(file))
        elif denoised:
            self._warn_of_correlation()
            self._rendering.save_denoised(fspath(file), denoiser_library())
        else:
            self._rendering.save(fspath(file), list(self._aov_names))

    def partial(self) -> bytes:
        """The sums over the passes, for merge(): with them errors, statistics and technique images."""
        return self._rendering.partial()

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (self.partial(), self.stopped_by)

    def __repr__(self) -> str:
        height, width = self.image.shape[:2]
        error = "" if self.error is None else f", relative error {self.error:.4f}"
        return (
            f"<Result {width} x {height}, {self._rendering.integrator}, {self.passes} spp in {self.seconds:.1f} s"
            f"{error}, stopped by {self.stopped_by}>"
        )

    def _repr_png_(self) -> bytes:
        return png_of(self.image)

    def _repr_html_(self) -> str:
        error = "" if self.error is None else f", relative error {self.error:.4f}"
        text = f"{self._rendering.integrator}: {self.passes} spp in {self.seconds:.1f} s{error}"
        return f"<figure>{image_html(self.image, title=text)}<figcaption>{text}</figcaption></figure>"


class RenderError(RuntimeError):
    """A rendering has failed, in a pass or between passes, but there are passes before it:

        try:
            result = et.render(scene, "vcm", spp=4096)
        except et.RenderError as e:
            result = e.result

    Its __cause__ is what was raised, such as a MemoryError.
    """

    def __init__(self, message: str, result: Result):
        super().__init__(message)
        self.result = result
        """The result of the passes before the failure. Result.save() of an .etd file and resume() go on from it."""

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.result)


class _Bar:
    """A progress bar of tqdm, if tqdm is installed."""

    def __init__(self, rendering: _etendue.Rendering, wanted: bool | None):
        self._rendering = rendering
        self._bar: Any = None
        in_notebook = "ipykernel" in sys.modules
        if wanted is False or (wanted is None and not (in_notebook or sys.stderr.isatty())):
            return
        try:
            from tqdm.auto import tqdm
        except ImportError:
            return
        self._bar = tqdm(total=1.0, bar_format="{l_bar}{bar}| {elapsed}<{remaining}{postfix}", leave=False)

    def update(self) -> None:
        now = self._rendering.now()
        if self._bar is None or now is None:
            return
        passes, _, fraction, _, error = now
        self._bar.n = fraction or 0.0
        self._bar.set_postfix_str(f"{passes} spp" + ("" if error is None else f", error {error:.4f}"))

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()


def render(
    scene: SceneLike,
    integrator: Method = "",
    *,
    spp: int | None = None,
    time: float | None = None,
    error: float | None = None,
    seed: int = 0,
    passes: tuple[int, int] | None = None,
    sampler: str = "sobol",
    filter_mode: str = "spread",
    threads: int = 0,
    aovs: Sequence[str] = (),
    techniques: bool | int = False,
    sensor: int | str | None = None,
    callback: Callable[[Progress], object] | None = None,
    progress: bool | None = None,
    live: bool = False,
) -> Result:
    """Renders a scene. With the same seed, the image is bit-identical to that of the program.

        result = et.render("scenes/cornell.xml", "bdpt", spp=64)
        result = et.render(scene, {"type": "path", "max_depth": 8}, time=10, aovs=["albedo"])

    scene: a Scene, or a Description, a dict as load_dict() takes it, or a file, which is built first.
    integrator: a name with parameters, such as "upg+bdpt:max_depth=12"; the same as a dict or by integrator(); "" for the
        integrator of the scene, or "auto" if it names none; or an Integrator.
    spp, time, error: limits: samples per pixel, seconds, relative error of the image (see Result.error). The first limit
        that is reached ends the rendering. Without a limit, the samples per pixel of the scene, or 64.
    seed: seed of all random numbers.
    passes: renders the passes from the first number up to the second one, excluding it, for merge(); instead of spp.
    sampler: "sobol" or "independent". With "sobol", errors and variances are upper bounds.
    filter_mode: "spread": an eye path contributes to all pixels that the filter of the film reaches, and the errors of
        neighbouring pixels are correlated; "sample": to its own pixel alone, and errors are independent.
    threads: number of threads; 0 for one per core.
    aovs: auxiliary images to render: albedo, normal, depth, position, uv, denoise_albedo, denoise_normal, variance.
    techniques: makes an image of each technique, for paths of at most this many edges; True: 6.
    sensor: number (from 0) or name of the sensor, of files, dicts and Descriptions; None: the first. A Scene has one
        already.
    callback: called between passes with a Progress. If it returns False, the rendering ends. Exceptions that it raises
        are passed to the caller.
    progress: shows a progress bar of tqdm; None: in notebooks and on terminals, if tqdm is installed.
    live: shows the image during the rendering, in notebooks; see show().

    Ctrl-C discards the current pass and returns the result of the passes before it, with stopped_by "interrupted". If no
    pass is complete yet, it raises KeyboardInterrupt. Other Python threads continue during the rendering.

    Raises RuntimeError for an unknown integrator, parameter or layer, and in a process forked from one that had built or
    rendered a scene (use the start method "spawn"); ValueError for another sampler or filter mode, and for limits that
    are not above 0. If a pass fails, for example for want of memory, raises RenderError, whose result is that of the
    passes before it. If it is the first pass, raises what the pass raised: a RuntimeError, a MemoryError, or the exception
    of an Integrator. Exceptions of signal handlers are passed to the caller.
    """
    rendering = new_rendering(
        scene, integrator, spp, time, error, seed, passes, sampler, filter_mode, threads, aovs, techniques, sensor
    )
    return run(rendering, aovs, callback, progress, live)


def render_sensors(
    scene: SceneLike,
    integrator: Method = "",
    sensors: Iterable[int | str] | int | str | None = None,
    *,
    resolution: tuple[int, int] | None = None,
    threads: int = 0,
    **limits: Any,
) -> list[Result]:
    """Renders what several sensors of a scene see, one after the other. Geometry, hierarchy and images of the scene are made once.

        left, right = et.render_sensors("scenes/stereo.xml", "bdpt", ["left", "right"], spp=64)
        names = left.scene.sensors

    scene: a Description, a dict as load_dict() takes it, or a file. A Scene has one sensor only (ValueError).
    sensors: their numbers (from 0) or names, in the order of the results, or one of them; None: all sensors of the scene.
    resolution: (width, height) of all images in pixels, instead of those of the scene.
    threads: number of threads; 0 for one per core.
    limits: the other arguments of render(): spp, time and error are those of each image.

    Ctrl-C ends the rendering of one sensor, whose result has stopped_by "interrupted" and is the last one. Raises SceneError
    for a sensor that is not there, before anything is rendered, and else what render() raises.
    """
    if isinstance(scene, Scene):
        raise ValueError("a Scene has one sensor only: give its Description, or the dict or file that it was made of")
    description = described(scene)
    if isinstance(sensors, (numbers.Integral, str)):
        sensors = [sensors]  # type: ignore[list-item]
    chosen: list[int | str] = []
    for sensor in range(len(_scene_of(description, resolution, threads, 0).sensors)) if sensors is None else sensors:
        chosen.append(sensor if isinstance(sensor, str) else whole("sensors", sensor))
    scenes = [_scene_of(description, resolution, threads, sensor) for sensor in chosen]
    results: list[Result] = []
    for each in scenes:
        results.append(render(each, integrator, threads=threads, **limits))
        if results[-1].stopped_by == "interrupted":
            break
    return results


def _scene_of(description: Description, resolution: tuple[int, int] | None, threads: int, sensor: int | str) -> Scene:
    return description.build(resolution=resolution, threads=threads, sensor=sensor)


def new_rendering(
    scene: SceneLike,
    integrator: Method,
    spp: int | None,
    time: float | None,
    error: float | None,
    seed: int,
    passes: tuple[int, int] | None,
    sampler: str,
    filter_mode: str,
    threads: int,
    aovs: Sequence[str],
    techniques: bool | int,
    sensor: int | str | None,
) -> _etendue.Rendering:
    """A rendering before its first pass, with the arguments of render()."""
    _etendue.check_aovs(list(aovs))
    spp, seed = count("spp", spp), count("seed", seed) or 0
    if sensor is not None and not isinstance(sensor, str):
        sensor = whole("sensor", sensor)
    depth = 6 if techniques is True else int(techniques)
    first = 0
    if passes is not None:
        first, end = passes
        if spp is not None or not 0 <= first < end:
            raise ValueError("passes must be two numbers with 0 <= first < second, without spp")
        spp = end - first
    return _etendue.Rendering(
        built(scene, threads, sensor), integrator, spp, time, error, seed, sampler, filter_mode, threads, depth, first
    )


def resume(
    file: str | PathLike[str],
    scene: SceneLike,
    integrator: Integrator | None = None,
    *,
    spp: int | None = None,
    time: float | None = None,
    error: float | None = None,
    threads: int = 0,
    aovs: Sequence[str] = (),
    callback: Callable[[Progress], object] | None = None,
    progress: bool | None = None,
    live: bool = False,
) -> Result:
    """Goes on from a checkpoint (Result.save, Progress.save) with the same bits as if the rendering had not been interrupted.

        et.render(scene, "bdpt", spp=64).save("night.etd")
        result = et.resume("night.etd", scene, spp=256)

    file: an .etd file. It must be your own: what it has learned is used as it is.
    scene: the same scene, as for render(). If it has several sensors, a Scene with the same sensor.
    integrator: if it was one in Python, an object that is equal to what it was at the start.
    spp, time, error: limits, which count from the first pass. The others are those of render().

    Raises RuntimeError, with all differences, if the bits would not be the same: another scene, another build of this
    package, another kind of processor. Raises RenderError if a pass fails.
    """
    _etendue.check_aovs(list(aovs))
    spp = count("spp", spp)
    of = _etendue.read_checkpoint(fspath(file))
    if integrator is None and " in Python, " in of["condition"]:
        raise ValueError(f"{fspath(file)}: expected integrator, an object like the {of['integrator']} that it was rendered by")
    rendering = _etendue.Rendering(
        built(scene, threads), of["integrator"] if integrator is None else integrator, spp, time, error, of["seed"],
        of["sampler"], of["filter_mode"], threads, of["technique_depth"], of["first_pass"], of["choice"],
    )
    rendering.resume(fspath(file))
    return run(rendering, aovs, callback, progress, live)


def merge(parts: Iterable[str | PathLike[str] | bytes | Result]) -> Result:
    """Adds up renderings of one scene by one method: results, partial results (Result.partial), or .etd files.

        parts = [et.render(scene, "bdpt", spp=16, seed=seed) for seed in range(4)]
        result = et.merge(parts)

    They must have other seeds or other passes of the same seed; nothing depends on their order. Error, interval,
    statistics and technique images of the result are those of all passes. Renderings of other scenes or methods, and
    passes that occur twice, raise RuntimeError. A UserWarning says where more seeds do not reduce a bias.
    """
    merged = _etendue.merge(
        [p.partial() if isinstance(p, Result) else p if isinstance(p, bytes) else fspath(p) for p in parts]
    )
    for text in merged.merge_warnings():
        warnings.warn(text, stacklevel=2)
    return Result(merged, "merged", ())


def progress_of(rendering: _etendue.Rendering) -> Progress:
    """The state after the last finished pass."""
    now = rendering.now() or (0, 0.0, None, 0.0, None)
    return Progress(*now, film=FilmView(rendering), _rendering=rendering)


def _unpickled(partial: bytes, stopped_by: str) -> Result:
    return Result(_etendue.merge([partial]), stopped_by, ())


def check_checkpoint_name(file: str | PathLike[str]) -> None:
    if not fspath(file).endswith(".etd"):
        raise ValueError(f"the name of a checkpoint must end with .etd, but is {fspath(file)!r}")


def run(
    rendering: _etendue.Rendering,
    aovs: Sequence[str],
    callback: Callable[[Progress], object] | None,
    progress: bool | None,
    live: bool,
    seconds_between: float = 0.0,
) -> Result:
    """Renders all passes. The callback is called between them, if the last call was at least seconds_between before."""
    for text in rendering.memory_warnings:
        warnings.warn(text, stacklevel=3)
    update_view: Callable[..., None] | None = None
    if live:
        from ._show import LiveView

        update_view = harmless(LiveView().update)

    def between_passes() -> object:
        if update_view is not None:
            update_view(rendering.image())
        return None if callback is None else callback(progress_of(rendering))

    wants_calls = callback is not None or live
    interval = seconds_between if callback is not None else 0.5
    bar = _Bar(rendering, progress)
    try:
        stopped_by = rendering.run(harmless(bar.update), between_passes if wants_calls else None, interval)
    except Exception as failure:
        if not rendering.place_of_failure or rendering.passes == 0:
            raise
        n = rendering.passes
        why = "not enough memory" if isinstance(failure, MemoryError) else str(failure) or type(failure).__name__
        raise RenderError(
            f"{rendering.place_of_failure}: {why}; the result of the {'pass' if n == 1 else f'{n} passes'} before it "
            "is in RenderError.result",
            Result(rendering, "failure", aovs),
        ) from failure
    finally:
        harmless(bar.close)()
    if rendering.passes == 0:
        raise KeyboardInterrupt("interrupted in the first pass")
    result = Result(rendering, stopped_by, aovs)
    if update_view is not None:
        update_view(result.image, is_last=True)
    return result
