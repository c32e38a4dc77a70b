"""The signals of measured drives, guessed: all of them, with the right unit and sign."""

import pytest

import aqualog as aq

pytestmark = pytest.mark.real

WHEELS = ("fl", "fr", "rl", "rr")
PORSCHE = {
    **{f"omega_{w}": (f"WHEEL_{w.upper()}", "km/h", 1.0) for w in WHEELS},
    "v_x": ("GPS Speed", "m/s", 1.0), "a_x": ("InlineAcc", "g", 1.0), "a_y": ("LateralAcc", "g", -1.0),
    "yaw_rate": ("YawRate", "deg/s", -1.0), "steering_wheel_angle": ("STEER_POS", "deg", 1.0),
    "brake_pressure": ("BRK_PRESS", "bar", 1.0), "latitude": ("GPS Latitude", "deg", 1.0),
    "longitude": ("GPS Longitude", "deg", 1.0), "altitude": ("GPS Altitude", "m", 1.0),
}  # fmt: skip
RAV4 = {
    **{f"omega_{w}": (f"WHEEL_SPEEDS.WHEEL_SPEED_{w.upper()}", "km/h", 1.0) for w in WHEELS},
    "a_x": ("VSC1S07.GVC", "m/s^2", 1.0), "a_y": ("KINEMATICS.ACCEL_Y", "m/s^2", -1.0),
    "yaw_rate": ("KINEMATICS.YAW_RATE", "deg/s", 1.0),
    "steering_wheel_angle": ("STEER_ANGLE_SENSOR.STEER_ANGLE", "deg", 1.0),
}  # fmt: skip


def proposed(logs, dbc=()):
    found = aq.inspect(aq.read(logs, dbc=dbc))
    assert not any(p.doubt for p in found.proposals.values())
    return {s: (e.channel[0], e.unit, e.scale) for s, e in found.map.entries.items()}


def test_porsche_without_a_unit_anywhere(real_logs):
    assert proposed(real_logs / "porsche_981") == PORSCHE


def test_rav4_from_raw_frames(real_logs):
    folder = real_logs / "toyota_rav4"
    assert proposed(folder / "can_bus.mf4", folder / "toyota_2017.dbc") == RAV4
