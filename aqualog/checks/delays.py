"""Delays: which of the signals of the car's longitudinal motion comes late."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from aqualog.checks.doubts import Doubt
from aqualog.checks.relations import changes
from aqualog.checks.windows import Gather, Windows
from aqualog.core.records import FloatArray, Signals
from aqualog.core.vehicle import Vehicle

__all__ = ["LATE_S", "delay_doubts", "delays_in"]

LATE_S = 0.2  # [s] GNSS and filters take less (three measured cars: 0.15 and less)
MOST_S = 3.0  # [s]
CLOSE = 0.8  # correlation at the best lag: below, hills, slip and noise decide it
PARTS, APART_S = 3, 0.2  # of the drive, whose lags must all agree to that [s]
LEAST_S = 40.0  # [s] each part longer than the lags on both sides
LONGITUDINAL = 0.08  # [m/s^2] changes of less are no driving
_SAID = {"v_x": "v_x comes", "omega": "the wheel speeds come", "a_x": "a_x comes", "torque": "the torque comes"}
_ADVICE = "a filter or another clock: in the signal map, [sources] has offset_s for a file; `aqualog align` finds it"


def delays_in(signals: Signals, vehicle: Vehicle, *, least: float = LATE_S) -> list[Doubt]:
    """Return what comes late in a drive, as `delay_doubts`, by `least` or more. [s]"""
    own = [s for s in signals.symbols if s.startswith(("v_x", "a_x", "omega_", "torque_"))]
    gather = Gather(own, vehicle, signals.dt)
    gather.push({s: signals.array(s) for s in own})
    return [*delay_doubts(gather.windows(), least)]


def delay_doubts(windows: Windows, least: float = LATE_S) -> Iterator[Doubt]:
    """Yield the signal that is later than all others, or before them; of two alone, which of them it is stays open."""
    step = windows.step_s
    if any(x.size < LEAST_S / step for x in windows.columns.values()):
        return
    torques = [windows[n] for n in ("torque_f", "torque_r") if n in windows]
    seen = {"a_x": windows["a_x"]} if "a_x" in windows else {}
    seen |= {"v_x": np.gradient(windows["v_x"], step)} if "v_x" in windows else {}
    seen |= {"omega": np.gradient(windows.speed, step)} if windows.wheels else {}
    seen |= {"torque": np.sum(torques, axis=0) / (windows.vehicle.mass * windows.vehicle.arm("fl"))} if torques else {}
    moves = {n: changes(x, step) for n, x in seen.items()}
    lags = {(o, n): _lag(moves[o], moves[n], step) for o, n in combinations(moves, 2)}
    lags |= {(n, o): -x for (o, n), x in lags.items()}
    related = {n: {o: x for (o, late), x in lags.items() if late == n and math.isfinite(x)} for n in moves}
    most = max(map(len, related.values()), default=0)
    for name, own in related.items():
        values = [*own.values()]
        if len(own) >= min(most, 2) > 0 and all(math.copysign(1.0, values[0]) * x >= least for x in values):
            yield _doubt(windows, name, [*own], sum(values) / len(values))
            if most == 1:
                return


def _lag(x: FloatArray, y: FloatArray, step: float) -> float:
    """How much later y is [s]; NaN where a part of the drive does not show it, or they differ."""
    most = round(MOST_S / step)
    each = []
    for part in np.array_split(np.arange(x.size), PARTS):
        r = np.array([_correlation(x[part], y[part], k) for k in range(-most, most + 1)])
        k = int(np.argmax(r))  # a NaN if there is one
        if not (r[k] >= CLOSE and 0 < k < r.size - 1):
            return math.nan
        bend = r[k - 1] - 2.0 * r[k] + r[k + 1]
        each.append((k - most + 0.5 * float(r[k - 1] - r[k + 1]) / float(bend)) * step)
    return sum(each) / PARTS if max(each) - min(each) <= APART_S else math.nan


def _correlation(x: FloatArray, y: FloatArray, k: int) -> float:
    """Correlation of x with a y that is later by k windows; NaN without enough driving."""
    x, y = (x[: x.size - k], y[k:]) if k >= 0 else (x[-k:], y[:k])
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    if x.size < 2 * PARTS or min(np.mean(x**2), np.mean(y**2)) < LONGITUDINAL**2:
        return math.nan
    return float(x @ y / np.sqrt((x @ x) * (y @ y)))


def _doubt(windows: Windows, name: str, others: Sequence[str], lag: float) -> Doubt:
    than = ", ".join(_SAID[o].rpartition(" ")[0] for o in others)
    than = " and ".join(than.rsplit(", ", 1))
    own = [n for s in ([name] if len(others) > 1 else [name, *others]) for n in _symbols(windows, s)]
    what = f"{_SAID[name]} {abs(lag):.1f} s {'after' if lag > 0.0 else 'before'} {than}"
    return Doubt("delay", tuple(own), what, _ADVICE, value=lag)


def _symbols(windows: Windows, name: str) -> list[str]:
    if name == "torque":
        return [n for n in ("torque_f", "torque_r") if n in windows]
    return [f"omega_{w}" for w in windows.wheels] if name == "omega" else [name]
