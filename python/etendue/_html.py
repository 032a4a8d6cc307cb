"""Pieces of HTML for notebooks."""

import base64
import html
from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np

from . import _etendue
from ._etendue import Description, Scene


def auto_exposure(image: Any) -> float:
    """Stops that map the 95th percentile of the luminance to 0.8, a multiple of 1/4."""
    luminance = np.asarray(image) @ np.array([0.212671, 0.715160, 0.072169], dtype=np.float32)
    finite = luminance[np.isfinite(luminance)]
    high = float(np.percentile(finite, 95)) if finite.size else 0.0
    return round(4 * float(np.log2(0.8 / high))) / 4 if high > 0 else 0.0


def png_of(image: Any, operator: str = "aces", exposure: float | None = None) -> bytes:
    """A tone-mapped PNG of radiance, shape (H, W, 3)."""
    pixels = np.ascontiguousarray(image, dtype=np.float32)
    stops = auto_exposure(pixels) if exposure is None else exposure
    return _etendue.png(_etendue.tonemap(pixels, operator, stops, 0.0))


def image_html(image: Any, operator: str = "aces", exposure: float | None = None, title: str = "") -> str:
    data = base64.b64encode(png_of(image, operator, 0.0 if operator == "srgb" else exposure)).decode()
    return f'<img src="data:image/png;base64,{data}" alt="{html.escape(title)}" title="{html.escape(title)}">'


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    return html.escape(str(value))


def table_html(rows: list[dict[str, Any]]) -> str:
    if not rows:
        return ""
    head = "".join(f"<th>{html.escape(name)}</th>" for name in rows[0])
    body = "".join("<tr>" + "".join(f"<td>{_cell(v)}</td>" for v in row.values()) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _short(value: Any) -> str:
    """A parameter in one line; of meshes and images, their size."""
    if not isinstance(value, dict):
        text = ", ".join(map(_short, value)) if isinstance(value, list) else f"{value:.6g}" if isinstance(value, float) else str(value)
        return text if len(text) <= 100 else text[:99] + "…"
    if "positions" in value:
        return f"{len(value['positions'])} vertices, {len(value['triangles'])} triangles"
    if "bytes" in value:
        return f"{len(value['bytes'])} bytes"
    return _short(value.get("value", value))


def _object_rows(prefix: str, objects: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """A row for each object of a description."""
    for key, value in objects.items():
        if not isinstance(value, dict) or "type" not in value or value["type"] == "rgb":
            continue
        nested = {k: v for k, v in value.items() if isinstance(v, dict) and v.get("type", "rgb") != "rgb"}
        own = ", ".join(f"{k} = {_short(v)}" for k, v in value.items() if k not in nested and k != "type")
        yield {"path": prefix + key, "type": value["type"], "parameters": own}
        yield from _object_rows(f"{prefix}{key}.", nested)


def description_html(description: Description) -> str:
    """A table of the objects, or of the first ones."""
    most = 200
    rows = list(islice(_object_rows("", description.to_dict()), most + 1))
    rest = "<p>… and others</p>" if len(rows) > most else ""
    return f"<p>{html.escape(repr(description))}</p>{table_html(rows[:most])}{rest}"


def scene_html(scene: Scene) -> str:
    """A table of what the scene consists of, and its warnings."""
    info = {"size": f"{scene.width} x {scene.height}", "sensor": scene.sensors[scene.sensor], **scene.info()}
    rows = [{"": name.replace("_", " "), "value": value} for name, value in info.items()]
    notes = "".join(f"<li>{html.escape(w)}</li>" for w in scene.warnings)
    return f"<p>{html.escape(repr(scene))}</p>{table_html(rows)}" + (f"<ul>{notes}</ul>" if notes else "")


def frame_of(rows: list[dict[str, Any]]) -> Any:
    """A pandas.DataFrame where pandas is installed, otherwise the rows themselves."""
    try:
        import pandas
    except ImportError:
        return rows
    return pandas.DataFrame(rows)
