"""Claims on spin-downs of the front wheels, by passes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.evaluate.intervals import wilson
from aqualog.reproduce.check import Check, Checks, Maker
from aqualog.reproduce.checks.contact_loss import GRID, SOON, SOURCE
from aqualog.reproduce.passes import SPIN_UP, Pass
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
    told,
)
from aqualog.reproduce.verdict import judged

__all__ = ["CHECKS", "SEEDS", "aic_gain"]

FINE = tuple(range(84, 124, 2))
SHOWN = (89, 98, 106, 118)  # thesis Fig. 2.3
CURVE = tuple(Pass(v) for v in (70, *GRID[:9]))  # up to 110 km/h, below full aquaplaning
CURVE_A = tuple(Pass(v, a=0.5) for v in (78, 86, 94, 102))
CONSTANT_KMH, AIC_SURE = 2.0, 10.0


def _c13(table: Table) -> Checks:
    change = np.max(cells_of(table, [Pass(v) for v in SHOWN], "speed_change"))
    s = cells_of(table, [Pass(v) for v in SHOWN], "low_slip")
    low = -s / (1.0 - s)  # over the car's speed: a wheel that stands is 1 below it
    level = [mean(x) for x in low]
    grows = bool(np.all(np.diff(level) > 0))
    constant = bool(change < CONSTANT_KMH)
    value, ci = estimate(lambda r: float(low[2, r].mean() - low[0, r].mean()), low.shape[1])
    return (
        Check(
            "C13",
            f"speed within {CONSTANT_KMH:g} km/h of that at the entry until a wheel stops or spins, all passes at 89, "
            "98, 106, 118 km/h; the front wheels fall behind the car (5 % quantile of the slip) more at each; with a "
            "difference: the latter",
            f"speed within {change:.2f} km/h; slip {', '.join(f'{100 * x:.1f}' for x in level)} % below the car; from "
            f"89 to 106 km/h {told(100 * value, (100 * ci[0], 100 * ci[1]))} points more",
            judged(whole=constant and grows, part=grows),
            value=value, ci95=ci,
            reason=SHAPE + ("" if constant else " The driver model lets the speed fall by that much on the lane."),
            source=SOURCE,
        ),
    )  # fmt: skip


def _c14(table: Table) -> Checks:
    dips = table[Pass(89)].of("dips")
    k, n = int((dips > 0).sum()), dips.size
    return (
        Check(
            "C14", "dips of the front wheels below -2 % at 89 km/h: more than none over all passes",
            f"{dips.mean():.2f} per pass, in {k} of {n} passes", judged(whole=k > 0), value=k / n, ci95=wilson(k, n),
            reason=SHAPE + (" The other passes have no spin-down." if k else " The first ones come at a higher speed."),
            source=SOURCE,
        ),
    )  # fmt: skip


def _c15(table: Table) -> Checks:
    cells = [table[Pass(v)] for v in (89, 98, 106)]
    count = [c.of("dips") for c in cells]
    depth = [mean(c.of("depth")) for c in cells]
    yaw, stops = float(np.degrees(cells[2].of("yaw").max())), float(cells[2].of("any_stop").mean())
    n = count[0].size
    a, b, c = (float(x.mean()) for x in count)
    more, ci = estimate(lambda r: float(count[2][r].mean() - count[0][r].mean()), n)
    whole = a < b < c and depth[2] < depth[1] and yaw < 3.0 and stops < 0.5
    return (
        Check(
            "C15",
            "count grows from 89 to 98 to 106 km/h; median depth grows from 98 to 106; heading within 3 deg and stops "
            "in under half of the passes at 106; with a difference: count grows",
            f"{a:.2f}, {b:.2f}, {c:.2f} dips per pass, {told(more, ci)} more at 106 than at 89; depth {depth[1]:.3f}, "
            f"{depth[2]:.3f}; heading {yaw:.1f} deg; stops {stops:.0%}",
            judged(whole=whole, part=a < b < c), value=more, ci95=ci, unit="dips per pass",
            reason=SHAPE + ("" if whole else " Depth, heading or stops do not go with it."), source=SOURCE,
        ),
    )  # fmt: skip


def _c16(table: Table) -> Checks:
    c = table[Pass(118)]
    stop, up, down = (c.of(k) for k in ("stop_s", "rear_spin_s", "rear_stop_s"))
    n = stop.size
    full, ever = float((stop < SOON).mean()), float((c.of("rear_spin") > SPIN_UP).mean())
    with np.errstate(invalid="ignore"):
        at_once = (np.abs(up - stop) < 1.0) & (up < down)
    k = int(at_once.sum())
    whole, part = full >= 0.5 and 2 * k >= n, full >= 0.5 and ever >= 0.5
    return (
        Check(
            "C16",
            "118 km/h: front right below half speed within 0.5 s, and a rear wheel over +5 % within 1 s of it before "
            "any rear spin-down, half of the passes each; with a difference: a rear wheel over +5 % at any time",
            f"front right {full:.0%} (the anchor, fitted on other seeds); rear up at once {k} of {n}, up at all "
            f"{ever:.0%}, down first {float((down < up).mean()):.0%}",
            judged(whole=whole, part=part), value=k / n, ci95=wilson(k, n),
            reason=SHAPE if whole else SHAPE
            + " The rear wheels run in the tracks of the front ones and spin up later.",
            source=SOURCE,
        ),
    )  # fmt: skip


def _c17(table: Table) -> Checks:
    cells = [Pass(v) for v in FINE]
    minor = first_speed(FINE, cells_of(table, cells, "dips") > 0)
    stop = cells_of(table, cells, "stop_s") < SOON
    full = first_speed(FINE, stop)
    n = stop.shape[1]
    value, ci = estimate(lambda r: full(r) - minor(r), n)
    there = np.isfinite(value)
    return (
        Check(
            "C17", "difference of the speeds reached by half of the passes 15 to 25 km/h with its whole interval; with "
            "a difference: its value 10 to 30",
            f"full {said(full, n)}, first dip {said(minor, n)}: {told(value, ci)} km/h",
            judged(whole=bool(there and ci[0] >= 15.0 and ci[1] <= 25.0), part=bool(there and 10.0 <= value <= 30.0)),
            value=value if there else None, ci95=ci if np.all(np.isfinite(ci)) else None, unit="km/h",
            reason=SHAPE, source=SOURCE,
        ),
    )  # fmt: skip


def aic_gain(v: FloatArray, y: FloatArray) -> tuple[float, float, float]:
    """By how much an exponential c exp(v / v0) explains y over v better than a straight line.

    Parameters
    ----------
    v, y : array (n,)
        n > 4, y >= 0 mostly.

    Returns
    -------
    gain : float
        Akaike's criterion [akaike1974] of the line minus that of the exponential, both with two parameters and fitted
        by least squares; positive where the exponential is better.
    c, v0 : float
        Of the exponential; v0 in the unit of v, between 1 and 200.
    """
    best = (np.inf, 0.0, 0.0)
    for v0 in np.geomspace(1.0, 200.0, 400):
        shape = np.exp((v - v.max()) / v0)
        c = float(shape @ y / (shape @ shape))
        rss = float(((y - c * shape) ** 2).sum())
        best = min(best, (rss, float(c * np.exp(-v.max() / v0)), float(v0)))
    rest = y - np.polyval(np.polyfit(v, y, 1), v)
    return float(v.size * np.log(float(rest @ rest) / best[0])), best[1], best[2]


def _c18(table: Table) -> Checks:
    passes = [*CURVE, *CURVE_A]
    v, y = cells_of(table, passes, "mean_kmh"), -cells_of(table, passes, "low_slip")
    # the slip over the wheel's speed has no bound where the wheel stops: such passes would decide alone
    rolling = cells_of(table, passes, "any_stop") < 0.5
    n = v.shape[1]

    def fit(rows: Rows) -> tuple[float, float, float]:
        some = rolling[:, rows]
        return aic_gain(v[:, rows][some], y[:, rows][some])

    def part(k: int) -> Statistic:
        return lambda rows: fit(rows)[k]

    gain, ci = estimate(part(0), n)
    whole = gain > AIC_SURE and ci[0] > 0.0
    return (
        Check(
            "C18",
            "front slip (3.13, 5 % quantile on the lane), 70 to 110 km/h, constant and 0.5 m/s², passes in which no "
            f"front wheel stops: Akaike's criterion of -c exp(v / v0) better than a line's by {AIC_SURE:g}, its "
            "interval above 0; with a difference: better",
            f"better by {told(gain, ci)} over {int(rolling.sum())} of {v.size} passes, v0 = {said(part(2), n)} km/h",
            judged(whole=whole, part=gain > 0.0), value=gain, ci95=ci, unit="AIC",
            reason=SHAPE + " The unit of the thesis' axis is not certain; the shape does not depend on it."
            + ("" if whole else " A straight line explains the points about as well."),
            source=SOURCE,
        ),
    )  # fmt: skip


def _c19(table: Table) -> Checks:
    dips = cells_of(table, list(_c19_needs()), "dips")
    k, n = int((dips > 0).sum()), dips.size
    return (
        Check(
            "C19", "no dip below -2 %, 89 to 130 km/h, 1.3 mm; with a difference: in under 1 of 20 passes",
            f"{int(dips.sum())} dips in {n} passes", judged(whole=k == 0, part=k < 0.05 * n),
            value=k / n, ci95=wilson(k, n), reason=SHAPE, source="truth of simulated passes, new winter tyres",
        ),
    )  # fmt: skip


def _c19_needs() -> Iterator[Pass]:
    return (Pass(v, tyre="new_winter") for v in (89, 98, 106, 118, 130))


CHECKS: tuple[tuple[tuple[str, ...], Maker], ...] = (
    (("C13",), by_passes(lambda: (Pass(v) for v in SHOWN), _c13)),
    (("C14",), by_passes(lambda: (Pass(89),), _c14)),
    (("C15",), by_passes(lambda: (Pass(v) for v in SHOWN[:3]), _c15)),
    (("C16",), by_passes(lambda: (Pass(118),), _c16)),
    (("C17",), by_passes(lambda: (Pass(v) for v in FINE), _c17)),
    (("C18",), by_passes(lambda: (*CURVE, *CURVE_A), _c18)),
    (("C19",), by_passes(_c19_needs, _c19)),
)
