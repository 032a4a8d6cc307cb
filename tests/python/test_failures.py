"""Passes that fail, exceptions that end a rendering, and limits of memory."""

import functools
import os
import pickle
import shutil
import signal
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import etendue as et
from conftest import Hits
from etendue import _render, _show, core


class Fails(Hits):
    """Fails as soon as it is told to."""

    error: Exception | None = None

    def sample(self, c: core.Sample) -> None:
        if Fails.error is not None:
            raise Fails.error
        super().sample(c)


def fail_after(passes: int, error: Exception, scene: et.Scene) -> None:
    """Renders with an integrator that fails after so many passes."""

    def callback(p: et.Progress) -> None:
        if p.passes == passes:
            Fails.error = error

    Fails.error = error if passes == 0 else None
    try:
        et.render(scene, Fails(), spp=6, callback=callback, progress=False)
    finally:
        Fails.error = None


def test_a_pass_beyond_a_limit_of_memory_leaves_those_before_it(scenes: Path, tmp_path: Path) -> None:
    scene = et.load(scenes / "cornell.xml").build(resolution=(32, 16))

    def render(light_paths: int, spp: int, seed: int = 0) -> et.Result:
        return et.render(scene, f"vcm:memory=1,light_paths={light_paths}", spp=spp, seed=seed, progress=False)

    def fits(light_paths: int) -> bool:
        try:
            render(light_paths, 1)
        except RuntimeError as e:
            assert not isinstance(e, et.RenderError)
            return False
        return True

    # The most light paths that the first pass has room for. A later one has more vertices.
    low, high = 1, 1 << 16
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if fits(middle) else (low, middle)
    for seed in range(20):
        try:
            render(low, 100, seed)
        except et.RenderError as e:
            error = e
            break
        except RuntimeError:
            pass
    else:
        pytest.fail(f"no pass failed with light_paths={low}")
    result = error.result
    assert 0 < result.passes < 100
    assert f"pass {result.passes + 1} failed: " in str(error) and "need more than 1 MiB" in str(error)
    assert isinstance(error, RuntimeError) and type(error.__cause__) is RuntimeError
    assert result.stopped_by == result.stats["stopped_by"] == "failure"
    np.testing.assert_array_equal(result.image, render(low, result.passes, seed).image)
    result.save(tmp_path / "a.exr")
    result.save(tmp_path / "a.etd")
    # It goes on, and fails again.
    with pytest.raises(et.RenderError, match="need more than 1 MiB") as again:
        et.resume(tmp_path / "a.etd", scene, spp=100, progress=False)
    assert again.value.result.passes == result.passes


def test_integrators_in_python_that_fail(cornell: et.Scene) -> None:
    with pytest.raises(ZeroDivisionError, match="at once"):
        fail_after(0, ZeroDivisionError("at once"), cornell)
    for passes in (1, 4):
        with pytest.raises(et.RenderError, match=rf"pass {passes + 1} failed: later; the result of the .*pass") as e:
            fail_after(passes, ZeroDivisionError("later"), cornell)
        assert type(e.value.__cause__) is ZeroDivisionError
        assert e.value.result.passes == passes
        np.testing.assert_array_equal(
            e.value.result.image, et.render(cornell, Hits(), spp=passes, progress=False).image)
    with pytest.raises(et.RenderError, match="pass 3 failed: not enough memory"):
        fail_after(2, MemoryError(), cornell)


def test_the_error_takes_its_result_to_other_processes(cornell: et.Scene) -> None:
    with pytest.raises(et.RenderError) as e:
        fail_after(2, ValueError("later"), cornell)
    copy = pickle.loads(pickle.dumps(e.value))
    assert type(copy) is et.RenderError and str(copy) == str(e.value)
    assert copy.result.stopped_by == "failure"
    np.testing.assert_array_equal(copy.result.image, e.value.result.image)


class _Late(Exception):
    pass


def _raise_late(*_: object) -> None:
    raise _Late("the time is over")


def _raise_late_once(*_: object) -> None:
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    _raise_late()


class _Handler:
    def method(self, *_: object) -> None:
        raise _Late("the time is over")

    def __call__(self, *_: object) -> None:
        _raise_late()


@pytest.fixture(params=[_raise_late, _Handler().method, _Handler(), functools.partial(_raise_late, 1), _raise_late_once],
                ids=["function", "method", "object", "partial", "once"])
def alarm(request: pytest.FixtureRequest) -> Iterator[Callable[[float], None]]:
    """Sets a timer whose signal handler raises an exception."""

    def set_timer(seconds: float) -> None:
        signal.setitimer(signal.ITIMER_REAL, seconds)

    before = signal.signal(signal.SIGALRM, request.param)
    yield set_timer
    set_timer(0)
    signal.signal(signal.SIGALRM, before)


def test_exceptions_of_signal_handlers_end_the_rendering(cornell: et.Scene, alarm: Callable[[float], None]) -> None:
    passes: list[int] = []
    alarm(0.3)
    with pytest.raises(_Late, match="^the time is over$"):
        et.render(cornell, "path", time=5, progress=False, callback=lambda p: passes.append(p.passes))
    assert passes


@pytest.mark.parametrize("shows", [_show.LiveView, _render._Bar])
def test_so_they_do_while_the_progress_is_shown(
    cornell: et.Scene, monkeypatch: pytest.MonkeyPatch, alarm: Callable[[float], None], shows: type
) -> None:
    def draw(*_: object, **__: object) -> None:
        alarm(0.05)
        while True:
            time.sleep(0.001)

    monkeypatch.setattr(shows, "update", draw)
    with pytest.raises(_Late, match="^the time is over$"):
        et.render(cornell, "path", time=5, progress=False, live=True)


def test_the_progress_ends_nothing_where_warnings_are_errors(cornell: et.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(bar: _render._Bar) -> None:
        raise ValueError("no terminal")

    monkeypatch.setattr(_render._Bar, "update", fail)
    monkeypatch.setattr(_render._Bar, "close", fail)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("error")
        assert et.render(cornell, "path", spp=2, progress=False).passes == 2
        with pytest.raises(et.RenderError, match="pass 3 failed: later"):
            fail_after(2, ValueError("later"), cornell)
    assert len(told) == 4 and {str(w.message) for w in told} == {"the progress cannot be shown: no terminal"}


def test_what_is_no_failure_of_an_integrator_ends_reports(cornell: et.Scene, tmp_path: Path) -> None:
    for leaves in SystemExit("leaves"), KeyboardInterrupt("leaves"), GeneratorExit("leaves"):
        class Leaves(Hits):
            def sample(self, c: core.Sample) -> None:
                raise leaves

        with pytest.raises(type(leaves), match="leaves"):
            et.render(cornell, Leaves(), spp=1, progress=False)
        with pytest.raises(type(leaves), match="leaves"):
            et.compare(cornell, [Leaves(), "path"], spp=1, reference_spp=2, references=tmp_path, techniques=0,
                       progress=False)
        with pytest.raises(type(leaves), match="leaves"):
            et.compare(cornell, ["path"], spp=1, reference_spp=2, reference_method=Leaves(), references=tmp_path, techniques=0,
                       progress=False)
        with pytest.raises(type(leaves), match="leaves"):
            et.verify(cornell, ["path", Leaves()], spp=1, runs=8, lengths=(1, 2), progress=False)


def test_verifications_call_an_integrator_on_one_thread(cornell: et.Scene) -> None:
    """On others, what is no Exception, such as SystemExit, would not end them."""
    threads: set[int] = set()

    class Leaves(Hits):
        def sample(self, c: core.Sample) -> None:
            threads.add(threading.get_ident())
            if len(threads) > 1:
                raise SystemExit("from another thread")
            super().sample(c)

    report = et.verify(cornell, ["path", Leaves()], spp=1, runs=8, lengths=(1, 2), threads=4, progress=False)
    assert len(report.verdicts) == 2 and len(threads) == 1


LIMITED = """
import re
import numpy as np
import etendue as et

def more(mebibytes):
    data = int(re.search(r"VmData:\\s+(\\d+)", open("/proc/self/status").read()).group(1))
    return str(data // 1024 + mebibytes) + " M"

class Greedy(et.Integrator):
    is_full = False
    def counts(self, light_paths):
        return et.core.Counts(hit=1)
    def sample(self, c):
        if Greedy.is_full:
            bytearray(1 << 30)

def fill(p):
    Greedy.is_full = p.passes == 2

d = et.load({scene!r})
scene = d.build(resolution=(16, 16), threads=2)
et.render(scene, "bdpt", spp=1, threads=2)
et.limit_memory(more(400))
try:
    et.render(d.build(resolution=(4000, 4000), threads=2), threads=2)
except RuntimeError as e:
    print(e)
try:
    et.render(scene, Greedy(), spp=8, callback=fill)
except et.RenderError as e:
    print(e, "/", type(e.__cause__).__name__, e.result.passes)
    et.limit_memory(None)
    e.result.save({image!r})
print(len(bytearray(1 << 30)))
et.limit_memory(1 << 40)
"""


def test_the_memory_of_the_process_is_limited(scenes: Path, tmp_path: Path) -> None:
    image = tmp_path / "a.exr"
    code = LIMITED.format(scene=str(scenes / "cornell.xml"), image=str(image))
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
    lines = result.stdout.splitlines()
    assert "an image of 4000 x 4000 pixels needs" in lines[0] and "MiB are free" in lines[0]
    assert lines[1].startswith("pass 3 failed: not enough memory") and lines[1].endswith(" / MemoryError 2")
    assert lines[2] == str(1 << 30)
    assert et.read_image(image).shape == (16, 16, 3)


NO_MEMORY = """
#include <cstdlib>
#include <new>
#include <unistd.h>

// There is none for blocks of SIZE bytes while FILE exists.
void* operator new(std::size_t size) {
    if (size == SIZE && access(FILE, F_OK) == 0) throw std::bad_alloc();
    if (void* p = std::malloc(size ? size : 1)) return p;
    throw std::bad_alloc();
}
"""
WITHOUT_MEMORY = """
import pathlib
import numpy as np
import etendue as et

missing = pathlib.Path({file!r})
scene = et.load({scene!r}).build(resolution=(600, 500))
errors = {{}}

def callback(p):
    assert p.film.passes == p.passes
    errors[p.passes] = p.error
    if p.passes == 5:
        missing.touch()

def render(error):
    try:
        return et.render(scene, "mlt:groups=6,chains=24,mutations=0.1", spp=8, error=error, callback=callback)
    finally:
        missing.unlink(missing_ok=True)

# The error of the image tells whether it goes on.
try:
    render(1e-9)
except et.RenderError as e:
    print(e)
    r = e.result
    assert r.passes == r.stats["spp"] == 6, r.passes
    np.testing.assert_allclose(r.film.sums / r.film.passes, r.image, rtol=1e-5)
assert set(errors) == set(range(1, 6))
# It is only told.
r = render(None)
assert r.passes == 8 and len(r.stats["pass_seconds"]) == 8 and r.error is not None
assert set(errors) == set(range(1, 9)) and errors[6] is errors[7] is None
"""


def test_what_fails_between_passes_belongs_to_none(scenes: Path, tmp_path: Path) -> None:
    compiler = shutil.which("c++")
    if compiler is None:
        pytest.skip("there is no compiler")
    # Of the film's 74 chunks of pixels, for three pairs of groups, as Film::error() adds up.
    file, source, library = tmp_path / "missing", tmp_path / "no_memory.cpp", tmp_path / "no_memory.so"
    source.write_text(NO_MEMORY.replace("SIZE", str(74 * 3 * 8)).replace("FILE", f'"{file}"'))
    subprocess.run([compiler, "-shared", "-fPIC", "-o", str(library), str(source)], check=True)
    code = WITHOUT_MEMORY.format(file=str(file), scene=str(scenes / "cornell.xml"))
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300,
                            env=os.environ | {"LD_PRELOAD": str(library)})
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith("after pass 6: not enough memory; the result of the 6 passes before it is in")


@pytest.mark.parametrize("size", ["4X", "much", "", "-1", "1.5GG", 0, -5])
def test_what_is_no_size_of_memory(size: int | str) -> None:
    with pytest.raises(ValueError, match="size must be a size such as 4G or 1.5G"):
        et.limit_memory(size)


def test_less_memory_than_there_is_taken() -> None:
    with pytest.raises(RuntimeError, match="the memory cannot be limited to 1 MiB"):
        et.limit_memory("1M")
