"""Drive the simulation by a measured torque: torque in, speed out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.core.records import FloatArray
from aqualog.model import kernel
from aqualog.model.plant import Plant
from aqualog.model.road import DRY
from aqualog.model.state import column, resistance_at, rolling_state, wheel_columns

__all__ = ["Replay", "replay"]


@dataclass(frozen=True, slots=True)
class Replay:
    """Result of a torque: `t` [s], `v_x` [m/s], specific force `a_x` [m/s²], `omega` (4, n) [rad/s]."""

    t: FloatArray
    v_x: FloatArray
    a_x: FloatArray
    omega: FloatArray


def replay(
    plant: Plant,
    t: FloatArray,
    torque: FloatArray,
    *,
    split_rear: float,
    v_0: float,
    grade: FloatArray | None = None,
    dt: float = 2e-3,
) -> Replay:
    """Drive a dry straight road with a given torque, free from the first speed on.

    Parameters
    ----------
    plant : Plant
        The car; its `torque_gain` scales the torque.
    t : array (n,)
        Even time base of the inputs, from any start. [s]
    torque : array (n,)
        Sum of the net wheel torques, drive minus brake. [N·m] Finite.
    split_rear : float
        Rear share of the torque. [-]
    v_0 : float
        Speed at the first sample, > 0. [m/s]
    grade : array (n,), optional
        Slope angle at each sample, uphill positive. [rad]
    dt : float
        Step of the integration. [s]

    Returns
    -------
    replay : Replay
        On the samples of `t`. Where the car has come to a standstill, resistance fades out below 1 rad/s and it stays
        about there.

    Raises
    ------
    ConfigError
        If the inputs are not finite or not even in time.
    """
    step = float(t[1] - t[0])
    every = round(step / dt)
    if every < 1 or abs(every * dt - step) > 1e-6 or not np.allclose(np.diff(t), step, rtol=0.0, atol=1e-6):
        raise ConfigError(f"a replay needs an even time base in steps of {dt:g} s")
    if not (np.isfinite(torque).all() and np.isfinite(v_0)):
        raise ConfigError("a replay needs finite torque and speed")
    n = every * (t.size - 1)
    fine = np.arange(n + 1) * dt
    still = np.zeros(n + 1)
    controls = kernel.Controls(
        v_target=still,
        a_target=still,
        drive=np.interp(fine, t - t[0], torque),
        brake=still,
        split_rear=np.full(n + 1, split_rear),
        steer=still,
        exc=still,
        wind=still,
        gain=np.ones(n + 1),
        grade=still if grade is None else np.interp(fine, t - t[0], grade),
        has_driver=False,
        keeps_lane=False,
        exc_kind=0,
        exc_amplitude=0.0,
        scatter=0.0,
    )
    drive = float(torque[0]) * plant.torque_gain
    drag, rolling = resistance_at(plant, v_0, 0.0)
    a_0 = (drive / float(plant.r_l.mean()) - rolling.sum() - drag) / plant.mass
    start = rolling_state(plant, v=v_0, a=a_0, drive=drive, split_rear=split_rear)
    rows = kernel.run(n, dt, every, start, plant, DRY, controls)
    return Replay(t, column(rows, "v_x"), column(rows, "a_x"), np.array(wheel_columns(rows, "omega")))
