"""Pieces of HTML for notebooks."""

import base64
import html
from typing import Any

import numpy as np

from . import _etendue


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


def frame_of(rows: list[dict[str, Any]]) -> Any:
    """A pandas.DataFrame where pandas is installed, otherwise the rows themselves."""
    try:
        import pandas
    except ImportError:
        return rows
    return pandas.DataFrame(rows)
