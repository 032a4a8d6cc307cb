"""The examples that help() shows run as they are printed."""

import inspect
import re
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

import etendue as et
from docstring_examples import examples_of
from test_docs import ROOT, public_names

matplotlib.use("Agg")

EXAMPLES = [(name, i, code) for name, value in public_names() for i, code in enumerate(examples_of(value))]
# Of the machine, and of what is not installed everywhere.
NOT_RUN = {"etendue.limit_memory", "etendue.denoise", "etendue.Result.denoised"}


def quick(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same function with fewer samples and less time."""

    def call(*arguments: Any, **limits: Any) -> Any:
        for name, most in ("spp", 16), ("reference_spp", 32), ("time", 0.1):
            if name in limits:
                limits[name] = min(limits[name], most)
        return function(*arguments, **limits)

    return call


@pytest.fixture
def names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What examples take for granted, in a folder of their own: small scenes, images, and renderings of them."""
    monkeypatch.chdir(tmp_path)
    scenes = tmp_path / "scenes"
    scenes.mkdir()
    for file in (ROOT / "scenes").glob("*.xml"):
        text = re.sub(r'(name="(?:width|height)" value=")\d+', r"\g<1>16", file.read_text())
        (scenes / file.name).write_text(text)
    sensors = "".join(f'<sensor type="perspective" id="{name}"/>' for name in ("left", "right"))
    (scenes / "stereo.xml").write_text(f'<scene version="3.0.0">{sensors}<emitter type="constant"/></scene>')
    for name in "render", "render_sensors", "resume", "start", "compare", "verify":
        monkeypatch.setattr(et, name, quick(getattr(et, name)))
    description = et.load("scenes/cornell.xml")
    scene = description.build(resolution=(16, 12))

    def render(seed: int) -> et.Result:
        return et.render(scene, "path", spp=8, seed=seed, progress=False)

    first, second = render(0), render(1)
    mitsuba = tmp_path / "mitsuba"
    for folder, number in (mitsuba, 8), (tmp_path / "ours", 16):
        for seed in range(8):
            et.write_image(folder / f"{seed}.exr", render(seed + number))
    et.write_image("a.exr", first)
    et.write_image("albedo.exr", first)
    first.save("night.etd")
    second.save("other.etd")
    rng = np.random.default_rng(1)
    return {
        "et": et, "np": np, "plt": plt, "description": description, "scene": scene, "result": first, "image": first.image,
        "reference": second.image, "first": first, "second": second, "ours": [render(seed).image for seed in range(8)],
        "origins": np.full((5, 3), (0, 1, 0.5)), "directions": rng.normal(size=(5, 3)), "to_sun": np.array((0, 1, 0.5)),
        "vertices": np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)]), "faces": np.array([(0, 1, 2)]),
        "uvs": np.array([(0, 0), (1, 0), (0, 1)]), "pixels": rng.random((4, 4, 3)), "__name__": "example",
    }


@pytest.mark.parametrize("name, number, code", EXAMPLES, ids=[f"{name}-{i}" for name, i, _ in EXAMPLES])
def test_an_example_runs(name: str, number: int, code: str, names: dict[str, Any]) -> None:
    compiled = compile(textwrap.dedent(code), f"<example of {name}>", "exec")
    if "report." in code and "report =" not in code:
        names["report"] = et.compare(names["scene"], ["path", "bdpt"], spp=2)
    if name not in NOT_RUN:
        exec(compiled, names)


def test_functions_and_main_classes_have_examples() -> None:
    have = {name for name, _, _ in EXAMPLES}
    functions = {f"etendue.{name}" for name in et.__all__ if inspect.isfunction(getattr(et, name))}
    classes = {f"etendue.{name}" for name in ("Description", "CompareReport", "RayHits", "Bsdfs", "RenderError", "Job", "Integrator")}
    assert functions | classes <= have, (functions | classes) - have
