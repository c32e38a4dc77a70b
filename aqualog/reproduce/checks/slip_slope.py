"""Claims on the slip slope of the driven rear tyres over speed and depth, by passes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.reproduce.check import Check, Checks, Maker
from aqualog.reproduce.checks.resistance import CONFIGURATIONS, SLOW, at_speeds
from aqualog.reproduce.checks.slope_detection import detected
from aqualog.reproduce.pass_figures import SLOPE_EDGES
from aqualog.reproduce.passes import Pass, drive_pass
from aqualog.reproduce.tables import (
    SEEDS,
    SHAPE,
    Rows,
    Statistic,
    Table,
    by_passes,
    cells_of,
    estimate,
    mean,
    said,
    scatter,
    told,
)
from aqualog.reproduce.verdict import judged

__all__ = ["CHECKS", "SEEDS", "SOURCE", "WORN", "regressed", "slopes_of"]

WORN = Pass(94, wiggles=True)
VERY_WORN = Pass(100, tyre="very_worn_summer", h=0.8e-3, wiggles=True)
DRY_VERY_WORN = Pass(80, tyre="very_worn_summer", h=0.0, wiggles=True)
FALLING = ("very worn", "very worn 0.6 mm", "very worn 2.0 mm", "worn", "worn medium", "worn high")
DEPTHS = (0.8e-3, 1.1e-3, 1.3e-3, 2.0e-3)  # [m]
RAMPS = tuple(Pass(v, a=1.0, wiggles=True) for v in (78, 94))
SOURCE = "truth of simulated passes, rear-wheel drive, drive torque varied by 250 N·m"
STOPPING, TENTH = 0.2, 0.1
BIN_ERROR, BIN_SAMPLES = 0.15, 200
BELOW_FULL, BELOW_TOLERANCE = 20.0, 5.0  # [km/h]


def _wiggling(name: str) -> Pass:
    return replace(CONFIGURATIONS[name], wiggles=True)


def slopes_of(table: Table, p: Pass, speeds: Sequence[float], wheel: str = "rr") -> FloatArray:
    """Slope of a wheel, array (speeds, seeds)."""
    return cells_of(table, at_speeds(p, speeds), f"slope_{wheel}")


def _gradient(values: FloatArray, speeds: Sequence[float]) -> Statistic:
    return lambda rows: float(np.polyfit(speeds, np.nanmean(values[:, rows], axis=1), 1)[0])


def _c48(table: Table) -> Checks:
    wet, dry = table[VERY_WORN].of("slope_rr"), mean(table[DRY_VERY_WORN].of("slope_rr"))
    value, ci = estimate(lambda r: mean(wet[r]) / dry, wet.size)
    away = _full_speed(VERY_WORN) - VERY_WORN.kmh
    is_near = abs(away - BELOW_FULL) <= BELOW_TOLERANCE
    return (
        Check(
            "C48",
            "100 km/h, 0.8 mm, very worn: slope of the rear right wheel below 0.8 of the dry one with its whole "
            f"interval, and full aquaplaning {BELOW_FULL:g} km/h ± {BELOW_TOLERANCE:g} higher; with a difference: the "
            "slope below that of dry road",
            f"{mean(wet):.1f} of {dry:.1f}: {told(value, ci, 2)}; full aquaplaning of an even contact {away:.0f} km/h "
            "higher",
            judged(whole=ci[1] < 0.8 and is_near, part=value < 1.0), value=value, ci95=ci,
            reason=SHAPE
            + ("" if is_near else " The even contact of this tyre ends later than the thesis reports of its own."),
            source=SOURCE + ", low pressure",
        ),
    )  # fmt: skip


def _full_speed(p: Pass) -> float:
    """Speed of full aquaplaning of the rear right wheel on the lane of a pass, median. [km/h]"""
    _, columns, _ = drive_pass(p, SEEDS[0])
    return float(np.nanmedian(columns["true_full_speed_rr"])) * 3.6


def regressed(moments: FloatArray) -> float:
    """Slope from sums of n, mu, s, mu^2 and mu s, by regression of slip on traction. [-]"""
    n, mu, s, mu2, mu_s = moments[:5]
    return float((n * mu2 - mu * mu) / (n * mu_s - mu * s))


def _c49(table: Table) -> Checks:
    moments = cells_of(table, [*at_speeds(WORN), *RAMPS], "moments")

    def errors(rows: Rows) -> tuple[float, float, FloatArray]:
        sums = moments[:, rows].sum(axis=(0, 1))
        good = sums[:, 0] >= BIN_SAMPLES
        truth = sums[good, 5] / sums[good, 0]
        binned = np.array([regressed(x) for x in sums[good]]) / truth - 1.0
        whole = regressed(sums[good].sum(axis=0)) / truth - 1.0
        return float(np.sqrt(np.mean(binned**2))), float(np.sqrt(np.mean(whole**2))), binned

    n = moments.shape[1]
    value, ci = estimate(lambda r: errors(r)[0], n)
    without, ci_without = estimate(lambda r: errors(r)[1], n)
    binned = errors(np.arange(n))[2]
    at = (SLOPE_EDGES[:-1] + 5.0)[moments.sum(axis=(0, 1))[:, 0] >= BIN_SAMPLES]
    whole, part = value < BIN_ERROR and value < 0.5 * without, value < without
    return (
        Check(
            "C49",
            "points of slip and traction of all passes at 70 to 102 km/h and of accelerated ones (1 m/s²), 1.3 mm, in "
            f"bins of 10 km/h: slope regressed in each against the true one of its samples, rms relative error below "
            f"{BIN_ERROR:.0%} and below half of that of one regression over all speeds; with a difference: below that",
            f"rms error {told(100 * value, (100 * ci[0], 100 * ci[1]))} % in bins, "
            f"{told(100 * without, (100 * ci_without[0], 100 * ci_without[1]))} % without; "
            + ", ".join(f"{v:.0f} km/h: {100 * e:+.1f} %" for v, e in zip(at, binned, strict=True)),
            judged(whole=whole, part=part), statement="Slopes over speed are regressed in bins of speed.",
            value=value, ci95=ci,
            reason="" if whole else "Where slip is regressed on traction, the samples with the least contact count "
            "most: the regression lies below the mean initial slope.",
            source=SOURCE + ", worn summer tyres, low pressure, rear right wheel",
        ),
    )  # fmt: skip


def _c50(table: Table) -> Checks:
    rows, spans = [], []
    for v in SLOW:
        cells = {h: table[replace(WORN, kmh=v, h=h)] for h in DEPTHS}
        # the thesis' own condition: as long as the front tyres do not aquaplane fully
        kept = [c.of("slope_rr") for c in cells.values() if c.of("any_stop").mean() < STOPPING]
        means = [mean(x) for x in kept]
        rows.append((v, len(kept), max(means) - min(means), max(scatter(x) for x in kept), float(np.mean(means))))
        spans.append(kept)
    inside = [s < max(noise, TENTH * m) for _, _, s, noise, m in rows]

    def worst(r: Rows) -> float:
        means = [[mean(x[r]) for x in kept] for kept in spans]
        return max((max(m) - min(m)) / float(np.mean(m)) for m in means)

    value, ci = estimate(worst, len(table[WORN].figures))
    return (
        Check(
            "C50",
            "spread of the rear right slope over 0.8 to 2.0 mm below the scatter of the passes or 10 % of the slope, "
            "at each speed, over the depths at which front wheels stop in under a fifth of the passes; with a "
            "difference: at most speeds",
            "; ".join(f"{v} km/h: {s:.1f} against {noise:.1f} (slope {m:.1f}, {k} "
            "depths)" for v, k, s, noise, m in rows)
            + f"; largest share of the slope {told(value, ci, 2)}",
            judged(whole=all(inside), part=sum(inside) > len(inside) / 2), value=value, ci95=ci,
            reason=SHAPE + " In the simulator a front wheel leaves a film that hardly depends on the depth."
            + ("" if all(inside) else " Yet some of it comes through."),
            source=SOURCE + ", worn summer tyres, low pressure",
        ),
    )  # fmt: skip


def _c51(table: Table) -> Checks:
    found = {}
    for name in FALLING:
        for w in ("rl", "rr"):
            values = slopes_of(table, _wiggling(name), SLOW, w)
            found[f"{name} {w}"] = estimate(_gradient(values, SLOW), values.shape[1])
    falling = [x < 0.0 for x, _ in found.values()]
    value, ci = max(found.values())
    return (
        Check(
            "C51", "gradient of the slope 70 to 102 km/h below 0 for each of six combinations and both rear wheels; "
            "with a difference: 4 of 5",
            "per km/h: " + ", ".join(f"{k} {told(*x, 2)}" for k, x in found.items()),
            judged(whole=all(falling), part=bool(np.mean(falling) >= 0.8)), value=value, ci95=ci, unit="1/(km/h)",
            reason=SHAPE + " The number is the least fall.", source=SOURCE,
        ),
    )  # fmt: skip


def _c52(table: Table) -> Checks:
    left, right = (slopes_of(table, WORN, SLOW, w) for w in ("rl", "rr"))
    uneven = [float(np.mean([scatter(x) / mean(x) for x in side])) for side in (left, right)]
    higher = float(np.nanmean(left)) > float(np.nanmean(right))
    value, ci = estimate(lambda r: float(np.nanmean(left[:, r]) / np.nanmean(right[:, r])), left.shape[1])
    ratio = said(lambda r: _ratio(_unevenness(left[:, r]), _unevenness(right[:, r])), left.shape[1], 2)
    return (
        Check(
            "C52", "mean slope and relative scatter of the passes both larger left than right, 70 to 102 km/h; with a "
            "difference: one of both",
            f"left over right {told(value, ci, 3)}; scatter {uneven[0]:.3f} left, {uneven[1]:.3f} right, ratio {ratio}",
            judged(whole=higher and uneven[0] > uneven[1], part=higher or uneven[0] > uneven[1]), value=value, ci95=ci,
            reason=SHAPE + " That the left track has less water, less evenly, is put in." + (
                            "" if higher and uneven[0] > uneven[1] else
                            " Under the rear wheels the difference of the sides is small: they run in tracks."),
            source=SOURCE + ", worn summer tyres, low pressure, 1.3 mm, left track 0.6 of it and less even",
        ),
    )  # fmt: skip


def _ratio(a: float, b: float) -> float:
    return a / b if b > 0.0 else float("nan")


def _unevenness(values: FloatArray) -> float:
    return float(np.nanmean(np.nanstd(values, axis=1, ddof=1) / np.nanmean(values, axis=1)))


CHECKS: tuple[tuple[tuple[str, ...], Maker], ...] = (
    (("C47",), detected),
    (("C48",), by_passes(lambda: (VERY_WORN, DRY_VERY_WORN), _c48)),
    (("C49",), by_passes(lambda: (*at_speeds(WORN), *RAMPS), _c49)),
    (("C50",), by_passes(lambda: (WORN, *(q for h in DEPTHS for q in at_speeds(replace(WORN, h=h)))), _c50)),
    (("C51",), by_passes(lambda: (q for name in FALLING for q in at_speeds(_wiggling(name))), _c51)),
    (("C52",), by_passes(lambda: at_speeds(WORN), _c52)),
)  # fmt: skip
