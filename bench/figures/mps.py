"""Figures of Metropolis photon sampling, numbered as in [Fan et al. 2005]."""

import numpy as np

from equal_time import LARGE, compare_large
from output import Figure, panels
from runs import FIRST_SEED, ROOT

# ------------------------------------------------------------------------------ figure 3: user paths

USER_PATH_RUNS = 8
MUTATIONS = ("bidirectional", "caustic", "glossy_caustic", "glossy_lens", "large", "lens", "lens_subpath", "multi_chain",
             "user_path")


def user_paths(runs, seconds):
    """Fig. 3: mlt with ten user paths through a shutter, and without: acceptance, and mutations for the same variance."""
    scene = "shutter"
    methods = {"without": "mlt:mutations=4", "with": f"mlt:mutations=4,user_paths={ROOT / 'scenes/shutter-paths.json'}"}
    spp = runs.spp_within(scene, methods.values(), seconds / len(methods) / USER_PATH_RUNS)
    results = {}
    for name, method in methods.items():
        rendered = [runs.render(scene, method, spp=spp, seed=FIRST_SEED + i)
                    for i in range(USER_PATH_RUNS)]
        images = np.array([image for _, image in rendered])
        results[name] = {
            "spp": spp, "seeds": USER_PATH_RUNS,
            **_acceptance([stats for stats, _ in rendered]),
            "seconds": [sum(stats["pass_seconds"]) for stats, _ in rendered],
            "variances": _variances(images),
        }
    without, with_paths = results["without"], results["with"]
    # Variance is inversely proportional to the number of mutations.
    ratio = np.array(without["variances"]) / np.array(with_paths["variances"])
    results["mutations_without_over_with"] = float(ratio.mean())
    results["standard_error"] = float(ratio.std(ddof=1) / np.sqrt(len(ratio)))
    rows = [["", "accepted", "variance", "seconds"]]
    rows += [[name, f"{100 * r['accepted']:.0f} %", float(np.mean(r["variances"])),
              float(np.mean(r["seconds"]))] for name, r in results.items() if name in methods]
    rows.append(["mutations without / with, for the same variance", "",
                 f"{ratio.mean():.2f} ± {results['standard_error']:.2f}", ""])
    figure, (axes,) = panels(1, width=4.6, height=2.8)
    for i, name in enumerate(methods):
        shares = results[name]["accepted_by_mutation"]
        axes.bar(np.arange(len(MUTATIONS)) + 0.35 * i, [100 * shares.get(m, 0) for m in MUTATIONS], 0.35,
                 label=f"{name} user paths")
    axes.set_xticks(np.arange(len(MUTATIONS)) + 0.17, [m.replace("_", " ") for m in MUTATIONS],
                    rotation=30, ha="right", fontsize=7)
    axes.set_ylabel("% accepted")
    axes.legend()
    paper = {"accepted without": 0.58, "accepted with": 0.65, "mutations without / with": 1.6}
    return Figure(results, rows, figure, paper)


def _acceptance(stats):
    """Accepted part of all proposals, and of those by each mutation."""
    proposed = {m: sum(s.get(f"{m}_proposed", 0) for s in stats) for m in MUTATIONS}
    accepted = {m: sum(s.get(f"{m}_proposed", 0) * s.get(f"{m}_accepted", 0) for s in stats)
                for m in MUTATIONS}
    return {"proposed": proposed, "accepted": sum(accepted.values()) / sum(proposed.values()),
            "accepted_by_mutation": {m: accepted[m] / n for m, n in proposed.items() if n > 0}}


def _variances(images):
    """Variance between images, relative to the squared mean of each pixel: estimates by disjoint pairs of images."""
    grey = images.mean(axis=3)
    mean = grey.mean(axis=0)
    scale = mean**2 + 0.01 * mean.mean() ** 2
    return [float(((a - b) ** 2 / 2 / scale).mean()) for a, b in zip(grey[0::2], grey[1::2])]


# ---------------------------------------------------------------------------- table 1: equal time

TABLE_METHODS = ("pm", "mps")
# Rooms, Lantern and Box, which are not public: photons, and RMS of relative errors.
PAPER_TABLE = {"Rooms": {"mps": (81004, 0.036), "pm": (300000, 0.4239)},
               "Lantern": {"mps": (8675, 0.0728), "pm": (37160, 1.165)},
               "Box": {"mps": (47798, 0.0214), "pm": (250000, 0.0227)}}


def equal_time(runs, seconds):
    """Table 1: photons stored and errors of pm and mps at equal time, on scenes of the same kinds."""
    scenes = ("two-rooms", "lantern", "mirror-box", "keyhole")
    rows = [["scene", "method", "photons", "spp", "RMS of relative errors", "trimmed", "mean ratio"]]
    results, ratios = {}, []
    for scene in scenes:
        comparison = compare_large(runs, scene, TABLE_METHODS, seconds / len(scenes),
                                   reference_method="mlt")
        results[scene] = comparison
        for m in comparison["methods"]:
            stats, _ = runs.render(scene, m["method"], spp=1, size=LARGE[scene])
            m["photons"] = stats["photons"]
            m["rms"] = float(np.sqrt(max(0, m["rel_mse"])))
            rows.append([scene, m["method"], m["photons"], round(m["spp"]), m["rms"],
                         float(np.sqrt(max(0, m["rel_mse_trimmed"]))), m["mean_ratio"]["value"]])
        pm, mps = comparison["methods"]
        ratios.append(mps["rms"] / pm["rms"] if pm["rms"] > 0 else 0)
    figure, (axes,) = panels(1, width=4.6, height=2.8)
    theirs = [t["mps"][1] / t["pm"][1] for t in PAPER_TABLE.values()]
    names = [*scenes, *(f"paper: {name}" for name in PAPER_TABLE)]
    axes.bar(np.arange(len(names)), ratios + theirs, 0.6)
    axes.axhline(1, color="#999999", linestyle=":")
    axes.set_xticks(np.arange(len(names)), names, rotation=30, ha="right", fontsize=7)
    axes.set_ylabel("RMS error of mps / pm")
    paper = {"photons and RMS of relative errors": PAPER_TABLE}
    return Figure(results, rows, figure, paper)
