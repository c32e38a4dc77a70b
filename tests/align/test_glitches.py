import itertools
import time
from functools import partial

import numpy as np
import pytest

from aqualog.align.glitches import glitches_of, lost_speed, sensor_glitches, spikes

R_E = 0.317
T = (np.arange(3000) * 10_000_000).astype(np.int64)


def wheel():
    return 27.0 / R_E + np.random.default_rng(0).normal(0, 0.03, T.size)


def test_a_sound_wheel_has_none():
    assert not sensor_glitches(T, wheel(), r_e=R_E).any()


@pytest.mark.parametrize(
    ("length", "level"),
    [(1, 0.0), (20, 300.0), (80, 0.0), (80, 300.0), (1000, 0.0), (300, 587.0), (300, 287.1), (300, 140.0 / R_E)],
)
def test_dropouts_spikes_dead_sensors_and_codes_that_stand_for_seconds(length, level):
    x = wheel()
    x[1000 : 1000 + length] = level
    assert np.flatnonzero(sensor_glitches(T, x, r_e=R_E)).tolist() == list(range(1000, 1000 + length))


def test_real_spin_downs_and_lock_ups_stay():
    share = np.interp(np.arange(T.size), [0, 1000, 1065, 1200, 1240, 3000], [1, 1, 0, 0, 1, 1])  # to a stop in 0.65 s
    assert not sensor_glitches(T, wheel() * share, r_e=R_E).any()
    locked = np.interp(np.arange(T.size), [0, 1000, 1015, 1050, 1060, 3000], [1, 1, 0, 0, 1, 1])  # 180 m/s^2
    assert not sensor_glitches(T, wheel() * locked, r_e=R_E).any()


def test_a_step_to_a_value_that_lives_and_slow_logs_stay():
    x = wheel()
    x[1000:] += 60.0 / R_E  # nobody knows which of the two sides is the wheel's
    assert not sensor_glitches(T, x, r_e=R_E).any()
    x = np.full(300, 80.0)
    x[100:102] = 10.0
    assert not sensor_glitches(10 * T[:300], x, r_e=R_E).any()


def deceleration():
    """A car that brakes with 11 m/s^2 within 0.1 s, for 1 s, on a rough road."""
    ramp = np.interp(np.arange(T.size), [0, 500, 510, 610, 620, 3000], [0, 0, -11, -11, 0, 0])
    return ramp + np.random.default_rng(1).normal(0, 1.0, T.size)


def test_spikes_of_an_acceleration():
    for at, height, length in itertools.product((1000, 560), (18.0, -18.0, 35.0), (1, 5, 9)):
        a = deceleration()
        a[at : at + length] += height
        assert np.flatnonzero(spikes(T, a)).tolist() == list(range(at, at + length))


def test_what_a_car_does_is_no_spike():
    a = deceleration()
    assert not spikes(T, a).any()
    a[1000:1020] += 18.0  # 0.2 s: nobody knows
    assert not spikes(T, a).any()
    a[2000:] += 18.0  # nothing leads back
    assert not spikes(T, a).any()
    assert not spikes(T[:2], a[:2]).any()
    slow = np.tile([0.0, -11.0], 150)  # 10 Hz: from nothing to full braking in a sample
    assert not spikes((np.arange(300) * 100_000_000).astype(np.int64), slow).any()


def locking(seed):
    """A wheel under ABS for 4 s: cycles of 0.15 to 0.5 s, down with 60 to 150 m/s^2."""
    rng = np.random.default_rng(seed)
    t = T * 1e-9
    car = np.interp(t, [0, 10, 14, 30], [30, 30, 14, 30])
    rim, at = car + rng.normal(0, 0.01, t.size), 10.0
    while at < 13.5:
        depth = rng.uniform(0.3, 0.95) * np.interp(at, t, car)
        low, end = at + depth / np.array([1.0, 0.5]) / rng.uniform(60, 150)
        rim -= np.interp(t, [at, low, end], [0, depth, 0])
        at = end + rng.uniform(0.05, 0.2)
    return rim / R_E, rng


@pytest.mark.parametrize("length", [5, 10])
@pytest.mark.parametrize("kind", ["late", "doubled"])
@pytest.mark.parametrize("seed", range(4))
def test_bursts_of_stamps_do_not_hide_a_wheel_under_abs(seed, kind, length):
    x, rng = locking(seed)
    assert not sensor_glitches(T, x, r_e=R_E).any()
    t, keep = T.copy(), np.ones(T.size, dtype=bool)
    for k in 1000 + 60 * np.arange(6) + rng.integers(0, 40, 6):
        if kind == "late":
            t[k : k + length] = t[k + length] - 100_000 * np.arange(length, 0, -1)
        else:  # all have the first one's stamp, and the last one counts
            t[k + length - 1] = t[k]
            keep[k : k + length - 1] = False
    assert not sensor_glitches(t[keep], x[keep], r_e=R_E).any()


@pytest.mark.parametrize("level", [0.0, 300.0])
def test_dropouts_among_bursts_are_still_left_out(level):
    x, t = wheel(), T.copy()
    for k in range(0, 2900, 50):
        t[k : k + 10] = t[k + 10] - 100_000 * np.arange(10, 0, -1)
    for k in (503, 1007, 1511):
        x[k : k + 12] = level
    assert np.flatnonzero(sensor_glitches(t, x, r_e=R_E)).tolist() == [
        k + i for k in (503, 1007, 1511) for i in range(12)
    ]


def test_a_speed_that_is_zero_at_once_is_lost():
    rng = np.random.default_rng(2)
    v = 25.0 + 0.05 * rng.standard_normal(T.size)
    for a, b in ((500, 501), (900, 1400), (2900, 3000)):
        v[a:b] = 0.0
    assert np.flatnonzero(lost_speed(T, v)).tolist() == [500, *range(900, 1400), *range(2900, 3000)]


def test_a_car_that_stops_has_not_lost_its_speed():
    t = np.arange(T.size) * 0.01
    v = np.maximum(np.interp(t, [0, 10, 12, 20, 23, 30], [22, 22, 0, 0, 30, 30]), 0.0)  # 11 m/s^2
    v[v < 1.5] = 0.0  # what a receiver takes for standing
    assert not lost_speed(T, v).any()
    for step in (10, 100):  # 10 Hz, 1 Hz: each at its own stamps, and held on a grid of 100 Hz
        assert not lost_speed(T[::step], v[::step]).any()
        assert not lost_speed(T, v[np.arange(T.size) // step * step]).any()
    assert not lost_speed(T[:1], v[:1]).any()


@pytest.mark.parametrize(
    ("name", "amplitude", "hertz", "height"),
    [("yaw_rate", 1.0, 1.0, 1.0), ("steer_angle", 0.3, 0.7, -0.3), ("steering_wheel_angle", 4.5, 0.7, 4.5)],
)
def test_spikes_of_yaw_rate_and_steering(name, amplitude, hertz, height):
    """A car that skids and a driver who catches it (20 rad/s at the wheel) are none."""
    x = amplitude * np.sin(2.0 * np.pi * hertz * np.minimum(T * 1e-9, 10.0))
    rule = glitches_of(name, None)
    assert rule is not None
    assert not rule.find(T, x).any()
    for a, b in ((1200, 1201), (1500, 1512)):
        x[a:b] += height
    assert np.flatnonzero(rule.find(T, x)).tolist() == [1200, *range(1500, 1512)]


@pytest.mark.parametrize("find", [spikes, partial(sensor_glitches, r_e=0.3)])
def test_a_sensor_that_shakes_for_long_takes_no_longer_per_sample(find):
    """Each leap was held against all that follow: an hour took minutes."""
    t_ns = np.arange(20_000) * 10**7
    x = np.abs(np.random.default_rng(1).normal(0.0, 40.0, t_ns.size).cumsum()) + 5.0

    def cost(n):
        begin = time.process_time()
        find(t_ns[:n], x[:n])
        return time.process_time() - begin

    assert min(cost(20_000) for _ in range(2)) < 10.0 * max(min(cost(5_000) for _ in range(2)), 0.005)
