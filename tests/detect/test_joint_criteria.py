"""Joint detectors: truth table, terms of the sum, what decides, and where a lost slope counts."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from aqualog.core.notation import WHEELS
from aqualog.core.records import Track
from aqualog.detect import joint_criteria, joint_cusum, other_surface
from aqualog.detect.detector import JointCusumParams, Scene, Settings, Setup
from aqualog.detect.events import EventBook
from aqualog.detect.joint_criteria import GATE, GATE_AFTER, JOINT_CRITERIA, MAY_BE_WATER, ROTATES
from aqualog.detect.joint_cusum import JOINT_CUSUM, TERMS
from aqualog.detect.resistance import MEASURE
from aqualog.detect.stream import detect_drive
from aqualog.detect.verdict import JOINT
from aqualog.model import situations
from aqualog.model.log import as_signals
from aqualog.model.simulate import simulate
from tests.detect import episode_study
from tests.drives import CAR, drive, lane

DT = 0.01
N = 200
NOTHING = np.zeros(N, dtype=bool)


def scene(tracks=(), x=0.3, v_x=27.0, **shared):
    features = {"v_x_hat": np.full(N, v_x), "delta_a_x": np.full(N, 0.3), "criterion_full": np.zeros(N)}
    features |= {f"v_w_{w}": np.full(N, v_x) for w in WHEELS} | {"a_y_slow": np.zeros(N), "yaw_rate_slow": np.zeros(N)}
    shared = {
        MEASURE: np.broadcast_to(x, (N,)).astype(float),
        GATE: ~NOTHING,
        GATE_AFTER: np.zeros(N),
        MAY_BE_WATER: ~NOTHING,
        ROTATES: NOTHING,
    } | shared
    return Scene(features, dict.fromkeys(WHEELS, NOTHING), tracks=tuple(tracks), shared=shared)


def track(detector, bits, wheel="fr", statistic=None):
    bits = np.broadcast_to(np.asarray(bits, dtype=bool), (N,)).copy()
    statistic = bits.astype(float) if statistic is None else np.broadcast_to(statistic, (N,)).astype(float)
    return Track(detector, None if detector == "resistance" else wheel, "right", "-", statistic, 0.5, bits)


def watched(detector, seen, settings=None, threshold=None, car=CAR):
    """Track, event at the end of the drive (or None), and features of one piece."""
    setup = Setup(detector, car, DT, threshold or detector.threshold, settings or Settings())
    output = detector.start(setup).push(seen)
    ((found, evidence),) = output.found
    book = EventBook(10_000_000)
    book.take(found, evidence, detector.severity, detector.explain)
    return found, next(iter(book.finish()), None), output.features


def warned(criteria, gate, *, slope=True):
    tracks = [track(d, k in criteria) for d, k in joint_criteria.CRITERIA.items()]
    seen = scene(tracks, x=0.3 if gate else 0.0, v_x=27.0 if slope else 16.0)  # at 16 m/s no film takes half the slope
    return bool(watched(JOINT_CRITERIA, seen)[0].active.any())


@pytest.mark.parametrize("criteria", [c for r in range(6) for c in itertools.combinations(range(1, 6), r)])
@pytest.mark.parametrize("gate", [False, True])
def test_c64_warning_is_the_gate_and_at_least_one_other(criteria, gate):
    """Truth table over all 64 rows: resistance by itself (5) is its own indicator, never a joint warning."""
    assert warned(criteria, gate) == (gate and any(k in criteria for k in (1, 2, 3, 4)))


def test_a_lost_slope_that_cannot_be_waters_does_not_warn():
    assert warned((4,), True)
    assert not warned((4,), True, slope=False)
    assert warned((2, 4), True, slope=False)


def test_the_warning_names_what_decided():
    late = np.arange(N) > 60
    tracks = [track("minor_spin_down", np.arange(N) > 20), track("spin_down", late), track("resistance", late)]
    _, event, features = watched(JOINT_CRITERIA, scene(tracks, x=np.where(np.arange(N) > 26, 0.3, 0.0)))
    assert event.start_s == pytest.approx(0.41)  # the gate opens
    assert event.evidence["decided_by"] == ["minor_spin_down"]
    assert event.evidence["criterion_1"]
    assert event.evidence["criterion_5"]
    assert not event.evidence["criterion_3"]
    assert not any(k.startswith("at_start") for k in event.evidence)
    assert features["criterion_2"][30] == 1.0
    assert features["joint_gate"][30] == 0.0


def test_a_warning_begins_only_where_the_resistance_is_known():
    """The gate stays open for a second, also where the balance of forces has no value."""
    x = np.where(np.arange(N) < 30, 0.3, np.nan)
    seen = scene([track("spin_down", np.arange(N) > 50)], x=x)
    shown, _, features = watched(JOINT_CRITERIA, seen)
    assert features["joint_gate"][55] == 1.0
    assert not shown.active.any()


def test_a_criterion_that_began_under_braking_does_not_count():
    seen = scene([track("spin_down", np.arange(N) > 10)])
    assert watched(JOINT_CRITERIA, seen)[0].active.any()
    braking = dict.fromkeys(WHEELS, np.arange(N) < 30)
    assert not watched(JOINT_CRITERIA, replace(seen, braking=braking))[0].active.any()


@pytest.mark.parametrize(("drivetrain", "variance", "braked", "counts"), [
    ("awd", 2.2, False, True), ("awd", 4.0, False, False), ("awd", 2.2, True, False), ("rwd", 2.2, False, False),
])  # fmt: skip
def test_a_driven_wheel_that_shakes_need_not_fall_behind_the_car(drivetrain, variance, braked, counts):
    """Its torque swings it both ways; a free wheel that is not behind the car has a bump (C66)."""
    seen = scene([track("minor_spin_down", False, statistic=2.0)])
    seen = replace(seen, f=seen.f | {"variance_fr": np.full(N, variance)})
    seen = replace(seen, braking=dict.fromkeys(WHEELS, ~NOTHING if braked else NOTHING))
    car = replace(CAR, drivetrain=drivetrain)
    assert watched(JOINT_CRITERIA, seen, car=car)[0].active.any() == counts


ALL = {"spin_up": 1.5, "spin_down": 1.5, "resistance": 0.3, "minor_spin_down": 4.0, "slip_slope_drop": 0.75}


def of(p, statistics, g_variance=0.0):
    tracks = [(track(d, True, statistic=x), np.ones(N, dtype=bool)) for d, x in statistics.items()]
    return joint_cusum.terms(p, tracks, np.full(N, g_variance), N)


def test_c71_the_sum_of_scaled_terms():
    """(2.11) by hand: 0.3/1.5 + 0.6/1.5 + 0.15/0.3 + (2.25 - 0.5)/(4 - 0.5), the slope left out."""
    p = JointCusumParams(with_slope=False)
    parts = of(
        p, {"spin_up": 0.3, "spin_down": 0.6, "resistance": 0.15, "minor_spin_down": 2.25, "slip_slope_drop": 0.9}
    )
    assert sum(x[0] for x in parts.values()) == pytest.approx(0.2 + 0.4 + 0.5 + 0.5, abs=1e-12)
    assert parts["slip_slope_drop"].max() == 0.0


@pytest.mark.parametrize("name", TERMS)
def test_each_term_ends_at_its_weight_and_never_is_negative(name):
    for value, expected in ((-5.0, 0.0), (0.0, 0.0), (ALL[name], 1.0), (100.0, 1.0), (np.nan, 0.0)):
        parts = of(JointCusumParams(), {name: value})
        assert parts[name] == pytest.approx(expected)
    weights = tuple(2.0 if n == name else 0.0 for n in TERMS)
    parts = of(JointCusumParams(weights=weights), ALL)
    assert {n: x[0] for n, x in parts.items()} == {n: 2.0 if n == name else 0.0 for n in TERMS}


def test_e6_the_third_term_can_be_the_variance():
    p = JointCusumParams(third="variance")
    parts = of(p, {"resistance": 0.3}, g_variance=0.25)
    assert parts["resistance"] == pytest.approx(0.25)


def test_the_largest_wheel_decides_and_braked_wheels_do_not_count():
    p = JointCusumParams()
    tracks = [
        (track("spin_down", True, "fl", 0.3), np.ones(N, dtype=bool)),
        (track("spin_down", True, "fr", 0.9), np.ones(N, dtype=bool)),
        (track("spin_down", True, "rl", 1.5), np.zeros(N, dtype=bool)),
    ]
    assert joint_cusum.terms(p, tracks, np.zeros(N), N)["spin_down"] == pytest.approx(0.6)


def test_the_sum_warns_above_its_threshold_and_names_the_terms():
    ramp = np.clip((np.arange(N) - 50) * 0.01, 0.0, 1.0)
    tracks = [track("resistance", True, statistic=0.3), track("spin_down", True, statistic=1.5 * ramp)]
    found, event, features = watched(JOINT_CUSUM, scene(tracks), threshold=1.2)
    first = np.flatnonzero(found.active)[0]
    assert first == 71  # 1 + 0.21 > 1.2
    assert found.statistic == pytest.approx(1.0 + ramp)
    assert features["joint_term_resistance"] == pytest.approx(1.0)
    assert event.evidence["decided_by"] == ["resistance", "spin_down"]
    assert event.severity == "partial"  # no wheel has lost the road


@pytest.mark.parametrize(
    ("mu", "is_alarm", "counts"), [(0.98, False, False), (0.05, False, True), (0.98, True, True), (None, False, True)]
)
def test_a_wheel_that_spins_up_with_its_traction_does_not_count(mu, is_alarm, counts):
    """A front wheel under full throttle on a dry road, of which the resistance takes 0.25 m/s² (C27)."""
    tracks = [track("resistance", True, statistic=0.1), track("spin_up", is_alarm, "fl", 3.0)]
    seen = scene(tracks)
    if mu is not None:
        seen = replace(seen, f={**seen.f, "mu_fl": np.full(N, mu)})
    found, _, features = watched(JOINT_CUSUM, seen)
    assert found.active.all() == counts
    assert features["joint_term_spin_up"] == pytest.approx(1.0 if counts else 0.0)


@pytest.mark.parametrize("gated", [True, False])
def test_without_resistance_the_sum_does_not_warn_unless_asked_to(gated):
    tracks = [track("spin_up", True, statistic=1.5), track("spin_down", True, statistic=1.5)]
    settings = Settings(joint_cusum=JointCusumParams(gated=gated))
    seen = scene(tracks, x=0.0, **{GATE: NOTHING})
    found, _, _ = watched(JOINT_CUSUM, seen, settings, threshold=1.2)
    assert found.active.all() != gated
    assert found.statistic == pytest.approx(2.0)


def allowed(x, v_x, dropped, loss):
    n = len(x)
    args = (np.broadcast_to(a, (n,)) for a in (x, v_x, dropped, loss))
    bits, _ = other_surface.scan(other_surface.OtherParams.make(DT), other_surface.initial_state(), *args)
    return bits


def test_a_lost_slope_counts_with_the_resistance_of_water_only():
    n = 500
    assert allowed(np.full(n, 0.3), 25.0, True, 0.6)[-1]
    assert not allowed(np.full(n, 0.15), 25.0, True, 0.6).any()  # compacted snow
    assert not allowed(np.full(n, 0.3), 15.0, True, 0.6).any()  # too slow for a film to lift half of the contact


def test_a_slope_lost_at_low_speed_stays_anothers_until_the_road_is_dry_again():
    slow, fast, dry = np.full(300, 12.0), np.full(500, 25.0), np.full(1200, 25.0)
    v = np.concatenate([slow, fast, dry, fast])
    dropped = np.concatenate([np.ones(800), np.zeros(1200), np.ones(500)]).astype(bool)
    loss = np.where(dropped, 0.6, 0.05)
    bits = allowed(np.full(v.size, 0.4), v, dropped, loss)
    assert not bits[300:800].any()
    assert bits[2050:].all()


@pytest.mark.parametrize(("road", "limit"), [("water", 0.5), ("ice", np.nan)])
def test_water_stops_a_braked_wheel_and_ice_turns_it_up_again(road, limit):
    """Only in water a wheel slows down further while its brake is let off; the gate of the resistance is shut."""
    for seed in range(4):
        (full, _), false, _ = episode_study.stop(road, seed, episode_study.SCORING_POOL)
        assert np.isnan(full) or full <= limit
        assert not false


@pytest.mark.parametrize(("seed", "kind"), [(7013, "curve 1.0"), (7038, "curve 0.75"), (7007, "lane_change 1.0")])
def test_water_is_found_while_stability_control_brakes_single_wheels(seed, kind):
    (_, partial), _, _ = episode_study.controlled(f"water {kind}", seed, episode_study.SCORING_POOL)
    assert partial <= 2.0
    assert episode_study.controlled(f"dry {kind}", seed, episode_study.SCORING_POOL)[1] == []


def test_water_is_found_under_a_light_braking_that_may_be_in_no_torque():
    """A driver who rolls brakes with half a bar; the resistance is not judged, and both front wheels stop."""
    drawn = situations.draw("lane_coasting", 20086, episode_study.SCORING_POOL)
    found = detect_drive(as_signals(simulate(drawn.scenario, drawn.model), vehicle=drawn.believed), drawn.believed)
    assert not found.features["joint_gate"].to_numpy()[1405:1700].any()
    assert [e.start_s < 14.6 for e in found.events if e.detector == "joint_criteria"] == [True]


def test_a_log_that_begins_on_water():
    """Its offset is learnt in water, and no minor spin-down begins in the first three seconds."""
    found = detect_drive(drive(duration_s=7.0, lanes=(lane(0.0, 5.0),), speed_kmh=((0.0, 92.0),), seed=2)[0], CAR)
    first = next(e for e in found.events if e.detector == "joint_criteria")
    assert first.start_s < 2.0
    assert first.evidence["decided_by"] == ["margin"]


def test_a_log_that_begins_on_gravel():
    """Slip, resistance and shake are those of water, but both axles shake."""
    drawn = situations.draw("gravel", 7058, episode_study.SCORING_POOL)
    signals = as_signals(simulate(replace(drawn.scenario, duration_s=4.0)), vehicle=drawn.believed)
    found = detect_drive(signals, drawn.believed)
    assert found.features["water_probability"].max() > 0.5
    assert not [e for e in found.events if e.detector in JOINT]


def turning(joint, seen, yaw_rate, a_y=0.0):
    """Where a joint detector warns (n,), the second one with what the first one says of the car's rotation."""
    # a spin-up would need less traction to begin
    f = {"yaw_rate_slow": yaw_rate, "a_y_slow": a_y, "a_kin_slow": 0.0, "mu_fr": 0.2}
    seen = replace(seen, f=seen.f | {n: np.broadcast_to(x, (N,)) for n, x in f.items()})
    first = JOINT_CRITERIA.start(Setup(JOINT_CRITERIA, CAR, DT, JOINT_CRITERIA.threshold, Settings()))
    return watched(joint, replace(seen, shared=seen.shared | {ROTATES: first.push(seen).shared[ROTATES]}))[0].active


@pytest.mark.parametrize("joint", [JOINT_CRITERIA, JOINT_CUSUM])
@pytest.mark.parametrize(("detector", "yaw_rate", "a_y", "counts"), [
    ("spin_down", 0.2, 0.0, True), ("spin_down", 1.0, 0.0, False), ("spin_up", 0.2, 0.0, False), ("spin_up", 1.0, 0.0, False),
    ("minor_spin_down", 0.2, 0.0, True), ("minor_spin_down", 1.0, 0.0, False),
    ("spin_up", 0.3, 8.1, True), ("spin_up", 0.3, -8.1, False), ("spin_down", 0.3, 8.1, True), ("spin_down", 0.3, -8.1, False),
])  # fmt: skip
def test_wheels_of_a_car_that_spins_round_are_no_evidence(joint, detector, yaw_rate, a_y, counts):
    """At 27 m/s: beyond 3 m/s² of drift no spin-up counts, beyond 9.8 m/s² no wheel; a left turn has both positive."""
    seen = scene([track("resistance", True, statistic=0.1), track(detector, True, statistic=5.0)])
    assert turning(joint, seen, 0.0).any()
    assert turning(joint, seen, yaw_rate, a_y).any() == counts


@pytest.mark.parametrize("joint", [JOINT_CRITERIA, JOINT_CUSUM])
def test_a_car_that_swings_from_one_side_to_the_other_still_spins(joint):
    seen = scene([track("resistance", True, statistic=0.3), track("spin_down", True, statistic=5.0)])
    active = turning(joint, seen, np.where(np.arange(N) < 20, 1.0, 0.0))
    assert np.flatnonzero(active)[0] == pytest.approx(20 + 0.5 / DT, abs=1)
