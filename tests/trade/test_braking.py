"""The braking test: stops, their coefficient, and why some do not count."""

import math

import numpy as np
import pytest

from aqualog.trade.braking import Conditions, bfc_of, stop_between, stops
from aqualog.trade.grip import Coefficients, wet_grip_index
from tests.trade.made import KMH, signals

G = 9.80665


def drive(decel=7.0, *, wet=True, rate=100.0, start=90.0):
    t = np.arange(0.0, 8.0, 1.0 / rate)
    v = np.clip(start * KMH - decel * np.maximum(t - 2.0, 0.0), 0.0, None)
    return {"v_x": v, "yaw_rate": np.zeros(t.size), **({"water_depth": np.full(t.size, 1e-3)} if wet else {})}


def one(columns, **more):
    (stop,) = stops(signals(columns), v_from=80 * KMH, v_to=20 * KMH, **more)
    return stop


def test_coefficient_by_hand():
    # 80 to 20 km/h at 7 m/s²: d = (22.2222² - 5.5556²) / 14 = 33.0688 m
    assert bfc_of(80 * KMH, 20 * KMH, 33.0688) == pytest.approx(7.0 / G, rel=1e-5)
    assert math.isnan(bfc_of(10.0, 5.0, 0.0))
    stop = one(drive())
    assert stop.valid, stop.reasons
    assert stop.distance == pytest.approx(33.0688, abs=1e-3)
    assert stop.bfc == pytest.approx(7.0 / G, rel=1e-4)
    assert stop.end_s - stop.start_s == pytest.approx(60 * KMH / 7.0, abs=1e-3)


def test_places_of_stops():
    v = np.array([25.0, 21.0, 23.0, 19.0, 12.0, np.nan, 4.0, 25.0, 25.0, 3.0])
    # the last fall below 22 before 5: between 23 and 19; NaN is passed over
    assert stop_between(v, 22.0, 5.0) == [pytest.approx((2.25, 5.75)), pytest.approx((8 + 3 / 22, 8 + 20 / 22))]
    assert stop_between(v, 30.0, 5.0) == []
    assert stop_between(np.full(3, np.nan), 22.0, 5.0) == []


def test_temperature_and_texture():
    stop = one(drive(), conditions=Conditions(1e-3, 30.0, 0.7e-3))
    assert stop.valid
    assert stop.bfc_20 == pytest.approx(stop.bfc + 0.002 * 10.0)
    assert math.isnan(one(drive()).bfc_20)
    measured = drive() | {"ambient_temperature": np.full(800, 283.15)}
    assert one(measured).temperature == pytest.approx(10.0)
    assert "wetted road" in one(measured).notes[0]
    deep = one(drive() | {"water_depth": np.full(800, 3e-3)}, conditions=Conditions(1e-3))  # the log's depth counts
    assert "3.0 mm of water" in deep.reasons[0]
    rough = one(drive(), conditions=Conditions(texture=1.6e-3))
    assert "macrotexture of 1.60 mm" in rough.reasons[0]


T = np.arange(0.0, 8.0, 0.01)
ODD = {
    "dry": (drive(wet=False), "nothing says that the road was wet"),
    "zero water": (drive(wet=False) | {"water_depth": np.zeros(800)}, "nothing says that the road was wet"),
    "deep": (drive() | {"water_depth": np.full(800, 4e-3)}, "4.0 mm of water"),
    "lane too short": (drive() | {"on_water": (T < 3.0).astype(float)}, "not on water all the way"),
    "coasting": (drive(1.0, start=85.0), "no stop from 80 to 20 km/h"),
    "never so fast": (drive(start=70.0), "no stop from 80 to 20 km/h in the log: v_x goes from 0 to 70 km/h; --from"),
    "yaw": (drive() | {"yaw_rate": np.where((T > 3.0) & (T < 3.5), 0.4, 0.0)}, "yaw rate reaches 0.40"),
    "no speed": ({"yaw_rate": np.zeros(800)}, "v_x is not in the log"),
    "all NaN": (drive() | {"v_x": np.full(800, np.nan)}, "v_x is not in the log"),
    "locked": (
        drive() | {"omega_rr": np.where((T > 2.5) & (T < 3.2), 0.0, drive()["v_x"] / 0.3)},
        "wheel rr stands for",
    ),
    "eased": (drive() | {"brake_pressure": np.where(T < 3.0, 1e7, 2.5e6)}, "the brake pressure falls to 25 % for"),
    "wrong unit": (drive() | {f"omega_{w}": drive()["v_x"] / 1.08 for w in ("fl", "fr")}, "a radius of 1.08 m"),
    "no tyre": (drive(15.0), "a coefficient of 1.53: no tyre has more than 1.4"),
    "gap": (drive() | {"v_x": np.where((T > 3.0) & (T < 3.4), np.nan, drive()["v_x"])}, "speed is missing for 0.39 s"),
}


@pytest.mark.parametrize("name", ODD)
def test_a_stop_that_is_none_says_why(name):
    columns, words = ODD[name]
    stop = one(columns)
    assert not stop.valid
    assert words in "; ".join(stop.reasons)


def test_rolling_out_is_no_stop():
    t = np.arange(0.0, 30.0, 0.01)
    stop = one({"v_x": np.clip(85 * KMH - 1.0 * t, 0, None), "water_depth": np.full(t.size, 1e-3)})
    assert not stop.valid
    assert (
        "between these it slows down by 1.0 m/s² on average (from 1.4 s on), a stop by 2 m/s² or more; --limits"
        in stop.reasons[0]
    )


def test_a_brake_that_was_let_go():
    t = np.arange(0.0, 10.0, 0.01)
    a = np.where((t > 2.0) & ~((t > 3.0) & (t < 4.0)), 7.0, 0.0)
    stop = one({"v_x": np.clip(90 * KMH - np.cumsum(a) * 0.01, 0, None), "water_depth": np.full(t.size, 1e-3)})
    assert "the brake was let go" in stop.reasons[0]


def test_several_stops_in_one_log():
    twice = {k: np.concatenate([x, x]) for k, x in drive().items()}
    assert [s.valid for s in stops(signals(twice), v_from=80 * KMH, v_to=20 * KMH)] == [True, True]


def test_wet_grip_index_by_hand():
    c = Coefficients("made up", scale=125.0, a=-0.4, t0=20.0, b=-8.0, bfc_r0=0.68)
    assert wet_grip_index(0.7, 0.7, 20.0, Coefficients("x", 125.0, -0.4, 20.0, -8.0, 0.7)) == pytest.approx(1.25)
    # 125 * 0.77/0.70 = 137.5; -0.4 * 5 = -2; -8 (0.70/0.68 - 1) = -0.23529
    assert wet_grip_index(0.77, 0.70, 25.0, c) == pytest.approx((137.5 - 2.0 - 0.2352941) / 100.0)


def test_a_stop_with_abs_counts():
    t = T
    v = drive()["v_x"]
    cycles = np.where((t > 2.2) & (np.mod(t, 0.4) < 0.15), 0.0, v / 0.3)  # a wheel stands for 0.15 s at a time
    pressed = np.clip(1e7 * (t - 2.0) / 0.2, 0.0, 1e7) + 5e5 * np.sin(30.0 * t)
    stop = one(drive() | {f"omega_{w}": cycles for w in ("fl", "fr", "rl", "rr")} | {"brake_pressure": pressed})
    assert stop.valid, stop.reasons
