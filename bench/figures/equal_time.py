"""Comparisons at equal time on images of the size that a user would render."""

from output import Figure, panels, plot_lines
from runs import mean_curve

LARGE = {
    "keyhole": (320, 240),
    "lantern": (320, 240),
    "living-room": (320, 180),
    "mirror-box": (320, 240),
    "two-rooms": (320, 240),
    "veach-ajar": (320, 180),
}
RUNS = 2
# In that of a method. A relative error is also divided by the reference's pixels: if they are about as noisy as the image,
# errors are too large, although the mean of the reference's noise is subtracted.
REFERENCE_TIME = 10
HEAD = ["scene", "method", "spp", "relMSE", "trimmed", "spike", "mean ratio"]


def at_equal_time(runs, scenes, methods, seconds, *, paper, **options):
    """A figure of the methods' errors: its results by scene are those of Runs.compare()."""
    rows, results = [HEAD], {}
    figure, axes = panels(len(scenes), width=3.2, height=2.8)
    for scene, a in zip(scenes, axes):
        comparison = compare_large(runs, scene, methods, seconds / len(scenes), **options)
        results[scene] = comparison
        rows += equal_time_rows(scene, comparison)
        plot_lines(a, [(m["method"], *mean_curve(m, "rel_mse_trimmed"))
                       for m in comparison["methods"]], title=scene, x="seconds")
    axes[0].set_ylabel("relMSE, trimmed")
    axes[0].legend()
    return Figure(results, rows, figure, paper)


def compare_large(runs, scene, methods, seconds, **options):
    """Runs.compare() with a reference that takes REFERENCE_TIME times as long as each image of a method."""
    return runs.compare(scene, methods, seconds=seconds, runs=RUNS, size=LARGE[scene],
                        reference_seconds=REFERENCE_TIME * seconds / len(methods) / RUNS, **options)


def equal_time_rows(scene, comparison):
    return [[scene, m["method"], round(m["spp"]), m["rel_mse"], m["rel_mse_trimmed"], m["spike"],
             m["mean_ratio"]["value"]] for m in comparison["methods"]]
