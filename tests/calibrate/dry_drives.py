"""Simulated dry drives of a car whose parameters are drawn, for the calibration that is to find them."""

from dataclasses import replace

import numpy as np
import polars as pl

from aqualog.core.vehicle import Vehicle
from aqualog.model.log import as_signals
from aqualog.model.scenario import Scenario
from aqualog.model.sensors import ESC
from aqualog.model.simulate import simulate

WIND_SD = 3.0  # [m/s]
GRADE_SD = 0.02  # [rad]
CLIMB_SD = 20.0  # [m] net climb of a drive
GAIN_SD = 0.02  # of the torque signal, one draw for the car
ALTITUDE_SD = 3.0  # [m] at each moment, slowly changing


def car(rng):
    """A car, and what its torque signal is multiplied with."""
    drivetrain = ("rwd", "fwd")[int(rng.integers(2))]
    true = Vehicle(
        name="drawn", drivetrain=drivetrain, torque_split_rear=1.0 if drivetrain == "rwd" else 0.0,
        mass=rng.uniform(1200.0, 2100.0), l_f=rng.uniform(1.25, 1.45), l_r=rng.uniform(1.35, 1.5),
        drag_area=rng.uniform(0.5, 0.9), rolling_resistance=rng.uniform(0.008, 0.014),
        r_e_f=0.317 * (1.0 + 0.003 * rng.normal()), r_e_r=0.317 * (1.0 + 0.003 * rng.normal()),
        given=frozenset({"drivetrain", "mass", "l_f", "l_r"}),
    )  # fmt: skip
    return true, 1.0 + GAIN_SD * rng.normal()


def believed(true):
    """The vehicle file before: a catalogue's figures."""
    return replace(true, mass=1650.0, drag_area=0.66, rolling_resistance=0.0105, r_e_f=0.317, r_e_r=0.317)


def one_drive(true, gain, rng, *, seconds=400.0, rate=50.0, altitude=True, grade=True, wind=None, sensors=ESC):
    """One drive over rolling country in some wind, with the series sensors' own draws."""
    t, v, points = 0.0, rng.uniform(12.0, 30.0), []
    while t < seconds:
        points.append((t, v))
        hold = rng.uniform(3.0, 15.0)
        points.append((t + hold, v))
        target = rng.uniform(11.0, 34.0)
        change = abs(target - v) / rng.uniform(0.3, 1.2)
        t, v = t + hold + max(change, 1.0), target
    points.append((t, v))
    knots = np.arange(0.0, seconds * 36.0, 300.0)
    slope = GRADE_SD * rng.normal(size=knots.size) * grade
    # roads end near the height at which they began
    length = float(np.trapezoid([p[1] for p in points], [p[0] for p in points]))
    inside = knots < length
    slope[inside] += CLIMB_SD * rng.normal() * grade / length - slope[inside].mean()
    channels = dict(sensors.channels)
    for w in ("fl", "fr", "rl", "rr"):
        if f"torque_{w}" in channels:
            channels[f"torque_{w}"] = replace(channels[f"torque_{w}"], gain=gain, gain_spread=0.0)
    scenario = Scenario(
        true, duration_s=seconds, rate_hz=rate, seed=int(rng.integers(1, 10**6)), speed=tuple(points),
        grade=tuple(zip(knots.tolist(), slope.tolist(), strict=True)),
        head_wind=WIND_SD * rng.normal() if wind is None else wind, sensors=replace(sensors, channels=channels),
    )  # fmt: skip
    signals = as_signals(simulate(scenario, dt=2e-3), vehicle=believed(true))
    if not altitude:
        return signals
    climb = np.cumsum(signals.array("true_v_x") * np.sin(signals.array("true_grade"))) / rate
    n = climb.size
    wander = np.interp(np.arange(n), np.linspace(0, n - 1, 12), rng.normal(0.0, ALTITUDE_SD, 12))
    return replace(signals, frame=signals.frame.with_columns(pl.Series("altitude", 300.0 + climb + wander)))


def campaign(seed, drives, **kw):
    """Signals of some drives of one car, the car, and the gain of its torque signal."""
    rng = np.random.default_rng([seed, 8101])
    true, gain = car(rng)
    return [one_drive(true, gain, rng, **kw) for _ in range(drives)], true, gain


def truth(true, gain, signals):
    """What the parameters are to be; a radius is that of a freely rolling wheel, with the slip that it has then."""
    f, r = (
        1.0 + true.rolling_resistance / np.nanmean([signals.array(f"true_slip_slope_{w}") for w in pair])
        for pair in (("fl", "fr"), ("rl", "rr"))
    )
    return {
        "mass_per_gain": true.mass * gain, "mass": true.mass, "torque_gain": 1.0 / gain, "drag_area": true.drag_area,
        "rolling_resistance": true.rolling_resistance, "r_e_f": true.r_e_f * f, "r_e_r": true.r_e_r * r,
        "r_e_ratio": true.r_e_f * f / (true.r_e_r * r),
    }  # fmt: skip
