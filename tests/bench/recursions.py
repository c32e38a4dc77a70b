"""Recursions over samples: two-sided CUSUM with gate and reset, exponentially weighted variance."""

from __future__ import annotations

import numpy as np

from tests.bench.compare import Row
from tests.bench.scale import Scale

DT = 0.01
WHEELS = 4
DECAY = 0.02

Wheel = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Acceleration difference [m/s^2], speed difference [m/s], velocity [m/s], each (n,)."""


def wheels(n: int) -> list[Wheel]:
    """Noisy wheels that leave the road's speed and come back, with samples missing."""
    rng = np.random.default_rng(n)
    found = []
    for i in range(WHEELS):
        bump = 4.0 * np.sin(2.0 * np.pi * np.arange(n) * DT / (7.0 + i)) ** 21
        a = np.gradient(bump, DT) + rng.normal(0.0, 1.5, n)
        a[rng.integers(0, n, n // 500)] = np.nan
        found.append((a, bump + rng.normal(0.0, 0.05, n), 28.0 + rng.normal(0.0, 0.02, n)))
    return found


def with_aqualog(data: list[Wheel]) -> list[np.ndarray]:
    """Statistic and bits of spin-down and spin-up of each wheel."""
    from aqualog.detect import spin

    out = []
    for a, dv, v in data:
        allowed = np.ones(a.size, dtype=bool)
        for sign in (-1.0, 1.0):
            g, bits, _ = spin.scan(spin.SpinParams.make(sign, DT), spin.initial_state(), a, dv, v, allowed)
            out += [g, bits]
    return out


def with_python(data: list[Wheel]) -> list[np.ndarray]:
    """The same in plain Python on lists, both signs in one pass."""
    out = []
    for wheel in data:
        a, dv, v = (x.tolist() for x in wheel)
        out += [*_one_sided(a, dv, v, -1.0), *_one_sided(a, dv, v, 1.0)]
    return out


def _one_sided(a: list[float], dv: list[float], v: list[float], sign: float) -> tuple[np.ndarray, np.ndarray]:
    g = deep = calm = 0.0
    active = False
    statistic, bits = [], []
    for a_i, dv_i, v_i in zip(a, dv, v, strict=True):
        if a_i != a_i or dv_i != dv_i or v_i != v_i:
            statistic.append(a_i * float("nan"))
            bits.append(False)
            continue
        x, d = sign * a_i, sign * dv_i
        if v_i < 5.0:
            g = deep = calm = 0.0
            active = False
            statistic.append(0.0)
            bits.append(False)
            continue
        limit = 0.03 * v_i
        if limit < 0.5:
            limit = 0.5
        g += (x - 3.0) * DT
        if g < 0.0 or d < -0.25 * limit:
            g = 0.0
        elif g > 3.0:
            g = 3.0
        deep = deep + DT if d > 0.25 * v_i else 0.0
        calm = calm + DT if d < 3.0 * limit and -1.0 < x < 1.0 else 0.0
        statistic.append(g)
        if active:
            if d < 0.5 * limit or calm > 1.0:
                active, g = False, 0.0
        elif d > limit and (g > 0.6 or deep > 0.1):
            active = True
        bits.append(active)
    return np.array(statistic), np.array(bits)


def variance_with_aqualog(data: list[np.ndarray]) -> list[np.ndarray]:
    """Moving variance of each signal (the mean comes with it)."""
    from aqualog.detect import ewvar

    p = ewvar.EwvarParams(DECAY, DECAY)
    return [ewvar.scan(p, ewvar.initial_state(), x)[1] for x in data]


def variance_with_pandas(data: list[np.ndarray]) -> list[np.ndarray]:
    """The same recursion by pandas."""
    import pandas as pd

    return [pd.Series(x).ewm(alpha=DECAY, adjust=False).var(bias=True).to_numpy() for x in data]


def unlike(a: list[np.ndarray], b: list[np.ndarray]) -> str:
    """Empty if all agree to 1e-9 of their size, bits to the last."""
    for x, y in zip(a, b, strict=True):
        if x.dtype == bool and not np.array_equal(x, y):
            return f"{np.count_nonzero(x != y)} bits differ"
        if not np.allclose(x, y, rtol=1e-9, atol=1e-12, equal_nan=True):
            return f"values differ by {np.nanmax(np.abs(x - y)):.1e}"
    return ""


def rows(scale: Scale) -> list[Row]:
    """Four wheels, both signs; four signals."""
    n, m = (round(0.36 * x) for x in (scale.steps, 5 * scale.slow_steps))
    big, small = wheels(n), wheels(m)
    noise = [np.random.default_rng(i).standard_normal(n) + 3.0 for i in range(WHEELS)]

    def alike(_: list[np.ndarray], b: list[np.ndarray]) -> str:
        # another length is another draw: both are compared on the short one
        ours = with_aqualog(small)
        return unlike(ours, b) if any(x.any() for x in ours if x.dtype == bool) else "nothing was detected"

    return [
        Row(
            "two-sided CUSUM with gate and reset, per sample", "plain Python", 50.0, lambda: with_aqualog(big),
            lambda: with_python(small), alike, work=n, peer_work=m, rounds=5,
            conditions=f"4 wheels, {n} and {m} samples, one thread",
        ),
        Row(
            "exponentially weighted variance", "pandas ewm().var()", 3.0, lambda: variance_with_aqualog(noise),
            lambda: variance_with_pandas(noise), unlike, needs=("pandas",),
            conditions=f"4 signals, {n} samples, one thread; ours has the mean too",
        ),
    ]  # fmt: skip
