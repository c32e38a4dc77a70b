"""Each detector on drives where its effect is there, is not there, and is imitated by something else."""

import numpy as np
import pytest

from aqualog.detect import minor_spin_down
from aqualog.detect.stream import Settings, detect_drive
from tests.drives import AWD, CAR, FWD, drive, lane
from tests.small_model import Lane


def events(detector=None, **kw):
    vehicle = kw.pop("vehicle", CAR)
    drop = kw.pop("drop", ())
    signals, _ = drive(vehicle, drop=drop, **kw)
    found = detect_drive(signals, vehicle).events
    return [e for e in found if detector in (None, e.detector)]


WATER = {"lanes": (lane(),)}
SPEED = {kmh: {"speed_kmh": ((0.0, float(kmh)),)} for kmh in (70, 89, 98, 106, 118)}
FULL_BRAKE = {
    "holds_speed": False, "speed_kmh": ((0.0, 120.0),),
    "brake_torque": ((0, 0), (8, 0), (8.3, 3600), (10, 3600), (10.2, 0)),
}  # fmt: skip
CORNER = {"speed_kmh": ((0.0, 80.0),), "yaw_rate": ((0, 0), (6, 0), (7, 0.3), (10, 0.3), (12, -0.3), (14, 0))}
SNOW = {
    "lanes": (Lane(6, 14, mu=0.3, slope_factor=0.4),), "speed_kmh": ((0.0, 70.0),), "holds_speed": False,
    "extra_torque": ((0, 200), (7.5, 200), (8.5, 1800), (9.5, 1800), (10, 200)),
}  # fmt: skip
ROUGH = {"lanes": (Lane(6, 14, roughness=150.0),)}
SPIN_UP = {
    "lanes": (lane(6, 11),), "v_full_kmh": 160.0, "v_full_rear_kmh": 88.0, "speed_kmh": ((0.0, 100.0),),
    "holds_speed": False, "extra_torque": ((0, 180), (7, 180), (7.5, 1500), (9.5, 1500), (10, 100)),
}  # fmt: skip

IMITATIONS = {"rough road": ROUGH, "hard braking": FULL_BRAKE, "cornering": CORNER, "snow": SNOW, "dry": {}}


@pytest.mark.parametrize("seed", range(1, 6))
def test_full_spin_down_where_the_contact_is_gone(seed):
    found = events("spin_down", seed=seed, **WATER, **SPEED[118])
    front = [e for e in found if e.wheel in ("fl", "fr")]
    assert any(e.severity == "full" and e.start_s < 6.7 for e in front)
    assert all(e.start_s >= 6.0 for e in front)
    assert all(e.evidence["slip_min"] < -0.03 for e in front)


@pytest.mark.parametrize("kmh", [70, 89])
def test_no_full_spin_down_far_below_full_aquaplaning(kmh):
    assert not [e for e in events("spin_down", **WATER, **SPEED[kmh]) if e.severity == "full"]


@pytest.mark.parametrize("seed", range(1, 6))
def test_minor_spin_downs_near_full_aquaplaning_and_not_far_below(seed):
    near = events("minor_spin_down", seed=seed, **WATER, **SPEED[98])
    assert any(e.wheel == "fr" and 6.0 <= e.start_s < 7.5 for e in near)
    assert all(6.0 <= e.start_s < 14.6 for e in near)
    assert not events("minor_spin_down", seed=seed, **WATER, **SPEED[70])


def test_minor_detector_is_the_more_sensitive_one():
    """C29: large-spin-down detection misses minor ones."""
    counts = dict.fromkeys(("minor_spin_down", "spin_down"), 0)
    for seed in range(1, 9):
        found = events(seed=seed, **WATER, speed_kmh=((0.0, 92.0),))
        for d in counts:
            counts[d] += any(e.detector == d for e in found)
    assert counts["minor_spin_down"] > counts["spin_down"]


def test_watched_axle_follows_the_drivetrain():
    """On a car with driven front wheels the rear ones are watched."""
    assert {e.wheel for e in events("minor_spin_down", vehicle=CAR, **WATER, **SPEED[106])} <= {"fl", "fr"}
    assert {e.wheel for e in events("minor_spin_down", vehicle=AWD, **WATER, **SPEED[106])} <= {"fl", "fr"}
    rear = events("minor_spin_down", vehicle=FWD, v_full_kmh=200.0, v_full_rear_kmh=104.0, **WATER, **SPEED[98])
    assert rear
    assert {e.wheel for e in rear} <= {"rl", "rr"}


@pytest.mark.parametrize("seed", range(1, 4))
def test_spin_up_of_driven_wheels_on_water(seed):
    found = events("spin_up", seed=seed, **SPIN_UP)
    assert found
    assert {e.wheel for e in found} <= {"rl", "rr"}
    assert all(e.evidence["slip_max"] > 0.03 for e in found)
    assert all(7.0 < e.start_s < 11.0 for e in found)


def test_spin_up_without_torque_is_reported_as_judged_in_part():
    drop = tuple(f"torque_{w}" for w in ("fl", "fr", "rl", "rr"))
    signals, _ = drive(CAR, drop=drop, **SNOW)
    result = detect_drive(signals, CAR)
    assert [e for e in result.events if e.detector == "spin_up"]
    assert ("spin_up", ("torque_rl", "torque_rr")) in [(u.detector, u.missing) for u in result.limited]
    assert {u.detector for u in result.unavailable} >= {"resistance", "joint_criteria", "slip_slope_drop"}


@pytest.mark.parametrize("kmh", [70, 89, 98])
def test_resistance_on_water(kmh):
    found = events("resistance", **WATER, **SPEED[kmh])
    assert len(found) == 1
    assert 6.0 < found[0].start_s < 8.5
    assert 14.0 < found[0].end_s < 17.0


def test_joint_needs_resistance_and_a_wheel_criterion():
    """C64."""
    found = events("joint_criteria", **WATER, **SPEED[98])
    assert found
    assert all(e.evidence["criterion_1"] or e.evidence["criterion_2"] or e.evidence["criterion_3"] for e in found)
    assert not events("joint_criteria", **WATER, **SPEED[70])  # resistance alone
    braked = {"locks": ((9.0, 9.6, "fr"),), **FULL_BRAKE}
    assert events("spin_down", **braked)  # a locked wheel alone
    assert not events("joint_criteria", **braked)


def test_full_aquaplaning_is_called_full():
    assert any(e.severity == "full" for e in events("joint_criteria", **WATER, **SPEED[118]))
    assert all(e.severity == "partial" for e in events("joint_criteria", **WATER, **SPEED[89]))


@pytest.mark.parametrize("name", list(IMITATIONS))
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_imitations_raise_no_aquaplaning(name, seed):
    found = events(seed=seed, **IMITATIONS[name])
    assert not [e for e in found if e.detector in ("minor_spin_down", "resistance", "joint_criteria", "spin_up")]
    assert not [e for e in found if e.detector == "spin_down" and not e.evidence["braking"]]


def test_a_locked_wheel_is_told_apart_by_braking():
    found = events("spin_down", locks=((9.0, 9.6, "fr"),), **FULL_BRAKE)
    assert [e.wheel for e in found] == ["fr"]
    assert found[0].evidence["braking"]
    assert found[0].severity == "full"


def test_cornering_would_be_slip_without_yaw_correction():
    signals, _ = drive(CAR, **CORNER)
    with_yaw = detect_drive(signals, CAR).features
    without = detect_drive(signals, CAR, settings=Settings(correct_yaw=False)).features
    for wheel in ("fl", "fr", "rl", "rr"):
        name = f"v_w_delta_{wheel}"
        assert np.nanmax(np.abs(with_yaw[name].to_numpy()[200:])) < 0.15
        assert np.nanmax(np.abs(without[name].to_numpy()[200:])) > 0.15


def test_grade_does_not_look_like_wheel_acceleration():
    """E2: the accelerometer shows 0.49 m/s^2 on a 5 % grade; the wheels must not."""
    grade = ((0, 0.0), (10, 0.0), (12, 0.05), (30, 0.05))
    signals, _ = drive(CAR, duration_s=30.0, grade=grade)
    features = detect_drive(signals, CAR).features
    tail = features["a_w_delta_rl"].to_numpy()[2600:]
    assert abs(tail.mean()) < 0.03


@pytest.mark.parametrize("drop", [("v_x",), ("v_x", "a_x"), ("steer_angle",), ("brake_pressure",)])
def test_coarse_velocity_is_enough(drop):
    """C70: without a reference the same wheels are found."""
    found = events(drop=drop, **WATER, **SPEED[106])
    wheels = {e.wheel for e in found if e.detector == "spin_down"}
    assert {"fl", "fr"} <= wheels
    assert not [e for e in events(drop=drop) if e.detector != "resistance"]


def test_reference_speed_with_a_scale_error_is_no_slip():
    signals, _ = drive(CAR, duration_s=40.0)
    wrong = signals.frame.with_columns(v_x=signals.frame["v_x"] * 1.02)
    result = detect_drive(type(signals)(wrong, signals.dt_ns, None, {}, signals.quality, ()), CAR)
    assert not [e for e in result.events if e.detector != "resistance"]


@pytest.mark.parametrize("rate", [50.0, 100.0, 500.0])
def test_events_do_not_depend_on_the_sample_rate(rate):
    signals, _ = drive(CAR, rate_hz=rate, seed=4, ideal=True, **WATER, **SPEED[106])
    found = detect_drive(signals, CAR).events
    first = {
        d: min(e.start_s for e in found if e.detector == d) for d in ("spin_down", "minor_spin_down", "resistance")
    }
    reference = detect_drive(drive(CAR, seed=4, ideal=True, rate_hz=200.0, **WATER, **SPEED[106])[0], CAR).events
    for detector, at in first.items():
        assert at == pytest.approx(min(e.start_s for e in reference if e.detector == detector), abs=0.06)
    assert not detect_drive(drive(CAR, rate_hz=rate)[0], CAR).events


def test_mirrored_drive_gives_mirrored_events():
    signals, _ = drive(CAR, seed=3, **WATER, **SPEED[106])
    frame = signals.frame
    swap = {}
    for stem in ("omega", "torque"):
        for axle in "fr":
            swap[f"{stem}_{axle}l"], swap[f"{stem}_{axle}r"] = frame[f"{stem}_{axle}r"], frame[f"{stem}_{axle}l"]
    mirrored = frame.with_columns(
        **swap, yaw_rate=-frame["yaw_rate"], a_y=-frame["a_y"], steer_angle=-frame["steer_angle"]
    )
    other = detect_drive(type(signals)(mirrored, signals.dt_ns, None, {}, signals.quality, ()), CAR).events
    flip = {"fl": "fr", "fr": "fl", "rl": "rr", "rr": "rl", None: None}
    mine = sorted((e.detector, flip[e.wheel] or "", e.start_s, e.end_s) for e in detect_drive(signals, CAR).events)
    theirs = sorted((e.detector, e.wheel or "", e.start_s, e.end_s) for e in other)
    assert mine == theirs


def test_common_roughness_drops_out_of_the_front_rear_difference():
    """C32: the same shaking on both axles is the road; on the watched wheel alone it is the wheel."""
    rng = np.random.default_rng(0)
    n = 1000
    shaken, calm = rng.normal(0, 4, n), rng.normal(0, 0.2, n)
    dv, v, free = np.full(n, -1.0), np.full(n, 27.0), np.ones(n, dtype=bool)
    params, state = minor_spin_down.MinorParams.make(0.01), minor_spin_down.initial_state()
    delta, var, alone, _ = minor_spin_down.scan(params, state, shaken, calm, dv, v, free)
    assert alone.any()
    assert np.median(delta[300:] / var[300:]) > 0.8  # C33
    _, _, both, _ = minor_spin_down.scan(params, state, shaken, shaken, dv, v, free)
    assert not both.any()
    _, _, braked, _ = minor_spin_down.scan(params, state, shaken, calm, dv, v, ~free)
    assert not braked.any()


def test_wheel_criteria_without_resistance_are_no_joint_detection():
    """C64: the gate. The same spin-downs with an accelerometer that shows no missing acceleration."""
    signals, _ = drive(CAR, **WATER, **SPEED[98])
    delta = detect_drive(signals, CAR).features["delta_a_x"].fill_nan(0.0)
    dry = signals.frame.with_columns(a_x=signals.frame["a_x"] + delta)
    found = detect_drive(type(signals)(dry, signals.dt_ns, None, {}, signals.quality, ()), CAR).events
    assert [e for e in found if e.detector == "minor_spin_down"]
    assert not [e for e in found if e.detector in ("joint_criteria", "resistance")]


@pytest.mark.parametrize("scale", [0.985, 1.015])
def test_radius_correction_takes_a_scale_error_out(scale):
    signals, _ = drive(CAR, duration_s=60.0)
    wrong = signals.frame.with_columns(v_x=signals.frame["v_x"] * scale)
    features = detect_drive(type(signals)(wrong, signals.dt_ns, None, {}, signals.quality, ()), CAR).features
    for wheel in ("fl", "rr"):
        slip = features[f"v_w_delta_{wheel}"].to_numpy() / features["v_x_hat"].to_numpy()
        assert abs(np.nanmean(slip[-1000:])) < 0.002


def test_a_left_turn_unloads_the_left_wheels():
    """The same torque on both driven wheels is more of the load on the inner one."""
    signals, _ = drive(CAR, speed_kmh=((0.0, 80.0),), yaw_rate=((0, 0), (5, 0), (7, 0.15), (20, 0.15)), ideal=True)
    assert signals.array("a_y")[-1] > 3.0
    features = detect_drive(signals, CAR).features
    assert features["mu_rl"][-1] > 1.1 * features["mu_rr"][-1] > 0


def test_traction_of_a_free_wheel_is_not_charged_with_the_cars_resistance():
    for event in events("minor_spin_down", **WATER, **SPEED[98]):
        assert event.evidence["mu_min"] > -0.25


def test_evidence_of_resistance_leaves_braking_out():
    columns = {"brake_torque": ((0, 0), (11, 0), (11.3, 3600), (12, 3600), (12.2, 0)), "holds_speed": True}
    signals, _ = drive(CAR, **WATER, **SPEED[98], **columns)
    drive_only = signals.frame.with_columns(
        **{f"torque_{w}": signals.frame[f"torque_{w}"].clip(0.0) for w in ("fl", "fr", "rl", "rr")}
    )
    found = detect_drive(type(signals)(drive_only, signals.dt_ns, None, {}, signals.quality, ()), CAR).events
    resistance = [e for e in found if e.detector == "resistance"]
    assert resistance
    assert all(e.evidence["delta_a_x_max"] < 3.0 for e in resistance)  # the brake alone makes 7
