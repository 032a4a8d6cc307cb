"""Measures et.render() against the command line: the ratio of user CPU time, in turns, since machines are busy.

    PYTHONPATH=build/release/python build/venv/bin/python tests/python/overhead.py [ROUNDS]

Both render the same samples of the same scene. What both spend before and after, such as loading libraries, is left out:
each is run with few and with many samples, and the difference is compared.
"""

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
SCENE = str(ROOT / "scenes" / "cornell.xml")
FEW, MANY = 2, 34

CODE = """
import sys, etendue as et
scene = et.load(sys.argv[1]).build(resolution=(128, 128))
result = et.render(scene, "bdpt:max_depth=8", spp=int(sys.argv[2]), threads=1{callback})
result.image
"""


def user_seconds(command: list[str]) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def main() -> None:
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 8
    program = os.environ.get("ETENDUE_PROGRAM", str(ROOT / "build" / "release" / "etendue"))
    with tempfile.TemporaryDirectory() as folder:
        render = [program, "render", SCENE, "--resolution", "128x128", "-i", "bdpt:max_depth=8", "--threads", "1", "--quiet",
                  "-o", f"{folder}/a.exr", "--spp"]
        ways = {
            "command line": lambda spp: user_seconds([*render, str(spp)]),
            "render": lambda spp: user_seconds([sys.executable, "-c", CODE.format(callback=""), SCENE, str(spp)]),
            "render with a callback": lambda spp: user_seconds(
                [sys.executable, "-c", CODE.format(callback=", callback=lambda p: None"), SCENE, str(spp)]),
        }
        seconds: dict[str, list[float]] = {name: [] for name in ways}
        for _ in range(rounds):
            for name, measure in ways.items():
                seconds[name].append(measure(MANY) - measure(FEW))
    base = np.array(seconds["command line"])
    for name, values in seconds.items():
        ratios = np.array(values) / base
        error = ratios.std(ddof=1) / np.sqrt(rounds)
        print(f"{name}: {np.mean(values):.3f} s, ratio {ratios.mean():.4f} ± {error:.4f}, of the least {min(values) / base.min():.4f}")


if __name__ == "__main__":
    main()
