"""Figures of unbiased photon gathering, numbered as in [Qin et al. 2015]."""

import numpy as np

from equal_time import LARGE, at_equal_time, equal_time_rows
from output import Figure, panels, plot_lines, plot_pictures
from runs import FIRST_SEED, mean_curve, power_law, scene_settings

# --------------------------------------------------------------------------- figure 6: Markov chains

CHAIN_METHODS = ("pssmlt", "upg", "upg+pssmlt", "upg+bdpt")


def chains(runs, seconds):
    """Fig. 6: pssmlt, upg and upg+pssmlt, for paths of three edges and more, which upg can make alone."""
    scenes = runs.available("veach-ajar")
    return at_equal_time(runs, scenes, CHAIN_METHODS, seconds, lengths="3..", paper={
        "images": "pssmlt converges slowly for many bounces; upg+pssmlt has no spikes, unlike upg",
        "text": "upg+pssmlt does not perform as well as upg+bdpt"})


# ------------------------------------------------------------------------------------ figure 7: bias

CONVERGENCE_RUNS = 64
FEWEST_CONVERGENCE_RUNS = 16  # where times are scaled down
# Below the lamp, whose edges would dominate the error.
CONVERGENCE_CROP = (0, 16, 64, 48)
CONVERGENCE_RADIUS = 0.1


def convergence(runs, seconds):
    """Fig. 7: error of the mean of 1 to 64 independent runs."""
    scene, crop = "cornell", CONVERGENCE_CROP
    count = CONVERGENCE_RUNS if runs.scale >= 0.1 else FEWEST_CONVERGENCE_RUNS
    methods = [f"upg+bdpt:radius={CONVERGENCE_RADIUS}", f"vcm:radius={CONVERGENCE_RADIUS},alpha=1"]
    spp = runs.spp_within(scene, methods, seconds / 4 / count, crop=crop)
    # Two halves, so that the reference's noise cancels; together they have as many samples as all runs of a method.
    reference_spp = runs.spp_within(scene, ["bdpt"], seconds / 4, crop=crop)
    reference = [
        runs.render(scene, "bdpt", spp=reference_spp, seed=seed, crop=crop)[1]
        for seed in (1_000_001, 1_000_002)
    ]
    results, curves = [], []
    rows = [["method", f"slope, 1 to {count} runs", f"slope, {count // 4} to {count}", "RMSE of 1", f"of {count}", "bias"]]
    for method in methods:
        images = np.array([
            runs.render(scene, method, spp=spp, seed=FIRST_SEED + i, crop=crop)[1]
            for i in range(count)
        ])
        counts, mse = _mse_of_means(images, reference)
        rmse = np.sqrt(np.maximum(mse, 0))
        usable = mse > 0
        slope, slope_error = power_law(counts[usable], rmse[usable])
        last = usable & (counts >= count // 4)
        last_slope = power_law(counts[last], rmse[last])[0] if last.sum() > 1 else None
        # mse(n) = variance / n + bias².
        bias_squared = (counts[-1] * mse[-1] - mse[0]) / (counts[-1] - 1)
        bias = float(np.sign(bias_squared) * np.sqrt(abs(bias_squared)))
        results.append({
            "method": method, "runs": counts, "mse": mse, "slope": slope,
            "slope_standard_error": slope_error, "slope_of_last_quarter": last_slope, "bias": bias,
        })
        rows.append([method, f"{slope:.3f} ± {slope_error:.3f}", last_slope, rmse[0], rmse[-1], bias])
        curves.append((f"{method}: slope {slope:.2f}", counts, rmse))
    figure, (axes,) = panels(1, width=4.6, height=3.2)
    plot_lines(axes, curves, x="runs averaged", y="RMSE", marker="o")
    first = results[0]
    ideal = np.sqrt(first["mse"][0] / counts)
    axes.plot(counts, ideal, color="#999999", linestyle=":", label="slope −0.5")
    axes.legend()
    settings = scene_settings(scene, crop=crop, runs=count, spp=spp, reference="bdpt",
                              reference_spp=2 * reference_spp)
    paper = {"upg+bdpt": "a line of slope -0.5", "vcm": "levels off"}
    return Figure({**settings, "methods": results}, rows, figure, paper)


def _mse_of_means(images, reference):
    """Mean squared error of the means of 1, 2, 4 … images, over disjoint groups of them, by (X − R1)(X − R2)."""
    counts, mse = [], []
    n = 1
    while n <= len(images):
        means = images.reshape(len(images) // n, n, *images.shape[1:]).mean(axis=1)
        counts.append(n)
        mse.append(float(((means - reference[0]) * (means - reference[1])).mean()))
        n *= 2
    return np.array(counts), np.array(mse)


# --------------------------------------------------------------------------------- figure 8: speed

SPEED_PASSES = 100
SPEED_RADIUS = 0.1
# The paper's initial radius of VCM was 1.5 times that of UPG.
SPEED_METHODS = (f"upg+bdpt:radius={SPEED_RADIUS}", f"vcm:radius={1.5 * SPEED_RADIUS:g}",
                 f"vcm:radius={1.5 * SPEED_RADIUS:g},alpha=1")


def speed(runs, seconds):
    """Fig. 8: eye paths a second, and pairs merged or gathered a second, pass by pass."""
    (scene,) = runs.available("veach-ajar")
    passes = max(20, round(min(1, runs.scale) * SPEED_PASSES))
    repeats = max(1, runs.spp_within(scene, SPEED_METHODS, seconds / len(SPEED_METHODS)) // passes)
    times = {method: [] for method in SPEED_METHODS}
    pairs = {method: [] for method in SPEED_METHODS}
    for i in range(repeats):  # alternating, so that changes of the machine's speed affect all methods
        for method in SPEED_METHODS if i % 2 == 0 else SPEED_METHODS[::-1]:
            stats, image = runs.render(scene, method, spp=passes, seed=FIRST_SEED + i)
            times[method].append(stats["pass_seconds"])
            pairs[method].append(stats["pass_pairs"])
    eye_paths = image.shape[0] * image.shape[1]
    what = {"eye paths": {m: eye_paths / np.median(times[m], axis=0) for m in times},
            "pairs": {m: np.median(pairs[m], axis=0) / np.median(times[m], axis=0) for m in times}}
    rows = [["method", "a second", "in the first tenth", "in the last tenth", "drift, first to last pass"]]
    results = []
    figure, axes = panels(len(what), width=3.8, height=2.9)
    for (name, speeds), a in zip(what.items(), axes):
        for method, speed_of_pass in speeds.items():
            drift, error = _drift(speed_of_pass)
            first, last = (float(part.mean()) for part in (speed_of_pass[:passes // 10],
                                                           speed_of_pass[-(passes // 10):]))
            results.append({"method": method, "a second": name, "first_tenth": first,
                            "last_tenth": last, "drift": drift, "drift_standard_error": error})
            rows.append([method, name, first, last, f"{100 * drift:+.1f} ± {100 * error:.1f} %"])
        plot_lines(a, [(method, np.arange(1, passes + 1), s / 1000) for method, s in speeds.items()],
                   x="pass", y=f"thousand {name} a second", logarithmic=False)
        a.set_ylim(bottom=0)
    axes[0].legend(loc="lower right")
    paper = {"vcm": "falls; below upg+bdpt after about two hours", "upg+bdpt": "constant",
             "radius of vcm over that of upg": 1.5, "time of a photon, upg over vcm": 4}
    settings = scene_settings(scene, passes=passes, repeats=repeats)
    return Figure({**settings, "speeds": results, "pass_seconds": times, "pass_pairs": pairs}, rows,
                  figure, paper)


def _drift(speeds):
    """Relative change of the speed from the first to the last pass, by a linear fit, and its standard error. The first
    tenth is left out: memory is still being claimed."""
    speeds = speeds[len(speeds) // 10:]
    x = np.linspace(-0.5, 0.5, len(speeds))
    slope = (x * speeds).sum() / (x**2).sum()
    rest = speeds - speeds.mean() - slope * x
    error = np.sqrt((rest**2).sum() / (len(x) - 2) / (x**2).sum())
    return float(slope / speeds.mean()), float(error / speeds.mean())


# -------------------------------------------------------------------------------- figure 9: trials

TRIAL_SCENES = ("cornell-box", "veach-ajar", "staircase2", "veach-bidir", "living-room")
BOUNDS = ("box", "cone", "slab")


def trials(runs, seconds):
    """Fig. 9: Bernoulli trials of a pair, by the bound of the directions that they propose."""
    scenes = runs.available(*TRIAL_SCENES)
    rows = [["scene", "bound", "trials a visible pair", "a pair", "rays of trials", "Var(r)/E(r)²"]]
    results = []
    share = seconds / len(scenes) / len(BOUNDS)
    figure, axes = panels(len(scenes), width=2.5, height=2.6, sharey=True)
    for scene, a in zip(scenes, axes):
        spp = runs.spp_within(scene, ["upg+bdpt"], share)
        for i, bound in enumerate(BOUNDS):
            stats, _ = runs.render(scene, f"upg+bdpt:bound={bound}", spp=spp)
            visible, histogram = stats["visible_pairs"], np.trim_zeros(stats["pairs_by_trials"], "b")
            result = {
                **scene_settings(scene, bound=bound, spp=spp),
                **{key: stats[key] for key in ("pairs", "visible_pairs", "trials", "trial_rays")},
                "trials_per_visible_pair": stats["trials"] / visible,
                "trials_per_pair": stats["trials"] / stats["pairs"],
                "rays_per_visible_pair": stats["trial_rays"] / visible,
                # r ∝ N is geometric: E(r²)/E(r)² − 1 is the share of trials that fail at first.
                "relative_variance": 1 - histogram[0] / visible,
                "pairs_by_trials": histogram,
                **{key: stats[key] for key in ("runaways", "bounds_exceeded")},
            }
            results.append(result)
            rows.append([scene, bound] + [result[key] for key in (
                "trials_per_visible_pair", "trials_per_pair", "rays_per_visible_pair",
                "relative_variance")])
            shown = np.append(histogram[:6], sum(histogram[6:]))
            a.bar(np.arange(len(shown)) + (i - 1) * 0.27, 100 * shown / visible, 0.27, label=bound)
        a.set_title(scene)
        a.set_xticks(range(7), ["1", "2", "3–4", "5–8", "–16", "–32", "more"], fontsize=7)
        a.set_xlabel("trials")
    axes[0].set_ylabel("% of visible pairs")
    axes[0].legend()
    paper = {"trials a pair, over its scenes": [2.60, 2.87], "in its fig. 9": 2.81}
    what = "pairs_by_trials: visible pairs with 1, 2, 3-4, 5-8, ... trials"
    return Figure({"what": what, "runs": results}, rows, figure, paper)


# -------------------------------------------------------------------------------- figure 10: radius

RADII = (0.01, 0.02, 0.04, 0.08, 0.16, 0.32)


def radius(runs, seconds):
    """Fig. 10: radius of gathers and merges."""
    scene = "ajar"
    families = {"upg+bdpt": "upg+bdpt:radius={}", "vcm": "vcm:radius={}"}
    methods = [form.format(r) for form in families.values() for r in RADII]
    comparison = runs.compare(scene, ["bdpt", *methods], seconds=seconds)
    by_name = {m["method"]: m for m in comparison["methods"]}
    base = by_name["bdpt"]
    rows = [["method", "radius", "pairs an eye path", "time a sample over bdpt's", "relMSE", "trimmed",
             "efficiency", "efficiency, trimmed", "mean ratio"]]
    pairs = {}
    for r in RADII:
        stats, _ = runs.render(scene, families["upg+bdpt"].format(r), spp=2)
        pairs[r] = stats["pairs"] / stats["eye_paths"]
    curves = {"rel_mse": [], "rel_mse_trimmed": [], "time": []}
    for family, form in families.items():
        found = [by_name[form.format(r)] for r in RADII]
        times = [(m["seconds"] / m["spp"]) / (base["seconds"] / base["spp"]) for m in found]
        for r, m, time in zip(RADII, found, times):
            m.update(radius=r, time_per_sample_over_bdpt=time)
            if family == "upg+bdpt":
                m["pairs_per_eye_path"] = pairs[r]
            rows.append([family, r, m.get("pairs_per_eye_path"), time, m["rel_mse"],
                         m["rel_mse_trimmed"], m["efficiency"], m["efficiency_trimmed"],
                         m["mean_ratio"]["value"]])
        curves["time"].append((family, RADII, times))
        for error in ("rel_mse", "rel_mse_trimmed"):
            curves[error].append((family, RADII, [m[error] for m in found]))
    figure, axes = panels(3, width=3, height=2.8)
    titles = {"rel_mse": "relMSE at equal time", "rel_mse_trimmed": "relMSE, trimmed",
              "time": "time of a sample / bdpt"}
    for a, (what, lines) in zip(axes, curves.items()):
        plot_lines(a, lines, title=titles[what], x="radius", marker="o")
        a.axhline(1 if what == "time" else base[what], color="#999999", linestyle=":", label="bdpt")
    axes[0].legend()
    paper = {"upg+bdpt": "not sensitive to small changes; excessive radii cost",
             "vcm": "more radius: less variance, more bias"}
    return Figure(comparison, rows, figure, paper)


# ---------------------------------------------------------------------- figure 11: leak and darkening

LEAK_RADIUS = 0.08
LEAK_METHODS = {
    "reference (bdpt)": "bdpt",
    "vcm": f"vcm:radius={LEAK_RADIUS},alpha=1",
    "vcm, exact": f"vcm:radius={LEAK_RADIUS},alpha=1,exact=true",
    "upg+bdpt": f"upg+bdpt:radius={LEAK_RADIUS}",
}
# x, y, w, h in pixels.
LEAK_REGIONS = {
    "foot": (61, 70, 4, 5),
    "crease": (78, 61, 20, 2),
    "edge": (80, 79, 24, 3),
    "floor": (16, 73, 16, 10),
}
LEAK_RUNS = 8


def leak(runs, seconds):
    """Fig. 11: light leaks and darkening of vcm, with approximate and with exact paths, and of upg+bdpt."""
    scene = "leak"
    share = seconds / len(LEAK_METHODS) / LEAK_RUNS
    spp = {name: runs.spp_within(scene, [method], share) for name, method in LEAK_METHODS.items()}
    images = {
        name: np.array([
            runs.render(scene, method, spp=spp[name], seed=FIRST_SEED + 1000 * i + j)[1]
            for j in range(LEAK_RUNS)
        ])
        for i, (name, method) in enumerate(LEAK_METHODS.items())
    }
    reference = next(iter(images))
    rows, results = [["method", *LEAK_REGIONS]], []
    for name, method in list(LEAK_METHODS.items())[1:]:
        regions = {
            region: _relative_difference(images[name], images[reference], box)
            for region, box in LEAK_REGIONS.items()
        }
        results.append({"method": method, "spp": spp[name], "regions": regions})
        rows.append([name] + [f"{100 * d:+.1f} ± {100 * e:.1f} %" for d, e in regions.values()])
    means = {name: i.mean(axis=0) for name, i in images.items()}
    exposure = 0.3 / np.percentile(means[reference], 60)
    figure = plot_pictures(means, exposure, boxes=LEAK_REGIONS.items())
    settings = scene_settings(scene, runs=LEAK_RUNS, reference="bdpt",
                              reference_spp=spp[reference],
                              regions={"what": "x, y, width, height", **LEAK_REGIONS})
    what = "difference of the mean to the reference's over the latter, and its standard error"
    paper = {"vcm": "leaks, blurred shadows", "exact": "reduced, but darkening at sharp features",
             "upg+bdpt": "none"}
    return Figure({**settings, "what": what, "methods": results}, rows, figure, paper, True)


def _relative_difference(images, reference, box):
    x, y, w, h = box
    a, b = (i[:, y:y + h, x:x + w].mean(axis=(1, 2, 3)) for i in (images, reference))
    error = np.sqrt((a.var(ddof=1) + b.var(ddof=1)) / len(a)) / b.mean()
    return float(a.mean() / b.mean() - 1), float(error)


# ----------------------------------------------------------------------------- table 1: path lengths

# With a substitute scene: the paper's scene, "stairs", is not public.
DEPTHS = {"1..2": "k ≤ 2", "3..3": "k = 3", "4..4": "k = 4", "5..": "k > 4"}
PAPER_DEPTHS = {"bdpt": (0.0074, 0.0614, 0.0733, 0.1570), "upg": (0.0123, 0.0333, 0.0310, 0.0418)}


def depth(runs, seconds):
    """Table 1: errors of paths of k edges alone, at equal time."""
    scenes = runs.available("veach-ajar", "staircase2")
    rows = [["scene", "", "RMSE, bdpt", "upg+bdpt", "ratio", "ratio of relMSE", "trimmed", "paper: bdpt",
             "upg", "ratio"]]
    results = {}
    theirs = np.array([PAPER_DEPTHS["bdpt"], PAPER_DEPTHS["upg"]])
    ratios = {scene: [] for scene in scenes}
    for scene in scenes:
        results[scene] = {}
        for (lengths, title), (bdpt_there, upg_there) in zip(DEPTHS.items(), theirs.T):
            comparison = runs.compare(scene, ["bdpt", "upg+bdpt"], lengths=lengths,
                                      seconds=seconds / len(DEPTHS) / len(scenes))
            bdpt, upg = comparison["methods"]
            results[scene][title] = comparison
            ratio = {name: upg[name] / bdpt[name] if bdpt[name] > 0 else None
                     for name in ("rmse", "rel_mse", "rel_mse_trimmed")}
            ratios[scene].append(ratio["rmse"] or 0)
            rows.append([scene, title, bdpt["rmse"], upg["rmse"], *ratio.values(), bdpt_there, upg_there,
                         upg_there / bdpt_there])
    figure, (axes,) = panels(1, width=4.2, height=2.8)
    bars = {f"here, {scene}": values for scene, values in ratios.items()}
    bars["paper, stairs"] = theirs[1] / theirs[0]
    for i, (label, values) in enumerate(bars.items()):
        axes.bar(np.arange(len(DEPTHS)) + 0.27 * (i - 1), values, 0.27, label=label)
    axes.axhline(1, color="#999999", linestyle=":")
    axes.set_xticks(range(len(DEPTHS)), DEPTHS.values())
    axes.set_ylabel("RMSE of upg+bdpt / bdpt")
    axes.legend()
    paper = {"scene": "stairs", "lengths": list(DEPTHS), "rmse": PAPER_DEPTHS}
    return Figure(results, rows, figure, paper)


# ------------------------------------------------------------------------------ table 2: end points

DROPS = ("gloss", "eye", "light", "both")
# x̄(s',t'-1) lacks the eye's end point, x̄(s'-1,t') the light's. Its scene, "living room", is not public.
PAPER_DROPS = {"eye": 0.0438, "light": 0.0172, "both": 0.0274, "gloss": 0.0148}


def endpoint(runs, seconds):
    """Table 2: which end point of a pair is dropped, for paths of three edges and more (the paper: all)."""
    scenes = runs.available("living-room", "veach-ajar")
    methods = [f"upg+bdpt:drop={drop}" for drop in DROPS]
    rows = [["scene", "drop", "equal time: RMSE", "relMSE", "trimmed", "over gloss",
             "equal samples: relMSE", "trimmed", "over gloss", "paper: RMSE", "over gloss"]]
    results = {}
    figure, axes = panels(len(scenes), width=3.2, height=2.6)
    for scene, a in zip(scenes, axes):
        time = runs.compare(scene, methods, seconds=seconds / len(scenes) / 2, lengths="3..")
        spp = max(1, round(min(m["spp"] for m in time["methods"])))
        samples = runs.compare(scene, methods, spp=spp, lengths="3..")
        results[scene] = {"equal_time": time, "equal_samples": samples}
        base, base_samples = (c["methods"][0]["rel_mse_trimmed"] for c in (time, samples))
        for drop, m, s in zip(DROPS, time["methods"], samples["methods"]):
            rows.append([scene, drop, m["rmse"], m["rel_mse"], m["rel_mse_trimmed"],
                         m["rel_mse_trimmed"] / base, s["rel_mse"], s["rel_mse_trimmed"],
                         s["rel_mse_trimmed"] / base_samples, PAPER_DROPS[drop],
                         PAPER_DROPS[drop] / PAPER_DROPS["gloss"]])
        plot_lines(a, [(drop, *mean_curve(m, "rel_mse_trimmed"))
                       for drop, m in zip(DROPS, time["methods"])],
                   title=scene, x="seconds", y="relMSE, trimmed")
    axes[0].legend()
    paper = {"scene": "living room", "rmse at equal time": PAPER_DROPS}
    return Figure(results, rows, figure, paper)


# ---------------------------------------------------------------------------- figure 12: guided paths

GUIDED_METHODS = ("bdpt", "bdpt:guide=on", "upg+bdpt", "upg+bdpt:guide=on")


def guided(runs, seconds):
    """Fig. 12: bdpt and upg+bdpt, guided and not, at equal time, training included; upg+bdpt also at equal samples."""
    scenes = runs.available("veach-ajar", "lantern")
    figure = at_equal_time(runs, scenes, GUIDED_METHODS, seconds * 4 / 5, paper={
        "at equal time": "upg+bdpt better than guided bdpt",
        "at equal samples": "guided upg+bdpt somewhat better than upg+bdpt"})
    for scene in scenes:
        spp = min(m["spp"] for m in figure.results[scene]["methods"][2:])
        samples = runs.compare(scene, GUIDED_METHODS[2:], spp=max(1, round(spp)), runs=2,
                               size=LARGE[scene])
        figure.results[scene] = {"equal_time": figure.results[scene], "equal_samples": samples}
        figure.rows += equal_time_rows(f"{scene}, equal samples", samples)
    return figure


# ------------------------------------------------------------------------------ figure 14: equal time

EQUAL_TIME_SCENES = ("veach-ajar", "staircase2", "living-room", "veach-bidir", "ring")
EQUAL_TIME_METHODS = ("bdpt", "path", "vcm", "sppm", "upg+bdpt")


def equal_time(runs, seconds):
    """Fig. 14: equal time; the paper's scenes are not public."""
    scenes = runs.available(*EQUAL_TIME_SCENES)
    rows = [["scene", "method", "spp", "relMSE", "trimmed", "FLIP", "mean ratio", "efficiency",
             "efficiency, trimmed"]]
    results = {}
    figure, axes = panels(len(scenes), width=2.6, height=2.7)
    for scene, a in zip(scenes, axes):
        comparison = runs.compare(scene, EQUAL_TIME_METHODS, seconds=seconds / len(scenes), runs=2)
        results[scene] = comparison
        for m in comparison["methods"]:
            rows.append([scene, m["method"], round(m["spp"]), m["rel_mse"], m["rel_mse_trimmed"],
                         m["flip"], m["mean_ratio"]["value"], m["efficiency"],
                         m["efficiency_trimmed"]])
        plot_lines(a, [(m["method"], *mean_curve(m, "rel_mse_trimmed"))
                       for m in comparison["methods"]], title=scene, x="seconds")
    axes[0].set_ylabel("relMSE, trimmed")
    axes[0].legend()
    return Figure(results, rows, figure)
