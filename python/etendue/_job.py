"""Renderings that run while Python goes on."""

import atexit
import weakref
from collections.abc import Callable, Generator, Sequence
from os import PathLike, fspath
from threading import Lock, Thread, current_thread
from types import TracebackType
from typing import TYPE_CHECKING, Any

from . import _etendue
from ._method import Method
from ._render import Image, Progress, Result, check_checkpoint_name, new_rendering, progress_of, run
from ._scenes import SceneLike

if TYPE_CHECKING:  # imported where it is used, since it takes long
    from concurrent.futures import Future


class _Calls:
    """Calls that other threads want to be done between two passes."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._waiting: list[tuple[Callable[[], Any], "Future[Any]"]] = []
        self._has_ended = False

    def add(self, call: Callable[[], Any]) -> "Future[Any]":
        """What `call` returns between two passes, or at once if there are no more passes."""
        from concurrent.futures import Future

        future: Future[Any] = Future()
        with self._lock:
            waits = not self._has_ended
            if waits:
                self._waiting.append((call, future))
        if not waits:
            _do(call, future)
        return future

    def do(self, has_ended: bool = False) -> None:
        with self._lock:
            waiting, self._waiting = self._waiting, []
            self._has_ended = has_ended
        for call, future in waiting:
            _do(call, future)


def _do(call: Callable[[], Any], future: "Future[Any]") -> None:
    try:
        future.set_result(call())
    except Exception as e:
        future.set_exception(e)


def _work(
    rendering: _etendue.Rendering,
    aovs: Sequence[str],
    callback: Callable[[Progress], object] | None,
    calls: _Calls,
    result: "Future[Result]",
) -> None:
    """What the thread of a job does."""

    def between_passes(progress: Progress) -> object:
        calls.do()
        return None if callback is None else callback(progress)

    # Calls between passes need the error of the image, which takes time.
    seconds_between = 0.25 if callback is None else 0.0
    ended: Result | BaseException
    try:
        ended = run(rendering, aovs, between_passes, progress=False, live=False, seconds_between=seconds_between)
    except KeyboardInterrupt:
        ended = RuntimeError("the rendering was stopped in its first pass: there is no result")
    except BaseException as e:
        ended = e
    calls.do(has_ended=True)
    if isinstance(ended, Result):
        result.set_result(ended)
    else:
        result.set_exception(ended)


_threads: weakref.WeakKeyDictionary[Thread, _etendue.Rendering] = weakref.WeakKeyDictionary()
"""The threads of jobs, and what they render."""


@atexit.register
def _stop_all() -> None:
    """Threads that render cannot outlive the interpreter."""
    for rendering in list(_threads.values()):
        rendering.stop()
    for thread in list(_threads):
        thread.join()


class Job:
    """A rendering that runs on a thread of its own, from start().

        job = et.start(scene, "upg+bdpt", time=600)
        job.progress.passes
        plt.imshow(job.image())
        job.stop()
        result = job.result()

    `result = await job` waits in asyncio; if the task that waits is cancelled, the rendering is stopped. As a context manager, a
    job is stopped at the end of the block. A job that is no longer referred to is stopped, too, and so are all at the end of
    the program.
    """

    def __init__(self, rendering: _etendue.Rendering, aovs: Sequence[str], callback: Callable[[Progress], object] | None):
        from concurrent.futures import Future

        self._rendering = rendering
        self._calls = _Calls()
        self._result: Future[Result] = Future()
        self._result.set_running_or_notify_cancel()
        # The thread does not refer to the job, so that a job can be given up.
        self._thread = Thread(
            target=_work, args=(rendering, tuple(aovs), callback, self._calls, self._result), name="etendue", daemon=True
        )
        _threads[self._thread] = rendering
        self._thread.start()
        weakref.finalize(self, rendering.stop)

    @property
    def progress(self) -> Progress:
        """The number of finished passes, seconds and so on, without waiting. Its film and image can be read when the
        rendering has ended; see Job.image().
        """
        return progress_of(self._rendering)

    @property
    def done(self) -> bool:
        """Whether the rendering has ended."""
        return self._result.done()

    def image(self, timeout: float | None = None) -> Image:
        """The image so far: radiance, linear RGB, shape (H, W, 3). Waits for the end of the current pass, of the first one
        at least.

        timeout: longest time to wait, in seconds; then TimeoutError is raised. Raises RuntimeError if the rendering has ended
        without a complete pass.
        """
        image: Image = self._between_passes(self._image, timeout)
        return image

    def save(self, file: str | PathLike[str], timeout: float | None = None) -> None:
        """Writes the state of the rendering so far, an .etd file, from which resume() goes on. Waits as image() does, at most
        timeout seconds.
        """
        check_checkpoint_name(file)
        self._between_passes(lambda: self._rendering.save_checkpoint(fspath(file)), timeout)

    def stop(self) -> None:
        """Ends the rendering soon. The current pass is discarded, and result() has the passes before it, with stopped_by
        "stopped". Does not wait, and does nothing if the rendering has ended.
        """
        self._rendering.stop()

    def result(self, timeout: float | None = None) -> Result:
        """Waits for the end of the rendering, and returns the Result.

        timeout: longest time to wait, in seconds; then TimeoutError is raised. Raises what render() raises, and RuntimeError
        if the rendering was stopped in its first pass. Ctrl-C ends the waiting, not the rendering.
        """
        self._check_thread()
        try:
            return self._result.result(timeout)
        finally:
            self._join_if_done()

    def _join_if_done(self) -> None:
        if self._result.done():
            self._thread.join()

    def _image(self) -> Image:
        if self._rendering.passes == 0:
            raise RuntimeError("the rendering has ended without a complete pass")
        return self._rendering.image()

    def _between_passes(self, call: Callable[[], Any], timeout: float | None) -> Any:
        self._check_thread()
        return self._calls.add(call).result(timeout)

    def _check_thread(self) -> None:
        if current_thread() is self._thread:
            raise RuntimeError("a callback cannot wait for its own rendering: use the Progress that it is called with")

    def __await__(self) -> Generator[Any, None, Result]:
        import asyncio

        try:
            return (yield from asyncio.wrap_future(self._result).__await__())
        except asyncio.CancelledError:
            self.stop()
            raise
        finally:
            self._join_if_done()

    def __enter__(self) -> "Job":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None) -> None:
        self.stop()
        self._thread.join()

    def __repr__(self) -> str:
        now = self.progress
        share = "" if now.fraction is None else f", {100 * now.fraction:.0f} %"
        state = "ended" if self.done else f"running{share}"
        return f"<Job {self._rendering.integrator}, {now.passes} spp in {now.seconds:.1f} s, {state}>"


def start(
    scene: SceneLike,
    integrator: Method = "",
    *,
    spp: int | None = None,
    time: float | None = None,
    error: float | None = None,
    seed: int = 0,
    passes: tuple[int, int] | None = None,
    sampler: str = "sobol",
    filter_mode: str = "spread",
    threads: int = 0,
    aovs: Sequence[str] = (),
    techniques: bool | int = False,
    sensor: int | str | None = None,
    callback: Callable[[Progress], object] | None = None,
) -> Job:
    """Starts a rendering, and returns a Job, the handle of it:

        from time import sleep

        with et.start("scenes/cornell.xml", "bdpt", time=60) as job:
            while not job.done and (job.progress.error or 1) > 0.05:
                sleep(0.1)
        result = job.result()

    The arguments are those of render(); the callback is called on the thread of the job. With the same seed, the result
    is bit-identical to that of render(). Raises at once what render() raises for wrong arguments.
    """
    rendering = new_rendering(
        scene, integrator, spp, time, error, seed, passes, sampler, filter_mode, threads, aovs, techniques, sensor
    )
    return Job(rendering, aovs, callback)
