"""What a model's terms change for the detectors, on simulated dry drives with perfect sensors."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from aqualog.core.errors import ConfigError
from aqualog.core.notation import WHEELS
from aqualog.core.vehicle import KEYS, Vehicle
from aqualog.detect.stream import detect_drive
from aqualog.diagnose.extended import extended_inputs
from aqualog.model.effects import EFFECTS, EMPIRICAL
from aqualog.model.log import as_signals
from aqualog.model.scenario import Scenario, Steering
from aqualog.model.sensors import ESC, IDEAL, Sensors
from aqualog.model.simulate import simulate
from aqualog.model.term import Model, Term

CAR = Vehicle(name="car", drivetrain="awd", torque_split_rear=0.6, given=frozenset({"drivetrain", *KEYS}))
SPEED = ((0.0, 18.0), (5.0, 18.0), (12.0, 34.0), (20.0, 34.0), (28.0, 20.0), (35.0, 20.0))


def model(effect, where=None, **values):
    return Model((Term(EFFECTS[effect], values, where),))


def drive(m, sensors=IDEAL, **kw):
    scenario = Scenario(CAR, duration_s=35.0, speed=SPEED, sensors=sensors, **kw)
    return as_signals(simulate(scenario, m), vehicle=CAR)


def feature(signals, vehicle, name="delta_a_x"):
    return detect_drive(signals, vehicle).features[name].to_numpy()[100:-50]


@pytest.fixture(scope="module")
def base():
    return drive(Model())


NEUTRAL = [
    Model(),
    Model(tuple(Term(e) for e in (*EFFECTS.values(), *EMPIRICAL.values()))),
    model("payload_mass", delta_mass=0.0),
    Model((Term(EMPIRICAL["unexplained_force"], {}, None, ((10.0, 0.0), (30.0, 0.0))),)),
    model("torque_gain", gain=1.0),
    model("signal_delay", delay=0.0),
]


@pytest.mark.parametrize("m", NEUTRAL)
def test_a_neutral_model_leaves_the_very_inputs(base, m):
    extended = extended_inputs(base, CAR, m)
    assert extended.signals is base
    assert extended.vehicle is CAR
    assert extended.notes == ()


# what the balance of forces shows of a hidden effect, and what is left of it with the model
BALANCE = [
    ("payload_mass", None, {"delta_mass": 250.0}),
    ("payload_mass", "r", {"delta_mass": 250.0}),
    ("payload_mass", "f", {"delta_mass": -120.0}),
    ("aero_drag", None, {"delta_drag_area": 0.3}),
    ("rolling_resistance", None, {"delta_r_w": 0.01}),
    ("rolling_resistance", "rl", {"delta_r_w": 0.03}),
    ("brake_drag", "fl", {"torque": 60.0}),
    ("brake_drag", None, {"torque": 20.0}),
    ("torque_gain", None, {"gain": 0.88}),
    ("torque_gain", "f", {"gain": 0.8}),
    ("tyre_radius", "f", {"delta": -0.05}),
    ("tyre_radius", "rl", {"delta": -0.08}),
    ("wheel_inertia", "r", {"delta_inertia": 6.0}),
    ("head_wind", None, {"speed": 6.0}),
    ("head_wind", None, {"speed": -6.0}),
    ("trailer", None, {"mass": 700.0, "delta_drag_area": 0.6}),
    ("tyre_warmup", None, {"extra": 0.9, "time_constant": 30.0}),
    ("accelerometer_gain", "a_x", {"gain": 0.9}),
    ("accelerometer_bias", "a_x", {"bias": 0.3}),
    ("accelerometer_drift", "a_x", {"drift": 0.01}),
    ("signal_delay", "a_x", {"delay": 0.2}),
    ("signal_delay", "torque", {"delay": -0.2}),
]


@pytest.mark.parametrize(("effect", "where", "values"), BALANCE)
def test_a_known_effect_leaves_the_balance_of_forces(base, effect, where, values):
    m = model(effect, where, **values)
    hidden = drive(m)
    clean = feature(base, CAR)
    extended = extended_inputs(hidden, CAR, m)
    assert extended.notes == ()
    off = np.nanmean(np.abs(feature(hidden, CAR) - clean))
    left = np.nanmean(np.abs(feature(extended.signals, extended.vehicle) - clean))
    assert off > 0.01
    assert left < 0.15 * off


def test_a_force_over_speed_leaves_the_balance_of_forces(base):
    knots = ((15.0, 0.0), (25.0, 300.0), (35.0, 100.0))
    m = Model((Term(EMPIRICAL["unexplained_force"], {}, None, knots),))
    hidden = drive(m)
    clean = feature(base, CAR)
    extended = extended_inputs(hidden, CAR, m)
    off = np.nanmean(np.abs(feature(hidden, CAR) - clean))
    left = np.nanmean(np.abs(feature(extended.signals, extended.vehicle) - clean))
    assert off > 0.05
    assert left < 0.15 * off


@pytest.mark.parametrize(
    ("effect", "where", "values"),
    [("cornering_drag", None, {"coefficient": 0.03}), ("accelerometer_position", "a_x", {"ahead": -2.0})],
)
def test_curves_cost_and_show_what_the_model_says(effect, where, values):
    m = model(effect, where, **values)
    given = {"steering": Steering(0.03, 6.0)}
    clean, hidden = drive(Model(), **given), drive(m, **given)
    extended = extended_inputs(hidden, CAR, m)
    off = np.nanmean(np.abs(feature(hidden, CAR) - feature(clean, CAR)))
    left = np.nanmean(np.abs(feature(extended.signals, extended.vehicle) - feature(clean, CAR)))
    assert off > 0.02
    assert left < 0.2 * off


@pytest.mark.parametrize(
    ("effect", "where", "values"),
    [
        ("tyre_radius", "fl", {"delta": -0.02}),
        ("tyre_radius", "r", {"delta": 0.02}),
        ("tyre_radius_growth", "left", {"growth": 2e-5}),
        ("pressure_loss", "rr", {"radius": 0.05, "start": 8.0, "duration": 5.0}),
        ("signal_delay", "omega", {"delay": 0.3}),
    ],
)
def test_rim_speeds_are_those_of_the_file(base, effect, where, values):
    m = model(effect, where, **values)
    hidden = drive(m)
    e = extended_inputs(hidden, CAR, m)
    v = hidden.array("v_x")[100:-50]
    most = 0.0
    for w in WHEELS:
        clean = base.array(f"omega_{w}")[100:-50] * CAR.r_e(w) - base.array("v_x")[100:-50]
        off = hidden.array(f"omega_{w}")[100:-50] * CAR.r_e(w) - v
        left = e.signals.array(f"omega_{w}")[100:-50] * e.vehicle.r_e(w) - v
        assert np.nanmax(np.abs(left - clean)) < 0.02
        most = max(most, np.nanmax(np.abs(off - clean)))
    assert most > 0.1


@pytest.mark.parametrize(
    ("m", "name"),
    [
        (model("velocity_scale", scale=1.02), "v_x"),
        (model("signal_delay", delay=0.3), "v_x"),
        (model("clock_skew", skew=1e4), "v_x"),
        (model("accelerometer_bias", "a_y", bias=0.2), "a_y"),
        (model("signal_delay", "torque_rl", delay=0.5), "torque_rl"),
    ],
)
def test_a_sensor_error_is_taken_off_its_signal_alone(m, name):
    one_bus = Sensors("perfect, on the buses of a series car", ESC.groups)
    base, hidden = drive(Model(), one_bus), drive(m, one_bus)
    e = extended_inputs(hidden, CAR, m)
    n = min(base.frame.height, e.signals.frame.height)
    clean, off, left = (s.array(name)[:n] for s in (base, hidden, e.signals))
    known = np.isfinite(clean) & np.isfinite(left) & np.isfinite(off)
    assert known.mean() > 0.9
    off, left = (np.abs(x[known] - clean[known]).mean() for x in (off, left))
    assert left < 0.15 * off
    for other in set(hidden.symbols) - {name}:
        assert np.array_equal(e.signals.array(other), hidden.array(other), equal_nan=True)
    assert e.vehicle is CAR


def test_a_delayed_signal_ends_unknown(base):
    e = extended_inputs(base, CAR, model("signal_delay", "a_x", delay=0.5))
    x = e.signals.array("a_x")
    assert np.isnan(x[-50:]).all()
    assert np.array_equal(x[:-50], base.array("a_x")[50:])
    assert e.signals.frame["a_x"].null_count() == 50


def test_slip_slopes_keep_their_ratio_to_the_file(base):
    e = extended_inputs(base, CAR, model("slip_stiffness", "f", gain=0.8))
    assert e.vehicle.slip_slope_f == pytest.approx(0.8 * CAR.slip_slope_f, rel=1e-12)
    assert e.vehicle.slip_slope_r == CAR.slip_slope_r
    one = extended_inputs(base, CAR, model("slip_stiffness", "fl", gain=0.8))
    assert one.vehicle.slip_slope_f == pytest.approx(0.9 * CAR.slip_slope_f, rel=1e-12)
    assert one.notes == ("model: slip_slope of the front axle is the mean of its wheels",)


def test_a_torque_pulls_at_the_radius_of_its_wheel(base):
    e = extended_inputs(base, CAR, model("tyre_radius", "rl", delta=-0.08))
    for w, radius in (("rl", 0.92 * CAR.r_e_r), ("rr", CAR.r_e_r), ("fl", CAR.r_e_f)):
        force, expected = e.signals.array(f"torque_{w}") / e.vehicle.arm(w), base.array(f"torque_{w}") / radius
        assert force == pytest.approx(expected, rel=1e-12)


def test_payload_moves_the_centre_of_mass(base):
    e = extended_inputs(base, CAR, model("payload_mass", "r", delta_mass=200.0))
    assert e.vehicle.mass == CAR.mass + 200.0
    assert e.vehicle.l_f * e.vehicle.mass == pytest.approx(CAR.l_f * CAR.mass + 200.0 * CAR.wheelbase)
    assert e.vehicle.wheelbase == pytest.approx(CAR.wheelbase)
    assert e.signals is base


@pytest.mark.parametrize(
    ("m", "told"),
    [
        (model("road_grade", grade=0.03), "road_grade: no detector uses this quantity"),
        (model("water_drag", gain=1.5), "water_drag: no detector uses this quantity"),
        (model("uneven_water", depth_gain=0.5), "uneven_water at left: no detector uses this quantity"),
        (model("tone_ring", amplitude=0.01), "tone_ring: no detector uses this quantity"),
        (model("relaxation_length", length=0.3), "relaxation_length: no detector uses this quantity"),
        (model("signal_delay", "steer_angle", delay=0.1), "signal_delay at steer_angle: the log has no steer_angle"),
        (model("pressure_loss", "fl", radius=0.01, slope=0.1), "pressure_loss at fl: used without leak_slope"),
    ],
)
def test_what_is_not_used_is_told(base, m, told):
    without = pl.Series("steer_angle", [None] * base.frame.height, dtype=pl.Float64)
    log = replace(base, frame=base.frame.with_columns(without))
    e = extended_inputs(log, CAR, m)
    assert [n for n in e.notes if told in n], e.notes
    if "used without" not in told:
        assert e.signals is log
        assert e.vehicle is CAR


def test_a_force_needs_the_accelerometer(base):
    log = replace(base, frame=base.frame.drop("a_x"))
    e = extended_inputs(log, CAR, model("head_wind", speed=5.0))
    assert e.notes == ("model: the log has no a_x; head_wind not used",)
    assert e.signals is log


def test_a_car_beyond_a_vehicle_file_is_refused(base):
    with pytest.raises(ConfigError, match="rolling_resistance"):
        extended_inputs(base, CAR, model("rolling_resistance", delta_r_w=-0.01, where=None).with_term(
            Term(EFFECTS["brake_drag"], {"torque": -5.0})
        ))  # fmt: skip


def test_every_effect_is_used_or_told(base):
    for effect in EFFECTS.values():
        for where in effect.places or (None,):
            first = effect.parameters[0]
            values = {first.name: first.neutral + 0.5 * first.sigma}
            e = extended_inputs(base, CAR, Model((Term(effect, values, where),)))
            assert e.notes or e.signals is not base or e.vehicle is not CAR, (effect.name, where)
