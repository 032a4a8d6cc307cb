"""Rendering: the bits of the command line, memory, threads, interrupts."""

import ctypes
import gc
import json
import os
import re
import signal
import subprocess
import sys
import textwrap
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import etendue as et
from etendue import _etendue


def allocated_bytes(folder: Path) -> int:
    """What this process has allocated and not freed, in all arenas of the C library. Unlike resident memory, it does not
    depend on the pages that the arenas keep. Python's small objects are not among it; `sys.getallocatedblocks` has them."""
    gc.collect()
    libc = ctypes.CDLL(None)
    libc.fopen.restype = ctypes.c_void_p
    file = ctypes.c_void_p(libc.fopen(os.fsencode(folder / "heap.xml"), b"w"))
    assert file and libc.malloc_info(0, file) == 0 and libc.fclose(file) == 0
    heaps = ElementTree.parse(folder / "heap.xml").getroot()

    def size(kind: str, name: str) -> int:
        return int(heaps.find(f"./{kind}[@type='{name}']").attrib["size"])

    free = size("total", "fast") + size("total", "rest")
    return size("system", "current") - free + size("total", "mmap")


@pytest.mark.parametrize("integrator", ["", "bdpt:max_depth=5", "upg+bdpt", "pssmlt", "sppm"])
def test_bits_are_those_of_the_command_line(program: str, scenes: Path, tmp_path: Path, integrator: str) -> None:
    command = [program, "render", str(scenes / "demo.xml"), "-D", "width=40", "-D", "height=30", "--spp", "3", "--seed", "5",
               "--aov", "albedo,variance", "-o", str(tmp_path / "a.exr"), "--stats", str(tmp_path / "a.json"), "--quiet"]
    subprocess.run(command + (["-i", integrator] if integrator else []), check=True)
    scene = et.load(scenes / "demo.xml", {"width": 40, "height": 30}).build()
    result = et.render(scene, integrator, spp=3, seed=5, aovs=["albedo", "variance"])
    np.testing.assert_array_equal(result.image, et.read_image(tmp_path / "a.exr"))
    np.testing.assert_array_equal(result.aov["albedo"], et.read_image(tmp_path / "a.exr", "albedo"))
    np.testing.assert_array_equal(result.variance, et.read_image(tmp_path / "a.exr", "variance"))
    result.save(tmp_path / "b.exr")
    np.testing.assert_array_equal(result.image, et.read_image(tmp_path / "b.exr"))
    np.testing.assert_array_equal(result.aov["albedo"], et.read_image(tmp_path / "b.exr", "albedo"))
    # The program reads what the package writes.
    diff = subprocess.run([program, "diff", str(tmp_path / "a.exr"), str(tmp_path / "b.exr"), "--json"],
                          capture_output=True, check=True).stdout
    assert json.loads(diff)["rmse"] == 0
    stats = json.loads((tmp_path / "a.json").read_text())
    assert stats.keys() == result.stats.keys()
    for key in ("integrator", "spp", "walk_rays", "shadow_rays", "mean_luminance", "seed", "stopped_by"):
        assert stats[key] == result.stats[key]


def test_textures_have_the_bits_of_the_command_line(program: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    et.write_image(tmp_path / "a.png", rng.random((8, 16, 3), dtype=np.float32))
    et.write_image(tmp_path / "b.exr", rng.random((8, 16, 3), dtype=np.float32) * 10)
    et.write_image(tmp_path / "c.hdr", rng.random((8, 16, 3), dtype=np.float32) * 10)
    et.write_image(tmp_path / "d.pfm", rng.random((8, 16, 3), dtype=np.float32))
    from PIL import Image

    codes = (rng.random((8, 16, 3)) * 255).astype(np.uint8)
    Image.fromarray(codes).resize((64, 32)).save(tmp_path / "e.jpg", quality=90)
    Image.fromarray(codes[:, :, 0]).save(tmp_path / "f.png")
    Image.fromarray(codes).quantize(16).save(tmp_path / "g.png")
    Image.fromarray(np.dstack([codes, codes[:, :, 0]])).save(tmp_path / "h.png")
    Image.fromarray((rng.random((8, 16)) * 65535).astype(np.uint16)).save(tmp_path / "i.png")
    for file in sorted(tmp_path.glob("?.*")):
        scene = tmp_path / f"{file.name}.xml"
        scene.write_text(f"""<scene version="3.0.0"><sensor type="perspective">
            <transform name="to_world"><lookat origin="0, 0, 3" target="0, 0, 0" up="0, 1, 0"/></transform>
            <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/></film></sensor>
            <shape type="rectangle"><bsdf type="twosided"><bsdf type="diffuse"><texture type="bitmap" name="reflectance">
            <string name="filename" value="{file.name}"/></texture></bsdf></bsdf></shape>
            <emitter type="constant"/></scene>""")
        out = tmp_path / f"{file.name}.out.exr"
        ran = subprocess.run([program, "render", str(scene), "--spp", "2", "-o", str(out), "--quiet", "--lenient"],
                             capture_output=True, text=True)
        try:
            image = et.render(et.load(scene).build(lenient=True), spp=2).image
        except et.SceneError as error:  # reflectance above 1: both refuse the texture
            assert str(error) in ran.stderr
            continue
        assert ran.returncode == 0, ran.stderr
        np.testing.assert_array_equal(image, et.read_image(out), err_msg=file.name)


@pytest.mark.parametrize("mode", ["spread", "sample"])
def test_filter_modes_are_those_of_the_command_line(program: str, scenes: Path, tmp_path: Path, mode: str) -> None:
    subprocess.run([program, "render", str(scenes / "demo.xml"), "-D", "width=40", "-D", "height=30", "--spp", "2",
                    "--filter-mode", mode, "-o", str(tmp_path / "a.pfm"), "--quiet"], check=True)
    scene = et.load(scenes / "demo.xml", {"width": 40, "height": 30}).build()
    ours = et.render(scene, spp=2, filter_mode=mode).image
    np.testing.assert_array_equal(ours, et.read_image(tmp_path / "a.pfm"))
    np.testing.assert_equal(np.array_equal(ours, et.render(scene, spp=2).image), mode == "spread")


def test_all_ways_to_ask_for_a_rendering_take_the_same_names(program: str, scenes: Path, tmp_path: Path) -> None:
    """Of samplers and filter modes: on the command line, in Python and in studio, with the same defaults and hints."""
    size = {"width": 40, "height": 30}
    options = [str(scenes / "demo.xml"), *(f"-D{name}={value}" for name, value in size.items())]
    scene = et.load(scenes / "demo.xml", size).build()
    names = ("sampler", "filter_mode", "seed")

    def of_checkpoint(file: Path) -> dict[str, object]:
        found = _etendue.read_checkpoint(str(file))
        return {name: found[name] for name in names}

    def by_program(given: dict[str, str]) -> object:
        file = tmp_path / "program.etd"
        ran = subprocess.run([program, "render", *options, "--spp", "1", "-o", str(tmp_path / "a.pfm"), "--checkpoint", str(file),
                              "--quiet", *(f"--{name.replace('_', '-')}={value}" for name, value in given.items())],
                             capture_output=True, text=True)
        return of_checkpoint(file) if ran.returncode == 0 else ran.stderr.strip()

    def by_python(given: dict[str, str]) -> object:
        file = tmp_path / "python.etd"
        try:
            et.render(scene, spp=1, **given).save(file)  # type: ignore[arg-type]
        except ValueError as refusal:
            return str(refusal)
        return of_checkpoint(file)

    studio = subprocess.Popen([program, "studio", *options, "--idle", "-o", str(tmp_path)], stdout=subprocess.PIPE, text=True)
    try:
        assert studio.stdout
        url, token = re.search("(http.*)/#token=(.*)", studio.stdout.readline()).groups()  # type: ignore[union-attr]

        def ask(path: str, body: dict[str, str] | None = None) -> dict[str, object]:
            request = urllib.request.Request(url + path, headers={"Authorization": f"Bearer {token}"},
                                             data=json.dumps(body).encode() if body else None)
            return json.load(urllib.request.urlopen(request))  # type: ignore[no-any-return]

        while ask("/v1/state")["scene"] is None:
            time.sleep(0.01)

        def by_studio(given: dict[str, str]) -> object:
            try:
                ask("/v1/run", {"action": "start", **given})
            except urllib.error.HTTPError as refusal:
                return json.load(refusal)["error"]
            run = ask("/v1/state")["runs"][-1]  # type: ignore[index]
            return {name: run[name] for name in names}

        for given in ({}, {"sampler": "independent"}, {"sampler": "sobol"}, {"filter_mode": "sample"}, {"filter_mode": "spread"}):
            asked = by_python(given)
            assert asked == {"sampler": "sobol", "filter_mode": "spread", "seed": 0, **given}
            assert by_program(given) == asked
            assert by_studio(given) == asked
        for given in ({"sampler": "sobl"}, {"sampler": "halton"}, {"filter_mode": "Spred"}, {"filter_mode": "box"}):
            refusals = [str(ask_for(given)).partition(" must be ") for ask_for in (by_program, by_python, by_studio)]
            assert refusals[0][2] and len({refusal[2] for refusal in refusals}) == 1, refusals
    finally:
        studio.terminate()
        studio.wait()


def test_inks_of_a_jpeg_become_colours(tmp_path: Path) -> None:
    from PIL import Image

    gradient = np.linspace(0, 255, 32 * 32 * 4).reshape(32, 32, 4).astype(np.uint8)
    Image.fromarray(gradient, "CMYK").save(tmp_path / "inks.jpg", quality=95)
    expected = np.asarray(Image.open(tmp_path / "inks.jpg").convert("RGB")).astype(float) / 255
    linear = np.where(expected <= 0.04045, expected / 12.92, ((expected + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(et.read_image(tmp_path / "inks.jpg"), linear, atol=0.01)


def test_an_image_of_another_format_is_refused_with_one_message(tmp_path: Path) -> None:
    (tmp_path / "a.tif").write_bytes(b"II*\0" + bytes(100))
    with pytest.raises(RuntimeError, match="its format is none of EXR, PNG, JPEG"):
        et.read_image(tmp_path / "a.tif")
    for name, start in [("b.png", b"\x89PNG\r\n\x1a\n"), ("c.jpg", b"\xff\xd8\xff\xe0"), ("d.exr", b"\x76\x2f\x31\x01")]:
        (tmp_path / name).write_bytes(start + bytes(50))
        with pytest.raises(RuntimeError, match="^cannot read "):
            et.read_image(tmp_path / name)


def test_arrays_are_not_copied(cornell: et.Scene) -> None:
    result = et.render(cornell, spp=4)
    image = result.image
    assert image.shape == (24, 32, 3) and image.dtype == np.float32
    assert result.image is image and result.image.ctypes.data == image.ctypes.data
    assert not image.flags.owndata  # a capsule owns the renderer's vector
    sums = result.film.sums
    assert sums.shape == (24, 32, 3) and sums.dtype == np.float64 and sums.strides == (32 * 40, 40, 8)
    assert not sums.flags.writeable
    assert sums.ctypes.data == result.film.sums.ctypes.data
    deviations = result.film.deviations
    assert deviations.dtype == np.float32 and deviations.ctypes.data == sums.ctypes.data + 24
    n = result.film.passes
    np.testing.assert_allclose(deviations**2 / (n * (n - 1)), result.variance, rtol=1e-5)
    np.testing.assert_allclose(sums / result.film.passes, image, rtol=1e-6)


def test_arrays_outlive_result_and_scene(scenes: Path) -> None:
    scene = et.load(scenes / "cornell.xml").build(resolution=(8, 8))
    result = et.render(scene, spp=2)
    sums, image = result.film.sums, result.image
    expected = sums.copy(), image.copy()
    path = et.core.eye_path(scene, (3, 3))
    vertex = path[1]
    position = vertex.p.copy()
    del scene, result, path
    gc.collect()
    np.testing.assert_array_equal(sums, expected[0])
    np.testing.assert_array_equal(image, expected[1])
    np.testing.assert_array_equal(vertex.p, position)
    assert vertex.eval((0, 1, 0))[0].shape == (3,)


def test_half_widths_cover_the_truth(cornell: et.Scene) -> None:
    """95 % of the pixels' intervals contain the mean of many more samples, to within three standard errors of that share
    and a percent for values that are not normal: 0.942. Planted factors of 0.8 and 1.25 give 0.867 and 0.977.
    """
    scene = cornell.description.build(resolution=(16, 12))
    truth = et.render(scene, "path:max_depth=3", spp=16384, sampler="independent", seed=100).image
    lit = truth.mean(axis=2) > 0
    results = [et.render(scene, "path:max_depth=3", spp=512, sampler="independent", seed=seed) for seed in range(8)]
    share = np.mean([(np.abs(r.image - truth) <= r.half_width)[lit].mean() for r in results])
    assert 0.92 < share < 0.97
    assert np.isnan(et.render(cornell, spp=1).half_width).all()


def test_techniques_sum_to_the_image(cornell: et.Scene) -> None:
    result = et.render(cornell, "bdpt:max_depth=4", spp=4, techniques=True)
    total = sum(q.weighted for q in result.techniques)
    np.testing.assert_allclose(total, result.image, rtol=1e-4, atol=1e-6)
    assert result.technique(1, 2).kind == "next_event"
    with pytest.raises(KeyError, match="there is no image"):
        result.technique(9, 9)
    assert et.render(cornell, spp=1).techniques == []


def test_stops(cornell: et.Scene) -> None:
    assert et.render(cornell, spp=3).stopped_by == "samples"
    assert et.render(cornell, time=0.1).stopped_by == "time"
    assert et.render(cornell, error=0.5).stopped_by == "error"
    stopped = et.render(cornell, spp=1000, callback=lambda p: p.passes < 3)
    assert (stopped.stopped_by, stopped.passes) == ("callback", 3)


def test_what_a_callback_raises_ends_the_rendering(cornell: et.Scene) -> None:
    class Mine(Exception):
        pass

    def callback(p: et.Progress) -> None:
        if p.passes == 2:
            raise Mine("enough")

    with pytest.raises(Mine, match="enough"):
        et.render(cornell, spp=1000, callback=callback)


@pytest.mark.parametrize(
    "arguments, message",
    [
        ({"integrator": "bdp"}, 'there is no integrator "bdp"; did you mean "bdpt"'),
        ({"integrator": "bdpt:max_dept=3"}, 'has no parameter "max_dept" .did you mean "max_depth"'),
        ({"aovs": ["albdo"]}, 'unknown layer "albdo" .known: albedo'),
        ({"sampler": "halton"}, 'sampler must be independent or sobol, but is "halton"'),
        ({"filter_mode": "box"}, 'filter_mode must be spread or sample, but is "box"'),
        ({"spp": 0}, "spp, time and error must be above 0"),
        ({"spp": 4.0}, "spp must be an integer, but is 4.0"),
        ({"spp": "4"}, "spp must be an integer, but is '4'"),
        ({"seed": -1}, "seed must lie between 0 and 2.64 - 1, but is -1"),
        ({"sensor": 0.0}, "sensor must be an integer, but is 0.0"),
        ({"integrator": 3}, "an integrator is a text"),
        ({"threads": -1}, "threads must lie between 0 and 4096, but is -1"),
        ({"techniques": 65}, "techniques must lie between 0 and 64, but is 65"),
    ])
def test_wrong_arguments(cornell: et.Scene, arguments: dict[str, object], message: str) -> None:
    with pytest.raises((RuntimeError, ValueError, TypeError), match=message):
        et.render(cornell, **arguments)  # type: ignore[arg-type]


def test_other_threads_run_while_it_renders(cornell: et.Scene) -> None:
    ticks = 0
    done = threading.Event()

    def count() -> None:
        nonlocal ticks
        while not done.is_set():
            ticks += 1
            time.sleep(0.005)

    thread = threading.Thread(target=count)
    thread.start()
    et.render(cornell, time=1.0)
    done.set()
    thread.join()
    assert ticks > 40


def test_renderings_in_several_threads(cornell: et.Scene) -> None:
    images: dict[int, et.Result] = {}
    threads = [threading.Thread(target=lambda i=i: images.__setitem__(i, et.render(cornell, spp=4, seed=i % 2)))
               for i in range(4)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    np.testing.assert_array_equal(images[0].image, images[2].image)
    np.testing.assert_array_equal(images[1].image, images[3].image)


CHILD = """
    import sys, time
    import etendue as et
    d = et.load({scene!r})
    scene = d.build(resolution={size})
    print("ready", flush=True)
    try:
        result = et.render(scene, "{method}", time=600, callback={callback})
    except KeyboardInterrupt:
        print("raised", flush=True)
    else:
        print(result.stopped_by, result.passes > 0, float(result.image.mean()) > 0, flush=True)
"""


def interrupt(scene: str, size: tuple[int, int], wait: float, callback: str = "None",
              method: str = "bdpt") -> tuple[str, float]:
    code = textwrap.dedent(CHILD.format(scene=scene, size=size, callback=callback, method=method))
    # A process that was started in the background ignores interrupts, and its children do.
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True,
                             preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    assert child.stdout and child.stdout.readline() == "ready\n"
    time.sleep(wait)
    child.send_signal(signal.SIGINT)
    begin = time.monotonic()
    out, _ = child.communicate(timeout=120)
    assert child.returncode == 0
    return out.strip(), time.monotonic() - begin


@pytest.mark.parametrize("callback", ["None", "lambda p: None"])
def test_interrupts_return_what_there_is(scenes: Path, callback: str) -> None:
    out, seconds = interrupt(str(scenes / "cornell.xml"), (32, 32), 2, callback)
    assert out == "interrupted True True" and seconds < 10


def test_interrupts_before_the_first_pass_raise(scenes: Path) -> None:
    out, seconds = interrupt(str(scenes / "cornell.xml"), (4000, 4000), 0.5)
    assert out == "raised" and seconds < 30


def test_interrupts_of_pilots_raise(scenes: Path) -> None:
    out, seconds = interrupt(str(scenes / "cornell.xml"), (400, 400), 1, method="auto")
    assert out == "raised" and seconds < 5


@pytest.mark.long
def test_ten_thousand_renderings_leave_no_memory(scenes: Path, tmp_path: Path) -> None:
    scene = et.load(scenes / "cornell.xml").build(resolution=(8, 8))
    after = []
    for i in range(10_000):
        result = et.render(scene, "bdpt", spp=1, seed=i, techniques=2, threads=1 + i % 2)
        assert result.image.shape == (8, 8, 3) and len(result.techniques) > 0
        if i % 1000 == 999:
            after.append(allocated_bytes(tmp_path))
    print("allocated bytes:", after)
    assert after[-1] - after[0] < 2**18


def test_many_renderings_leave_no_memory(scenes: Path, tmp_path: Path) -> None:
    """A short form of the long test, with scenes: 200 bytes, or a small object, a rendering would show."""
    description = et.load(scenes / "cornell.xml")
    after, blocks = [], []
    for i in range(600):
        scene = description.build(resolution=(8, 8))
        result = et.render(scene, "bdpt", spp=1, seed=i, techniques=2, callback=lambda p: p.film.sums is None)
        assert result.image.shape == (8, 8, 3)
        if i in (199, 599):
            del scene, result
            after.append(allocated_bytes(tmp_path))
            blocks.append(sys.getallocatedblocks())
    assert after[1] - after[0] < 400 * 200
    assert blocks[1] - blocks[0] < 200


def test_import_takes_little_beside_numpy_and_reports_no_leaks_at_exit() -> None:
    """What takes long to import (SciPy, Matplotlib, IPython, asyncio) is imported by the functions that need it."""

    def packages(module: str) -> set[str]:
        code = f"import sys, {module}; print(*sys.modules)"
        run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert run.stderr == ""
        return {name.partition(".")[0] for name in run.stdout.split()}

    small = {"atexit", "base64", "binascii", "copy", "dataclasses", "errno", "fnmatch", "hashlib", "html", "ipaddress"}
    small |= {"json", "ntpath", "pathlib", "threading", "urllib"}
    others = {name for name in packages("etendue") - packages("numpy") - small if not name.startswith("_")}
    assert others == {"etendue"}


def test_an_old_processor_is_a_message(tmp_path: Path) -> None:
    from etendue._cpu import check_cpu

    (tmp_path / "cpuinfo").write_text("processor : 0\nflags\t\t: fpu sse2 avx f16c fma abm movbe bmi1 bmi2\n")
    with pytest.raises(ImportError, match="this one lacks avx2"):
        check_cpu(str(tmp_path / "cpuinfo"))
