"""Claims on spin-ups of the driven rear wheels, by passes with kicks of the drive torque and with acceleration."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.reproduce.check import Check, Checks, Maker
from aqualog.reproduce.pass_figures import SPIN_EDGES
from aqualog.reproduce.passes import HIGH, Pass
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
    said,
    told,
)
from aqualog.reproduce.verdict import judged

__all__ = ["CHECKS", "SEEDS", "rank_correlation"]

SOURCE = "truth of simulated passes over 1.3 mm, worn summer tyres, rear-wheel drive"
KICKS = (500.0, 1000.0, 1500.0, 2000.0)  # [N m]
KICK_SPEEDS = tuple(range(70, 140, 6))  # [km/h]
SPEEDS, ACCELERATIONS = tuple(range(90, 142, 6)), (2.0, 3.0, 4.0)  # [km/h], [m/s^2]
PUSHED = tuple(Pass(v, a=a, p=HIGH) for v in SPEEDS for a in ACCELERATIONS)
EVEN_SPEEDS = (102, 108, 114, 120, 126)
EVEN = tuple(Pass(v, a=3.0, p=HIGH, even=True) for v in EVEN_SPEEDS)
UNEVEN = tuple(Pass(v, a=3.0, p=HIGH) for v in EVEN_SPEEDS)
SAMPLES = 500  # that a bin must have, ms
SPUN = 0.1  # [-]
SPREAD_KMH, IRREGULAR = 20.0, 3


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


def _c20(table: Table) -> Checks:
    spun = {T: cells_of(table, [Pass(v, kick=T) for v in KICK_SPEEDS], "rear_spin") > SPUN for T in KICKS}
    at = {T: first_speed(KICK_SPEEDS, x) for T, x in spun.items()}
    n = spun[KICKS[0]].shape[1]
    v = np.array([f(np.arange(n)) for f in at.values()])
    whole = bool(np.isfinite(v).all() and np.all(np.diff(v) < 0))
    fall, ci = estimate(lambda r: at[KICKS[0]](r) - at[KICKS[-1]](r), n)
    return (
        Check(
            "C20",
            "speed at which half of the passes spin up (+10 %) on a kick of 500, 1000, 1500, 2000 N·m falls each time; "
            "with a difference: from the first to the last",
            ", ".join(f"{T:.0f} N m: "
            f"{said(f, n)}" for T, f in at.items()) + f" km/h; {told(fall, ci)} km/h sooner in all",
            judged(whole=whole, part=bool(v[-1] < v[0])),
            value=fall if np.isfinite(fall) else None, ci95=ci if np.isfinite(ci).all() else None, unit="km/h",
            reason="" if whole else "It does not fall with each step of the torque.", source=SOURCE + ", low pressure",
        ),
    )  # fmt: skip


def _c21(table: Table) -> Checks:
    spun = cells_of(table, PUSHED, "rear_spin") > SPUN
    onset = np.where(spun, cells_of(table, PUSHED, "rear_spin_v"), np.nan)
    n = spun.shape[1]

    def spread(rows: Rows) -> float:
        there = onset[:, rows][np.isfinite(onset[:, rows])]
        return float(np.quantile(there, 0.9) - np.quantile(there, 0.1)) if there.size else float("nan")

    share = spun.mean(axis=1)
    mixed = int(((share > 0.1) & (share < 0.9)).sum())
    value, ci = estimate(spread, n)
    whole = bool(value >= SPREAD_KMH and mixed >= IRREGULAR)
    return (
        Check(
            "C21",
            "accelerated passes (2 to 4 m/s², 90 to 138 km/h, high pressure): speeds at which a rear wheel passes +5 "
            f"% spread over {SPREAD_KMH:g} km/h (10 to 90 % of them), and in {IRREGULAR} cases of speed and "
            "acceleration some passes spin up (+10 %) and others not; with a difference: one of both",
            f"{int(spun.sum())} of {spun.size} passes spin up; speeds spread over {told(value, ci)} km/h; {mixed} of "
            f"{share.size} cases are mixed",
            judged(whole=whole, part=bool(value >= SPREAD_KMH or mixed >= IRREGULAR)),
            value=value, ci95=ci, unit="km/h",
            reason=SHAPE if whole else SHAPE + " Speed and torque decide more than the fluctuation of the contact "
            "does.",
            source=SOURCE + ", high pressure",
        ),
    )  # fmt: skip


def _c22(table: Table) -> Checks:
    spins = cells_of(table, PUSHED, "spins")
    n = spins.shape[1]
    ranks: dict[str, tuple[float, tuple[float, float]]] = {}
    text = []
    for k, w in enumerate(("rl", "rr")):
        v, mu = _bins(spins, k, np.arange(n))
        ranks[w] = estimate(_rank(spins, k), n)
        text.append(
            f"{w}: "
            + ", ".join(f"{a:.0f}: {b:.3f}" for a, b in zip(v, mu, strict=True))
            + f", rank {told(*ranks[w], 2)}"
        )
    value, ci = max(ranks.values())
    whole = all(r < 0.0 for r, _ in ranks.values())
    there = bool(np.isfinite(value))
    return (
        Check(
            "C22",
            "mean traction coefficient in spin-ups in bins of 10 km/h (over 500 samples of 1 ms): rank correlation "
            "with the speed below 0, both wheels; with a difference: one wheel",
            "; ".join(text), judged(whole=whole, part=any(r < 0.0 for r, _ in ranks.values())),
            value=value if there else None, ci95=ci if there else None,
            reason=SHAPE if whole else SHAPE + " It does not fall with the speed at both.",
            source=SOURCE + ", high pressure",
        ),
    )  # fmt: skip


def _rank(spins: FloatArray, wheel: int) -> Statistic:
    return lambda rows: rank_correlation(*_bins(spins, wheel, rows))


def _difference(spins: FloatArray) -> Statistic:
    """Mean traction left minus right over the bins that both have."""

    def statistic(rows: Rows) -> float:
        (v_l, left), (v_r, right) = (_bins(spins, k, rows) for k in (0, 1))
        _, i, j = np.intersect1d(v_l, v_r, return_indices=True)
        return float(np.mean(left[i] - right[j])) if i.size else float("nan")

    return statistic


def _c23(table: Table) -> Checks:
    uneven, even = (_difference(cells_of(table, p, "spins")) for p in (UNEVEN, EVEN))
    n = len(table[EVEN[0]].figures)
    a, ci = estimate(uneven, n)
    b, ci_even = estimate(even, n)
    apart = bool(np.isfinite(a) and (ci[0] > 0.0 or ci[1] < 0.0))
    whole = apart and bool(np.isfinite(b) and abs(a) > 3.0 * abs(b))
    return (
        Check(
            "C23",
            "mean traction in spin-ups left minus right in bins of speed: its interval leaves out 0 where the left "
            "track has 0.6 of the water, less evenly, and it is beyond three times that of a lane alike on both "
            "sides; with a difference: the former",
            f"left minus right {told(a, ci, 3)}; alike on both sides {told(b, ci_even, 3)} (3 m/s², 102 to 126 km/h)",
            judged(whole=whole, part=apart),
            value=a if np.isfinite(a) else None, ci95=ci if np.isfinite(a) else None,
            reason=SHAPE + " That the left track has less water is put in."
            if whole else SHAPE + " The tracks of the front wheels leave little of the difference.",
            source=SOURCE + ", high pressure",
        ),
    )  # fmt: skip


CHECKS: tuple[tuple[tuple[str, ...], Maker], ...] = (
    (("C20",), by_passes(lambda: (Pass(v, kick=T) for v in KICK_SPEEDS for T in KICKS), _c20)),
    (("C21",), by_passes(lambda: PUSHED, _c21)),
    (("C22",), by_passes(lambda: PUSHED, _c22)),
    (("C23",), by_passes(lambda: (*UNEVEN, *EVEN), _c23)),
)
