"""Figures of probabilistic connections, numbered as in [Popov et al. 2015]."""

import numpy as np

from equal_time import at_equal_time
from output import Figure, panels, plot_lines, plot_pictures
from runs import FIRST_SEED, mean_curve, scene_settings, speed_up

INTERIORS = ("veach-ajar", "staircase2", "living-room")
# The error of the paper. Unlike the squared errors, it includes the noise of the reference.
ERRORS = {"rel_mse": "relMSE", "rel_mse_trimmed": "relMSE, trimmed", "l1": "L1"}


def _sweep(runs, scenes, methods, seconds, *, head, repeats=1, **options):
    """Compares the methods, {label: method}, the first of which is bdpt, on each scene at equal time: results by scene,
    and rows."""
    results = {}
    rows = [["scene", head, "spp", *ERRORS.values(), "efficiency", "efficiency, trimmed"]]
    for scene in scenes:
        comparison = runs.compare(scene, methods.values(), seconds=seconds / len(scenes),
                                  runs=repeats, **options)
        results[scene] = comparison
        rows += _rows(scene, methods, comparison)
    return results, rows


def _rows(scene, labels, comparison):
    return [
        [scene, label, round(m["spp"]), *(m[e] for e in ERRORS), m["efficiency"],
         m["efficiency_trimmed"]]
        for label, m in zip(labels, comparison["methods"])
    ]


def _plot_sweep(results, labels, *, over, error="rel_mse_trimmed"):
    """Error curves: a panel for each scene and each of `over`."""
    titles = {"seconds": "seconds", "spp": "samples of a pixel"}
    figure, axes = panels(len(results) * len(over), width=3, height=2.8)
    places = [(scene, x) for scene in results for x in over]
    for (scene, x), a in zip(places, axes):
        plot_lines(a, [(label, *mean_curve(m, error, x))
                       for label, m in zip(labels, results[scene]["methods"])],
                   title=scene, x=titles[x])
    axes[0].set_ylabel(ERRORS[error])
    axes[0].legend()
    return figure


# ---------------------------------------------------------------------------- figure 11: guided paths

GUIDED_METHODS = ("pcbpt", "pcbpt:guide=hp02", "pcbpt:guide=on", "bdpt", "bdpt:guide=on")


def guided(runs, seconds):
    """Fig. 11: pcbpt alone, with footprints of photons and with learned mixtures, and bdpt, training included."""
    return at_equal_time(runs, runs.available("living-room", "lantern"), GUIDED_METHODS, seconds,
                         paper={"pcbpt with Hey and Purgathofer's sampling":
                                "2241 iterations in the time of 78 000 without it"})


# ----------------------------------------------------------------------------- figures 14, 15: cache

CACHE_METHODS = {
    "bdpt": "bdpt",
    "0.1 %": "pcbpt:record_fraction=0.001",
    "0.4 %": "pcbpt:record_fraction=0.004",
    "1.6 %": "pcbpt:record_fraction=0.016",
    "6.4 %": "pcbpt:record_fraction=0.064",
    "uniform": "pcbpt:uniform=1",
}


# Exact mass functions are so slow that only a small image is rendered.
EXACT_SIZE = (96, 54)


def cache(runs, seconds):
    """Figs. 14, 15: interpolated mass functions of few and many records, exact ones, and none."""
    scenes = runs.available("veach-ajar", "staircase2")
    results, rows = _sweep(runs, scenes, CACHE_METHODS, 0.6 * seconds, head="records")
    figure = _plot_sweep(results, CACHE_METHODS, over=("seconds", "spp"))
    (scene, *_), exact = scenes, "pcbpt:cache=false"
    spp = runs.spp_within(scene, [exact], 0.4 * seconds, size=EXACT_SIZE)
    methods = CACHE_METHODS | {"exact": exact}
    results["exact"] = runs.compare(scene, methods.values(), spp=spp, size=EXACT_SIZE)
    rows += _rows(f"{scene}, small, equal samples", methods, results["exact"])
    paper = {"exact against 0.4 %, equal samples": "differences low, even times 10",
             "10 % against 0.4 %": "quality marginally better, 28 min instead of 5"}
    return Figure(results, rows, figure, paper)


# ---------------------------------------------------------------------------- figures 8, 17: weights

# With the paper's technique for direct light, and more records than usual: the paper has exact mass functions here.
WEIGHT_METHODS = {
    "standard weights": "pcbpt:record_fraction=0.016,direct=stored,weights=standard",
    "upper bound": "pcbpt:record_fraction=0.016,direct=stored,weights=upper",
}
# Glass and copper.
WEIGHT_CROP = (20, 60, 130, 60)


def weights(runs, seconds):
    """Figs. 8, 17: standard weights and those of the upper bound, at equal samples."""
    scene, methods = "ajar", list(WEIGHT_METHODS.values())
    spp = runs.spp_within(scene, methods, seconds / 4)
    comparison = runs.compare(scene, methods, spp=spp)
    rows = [["weights", "spp", "relMSE", "trimmed", "99.99th percentile of the error / mean",
             "largest error / mean"]]
    reference = _picture(runs, scene, "bdpt", runs.spp_within(scene, ["bdpt"], seconds / 2), 1_000_001)
    pictures = {}
    for (name, method), m in zip(WEIGHT_METHODS.items(), comparison["methods"]):
        image = _picture(runs, scene, method, spp, FIRST_SEED)
        m["largest_error"] = float(np.abs(image - reference).mean(axis=2).max() / reference.mean())
        rows.append([name, spp, m["rel_mse"], m["rel_mse_trimmed"], m["spike"], m["largest_error"]])
        pictures[name] = image
    pictures["reference (bdpt)"] = reference
    x, y, w, h = WEIGHT_CROP
    pictures = {name: image[y:y + h, x:x + w] for name, image in pictures.items()}
    figure = plot_pictures(pictures, 0.8 / np.percentile(reference, 90), zoom=3)
    paper = {"standard weights": "intense noise at glass, which persists", "upper bound": "none"}
    return Figure(comparison, rows, figure, paper, True)


def _picture(runs, scene, method, spp, seed):
    return runs.render(scene, method, spp=spp, seed=seed)[1]


# ------------------------------------------------------------------------------ table 3: light paths

LIGHT_PATHS = (50, 100, 200, 400, 800)
PAPER_LIGHT_PATHS = {"Kitchen": (0.0235, 0.0233, 0.0250, 0.0289, 0.0344),
                     "Apartment": (0.1204, 0.1208, 0.1217, 0.1250, 0.1282)}


def light_paths(runs, seconds):
    """Table 3: number M of light paths, at equal time."""
    scenes = runs.available("veach-ajar", "staircase2")
    methods = {"bdpt": "bdpt"} | {f"M = {m}": f"pcbpt:light_paths={m}" for m in LIGHT_PATHS}
    results, rows = _sweep(runs, scenes, methods, seconds, head="light paths")
    figure, (axes,) = panels(1, width=4.4, height=2.9)
    relative = []
    for scene, comparison in results.items():
        l1 = np.array([m["l1"] for m in comparison["methods"][1:]])
        relative.append((f"{scene}, L1", LIGHT_PATHS, l1 / l1[1]))
    for scene, l1 in PAPER_LIGHT_PATHS.items():
        relative.append((f"paper, {scene}, L1", LIGHT_PATHS, np.array(l1) / l1[1]))
    for scene, comparison in results.items():
        e = np.sqrt([m["rel_mse_trimmed"] for m in comparison["methods"][1:]])
        relative.append((f"{scene}, √ trimmed relMSE", LIGHT_PATHS, e / e[1]))
    plot_lines(axes, relative, x="light paths M", y="error over that with M = 100", marker="o")
    axes.legend()
    return Figure(results, rows, figure, {"light_paths": LIGHT_PATHS, "l1": PAPER_LIGHT_PATHS})


# ----------------------------------------------------------------------------------- table 2: phases

# Milliseconds: path generation, PT and LT, PMF, selection and connections, inner paths of BDPT.
PAPER_PHASES = {"Kitchen": (1314, 648 + 202, 786, 2267, 3161),
                "Apartment": (868, 383 + 141, 425, 1708, 2068),
                "Living Rm.": (671, 799 + 169, 92, 472, 552),
                "Plants": (550, 355 + 53, 149, 646, 764)}
PHASES = ("light_paths", "eye_paths", "records", "connections")


def phases(runs, seconds):
    """Table 2: seconds of a pass by phase, on one thread."""
    scenes = runs.available(*INTERIORS)
    rows = [["scene", "method", *(p.replace("_", " ") for p in PHASES), "connections K",
             "selection and connections over those of bdpt:roulette=0", "with records"]]
    # First the method that the paper compares with, without roulette before shadow rays.
    results, methods = [], ("bdpt:roulette=0", "bdpt", "pcbpt")
    figure, (axes,) = panels(1, width=6, height=2.8)
    bars, names = [], []
    for scene in scenes:
        spp = runs.spp_within(scene, methods, seconds / len(scenes) / 2, threads=1)
        base = None
        for method in methods:
            stats, _ = runs.render(scene, method, spp=spp, threads=1)
            spent = {p: stats["phase_seconds"][p] / spp for p in PHASES}
            base = base or spent["connections"]
            ratio = spent["connections"] / base
            with_records = (spent["connections"] + spent["records"]) / base
            results.append({
                **scene_settings(scene, method=method, spp=spp, threads=1), "seconds": spent,
                "connections_over_bdpt": ratio, "connections_and_records_over_bdpt": with_records,
                **{key: stats.get(key) for key in ("connections", "records", "record_bytes",
                                                   "stored_vertices", "shadow_rays")},
            })
            rows.append([scene, method, *spent.values(), stats.get("connections"), ratio,
                         with_records])
            bars.append(list(spent.values()))
            names.append(f"{scene}, {method}")
    left = np.zeros(len(bars))
    for phase, width in zip(PHASES, np.array(bars).T):
        axes.barh(names, width, left=left, label=phase.replace("_", " "))
        left += width
    axes.invert_yaxis()
    axes.set_xlabel("seconds of a pass, one thread")
    axes.legend(loc="upper left", bbox_to_anchor=(1, 1))
    for scene, (*_, pmf, selection, inner_bdpt) in PAPER_PHASES.items():
        rows.append([f"paper, {scene}", "pcbpt", None, None, pmf / 1000, selection / 1000, None,
                     selection / inner_bdpt, (selection + pmf) / inner_bdpt])
    paper = {"milliseconds": PAPER_PHASES,
             "columns": "path generation, PT and LT, PMF, selection and connections, inner of BDPT"}
    what = "connections: of bdpt and pcbpt, next event included; records: PMF of the paper"
    return Figure({"what": what, "runs": results}, rows, figure, paper)


# -------------------------------------------------------------------------- figures 16, 18: time

TIMED_METHODS = {"bdpt": "bdpt", "bdpt, EORR": "bdpt:eorr=true", "pcbpt": "pcbpt"}


def inner(runs, seconds):
    """Fig. 16: errors of inner paths alone."""
    results, rows = _sweep(runs, runs.available(*INTERIORS), TIMED_METHODS, seconds, head="method",
                           repeats=2, paths="inner")
    rows[0].append("bdpt's L1 over its")
    for row in rows[1:]:
        base = next(r for r in rows[1:] if r[0] == row[0])
        row.append(base[5] / row[5])
    figure = _plot_sweep(results, TIMED_METHODS, over=("seconds",))
    paper = {"L1 of BDPT over that of PCBPT": {"Living Room": 6.4, "Kitchen": 1.6, "Apartment": 2.4,
                                               "Plant": 1.7}}
    return Figure(results, rows, figure, paper)


def convergence(runs, seconds):
    """Fig. 18: errors of all paths against time."""
    results, rows = _sweep(runs, runs.available(*INTERIORS), TIMED_METHODS, seconds, head="method",
                           repeats=2)
    rows[0] += [f"speed-up, {name}" for name in ERRORS.values()]
    methods = [m for c in results.values() for m in c["methods"]]
    for row, m in zip(rows[1:], methods):
        base = results[row[0]]["methods"][0]
        m["speed_up"] = {e: speed_up(base, m, e) for e in ERRORS}
        row += m["speed_up"].values()
    figure = _plot_sweep(results, TIMED_METHODS, over=("seconds",))
    paper = {"times of BDPT and PCBPT for the same L1": {"Kitchen": 3.4, "Apartment": 3.1,
                                                         "Living Room": 1.6, "Plants": 1.9},
             "EORR": {"Kitchen": "4.5 % less time", "Living Room": "17 % more time"}}
    return Figure(results, rows, figure, paper)
