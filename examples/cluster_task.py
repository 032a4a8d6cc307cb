"""One task of a cluster: a rendering with its own seed. For dask_cluster.py and ray_cluster.py, which send it to workers."""

from functools import lru_cache

import etendue as et


@lru_cache(maxsize=1)
def load(file: str, resolution: tuple[int, int]) -> et.Scene:
    """The scene, loaded once by each worker."""
    return et.load(file).build(resolution=resolution)


def run(file: str, integrator: str, seed: int, spp: int, resolution: tuple[int, int]) -> bytes:
    """The sums of the rendering, for et.merge()."""
    scene = load(file, resolution)
    return et.render(scene, integrator, spp=spp, seed=seed, threads=1, progress=False).partial()
