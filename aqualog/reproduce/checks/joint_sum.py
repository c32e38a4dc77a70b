"""The sum of joint detector 2 by hand."""

from __future__ import annotations

import math

import numpy as np

from aqualog.core.records import Track
from aqualog.detect import joint_cusum
from aqualog.detect.joint_cusum import JointCusumParams
from aqualog.reproduce.check import Check, Checks, Maker, Plan
from aqualog.reproduce.verdict import DIFFERENCE, judged

__all__ = ["CHECKS", "SEEDS"]

SEEDS = range(11000, 11200)


def _track(detector: str, wheel: str | None, statistic: float) -> Track:
    return Track(detector, wheel, None, "-", np.array([statistic]), 1.0, np.zeros(1, dtype=np.bool_))


def _sum(plan: Plan) -> Checks:
    """C71: the sum of 2.11 by hand."""
    rng = np.random.default_rng(plan.seeds[0])
    p = JointCusumParams(with_slope=False)
    worst, n, least = 0.0, 2000, math.inf
    for _ in range(n):
        up, down, rr, variance = (
            rng.uniform(0.0, 4.0, 2),
            rng.uniform(0.0, 4.0, 4),
            rng.uniform(0.0, 1.0),
            rng.uniform(-3.0, 9.0, 2),
        )
        tracks = [
            *(_track("spin_up", w, x) for w, x in zip(("rl", "rr"), up, strict=True)),
            *(_track("spin_down", w, x) for w, x in zip(("fl", "fr", "rl", "rr"), down, strict=True)),
            _track("resistance", None, rr),
            *(_track("minor_spin_down", w, x) for w, x in zip(("fl", "fr"), variance, strict=True)),
        ]
        everywhere = np.ones(1, dtype=np.bool_)
        terms = joint_cusum.terms(p, [(t, everywhere) for t in tracks], np.zeros(1), 1)
        ours = math.fsum(float(x[0]) for x in terms.values())
        printed = (min(max(variance), p.var_high) - p.var_low) / (p.var_high - p.var_low)
        least = min(least, printed)
        by_hand = (
            min(max(up) / p.g_up, 1.0)
            + min(max(down) / p.g_down, 1.0)
            + min(rr / p.g_resistance, 1.0)
            + max(printed, 0.0)
        )
        worst = max(worst, abs(ours - by_hand))
    exact = worst < 1e-12
    reason = (
        "The third term is the CUSUM of the rolling resistance, as in the text; the printed equation has one of the "
        "variance, which would appear twice. The fourth term is clipped below too, since as printed it becomes "
        "negative. Every term is clipped at 1. The largest wheel or side counts, which 2.11 leaves open."
    )
    return (
        Check(
            "C71",
            "sum against one by hand within 1e-12; as printed, for the claim as a whole",
            f"{worst:.1e} over {n} random states; the printed variance term would fall to {least:.2f} in them",
            DIFFERENCE if exact else judged(whole=False),
            value=worst,
            reason=reason,
            source="random numbers",
        ),
    )


CHECKS: tuple[tuple[tuple[str, ...], Maker], ...] = ((("C71",), _sum),)
