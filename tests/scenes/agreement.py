"""Renders one scene with etendue and with Mitsuba 3 and tests whether the images agree.

Shared by compare_mitsuba.py (whole scenes), compare_conventions.py (one plug-in at a time) and
compare_converted.py (what `etendue convert` writes).
Needs the PyPI packages mitsuba, numpy and scipy; ensure_packages() makes them available.
"""

import ctypes.util
import json
import math
import os
import pathlib
import subprocess
import sys
import time
import warnings
import xml.etree.ElementTree as ElementTree

ROOT = pathlib.Path(__file__).resolve().parents[2]
FALSE_ALARM = 0.01
TILES = (8, 6)


def ensure_packages():
    """Restart the running script in a virtual environment that has the packages."""
    try:
        import mitsuba  # noqa: F401
        import numpy  # noqa: F401
        import scipy  # noqa: F401
    except ImportError:
        venv = ROOT / "build" / "mitsuba-venv"
        python = venv / "bin" / "python"
        if os.environ.get("ETENDUE_MITSUBA_VENV") == "1":
            sys.exit(f"{sys.argv[0]}: mitsuba, numpy and scipy cannot be imported")
        if not python.exists():
            subprocess.run([sys.executable, "-m", "venv", str(venv)], check=True)
        subprocess.run(
            [python, "-m", "pip", "install", "-q", "mitsuba", "numpy", "scipy"], check=True
        )
        os.environ["ETENDUE_MITSUBA_VENV"] = "1"
        os.execv(python, [str(python), *sys.argv])


def add_arguments(parser):
    parser.add_argument("--etendue", default=str(ROOT / "build/release/etendue"))
    parser.add_argument("--variant", help="variant of Mitsuba (default: llvm_ad_rgb if LLVM 16 or later is found)")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    name = pathlib.Path(sys.argv[0]).stem.replace("_", "-")
    parser.add_argument(
        "--json",
        type=pathlib.Path,
        default=ROOT / f"out/{name}.json",
        help=f"JSON report, which keeps what it has from earlier runs (default: out/{name}.json)",
    )


def earlier_report(args, kind):
    """The contents of the report, or one without any `kind` ("cases") yet, and a folder for it."""
    args.json.parent.mkdir(parents=True, exist_ok=True)
    return json.loads(args.json.read_text()) if args.json.exists() else {kind: {}}


def start(parser, kind, table):
    """The arguments, Mitsuba, and the contents of the report, with the `kind` ("cases") of earlier runs.

    With --table, prints the report by the function `table` and ends.
    """
    parser.add_argument("--pictures", help="existing folder for the mean image of each renderer")
    parser.add_argument("--table", action="store_true", help="only print the JSON file as a table")
    args = parser.parse_args()
    if args.table:
        print(table(json.loads(args.json.read_text())))
        sys.exit()
    ensure_packages()
    mitsuba = Mitsuba(args)
    report = earlier_report(args, kind)
    report["mitsuba"] = mitsuba.version
    return args, mitsuba, report


def default_variant():
    """The compiled variant is several times faster, but its code generator needs a recent LLVM."""
    for version in range(22, 15, -1):
        if ctypes.util.find_library(f"LLVM-{version}"):
            os.environ.setdefault("DRJIT_LIBLLVM_PATH", f"libLLVM-{version}.so")
            return "llvm_ad_rgb"
    return "llvm_ad_rgb" if "DRJIT_LIBLLVM_PATH" in os.environ else "scalar_rgb"


class Mitsuba:
    def __init__(self, args):
        self.name = "mitsuba"
        variant = args.variant or default_variant()
        import drjit
        import mitsuba

        mitsuba.set_variant(variant)
        mitsuba.set_log_level(mitsuba.LogLevel.Error)
        drjit.set_thread_count(max(2, args.threads))  # scalar variants wait for ever with one
        self.mitsuba = mitsuba
        self.version = f"Mitsuba {mitsuba.__version__} {variant}"

    def open(self, file, **options):
        """options: those of load_file, as optimize=False."""
        self.scene = self.mitsuba.load_file(str(file), parallel=False, **options)

    def render(self, spp, seed):
        import numpy as np

        image = self.mitsuba.render(self.scene, spp=spp, seed=seed)
        return np.array(image)[:, :, :3].astype(float)


class Etendue:
    def __init__(self, integrator, args, folder):
        self.name = integrator
        self.args = args
        self.output = folder / "etendue.exr"
        self.more = []  # options of the program

    def open(self, file, *options):
        """options: parameters of the integrator, as 'max_depth=5'."""
        self.file = file
        self.integrator = ":".join(filter(None, [self.name, ",".join(options)]))

    def render(self, spp, seed):
        command = [self.args.etendue, "render", str(self.file), "-o", str(self.output), "--quiet"]
        command += ["-i", self.integrator, "--spp", str(spp), "--seed", str(seed)]
        command += ["--threads", str(self.args.threads), *self.more]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(done.stderr.strip())
        return read_image(self.output)


def read_image(file):
    import mitsuba
    import numpy as np

    bitmap = mitsuba.Bitmap(str(file)).convert(
        mitsuba.Bitmap.PixelFormat.RGB, mitsuba.Struct.Type.Float32, srgb_gamma=False
    )
    return np.array(bitmap).astype(float)


def write_image(file, image):
    import mitsuba

    mitsuba.Bitmap(image.astype("float32")).write(str(file))


def write_stretched_environment(file, source):
    """Rows of `source` as seen here, at the latitudes at which Mitsuba 3 expects its rows: from pole to
    pole, r / (rows - 1), where the centres of the source's rows are at (r + 1/2) / rows."""
    import numpy as np

    image = read_image(source)
    rows = len(image)
    # The centres of the source's rows are among those of this grid, so that both interpolate the same.
    grid = 2 * rows + 1
    y = np.linspace(0, rows, grid) - 0.5
    above = np.floor(y).astype(int)
    below_share = (y - above)[:, None, None]
    row = [image[np.clip(above + i, 0, rows - 1)] for i in (0, 1)]
    write_image(file, (1 - below_share) * row[0] + below_share * row[1])


def adapt_to_mitsuba(scene, integrator, folder):
    """Changes `scene`, the root element of a file of `folder`: what the file means here, said in the words of
    Mitsuba 3.9; see docs/agreement.md."""
    # Mitsuba's path ignores media, and counts surfaces without an effect as vertices.
    clear = any(b.get("type") in ("mask", "null") for b in scene.iter("bsdf"))
    if clear or any(scene.iter("medium")):
        integrator.set("type", "volpath")
    # Pixels at the edge are sampled beyond the border here.
    for film in scene.iter("film"):
        for child in film.findall("boolean[@name='sample_border']"):
            film.remove(child)
        ElementTree.SubElement(film, "boolean", name="sample_border", value="true")
    # Options of newer versions that change what the file meant when it was written.
    for bsdf in scene.iter("bsdf"):
        if bsdf.get("type") in ("normalmap", "bumpmap"):
            for option in ("flip_invalid_normals", "use_shadowing_function"):
                if bsdf.find(f"boolean[@name='{option}']") is None:
                    ElementTree.SubElement(bsdf, "boolean", name=option, value="false")
    # Newer versions stretch an environment by half a row at each pole.
    for file in scene.findall("emitter[@type='envmap']/string[@name='filename']"):
        write_stretched_environment(folder / "compare-environment.exr", folder / file.get("value"))
        file.set("value", "compare-environment.exr")
    # Newer versions give a constant spectrum of an emitter the colour of a flat spectrum, not white.
    for emitter in scene.iter("emitter"):
        for child in emitter.findall("spectrum"):
            if ":" not in child.get("value", ":"):
                child.tag = "rgb"
    for parent in [*scene.iter("shape"), *scene.iter("film")]:  # parameters of 0.6 only
        for name in ("collapse", "high_quality_edges"):
            for child in parent.findall(f"boolean[@name='{name}']"):
                parent.remove(child)


def independent_runs(renderer, runs, seconds):
    """Images that differ in their seed and take about `seconds` together, beyond reading the scene each
    time, and the spp of each."""
    import numpy as np

    def seconds_of(spp):
        begin = time.monotonic()
        renderer.render(spp, 999)
        return time.monotonic() - begin

    wanted = seconds / runs
    seconds_of(1)  # compiles
    start_up = seconds_of(1)
    spp = elapsed = 0
    while elapsed < wanted / 4 and spp < 4096:
        spp = max(4, 2 * spp)
        elapsed = seconds_of(spp) - start_up
    spp = max(2, int(spp * wanted / elapsed))
    return np.array([renderer.render(spp, 1 + i) for i in range(runs)]), spp


def tile_means(images):
    """Mean over the channels of each tile of each image: an array (images, tiles)."""
    import numpy as np

    _, height, width, _ = images.shape
    y = np.linspace(0, height, TILES[1] + 1).round().astype(int)
    x = np.linspace(0, width, TILES[0] + 1).round().astype(int)
    grey = images.mean(axis=3)
    rows = np.add.reduceat(grey, y[:-1], axis=1) / np.diff(y)[:, None]
    return (np.add.reduceat(rows, x[:-1], axis=2) / np.diff(x)).reshape(len(images), -1)


def mean_and_error(images):
    """Mean of all pixels and its standard error, from the spread of the runs."""
    from scipy import stats

    means = images.mean(axis=(1, 2, 3))
    return means.mean(), stats.sem(means)


def compare(a, b, tolerance=0.0):
    """Runs a against runs b. Welch's t-test of the image mean; the same of the tiles, at a level for
    which one tile or more fails by chance in 1 % of all comparisons (Sidak). Differences up to
    `tolerance` times the image's mean are taken for none."""
    import numpy as np
    from scipy import stats

    def welch(x, y):
        forgiven = np.clip(x.mean(axis=0) - y.mean(axis=0), -allowed, allowed)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Precision loss")  # images without noise
            return stats.ttest_ind(x, y + forgiven, equal_var=False)

    (mean_a, error_a), (mean_b, error_b) = mean_and_error(a), mean_and_error(b)
    allowed = tolerance * mean_b
    test = welch(a.mean(axis=(1, 2, 3)), b.mean(axis=(1, 2, 3)))
    interval = test.confidence_interval(1 - FALSE_ALARM)
    tiles_a, tiles_b = tile_means(a), tile_means(b)
    # 0/0 where all runs are equal: black tiles, or images without noise.
    tiles = np.nan_to_num(welch(tiles_a, tiles_b).pvalue, nan=1.0)
    level = 1 - (1 - FALSE_ALARM) ** (1 / tiles.size)
    return {
        "ratio": mean_a / mean_b,
        "ratio_99": [1 + interval.low / mean_b, 1 + interval.high / mean_b],
        "ratio_error": math.hypot(error_a, error_b) / mean_b,
        "p": float(np.nan_to_num(test.pvalue, nan=1.0)),
        "ratio_rgb": (a.mean(axis=(0, 1, 2)) / b.mean(axis=(0, 1, 2))).tolist(),
        "tiles": int(tiles.size),
        "tiles_failed": int((tiles < level).sum()),
        "smallest_tile_p": float(tiles.min()),
        "largest_tile_difference": float(
            np.abs(tiles_a.mean(axis=0) - tiles_b.mean(axis=0)).max() / mean_b
        ),
    }
