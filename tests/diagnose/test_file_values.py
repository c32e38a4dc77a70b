"""How far the values of a vehicle file may be off, in the parameters of the effects that change them."""

from dataclasses import replace

import pytest

from aqualog.core.provenance import uncertainty
from aqualog.core.vehicle import KEYS, Provenance, Vehicle
from aqualog.diagnose.file_values import calibrated_enough, day_to_day, deviation, key_of, not_calibrated
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.model.effects import EFFECTS

CAR = replace(
    Vehicle(), mass=1400.0, torque_gain=0.8, r_e_f=0.35, slip_slope_r=25.0, inertia_r=2.2,
    given=frozenset({"mass", "torque_gain", "wheels.r_e_f", "wheels.r_e_r", "drag_area"}),
    provenance={
        "mass": Provenance("measured"), "torque_gain": Provenance("calibrated", 0.012),
        "wheels.r_e_f": Provenance("calibrated", 0.00014), "drag_area": Provenance("calibrated"),
    },
)  # fmt: skip


def of(name, where=None, parameter=None, car=CAR):
    parameter = parameter or EFFECTS[name].parameters[0].name
    return deviation(Hypothesis(EFFECTS[name], where, (parameter,)), parameter, car)


@pytest.mark.parametrize(
    ("name", "where", "sd"),
    [
        ("payload_mass", None, 0.0),  # bound by the gain that drives have calibrated
        ("torque_gain", None, 0.0),
        ("aero_drag", None, 0.04 * 0.66),  # [m^2]
        ("rolling_resistance", None, 0.3 * 0.0105),  # not set: a guess; the sum of two coefficients is no share
        ("rolling_resistance", "f", 0.0),
        ("tyre_radius", "f", 0.0004),
        ("tyre_radius", "r", 0.01),  # set, without a word: a data sheet
        ("tyre_radius", None, 0.0),
        ("tyre_radius", "fl", 0.0),  # a file has one radius an axle
        ("wheel_inertia", "r", 0.3 * 2.2),  # [kg*m^2]
        ("slip_stiffness", "r", 0.25),
        ("head_wind", None, 0.0),
        ("road_grade", None, 0.0),
        ("trailer", None, 0.0),
        ("brake_drag", None, 0.0),
        ("signal_delay", "torque", 0.0),
        ("velocity_scale", "v_x", 0.0),
        ("pressure_loss", "f", 0.0),
    ],
)
def test_deviation_in_the_unit_of_the_effect(name, where, sd):
    assert of(name, where) == pytest.approx(sd, rel=1e-9)


@pytest.mark.parametrize(
    ("mass", "gain", "of_mass", "of_gain"),
    [
        ("measured", "guess", 10.0, 0.2), ("data_sheet", "data_sheet", 42.0, 0.05), ("calibrated", "guess", 0.0, 0.0),
        ("measured", "calibrated", 0.0, 0.0), ("data_sheet", "calibrated", 42.0, 0.01),  # no drive has seen such a mass
        ("guess", "calibrated", 112.0, 0.01), ("guess", "guess", 112.0, 0.2),
    ],
)  # fmt: skip
def test_mass_and_gain_are_sure_as_a_ratio_once_drives_have_shown_it(mass, gain, of_mass, of_gain):
    car = replace(CAR, provenance={"mass": Provenance(mass), "torque_gain": Provenance(gain)})
    assert of("payload_mass", car=car) == pytest.approx(of_mass)
    assert of("payload_mass", "r", car=car) == 0.0  # the same key, counted once
    assert of("torque_gain", car=car) == pytest.approx(of_gain)  # on top of the file's


def test_each_key_of_a_row_exists_and_counts_at_one_place():
    """A new effect is one row: the name of its key stands in it, and the unit says whether it is a share."""
    found = []
    for effect in EFFECTS.values():
        for p in effect.parameters:
            places = dict.fromkeys((None, *effect.places))
            keys = [key_of(Hypothesis(effect, where, (p.name,)), p.name) for where in places]
            found += [k for k in keys if k]
    assert sorted(found) == sorted(set(found))
    assert set(found) == {
        "mass", "torque_gain", "drag_area", "rolling_resistance",
        *(f"{start}_{axle}" for start in ("wheels.r_e", "wheels.inertia", "tyre.slip_slope") for axle in "fr"),
    }  # fmt: skip
    assert set(found) <= set(KEYS)


def test_a_second_parameter_has_no_key():
    radius = EFFECTS["tyre_radius"]
    more = replace(radius, parameters=(*radius.parameters, replace(radius.parameters[0], name="other")))
    assert [key_of(Hypothesis(more, "f", (n,)), n) for n in ("delta", "other")] == ["wheels.r_e_f", ""]


def test_a_value_that_is_said_to_be_surer_deviates_less():
    for source in ("data_sheet", "calibrated"):
        car = replace(CAR, provenance={"wheels.r_e_f": Provenance(source)})
        assert of("tyre_radius", "f", car=car) == pytest.approx(uncertainty(car, "wheels.r_e_f") / 0.35)
    silent = replace(CAR, provenance={})  # a file that says nothing of its values is taken at its word
    assert of("aero_drag", car=silent) == 0.0
    lean = replace(silent, given=frozenset({"drivetrain", "mass"}))
    assert of("aero_drag", car=lean) == of("torque_gain", car=lean) == 0.0  # a load must not pass for the gain
    assert of("tyre_radius", "f", car=lean) > 0.0
    lost = replace(CAR, given=CAR.given - {"wheels.r_e_f"})  # as where wheel speeds are logged in km/h
    assert of("tyre_radius", "f", car=lost) == pytest.approx(0.015)


EVERY = ("force_balance", "kinematic", "slip_fl")


def test_what_to_calibrate_first():
    assert calibrated_enough(CAR) == ()
    assert not_calibrated(CAR, EVERY) == ""
    by_hand = replace(CAR, provenance={}, given=CAR.given - {"torque_gain"})
    assert calibrated_enough(by_hand) == ("torque_gain",)
    assert not_calibrated(by_hand, EVERY) == (
        "This vehicle file was not calibrated: it does not say where its values come from, so they count as exact; run "
        "`aqualog calibrate` on four or more dry drives, best with the weighed mass (--fix mass=...)."
    )
    weighed = replace(by_hand, provenance={"mass": Provenance("measured"), "wheels.r_e_f": Provenance("guess")})
    assert not_calibrated(weighed, EVERY) == (
        "This vehicle file was not calibrated: torque_gain and wheels.r_e_f are guesses; run `aqualog calibrate` on "
        "four or more dry drives."
    )
    assert "torque_gain" not in not_calibrated(weighed, ("kinematic", "slip_fl"))  # no torque: it does not matter
    assert not_calibrated(by_hand, ("kinematic", "slip_fl")) == ""
    bound = replace(by_hand, provenance={"mass": Provenance("calibrated"), "torque_gain": Provenance("guess", 0.02)})
    assert calibrated_enough(bound) == ()  # the drives have shown the ratio of both
    assert calibrated_enough(Vehicle()) == ("mass", "torque_gain", "wheels.r_e_f", "wheels.r_e_r")


def test_a_load_of_one_drive_looks_like_the_error_of_its_torque():
    own = replace(Hypothesis(EFFECTS["payload_mass"], None, ("delta_mass",)), drive="b.mf4")
    assert day_to_day(own, "delta_mass", CAR) == pytest.approx(14.0)
    scattered = replace(CAR, spread={"torque_gain": 0.024, "mass": 56.0})
    assert day_to_day(own, "delta_mass", scattered) == pytest.approx(70.0)
    assert day_to_day(replace(own, drive=""), "delta_mass", scattered) == 56.0
