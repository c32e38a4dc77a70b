"""A turned signal is named; where the log cannot tell which one is turned, that is said."""

import numpy as np
import pytest

from aqualog.checks.look import look
from aqualog.core.records import Origin
from tests.checks.made import CAR, DT, made, signals, smooth

TURNING = ("a_y", "yaw_rate", "steer_angle")
WHEELS = tuple(f"omega_{w}" for w in ("fl", "fr", "rl", "rr"))
PLACE = ("latitude", "longitude")
DRIVE = made()


def said(columns=DRIVE, *, drop=PLACE, **how):
    how["drop"] = drop
    return [(r.signals, r.lines) for r in look(signals(columns, **how), CAR) if r.kind == "sign"]


def line(symbol):
    return f'{symbol} = {{ channel = "{symbol}", scale = -1.0 }}'


@pytest.mark.parametrize(
    "turned",
    [(), ("a_x",), ("a_y",), ("yaw_rate",), ("steer_angle",), ("a_y", "yaw_rate"), TURNING, ("a_x", "a_y", "steer_angle")],
)  # fmt: skip
def test_with_wheels_the_turned_signals_are_named(turned):
    assert said(turned=turned) == [((s,), (line(s),)) for s in sorted(turned)]


@pytest.mark.parametrize("turned", [("v_x",), WHEELS])
def test_a_velocity_against_the_wheels(turned):
    (first, *_) = look(signals(DRIVE, turned=turned), CAR)
    assert (first.kind, first.signals, first.lines) == ("sign", turned, tuple(line(s) for s in turned))
    assert "v_x has the opposite sign of the wheels in 100 %" in first.what


def test_water_on_one_side_of_a_straight_road_exchanges_nothing():
    # wheels of one side slip, the car yaws a little, and the driver steers against it: the drive's only event
    t = np.arange(DRIVE["v_x"].size) * DT
    noise = np.random.default_rng(4).normal(size=(len(TURNING), t.size))
    wet = np.clip(np.minimum(t - 20.0, 24.0 - t), 0.0, 1.0)
    columns = {n: x for n, x in DRIVE.items() if n not in PLACE}
    columns |= {n: size * wet + size / 20.0 * e for n, size, e in zip(TURNING, (0.25, 0.01, -0.01), noise, strict=True)}
    columns |= {w: columns["v_x"] / CAR.r_e(w[-2:]) for w in WHEELS}
    columns["omega_fl"], columns["omega_rl"] = (
        columns[w] * (1.0 + s * wet) for w, s in (("omega_fl", 0.03), ("omega_rl", -0.03))
    )
    assert [r for r in look(signals(columns), CAR) if r.kind in ("sign", "exchange")] == []


@pytest.mark.parametrize("turned", ["a_y", "yaw_rate"])
def test_without_wheels_the_odd_one_of_three_is_turned(turned):
    assert said(drop=WHEELS, turned=(turned,)) == [((turned,), (line(turned),))]


def test_a_turned_imu_and_turned_steering_look_alike():
    ((names, lines),) = said(drop=(*WHEELS, *PLACE), turned=("steer_angle",))
    assert names == tuple(sorted(TURNING))
    assert set(lines) == {line(s) for s in TURNING}
    (remark,) = look(signals(DRIVE, drop=(*WHEELS, *PLACE), turned=("steer_angle",)), CAR)
    assert "does not show which" in remark.what
    assert " or " in remark.advice


@pytest.mark.parametrize(("one", "other"), [("a_y", "yaw_rate"), ("steer_angle", "yaw_rate")])
def test_of_two_signals_none_is_named(one, other):
    (third,) = set(TURNING) - {one, other}
    ((names, _),) = said(drop=(*WHEELS, *PLACE, third), turned=(one,))
    assert names == tuple(sorted((one, other)))


def exchange(*pairs, columns=DRIVE):
    out = dict(columns)
    for one, other in pairs:
        out[one], out[other] = columns[other], columns[one]
    return out


def lines_for(*pairs):
    return {f'{a} = {{ channel = "{b}" }}' for pair in pairs for a, b in (pair, pair[::-1])}


FRONT, REAR = ("omega_fl", "omega_fr"), ("omega_rl", "omega_rr")


@pytest.mark.parametrize("drop", [(), PLACE, ("yaw_rate", "a_y"), TURNING])
def test_exchanged_wheels_of_one_axle(drop):
    (remark,) = look(signals(exchange(FRONT), drop=drop), CAR)
    assert remark.signals == FRONT
    assert remark.what.startswith("omega_fl and omega_fr look exchanged")
    assert set(remark.lines) == lines_for(FRONT)


def test_the_course_names_exchanged_wheels_of_both_axles():
    """Three signals and the course agree: to turn the three would be wrong."""
    (remark,) = look(signals(exchange(FRONT, REAR)), CAR)
    assert remark.signals == (*FRONT, *REAR)
    assert remark.what.startswith("omega_fl and omega_fr, omega_rl and omega_rr look exchanged")
    assert set(remark.lines) == lines_for(FRONT, REAR)


def test_without_a_course_turned_signals_are_asked_for_with_the_other_cause():
    remarks = look(signals(exchange(FRONT, REAR), drop=PLACE), CAR)
    assert {r.signals for r in remarks} == {(s,) for s in TURNING}
    assert all("or left and right are exchanged at both axles" in r.advice for r in remarks)
    assert all("latitude and longitude in the map would decide" in r.advice for r in remarks)


def test_front_wheels_alone_do_not_outvote_three_signals_that_agree():
    (remark,) = look(signals(exchange(FRONT), drop=(*REAR, *PLACE)), CAR)
    assert "does not show which" in remark.what
    assert set(remark.lines) == {line(s) for s in TURNING} | lines_for(FRONT)


def test_front_wheels_alone_are_named_by_the_course():
    (remark,) = look(signals(exchange(FRONT), drop=REAR), CAR)
    assert set(remark.lines) == lines_for(FRONT)


def test_exchanged_latitude_and_longitude_turn_nothing_else():
    (remark,) = look(signals(exchange(PLACE)), CAR)
    assert remark.what.startswith("latitude and longitude look exchanged")
    assert set(remark.lines) == lines_for(PLACE)


def test_a_line_for_exchanged_channels_keeps_the_unit_of_each():
    origins = {s: Origin(s, f"Rad_{s[-2:]}", "a.mf4", "km/h", 10.0, 1, mapped={"channel": [f"Rad_{s[-2:]}"], "unit": "km/h"})
               for s in FRONT}  # fmt: skip
    (remark,) = look(signals(exchange(FRONT), origins=origins), CAR)
    assert set(remark.lines) == {
        'omega_fl = { channel = "Rad_fr", unit = "km/h" }', 'omega_fr = { channel = "Rad_fl", unit = "km/h" }'
    }  # fmt: skip


@pytest.mark.parametrize("slow", [0.1, 1.0])
@pytest.mark.parametrize("turned", [("yaw_rate",), ("a_y", "yaw_rate"), TURNING])
def test_the_course_of_a_slow_gnss_names_what_is_turned_without_wheels(slow, turned):
    """Positions of 1 Hz or 10 Hz, to 0.1 m, joined by straight lines."""
    t = np.arange(DRIVE["v_x"].size) * DT
    own = np.arange(0.0, t[-1], slow)
    joined = {s: np.interp(t, own, np.round(np.interp(own, t, DRIVE[s]), 6)) for s in PLACE}
    assert said({**DRIVE, **joined}, drop=WHEELS, turned=turned) == [((s,), (line(s),)) for s in sorted(turned)]


@pytest.mark.parametrize(
    "how",
    [
        {"turning": 0.0005, "accelerating": 0.02},  # straight on, at one speed
        {"seconds": 25.0},
        {"bank": 0.9}, {"bank": 2.0, "one_way": True, "turning": 0.03},
        {"stops": 3}, {"v": 6.0, "seconds": 60.0},
    ],
)  # fmt: skip
@pytest.mark.parametrize("seed", range(3))
def test_sound_drives_have_no_remark(how, seed):
    assert look(signals(made(seed=seed, **how)), CAR) == ()


def test_too_little_driving_is_not_judged():
    assert said(made(seconds=600.0, turning=0.002, accelerating=0.02), turned=("a_x", "yaw_rate")) == []


def test_a_driver_who_steers_against_a_slide_has_no_turned_steering():
    """Braking on snow: the axles slip, and the steering follows the yaw rate with the opposite sign."""
    slides = {n: x * (1.08 if n in ("omega_fl", "omega_fr") else 1.0) for n, x in DRIVE.items()}
    assert said({**slides, "steer_angle": -0.1 * DRIVE["yaw_rate"]}) == []


def test_wheels_that_stand_and_spin_on_water_do_not_put_the_accelerometer_in_doubt():
    wet = np.arange(DRIVE["v_x"].size) > 0.3 * DRIVE["v_x"].size
    spinning = 1.5 + np.clip(smooth(np.random.default_rng(5), wet.size, 6.0, 1.0), -1.0, 3.0)
    factor = {"f": np.where(wet, 0.0, 1.0), "r": np.where(wet, spinning, 1.0)}
    wheels = {f"omega_{w}": DRIVE[f"omega_{w}"] * factor[w[0]] for w in ("fl", "fr", "rl", "rr")}
    assert not [r for r in look(signals(DRIVE | wheels), CAR) if "a_x" in r.signals]


def test_radii_that_differ_are_no_turning_on_a_straight_road():
    """Where the speed changes, two thousandths between left and right look like curves, front and rear apart."""
    rng = np.random.default_rng(5)
    v = 25.0 + smooth(rng, 12_000, 4.0, 5.0)
    straight = {"t": np.arange(v.size) * DT, "v_x": v, "a_x": np.gradient(v, DT)}
    straight["a_y"] = 0.02 * rng.standard_normal(v.size)
    for name, share in zip(WHEELS, (0.0, 0.002, 0.002, 0.0), strict=True):
        straight[name] = v * (1.0 + share) / CAR.r_e(name[-2:]) + 0.01 * rng.standard_normal(v.size)
    assert said(straight) == []
