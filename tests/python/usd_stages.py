"""Stages for the tests of the reader of USD, as texts by the schemas of USD's documentation, and their images."""

import textwrap
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import etendue as et

CAMERA = """
def Camera "Camera" {
    float focalLength = 50
    float horizontalAperture = 40
    float verticalAperture = 30
    double3 xformOp:translate = (0, 0, 5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
# The same camera: the angle of 40/2 over 50.
CAMERA_XML = """
<sensor type="perspective"><float name="fov" value="43.602818972703"/>
<transform name="to_world"><lookat origin="0, 0, 5" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>
"""
FLOOR = """
def Plane "Floor" {
    double width = 4
    double length = 4
    color3f[] primvars:displayColor = [(0.5, 0.25, 0.75)]
}
"""
FLOOR_XML = """
<shape type="rectangle"><transform name="to_world"><scale value="2"/></transform>
<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.5, 0.25, 0.75"/></bsdf></bsdf></shape>
"""


def write(
    folder: Path, text: str, metadata: str = "", name: str = "scene.usda", unit: float = 1, up: str = "Y"
) -> Path:
    """A file with a stage."""
    file = folder / name
    text = textwrap.dedent(text).replace("}", "\n}\n")  # Lines of their own, as the format wants them.
    file.write_text(f"#usda 1.0\n(\n    metersPerUnit = {unit}\n    upAxis = \"{up}\"\n{metadata}\n)\n{text}")
    return file


def load(folder: Path, text: str, metadata: str = "", **options: object) -> et.Description:
    """The description of a stage of which nothing is left out."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return et.load(write(folder, text, metadata), **options)


def image(description: et.Description, spp: int = 8, method: str = "path:max_depth=3") -> NDArray[np.float32]:
    """A small image."""
    scene = description.build(resolution=(16, 12))
    return et.render(scene, method, spp=spp, seed=1, progress=False).image


def image_of_xml(text: str, spp: int = 8) -> NDArray[np.float32]:
    """The image of the same camera with shapes and emitters of Mitsuba's XML."""
    return image(et.load_string(f'<scene version="3.0.0">{CAMERA_XML}{text}</scene>'), spp)


def expect_same(a: NDArray[np.float32], b: NDArray[np.float32], tolerance: float = 1e-4) -> None:
    """Images of the same scene with the same random numbers: they differ by rounding alone. A few pixels may differ, where
    rounding decides which surface a ray hits."""
    assert a.mean() > 0
    off = np.abs(a - b) > tolerance * b.mean() + tolerance * b
    assert off.any(axis=2).mean() < 0.02, np.abs(a - b).max()
