"""Rays by the array."""

import re
import threading
from typing import Any

import numpy as np
import pytest

import etendue as et
from etendue import core

SCENE = {
    "type": "scene",
    "sensor": {"type": "perspective"},
    "light": {"type": "constant"},
    "floor": {"type": "rectangle", "to_world": et.rotate((1, 0, 0), -90) @ et.scale(10)},
    "ball": {"type": "sphere", "center": (0, 3, 0), "radius": 1},
}


@pytest.fixture(scope="module")
def scene() -> et.Scene:
    return et.load_dict(SCENE).build(resolution=(8, 8))


def test_hits_are_those_of_single_rays(cornell: et.Scene) -> None:
    rng = np.random.default_rng(1)
    lo, hi = np.array(cornell.bounds)
    origins = lo + (hi - lo) * (0.25 + 0.5 * rng.random((2000, 3)))
    directions = rng.normal(size=(2000, 3))
    hits = cornell.ray_intersect(origins, directions)
    assert 1000 < hits.is_hit.sum() < 2000
    for i in range(0, 2000, 20):
        v = core.vertex_at(cornell, tuple(origins[i]), tuple(directions[i]))
        assert (v is not None) == hits.is_hit[i]
        if v is not None:
            np.testing.assert_allclose(hits.p[i], v.p, rtol=1e-4, atol=1e-4 * np.abs(hi - lo).max())
            np.testing.assert_allclose(hits.ng[i], v.ng, atol=1e-5)
            # The material of the walls is twosided: there, v.ns is on the side of the ray.
            np.testing.assert_allclose(hits.ns[i], v.ns * np.sign(np.dot(v.ns, v.ng)), atol=1e-5)
    np.testing.assert_array_equal(cornell.occluded(origins, directions), hits.is_hit)


def test_what_hits_and_misses_have(scene: et.Scene) -> None:
    hits = scene.ray_intersect([(0, 10, 0), (2, 10, 0), (0, 10, 0)], [(0, -5, 0), (0, -1, 0), (0, 1, 0)])
    np.testing.assert_allclose(hits.t, [6, 10, np.inf])
    assert [scene.shapes[i] for i in hits.shape[:2]] == ["ball", "floor"] and hits.shape[2] == -1
    np.testing.assert_allclose(hits.p[:2], [(0, 4, 0), (2, 0, 0)], atol=1e-5)
    np.testing.assert_allclose(hits.ng[:2], [(0, 1, 0), (0, 1, 0)], atol=1e-6)
    np.testing.assert_allclose(hits.uv[1], (0.6, 0.5), atol=1e-6)
    assert hits.primitive[0] == 0 and hits.primitive[2] == -1
    for name in ("p", "ng", "ns", "uv", "slack"):
        assert np.isnan(getattr(hits, name)[2]).all() and np.isfinite(getattr(hits, name)[:2]).all(), name
    some = hits[hits.is_hit]
    assert some.t.shape == (2,) and some.p.shape == (2, 3) and hits[0].t == 6


def test_shapes_of_arguments_are_broadcast(scene: et.Scene) -> None:
    directions = np.random.default_rng(2).normal(size=(3, 5, 3))
    hits = scene.ray_intersect((0, 1, 0), directions)
    assert hits.t.shape == hits.shape.shape == (3, 5) and hits.p.shape == (3, 5, 3) and hits.uv.shape == (3, 5, 2)
    one = scene.ray_intersect((0, 1, 0), directions[2, 4])
    assert one.t.shape == () and one.t == hits.t[2, 4]
    np.testing.assert_array_equal(one.p, hits.p[2, 4])
    assert scene.occluded((0, 10, 0), (0, -1, 0)).shape == ()
    assert scene.ray_intersect(np.zeros((0, 3)), (0, 1, 0)).t.shape == (0,)


def test_distances_are_limited(scene: et.Scene) -> None:
    far = [5.9, 6.1, np.inf]
    np.testing.assert_array_equal(scene.ray_intersect((0, 10, 0), (0, -1, 0), far).is_hit, [False, True, True])
    np.testing.assert_array_equal(scene.occluded((0, 10, 0), (0, -1, 0), far), [False, True, True])


def test_rays_that_leave_a_surface_do_not_find_it_again(cornell: et.Scene, demo: et.Scene) -> None:
    rng = np.random.default_rng(3)
    for scene in cornell, demo:
        lo, hi = np.array(scene.bounds)
        hits = scene.ray_intersect(lo + (hi - lo) * rng.random((20000, 3)), rng.normal(size=(20000, 3)))
        hits = hits[hits.is_hit]
        outward = hits.ng + 0.5 * rng.normal(size=hits.ng.shape)
        outward *= np.sign((outward * hits.ng).sum(axis=-1, keepdims=True))
        again = scene.ray_intersect(hits.origins(outward), outward)
        near = again.t < 1e-4 * np.linalg.norm(hi - lo)
        assert not (near & (again.shape == hits.shape) & (again.primitive == hits.primitive)).any()


def test_masks_stop_rays_that_they_halve() -> None:
    def scene(opacity: float) -> et.Scene:
        floor = {"type": "rectangle", "bsdf": {"type": "mask", "opacity": opacity, "bsdf": {"type": "diffuse"}}}
        return et.load_dict({**SCENE, "floor": floor}).build(resolution=(8, 8))

    for opacity, hit in (0.4, False), (0.6, True):
        of = scene(opacity)
        assert of.ray_intersect((0, 0, 5), (0, 0, -1)).is_hit == hit == of.occluded((0, 0, 5), (0, 0, -1))


def test_directions_of_any_length(scene: et.Scene) -> None:
    expected = scene.ray_intersect((0, 3, 7), (0, 0, -1))
    assert expected.is_hit
    for length in (1e-300, 1e-30, 1e30):
        found = scene.ray_intersect((0, 3, 7), (0, 0, -length))
        assert found.t == expected.t and (found.p == expected.p).all()


@pytest.mark.parametrize(
    "arguments, message",
    [
        ((np.zeros((4, 2)), (0, 0, 1)), "origins: expected an array of shape (..., 3), but found one of (4, 2)"),
        (((0, 0, 0), 1), "directions: expected an array of shape (..., 3), but found one of ()"),
        (((0, 0, 0), [(0, 0, 1), (0, 0, 0)]), "directions[1] is zero"),
        (((0, 0, 0), (0, np.nan, 0)), "directions is [ 0. nan  0.]: expected finite numbers"),
        (([[(0, 0, 0), (np.inf, 0, 0)]], (0, 0, 1)), "origins[0, 1] is [inf  0.  0.]: expected finite numbers"),
        ((np.zeros((4, 3)), np.ones((5, 3))), "do not fit together: their shapes are (4, 3), (5, 3) and ()"),
        (("here", (0, 0, 1)), "origins: expected an array of numbers"),
        (([[1, 2, 3], [4]], (0, 0, 1)), "origins: expected an array of numbers"),
        (((0, 0, 0), (0, 0, 1), -1), "max_distance must not be negative or NaN"),
    ])
def test_wrong_rays_say_what_was_expected(scene: et.Scene, arguments: tuple[Any, ...], message: str) -> None:
    for query in scene.ray_intersect, scene.occluded:
        with pytest.raises(ValueError, match=re.escape(message)):
            query(*arguments)


def test_other_threads_run_meanwhile(cornell: et.Scene) -> None:
    directions = np.random.default_rng(4).normal(size=(400_000, 3))
    done = threading.Event()
    seen: list[int] = []

    def wait() -> None:
        while not done.wait(0.001):
            seen.append(1)

    thread = threading.Thread(target=wait)
    thread.start()
    for _ in range(5):
        cornell.ray_intersect((278, 273, 0), directions)
    done.set()
    thread.join()
    assert len(seen) > 5
