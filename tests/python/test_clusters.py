"""The examples for clusters run on this machine: Dask, Ray, MPI, Slurm and GNU parallel."""

import functools
import importlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest

import etendue as et
import one_machine_slurm
from one_machine_slurm import output_of, wait_for_jobs, wait_until

pytestmark = pytest.mark.clusters
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
RUNS, SPP, SIZE = 8, 64, (48, 36)


def absent(name: str) -> NoReturn:
    """Skips the test; with ETENDUE_NEEDS_CLUSTERS set, it fails."""
    if os.environ.get("ETENDUE_NEEDS_CLUSTERS"):
        pytest.fail(f"no {name} here")
    pytest.skip(f"no {name} here")


def command(name: str) -> str:
    """A program, which may be one for administrators."""
    found = shutil.which(name, path=os.environ["PATH"] + ":/usr/local/sbin:/usr/sbin:/sbin")
    return found or absent(name)


def package(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        absent(name)


def merged(file: Path, integrator: str, seeds: int, spp: int, size: tuple[int, int]) -> et.Result:
    scene = et.load(file).build(resolution=size)
    return et.merge(
        [et.render(scene, integrator, spp=spp, seed=seed, threads=1, progress=False) for seed in range(seeds)]
    )


# -- Workers that are lost.


@pytest.fixture
def importable(monkeypatch: pytest.MonkeyPatch) -> None:
    """The examples and recorded_task, here and in processes that are started."""
    for folder in (EXAMPLES, Path(__file__).parent):
        monkeypatch.syspath_prepend(str(folder))
        monkeypatch.setenv("PYTHONPATH", str(folder), prepend=":")


class Killer(threading.Thread):
    """Kills one worker in the middle of a task, but not in its first one."""

    def __init__(self, folder: Path) -> None:
        super().__init__(daemon=True)
        self.folder = folder
        self.is_over = threading.Event()
        self.killed = ""
        """Name of the task that was not ended."""

    def run(self) -> None:
        while not self.is_over.wait(0.005):
            begun, ended = names(self.folder, "begin"), names(self.folder, "end")
            experienced = {pid_of(name) for name in ended}
            for name in begun - ended:
                if pid_of(name) in experienced:
                    os.kill(pid_of(name), signal.SIGKILL)
                    time.sleep(0.1)
                    if name not in names(self.folder, "end"):
                        self.killed = name
                    return


def names(folder: Path, what: str) -> set[str]:
    return {file.stem for file in folder.glob(f"*.{what}")}


def pid_of(name: str) -> int:
    return int(name.split("-")[1])


def check_that_a_task_ran_again(folder: Path, killer: Killer, total: et.Result, scene: Path) -> None:
    killer.is_over.set()
    killer.join()
    begun, ended = names(folder, "begin"), names(folder, "end")
    assert killer.killed, "no worker was killed in the middle of a task"
    again = {name for name in ended if name.split("-")[0] == killer.killed.split("-")[0]}
    assert again and killer.killed not in again
    assert begun - ended == {killer.killed}
    assert {name.split("-")[0] for name in ended} == {str(seed) for seed in range(RUNS)}
    # The scene was loaded once by each worker.
    assert len(ended) > len({pid_of(name) for name in ended})
    assert {file.read_text() for file in folder.glob("*.end")} == {"1"}
    expected = merged(scene, "bdpt", RUNS, SPP, SIZE)
    np.testing.assert_array_equal(total.image, expected.image)
    assert total.passes == RUNS * SPP and total.error == expected.error


def test_dask_runs_the_task_of_a_killed_worker_again(
    scenes: Path, tmp_path: Path, importable: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    distributed = package("dask.distributed")
    import cluster_task
    import dask_cluster
    import recorded_task

    monkeypatch.setattr(cluster_task, "run", functools.partial(recorded_task.run, str(tmp_path)))
    killer = Killer(tmp_path)
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        killer.start()
        total = dask_cluster.render_on(client, str(scenes / "cornell.xml"), "bdpt", RUNS, SPP, SIZE)
    check_that_a_task_ran_again(tmp_path, killer, total, scenes / "cornell.xml")


def test_ray_runs_the_task_of_a_killed_worker_again(
    scenes: Path, tmp_path: Path, importable: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    ray = package("ray")
    monkeypatch.setenv("RAY_worker_niceness", "0")  # Otherwise workers wait for all other tests.
    import cluster_task
    import ray_cluster
    import recorded_task

    def run(*arguments: Any) -> bytes:
        return recorded_task.run(str(tmp_path), *arguments)

    monkeypatch.setattr(cluster_task, "run", run)
    killer = Killer(tmp_path)
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    try:
        killer.start()
        total = ray_cluster.render_on(str(scenes / "cornell.xml"), "bdpt", RUNS, SPP, SIZE)
    finally:
        ray.shutdown()
    check_that_a_task_ran_again(tmp_path, killer, total, scenes / "cornell.xml")


@pytest.mark.parametrize("example", ["dask", "ray"])
def test_the_examples_run_as_programs(scenes: Path, tmp_path: Path, example: str) -> None:
    package(example)
    scene = scenes / "cornell.xml"
    subprocess.run(
        [sys.executable, EXAMPLES / f"{example}_cluster.py", scene, "path", "3"], cwd=tmp_path, check=True, timeout=300
    )
    image = et.read_image(tmp_path / f"{example}.exr")
    np.testing.assert_array_equal(image, merged(scene, "path", 3, 16, (64, 64)).image)


# -- MPI.


def test_mpi_merges_the_images_of_its_processes(scenes: Path, tmp_path: Path) -> None:
    package("mpi4py")
    mpirun = command("mpirun")
    scene = tmp_path / "small.xml"
    scene.write_text((scenes / "cornell.xml").read_text().replace('value="400"', 'value="24"'))
    # Open MPI refuses root and more processes than cores.
    environment = os.environ | {
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
    }
    example = [mpirun, "-n", "3", sys.executable, "-m", "mpi4py", EXAMPLES / "mpi_cluster.py"]
    subprocess.run([*example, scene, "path", "2", tmp_path / "mpi.exr"], env=environment, check=True, timeout=300)
    image = et.read_image(tmp_path / "mpi.exr")
    np.testing.assert_array_equal(image, merged(scene, "path", 3, 2, (24, 24)).image)


# -- Job arrays.

ARRAY = EXAMPLES / "slurm_array.sh"


def environment_of_tasks(program: str, scenes: Path, spp: int) -> dict[str, str]:
    return os.environ | {
        "ETENDUE": program,
        "SCENE": str(scenes / "cornell.xml"),
        "METHOD": "path",
        "SPP": str(spp),
    }


def check_tasks(folder: Path, program: str, tasks: int, spp: int) -> None:
    """Their sum has all passes of all seeds."""
    files = sorted(map(str, folder.glob("task-*.etd")))
    assert len(files) == tasks
    subprocess.run([program, "merge", *files, "-o", folder / "sum.etd", "--quiet"], check=True)
    info = json.loads(subprocess.run([program, "info", "--json", folder / "sum.etd"], check=True, capture_output=True).stdout)
    assert info["spp"] == tasks * spp


def test_gnu_parallel_runs_the_array(program: str, scenes: Path, tmp_path: Path) -> None:
    parallel = command("parallel")
    if "GNU" not in subprocess.run([parallel, "--version"], capture_output=True, text=True).stdout:
        absent("GNU parallel")
    for spp in (1, 2):  # The second time, the tasks go on.
        subprocess.run(
            [parallel, "-j", "2", f"SLURM_ARRAY_TASK_ID={{}} bash {ARRAY}", ":::", "0", "1", "2"],
            env=environment_of_tasks(program, scenes, spp), cwd=tmp_path, check=True, timeout=300,
        )
        check_tasks(tmp_path, program, 3, spp)


@pytest.fixture
def slurm() -> Iterator[Path]:
    with one_machine_slurm.running({name: command(name) for name in one_machine_slurm.PROGRAMS}) as folder:
        yield folder


def renders(folder: Path, argument: str) -> bool:
    """Whether a process in this folder has this argument, and has begun to render: it handles the end of --grace."""
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if process.joinpath("cwd").resolve() == folder and argument in process.joinpath("cmdline").read_text().split("\0"):
                caught = re.search(r"^SigCgt:\s*(\w+)", process.joinpath("status").read_text(), re.MULTILINE)
                return caught is not None and bool(int(caught[1], 16) >> (signal.SIGALRM - 1) & 1)
        except (OSError, UnicodeDecodeError):
            continue  # It has ended.
    return False


def test_slurm_runs_the_array_and_queues_late_tasks_again(
    slurm: Path, program: str, scenes: Path, tmp_path: Path
) -> None:
    def submit(spp: int) -> None:
        subprocess.run(
            ["sbatch", "--array=0-2", "--cpus-per-task=1", ARRAY], env=environment_of_tasks(program, scenes, spp),
            cwd=tmp_path, check=True,
        )

    submit(1)
    wait_for_jobs()
    check_tasks(tmp_path, program, 3, 1)
    # What Slurm sends before the end of the time.
    submit(20)
    wait_until(lambda: renders(tmp_path, "task-0.etd"), 60, "task 0 does not run")
    array = output_of("squeue", "--noheader", "--format=%F").split()[0]
    subprocess.run(["scancel", "--batch", "--signal=USR1", f"{array}_0"], check=True)
    wait_until(lambda: "Restarts=1" in output_of("scontrol", "show", "job", f"{array}_0"), 60, "task 0 is not queued again")
    wait_for_jobs()
    check_tasks(tmp_path, program, 3, 20)
