"""Inputs without noise: what is motion stays, what is a sensor's goes, nothing is delayed."""

import numpy as np
import pytest

from aqualog.diagnose.inputs import confirmed_torque, quiet, quiet_speed, quiet_torque, smooth

DT = 0.01
T = np.arange(9000) * DT
MOTION = 200.0 + 150.0 * np.sin(2.0 * np.pi * 0.05 * T) + 60.0 * np.sin(2.0 * np.pi * 0.3 * T)
RNG = np.random.default_rng(1)


def test_noise_goes_and_motion_stays_without_delay():
    noisy = MOTION + 20.0 * RNG.standard_normal(T.size)
    out = quiet(noisy, DT)
    inside = slice(200, -200)
    assert (out - MOTION)[inside].std() < 0.25 * 20.0
    lags = range(-20, 21)
    best = max(lags, key=lambda k: np.corrcoef(np.roll(out, -k)[inside], MOTION[inside])[0, 1])
    assert abs(best) <= 1


def test_a_signal_without_noise_stays():
    np.testing.assert_allclose(quiet(MOTION, DT), MOTION, atol=1.0)


@pytest.mark.parametrize("every", [1, 2, 5], ids=["100 Hz", "50 Hz bus", "20 Hz bus"])
def test_a_constant_torque_has_hardly_anything_left_of_its_noise(every):
    """What is left of it would look like torque to which neither wheel nor accelerometer answers."""
    noise = np.array([np.random.default_rng(k).normal(0.0, 2.0, T.size) for k in range(8)])[:, ::every]
    noise = np.array([np.interp(T, T[::every], x) for x in noise])
    left = np.array([quiet(130.0 + x, DT, 100.0 / every) - 130.0 for x in noise])
    assert np.median(left.std(axis=1) / noise.std(axis=1)) < 0.11
    np.testing.assert_allclose(left.mean(axis=1), noise.mean(axis=1), atol=0.2)


def test_a_slow_signal_stays_as_it_is():
    slow = MOTION[::20]
    assert quiet(slow, 0.2) is slow


@pytest.mark.parametrize("over", [0.5, 1.0])
def test_smoothing_keeps_lines_and_means_and_has_no_delay(over):
    line = 3.0 + 0.1 * T
    k = round(over / DT)
    np.testing.assert_allclose(smooth(line, DT, over)[k:-k], line[k:-k], rtol=1e-12)
    pulse = np.zeros(501)
    pulse[250] = 1.0
    out = smooth(pulse, DT, over)
    assert out.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(out, out[::-1], atol=1e-15)
    assert smooth(line, 1.0, over) is line


def test_left_and_right_get_the_mean_of_their_axle():
    torque = np.array([np.zeros(T.size), np.zeros(T.size), MOTION, MOTION]) + 5.0 * RNG.standard_normal((4, T.size))
    out = quiet_torque(torque, DT)
    assert np.array_equal(out[2], out[3])
    assert np.ptp(out[0]) == 0.0
    assert out[2].mean() == pytest.approx(MOTION.mean(), abs=2.0)


def test_light_braking_at_the_axle_that_is_not_driven_stays():
    """A few seconds at -70 N m have a small variance, and without them the torque is 3 % too large."""
    braking = np.where((T > 40.0) & (T < 43.0), -35.0, 0.0)
    torque = np.array([braking, braking, MOTION, MOTION]) + 2.0 * np.random.default_rng(4).standard_normal((4, T.size))
    out = quiet_torque(torque, DT)
    assert out[0][(T > 40.5) & (T < 42.5)].mean() == pytest.approx(-35.0, abs=2.0)
    assert out[0][T < 38.0].mean() == pytest.approx(0.0, abs=0.5)


def test_a_real_difference_of_left_and_right_stays():
    apart = 80.0 * np.sin(2.0 * np.pi * 0.1 * T)
    torque = np.array([0.0 * T, 0.0 * T, MOTION + apart, MOTION - apart]) + 3.0 * RNG.standard_normal((4, T.size))
    out = quiet_torque(torque, DT)
    half = 0.5 * (out[2] - out[3])
    assert (half - apart)[200:-200].std() < 4.0


@pytest.mark.parametrize("every", [1, 5])  # a bus as fast as the grid, and one of 20 Hz
def test_a_constant_speed_has_little_motion_left_of_its_noise(every):
    shares = []
    for seed in range(10):
        v = 25.0 + np.repeat(0.02 * np.random.default_rng(seed).standard_normal(6000 // every), every)
        shares.append(np.diff(quiet_speed(v, DT)).std() / np.diff(smooth(v, DT, 1.0)).std())
    assert np.mean(shares) < 0.5


def test_a_speed_that_changes_is_kept():
    t = np.arange(0.0, 120.0, 0.01)
    v = 22.0 + 6.0 * np.sin(2.0 * np.pi * t / 35.0) + 0.5 * np.sin(2.0 * np.pi * t / 8.0)
    noisy = v + 0.03 * np.random.default_rng(5).standard_normal(t.size)
    assert np.abs(quiet_speed(noisy, 0.01) - smooth(v, 0.01, 1.0))[300:-300].max() < 0.02


LONG = np.arange(30_000) * DT
PER_TORQUE = 1.0 / 500.0


def coloured(seed, low, high, rms, t=LONG):
    """Noise of a band. [Hz]"""
    f = np.fft.rfftfreq(t.size, DT)
    lines = np.random.default_rng(seed).standard_normal((2, f.size)) * ((f > low) & (f < high))
    x = np.fft.irfft(lines[0] + 1j * lines[1], t.size)
    return rms * x / x.std()


def wheels(total):
    return np.array([np.zeros(total.size), np.zeros(total.size), 0.5 * total, 0.5 * total])


@pytest.mark.parametrize("late", [0.0, 0.15], ids=["on time", "late"])
def test_torque_that_does_not_move_the_car_goes_and_what_does_stays(late):
    real = coloured(1, 0.03, 0.6, 300.0)
    false = coloured(2, 1.0, 4.0, 60.0)
    moves = np.roll(real, -round(late / DT)) * 0.9 * PER_TORQUE + np.random.default_rng(3).normal(0.0, 0.1, real.size)
    out = confirmed_torque(wheels(real + false), moves, DT, PER_TORQUE).sum(axis=0)
    inside = slice(500, -500)
    assert (out - real)[inside].std() < 0.2 * 60.0
    np.testing.assert_allclose(out.mean(), real.mean(), atol=1.0)


def test_fast_torque_that_moves_the_car_stays():
    real = coloured(4, 0.03, 3.0, 300.0)
    moves = real * PER_TORQUE + np.random.default_rng(5).normal(0.0, 0.02, real.size)
    out = confirmed_torque(wheels(real), moves, DT, PER_TORQUE).sum(axis=0)
    assert (out - real)[500:-500].std() < 0.05 * 300.0


def test_a_gear_shift_is_no_noise():
    """The spectra of the whole drive do not know that its torque is fast in one place; around it the rest is quiet."""
    slow, false = coloured(8, 0.03, 0.2, 300.0), coloured(9, 1.0, 3.0, 5.0)
    gap = np.interp(LONG, [80.0, 80.15, 80.4, 80.55], [0.0, 1.0, 1.0, 0.0]) - np.clip((LONG - 120.0) / 0.2, 0.0, 1.0)
    real = slow - 600.0 * gap
    moves = real * PER_TORQUE + np.random.default_rng(10).normal(0.0, 0.02, real.size)
    out = confirmed_torque(wheels(real + false), moves, DT, PER_TORQUE).sum(axis=0)
    for at in (80.0, 120.0):
        assert np.abs(out - real)[(at - 1.5 < LONG) & (at + 1.5 > LONG)].max() < 30.0
    assert (out - real)[500:-500].std() < 0.8 * 5.0


def test_a_drive_that_shows_nothing_of_it_leaves_the_torque_alone():
    torque = wheels(coloured(6, 0.03, 3.0, 30.0))
    assert confirmed_torque(torque, np.zeros(LONG.size), DT, PER_TORQUE) is torque
    short = torque[:, :3000]
    assert confirmed_torque(short, short.sum(axis=0) * PER_TORQUE, DT, PER_TORQUE) is short
