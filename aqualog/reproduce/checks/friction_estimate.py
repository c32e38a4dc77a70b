"""Accuracy of an estimate of the maximum friction under noise."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.reproduce.check import Check, Checks, Maker, Plan
from aqualog.reproduce.statistics import bootstrap, percent
from aqualog.reproduce.verdict import judged

__all__ = ["CHECKS", "SEEDS"]

SEEDS = range(11000, 11200)
# C1: slip as measured on a road, 5 times a second for 10 s, with the offset of the radii unknown
_NOISE, _POINTS, _SLOPE = 5e-4, 50, 30.0
_GOOD, _DRY_RANGE = 0.10, (0.5, 0.7)  # [-] spread of mu_max that may be called known; utilisation at which it is
_UTILISATION = np.arange(0.30, 0.96, 0.05)


def _estimates(rng: np.random.Generator, utilisation: float, mu_max: float, runs: int) -> FloatArray:
    """Estimated mu_max (runs,) of points up to a utilisation; slope, offset and mu_max by least squares of the slip."""
    mu = np.linspace(0.0, utilisation * mu_max, _POINTS)
    grid = mu_max * np.geomspace(max(1.001 * utilisation, 0.2), 20.0, 400)

    def shape(limit: FloatArray) -> FloatArray:
        return 3.0 * limit * (1.0 - np.cbrt(1.0 - mu / limit))  # slip times slope (brush, solved for the slip)

    slip = shape(np.array(mu_max)) / _SLOPE + _NOISE * rng.standard_normal((runs, _POINTS))
    left = np.empty((grid.size, runs))
    for i, limit in enumerate(grid):
        design, _ = np.linalg.qr(np.column_stack([shape(limit), np.ones(_POINTS)]))
        left[i] = np.sum(slip**2, axis=1) - np.sum((slip @ design) ** 2, axis=1)
    return np.asarray(grid[np.argmin(left, axis=0)])


def _utilisation(plan: Plan) -> Checks:
    rng = np.random.default_rng(plan.seeds[0])
    runs = min(max(len(plan.seeds), 20), 200)
    spread = np.empty((2, _UTILISATION.size))
    needed = []
    bands = []
    for row, mu_max in enumerate((1.0, 0.3)):
        found = [_estimates(rng, u, mu_max, runs) / mu_max for u in _UTILISATION]
        half = [0.5 * float(np.subtract(*np.quantile(x, [0.84, 0.16]))) for x in found]
        spread[row] = half
        good = np.flatnonzero(np.array(half) < _GOOD)
        needed.append(float(_UTILISATION[good[0]]) if good.size else 1.0)
        bands.append(found)
    k = int(np.searchsorted(_UTILISATION, 0.6 - 1e-9))
    ci = bootstrap(bands[0][k], lambda x: 0.5 * float(np.subtract(*np.quantile(x, [0.84, 0.16]))))
    dry, low = needed
    whole = _DRY_RANGE[0] <= dry <= _DRY_RANGE[1] and low > dry
    return (
        Check(
            "C1",
            f"least utilisation at which mu_max is known within {percent(_GOOD)} (half of the middle 68 %): "
            f"{_DRY_RANGE[0]:g} to {_DRY_RANGE[1]:g} at mu_max = 1, more at 0.3; in part: more at 0.3",
            f"{dry:.2f} at mu_max = 1 and {low:.2f} at 0.3; spread at a utilisation of 0.4, 0.6, 0.8: "
            + ", ".join(f"{100 * spread[0, i]:.0f}" for i in (k - 4, k, k + 4))
            + " % dry, "
            + ", ".join(f"{100 * spread[1, i]:.0f}" for i in (k - 4, k, k + 4))
            + f" % slippery ({runs} runs each; brush of slope {_SLOPE:g}, slip noise {_NOISE:g} rms, {_POINTS} points, "
            "slope and slip offset unknown)",
            judged(whole=whole, part=low > dry),
            value=float(spread[0, k]),
            ci95=(min(ci), max(ci)),
            reason=""
            if whole
            else "The number depends on how much noise and how many points one takes; the order, "
            "that slippery roads need more, does not.",
            source="least squares on a noisy brush",
        ),
    )


CHECKS: tuple[tuple[tuple[str, ...], Maker], ...] = ((("C1",), _utilisation),)
