"""How visible an effect is in simulated signals, by plain physics and without the engine: the length of its whitened trace.

Four kinds of residuals over blocks of 0.1 s: accelerometer less torque and air over mass; accelerometer less the derivative
of the velocity; slip of each wheel; lateral accelerometer less velocity times yaw rate. The trace is the difference of
two drives, one with the effect, without noise or with the same noise. Each residual is whitened by an autoregression of its
noise, which is taken as independent of the others'.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import polars as pl

from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle

__all__ = ["detectability", "residuals"]

WHEELS = ("fl", "fr", "rl", "rr")
BLOCK, ORDER, V_LEAST = 10, 12, 5.0


def residuals(frame: pl.DataFrame, car: Vehicle) -> Mapping[str, FloatArray]:
    """Residuals by channel, each (n,), NaN where the car stands or a signal is missing."""
    c = {n: _blocks(frame[n].cast(pl.Float64).fill_null(float("nan")).to_numpy()) for n in frame.columns if n != "t"}
    dt = BLOCK * float(frame["t"][1] - frame["t"][0])
    v = c["v_x"] if "v_x" in c else np.mean([c[f"omega_{w}"] * car.r_e(w) for w in WHEELS], axis=0)
    moving = v > V_LEAST
    pull = np.sum([c[f"torque_{w}"] / car.arm(w) for w in WHEELS], axis=0)
    air = 0.5 * car.air_density * car.drag_area * v * v
    out = {
        "force": c["a_x"] - (pull - air) / car.mass,
        "kinematic": c["a_x"] - np.gradient(v, dt),
        "lateral": c["a_y"] - v * c["yaw_rate"],
        **{f"slip_{w}": c[f"omega_{w}"] * car.r_e(w) / np.maximum(v, V_LEAST) - 1.0 for w in WHEELS},
    }
    return {n: np.where(moving, x, np.nan) for n, x in out.items()}


def detectability(
    with_effect: Mapping[str, FloatArray], without: Mapping[str, FloatArray], noise: Mapping[str, FloatArray]
) -> float:
    """Whitened length of the difference of two drives' residuals, with the noise of a third set."""
    total = 0.0
    for name, x in with_effect.items():
        e = noise[name] - np.nanmean(noise[name]) if np.isfinite(noise[name]).any() else noise[name]
        filter_, sigma = _autoregression(np.nan_to_num(e))
        trace = np.convolve(np.nan_to_num(x - without[name]), filter_, "valid")
        total += float(trace @ trace) / max(sigma, 1e-12) ** 2
    return float(np.sqrt(total))


def _blocks(x: FloatArray) -> FloatArray:
    n = x.size // BLOCK
    out: FloatArray = x[: n * BLOCK].reshape(n, BLOCK).mean(axis=1)
    return out


def _autoregression(e: FloatArray) -> tuple[FloatArray, float]:
    """Whitening filter and the size of its innovations."""
    past = np.column_stack([e[ORDER - k - 1 : e.size - k - 1] for k in range(ORDER)])
    a = np.linalg.lstsq(past, e[ORDER:], rcond=None)[0]
    return np.concatenate([[1.0], -a]), float(np.std(e[ORDER:] - past @ a))
