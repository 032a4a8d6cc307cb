"""Reproduces the figures and tables of the papers with etendue: NAME.json with all measurements and the paper's results,
and a plot NAME.svg or images NAME.png.

Errors are those of small images and short times, on an otherwise idle machine. Repeat a figure to see their variation.
"""

import argparse
import os
import pathlib
import sys
import tempfile
import time

import mps
import pcbpt
import upg
from output import save, text_table
from runs import REFERENCE_SECONDS, ROOT, Runs, Skipped

# Function that makes the figure, and seconds of its methods. References take REFERENCE_SECONDS more for each scene and each
# selection of paths, those of large images (equal_time.py) ten times as long as an image; figures made by the same call
# share them.
FIGURES = {
    "upg-pssmlt": (upg.chains, 480),
    "upg-convergence": (upg.convergence, 150),
    "upg-speed": (upg.speed, 90),
    "upg-trials": (upg.trials, 60),
    "upg-radius": (upg.radius, 160),
    "upg-leak": (upg.leak, 120),
    "upg-depth": (upg.depth, 240),
    "upg-endpoint": (upg.endpoint, 160),
    "upg-guide": (upg.guided, 1200),
    "equal-time": (upg.equal_time, 300),
    "pcbpt-guide": (pcbpt.guided, 1200),
    "pcbpt-cache": (pcbpt.cache, 120),
    "pcbpt-weights": (pcbpt.weights, 40),
    "pcbpt-paths": (pcbpt.light_paths, 120),
    "pcbpt-phases": (pcbpt.phases, 30),
    "pcbpt-inner": (pcbpt.inner, 100),
    "pcbpt-convergence": (pcbpt.convergence, 150),
    "mps-user-paths": (mps.user_paths, 960),
    "mps-equal-time": (mps.equal_time, 960),
}
QUICK = 0.015


def parse_arguments():
    listing = "\n".join(f"  {n:20}{f.__doc__}" for n, (f, _) in FIGURES.items())
    parser = argparse.ArgumentParser(
        prog="figures", description=__doc__, epilog=f"figures:\n{listing}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("names", nargs="+", metavar="NAME", help="figures to make, or all")
    parser.add_argument("--etendue", default=str(ROOT / "build/release/etendue"), help="the program")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "docs/figures",
                        help="output folder (default: docs/figures)")
    parser.add_argument("--references", type=pathlib.Path, metavar="FOLDER", help="where references are kept for later calls")
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--scale", type=float, default=1, help="factor on all times")
    parser.add_argument("--quick", action="store_true",
                        help="take only seconds for each figure, as a test of the program; same as --scale %g" % QUICK)
    arguments = parser.parse_args()
    unknown = [n for n in arguments.names if n not in FIGURES and n != "all"]
    if unknown:
        parser.error(f"there is no figure \"{unknown[0]}\" (there are: {', '.join(FIGURES)})")
    if not os.access(arguments.etendue, os.X_OK):
        parser.error(f"{arguments.etendue}: no such program; scripts/build makes it")
    if not arguments.scale > 0:
        parser.error("--scale must be above 0")
    if arguments.quick:
        arguments.scale = QUICK
    if "all" in arguments.names:
        arguments.names = list(FIGURES)
    return arguments


def main():
    arguments = parse_arguments()
    failed = False
    with tempfile.TemporaryDirectory() as folder:
        runs = Runs(arguments.etendue, arguments.threads, arguments.scale, folder, arguments.references)
        for name in arguments.names:
            make, seconds = FIGURES[name]
            begin = time.monotonic()
            print(f"\n{name}: {make.__doc__}\n", flush=True)
            try:
                figure = make(runs, seconds)
            except Skipped as reason:
                print(f"left out: {reason}")
                continue
            except RuntimeError as error:
                print(f"figures: {name}: {error}", file=sys.stderr)
                failed = True
                continue
            save(name, arguments.out, figure, {"shows": make.__doc__, "settings": runs.description()})
            print(text_table(figure.rows))
            print(f"\n{time.monotonic() - begin:.0f} s", flush=True)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
