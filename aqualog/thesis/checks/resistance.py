"""The resistance measure over speed, depth, tyre, pressure and load, by passes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.thesis.claims import Check, Checks, judge, limit
from aqualog.thesis.evidence.passes import HIGH, LOW, MEDIUM, Pass
from aqualog.thesis.evidence.seeds import (
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

__all__ = ["CHECKS", "CONFIGURATIONS", "LOADED", "SLOW", "UNLOADED", "at_speeds"]

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
V_FULL = limit("v_full", "C44.passes_speed")  # [km/h] below full aquaplaning of the anchor, 118 km/h
RISE_S = limit("rise_s", "C37.passes")


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


def _c12(table: Table) -> Check:
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
    outcome = (
        f"{1e3 * by_h[0][0]:.1f} mm at 70 km/h and 0.6 mm to {told(shift, ci)} mm at 102 km/h and 2.0 mm, grows "
        f"with speed {grows_v}, with depth {grows_h}; resistance ranges over "
        + ", ".join(f"{k} {x:.3f}" for k, x in span.items())
        + " m/s^2"
    )
    return judge("C12.passes", outcome, whole=grows and mainly, part=grows, value=shift, ci95=ci)


def _c37(table: Table) -> Check:
    c = table[VERY_WORN]
    wet, dry, rise = (c.of(k) for k in ("delta_a", "delta_a_dry", "rise_s"))
    step, ci = estimate(lambda r: float((wet - dry)[r].mean()), wet.size)
    whole = bool((wet - dry > 0.1).all() and (rise < RISE_S).all())
    outcome = (
        f"{dry.mean():+.3f} before, {wet.mean():.3f} m/s² on the lane: {told(step, ci, 3)} more; half of it after "
        f"{np.median(rise):.2f} s (at most {rise.max():.2f} s)"
    )
    return judge("C37.passes", outcome, whole=whole, part=bool((wet > dry).all()), value=step, ci95=ci)


def _c38(table: Table) -> Check:
    cells = {h: table[replace(VERY_WORN, h=h)].of("delta_a") for h in DEPTHS}
    level = {h: mean(x) for h, x in cells.items()}
    thin = [level[h] for h in DEPTHS[:-1]]
    noise = max(scatter(x) for x in cells.values())
    deep, flat = level[2.0e-3] - max(thin) > noise, max(thin) - min(thin) < noise
    value, ci = estimate(
        lambda r: float(cells[2.0e-3][r].mean() - max(cells[h][r].mean() for h in DEPTHS[:-1])), cells[2.0e-3].size
    )
    g = {h: said(scaled(gradient_of(table, replace(VERY_WORN, h=h))), cells[h].size) for h in OUTER}
    outcome = (
        ", ".join(f"{1e3 * h:.1f} mm: {x:.3f}" for h, x in level.items())
        + f" m/s², scatter {noise:.3f}; 2 mm above the others by {told(value, ci, 3)}; gradients "
        + ", ".join(f"{1e3 * h:.1f} mm: {x}" for h, x in g.items())
        + " 1e-3 m/s^2 per km/h"
    )
    return judge("C38.passes", outcome, whole=deep and flat, part=deep, value=value, ci95=ci)


def scaled(statistic: Statistic) -> Statistic:
    """A statistic in thousandths."""
    return lambda rows: 1e3 * statistic(rows)


def _c39(table: Table) -> Check:
    found = {
        name: estimate(scaled(gradient_of(table, p)), seeds_of(table, p)) for name, p in CONFIGURATIONS.items()
    }  # fmt: skip
    rising = [x > 0.0 for x, _ in found.values()]
    least = min(found.values())
    outcome = "1e-3 m/s^2 per km/h: " + ", ".join(f"{name} {told(*x)}" for name, x in found.items())
    return judge(
        "C39.passes", outcome, whole=all(rising), part=bool(np.mean(rising) >= 0.8), value=least[0], ci95=least[1]
    )


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
        judge(
            "C44.passes_speed",
            f"at {told(v, ci)} km/h",
            whole=v < V_FULL,
            value=v if np.isfinite(v) else None,
            ci95=ci if np.isfinite(ci).all() else None,
        ),
        judge(
            "C44.passes_partial_aquaplaning",
            f"balanced accuracy {told(accuracy, span, 2)}: {sides}" if there else "all passes are alike",
            whole=there and accuracy >= 0.8,
            part=there and accuracy >= 0.65,
            value=accuracy if there else None,
            ci95=span if there else None,
        ),
    )


def configured() -> Iterator[Pass]:
    """All combinations of tyre, depth, pressure and load at all speeds."""
    for p in CONFIGURATIONS.values():
        yield from at_speeds(p)


def at_depths(*passes: Pass, depths: Sequence[float]) -> list[Pass]:
    """The same passes at several depths [m], each at all speeds."""
    return [replace(p, kmh=v, h=h) for p in passes for h in depths for v in SLOW]


PRESSURES = (LOW, MEDIUM, HIGH)
LOAD_SPEEDS = (86, 94, 102)
LOADED = {
    "medium pressure": Pass(94, h=1.2e-3, p=MEDIUM),
    "front load": Pass(94, h=1.2e-3, load_front=270.0),
    "rear load": Pass(94, h=1.2e-3, load_rear=270.0),
}
UNLOADED = Pass(94, h=1.2e-3)
ONE_MM = 1.1e-3


def _compared(claim: str, other: Pass, depths: Sequence[float], table: Table) -> Check:
    """Very worn against another tyre at all speeds and depths (Figures 2.12 and 2.13)."""
    pairs = [(replace(VERY_WORN, kmh=v, h=h), replace(other, kmh=v, h=h)) for h in depths for v in SLOW]
    a, b = (cells_of(table, [p[k] for p in pairs], "delta_a") for k in (0, 1))
    lower = [bool(x.mean() < y.mean()) for x, y in zip(b, a, strict=True)]
    value, ci = estimate(lambda r: float(b[:, r].mean() / a[:, r].mean()), a.shape[1])
    outcome = f"lower at {sum(lower)} of {len(lower)}; {told(value, ci, 2)} of it in the mean"
    return judge(f"{claim}.passes", outcome, whole=all(lower) and ci[1] < 1.0, part=ci[1] < 1.0, value=value, ci95=ci)


def _c42(table: Table) -> Check:
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

    outcome = (
        "; ".join(f"{k}: {level[k]:.3f} m/s^2, {said(scaled(gradient[k]), n)} 1e-3 m/s^2 per km/h" for k in names)
        + f"; larger level over that of very worn {told(value, ci, 2)}"
    )
    return judge("C42.passes", outcome, whole=below(0.5), part=below(1.0), value=value, ci95=ci)


def _c43(table: Table) -> Check:
    rows = []
    for v in SLOW:
        x = [table[replace(WORN, kmh=v, p=p)].of("delta_a") for p in PRESSURES]
        rows.append((v, _range_of(x), max(scatter(y) for y in x)))
    inside = [s < noise for _, s, noise in rows]
    values = [cells_of(table, at_speeds(replace(WORN, p=p)), "delta_a").mean(axis=0) for p in PRESSURES]
    value, ci = estimate(lambda r: _range_of([x[r] for x in values]), values[0].size)
    outcome = (
        "; ".join(f"{v} km/h: {s:.3f} against {noise:.3f}" for v, s, noise in rows)
        + f" m/s^2; in the mean {told(value, ci, 3)}"
    )
    return judge("C43.passes", outcome, whole=all(inside), part=sum(inside) > len(inside) / 2, value=value, ci95=ci)


def _range_of(values: Sequence[FloatArray]) -> float:
    means = [mean(x) for x in values]
    return max(means) - min(means)


def _c45(table: Table) -> Check:
    base = cells_of(table, at_speeds(UNLOADED, LOAD_SPEEDS), "delta_a").mean(axis=0)
    change = {
        k: cells_of(table, at_speeds(p, LOAD_SPEEDS), "delta_a").mean(axis=0) - base for k, p in LOADED.items()
    }  # fmt: skip
    found = {k: estimate(_mean_of(x), base.size) for k, x in change.items()}
    below = [x < 0.0 for x, _ in found.values()]
    value, ci = max(found.values())
    outcome = f"{base.mean():.3f} m/s^2; " + ", ".join(f"{k} {told(*x, 3)}" for k, x in found.items()) + " more"
    return judge("C45.passes", outcome, whole=all(below), part=sum(below) >= 2, value=value, ci95=ci)


def _mean_of(values: FloatArray) -> Statistic:
    return lambda rows: float(values[rows].mean())


def _depths() -> Iterator[Pass]:
    yield from (replace(VERY_WORN, h=h) for h in DEPTHS)
    yield from at_depths(VERY_WORN, depths=OUTER)


CHECKS = (
    by_passes("C12", configured, _c12),
    by_passes("C37", lambda: (VERY_WORN,), _c37),
    by_passes("C38", _depths, _c38),
    by_passes("C39", configured, _c39),
    by_passes("C44", lambda: (replace(WORN, kmh=v) for v in THRESHOLD_SPEEDS), _c44),
    by_passes(
        "C40", lambda: at_depths(VERY_WORN, NEW, depths=(ONE_MM, 2.0e-3)),
        lambda t: _compared("C40", NEW, (ONE_MM, 2.0e-3), t),
    ),
    by_passes(
        "C41", lambda: at_depths(VERY_WORN, WINTER, depths=(1.3e-3, 2.0e-3)),
        lambda t: _compared("C41", WINTER, (1.3e-3, 2.0e-3), t),
    ),
    by_passes("C42", configured, _c42),
    by_passes("C43", lambda: (q for p in PRESSURES for q in at_speeds(replace(WORN, p=p))), _c43),
    by_passes("C45", lambda: (q for p in (UNLOADED, *LOADED.values()) for q in at_speeds(p, LOAD_SPEEDS)), _c45),
)  # fmt: skip
