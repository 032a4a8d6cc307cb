"""Renderings that go on from files, and sums of several."""

import json
import pickle
import subprocess
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import etendue as et
from conftest import Hits

METHODS = ["path", "bdpt:max_depth=5", "upg+bdpt", "vcm", "mlt:groups=4,chains=48"]


@pytest.mark.parametrize("method", METHODS)
def test_a_rendering_goes_on_with_the_same_bits(cornell: et.Scene, tmp_path: Path, method: str) -> None:
    whole = et.render(cornell, method, spp=7, techniques=3, progress=False)
    et.render(cornell, method, spp=3, techniques=3, progress=False).save(tmp_path / "a.etd")
    resumed = et.resume(tmp_path / "a.etd", cornell, spp=7, threads=1, progress=False)
    np.testing.assert_array_equal(resumed.image, whole.image)
    np.testing.assert_array_equal(resumed.variance, whole.variance)
    assert resumed.error == whole.error and resumed.passes == 7
    assert len(resumed.stats["pass_seconds"]) == 7
    for a, b in zip(resumed.techniques, whole.techniques, strict=True):
        np.testing.assert_array_equal(a.weighted, b.weighted)


def test_callbacks_save_the_state_so_far(cornell: et.Scene, tmp_path: Path) -> None:
    def save(p: et.Progress) -> None:
        if p.passes == 2:
            p.save(tmp_path / "a.etd")

    whole = et.render(cornell, "bdpt", spp=5, callback=save, progress=False)
    resumed = et.resume(tmp_path / "a.etd", cornell, spp=5, progress=False)
    np.testing.assert_array_equal(resumed.image, whole.image)
    with pytest.raises(ValueError, match=r"\.etd"):
        et.render(cornell, "path", spp=1, callback=lambda p: p.save(tmp_path / "a.exr"), progress=False)


def test_what_would_change_bits_is_refused(cornell: et.Scene, demo: et.Scene, tmp_path: Path) -> None:
    et.render(cornell, "bdpt", spp=1, progress=False).save(tmp_path / "a.etd")
    with pytest.raises(RuntimeError, match="scene contents"):
        et.resume(tmp_path / "a.etd", demo, spp=2)
    with pytest.raises(RuntimeError, match="no state of a rendering"):
        (tmp_path / "b.etd").write_text("<scene/>")
        et.resume(tmp_path / "b.etd", cornell, spp=2)
    with pytest.raises(RuntimeError, match="missing.etd"):
        et.resume(tmp_path / "missing.etd", cornell, spp=2)
    with pytest.raises(ValueError, match="spp must lie between 0 and"):
        et.resume(tmp_path / "a.etd", cornell, spp=-1)


def test_a_sum_does_not_replace_its_parts(cornell: et.Scene, tmp_path: Path) -> None:
    parts = [tmp_path / "a.etd", tmp_path / "b.etd"]
    for seed, part in enumerate(parts):
        et.render(cornell, "path", spp=2, seed=seed, progress=False).save(part)
    with pytest.raises(RuntimeError, match="one of the parts"):
        et.merge(parts).save(tmp_path / "." / "b.etd")
    assert et.resume(parts[1], cornell, spp=3, progress=False).passes == 3
    et.merge(parts).save(tmp_path / "sum.etd")


def test_nor_from_another_working_folder(cornell: et.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    part = tmp_path / "a.etd"
    et.render(cornell, "path", spp=2, progress=False).save(part)
    monkeypatch.chdir(tmp_path)
    merged = et.merge(["a.etd"])
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    with pytest.raises(RuntimeError, match="one of the parts"):
        merged.save(part)
    assert et.resume(part, cornell, spp=3, progress=False).passes == 3
    merged.save("a.etd")


def test_files_that_change_after_a_scene_was_built_do_not_count(tmp_path: Path) -> None:
    mesh = tmp_path / "mesh.obj"
    mesh.write_text("v -1 -1 0\nv 1 -1 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "scene.xml").write_text(
        '<scene version="3.0.0"><sensor type="perspective"><transform name="to_world">'
        '<lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform></sensor><emitter type="constant"/>'
        '<shape type="obj"><string name="filename" value="mesh.obj"/></shape></scene>'
    )
    scene = et.load(tmp_path / "scene.xml").build(resolution=(8, 8))
    mesh.write_text("v -1 -1 0\nv 1 -1 0\nv 0 2 0\nf 1 2 3\n")
    et.render(scene, "path", spp=1, progress=False).save(tmp_path / "a.etd")
    other = et.load(tmp_path / "scene.xml").build(resolution=(8, 8))
    with pytest.raises(RuntimeError, match="scene contents"):
        et.resume(tmp_path / "a.etd", other, spp=2)
    assert et.resume(tmp_path / "a.etd", scene, spp=2, progress=False).passes == 2


@pytest.mark.parametrize("method", ["bdpt", "mlt:groups=4,chains=48"])
def test_merged_results_do_not_depend_on_their_order(cornell: et.Scene, tmp_path: Path, method: str) -> None:
    results = [et.render(cornell, method, spp=12, seed=s, techniques=3, progress=False) for s in range(3)]
    results[1].save(tmp_path / "1.etd")
    a = et.merge(results)
    b = et.merge([results[2].partial(), tmp_path / "1.etd", results[0]])
    np.testing.assert_array_equal(a.image, b.image)
    np.testing.assert_array_equal(a.half_width, b.half_width)
    assert a.error == b.error and a.error is not None and a.error_interval == b.error_interval
    assert a.passes == 36 and a.stopped_by == "merged"
    sums = sum(r.film.sums for r in results)
    np.testing.assert_allclose(a.film.sums, sums, rtol=1e-12)
    assert a.stats["walk_rays"] == sum(r.stats["walk_rays"] for r in results)
    assert len(a.techniques) == len(results[0].techniques)
    a.save(tmp_path / "sum.exr")
    np.testing.assert_array_equal(et.read_image(tmp_path / "sum.exr"), a.image)
    a.save(tmp_path / "sum.etd")
    np.testing.assert_array_equal(et.merge([tmp_path / "sum.etd"]).image, a.image)
    with pytest.raises(RuntimeError, match="sum of several"):
        et.resume(tmp_path / "sum.etd", cornell, spp=100)
    with pytest.raises(RuntimeError, match="share passes"):
        et.merge([a, results[1]])
    with pytest.raises(RuntimeError, match="no scene"):
        _ = a.scene
    with pytest.raises(ValueError, match="no parts"):
        et.merge([])


def test_ranges_of_passes_make_up_a_rendering(cornell: et.Scene) -> None:
    whole = et.render(cornell, "path", spp=8, progress=False)
    parts = [et.render(cornell, "path", passes=p, progress=False) for p in [(5, 8), (0, 5)]]
    merged = et.merge(parts)
    np.testing.assert_allclose(merged.image, whole.image, rtol=1e-6)
    assert merged.passes == 8
    for wrong in [(3, 3), (-1, 2), (4, 2)]:
        with pytest.raises(ValueError, match="passes"):
            et.render(cornell, "path", passes=wrong)
    with pytest.raises(ValueError, match="passes"):
        et.render(cornell, "path", passes=(0, 2), spp=2)


def test_seeds_that_do_not_reduce_a_bias_are_a_warning(cornell: et.Scene) -> None:
    seeds = [et.render(cornell, "vcm", spp=1, seed=s, progress=False) for s in range(2)]
    with pytest.warns(UserWarning, match="several seeds"):
        et.merge(seeds)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        et.merge([et.render(cornell, "vcm", passes=p, progress=False) for p in [(0, 1), (1, 2)]])


# Pairs of renderings, and the number of standard errors beyond which 12 tiles and the whole image, or the whole image alone,
# raise a false alarm with a probability of 0.001 (two-sided t test with 15 degrees of freedom, Šidák); and the quantile 0.9.
PAIRS, ALARM_OF_13, ALARM_OF_1, POWER = 16, 5.377, 4.073, 1.341


@pytest.mark.parametrize(
    "method, passes",
    [("path", 16), ("mlt:groups=4,chains=48", 12)]
    + [pytest.param(*p, marks=pytest.mark.long)
       for p in [("upg+bdpt", 10), ("pssmlt:groups=4,chains=48", 12), ("mmlt:groups=4,chains=48", 12)]],
    ids=lambda v: str(v).split(":")[0])
def test_the_sum_of_8_runs_has_the_expectation_of_one_with_8_times_the_passes(
    cornell: et.Scene, method: str, passes: int
) -> None:
    def rendering(seed: int, spp: int) -> et.Result:
        return et.render(cornell, method, spp=spp, seed=seed, sampler="independent", progress=False)

    def tiles(result: et.Result) -> Any:
        grey = result.image.mean(axis=2, dtype=float)
        return np.append(grey.reshape(3, 8, 4, 8).mean(axis=(1, 3)), grey.mean())

    sums = [et.merge([rendering(9 * pair + run, passes) for run in range(8)]) for pair in range(PAIRS)]
    others = [rendering(9 * pair + 8, 8 * passes) for pair in range(PAIRS)]
    differences = np.array([tiles(a) - tiles(b) for a, b in zip(sums, others, strict=True)])
    standard_error = differences.std(axis=0, ddof=1) / PAIRS**0.5
    assert (np.abs(differences.mean(axis=0)) <= ALARM_OF_13 * standard_error).all()
    # A difference of the whole image that would be found with a probability of 90 %.
    found = (ALARM_OF_13 + POWER) * standard_error[-1] / tiles(sums[0])[-1]
    print(f"{method}: a difference of {100 * found:.2f} % would be found")
    assert found < 0.05

    # The variance that a sum states is that of sums.
    images = np.array([a.image for a in sums], float)
    true = ((images - images.mean(axis=0)) ** 2).sum(axis=(1, 2, 3)) * PAIRS / (PAIRS - 1)
    stated = np.array([a.variance.sum(dtype=float) for a in sums])
    excess = stated - true
    standard_error = excess.std(ddof=1) / PAIRS**0.5
    print(f"{method}: stated over true variance {stated.mean() / true.mean():.3f} ± {standard_error / true.mean():.3f}")
    assert abs(excess.mean()) <= ALARM_OF_1 * standard_error
    assert all(a.error is not None and b.error is not None for a, b in zip(sums, others, strict=True))
    print(f"{method}: error {np.mean([a.error for a in sums]):.4f}, of one run {np.mean([b.error for b in others]):.4f}")


@pytest.mark.long
@pytest.mark.parametrize(
    "method, passes",
    [("path", 1024), ("upg+bdpt", 300), ("pssmlt:groups=4,chains=48", 512), ("mmlt:groups=4,chains=48", 512),
     ("mlt:groups=4,chains=48", 512)],
    ids=lambda v: str(v).split(":")[0])
def test_verify_finds_no_difference_from_the_sum_of_8_runs(
    program: str, scenes: Path, tmp_path: Path, method: str, passes: int
) -> None:
    def run(*words: object) -> None:
        subprocess.run([program, *map(str, words), "--quiet"], cwd=tmp_path, check=True)

    scene = (scenes / "cornell.xml", "--resolution", "32x24")
    parts = [tmp_path / f"{seed}.etd" for seed in range(8)]
    for seed, part in enumerate(parts):
        run("render", *scene, "-i", method, "--spp", passes, "--seed", seed, "--checkpoint", part, "-o", "part.exr")
    run("merge", *parts, "--variance", "-o", "sum.exr")
    run("verify", *scene, "--methods", method, "--reference", "sum.exr", "--runs", 16, "--spp", passes, "--seed", 100,
        "--json", "verify.json")
    found, = json.loads((tmp_path / "verify.json").read_text())["methods"]
    assert found["verdict"] == "agrees", found
    # An error of the image, in any channel, that would be found with a probability of 90 %.
    print(f"{method}: an error of {100 * found['detectable']['image']:.2f} % would be found")
    assert found["detectable"]["image"] < 0.025


def test_results_can_be_pickled(cornell: et.Scene) -> None:
    result = et.render(cornell, "bdpt", spp=12, techniques=2, progress=False)
    copy = pickle.loads(pickle.dumps(result))
    np.testing.assert_array_equal(copy.image, result.image)
    np.testing.assert_array_equal(copy.variance, result.variance)
    assert copy.error == result.error and copy.passes == 12 and copy.stopped_by == "samples"
    assert len(copy.techniques) == len(result.techniques)
    assert et.merge([copy]).passes == 12


class Counting(Hits):
    """One that changes while it renders."""

    samples = 0

    def sample(self, c: et.core.Sample) -> None:
        self.samples += 1
        super().sample(c)


class Remembering(Counting):
    """And that says what has changed."""

    def save(self) -> bytes:
        return str(self.samples).encode()

    def load(self, state: bytes) -> None:
        self.samples = int(state)


def test_integrators_in_python_go_on(cornell: et.Scene, tmp_path: Path) -> None:
    file = tmp_path / "a.etd"
    remembering = Remembering()
    for make in (Hits, Remembering):
        whole = et.render(cornell, make(), spp=3, progress=False)
        et.render(cornell, make(), spp=1, progress=False).save(file)
        if make is Remembering:
            resumed = et.resume(file, cornell, remembering, spp=3, progress=False)
        else:
            resumed = et.resume(file, cornell, make(), spp=3, progress=False)
        np.testing.assert_array_equal(resumed.image, whole.image)
    assert remembering.samples >= 3 * 32 * 24


def test_integrators_in_python_are_refused_where_they_are_others(cornell: et.Scene, tmp_path: Path) -> None:
    file = tmp_path / "a.etd"
    et.render(cornell, Hits(), spp=1, progress=False).save(file)
    for other in (Hits(2), Remembering(), "path"):
        with pytest.raises(RuntimeError, match="Hits in Python, .* there, but .* here"):
            et.resume(file, cornell, other, spp=2, progress=False)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="expected integrator"):
        et.resume(file, cornell, spp=2)
    with pytest.raises(RuntimeError, match=r"Counting cannot be saved: rendering has changed samples"):
        et.render(cornell, Counting(), spp=1, progress=False).save(file)
    parts = [et.render(cornell, Hits(), spp=1, seed=s, progress=False) for s in range(2)]
    assert et.merge(parts).passes == 2
    with pytest.raises(RuntimeError, match="cannot be merged"):
        et.merge([parts[0], et.render(cornell, Hits(2), spp=1, seed=1, progress=False)])
