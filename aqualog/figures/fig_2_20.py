"""Figure 2.20: slip slope of driven wheels over speed by tyre pressure and load."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aqualog.figures.bin_lines import line_of_logs, usable
from aqualog.figures.evidence import Evidence
from aqualog.figures.measures import TEN, Effect
from aqualog.figures.record import Figure, Finding, judged
from aqualog.figures.selection import Wish, marks
from aqualog.figures.slope_figure import Slopes, slope_figure
from aqualog.figures.tyres import WORN

__all__ = ["make"]

NUMBER = "2.20"
_WISH = Wish(("pressure", "load"), WORN, depth_mm=1.2, any_one=True, only_lowest_pressures=2)
_SLIGHT = 15.0  # [%] more is not "slight"


def _effects(found: Slopes) -> dict[str, Effect]:
    """Relative change of the slope by load and by pressure, which add to one curve over speed. [%]"""
    names, of_level = marks(found.levels, found.selected.wish)
    rows = [(r, m) for x, m in zip(found.levels, of_level, strict=True) for r in usable(found.of(x))]
    if not names or not rows:
        return {}
    v = np.array([r.v_mean for r, _ in rows])
    x = (v - v.mean()) / TEN
    left = np.array([float(r.wheel[1] == "l") for r, _ in rows])
    columns = [np.ones(x.size), x, x * x] + ([left] if 0.0 < left.mean() < 1.0 else [])
    fits = line_of_logs([r for r, _ in rows], columns + [np.array([m[i] for _, m in rows]) for i in range(len(names))])
    return {} if fits is None else {
        n: e.mapped(lambda x: 100.0 * math.expm1(x))
        for n, e in zip(names, fits[len(columns):], strict=True)
    }  # fmt: skip


def _c55(found: Slopes) -> Sequence[Finding]:
    effects = _effects(found)
    if not effects:
        return ()
    up = [n for n, e in effects.items() if e.is_above]
    slight = all(abs(e.value) < _SLIGHT for e in effects.values())
    name, first = next(iter(effects.items()))
    whole = len(up) == len(effects) and slight
    return (
        Finding(
            "C55",
            "Pressure and load change the slip slope slightly; it slightly rises with both.",
            "one curve over speed for all, that load and pressure each shift by a share: both intervals above 0, "
            "and both "
            f"shares below {_SLIGHT:g} %; in part: one interval above 0; value: {name}",
            "; ".join(f"{n}: {e.words(1)} %" for n, e in effects.items()),
            judged(whole=whole, part=bool(up)),
            "" if whole else "Not higher by " + ", ".join(n for n in effects if n not in up) + "."
            if len(up) < len(effects) else "More than slightly.",
            first.value, first.ci, "%",
        ),
    )  # fmt: skip


def make(evidence: Evidence) -> Figure:
    """Slopes over speed by pressure and load, a panel per wheel; C55."""
    return slope_figure(
        evidence, NUMBER, "slip slope of driven wheels over speed by tyre pressure and load", _WISH,
        "runs with two loads or at two tyre pressures, else alike, on water, with slip and traction of driven wheels",
        _c55,
    )  # fmt: skip
