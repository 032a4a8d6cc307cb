"""Typical use, for the type checker."""

import numpy as np
from numpy.typing import NDArray

import etendue as et
from etendue import core


class Hits(et.Integrator):
    def counts(self, light_paths: int) -> core.Counts:
        return core.Counts(hit=1)

    def sample(self, c: core.Sample) -> None:
        z = c.eye_path(max_vertices=4)
        for t in range(2, len(z) + 1):
            for x in c.join(0, t):
                c.add(x, mis_weight=1.0)


def sweep(file: str) -> list[NDArray[np.float32]]:
    d = et.load(file, {"width": 64})
    d["sensor.fov"] = 40
    images = []
    for roughness in (0.1, 0.3):
        d["ball.bsdf.alpha"] = roughness
        scene = d.build(resolution=(64, 48), crop=(0, 0, 32, 32))
        result = et.render(scene, "bdpt:max_depth=4", spp=4, callback=lambda p: p.passes < 3, aovs=["albedo"])
        images.append(result.image + result.aov["albedo"])
        sums: NDArray[np.float64] = result.film.sums
        images.append((sums / result.film.passes).astype(np.float32))
    return images


def judge(scene: et.Scene) -> str:
    report = et.verify(scene, ["bdpt", Hits()], spp=4, runs=8, lengths=(1, 3))
    errors = et.compare([scene], ["path", "bdpt"], spp=4).frame()
    return report.verdicts["bdpt"] + str(errors)


def densities(scene: et.Scene) -> float:
    z = core.eye_path(scene, (3, 4), seed=1)
    y = core.light_path(scene, 0)
    total = 0.0
    for x in core.join(scene, y, 2, z, 2):
        f, pdfs = core.evaluate(scene, x.vertices(), x.delta)
        total += pdfs.density(x.technique) * float(f.sum())
        total += core.mis_weight(pdfs, core.Technique(1, 3), core.Counts(hit=1, next_event=1))
    v = core.vertex_at(scene, (0, 0, 0), (0, 0, 1))
    if v is not None:
        value, pdf = v.eval((0, 1, 0))
        total += pdf + float(value[0])
    return total


async def modern(file: str, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> float:
    d = et.load_dict({"type": "scene", "thing": {"type": "mesh", "vertices": vertices, "faces": faces}})
    for path, value in d.items():
        print(path, value)
    method = et.integrator("upg+bdpt", max_depth=12)
    with et.start(d, method, time=10) as job:
        image: NDArray[np.float32] = job.image(timeout=5)
        if job.progress.passes > 10:
            job.stop()
        result = await job
    et.render(file, {"type": "path", "max_depth": 8}, spp=4, sensor="left").plot_convergence()
    scene = d.build(sensor=1)
    hits: et.RayHits = scene.ray_intersect((0, 0, 0), np.eye(3))
    dark: NDArray[np.bool_] = scene.occluded(hits.origins((0, 1, 0)), (0, 1, 0), max_distance=5)
    return float(np.asarray(result).mean() + image.mean() + hits.t[dark].sum()) + len(scene.shapes)
