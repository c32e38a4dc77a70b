"""Scale of the turning: a yaw rate or a_y in the wrong unit; signs and offsets are judged with it put right."""

import numpy as np
import pytest

from aqualog.checks.correct import without_offsets
from aqualog.checks.look import look
from aqualog.core.records import Origin
from tests.checks.made import CAR, made, signals

DEGREE = np.pi / 180.0
WHEELS = tuple(f"omega_{w}" for w in ("fl", "fr", "rl", "rr"))
PLACES = ("latitude", "longitude")


def remarks(drop=(), turned=(), origins=None, seed=0, **factors):
    drive = made(seed=seed, stops=2, turning=0.1, yaw_rate_offset=0.002)
    own = {n: x * factors.get(n, 1.0) for n, x in drive.items()}
    return look(signals(own, drop=drop, turned=turned, origins=origins), CAR)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("drop", [(), PLACES, ("a_y",), ("a_y", *PLACES), ("torque_rl", "torque_rr", *WHEELS)])
@pytest.mark.parametrize(("factor", "words"), [(1 / DEGREE, "deg/s read as rad/s"), (DEGREE, "rad/s read as deg/s")])
def test_a_yaw_rate_in_the_wrong_unit(seed, drop, factor, words):
    (remark,) = remarks(drop=drop, seed=seed, yaw_rate=factor)
    assert (remark.kind, remark.signals) == ("scale", ("yaw_rate",))
    assert words in remark.what
    assert float(remark.lines[0].split("scale = ")[1].rstrip(" }")) == pytest.approx(1 / factor, rel=0.001)


@pytest.mark.parametrize("seed", range(3))
def test_a_short_drive_shows_a_unit(seed):
    """10 s are enough for a factor of 57, but not for one that no unit explains."""
    drive = made(seconds=12.0, seed=seed, turning=0.1)
    found = {f: look(signals(drive | {"yaw_rate": f * drive["yaw_rate"]}), CAR) for f in (1.0, 1 / DEGREE, 20.0)}
    assert [r.kind for f in found for r in found[f]] == ["scale"]
    assert "deg/s read as rad/s" in found[1 / DEGREE][0].what


def test_front_wheels_that_slip_on_water_are_no_turning():
    drive = made(seconds=24.0, accelerating=0.2, turning=0.002)
    slips = 0.04 * np.clip(np.sin(np.arange(480) * 0.08), 0.0, None)
    drive |= {"omega_fr": drive["omega_fr"] * (1.0 - slips), "yaw_rate": -0.3 * slips}
    drop = ("a_y", "steer_angle", *PLACES)
    assert look(signals(drive, drop=drop), CAR) == ()
    # without rear wheels nothing speaks against it
    assert ("yaw_rate",) in [r.signals for r in look(signals(drive, drop=(*drop, *WHEELS[2:])), CAR)]


def test_the_line_has_the_right_unit():
    origin = Origin("yaw_rate", "Gyro", "a.mf4", "rad/s", 20.0, 1, mapped={"channel": ["Gyro"], "unit": "rad/s"})
    (remark,) = remarks(yaw_rate=1 / DEGREE, origins={"yaw_rate": origin})
    assert remark.lines == ('yaw_rate = { channel = "Gyro", unit = "deg/s" }',)


@pytest.mark.parametrize("factor", [1 / DEGREE, DEGREE])
def test_sign_and_scale_of_one_signal(factor):
    found = remarks(turned=("yaw_rate",), yaw_rate=factor)
    assert [r.kind for r in found] == ["sign", "scale"]
    assert found[0].lines == found[1].lines
    assert "scale = -" in found[0].lines[0]


def test_a_lateral_acceleration_read_as_g():
    (remark,) = remarks(a_y=9.80665)
    assert (remark.kind, remark.signals) == ("scale", ("a_y",))
    assert "m/s² read as g" in remark.what


@pytest.mark.parametrize("factor", [3.6, 1 / 3.6])
def test_wrong_speeds_are_not_laid_upon_the_yaw_rate(factor):
    assert "yaw_rate" not in {s for r in remarks(**dict.fromkeys(WHEELS, factor)) for s in r.signals}
    assert "yaw_rate" not in {s for r in remarks(drop=WHEELS, v_x=factor) for s in r.signals}


def test_no_offset_of_a_signal_whose_scale_is_wrong():
    drive = made(stops=2, turning=0.1, yaw_rate_offset=0.03)
    drive["yaw_rate"] = drive["yaw_rate"] / DEGREE
    assert [r.kind for r in look(signals(drive), CAR)] == ["scale"]


@pytest.mark.parametrize(("name", "offset"), [("yaw_rate", 1.7), ("a_x", 9.81), ("a_y", -9.81)])
def test_what_no_sensor_has_is_no_offset(name, offset):
    """Gravity, or a value in another unit: nothing is proposed to be taken off, and nothing is."""
    drive = signals(made(stops=2, **{f"{name}_offset": offset}))
    remark = next(r for r in look(drive, CAR) if r.signals == (name,))
    assert remark.kind == "channel"
    assert "no sensor is so far off" in remark.what
    assert remark.lines == ()
    assert np.array_equal(without_offsets(drive, CAR).array(name), drive.array(name))


@pytest.mark.parametrize("seed", range(3))
def test_another_channel_as_a_x(seed):
    drive = made(seed=seed, stops=1)
    drive["a_x"] = drive["a_y"]
    remark = next(r for r in look(signals(drive), CAR) if r.signals == ("a_x",))
    assert remark.kind == "channel"
    assert remark.what.startswith("a_x does not follow the change of the speed (correlation ")
    assert remark.what.endswith("): another channel?")
    assert not [r for r in look(signals(drive), CAR) if r.kind in ("torque", "resistance")]
