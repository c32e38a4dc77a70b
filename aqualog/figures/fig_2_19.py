"""Figure 2.19: slip slope of driven wheels over speed, worn summer against new winter tyres."""

from __future__ import annotations

from collections.abc import Sequence

from aqualog.figures.bin_lines import fall
from aqualog.figures.evidence import Evidence
from aqualog.figures.record import Figure, Finding, judged
from aqualog.figures.selection import Wish
from aqualog.figures.slope_figure import Slopes, slope_figure
from aqualog.figures.tyres import WORN, pairs

__all__ = ["make"]

NUMBER = "2.19"
_WISH = Wish(("tyre", "depth"), only_tyres=(WORN, ("new_winter",)))
_NONE = 2.0  # [% per 10 km/h] a fall that does not count: a tenth over the speeds driven


def _c54(found: Slopes) -> Sequence[Finding]:
    rows = []
    for words, worn, new in pairs(found.levels, found.selected.wish):
        for wheel in found.wheels:
            old, deep = fall(found.of(worn, wheel)), fall(found.of(new, wheel))
            if old is not None and deep is not None:
                rows.append((f"{words} {wheel}".strip(), old, deep))
    if not rows:
        return ()
    level = [r for r in rows if r[2].is_none(_NONE) or r[2].is_above]
    falling = [r for r in rows if r[1].is_below]
    less = [r for r in rows if r[2].value > r[1].value / 3.0]
    worst = min((r[2] for r in rows), key=lambda e: e.low)
    whole = len(level) == len(rows) and len(falling) == len(rows)
    return (
        Finding(
            "C54",
            "Within the speeds and depths tested the slip slope of new winter tyres does not fall; that of worn summer "
            "tyres does.",
            "relative change per 10 km/h: of the less worn tyre the interval holds 0, is above, or stays within "
            f"{_NONE:g} "
            "%; of the worn one it is below 0; in every depth and wheel; in part: the less worn tyre falls less than a "
            "third as fast in all; value: its least certain change",
            "; ".join(f"{n}: worn {a.words(1)}, less worn {b.words(1)} %" for n, a, b in rows),
            judged(whole=whole, part=len(less) == len(rows)),
            "" if whole else f"No fall of the less worn tyre in {len(level)} of {len(rows)}; fall of the worn one in "
            f"{len(falling)}.",
            worst.value, worst.ci, "% per 10 km/h",
        ),
    )  # fmt: skip


def make(evidence: Evidence) -> Figure:
    """Slopes over speed by tyre and depth, a panel per wheel; C54."""
    return slope_figure(
        evidence, NUMBER, "slip slope of driven wheels over speed, worn summer and new winter tyres", _WISH,
        "runs with two tyres in the same water, with slip and traction of driven wheels", _c54,
    )  # fmt: skip
