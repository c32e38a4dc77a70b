"""Compute the exponentially weighted moving mean and variance."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.core.records import FloatArray
from aqualog.features.smoothing import gain

__all__ = ["EwvarParams", "EwvarState", "from_seconds", "initial_state", "scan", "step"]


class EwvarParams(NamedTuple):
    """Weights of a new sample in the mean (alpha) and in the variance (beta)."""

    alpha: float
    beta: float


class EwvarState(NamedTuple):
    """Mean (NaN before the first sample) and variance."""

    mean: float
    var: float


def from_seconds(tau_mean: float, tau_var: float, dt: float) -> EwvarParams:
    """Return weights with these time constants at any sample rate. [s]"""
    return EwvarParams(gain(tau_mean, dt), gain(tau_var, dt))


def initial_state() -> EwvarState:
    """Return the state before the first sample, which becomes the mean (E4)."""
    return EwvarState(math.nan, 0.0)


@compiled
def step(p, mean, var, x):  # type: ignore[no-untyped-def]
    """Apply thesis 2.5 and 2.6 to one sample: the variance uses the mean before this sample."""
    if math.isnan(x):
        return mean, var
    if math.isnan(mean):
        return x, 0.0
    deviation = x - mean
    var = (1.0 - p.beta) * (var + p.beta * deviation * deviation)
    mean = (1.0 - p.alpha) * mean + p.alpha * x
    return mean, var


@compiled
def _scan(p, mean, var, x):  # type: ignore[no-untyped-def]
    means = np.empty_like(x)
    variances = np.empty_like(x)
    for i in range(x.size):
        mean, var = step(p, mean, var, x[i])
        missing = math.isnan(x[i])
        means[i] = math.nan if missing else mean
        variances[i] = math.nan if missing else var
    return means, variances, mean, var


def scan(p: EwvarParams, state: EwvarState, x: FloatArray) -> tuple[FloatArray, FloatArray, EwvarState]:
    """Compute moving mean and variance (n,) of a signal (n,); `state` from `initial_state` or the piece before.

    NaN: state held, output NaN. Mean and variance are in units of x and x^2; the variance is never negative and does
    not depend on an offset of x. The state comes after them.

    With alpha = beta this is the weighted variance exactly; otherwise white noise of variance s^2 gives
    (1 - beta) 2 / (2 - alpha) s^2 (E4). The form is that of Finch [finch2009] and West [west1979].
    Thesis: Eq. (2.5), (2.6); their Delta a is the wheel acceleration difference of 2.3, not the resistance measure
    of 2.9 (E3).
    """
    means, variances, mean, var = _scan(p, state.mean, state.var, np.ascontiguousarray(x, dtype=np.float64))
    return means, variances, EwvarState(mean, var)
