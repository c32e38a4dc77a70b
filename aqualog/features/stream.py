"""Compute all features of a drive, sample by sample or in one go.

A `FeatureStream` takes pieces of a drive of any length. The joined features of the pieces equal those of the whole bit
for bit: every step is either one sample by itself or a recursion whose state is kept.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.features.smoothing import UNSET, derivative, fading_lowpass, lowpass
from aqualog.features.steering_model import STEERING_INPUTS, SteeringModel
from aqualog.features.velocity import initial_state, observe, params_from_seconds
from aqualog.physics.kinematics import centre_line_speed, kinematic_steer_angle
from aqualog.physics.load import wheel_loads
from aqualog.physics.resistance import nominal_acceleration
from aqualog.physics.traction import residual_traction, traction_coefficient

__all__ = ["INPUTS", "FeatureStream", "Features", "loads_of_car"]

# Signals that features read. Truth and labels are not among them, so that no detector can see them.
INPUTS = (
    "v_x", "a_x", "a_y", "yaw_rate", "steer_angle", "brake_pressure",
    *(f"omega_{w}" for w in WHEELS), *(f"torque_{w}" for w in WHEELS), *STEERING_INPUTS,
)  # fmt: skip

TAU_YAW = 0.05  # [s] the yaw rate is differentiated with the wheel speeds
TAU_WHEEL = 0.03  # [s] wheel acceleration
FADE = 0.5  # [s] a yaw rate that is missing fades out of the correction
TAU_COMMON = 0.3  # [s] what all wheels share is an error of the velocity (a late reference), and slow
SPIN_DOWN = 8.0  # [m/s²] at the rim, behind the other wheels: beyond what a road shakes (K)
TAU_LOAD = 0.10  # [s] load transfer follows the body, not the accelerometer's noise

Features = Mapping[str, FloatArray]


def loads_of_car(car: Vehicle, a_x: FloatArray, a_y: FloatArray) -> FloatArray:
    """Wheel loads (4, n) [N] of a car at a specific force forward and left [m/s²], see `wheel_loads`."""
    return wheel_loads(a_x, a_y, mass=car.mass, l_f=car.l_f, l_r=car.l_r, h_cg=car.h_cg, track=car.track)


class FeatureStream:
    """Compute the features of one drive.

    Parameters
    ----------
    dt : float
        Sample time. [s]
    available : collection of str
        Symbols that the drive has at all; fixed for the drive.
    correct_yaw : bool
        Move the wheel speeds to the centre line; switched off only to show the effect.
    """

    def __init__(self, vehicle: Vehicle, dt: float, available: Collection[str], *, correct_yaw: bool = True) -> None:
        self.vehicle = vehicle
        self.dt = dt
        self.available = frozenset(available) & frozenset(INPUTS)
        self._correct_yaw = correct_yaw
        self._has_wheels = any(f"omega_{w}" in self.available for w in WHEELS)
        self._has_torque = all(f"torque_{w}" in self.available for w in vehicle.driving)
        self._velocity_params = params_from_seconds(dt, has_accelerometer="a_x" in self.available)
        self._velocity = initial_state()
        self._memory: dict[str, float] = {}
        # of an axle that may or may not be driven nothing is assumed
        trust = 1.0 if vehicle.drivetrain == "awd" or not vehicle.knows_drivetrain else 0.25
        self._weights = np.array([trust if w in vehicle.driven else 1.0 for w in WHEELS])
        self._r_e = np.array([vehicle.r_e(w) for w in WHEELS])
        self._arm = np.array([vehicle.arm(w) for w in WHEELS])
        self._inertia = np.array([vehicle.turning_inertia(w) for w in WHEELS])
        self._steering = SteeringModel(vehicle, dt, self.available)

    def push(self, columns: Mapping[str, FloatArray]) -> Features:
        """Return features of the next piece.

        Parameters
        ----------
        columns : mapping symbol -> array (n,)
            SI; at least the symbols named as available.

        Returns
        -------
        mapping name -> array (n,)
            Those of `names.FEATURES` that no detector makes; a feature is missing if its signals are.
        """
        n = next(iter(columns.values())).size
        get = {s: columns[s] if s in self.available else np.full(n, np.nan) for s in INPUTS}
        out: dict[str, FloatArray] = {}
        yaw_rate, self._memory["yaw_rate"] = fading_lowpass(
            get["yaw_rate"], self._memory.get("yaw_rate", 0.0), tau=TAU_YAW, fade=FADE, dt=self.dt
        )
        omega = np.array([get[f"omega_{w}"] for w in WHEELS])
        v_line = self._centre_line(omega * self._r_e[:, None], yaw_rate, get["steer_angle"])
        v_x, a_kin, v_w, self._velocity = observe(
            self._velocity_params, self._velocity, get["v_x"], v_line, get["a_x"], get["a_y"], yaw_rate,
            weights=self._weights,
        )  # fmt: skip
        out["v_x_hat"], out["a_kin"], out["yaw_rate_slow"] = v_x, a_kin, yaw_rate
        for i, wheel in enumerate(WHEELS):
            if f"omega_{wheel}" in self.available:
                out[f"v_line_{wheel}"] = v_line[i]
        if self._has_wheels:
            self._differences(v_w, v_x, a_kin, out)
        a_x = get["a_x"] if "a_x" in self.available else a_kin
        a_y = np.where(np.isnan(get["a_y"]), v_x * yaw_rate, get["a_y"])  # as of a car that does not slide
        out["a_x_slow"] = self._lowpass("a_x", a_x, TAU_LOAD)
        out["a_y_slow"] = self._lowpass("a_y", np.nan_to_num(a_y), TAU_LOAD)
        out["a_kin_slow"] = self._lowpass("a_kin_slow", a_kin, TAU_LOAD)
        loads = loads_of_car(self.vehicle, out["a_x_slow"], out["a_y_slow"])
        if self._has_torque:
            self._forces(get, omega, loads, out)
        out |= self._steering.push(
            get, out["a_y_slow"], yaw_rate, (loads[0], loads[1]), (self._drive(get, 0), self._drive(get, 1))
        )
        if "brake_pressure" in self.available:
            out["brake_pressure"] = get["brake_pressure"]
        return out

    def _lowpass(self, name: str, x: FloatArray, tau: float) -> FloatArray:
        y, self._memory[name] = lowpass(x, self._memory.get(name, UNSET), tau=tau, dt=self.dt)
        return y

    def _derivative(self, name: str, x: FloatArray) -> FloatArray:
        y, self._memory[name] = derivative(x, self._memory.get(name, UNSET), tau=TAU_WHEEL, dt=self.dt)
        return y

    def _centre_line(self, v_rim: FloatArray, yaw_rate: FloatArray, steer: FloatArray) -> FloatArray:
        if not self._correct_yaw or "yaw_rate" not in self.available:
            return v_rim
        vehicle = self.vehicle
        lacks = np.isnan(steer)
        if lacks.any():
            # the rear axle rolls straight ahead, so its mean is the speed; a spinning pair errs by its slip only
            rolling = kinematic_steer_angle(yaw_rate, 0.5 * (v_rim[2] + v_rim[3]), wheelbase=vehicle.wheelbase)
            steer = np.where(lacks, np.where(np.isnan(rolling), 0.0, rolling), steer)
        y = 0.5 * vehicle.track * np.array([[1.0], [-1.0]])  # of the left and the right wheel
        axles = ((v_rim[:2], steer), (v_rim[2:], np.zeros(1)))
        return np.concatenate(
            [centre_line_speed(v, yaw_rate, delta, y=y, wheelbase=vehicle.wheelbase) for v, delta in axles]
        )

    def _differences(self, v_w: FloatArray, v_x: FloatArray, a_kin: FloatArray, out: dict[str, FloatArray]) -> None:
        # the wheel's derivative is of a low-passed speed, so the vehicle's acceleration gets the same lag
        a_ref = self._lowpass("a_kin", a_kin, TAU_WHEEL)
        middle = _middle(v_w - v_x)
        out["v_w_delta_common"], self._memory["common"] = fading_lowpass(
            middle, self._memory.get("common", 0.0), tau=TAU_COMMON, fade=FADE, dt=self.dt
        )
        for i, wheel in enumerate(WHEELS):
            if f"omega_{wheel}" not in self.available:
                continue
            out[f"v_w_{wheel}"] = v_w[i]
            out[f"v_w_delta_{wheel}"] = v_w[i] - v_x
            out[f"a_w_delta_{wheel}"] = self._derivative(f"v_w_{wheel}", v_w[i]) - a_ref

    def _drive(self, get: Mapping[str, FloatArray], i: int) -> FloatArray:
        """Return the force that the torque of a wheel makes; zero if the log has no torque of it. [N]"""
        name = f"torque_{WHEELS[i]}"
        torque = get[name] if name in self.available else np.zeros_like(get[name])
        return torque / float(self._arm[i])

    def _forces(
        self, get: Mapping[str, FloatArray], omega: FloatArray, loads: FloatArray, out: dict[str, FloatArray]
    ) -> None:
        vehicle = self.vehicle
        # a wheel without a torque signal of its own is a non-driven one that rolls freely
        torque = np.array(
            [get[f"torque_{w}"] if f"torque_{w}" in self.available else np.zeros_like(out["v_x_hat"]) for w in WHEELS]
        )
        # without wheel speeds the wheels are taken to follow the vehicle
        omega_dot = np.array(
            [
                self._derivative(f"omega_{w}", omega[i])
                if f"omega_{w}" in self.available
                else out["a_kin_slow"] / self._r_e[i]
                for i, w in enumerate(WHEELS)
            ]
        )
        for i, wheel in enumerate(WHEELS):
            if f"torque_{wheel}" in self.available:
                out[f"mu_{wheel}"] = traction_coefficient(
                    torque[i], loads[i], omega_dot[i], arm=float(self._arm[i]), inertia=float(self._inertia[i]),
                    r_w=vehicle.rolling_resistance,
                )  # fmt: skip
        # a wheel that slows down faster than the car gives its momentum to the water, not to the car: only a wheel that
        # spins up has taken torque from the road, else every spin-down would look like resistance; a wheel that shakes
        # does both in turn, and has both; one whose signal is missing is taken to turn as the others
        middle = _middle(omega_dot)
        with np.errstate(invalid="ignore"):
            turns = omega_dot - middle >= -SPIN_DOWN / self._r_e[:, None]
        spinning_up = np.where(turns, omega_dot, middle)
        out["torque_sum"] = torque[0] + torque[1] + torque[2] + torque[3]
        if "a_x" in self.available:
            a_nom = nominal_acceleration(
                torque, loads, out["v_x_hat"], spinning_up, arm=self._arm, inertia=self._inertia, mass=vehicle.mass,
                r_w=vehicle.rolling_resistance, drag_area=vehicle.drag_area, air_density=vehicle.air_density,
            )  # fmt: skip
            out["delta_a_x"] = a_nom - get["a_x"]
            slow = self._lowpass("delta_a_x", out["delta_a_x"], TAU_LOAD)
            for i, wheel in enumerate(WHEELS):
                if f"mu_{wheel}" in out:
                    out[f"mu_res_{wheel}"] = residual_traction(out[f"mu_{wheel}"], slow, loads[i], mass=vehicle.mass)


def _middle(x: FloatArray) -> FloatArray:
    """Return the mean of the two middle ones of four values, (4, n) to (n,); NaN counts as the largest."""
    if np.isnan(x).any():
        lower, upper = np.sort(x, axis=0)[1:3]
    else:  # a network of comparisons takes a tenth of the sort
        lower = np.maximum(np.minimum(x[0], x[1]), np.minimum(x[2], x[3]))
        upper = np.minimum(np.maximum(x[0], x[1]), np.maximum(x[2], x[3]))
    middle: FloatArray = (lower + upper) / 2.0
    return middle
