"""A task that notes its begin and its end in a folder, so that a test can kill its worker in between."""

import os
from pathlib import Path

import cluster_task


def run(folder: str, file: str, integrator: str, seed: int, spp: int, resolution: tuple[int, int]) -> bytes:
    name = f"{seed}-{os.getpid()}"
    (Path(folder) / f"{name}.begin").touch()
    part = cluster_task.run(file, integrator, seed, spp, resolution)
    (Path(folder) / f"{name}.end").write_text(str(cluster_task.load.cache_info().misses))
    return part
