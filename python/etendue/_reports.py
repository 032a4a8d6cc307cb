"""Comparison and verification of methods."""

import json
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from . import _etendue
from ._arguments import count
from ._etendue import Description, Scene
from ._html import auto_exposure, frame_of, image_html, table_html
from ._images import _pixels
from ._integrator import Integrator
from ._method import Method, text_of
from ._plots import axes_or_new
from ._progress import harmless
from ._scenes import SceneLike, built

Image = NDArray[np.float32]


def _methods(methods: Method | Sequence[Method]) -> list[str | Integrator]:
    several = [methods] if isinstance(methods, (str, dict, Integrator)) else methods
    return [text_of(method) if isinstance(method, dict) else method for method in several]


def _status(progress: bool | None) -> tuple[Callable[[str], None] | None, Callable[[], None]]:
    """A listener that rewrites one line, and a function that clears this line."""
    if progress is False or (progress is None and not sys.stderr.isatty()):
        return None, lambda: None

    @harmless
    def show(text: str) -> None:
        sys.stderr.write(f"\r{text}\033[K")
        sys.stderr.flush()

    @harmless
    def clear() -> None:
        sys.stderr.write("\r\033[K")
        sys.stderr.flush()

    return show, clear


class CompareReport:
    """Errors of methods on scenes, at equal time or equal samples.
    compare() makes it, and notebooks show it as a table.

        report = et.compare("scenes/cornell.xml", ["path", "bdpt"], spp=16)
        rows = report.frame()
        error = et.diff(report.image(method=1), report.reference())["rel_mse"]
        report.save("out/report")
    """

    def __init__(self, comparisons: Any, data: Mapping[str, Any]):
        self._comparisons = comparisons
        self.data: list[dict[str, Any]] = data["scenes"]
        """All results, one dict for each scene, as in report.json of `etendue compare`."""
        self.warnings: list[str] = list(data["warnings"])
        """Warnings about the results, one sentence each."""
        for scene in self.data:
            for method in scene["methods"]:
                self.warnings += [f"{method['name']}: {w}" for w in method["warnings"]]

    def _rows(self) -> list[dict[str, Any]]:
        rows = []
        for scene in self.data:
            for method in scene["methods"]:
                s = method["summary"]
                rows.append({
                    "scene": scene["file"], "method": method["name"], "spp": s["spp"], "seconds": s["seconds"],
                    "rmse": s["rmse"], "rel_mse": s["rel_mse"], "rel_mse_trimmed": s["rel_mse_trimmed"],
                    "flip": method["flip"], "mean_ratio": s["mean_ratio"]["value"],
                    "efficiency": s["efficiency"]["value"] if s["efficiency"] else None,
                })
        return rows

    def frame(self) -> Any:
        """One row for each scene and method, as a pandas.DataFrame, or a list of dicts without pandas. seconds is time;
        rmse is in units of radiance; rel_mse, flip, mean_ratio and efficiency (relative to the first method) are
        dimensionless.
        """
        return frame_of(self._rows())

    def convergence(self) -> Any:
        """Errors over time: one row for each scene, method, run and checkpoint, with seconds, spp, rmse (units of radiance)
        and rel_mse (dimensionless); a DataFrame, or a list of dicts.
        """
        return frame_of([
            {
                "scene": scene["file"], "method": method["name"], "seed": run["seed"], "spp": c["spp"],
                "seconds": c["seconds"], "rmse": c["errors"]["rmse"], "rel_mse": c["errors"]["rel_mse"],
            }
            for scene in self.data for method in scene["methods"] for run in method["runs"]
            for c in run["checkpoints"]
        ])

    def plot(self, ax: Any = None, *, scene: int = 0, x: str = "seconds", y: str = "rel_mse") -> Any:
        """Plots the errors of the methods on one scene, averaged over the runs, over the time or the samples. Returns the
        Axes of matplotlib, which can be given as ax.

        x: "seconds", or "spp", the samples per pixel. y: "rel_mse" (dimensionless) or "rmse" (units of radiance).

            figure, (left, right) = plt.subplots(1, 2)
            report.plot(left)
            report.plot(right, x="spp")

        Raises ImportError without matplotlib.
        """
        labels = {"seconds": "time [s]", "spp": "samples per pixel", "rel_mse": "relMSE", "rmse": "RMSE"}
        for name, value, known in (("x", x, ("seconds", "spp")), ("y", y, ("rel_mse", "rmse"))):
            if value not in known:
                raise ValueError(f'{name} must be "{known[0]}" or "{known[1]}", but is {value!r}')
        if not 0 <= scene < len(self.data):
            raise IndexError(f"there is no scene {scene}: the report has {len(self.data)}")
        ax = axes_or_new(ax)
        for method in self.data[scene]["methods"]:
            steps = list(zip(*(run["checkpoints"] for run in method["runs"])))
            ax.loglog(
                [np.mean([c[x] for c in step]) for step in steps], [np.mean([c["errors"][y] for c in step]) for step in steps],
                marker=".", label=method["name"],
            )
        ax.set(xlabel=labels[x], ylabel=labels[y], title=Path(self.data[scene]["file"]).name)
        ax.legend()
        return ax

    def image(self, method: int = 0, scene: int = 0) -> Image:
        """Image of a method's first run: radiance, linear RGB, shape (H, W, 3)."""
        return self._comparisons.image(scene, method)  # type: ignore[no-any-return]

    def flip_map(self, method: int = 0, scene: int = 0) -> Image:
        """FLIP of this image, in [0, 1], shape (H, W)."""
        return self._comparisons.flip_map(scene, method)  # type: ignore[no-any-return]

    def reference(self, scene: int = 0) -> Image:
        """The reference: radiance, linear RGB, shape (H, W, 3)."""
        return self._comparisons.reference(scene)  # type: ignore[no-any-return]

    def save(self, folder: str | PathLike[str]) -> None:
        """Writes report.html, report.json and the images to a folder, as `etendue compare --report`."""
        self._comparisons.save(fspath(folder))

    def __repr__(self) -> str:
        return "\n".join(
            f"{r['scene']}: {r['method']}: relMSE {r['rel_mse']:.3e}, {r['spp']:.0f} spp, {r['seconds']:.2f} s"
            for r in self._rows()
        )

    def _repr_html_(self) -> str:
        pictures = ""
        for i, scene in enumerate(self.data):
            stops = auto_exposure(self.reference(i))
            pictures += image_html(self.reference(i), exposure=stops, title="reference")
            for k, method in enumerate(scene["methods"]):
                pictures += image_html(self.image(k, i), exposure=stops, title=method["name"])
        return pictures + table_html(self._rows())


class VerifyReport:
    """Whether methods are unbiased: comparisons with references, of the image, its tiles, path lengths, classes of paths
    and techniques, with a common probability of a false alarm.
    """

    def __init__(self, data: dict[str, Any]):
        self.data = data
        """All results, as `etendue verify --json` writes them."""

    @property
    def warnings(self) -> list[str]:
        """Possible errors of the renderings, one sentence each."""
        return list(self.data["warnings"])

    @property
    def verdicts(self) -> dict[str, str]:
        """A text for each method: "agrees" (no deviation was found), "deviates" or "undecided"."""
        return {m["method"]: m["verdict"] for m in self.data["methods"]}

    def _rows(self) -> list[dict[str, Any]]:
        rows = []
        for m in self.data["methods"]:
            tests = [t for t in m.get("image", []) if t["tested"]]
            worst = min((t["p"] for t in tests), default=None)
            ratio = sum(t["method"] for t in tests) / sum(t["reference"] for t in tests) if tests else None
            rows.append({
                "method": m["method"], "claims": m.get("estimator"), "verdict": m["verdict"], "spp": m.get("spp"),
                "image_ratio": ratio, "image_p": worst, "detectable": m["detectable"].get("image"),
                "out_of_reach": m.get("out_of_reach"), "too_rare": m.get("too_rare"), "slope": m.get("slope"),
            })
        return rows

    def frame(self) -> Any:
        """One row for each method, as a pandas.DataFrame, or a list of dicts without pandas. All dimensionless:
        image_ratio is the ratio to the reference, image_p the smallest p-value of the three channels, detectable the smallest
        relative error of the image that would have been found with 90 % probability. out_of_reach and too_rare are shares
        of the light, and slope is that of the logarithm of the error over the logarithm of the number of runs. Of images of
        files or arrays, only verdict, image_ratio, image_p and detectable are known.
        """
        return frame_of(self._rows())

    def lengths(self) -> Any:
        """One row for each method and path length (edges), with the share of the light, the ratio to the reference and the
        p-value, all dimensionless; a DataFrame, or a list of dicts.
        """
        return frame_of([
            {
                "method": m["method"], "edges": x["edges"], "share": x["share"],
                "ratio": x["method"] / x["reference"] if x["reference"] else None, "p": x.get("p"),
                "deviates": x.get("deviates"),
            }
            for m in self.data["methods"] for x in m.get("lengths", [])
        ])

    def save(self, folder: str | PathLike[str]) -> None:
        """Writes verify.json and verify.html to a folder, which is created."""
        path = Path(folder)
        _etendue.write_text(fspath(path / "verify.json"), json.dumps(self.data, indent=2) + "\n")
        _etendue.write_text(
            fspath(path / "verify.html"), f"<!DOCTYPE html><meta charset=utf-8>{self._repr_html_()}\n"
        )

    def __repr__(self) -> str:
        return "\n".join(
            f"{r['method']}: {r['verdict']}" + (f" (claims to be {r['claims']})" if r["claims"] else "")
            + ("" if r["image_ratio"] is None else f", image {r['image_ratio']:.4f} of the reference")
            for r in self._rows()
        )

    def _repr_html_(self) -> str:
        return table_html(self._rows())


def compare(
    scenes: SceneLike | Sequence[SceneLike],
    methods: Sequence[Method],
    *,
    time: float | None = None,
    spp: int | None = None,
    runs: int = 1,
    seed: int = 0,
    sampler: str = "sobol",
    threads: int = 0,
    paths: Literal["all", "inner"] = "all",
    lengths: tuple[int, int | None] = (1, None),
    reference: str | PathLike[str] | Sequence[str | PathLike[str]] | None = None,
    reference_method: Method | None = None,
    reference_time: float | None = None,
    reference_spp: int | None = None,
    references: str | PathLike[str] = "out/references",
    images: Mapping[str, str | PathLike[str]] | None = None,
    techniques: int = 5,
    progress: bool | None = None,
) -> CompareReport:
    """Compares methods at equal time (seconds) or equal samples per pixel (spp), like `etendue compare`. One of time and spp
    must be given.

        report = et.compare("scenes/cornell.xml", ["path", "bdpt"], time=5)
        report.frame()
        report.plot()

    scenes: one or several files, dicts, Descriptions or Scenes. methods: names with parameters, dicts, or Integrators.
    runs, seed: number of independent runs, which have consecutive seeds, and the first seed.
    sampler: "sobol" or "independent". threads: number of threads; 0 for one per core.
    paths: "all", or "inner" for those that join two sub-paths inside the scene (s >= 1 and t >= 2).
    lengths: shortest and longest path shown in the images, in edges; None for no limit.
    reference: image files, one for each scene. Without them, references are rendered by reference_method (bdpt) in
        reference_time seconds (10 times time) or with reference_spp (16 times spp), and stored in the folder references.
    images: images of other programs, as {name: folder}; they are shown and measured like methods. The name of each file,
        .exr or .pfm, ends with its rendering time in seconds: seed1-64spp-2.5s.exr. Those that share what stands before
        samples and time are of one run.
    techniques: longest path with technique images, in edges; 0: none.
    progress: shows a status line; None: on terminals.

    Ctrl-C ends the comparison; the report contains the results so far. If a scene or a method fails, a RuntimeWarning says
    so, and the report contains the others; if all fail, RuntimeError is raised.
    """
    wanted = [scenes] if isinstance(scenes, (Scene, Description, dict, str, PathLike)) else list(scenes)
    files = [reference] if isinstance(reference, (str, PathLike)) else list(reference or ())
    folders = [(name, fspath(folder)) for name, folder in (images or {}).items()]
    spp, seed, reference_spp = count("spp", spp), count("seed", seed) or 0, count("reference_spp", reference_spp)
    if files and not (reference_method is None and reference_time is None and reference_spp is None):
        raise ValueError("reference excludes reference_method, reference_time and reference_spp, which apply to rendered references")
    shortest, longest = lengths
    if shortest < 1 or (longest is not None and longest < shortest):
        raise ValueError(f"lengths must be (shortest, longest), from 1 edge on, but is {lengths}")
    listener, end = _status(progress)
    try:
        comparisons, text = _etendue.compare(
            [built(s, threads) for s in wanted], _methods(methods), time, spp, runs, seed, sampler, threads, techniques,
            paths, shortest, longest, reference_method, reference_time, reference_spp, [fspath(f) for f in files],
            fspath(references), folders, listener,
        )
    finally:
        end()
    data = json.loads(text)
    for failure in data["failures"]:
        warnings.warn(f"{failure['file']} could not be compared: {failure['reason']}", RuntimeWarning, stacklevel=2)
    for scene in data["scenes"]:
        for reason in scene["failures"]:
            warnings.warn(f"{scene['file']}: {reason}", RuntimeWarning, stacklevel=2)
    return CompareReport(comparisons, data)


def verify(
    scene: SceneLike,
    methods: Method | Sequence[Method],
    *,
    time: float | None = None,
    spp: int | None = None,
    detect: float | None = None,
    lengths: tuple[int, int] = (1, 8),
    runs: int = 32,
    alpha: float = 0.01,
    against: Sequence[str] = ("path", "light"),
    tiles: int = 4,
    seed: int = 0,
    sampler: str = "sobol",
    threads: int = 0,
    progress: bool | None = None,
) -> VerifyReport:
    """Tests whether methods are unbiased, like `etendue verify`: compares means over independent runs with references by
    Welch's t-test.

        et.verify("scenes/cornell.xml", ["bdpt", {"type": "upg+bdpt", "radius": 0.02}], spp=16).verdicts

    methods: names with parameters, dicts, or Integrators. lengths determines max_depth, which must not be given.
    time: seconds for all runs of one method (30 if spp is not given); with detect, for the whole verification.
    spp: samples per pixel of one run.
    detect: renders until a relative error of this size, such as 0.005, would be found with 90 % probability: an error of
        the image, or of a path length with at least 2 % of the light. From 0.0001 to below 1.
    lengths: shortest and longest path, in edges. runs: independent renderings, 8 to 4096.
    alpha: probability of a false alarm in all comparisons together, from 1e-9 to 0.5.
    against: methods to compare with: the first one, and each other one on the classes of paths that it estimates much
        better.
    tiles: number of tiles along each side of the image, 1 to 64.
    seed: seed of all random numbers. sampler: "sobol" or "independent".
    threads: number of runs rendered at the same time; 0 for one per core. Those of an Integrator come one after the other.
    progress: shows a status line; None: on terminals.

    Ctrl-C ends the verification. The report contains the comparisons that are then possible, and data["interrupted"] is
    True; if there are none, KeyboardInterrupt is raised. Methods that fail are left out with a RuntimeWarning; if all fail,
    RuntimeError is raised.
    """
    spp, seed = count("spp", spp), count("seed", seed) or 0
    listener, end = _status(progress)
    try:
        text = _etendue.verify(
            built(scene, threads), _methods(methods), spp, time, detect, lengths[0], lengths[1], runs, alpha,
            list(against), tiles, seed, sampler, threads, listener,
        )
    finally:
        end()
    data = json.loads(text)
    for reason in data["failures"]:
        warnings.warn(f"left out, since it failed: {reason}", RuntimeWarning, stacklevel=2)
    return VerifyReport(data)


def verify_images(
    images: Sequence[Any], against: Sequence[Any], *, alpha: float = 0.01, tiles: int = 4
) -> VerifyReport:
    """Tests whether two sets of independent images, of any programs, have the same expectation, like `etendue verify
    --images`: compares the means of the image and of its tiles over the images by Welch's t-test.

        ours = [et.render(scene, spp=16, seed=i, sampler="independent") for i in range(16)]
        et.verify_images(ours, "mitsuba/").verdicts

    images, against: each at least two images of the same size, with different seeds: files (.exr or .pfm), folders of
        them, arrays of shape (H, W, 3), or Results.
    alpha: probability of a false alarm in all comparisons together, from 1e-9 to 0.5.
    tiles: number of tiles along each side of the image, 1 to 64.

    The verdict is "undecided" where the images vary too much for a test. An error that is smaller than `detectable` in
    frame(), or that stems from light too rare to be in the images, may remain unnoticed. Raises RuntimeError if an image
    cannot be read, is not finite, has another size, or is given twice.
    """
    series = [
        [
            (fspath(image), None) if isinstance(image, (str, PathLike)) else (f"{name}[{i}]", _pixels(image))
            for i, image in enumerate([given] if isinstance(given, (str, PathLike)) else given)
        ]
        for name, given in (("images", images), ("against", against))
    ]
    return VerifyReport(json.loads(_etendue.verify_images(*series, alpha, tiles)))
