"""Denoising by Open Image Denoise, whose library the package pyoidn brings."""

import importlib.util
import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import etendue as et

needs_library = pytest.mark.skipif(importlib.util.find_spec("pyoidn") is None, reason="there is no pyoidn here")


def rendered(scene: et.Scene, **more: object) -> et.Result:
    return et.render(scene, "path", spp=16, filter_mode="sample", progress=False, **more)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def result(scenes: Path) -> et.Result:
    return rendered(et.load(scenes / "cornell.xml").build(resolution=(64, 64)), aovs=["denoise_albedo", "denoise_normal"])


@needs_library
def test_denoising_removes_noise(result: et.Result) -> None:
    before = result.image.copy()
    denoised = et.denoise(result)
    assert denoised.shape == (64, 64, 3) and denoised.dtype == np.float32
    np.testing.assert_array_equal(result.image, before)
    reference = et.render(result.scene, "path", spp=1024, progress=False).image
    errors = [et.diff(image, reference, flip="none")["rel_mse_trimmed"] for image in (denoised, before)]
    assert errors[0] < 0.3 * errors[1]


@needs_library
def test_results_and_arrays_are_denoised_alike(result: et.Result) -> None:
    albedo, normal = result.aov["denoise_albedo"], result.aov["denoise_normal"]
    denoised = et.denoise(result)
    np.testing.assert_array_equal(denoised, result.denoised())
    np.testing.assert_array_equal(denoised, et.denoise(result.image, albedo, normal))
    np.testing.assert_array_equal(denoised, et.denoise(result.image, albedo, normal, threads=1))
    for guides in ((), (albedo,)):
        assert not np.array_equal(denoised, et.denoise(result.image, *guides))


@needs_library
def test_files_say_what_is_denoised(program: str, result: et.Result, tmp_path: Path) -> None:
    result.save(tmp_path / "noisy.exr")
    result.save(tmp_path / "denoised.exr", denoised=True)
    np.testing.assert_array_equal(et.read_image(tmp_path / "denoised.exr"), result.denoised())
    for name in ("noisy", "denoised"):
        info = subprocess.run([program, "info", tmp_path / f"{name}.exr"], capture_output=True, text=True, check=True).stdout
        assert (": denoised image" in info) == (name == "denoised")
        assert ("unbiased" in info) == (name == "noisy")
    with pytest.raises(RuntimeError, match="the image is denoised"):
        et.compare(result.scene, "path", spp=1, reference=tmp_path / "denoised.exr", progress=False)
    with pytest.raises(ValueError, match="a checkpoint is not denoised"):
        result.save(tmp_path / "state.etd", denoised=True)


@needs_library
def test_correlated_errors_are_a_warning(result: et.Result, scenes: Path) -> None:
    scene = et.load(scenes / "demo.xml").build(resolution=(16, 12))
    with pytest.warns(UserWarning, match='filter_mode="sample"'):
        et.denoise(et.render(scene, "path", spp=1, progress=False))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        et.denoise(rendered(scene))


@needs_library
def test_sums_are_denoised_without_the_scene(result: et.Result) -> None:
    merged = et.merge([result])
    np.testing.assert_array_equal(et.denoise(merged), et.denoise(result.image))


@needs_library
def test_wrong_arguments(result: et.Result) -> None:
    image, small = result.image, result.image[1:]
    for guides in ((small,), (image, small)):
        with pytest.raises(ValueError, match="differ in size"):
            et.denoise(image, *guides)
    with pytest.raises(ValueError, match="normal needs albedo"):
        et.denoise(image, normal=image)
    with pytest.raises(ValueError, match="of its own"):
        et.denoise(result, image)
    with pytest.raises(ValueError, match="shape"):
        et.denoise(image[..., :2])
    with pytest.raises(ValueError, match="threads"):
        et.denoise(image, threads=-1)


def test_a_missing_library_is_an_error_that_says_how_to_get_it(tmp_path: Path) -> None:
    script = "import numpy as np, etendue as et\net.denoise(np.ones((4, 4, 3), np.float32))"
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True,
                         env={**os.environ, "ETENDUE_OIDN": str(tmp_path / "none.so")})
    assert ran.returncode == 1
    assert "RuntimeError: cannot load Open Image Denoise 2" in ran.stderr and "pip install" in ran.stderr
