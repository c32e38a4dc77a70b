"""What the filter reads of a drive, and where none of it counts."""

from __future__ import annotations

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.detect.braking import hold_on, lasting
from aqualog.detect.detector import Scene, missing_balance
from aqualog.detect.margin.state import Inputs
from aqualog.features.smoothing import UNSET, lowpass
from aqualog.features.stream import loads_of_car
from aqualog.physics.traction import traction_of_one_axle

__all__ = ["Reader", "has_balance"]

PAIRS = ((0, 2), (1, 3), (2, 3))  # of `WHEELS`: front and rear of each side, both sides of the rear axle
V_MIN = 5.0  # [m/s] slower, wheel speeds are too coarse
A_Y_MAX = 2.5  # [m/s^2] beyond, cornering costs more than the balance knows
TAU_A = 0.5  # [s] of the acceleration that these limits are for, about the window's length
A_MOST, A_LEAST = 1.5, -1.5  # [m/s^2] beyond, no slip counts; braking
HURRY = 0.5  # [m/s^2] beyond, an unknown trailer, or a torque that is off by a tenth, takes more than water
U_MOST, FORCED = 0.6, 0.35  # [-] of the traction: beyond, no slip counts; the slip of a dry tyre is known roughly
LOAD_LEAST = 100.0  # [N] of a wheel that lifts off in a curve
JUMP = 0.02  # [-] of the traction within a tenth of a second: a gear shift, which torque signals report late
HOLD = 0.3  # [s] after it
TAU_JUMP = 0.1  # [s]
SHIFT = 1.0  # [s] a gear shift is over by then: jumps that go on are a traction control at work, as on water
STANDS = 0.25  # [s] a wheel speed that does not change by a bit for longer has stopped coming
OVERRUN = -0.03  # [-] of all wheels' traction: without torque and brake pressure a car that is slowed by more may brake
STOPPING = 0.5  # [-] of the car's speed: a wheel that reads 0 after less has stopped
HELD = 0.5  # [s] the same of a torque, while that of the axle's other wheel comes


def has_balance(vehicle: Vehicle, scene: Scene) -> bool:
    """Whether torques say what water costs."""
    return not missing_balance(vehicle, scene.columns)


class Reader:
    """Turns scenes into the inputs of the filter, piece by piece; `dt` is the sample time. [s]"""

    def __init__(self, vehicle: Vehicle, dt: float) -> None:
        self._vehicle = vehicle
        self._dt = dt
        self._slow = {"f": UNSET, "r": UNSET}
        self._a = UNSET
        self._left = self._jumping = 0
        self._before = dict.fromkeys(WHEELS, UNSET)  # speed of each wheel over the car's when it last turned
        self._unchanged = dict.fromkeys((f"{stem}_{w}" for stem in ("omega", "torque") for w in WHEELS), (UNSET, 0))

    def push(self, scene: Scene) -> Inputs:
        """Return the inputs of the next piece, (n,)."""
        f = scene.f
        v = f["v_x_hat"]
        # slow, or it would let through what the noise of the accelerometer makes low: that looked like water
        a, self._a = lowpass(f["a_kin_slow"], self._a, tau=TAU_A, dt=self._dt)
        none = np.full(scene.size, np.nan)
        balanced = has_balance(self._vehicle, scene)
        u = self._traction(scene) if balanced else self._traction_of_car(scene)
        jump = self._jumps(u[0] + u[1], u[2] + u[3])
        held = [self._stands(scene, f"torque_{w}", HELD) for w in WHEELS]
        # without torque a jump is as well one of the drag, where water begins
        jump = (jump | (held[0] ^ held[1]) | (held[2] ^ held[3])) & balanced
        with np.errstate(invalid="ignore"):
            rolls = (v > V_MIN) & ~scene.is_braking
            trusted = rolls & (a < A_MOST) & (a > A_LEAST) & ~(np.abs(f["a_y_slow"]) > A_Y_MAX)
            if not balanced and "brake_pressure" not in f:
                # a light braking makes no wheel lose half of its speed, water does
                lost = [f[n] < STOPPING * v for n in ("v_line_fl", "v_line_fr") if n in f]
                trusted &= (sum(u) > OVERRUN) | np.logical_or.reduce(lost)
            known = ~jump & ~(a > HURRY)
            rough = jump | (np.max(np.abs(u), axis=0) > FORCED)
        R = np.where(trusted & known, f["delta_a_x"], np.nan) if balanced else none
        turning, pairs = [self._turning(scene, w) for w in WHEELS], []
        for one, other in PAIRS:
            front, rear = turning[one], turning[other]
            with np.errstate(invalid="ignore", divide="ignore"):
                slip = none if front is None or rear is None else (front - rear) / v
                small = np.maximum(np.abs(u[one]), np.abs(u[other])) < U_MOST
            pairs.append(np.where(trusted & small, slip, np.nan))
        # of the torques, not the accelerometer: that is in the resistance too, and its noise would make a slope of them
        a_x = scene.columns.get("a_x", none)
        torques = f["delta_a_x"] + a_x if balanced else none
        return Inputs._make((v, torques, R, *pairs, *u, a_x, rough.astype(float)))

    def _turning(self, scene: Scene, wheel: str) -> FloatArray | None:
        """Speed of a wheel on the centre line, NaN where its signal stands still. [m/s]"""
        v = scene.f.get(f"v_line_{wheel}")
        if v is None:
            return None
        return np.where(self._stands(scene, f"omega_{wheel}", STANDS) & ~self._stopped(scene, wheel), np.nan, v)

    def _stopped(self, scene: Scene, wheel: str) -> BoolArray:
        """Where a wheel reads 0 because it has stopped: it had lost half of its speed before. A dead sensor has not."""
        x, v = scene.columns[f"omega_{wheel}"] * self._vehicle.r_e(wheel), scene.f["v_x_hat"]
        with np.errstate(invalid="ignore", divide="ignore"):
            turns, ratio = np.abs(x) > 0.0, np.where(v > V_MIN, np.abs(x / v), 1.0)
        known = np.where(turns, np.arange(1, x.size + 1), 0)
        last = np.maximum.accumulate(known)
        before = np.where(last > 0, ratio[np.maximum(last - 1, 0)], self._before[wheel])
        self._before[wheel] = float(before[-1])
        stopped: BoolArray = (x == 0.0) & (before < STOPPING)
        return stopped

    def _stands(self, scene: Scene, signal: str, seconds: float) -> BoolArray:
        """Where a signal has not changed by a bit for so long; one that the drive does not have does not change."""
        x, (last, run) = scene.columns.get(signal, np.zeros(scene.size)), self._unchanged[signal]
        least = max(2, round(seconds / self._dt))
        bits, run = lasting(np.diff(x, prepend=last) == 0.0, run, least=least)
        self._unchanged[signal] = (float(x[-1]), run)
        return bits

    def _jumps(self, front: FloatArray, rear: FloatArray) -> BoolArray:
        """Where the traction of an axle has just changed faster than torque signals follow."""
        away = np.zeros(front.size, dtype=bool)
        for axle, x in (("f", front), ("r", rear)):
            slow, self._slow[axle] = lowpass(0.5 * x, self._slow[axle], tau=TAU_JUMP, dt=self._dt)
            with np.errstate(invalid="ignore"):
                away |= np.abs(0.5 * x - slow) > JUMP
        away, self._left = hold_on(away, self._left, seconds=HOLD, dt=self._dt)
        goes_on, self._jumping = lasting(away, self._jumping, least=max(1, round(SHIFT / self._dt)))
        return away & ~goes_on

    def _traction(self, scene: Scene) -> list[FloatArray]:
        """Torque over lever and load of each wheel; in a curve the outer ones carry more. [-]"""
        vehicle, f = self._vehicle, scene.f
        loads = loads_of_car(vehicle, f["a_kin_slow"], f["a_y_slow"])
        none = np.zeros(scene.size)
        spin = [vehicle.turning_inertia(w) / (vehicle.arm(w) * vehicle.r_e(w)) * f["a_kin_slow"] for w in WHEELS]
        return [
            (scene.columns.get(f"torque_{w}", none) / vehicle.arm(w) - spin[i]) / np.fmax(loads[i], LOAD_LEAST)
            for i, w in enumerate(WHEELS)
        ]

    def _traction_of_car(self, scene: Scene) -> list[FloatArray]:
        """The same without torque, by the acceleration: no drag of water is in it, and no grade without `a_x`. [-]"""
        vehicle, f = self._vehicle, scene.f
        loads = loads_of_car(vehicle, f["a_kin_slow"], f["a_y_slow"])
        rear = vehicle.torque_split_rear
        free, mass = np.zeros((2, scene.size)), 0.0  # of an axle that no engine drives
        if rear in (0.0, 1.0):
            end = "f" if rear == 1.0 else "r"
            free = loads[:2] if rear == 1.0 else loads[2:]
            mass = 2.0 * vehicle.turning_inertia(f"{end}l") / vehicle.r_e(f"{end}l") ** 2
        out = []
        for share, own in ((1.0 - rear, loads[:2]), (rear, loads[2:])):
            mu = traction_of_one_axle(
                f.get("a_x_slow", f["a_kin_slow"]), f["a_kin_slow"], f["v_x_hat"], own, free, mass=vehicle.mass,
                r_w=vehicle.rolling_resistance, drag_area=vehicle.drag_area, air_density=vehicle.air_density,
                free_wheel_mass=mass,
            )  # fmt: skip
            out += list(share * mu + vehicle.rolling_resistance * (share > 0.0))  # a torque turns its own wheel, too
        return out
