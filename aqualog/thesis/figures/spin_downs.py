"""Figures 2.3 and 2.4: free wheels spin down in passes over water, over time and over speed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from aqualog.campaign.bins import free_of
from aqualog.campaign.spin_downs import Pass
from aqualog.core.intervals import wilson
from aqualog.core.records import FloatArray
from aqualog.thesis.catalogue import figure_of, needs_of
from aqualog.thesis.claims import Check, judge, limit
from aqualog.thesis.evidence import measures
from aqualog.thesis.evidence.campaign import KMH, Evidence
from aqualog.thesis.evidence.selection import NotInCampaign, Selected, is_winter, label, value_of, wear_rank
from aqualog.thesis.figures.panels import STILL, V_KMH, WHEEL_WORDS, clouds, speed_panels, spread_over
from aqualog.thesis.record import Axis, Figure, Panel

__all__ = ["FIGURES"]

_NEAR = 5.0 * KMH  # [m/s] about a speed of the thesis
_SOON = limit("soon")  # [s] "immediately after entering"
_BEFORE, _BEFORE_TOL = 20.0, 5.0  # [km/h]
_LEAST = 3  # passes


def _shares(found: Sequence[Pass], kmh: float, holds: Callable[[Pass], bool], claim: str, word: str) -> Check | None:
    near = [p for p in found if abs(p.v_mean - kmh * KMH) <= _NEAR]
    if len(near) < _LEAST:
        return None
    hit = sum(holds(p) for p in near)
    low, high = wilson(hit, len(near))
    share = hit / len(near)
    outcome = f"{hit} of {len(near)} passes at {kmh:g} ± {_NEAR / KMH:g} km/h {word}"
    fields = {"full": _full(found)}
    whole = share >= 0.5 and low > 0.0
    return judge(f"{claim}.figure", outcome, whole=whole, part=hit > 0, value=share, ci95=(low, high), fields=fields)


def _full(found: Sequence[Pass]) -> str:
    v = measures.full_speed(found)
    return f"{v / KMH:.0f} km/h" if np.isfinite(v) else "no speed that was driven"


def _at_118(evidence: Evidence, found: Sequence[Pass]) -> Check | None:
    """C16: full spin-down at once at 118 km/h, and the rear spins up."""

    def at_once(p: Pass) -> bool:
        entry = evidence.of(p.info).entry
        return any(
            isinstance(t := e["start_s"], float) and t - entry <= _SOON
            for e in evidence.events(p.info, "spin_down", wheels=tuple(p.full))
        )

    rear = [p for p in found if abs(p.v_mean - 118.0 * KMH) <= _NEAR]
    ups = sum(bool(evidence.events(p.info, "spin_up")) for p in rear)
    return _shares(
        found, 118.0, at_once, "C16",
        f"with a large spin-down of a free wheel within {_SOON:g} s; a driven wheel spins up in {ups}",
    )  # fmt: skip


def rising_number(found: Sequence[Pass]) -> Check | None:
    """C15: number and depth of the minor spin-downs rise with speed, up to full aquaplaning."""
    calm = [p for p in found if not measures.has_full(p)]
    v_first = min((p.v_mean for p in calm if measures.has_minor(p)), default=np.nan)
    part = [p for p in calm if p.v_mean >= v_first - measures.TEN]
    if not np.isfinite(v_first) or len(part) < _LEAST:
        return None
    v = np.array([p.v_mean for p in part]) / measures.TEN
    columns = [np.ones(v.size), v - v.mean()]
    number = measures.over_passes(columns, np.array([sum(map(len, p.minor.values())) / p.seconds for p in part]))
    deepest = np.array([-min(x for x in p.deepest.values()) for p in part])
    depth = measures.over_passes(columns, 100.0 * deepest)
    if number is None or depth is None:
        return None
    both = [number[1].is_above, depth[1].is_above]
    outcome = (
        f"per 10 km/h {number[1].words(2)} more spin-downs a second, {depth[1].words(1)} % deeper slip "
        f"({len(part)} passes)"
    )
    value, ci95, whole = number[1].value, number[1].ci, all(both)
    why = "Several short dips merge into one longer spin-down." if both[1] else ""
    reason = "" if whole else why or "The passes are few, or cover little speed."
    return judge("C15.figure", outcome, whole=whole, part=any(both), value=value, ci95=ci95, reason=reason)


def before_full(found: Sequence[Pass]) -> Check | None:
    """C17: minor spin-downs from 20 km/h below full aquaplaning on."""
    if len(found) < _LEAST:
        return None
    (first, firsts), (full, fulls) = measures.half_speeds(found, [measures.begins, measures.has_full])
    if not (np.isfinite(first) and np.isfinite(full)):
        return None
    away = (full - first) / KMH
    low, high = (float(x) / KMH for x in np.nanquantile(fulls - firsts, (0.025, 0.975)))
    lo, hi = _BEFORE - _BEFORE_TOL, _BEFORE + _BEFORE_TOL
    whole = lo <= low and high <= hi
    outcome = (
        f"full at {full / KMH:.0f} km/h, minor from {first / KMH:.0f} km/h on: {away:.0f} km/h ({len(found)} passes)"
    )
    part, fields = low <= hi and high >= lo, {"lo": lo, "hi": hi}
    return judge("C17.figure", outcome, whole=whole, part=part, value=away, ci95=(low, high), fields=fields)


def exponential(found: Sequence[Pass]) -> Check | None:
    """C18: the deepest slip grows with speed like an exponential."""
    part = [p for p in found if not measures.has_full(p)]
    deepest = np.array([-min(p.deepest.values()) for p in part])
    v = np.array([p.v_mean for p in part]) / measures.TEN
    good = np.isfinite(deepest) & (deepest > 0.0)
    v, deepest = v[good], deepest[good]
    grown = measures.over_passes([np.ones(v.size), v - v.mean()], np.log(deepest)) if v.size > _LEAST else None
    if grown is None:
        return None
    rate = grown[1].mapped(lambda x: 100.0 * math.expm1(x))
    x = np.stack([np.ones(v.size), v - v.mean()], axis=1)
    line = float(np.sqrt(np.mean((deepest - x @ np.linalg.lstsq(x, deepest)[0]) ** 2)))
    curve = _rms_exponential(v, deepest)
    whole = rate.is_above and curve < line
    outcome = (
        f"{rate.words(0)} % deeper per 10 km/h; rms about the exponential {100 * curve:.2f} %, about the line "
        f"{100 * line:.2f} % of slip ({v.size} passes)"
    )
    why = "The slip rises, but not faster than a straight line." if rate.is_above else "No rise exceeds the scatter."
    reason = "" if whole else why
    return judge("C18.figure", outcome, whole=whole, part=rate.is_above, value=rate.value, ci95=rate.ci, reason=reason)


def _rms_exponential(v: FloatArray, y: FloatArray) -> float:
    """y = c exp(v / v_0), v_0 searched on a grid of 1 to 100 km/h: two numbers, as the line has."""
    best = np.inf
    for v0 in np.geomspace(0.1, 10.0, 200):
        e = np.exp((v - v.max()) / v0)
        best = min(best, float(np.sqrt(np.mean((y - e * (e @ y) / (e @ e)) ** 2))))
    return best


def _where(found: Sequence[Pass]) -> str:
    """In which water and at which wheels they are."""
    with_one = [p for p in found if measures.begins(p)]
    depths = sorted({label("depth", value_of(p.info, "depth")) for p in with_one})
    wheels = sorted({WHEEL_WORDS[w] for p in with_one for w in p.minor if p.minor[w] or p.full[w]})
    there = sum(label("depth", value_of(p.info, "depth")) in depths for p in found)
    return f"They are in {', '.join(depths)} ({there} passes), at {', '.join(wheels)}."


def new_tread(found: Sequence[Pass], words: str) -> Check | None:
    """C19: no minor spin-downs on new winter tyres."""
    if len(found) < _LEAST:
        return None
    hit = sum(measures.begins(p) for p in found)
    low, high = wilson(hit, len(found))
    top = max(p.v_mean for p in found) / KMH
    outcome = f"{hit} of {len(found)} passes of {words}, up to {top:.0f} km/h"
    part, share, fields = hit <= 0.05 * len(found), hit / len(found), {"where": _where(found)}
    return judge("C19.figure", outcome, whole=hit == 0, part=part, value=share, ci95=(low, high), fields=fields)


_SHOWN = (89.0, 98.0, 106.0, 118.0)  # [km/h] of the thesis, in its configuration
_BELOW = tuple(_SHOWN[-1] - v for v in _SHOWN)  # [km/h] the same below full aquaplaning, in any other


def figure_2_03(number: str, evidence: Evidence) -> Figure:
    """Four passes at constant speed over time; C14 to C17 over all passes of the configuration."""
    selected = evidence.choose(number, evidence.has_water)
    found = measures.passes_of(evidence, selected.runs)
    constant = [p.info for p in found if evidence.of(p.info).is_constant]
    if len(constant) < 2:
        raise NotInCampaign(f"needs {needs_of(number)}: {len(constant)} in {selected.fixed}", where=f"figure {number}")
    v_full = measures.full_speed(found)
    top = v_full if np.isfinite(v_full) else max(p.v_mean for p in found)
    speeds = [v * KMH for v in _SHOWN] if selected.is_thesis else [top - b * KMH for b in _BELOW]
    shown = spread_over(constant, evidence, speeds)
    listed = ", ".join(f"{v / KMH:.0f}" for v in speeds)
    half = f"half of the passes have a full spin-down at {top / KMH:.0f} km/h"
    what = half if np.isfinite(v_full) else f"the fastest pass has {top / KMH:.0f} km/h"
    at_89 = at_118 = None
    if selected.is_thesis:
        at_89 = _shares(found, 89.0, measures.has_minor, "C14", "with minor spin-downs of a free wheel")
        at_118 = _at_118(evidence, found)
    checks = (at_89, rising_number(found), at_118, before_full(found))
    counted = {r.index: "drawn, and counted" if r in shown else "counted" for r in selected.runs}
    return figure_of(
        number, speed_panels(evidence, shown), checks, runs=selected.used(counted), fixed=selected.fixed,
        speeds=listed, what=what,
    )  # fmt: skip


def _deep(evidence: Evidence, selected: Selected) -> Check | None:
    """C19 over the passes of winter tyres that are less worn than the tyres shown."""
    shown = wear_rank(value_of(selected.runs[0], "tyre"))
    runs = [
        r for r in evidence.data.done
        if not evidence.has_water(r) and is_winter(tyre := value_of(r, "tyre")) and shown is not None
        and (rank := wear_rank(tyre)) is not None and rank > shown
    ]  # fmt: skip
    if not runs:
        return None
    return new_tread(measures.passes_of(evidence, runs), label("tyre", value_of(runs[0], "tyre")))


def figure_2_04(number: str, evidence: Evidence) -> Figure:
    """Clouds of slips of the free wheels; C17 to C19."""
    selected = evidence.choose(number, evidence.has_water)
    lines = clouds(evidence, selected.runs, "slip_min", free_of(selected.runs[0]))
    if not lines:
        raise NotInCampaign(
            "needs wheel speeds and the car's speed on water: no slip in any pass", where=f"figure {number}"
        )
    found = measures.passes_of(evidence, selected.runs)
    panel = Panel("Slip of the free wheels", V_KMH, Axis("slip (3.13)", limits=(1.05 * STILL, 0.5)), tuple(lines))
    checks = (before_full(found), exponential(found), _deep(evidence, selected))
    return figure_of(number, (panel,), checks, runs=selected.used(), fixed=selected.fixed)


FIGURES = {"2.3": figure_2_03, "2.4": figure_2_04}
