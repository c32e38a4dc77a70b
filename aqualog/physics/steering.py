"""Steering: from tyre forces to tie rods."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aqualog.types import FloatArray

__all__ = ["tie_rod_force"]


def tie_rod_force(
    F_x: FloatArray,
    F_y_outward: FloatArray,
    *,
    c0: Sequence[float],
    c_y: Sequence[float],
    c_x: Sequence[float],
) -> FloatArray:
    """Tie-rod force of one front wheel by a polynomial transfer function.

    Parameters
    ----------
    F_x : array
        Longitudinal force on the wheel, forward positive. [N]
    F_y_outward : array
        Lateral force on the wheel away from the vehicle's centre line (left wheel: F_y, right wheel: -F_y): one rod is
        pressed where the other is pulled, so both sides share the coefficients and a mirrored drive swaps them. [N]
    c0, c_y, c_x : sequence of float
        c0[0]; then powers from the first on: c_y[0] F_y + c_y[1] F_y^2 + ... [N, -, 1/N, ...]

    Returns
    -------
    F : array
        Compression positive. [N]

    Thesis: section 2.4 (no number): a polynomial from a multi-body simulation of the front axle.
    """
    force = np.zeros_like(np.asarray(F_x, dtype=np.float64)) + sum(c0)
    for power, c in enumerate(c_y, 1):
        force = force + c * F_y_outward**power
    for power, c in enumerate(c_x, 1):
        force = force + c * F_x**power
    return force
