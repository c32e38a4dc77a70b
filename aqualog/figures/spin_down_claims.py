"""Claims of Figures 2.3 and 2.4 on minor and full spin-downs, judged from passes over the water."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from aqualog.campaign.spin_downs import Pass
from aqualog.core.records import FloatArray
from aqualog.evaluate.intervals import wilson
from aqualog.figures.evidence import KMH, Evidence
from aqualog.figures.measures import TEN
from aqualog.figures.passes import begins, full_speed, half_speeds, has_full, has_minor, over_passes
from aqualog.figures.record import Finding, judged
from aqualog.figures.scene_panels import WHEEL_WORDS
from aqualog.figures.selection import label, value_of

__all__ = ["at_89", "at_118", "before_full", "exponential", "new_tread", "rising_number"]

_NEAR = 5.0 * KMH  # [m/s] about a speed of the thesis
_SOON = 0.5  # [s] "immediately after entering"
_BEFORE, _BEFORE_TOL = 20.0, 5.0  # [km/h]
_LEAST = 3  # passes


def _shares(
    found: Sequence[Pass], kmh: float, holds: Callable[[Pass], bool], claim: str, thesis: str, criterion: str, word: str
) -> list[Finding]:
    near = [p for p in found if abs(p.v_mean - kmh * KMH) <= _NEAR]
    if len(near) < _LEAST:
        return []
    hit = sum(holds(p) for p in near)
    low, high = wilson(hit, len(near))
    share = hit / len(near)
    return [
        Finding(
            claim, thesis, criterion, f"{hit} of {len(near)} passes at {kmh:g} ± {_NEAR / KMH:g} km/h {word}",
            judged(whole=share >= 0.5 and low > 0.0, part=hit > 0),
            "" if share >= 0.5 else f"The passes reach full aquaplaning at {_full(found)}.",
            share, (low, high), "-",
        )
    ]  # fmt: skip


def _full(found: Sequence[Pass]) -> str:
    v = full_speed(found)
    return f"{v / KMH:.0f} km/h" if np.isfinite(v) else "no speed that was driven"


def at_89(found: Sequence[Pass]) -> list[Finding]:
    """C14: minor spin-downs at 89 km/h."""
    return _shares(
        found, 89.0, has_minor, "C14", "At 89 km/h there are some minor spin-downs of the front wheels.",
        "at least half of the passes within 5 km/h have one; in part: one has", "with minor spin-downs of a free wheel",
    )  # fmt: skip


def at_118(evidence: Evidence, found: Sequence[Pass]) -> list[Finding]:
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
        "At 118 km/h the front right wheel spins down immediately after entering, and the rear tyres spin up.",
        f"at least half of the passes within 5 km/h have a large spin-down of a free wheel within {_SOON:g} s of the "
        "entry; "
        "in part: one has",
        f"with a large spin-down of a free wheel within {_SOON:g} s; a driven wheel spins up in {ups}",
    )  # fmt: skip


def rising_number(found: Sequence[Pass]) -> list[Finding]:
    """C15: number and depth of the minor spin-downs rise with speed, up to full aquaplaning."""
    calm = [p for p in found if not has_full(p)]
    v_first = min((p.v_mean for p in calm if has_minor(p)), default=np.nan)
    part = [p for p in calm if p.v_mean >= v_first - TEN]
    if not np.isfinite(v_first) or len(part) < _LEAST:
        return []
    v = np.array([p.v_mean for p in part]) / TEN
    columns = [np.ones(v.size), v - v.mean()]
    number = over_passes(columns, np.array([sum(p.minor.values()) / p.seconds for p in part]))
    deepest = np.array([-min(x for x in p.deepest.values()) for p in part])
    depth = over_passes(columns, 100.0 * deepest)
    if number is None or depth is None:
        return []
    both = [number[1].is_above, depth[1].is_above]
    return [
        Finding(
            "C15", "At 98 and 106 km/h the minor spin-downs are more and deeper, while the car stays stable.",
            "over the passes without a full spin-down, from 10 km/h below the first minor one: number per second and "
            "deepest slip rise with speed, both intervals above 0; in part: one; value: number per second per 10 km/h",
            f"per 10 km/h {number[1].words(2)} more spin-downs a second, {depth[1].words(1)} % deeper slip "
            f"({len(part)} "
            "passes)",
            judged(whole=all(both), part=any(both)),
            "" if all(both) else "Several short dips merge into one longer spin-down." if both[1] else
            "The passes are few, or cover little speed.",
            number[1].value, number[1].ci, "1/s per 10 km/h",
        )
    ]  # fmt: skip


def before_full(found: Sequence[Pass]) -> list[Finding]:
    """C17: minor spin-downs from 20 km/h below full aquaplaning on."""
    if len(found) < _LEAST:
        return []
    (first, firsts), (full, fulls) = half_speeds(found, [begins, has_full])
    if not (np.isfinite(first) and np.isfinite(full)):
        return []
    away = (full - first) / KMH
    low, high = (float(x) / KMH for x in np.nanquantile(fulls - firsts, (0.025, 0.975)))
    lo, hi = _BEFORE - _BEFORE_TOL, _BEFORE + _BEFORE_TOL
    whole = lo <= low and high <= hi
    return [
        Finding(
            "C17", "Minor spin-downs occur from 20 km/h below the speed of full aquaplaning on.",
            "speed at which half of the passes have a full spin-down less that at which half have a minor one: "
            f"{lo:g} to "
            f"{hi:g} km/h, with its whole interval; in part: its interval reaches into that",
            f"full at {full / KMH:.0f} km/h, minor from {first / KMH:.0f} km/h on: {away:.0f} km/h ({len(found)} "
            "passes)",
            judged(whole=whole, part=low <= hi and high >= lo),
            "" if whole else
            "How far below they begin is set by how the contact fluctuates along the lane, and full spin-downs come "
            "sooner than the even contact ends.",
            away, (low, high), "km/h",
        )
    ]  # fmt: skip


def exponential(found: Sequence[Pass]) -> list[Finding]:
    """C18: the deepest slip grows with speed like an exponential."""
    part = [p for p in found if not has_full(p)]
    deepest = np.array([-min(p.deepest.values()) for p in part])
    v = np.array([p.v_mean for p in part]) / TEN
    good = np.isfinite(deepest) & (deepest > 0.0)
    v, deepest = v[good], deepest[good]
    grown = over_passes([np.ones(v.size), v - v.mean()], np.log(deepest)) if v.size > _LEAST else None
    if grown is None:
        return []
    rate = grown[1].mapped(lambda x: 100.0 * math.expm1(x))
    curve, line = _rms_exponential(v, deepest), _rms_line(v, deepest)
    whole = rate.is_above and curve < line
    return [
        Finding(
            "C18", "The slip of the front wheels over speed shows exponential behaviour.",
            "over the passes without a full spin-down the logarithm of the deepest slip rises with speed (interval "
            "above "
            "0), and an exponential comes nearer to the slips than a straight line (rms); in part: the first",
            f"{rate.words(0)} % deeper per 10 km/h; rms about the exponential {100 * curve:.2f} %, about the line "
            f"{100 * line:.2f} % of slip ({v.size} passes)",
            judged(whole=whole, part=rate.is_above),
            "" if whole else "The slip rises, but not faster than a straight line." if rate.is_above else
            "No rise exceeds the scatter.",
            rate.value, rate.ci, "% per 10 km/h",
        )
    ]  # fmt: skip


def _rms_line(v: FloatArray, y: FloatArray) -> float:
    x = np.stack([np.ones(v.size), v - v.mean()], axis=1)
    return float(np.sqrt(np.mean((y - x @ np.linalg.lstsq(x, y)[0]) ** 2)))


def _rms_exponential(v: FloatArray, y: FloatArray) -> float:
    """y = c exp(v / v_0), v_0 searched on a grid of 1 to 100 km/h: two numbers, as the line has."""
    best = np.inf
    for v0 in np.geomspace(0.1, 10.0, 200):
        e = np.exp((v - v.max()) / v0)
        best = min(best, float(np.sqrt(np.mean((y - e * (e @ y) / (e @ e)) ** 2))))
    return best


def _where(found: Sequence[Pass]) -> str:
    """In which water and at which wheels they are."""
    with_one = [p for p in found if begins(p)]
    depths = sorted({label("depth", value_of(p.info, "depth")) for p in with_one})
    wheels = sorted({WHEEL_WORDS[w] for p in with_one for w in p.minor if p.minor[w] or p.full[w]})
    there = sum(label("depth", value_of(p.info, "depth")) in depths for p in found)
    return f"They are in {', '.join(depths)} ({there} passes), at {', '.join(wheels)}."


def new_tread(found: Sequence[Pass], words: str) -> list[Finding]:
    """C19: no minor spin-downs on new winter tyres."""
    if len(found) < _LEAST:
        return []
    hit = sum(begins(p) for p in found)
    low, high = wilson(hit, len(found))
    top = max(p.v_mean for p in found) / KMH
    return [
        Finding(
            "C19", "New winter tyres show no minor spin-downs.",
            "no pass of the deep-treaded tyres has one; in part: at most one in twenty",
            f"{hit} of {len(found)} passes of {words}, up to {top:.0f} km/h",
            judged(whole=hit == 0, part=hit <= 0.05 * len(found)),
            "" if hit == 0 else _where(found),
            hit / len(found), (low, high), "-",
        )
    ]  # fmt: skip
