"""Scripts and measurements, with stand-ins for the programs that they run."""

import argparse
import ast
import importlib.machinery
import importlib.util
import json
import re
import subprocess
import sys
import types
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def write_program(file: Path, text: str) -> None:
    file.parent.mkdir(exist_ok=True)
    file.write_text(f"#!/bin/bash\n{text}")
    file.chmod(0o755)


KILLED = """
[ RUN      ] Methods/Killed.ResumesWithTheSameBits/path_guide_on
path:guide=on: ETENDUE_SEED=11
path:guide=on: 2 kills, 1 resumes
[       OK ] Methods/Killed.ResumesWithTheSameBits/path_guide_on (12 ms)
[ RUN      ] Methods/Killed.ResumesWithTheSameBits/upg_bdpt
upg+bdpt: ETENDUE_SEED=12
upg+bdpt: 2 kills, 2 resumes
/a/tests/program/checkpoint_test.cpp:150: Failure
Expected equality of these values:
  bits("killed.etd")
  bits("whole.etd")
Google Test trace:
/a/tests/program/checkpoint_test.cpp:100: ETENDUE_SEED=12
[  FAILED  ] Methods/Killed.ResumesWithTheSameBits/upg_bdpt, where GetParam() = 0x55 pointing to "upg+bdpt" (9 ms)
[ RUN      ] Methods/Killed.ResumesWithTheSameBits/vcm
vcm: ETENDUE_SEED=13
"""


def test_chaos_tells_bits_that_differ_and_tests_that_crash(tmp_path: Path) -> None:
    write_program(tmp_path / "etendue", "echo etendue 1")
    write_program(tmp_path / "tests" / "program_tests", f"echo '{KILLED}'; kill -SEGV $$")
    report = tmp_path / "chaos.json"
    chaos = [sys.executable, str(ROOT / "scripts" / "chaos")]
    run = subprocess.run([*chaos, "2", str(tmp_path), "-o", str(report)], capture_output=True, text=True)
    assert run.returncode != 0, run.stdout
    methods = json.loads(report.read_text())["methods"]
    assert [(m["method"], m["seed"], m["kills"], m["same_bits"]) for m in methods] == [
        ("path:guide=on", 11, 2, True), ("upg+bdpt", 12, 2, False), ("vcm", 13, 0, False)]
    table = subprocess.run([*chaos, "--table", str(report)], capture_output=True, text=True, check=True).stdout
    assert "| `upg+bdpt` | 2 | 2 | 12 | **no** |" in table


def test_images_of_mitsuba_are_left_out_where_it_is_missing(tmp_path: Path) -> None:
    write_program(tmp_path / "python", "exit 1")
    for arguments, message in (
        (["--mitsuba", str(tmp_path / "python")], f"{tmp_path}/python does not have the package mitsuba"),
        ([], "--mitsuba PYTHON is missing"),
    ):
        run = subprocess.run([sys.executable, str(ROOT / "bench" / "mitsuba-images"), "run", str(tmp_path / "a.json"), *arguments],
                             capture_output=True, text=True)
        assert (run.returncode, run.stderr) == (0, f"mitsuba-images: {message}: nothing is rendered\n")
    assert not (tmp_path / "a.json").exists()


def test_images_for_mitsuba_have_a_box_filter() -> None:
    loader = importlib.machinery.SourceFileLoader("mitsuba_images", str(ROOT / "bench" / "mitsuba-images"))
    sys.path.insert(0, str(ROOT / "bench"))
    script = types.ModuleType("mitsuba_images")
    script.__file__ = loader.path
    loader.exec_module(script)
    box = '<film type="hdrfilm"><rfilter type="box"/></film>'
    for text in ('<film type="hdrfilm"><rfilter type="gaussian"/></film>', '<film type="hdrfilm"></film>',
                 '<film type="hdrfilm"><rfilter type="gaussian">\n<float name="stddev" value="1"/></rfilter></film>'):
        assert script.with_box_filter(text) == box


def test_the_model_of_ranks_has_the_pace_of_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "bench"))
    import ranks_model

    pace = (ROOT / "src" / "render" / "writing_pace.h").read_text()
    assert f"kMostOfTime = {ranks_model.MOST_OF_TIME};" in pace
    assert f"{{interval, most, {ranks_model.LONGEST_WAIT}}}" in pace
    # The share of the time for a file: less than one a minute takes, a hundredth, and one every quarter of an hour.
    for seconds, of_checkpoints, of_images in [(0.3, 0.005, 0.005), (3, 0.01, 0.01), (90, 0.1, 0.01)]:
        for kind, share in [("checkpoint_seconds", of_checkpoints), ("image_seconds", of_images)]:
            job = ranks_model.Job(pass_seconds=1, jitter=0, **{kind: seconds})
            assert job.seconds(1, 1000) == pytest.approx(1000 * (1 + share))


def test_what_checkpoints_cost_is_measured_after_every_pass(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "bench"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    loader = importlib.machinery.SourceFileLoader("checkpoint_cost", str(ROOT / "bench" / "checkpoint_cost"))
    checkpoint_cost = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(checkpoint_cost)
    stats = {"checkpoints": {"written": 2, "seconds": 0.1}}
    monkeypatch.setattr(checkpoint_cost, "render", lambda *_: stats)
    with pytest.raises(SystemExit, match="path: 2 checkpoints between 4 passes"):
        checkpoint_cost.measure_method(None, "path", argparse.Namespace(passes=4), tmp_path)


@pytest.mark.parametrize("line, dead", [
    ("[a](b.md#a-heading--here)", ""),
    ("[a](b.md) and ![a](b.png)", "b.png"),
    ("[over two\nlines](c.md)", "c.md"),
    ("[a](b.md#another-heading)", "b.md#another-heading"),
    ("[a](#nothing)", "#nothing"),
    ('<img src="c.jpg">', "c.jpg"),
    ("`[a](c.md)`\n\n    [a](c.md)\n\n```\n[a](c.md)\n```\n", ""),
    ("[a](https://example.org/c.md)", ""),
    ("[a](../b.md)", "../b.md"),
])
def test_dead_links_of_the_manual_are_found(tmp_path: Path, line: str, dead: str) -> None:
    (tmp_path / "scripts").mkdir()
    (tmp_path / "scripts" / "links").write_text((ROOT / "scripts" / "links").read_text())
    (tmp_path / "a.md").write_text(f"# Page\n\n{line}\n")
    (tmp_path / "b.md").write_text("# B\n\n```\n# Another heading\n```\n\n## A *heading* `+` here\n")
    result = subprocess.run([sys.executable, tmp_path / "scripts" / "links"], capture_output=True, text=True)
    assert result.returncode == (1 if dead else 0), result.stderr
    assert (f": {dead}\n" in result.stderr) if dead else result.stderr == ""


def copy_of_script(folder: Path, name: str) -> Path:
    """A script of the project in another folder, whose other programs are stand-ins that do nothing."""
    for other in ("build", "links"):
        write_program(folder / "scripts" / other, "")
    script = folder / "scripts" / name
    script.write_bytes((ROOT / "scripts" / name).read_bytes())
    script.chmod(0o755)
    return script


def test_pages_lose_no_text(tmp_path: Path) -> None:
    script = copy_of_script(tmp_path, "docs")
    (tmp_path / "README.md").write_text("no generated part\n")
    (tmp_path / "docs").mkdir()
    page = tmp_path / "docs" / "page.md"
    end = "<!-- end of generated part -->\n"
    text = "before\n<!-- generated from code.cpp -->\n```cpp\nold\n```\n" + end + "after, without an end of the line"
    page.write_text(text)
    page.chmod(0o640)
    run = subprocess.run([script], capture_output=True, text=True)
    assert run.returncode != 0 and "code.cpp" in run.stderr
    assert page.read_text() == text
    (tmp_path / "code.cpp").write_text("int new_one;\n")
    subprocess.run([script], check=True, capture_output=True)
    assert page.read_text() == text.replace("old", "int new_one;") + "\n"
    assert page.stat().st_mode & 0o777 == 0o640
    assert [f.name for f in (tmp_path / "docs").iterdir()] == ["page.md"]


def test_a_folder_that_is_no_site_is_not_deleted(tmp_path: Path) -> None:
    script = copy_of_script(tmp_path, "site")
    (tmp_path / "scripts" / "site-requirements.txt").write_text("")
    (tmp_path / "build" / "site-venv").mkdir(parents=True)
    write_program(tmp_path / "build" / "site-venv" / "bin" / "mkdocs", 'rm -rf "${@: -1}"/*')
    write_program(tmp_path / "build" / "site-venv" / "bin" / "python", "")
    (tmp_path / "build" / "site-venv" / "requirements.txt").write_text("")
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "thesis.tex").write_text("ten years")
    run = subprocess.run([script, folder], capture_output=True, text=True)
    assert run.returncode != 0 and "neither empty nor a site" in run.stderr
    assert (folder / "thesis.tex").exists()
    (folder / "sitemap.xml").write_text("")
    subprocess.run([script, folder], check=True, capture_output=True)
    assert not (folder / "thesis.tex").exists()


def test_pages_of_the_site_load_nothing_from_elsewhere(tmp_path: Path) -> None:
    def problems(html: str, name: str = "index.html") -> str:
        (tmp_path / name).write_text(html)
        return subprocess.run([ROOT / "scripts" / "links", "--site", tmp_path], capture_output=True, text=True).stderr

    (tmp_path / "own.js").write_text("")
    own = '<script src="own.js"></script><a href="https://a.example/">a</a><link rel="canonical" href="https://a.example/">' \
        '<img src="data:image/png;base64,AA==">'
    assert problems(own) == ""
    for loaded in ('<script src="https://a.example/x.js"></script>', '<link rel="stylesheet" href="//a.example/x.css">',
                   '<img src="http://a.example/x.png">', '<img srcset="own.js 1x, https://a.example/x.png 2x">'):
        assert "from another site" in problems(own + loaded), loaded
    assert problems(own) == ""
    assert "404.html: this is loaded from another site" in problems('<script src="https://a.example/x.js"></script>', "404.html")


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> types.ModuleType:
    """scripts/results for a tree with one method, one page and one part."""
    loader = importlib.machinery.SourceFileLoader("results", str(ROOT / "scripts" / "results"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    monkeypatch.setitem(sys.modules, loader.name, module)  # Its data classes look for it there.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    loader.exec_module(module)
    figures = tmp_path / "docs" / "figures"
    for name, value in {"ROOT": tmp_path, "FIGURES": figures, "REPORTS": tmp_path / "docs" / "reports",
                        "MANIFEST": figures / "results.json",
                        "PARTS": [module.Part("speed", "Speed", 1, ["path"], ["speed*.json"], lambda c: [])]}.items():
        monkeypatch.setattr(module, name, value)
    (tmp_path / "docs" / "integrators").mkdir(parents=True)
    figures.mkdir()
    (tmp_path / "docs" / "integrators" / "path.md").write_text(
        "<!-- generated: list integrator path --markdown -->\nrr_depth 5\n<!-- end of generated part -->\nOne more.\n")
    (figures / "speed.json").write_text("{}")
    (tmp_path / "README.md").write_text("<!-- generated by echo 1 -->\n\n1\n\n<!-- end of generated part -->\n")
    return module


MACHINE = {"date": "2026-11-30", "commit": "c", "program": "etendue", "processor": "p", "cores": 2, "load": 0.0}


def context(results: types.ModuleType, tmp_path: Path) -> object:
    return results.Context(str(tmp_path / "elsewhere" / "etendue"), tmp_path / "elsewhere", results.FIGURES, results.REPORTS, tmp_path,
                           True, "/home/someone/venv/bin/python")


def test_results_older_than_their_methods_are_found(tmp_path: Path, results: types.ModuleType,
                                                    capsys: pytest.CaptureFixture[str]) -> None:
    figures, method, page = results.FIGURES, tmp_path / "docs" / "integrators" / "path.md", tmp_path / "README.md"
    good = {"date": "2026-11-30", "quick": False, "tables": {"path": results.table_of("path")},
            "files": {"speed.json": results.hash_of(figures / "speed.json")}}

    def problems(by_hand: tuple[str, ...] = (), **entries: dict[str, object]) -> str:
        results.MANIFEST.write_text(json.dumps({"by hand": by_hand, **({"speed": good} | entries)}))
        status = results.check()
        text = capsys.readouterr().err
        assert status == (1 if text else 0)
        return text

    assert problems() == ""
    # Methods and their parameters.
    text = method.read_text()
    method.write_text(text.replace("One more.", "Two more."))
    assert problems() == ""
    method.write_text(text.replace("rr_depth 5", "rr_depth 2"))
    assert "speed of 2026-11-30 is older than the parameters of path" in problems()
    method.unlink()
    assert "older than the parameters of path" in problems()
    method.write_text(text)
    assert "speed of 2026-11-30 lacks path" in problems(speed=good | {"tables": {}})
    assert "no longer has, light" in problems(speed=good | {"tables": good["tables"] | {"light": "0"}})
    assert "speed was made with --quick" in problems(speed=good | {"quick": True})
    assert "the part sped, which scripts/results does not make" in problems(sped=good)
    # Pages.
    generated = page.read_text()
    page.write_text(generated.replace("\n1\n", "\n2\n"))
    assert "README.md differs from what `echo 1` prints" in problems()
    page.write_text(generated.replace("echo 1", "no-such-program"))
    assert "README.md" in problems()
    page.write_text(generated)
    # Files.
    assert "speed of 2026-11-30 has no files" in problems(("speed.json",), speed=good | {"files": {}})
    (figures / "speed-by-hand.json").write_text("")
    assert "docs/figures/speed-by-hand.json was not written by its part" in problems()
    assert problems(("speed-by-hand.json",)) == ""
    (figures / "speed-by-hand.json").unlink()
    assert "docs/figures/speed-by-hand.json is missing" in problems(("speed-by-hand.json",))
    (figures / "drawn.svg").write_text("")
    assert results.check() == 1  # of the list that lacks the file
    assert "no part writes drawn.svg" in capsys.readouterr().out
    (figures / "speed.json").write_text("{} ")
    assert "speed.json is not what the part speed wrote" in problems()
    (figures / "speed.json").unlink()
    assert "speed: docs/figures/speed.json is missing" in problems()


def test_results_are_unchecked_without_their_list(results: types.ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert results.check() == 1
    printed = capsys.readouterr()
    assert "results.json is missing" in printed.err
    assert "never made by scripts/results, so that versions are unchecked: speed\n1 skipped\n" in printed.out


def test_results_are_of_the_run_that_wrote_them(tmp_path: Path, results: types.ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    c = context(results, tmp_path)
    results.MANIFEST.write_text(json.dumps({"by hand": ["speed.json", "speed-2.json"]}))

    def make(*commands: list[str]) -> Path:
        return results.make(results.Part("speed", "Speed", 1, ["path"], ["speed*.json"], lambda c: iter(commands)), c, MACHINE)

    with pytest.raises(RuntimeError, match="no file was written"):
        make(["true"])
    (results.FIGURES / "speed-2.json").write_text("{}")
    report = make(["touch", str(results.FIGURES / "speed.json")],
                  ["echo", c.mitsuba, str(c.build), c.program, "/opt/x/y.py", "https://a.example/b/c", "1/2"]).read_text()
    manifest = json.loads(results.MANIFEST.read_text())
    assert list(manifest["speed"]["files"]) == ["speed.json"] and manifest["by hand"] == ["speed-2.json"]
    assert "not written anew: speed-2.json" in capsys.readouterr().err
    assert "\npython build/release etendue y.py https://a.example/b/c 1/2\n" in report
    assert str(tmp_path) not in report and "/home" not in report and "/opt" not in report


def test_results_of_other_parts_are_made_whatever_one_does(tmp_path: Path, results: types.ModuleType, monkeypatch: pytest.MonkeyPatch,
                                                           capsys: pytest.CaptureFixture[str]) -> None:
    def fails(c: object) -> object:
        yield ["true"]
        raise KeyError("detectable")

    part = results.PARTS[0]
    broken = results.dataclasses.replace(part, name="broken", commands=fails)
    good = results.dataclasses.replace(part, commands=lambda c: iter([["touch", str(c.figures / "speed.json")]]))
    args = argparse.Namespace(quick=True, etendue="/bin/true", build=None, mitsuba=None)
    assert results.run(args, [broken, good]) == 1
    printed = capsys.readouterr().out
    assert "broken failed: KeyError: 'detectable'" in printed and "1 made, 0 left out, 1 failed" in printed
    # Where nothing says that the tree is clean.
    args.quick = False
    with pytest.raises(SystemExit, match="not clean"):
        results.run(args, [good])


def test_results_are_left_out_without_what_they_show(tmp_path: Path, results: types.ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    c = results.dataclasses.replace(context(results, tmp_path), quick=False)
    monkeypatch.setenv("ETENDUE_SCENES", str(tmp_path))
    (tmp_path / "veach-ajar-1").mkdir()
    with pytest.raises(results.LeftOut, match="veach-bidir") as reason:
        results.available(["veach-ajar", "veach-bidir", "lantern"], c)
    assert "veach-ajar" not in str(reason.value)
    assert results.available(["veach-ajar", "yard-ring"], c) == ["veach-ajar", "yard-ring"]
    with pytest.raises(results.LeftOut, match="build/release"):
        next(results.speed(c))


def test_results_show_each_method_of_the_gallery(results: types.ModuleType) -> None:
    gallery = re.search(r"^METHODS = (\[.*?\])", (ROOT / "bench" / "gallery").read_text(), re.DOTALL | re.MULTILINE)
    assert sorted(results.METHODS) == sorted(ast.literal_eval(gallery[1]))


def plugin_pictures(monkeypatch: pytest.MonkeyPatch) -> types.ModuleType:
    loader = importlib.machinery.SourceFileLoader("plugin_pictures", str(ROOT / "bench" / "plugin-pictures"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    loader.exec_module(module)
    return module


def test_a_plugin_without_a_picture_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = plugin_pictures(monkeypatch)
    for category, variants in module.VARIANTS.items():
        listed = [{"name": name, "doc": "A plug-in."} for name in variants]
        (tmp_path / f"{category}.json").write_text(json.dumps(listed))
    program = tmp_path / "etendue"
    program.write_text(f"#!/bin/sh\ncat {tmp_path}/$2.json\n")
    program.chmod(0o755)
    module.check(program)
    names = list(module.VARIANTS["bsdf"])
    (tmp_path / "bsdf.json").write_text(json.dumps([{"name": name, "doc": ""} for name in [*names[1:], "velvet"]]))
    with pytest.raises(SystemExit) as reason:
        module.check(program)
    assert "the bsdf velvet has no picture" in str(reason.value)
    assert f"the bsdf {names[0]}, which etendue does not have" in str(reason.value)
    assert "emitter" not in str(reason.value)


def test_plugins_have_the_pictures_that_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    module = plugin_pictures(monkeypatch)
    jobs = list(module.jobs())
    assert sorted(file for _, file, _ in jobs) == sorted(f.name for f in (ROOT / "docs" / module.FOLDER).iterdir())
    scenes = [module.scene_with(category, xml) for category, _, xml in jobs]
    assert len(set(scenes)) == len(scenes)


def test_results_know_files_of_other_folders(tmp_path: Path, results: types.ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "examples").mkdir()
    notebook = tmp_path / "examples" / "a.ipynb"
    part = results.Part("notebooks", "Notebooks", 1, ["path"], ["../../examples/*.ipynb"], lambda c: iter([["touch", str(notebook)]]))
    results.PARTS[:] = [part]
    results.make(part, context(results, tmp_path), MACHINE)
    manifest = json.loads(results.MANIFEST.read_text())
    results.MANIFEST.write_text(json.dumps({"notebooks": manifest["notebooks"] | {"quick": False}}))
    assert list(manifest["notebooks"]["files"]) == ["../../examples/a.ipynb"]
    (tmp_path / "docs" / "figures" / "speed.json").unlink()
    capsys.readouterr()
    results.check()
    assert "examples/a.ipynb" not in capsys.readouterr().err
    notebook.write_text("{}")
    assert results.check() == 1
    assert "examples/a.ipynb is not what the part notebooks wrote on 2026-11-30" in capsys.readouterr().err.splitlines()[0]
    (tmp_path / "examples" / "b.ipynb").write_text("{}")
    results.check()
    assert '\nexamples/b.ipynb was not written by its part' in capsys.readouterr().err
    notebook.unlink()
    results.check()
    assert "\nnotebooks: examples/a.ipynb is missing" in "\n" + capsys.readouterr().err


def test_scenes_of_others_are_recognised(tmp_path: Path) -> None:
    sys.path.insert(0, str(ROOT / "bench"))
    import public_scenes

    def check() -> tuple[int, str]:
        run = subprocess.run([sys.executable, str(ROOT / "scripts" / "scenes"), "--check"], capture_output=True, text=True,
                             env={"ETENDUE_SCENES": str(tmp_path), "PATH": "/usr/bin:/bin"})
        return run.returncode, run.stdout + run.stderr

    status, text = check()
    assert status == 0 and f"{len(public_scenes.SCENES)} skipped" in text
    folder = tmp_path / "veach-bidir-mts3"
    folder.mkdir()
    status, text = check()
    assert status == 1 and "veach-bidir-mts3/scene.xml is missing" in text
    (folder / "scene.xml").write_text("<scene/>")
    status, text = check()
    assert status == 1 and "veach-bidir-mts3/scene.xml is another file: " in text and "not 5d0d438d4f72e07d" in text


def test_checksums_of_folders_are_of_what_scenes_read(tmp_path: Path) -> None:
    sys.path.insert(0, str(ROOT / "bench"))
    import public_scenes

    def checksum(changed: str = "", text: str = "1") -> str:
        for name in ("scene.xml", "meshes/a.ply", "LICENSE.txt", "reference/a.exr"):
            file = tmp_path / name
            file.parent.mkdir(exist_ok=True)
            file.write_text(text if name == changed else "0")
        return public_scenes.checksum_of_folder(tmp_path)

    assert checksum() == checksum("LICENSE.txt") == checksum("reference/a.exr")
    assert len({checksum(), checksum("scene.xml"), checksum("meshes/a.ply"), checksum("meshes/a.ply", "2")}) == 4


def test_the_picture_of_the_layers_is_that_of_the_build(tmp_path: Path) -> None:
    subprocess.run([sys.executable, str(ROOT / "bench" / "layers"), "-o", str(tmp_path / "layers.svg")], check=True)
    shown = (tmp_path / "layers.svg").read_text()
    assert shown == (ROOT / "docs" / "figures" / "layers.svg").read_text(), "run scripts/results --only layers"
    folders = [f.name for f in (ROOT / "src").iterdir() if f.is_dir()]
    assert all(f">{name}</text>" in shown for name in folders)


def script_of_bench(name: str, monkeypatch: pytest.MonkeyPatch) -> types.ModuleType:
    monkeypatch.syspath_prepend(str(ROOT / "bench"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    loader = importlib.machinery.SourceFileLoader(name.replace("-", "_"), str(ROOT / "bench" / name))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    return module


def test_sheets_show_scenes_that_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    sheet, symptoms = (script_of_bench(name, monkeypatch) for name in ("contact-sheet", "symptoms"))
    import public_scenes

    own = {file.stem for file in (ROOT / "scenes").glob("*.xml")}
    folders = {s.folder for s in public_scenes.SCENES}
    assert sheet.METHODS.keys() | sheet.EXPOSURES.keys() <= own | folders and sheet.NEED_LENIENT <= folders
    assert {scene for scene, *_ in symptoms.STRIPS.values()} <= own
    labels = [name for s in public_scenes.SCENES for name, _ in s.labels()]
    assert len(set(labels)) == len(labels) == sum(len(s.files) for s in public_scenes.SCENES)


def test_notebooks_are_stored_without_the_moment(monkeypatch: pytest.MonkeyPatch) -> None:
    notebooks = script_of_bench("notebooks", monkeypatch)
    assert notebooks.without_moment(f"12 spp in 1.3 s, of {ROOT}/scenes/a.xml") == "12 spp in … s, of scenes/a.xml"
    assert notebooks.without_moment("1.3 samples, 4 shapes") == "1.3 samples, 4 shapes"
    head = "<table><thead><tr><th></th><th>spp</th><th>seconds</th></tr></thead><tbody>"
    row = "<tr><th>0</th><td>8</td><td>{}</td></tr>"
    end = "</tbody></table>"
    assert notebooks.html_of(head + row.format("0.25") + row.format("3") + end) == head + 2 * row.format("…") + end
