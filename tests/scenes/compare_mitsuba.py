#!/usr/bin/env python3
"""Compare etendue with Mitsuba 3 on the shared Mitsuba scenes.

Both renderers read the same file with two changes: a small film with a box filter, so that pixels are
independent, and the integrator. Each renders several independent runs; compared are

  - the mean of the image: difference in % and in standard errors of the runs, and
  - tiles of the image (8 x 6): Welch's t-test per tile, at 1 % for all tiles together (Sidak).

The table goes to the terminal, everything to a JSON file. A disagreement is a question, not a verdict: paths
that one of the renderers samples badly (caustics under path tracing) make means and errors too small.

Needs the PyPI packages mitsuba, numpy and scipy; made available in a virtual environment if missing.
"""

import argparse
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCENES = {
    "cornell-box": "cornell-box-mts3/scene_v3.xml",
    "yard-cornell": "yard-cornell-mts06/scene.xml",
    "yard-ring": "yard-ring-mts06/scene.xml",
    "veach-bidir": "veach-bidir-mts3/scene.xml",
    "veach-ajar": "veach-ajar-mts3/scene.xml",
    "staircase2": "staircase2-mts3/scene.xml",
    "staircase2-principled": "staircase2-mts3/scene_principled_floor.xml",
    "living-room": "living-room-mts06/scene.xml",
    "cbox-with-bulb": "cbox-with-bulb-mts06/scene.xml",
    "tire": "tire-mts3/scene.xml",
    "sms-ring": "sms-ring-mts3/ring.xml",
    "sms-plane": "sms-plane-mts3/plane.xml",
}
TILES = (8, 6)
FALSE_ALARM = 0.01


def ensure_packages():
    """Restart this script in a virtual environment that has the packages."""
    try:
        import mitsuba  # noqa: F401
        import numpy  # noqa: F401
        import scipy  # noqa: F401
    except ImportError:
        venv = ROOT / "build" / "mitsuba-venv"
        python = venv / "bin" / "python"
        if os.environ.get("ETENDUE_MITSUBA_VENV") == "1":
            sys.exit("compare-mitsuba: mitsuba, numpy and scipy cannot be imported")
        if not python.exists():
            subprocess.run([sys.executable, "-m", "venv", str(venv)], check=True)
        subprocess.run(
            [python, "-m", "pip", "install", "-q", "mitsuba", "numpy", "scipy"], check=True
        )
        os.environ["ETENDUE_MITSUBA_VENV"] = "1"
        os.execv(python, [str(python), *sys.argv])


class Case:
    """A scene prepared for both renderers in a folder of its own."""

    def __init__(self, name, file, folder, args):
        self.name = name
        tree = ElementTree.parse(file)
        scene = tree.getroot()
        snake = int(scene.get("version").split(".")[0]) >= 2
        defaults = {d.get("name"): d.get("value") for d in scene.iter("default")}

        def resolve(value):
            return defaults[value[1:]] if value.startswith("$") else value

        film = scene.find("sensor/film")
        size = {e.get("name"): e for e in film.findall("integer")}
        width, height = (int(resolve(size[k].get("value"))) for k in ("width", "height"))
        self.width = args.width
        self.height = max(1, round(height * args.width / width))
        for key in list(size):
            film.remove(size[key])
        for child in film.findall("rfilter"):
            film.remove(child)
        for key, value in (("width", self.width), ("height", self.height)):
            ElementTree.SubElement(film, "integer", name=key, value=str(value))
        ElementTree.SubElement(film, "rfilter", type="box")

        depth_name = "max_depth" if snake else "maxDepth"
        old = scene.find("integrator")
        depth = [resolve(e.get("value")) for e in old if e.get("name") == depth_name]
        self.max_depth = args.max_depth or int(depth[0] if depth else -1)
        kind = "volpath" if any(scene.iter("medium")) else "path"
        scene.remove(old)
        integrator = ElementTree.SubElement(scene, "integrator", type=kind)
        ElementTree.SubElement(
            integrator, "integer", name=depth_name, value=str(self.max_depth)
        )

        folder.mkdir()
        for entry in file.parent.iterdir():
            (folder / entry.name).symlink_to(entry)
        self.ours = folder / "compare-etendue.xml"
        integrator.set("type", "path")
        tree.write(self.ours)
        # Options of newer versions of Mitsuba that change what the file meant when it was written.
        integrator.set("type", kind)
        for bsdf in scene.iter("bsdf"):
            if bsdf.get("type") in ("normalmap", "bumpmap"):
                for option in ("flip_invalid_normals", "use_shadowing_function"):
                    ElementTree.SubElement(bsdf, "boolean", name=option, value="false")
        # Mitsuba 3 gives a constant spectrum of an emitter the colour of a flat spectrum, not white.
        for emitter in scene.iter("emitter"):
            for child in emitter.findall("spectrum"):
                if ":" not in child.get("value", ":"):
                    child.tag = "rgb"
        for shape in scene.iter("shape"):
            for child in shape.findall("boolean[@name='collapse']"):  # 0.6 only
                shape.remove(child)
        self.theirs = folder / "compare-mitsuba.xml"
        tree.write(self.theirs)


class Mitsuba:
    name = "mitsuba"

    def __init__(self, args):
        import mitsuba as mi

        self.mi = mi
        mi.set_variant(args.variant)
        self.version = f"Mitsuba {mi.__version__} {args.variant}"

    def open(self, case):
        self.scene = self.mi.load_file(str(case.theirs))

    def render(self, case, spp, seed):
        import numpy as np

        return np.array(self.mi.render(self.scene, spp=spp, seed=seed))[:, :, :3].astype(float)


class Etendue:
    def __init__(self, integrator, args, folder):
        self.name = integrator
        self.args = args
        self.output = folder / f"{integrator}.exr"

    def open(self, case):
        pass

    def render(self, case, spp, seed):
        import mitsuba as mi
        import numpy as np

        command = [self.args.etendue, "render", str(case.ours), "-o", str(self.output), "--quiet"]
        command += ["-i", f"{self.name}:max_depth={case.max_depth}", "--spp", str(spp)]
        command += ["--seed", str(seed), "--threads", str(self.args.threads)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        bitmap = mi.Bitmap(str(self.output)).convert(
            mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False
        )
        return np.array(bitmap).astype(float)


def runs_of(renderer, case, args):
    """Independent runs that take about args.seconds together, and their samples per pixel."""
    import numpy as np

    renderer.open(case)
    wanted = args.seconds / args.runs
    spp = 2
    while True:
        start = time.monotonic()
        renderer.render(case, spp, 999)
        seconds = time.monotonic() - start
        if seconds > wanted / 4 or spp >= 4096:
            break
        spp *= 2
    spp = max(2, int(spp * wanted / seconds))
    return np.array([renderer.render(case, spp, 1 + i) for i in range(args.runs)]), spp


def tiles_of(runs):
    """Mean luminance-free (RGB average) value of each tile of each run."""
    import numpy as np

    count, height, width, _ = runs.shape
    y = np.linspace(0, height, TILES[1] + 1).round().astype(int)
    x = np.linspace(0, width, TILES[0] + 1).round().astype(int)
    grey = runs.mean(axis=3)
    return np.array(
        [
            [
                grey[i, y[j] : y[j + 1], x[k] : x[k + 1]].mean()
                for j in range(TILES[1])
                for k in range(TILES[0])
            ]
            for i in range(count)
        ]
    )


def compare(a, b):
    """Difference of a from b in the mean of the image, per channel, and in the tiles."""
    import numpy as np
    from scipy import stats

    mean_a, mean_b = a.mean(axis=(1, 2, 3)), b.mean(axis=(1, 2, 3))
    error = math.hypot(stats.sem(mean_a), stats.sem(mean_b))
    difference = mean_a.mean() - mean_b.mean()
    p = np.nan_to_num(stats.ttest_ind(tiles_of(a), tiles_of(b), equal_var=False).pvalue, nan=1.0)
    level = 1 - (1 - FALSE_ALARM) ** (1 / p.size)
    return {
        "percent": 100 * difference / mean_b.mean(),
        "percent_error": 100 * error / mean_b.mean(),
        "standard_errors": difference / error if error > 0 else 0.0,
        "percent_rgb": (100 * (a.mean(axis=(0, 1, 2)) / b.mean(axis=(0, 1, 2)) - 1)).tolist(),
        "tiles": int(p.size),
        "tiles_failed": int((p < level).sum()),
        "smallest_p": float(p.min()),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scenes", nargs="*", help=f"some of: {', '.join(SCENES)}, or files")
    parser.add_argument("--etendue", default=str(ROOT / "build/release/etendue"))
    parser.add_argument("--integrators", default="path,bdpt")
    parser.add_argument("--variant", default="scalar_rgb")
    parser.add_argument("--width", type=int, default=160)
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=60, help="for all runs of a renderer")
    parser.add_argument("--threads", type=int, default=0, help="of etendue; Mitsuba takes all")
    parser.add_argument("--max-depth", type=int, help="instead of the file's")
    parser.add_argument("--json", default="compare-mitsuba.json")
    parser.add_argument("--pictures", help="folder for the mean image of each renderer")
    args = parser.parse_args()
    ensure_packages()
    from scipy import stats
    import mitsuba as mi

    root = pathlib.Path(os.environ.get("ETENDUE_SCENES", ROOT.parent / "shared" / "scenes"))
    mitsuba = Mitsuba(args)
    report = {"mitsuba": mitsuba.version, "scenes": {}}
    print(
        f"{'scene':22}{'renderer':9}{'spp':>7}{'mean':>11} ±{'%':>5}"
        f"{'diff %':>9} ±{'%':>5}{'SE':>7}{'tiles':>7}  {'diff % in R, G, B'}"
    )
    with tempfile.TemporaryDirectory() as temporary:
        temporary = pathlib.Path(temporary)
        for name in args.scenes or SCENES:
            file = root / SCENES[name] if name in SCENES else pathlib.Path(name).resolve()
            name = name if name in SCENES else file.stem
            case = Case(name, file, temporary / name, args)
            entry = report["scenes"][name] = {"max_depth": case.max_depth, "renderers": {}}
            renderers = [mitsuba]
            renderers += [Etendue(i, args, temporary) for i in args.integrators.split(",")]
            images = {}
            for renderer in renderers:
                runs, spp = runs_of(renderer, case, args)
                images[renderer.name] = runs
                if args.pictures:
                    os.makedirs(args.pictures, exist_ok=True)
                    mi.Bitmap(runs.mean(axis=0).astype("float32")).write(
                        f"{args.pictures}/{name}-{renderer.name}.exr"
                    )
                means = runs.mean(axis=(1, 2, 3))
                result = {"spp": spp * args.runs, "mean": means.mean()}
                result["percent_error"] = 100 * stats.sem(means) / means.mean()
                line = (
                    f"{name:22}{renderer.name:9}{result['spp']:7}{result['mean']:11.5f}"
                    f" ±{result['percent_error']:5.2f}"
                )
                if renderer is not mitsuba:
                    result["against_mitsuba"] = c = compare(runs, images["mitsuba"])
                    rgb = ", ".join(f"{x:+.2f}" for x in c["percent_rgb"])
                    line += (
                        f"{c['percent']:+9.2f} ±{c['percent_error']:5.2f}"
                        f"{c['standard_errors']:+7.1f}{c['tiles_failed']:4}/{c['tiles']}  {rgb}"
                    )
                print(line, flush=True)
                entry["renderers"][renderer.name] = result
            pathlib.Path(args.json).write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
