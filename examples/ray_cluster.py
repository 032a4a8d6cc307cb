"""One image by a cluster, with Ray: each task renders with its own seed, and the results are merged.

    pip install ray
    python examples/ray_cluster.py scenes/glass-caustic.xml bdpt 8

Two processes on this machine stand for the cluster here; ray.init("auto") uses another. The workers need the package and the
scene's files. The sum does not depend on which worker was faster. If a worker is lost, Ray runs its task again, and the
result has the same bits.
"""

import sys

import ray

import cluster_task
import etendue as et


def render_on(file: str, integrator: str, runs: int, spp: int = 16, size: tuple[int, int] = (64, 64)) -> et.Result:
    """Maps the seeds 0 ... runs-1 to the workers, and merges their results."""
    task = ray.remote(num_cpus=1, max_retries=3)(cluster_task.run)
    return et.merge(ray.get([task.remote(file, integrator, seed, spp, size) for seed in range(runs)]))


def main() -> None:
    file, integrator, runs = sys.argv[1], sys.argv[2], int(sys.argv[3])
    ray.init(num_cpus=2, include_dashboard=False, runtime_env={"py_modules": [cluster_task]})
    result = render_on(file, integrator, runs)
    ray.shutdown()
    print(result)
    result.save("ray.exr")


if __name__ == "__main__":
    main()
