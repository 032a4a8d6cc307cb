"""Tables, plots, pictures and JSON of the figures."""

import dataclasses
import json

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import matplotlib.ticker
import numpy as np

# Makes output files reproducible.
plt.rcParams.update({
    "svg.hashsalt": "etendue",
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.4,
    "lines.markersize": 3.5,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
})
SIGNIFICANT_DIGITS = 6


@dataclasses.dataclass
class Figure:
    """Contents of a figure. `paper` has the results stated in the paper; the first row of `rows` is the table's header."""

    results: object
    rows: list
    plot: object
    paper: dict = dataclasses.field(default_factory=dict)
    is_picture: bool = False


def panels(count, height=2.8, width=3.6, **options):
    figure, axes = plt.subplots(1, count, figsize=(width * count, height), squeeze=False, **options)
    return figure, list(axes[0])


def plot_lines(axes, curves, *, title="", x="", y="", logarithmic=True, marker=None):
    """curves: (label, x, y) each."""
    for label, xs, ys in curves:
        axes.plot(xs, ys, marker=marker, label=label)
    if logarithmic:
        axes.set_xscale("log")
        axes.set_yscale("log")
        _label_few_values(axes.xaxis)
        _label_few_values(axes.yaxis)
    axes.set_title(title)
    axes.set_xlabel(x)
    axes.set_ylabel(y)


def _label_few_values(axis):
    """Labels 1, 2, 5, 10 … for a short axis, otherwise powers of ten."""
    low, high = axis.get_view_interval()
    factors = (1, 2, 5) if high < 50 * low else (1,)
    axis.set_major_locator(matplotlib.ticker.LogLocator(subs=factors))
    axis.set_major_formatter(matplotlib.ticker.StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(matplotlib.ticker.NullFormatter())


def displayed(image, exposure):
    """sRGB image; a radiance of 1/exposure is mapped to half of white [Reinhard et al. 2002]."""
    x = np.maximum(image, 0) * exposure
    x = x / (1 + x)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def plot_pictures(images, exposure, *, boxes=(), zoom=2):
    """Images side by side with their names below, and boxes (x, y, w, h) in the first one."""
    first = next(iter(images.values()))
    height, width = (zoom * n / 100 for n in first.shape[:2])
    figure, axes = panels(len(images), height=height + 0.35, width=width + 0.03)
    figure.set_constrained_layout_pads(w_pad=0.02, h_pad=0.02, wspace=0, hspace=0)
    for a, (name, image) in zip(axes, images.items()):
        a.imshow(displayed(image, exposure), interpolation="nearest")
        a.set_anchor("N")
        a.set_xlabel(name)
        a.set_xticks([])
        a.set_yticks([])
        a.grid(False)
        a.spines[:].set_visible(False)
    for name, (x, y, w, h) in boxes:
        axes[0].add_patch(plt.Rectangle((x, y), w, h, fill=False, edgecolor="#ffcc00", lw=1))
        axes[0].annotate(name, (x + w, y), color="#ffcc00", fontsize=7)
    return figure


def text_table(rows):
    """Markdown, aligned."""
    cells = [[format_number(c) for c in row] for row in rows]
    widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))]
    lines = ["| " + " | ".join(c.ljust(w) for c, w in zip(row, widths)) + " |" for row in cells]
    lines.insert(1, "| " + " | ".join("-" * max(3, w) for w in widths) + " |")
    return "\n".join(lines)


def format_number(value):
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
    return str(value)


def save(name, folder, figure, description):
    """Writes NAME.json and NAME.svg or .png."""
    folder.mkdir(parents=True, exist_ok=True)
    content = {"figure": name, **description, "paper": figure.paper, "results": figure.results}
    (folder / f"{name}.json").write_text(_json(_rounded(content)) + "\n")
    if figure.is_picture:
        figure.plot.savefig(folder / f"{name}.png", dpi=100, metadata={"Software": None})
    else:
        figure.plot.savefig(folder / f"{name}.svg", metadata={"Date": None, "Creator": None})
    plt.close(figure.plot)


def _rounded(value):
    if isinstance(value, dict):
        return {key: _rounded(v) for key, v in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_rounded(v) for v in value]
    if isinstance(value, (float, np.floating)):
        return float(f"{value:.{SIGNIFICANT_DIGITS}g}") if np.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    return value


def _json(value, indent=""):
    """JSON with lists of numbers on one line."""
    inner = indent + " "
    if isinstance(value, dict) and value:
        items = [f"{inner}{json.dumps(k)}: {_json(v, inner)}" for k, v in value.items()]
        return "{\n" + ",\n".join(items) + f"\n{indent}}}"
    if isinstance(value, list) and any(isinstance(v, (dict, list)) for v in value):
        return "[\n" + ",\n".join(inner + _json(v, inner) for v in value) + f"\n{indent}]"
    return json.dumps(value, ensure_ascii=False)
