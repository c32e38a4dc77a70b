"""Estimated slopes over time as lines, when a drop was found in words, and tangents that estimates settle at."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.report.theme import INK, MUTED, WHEEL_COLOURS
from aqualog.thesis.evidence.brush import tangent
from aqualog.thesis.evidence.half_car import (
    HIGH_SLOPE,
    LOW_SLOPE,
    Case,
    drive,
    estimate,
    false_alarms,
    first_alarm,
    is_used,
    slope_at,
)
from aqualog.thesis.record import Axis, Line, Panel, Table, seconds

__all__ = [
    "COLOURS", "TIME", "detected_s", "estimate_lines", "false_alarms_of", "is_falling", "listed",
    "settled_slopes", "slope_after", "slope_panel", "tangent_table", "told",
]  # fmt: skip

COLOURS = (*WHEEL_COLOURS.values(), "#E69F00", "#56B4E9")
"""Okabe and Ito's [okabe2008], in the order of the wheels' colours."""

TIME = Axis("t", "s")
SLOPE = Axis("slip slope", "-", limits=(0.0, 36.0))
_FROM = -2.0  # [s] of the dry road that is drawn


def slope_panel(
    title: str, cases: Mapping[str, tuple[Case, str, str]], *, t_end: float, is_split: bool = False
) -> Panel:
    """Estimated slopes of cases by name, each with its colour and dash, beside that of the road, a step at t = 0.

    `t_end` [s] and `is_split` as in `estimate_lines`.
    """
    lines = [
        line for name, (case, colour, dash) in cases.items()
        for line in estimate_lines(name, case, colour=colour, dash=dash, t_end=t_end, is_split=is_split)
    ]  # fmt: skip
    high, low = [HIGH_SLOPE] * 2, [LOW_SLOPE] * 2
    road = Line("true", np.array([_FROM, 0.0, 0.0, t_end]), np.array(high + low), colour=MUTED, dash="dot", width=1.5)
    return Panel(title, TIME, SLOPE, (*lines, road))


def estimate_lines(
    name: str, case: Case, *, colour: str = INK, dash: str = "solid", t_end: float = 12.0, is_split: bool = False
) -> list[Line]:
    """Estimated slope of a case until `t_end` [s], with a dot where the drop is found.

    `is_split`: thin and light where the estimator does not work, as in the thesis' figures 3.7 and on.
    """
    d, e = drive(case), estimate(case)
    span = (d.t >= _FROM - 1e-9) & (d.t <= t_end + 1e-9)
    t, slope, used = d.t[span], e.slope[span], is_used(e)[span]
    bold = np.where(used, slope, np.nan) if is_split else slope
    lines = [Line(name, t, bold, colour=colour, dash=dash, group=name)]
    if is_split:
        # one sample further on both sides, so that the lines meet
        near = used.copy()
        near[1:-1] &= used[:-2] & used[2:]
        thin: FloatArray = np.where(near, np.nan, slope)
        lines.append(
            Line(f"{name}, not estimating", t, thin, colour=colour, width=1.0, opacity=0.45, group=name,
                 in_legend=False)
        )  # fmt: skip
    found = first_alarm(d, e)
    if found <= t_end:
        # the estimate before the alarm's own update: the dot sits where the step begins
        lines.append(
            Line(f"{name}, found", np.array([found]), np.array([slope_at(d, e, found)]), colour=colour, mode="markers",
                 group=name, in_legend=False)
        )  # fmt: skip
    return lines


def detected_s(case: Case) -> float:
    """Time from the change to the first drop found; NaN without a detection. [s]"""
    return first_alarm(drive(case), estimate(case))


def false_alarms_of(cases: Iterable[Case]) -> int:
    """Changes that were found before there was one, over all cases."""
    return sum(false_alarms(drive(c), estimate(c)) for c in cases)


def slope_after(case: Case, t: float) -> float:
    """Estimated slope at a time after the change. [-]"""
    return slope_at(drive(case), estimate(case), t)


def told(case: Case) -> str:
    """Detection time in words: seconds, or no detection until the end of the run."""
    t = detected_s(case)
    return f"not within {case.t_end:g} s" if np.isnan(t) else f"{seconds(t)} s"


def listed(times: Sequence[float]) -> str:
    """Detection times, a dash for a missing one."""
    return " / ".join(seconds(t) for t in times)


def is_falling(times: Sequence[float]) -> bool:
    """Whether each is shorter than the one before; nothing found counts as the longest, twice in a row as no change."""
    shown = [float("inf") if np.isnan(t) else t for t in times]
    pairs = list(pairwise(shown))
    return all(b < a or (a == b == float("inf")) for a, b in pairs) and any(b < a for a, b in pairs)


_WINDOW_S = 8.0  # the last seconds of a run, one period of most


def settled_slopes(case: Case) -> tuple[float, float, float]:
    """Mean traction of both axles, tangent of the brush there, and mean estimate, over the last 8 s of a run. [-]

    Both axles slip about alike under the blind split, and the excitation swings about that point: what it shows is the
    tangent there, and not the slope at zero slip.
    """
    d, e = drive(case), estimate(case)
    last = d.t >= case.t_end - _WINDOW_S
    mu = float(0.5 * np.mean(d.mu_f[last] + d.mu_r[last]))
    slope = float(tangent(np.array([mu]), slope=LOW_SLOPE, mu_max=case.low_mu)[0])
    return mu, slope, float(np.mean(e.slope[last]))


def tangent_table(cases: Mapping[str, Case]) -> Table:
    """Estimate and tangent of several runs on the low surface."""
    rows = []
    for name, case in cases.items():
        mu, slope, estimated = settled_slopes(case)
        rows.append(
            (name, f"{mu:.3f}", f"{slope:.2f}", f"{estimated:.2f}", f"{100.0 * (estimated / slope - 1.0):+.1f}")
        )
    return Table(
        f"Slope reached at the end of the run, and the tangent C (1 - mu / mu_max)^(2/3) of the brush at the working "
        f"point (C = {LOW_SLOPE:.0f}, mu_max = 0.4)",
        ("run", "mean traction [-]", "tangent [-]", "estimate [-]", "difference [%]"),
        tuple(rows),
    )
