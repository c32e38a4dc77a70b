"""Eight trips of an electric car: what they tell of its mass, and how far a trip is from the next.

The trips show apparent masses that differ by 2 % although nothing was loaded: driver, rig, temperature of the driveline
and the torque's own accuracy. Only A-trips in summer and one B-trip in winter are unloaded; the loaded one is a B-trip.
"""

from pathlib import Path

import numpy as np
import pytest

from aqualog.align.load import load_signals
from aqualog.align.mapping import SignalMap
from aqualog.calibrate.run import calibrate
from aqualog.config.signal_map import load_signal_map
from aqualog.config.vehicle import load_vehicle

HERE = Path(__file__).parent
UNLOADED = ("A05", "A10", "A11", "A12", "A17", "B26")  # A15 was driven in rain
KERB = 1270.0  # [kg]
ABOARD = 105.0  # [kg] driver and rig, estimated in the vehicle file
pytestmark = pytest.mark.real

MAP = """[signals]
v_x = "Velocity"
a_x = "Longitudinal Acceleration"
altitude = "Elevation"
torque_r = { channel = "Motor Torque", scale = 9.665 }
"""


@pytest.fixture(scope="module")
def trips(real_logs, tmp_path_factory):
    path = tmp_path_factory.mktemp("map") / "map.toml"
    path.write_text(MAP, encoding="utf-8")
    signal_map: SignalMap = load_signal_map(path)
    car = load_vehicle(HERE / "bmw_i3.toml")
    names = (*UNLOADED, "B24")
    return car, {
        n: load_signals([real_logs / "bmw_i3" / f"Trip{n}.csv"], vehicle=car, signal_map=signal_map) for n in names
    }


@pytest.fixture(scope="module")
def unloaded(trips):
    car, signals = trips
    return calibrate([signals[n] for n in UNLOADED], UNLOADED, car, {"mass": KERB + ABOARD})


def test_torque_gain_with_the_weight_given(unloaded):
    """The reduction alone is 9.665; the map of the other tests has 0.857 of it, from two of these trips."""
    gain = unloaded.get("torque_gain")
    low, high = gain.ci95
    assert low < 0.857 < high
    assert 0.005 < 0.5 * (high - low) / gain.value < 0.04


def test_trips_differ_more_than_each_by_itself_says(unloaded):
    masses = np.array([d.mass for d in unloaded.drives])
    within = np.array([d.mass_sd for d in unloaded.drives])
    assert np.std(masses, ddof=1) > 1.3 * np.mean(within)
    assert np.ptp(masses) < 0.06 * np.mean(masses)


def test_dry_parameters_are_a_cars(unloaded):
    for name, low, high in (("rolling_resistance", 0.007, 0.015), ("drag_area", 0.3, 0.75)):
        p = unloaded.get(name)
        assert p.identified
        assert low < p.ci95[0] < p.ci95[1] < high
    assert all(abs(d.offset) < 0.05 for d in unloaded.drives)
    assert all(d.rmse_after < 0.07 for d in unloaded.drives)


def test_loaded_trip_is_heavier_within_its_interval(trips, unloaded):
    """60 kg and 0 kg both lie in it: one trip cannot tell 60 kg where trips differ by 25 kg without any load."""
    car, signals = trips
    gain, area = unloaded.get("torque_gain").value, unloaded.get("drag_area").value
    fixed = {"torque_gain": gain, "drag_area": area}
    result = calibrate([signals[n] for n in (*UNLOADED, "B24")], (*UNLOADED, "B24"), car, fixed)
    difference, low, high = result.drives[-1].against_others
    assert difference > 0.0
    assert low < 60.0 < high
    assert 40.0 < 0.5 * (high - low) < 100.0


def test_winter_trips_against_each_other(trips, unloaded):
    """The same season and setting: B24 less B26, where less differs than between all trips."""
    car, signals = trips
    fixed = {"torque_gain": unloaded.get("torque_gain").value, "drag_area": unloaded.get("drag_area").value}
    loaded, empty = (calibrate([signals[n]], [n], car, fixed).drives[0] for n in ("B24", "B26"))
    sd = np.hypot(loaded.mass_sd, empty.mass_sd)
    assert abs(loaded.mass - empty.mass - 60.0) < 2.0 * sd


def test_without_a_weight_mass_and_gain_are_one_ratio(trips):
    car, signals = trips
    result = calibrate([signals[n] for n in UNLOADED], UNLOADED, car)
    assert any("one ratio" in s for s in result.cannot_tell)
    assert not result.get("torque_gain").identified
    assert any("wheel speeds of all four wheels" in s for s in result.cannot_tell)
