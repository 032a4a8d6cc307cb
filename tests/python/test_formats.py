"""One scene as glTF, as a stage of USD and as XML of Mitsuba has one image."""

from pathlib import Path

import pytest

pytest.importorskip("pxr", reason="usd-core is not installed")

from format_scenes import images
from usd_stages import expect_same


def test_gltf_usd_and_xml_give_the_same_image(tmp_path: Path) -> None:
    first, *others = images(tmp_path, (64, 48), 16).values()
    for other in others:
        expect_same(first, other, 1e-4)
