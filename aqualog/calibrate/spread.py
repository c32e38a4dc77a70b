"""Compute intervals of estimates whose residuals are correlated: blocks or whole drives are left out in turn."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from aqualog.calibrate.balance import Sample
from aqualog.calibrate.design import Windows
from aqualog.core.errors import FitError
from aqualog.core.intervals import jackknife_sd, student_quantile, variance_ratio_chance

__all__ = [
    "BLOCKS_MIN", "DRIVES_MIN", "WIND_SD", "Spread", "combined", "half_width", "jackknife", "jackknife_of",
    "one_more", "spread_of", "stratified",
]  # fmt: skip

DRIVES_MIN = 4  # from here on the drives themselves show how they differ
DOF_KNOWN = 1e3  # degrees of freedom of a variance that counts as known
DOUBT = 0.25  # [-] chance of a spread between drives as large as seen, below which the assumptions are given up
BLOCKS_MIN = 5
WIND_SD = 3.0  # [m/s] along the road, mean over a drive (K)

Estimate = Mapping[str, float]
Estimator = Callable[[Sequence[Sample]], Estimate]


class Spread(NamedTuple):
    """Standard deviations by name, degrees of freedom by name, and whether whole drives were left out."""

    sd: Mapping[str, float]
    dof: Mapping[str, float]
    by_drive: bool


def half_width(sd: float, dof: float) -> float:
    """Return half of the 95 % interval. NaN without a finite standard deviation."""
    if not math.isfinite(sd):
        return math.nan
    return student_quantile(0.975, max(dof, 1.0)) * sd if dof < 200.0 else 1.96 * sd


def spread_of(estimator: Estimator, samples: Sequence[Sample], *, drag: float, air_density: float) -> Spread:
    """Estimate the errors of estimates.

    Parameters
    ----------
    estimator : callable
        Estimates by name from any subset of drives or windows.
    samples : sequence of Sample
    drag : float
        Drag area over mass, for the wind. [m²/kg]
    air_density : float
        [kg/m^3]

    Jackknife over blocks of 40 s, plus the errors that one drive hides: a steady wind of 3 m/s rms, and the height
    at its ends, in each drive on its own. Four drives or more: `combined` with a jackknife over drives, so that the
    interval includes what differs between them (wind, surface, temperature, offset, driver).

    Raises
    ------
    FitError
        If the drives hold fewer than five blocks.
    """
    assumed = _of_blocks_and_assumptions(estimator, samples, drag=drag, air_density=air_density)
    if len(samples) < DRIVES_MIN:
        return assumed
    left = [estimator([s for k, s in enumerate(samples) if k != j]) for j in range(len(samples))]
    return combined(assumed, Spread(*jackknife(left), by_drive=True))


def one_more(spread: Spread, count: int) -> dict[str, float]:
    """Return the standard deviation by which one more drive differs from the estimates over `count` drives, by name.

    With sd that of estimates over J drives, it is sd sqrt(J) for a drive by itself and sd sqrt(J + 1) for its
    difference to the estimates (D). It is scaled so that 1.96 of it is half of the 95 % interval, whatever the degrees
    of freedom. Empty where the drives do not show how they differ.
    """
    if not spread.by_drive:
        return {}
    half = {n: half_width(sd * math.sqrt(count + 1.0), spread.dof[n]) for n, sd in spread.sd.items()}
    return {n: x / 1.96 for n, x in half.items() if math.isfinite(x)}


def combined(assumed: Spread, seen: Spread) -> Spread:
    """Combine the assumed spread with that seen between drives, name by name.

    Both are variances of the same estimate where the assumptions hold. They are pooled, weighted by their degrees of
    freedom. The drives alone count where F = seen / assumed exceeds its 75 % quantile. Pooling after a preliminary test
    at 25 %, not 5 %, keeps nearly the nominal level whatever the true spread is (Bozivich, Bancroft and Hartley
    [bozivich1956], K). For normal estimates, 95 % intervals from four drives cover in 96 % where the assumptions hold.
    They cover in at least 92 % where the variance is any multiple of the assumed one (D). The wider of the two spreads
    would cover in 98 %: it picks the estimate that erred upwards.
    """
    sd, dof = {}, {}
    for n in seen.sd:
        a, s, nu_a, nu_s = assumed.sd[n] ** 2, seen.sd[n] ** 2, min(assumed.dof[n], DOF_KNOWN), seen.dof[n]
        if variance_ratio_chance(s / a, nu_s, nu_a) < DOUBT if a > 0.0 else True:
            sd[n], dof[n] = seen.sd[n], nu_s
        else:
            dof[n] = nu_a + nu_s
            sd[n] = math.sqrt((nu_a * a + nu_s * s) / dof[n])
    return Spread(sd, dof, by_drive=True)


def _of_blocks_and_assumptions(
    estimator: Estimator, samples: Sequence[Sample], *, drag: float, air_density: float
) -> Spread:
    within = jackknife_of(estimator, samples)
    best = estimator(samples)
    assumed = dict.fromkeys(best, 0.0)
    for j, sample in enumerate(samples):
        w, o = sample.windows, sample.offset
        # the drive as it would have been in more head or tail wind, and with another offset where the height allows it
        air = (0.5 * air_density * ((w.v + wind) ** 2 - w.v**2) for wind in (WIND_SD, -WIND_SD))
        winds = [sample._replace(windows=w._replace(a_x=w.a_x - drag * extra)) for extra in air]
        offset = [sample._replace(offset=o._replace(value=o.value + o.sd))] if math.isfinite(o.sd) else []
        for others in (winds, offset):
            moved = [estimator([*samples[:j], other, *samples[j + 1 :]]) for other in others]
            for name in assumed if moved else ():
                # mean square over head and tail wind, which come alike
                assumed[name] += sum((m[name] - best[name]) ** 2 for m in moved) / len(moved)
    sd = {n: math.sqrt(within.sd[n] ** 2 + assumed[n]) for n in best}
    # [welch1947], [satterthwaite1946]: the assumed part is known, the part from the blocks is not
    dof = {n: within.dof[n] * (sd[n] / within.sd[n]) ** 4 if within.sd[n] > 0.0 else DOF_KNOWN for n in best}
    return Spread(sd, dof, by_drive=False)


def jackknife_of(estimator: Estimator, samples: Sequence[Sample]) -> Spread:
    """Leave out each block of windows in turn; only differences between blocks of one drive count.

    The sum over drives treats them as strata. Differences between whole drives (wind) would otherwise count twice:
    here and in the assumptions.
    """
    blocks = [[(j, b) for b in np.unique(s.windows.block)] for j, s in enumerate(samples)]
    if (count := sum(len(b) for b in blocks)) < BLOCKS_MIN:
        raise FitError(
            f"{count} blocks of 40 s of straight, unbraked, dry driving",
            expected=f"{BLOCKS_MIN} at the least for an interval", hint="longer or more drives",
        )  # fmt: skip
    parts = []
    for of_drive in blocks:
        left = []
        for j, b in of_drive:
            kept = Windows(*(x[samples[j].windows.block != b] for x in samples[j].windows))
            rest = [*samples[:j], samples[j]._replace(windows=kept), *samples[j + 1 :]]
            left.append(estimator([s for s in rest if s.windows.v.size]))
        parts.append(left)
    return stratified(parts)


def stratified(parts: Sequence[Sequence[Estimate]]) -> Spread:
    """Add up variances and degrees of freedom of estimates with one part left out each, sorted by drive.

    Drives of a single part form one stratum together; a lone one joins another drive.
    """
    strata = [list(left) for left in parts if len(left) > 1]
    single = [e for left in parts if len(left) == 1 for e in left]
    if len(single) == 1 and strata:
        strata[-1] += single
    elif single:
        strata.append(single)
    each = [jackknife(left) for left in strata]
    names = each[0][0]
    sd = {n: math.sqrt(sum(e[0][n] ** 2 for e in each)) for n in names}
    return Spread(sd, {n: sum(e[1][n] for e in each) for n in names}, by_drive=False)


def jackknife(left: Sequence[Estimate]) -> tuple[dict[str, float], dict[str, float]]:
    """Return standard deviations and degrees of freedom from estimates with one part left out each."""
    sd = {name: float(jackknife_sd(np.array([e[name] for e in left]))) for name in left[0]}
    return sd, dict.fromkeys(sd, len(left) - 1.0)
