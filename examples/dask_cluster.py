"""Independent runs over a cluster, by Dask: each task renders with its own seed, and the sums are merged exactly.

    pip install "dask[distributed]"
    python examples/dask_cluster.py scenes/glass-caustic.xml bdpt 8

A LocalCluster of two processes stands for the cluster here; Client("scheduler:8786") uses another. The workers need the
package and the scene's files. Sums are added in double precision in the order of the seeds, so that the result does not
depend on which worker was faster.
"""

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import etendue as et


@dataclass
class Sums:
    """What runs are merged by: sums and sums of squares over the passes, of shape (H, W, 3), and their number."""

    sums: NDArray[np.float64]
    squares: NDArray[np.float64]
    passes: int

    def __add__(self, other: "Sums") -> "Sums":
        return Sums(self.sums + other.sums, self.squares + other.squares, self.passes + other.passes)

    @property
    def image(self) -> NDArray[np.float64]:
        """Mean over all passes: radiance, shape (H, W, 3)."""
        return self.sums / self.passes

    @property
    def standard_error(self) -> NDArray[np.float64]:
        """Standard error of each pixel's mean, in units of radiance, shape (H, W, 3)."""
        variance = np.maximum(self.squares / self.passes - self.image**2, 0)
        result: NDArray[np.float64] = np.sqrt(variance / (self.passes - 1))
        return result


def run(file: str, integrator: str, seed: int, spp: int, resolution: tuple[int, int]) -> Sums:
    """One task: a rendering with its own seed."""
    scene = et.load(file).build(resolution=resolution)
    result = et.render(scene, integrator, spp=spp, seed=seed, sampler="independent", threads=1, progress=False)
    return Sums(result.film.sums.copy(), result.film.squares.copy(), result.passes)


def render_on(client: Any, file: str, integrator: str, runs: int, spp: int = 16, size: tuple[int, int] = (64, 64)) -> Sums:
    """Maps the seeds 0 ... runs-1 to the workers, and merges in the order of the seeds."""
    futures = [client.submit(run, file, integrator, seed, spp, size, pure=False) for seed in range(runs)]
    parts: list[Sums] = client.gather(futures)
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total


def main() -> None:
    from dask.distributed import Client, LocalCluster

    file, integrator, runs = sys.argv[1], sys.argv[2], int(sys.argv[3])
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:  # type: ignore[no-untyped-call]
        total = render_on(client, file, integrator, runs)
    relative = total.standard_error.mean() / total.image.mean()
    print(f"{runs} runs, {total.passes} samples per pixel, mean standard error {relative:.1%} of the mean radiance")
    et.write_image("dask.exr", total.image)


if __name__ == "__main__":
    main()
