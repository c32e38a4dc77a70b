"""Figure 2.17: slip slope of driven wheels over speed for several water depths."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from aqualog.figures.bin_lines import fall, ratio, uneven, usable
from aqualog.figures.evidence import Evidence
from aqualog.figures.record import Figure, Finding, judged
from aqualog.figures.selection import Wish
from aqualog.figures.slope_figure import Slopes, slope_figure
from aqualog.figures.tyres import WORN

__all__ = ["make"]

NUMBER = "2.17"
_WISH = Wish(("depth",), WORN)
_SAME = 0.10  # of the slope: less is no clear influence
_TOLD, _LEAST_RUNS = 0.8, 5  # share of bins with so many runs in which the method gives a slope
_SLIGHT = 1.25  # times: "slightly higher"


def _c49(found: Slopes) -> list[Finding]:
    rows = [r for x in found.levels for r in found.of(x) if r.runs >= _LEAST_RUNS]
    if not rows:
        return []
    told = len(usable(rows)) / len(rows)
    return [
        Finding(
            "C49", "Points put into bins of speed and a line through each give the slip slope.",
            f"in {_TOLD:.0%} of the bins with at least {_LEAST_RUNS} runs, a slope with an interval exists",
            f"in {len(usable(rows))} of {len(rows)} bins", judged(whole=told >= _TOLD),
            "" if told >= _TOLD else "Elsewhere the traction varies too little, or its noise is too large a share.",
            100 * told, None, "%",
        )
    ]  # fmt: skip


def _c50(found: Slopes) -> list[Finding]:
    levels = [x for x in found.levels if usable(found.of(x))]
    effects = {
        w: e for w in found.wheels
        if len(levels) > 1 and (e := ratio(found.of(levels[0], w), found.of(levels[-1], w))) is not None
    }  # fmt: skip
    if not effects:
        return []
    ratios = {w: e[0] for w, e in effects.items()}
    none = [w for w, e in ratios.items() if e.low <= 1.0 <= e.high or (e.low >= 1 - _SAME and e.high <= 1 + _SAME)]
    worst = min(ratios.values(), key=lambda e: e.value)
    return [
        Finding(
            "C50",
            "No clear influence of the water depth on the fall of the rear slip slope: rear wheels run in tracks.",
            f"slope in the deepest over that in the shallowest water, in bins that both have: the interval holds 1 or "
            f"stays within {_SAME:.0%} of it for every driven wheel; in part: for one",
            f"{levels[-1].name} over {levels[0].name}: " + "; ".join(f"{w} {e.words(2)}" for w, e in ratios.items()),
            judged(whole=len(none) == len(ratios), part=bool(none)),
            "" if len(none) == len(ratios) else "Deeper water leaves the rear wheels a little less of their contact.",
            worst.value, worst.ci, "-",
        )
    ]  # fmt: skip


def _c51(found: Slopes) -> list[Finding]:
    falls = {f"{x.name} {w}": e for x in found.levels for w in found.wheels if (e := fall(found.of(x, w))) is not None}
    if not falls:
        return []
    down = [n for n, e in falls.items() if e.is_below]
    least = max(falls.values(), key=lambda e: e.high)
    whole = len(down) == len(falls)
    return [
        Finding(
            "C51", "All curves fall with speed, in agreement with (2.2).",
            "the interval of the relative change per 10 km/h is below 0 at every level and wheel; in part: at half of "
            "them, and nowhere above 0",
            f"below 0 in {len(down)} of {len(falls)} curves; changes {min(e.value for e in falls.values()):.0f} to "
            f"{max(e.value for e in falls.values()):.0f} % per 10 km/h; the least certain one",
            judged(whole=whole, part=2 * len(down) >= len(falls) and not any(e.is_above for e in falls.values())),
            "" if whole else "No clear difference from 0: " + ", ".join(n for n in falls if n not in down) + ".",
            least.value, least.ci, "% per 10 km/h",
        )
    ]  # fmt: skip


def _c52(found: Slopes) -> list[Finding]:
    left, right = (next((w for w in found.wheels if w[1] == side), None) for side in "lr")
    if left is None or right is None:
        return []
    both = [
        (a, b) for x in found.levels for a, b in [(found.of(x, left), found.of(x, right))] if usable(a) and usable(b)
    ]
    effects = [e[0] for a, b in both if (e := ratio([replace(r, wheel=left) for r in b], a)) is not None]
    rough = [(uneven(a), uneven(b)) for a, b in both]
    rough = [(a, b) for a, b in rough if a == a and b == b]
    if not effects:
        return []
    higher = [e for e in effects if e.low > 1.0]
    most = [e for e in effects if e.value > 1.0]
    rougher = sum(a > b for a, b in rough)
    mean = sorted(effects, key=lambda e: e.value)[len(effects) // 2]
    is_higher = len(most) == len(effects) and 2 * len(higher) >= len(effects) and mean.value < _SLIGHT
    is_rougher = bool(rough) and 2 * rougher > len(rough)
    return [
        Finding(
            "C52",
            "Left slopes are slightly higher and less uniform than right ones: less and more uneven water there.",
            f"left over right is above 1 at every level, with its interval in half of them, and below {_SLIGHT:g} "
            "(median); "
            "the left slopes scatter more about their own line over speed in most levels; in part: one of both; value: "
            "median ratio",
            "left over right: " + "; ".join(e.words(2) for e in effects)
            + f"; left less uniform in {rougher} of {len(rough)}",
            judged(whole=is_higher and is_rougher, part=is_higher or is_rougher),
            "" if is_higher and is_rougher else
            f"Above 1 at {len(most)} of {len(effects)} levels, significantly above it at {len(higher)}"
            + ("." if is_rougher else "; the right wheels, on more water, scatter as much."),
            mean.value, mean.ci, "-",
        )
    ]  # fmt: skip


def _claims(found: Slopes) -> Sequence[Finding]:
    return [*_c49(found), *_c50(found), *_c51(found), *_c52(found)]


def make(evidence: Evidence) -> Figure:
    """Slopes over speed by water depth, a panel per wheel; C49 to C52."""
    return slope_figure(
        evidence, NUMBER, "slip slope of driven wheels over speed by water depth", _WISH,
        "runs in two water depths, else alike, with slip and traction of driven wheels", _claims,
    )  # fmt: skip
