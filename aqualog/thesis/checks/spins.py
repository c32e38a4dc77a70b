"""Order of the effects over speed, loss of contact, spin-downs and spin-ups, by passes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aqualog.core.intervals import wilson
from aqualog.core.records import FloatArray
from aqualog.evaluate.labels import CONTACT_FULL
from aqualog.thesis.claims import Check, Checks, judge, limit
from aqualog.thesis.evidence.passes import HIGH, LOW, MEDIUM, SPIN_EDGES, SPIN_UP, Pass
from aqualog.thesis.evidence.seeds import (
    Rows,
    Statistic,
    Table,
    by_passes,
    cells_of,
    estimate,
    first_speed,
    mean,
    mean_of,
    number,
    said,
    share,
    told,
)

__all__ = ["CHECKS", "full_speed"]

GRID = tuple(range(78, 126, 4))  # [km/h]
DRY = Pass(80, h=0.0, wiggles=True)
FLOODED = Pass(150, even=True, scatter=0.0)
FINE = tuple(range(84, 124, 2))
CONSTANT = tuple(Pass(v) for v in FINE)
KICKED = tuple(Pass(v, kick=T) for T in (1000.0, 2000.0) for v in range(70, 140, 6))
SOON, RESISTANCE, SLOPE_LOSS = 0.5, 0.2, 0.2  # [s], [m/s^2], [-]
NO_FORCE, OVERLOAD_S = limit("no_force", "C4.passes_full"), limit("overload_s", "C4.passes_partial")  # [-], [s]
SPUN = 0.1  # [-]


def _c3(table: Table) -> Check:
    plain, wiggling = [Pass(v) for v in GRID], [Pass(v, wiggles=True) for v in GRID]
    dry = mean(table[DRY].of("slope_rr"))
    slope = cells_of(table, wiggling, "slope_rr")
    reached = {
        "resistance": cells_of(table, plain, "delta_a") > RESISTANCE,
        "slope -20 %": slope < (1.0 - SLOPE_LOSS) * dry,
        "slope -50 %": slope < 0.5 * dry,
        "first dip": cells_of(table, plain, "dips") > 0,
        "full": cells_of(table, plain, "stop_s") < SOON,
    }
    n = slope.shape[1]
    at = {k: first_speed(GRID, met) for k, met in reached.items()}
    v = {k: f(np.arange(n)) for k, f in at.items()}
    early = max(v["resistance"], v["slope -20 %"])
    lead, ci = estimate(lambda r: at["first dip"](r) - max(at["resistance"](r), at["slope -20 %"](r)), n)
    whole, part = early < v["first dip"] < v["full"] < np.inf, max(early, v["first dip"]) < v["full"] < np.inf
    outcome = (
        "; ".join(f"{k} {said(f, n)}" for k, f in at.items()) + f" km/h; first dip after both by {told(lead, ci)} km/h"
    )
    return judge("C3.passes", outcome, whole=whole, part=part, value=lead, ci95=ci)


def full_speed(table: Table, passes: Sequence[Pass]) -> Statistic:
    """Speed of full aquaplaning of passes that differ in speed alone: half of them stop a front wheel. [km/h]"""
    return first_speed([p.kmh for p in passes], cells_of(table, passes, "any_stop") > 0.5)


def _c4(table: Table) -> Checks:
    force = max(float(table[p].of("afloat_force").max()) for p in (FLOODED, Pass(118), Pass(122)))
    spun = cells_of(table, KICKED, "rear_spin").ravel() > SPUN
    full = full_speed(table, CONSTANT)(np.arange(len(table[CONSTANT[0]].figures)))
    slower = np.repeat([p.kmh < full for p in KICKED], spun.size // len(KICKED))
    partial = cells_of(table, KICKED, "rear_contact").ravel()[spun & slower] > CONTACT_FULL
    overloaded = cells_of(table, KICKED, "overload_s").ravel() > OVERLOAD_S
    hit, spared = (float(x.mean()) if x.size else 0.0 for x in (overloaded[spun], ~overloaded[~spun]))
    balanced = 0.5 * (hit + spared)
    k, n = int(partial.sum()), int(partial.size)
    ok = n > 0 and k >= 0.8 * n
    most = f"at most {force:.2e} of the load (118, 122 and 150 km/h)"
    outcome = (
        f"{k} of {n} below {full:.1f} km/h begin with contact left; balanced accuracy {balanced:.3f} over {spun.size} "
        f"passes, found {hit:.3f}, spared {spared:.3f}"
    )
    whole, value = ok and balanced >= 0.9, k / n if n else None
    return (
        judge("C4.passes_full", most, whole=force < NO_FORCE, value=force),
        judge("C4.passes_partial", outcome, whole=whole, part=ok, value=value, ci95=wilson(k, n)),
    )


def _c5(table: Table) -> Check:
    times = table[FLOODED].of("gone_still_s")
    stops, middle = int((times < 1.0).sum()), float(np.median(times))
    outcome = (
        f"{middle:.3f} s ({times.min():.3f} to {times.max():.3f}), {stops} of {times.size} within 1 s "
        "(150 km/h, even contact)"
    )
    ci95 = (float(times.min()), float(times.max()))
    return judge("C5.passes", outcome, whole=stops == times.size, part=2 * stops >= times.size, value=middle, ci95=ci95)


SHOWN = (89, 98, 106, 118)  # thesis Fig. 2.3
CURVE = tuple(Pass(v) for v in (70, *GRID[:9]))  # up to 110 km/h, below full aquaplaning
CURVE_A = tuple(Pass(v, a=0.5) for v in (78, 86, 94, 102))
CONSTANT_KMH, AIC_SURE = limit("constant_kmh", "C13.passes"), limit("aic_sure", "C18.passes")


def _c13(table: Table) -> Check:
    change = cells_of(table, [Pass(v) for v in SHOWN], "speed_change")
    kept = change < CONSTANT_KMH
    largest = float(change.max())
    outcome = f"at most {largest:.2f} km/h, kept in {share(int(kept.sum()), kept.size)} of the passes"
    return judge("C13.passes", outcome, whole=bool(kept.all()), part=bool(kept.mean() >= 0.5), value=largest)


def _c14(table: Table) -> Check:
    dips = table[Pass(89)].of("dips")
    k, n = int((dips > 0).sum()), dips.size
    outcome = f"{dips.mean():.2f} per pass, in {k} of {n} passes"
    return judge("C14.passes", outcome, whole=k > 0, value=k / n, ci95=wilson(k, n))


def _c15(table: Table) -> Check:
    cells = [table[Pass(v)] for v in (89, 98, 106)]
    count = [c.of("dips") for c in cells]
    depth = [mean(c.of("depth")) for c in cells]
    yaw, stops = float(np.degrees(cells[2].of("yaw").max())), float(cells[2].of("any_stop").mean())
    n = count[0].size
    a, b, c = (float(x.mean()) for x in count)
    more, ci = estimate(lambda r: float(count[2][r].mean() - count[0][r].mean()), n)
    whole = a < b < c and depth[2] < depth[1] and yaw < 3.0 and stops < 0.5
    outcome = (
        f"{a:.2f}, {b:.2f}, {c:.2f} dips per pass, {told(more, ci)} more at 106 than at 89; depth {depth[1]:.3f}, "
        f"{depth[2]:.3f}; heading {yaw:.1f} deg; stops {stops:.0%}"
    )
    return judge("C15.passes", outcome, whole=whole, part=a < b < c, value=more, ci95=ci)


def _c16(table: Table) -> Check:
    c = table[Pass(118)]
    stop, up, down = (c.of(k) for k in ("stop_s", "rear_spin_s", "rear_stop_s"))
    n = stop.size
    full, ever = float((stop < SOON).mean()), float((c.of("rear_spin") > SPIN_UP).mean())
    with np.errstate(invalid="ignore"):
        at_once = (np.abs(up - stop) < 1.0) & (up < down)
    k = int(at_once.sum())
    whole, part = full >= 0.5 and 2 * k >= n, full >= 0.5 and ever >= 0.5
    outcome = (
        f"front right {full:.0%} (the anchor, fitted on other seeds); rear up at once {k} of {n}, up at all "
        f"{ever:.0%}, down first {float((down < up).mean()):.0%}"
    )
    return judge("C16.passes", outcome, whole=whole, part=part, value=k / n, ci95=wilson(k, n))


def _c17(table: Table) -> Check:
    dips = cells_of(table, CONSTANT, "dips")
    minor, full = first_speed(FINE, dips > 0), full_speed(table, CONSTANT)
    n = dips.shape[1]
    value, ci = estimate(lambda r: full(r) - minor(r), n)
    there = np.isfinite(value)
    outcome = f"full {said(full, n)}, first dip {said(minor, n)}: {told(value, ci)} km/h"
    whole, part = bool(there and ci[0] >= 15.0 and ci[1] <= 25.0), bool(there and 10.0 <= value <= 30.0)
    return judge("C17.passes", outcome, whole=whole, part=part, **number(value, ci))


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
    widths = np.geomspace(1.0, 200.0, 400)
    shapes = np.exp((v - v.max()) / widths[:, None])
    sizes = np.einsum("ij,j->i", shapes, y) / np.einsum("ij,ij->i", shapes, shapes)
    squares = ((y - sizes[:, None] * shapes) ** 2).sum(axis=1)
    best = int(np.argmin(squares))
    v0 = float(widths[best])
    rest = y - np.polyval(np.polyfit(v, y, 1), v)
    gain = float(v.size * np.log(float(rest @ rest) / squares[best]))
    return gain, float(sizes[best] * np.exp(-v.max() / v0)), v0


def _c18(table: Table) -> Check:
    passes = [*CURVE, *CURVE_A]
    v, y = cells_of(table, passes, "mean_kmh"), -cells_of(table, passes, "low_slip")
    # the slip over the wheel's speed has no bound where the wheel stops: such passes would decide alone
    rolling = cells_of(table, passes, "any_stop") < 0.5
    n = v.shape[1]

    def fit(rows: Rows) -> tuple[float, float, float]:
        some = rolling[:, rows]
        return aic_gain(v[:, rows][some], y[:, rows][some])

    gain, ci = estimate(lambda rows: fit(rows)[0], n)
    whole, v0 = gain > AIC_SURE and ci[0] > 0.0, said(lambda rows: fit(rows)[2], n)
    outcome = f"better by {told(gain, ci)} over {int(rolling.sum())} of {v.size} passes, v0 = {v0} km/h"
    return judge("C18.passes", outcome, whole=whole, part=gain > 0.0, value=gain, ci95=ci)


NEW_WINTER = tuple(Pass(v, tyre="new_winter") for v in (89, 98, 106, 118, 130))


def _c19(table: Table) -> Check:
    dips = cells_of(table, NEW_WINTER, "dips")
    k, n = int((dips > 0).sum()), dips.size
    outcome = f"{int(dips.sum())} dips in {n} passes"
    return judge("C19.passes", outcome, whole=k == 0, part=k < 0.05 * n, value=k / n, ci95=wilson(k, n))


KICKS = (500.0, 1000.0, 1500.0, 2000.0)  # [N m]
KICK_SPEEDS = tuple(range(70, 140, 6))  # [km/h]
SPEEDS, ACCELERATIONS = tuple(range(90, 142, 6)), (2.0, 3.0, 4.0)  # [km/h], [m/s^2]
PUSHED = tuple(Pass(v, a=a, p=HIGH) for v in SPEEDS for a in ACCELERATIONS)
EVEN_SPEEDS = (102, 108, 114, 120, 126)
EVEN = tuple(Pass(v, a=3.0, p=HIGH, even=True) for v in EVEN_SPEEDS)
UNEVEN = tuple(Pass(v, a=3.0, p=HIGH) for v in EVEN_SPEEDS)
SAMPLES = 500  # that a bin must have, ms
SPREAD_KMH, IRREGULAR = limit("spread_kmh", "C21.passes"), limit("irregular", "C21.passes")


def _bins(spins: FloatArray, wheel: int, rows: Rows) -> tuple[FloatArray, FloatArray]:
    """Speeds [km/h] of the bins with enough samples, and mean traction in them; spins (passes, seeds, 2, bins, 2)."""
    count, total = np.moveaxis(spins[:, rows, wheel].sum(axis=(0, 1)), -1, 0)
    good = count > SAMPLES
    return SPIN_EDGES[:-1][good] + 5.0, total[good] / count[good]


def rank_correlation(x: FloatArray, y: FloatArray) -> float:
    """Spearman's rank correlation [spearman1904] of arrays (n,) without ties; NaN for fewer than three."""
    if x.size < 3:
        return float("nan")
    return float(np.corrcoef(np.argsort(np.argsort(x)), np.argsort(np.argsort(y)))[0, 1])


def _c20(table: Table) -> Check:
    spun = {T: cells_of(table, [Pass(v, kick=T) for v in KICK_SPEEDS], "rear_spin") > SPUN for T in KICKS}
    at = {T: first_speed(KICK_SPEEDS, x) for T, x in spun.items()}
    n = spun[KICKS[0]].shape[1]
    v = np.array([f(np.arange(n)) for f in at.values()])
    whole = bool(np.isfinite(v).all() and np.all(np.diff(v) < 0))
    fall, ci = estimate(lambda r: at[KICKS[0]](r) - at[KICKS[-1]](r), n)
    outcome = (
        ", ".join(f"{T:.0f} N m: {said(f, n)}" for T, f in at.items()) + f" km/h; {told(fall, ci)} km/h sooner in all"
    )
    return judge("C20.passes", outcome, whole=whole, part=bool(v[-1] < v[0]), **number(fall, ci))


def _c21(table: Table) -> Check:
    spun = cells_of(table, PUSHED, "rear_spin") > SPUN
    onset = np.where(spun, cells_of(table, PUSHED, "rear_spin_v"), np.nan)
    n = spun.shape[1]

    def spread(rows: Rows) -> float:
        there = onset[:, rows][np.isfinite(onset[:, rows])]
        return float(np.quantile(there, 0.9) - np.quantile(there, 0.1)) if there.size else float("nan")

    share = spun.mean(axis=1)
    mixed = int(((share > 0.1) & (share < 0.9)).sum())
    value, ci = estimate(spread, n)
    is_wide, is_mixed = bool(value >= SPREAD_KMH), mixed >= IRREGULAR
    outcome = (
        f"{int(spun.sum())} of {spun.size} passes spin up; speeds spread over {told(value, ci)} km/h; {mixed} of "
        f"{share.size} cases are mixed"
    )
    return judge("C21.passes", outcome, whole=is_wide and is_mixed, part=is_wide or is_mixed, value=value, ci95=ci)


def _c22(table: Table) -> Check:
    spins = cells_of(table, PUSHED, "spins")
    n = spins.shape[1]
    ranks, text = [], []
    for k, w in enumerate(("rl", "rr")):
        rank = estimate(lambda rows, k=k: rank_correlation(*_bins(spins, k, rows)), n, of=2)  # type: ignore[misc]
        bins = ", ".join(f"{a:.0f}: {b:.3f}" for a, b in zip(*_bins(spins, k, np.arange(n)), strict=True))
        ranks.append(rank)
        text.append(f"{w}: {bins}, rank {told(*rank, 2)}")
    falls = [r < 0.0 for r, _ in ranks]
    return judge("C22.passes", "; ".join(text), whole=all(falls), part=any(falls), **number(*max(ranks)))


def _difference(spins: FloatArray) -> Statistic:
    """Mean traction left minus right over the bins that both have."""

    def statistic(rows: Rows) -> float:
        (v_l, left), (v_r, right) = (_bins(spins, k, rows) for k in (0, 1))
        _, i, j = np.intersect1d(v_l, v_r, return_indices=True)
        return float(np.mean(left[i] - right[j])) if i.size else float("nan")

    return statistic


def _c23(table: Table) -> Check:
    uneven, even = (_difference(cells_of(table, p, "spins")) for p in (UNEVEN, EVEN))
    n = len(table[EVEN[0]].figures)
    a, ci = estimate(uneven, n)
    b, ci_even = estimate(even, n)
    apart = bool(np.isfinite(a) and (ci[0] > 0.0 or ci[1] < 0.0))
    whole = apart and bool(np.isfinite(b) and abs(a) > 3.0 * abs(b))
    outcome = f"left minus right {told(a, ci, 3)}; alike on both sides {told(b, ci_even, 3)} (3 m/s², 102 to 126 km/h)"
    return judge("C23.passes", outcome, whole=whole, part=apart, **number(a, ci))


_DIFFERENT = Pass(106, kick=1000.0)
_FACTORS = {
    "drivetrain": [replace(_DIFFERENT, rear_share=x) for x in (1.0, 0.0, 0.6)],
    "tyre": [replace(_DIFFERENT, tyre=t) for t in ("new_winter", "new_summer", "worn_summer", "very_worn_summer")],
    "pressure": [replace(_DIFFERENT, p=p) for p in (LOW, MEDIUM, HIGH)],
    "depth": [replace(_DIFFERENT, h=h) for h in (0.6e-3, 1.3e-3, 2.0e-3)],
}


def _c6(table: Table) -> Check:
    found = {}
    for name, passes in _FACTORS.items():
        for effect, unit in (("dips", "spin-downs"), ("rear_spin", "rear spin-ups"), ("delta_a", "m/s^2")):
            values = cells_of(table, passes, effect)
            counted = (values > SPUN).astype(np.float64) if effect == "rear_spin" else values
            sizes = [estimate(mean_of(x), x.size, of=len(counted)) for x in counted]
            least, most = min(sizes), max(sizes)
            found[name, unit] = least[1][1] < most[1][0], f"{least[0]:.2f} to {most[0]:.2f} {unit}"
    differ = {name: [text for (n, _), (is_apart, text) in found.items() if n == name and is_apart] for name in _FACTORS}
    outcome = "; ".join(f"{name}: {', '.join(texts) or 'alike'}" for name, texts in differ.items())
    k = sum(map(bool, differ.values()))
    return judge("C6.passes", outcome, whole=k == len(differ), part=k >= len(differ) - 1, value=k / len(differ))


CHECKS = (
    by_passes("C6", lambda: (p for passes in _FACTORS.values() for p in passes), _c6),
    by_passes("C3", lambda: (DRY, *(Pass(v, wiggles=w) for v in GRID for w in (False, True))), _c3),
    by_passes("C4", lambda: (FLOODED, Pass(118), Pass(122), *KICKED, *CONSTANT), _c4),
    by_passes("C5", lambda: (FLOODED,), _c5),
    by_passes("C13", lambda: (Pass(v) for v in SHOWN), _c13),
    by_passes("C14", lambda: (Pass(89),), _c14),
    by_passes("C15", lambda: (Pass(v) for v in SHOWN[:3]), _c15),
    by_passes("C16", lambda: (Pass(118),), _c16),
    by_passes("C17", lambda: CONSTANT, _c17),
    by_passes("C18", lambda: (*CURVE, *CURVE_A), _c18),
    by_passes("C19", lambda: NEW_WINTER, _c19),
    by_passes("C20", lambda: (Pass(v, kick=T) for v in KICK_SPEEDS for T in KICKS), _c20),
    by_passes("C21", lambda: PUSHED, _c21),
    by_passes("C22", lambda: PUSHED, _c22),
    by_passes("C23", lambda: (*UNEVEN, *EVEN), _c23),
)
