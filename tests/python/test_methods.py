"""Integrators by name, as texts and as dicts."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import etendue as et


def test_keywords_make_the_text() -> None:
    assert et.integrator("path") == "path"
    assert et.integrator("upg+bdpt", max_depth=np.int32(12)) == "upg+bdpt:max_depth=12"
    text = et.integrator("upg", radius=1e-5, max_depth=8)
    assert text == "upg:radius=1e-05,max_depth=8"
    assert et.integrator("pm", radius=np.float32(0.5)) == "pm:radius=0.5"
    assert et.integrator("path:max_depth=3", rr_depth=2) == "path:max_depth=3,rr_depth=2"


@pytest.mark.parametrize(
    "name, parameters, error, message",
    [
        ("pth", {}, RuntimeError, 'did you mean "path"?'),
        ("path", {"max_dept": 8}, RuntimeError, 'integrator "path" has no parameter "max_dept" (did you mean "max_depth"?)'),
        ("path", {"max_depth": 8.5}, RuntimeError, 'parameter "max_depth" must be an integer, but is "8.5"'),
        ("path", {"max_depth": [8]}, TypeError, 'parameter "max_depth" must be a number, a text or a boolean, but is [8]'),
        ("path", {"max_depth": "8,rr_depth=3"}, ValueError, "must be a text without commas"),
        ("path", {"max_depth": ""}, ValueError, "must be a text without commas that is not empty"),
        ("path", {"max_depth": None}, TypeError, "but is None"),
    ])
def test_wrong_parameters_say_what_is_near(name: str, parameters: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=re.escape(message)):
        et.integrator(name, **parameters)
    with pytest.raises(error, match=re.escape(message)):
        et.core.counts(et.load_dict({"type": "scene", "sensor": {"type": "perspective"}, "light": {"type": "constant"}}).build(),
                       {"type": name, **parameters})


def test_dicts_mean_what_texts_mean(cornell: et.Scene, tmp_path: Path) -> None:
    as_text, as_dict = "bdpt:max_depth=3", {"type": "bdpt", "max_depth": 3}
    expected = et.render(cornell, as_text, spp=2, progress=False)
    found = et.render(cornell, as_dict, spp=2, progress=False)
    np.testing.assert_array_equal(found.image, expected.image)
    assert found.stats["integrator"] == expected.stats["integrator"] == as_text
    assert as_dict == {"type": "bdpt", "max_depth": 3}
    report = et.compare(cornell, [as_dict, "path"], spp=1, reference_spp=2, references=tmp_path, techniques=0, progress=False,
                        reference_method={"type": "path"})
    assert [m["name"] for m in report.data[0]["methods"]] == [as_text, "path"]
    verified = et.verify(cornell, {"type": "bdpt"}, spp=1, runs=8, lengths=(1, 2), progress=False)
    assert list(verified.verdicts) == ["bdpt"]
    assert str(et.core.counts(cornell, as_dict)) == str(et.core.counts(cornell, as_text))


def test_what_is_no_integrator(cornell: et.Scene) -> None:
    for wrong in ({}, {"max_depth": 3}, {"type": 3}):
        with pytest.raises(ValueError, match='an integrator as a dict needs a "type"'):
            et.render(cornell, wrong)
    for other in (3, ["path"]):
        with pytest.raises(TypeError, match="an integrator is a text such as"):
            et.render(cornell, other)  # type: ignore[arg-type]


def test_auto_tells_what_it_has_chosen(cornell: et.Scene) -> None:
    result = et.render(cornell, "auto:chains=false", spp=128, progress=False)
    auto = result.stats["auto"]
    assert auto["asked"].startswith("auto:chains=false") and auto["chosen"] == result.stats["integrator"]
    assert auto["candidates"][0]["method"] == auto["chosen"]
    assert result.seconds >= auto["seconds"] > 0
    given = et.render(cornell, auto["chosen"], spp=128, progress=False)
    np.testing.assert_array_equal(given.image, result.image)
    assert "auto" not in given.stats


def test_a_choice_is_kept_in_checkpoints(cornell: et.Scene, tmp_path: Path) -> None:
    first = et.render(cornell, et.integrator("auto", chains=False), spp=128, progress=False)
    first.save(tmp_path / "a.etd")
    resumed = et.resume(tmp_path / "a.etd", cornell, spp=130, progress=False)
    assert resumed.stats["auto"] == first.stats["auto"]


def test_a_rendering_that_goes_on_does_not_choose_again(scenes: Path, tmp_path: Path) -> None:
    scene = et.load(scenes / "cornell.xml").build(resolution=(64, 64))
    first = et.render(scene, "auto:chains=false", spp=4000, callback=lambda p: p.passes < 3, progress=False)
    assert first.stats["auto"]["pilots"] > 0
    first.save(tmp_path / "a.etd")
    # For so short a rendering, there would be no pilots.
    for integrator in "auto:chains=false", None:
        resumed = et.resume(tmp_path / "a.etd", scene, integrator, spp=first.passes + 1, progress=False)  # type: ignore[arg-type]
        assert resumed.stats["auto"] == first.stats["auto"]
    with pytest.raises(RuntimeError, match="chains=false"):
        et.resume(tmp_path / "a.etd", scene, "auto", spp=10, progress=False)  # type: ignore[arg-type]


def test_scenes_without_integrator_are_rendered_by_auto() -> None:
    scene = {"type": "scene", "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 8, "height": 6}},
             "light": {"type": "constant"}, "ball": {"type": "sphere", "center": [0, 0, 3]}}
    result = et.render(scene, spp=2, progress=False)
    assert result.stats["auto"]["chosen"] == result.stats["integrator"]
    assert "auto" not in et.render(scene | {"integrator": {"type": "path"}}, spp=2, progress=False).stats
