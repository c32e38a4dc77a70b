"""A log made ready: what is used, what is left out, what stands in; and the short drives of the tests beside this."""

from dataclasses import replace
from functools import cache

import numpy as np
import polars as pl
import pytest

from aqualog.core.errors import SignalError
from aqualog.core.notation import WHEELS
from aqualog.core.vehicle import KEYS, Provenance, Vehicle
from aqualog.diagnose.channels import CHANNELS, block_means
from aqualog.diagnose.drive import _shifting, calm, led_by, prepare
from aqualog.diagnose.hypotheses import residual
from aqualog.model.effects import EFFECTS
from aqualog.model.follow import follow
from aqualog.model.log import as_signals
from aqualog.model.scenario import Scenario, Steering
from aqualog.model.sensors import IDEAL, Channel
from aqualog.model.simulate import simulate
from aqualog.model.term import Model, Term

CAR = Vehicle(
    name="test car", given=frozenset({"drivetrain", *KEYS}), provenance={k: Provenance("measured", 0.0) for k in KEYS}
)
# no braking: the car of the log rolls out
SPEED = ((0.0, 15.0), (8.0, 15.0), (16.0, 24.0), (28.0, 24.0), (40.0, 20.0), (46.0, 24.0), (58.0, 24.0), (66.0, 30.0), (78.0, 30.0), (90.0, 25.0))  # fmt: skip
NOISY = replace(
    IDEAL,
    channels={
        "a_x": Channel(noise=0.05), "a_y": Channel(noise=0.05), "v_x": Channel(noise=0.03), "yaw_rate": Channel(noise=1e-3),
        **{f"omega_{w}": Channel(noise=0.05) for w in WHEELS}, **{f"tie_rod_{w}": Channel(noise=20.0) for w in WHEELS[:2]},
    },
)  # fmt: skip


def term(name, where=None, **values):
    return Term(EFFECTS[name], values, where)


KEPT = {}


def signals(*terms, sensors=IDEAL, seed=3, drop=(), **kw):
    """A simulated drive of 90 s with these terms in the car; the last dozen are kept for who asks again."""
    scenario = Scenario(**({"vehicle": CAR, "sensors": sensors, "seed": seed, "speed": SPEED, "duration_s": 90.0} | kw))
    key = repr((terms, scenario))
    KEPT[key] = made = KEPT.pop(key, None) or as_signals(simulate(scenario, Model(terms)), truth=False)
    for oldest in [*KEPT][:-12]:
        del KEPT[oldest]
    return changed(made, made.frame.drop(drop))


def changed(log, frame):
    return replace(log, frame=frame)


@cache
def plain():
    return signals()


def test_a_car_that_slides_in_the_simulation_alone_shows_nothing_and_comes_back():
    speed = ((0.0, 18.0), (7.0, 18.0), (12.0, 36.0), (40.0, 36.0), (60.0, 25.0), (90.0, 25.0))
    car = replace(CAR, drivetrain="rwd", mu_max=2.0)
    log = signals(vehicle=car, speed=speed, steering=Steering(0.04, 4.0, 8.0, "lane_change"))
    d = prepare(log, replace(car, mu_max=0.6), "a")
    assert 70.0 < d.used_s < 80.0
    assert np.abs(residual(d, Model())[d.channels.index("kinematic"), d.mask]).max() < 0.6
    led = follow(d.vehicle, d.course, Model())
    assert 0.45 < led["slides"].max() < 0.55
    assert 3.0 < np.count_nonzero(led["slides"]) * d.dt < 5.5
    assert np.abs(led["v_x"] - d.speed).max() < 0.9
    rim = np.array([led[f"omega_{w}"] * CAR.r_e(w) for w in WHEELS])
    assert np.abs(rim / led["v_x"] - 1.0)[:, d.course.t > 14.0].max() < 0.033
    assert prepare(changed(log, log.frame.drop("yaw_rate")), d.vehicle, "a").used_s < 85.0  # and without a gyro


def test_a_dry_drive_is_used_whole():
    d = prepare(plain(), CAR, "a")
    assert d.used_s == d.duration_s == pytest.approx(90.0)
    assert {"force_balance", "kinematic", "slip_fl", "slip_rr"} <= set(d.channels)
    assert not d.untorqued
    assert all(x.shape == d.mask.shape for x in d.coordinates.values())


def test_the_change_of_speed_is_not_the_noise_of_the_velocity():
    log = plain()
    v = log.array("v_x") + 0.05 * np.random.default_rng(1).standard_normal(log.frame.height)
    noisy = changed(log, log.frame.with_columns(pl.Series("v_x", v)))
    quiet, loud = (prepare(x, CAR, "a").coordinates["a_x"] for x in (log, noisy))
    assert np.std(loud - quiet) < 0.1


def test_a_long_gap_is_left_out_with_a_second_beside_and_a_short_one_bridged():
    x = plain().array("a_x").copy()
    x[3000:3010] = np.nan  # 0.1 s
    x[6000:6200] = np.nan  # 2 s
    d = prepare(changed(plain(), plain().frame.with_columns(pl.Series("a_x", x).fill_nan(None))), CAR, "a")
    assert d.mask[290:310].all()
    assert not d.mask[591:629].any()
    assert d.mask[:589].all()
    assert d.mask[631:].all()


def test_standstill_and_creeping_are_left_out():
    d = prepare(signals(speed=((0.0, 15.0), (20.0, 15.0), (30.0, 2.0), (40.0, 2.0), (50.0, 15.0))), CAR, "a")
    v = d.coordinates["v_x"]
    assert not d.mask[v < 4.0].any()
    assert d.mask[v > 8.0].mean() > 0.9


def test_a_frozen_accelerometer_is_left_out_where_it_is_frozen():
    noisy = signals(sensors=NOISY)
    x = noisy.array("a_x").copy()
    x[2000:4000] = x[2000]
    d = prepare(changed(noisy, noisy.frame.with_columns(pl.Series("a_x", x))), CAR, "a")
    assert not d.mask[210:390].any()
    assert d.mask[:180].all()


def test_the_time_since_braking_counts_from_its_end():
    """From 24 to 15 m/s in 6 s; before, braking was long ago, and while braking it is a place of its own."""
    slow = ((0.0, 24.0), (30.0, 24.0), (36.0, 15.0), (90.0, 15.0))
    at = prepare(signals(speed=slow), CAR, "a").coordinates["since_braking"]
    assert at[100] == pytest.approx(60.0)
    assert at[330] == -15.0
    assert at[365:].min() < 1.0
    assert at[600] == pytest.approx(60.0 - 36.0, abs=1.5)
    assert "since_braking" not in prepare(plain(), CAR, "a").coordinates


BRAKING = 3000, 5000  # samples


def braked(drivetrain, **columns):
    """The coordinate on a drive that keeps its speed, with columns that have a value of their own while braking."""
    car, on = replace(CAR, drivetrain=drivetrain), np.arange(plain().frame.height)
    on = (on >= BRAKING[0]) & (on < BRAKING[1])
    frame = (
        plain()
        .frame.drop("brake_pressure")
        .with_columns(pl.Series(n, np.where(on, x, other)) for n, (x, other) in columns.items())
    )
    return prepare(changed(plain(), frame), car, "a").coordinates.get("since_braking")


def torques(front, rear, *, other=(20.0, 20.0)):
    return {f"torque_{w}": (front if w[0] == "f" else rear, other[0] if w[0] == "f" else other[1]) for w in WHEELS}


@pytest.mark.parametrize(
    ("drivetrain", "columns", "brakes"),
    [
        ("rwd", {"brake_pressure": (1e5, 0.0)}, True),
        ("rwd", {"brake_pressure": (0.4e5, 0.0)}, False),
        # of wheels that nothing drives: 0.03 m/s^2 of the car, from what the log has there else
        ("rwd", torques(8.0, 40.0), True),
        ("rwd", torques(16.0, -150.0), False),
        ("fwd", torques(40.0, 8.0), True),
        ("awd", torques(8.0, 40.0), False),
        # an engine slows no car by 0.4 m/s^2
        ("awd", torques(-80.0, -40.0), True),
        ("awd", torques(-40.0, -40.0), False),
        # the pressure is the better witness
        ("rwd", torques(8.0, 40.0) | {"brake_pressure": (0.0, 0.0)}, False),
    ],
)
def test_brakes_show_by_their_pressure_or_by_torque_that_no_engine_makes(drivetrain, columns, brakes):
    at = braked(drivetrain, **columns)
    if not brakes:
        assert at is None
        return
    assert (at[302:498] == -15.0).all()
    assert at[290] == pytest.approx(60.0)
    assert at[600] == pytest.approx(10.0, abs=0.2)


def test_braking_is_left_out_where_the_torque_does_not_hold_it():
    log = signals(speed=((0.0, 24.0), (30.0, 24.0), (33.0, 18.0), (90.0, 18.0)))
    p = np.where(np.arange(log.frame.height) // 300 == 10, 10e5, 0.0)
    pressed = log.frame.with_columns(pl.Series("brake_pressure", p))
    driven = pressed.with_columns(pl.col(f"torque_{w}").clip(-80.0, None) for w in WHEELS)  # the engine's drag
    d = prepare(changed(log, driven), CAR, "a")
    assert not d.mask[302:328].any()
    assert d.mask[:280].all()
    assert any("braking" in n for n in d.notes)
    assert prepare(changed(log, pressed), CAR, "a").mask[305:325].all()


def test_jumps_of_the_torque_are_left_out_and_no_more_than_that():
    log = plain()
    step = 200.0 * (np.arange(log.frame.height) > 3000)
    jumped = log.frame.with_columns((pl.col(f"torque_{w}") + pl.Series(step)).alias(f"torque_{w}") for w in WHEELS)
    d = prepare(changed(log, jumped), CAR, "a")
    assert not d.mask[299:302].any()
    assert d.mask[:297].all()
    assert d.mask[304:].all()


@pytest.mark.parametrize(("falls_for", "left_out"), [(0.4, True), (3.0, False)], ids=["shift", "the driver lifts"])
def test_a_gear_shift_is_left_out_until_the_body_is_calm_again(falls_for, left_out):
    log = plain()
    t = np.arange(log.frame.height) * log.dt
    ramp = np.clip((t - 30.0) / 0.15, 0.0, 1.0) - np.clip((t - 30.0 - falls_for) / 0.15, 0.0, 1.0)
    less = pl.Series(-0.15 * CAR.mass * CAR.r_e_r * ramp)  # 0.6 m/s^2 in all, 4 m/s^3
    columns = [(pl.col(f"torque_{w}") + less).alias(f"torque_{w}") for w in WHEELS]
    d = prepare(changed(log, log.frame.with_columns(*columns, pl.col("a_x") - pl.Series(0.6 * ramp))), CAR, "a")
    assert d.mask.all()
    rest = calm(d)
    assert rest.mask[302:320].any() != left_out
    assert rest.mask[:298].all()
    assert rest.mask[330:].all()


def test_a_torque_that_falls_away_all_the_time_is_noise():
    jerk = np.tile([-3.0, 3.0], 500)
    assert not _shifting(jerk, 0.01).any()
    assert _shifting(np.where(np.arange(1000) < 20, jerk, 0.0), 0.01)[:200].all()


def test_radii_are_not_known_where_wheel_speeds_are_those_of_a_control_unit():
    radii = {"wheels.r_e_f", "wheels.r_e_r"}
    told = replace(CAR, given=CAR.given | {*radii, "wheels.inertia_f"})
    log = plain()
    kmh = {n: replace(o, unit="km/h") if n.startswith("omega_") else o for n, o in log.origins.items()}
    unknown = {n: replace(o, unit="") for n, o in log.origins.items()}
    assert prepare(log, told, "a").vehicle is told
    assert prepare(replace(log, origins=unknown), told, "a").vehicle is told
    assert prepare(replace(log, origins=kmh), told, "a").vehicle.given == told.given - radii


def test_the_gain_of_the_file_is_in_the_signals_already():
    a, b = (prepare(plain(), replace(CAR, torque_gain=g), "a").course.torque for g in (1.0, 2.0))
    np.testing.assert_array_equal(b, a)


def test_torque_of_one_axle_holds_no_brakes():
    whole = changed(plain(), plain().frame.drop("brake_pressure"))
    log = changed(plain(), whole.frame.drop("torque_fl", "torque_fr"))
    d = prepare(log, CAR, "a")
    braked = block_means(log.array("torque_rl") + log.array("torque_rr"), log.dt) < 0.0
    assert braked.any()
    assert not d.mask[braked].any()
    assert d.mask.any()
    assert any("brakes are not in the log" in n for n in d.notes)
    assert not any("brakes" in n for n in prepare(whole, CAR, "a").notes)


def test_more_braking_than_the_torque_explains_may_be_a_trailer_too():
    hard = signals(speed=((0.0, 20.0), (20.0, 34.0), (40.0, 34.0), (48.0, 12.0), (90.0, 12.0)))
    log = changed(hard, hard.frame.drop("brake_pressure").with_columns(pl.col("^torque_.*$").clip(0.0)))
    why = "explains (brakes, more drag, or a trailer), driven stretches are used"
    assert any(n.endswith(why) for n in prepare(log, CAR, "a").notes)


def test_led_by_the_right_model_the_simulation_meets_the_measured_speed():
    right = Model((term("aero_drag", delta_drag_area=0.3),))
    d = prepare(signals(*right.terms), CAR, "a")
    off = [follow(CAR, x.course, right)["v_x"] - x.speed for x in (d, led_by(d, right))]
    assert np.abs(off[1][2000:]).mean() < 0.1 * np.abs(off[0][2000:]).mean()


def test_water_of_the_log_lies_on_the_course():
    n = plain().frame.height
    depth = np.where((np.arange(n) >= 2000) & (np.arange(n) < 3000), 1e-3, 0.0)
    frame = plain().frame.with_columns(
        pl.Series("water_depth_left", depth), pl.Series("water_depth_right", 2.0 * depth)
    )
    d = prepare(changed(plain(), frame), CAR, "a")
    (lane,) = d.course.lanes
    assert (lane.start, lane.end) == (pytest.approx(20.0), pytest.approx(30.0))
    assert (lane.depth_left, lane.depth_right) == (pytest.approx(1e-3), pytest.approx(2e-3))
    assert d.coordinates["water_depth"].max() == pytest.approx(1.5e-3)


def test_too_little_is_said():
    with pytest.raises(SignalError, match="10 s of drive"):
        prepare(changed(plain(), plain().frame.head(1000)), CAR, "a")
    with pytest.raises(SignalError, match="signals at 2 Hz; expected 5 Hz or more"):
        prepare(replace(plain(), frame=plain().frame[::50], dt_ns=500_000_000), CAR, "a")
    bare = changed(plain(), plain().frame.select("t", "v_x"))
    with pytest.raises(SignalError, match="nothing to compare"):
        prepare(bare, CAR, "a")


@pytest.mark.parametrize(
    ("drop", "lacks"),
    [(("torque_rl",), "torque_rl"), ([f"torque_{w}" for w in WHEELS], "wheel torque")],
)
def test_what_the_torque_lacks(drop, lacks):
    log = plain()
    notes = prepare(changed(log, log.frame.drop(drop)), CAR, "a").notes
    assert any(n.startswith(f"no {lacks} in the log: the torque is") for n in notes)


@pytest.mark.parametrize("dead", ["yaw_rate", "a_y"])
def test_a_gyro_that_never_changes_judges_nothing(dead):
    log = signals(sensors=NOISY)
    assert "lateral" in prepare(log, CAR, "a").channels
    d = prepare(changed(log, log.frame.with_columns(pl.lit(0.01).alias(dead))), CAR, "a")
    assert "lateral" not in d.channels
    assert any(dead in n and "the same one" in n for n in d.notes)


def test_a_wheel_without_values_takes_the_slip_with_it_and_says_so():
    nothing = pl.Series("omega_rr", [None] * plain().frame.height, dtype=pl.Float64)
    d = prepare(changed(plain(), plain().frame.with_columns(nothing)), CAR, "a")
    assert not any(c.startswith("slip") for c in d.channels)
    assert d.notes[:2] == (
        "omega_rr: no value, or the same one, in the whole drive", "not all four wheel speeds: the slip of the wheels is not judged"
    )  # fmt: skip


@pytest.mark.parametrize("missing", [("omega_rr",), ("yaw_rate", "steer_angle"), ("v_x",)])
def test_both_sides_are_compared_by_the_same_signals(missing):
    """A drive of the model itself leaves nothing, whatever signal is missing."""
    d = prepare(changed(plain(), plain().frame.drop(missing)), CAR, "a")
    r = residual(d, Model())
    least = {"m/s^2": 0.02, "m/s": 0.02, "N": 10.0}
    for c, x in zip(d.channels, r, strict=True):
        assert x[d.mask].std() < least[CHANNELS[c].unit], c
