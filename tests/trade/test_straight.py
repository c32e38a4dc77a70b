"""The straight test of one run, by hand-made wheel speeds."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from aqualog.trade.limits import Limits, defaults
from aqualog.trade.speeds import lateness
from aqualog.trade.straight import crossing, slip_of, straight_runs
from tests.trade.made import FWD, KMH, RWD, signals, straight


def one(columns, car=FWD, **more):
    (run,) = straight_runs(signals(columns), car, **more)
    return run


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize(("car", "axle"), [(FWD, "f"), (RWD, "r")])
def test_speed_of_15_percent(side, car, axle):
    run = one(straight(side=side, axle=axle, v_15=78.0), car)
    assert run.valid, run.reasons
    assert run.wet_side == side
    assert run.axle == axle
    # a slope of 1 % per km/h: 5 % ten km/h below, 10 % five, 50 % 35 above
    speeds = {n: v / KMH for n, v in run.speeds.items()}
    assert speeds["v_15"] == pytest.approx(78.0, abs=0.01)
    assert speeds["v_10"] == pytest.approx(73.0, abs=0.01)
    assert speeds["v_05"] == pytest.approx(68.0, abs=0.01)
    assert speeds["v_50"] == pytest.approx(113.0, abs=0.01)
    assert run.speeds_other["v_15"] == pytest.approx(78.0 * KMH, abs=0.003)
    assert (run.reference, run.other) == ("v_x", f"omega_{'r' if axle == 'f' else 'f'}{'r' if side == 'left' else 'l'}")


def test_radii_that_differ_are_taken_out_in_the_dry_second():
    run = one(straight(ratio=1.02))
    assert run.ratio == pytest.approx(1 / 1.02)
    assert run.v / KMH == pytest.approx(78.0, abs=0.01)


def test_slip_by_hand():
    omega_wet, omega_dry = np.array([50.0, 50.0, 57.5]), np.array([49.0, 49.0, 49.0])
    before = np.array([True, True, False])
    s, q = slip_of(omega_wet, omega_dry, np.zeros(3), before)
    assert q == pytest.approx(0.98)
    assert s == pytest.approx([0.0, 0.0, 0.15])
    s, q = slip_of(omega_wet, omega_dry, np.array([0.01, 0.01, 0.03]), before)
    assert q == pytest.approx(1.01 / (50 / 49))
    assert s[2] == pytest.approx(57.5 / 49 * q - 1 - 0.03)


def test_crossing_by_hand():
    on = np.ones(8, dtype=bool)
    slip = np.array([0.0, 0.1, 0.2, 0.1, 0.1, 0.2, 0.2, 0.2])
    assert crossing(slip, on, 0.15, 1) == pytest.approx(1.5)
    assert crossing(slip, on, 0.15, 3) == pytest.approx(4.5)  # the first one does not last
    assert math.isnan(crossing(slip, on, 0.15, 4))
    assert math.isnan(crossing(slip, on & (np.arange(8) < 2), 0.15, 1))
    late = np.arange(8) > 5
    assert crossing(slip, late, 0.15, 3) == pytest.approx(4.5)  # it lasts into the lane
    assert math.isnan(crossing(slip[:6], late[:6] | (np.arange(6) == 4), 0.15, 2))  # and not beyond its end
    gap = np.array([0.0, 0.1, np.nan, 0.2, np.nan, 0.2, 0.2, 0.1])
    assert crossing(gap, on, 0.15, 4) != crossing(gap, on, 0.15, 3) == pytest.approx(2.0)


def labelled(late, **more):
    """A run whose label begins late [s] behind the water's edge, where the slip is there at once."""
    columns = straight(**more)
    on = columns["on_water"] * (np.arange(1500) >= 300 + round(100 * late))
    return columns | {"on_water": on, "water_depth_left": 7e-3 * on}


@pytest.mark.parametrize(("late", "v_15"), [(0.0, 40.0), (0.1, 78.0), (0.3, 78.0)])
def test_a_run_that_enters_beyond_the_level_is_not_above_its_highest_speed(late, v_15):
    run = one(labelled(late, v_15=v_15, v_0=66.0))  # 80 km/h at the edge; abrupt, the slip's mean comes before it
    assert not run.is_censored
    assert not run.valid
    assert "before the lane began: the car entered it too fast" in run.reasons[0]
    assert run.v / KMH == pytest.approx(80.0, abs=0.3)
    assert not any("yaw" in n for n in run.notes)


@pytest.mark.parametrize("late", [0.1, 0.3])
def test_a_late_label_takes_no_water_into_the_dry_second(late):
    run = one(labelled(late, v_0=58.0))  # 72 km/h and 9 % at the edge
    assert run.ratio == pytest.approx(1.0)
    assert run.v / KMH == pytest.approx(78.0, abs=0.01)


def test_a_crossing_too_near_to_the_end_of_the_lane_is_above_the_bound():
    run = one(straight(v_15=115.3))  # 0.05 s before it, where 15 % cannot last
    assert run.is_censored
    assert run.v / KMH == pytest.approx(50 + 1.3 * 13.85 / KMH, abs=0.06)


def test_a_run_that_ends_before_15_percent_is_censored_and_counts():
    run = one(straight(v_15=200.0))
    assert run.is_censored
    assert run.valid
    assert run.v / KMH == pytest.approx(50 + 1.3 * 13.85 / KMH, abs=0.06)


def test_acceleration_is_that_of_the_speed():
    assert one(broken("a_x", 1.3 + 0.3)).a_x == pytest.approx(1.3, abs=0.01)  # an offset of the accelerometer


def late(seconds, **more):
    """A run whose v_x comes late, with noise of a receiver and of a wheel, which shows by a radius of its own."""
    columns, rng = straight(begin=2.0, **more), np.random.default_rng(1)
    t = np.arange(1500) / 100.0
    columns["v_x"] = np.interp(t - seconds, t, columns["v_x"]) + rng.normal(0.0, 0.03, t.size)
    columns["omega_rr"] = 1.01 * columns["omega_rr"] + rng.normal(0.0, 0.05, t.size)
    return columns


@pytest.mark.parametrize("seconds", [0.0, 0.08, 0.2])
def test_delay_of_v_x_is_taken_off(seconds):
    run = one(late(seconds))  # 0.2 s at 1.3 m/s² are 0.9 km/h
    assert run.late == pytest.approx(seconds, abs=0.015)
    assert run.v / KMH == pytest.approx(78.0, abs=0.15)


def test_a_delay_that_the_drive_does_not_show_stays():
    assert math.isnan(one(late(0.08, a=0.0)).late)
    assert "the delay of v_x is not known" in "; ".join(one(late(0.08, a=0.0)).notes)
    assert "check the clocks" in "; ".join(one(late(0.8)).notes)


@pytest.mark.parametrize("tau", [0.02, 0.5])
def test_the_interval_of_the_delay_holds_it(tau):
    """Noise of a receiver is correlated, and few stretches show the delay."""
    rng, t = np.random.default_rng(0), np.arange(1100) / 100.0
    v = 18.0 + 1.3 * np.maximum(t - 4.0, 0.0) + 0.05 * np.sin(0.6 * np.pi * t)
    keep, inside = math.exp(-0.01 / tau), 0
    for _ in range(60):
        noise = lfilter([0.03 * math.sqrt(1.0 - keep**2)], [1.0, -keep], rng.normal(size=1600))[500:]
        wheel = v + rng.normal(0.0, 0.01, t.size)
        found, half = lateness(np.interp(t - 0.08, t, v) + noise, wheel, np.ones(t.size, bool), 0.01)
        inside += abs(found - 0.08) <= half
    assert inside / 60 > 0.88


def test_yaw_of_a_bent_line_is_taken_off():
    columns = straight()
    t = np.arange(columns["v_x"].size) / 100.0
    columns["yaw_rate"] = np.where(t > 2.0, 0.03, 0.0)
    for w, sign in (("l", -1.0), ("r", 1.0)):  # left turn: the right wheels run outside
        for axle in "fr":
            columns[f"omega_{axle}{w}"] = (
                columns[f"omega_{axle}{w}"] + sign * 0.5 * columns["yaw_rate"] * FWD.track / 0.317
            )
    run = one(columns)
    assert run.v / KMH == pytest.approx(78.0, abs=0.1)
    assert run.speeds_other["v_15"] / KMH == pytest.approx(78.0, abs=0.1)


def broken(name, value, when=slice(None)):
    columns = straight()
    x = columns[name].copy()
    x[when] = value
    return {**columns, name: x}


def lifted(at, *, late=math.nan, lane_end=14.0):
    """A run whose driver lifts at a time [s], before 15 %; its torque comes late [s], or is not in the log."""
    columns = straight(v_15=200.0, lane=(3.0, lane_end))
    t, v = np.arange(1500) / 100.0, columns["v_x"].copy()
    falls = np.where(t > at, v[int(100 * at)] - 0.6 * (t - at), v) / v
    columns |= {k: x * falls for k, x in columns.items() if k.startswith(("omega", "v_x"))}
    return columns | {f"torque_f{s}": np.where(t > at + late, 20.0, 400.0) * (late / late) for s in "lr"}


AT = slice(760, 790)  # 15 % are reached at 5.98 s
REASONS = {
    "yaw": (lambda: broken("yaw_rate", 0.2, slice(500, 560)), "yaw rate reaches 0.200"),
    "shift": (lambda: broken("gear", 4.0, slice(600, None)), "gear changes within 0.3 s"),
    "cut": (lambda: broken("torque_fl", 0.0, slice(540, 580)), "torque falls by 50 %"),
    "braked": (lambda: broken("torque_fl", -2000.0, slice(540, 580)), "torque falls below zero within a second"),
    "gap": (lambda: broken("omega_fl", np.nan, slice(540, 580)), "wheel speeds are missing for 0.40 s"),
    "idle": (lambda: straight(a=0.1), "0.10 m/s²: no full throttle"),
    "fast": (lambda: straight(v_15=64.5, slope=0.5), "after the lane began"),
    "no dry road": (lambda: straight(lane=(0.3, 14.0)), "of dry road"),
    "one wheel": (lambda: {k: x for k, x in straight().items() if k != "omega_fr"}, "omega_fr is not in the log"),
    "slow log": (lambda: {k: x[::20] for k, x in straight().items()}, "at least 10 needed"),
    "no lane": (lambda: {k: x for k, x in straight().items() if "water" not in k}, "no watered lane"),
    "short lane": (lambda: straight(lane=(3.0, 3.14)), "the water in the log lasts 0.14 s, a lane at least 0.2 s"),
    "no dry wheel": (
        lambda: straight() | {"water_depth_right": np.full(1500, 7e-3), "water_depth_left": np.full(1500, 7e-3)},
        "no side is dry beside a wet one: 7.0 and 7.0 mm",
    ),
    "side unknown": (
        lambda: {k: x for k, x in straight(v_15=300.0).items() if not k.startswith("water")},
        "the wet side is not known",
    ),
    "wrong side": (
        lambda: (
            straight() | {f"water_depth_{s}": straight(side="right")[f"water_depth_{s}"] for s in ("left", "right")}
        ),
        "the other driven wheel, on the left, slipped by 15 %: wrong side declared?",
    ),
    "lift": (lambda: lifted(8.0), "the speed falls on the lane from 87.4 km/h on: the throttle was let go"),
    "lift, torque late": (lambda: lifted(8.0, late=0.15, lane_end=8.25), "torque falls by 95 % within a second"),
    "no speed": (lambda: {k: x for k, x in straight().items() if k not in ("v_x", "omega_rr")}, "no speed on the lane"),
}


@pytest.mark.parametrize("name", REASONS)
def test_a_run_that_is_none_says_why(name):
    make, words = REASONS[name]
    (run,) = straight_runs(signals(make(), rate=5.0 if name == "slow log" else 100.0), FWD)
    assert not run.valid
    assert words in "; ".join(run.reasons)


def test_a_throttle_that_is_let_go_behind_the_lane_costs_nothing():
    run = one(lifted(8.0, late=0.1, lane_end=8.05))
    assert run.valid, run.reasons
    assert run.v / KMH == pytest.approx(50 + 1.3 * 7.9 / KMH, abs=0.06)


GAPS = {"crossing": (583, 613), "long": (540, 640), "early": (400, 450), "after": (650, 750), "before": (210, 310)}


@pytest.mark.parametrize("name", GAPS)
def test_the_free_wheel_fills_a_gap_in_v_x_at_the_ratio_of_the_run(name):
    first, last = GAPS[name]
    run = one(broken("v_x", np.nan, slice(first, last)), replace(FWD, r_e_r=0.32))  # 1 % more than it is
    assert run.valid, run.reasons
    assert run.reference == "v_x"
    assert run.v / KMH == pytest.approx(78.0, abs=0.02)
    assert f"v_x is missing for {(last - first) / 100:.2f} s: the free wheel omega_rr fills the gap" in run.notes


def test_a_gap_in_v_x_without_a_free_wheel_costs_no_slip():
    car = replace(FWD, drivetrain="awd", torque_split_rear=0.4)
    assert one(broken("v_x", np.nan, slice(400, 450)), car).v / KMH == pytest.approx(78.0, abs=0.02)
    assert one(broken("v_x", np.nan, slice(590, 610)), car).reasons == ("the speed is missing at the crossing",)
    lost = one(broken("v_x", np.nan, slice(400, 950)), car).reasons[0]
    assert lost == "there is no speed on the lane: v_x is missing on 50 % of it, and all wheels are driven"


def test_what_is_not_in_the_log_is_a_note():
    bare = {k: x for k, x in straight().items() if k.startswith(("omega", "on_water", "water"))}
    run = one(bare)
    assert run.valid
    assert run.v / KMH == pytest.approx(78.0, abs=0.05)
    said = "; ".join(run.notes)
    for words in ("no v_x", "no gear", "no torque", "no yaw_rate"):
        assert words in said


def test_the_wet_side_is_found_by_the_wheels_where_no_depth_is_known():
    run = one({k: x for k, x in straight(side="right").items() if not k.startswith("water")})
    assert run.wet_side == "right"
    assert "turns faster" in run.notes[0]


def test_radius_of_the_free_wheel_that_the_vehicle_file_does_not_have():
    car = replace(FWD, given=frozenset({"drivetrain"}), r_e_r=0.4)
    columns = straight()
    run = one(columns, car)
    assert run.speeds_other["v_15"] / KMH == pytest.approx(78.0, abs=0.01)  # learnt: 0.317 m
    assert "is learnt from v_x before the lane" in " ".join(run.notes)
    columns["v_x"] = np.where(np.arange(1500) < 300, columns["v_x"], np.nan)  # lost on the lane
    run = one(columns, car)
    assert run.reference == "omega_rr"
    assert run.v / KMH == pytest.approx(78.0, abs=0.01)
    del columns["v_x"]
    run = one(columns, car)
    assert not run.valid
    assert "the vehicle file has no wheels.r_e_r" in run.reasons[0]


def test_no_drivetrain():
    from aqualog.core.vehicle import Vehicle

    (run,) = straight_runs(signals(straight()), Vehicle())
    assert "which axle is driven" in run.reasons[0]


def test_lane_of_the_campaign_and_several_passages():
    columns = straight()
    del columns["on_water"], columns["water_depth_left"], columns["water_depth_right"]
    run = one(columns, lane=(3.0, 14.0), depths=(7e-3, 0.0))
    assert run.v / KMH == pytest.approx(78.0, abs=0.01)
    twice = {k: np.concatenate([x, x]) for k, x in straight().items()}
    assert [round(r.v / KMH, 1) for r in straight_runs(signals(twice), FWD)] == [78.0, 78.0]


def test_limits_of_a_user():
    limits = Limits.of({"straight.slip": 0.10}).straight
    run = one(straight(), limits=limits)
    assert run.v / KMH == pytest.approx(73.0, abs=0.01)
    assert defaults().straight.slip == 0.15


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda c: c | {"v_x": 3.6 * c["v_x"]}, "v_x and the wheel speeds give a radius of 1.14 m"),
        (lambda c: c | {"v_x": 1.05 * c["v_x"]}, "v_x is 1.05 times the speed of the free wheel omega_rr"),
        (lambda c: c | {w: 9.55 * x for w, x in c.items() if w.startswith("omega")}, "give a radius of 0.03 m"),
    ],
)
def test_a_speed_that_is_not_that_of_the_wheels_does_not_count(change, why):
    run = one(change(straight()))
    assert not run.valid
    assert why in run.reasons[0]
    assert not any("differ by" in n for n in run.notes)


def test_radii_that_are_off_by_three_percent_count():
    columns = straight()
    assert one(columns | {"v_x": 1.03 * columns["v_x"]}).valid


def test_a_log_that_ends_on_the_lane_is_remarked():
    cut = {n: x[:900] for n, x in straight(v_15=110.0).items()}
    run = one(cut)
    assert run.is_censored
    assert "the log ends on the lane" in run.notes
    assert "the log ends on the lane" in one(straight(end=15.0), lane=(3.0, 100.0)).notes
    assert "the log ends on the lane" not in one(straight()).notes


def test_a_wheel_that_spins_long_before_the_water():
    columns, t = straight(v_0=66.0), np.arange(0.0, 15.0, 0.01)
    columns["omega_fl"] = np.where((t > 2.5) & (t < 3.3), 1.6, 1.0) * columns["omega_fl"]
    assert any("before the lane began: the wheel spun before the water" in r for r in one(columns).reasons)


def test_a_gear_shift_is_named_where_the_torque_falls():
    columns, t = straight(), np.arange(0.0, 15.0, 0.01)
    hole = (t > 5.0) & (t < 5.3)
    columns |= {f"torque_{w}": np.where(hole, 0.0, columns[f"torque_{w}"]) for w in ("fl", "fr")}
    assert "it was cut" in one(columns).reasons[0]
    assert "in a gear shift" in one(columns | {"gear": np.where(t < 5.1, 3.0, 4.0)}).reasons[0]


def test_a_label_that_is_never_on_is_no_missing_label():
    columns = {n: x for n, x in straight().items() if not n.startswith("water")}
    run = one(columns | {"on_water": np.zeros(1500)})
    assert run.reasons == ("on_water is never 1 in the log, which ends at 15.0 s",)


def test_an_all_wheel_drive_says_what_an_unknown_delay_would_do():
    run = one(straight(), replace(FWD, drivetrain="awd", torque_split_rear=0.4))
    assert any("0.1 s would make it 0.5 km/h too low" in n for n in run.notes)
