"""Comparison, verification, image errors, tone mapping, notebooks."""

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import etendue as et
from conftest import Hits


@pytest.fixture(scope="module")
def comparison(cornell: et.Scene, tmp_path_factory: pytest.TempPathFactory) -> et.CompareReport:
    folder = tmp_path_factory.mktemp("references")
    return et.compare(cornell, ["path", "bdpt"], spp=4, runs=2, references=folder)


def test_compare_has_the_figures_of_the_command_line(
        program: str, scenes: Path, tmp_path: Path, comparison: et.CompareReport) -> None:
    subprocess.run([program, "compare", str(scenes / "cornell.xml"), "--resolution", "32x24", "-m", "path", "bdpt", "--spp",
                    "4", "--runs", "2", "--references", str(tmp_path / "r"), "--report", str(tmp_path / "report"), "--quiet"],
                   check=True)
    expected = json.loads((tmp_path / "report" / "report.json").read_text())["scenes"][0]
    for mine, other in zip(comparison.data[0]["methods"], expected["methods"], strict=True):
        assert mine["name"] == other["name"] and mine["flip"] == other["flip"]
        for key in ("spp", "rel_mse", "rmse", "mean_ratio"):
            assert mine["summary"][key] == other["summary"][key]


def test_the_report_of_a_comparison(comparison: et.CompareReport, tmp_path: Path) -> None:
    frame = comparison.frame()
    assert list(frame["method"]) == ["path", "bdpt"] and (frame["rel_mse"] > 0).all()
    assert len(comparison.convergence()) == 2 * 2 * 3  # methods, runs, checkpoints at 1, 2, 4 samples
    assert comparison.image(1).shape == (24, 32, 3) and comparison.flip_map(1).shape == (24, 32)
    assert comparison.reference().shape == (24, 32, 3)
    comparison.save(tmp_path / "report")
    assert (tmp_path / "report" / "report.html").exists()
    assert "<table>" in comparison._repr_html_() and "data:image/png" in comparison._repr_html_()


def test_compare_takes_integrators_in_python(scenes: Path, tmp_path: Path) -> None:
    scene = et.load(scenes / "cornell.xml").build(resolution=(8, 8))
    report = et.compare(scene, ["path:max_depth=3", Hits()], spp=2, references=tmp_path, reference_spp=64)
    assert [m["name"] for m in report.data[0]["methods"]] == ["path:max_depth=3", "Hits"]
    report = et.compare(scene, ["path:max_depth=3"], spp=64, references=tmp_path, reference_spp=64,
                        reference_method=Hits())
    np.testing.assert_allclose(report.reference().mean(), report.image(0).mean(), rtol=0.3)


def test_verify_has_the_figures_of_the_command_line(program: str, scenes: Path, tmp_path: Path) -> None:
    command = [program, "verify", str(scenes / "cornell.xml"), "--resolution", "16x16", "--methods", "bdpt", "--lengths",
               "1..3", "--spp", "4", "--runs", "8", "--json", str(tmp_path / "v.json"), "--quiet"]
    subprocess.run(command, check=True)
    scene = et.load(scenes / "cornell.xml").build(resolution=(16, 16))
    report = et.verify(scene, "bdpt", spp=4, runs=8, lengths=(1, 3))
    assert report.data == json.loads((tmp_path / "v.json").read_text())
    assert report.verdicts == {"bdpt": "agrees"}
    assert list(report.frame()["verdict"]) == ["agrees"] and len(report.lengths()) == 3
    report.save(tmp_path / "out")
    assert (tmp_path / "out" / "verify.html").exists()


@pytest.mark.parametrize(
    "arguments, message",
    [({"runs": 2}, "runs must lie between 8"), ({"tiles": 0}, "tiles must lie"), ({"alpha": 2.0}, "alpha must lie"),
     ({"detect": 2.0}, "detect must be a share"), ({"lengths": (3, 2)}, "lengths must be"),
     ({"methods": "bdp"}, 'there is no integrator "bdp"'), ({"spp": 1, "time": 1.0}, "exclude each other"),
     ({"spp": 0}, "time and spp must be above 0"), ({"threads": -1}, "threads must lie between 0 and 4096, but is -1")])
def test_wrong_arguments_of_verify(cornell: et.Scene, arguments: dict[str, object], message: str) -> None:
    with pytest.raises((RuntimeError, ValueError), match=message):
        et.verify(cornell, **{"methods": "path", **arguments})  # type: ignore[arg-type]


def test_wrong_arguments_of_compare(cornell: et.Scene) -> None:
    with pytest.raises(ValueError, match="give either time, in seconds, or spp"):
        et.compare(cornell, ["path"])
    with pytest.raises(RuntimeError, match="given twice"):
        et.compare(cornell, ["path", "path"], spp=1)
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"spp": 0}, "must be above 0"), ({"spp": 1, "reference_spp": 0}, "must be above 0"),
        ({"spp": 1, "runs": 0}, "runs must lie between 1 and 10000, but is 0"),
        ({"spp": 1, "techniques": 17}, "techniques must lie between 0 and 16, but is 17"),
        ({"spp": 1, "threads": 5000}, "threads must lie between 0 and 4096, but is 5000")]
    for arguments, message in wrong:
        with pytest.raises(ValueError, match=message):
            et.compare(cornell, ["path"], **arguments)


def test_compare_refuses_what_does_not_go_together(cornell: et.Scene) -> None:
    for more in ({"reference_time": 1.0}, {"reference_spp": 2}, {"reference_method": "path"}):
        with pytest.raises(ValueError, match="reference excludes reference_method"):
            et.compare(cornell, ["path"], spp=1, reference="missing.exr", progress=False, **more)  # type: ignore[arg-type]
    for lengths in ((3, 1), (0, 2), (-1, None)):
        with pytest.raises(ValueError, match="lengths must be"):
            et.compare(cornell, ["path"], spp=1, lengths=lengths, progress=False)


def test_diff_has_the_figures_of_the_command_line(program: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    a, b = (rng.random((20, 30, 3), dtype=np.float32) for _ in range(2))
    et.write_image(tmp_path / "a.exr", a)
    et.write_image(tmp_path / "b.exr", b)
    printed = subprocess.run([program, "diff", str(tmp_path / "a.exr"), str(tmp_path / "b.exr"), "--json"],
                             capture_output=True, check=True).stdout
    expected = {k: v for k, v in json.loads(printed).items() if k not in ("image", "reference")}
    result = et.diff(a, b)
    assert dict(result) == pytest.approx(expected, rel=1e-6)
    assert dict(et.diff(tmp_path / "a.exr", tmp_path / "b.exr")) == dict(result)
    assert result.flip_map is not None and result.flip_map.shape == (20, 30)
    assert result.rel_se_map.shape == (20, 30)
    with pytest.raises(ValueError, match="differ in size"):
        et.diff(a, b[:10])


@pytest.mark.parametrize("operator", ["aces", "reinhard", "srgb"])
def test_tonemap_has_the_codes_of_the_command_line(program: str, tmp_path: Path, operator: str) -> None:
    from PIL import Image

    image = np.random.default_rng(2).exponential(size=(20, 30, 3)).astype(np.float32)
    et.write_image(tmp_path / "a.exr", image)
    subprocess.run([program, "tonemap", str(tmp_path / "a.exr"), str(tmp_path / "a.png"), "--operator", operator,
                    "--exposure", "0.5"], check=True)
    expected = np.asarray(Image.open(tmp_path / "a.png"))
    np.testing.assert_array_equal(et.tonemap(image, operator, exposure=0.5), expected)  # type: ignore[arg-type]


def test_images_survive_files(tmp_path: Path) -> None:
    image = np.random.default_rng(3).exponential(size=(5, 40, 3)).astype(np.float32)
    for name, tolerance in [("a.exr", 0), ("a.pfm", 0), ("a.hdr", 1 / 128)]:
        et.write_image(tmp_path / name, image)
        np.testing.assert_allclose(et.read_image(tmp_path / name), image, rtol=0,
                                   atol=tolerance * float(image.max(axis=2).max()))
    codes = et.tonemap(image)
    et.write_image(tmp_path / "a.png", codes)
    from PIL import Image

    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "a.png")), codes)
    with pytest.raises(ValueError, match="as .png only"):
        et.write_image(tmp_path / "a.exr", codes)
    with pytest.raises(RuntimeError, match="must end in .exr"):
        et.write_image(tmp_path / "a.gif", image)


def test_results_show_themselves_in_notebooks(cornell: et.Scene) -> None:
    result = et.render(cornell, spp=2)
    assert result._repr_png_().startswith(b"\x89PNG")
    assert ": 2 spp in" in result._repr_html_()
    assert "stopped by samples" in repr(result)
    widget = et.show(result)
    half = np.frombuffer(widget.pixels, dtype="<f2").reshape(24, 32, 3)
    np.testing.assert_allclose(half, result.image, rtol=1e-3, atol=1e-6)
    assert (widget.width, widget.height) == (32, 24)


def test_without_anywidget_a_picture_is_shown(cornell: et.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "anywidget", None)
    assert et.show(et.render(cornell, spp=1))._repr_png_().startswith(b"\x89PNG")


def test_without_pandas_frames_are_dicts(
        comparison: et.CompareReport, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "pandas", None)
    assert [row["method"] for row in comparison.frame()] == ["path", "bdpt"]


def test_the_viewer_maps_tones_as_the_library_does(tmp_path: Path) -> None:
    import shutil

    node = shutil.which("node")
    if node is None:
        pytest.skip("there is no node")
    image = np.random.default_rng(4).exponential(size=(4, 5, 3)).astype(np.float32)
    source = Path(et.__file__).with_name("_viewer.js").read_text()
    (tmp_path / "viewer.mjs").write_text(source)
    (tmp_path / "run.mjs").write_text(
        "import { toneMapped } from './viewer.mjs';\n"
        f"const rgb = Float32Array.from({json.dumps(image.ravel().tolist())});\n"
        "console.log(JSON.stringify(['aces', 'reinhard', 'srgb'].map(o => Array.from(toneMapped(rgb, 0.5, o)))));\n")
    printed = subprocess.run([node, str(tmp_path / "run.mjs")], capture_output=True, check=True, text=True).stdout
    for name, codes in zip(["aces", "reinhard", "srgb"], json.loads(printed), strict=True):
        mine = np.array(codes).reshape(4, 5, 4)[:, :, :3]
        expected = et.tonemap(image, name, exposure=0.5).astype(int)  # type: ignore[arg-type]
        assert np.abs(mine - expected).max() <= 1


def test_convergence_is_plotted(cornell: et.Scene) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    result = et.render(cornell, "bdpt", spp=64, progress=False)
    axes = result.plot_convergence()
    times, errors = axes.lines[0].get_data()
    assert 1 < len(times) < 64 and (np.diff(times) > 0).all()
    assert errors[-1] == pytest.approx(result.error) and times[-1] == pytest.approx(result.seconds)
    assert axes.get_xscale() == axes.get_yscale() == "log" and axes.get_legend().texts[0].get_text().startswith("bdpt")
    given = pyplot.figure().add_subplot()
    assert et.render(cornell, "path", spp=16, progress=False).plot_convergence(given) is given
    with pytest.raises(RuntimeError, match="the error is not known after 1 spp"):
        et.render(cornell, "path", spp=1, progress=False).plot_convergence()
    with pytest.raises(RuntimeError, match="merged results have no errors of fewer passes"):
        et.merge([result]).plot_convergence()
    with pytest.raises(TypeError, match="ax must be the Axes of a figure, but is str"):
        result.plot_convergence("right")
    pyplot.close("all")


def test_comparisons_are_plotted(comparison: et.CompareReport) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    axes = comparison.plot()
    assert [t.get_text() for t in axes.get_legend().texts] == ["path", "bdpt"]
    method = comparison.data[0]["methods"][1]
    last = [np.mean([run["checkpoints"][-1]["seconds"] for run in method["runs"]]),
            np.mean([run["checkpoints"][-1]["errors"]["rel_mse"] for run in method["runs"]])]
    np.testing.assert_allclose(np.array(axes.lines[1].get_data())[:, -1], last)
    assert comparison.plot(axes, x="spp", y="rmse") is axes and axes.get_xlabel() == "samples per pixel"
    with pytest.raises(ValueError, match=r'x must be "seconds" or "spp", but is \'time\''):
        comparison.plot(x="time")
    with pytest.raises(IndexError, match="there is no scene 7"):
        comparison.plot(scene=7)
    pyplot.close("all")


def test_plots_without_matplotlib_say_what_is_missing(comparison: et.CompareReport, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError, match="plots need matplotlib: pip install matplotlib"):
        comparison.plot()


def test_results_are_arrays_for_numpy(cornell: et.Scene) -> None:
    result = et.render(cornell, "path", spp=2, progress=False)
    assert np.asarray(result) is result.image
    copy = np.array(result)
    assert copy is not result.image and not np.shares_memory(copy, result.image)
    np.testing.assert_array_equal(copy, result.image)
    doubles = np.asarray(result, dtype=np.float64)
    assert doubles.dtype == np.float64
    np.testing.assert_array_equal(doubles, result.image)
    assert np.mean(result) == result.image.mean()
    with pytest.raises(ValueError, match="as float64 it has to be copied"):
        result.__array__(np.float64, copy=False)


def test_images_of_other_programs_are_verified(cornell: et.Scene, tmp_path: Path) -> None:
    def images(first: int) -> list[np.ndarray]:
        return [et.render(cornell, spp=64, seed=first + i, sampler="independent", progress=False).image for i in range(8)]

    ours, others = images(1), images(101)
    report = et.verify_images(ours, others, tiles=2)
    assert list(report.verdicts.values()) == ["agrees"]
    assert "agrees" in repr(report) and "claims" not in repr(report)
    row = report._rows()[0]
    assert 0 < row["detectable"] < 0.3 and abs(row["image_ratio"] - 1) < row["detectable"]
    (tmp_path / "folder").mkdir()
    for i, image in enumerate(others):
        et.write_image(tmp_path / "folder" / f"{i}.exr", np.minimum(image, 0.3))
    assert list(et.verify_images(ours, tmp_path / "folder", tiles=2).verdicts.values()) == ["deviates"]


def test_images_that_cannot_be_verified() -> None:
    good = [np.full((4, 4, 3), 1 + 0.01 * i, np.float32) for i in range(4)]
    other = [2 * image for image in good]
    with pytest.raises(RuntimeError, match=r"images\[0\]: expected at least two independent images"):
        et.verify_images(good[:1], other)
    with pytest.raises(RuntimeError, match=r"has the same pixels as"):
        et.verify_images(good, good)
    with pytest.raises(RuntimeError, match=r"against\[1\]: pixel \(0, 0\) is \(nan"):
        et.verify_images(good, [other[0], np.full((4, 4, 3), np.nan)])
    with pytest.raises(RuntimeError, match="there is no such file or folder"):
        et.verify_images(good, "none")
    with pytest.raises(ValueError, match="shape"):
        et.verify_images(good, [np.zeros((4, 4, 2))] * 2)
    with pytest.raises(ValueError, match="tiles"):
        et.verify_images(good, other, tiles=0)


def test_compare_shows_images_of_other_programs(cornell: et.Scene, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    for i in range(3):
        image = et.render(cornell, spp=4 << i, seed=i + 7, progress=False).image
        et.write_image(tmp_path / "other" / f"{4 << i}spp-{2 ** i}s.exr", image)
    report = et.compare(
        cornell, ["path"], spp=4, reference_spp=32, references=tmp_path, techniques=0, progress=False,
        images={"other": tmp_path / "other"},
    )
    row = report._rows()[1]
    assert (row["method"], row["spp"], row["seconds"]) == ("other", 16, 4)
    assert report.image(1).shape == report.reference().shape
    (tmp_path / "empty").mkdir()
    with pytest.raises(RuntimeError, match="no .exr or .pfm file"):
        et.compare(cornell, ["path"], spp=1, images={"x": tmp_path / "empty"}, progress=False)
