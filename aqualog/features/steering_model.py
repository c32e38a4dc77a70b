"""Model the forces of tie rods and steering on dry road, beside the measured ones."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.features.smoothing import UNSET, derivative, lowpass
from aqualog.physics.lateral import front_axle_lateral_force, outward, split_by_load, yaw_inertia
from aqualog.physics.steering import tie_rod_force

__all__ = ["FRONT", "STEERING_INPUTS", "SteeringModel"]

FRONT = ("fl", "fr")
STEERING_INPUTS = ("tie_rod_fl", "tie_rod_fr", "steering_torque")
TAU_YAW_ACCELERATION = 0.10  # [s] of the yaw rate before it is differentiated
TAU_FORCE = 0.03  # [s] measured and modelled force alike: a spin-down of 50 ms must not drown


class SteeringModel:
    """Coarse model of the forces in the tie rods (thesis 2.4) with its state.

    Parameters
    ----------
    vehicle : Vehicle
        Its `tie_rod` and `steering_torque` hold the polynomials; without one the signal has no model.
    dt : float
        [s]
    available : collection of str
        Symbols of the drive.
    """

    def __init__(self, vehicle: Vehicle, dt: float, available: Collection[str]) -> None:
        self._vehicle = vehicle
        self._dt = dt
        self._rods = tuple(w for w in FRONT if vehicle.tie_rod and f"tie_rod_{w}" in available)
        self._has_torque = bool(vehicle.steering_torque) and "steering_torque" in available
        self._inertia = yaw_inertia(mass=vehicle.mass, l_f=vehicle.l_f, l_r=vehicle.l_r)
        self._memory: dict[str, float] = {}

    def push(
        self,
        get: Mapping[str, FloatArray],
        a_y: FloatArray,
        yaw_rate: FloatArray,
        F_z: tuple[FloatArray, FloatArray],
        F_x: tuple[FloatArray, FloatArray],
    ) -> dict[str, FloatArray]:
        """Return modelled and measured forces of the next piece.

        Parameters
        ----------
        get : mapping symbol -> array (n,)
            Measured signals.
        a_y : array (n,)
            Low-passed. [m/s²]
        yaw_rate : array (n,)
            [rad/s]
        F_z, F_x : (left, right) arrays (n,)
            Loads and longitudinal forces of the front wheels. [N]

        Returns
        -------
        mapping
            `tie_rod_meas_fl`, `tie_rod_hat_fl` ... [N] and `steering_meas`, `steering_hat` [N·m], all low-passed alike.
        """
        if not self._rods and not self._has_torque:
            return {}
        v = self._vehicle
        psi_ddot, self._memory["yaw"] = derivative(
            yaw_rate, self._memory.get("yaw", UNSET), tau=TAU_YAW_ACCELERATION, dt=self._dt
        )
        axle = front_axle_lateral_force(
            a_y, np.nan_to_num(psi_ddot), mass=v.mass, l_f=v.l_f, l_r=v.l_r, inertia=self._inertia
        )
        sides = split_by_load(axle, *F_z)
        out: dict[str, FloatArray] = {}
        for wheel, force, F in zip(FRONT, outward(*sides), F_x, strict=True):
            if wheel not in self._rods:
                continue
            c = v.tie_rod
            model = tie_rod_force(F, force, c0=c.get("c0", (0.0,)), c_y=c.get("c_y", ()), c_x=c.get("c_x", ()))
            out[f"tie_rod_hat_{wheel}"] = self._smooth(f"hat_{wheel}", model)
            out[f"tie_rod_meas_{wheel}"] = self._smooth(f"meas_{wheel}", get[f"tie_rod_{wheel}"])
        if self._has_torque:
            c = v.steering_torque
            # the rods pull at one rack against each other: the axle's lateral force and the difference of the drive
            model = tie_rod_force(
                F_x[0] - F_x[1], axle, c0=c.get("c0", (0.0,)), c_y=c.get("c_y", ()), c_x=c.get("c_x", ())
            )
            out["steering_hat"] = self._smooth("hat", model)
            out["steering_meas"] = self._smooth("meas", get["steering_torque"])
        return out

    def _smooth(self, name: str, x: FloatArray) -> FloatArray:
        y, self._memory[name] = lowpass(x, self._memory.get(name, UNSET), tau=TAU_FORCE, dt=self._dt)
        return y
