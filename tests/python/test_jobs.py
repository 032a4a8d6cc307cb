"""Renderings in the background."""

import asyncio
import gc
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import etendue as et
from conftest import Hits

LONG = 600  # seconds, which no test waits for


def threads_of_jobs() -> list[threading.Thread]:
    return [t for t in threading.enumerate() if t.name == "etendue"]


@pytest.fixture(autouse=True)
def no_thread_is_left_behind() -> Iterator[None]:
    yield
    gc.collect()
    end = time.monotonic() + 60
    while threads_of_jobs() and time.monotonic() < end:
        time.sleep(0.01)
    assert threads_of_jobs() == []


def test_the_result_is_that_of_render(cornell: et.Scene) -> None:
    expected = et.render(cornell, "bdpt", spp=3, seed=7, progress=False)
    job = et.start(cornell, "bdpt", spp=3, seed=7)
    result = job.result(timeout=60)
    assert threads_of_jobs() == [] and job.done
    assert result.passes == 3 and result.stopped_by == "samples"
    np.testing.assert_array_equal(result.image, expected.image)
    np.testing.assert_array_equal(job.image(), expected.image)
    assert job.result() is result and job.progress.passes == 3
    job.stop()
    assert job.result().stopped_by == "samples"


def test_images_and_checkpoints_while_it_runs(cornell: et.Scene, tmp_path: Path) -> None:
    with et.start(cornell, "path", time=LONG) as job:
        first = job.image(timeout=60)
        assert first.shape == (24, 32, 3) and first.mean() > 0
        passes = job.progress.passes
        assert passes > 0 and not job.done and 0 < job.progress.fraction < 1  # type: ignore[operator]
        assert re.fullmatch(r"<Job path.*, \d+ spp in \d+\.\d s, running, \d+ %>", repr(job))
        with pytest.raises(RuntimeError, match="is running"):
            job.progress.image
        with pytest.raises(ValueError, match="must end with .etd"):
            job.save(tmp_path / "a.exr")
        job.save(tmp_path / "a.etd", timeout=60)
        job.stop()
        result = job.result(timeout=60)
    assert result.stopped_by == "stopped" and result.passes >= passes and ", ended>" in repr(job)
    np.testing.assert_array_equal(job.image(), result.image)
    resumed = et.resume(tmp_path / "a.etd", cornell, spp=result.passes, progress=False)
    np.testing.assert_array_equal(resumed.image, result.image)


def test_a_job_that_is_stopped_at_once_has_no_result(scenes: Path) -> None:
    scene = et.load(scenes / "cornell.xml").build(resolution=(1000, 1000))
    job = et.start(scene, "bdpt", spp=64)
    job.stop()
    for wait in job.result, job.image:
        with pytest.raises(RuntimeError, match="first pass|without a complete pass"):
            wait(timeout=60)


def test_waiting_has_limits(cornell: et.Scene) -> None:
    with et.start(cornell, "path", time=LONG) as job:
        with pytest.raises(TimeoutError):
            job.result(timeout=0.01)
        assert not job.done
    assert job.result().passes >= 1


def test_a_job_that_is_given_up_is_stopped(cornell: et.Scene) -> None:
    et.start(cornell, "path", time=LONG)
    # The fixture waits for its thread.


def test_arguments_are_checked_at_once(cornell: et.Scene) -> None:
    with pytest.raises(RuntimeError, match="pth"):
        et.start(cornell, "pth")
    with pytest.raises(ValueError, match="above 0"):
        et.start(cornell, spp=0)
    with pytest.raises(RuntimeError, match="albdo"):
        et.start(cornell, aovs=["albdo"])


class _Fails(Hits):
    passes = 2

    def sample(self, c: et.core.Sample) -> None:
        if c.pixel == (0, 0):
            self.passes -= 1
        if self.passes < 0:
            raise LookupError("no such path")
        super().sample(c)


def test_failures_are_those_of_render(cornell: et.Scene) -> None:
    job = et.start(cornell, _Fails(), spp=8)
    with pytest.raises(et.RenderError, match="pass 3 failed: no such path") as failure:
        job.result(timeout=60)
    assert failure.value.result.passes == 2
    np.testing.assert_array_equal(job.image(), failure.value.result.image)


def test_callbacks_run_on_the_thread_of_the_job(cornell: et.Scene) -> None:
    names: set[str] = set()
    messages: list[str] = []
    has_job = threading.Event()

    def callback(p: et.Progress) -> bool:
        names.add(threading.current_thread().name)
        assert p.image.shape == (24, 32, 3)
        if p.passes == 3:
            assert has_job.wait(60)
            for wait in job.image, job.result:
                with pytest.raises(RuntimeError) as refusal:
                    wait()
                messages.append(str(refusal.value))
        return p.passes < 4

    job = et.start(cornell, "path", time=LONG, callback=callback)
    has_job.set()
    assert job.result(timeout=60).stopped_by == "callback" and job.result().passes == 4
    assert names == {"etendue"} and all("cannot wait for its own rendering" in m for m in messages) and len(messages) == 2


def test_jobs_can_be_awaited(cornell: et.Scene) -> None:
    async def both() -> list[et.Result]:
        return await asyncio.gather(*map(_result, [et.start(cornell, "path", spp=2), et.start(cornell, "path", spp=4)]))

    async def _result(job: et.Job) -> et.Result:
        return await job

    assert [r.passes for r in asyncio.run(both())] == [2, 4]


def test_a_job_whose_task_is_cancelled_is_stopped(cornell: et.Scene) -> None:
    job = et.start(cornell, "path", time=LONG)
    job.image(timeout=60)

    async def wait() -> None:
        with pytest.raises(TimeoutError if sys.version_info >= (3, 11) else asyncio.TimeoutError):
            await asyncio.wait_for(job, timeout=0.05)

    asyncio.run(wait())
    assert job.result(timeout=60).stopped_by == "stopped"


AT_EXIT = """
import etendue as et
jobs = [et.start({scene!r}, "path", time=600) for _ in range(2)]
jobs[0].image()
print("end of the program", flush=True)
"""


def test_the_program_ends_while_jobs_run(scenes: Path) -> None:
    run = subprocess.run([sys.executable, "-c", AT_EXIT.format(scene=str(scenes / "slit.xml"))], capture_output=True, text=True,
                         timeout=120)
    assert (run.returncode, run.stdout, run.stderr) == (0, "end of the program\n", "")
