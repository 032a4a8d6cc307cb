"""Transcripts of a terminal in the manual, and their commands run again.

A transcript is a block of code whose lines begin with `$ `, each followed by what it prints. All commands of a page are run by one
shell. A heading begins an empty folder, with links to the project's scenes/ and examples/."""

import difflib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import one_machine_slurm

ROOT = Path(__file__).resolve().parents[2]
INDENT = "    "
MARK = "@@ transcript"
# What a command needs, by a word of it.
PROGRAMS = {"sbatch": one_machine_slurm.PROGRAMS, "parallel": ("parallel",), "mpirun": ("mpirun",)}
PACKAGES = {"dask_cluster": "dask.distributed", "ray_cluster": "ray", "mpi_cluster": "mpi4py"}


@dataclass
class Command:
    text: str
    printed: list[str] = field(default_factory=list)


@dataclass
class Block:
    begin: int
    """Index of its first line in the page."""
    commands: list[Command] = field(default_factory=list)
    begins_folder: bool = False
    end: int = 0

    def lines(self) -> list[str]:
        return [INDENT + line for c in self.commands for line in (f"$ {c.text}", *c.printed)]


def pages() -> list[Path]:
    """Those with transcripts."""
    return sorted(page for page in (ROOT / "docs").glob("**/*.md") if blocks_of(page.read_text().splitlines()))


def blocks_of(lines: list[str]) -> list[Block]:
    found: list[Block] = []
    is_inside, is_new = False, True
    for number, line in enumerate(lines):
        if line.startswith("#"):
            is_new = True
        if line.startswith(f"{INDENT}$ "):
            if not is_inside:
                found.append(Block(number, begins_folder=is_new))
                is_inside, is_new = True, False
            found[-1].commands.append(Command(line[len(INDENT) + 2:]))
        elif is_inside and line.startswith(INDENT):
            found[-1].commands[-1].printed.append(line[len(INDENT):])
        else:
            is_inside = False
        if is_inside:
            found[-1].end = number + 1
    return found


def missing(block: Block, program: str, where: Callable[[str], str | None]) -> list[str]:
    """Programs and packages that its commands need and that are not here."""
    if any(re.search(r"mpirun .*etendue ", c.text) for c in block.commands) and not has_mpi(program):
        return ["etendue with MPI"]
    words = {word for c in block.commands for word in re.findall(r"\w+", c.text)}
    programs = [p for word in PROGRAMS.keys() & words for p in PROGRAMS[word] if not where(p)]
    return programs + [p for word in PACKAGES.keys() & words for p in [PACKAGES[word]] if not is_package(p)]


def has_mpi(program: str) -> bool:
    return "libmpi" in subprocess.run(["ldd", program], capture_output=True, text=True, check=True).stdout


def is_package(name: str) -> bool:
    return importlib.util.find_spec(name.split(".")[0]) is not None


def place_of(program: str) -> str | None:
    """A program, which may be one for administrators."""
    return shutil.which(program, path=os.environ["PATH"] + ":/usr/local/sbin:/usr/sbin:/sbin")


def run(blocks: list[Block], program: str, folder: Path) -> None:
    """Replaces what the commands print."""
    (folder / "bin").mkdir()
    (folder / "bin" / "etendue").symlink_to(program)
    script = ["exec 2>&1 </dev/null"]
    number = 0
    for block in blocks:
        if block.begins_folder:
            here = folder / f"{block.begin}"
            here.mkdir()
            for name in ("scenes", "examples"):
                (here / name).symlink_to(ROOT / name)
            script.append(f"cd {here}")
        for c in block.commands:
            script += [f"echo; echo '{MARK} {number}'", c.text, 'echo; echo "$?"']
            if re.match(r".*\bsbatch\b", c.text):
                script.append("while [[ $(squeue --noheader) ]]; do sleep 0.2; done >/dev/null")
            number += 1
    environment = os.environ | {
        "PATH": f"{folder / 'bin'}:{Path(sys.executable).parent}:{os.environ['PATH']}",
        "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1",
    }
    text = subprocess.run(["bash", "-c", "\n".join(script)], env=environment, stdout=subprocess.PIPE, text=True, timeout=1200).stdout
    parts = re.split(rf"^{MARK} \d+\n", text, flags=re.MULTILINE)[1:]
    commands = [c for block in blocks for c in block.commands]
    assert len(parts) == len(commands), text
    for c, part in zip(commands, parts, strict=True):
        *printed, status = part.rstrip("\n").splitlines()
        c.printed = "\n".join(printed).rstrip("\n").splitlines()
        # The manual shows messages of the program, but no other failures.
        assert status == "0" or (c.printed or [""])[-1].startswith("etendue: "), f"$ {c.text}\n{part}"


def replayed(page: Path, program: str, folder: Path) -> tuple[str, list[str]]:
    """The page with what its commands print here, and what was missing for some of them, which are left as they are
    with those that follow in their folder."""
    lines = page.read_text().splitlines()
    blocks, absent, is_left = [], set(), False
    for block in blocks_of(lines):
        lacks = missing(block, program, place_of)
        absent.update(lacks)
        # Those that follow it need its folder, and what it leaves there.
        is_left = bool(lacks) or (is_left and not block.begins_folder)
        if not is_left:
            blocks.append(block)
    with ExitStack() as stack:
        if any("sbatch" in c.text for block in blocks for c in block.commands):
            stack.enter_context(one_machine_slurm.running({p: str(place_of(p)) for p in one_machine_slurm.PROGRAMS}))
        run(blocks, program, folder)
    for block in reversed(blocks):
        lines[block.begin:block.end] = block.lines()
    return "\n".join(lines) + "\n", sorted(absent)


def without_times(page: str) -> list[str]:
    """Its lines without what differs from run to run, or with the build and the machine."""
    kept = []
    for line in page.splitlines():
        if re.match(r" +\d+ spp, .* s, \d+ %", line):
            continue  # Progress: which passes are shown depends on the time, and the last line of a rendering tells the rest.
        line = re.sub(r"\b\d+(\.\d+)? s\b", "# s", line)
        line = re.sub(r"\b\d+(\.\d+)? (M(samples|rays)/s)", r"# \2", line)
        line = re.sub(r"^( +(build|C library|ray tracer|processor) +)\S.*", r"\1#", line)
        kept.append(line)
    return kept


def what_bits_depend_on(page: str) -> list[str]:
    """Libraries and processor, as info prints them."""
    return re.findall(r"^ +(?:C library|ray tracer|processor) +.*$", page, re.MULTILINE)


def difference(old: str, new: str) -> str:
    """What is not the same, apart from times. Numbers with decimals may differ by 2 % where libraries or processors do, on which
    last bits depend."""
    a, b = without_times(old), without_times(new)
    if what_bits_depend_on(old) != what_bits_depend_on(new):
        a, b = like(a, b)
    return "\n".join(difflib.unified_diff(a, b, "manual", "here", n=1, lineterm=""))


def like(a: list[str], b: list[str]) -> tuple[list[str], list[str]]:
    number = re.compile(r"\d+\.\d+")
    bits = re.compile(r"^( +bits of the sums +).*")
    a, b = ([bits.sub(r"\1#", line) for line in lines] for lines in (a, b))
    if len(a) != len(b):
        return a, b
    for i, (old, new) in enumerate(zip(a, b, strict=True)):
        pairs = list(zip(map(float, number.findall(old)), map(float, number.findall(new)), strict=False))
        if number.sub("#", old) == number.sub("#", new) and all(abs(x - y) <= 0.02 * abs(x) for x, y in pairs):
            b[i] = old
    return a, b
