"""Claims on the slip slope at several pressures, of another tyre and under load, by passes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.reproduce.check import Check, Checks, Maker
from aqualog.reproduce.checks.resistance import at_speeds
from aqualog.reproduce.checks.resistance_variants import LOADED, UNLOADED
from aqualog.reproduce.checks.slip_slope import SOURCE, WORN, slopes_of
from aqualog.reproduce.passes import HIGH, LOW, MEDIUM, Pass
from aqualog.reproduce.tables import (
    SEEDS,
    SHAPE,
    Rows,
    Statistic,
    Table,
    by_passes,
    estimate,
    mean,
    scatter,
    told,
)
from aqualog.reproduce.verdict import judged

__all__ = ["CHECKS", "SEEDS"]

FEW = (70, 86, 102)  # [km/h]
WINTER_SPEEDS, WINTER_DEPTHS = (70, 90, 110), (1.3e-3, 2.0e-3)
SLIGHT = 0.15  # of the slope


def _levels(values: FloatArray) -> list[float]:
    return [mean(x) for x in values]


def _c53(table: Table) -> Checks:
    values = {
        n: slopes_of(table, replace(WORN, p=p), FEW) for n, p in (("low", LOW), ("medium", MEDIUM), ("high", HIGH))
    }
    level = {n: _levels(x) for n, x in values.items()}
    drop = {n: x[0] - x[-1] for n, x in level.items()}
    gap = [abs(level["low"][i] - level["high"][i]) for i in (0, -1)]
    smaller = level["high"][0] < level["medium"][0] < level["low"][0] * 1.001
    flatter = drop["high"] < 0.7 * drop["low"]

    def share(rows: Rows) -> float:
        high, low = (mean(values[n][0, rows]) - mean(values[n][-1, rows]) for n in ("high", "low"))
        return high / low

    value, ci = estimate(share, values["low"].shape[1])
    return (
        Check(
            "C53",
            "slope at 70 km/h falls with the pressure, decrease 70 to 102 km/h at high below 0.7 of that at low, and "
            "the gap of low and high shrinks; with a difference: the first two",
            "; ".join(f"{n}: " + ", ".join(f"{x:.1f}" for x in level[n]) for n in level)
            + f" at {', '.join(map(str, FEW))} km/h; decrease at high over low {told(value, ci, 2)}; gap {gap[0]:.1f} "
            f"to {gap[1]:.1f}",
            judged(whole=smaller and flatter and gap[1] < gap[0], part=smaller and flatter), value=value, ci95=ci,
            reason=SHAPE if smaller and flatter and gap[1] < gap[0] else
            SHAPE + " At high pressure the slope falls so much less that the curves cross instead of meeting.",
            source=SOURCE + ", worn summer tyres, 1.3 mm",
        ),
    )  # fmt: skip


def _c54(table: Table) -> Checks:
    winter = {h: slopes_of(table, Pass(90, tyre="new_winter", h=h, wiggles=True), WINTER_SPEEDS) for h in WINTER_DEPTHS}
    rows = {h: (mean(x[0]) - mean(x[-1]), max(scatter(y) for y in x), mean(x[0])) for h, x in winter.items()}
    worn = _levels(slopes_of(table, WORN, (70, 102)))
    falls = worn[1] < 0.8 * worn[0]
    still, nearly = (all(abs(d) < max(s, k * m) for d, s, m in rows.values()) for k in (0.05, 0.10))

    def worst(r: Rows) -> float:
        return max((mean(x[0, r]) - mean(x[-1, r])) / mean(x[0, r]) for x in winter.values())

    value, ci = estimate(worst, winter[WINTER_DEPTHS[0]].shape[1])
    return (
        Check(
            "C54",
            "new winter tyres: change 70 to 110 km/h below the scatter of the passes or 5 % at 1.3 and 2.0 mm; worn "
            "summer falls by over 20 % to 102 km/h; with a difference: 10 %",
            "; ".join(f"{1e3 * h:.1f} mm: {d:+.2f} of {m:.1f} (scatter {s:.2f})" for h, (d, s, m) in rows.items())
            + f", largest loss {told(100 * value, (100 * ci[0], 100 * ci[1]))} %; worn {worn[0]:.1f} to {worn[1]:.1f}",
            judged(whole=still and falls, part=nearly and falls), value=value, ci95=ci,
            reason=SHAPE + ("" if still and falls else " The winter tyre's grooves do not take all of 2 mm at 110 "
            "km/h."),
            source=SOURCE + ", low pressure",
        ),
    )  # fmt: skip


def _c55(table: Table) -> Checks:
    base = slopes_of(table, replace(UNLOADED, wiggles=True), FEW)
    cases = {k: slopes_of(table, replace(p, wiggles=True), FEW) for k, p in LOADED.items()}
    change = {k: np.nanmean(x, axis=0) - np.nanmean(base, axis=0) for k, x in cases.items()}
    found = {k: estimate(_mean_of(x), x.size) for k, x in change.items()}
    above = [x > 0.0 for x, _ in found.values()]
    share = max(x for x, _ in found.values()) / float(np.nanmean(base))
    is_slight = share <= SLIGHT
    value, ci = min(found.values())
    return (
        Check(
            "C55",
            "mean slope over 70, 86, 102 km/h, 1.2 mm, of medium pressure and of 270 kg in front and in the rear "
            f"above that of low pressure without load, by at most {SLIGHT:.0%}; with a difference: of two of the "
            "three, or more than that",
            f"{np.nanmean(base):.1f}; " + ", ".join(f"{k} {told(*x, 2)}" for k, x in found.items()) + " more",
            judged(whole=all(above) and is_slight, part=sum(above) >= 2), value=value, ci95=ci,
            reason=SHAPE + " The number is the least rise."
            + ("" if all(above) else " Not each of them raises the slope.")
            + ("" if is_slight else f" The largest is {share:.0%} of the slope, which is more than slight."),
            source=SOURCE + ", worn summer tyres, rear right wheel",
        ),
    )  # fmt: skip


def _mean_of(values: FloatArray) -> Statistic:
    return lambda rows: float(np.nanmean(values[rows]))


CHECKS: tuple[tuple[tuple[str, ...], Maker], ...] = (
    (("C53",), by_passes(lambda: (q for p in (LOW, MEDIUM, HIGH) for q in at_speeds(replace(WORN, p=p), FEW)), _c53)),
    (("C54",), by_passes(
        lambda: (*at_speeds(WORN, (70, 102)), *(
            q for h in WINTER_DEPTHS for q in at_speeds(Pass(90, tyre="new_winter", h=h, wiggles=True), WINTER_SPEEDS)
        )), _c54)),
    (("C55",), by_passes(
        lambda: (replace(q, wiggles=True) for p in (UNLOADED, *LOADED.values()) for q in at_speeds(p, FEW)), _c55)),
)  # fmt: skip
