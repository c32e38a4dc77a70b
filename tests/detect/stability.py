"""Stability control that brakes single wheels: each run of a drive is braked by what the run before showed.

`brake_pressure` has the control's own pressure, and torques know its brakes. It cuts the drive torque too.
"""

from dataclasses import replace
from unittest.mock import patch

import numpy as np
import polars as pl

from aqualog.core.notation import WHEELS
from aqualog.features.smoothing import UNSET, lowpass
from aqualog.model import simulate as simulation
from aqualog.model.drawing import KMH, slalom_angle
from aqualog.model.log import as_signals
from aqualog.model.plant import understeer_gradient
from aqualog.model.scenario import Steering
from aqualog.physics.load import G

DEAD, GAIN = 0.04, 12e3  # [rad/s] of the yaw rate, [N m s/rad] of torque beyond it
INNER_FRONT, INNER_REAR, OUTER_FRONT = 700.0, 900.0, 1800.0  # [N m] at most


def torques(run, drive):
    """Torques of the brakes (4, n) [N m] by the yaw rate that a run has shown against the one that is steered."""
    c, dt = run.truth.columns, run.truth.t[1] - run.truth.t[0]
    v, law = np.maximum(c["v_x"], 5.0), understeer_gradient(drive.tyre_front.cornering_slope)
    steered, _ = lowpass(c["steer_angle"] * v / (drive.vehicle.wheelbase + law * v**2), UNSET, tau=0.08, dt=dt)
    steered = np.clip(steered, -0.95 * G / v, 0.95 * G / v)
    lacks = np.where(c["v_x"] < 6.0, 0.0, (steered - c["yaw_rate"]) * np.sign(steered))
    under, over = (GAIN * np.maximum(x - DEAD, 0.0) for x in (lacks, -lacks))
    out = np.zeros((4, v.size))
    for side, inner in ((0, steered > 0.0), (1, steered <= 0.0)):
        out[side] = np.where(inner, np.minimum(0.5 * under, INNER_FRONT), np.minimum(over, OUTER_FRONT))
        out[2 + side] = np.where(inner, np.minimum(under, INNER_REAR), 0.0)
    for i, w in enumerate(WHEELS):  # no more than the tyre takes, and let off where the wheel slides or floats
        grip = 0.75 * c[f"true_mu_max_{w}"] * c[f"true_load_{w}"] * drive.vehicle.r_e_f
        holds = np.clip((c[f"true_slip_{w}"] + 0.25) / 0.15, 0.0, 1.0)
        holds *= np.clip((c[f"true_contact_{w}"] - 0.1) / 0.2, 0.0, 1.0)
        out[i] = lowpass(np.minimum(out[i], grip) * holds, UNSET, tau=0.05, dt=dt)[0]
    return run.truth.t, -out


def controlled(drive, believed, known):
    """Signals of a drive with stability control, of whose torque the log has the share `known`. [-]"""
    run = simulation.simulate(drive)
    for _ in range(3):
        t, braked = torques(run, drive)
        cut, _ = lowpass((braked < -60.0).any(axis=0).astype(float), UNSET, tau=0.15, dt=t[1] - t[0])
        share = tuple(zip(t[::20].tolist(), (1.0 - cut[::20]).tolist(), strict=True))
        fine = np.arange(round(drive.duration_s / simulation.STEP_S) + 1) * simulation.STEP_S
        applied = np.stack([np.interp(fine, t, x) for x in braked], axis=1)
        with patch.object(simulation, "_vectored", return_value=applied):
            run = simulation.simulate(replace(drive, drive_share=share))
    signals = as_signals(run, vehicle=believed)
    torque = {n: signals.array(n) for n in (f"torque_{w}" for w in WHEELS)}
    columns = {n: np.where(x < 0.0, known * x, x) for n, x in torque.items()}
    own = -simulation.PRESSURE_PER_TORQUE * np.interp(signals.array("t"), t, braked.sum(axis=0))
    columns["brake_pressure"] = np.round((signals.array("brake_pressure") + own) / 3e4) * 3e4
    return replace(signals, frame=signals.frame.with_columns(*(pl.Series(n, x) for n, x in columns.items())))


def steered_drive(kind, k, v_full, lane=None):
    """A curve of 2.6 to 4.2 m/s² or a lane change of 3 to 6 m/s² with a lane of water; on dry road 5 to 9 m/s²."""
    v = k.between(60.0, 120.0) * KMH if lane is None else max(v_full + k.between(-20.0, 15.0) * KMH, 60.0 * KMH)
    ends = (5.0, 9.0) if lane is None else (3.0, 6.0) if kind == "lane_change" else (2.6, 4.2)
    angle, t = slalom_angle(k.vehicle, k.tyre, v, k.between(*ends)) * k.one_of(-1.0, 1.0), k.between(8.0, 11.0)
    if kind == "lane_change":
        steering = Steering(angle, k.between(2.2, 3.2), t, "lane_change")
        begin, end = t + k.between(-1.0, 1.5), t + 3.0 * steering.period_s
    else:
        steering = Steering(angle, k.between(4.0, 6.0), t, "hold")
        begin = t + 0.5 * steering.period_s + k.between(0.5, 2.0)
        end = begin + 5.0
    lanes = () if lane is None else (lane(k, v * begin, v * k.between(1.2, 3.0)),)
    return k.drive(end + 5.0, ((0.0, v),), lanes=lanes, steering=steering)
