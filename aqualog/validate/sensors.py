"""Constant errors of a drive's sensors, which say nothing of the car: a late velocity, and offsets in curves."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from aqualog.campaign.delay import HALF_MAX, LATEST
from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.channels import block_means, block_step, centre_line_speeds
from aqualog.diagnose.drive import Drive
from aqualog.diagnose.hypotheses import simulated
from aqualog.diagnose.inputs import BRAKE_PRESSURE
from aqualog.diagnose.tolerances import TOLERANCES
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model, Term
from aqualog.trade.speeds import lateness

__all__ = ["late_velocity", "offsets"]

_OWN = {e.name: Term(e, {"by": e.parameters[0].step}) for e in TOLERANCES}
# of the size of their tolerances; of these three are of sensors, the others of the car, which stay in the residual
_BIAS = Term(EFFECTS["accelerometer_bias"], {"bias": 0.1}, "a_y")
_OF_CAR = (_OWN["steer_gain"], _OWN["cornering_front"], _OWN["cornering_rear"])
_ASKED = (_OWN["steer_offset"], _OWN["gyro_offset"], _BIAS, *_OF_CAR)


def late_velocity(drive: Drive, v_x: FloatArray, dry: BoolArray) -> float:
    """By how much v_x (n,) is late against wheels that roll freely [s]; 0 where they show none, NaN where that is open.

    Brakes slow these wheels: of a log without their pressure only driven stretches count. `dry` (n,): samples.
    """
    free = [i for i, w in enumerate(WHEELS) if w not in drive.vehicle.driving]
    if not {"v_x", *(f"omega_{w}" for w in WHEELS)} <= drive.present:
        return 0.0  # no slip is judged
    if not free:
        return math.nan
    pressure = drive.columns.get("brake_pressure")
    rolls = drive.course.torque.sum(axis=0) >= 0.0 if pressure is None else pressure <= BRAKE_PRESSURE
    wheels = centre_line_speeds(drive.columns, drive.vehicle)[free].mean(axis=0)
    late, half = lateness(v_x, wheels, rolls & dry, drive.dt)
    if not (half <= HALF_MAX and abs(late) <= LATEST):
        return math.nan
    return late if abs(late) > half else 0.0


def offsets(drive: Drive, model: Model, dry: BoolArray) -> tuple[Term, ...]:
    """Offsets of steering, gyro and lateral accelerometer; empty where the log does not show them.

    Least squares over a_y and yaw rate, with the tolerances of a diagnosis as knowledge before. Errors within a second
    belong together.
    """
    used = drive.mask & (block_means(dry.astype(np.float64), drive.dt) == 1.0)
    if not {"a_y", "yaw_rate", "steer_angle"} <= drive.present or not used.any():
        return ()

    def means(columns: Mapping[str, FloatArray]) -> FloatArray:
        return np.array([block_means(columns[n], drive.dt)[used] for n in ("a_y", "yaw_rate")])

    base = means(simulated(drive, model))
    off = means(drive.columns) - base
    weight = math.sqrt(block_step(drive.dt)) / np.maximum(off.std(axis=1, keepdims=True), 1e-9)
    x = np.array([(weight * (means(simulated(drive, Model((*model.terms, t)))) - base)).ravel() for t in _ASKED])
    share = np.linalg.solve(x @ x.T + np.eye(len(x)), x @ (weight * off).ravel())[:3]
    # the bounds of these effects are 20 tolerances
    found = zip(_ASKED[:3], np.clip(share, -19.9, 19.9).tolist(), strict=True)
    return tuple(replace(t, values={n: s * v for n, v in t.values.items()}) for t, s in found)
