"""Runs etendue and reads its output."""

import json
import os
import pathlib
import subprocess
import sys

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "bench"))
import machine  # noqa: E402

SHARED = pathlib.Path(os.environ.get("ETENDUE_SCENES", ROOT.parent / "shared" / "scenes"))

# File, in scenes/ of the project or in the folder of shared scenes, and size of its images.
SCENES = {
    "ajar": ("scenes/ajar.xml", (160, 120)),
    "cornell": ("scenes/cornell.xml", (64, 64)),
    "leak": ("scenes/leak.xml", (128, 96)),
    "ring": ("scenes/ring.xml", (160, 120)),
    "cornell-box": ("cornell-box-mts3/scene_v3.xml", (128, 128)),
    "veach-ajar": ("veach-ajar-mts3/scene.xml", (160, 90)),
    "staircase2": ("staircase2-mts3/scene.xml", (120, 120)),
    "veach-bidir": ("veach-bidir-mts3/scene.xml", (120, 120)),
    "keyhole": ("scenes/keyhole.xml", (160, 120)),
    "lantern": ("scenes/lantern.xml", (160, 120)),
    "mirror-box": ("scenes/mirror-box.xml", (160, 120)),
    "shutter": ("scenes/shutter.xml", (160, 120)),
    "two-rooms": ("scenes/two-rooms.xml", (160, 120)),
    "living-room": ("living-room-mts06/scene.xml", (160, 90)),
}
# Per scene; a reference is rendered once and cached for all figures of a call.
REFERENCE_SECONDS = 40
FIRST_SEED = 1


class Skipped(Exception):
    """Raised where a figure cannot be made, such as for a missing scene."""


class Runs:
    """Program, threads and scale of times for all figures."""

    def __init__(self, program, threads, scale, folder, references=None):
        self.program = program
        self.threads = threads
        self.scale = scale
        self.folder = pathlib.Path(folder)
        self.references = references or self.folder / "references"

    def description(self):
        processor = [
            line.split(":", 1)[1].strip()
            for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines()
            if line.startswith("model name")
        ]
        return {
            "program": self._call("--version").strip(),
            "commit": machine.commit(),
            "processor": processor[0] if processor else "unknown",
            "threads": self.threads,
            "time_scale": self.scale,
        }

    def available(self, *names):
        """Those of the scenes that exist; prints a message for each of the others."""
        found = [name for name in names if scene_file(name).exists()]
        for name in set(names) - set(found):
            print(f"{name} is left out: {SCENES[name][0]} was not found", file=sys.stderr)
        if not found:
            raise Skipped("none of its scenes was found; ETENDUE_SCENES names their folder")
        return found

    def render(self, scene, method, *, spp, seed=FIRST_SEED, size=None, crop=None, threads=None):
        """Statistics, and the image as an array (height, width, 3)."""
        image, stats = self.folder / "image.pfm", self.folder / "stats.json"
        arguments = ["render", scene_file(scene), "-i", method, "-o", image, "--stats", stats]
        arguments += ["--resolution", "{}x{}".format(*(size or SCENES[scene][1]))]
        arguments += ["--spp", spp, "--seed", seed, "--threads", threads or self.threads]
        if crop:
            arguments += ["--crop", ",".join(map(str, crop))]
        self._call(*arguments, "--quiet")
        return json.loads(stats.read_text()), read_pfm(image)

    def spp_within(self, scene, methods, seconds, **options):
        """Samples per pixel that the slowest of the methods takes in `seconds`, scaled."""
        speeds = []
        for method in methods:
            stats, _ = self.render(scene, method, spp=2, **options)
            speeds.append(1 / np.median(stats["pass_seconds"]))
        return max(2, round(min(speeds) * self.scale * seconds))

    def compare(self, scene, methods, *, seconds=None, spp=None, runs=1, paths="all",
                lengths="1..", size=None, reference_seconds=REFERENCE_SECONDS,
                reference_method="bdpt"):
        """A summary of the results of `etendue compare` for each method. `seconds`, which is scaled like
        `reference_seconds`, is the time of all methods and runs together."""
        report = self.folder / "report"
        arguments = ["compare", scene_file(scene), "--methods", *methods, "--runs", runs]
        if spp:
            arguments += ["--spp", spp]
        else:
            arguments += ["--time", max(0.05, self.scale * seconds / len(methods) / runs)]
        arguments += ["--resolution", "{}x{}".format(*(size or SCENES[scene][1]))]
        arguments += ["--paths", paths, "--lengths", lengths, "--techniques-max-depth", 0]
        arguments += ["--reference-time", self.scale * reference_seconds]
        arguments += ["--reference-method", reference_method, "--references", self.references]
        arguments += ["--report", report, "--seed", FIRST_SEED, "--threads", self.threads]
        self._call(*arguments, "--quiet")
        return _comparison(json.loads((report / "report.json").read_text()), scene)

    def _call(self, *arguments):
        done = subprocess.run([self.program, *map(str, arguments)], capture_output=True, text=True)
        if done.returncode != 0:
            raise RuntimeError(f"etendue {' '.join(map(str, arguments))}: {done.stderr.strip()}")
        return done.stdout


def scene_file(name):
    file = SCENES[name][0]
    return (ROOT if file.startswith("scenes/") else SHARED) / file


def scene_settings(name, **more):
    file, size = SCENES[name]
    return {"file": file, "resolution": "{}x{}".format(*size), **more}


def read_pfm(file):
    with open(file, "rb") as stream:
        assert stream.readline().strip() == b"PF"
        width, height = map(int, stream.readline().split())
        order = "<" if float(stream.readline()) < 0 else ">"
        pixels = np.frombuffer(stream.read(), order + "f4").reshape(height, width, 3)
    return pixels[::-1].astype(float)


ERRORS = ("rmse", "rel_mse", "rel_mse_trimmed", "l1", "mape", "spike")


def _comparison(report, scene):
    """The report without data that the figures do not need, such as names of files."""
    settings, compared = report["settings"], report["scenes"][0]
    reference = compared["reference"]
    shown = ("seconds", "spp", "runs", "seed", "sampler", "paths", "shortest_path", "longest_path")
    methods = [_method(m) for m in compared["methods"]]
    for m in methods:
        base = methods[0]
        m["efficiency_trimmed"] = (base["rel_mse_trimmed"] * base["seconds"]) / (
            m["rel_mse_trimmed"] * m["seconds"]
        )
    return {
        "file": SCENES[scene][0],
        "resolution": "{width}x{height}".format(**compared),
        **{key: settings[key] for key in shown},
        "reference": {k: reference[k] for k in ("method", "spp", "seconds", "rel_mse")},
        "methods": methods,
    }


def _method(m):
    summary = m["summary"]
    runs = [
        {
            **{key: run[key] for key in ("seed", "spp", "seconds", "rays", "mean_luminance")},
            "curve": {
                **{key: [c[key] for c in run["checkpoints"]] for key in ("spp", "seconds")},
                **{key: [c["errors"][key] for c in run["checkpoints"]] for key in ERRORS},
            },
        }
        for run in m["runs"]
    ]
    efficiency = summary["efficiency"] or {"value": None, "interval": None}
    return {
        "method": m["name"],
        "spp": summary["spp"],
        "seconds": summary["seconds"],
        **{key: summary[key] for key in ERRORS if key != "l1"},
        "l1": float(np.mean([run["errors"]["l1"] for run in m["runs"]])),
        "flip": m["flip"],
        "mean_ratio": summary["mean_ratio"],
        "rel_mse_slope": summary["rel_mse_slope"] and summary["rel_mse_slope"]["slope"],
        "efficiency": efficiency["value"],
        "efficiency_95": efficiency["interval"],
        "reference_share": summary["reference_share"],
        "runs": runs,
    }


def mean_curve(method, error="rel_mse", over="seconds", points=24):
    """The error of a method against time or samples: geometric mean over its runs, interpolated in logarithms."""
    curves = []
    for run in method["runs"]:
        x, y = np.array(run["curve"][over], float), np.array(run["curve"][error], float)
        usable = y > 0  # without the reference's noise, squared errors may be negative
        curves.append((np.log(x[usable]), np.log(y[usable])))
    if any(len(x) == 0 for x, _ in curves):
        return np.array([]), np.array([])
    grid = np.linspace(max(x[0] for x, _ in curves), min(x[-1] for x, _ in curves), points)
    return np.exp(grid), np.exp(np.mean([np.interp(grid, x, y) for x, y in curves], axis=0))


def speed_up(base, method, error="rel_mse"):
    """Ratio of the times of `base` and `method` for the same error, the smallest that both reached."""
    (base_t, base_e), (t, e) = mean_curve(base, error), mean_curve(method, error)
    if len(base_t) == 0 or len(t) == 0:
        return None
    base_e, e = np.minimum.accumulate(base_e), np.minimum.accumulate(e)
    target = np.log(max(base_e[-1], e[-1]))

    def time_for(times, errors):
        return float(np.exp(np.interp(-target, -np.log(errors), np.log(times))))

    return time_for(base_t, base_e) / time_for(t, e)


def power_law(x, y):
    """Slope of log y over log x, with its standard error, by least squares."""
    u, v = np.log(x), np.log(y)
    slope, offset = np.polyfit(u, v, 1)
    rest = v - (slope * u + offset)
    freedom = max(1, len(u) - 2)
    return float(slope), float(np.sqrt((rest**2).sum() / freedom / ((u - u.mean()) ** 2).sum()))
