"""Arguments that are wrong, objects that outlive others, threads, forks, and files that cannot be written."""

import gc
import io
import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import etendue as et
from conftest import ROOT, Hits
from etendue import _etendue, _render, _show


@pytest.mark.parametrize("shape", [(8, 8), (8, 8, 0), (8, 8, 1), (8, 8, 2), (8, 8, 4), (0, 0, 3), (8, 0, 3), (8, 8, 3, 1)])
def test_codes_of_another_shape_are_refused(tmp_path: Path, shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="8-bit codes have the shape"):
        et.write_image(tmp_path / "a.png", np.zeros(shape, np.uint8))
    with pytest.raises((TypeError, RuntimeError)):
        _etendue.png(np.zeros(shape, np.uint8))
    assert list(tmp_path.iterdir()) == []


def test_codes_are_written_as_they_are(tmp_path: Path) -> None:
    codes = np.arange(8 * 5 * 3, dtype=np.uint8).reshape(8, 5, 3)
    et.write_image(tmp_path / "new" / "a.png", codes)
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["a.png"]
    np.testing.assert_array_equal(et.tonemap(et.read_image(tmp_path / "new" / "a.png"), "srgb"), codes)
    # Every second column: the array is not contiguous.
    et.write_image(tmp_path / "b.png", codes[:, ::2])
    np.testing.assert_array_equal(et.tonemap(et.read_image(tmp_path / "b.png"), "srgb"), codes[:, ::2])


def test_codes_are_srgb_wherever_images_are_radiance() -> None:
    codes = np.random.default_rng(1).integers(0, 256, (4, 8, 3)).astype(np.uint8)
    np.testing.assert_array_equal(et.tonemap(codes, "srgb"), codes)
    linear = np.where(codes / 255 <= 0.04045, codes / 255 / 12.92, ((codes / 255 + 0.055) / 1.055) ** 2.4)
    assert et.diff(codes, codes[::-1]) == et.diff(linear, linear[::-1])
    with pytest.raises(ValueError, match="complex"):
        et.tonemap(np.ones((4, 4, 3)) * 1j)


def test_descriptions_can_be_edited_while_a_scene_is_built() -> None:
    d = et.load_dict({"type": "scene", "light": {"type": "constant"}, "sensor": {"type": "perspective"},
                      **{f"ball{i}": {"type": "sphere", "radius": 1.0} for i in range(300)}})
    ended = threading.Event()

    def edit() -> None:
        i = 0
        while not ended.is_set():
            d["more"] = {"type": "sphere", "center": [i, 0, 0]}
            del d["more"]
            i += 1

    thread = threading.Thread(target=edit)
    thread.start()
    try:
        for _ in range(100):
            assert d.build(threads=1).info()["shapes"] in (300, 301)
    finally:
        ended.set()
        thread.join()


@pytest.mark.parametrize("shape", [(0, 0, 3), (0, 8, 3), (8, 0, 3), (0, 8)])
def test_empty_images_are_refused(tmp_path: Path, shape: tuple[int, ...]) -> None:
    empty = np.zeros(shape, np.float32)
    calls: list[Callable[[], Any]] = [
        lambda: et.tonemap(empty), lambda: et.diff(empty, empty), lambda: et.show(empty),
        lambda: et.write_image(tmp_path / "a.exr", empty), lambda: et.write_image(tmp_path / "a.png", empty),
    ]
    for call in calls:
        with pytest.raises(ValueError, match="no pixels"):
            call()
    assert list(tmp_path.iterdir()) == []


def test_failed_writes_say_so_and_keep_what_there_was(tmp_path: Path) -> None:
    codes = np.zeros((8, 8, 3), np.uint8)
    (tmp_path / "full.png").symlink_to("/dev/full")
    (tmp_path / "folder.png").mkdir()
    for name, why in [("full.png", "No space left"), ("folder.png", "there is a folder")]:
        for image in (codes, codes.astype(np.float32)):
            with pytest.raises(RuntimeError, match=why):
                et.write_image(tmp_path / name, image)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder.png", "full.png"]
    assert (tmp_path / "full.png").is_symlink()


class _Keeps(et.Integrator):
    """Keeps all joins, and adds the first one again in every later sample."""

    traces_light_paths = True

    def __init__(self) -> None:
        self.kept: list[et.core.Join] = []
        self.refused = 0

    def counts(self, light_paths: int) -> et.core.Counts:
        return et.core.Counts(hit=1, next_event=1, splat=light_paths)

    def sample(self, c: et.core.Sample) -> None:
        z = c.eye_path(max_vertices=4)
        y = c.light_path(max_vertices=3)
        for join in self.kept[:3]:
            try:
                c.add(join)
            except ValueError as e:
                assert "another sample" in str(e)
                self.refused += 1
        for s, t in [(0, t) for t in range(2, len(z) + 1)] + [(1, t) for t in range(2, len(z) + 1)] + [
            (s, 1) for s in range(1, len(y) + 1)
        ]:
            for join in c.join(s, t):
                c.add(join)
                if len(self.kept) < 50:
                    self.kept.append(join)
        last = c.join(0, 2) if len(z) > 1 else []
        c.eye_path(max_vertices=2)
        for join in last:
            with pytest.raises(ValueError, match="replaced"):
                c.add(join)


def test_joins_that_outlive_their_sample(scenes: Path) -> None:
    integrator = _Keeps()
    scene = et.load(scenes / "cornell.xml").build(resolution=(8, 8))
    et.verify(scene, integrator, spp=1, runs=8, lengths=(1, 3), tiles=1, threads=1, progress=False)
    assert integrator.kept and integrator.refused > 100
    del scene
    gc.collect()
    for join in integrator.kept:
        assert np.isfinite(join.contribution).all()
        try:
            vertices = join.vertices()
        except RuntimeError as e:
            assert "has ended" in str(e)
            continue
        for vertex in vertices:
            try:
                assert np.isfinite(vertex.p).all()
            except RuntimeError as e:
                assert "has ended" in str(e)


FORMATS = ROOT / "tests" / "scenes" / "formats"


@pytest.mark.parametrize(
    "name", sorted(str(p.relative_to(FORMATS)) for p in FORMATS.rglob("*") if p.suffix in (".pbrt", ".gltf", ".glb"))
)
def test_scenes_of_all_formats_survive_the_way_through_a_dict(name: str) -> None:
    d = et.load(FORMATS / name, lenient=True)
    as_dict = d.to_dict()
    again = et.load_dict(as_dict, folder=(FORMATS / name).parent)
    for path in d.paths():
        d[path]
    try:
        scene = d.build(resolution=(16, 12), lenient=True)
    except (et.SceneError, RuntimeError) as e:
        if "its format is none of" in str(e):
            pytest.skip("the package does not read its textures")
        raise
    images = [et.render(s, "path", spp=1, progress=False).image
              for s in (scene, again.build(resolution=(16, 12), lenient=True))]
    np.testing.assert_array_equal(images[0], images[1])


TRIANGLE = {
    "type": "scene",
    "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 8, "height": 8},
               "to_world": et.look_at((0, 0, 4), (0, 0, 0))},
    "emitter": {"type": "constant"},
    "thing": {"type": "mesh", "mesh": {"positions": [[-1, -1, 0], [1, -1, 0], [0, 1, 0]], "triangles": [[0, 1, 2]]},
              "bsdf": {"type": "diffuse"}},
}


def test_meshes_from_arrays() -> None:
    d = et.load_dict(TRIANGLE)
    assert d["thing.mesh"]["positions"].shape == (3, 3) and d["thing.mesh"]["positions"].dtype == np.float32
    assert not d["thing.mesh"]["positions"].flags.writeable
    image = et.render(d.build(), "path", spp=4, progress=False).image
    # Beside the triangle is the sky.
    assert image[0, 0] == pytest.approx(1, rel=1e-3) and image[4, 4, 0] < 0.9
    d["thing.mesh"] = {"positions": np.array([[5, 5, 0], [6, 5, 0], [5, 6, 0.0]]), "triangles": np.array([[0, 1, 2]])}
    assert et.render(d.build(), "path", spp=4, progress=False).image[4, 4] == pytest.approx(1, rel=1e-3)

    for mesh, message in [
        ({"positions": np.zeros((3, 2)), "triangles": [[0, 1, 2]]}, r"shape \(N, 3\)"),
        ({"positions": np.eye(3), "triangles": [[0, 1, 3]]}, "3"),
        ({"positions": np.eye(3), "triangles": [[0, 1, -1]]}, "-1"),
        ({"positions": np.full((3, 3), np.nan), "triangles": [[0, 1, 2]]}, "finite"),
        ({"positions": np.eye(3), "triangles": []}, ""),
        ({"positions": np.eye(3), "triangles": [[0, 1, 2]], "normals": np.eye(3)[:2]}, "2 normals, but 3 positions"),
        ({"positions": "many", "triangles": [[0, 1, 2]]}, "positions"),
        ({"position": np.eye(3)}, 'did you mean "positions"'),
    ]:
        before = d.dump()
        with pytest.raises(et.SceneError, match=message):
            d["thing.mesh"] = mesh
        assert d.dump() == before


def test_copies_and_edits_share_meshes() -> None:
    d = et.load_dict(TRIANGLE)
    address = d["thing.mesh"]["positions"].ctypes.data
    copy = d.copy()
    for i in range(3):
        d["thing.bsdf.reflectance"] = 0.1 * i
    assert copy["thing.mesh"]["positions"].ctypes.data == address
    assert d["thing.mesh"]["positions"].ctypes.data == address
    scene = d.build()
    assert scene.description["thing.mesh"]["positions"].ctypes.data == address
    array = d["thing.mesh"]["positions"]
    del d, copy, scene
    gc.collect()
    np.testing.assert_array_equal(array[0], (-1, -1, 0))


def _ticks_during(task: Callable[[], Any]) -> tuple[int, float]:
    """How often another thread runs while a task does, and the seconds that it takes."""
    done = threading.Event()
    count = 0

    def tick() -> None:
        nonlocal count
        while not done.is_set():
            count += 1
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    begin = time.monotonic()
    before = count
    task()
    ticks, seconds = count - before, time.monotonic() - begin
    done.set()
    thread.join()
    return ticks, seconds


def test_other_threads_run_while_images_are_computed(tmp_path: Path, scenes: Path) -> None:
    image = np.random.default_rng(1).random((700, 700, 3), dtype=np.float32)
    et.write_image(tmp_path / "a.exr", image)
    xml = (scenes / "cornell.xml").read_text()
    cube = '<shape type="cube"><bsdf type="diffuse"/></shape>'
    long = xml.replace("</scene>", 20000 * cube + "</scene>")
    scene = et.load(scenes / "cornell.xml").build(resolution=(64, 64))
    tasks: dict[str, Callable[[], Any]] = {
        "diff": lambda: et.diff(image, image[::-1]),
        "write": lambda: et.write_image(tmp_path / "b.exr", image),
        "load_string": lambda: et.load_string(long),
        "pilot": lambda: _etendue.Rendering(scene, "upg+pssmlt", 1, None, None, 0, "sobol", "spread", 1, 0, 0),
    }
    # Images of many pixels, and little else, so that a pass takes little time.
    large = np.resize(image, (1500, 2000, 3))
    et.write_image(tmp_path / "large.exr", large)
    codes = et.tonemap(large)
    sky = {"type": "scene", "sensor": {"type": "perspective"}, "sky": {"type": "constant"}}
    empty = et.render(et.load_dict(sky).build(resolution=(2000, 1500)), "path", spp=2, progress=False)
    tasks |= {
        "tonemap": lambda: et.tonemap(large),
        "read": lambda: et.read_image(tmp_path / "large.exr"),
        "png": lambda: _etendue.png(codes),
        "image": empty._rendering.image,
        "variance": empty._rendering.variance,
        "half_width": empty._rendering.half_width,
    }
    measured = {name: _ticks_during(task) for name, task in tasks.items()}
    # A thread that waits for the GIL gets none in all that time.
    assert not {name: m for name, m in measured.items() if m[0] <= 5 and m[1] >= 0.02}, measured


def _child(code: str) -> str:
    """Output of a Python process."""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, env=os.environ)
    assert result.returncode == 0, result.stderr
    return result.stdout


COMMA = """
import locale, sys
import numpy as np
import etendue as et

if sys.argv[1]:
    locale.setlocale(locale.LC_ALL, sys.argv[1])
    assert locale.localeconv()["decimal_point"] == ","
folder = sys.argv[2]
for name in sys.argv[3:]:
    scene = et.load(name, lenient=True).build(resolution=(8, 6))
    result = et.render(scene, "bdpt:roulette=0.25,max_depth=5", spp=1, threads=1, progress=False)
    print(name, result.image.tobytes().hex(), result.stats["mean_luminance"])
    result.save(folder + "/a.exr")
    result.save(folder + "/a.pfm")
    print(et.read_image(folder + "/a.pfm").tobytes().hex() == result.image.tobytes().hex())
print(et.read_image(folder + "/half.pfm"), dict(et.diff(result.image, result.image * 0.5)))
print(et.verify(scene, ["bdpt:roulette=0.5"], spp=1, runs=8, lengths=(1, 2), alpha=0.001, threads=1, progress=False).data["methods"][0]["image"])
"""


def test_numbers_do_not_depend_on_the_locale(tmp_path: Path) -> None:
    made = subprocess.run(["localedef", "-i", "de_DE", "-f", "UTF-8", str(tmp_path / "de_DE.UTF-8")],
                          capture_output=True, check=False) if shutil.which("localedef") else None
    if made is None or not (tmp_path / "de_DE.UTF-8").exists():
        pytest.skip("no locale with a decimal comma can be made here")
    (tmp_path / "half.pfm").write_bytes(b"Pf\n1 1\n-0.5\n" + np.float32(0.75).tobytes())
    formats = ROOT / "tests" / "scenes" / "formats"
    names = ["gltf/materials.gltf", "mitsuba3/shapes.xml", "mitsuba06/media.xml", "pbrt3/materials.pbrt", "pbrt4/lights.pbrt"]
    out = [
        subprocess.run([sys.executable, "-c", COMMA, name, str(tmp_path), *[str(formats / n) for n in names]],
                       capture_output=True, text=True, timeout=300, check=False,
                       env={**os.environ, "LOCPATH": str(tmp_path)})
        for name in ("", "de_DE.UTF-8")
    ]
    assert out[0].returncode == 0 == out[1].returncode, (out[0].stderr, out[1].stderr)
    assert out[0].stdout == out[1].stdout


THREADS = """
import re
import etendue as et

def threads():
    return int(re.search(r"Threads:\\s+(\\d+)", open("/proc/self/status").read()).group(1))

before = threads()
et.load({scene!r}).build({arguments})
print(threads() - before)
"""


@pytest.mark.skipif(os.cpu_count() == 1, reason="one core")
def test_scenes_are_built_with_few_threads_if_asked(scenes: Path) -> None:
    def added(arguments: str) -> int:
        return int(_child(THREADS.format(scene=str(scenes / "cornell.xml"), arguments=arguments)))

    assert added("threads=1") == 0
    assert added("") > 0
    with pytest.raises(ValueError, match="threads must lie between 0 and 4096, but is -1"):
        et.load(scenes / "cornell.xml").build(threads=-1)


FORK = """
import os, sys
import etendue as et
d = et.load({scene!r})
{before}
child = os.fork()
if child == 0:
    try:
        et.render(d.build(resolution=(8, 8)), "path", spp=1, progress=False)
        print("rendered", flush=True)
    except RuntimeError as e:
        print(e, flush=True)
    os._exit(0)
os.waitpid(child, 0)
"""


def test_forked_processes_refuse_instead_of_hanging(scenes: Path) -> None:
    scene = str(scenes / "cornell.xml")
    before = 'et.render(d.build(resolution=(8, 8)), "path", spp=1, progress=False)'
    assert "forked" in _child(FORK.format(scene=scene, before=before))
    assert "rendered" in _child(FORK.format(scene=scene, before=""))


def test_the_film_of_a_running_rendering(cornell: et.Scene) -> None:
    kept: list[Any] = []
    copies: list[Any] = []
    errors: list[str] = []

    def callback(p: et.Progress) -> None:
        kept.append(p.film.sums)
        copies.append(p.film.sums.copy())
        np.testing.assert_allclose(p.film.sums / p.passes, p.image, rtol=1e-6)

        def read() -> None:
            try:
                p.film.sums
            except RuntimeError as e:
                errors.append(str(e))

        thread = threading.Thread(target=read)
        thread.start()
        thread.join()

    result = et.render(cornell, "path", spp=4, callback=callback, progress=False)
    assert [len(x) for x in kept] == [24] * 4
    for array, copy in zip(kept, copies, strict=True):
        np.testing.assert_array_equal(array, copy)
    np.testing.assert_array_equal(kept[-1], result.film.sums)
    assert len(errors) == 4 and "is running" in errors[0]


INTERRUPTED = """
import os, signal, sys, threading
import etendue as et
signal.signal(signal.SIGINT, signal.default_int_handler)  # a process in the background ignores it
scene = et.load({scene!r}).build(resolution=(8, 8))
threading.Timer({seconds}, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
try:
    r = et.verify(scene, ["path", "bdpt"], spp=4, runs=8, lengths=(1, 2), detect=0.0001, progress=False)
    print(r.data["interrupted"], r.data["methods"][0]["method"], r.verdicts)
except KeyboardInterrupt:
    print("nothing")
"""


def test_interrupted_verifications_return_what_they_have(scenes: Path) -> None:
    scene = str(scenes / "cornell.xml")
    seconds = 2.0
    output = "nothing"
    while output.startswith("nothing") and seconds < 60:
        output = _child(INTERRUPTED.format(scene=scene, seconds=seconds))
        seconds *= 3
    assert output.startswith("True path"), output


SAMPLING = """
import os, signal, threading
import etendue as et
from etendue import core
signal.signal(signal.SIGINT, signal.default_int_handler)
scene = et.load({scene!r}).build(resolution=(512, 512))
threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
try:
    print(len(core.sample_paths(scene, 10**9)))
except KeyboardInterrupt:
    print("interrupted")
"""


def test_sampled_paths_are_complete_or_interrupted(scenes: Path) -> None:
    assert _child(SAMPLING.format(scene=str(scenes / "cornell.xml"))) == "interrupted\n"


def test_reports_keep_what_does_not_fail(cornell: et.Scene, tmp_path: Path) -> None:
    fails = "vcm:memory=1,light_paths=40000"
    with pytest.warns(RuntimeWarning, match="1 MiB"):
        report = et.compare(cornell, [fails, "path"], spp=1, reference_spp=2, references=tmp_path, techniques=0,
                            progress=False)
    assert [m["name"] for m in report.data[0]["methods"]] == ["path"]
    with pytest.raises(RuntimeError, match="1 MiB"):
        et.compare(cornell, [fails], spp=1, reference_spp=2, references=tmp_path, techniques=0, progress=False)
    with pytest.warns(RuntimeWarning, match="1 MiB"):
        verified = et.verify(cornell, ["path", fails], spp=1, runs=8, lengths=(1, 2), progress=False)
    assert [m["method"] for m in verified.data["methods"]] == ["path"]


class Raises(Hits):
    """Fails in samples from a column on."""

    def __init__(self, column: int) -> None:
        super().__init__()
        self.column = column

    def sample(self, c: et.core.Sample) -> None:
        if c.pixel[0] >= self.column:
            raise LookupError("no such path")
        super().sample(c)


def test_reports_keep_what_does_not_raise(cornell: et.Scene, demo: et.Scene, tmp_path: Path) -> None:
    def compare(methods: list[str | et.Integrator], **more: Any) -> et.CompareReport:
        return et.compare([cornell, demo], methods, spp=1, reference_spp=2, references=tmp_path, techniques=0,
                          progress=False, **more)

    with pytest.warns(RuntimeWarning, match="no such path"):
        report = compare([Raises(20), "path"])
    assert [[m["name"] for m in scene["methods"]] for scene in report.data] == [["path"]] * 2
    # The reference of the second scene fails, which has more columns than the first one.
    with pytest.warns(RuntimeWarning, match="(?s)demo.xml could not be compared.*no such path"):
        report = compare(["path"], reference_method=Raises(36))
    assert [Path(scene["file"]).name for scene in report.data] == ["cornell.xml"]
    with pytest.warns(RuntimeWarning, match="no such path"):
        verified = et.verify(cornell, ["path", Raises(20)], spp=1, runs=8, lengths=(1, 2), progress=False)
    assert [m["method"] for m in verified.data["methods"]] == ["path"]


class _Closed(io.StringIO):
    """A standard error that is gone."""

    def write(self, text: str) -> int:
        raise BrokenPipeError("gone")


def test_what_shows_the_progress_may_fail(cornell: et.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any) -> None:
        raise BrokenPipeError("gone")

    with monkeypatch.context() as patch, pytest.warns(RuntimeWarning, match="cannot be shown: gone"):
        patch.setattr(sys, "stderr", _Closed())
        report = et.compare(cornell, ["path"], spp=1, reference_spp=2, references=tmp_path, techniques=0, progress=True)
        verified = et.verify(cornell, ["path"], spp=1, runs=8, lengths=(1, 2), progress=True)
    assert len(report.data) == len(verified.data["methods"]) == 1
    for shows in _render._Bar, _show.LiveView:
        monkeypatch.setattr(shows, "update", fail)
    monkeypatch.setattr(_render._Bar, "close", fail)
    with pytest.warns(RuntimeWarning, match="cannot be shown: gone"):
        assert et.render(cornell, "path", spp=64, progress=True, live=True).passes == 64
