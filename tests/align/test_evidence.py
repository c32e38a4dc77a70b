"""Signals of a drive whose channels have no units: unit and sign by what the car does."""

import math

import numpy as np
import pytest

from aqualog.align.propose import propose_map
from aqualog.core.records import Channel, ChannelInfo

T = np.arange(0.0, 150.0, 0.02)
V = 20.0 + 7.0 * np.sin(0.21 * T) + 2.0 * np.sin(0.8 * T)
A = np.gradient(V, 0.02)
YAW = 0.12 * np.sin(0.17 * T) + 0.03
BRAKE = np.where(A < -1.0, -10.0 * A, 0.0)  # [bar]
HEADING = np.cumsum(YAW) * 0.02
EARTH = 6.371e6


def channel(name, x, unit=""):
    noise = (np.unique(x).size > 2) * 1e-3 * np.std(x) * np.random.default_rng(len(name)).standard_normal(T.size)
    t_ns = np.rint(T * 1e9).astype(np.int64)
    return Channel(ChannelInfo(name, name, unit, T.size, "a.csv"), t_ns, x + noise, False)


def wheels(factor):
    v = {"FL": V - 0.75 * YAW, "FR": V + 0.75 * YAW, "RL": V - 0.75 * YAW, "RR": V + 0.75 * YAW}
    return [channel(f"WHEEL_{w}", x / factor) for w, x in v.items()]


def positions():
    north, east = (np.cumsum(V * f(HEADING)) * 0.02 / EARTH for f in (np.sin, np.cos))
    latitude = math.radians(48.0) + north
    return [
        channel("Latitude", np.degrees(latitude)),
        channel("Longitude", 11.0 + np.degrees(east) / math.cos(math.radians(48.0))),
    ]


def unit_of(found, symbol):
    return found[symbol].entry.unit


@pytest.mark.parametrize(("unit", "factor"), [("km/h", 1 / 3.6), ("m/s", 1.0), ("rad/s", 0.317), ("rpm", 0.0332), ("mph", 0.447)])  # fmt: skip
@pytest.mark.parametrize("by", ["positions", "gps speed"])
def test_wheels_by_positions_or_by_a_speed_with_a_unit(unit, factor, by):
    others = positions() if by == "positions" else [channel("GPS Speed", V, "m/s")]
    found = propose_map([*wheels(factor), *others])
    assert {unit_of(found, f"omega_{w}") for w in ("fl", "fr", "rl", "rr")} == {unit}
    assert not found["omega_rr"].doubt


def test_a_speed_by_wheels_that_have_a_unit():
    of_wheels = [channel(f"WHEEL_{w}", 3.6 * V, "km/h") for w in ("FL", "FR", "RL", "RR")]
    assert unit_of(propose_map([*of_wheels, channel("GPS Speed", V)]), "v_x") == "m/s"
    assert "v_x" not in propose_map([*of_wheels, channel("GPS Speed", 7.0 * V)])


@pytest.mark.parametrize(("unit", "factor"), [("m/s", 1.0), ("km/h", 1 / 3.6)])
def test_wheels_by_the_accelerometer_alone(unit, factor):
    found = propose_map([*wheels(factor), channel("InlineAcc", A, "m/s^2")])
    assert unit_of(found, "omega_rl") == unit
    assert unit_of(found, "omega_fr") == unit


def test_what_nothing_decides_is_in_doubt_and_said():
    found = propose_map(wheels(1.0))["omega_fl"]
    assert found.entry.unit == "km/h"
    assert "m/s" in found.doubt
    assert "CHECK THE UNIT: it may be m/s or" in found.remark


@pytest.mark.parametrize(
    ("symbol", "name", "raw", "unit"),
    [
        ("a_x", "InlineAcc", A, "m/s^2"), ("a_x", "InlineAcc", A / 9.81, "g"),
        ("a_y", "LateralAcc", V * YAW, "m/s^2"), ("a_y", "LateralAcc", V * YAW / 9.81, "g"),
        ("yaw_rate", "YawRate", YAW, "rad/s"), ("yaw_rate", "YawRate", np.degrees(YAW), "deg/s"),
        ("steering_wheel_angle", "STEER_POS", 42.0 * YAW / V, "rad"),
        ("steering_wheel_angle", "STEER_POS", np.degrees(42.0 * YAW / V), "deg"),
        ("brake_pressure", "BRK_PRESS", BRAKE, "bar"), ("brake_pressure", "BRK_PRESS", BRAKE / 10.0, "MPa"),
        ("brake_pressure", "BRK_PRESS", 100.0 * BRAKE, "kPa"),
    ],
)  # fmt: skip
def test_units_by_the_motion(symbol, name, raw, unit):
    found = propose_map([*wheels(1 / 3.6), *positions(), channel(name, raw)])[symbol]
    assert (found.entry.unit, found.entry.scale, found.doubt) == (unit, 1.0, ())


@pytest.mark.parametrize(
    ("symbol", "name", "raw", "unit"),
    [
        ("a_y", "LateralAcc", -V * YAW, "m/s^2"), ("yaw_rate", "YawRate", -YAW, "rad/s"),
        ("steering_wheel_angle", "STEER_POS", -np.degrees(42.0 * YAW / V), "deg"), ("a_x", "InlineAcc", -A, "m/s^2"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("has_unit", [True, False])
def test_a_turned_sign_is_proposed_with_its_correlation(symbol, name, raw, unit, has_unit):
    found = propose_map([*wheels(1 / 3.6), *positions(), channel(name, raw, unit if has_unit else "")])[symbol]
    assert found.entry.scale == -1.0
    assert "correlation -" in found.reason
    assert found.reason.endswith("sign turned")


@pytest.mark.parametrize(("name", "top"), [("YawRate", 2.0), ("STEER_POS", 5.0)])
def test_a_straight_drive_in_radians_would_be_a_curve_that_no_tyre_holds(name, top):
    wanders = top * np.random.default_rng(2).uniform(-1.0, 1.0, T.size // 100).repeat(100)
    found = propose_map([*wheels(1 / 3.6), channel("GPS Speed", V, "m/s"), channel(name, wanders)])
    p = found.get("yaw_rate") or found["steering_wheel_angle"]
    assert p.entry.unit.startswith("deg")
    assert not p.doubt


def test_what_a_speed_in_doubt_shows_is_in_doubt_too():
    found = propose_map([*wheels(1.0), channel("YawRate", YAW)])
    assert found["omega_fl"].doubt
    assert found["yaw_rate"].doubt


def test_the_axes_of_one_accelerometer_have_one_unit():
    calm = 0.03 * np.random.default_rng(3).standard_normal(T.size)
    found = propose_map([*wheels(1 / 3.6), *positions(), channel("InlineAcc", A / 9.81), channel("LateralAcc", calm)])
    assert (found["a_y"].entry.unit, found["a_y"].doubt) == ("g", ())


def test_switches_and_strangers_without_a_unit_are_no_signals():
    found = propose_map([
        *wheels(1 / 3.6), *positions(), channel("BRK_PRESSED", V), channel("BRK_PRESS", (V > 20.0) + 0.0), channel("ACC_FAULT", V),
        channel("LongitudinalAcc", np.random.default_rng(1).standard_normal(T.size)), channel("PEDAL_POS", V),
    ])  # fmt: skip
    assert not {"brake_pressure", "a_x"} & set(found)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "x", [np.full(T.size, np.nan), np.zeros(T.size), np.append(np.full(T.size - 1, np.nan), 1.0), 1e300 * V]
)
def test_channels_that_say_nothing_are_no_error(x):
    t_ns = np.rint(T * 1e9).astype(np.int64)
    names = [
        "WHEEL_FL",
        "WHEEL_RL",
        "WHEEL_RR",
        "GPS Speed",
        "Latitude",
        "Longitude",
        "InlineAcc",
        "LateralAcc",
        "YawRate",
    ]
    names += ["STEER_POS", "BRK_PRESS", "Altitude"]
    dead = [Channel(ChannelInfo(n, n, "", T.size, "a.csv"), t_ns, x, False) for n in names]
    for others in ([], wheels(1 / 3.6), positions()):
        propose_map([*others, *dead])
    propose_map([Channel(c.info, c.t_ns[:1], c.values[:1], False) for c in dead])
