"""What every detector sees of a piece of a drive."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.detect.negative_force import HOLD, hold_on, is_braking
from aqualog.features.stream import Features
from aqualog.physics.load import G

__all__ = ["BrakeWatch", "Scene", "any_wheel", "traction"]


@dataclass(frozen=True, slots=True)
class Scene:
    """Features of one piece, arrays (n,), and on which wheels a braking force acts."""

    f: Features
    braking: Mapping[str, BoolArray]

    @property
    def size(self) -> int:
        """Number of samples."""
        return self.f["v_x_hat"].size

    @property
    def wheels(self) -> list[str]:
        """Return wheels whose speeds are known."""
        return [w for w in WHEELS if f"v_w_{w}" in self.f]

    @property
    def is_braking(self) -> BoolArray:
        """Return whether a braking force acts on any wheel. (n,)"""
        return any_wheel(self.braking)

    @property
    def unbraked_resistance(self) -> FloatArray:
        """Return the resistance measure less its dry offset; braking is no evidence of water. (n,) [m/s²]"""
        return np.where(self.is_braking, np.nan, self.f["delta_a_x"] - self.f.get("delta_a_x_offset", 0.0))


class BrakeWatch:
    """Find the wheels with a braking force, with its after-effects."""

    def __init__(self, vehicle: Vehicle, dt: float) -> None:
        self._vehicle = vehicle
        self._dt = dt
        self._left = dict.fromkeys(WHEELS, 0)

    def push(self, f: Features, columns: Mapping[str, FloatArray]) -> dict[str, BoolArray]:
        """Return bits (n,) by wheel; `columns` holds the torques that the drive has."""
        weight = 0.25 * self._vehicle.mass * G
        result = {}
        for wheel in WHEELS:
            torque = columns.get(f"torque_{wheel}")
            share = None if torque is None else torque / (self._vehicle.r_l(wheel) * weight)
            bits = is_braking(f["a_kin_slow"], f.get("brake_pressure"), share)
            result[wheel], self._left[wheel] = hold_on(bits, self._left[wheel], seconds=HOLD, dt=self._dt)
        return result


def any_wheel(bits: Mapping[str, BoolArray]) -> BoolArray:
    """Return whether a bit is set at any wheel. (n,)"""
    return bits["fl"] | bits["fr"] | bits["rl"] | bits["rr"]


def traction(f: Features, wheel: str) -> FloatArray | None:
    """Return the traction coefficient of a wheel, less the water's resistance where known; None without torque."""
    return f.get(f"mu_res_{wheel}", f.get(f"mu_{wheel}"))
