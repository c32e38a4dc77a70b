"""Claims on the resistance measure over speed and depth, by passes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from aqualog.reproduce.check import Check, Checks, Maker
from aqualog.reproduce.passes import HIGH, MEDIUM, Pass
from aqualog.reproduce.tables import (
    SEEDS,
    SHAPE,
    Rows,
    Statistic,
    Table,
    by_passes,
    cells_of,
    estimate,
    first_speed,
    mean,
    said,
    scatter,
    told,
)
from aqualog.reproduce.verdict import judged

__all__ = [
    "CHECKS", "CONFIGURATIONS", "NEW", "SEEDS", "SLOW", "SOURCE", "VERY_WORN", "WINTER", "WORN", "at_depths",
    "at_speeds", "configured", "gradient_of", "level_at", "scaled", "seeds_of",
]  # fmt: skip

SLOW = (70, 78, 86, 94, 102)  # [km/h] below full aquaplaning
WORN, VERY_WORN = Pass(94), Pass(94, tyre="very_worn_summer")
NEW, WINTER = Pass(94, tyre="new_summer"), Pass(94, tyre="new_winter")
CONFIGURATIONS: Mapping[str, Pass] = {
    "very worn": VERY_WORN,
    "very worn 0.6 mm": replace(VERY_WORN, h=0.6e-3),
    "very worn 2.0 mm": replace(VERY_WORN, h=2.0e-3),
    "worn": WORN,
    "worn medium": replace(WORN, p=MEDIUM),
    "worn high": replace(WORN, p=HIGH),
    "worn front load": replace(WORN, load_front=270.0),
    "worn rear load": replace(WORN, load_rear=270.0),
    "new summer": NEW,
    "new summer 2.0 mm": replace(NEW, h=2.0e-3),
    "new winter": WINTER,
    "new winter 2.0 mm": replace(WINTER, h=2.0e-3),
}
DEPTHS = (0.6e-3, 0.8e-3, 1.1e-3, 1.3e-3, 2.0e-3)  # [m]
OUTER = (0.6e-3, 1.3e-3, 2.0e-3)  # those whose gradients are compared
THRESHOLD = 0.2  # [m/s^2]
THRESHOLD_SPEEDS = tuple(range(78, 118, 4))
V_FULL = 113.0  # [km/h] below full aquaplaning of the anchor, 118 km/h
RISE_S, SOURCE = 0.5, "truth of simulated passes, rear-wheel drive"


def at_speeds(p: Pass, speeds: Sequence[float] = SLOW) -> list[Pass]:
    """The same pass at several speeds [km/h]."""
    return [replace(p, kmh=v) for v in speeds]


def level_at(table: Table, p: Pass) -> float:
    """Mean resistance of a pass over the seeds. [m/s²]"""
    return mean(table[p].of("delta_a"))


def gradient_of(table: Table, p: Pass) -> Statistic:
    """Gradient of the mean resistance over `SLOW`. [m/s² per km/h]"""
    values = cells_of(table, at_speeds(p), "delta_a")
    return lambda rows: float(np.polyfit(SLOW, values[:, rows].mean(axis=1), 1)[0])


def seeds_of(table: Table, p: Pass) -> int:
    """How many seeds a pass was driven with."""
    return len(table[p].figures)


def _c12(table: Table) -> Checks:
    depths = (VERY_WORN, CONFIGURATIONS["very worn 0.6 mm"], CONFIGURATIONS["very worn 2.0 mm"])
    lever = {p.h: cells_of(table, at_speeds(p), "lever") for p in depths}
    by_h = [lever[h].mean(axis=1) for h in sorted(lever)]
    ahead = all((x > 0.0).all() for x in lever.values())
    grows_v = all(np.all(np.diff(x) > 0.0) for x in by_h)
    grows_h = bool(np.all(np.diff(np.stack(by_h), axis=0) > 0.0))

    def change(names: Sequence[str]) -> float:
        means = [np.mean([level_at(table, p) for p in at_speeds(CONFIGURATIONS[n])]) for n in names]
        return float(max(means) - min(means))

    speeds = [level_at(table, p) for p in at_speeds(VERY_WORN)]
    span = {
        "speed": max(speeds) - min(speeds), "depth": change(("very worn", "very worn 0.6 mm", "very worn 2.0 mm")),
        "pressure": change(("worn", "worn medium", "worn high")),
        "load": change(("worn", "worn front load", "worn rear load")),
    }  # fmt: skip
    mainly = min(span["speed"], span["depth"]) > max(span["pressure"], span["load"])
    shift, ci = estimate(lambda r: 1e3 * float(lever[2.0e-3][-1, r].mean()), seeds_of(table, VERY_WORN))
    grows = bool(ahead and grows_v and grows_h)
    return (
        Check(
            "C12",
            "torque of the water against a front wheel over its load (how far ahead the load acts): above 0 in every "
            "pass at 0.6, 1.3, 2.0 mm, growing with speed (70 to 102 km/h) and depth; range of the resistance over "
            "speed and over depth beyond those over pressure and load; with a difference: the former",
            f"{1e3 * by_h[0][0]:.1f} mm at 70 km/h and 0.6 mm to {told(shift, ci)} mm at 102 km/h and 2.0 mm, grows "
            f"with speed {grows_v}, with depth {grows_h}; resistance ranges over "
            + ", ".join(f"{k} {x:.3f}" for k, x in span.items()) + " m/s^2",
            judged(whole=grows and mainly, part=grows), value=shift, ci95=ci, unit="mm",
            reason="That the wedge carries its load in front is assumed. The torque holds the drag of the film that "
            "the tread throws, too."
            + ("" if grows and mainly else " Not all of depth, speed, pressure and load rank as claimed."),
            source=SOURCE + ", very worn summer tyres",
        ),
    )  # fmt: skip


def _c37(table: Table) -> Checks:
    c = table[VERY_WORN]
    wet, dry, rise = (c.of(k) for k in ("delta_a", "delta_a_dry", "rise_s"))
    step, ci = estimate(lambda r: float((wet - dry)[r].mean()), wet.size)
    whole = bool((wet - dry > 0.1).all() and (rise < RISE_S).all())
    return (
        Check(
            "C37",
            "94 km/h, 1.3 mm, very worn: resistance on the lane at least 0.1 m/s² above that before it, and half of "
            f"it reached within {RISE_S:g} s, every pass; with a difference: higher in every pass",
            f"{dry.mean():+.3f} before, {wet.mean():.3f} m/s² on the lane: {told(step, ci, 3)} more; half of it after "
            f"{np.median(rise):.2f} s (at most {rise.max():.2f} s)",
            judged(whole=whole, part=bool((wet > dry).all())), value=step, ci95=ci, unit="m/s^2", reason=SHAPE,
            source=SOURCE + ", very worn summer tyres, low pressure",
        ),
    )  # fmt: skip


def _c38(table: Table) -> Checks:
    cells = {h: table[replace(VERY_WORN, h=h)].of("delta_a") for h in DEPTHS}
    level = {h: mean(x) for h, x in cells.items()}
    thin = [level[h] for h in DEPTHS[:-1]]
    noise = max(scatter(x) for x in cells.values())
    deep, flat = level[2.0e-3] - max(thin) > noise, max(thin) - min(thin) < noise
    value, ci = estimate(
        lambda r: float(cells[2.0e-3][r].mean() - max(cells[h][r].mean() for h in DEPTHS[:-1])), cells[2.0e-3].size
    )
    g = {h: said(scaled(gradient_of(table, replace(VERY_WORN, h=h))), cells[h].size) for h in OUTER}
    return (
        Check(
            "C38",
            "94 km/h, very worn: levels of 0.6 to 1.3 mm within the scatter of the passes, 2 mm beyond it above them; "
            "with a difference: the latter",
            ", ".join(f"{1e3 * h:.1f} mm: {x:.3f}" for h, x in level.items())
            + f" m/s², scatter {noise:.3f}; 2 mm above the others by {told(value, ci, 3)}; gradients "
            + ", ".join(f"{1e3 * h:.1f} mm: {x}" for h, x in g.items()) + " 1e-3 m/s^2 per km/h",
            judged(whole=deep and flat, part=deep), value=value, ci95=ci, unit="m/s^2",
            reason=SHAPE if deep and flat else
            SHAPE + " Film drag and the shift of the load grow with depth below 1.3 mm already.",
            source=SOURCE + ", very worn summer tyres, low pressure",
        ),
    )  # fmt: skip


def scaled(statistic: Statistic) -> Statistic:
    """A statistic in thousandths."""
    return lambda rows: 1e3 * statistic(rows)


def _c39(table: Table) -> Checks:
    found = {
        name: estimate(scaled(gradient_of(table, p)), seeds_of(table, p)) for name, p in CONFIGURATIONS.items()
    }  # fmt: skip
    rising = [x > 0.0 for x, _ in found.values()]
    least = min(found.values())
    return (
        Check(
            "C39", "gradient 70 to 102 km/h above 0 for each of 12 combinations; with a difference: 4 of 5",
            "1e-3 m/s^2 per km/h: " + ", ".join(f"{name} {told(*x)}" for name, x in found.items()),
            judged(whole=all(rising), part=bool(np.mean(rising) >= 0.8)),
            value=least[0], ci95=least[1], unit="1e-3 m/s^2 per km/h",
            reason=SHAPE + " The number is the least of them.", source=SOURCE,
        ),
    )  # fmt: skip


def _c44(table: Table) -> Checks:
    passes = [replace(WORN, kmh=v) for v in THRESHOLD_SPEEDS]
    above = cells_of(table, passes, "delta_a") > THRESHOLD
    partial = cells_of(table, passes, "is_partial") > 0.5
    n = above.shape[1]
    v, ci = estimate(first_speed(THRESHOLD_SPEEDS, above), n)

    def balanced(rows: Rows) -> float:
        a, p = above[:, rows], partial[:, rows]
        return float(0.5 * (a[p].mean() + (~a[~p]).mean())) if p.any() and not p.all() else float("nan")

    accuracy, span = estimate(balanced, n)
    there = bool(np.isfinite(accuracy))
    sides = f"{above[partial].mean():.2f} of the partial ones reach it, {above[~partial].mean():.2f} of the others"
    return (
        Check(
            "C44", f"0.2 m/s² reached by half of the passes below {V_FULL:g} km/h", f"at {told(v, ci)} km/h",
            judged(whole=v < V_FULL), part="speed", value=v if np.isfinite(v) else None,
            ci95=ci if np.isfinite(ci).all() else None, unit="km/h", reason=SHAPE,
            source=SOURCE + ", worn summer tyres, low pressure, 1.3 mm",
        ),
        Check(
            "C44",
            "0.2 m/s² separates passes with partial aquaplaning (contact of a wheel below 0.7 for 1 s) from those "
            "without, balanced accuracy 0.8 over 78 to 114 km/h; with a difference: 0.65",
            f"balanced accuracy {told(accuracy, span, 2)}: {sides}" if there else "all passes are alike",
            judged(whole=there and accuracy >= 0.8, part=there and accuracy >= 0.65), part="partial aquaplaning",
            value=accuracy if there else None, ci95=span if there else None,
            reason=SHAPE if there and accuracy >= 0.8 else
            SHAPE + " Resistance and contact do not part the passes alike.",
            source=SOURCE + ", worn summer tyres, low pressure, 1.3 mm",
        ),
    )  # fmt: skip


def configured() -> Iterator[Pass]:
    """All combinations of tyre, depth, pressure and load at all speeds."""
    for p in CONFIGURATIONS.values():
        yield from at_speeds(p)


def at_depths(*passes: Pass, depths: Sequence[float]) -> list[Pass]:
    """The same passes at several depths [m], each at all speeds."""
    return [replace(p, kmh=v, h=h) for p in passes for h in depths for v in SLOW]


CHECKS: tuple[tuple[tuple[str, ...], Maker], ...] = (
    (("C12",), by_passes(configured, _c12)),
    (("C37",), by_passes(lambda: (VERY_WORN,), _c37)),
    (("C38",), by_passes(
        lambda: (*(replace(VERY_WORN, h=h) for h in DEPTHS), *at_depths(VERY_WORN, depths=OUTER)), _c38)),
    (("C39",), by_passes(configured, _c39)),
    (("C44",), by_passes(lambda: (replace(WORN, kmh=v) for v in THRESHOLD_SPEEDS), _c44)),
)  # fmt: skip
