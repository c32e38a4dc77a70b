"""Rivals on drives: what their idea sees, what it does not, and what all have in common."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from aqualog.core.errors import ConfigError
from aqualog.core.notation import WHEELS
from aqualog.detect.registry import RIVALS
from aqualog.detect.stream import run_rivals
from tests.drives import AWD, CAR, FWD, drive, lane
from tests.straight_drive import RWD
from tests.straight_drive import drive as straight

KNOWN = frozenset({"drivetrain", "mass", "l_f", "l_r", "tyre.slip_slope_f", "tyre.slip_slope_r"})
NAMES = tuple(RIVALS)
SLOPES = ("slope_rls", "slope_kalman", "slope_friction_ekf")
WHEEL_RIVALS = ("wheel_thresholds", "front_rear_pattern", "wheel_oscillation")
LANE = (12.0, 18.0)


def wet_drive(vehicle=CAR, seed=2, **kw):
    signals, _ = drive(vehicle, duration_s=26.0, seed=seed, speed_kmh=((0.0, 112.0),), lanes=(lane(*LANE),), **kw)
    return signals


def dry_drive(vehicle=CAR, seed=2, **kw):
    speed = ((0.0, 60.0), (10.0, 60.0), (30.0, 120.0), (45.0, 120.0), (60.0, 80.0))
    return drive(vehicle, duration_s=60.0, seed=seed, speed_kmh=speed, **kw)[0]


def soft_road(car=RWD, soft=6.0, **kw):
    """A straight drive whose road yields from 120 s on."""
    slope = np.where(np.arange(4800) / 20.0 < 120.0, 31.0, soft)
    return straight(replace(car, given=KNOWN), slope=slope, **kw), replace(car, given=KNOWN)


@pytest.fixture(scope="module")
def wet():
    return run_rivals(wet_drive(), CAR)


@pytest.mark.parametrize("name", [*WHEEL_RIVALS, "resistance_model"])
def test_alarms_on_water(wet, name):
    events = [e for e in wet.events if e.detector == name]
    assert events
    assert LANE[0] <= events[0].start_s <= LANE[0] + 2.0
    assert all(e.peak > e.threshold == RIVALS[name].threshold for e in events)
    t = np.arange(wet.tracks[0].active.size) / 100.0
    assert not np.any([x.active for x in wet.tracks if x.detector == name], axis=0)[t < LANE[0]].any()


def test_deep_spin_down_is_full(wet):
    found = [e for e in wet.events if e.detector == "wheel_thresholds"]
    assert {e.severity for e in found if e.evidence["slip_min"] < -0.25} == {"full"}
    assert any(e.severity == "full" for e in found)
    assert {e.severity for e in wet.events if e.detector == "front_rear_pattern"} == {"partial"}


@pytest.mark.parametrize("name", SLOPES)
def test_alarms_on_a_road_that_yields(name):
    signals, car = soft_road()
    result = run_rivals(signals, car, names=[name])
    assert {e.wheel for e in result.events} == {"rl", "rr"}
    assert min(e.start_s for e in result.events) >= 120.0
    assert min(e.start_s for e in result.events) < 150.0


@pytest.mark.parametrize("name", SLOPES)
def test_own_first_part_is_the_reference_where_the_file_has_none(name):
    signals, _ = soft_road()
    result = run_rivals(signals, RWD, names=[name])
    (first, *_) = result.tracks
    assert np.isnan(first.statistic[: round(40.0 * 20.0)]).all()
    assert min(e.start_s for e in result.events) >= 120.0


@pytest.mark.parametrize("name", SLOPES)
def test_all_wheel_drive_against_a_late_reference(name):
    car = replace(AWD, given=KNOWN)
    signals = straight(car, late_v=0.15, slope=31.0)
    result = run_rivals(signals, car, names=[name])
    assert result.tracks
    # the lag is learnt in the first half minute
    assert not [e for e in result.events if e.start_s > 60.0]
    soft = straight(car, late_v=0.15, slope=np.where(np.arange(4800) / 20.0 < 120.0, 31.0, 6.0))
    assert [e for e in run_rivals(soft, car, names=[name]).events if 120.0 <= e.start_s < 150.0]


@pytest.mark.parametrize("vehicle", [CAR, FWD, AWD], ids=lambda v: v.drivetrain)
def test_silent_on_the_dry(vehicle):
    for seed in (2, 3):
        result = run_rivals(dry_drive(vehicle, seed=seed), vehicle)
        assert not result.unavailable
        assert not result.events


def test_a_bump_under_both_axles_is_no_pattern():
    from tests.small_model import Lane

    rough = (Lane(15.0, 50.0, roughness=60.0),)
    result = run_rivals(dry_drive(lanes=rough), CAR, names=["front_rear_pattern"])
    assert not result.events


@pytest.mark.parametrize("is_bump", [True, False])
def test_a_dip_that_the_rear_wheel_repeats_is_a_bump(is_bump):
    signals, _ = drive(CAR, duration_s=30.0, seed=2, speed_kmh=((0.0, 90.0),))
    frame = signals.frame
    for wheel, late in (("fl", 0.0), ("rl", CAR.wheelbase / 25.0))[: 2 if is_bump else 1]:
        share = pl.when((pl.col("t") >= 20.0 + late) & (pl.col("t") < 20.08 + late)).then(0.95).otherwise(1.0)
        frame = frame.with_columns(pl.col(f"omega_{wheel}") * share)
    result = run_rivals(replace(signals, frame=frame), CAR, names=["front_rear_pattern"])
    assert [e.wheel for e in result.events] == ([] if is_bump else ["fl"])


def test_a_grade_is_no_resistance():
    hills = ((0.0, 0.0), (12.0, 0.0), (14.0, -0.06), (24.0, -0.06), (28.0, 0.06), (38.0, 0.06))
    signals, _ = drive(CAR, duration_s=40.0, seed=2, speed_kmh=((0.0, 90.0),), grade=hills)
    (track,) = run_rivals(signals, CAR, names=["resistance_model"]).tracks
    assert np.nanmax(np.abs(track.statistic[500:])) < 0.2


def test_braking_has_its_own_levels():
    brake = ((0.0, 0.0), (20.0, 0.0), (20.2, 4200.0), (22.0, 4200.0), (22.1, 0.0))
    signals, _ = drive(CAR, duration_s=26.0, seed=4, speed_kmh=((0.0, 110.0),), brake_torque=brake)
    assert not run_rivals(signals, CAR, names=["wheel_thresholds", "resistance_model"]).events


@pytest.mark.parametrize(
    ("name", "vehicle", "gone", "missing"),
    [
        ("wheel_thresholds", CAR, ["omega_fr"], ("omega_fr",)),
        ("front_rear_pattern", CAR, ["omega_fr", "omega_rl"], ("omega_fr", "omega_rl")),
        ("wheel_oscillation", CAR, ["omega_rr"], ("omega_rr",)),
        ("resistance_model", CAR, ["a_x", "torque_rl"], ("torque_rl", "a_x")),
        ("resistance_model", replace(CAR, given=frozenset()), [], ("vehicle.drivetrain", "vehicle.mass")),
        *((n, CAR, ["torque_rr"], ("torque_rr",)) for n in SLOPES),
        *((n, AWD, ["v_x"], ("v_x",)) for n in SLOPES),
        *((n, AWD, ["a_x"], ("a_x",)) for n in SLOPES),
    ],
)
def test_refuses_with_the_names_of_what_is_missing(name, vehicle, gone, missing):
    signals = drive(vehicle, duration_s=3.0, drop=gone)[0]
    result = run_rivals(signals, vehicle, names=[name])
    assert [(u.detector, u.missing) for u in result.unavailable] == [(name, missing)]
    assert not result.tracks


def test_slow_wheel_speeds_have_no_oscillation():
    signals = drive(CAR, duration_s=3.0, rate_hz=50.0)[0]
    (gone,) = run_rivals(signals, CAR).unavailable
    assert gone.detector == "wheel_oscillation"
    assert gone.missing == ("wheel speeds at 80 Hz or more",)
    fast = drive(CAR, duration_s=3.0, rate_hz=80.0)[0]
    assert not run_rivals(fast, CAR).unavailable


def test_nothing_at_all_is_named():
    signals = drive(CAR, duration_s=3.0)[0]
    empty = replace(signals, frame=signals.frame.select("t"))
    result = run_rivals(empty, CAR)
    assert {u.detector for u in result.unavailable} == set(NAMES)


def with_gaps(signals, spans, symbols):
    frame = signals.frame.with_columns(
        pl.when(pl.any_horizontal(*[(pl.col("t") >= a) & (pl.col("t") < b) for a, b in spans]))
        .then(None)
        .otherwise(pl.col(s))
        .alias(s)
        for s in symbols
    )
    return replace(signals, frame=frame)


@pytest.mark.parametrize("symbols", [[f"omega_{w}" for w in WHEELS], ["a_x", "torque_rl", "torque_rr"], ["yaw_rate"]])
def test_gaps_on_the_dry_raise_no_alarm(symbols):
    spans = [(8.0, 8.2), (20.0, 21.5), (33.0, 33.01)]
    result = run_rivals(with_gaps(dry_drive(), spans, symbols), CAR)
    assert not result.events
    for track in result.tracks:
        assert np.isfinite(track.statistic).any(), track.detector
        assert not track.active[np.isnan(track.statistic)].any()


def test_a_wheel_that_is_missing_has_no_statistic():
    result = run_rivals(with_gaps(dry_drive(), [(30.0, 31.0)], ["omega_fl"]), CAR)
    for track in result.tracks:
        if track.wheel == "fl" and track.detector in ("wheel_thresholds", "wheel_oscillation"):
            assert np.isnan(track.statistic[3005:3095]).all()


def test_water_is_found_behind_a_gap():
    signals = with_gaps(wet_drive(), [(5.0, 6.0)], [f"omega_{w}" for w in WHEELS])
    result = run_rivals(signals, CAR, names=[*WHEEL_RIVALS, "resistance_model"])
    assert {e.detector for e in result.events if LANE[0] <= e.start_s < LANE[1]} == {t.detector for t in result.tracks}


def test_truth_and_labels_are_not_read_and_the_bits_are_the_same_every_time(wet):
    signals = wet_drive()
    lie = np.where(np.arange(signals.frame.height) % 2, 1.0, np.nan)
    frame = signals.frame.with_columns(pl.Series("true_contact_fl", lie), pl.Series("on_water", lie))
    again = run_rivals(replace(signals, frame=frame), CAR)
    assert again.events == wet.events
    for a, b in zip(again.tracks, wet.tracks, strict=True):
        np.testing.assert_array_equal(a.statistic, b.statistic)


@pytest.mark.parametrize("name", NAMES)
def test_a_larger_threshold_never_sets_a_bit(name):
    signals, car = soft_road() if name in SLOPES else (wet_drive(), CAR)
    before, times = None, []
    for factor in (0.1, 0.5, 1.0, 1.2, 4.0):
        result = run_rivals(signals, car, {name: factor * RIVALS[name].threshold}, [name])
        bits = np.array([t.active for t in result.tracks])
        if before is not None:
            assert not (bits & ~before).any()
        before = bits
        times.append(int(bits.sum()))
    assert times[0] > times[-1]


def test_thresholds_and_names_are_checked():
    signals = drive(CAR, duration_s=2.0)[0]
    with pytest.raises(ConfigError, match="slope_rls"):
        run_rivals(signals, CAR, names=["slope_rsl"])
    with pytest.raises(ConfigError, match="no rival 'x'"):
        run_rivals(signals, CAR, {"x": 1.0})
    for bad in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ConfigError, match="not positive"):
            run_rivals(signals, CAR, {"slope_rls": bad})


def test_order_and_references_of_the_catalogue():
    assert NAMES == (
        "wheel_thresholds", "front_rear_pattern", "wheel_oscillation", "resistance_model", "slope_rls", "slope_kalman",
        "slope_friction_ekf",
    )  # fmt: skip
    assert all(rival.reference.startswith("[") for rival in RIVALS.values())


def test_a_drive_of_one_sample():
    signals = drive(CAR, duration_s=2.0)[0]
    result = run_rivals(replace(signals, frame=signals.frame.head(1)), CAR)
    assert not result.events
