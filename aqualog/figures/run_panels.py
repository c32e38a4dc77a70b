"""Panels of several runs of a campaign over time, set so that all enter the water together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aqualog.campaign.samples import RunInfo
from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray
from aqualog.figures.drive import DriveRun
from aqualog.figures.evidence import KMH, Evidence
from aqualog.figures.record import Axis, Line, Panel
from aqualog.figures.scene_panels import WHEEL_WORDS
from aqualog.report.theme import INK, WATER, wheel_colour

__all__ = ["ENTRY_S", "aligned", "speed_panels", "spread_over", "water_of"]

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
