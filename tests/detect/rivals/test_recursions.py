"""Compiled recursions of the rivals against the same in plain Python."""

import math

import numpy as np
import pytest

from aqualog.detect.rivals import (
    front_rear_pattern,
    slope_friction_ekf,
    slope_line,
    wheel_oscillation,
    wheel_thresholds,
)
from aqualog.detect.rivals.rival import alarm_bits
from aqualog.detect.rivals.slope_inputs import velocity_lag

DT = 0.01


def noisy(n=3000, seed=3, gaps=True):
    rng = np.random.default_rng(seed)
    x = np.cumsum(rng.normal(0.0, 0.02, n))
    if gaps:
        x[400:430] = np.nan
        x[900] = np.nan
    return x


def slip_and_traction(n=4000, seed=1, slope=30.0):
    rng = np.random.default_rng(seed)
    t = DT * np.arange(n)
    mu = 0.06 + 0.05 * np.sin(0.7 * t) + 0.03 * np.sin(2.3 * t)
    C = np.where(t < 20.0, slope, 12.0)
    s = mu / C + 0.002 + rng.normal(0.0, 5e-4, n)
    is_active = rng.random(n) > 0.05
    s[700:720] = np.nan
    return s, mu, is_active, C


def test_alarm_bits():
    x = noisy()
    on, share, patience = 0.2, 0.4, 12
    bits = alarm_bits(x, on, off_share=share, patience_s=patience * DT, dt=DT)
    active, left, want = False, 0, []
    for value in x:
        if math.isnan(value):
            left = max(left - 1, 0)
            active = active and left > 0
        else:
            active = value > (share * on if active else on)
            left = patience
        want.append(active)
    assert bits.tolist() == want
    assert bits.any()
    assert not bits.all()


def test_patience_bridges_a_short_gap_only():
    x = np.array([1.0, np.nan, np.nan, 0.9] + [np.nan] * 6 + [0.9])
    assert alarm_bits(x, 0.95, patience_s=0.03, dt=DT).tolist() == [*[True] * 6, *[False] * 5]
    assert alarm_bits(x, 0.95, dt=DT).tolist() == [True, *[False] * 10]


def test_deceleration_counts_as_its_decaying_peak():
    x, slip = noisy(), np.full(3000, 5.0)
    got = wheel_thresholds.critical_share(x, slip, dt=DT)
    peak, want = 0.0, []
    for value in x:
        peak *= math.exp(-DT / 0.15)
        if not math.isnan(value):
            peak = max(peak, value)
        want.append(math.nan if math.isnan(value) else min(peak, 5.0))
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-12)


def test_dips_below_the_stored_reference():
    x = 0.02 * noisy()
    got = front_rear_pattern.dips(x, dt=DT)
    k = 1.0 - math.exp(-DT / front_rear_pattern.TAU_REFERENCE)
    reference, want = None, []
    for value in x:
        if math.isnan(value):
            want.append(math.nan)
            continue
        reference = value if reference is None else reference
        e = value - reference
        reference += k * float(np.clip(e, -front_rear_pattern.STEP_MAX, front_rear_pattern.STEP_MAX))
        want.append(float(np.clip(-e, 0.0, front_rear_pattern.DIP_MAX)))
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-12)


def test_front_signal_where_the_rear_wheel_is_now():
    v = np.linspace(10.0, 30.0, 2000)
    way = np.cumsum(v) * DT
    there = front_rear_pattern.at_the_rear(np.sin(way), v, wheelbase=2.8, dt=DT)
    known = way > 3.5
    np.testing.assert_allclose(there[known], np.sin(way[known] - 2.8), atol=0.02)
    assert np.isnan(there[:10]).all()
    standing = front_rear_pattern.at_the_rear(np.ones(50), np.full(50, np.nan), wheelbase=2.8, dt=DT)
    assert np.isnan(standing).all()


@pytest.mark.parametrize("rate", [100.0, 80.0, 250.0])
def test_band_level_against_a_plain_filter(rate):
    dt = 1.0 / rate
    p = wheel_oscillation.BandParams.make(dt)
    rng = np.random.default_rng(5)
    x = rng.normal(0.0, 1e-3, 3000)
    x[2000:2400] *= 4.0
    usable = np.ones(3000, dtype=bool)
    usable[1000:1100] = False
    got = wheel_oscillation.level_change(p, x, usable)
    y = np.zeros(3000)
    first = x[0]
    for i in range(3000):
        two_before, y2 = (x[i - 2], y[i - 2]) if i >= 2 else (first, 0.0)
        y[i] = p.b * (x[i] - two_before) - p.a1 * (y[i - 1] if i else 0.0) - p.a2 * y2
    power, reference, age, want, run_in = None, 0.0, 0.0, np.full(3000, np.nan), 0.0
    for i in range(3000):
        run_in += dt
        if run_in < 0.3 or not usable[i]:
            power = None
            continue
        square = y[i] ** 2
        if age >= p.warm_up:
            square = min(square, 1e3 * math.exp(reference))
        power = square if power is None else power + p.k_power * (square - power)
        e = math.log(max(power, 1e-12)) - reference
        if age >= p.warm_up:
            want[i] = e
            e = min(max(e, -1.0), 1.0)
        age = min(age + dt, p.tau_reference)
        reference += dt / age * e
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-9)
    assert np.nanmax(got[2100:2400]) > 1.5


@pytest.mark.parametrize("rate", [100.0, 80.0])
def test_band_passes_its_centre_and_stops_the_rest(rate):
    p = wheel_oscillation.BandParams.make(1.0 / rate)
    high = min(45.0, 0.45 * rate)

    def gain(f):
        z = np.exp(-2j * np.pi * f / rate)
        return abs(p.b * (1.0 - z * z) / (1.0 + p.a1 * z + p.a2 * z * z))

    assert gain(15.0) == pytest.approx(2**-0.5, abs=1e-6)
    assert gain(high) == pytest.approx(2**-0.5, abs=1e-6)
    assert gain(1.0) < 0.1


def test_least_squares_recursion():
    s, mu, is_active, _ = slip_and_traction()
    p = slope_line.RlsParams.make(DT)
    slope, offset = slope_line.scan_rls(p, s, mu, is_active, slope=25.0)
    x, P, want = np.array([1.0 / 25.0, 0.0]), np.array([p.P_k, p.P_delta]), []
    keep = np.array([p.keep_k, p.keep_delta])
    for y, m, on in zip(s, mu, is_active, strict=True):
        if not on or math.isnan(y):
            want.append((math.nan, x[1]))
            continue
        phi = np.array([m, 1.0])
        weighted = P * phi / keep
        x = x + weighted / (1.0 + weighted @ phi) * (y - phi @ x)
        x[0] = np.clip(x[0], 1.0 / 300.0, 1.0)
        P = np.minimum(P / (keep + P * phi * phi), [p.P_k, p.P_delta])
        want.append((1.0 / x[0], x[1]))
    np.testing.assert_allclose(np.array([slope, offset]).T, want, rtol=1e-9)


@pytest.mark.parametrize("order", [1, -1], ids=["softer", "stiffer"])
def test_kalman_recursion(order):
    s, mu, is_active, _ = (x[::order] for x in slip_and_traction())
    p = slope_line.KalmanParams.make(DT)
    slope, offset, alarm = slope_line.scan_kalman(p, s, mu, is_active, slope=25.0)
    x, P = np.array([1.0 / 25.0, 0.0]), np.diag([p.P_k, p.P_delta])
    up = down = 0.0
    want, alarms = [], []
    for y, m, on in zip(s, mu, is_active, strict=True):
        alarms.append(0.0)
        if not on or math.isnan(y):
            want.append((math.nan, x[1]))
            continue
        P = P + np.diag([p.q_k, p.q_delta])
        H = np.array([m, 1.0])
        e = y - H @ x
        gain = P @ H / (H @ P @ H + p.r)
        x = x + gain * e
        x[0] = np.clip(x[0], 1.0 / 300.0, 1.0)
        P = P - np.outer(gain, H @ P)
        up, down = max(up + (e - p.nu) * DT, 0.0), max(down + (-e - p.nu) * DT, 0.0)
        if max(up, down) > p.h:
            alarms[-1] = 1.0 if up > p.h else -1.0
            P = np.diag([max(P[0, 0], p.P_k_reset), P[1, 1]])
            up = down = 0.0
        want.append((1.0 / x[0], x[1]))
    np.testing.assert_allclose(np.array([slope, offset]).T, want, rtol=1e-9)
    np.testing.assert_array_equal(alarm, alarms)
    assert (alarm[2000:] == order).any()


def brush(s, C, m):
    theta = min(C * abs(s) / (3.0 * m), 1.0)
    return math.copysign(m * (1.0 - (1.0 - theta) ** 3), s)


def test_friction_filter_recursion():
    s, mu, is_active, _ = slip_and_traction()
    s[3000:3200] = 0.25  # a wheel that spins on water
    mu = mu.copy()
    mu[3000:3200] = 0.05
    p = slope_friction_ekf.CurveParams.make(DT)
    slope, friction, offset = slope_friction_ekf.scan(p, s, mu, is_active, slope=25.0, mu_max=1.0)
    x, P = np.array([math.log(25.0), 0.0, 0.0]), np.diag([p.P_C, p.P_mu, p.P_delta])
    low = np.array([0.0, math.log(0.02), -0.02])
    high = np.array([math.log(150.0), math.log(1.5), 0.02])
    want = []
    for y, m, on in zip(s, mu, is_active, strict=True):
        x[0] += p.back_C * (math.log(25.0) - x[0])
        x[1] += p.back_mu * (0.0 - x[1])
        if not on or math.isnan(y):
            want.append((math.nan, math.nan, x[2]))
            continue
        P = P + np.diag([p.q_C, p.q_mu, p.q_delta])
        P[0, 0], P[1, 1] = min(P[0, 0], p.P_most), min(P[1, 1], p.P_most)
        x[1] = min(max(x[1], math.log(abs(m) / 0.9)), high[1])
        C, top = math.exp(x[0]), math.exp(x[1])
        if abs(y - x[2]) < 3.0 * top / C:
            slip = math.copysign(3.0 * top / C * (1.0 - (1.0 - abs(m) / top) ** (1.0 / 3.0)), m)
            step = 1e-7

            def held(a, b, m=m):
                c, t = math.exp(a), math.exp(b)
                return math.copysign(3.0 * t / c * (1.0 - (1.0 - abs(m) / t) ** (1.0 / 3.0)), m)

            H = np.array([
                (held(x[0] + step, x[1]) - held(x[0] - step, x[1])) / (2 * step),
                (held(x[0], x[1] + step) - held(x[0], x[1] - step)) / (2 * step),
                1.0,
            ])  # fmt: skip
            e, r = y - slip - x[2], p.r_slip
        else:
            H = np.array([0.0, brush(y - x[2], C, top), 0.0])  # the whole contact slides: mu = mu_max
            e, r = m - brush(y - x[2], C, top), p.r
        PH = P @ H
        variance = H @ PH + r
        gain = PH.copy()
        if e * e > 9.0 * variance:
            gain[2] = 0.0
        x = np.clip(x + gain / variance * e, low, high)
        P = P - np.outer(gain, gain) / variance
        want.append((math.exp(x[0]), math.exp(x[1]), x[2]))
    # the derivatives here are differences
    np.testing.assert_allclose(np.array([slope, friction, offset]).T, want, rtol=2e-5, atol=1e-8)
    assert np.nanmin(friction[3000:3200]) < 0.1


@pytest.mark.parametrize("theta", [0.05, 0.4, 0.8])
def test_both_forms_of_the_curve_agree(theta):
    C, m = 28.0, 0.7
    s = 3.0 * m / C * theta
    mu, by_C, by_m = slope_friction_ekf._sliding(s, C, m)
    assert mu == pytest.approx(brush(s, C, m), rel=1e-12)
    step = 1e-6
    assert by_C == pytest.approx((brush(s, C * (1 + step), m) - brush(s, C * (1 - step), m)) / (2 * step), rel=1e-6)
    assert by_m == pytest.approx((brush(s, C, m * (1 + step)) - brush(s, C, m * (1 - step))) / (2 * step), rel=1e-6)
    slip, slip_by_C, slip_by_m = slope_friction_ekf._holding(mu, C, m)
    assert slip == pytest.approx(s, rel=1e-12)
    # along the curve a change of slope or friction is undone by one of slip
    by_s = by_C / s
    assert slip_by_C == pytest.approx(-by_C / by_s, rel=1e-9)
    assert slip_by_m == pytest.approx(-by_m / by_s, rel=1e-9)


def test_slopes_follow_the_road():
    s, mu, _, C = slip_and_traction()
    on = np.ones(s.size, dtype=bool)
    found = {
        "rls": slope_line.scan_rls(slope_line.RlsParams.make(DT), s, mu, on, slope=30.0)[0],
        "kalman": slope_line.scan_kalman(slope_line.KalmanParams.make(DT), s, mu, on, slope=30.0)[0],
        "ekf": slope_friction_ekf.scan(slope_friction_ekf.CurveParams.make(DT), s, mu, on, slope=30.0, mu_max=1.0)[0],
    }
    for name, slope in found.items():
        assert slope[1990] == pytest.approx(C[1990], rel=0.25), name
        assert slope[3990] == pytest.approx(C[3990], rel=0.35), name


@pytest.mark.parametrize("late", [0.0, 0.1, 0.3])
def test_lag_of_a_velocity(late):
    rng = np.random.default_rng(1)
    t = DT * np.arange(12000)
    a = 0.8 * np.sin(t) + 0.5 * np.sin(2.6 * t)
    v = 25.0 + np.cumsum(a) * DT
    grade = 0.3 * np.sin(2 * np.pi * t / 90.0)
    lag = velocity_lag(np.interp(t - late, t, v) + rng.normal(0.0, 0.01, t.size), a + grade + 0.2, dt=DT)
    assert lag[-1] == pytest.approx(late, abs=0.02)
    assert lag[0] == 0.0
