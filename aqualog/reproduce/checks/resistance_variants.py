"""Claims on the resistance measure of several tyres, pressures and loads, by passes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.reproduce.check import Check, Checks, Maker
from aqualog.reproduce.checks.resistance import (
    CONFIGURATIONS,
    NEW,
    SLOW,
    SOURCE,
    VERY_WORN,
    WINTER,
    WORN,
    at_depths,
    at_speeds,
    configured,
    gradient_of,
    level_at,
    scaled,
    seeds_of,
)
from aqualog.reproduce.passes import HIGH, LOW, MEDIUM, Pass
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

__all__ = ["CHECKS", "LOADED", "SEEDS", "UNLOADED"]

PRESSURES = (LOW, MEDIUM, HIGH)
LOAD_SPEEDS = (86, 94, 102)
LOADED = {
    "medium pressure": Pass(94, h=1.2e-3, p=MEDIUM),
    "front load": Pass(94, h=1.2e-3, load_front=270.0),
    "rear load": Pass(94, h=1.2e-3, load_rear=270.0),
}
UNLOADED = Pass(94, h=1.2e-3)
ONE_MM = 1.1e-3


def _compared(claim: str, what: str, other: Pass, depths: Sequence[float], table: Table) -> Check:
    """Very worn against another tyre at all speeds and depths (Figures 2.12 and 2.13)."""
    pairs = [(replace(VERY_WORN, kmh=v, h=h), replace(other, kmh=v, h=h)) for h in depths for v in SLOW]
    a, b = (cells_of(table, [p[k] for p in pairs], "delta_a") for k in (0, 1))
    lower = [bool(x.mean() < y.mean()) for x, y in zip(b, a, strict=True)]
    value, ci = estimate(lambda r: float(b[:, r].mean() / a[:, r].mean()), a.shape[1])
    return Check(
        claim,
        f"resistance of {what} tyres below that of very worn ones at each speed (70 to 102 km/h) and depth "
        f"({', '.join(f'{1e3 * h:.1f}' for h in depths)} mm), and below in the mean with its interval; with a "
        "difference: the latter",
        f"lower at {sum(lower)} of {len(lower)}; {told(value, ci, 2)} of it in the mean",
        judged(whole=all(lower) and ci[1] < 1.0, part=ci[1] < 1.0), value=value, ci95=ci,
        reason=SHAPE + " The thesis shows curves without saying more; its captions are not clear on the depths.",
        source=SOURCE + ", low pressure",
    )  # fmt: skip


def _c42(table: Table) -> Checks:
    names = ("very worn", "new summer", "new winter")
    n = seeds_of(table, VERY_WORN)
    gradient = {k: gradient_of(table, CONFIGURATIONS[k]) for k in names}
    g = {k: f(np.arange(n)) for k, f in gradient.items()}
    level = {k: level_at(table, CONFIGURATIONS[k]) for k in names}
    values = {k: table[CONFIGURATIONS[k]].of("delta_a") for k in names}

    def worst(rows: Rows) -> float:
        return max(float(values[k][rows].mean() / values[names[0]][rows].mean()) for k in names[1:])

    value, ci = estimate(worst, n)

    def below(share: float) -> bool:
        return all(g[k] < share * g[names[0]] and level[k] < share * level[names[0]] for k in names[1:])

    return (
        Check(
            "C42",
            "level at 94 km/h and gradient of new summer and new winter tyres less than half of the very worn tyre's; "
            "with a difference: less",
            "; ".join(f"{k}: {level[k]:.3f} m/s^2, {said(scaled(gradient[k]), n)} 1e-3 m/s^2 per km/h" for k in names)
            + f"; larger level over that of very worn {told(value, ci, 2)}",
            judged(whole=below(0.5), part=below(1.0)), value=value, ci95=ci,
            reason=SHAPE + " That deep treads take up water is assumed.",
            source=SOURCE + ", low pressure, 1.3 mm",
        ),
    )  # fmt: skip


def _c43(table: Table) -> Checks:
    rows = []
    for v in SLOW:
        x = [table[replace(WORN, kmh=v, p=p)].of("delta_a") for p in PRESSURES]
        rows.append((v, _range_of(x), max(scatter(y) for y in x)))
    inside = [s < noise for _, s, noise in rows]
    values = [cells_of(table, at_speeds(replace(WORN, p=p)), "delta_a").mean(axis=0) for p in PRESSURES]
    value, ci = estimate(lambda r: _range_of([x[r] for x in values]), values[0].size)
    return (
        Check(
            "C43", "spread over low, medium, high pressure below the scatter of the passes at each speed, 1.3 mm; "
            "with a difference: at most speeds",
            "; ".join(f"{v} km/h: {s:.3f} against {noise:.3f}" for v, s, noise in rows)
            + f" m/s^2; in the mean {told(value, ci, 3)}",
            judged(whole=all(inside), part=sum(inside) > len(inside) / 2), value=value, ci95=ci, unit="m/s^2",
            reason=SHAPE if all(inside) else SHAPE
            + " Pressure changes how much of the patch floats, and that its resistance: this claim and C45 cannot "
            "both hold.",
            source=SOURCE + ", worn summer tyres",
        ),
    )  # fmt: skip


def _range_of(values: Sequence[FloatArray]) -> float:
    means = [mean(x) for x in values]
    return max(means) - min(means)


def _c45(table: Table) -> Checks:
    base = cells_of(table, at_speeds(UNLOADED, LOAD_SPEEDS), "delta_a").mean(axis=0)
    change = {
        k: cells_of(table, at_speeds(p, LOAD_SPEEDS), "delta_a").mean(axis=0) - base for k, p in LOADED.items()
    }  # fmt: skip
    found = {k: estimate(_mean_of(x), base.size) for k, x in change.items()}
    below = [x < 0.0 for x, _ in found.values()]
    value, ci = max(found.values())
    return (
        Check(
            "C45",
            "mean over 86 to 102 km/h, 1.2 mm, of medium pressure and of 270 kg in front and in the rear below that "
            "of low pressure without load; with a difference: of two of the three",
            f"{base.mean():.3f} m/s^2; " + ", ".join(f"{k} {told(*x, 3)}" for k, x in found.items()) + " more",
            judged(whole=all(below), part=sum(below) >= 2), value=value, ci95=ci, unit="m/s^2",
            reason=SHAPE + " The number is the least fall. Pressure matters here, against C43."
            + ("" if all(below) else " Not each of them lowers the resistance."),
            source=SOURCE + ", worn summer tyres",
        ),
    )  # fmt: skip


def _mean_of(values: FloatArray) -> Statistic:
    return lambda rows: float(values[rows].mean())


CHECKS: tuple[tuple[tuple[str, ...], Maker], ...] = (
    (("C40",), by_passes(lambda: at_depths(VERY_WORN, NEW, depths=(ONE_MM, 2.0e-3)),
                         lambda t: (_compared("C40", "new summer", NEW, (ONE_MM, 2.0e-3), t),))),
    (("C41",), by_passes(lambda: at_depths(VERY_WORN, WINTER, depths=(1.3e-3, 2.0e-3)),
                         lambda t: (_compared("C41", "new winter", WINTER, (1.3e-3, 2.0e-3), t),))),
    (("C42",), by_passes(configured, _c42)),
    (("C43",), by_passes(lambda: (q for p in PRESSURES for q in at_speeds(replace(WORN, p=p))), _c43)),
    (("C45",), by_passes(
        lambda: (q for p in (UNLOADED, *LOADED.values()) for q in at_speeds(p, LOAD_SPEEDS)), _c45)),
)  # fmt: skip
