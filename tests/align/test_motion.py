"""The motion against which channels are held."""

import numpy as np
import pytest

from aqualog.align.motion import derivative, fit, smooth, track, wheel_turn

T = np.arange(0.0, 60.0, 0.1)


def test_positions_on_a_left_circle_turn_left():
    v, rate, r_earth = 15.0, 0.1, 6.371e6
    north, east = v / rate * np.cos(rate * T), -v / rate * -np.sin(rate * T)  # to the east first, then to the north
    latitude = 48.0 + np.degrees(-north / r_earth)
    longitude = 11.0 + np.degrees(east / r_earth / np.cos(np.radians(48.0)))
    speed, turn = track(latitude, longitude)
    inner = slice(20, -20)
    assert speed[inner] == pytest.approx(v, rel=1e-3)
    assert turn[inner] == pytest.approx(rate, rel=1e-2)
    assert np.isnan(track(np.full(T.size, 48.0), np.full(T.size, 11.0))[1]).all()


def test_means_have_no_ends():
    x = smooth(np.ones(30))
    assert np.isnan(x[:5]).all()
    assert np.isnan(x[-5:]).all()
    assert x[5:-5] == pytest.approx(1.0)
    assert np.isnan(smooth(np.ones(4))).all()
    assert derivative(2.0 * T)[10:-10] == pytest.approx(2.0)


def test_the_right_wheel_is_faster_to_the_left():
    assert np.nanmean(wheel_turn(np.full(30, 10.0), np.full(30, 10.31))) == pytest.approx(0.2)


def test_a_fit_has_sign_and_size_or_is_refused():
    found = fit(np.sin(T), -3.0 * np.sin(T))
    assert found.r == pytest.approx(-1.0)
    assert found.factor == pytest.approx(3.0)
    assert np.isnan(fit(np.ones(T.size), np.sin(T)).r)
    assert np.isnan(fit(np.sin(T[:20]), np.sin(T[:20])).r)
