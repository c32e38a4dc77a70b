"""Gather what the checks compare: means over half a second, piece by piece, of a drive of any length."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from aqualog.core.notation import AXLES, WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.vehicle import Vehicle

__all__ = ["EXTRA", "PRESSURES", "Gather", "Windows"]

WINDOW = 0.5  # [s] over which changes are compared: longer than latencies, shorter than manoeuvres
UNLIKE = 0.2  # [-] share by which wheels differ neither in curves nor by their radii (K)
EXTRA = "delta_a_x"  # what `detect` adds: the measure of the resistance, where it is judged
PRESSURES = tuple(f"pressure_{w}" for w in WHEELS)
_AS_THEY_ARE = (
    "v_x", "a_x", "a_y", "yaw_rate", "steer_angle", "brake_pressure", "latitude", "longitude", *PRESSURES,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Windows:
    """Means over `step_s` [s] of the signals of a drive.

    `columns`: by name, arrays (n,), NaN where less than half of a window is known: the signals of `_AS_THEY_ARE`,
    `v_fl` ... `v_rr` [m/s], `torque_f` and `torque_r` [N·m], `EXTRA` [m/s²].
    """

    columns: Mapping[str, FloatArray]
    step_s: float
    vehicle: Vehicle

    def __getitem__(self, name: str) -> FloatArray:
        return self.columns[name]

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def without(self, names: Collection[str]) -> Windows:
        """Return the windows without some columns."""
        return replace(self, columns={n: x for n, x in self.columns.items() if n not in names})

    @property
    def wheels(self) -> dict[str, FloatArray]:
        """Speeds of the known wheels. [m/s]"""
        return {w: self.columns[f"v_{w}"] for w in WHEELS if f"v_{w}" in self.columns}

    @property
    def speed(self) -> FloatArray:
        """Median of the wheels, without wheels `v_x`; empty without either. [m/s]"""
        wheels = list(self.wheels.values())
        if not wheels:
            return self.columns.get("v_x", np.zeros(0))
        return middle(wheels)

    @property
    def slips(self) -> BoolArray:
        """Where the wheels differ by more than `UNLIKE` of the fastest: their median need not be the car's speed."""
        if not self.wheels:
            return np.zeros(self.speed.size, dtype=bool)
        wheels = np.abs(np.stack(list(self.wheels.values())))
        with np.errstate(invalid="ignore"):
            return np.asarray(np.ptp(wheels, axis=0) > UNLIKE * wheels.max(axis=0))


def middle(rows: list[FloatArray]) -> FloatArray:
    """Return the median of arrays (n,), of those that have a value at each place."""
    ordered = np.sort(np.stack(rows), axis=0)  # NaN come last
    known = np.isfinite(ordered).sum(axis=0)
    at = np.arange(ordered.shape[1])
    low, high = ordered[np.maximum(known - 1, 0) // 2, at], ordered[np.minimum(known // 2, len(rows) - 1), at]
    return np.asarray(np.where(known > 0, 0.5 * (low + high), np.nan))


class Gather:
    """Take a drive piece by piece and keep its windows, however it is cut. `available`: its symbols; `dt` [s]."""

    def __init__(self, available: Collection[str], vehicle: Vehicle, dt: float) -> None:
        self._vehicle = vehicle
        self._length = max(1, round(WINDOW / dt))
        self._dt = dt
        self._own = [s for s in (*_AS_THEY_ARE, EXTRA) if s in available]
        self._wheels = [w for w in WHEELS if f"omega_{w}" in available]
        torques = {a: [f"torque_{w}" for w in ws if f"torque_{w}" in available] for a, ws in AXLES.items()}
        self._torques = {a: names for a, names in torques.items() if names}
        self._names = [*self._own, *(f"v_{w}" for w in self._wheels), *(f"torque_{a}" for a in self._torques)]
        self._rest: FloatArray = np.zeros((len(self._names), 0))
        self._kept: list[FloatArray] = []

    def push(self, columns: Mapping[str, FloatArray]) -> None:
        """Take the next samples, arrays (n,), SI."""
        if not self._names:
            return
        rows = [
            *(columns[s] for s in self._own),
            *(columns[f"omega_{w}"] * self._vehicle.r_e(w) for w in self._wheels),
            *(np.sum([columns[n] for n in names], axis=0) for names in self._torques.values()),
        ]
        x = np.concatenate([self._rest, np.stack(rows)], axis=1)
        whole = x.shape[1] // self._length * self._length
        self._rest = x[:, whole:].copy()
        self._kept.append(_means(x[:, :whole].reshape(len(rows), -1, self._length)))

    def windows(self) -> Windows:
        """Return the windows so far; a last one that is not full is left out."""
        x = np.concatenate([np.zeros((len(self._names), 0)), *self._kept], axis=1)
        return Windows(dict(zip(self._names, x, strict=True)), self._length * self._dt, self._vehicle)


def _means(x: FloatArray) -> FloatArray:
    """Return the means over the last axis of (s, m, k), NaN where more than half is missing."""
    known: BoolArray = np.isfinite(x)
    count = known.sum(axis=2)
    total = np.where(known, x, 0.0).sum(axis=2)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(2 * count >= x.shape[2], total / count, np.nan))
