"""The path space, and integrators written in Python."""

import math
from pathlib import Path

import numpy as np
import pytest

import etendue as et
from etendue import core

BDPT = core.Counts(hit=1, next_event=1, connect=1, splat=1)


class PathTracer(et.Integrator):
    """Hits and next events, with the weights of the power heuristic."""

    def counts(self, light_paths: int) -> core.Counts:
        return core.Counts(hit=1, next_event=1)

    def sample(self, c: core.Sample) -> None:
        z = c.eye_path(max_vertices=5)
        for t in range(2, len(z) + 1):
            for s in (0, 1):
                for x in c.join(s, t):
                    c.add(x)


class ShortPathTracer(PathTracer):
    """Walks end early, and the weights know it."""

    def counts(self, light_paths: int) -> core.Counts:
        return core.Counts(hit=1, next_event=1, continued=0.4)


class TooBright(PathTracer):
    """A planted error: paths of two edges are a twentieth too bright."""

    def sample(self, c: core.Sample) -> None:
        z = c.eye_path(max_vertices=5)
        for t in range(2, len(z) + 1):
            for s in (0, 1):
                for x in c.join(s, t):
                    c.add(x, factor=1.05 if x.technique.edges == 2 else 1.0)


class WrongWeights(PathTracer):
    """A planted error: weights that do not sum to one."""

    def sample(self, c: core.Sample) -> None:
        z = c.eye_path(max_vertices=5)
        for t in range(2, len(z) + 1):
            for s in (0, 1):
                for x in c.join(s, t):
                    c.add(x, mis_weight=0.55 if s == 1 and t < 5 else None)


class LightTracer(et.Integrator):
    traces_light_paths = True

    def counts(self, light_paths: int) -> core.Counts:
        return core.Counts(splat=light_paths)

    def sample(self, c: core.Sample) -> None:
        y = c.light_path(max_vertices=4)
        for s in range(1, len(y) + 1):
            for x in c.join(s, 1):
                c.add(x)


@pytest.fixture(scope="module")
def small(scenes: Path) -> et.Scene:
    return et.load(scenes / "cornell.xml").build(resolution=(16, 16))


def test_sub_paths_are_those_of_their_address(small: et.Scene) -> None:
    a, b = core.eye_path(small, (5, 7), seed=3, pass_=2), core.eye_path(small, (5, 7), seed=3, pass_=2)
    np.testing.assert_array_equal(a.p, b.p)
    assert not np.array_equal(a.p, core.eye_path(small, (5, 7), seed=4, pass_=2).p)
    assert a.p.shape == (len(a), 3) and a.pdf_fwd.shape == (len(a),) and a.beta.shape == (len(a), 3)
    assert a[0].kind == "sensor" and a[1].kind == "surface" and a[-1].kind in ("surface", "infinity")
    assert 5 <= a.film[0] <= 6.5 or abs(a.film[0] - 5.5) < 2
    y = core.light_path(small, 4, seed=1)
    assert y[0].kind == "emitter" and y[0].on_emitter
    with pytest.raises(IndexError):
        core.eye_path(small, (16, 0))
    with pytest.raises(IndexError):
        a[len(a)]


def test_a_vertex_samples_what_it_evaluates(small: et.Scene) -> None:
    v = core.vertex_at(small, (0, 1, 2), (0, -0.2, -1))
    assert v is not None and v.kind == "surface"
    rng = np.random.default_rng(1)
    for _ in range(20):
        u = rng.random(3)
        s = v.sample(u[0], (u[1], u[2]))
        if s is None:
            continue
        wi, weight, pdf, is_delta = s
        f, density = v.eval(tuple(map(float, wi)))
        assert not is_delta
        np.testing.assert_allclose(density, pdf, rtol=1e-3)
        np.testing.assert_allclose(f, weight * pdf, rtol=1e-3)


@pytest.mark.parametrize("counts", [BDPT, core.Counts(hit=1, next_event=1, connect=1, splat=1, continued=0.5)])
def test_joins_have_the_slow_definitions_values_and_weights(small: et.Scene, counts: core.Counts) -> None:
    """Contribution = f / p, and the weight is the explicit sum."""
    made: set[tuple[int, int]] = set()
    for i in range(250):
        z = core.eye_path(small, (i % 16, (5 * i) % 16), seed=i, max_vertices=4, counts=counts)
        y = core.light_path(small, i, seed=i, max_vertices=4, counts=counts)
        for t in range(1, len(z) + 1):
            for s in range(2 if t == 1 else 0, len(y) + 1):
                for x in core.join(small, y, s, z, t, seed=i):
                    q = x.technique
                    f, pdfs = core.evaluate(small, x.vertices(), x.delta)
                    np.testing.assert_allclose(x.mis_weight, core.mis_weight(pdfs, q, counts), rtol=2e-3, atol=1e-6)
                    made.add((q.s, q.t))
                    if q.t > 1:  # f is that of the whole film's measurement; splats are of one light path
                        ratio = x.contribution * pdfs.density(q) / np.maximum(f, 1e-30)
                        np.testing.assert_allclose(ratio, ratio.mean(), rtol=5e-3)
    assert {(0, 3), (1, 2), (2, 1), (2, 2), (3, 3)} <= made


def test_weights_of_all_techniques_sum_to_one(small: et.Scene) -> None:
    found = []
    for seed in range(50):
        z = core.eye_path(small, (8, 12), seed=seed, max_vertices=4)
        y = core.light_path(small, 1, seed=seed, max_vertices=4)
        if len(y) > 2 and len(z) > 3:
            found += core.join(small, y, 2, z, 3)
    x = found[0]
    _, pdfs = core.evaluate(small, x.vertices(), x.delta)
    n = len(pdfs)
    assert pdfs.light.shape == (n,) and pdfs.eye.shape == (n,)
    total = sum(core.mis_weight(pdfs, core.Technique(s, n - s), BDPT) for s in range(n)
                if pdfs.sampled(core.Technique(s, n - s), BDPT) > 0)
    assert math.isclose(total, 1, rel_tol=1e-9)


def test_sampled_paths(small: et.Scene) -> None:
    paths = core.sample_paths(small, 500, "bdpt:max_depth=4", seed=2)
    assert paths.shape == (500,)
    assert ((paths["mis_weight"] > 0) & (paths["mis_weight"] <= 1)).all()
    assert (paths["vertices"] == paths["s"] + paths["t"]).all() and paths["vertices"].max() <= 5
    last = paths["x"][np.arange(500), paths["vertices"] - 1]
    lens = core.eye_path(small, (0, 0)).p[0]
    np.testing.assert_allclose(last, np.broadcast_to(lens, (500, 3)), atol=1e-4)
    assert np.isnan(paths["x"][0, paths["vertices"][0]:]).all()
    for wrong in (-1, 1, 10**6):
        with pytest.raises(ValueError, match="max_vertices must lie between 2 and"):
            core.sample_paths(small, 1, max_vertices=wrong)


def test_counts(small: et.Scene) -> None:
    assert core.counts(small, "path").next_event == 1 and core.counts(small, "path").connect == 0
    assert core.counts(small, "light").splat == 256
    assert core.counts(small, PathTracer()).hit == 1
    assert core.counts(small, "vcm").continued == 0.25 and BDPT.continued == 1
    with pytest.raises(ValueError, match="continued must be above 0 and at most 1, not 2"):
        core.Counts(hit=1, continued=2)


@pytest.mark.parametrize(
    "mine, own", [(PathTracer(), "path:max_depth=4,rr_depth=100"), (LightTracer(), "light:max_depth=4,rr_depth=100")])
def test_an_integrator_in_python_renders(small: et.Scene, mine: et.Integrator, own: str) -> None:
    """Within four standard errors of the integrator in C++; verify() judges more closely."""
    stats = [et.render(small, m, spp=64, seed=seed, sampler="independent").stats for seed, m in ((1, mine), (2, own))]
    means = [s["mean_luminance"] for s in stats]
    assert abs(means[0] - means[1]) < 4 * math.hypot(*(s["mean_luminance_standard_error"] for s in stats))


@pytest.mark.parametrize(
    "integrator, verdict",
    [(PathTracer(), "agrees"), (ShortPathTracer(), "agrees"), (TooBright(), "deviates"), (WrongWeights(), "deviates"),
     (LightTracer(), "agrees")])
def test_verify_judges_integrators_in_python(small: et.Scene, integrator: et.Integrator, verdict: str) -> None:
    report = et.verify(small, integrator, spp=24, runs=16, lengths=(1, 3), seed=1, tiles=2)
    assert report.verdicts == {type(integrator).__name__: verdict}, report


def test_errors_of_integrators_in_python(small: et.Scene) -> None:
    class NoCounts(et.Integrator):
        def sample(self, c: core.Sample) -> None:
            pass

    with pytest.raises(NotImplementedError, match="NoCounts needs a method counts"):
        et.render(small, NoCounts(), spp=1)

    class Raises(PathTracer):
        def sample(self, c: core.Sample) -> None:
            raise ZeroDivisionError("in sample")

    with pytest.raises(ZeroDivisionError, match="in sample"):
        et.render(small, Raises(), spp=1)
    with pytest.raises(RuntimeError, match="ZeroDivisionError: in sample"):
        et.verify(small, Raises(), spp=1, runs=8)

    kept = []

    class Keeps(PathTracer):
        def sample(self, c: core.Sample) -> None:
            kept.append((c, c.eye_path()))
            kept[:] = kept[-1:]

    et.render(small, Keeps(), spp=1)
    with pytest.raises(RuntimeError, match="sample has ended|has ended"):
        kept[0][0].eye_path()
    with pytest.raises(RuntimeError, match="has ended"):
        kept[0][1].p
