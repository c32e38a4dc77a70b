"""Figure 2.18: slip slope of driven wheels over speed for several tyre pressures."""

from __future__ import annotations

from collections.abc import Sequence

from aqualog.figures.bin_lines import ratio
from aqualog.figures.evidence import Evidence
from aqualog.figures.record import Figure, Finding, judged
from aqualog.figures.selection import Wish
from aqualog.figures.slope_figure import Slopes, slope_figure
from aqualog.figures.tyres import WORN

__all__ = ["make"]

NUMBER = "2.18"
_WISH = Wish(("pressure",), WORN, depth_mm=1.2)
_SLOW_KMH = 90.0  # "low velocities", far below aquaplaning
_SAME = 0.10  # of the slope: less is alike


def _c53(found: Slopes) -> Sequence[Finding]:
    levels = found.levels
    if len(levels) < 2:
        return ()
    low, high = found.of(levels[0]), found.of(levels[-1])
    slow, over_all = ratio(low, high, up_to_kmh=_SLOW_KMH), ratio(low, high)
    near = ratio(low, found.of(levels[1])) if len(levels) > 2 else None
    if slow is None or over_all is None:
        return ()
    is_less, is_flatter = slow[0].high < 1.0, over_all[1].is_above
    # an interval that holds 1 may be wide: alike is what lies near 1 as a whole
    alike = near is None or (near[0].low >= 1.0 - _SAME and near[0].high <= 1.0 + _SAME)
    middle = f"; {levels[1].name} over {levels[0].name}: {near[0].words(2)}" if near is not None else ""
    whole = is_less and is_flatter and alike
    lacking = [
        n for n, ok in (("the smaller slope at low speed", is_less), ("the smaller fall", is_flatter),
                        ("low and medium pressure alike", alike)) if not ok
    ]  # fmt: skip
    return (
        Finding(
            "C53",
            "Low and medium pressure are alike; the high pressure has a significantly smaller slope at low speed, "
            "falls "
            "much less, and the curves meet at high speed.",
            f"highest over lowest pressure below {_SLOW_KMH:g} km/h: interval below 1 (value); the fall per 10 km/h "
            "is less: "
            f"interval of the difference above 0; the second pressure's ratio is within {_SAME:.0%} of 1 "
            "with its whole interval; in "
            "part: the first or the second",
            f"{levels[-1].name} over {levels[0].name}: {slow[0].words(2)} below {_SLOW_KMH:g} km/h, fall per 10 km/h "
            "less "
            f"by {over_all[1].words(1)} %{middle}",
            judged(whole=whole, part=is_less or is_flatter),
            "" if whole else "Not found: " + ", ".join(lacking) + ".",
            slow[0].value, slow[0].ci, "-",
        ),
    )  # fmt: skip


def make(evidence: Evidence) -> Figure:
    """Slopes over speed by pressure, a panel per wheel; C53."""
    return slope_figure(
        evidence, NUMBER, "slip slope of driven wheels over speed by tyre pressure", _WISH,
        "runs at two tyre pressures, else alike, on water, with slip and traction of driven wheels", _c53,
    )  # fmt: skip
