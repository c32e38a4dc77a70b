"""Drives of the tyre tests by hand: wheel speeds whose slip is known."""

import numpy as np
import polars as pl

from aqualog.core.records import Quality, Signals
from aqualog.core.vehicle import Vehicle

FWD = Vehicle(
    name="hatch", drivetrain="fwd", torque_split_rear=0.0,
    given=frozenset({"drivetrain", "wheels.r_e_f", "wheels.r_e_r"}),
)  # fmt: skip
RWD = Vehicle(name="sedan", drivetrain="rwd", given=frozenset({"drivetrain", "wheels.r_e_f", "wheels.r_e_r"}))
KMH = 1.0 / 3.6


def signals(columns, *, rate=100.0):
    """Signals of columns (n,) on an even grid."""
    n = len(next(iter(columns.values())))
    frame = pl.DataFrame({"t": np.arange(n) / rate, **{k: np.asarray(x, float) for k, x in columns.items()}})
    return Signals(frame.fill_nan(None), round(1e9 / rate), None, {}, Quality(), ("made.mf4",))


def straight(
    *, v_15=78.0, slope=0.01, side="left", axle="f", v_0=50.0, a=1.3, rate=100.0, ratio=1.0, lane=(3.0, 14.0), end=15.0,
    begin=0.0,
):  # fmt: skip
    """A run whose wet driven wheel slips by `slope` per km/h, 15 % at `v_15` [km/h], from 0 on; ratio: its radius.

    The speed is even until `begin` [s].
    """
    t = np.arange(0.0, end, 1.0 / rate)
    v = v_0 * KMH + a * np.maximum(t - begin, 0.0)
    on = (t >= lane[0]) & (t <= lane[1])
    slip = np.where(on, np.maximum(0.15 + slope * (v / KMH - v_15), 0.0), 0.0)
    radius = 0.317
    columns = {f"omega_{w}": v / radius for w in ("fl", "fr", "rl", "rr")}
    wet = f"{axle}{side[0]}"
    columns[f"omega_{wet}"] = columns[f"omega_{wet}"] * (1.0 + slip) * ratio
    columns |= {"v_x": v, "a_x": np.full(t.size, a), "yaw_rate": np.zeros(t.size), "on_water": on.astype(float)}
    columns |= {f"torque_{w}": np.full(t.size, 400.0 if w[0] == axle else 0.0) for w in ("fl", "fr", "rl", "rr")}
    columns |= {"gear": np.full(t.size, 3.0)}
    columns |= {f"water_depth_{s}": np.where(on, 7e-3 if s == side else 0.0, 0.0) for s in ("left", "right")}
    return columns
