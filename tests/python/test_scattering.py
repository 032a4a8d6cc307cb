"""BSDFs and rays of the sensor by the array."""

import threading
from typing import Any

import numpy as np
import pytest

import etendue as et

UP = (0, 0, 1)


def uniform(n: int, seed: int = 1) -> Any:
    """Directions, uniform over the sphere."""
    d = np.random.default_rng(seed).normal(size=(n, 3))
    return d / np.linalg.norm(d, axis=-1, keepdims=True)


@pytest.fixture(scope="module")
def scene() -> et.Scene:
    bsdfs: dict[str, dict[str, Any]] = {
        "diffuse": {"type": "diffuse", "reflectance": (0.2, 0.4, 0.8)},
        "metal": {"type": "roughconductor", "alpha": 0.4, "material": "Cu"},
        "mirror": {"type": "conductor"},
        "glass": {"type": "dielectric"},
        "plastic": {"type": "twosided", "bsdf": {"type": "roughplastic", "alpha": 0.3}},
        "picture": {"type": "diffuse", "reflectance": {
            "type": "bitmap", "raw": True, "filter_type": "nearest", "data": np.array([[[1, 0, 0], [0, 1, 0]]], np.float32)}},
    }
    shapes = {name: {"type": "rectangle", "to_world": et.translate(3 * i), "bsdf": bsdf} for i, (name, bsdf) in enumerate(bsdfs.items())}
    return et.load_dict({
        "type": "scene", "light": {"type": "constant"}, **shapes,
        "sensor": {"type": "perspective", "fov": 40, "to_world": et.look_at((7.5, 0, 30), (7.5, 0, 0))},
    }).build(resolution=(16, 12))


@pytest.mark.parametrize("name", ["diffuse", "metal", "plastic"])
def test_eval_pdf_and_sample_belong_together(scene: et.Scene, name: str) -> None:
    bsdf, n = scene.bsdf(name), 200_000
    wo = np.array((0.5, 0.2, 0.8))
    pdf = bsdf.pdf(wo, uniform(n))
    assert pdf.shape == (n,)
    assert 4 * np.pi * pdf.mean() == pytest.approx(1, abs=float(6 * 4 * np.pi * pdf.std() / n**0.5) + 0.01)
    rng = np.random.default_rng(2)
    s = bsdf.sample(wo, rng.random(1000), rng.random((1000, 2)))
    alive = s.pdf > 0
    assert alive.mean() > 0.8 and not s.is_delta.any()
    np.testing.assert_allclose(np.linalg.norm(s.wi[alive], axis=-1), 1, atol=1e-5)
    np.testing.assert_allclose(bsdf.pdf(wo, s.wi[alive]), s.pdf[alive], rtol=2e-3)
    np.testing.assert_allclose(bsdf.eval(wo, s.wi[alive]), s.weight[alive] * s.pdf[alive, None], rtol=2e-3, atol=1e-6)
    assert np.isnan(s.wi[~alive]).all() and (s.weight[~alive] == 0).all()


def test_values_are_those_of_the_models(scene: et.Scene) -> None:
    wi = uniform(50)
    cos = np.maximum(wi[:, 2:], 0)
    np.testing.assert_allclose(scene.bsdf("diffuse").eval(UP, wi), np.array((0.2, 0.4, 0.8)) / np.pi * cos, rtol=1e-5)
    np.testing.assert_allclose(scene.bsdf("diffuse").pdf((0, 0, 7), 3 * wi), cos[:, 0] / np.pi, rtol=1e-5)
    # Reciprocal, for light and importance.
    a, b = uniform(50, 3) * (1, 1, 0.1) + (0, 0, 0.5), uniform(50, 4) * (1, 1, 0.1) + (0, 0, 0.5)
    cos_a, cos_b = (x[:, 2:] / np.linalg.norm(x, axis=-1, keepdims=True) for x in (a, b))
    metal = scene.bsdf(1)
    np.testing.assert_allclose(metal.eval(a, b) * cos_a, metal.eval(b, a, mode="importance") * cos_b, rtol=1e-4)
    uv = [[(0.2, 0.5), (0.8, 0.5)]]
    colours = scene.bsdf("picture", uv).eval(UP, UP) * np.pi
    assert colours.shape == (1, 2, 3)
    np.testing.assert_allclose(colours, [[(1, 0, 0), (0, 1, 0)]], rtol=1e-5)


def test_mirrors_and_glass_have_delta_directions(scene: et.Scene) -> None:
    wo = np.array((0.6, 0, 0.8))
    s = scene.bsdf("mirror").sample(wo, 0.5, (0.5, 0.5))
    assert s.is_delta == True and s.pdf == 1  # noqa: E712
    np.testing.assert_allclose(s.wi, (-0.6, 0, 0.8), atol=1e-6)
    assert (scene.bsdf("mirror").eval(wo, s.wi) == 0).all()
    u = np.linspace(0, 0.999, 500)
    s = scene.bsdf("glass").sample(wo, u, np.full((500, 2), 0.5))
    assert s.is_delta.all() and len(np.unique(s.wi[:, 2].round(4))) == 2


def test_surfaces_of_hits_have_their_own_frames(scene: et.Scene) -> None:
    rays = scene.sensor_rays()
    assert rays.origins.shape == rays.directions.shape == (12, 16, 3) and rays.pdf_position.shape == (12, 16)
    hits = scene.ray_intersect(rays.origins, rays.directions)
    hit = hits.is_hit
    bsdf = scene.bsdf(hits[hit])
    of_shape = hits.shape[hit]
    f = bsdf.eval(-rays.directions[hit], UP)
    assert f.shape == (hit.sum(), 3) and bsdf.shape == (hit.sum(),)
    diffuse = of_shape == scene.shapes.index("diffuse")
    assert diffuse.any()
    np.testing.assert_allclose(f[diffuse], np.broadcast_to(np.array((0.2, 0.4, 0.8)) / np.pi, (diffuse.sum(), 3)), rtol=1e-4)
    assert (f[of_shape == scene.shapes.index("mirror")] == 0).all()
    with pytest.raises(ValueError, match=r"take hits\[hits.is_hit\]"):
        scene.bsdf(hits)


def test_instances_are_found_again() -> None:
    part = {"type": "rectangle", "bsdf": {"type": "diffuse", "reflectance": (0.3, 0.3, 0.3)}}
    scene = et.load_dict({
        "type": "scene", "light": {"type": "constant"}, "sensor": {"type": "perspective"},
        "group": {"type": "shapegroup", "part": part},
        "a": {"type": "instance", "to_world": et.translate(5) @ et.rotate((0, 1, 0), 90), "g": {"type": "ref", "id": "group"}},
    }).build()
    hits = scene.ray_intersect((9, 0, 0), (-1, 0, 0))
    assert hits.instance == 0 and hits.p[0] == pytest.approx(5)
    np.testing.assert_allclose(scene.bsdf(hits).eval((1, 0, 0), (1, 0, 0)), np.full(3, 0.3 / np.pi), rtol=1e-5)

    # A scene with as many shapes has no such instance, and one without triangles no such triangle.
    def alone(shape: dict[str, Any]) -> et.Scene:
        return et.load_dict({"type": "scene", "light": {"type": "constant"}, "sensor": {"type": "perspective"}, "a": shape}).build()

    mesh = {"type": "mesh", "vertices": [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], "faces": [(0, 1, 2), (0, 2, 3)]}
    second = alone(mesh).ray_intersect((-0.5, 0.5, 1), (0, 0, -1))
    assert second.primitive == 1
    for foreign, plain in ((hits, alone(part)), (second, alone({"type": "sphere"}))):
        with pytest.raises(ValueError, match="hits of another scene"):
            plain.bsdf(foreign).eval(UP, UP)
        with pytest.raises(ValueError, match="hits of another scene"):
            plain.bsdf(foreign).sample(UP, 0.5, (0.5, 0.5))


def test_direct_light_by_hand_is_that_of_path(cornell: et.Scene) -> None:
    scene = et.load_dict({
        "type": "scene", "light": {"type": "constant", "radiance": 0.8},
        "sensor": {"type": "perspective", "fov": 40, "to_world": et.look_at((0, 2, 6), (0, 0.5, 0))},
        "ball": {"type": "sphere", "center": (0, 1, 0), "bsdf": {"type": "roughconductor", "alpha": 0.3}},
        "floor": {"type": "rectangle", "to_world": et.rotate((1, 0, 0), -90) @ et.scale(4)},
    }).build(resolution=(24, 16))
    rays = scene.sensor_rays()
    hits = scene.ray_intersect(rays.origins, rays.directions)
    hit, rng, n = hits.is_hit, np.random.default_rng(1), 256
    bsdf, wo = scene.bsdf(hits[hit]), -rays.directions[hit]
    s = bsdf.sample(wo, rng.random((n, len(wo))), rng.random((n, len(wo), 2)))
    alive = s.pdf > 0
    wi = np.where(alive[..., None], s.wi, hits.ns[hit])
    is_open = ~scene.occluded(hits[hit].origins(wi), wi) & alive
    image = np.full(hit.shape + (3,), 0.8)
    image[hit] = (0.8 * s.weight * is_open[..., None]).mean(axis=0)
    expected = et.render(scene, "path:max_depth=2", spp=256, progress=False).image
    inner = np.s_[2:-2, 2:-2]
    assert image[inner].mean() == pytest.approx(expected[inner].mean(), rel=0.02)


def test_rays_of_crops_lenses_and_points() -> None:
    d = et.load_dict({
        "type": "scene", "light": {"type": "constant"},
        "sensor": {"type": "thinlens", "fov": 60, "aperture_radius": 0.5, "focus_distance": 4,
                   "to_world": et.look_at((1, 2, 3), (1, 2, 0))},
    })
    whole, part = d.build(resolution=(16, 12)), d.build(resolution=(16, 12), crop=(4, 2, 8, 6))
    assert part.crop_offset == (4, 2)
    rays = whole.sensor_rays()
    np.testing.assert_array_equal(part.sensor_rays().directions, rays.directions[2:8, 4:12])
    np.testing.assert_allclose(np.linalg.norm(rays.directions, axis=-1), 1, atol=1e-6)
    left, right = whole.sensor_rays([(0, 6), (16, 6)]).directions
    assert np.degrees(np.arccos(left @ right)) == pytest.approx(60, abs=1e-3)
    # Through the same point of the plane in focus, from all over the lens.
    rays = whole.sensor_rays((3, 4), np.random.default_rng(1).random((100, 2)))
    assert rays.origins.std(axis=0)[:2].min() > 0.1 and rays.pdf_position == pytest.approx(1 / (np.pi * 0.25), rel=1e-5)
    focus = rays.origins + rays.directions * (4 / -rays.directions[:, 2:])
    np.testing.assert_allclose(focus, np.broadcast_to(focus[0], focus.shape), atol=1e-4)
    assert whole.sensor_rays(np.zeros((0, 2))).origins.shape == (0, 3)


def test_wrong_arguments_say_what_was_expected(scene: et.Scene) -> None:
    bsdf = scene.bsdf("diffuse")
    wrong: list[tuple[Any, str]] = [
        (lambda: scene.bsdf("difuse"), "there is no shape 'difuse'"),
        (lambda: scene.bsdf(99), r"lies in \[0, 6\), but is 99"),
        (lambda: bsdf.eval((0, 0, 0), UP), "wo is zero"),
        (lambda: bsdf.eval(UP, (1, 2)), r"wi: expected an array of shape \(..., 3\)"),
        (lambda: bsdf.eval(np.ones((4, 3)), np.ones((5, 3))), r"do not fit together: points \(\), wo \(4,\), wi \(5,\)"),
        (lambda: bsdf.eval(UP, (np.nan, 0, 1)), "expected finite numbers"),
        (lambda: bsdf.pdf(UP, UP, mode="light"), 'mode must be "radiance" or "importance"'),  # type: ignore[arg-type]
        (lambda: bsdf.sample(UP, 1, (0.5, 0.5)), r"u_lobe must lie in \[0, 1\)"),
        (lambda: bsdf.sample(UP, 0.5, 0.5), r"u: expected an array of shape \(..., 2\)"),
        (lambda: scene.sensor_rays((1, 2, 3)), r"film: expected an array of shape \(..., 2\)"),
        (lambda: scene.sensor_rays((1, np.inf)), "film must be finite"),
    ]
    for call, message in wrong:
        with pytest.raises(ValueError, match=message):
            call()
    with pytest.raises(TypeError, match="expected hits, or the name or number of a shape"):
        scene.bsdf(0.5)  # type: ignore[arg-type]
    two = {"type": "rectangle"}
    same = et.load_dict({"type": "scene", "a": {"type": "constant"}, "sensor": {"type": "perspective"}, "shape": two, "shape_2": two}).build()
    with pytest.raises(ValueError, match="2 shapes have the name 'rectangle'"):
        same.bsdf("rectangle")


def test_other_threads_run_meanwhile(scene: et.Scene) -> None:
    bsdf, wi = scene.bsdf("metal"), uniform(400_000)
    done = threading.Event()
    seen: list[int] = []

    def wait() -> None:
        while not done.wait(0.001):
            seen.append(1)

    thread = threading.Thread(target=wait)
    thread.start()
    for _ in range(5):
        bsdf.eval(UP, wi)
    done.set()
    thread.join()
    assert len(seen) > 5
