"""Documentation and types."""

import inspect
import os
import re
import subprocess
import sys
import types
from pathlib import Path

import pytest

import etendue as et
import transcripts

ROOT = Path(__file__).resolve().parents[2]

# Words that tell shape, measure or unit.
UNITS = re.compile(
    r"shape|pixel|unit|radiance|second|stop|degree|meter|watt|byte|MiB|steradian|density|dimensionless|number|count|share"
    r"|text|sentence|file|folder|row|dict|name|matrix|whether|vertex|vertices|path|linear|None|scene|description|HTML|image", re.IGNORECASE)


def public_names() -> list[tuple[str, object]]:
    found: list[tuple[str, object]] = []
    for module in (et, et.core):
        found.append((module.__name__, module))
        for name in module.__all__:
            value = getattr(module, name)
            found.append((f"{module.__name__}.{name}", value))
            if not inspect.isclass(value):
                continue
            for member, m in vars(value).items():
                is_documented = isinstance(m, (property, types.FunctionType, staticmethod)) or "nb_method" in type(
                    m).__name__
                if not member.startswith("_") and is_documented:
                    found.append((f"{module.__name__}.{name}.{member}", m))
    return found


@pytest.mark.parametrize("name, value", public_names(), ids=lambda v: v if isinstance(v, str) else "")
def test_every_public_name_has_a_docstring_with_shape_or_unit(name: str, value: object) -> None:
    doc = inspect.getdoc(value) or ""
    lines = [line for line in doc.splitlines() if line.strip()]
    text = " ".join(line for line in lines if not re.match(rf"{name.split('.')[-1]}\(", line))
    assert len(text) > 15, f"{name} has no docstring"
    if isinstance(value, property) or (callable(value) and not inspect.isclass(value)):
        assert UNITS.search(text), f"the docstring of {name} names neither shape nor unit: {text}"


def test_the_test_finds_names() -> None:
    names = [name for name, _ in public_names()]
    for expected in ("etendue.render", "etendue.Result.image", "etendue.core.Vertex.pdf_fwd", "etendue.Description.build"):
        assert expected in names


def test_every_public_name_is_listed() -> None:
    for module in (et, et.core):
        public = {n for n, v in vars(module).items() if not n.startswith("_") and not inspect.ismodule(v)}
        assert {n for n in public if getattr(vars(module)[n], "__module__", "").startswith("etendue")} <= set(module.__all__) | set(et.__all__)


def test_types_of_package_tests_and_examples() -> None:
    files = [str(ROOT / "python" / "etendue"), str(ROOT / "tests" / "python" / "typed_examples.py"),
             *map(str, sorted((ROOT / "examples").glob("*.py")))]
    run = subprocess.run([sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(ROOT / "build" / "mypy"), *files[1:]],
                         capture_output=True, text=True, cwd=ROOT)
    assert run.returncode == 0, run.stdout + run.stderr


@pytest.mark.clusters
@pytest.mark.parametrize("page", transcripts.pages(), ids=lambda page: str(page.stem))
def test_transcripts_are_what_the_commands_print(page: Path, program: str, tmp_path: Path) -> None:
    old = page.read_text()
    new, absent = transcripts.replayed(page, program, tmp_path)
    assert not absent or not os.environ.get("ETENDUE_NEEDS_CLUSTERS"), f"missing: {', '.join(absent)}"
    if os.environ.get("ETENDUE_RENEW"):
        page.write_text(new)
        return
    assert not transcripts.difference(old, new), f"{transcripts.difference(old, new)}\nscripts/transcripts renews {page.name}"


def test_transcripts_differ_by_more_than_times() -> None:
    page = (
        "    $ etendue render a.xml\n    1 spp, 2.2 s, 12 %, 15.4 s left, 0.55 Mrays/s\n"
        "    a.exr: 8 spp in 8.5 s, 0.028 Msamples/s, 0.51 Mrays/s, relative error 0.1060\n      processor   12ab\n"
    )
    same = page.replace("8.5 s", "125 s").replace("0.028", "1.2").replace("1 spp, 2.2 s", "3 spp, 3 s")
    assert not transcripts.difference(page, same)
    other = page.replace("0.1060", "0.1061")
    assert "0.1061" in transcripts.difference(page, other)
    assert "8 spp" in transcripts.difference(page, page.replace("8 spp", "9 spp"))
    # Last bits depend on the processor.
    assert not transcripts.difference(page, other.replace("12ab", "12ac"))
    assert "0.2" in transcripts.difference(page, other.replace("12ab", "12ac").replace("0.1061", "0.2"))
    block, = transcripts.blocks_of(["text", *page.splitlines(), "", "    $$"])
    assert [c.text for c in block.commands] == ["etendue render a.xml"] and len(block.commands[0].printed) == 3
    assert block.lines() == page.splitlines()


def test_what_follows_in_the_folder_of_a_transcript_that_is_left_is_left(
    program: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(transcripts.PROGRAMS, "absent", ("absent",))
    old = (
        "# One\n\n    $ echo absent\n    old\n\ntext\n\n    $ echo new\n    old\n\n"
        "# Two\n\n    $ echo new\n    old\n\ntext\n\n    $ echo absent\n    old\n\ntext\n\n    $ echo new\n    old\n\n"
        "# Three\n\n    $ echo new; ls\n    old\n"
    )
    page = tmp_path / "page.md"
    page.write_text(old)
    one, two, three = old.split("# T")
    expected = "# T".join([one, two.replace("old", "new", 1), three.replace("old", "new\n    examples\n    scenes")])
    assert transcripts.replayed(page, program, tmp_path) == (expected, ["absent"])
