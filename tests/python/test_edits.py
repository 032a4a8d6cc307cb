"""Scenes of edited descriptions, which share what has not changed, are those that are built from nothing."""

import os
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pytest

import etendue as et


def grid(n: int, height: float = 0.2) -> dict[str, Any]:
    """A wavy square of 2 n² triangles."""
    y, x = np.meshgrid(*2 * (np.linspace(-1, 1, n + 1),), indexing="ij")
    vertices = np.stack([x, height * np.sin(5 * x) * np.cos(4 * y), -y], axis=-1).reshape(-1, 3)
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).reshape(-1)
    faces = np.concatenate([np.stack([i, i + 1, i + n + 2], -1), np.stack([i, i + n + 2, i + n + 1], -1)])
    return {"type": "mesh", "vertices": vertices, "faces": faces}


def pixels(seed: int) -> Any:
    return np.random.default_rng(seed).random((8, 8, 3)).astype(np.float32)


def description(n: int = 12) -> et.Description:
    return et.load_dict({
        "type": "scene",
        "sensor": {"type": "perspective", "fov": 40, "to_world": et.look_at((0, 2, 5), (0, 0, 0))},
        "sky": {"type": "constant", "radiance": (0.2, 0.3, 0.4)},
        "lamp": {"type": "sphere", "center": (2, 2, 1), "radius": 0.3, "emitter": {"type": "area", "radiance": (9, 8, 7)}},
        "paint": {"type": "diffuse", "reflectance": {"type": "bitmap", "data": pixels(1), "raw": True}},
        "red": {"type": "diffuse", "reflectance": (0.8, 0.2, 0.1)},
        "ground": grid(n) | {"bsdf": {"type": "ref", "id": "paint"}},
        "group": {"type": "shapegroup", "part": grid(n, 0.5) | {"bsdf": {"type": "ref", "id": "red"}}},
        "left": {"type": "instance", "to_world": et.translate(-1, 0.8) @ et.scale(0.4), "g": {"type": "ref", "id": "group"}},
        "right": {"type": "instance", "to_world": et.translate(1, 0.8) @ et.scale(0.3), "g": {"type": "ref", "id": "group"}},
    })


def image(scene: et.Scene) -> Any:
    return et.render(scene, "bdpt:max_depth=4", spp=2, progress=False, threads=1).image


def expect_as_from_nothing(d: et.Description) -> None:
    scene = d.build(resolution=(20, 14))
    fresh = et.load_dict(d.to_dict()).build(resolution=(20, 14))
    np.testing.assert_array_equal(image(scene), image(fresh))
    assert scene.warnings == fresh.warnings
    a, b = scene.info(), fresh.info()
    memory = "accelerator_bytes"
    assert {k: v for k, v in a.items() if k != memory} == {k: v for k, v in b.items() if k != memory}
    assert a[memory] == pytest.approx(b[memory], rel=0.2, abs=100_000)


def moved(d: et.Description) -> None:
    d["ground.to_world"] = et.translate(0, 0.3)


EDITS: dict[str, Callable[[et.Description], None]] = {
    "nothing": lambda d: None,
    "camera": lambda d: d.__setitem__("sensor.to_world", et.look_at((1, 2, 5), (0, 0, 0))),
    "colour": lambda d: d.__setitem__("red.reflectance", (0.1, 0.7, 0.2)),
    "radiance": lambda d: d.__setitem__("lamp.emitter.radiance", (1, 2, 3)),
    "sky": lambda d: d.__setitem__("sky.radiance", (1, 1, 1)),
    "moved": moved,
    "moved instance": lambda d: d.__setitem__("left.to_world", et.translate(-0.5, 1) @ et.scale(0.5)),
    "moved lamp": lambda d: d.__setitem__("lamp.center", (0, 3, 0)),
    "mesh": lambda d: d.__setitem__("ground.vertices", grid(12, 0.4)["vertices"]),
    "mesh of a group": lambda d: d.__setitem__("group.part", grid(9, 0.3)),
    "picture": lambda d: d.__setitem__("paint.reflectance.data", pixels(2)),
    "material": lambda d: d.__setitem__("ground.bsdf", {"type": "conductor"}),
    "mask": lambda d: d.__setitem__("ground.bsdf", {"type": "mask", "opacity": 0.5, "bsdf": {"type": "diffuse"}}),
    "emitter": lambda d: d.__setitem__("ground.emitter", {"type": "area", "radiance": (1, 0, 0)}),
    "added": lambda d: d.__setitem__("ball", {"type": "sphere", "radius": 0.5}),
    "removed": lambda d: d.__delitem__("right"),
    "removed shape": lambda d: d.__delitem__("ground"),
}


@pytest.mark.parametrize("name", EDITS)
def test_an_edit_gives_the_scene_that_is_built_from_nothing(name: str) -> None:
    d = description()
    before = d.build(resolution=(20, 14))
    first = image(before)
    EDITS[name](d)
    expect_as_from_nothing(d)
    np.testing.assert_array_equal(image(before), first)  # which shares parts with the other one
    EDITS["camera"](d)
    expect_as_from_nothing(d)


def test_parts_outlive_the_scene_that_they_were_made_for() -> None:
    d = description()
    d.build()
    for name in EDITS:
        d = d.copy()
        EDITS[name if name not in ("removed", "removed shape", "mesh") else "nothing"](d)
        scene = d.build(resolution=(20, 14), watertight=name == "sky")
        del d
        d = scene.description
        image(scene)
    expect_as_from_nothing(d)


def test_files_that_change_are_read_again(tmp_path: Path) -> None:
    mesh, picture = tmp_path / "a.obj", tmp_path / "a.pfm"

    def write(height: float, seed: int) -> None:
        mesh.write_text(f"v -1 {height} 1\nv 1 {height} 1\nv 0 {height} -1\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
        et.write_image(picture, pixels(seed))

    d = et.load_dict({
        "type": "scene", "sky": {"type": "constant"},
        "sensor": {"type": "perspective", "to_world": et.look_at((0, 3, 3), (0, 0, 0))},
        "thing": {"type": "obj", "filename": "a.obj", "bsdf": {
            "type": "diffuse", "reflectance": {"type": "bitmap", "filename": "a.pfm", "raw": True}}},
    }, folder=tmp_path)

    def expect_that_of_files() -> None:
        scene, fresh = (x.build(resolution=(20, 14)) for x in (d, et.load_dict(d.to_dict(), folder=tmp_path)))
        np.testing.assert_array_equal(image(scene), image(fresh))

    for height, seed in (0, 1), (0.5, 1), (0.5, 2), (0.1, 3):
        write(height, seed)
        expect_that_of_files()
        expect_that_of_files()
    os.replace(picture, tmp_path / "b.pfm")
    with pytest.raises(et.SceneError, match="a.pfm"):
        d.build()


def test_edits_are_cheaper_than_scenes() -> None:
    """Measured are 0.02 of the time for colours and the camera; the machine may be busy."""
    d = description(400)

    def seconds(edit: Callable[[et.Description], None]) -> float:
        edit(d)
        begin = perf_counter()
        d.build(resolution=(20, 14), threads=1)
        return perf_counter() - begin

    first = seconds(EDITS["nothing"])
    for name in "camera", "colour", "radiance":
        assert min(seconds(EDITS[name]) for _ in range(3)) < 0.5 * first, name
