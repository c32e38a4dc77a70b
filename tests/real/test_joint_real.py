"""Joint detectors and the warning before them over measured dry drives.

No measured drive has wheel speeds and wheel torques. The trips of the BMW have torque, acceleration and speed; wheels
that roll with a tyre of slip slope 31 and the noise of a tooth ring are added to them, so that everything that the
resistance gate sees is measured, and everything that wheels add is what a healthy car shows.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from aqualog.align.load import load_signals
from aqualog.config.signal_map import load_signal_map
from aqualog.config.vehicle import load_vehicle
from aqualog.core.notation import WHEELS
from aqualog.detect.stream import detect_drive
from aqualog.physics.load import G

HERE = Path(__file__).parent
pytestmark = pytest.mark.real
TRIPS = ("A05", "A10", "A11", "A12", "A15", "A17", "B24", "B26")
SLOPE, NOISE = 31.0, 0.02  # [-], [m/s]


def with_wheels(signals, car, seed):
    rng = np.random.default_rng(seed)
    n = signals.frame.height
    v = signals.array("v_x")
    mu = signals.array("torque_rl") / car.r_e_r / (0.25 * car.mass * G)
    columns = {}
    for w in WHEELS:
        slip = mu / SLOPE if w in car.driven else 0.0
        columns[f"omega_{w}"] = (v * (1.0 + slip) + NOISE * rng.standard_normal(n)) / car.r_e(w)
    return replace(signals, frame=signals.frame.with_columns(**{k: pl.Series(x) for k, x in columns.items()}))


def one(real_logs, trip):
    car = load_vehicle(HERE / "bmw_i3.toml")
    signals = load_signals(
        [real_logs / "bmw_i3" / f"Trip{trip}.csv"], vehicle=car, signal_map=load_signal_map(HERE / "bmw_i3_map.toml")
    )
    return detect_drive(with_wheels(signals, car, TRIPS.index(trip)), car), signals


@pytest.mark.parametrize("trip", TRIPS)
def test_no_warning_on_a_dry_trip(real_logs, trip):
    result, _ = one(real_logs, trip)
    ran = {t.detector for t in result.tracks}
    assert {"joint_criteria", "joint_cusum", "margin", "resistance", "spin_down", "spin_up"} <= ran
    assert [e for e in result.events if e.detector.startswith(("joint", "margin"))] == []


@pytest.mark.parametrize("trip", ["A11", "A12", "B26"])
def test_no_warning_on_a_dry_trip_without_torque(real_logs, trip):
    """A12 is hilly; the others come nearest to a warning."""
    result, signals = one(real_logs, trip)
    car = load_vehicle(HERE / "bmw_i3.toml")
    frame = with_wheels(signals, car, TRIPS.index(trip)).frame.drop("torque_rl", "torque_rr")
    alone = detect_drive(replace(result.signals, frame=frame), car)
    assert "margin" in {t.detector for t in alone.tracks}
    assert not [e for e in alone.events if e.detector == "margin"]


def test_a_stopping_wheel_in_a_dry_trip_is_no_joint_warning_but_one_with_resistance_is(real_logs):
    """A spin-down put into trip A11 at 80 km/h or more: by itself, and with 0.4 m/s^2 less on the accelerometer."""
    car = load_vehicle(HERE / "bmw_i3.toml")
    _, plain = one(real_logs, "A11")
    v = plain.array("v_x")
    begin = next(i for i in range(600, v.size - 60) if v[i - 50 : i + 60].min() > 22.0)
    at = slice(begin, begin + 12)
    for loss, expected in ((0.0, False), (0.4, True)):
        signals = with_wheels(plain, car, 1)
        omega, a_x = signals.array("omega_fr").copy(), signals.array("a_x").copy()
        omega[at] *= np.concatenate([np.linspace(1.0, 0.3, 6), np.linspace(0.3, 1.0, 6)])
        a_x[begin - 10 : begin + 30] -= loss
        frame = signals.frame.with_columns(omega_fr=pl.Series(omega), a_x=pl.Series(a_x))
        events = detect_drive(replace(signals, frame=frame), car).events
        found = [e for e in events if e.detector == "joint_criteria"]
        assert bool(found) == expected
        if found:
            assert found[0].evidence["decided_by"][0] == "spin_down"
