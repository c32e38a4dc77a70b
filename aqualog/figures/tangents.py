"""The slope that the estimator settles at, against the tangent of the brush at the working point."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from aqualog.figures.curves import tangent
from aqualog.figures.record import Table
from aqualog.figures.study import LOW_SLOPE, Case, drive, estimate

__all__ = ["settled_slopes", "tangent_table"]

_WINDOW_S = 8.0  # the last seconds of a run, one period of most


def settled_slopes(case: Case) -> tuple[float, float, float]:
    """Mean traction of both axles, tangent of the brush there, and mean estimate, over the last 8 s of a run. [-]

    Both axles slip about alike under the blind split, and the excitation swings about that point: what it shows is the
    tangent there, and not the slope at zero slip.
    """
    d, e = drive(case), estimate(case)
    last = d.t >= case.t_end - _WINDOW_S
    mu = float(0.5 * np.mean(d.mu_f[last] + d.mu_r[last]))
    slope = float(tangent(np.array([mu]), slope=LOW_SLOPE, mu_max=case.low_mu)[0])
    return mu, slope, float(np.mean(e.slope[last]))


def tangent_table(cases: Mapping[str, Case]) -> Table:
    """Estimate and tangent of several runs on the low surface."""
    rows = []
    for name, case in cases.items():
        mu, slope, estimated = settled_slopes(case)
        rows.append(
            (name, f"{mu:.3f}", f"{slope:.2f}", f"{estimated:.2f}", f"{100.0 * (estimated / slope - 1.0):+.1f}")
        )
    return Table(
        f"Slope reached at the end of the run, and the tangent C (1 - mu / mu_max)^(2/3) of the brush at the working "
        f"point (C = {LOW_SLOPE:.0f}, mu_max = 0.4)",
        ("run", "mean traction [-]", "tangent [-]", "estimate [-]", "difference [%]"),
        tuple(rows),
    )
