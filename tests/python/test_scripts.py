"""Scripts and measurements, with stand-ins for the programs that they run."""

import argparse
import importlib.machinery
import importlib.util
import json
import subprocess
import sys
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


def test_results_older_than_their_methods_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                    capsys: pytest.CaptureFixture[str]) -> None:
    loader = importlib.machinery.SourceFileLoader("results", str(ROOT / "scripts" / "results"))
    results = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    monkeypatch.setitem(sys.modules, loader.name, results)  # Its data classes look for it there.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    loader.exec_module(results)
    figures = tmp_path / "docs" / "figures"
    for name, value in {"ROOT": tmp_path, "FIGURES": figures, "MANIFEST": figures / "results.json"}.items():
        monkeypatch.setattr(results, name, value)
    (tmp_path / "docs" / "integrators").mkdir(parents=True)
    figures.mkdir()
    method = tmp_path / "docs" / "integrators" / "path.md"
    method.write_text("<!-- generated: list integrator path --markdown -->\nrr_depth 5\n<!-- end of generated part -->\nOne more.\n")
    (figures / "speed.jsonl").write_text("{}")
    page = "<!-- generated by echo 1 -->\n\n1\n\n<!-- end of generated part -->\n"
    (tmp_path / "README.md").write_text(page)
    entry = {"date": "2026-11-30", "quick": False, "tables": {"path": results.table_of("path")},
             "files": {"speed.jsonl": results.hash_of(figures / "speed.jsonl")}}
    results.MANIFEST.write_text(json.dumps({"speed": entry}))

    def problems() -> str:
        status = results.check()
        text = capsys.readouterr().err
        assert status == (1 if text else 0)
        return text

    assert problems() == ""
    method.write_text(method.read_text().replace("One more.", "Two more."))
    assert problems() == ""
    method.write_text(method.read_text().replace("rr_depth 5", "rr_depth 2"))
    assert "speed of 2026-11-30 is older than the parameters of path" in problems()
    entry["tables"] = {"path": results.table_of("path")}
    results.MANIFEST.write_text(json.dumps({"speed": entry}))
    (tmp_path / "README.md").write_text(page.replace("\n1\n", "\n2\n"))
    assert "README.md differs from what `echo 1` prints" in problems()
    (tmp_path / "README.md").write_text(page)
    (figures / "speed.jsonl").write_text("{} ")
    assert "speed.jsonl is not what the part speed wrote" in problems()
