"""Lines over speed for the levels of a selection: colours, means with intervals, tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from aqualog.campaign.bins import Pool
from aqualog.figures.measures import Means
from aqualog.figures.record import Axis, Line, Table
from aqualog.figures.selection import Level, Selected
from aqualog.report.theme import WHEEL_COLOURS

__all__ = ["PALETTE", "V_KMH", "Style", "means_line", "means_table", "shifts", "styles", "thinned"]

# wheels have their own colours, so levels take these last
PALETTE = ("#E69F00", "#56B4E9", "#7F6BB3", "#8C6D31", *WHEEL_COLOURS.values())
V_KMH = Axis("velocity", "km/h")
_SYMBOLS = ("circle", "square", "diamond", "cross", "triangle-up", "x", "star", "hexagon")
_DASHES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot", "5px", "10px")
_MOST_POINTS = 2500  # of one cloud: what a page can hold and an eye can see

Style = tuple[str, str, str]
"""Colour, dash, symbol."""


def styles(selected: Selected) -> dict[str, Style]:
    """Style of each level by its name: of two varied families the first sets the colour, the second the dash."""
    levels = selected.levels
    if len(selected.wish.varies) < 2:
        return {x.name: (PALETTE[i % len(PALETTE)], "solid", _SYMBOLS[i % len(_SYMBOLS)]) for i, x in enumerate(levels)}
    first = list(dict.fromkeys(x.value[0] for x in levels))
    rest = list(dict.fromkeys(x.value[1:] for x in levels))
    return {
        x.name: (
            PALETTE[first.index(x.value[0]) % len(PALETTE)], _DASHES[rest.index(x.value[1:]) % len(_DASHES)],
            _SYMBOLS[rest.index(x.value[1:]) % len(_SYMBOLS)],
        )
        for x in levels
    }  # fmt: skip


def means_line(name: str, means: Means, style: Style, *, shift: float = 0.0) -> Line:
    """Means with their intervals over speed; `shift` [km/h] keeps bars of several lines apart."""
    colour, dash, symbol = style
    return Line(
        name, means.v_kmh + shift, means.mean, low=means.low, high=means.high, colour=colour, dash=dash, width=1.6,
        mode="lines+markers", symbol=symbol,
    )  # fmt: skip


def shifts(levels: Sequence[Level]) -> dict[str, float]:
    """Small shifts along the speed that keep the bars apart. [km/h]"""
    n = len(levels)
    return {x.name: 0.6 * (i - 0.5 * (n - 1)) for i, x in enumerate(levels)}


def means_table(title: str, means: Mapping[str, Means], digits: int) -> Table:
    """Bins of all levels with intervals and counts."""
    rows = []
    for name, m in means.items():
        for i in range(m.v_kmh.size):
            ci = f"{m.low[i]:.{digits}f} to {m.high[i]:.{digits}f}" if np.isfinite(m.low[i]) else "–"
            rows.append(
                (name, f"{m.v_kmh[i]:.0f}", f"{m.mean[i]:.{digits}f}", ci, f"{m.runs[i]:.0f}", f"{m.samples[i]:.0f}")
            )
    return Table(title, ("level", "km/h", "mean", "95 %", "runs", "samples"), tuple(rows))


def thinned(pool: Pool) -> slice:
    """Every so many of the samples, so that a cloud has not more than can be drawn."""
    return slice(None, None, max(1, -(-pool.step.size // _MOST_POINTS)))
