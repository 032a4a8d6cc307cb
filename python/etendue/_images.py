"""Images: files, tone mapping, errors."""

import json
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _etendue
from ._denoiser_library import denoiser_library
from ._html import image_html, table_html

Image = NDArray[np.float32]
ImageLike = ArrayLike | str | PathLike[str]
ToneOperator = Literal["aces", "reinhard", "srgb"]


def _pixels(image: Any) -> Image:
    if isinstance(image, (str, PathLike)):
        return read_image(image)
    if hasattr(image, "image"):  # a Result
        image = image.image
    array = np.asarray(image)
    if array.dtype.kind == "c":
        raise ValueError("an image has real numbers, but this one is complex")
    pixels = np.ascontiguousarray(_decoded(array) if array.dtype == np.uint8 else array, dtype=np.float32)
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[:, :, None], 3, axis=2)
    if pixels.ndim != 3 or pixels.shape[2] != 3:
        raise ValueError(f"an image has the shape (H, W, 3) or (H, W), but this one has {pixels.shape}")
    if pixels.size == 0:
        raise ValueError(f"the image has no pixels: its shape is {pixels.shape}")
    return pixels


def _decoded(codes: NDArray[np.uint8]) -> NDArray[np.float64]:
    """sRGB codes as linear values."""
    values = np.arange(256) / 255
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    decoded: NDArray[np.float64] = linear[codes]
    return decoded


def read_image(file: str | PathLike[str], layer: str = "") -> Image:
    """Reads an image of radiance: .exr, .hdr, .pfm, .png (decoded from sRGB) or .jpg. Linear RGB, shape (H, W, 3).

        image = et.read_image("a.exr")
        albedo = et.read_image("albedo.exr")

    layer: this layer of an .exr, such as "albedo", instead of the image.

    Raises RuntimeError if the file cannot be read or has no such layer.
    """
    return _etendue.read_image(fspath(file), layer)


def write_image(file: str | PathLike[str], image: ArrayLike) -> None:
    """Writes linear RGB of shape (H, W, 3) as .exr, .pfm, .hdr or .png (sRGB, clamped to [0, 1]); or 8-bit sRGB codes of
    that shape, as tonemap() makes them, as .png. Missing folders are created. An existing file is replaced only when the
    new one is complete.

        et.write_image("copy.exr", image)
        et.write_image("picture.png", et.tonemap(image, exposure=1))

    Raises RuntimeError for another extension or if the file cannot be written, and ValueError for another shape.
    """
    if isinstance(image, np.ndarray) and image.dtype == np.uint8:
        if Path(file).suffix.lower() != ".png":
            raise ValueError(f"8-bit codes can be written as .png only, not as {fspath(file)}")
        if image.ndim != 3 or image.shape[2] != 3 or image.size == 0:
            raise ValueError(f"8-bit codes have the shape (H, W, 3), but these have {image.shape}")
        _etendue.write_png(fspath(file), np.ascontiguousarray(image))
        return
    _etendue.write_image(fspath(file), _pixels(image))


def denoise(image: Any, albedo: ImageLike | None = None, normal: ImageLike | None = None, *, threads: int = 0) -> Image:
    """Removes the noise of an image by Intel Open Image Denoise. The result is radiance, shape (H, W, 3). It has a bias, so
    that it is no reference and no evidence: see docs/denoising.md.

        result = et.render(scene, "bdpt", spp=64, filter_mode="sample", aovs=["denoise_albedo", "denoise_normal"])
        et.write_image("clean.exr", et.denoise(result))

    image: a Result, which should be rendered with filter_mode="sample", and whose auxiliary images are used; or an array of
        radiance, shape (H, W, 3), or its file.
    albedo: reflectance, in [0, 1], such as the auxiliary image denoise_albedo; of the same shape, or a file.
    normal: normals, in [-1, 1], such as the auxiliary image denoise_normal; only with albedo.
    threads: number of threads; 0 for one per core. A Result is denoised by as many as rendered it.

    Raises RuntimeError if there is no library: `pip install pyoidn` installs it, or ETENDUE_OIDN names it. Raises
    ValueError if the sizes differ.
    """
    if hasattr(image, "denoised"):  # a Result
        if albedo is not None or normal is not None:
            raise ValueError("a Result has an albedo and normals of its own")
        of_result: Image = image.denoised()
        return of_result

    def pixels(guide: ImageLike | None) -> Image | None:
        return None if guide is None else _pixels(guide)

    return _etendue.denoise(_pixels(image), pixels(albedo), pixels(normal), threads, denoiser_library())


def tonemap(
    image: ImageLike, operator: ToneOperator = "aces", *, exposure: float = 0, white: float = 0
) -> NDArray[np.uint8]:
    """Converts radiance, shape (H, W, 3), for displays: 8-bit sRGB codes of the same shape, as `etendue tonemap`.

        codes = et.tonemap(result, "reinhard", exposure=-1)
        et.write_image("picture.png", codes)

    operator: "aces", "reinhard", or "srgb", which only clamps.
    exposure: in stops; radiance is multiplied by 2^exposure first.
    white: luminance, after exposure, that reinhard maps to white; 0: the largest of the image.
    """
    return _etendue.tonemap(_pixels(image), operator, exposure, white)


class Diff(dict[str, float]):
    """Errors of an image by name, as `etendue diff --json` prints them: rmse and l1 in units of radiance; rel_mse,
    rel_mse_trimmed, mape, smape, spike, flip_hdr or flip_ldr, and mean_ratio dimensionless; pixels, not_finite and
    ignored are counts.
    """

    flip_map: Image | None
    """FLIP of each pixel, in [0, 1], shape (H, W); None if FLIP was not requested."""
    rel_se_map: Image
    """Each pixel's term of rel_mse, dimensionless, shape (H, W)."""

    def _repr_html_(self) -> str:
        shown = self.rel_se_map if self.flip_map is None else self.flip_map
        colours = _etendue.magma(np.ascontiguousarray(shown))
        return image_html(colours, "srgb") + table_html([{k: v for k, v in self.items()}])


def diff(
    image: ImageLike,
    reference: ImageLike,
    reference2: ImageLike | None = None,
    *,
    flip: Literal["hdr", "ldr", "none"] = "hdr",
    ignore_above: float = float("inf"),
) -> Diff:
    """Compares an image with a reference of the same shape (H, W, 3), as `etendue diff`. Images are arrays, files or
    Results, in linear RGB; arrays of uint8 are sRGB codes.

        errors = et.diff(image, reference)
        print(errors["rel_mse"], errors.flip_map.max())

    reference2: a second, independent reference. Squared errors are then (X - R1)(X - R2), so that the noise of the
        references cancels on average.
    flip: the variant of FLIP [Andersson et al. 2020, 2021]: "hdr", "ldr" or "none".
    ignore_above: leaves out pixels whose reference is brighter than this radiance, such as lamps.

    Raises ValueError if the sizes differ.
    """
    second = None if reference2 is None else _pixels(reference2)
    text, flip_map, rel_se_map = _etendue.diff(_pixels(image), _pixels(reference), second, flip, ignore_above)
    result = Diff(json.loads(text))
    result.flip_map = flip_map
    result.rel_se_map = rel_se_map
    return result
