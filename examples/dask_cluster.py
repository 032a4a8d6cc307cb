"""One image by a cluster, with Dask: each task renders with its own seed, and the results are merged.

    pip install "dask[distributed]"
    python examples/dask_cluster.py scenes/glass-caustic.xml bdpt 8

A LocalCluster of two processes stands for the cluster here. Client("scheduler:8786") uses another, whose workers need the
package, the scene's files, and client.upload_file("examples/cluster_task.py"). The sum does not depend on which worker was
faster. If a worker is lost, Dask runs its task again, and the result has the same bits.
"""

import sys
from typing import Any

import cluster_task
import etendue as et


def render_on(
    client: Any, file: str, integrator: str, runs: int, spp: int = 16, size: tuple[int, int] = (64, 64)
) -> et.Result:
    """Maps the seeds 0 ... runs-1 to the workers, and merges their results."""
    futures = [client.submit(cluster_task.run, file, integrator, seed, spp, size, pure=False) for seed in range(runs)]
    return et.merge(client.gather(futures))


def main() -> None:
    from dask.distributed import Client, LocalCluster

    file, integrator, runs = sys.argv[1], sys.argv[2], int(sys.argv[3])
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:  # type: ignore[no-untyped-call]
        result = render_on(client, file, integrator, runs)
    print(result)
    result.save("dask.exr")


if __name__ == "__main__":
    main()
