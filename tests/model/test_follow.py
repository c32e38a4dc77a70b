"""The simulation led along a drive: it gives the drive back, and what sensors did to its inputs is undone."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.core.errors import ConfigError
from aqualog.core.notation import WHEELS
from aqualog.core.vehicle import Vehicle
from aqualog.model import kernel, state
from aqualog.model.effects import EFFECTS, EMPIRICAL
from aqualog.model.follow import Course, follow, replay
from aqualog.model.plant import build_plant
from aqualog.model.road import build_road
from aqualog.model.scenario import Scenario
from aqualog.model.sensors import IDEAL
from aqualog.model.simulate import assemble, drive_truth, simulate
from aqualog.model.state import rolling_state
from aqualog.model.term import Model, Term
from aqualog.model.tyre import TYRES
from aqualog.physics.load import G
from tests.thesis.passes import SEDAN

CAR = Vehicle(name="test car")
SPEED = ((0.0, 18.0), (5.0, 18.0), (15.0, 26.0), (25.0, 26.0), (45.0, 20.0), (60.0, 28.0))
INSIDE = slice(300, -100)  # the first steps settle


def drive(*terms, **kw):
    scenario = Scenario(CAR, speed=SPEED, duration_s=60.0, sensors=IDEAL, **kw)
    made = simulate(scenario, Model(terms))
    columns = next(m for m in made.measured if m.name == "signals")
    return columns.t, columns.columns


def course(t, c, v=None):
    return Course(t, np.array([c[f"torque_{w}"] for w in WHEELS]), c["steer_angle"], c["v_x"] if v is None else v)


def term(name, where=None, **values):
    return Term(EFFECTS[name], values, where)


@pytest.fixture(scope="module")
def made():
    return drive()


def test_a_drive_is_given_back_in_all_channels(made):
    t, c = made
    shown = follow(CAR, course(t, c), Model())
    for name, atol in (("v_x", 0.01), ("a_x", 0.02), ("a_y", 1e-6), ("yaw_rate", 1e-6)):
        np.testing.assert_allclose(shown[name][INSIDE], c[name][INSIDE], atol=atol, err_msg=name)
    for w in WHEELS:
        np.testing.assert_allclose(shown[f"omega_{w}"][INSIDE], c[f"omega_{w}"][INSIDE], atol=0.04)
        # between samples of 10 ms the led torque is a straight line
        np.testing.assert_allclose(shown[f"torque_{w}"][INSIDE], c[f"torque_{w}"][INSIDE], atol=1.0)
    assert np.abs(shown["nudge"][INSIDE]).max() < 0.005


def test_running_free_the_speed_stays_with_the_measured_one(made):
    t, c = made
    shown = follow(CAR, course(t, c), Model(), rate=0.0)
    assert np.all(shown["nudge"] == 0.0)
    assert np.abs(shown["v_x"] - c["v_x"]).max() < 0.15


def test_a_wrong_mass_runs_away_free_and_is_drawn_back_nudged(made):
    t, c = made
    heavy = Model((term("payload_mass", delta_mass=300.0),))
    free, led = (np.abs(follow(CAR, course(t, c), heavy, rate=r)["v_x"] - c["v_x"]).max() for r in (0.0, 0.3))
    assert free > 1.0
    assert led < 0.4 * free


def test_the_nudge_is_rate_times_what_is_missing(made):
    t, c = made
    shown = follow(CAR, course(t, c, c["v_x"] + 1.0), Model(), rate=0.2)
    np.testing.assert_allclose(shown["nudge"], 0.2 * (c["v_x"] + 1.0 - shown["v_x"]), atol=5e-3)


def test_a_car_stands_on_a_slope_where_the_measured_one_stands():
    t = np.arange(4000) * 0.01
    v = np.interp(t, (0.0, 10.0, 20.0, 30.0), (10.0, 0.0, 0.0, 10.0))
    torque = np.tile(0.25 * CAR.mass * np.gradient(v, 0.01) * CAR.arm("fl"), (4, 1))
    shown = follow(CAR, Course(t, torque, 0.0 * t, v), Model((term("road_grade", grade=0.05),)))
    assert np.abs(shown["v_x"][1500:2000]).max() < 0.2


def test_a_wheel_that_drags_does_not_swing_after_a_start_from_rest():
    t = np.arange(1200) * 0.01
    v = np.interp(t, (0.0, 3.0, 12.0), (0.0, 0.0, 9.0))
    of_axle = 0.5 * CAR.mass * np.gradient(v, 0.01) * CAR.arm("rl")
    along = Course(t, np.array([0.0 * t, 0.0 * t, of_axle, of_axle]), 0.0 * t, v)
    drags = Model((term("brake_drag", "fr", torque=5.0),))
    long, short = (follow(CAR, along, drags, step=s) for s in (0.01, 0.001))
    for w in WHEELS:
        np.testing.assert_allclose(long[f"omega_{w}"][500:], short[f"omega_{w}"][500:], atol=0.02, err_msg=w)


@pytest.mark.parametrize("delay", [0.2, -0.1])
def test_a_torque_that_is_reported_late_is_applied_earlier(made, delay):
    t, c = made
    late = {n: np.interp(t - delay, t, x) if n.startswith("torque") else x for n, x in c.items()}
    knows, not_ = (
        follow(CAR, course(t, late), m)["a_x"] - c["a_x"]
        for m in (Model((term("signal_delay", "torque", delay=delay),)), Model())
    )
    inside = slice(300, -300)
    assert knows[inside].std() < 0.1 * not_[inside].std()


def test_a_torque_that_arrives_in_part_is_undone(made):
    t, _ = made
    _, c = drive(term("torque_gain", gain=0.9))
    right = follow(CAR, course(t, c), Model((term("torque_gain", gain=0.9),)))
    wrong = follow(CAR, course(t, c), Model())
    assert np.abs(right["a_x"] - c["a_x"])[INSIDE].max() < 0.02
    assert np.abs(wrong["a_x"] - c["a_x"])[INSIDE].max() > 0.05
    # what the sensor shows is what was reported, whatever reaches the wheel
    np.testing.assert_allclose(right["torque_rl"][INSIDE], c["torque_rl"][INSIDE], atol=1.0)


def test_a_velocity_that_reads_too_much_leads_the_car_at_its_true_speed(made):
    t, c = made
    scaled = Model((term("velocity_scale", "v_x", scale=1.03),))
    knows, not_ = (follow(CAR, course(t, c, 1.03 * c["v_x"]), m) for m in (scaled, Model()))
    np.testing.assert_allclose(knows["omega_fl"][INSIDE], c["omega_fl"][INSIDE], rtol=2e-3)
    np.testing.assert_allclose(knows["v_x"][INSIDE], 1.03 * c["v_x"][INSIDE], rtol=2e-3)
    assert (not_["omega_fl"] / c["omega_fl"])[INSIDE].mean() > 1.01


def test_terms_of_the_sensors_show_in_their_own_column_alone(made):
    t, c = made
    base = follow(CAR, course(t, c), Model())
    off = follow(CAR, course(t, c), Model((term("accelerometer_bias", "a_x", bias=0.3),)))
    np.testing.assert_allclose(off["a_x"] - base["a_x"], 0.3, atol=1e-12)
    assert all(np.array_equal(off[n], x) for n, x in base.items() if n != "a_x")


@pytest.mark.parametrize("place", ["omega", "torque"])
def test_the_clock_of_four_wheels_is_that_of_any_one_of_them(made, place):
    t, c = made
    base = follow(CAR, course(t, c), Model())
    four = follow(CAR, course(t, c), Model((term("clock_skew", place, skew=5e4),)))
    one = follow(CAR, course(t, c), Model((term("clock_skew", f"{place}_fl", skew=5e4),)))
    assert np.abs(four["omega_rr"] - base["omega_rr"])[INSIDE].max() > 1e-3
    assert all(np.array_equal(four[n], x) for n, x in one.items())


def test_torque_applied_to_one_wheel_turns_that_wheel(made):
    t, c = made
    at = course(t, c)
    more = at.torque.copy()
    more[2] += 100.0
    a, b = follow(CAR, at, Model()), follow(CAR, replace(at, torque=more), Model())
    np.testing.assert_allclose((b["torque_rl"] - a["torque_rl"])[INSIDE], 100.0, atol=1e-6)
    np.testing.assert_allclose((b["torque_rr"] - a["torque_rr"])[INSIDE], 0.0, atol=1e-6)
    assert np.median(b["omega_rl"] - b["omega_rr"]) > 0.01


def kernel_rows(applied=None, follow_rate=0.0, torque=0.0):
    setup = assemble(Scenario(CAR, sensors=IDEAL))
    n = 2000
    zero = np.zeros(n + 1)
    controls = kernel.Controls(
        v_target=zero + 20.0, a_target=zero, drive=zero + torque, brake=zero, split_rear=zero + 1.0, steer=zero, exc=zero,
        grade=zero, wind=zero, gain=zero + 1.0, has_driver=False, keeps_lane=False, exc_kind=0, exc_amplitude=0.0,
        scatter=0.0, follow=follow_rate,
    )  # fmt: skip
    start = rolling_state(setup.plant, v=20.0, a=0.0, drive=torque, split_rear=1.0)
    start[state.DRIVE] = torque
    road = build_road(setup.scenario, 200.0)
    args = () if applied is None else (np.ascontiguousarray(applied),)
    return kernel.run(n, 1e-3, 10, start, setup.plant, road, controls, *args)


def test_no_applied_torque_leaves_every_bit():
    bare = kernel_rows()
    assert np.array_equal(bare, kernel_rows(np.zeros((1, 4))))
    assert np.array_equal(bare, kernel_rows(np.zeros((2001, 4))))
    assert np.all(bare[:, state.COLUMNS["nudge"]] == 0.0)


def test_one_row_of_torque_holds_for_the_whole_drive():
    one = np.array([[0.0, 0.0, 80.0, 60.0]])
    assert np.array_equal(kernel_rows(one), kernel_rows(np.repeat(one, 2001, axis=0)))
    rows = kernel_rows(one)
    assert rows[-1, state.COLUMNS["v_x"]] > kernel_rows()[-1, state.COLUMNS["v_x"]] + 0.05


def test_a_driven_simulation_knows_no_nudge():
    a = simulate(Scenario(CAR, duration_s=3.0, sensors=IDEAL))
    b = simulate(Scenario(CAR, duration_s=3.0, sensors=IDEAL))
    assert all(np.array_equal(a.truth.columns[n], b.truth.columns[n], equal_nan=True) for n in a.truth.columns)
    assert "nudge" not in a.truth.columns


def test_another_resistance_does_not_move_the_car_along_its_road():
    """It lags by a third of a metre per second; hills that came later would show in the accelerometer."""
    way = np.arange(0.0, 1600.0, 10.0)
    hills = tuple(zip(way.tolist(), (0.03 * np.sin(way / 25.0)).tolist(), strict=True))
    t, c = drive(grade=hills)
    position = np.cumsum(c["v_x"]) * (t[1] - t[0])
    model = Model((Term(EMPIRICAL["unexplained_grade"], knots=hills),))

    def felt(m):
        shown = follow(CAR, replace(course(t, c), position=position), m)
        return (shown["a_x"] + shown["nudge"] - np.gradient(shown["v_x"], t))[INSIDE]

    other = Model((*model.terms, term("rolling_resistance", delta_r_w=0.01)))
    assert felt(model).std() > 0.15
    np.testing.assert_allclose(felt(other), felt(model), atol=0.02)
    np.testing.assert_allclose(felt(other), c["a_x"][INSIDE] - np.gradient(c["v_x"], t)[INSIDE], atol=0.05)


PLANT = build_plant(SEDAN, TYRES["worn_summer"], TYRES["worn_summer"])


def test_the_torque_of_a_drive_gives_back_its_speed():
    truth = drive_truth(assemble(Scenario(SEDAN, speed=((0.0, 20.0), (8.0, 30.0)), duration_s=10.0, sensors=IDEAL)))
    torque = sum(truth.columns[f"torque_{w}"] for w in WHEELS)
    pick = slice(None, None, 10)
    r = replay(PLANT, truth.t[pick], torque[pick], split_rear=1.0, v_0=20.0)
    np.testing.assert_allclose(r.v_x, truth.columns["v_x"][pick], atol=0.03)
    np.testing.assert_allclose(r.omega[2], truth.columns["omega_rl"][pick], rtol=2e-3)


def test_coasting_slows_down_by_drag_and_rolling_resistance():
    t = np.arange(0.0, 5.0, 0.1)
    r = replay(PLANT, t, np.zeros(t.size), split_rear=1.0, v_0=30.0)
    a = -(0.5 * SEDAN.drag_area * SEDAN.air_density * 30.0**2 / SEDAN.mass + SEDAN.rolling_resistance * G)
    inertia = sum(SEDAN.inertia(w) / (SEDAN.r_e(w) * SEDAN.arm(w)) for w in WHEELS)
    assert np.diff(r.v_x)[5] / 0.1 == pytest.approx(a * SEDAN.mass / (SEDAN.mass + inertia), rel=0.02)


def test_grade_slows_and_is_not_felt_by_the_accelerometer():
    t = np.arange(0.0, 5.0, 0.1)
    flat = replay(PLANT, t, np.full(t.size, 200.0), split_rear=1.0, v_0=20.0)
    hill = replay(PLANT, t, np.full(t.size, 200.0), split_rear=1.0, v_0=20.0, grade=np.full(t.size, 0.05))
    assert (flat.v_x - hill.v_x)[-1] == pytest.approx(G * np.sin(0.05) * 4.9, rel=0.05)
    assert np.abs(hill.a_x - flat.a_x)[5:].max() < 0.06


def test_twice_the_gain_is_twice_the_torque():
    t = np.arange(0.0, 4.0, 0.1)
    a = replay(
        PLANT._replace(torque_gain=np.array([1.0, 1.0, 2.0, 2.0])), t, np.full(t.size, 150.0), split_rear=1.0, v_0=20.0
    )
    b = replay(PLANT, t, np.full(t.size, 300.0), split_rear=1.0, v_0=20.0)
    np.testing.assert_allclose(a.v_x, b.v_x, rtol=1e-6)


def test_bad_inputs_are_refused():
    t = np.arange(0.0, 1.0, 0.1)
    with pytest.raises(ConfigError, match="even time base"):
        replay(PLANT, t**1.1, np.zeros(t.size), split_rear=1.0, v_0=20.0)
    with pytest.raises(ConfigError, match="finite"):
        replay(PLANT, t, np.full(t.size, np.nan), split_rear=1.0, v_0=20.0)
