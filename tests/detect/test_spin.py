"""Large spins of one wheel: when an alarm may begin, and how severe a spin-up is."""

from dataclasses import replace

import numpy as np
import pytest

from aqualog.core.notation import WHEELS
from aqualog.core.records import Track
from aqualog.detect import spin as gate
from aqualog.detect.braking import UNLOGGED
from aqualog.detect.detector import Scene, Setup
from aqualog.detect.events import EventBook
from aqualog.detect.joint_criteria import GATE, GATE_AFTER, MAY_BE_WATER, ROTATES
from aqualog.detect.joint_cusum import JOINT_CUSUM
from aqualog.detect.resistance import MEASURE, RESISTANCE
from aqualog.detect.spin import HELD_BACK, HELD_S, SPIN_DOWN, SpinParams, SpinWatch, initial_state, scan
from aqualog.detect.spin_up import SPIN_UP
from aqualog.features.stream import FeatureStream
from aqualog.features.velocity import initial_state as initial_motion
from aqualog.features.velocity import observe, params_from_seconds
from aqualog.model.programme import SEDAN
from tests.straight_drive import RWD, drive

DT = 0.01
N = 100


def spin(sign, allowed):
    """A wheel that gains (loses) 20 m/s² from 0.2 s on for 0.5 s; bits of the detector."""
    t = np.arange(N) * DT
    a = np.where((t >= 0.2) & (t < 0.7), 20.0, 0.0)
    dv = np.cumsum(a) * DT
    p, v = SpinParams.make(sign, DT), np.full(N, 25.0)
    whole = scan(p, initial_state(), sign * a, sign * dv, v, allowed)[1]
    for cut in (1, 25, 33, 60):
        state, bits = initial_state(), []
        for part in (slice(None, cut), slice(cut, None)):
            _, own, state = scan(p, state, sign * a[part], sign * dv[part], v[part], allowed[part])
            bits.append(own)
        assert np.array_equal(np.concatenate(bits), whole)
    return whole


@pytest.mark.parametrize(("length", "begins"), [(0.5 * HELD_S, False), (2.0 * HELD_S, True)])
def test_a_spin_up_needs_lost_traction_for_a_while(length, begins):
    """On snow the traction passes the limit for a moment while the driver goes from braking to driving (C27)."""
    t = np.arange(N) * DT
    allowed = (t >= 0.4) & (t < 0.4 + length)
    assert spin(1.0, allowed).any() == begins


@pytest.mark.parametrize(("yaw_rate", "held", "begins"), [(0, 1, True), (0.1, 1, True), (0.5, 1, False), (0, 0, False)])
def test_a_car_that_spins_round_or_that_nothing_holds_back_has_no_spin_up(yaw_rate, held, begins):
    one = np.ones(40)
    f = {
        f"{n}_{w}": x * one
        for w in WHEELS
        for n, x in (("a_w_delta", 10.0), ("v_w_delta", 3.0), ("mu_res", 0.02), ("v_w", 23.0))
    }
    f |= {"v_x_hat": 20.0 * one, "a_y_slow": 0.0 * one, "yaw_rate_slow": yaw_rate * one}
    watch = SpinWatch(Setup(SPIN_UP, SEDAN, 0.01, 0.6), sign=1.0)
    scene = Scene(f, dict.fromkeys(WHEELS, one < 0), shared={HELD_BACK: one == held})
    found = watch.push(scene).found
    assert [track.active.any() for track, _ in found] == [begins, begins]
    # nor does a wheel that has not begun one count in the sum, but for its gate
    bare = tuple(replace(track, active=one < 0) for track, _ in found)
    more = {"delta_a_x": one, "criterion_full": one}
    shared = {MEASURE: one, GATE: one > 0, GATE_AFTER: one, MAY_BE_WATER: one > 0, ROTATES: one < 0}
    output = JOINT_CUSUM.start(Setup(JOINT_CUSUM, SEDAN, 0.01, 1.0)).push(
        Scene(f | more, scene.braking, {}, bare, shared)
    )
    assert (output.features["joint_term_spin_up"] > 0.0).any() == (yaw_rate < 0.5)


def test_water_holds_a_car_back_and_ice_does_not():
    """0.3 m/s² shows within 0.2 s and is remembered for 1 s; a measure that is not known rules nothing out."""
    t = np.arange(500) * DT
    x = np.where((t > 1.0) & (t < 1.5), 0.3, np.where(t > 4.0, np.nan, 0.0))
    f = {"delta_a_x": x, "v_x_hat": 25.0 + 0.0 * t, "a_kin_slow": 0.0 * t, "a_y_slow": 0.0 * t}
    watch = RESISTANCE.start(Setup(RESISTANCE, SEDAN, DT, 0.2))
    held = watch.push(Scene(f, dict.fromkeys((*WHEELS, UNLOGGED), t < 0.0))).shared[HELD_BACK]
    assert held[100:401:10].tolist() == [0.0] * 2 + [1.0] * 17 + [0.0] * 12
    assert held[402:].all()


def test_a_gap_of_the_lateral_acceleration_is_no_slide():
    t = np.arange(400) * DT
    v, yaw_rate = np.full(400, 20.0), np.full(400, 0.25)
    columns = {"v_x": v, "a_x": 0.0 * v, "a_y": np.where((t > 2.0) & (t < 3.0), np.nan, 5.0), "yaw_rate": yaw_rate}
    columns |= {f"omega_{w}": v / SEDAN.r_e(w) for w in WHEELS}
    f = FeatureStream(SEDAN, DT, columns).push(columns)
    assert f["a_y_slow"][100:] == pytest.approx(5.0, rel=0.01)


@pytest.mark.parametrize("every", [2, 10])
def test_lost_samples_leave_a_slide_known(every):
    """A car that slides while it turns: all of its acceleration, -0.5 m/s² after 2 s, is that of its turning."""
    t, wheels = np.arange(200) * DT, np.full((4, 200), np.nan)
    v, lossy = 20.0 - 0.125 * t * t, np.arange(200) % every == 0
    a_y = np.where(lossy, np.nan, 0.5 - 0.5 * v)  # the drift to the left grows by 0.5 m/s² at a yaw rate of -0.5 rad/s
    p = params_from_seconds(DT, has_accelerometer=True)
    _, a, _, _ = observe(p, initial_motion(), v, wheels, 0.0 * t, a_y, 0.0 * t - 0.5, weights=np.ones(4))
    assert a[-1] < -0.1


def test_a_spin_down_does_not_wait():
    bits = spin(-1.0, np.ones(N, dtype=bool))
    assert bits.any()
    first = np.flatnonzero(bits)[0]
    alone = np.arange(N) == first
    assert spin(-1.0, alone)[first]


def test_a_spin_up_is_full_where_the_traction_is_lost_for_most_of_it():
    assert SPIN_UP.severity({"mu_lost": 0.6, "mu_min": -0.1, "duration_s": 0.1}) == "full"
    assert SPIN_UP.severity({"mu_lost": 1.0, "duration_s": 0.04}) == "partial"  # a gap of the contact (C67)
    assert SPIN_UP.severity({"mu_lost": 0.4, "duration_s": 9.0}) == "partial"  # one moment of changing torque
    assert SPIN_UP.severity({"duration_s": 1.0}) == "partial"
    assert SPIN_DOWN.severity({"slip_min": -0.3}) == "full"


@pytest.mark.parametrize("cuts", [(), (5,), (3, 4, 17)])
def test_shares_are_the_same_however_a_drive_is_cut(cuts):
    bits = np.zeros(30, dtype=bool)
    bits[2:22] = True
    lost = np.where(np.arange(30) % 3 == 0, 1.0, 0.0)
    lost[6] = np.nan
    book, events = EventBook(10_000_000), []
    for part in np.split(np.arange(30), cuts):
        track = Track("spin_up", "rl", None, "m/s", np.ones(part.size), 0.6, bits[part])
        events += book.take(track, {"mu_lost": ("share", lost[part])}, SPIN_UP.severity)
    events += book.finish()
    known = lost[2:22][np.isfinite(lost[2:22])]
    assert events[0].evidence["mu_lost"] == np.count_nonzero(known) / known.size


def test_without_torque_a_spin_up_counts_in_a_drifting_car_too():
    f = {"a_y_slow": np.full(3, 9.0), "v_x_hat": np.full(3, 20.0), "yaw_rate_slow": np.full(3, 0.01)}
    assert gate.has_lost_traction(f, "rl").all()
    assert not gate.has_lost_traction(f | {"mu_rl": np.zeros(3)}, "rl").any()
    assert gate.has_lost_traction(f | {"mu_rl": np.zeros(3), "yaw_rate_slow": np.zeros(3)}, "rl").all()  # not logged


@pytest.mark.parametrize("inertia", [0.0, 4.0])
def test_shaken_wheels_are_no_resistance(inertia):
    """Each wheel alone at 9 to 15 Hz, 3 m/s² of its rim, on a dry and even road: the measure keeps its mean."""
    car = replace(RWD, driveline_inertia=inertia)
    s = drive(car, seconds=20, rate=100, noise=0.0, grade=0.0, even=True)
    rng, f = np.random.default_rng(0), np.linspace(9.0, 15.0, 25)[:, None]
    columns = {n: s.array(n) for n in s.symbols}
    for w in WHEELS:
        waves = np.sin(2.0 * np.pi * f * s.array("t") + rng.uniform(0.0, 2.0 * np.pi, f.shape)).sum(axis=0)
        columns[f"omega_{w}"] = columns[f"omega_{w}"] + 0.1 * waves / 12.5**0.5 / RWD.r_e(w)
    means = [
        FeatureStream(car, s.dt, list(c)).push(c)["delta_a_x"][300:].mean()
        for c in ({n: s.array(n) for n in s.symbols}, columns)
    ]
    assert means[1] == pytest.approx(means[0], abs=0.004)
    gap = {**columns, "omega_fl": np.where((s.array("t") > 9.0) & (s.array("t") < 10.0), np.nan, columns["omega_fl"])}
    assert np.isfinite(FeatureStream(car, s.dt, list(gap)).push(gap)["delta_a_x"][300:]).all()


def seen(v_ref, v_w, a_x):
    """Velocity that the observer finds of a reference, four like wheels and an accelerometer. [m/s]"""
    n, none = v_ref.size, np.full(v_ref.size, np.nan)
    p = params_from_seconds(DT, has_accelerometer=True)
    return observe(
        p, initial_motion(), v_ref, np.tile(v_w, (4, 1)), a_x, none, np.zeros(n), weights=np.ones(4)
    )[0]  # fmt: skip


def test_a_reference_that_the_accelerometer_follows_is_believed_where_all_wheels_float():
    t = np.arange(3000) * DT
    v, floats = 30.0 - 0.3 * t, (t > 10.0) & (t < 18.0)
    a_x = np.full(t.size, -0.3)
    wheels = np.where(floats, 0.2, v)
    assert np.abs(seen(v, wheels, a_x) - v).max() < 0.1
    # what the accelerometer does not follow has failed, and so has what is alone for longer
    assert np.abs(seen(np.where(t > 10.0, 0.0, v), v, a_x) - v)[t > 12.0].max() < 0.5
    drifts = v + np.where(t > 2.0, 2.0 * (t - 2.0), 0.0)
    assert np.abs(seen(drifts, v, a_x) - v)[t > 25.0].max() < 0.5
