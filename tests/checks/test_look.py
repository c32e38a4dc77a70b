"""Wrong units and signs are told."""

import re
from dataclasses import replace

import polars as pl
import pytest

from aqualog.checks.look import look
from aqualog.core.records import Origin
from aqualog.detect.stream import detect_drive
from aqualog.report.drive.judged import headline
from tests.checks.made import CAR as MADE
from tests.checks.made import made, signals
from tests.drives import CAR, drive

SPEEDS = {"speed_kmh": ((0.0, 70.0), (10, 110.0), (20, 70.0), (30, 120.0), (40, 80.0)), "duration_s": 40.0}
CURVES = {"yaw_rate": ((0, 0), (6, 0), (8, 0.2), (14, -0.2), (20, 0.2), (30, -0.2), (40, 0))}


KNOWN = replace(CAR, given=CAR.given | {"tyre.slip_slope_r"})  # its dry slope, so that no remark asks for it


def notes(car=KNOWN, **changes):
    signals, _ = drive(CAR, **SPEEDS, **CURVES)
    frame = signals.frame.with_columns(**{n: f(signals.frame) for n, f in changes.items()})
    return detect_drive(type(signals)(frame, signals.dt_ns, None, {}, signals.quality, ()), car).notes


def test_a_sound_drive_has_no_note():
    assert notes() == ()


@pytest.mark.parametrize("left_out", [19, 81])
def test_a_signal_much_of_which_no_car_can_have(left_out):
    origin = Origin("omega_fl", "w", "a.csv", "rad/s", 20.0, 100, out_of_range=left_out)
    found = look(signals(made(), origins={"omega_fl": origin}), MADE)
    assert [(r.kind, r.signals, r.value) for r in found] == [("channel", ("omega_fl",), 0.81)] * (left_out > 20)


@pytest.mark.parametrize("factor", [3.6, 1 / 3.6])
def test_unit_of_the_wheel_speeds(factor):
    found = notes(**{f"omega_{w}": lambda f, w=w: f[f"omega_{w}"] * factor for w in ("fl", "fr", "rl", "rr")})
    assert any("wheel speeds change" in n for n in found)


@pytest.mark.parametrize("factor", [3.6, 1 / 3.6, 1 / 0.316])
def test_wheel_speeds_against_the_reference(factor):
    (found,) = (n for n in notes(v_x=lambda f: f["v_x"] / factor) if "v_x" in n)
    ratio = re.match(r"wheel speeds times radius are (\S+) .*times v_x", found)[1]
    assert float(ratio) == pytest.approx(factor, rel=0.01)


def test_one_wheel_in_another_unit():
    (found,) = (n for n in notes(omega_rr=lambda f: f["omega_rr"] * 3.6) if "other wheels" in n)
    assert found.startswith("omega_rr is 3.6 (km/h read as m/s?) times the speed of the other wheels")


def test_drivetrain_against_the_torques():
    """A vehicle file of another car: the free axle is driven, or a driven one never is."""
    pushed = {f"torque_f{s}": lambda f: f["torque_rl"] for s in "lr"}
    (found,) = (n for n in notes(**pushed) if "vehicle file says" in n)
    assert "says rwd, but the front wheels are driven" in found
    assert 'drivetrain = "awd"' in found
    awd = replace(KNOWN, drivetrain="awd", torque_split_rear=0.5, given=KNOWN.given | {"tyre.slip_slope_f"})
    still = {f"torque_f{s}": lambda f: f["torque_rl"] * 0.0 for s in "lr"}
    (found,) = (n for n in notes(awd, **still) if "vehicle file says" in n)
    assert 'drivetrain = "rwd"' in found
    assert not [n for n in notes(awd, **pushed) if "vehicle file says" in n]


def test_a_drive_that_is_its_own_reference_says_so():
    assert any("is this drive's own" in n for n in notes(CAR))


def test_sign_of_the_accelerometer():
    assert any("a_x has the opposite sign" in n for n in notes(a_x=lambda f: -f["a_x"]))
    signals, _ = drive(CAR, **SPEEDS)
    turned = replace(signals, frame=signals.frame.with_columns(-pl.col("a_x")))
    looks = [detect_drive(turned, CAR, is_checked=x) for x in (True, False)]
    assert [bool(d.checks) for d in looks] == [True, False]
    assert [e.start_s for e in looks[0].events] == [e.start_s for e in looks[1].events]


def test_sign_of_the_yaw_rate():
    assert any("yaw_rate has the opposite sign" in n for n in notes(yaw_rate=lambda f: -f["yaw_rate"]))


def test_resistance_that_cannot_be():
    found = notes(torque_rl=lambda f: f["torque_rl"] * 9.1, torque_rr=lambda f: f["torque_rr"] * 9.1)
    assert any("resistance measure" in n for n in found)


def test_without_an_accelerometer_nothing_is_said():
    found = notes(a_x=lambda f: pl.Series([None] * f.height, dtype=pl.Float64))
    assert not [n for n in found if "a_x" in n]


@pytest.mark.parametrize(("force", "verdict"), [(1.5, "none"), (5.0, "cannot_be_judged")])
def test_a_resistance_that_no_water_makes_is_no_water(force, verdict):
    """A torque with a part that no road holds back, as an engine's times one gear ratio has it."""
    signals, _ = drive(CAR, **SPEEDS, **CURVES)
    more = 0.5 * force * CAR.mass * CAR.r_l_r
    frame = signals.frame.with_columns(pl.col("torque_rl", "torque_rr") + more)
    found = detect_drive(type(signals)(frame, signals.dt_ns, None, {}, signals.quality, ()), KNOWN)
    assert any(n.startswith("the resistance measure lies at +") for n in found.notes)
    assert found.judgement.verdict == verdict
    if verdict == "cannot_be_judged":
        assert headline(found.judgement).endswith("no wheel torque that fits mass and acceleration")
