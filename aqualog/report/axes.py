"""Axes, colours and layout shared by the slip-slope figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.report.theme import GRID, INK, MUTED

__all__ = ["axis", "layout", "rounded", "see_through"]


def rounded(values: FloatArray) -> list[float | None]:
    """Numbers with five digits, None for NaN and infinities."""
    return [float(f"{v:.5g}") if math.isfinite(v) else None for v in np.asarray(values, dtype=np.float64).tolist()]


def see_through(colour: str, opacity: float = 0.22) -> str:
    """`#0072B2` as rgba; grey for a colour that the page sets."""
    if not colour.startswith("#"):
        return f"rgba(128,128,128,{opacity})"
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity})"


def axis(title: str, limits: Sequence[float] | None = None) -> dict[str, Any]:
    """An axis in the page's colours."""
    out: dict[str, Any] = {
        "title": {"text": title, "font": {"size": 12}}, "gridcolor": GRID, "zerolinecolor": MUTED, "linecolor": MUTED,
        "tickcolor": MUTED, "tickfont": {"size": 11},
    }  # fmt: skip
    if limits is not None:
        out["range"] = [float(f"{v:.6g}") for v in limits]
    return out


def layout(title: str, x: dict[str, Any], y: dict[str, Any], *, height: int = 400) -> dict[str, Any]:
    """A layout with one pair of axes."""
    return {
        "title": {"text": title, "font": {"size": 14}, "x": 0.01, "y": 0.985, "yanchor": "top"},
        "font": {"color": INK, "size": 12, "family": 'system-ui, "Segoe UI", Helvetica, Arial, sans-serif'},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "height": height,
        "margin": {"l": 60, "r": 16, "t": 34, "b": 50},
        "legend": {"orientation": "h", "x": 0, "y": -0.18, "yanchor": "top", "font": {"size": 11}},
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": MUTED, "activecolor": INK},
        "hovermode": "closest",
        "xaxis": x,
        "yaxis": y,
    }
