"""Decide when the slip slope may be estimated: in driving that a linear tyre on both axles describes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aqualog.core.records import BoolArray, FloatArray

__all__ = ["LIMITS", "REASONS", "Limits", "inactive_reason"]

REASONS = (
    "active", "signals missing", "too slow", "cornering", "accelerating hard", "braking", "a wheel spins",
    "torque jumps",
)  # fmt: skip
ACTIVE, MISSING, SLOW, CORNERING, HARD, BRAKING, SPINNING, JUMPING = range(len(REASONS))


class Limits(NamedTuple):
    """Bounds of the driving state; those of differential slip and traction are in the tuning of the estimator.

    Thesis 3.2 names the criteria without values.
    """

    v_min: float = 8.0  # [m/s] below, a tooth of the pick-up is as much as the slip
    a_x_max: float = 3.0  # [m/s^2] the load transfer and the tyres' curves are no longer small
    a_y_max: float = 2.0  # [m/s^2] slip angles take from the longitudinal stiffness
    yaw_rate_max: float = 0.25  # [rad/s] paths of front and rear wheels differ
    a_w_delta_max: float = 8.0  # [m/s^2] a wheel that leaves the road's speed
    mu_rate_max: float = 0.4  # [1/s] a gear shift or a pedal that is let go: a torque that is late does not fit then


LIMITS = Limits()


def inactive_reason(
    *,
    v_x: FloatArray,
    a_x: FloatArray,
    a_y: FloatArray,
    yaw_rate: FloatArray,
    a_w_delta: FloatArray,
    is_braking: BoolArray,
    mu_rate: FloatArray | None = None,
    limits: Limits = LIMITS,
) -> FloatArray:
    """Return an index into `REASONS` for every sample; 0 where the slope may be estimated.

    Parameters
    ----------
    v_x : array (n,)
        Velocity. [m/s]
    a_x, a_y : array (n,)
        Accelerations of the body, low-passed. [m/s²]
    yaw_rate : array (n,)
        [rad/s]
    a_w_delta : array (n,)
        Largest wheel acceleration difference of the wheels that are compared, absolute. [m/s²]
    is_braking : bool array (n,)
        A braking force acts on one of them.
    mu_rate : array (n,), optional
        Rate of the traction coefficients, absolute, the larger one. [1/s]

    Returns
    -------
    reason : array (n,)
        NaN in velocity means missing; a missing yaw rate or acceleration does not stop the estimate.
    """
    reason = np.zeros(v_x.size)
    jumps = np.zeros(v_x.size) if mu_rate is None else mu_rate
    with np.errstate(invalid="ignore"):
        # of several reasons the last one is reported
        for code, bits in (
            (JUMPING, jumps > limits.mu_rate_max),
            (SPINNING, a_w_delta > limits.a_w_delta_max),
            (HARD, np.abs(a_x) > limits.a_x_max),
            (CORNERING, (np.abs(a_y) > limits.a_y_max) | (np.abs(yaw_rate) > limits.yaw_rate_max)),
            (BRAKING, is_braking),
            (SLOW, v_x < limits.v_min),
            (MISSING, np.isnan(v_x)),
        ):
            reason[bits] = code
    return reason
