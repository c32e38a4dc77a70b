"""Panels of a campaign's runs: means and clouds over speed, speeds over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from aqualog.campaign.bins import Pool
from aqualog.campaign.results import RunInfo
from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray
from aqualog.report.theme import INK, WATER, WHEEL_COLOURS, wheel_colour
from aqualog.thesis.evidence.campaign import KMH, DriveRun, Evidence
from aqualog.thesis.evidence.measures import Means
from aqualog.thesis.evidence.selection import Level, Selected
from aqualog.thesis.figures.time_panels import WHEEL_WORDS
from aqualog.thesis.record import Axis, Line, Panel, Table

__all__ = [
    "PALETTE", "TIME", "V_KMH", "Style", "aligned", "clouds", "means_line", "means_table", "shifts", "speed_panels",
    "spread_over", "styles", "water_of",
]  # fmt: skip

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


ENTRY_S = 1.0  # [s] on the common time axis, as in the thesis' Figures 2.3 and 2.5
_AFTER_S = 1.0
_LONGEST_S = 20.0  # on water that is drawn
TIME = Axis("t (water from 1 s)", "s")


def aligned(r: DriveRun) -> tuple[slice, FloatArray]:
    """Samples that are drawn, and their time from a second before the entry. [s]"""
    span = np.flatnonzero(r.within(r.entry - ENTRY_S, min(r.exit, r.entry + _LONGEST_S) + _AFTER_S))
    part = slice(int(span[0]), int(span[-1]) + 1)
    return part, np.round(r.t[part] - r.entry + ENTRY_S, 4)


def water_of(r: DriveRun, low: float, high: float) -> Line:
    """Entry and exit as upright lines on the common time axis."""
    leave = min(r.exit, r.entry + _LONGEST_S) - r.entry + ENTRY_S
    t = np.array([ENTRY_S, ENTRY_S, ENTRY_S, leave, leave])
    return Line("entry and exit", t, np.array([low, high, np.nan, low, high]), colour=WATER, dash="dot", width=1.2)


def speed_panels(evidence: Evidence, runs: Sequence[RunInfo]) -> list[Panel]:
    """A panel per run, each on its own scale: wheel speeds on the centre line and velocity, in km/h."""
    panels = []
    for info in runs:
        r = evidence.drive(info)
        part, t = aligned(r)
        lines = [
            Line(WHEEL_WORDS[w], t, r.feature(f"v_w_{w}")[part] / KMH, colour=wheel_colour(w), width=1.5)
            for w in WHEELS
        ]
        lines = [line for line in lines if np.isfinite(line.y).any()]
        lines.append(Line("velocity", t, r.velocity[part] / KMH, colour=INK, dash="dash", width=1.5))
        every = np.concatenate([line.y for line in lines])
        lines.append(water_of(r, float(np.nanmin(every)), float(np.nanmax(every))))
        kind = "constant speed" if evidence.of(info).is_constant else f"{evidence.of(info).a:+.1f} m/s²"
        panels.append(Panel(f"{evidence.of(info).v / KMH:.0f} km/h, {kind}", TIME, Axis("speed", "km/h"), tuple(lines)))
    return panels


def spread_over(runs: Sequence[RunInfo], evidence: Evidence, speeds: Sequence[float]) -> list[RunInfo]:
    """For each speed [m/s] the run nearest to it that is not taken yet; by speed."""
    left = list(runs)
    taken: list[RunInfo] = []
    for v in speeds:
        if left:
            nearest = min(left, key=lambda r: (abs(evidence.of(r).v - v), r.index))
            left.remove(nearest)
            taken.append(nearest)
    return sorted(taken, key=lambda r: evidence.of(r).v)


_MOST = 2500  # points of a cloud


def clouds(evidence: Evidence, runs: Sequence[RunInfo], column: str, wheels: Sequence[str]) -> list[Line]:
    """Extremes of the slip [%] within each 0.1 s over velocity [km/h], a cloud per wheel and kind of pass.

    Parameters
    ----------
    column : str
        `slip_min` or `slip_max`: rim against car, over the car's speed.
    """
    lines = []
    for kind, is_constant in (("constant speed", True), ("accelerated", False)):
        for wheel in wheels:
            x, y = [], []
            for info in runs:
                if evidence.of(info).is_constant != is_constant:
                    continue
                samples, wet = evidence.wet(info)
                v, s = samples.array("v_x")[wet], samples.array(f"{column}_{wheel}")[wet]
                good = np.isfinite(v) & np.isfinite(s)
                x.append(v[good] / KMH)
                y.append(100.0 * s[good])
            if x and sum(p.size for p in x):
                v, s = np.concatenate(x), np.concatenate(y)
                every = slice(None, None, max(1, -(-v.size // _MOST)))
                lines.append(
                    Line(
                        f"{WHEEL_WORDS[wheel]}, {kind}", v[every], s[every], colour=wheel_colour(wheel), mode="markers",
                        symbol="circle" if is_constant else "cross", size=3.5, opacity=0.6,
                    )
                )  # fmt: skip
    return lines
