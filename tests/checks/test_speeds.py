"""Scales of speeds: one wheel against the others, wheels against v_x; the unit that was mistaken is named."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.checks.look import look
from aqualog.core.records import Origin
from tests.checks.made import CAR, made, signals

DRIVE = made(stops=1)


def said(**factors):
    return [r for r in look(signals({n: x * factors.get(n, 1.0) for n, x in DRIVE.items()}), CAR) if r.kind == "scale"]


@pytest.mark.filterwarnings("error")
def test_small_differences_of_radii_and_what_never_moves_are_no_fault():
    assert said(a_x=1e-200) == []
    assert said(omega_fl=1.03, omega_rr=0.97, v_x=1.02) == []


def test_a_tyre_of_another_size():
    (remark,) = said(omega_rr=1.08)
    assert remark.what.startswith("omega_rr is 1.08 times the speed of the other wheels")
    (line,) = remark.lines
    assert float(line.split("scale = ")[1].rstrip(" }")) == pytest.approx(1 / 1.08, rel=0.01)


@pytest.mark.parametrize(
    ("factor", "unit"),
    [
        (3.6, "km/h read as m/s"), (1 / 3.6, "m/s read as km/h"), (2.237, "mph read as m/s"),
        (1 / 2.237, "m/s read as mph"), (1.609, "km/h read as mph"), (1 / 1.609, "mph read as km/h"), (1.1, ""),
    ],
)  # fmt: skip
def test_wheels_against_the_velocity(factor, unit):
    (remark,) = said(v_x=1.0 / factor)
    assert remark.value == pytest.approx(factor, rel=0.02)
    assert f"are {remark.value:.3g}" in remark.what
    assert f"({unit}?)" in remark.what if unit else "?" not in remark.what
    assert len(remark.lines) == 5
    assert " or " in remark.advice
    assert float(remark.lines[0].split("scale = ")[1].rstrip(" }")) == pytest.approx(factor, rel=0.02)


def test_wheels_that_slip_for_most_of_the_time_have_no_other_scale():
    """Snow: the driven wheels are faster, but not always by the same share."""
    rng = np.random.default_rng(1)
    slip = 1.0 + np.repeat(rng.uniform(0.0, 0.3, DRIVE["v_x"].size // 200), 200)
    columns = {n: x * slip if n in ("omega_rl", "omega_rr") else x for n, x in DRIVE.items()}
    assert not [r for r in look(signals(columns), CAR) if r.kind == "scale"]


def origins(**units):
    """Signals from channels with these units; `mapped` ones have the unit in the map."""
    wheels = {f"omega_{w}": units.get("wheels", "rad/s") for w in ("fl", "fr", "rl", "rr")}
    return {
        s: Origin(s, s.upper(), "a.mf4", u, 20.0, 1, mapped={"channel": [s.upper()], "unit": u})
        for s, u in {"v_x": "m/s", "a_x": "m/s^2", **wheels, **units}.items() if s in DRIVE
    }  # fmt: skip


def lines(factors, **units):
    own = {n: x * factors.get(n[:5], factors.get(n, 1.0)) for n, x in DRIVE.items()}
    remarks = [r for r in look(signals(own, origins=origins(**units)), CAR) if r.kind == "scale"]
    return tuple(line for r in remarks for line in r.lines)


@pytest.mark.parametrize(
    ("true", "taken", "size"),
    [("m/s", "km/h", 3.6), ("km/h", "m/s", 1 / 3.6), ("mph", "m/s", 0.44704), ("mph", "km/h", 1.609), ("km/h", "mph", 1 / 1.609)],
)  # fmt: skip
def test_the_right_unit_of_the_velocity_is_proposed(true, taken, size):
    """A factor alone would keep the wrong unit; wheels in rad/s cannot be wrong by it."""
    assert lines({"v_x": 1.0 / size}, v_x=taken) == (f'v_x = {{ channel = "V_X", unit = "{true}" }}',)


@pytest.mark.parametrize(
    ("true", "taken", "size"),
    [("km/h", "m/s", 3.6), ("rad/s", "m/s", 1.0 / CAR.r_e("fl")), ("rpm", "rad/s", 60.0 / (2.0 * np.pi)),
     ("rad/s", "deg/s", np.pi / 180.0)],
)  # fmt: skip
def test_the_right_unit_of_the_wheels_is_proposed(true, taken, size):
    found = lines({"omega": size}, wheels=taken)
    assert [line for line in found if "omega" in line] == [
        f'omega_{w} = {{ channel = "OMEGA_{w.upper()}", unit = "{true}" }}' for w in ("fl", "fr", "rl", "rr")
    ]  # fmt: skip


def test_both_may_be_in_the_wrong_unit():
    found = lines({"v_x": 1.0 / 3.6}, v_x="km/h", wheels="m/s")
    assert found[0] == 'v_x = { channel = "V_X", unit = "m/s" }'
    assert found[1] == 'omega_fl = { channel = "OMEGA_FL", unit = "km/h" }'
    assert len(found) == 5


def test_one_wheel_in_another_unit():
    assert lines({"omega_rr": 3.6}, wheels="m/s") == ('omega_rr = { channel = "OMEGA_RR", unit = "km/h" }',)


def test_a_factor_that_no_unit_explains_stays_one():
    (line,) = lines({"omega_rr": 1.08}, wheels="m/s")
    assert 'unit = "m/s", scale = 0.92' in line


@pytest.mark.parametrize(("true", "taken", "size"), [("g", "m/s^2", 1 / 9.80665), ("m/s^2", "g", 9.80665)])
def test_the_right_unit_of_the_acceleration_is_proposed(true, taken, size):
    assert lines({"a_x": size}, a_x=taken) == (f'a_x = {{ channel = "A_X", unit = "{true}" }}',)


@pytest.mark.parametrize("times", [0.1, 0.5, 2.0, 10.0])
def test_time_that_runs_at_another_rate(times):
    rng = np.random.default_rng(2)
    noisy = {n: x + (0.1 if n == "a_x" else 0.02) * rng.standard_normal(x.size) for n, x in DRIVE.items()}
    drive = signals(noisy)
    drive = replace(drive, dt_ns=round(drive.dt_ns * times))
    (remark,) = (r for r in look(drive, CAR) if r.kind == "scale")
    assert remark.value == pytest.approx(1.0 / times, rel=0.45)
    assert remark.advice.endswith("and of the time stamps")


def axle(axle, r_e, *, unit="rad/s", mapped=None, without=()):
    """A drive whose wheels of one axle have this radius in the vehicle file, not their own."""
    own = {n: x for n, x in DRIVE.items() if n not in without}
    known = {
        s: replace(o, unit=unit, mapped={"channel": [s], **({"unit": mapped} if mapped else {})})
        if s.startswith("omega")
        else o
        for s, o in origins().items()
    }
    return [r for r in look(signals(own, origins=known), replace(CAR, **{f"r_e_{axle}": r_e})) if r.kind == "scale"]


@pytest.mark.parametrize("side", ["f", "r"])
@pytest.mark.parametrize("r_e", [0.25, 0.28, 0.37])
def test_an_axle_that_is_off_by_its_radius(side, r_e):
    """At 0.25 m km/h would explain the factor, too, but the log declares rad/s."""
    (remark,) = axle(side, r_e)
    assert remark.what.startswith(
        f"both {'front' if side == 'f' else 'rear'} wheels are {r_e / CAR.r_e(side + 'l'):.2f}"[:-1]
    )
    assert (
        remark.advice
        == f"check the rolling radius in the vehicle file: r_e_{side} = {CAR.r_e(side + 'l'):.3f} fits, under [wheels]"
    )
    assert remark.lines == ()


def test_without_a_velocity_either_axle_may_be_off():
    (remark,) = axle("f", 0.25, without=("v_x",))
    assert f"r_e_f = {CAR.r_e('fl'):.3f} or r_e_r = 0.25" in remark.advice


def test_a_radius_does_not_move_speeds_at_the_rim_nor_explain_another_unit():
    own = {n: x * (1.1 if n in ("omega_fl", "omega_fr") else 1.0) for n, x in DRIVE.items()}
    (remark,) = (r for r in look(signals(own, origins=origins(wheels="m/s")), CAR) if r.kind == "scale")
    assert "r_e" not in remark.advice
    assert len(remark.lines) == 2
    found = lines({"omega_rl": 9.5493, "omega_rr": 9.5493}, wheels="rad/s")
    assert [line for line in found if 'unit = "rpm"' in line]
