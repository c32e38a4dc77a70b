"""Laws that every recursion keeps: any cut equals the whole, NaN holds the state, scaling, sample rate."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from aqualog.detect import cusum, ewvar, minor_spin_down, spin
from aqualog.detect.braking import hold_on
from aqualog.features import velocity
from aqualog.features.smoothing import UNSET, derivative, lowpass

DT = 0.01
value = st.one_of(st.floats(-50, 50, allow_nan=False, width=32), st.just(float("nan")))
signal = st.integers(1, 60).flatmap(lambda n: arrays(np.float64, n, elements=value))
cuts = st.lists(st.integers(0, 60), max_size=5)


def pieces(n, at):
    edges = sorted({0, n, *(min(a, n) for a in at)})
    return list(itertools.pairwise(edges))


def same(a, b):
    return np.asarray(a).tobytes() == np.asarray(b).tobytes()


def run_cut(scan, state, n, at):
    """Outputs of `scan(slice, state) -> (outputs..., state)` over pieces, joined."""
    collected = None
    for a, b in pieces(n, at):
        *outputs, state = scan(slice(a, b), state)
        collected = (
            [[o] for o in outputs] if collected is None else [[*c, o] for c, o in zip(collected, outputs, strict=True)]
        )
    return [np.concatenate(c) for c in collected]


def three(n, seed):
    rng = np.random.default_rng(seed)
    a = rng.normal(0, 6, n)
    dv = rng.normal(-0.5, 1, n)
    v = 25 + rng.normal(0, 0.1, n)
    for x in (a, dv, v):
        x[rng.random(n) < 0.05] = np.nan
    return a, dv, v


def scans(n, seed):
    """Each recursion as scan(slice, state), with its initial state."""
    a, dv, v = three(n, seed)
    rng = np.random.default_rng(seed + 1)
    other = rng.normal(0, 2, n)
    allowed = rng.random(n) > 0.1
    wheels = np.abs(v + rng.normal(0, 2, (4, n)))
    ref = np.where(rng.random(n) < 0.5, v, np.nan)
    down, up = spin.SpinParams.make(-1.0, DT), spin.SpinParams.make(1.0, DT)
    minor = minor_spin_down.MinorParams.make(DT)
    params = velocity.params_from_seconds(DT, has_accelerometer=True)
    return {
        "lowpass": (lambda s, z: lowpass(a[s], z, tau=0.1, dt=DT), UNSET),
        "derivative": (lambda s, z: derivative(a[s], z, tau=0.03, dt=DT), UNSET),
        "cusum": (lambda s, z: cusum.scan(cusum.CusumParams(0.5, 0.2, 0.4, DT), z, a[s]), cusum.initial_state()),
        "ewvar": (lambda s, z: ewvar.scan(ewvar.from_seconds(0.5, 0.3, DT), z, a[s]), ewvar.initial_state()),
        "spin_down": (lambda s, z: spin.scan(down, z, a[s], dv[s], v[s], allowed[s]), spin.initial_state()),
        "spin_up": (lambda s, z: spin.scan(up, z, a[s], dv[s], v[s], allowed[s]), spin.initial_state()),
        "minor": (
            lambda s, z: minor_spin_down.scan(minor, z, a[s], other[s], dv[s], v[s], allowed[s]),
            minor_spin_down.initial_state(),
        ),
        "hold": (lambda s, z: hold_on(allowed[s], z, seconds=0.05, dt=DT), 0),
        "velocity": (
            lambda s, z: _observe(params, z, ref[s], wheels[:, s], a[s], other[s], dv[s]),
            velocity.initial_state(),
        ),
    }


def _observe(params, state, ref, wheels, a_x, a_y, yaw):
    v, a, w, state = velocity.observe(params, state, ref, wheels, a_x, a_y, yaw, weights=np.ones(4))
    return v, a, *w, state


def test_a_car_that_spins_round_on_ice_loses_speed_ahead_without_any_acceleration():
    t = np.arange(0.0, 1.0, DT)
    ref, still = np.where(t < 0.05, 15.0, np.nan), np.zeros_like(t)
    wheels = np.array([40.0, 60.0, 80.0, 2.0])[:, None] + still  # none of them agrees with any
    params = velocity.params_from_seconds(DT, has_accelerometer=True)
    v, *_ = _observe(params, velocity.initial_state(), ref, wheels, still, still, 0.7 + still)
    assert 15.0 * np.cos(0.7) < v[-1] < 13.0  # 11.5; 15 if the car were taken to go straight, the drift fades in 2 s


@pytest.mark.parametrize("name", list(scans(10, 0)))
@settings(max_examples=60, deadline=None)
@given(n=st.integers(1, 400), seed=st.integers(0, 10_000), at=st.lists(st.integers(0, 400), max_size=20))
def test_any_cut_equals_the_whole(name, n, seed, at):
    scan, state = scans(n, seed)[name]
    *whole, _ = scan(slice(0, n), state)
    for one, parts in zip(whole, run_cut(scan, state, n, at), strict=True):
        assert same(one, parts)


@pytest.mark.parametrize("name", list(scans(10, 0)))
def test_sample_by_sample_equals_the_whole(name):
    n = 500
    scan, state = scans(n, 3)[name]
    *whole, _ = scan(slice(0, n), state)
    for one, parts in zip(whole, run_cut(scan, state, n, range(n)), strict=True):
        assert same(one, parts)


@settings(max_examples=100, deadline=None)
@given(signal)
def test_nan_holds_the_sum_and_gives_nan(x):
    p = cusum.CusumParams(0.5, 0.2, 0.4, DT)
    g, active, state = cusum.scan(p, cusum.initial_state(), x)
    known = ~np.isnan(x)
    assert (np.isnan(g) == ~known).all()
    assert not active[~known].any()
    without, _, state_without = cusum.scan(p, cusum.initial_state(), x[known])
    assert same(g[known], without)
    assert state == state_without


@settings(max_examples=100, deadline=None)
@given(signal)
def test_nan_holds_the_variance(x):
    p = ewvar.from_seconds(0.5, 0.5, DT)
    known = ~np.isnan(x)
    _, with_nan, state = ewvar.scan(p, ewvar.initial_state(), x)
    _, without, other = ewvar.scan(p, ewvar.initial_state(), x[known])
    assert same(with_nan[known], without)
    assert same(state, other)


@settings(max_examples=100, deadline=None)
@given(signal, st.sampled_from([0.25, 0.5, 2.0, 4.0]))
def test_scaling_the_signal_scales_the_sum(x, factor):
    p = cusum.CusumParams(0.5, 0.2, 0.4, DT)
    q = cusum.CusumParams(0.5 * factor, 0.2 * factor, 0.4 * factor, DT)
    g, active, _ = cusum.scan(p, cusum.initial_state(), x)
    h, scaled, _ = cusum.scan(q, cusum.initial_state(), x * factor)
    assert g * factor == pytest.approx(h, nan_ok=True)
    assert (active == scaled).all()


@settings(max_examples=100, deadline=None)
@given(signal)
def test_sum_stays_in_its_bounds(x):
    g, _, _ = cusum.scan(cusum.CusumParams(0.5, 0.2, 0.4, DT), cusum.initial_state(), x)
    assert (g[~np.isnan(g)] >= 0).all()
    assert (g[~np.isnan(g)] <= 0.4).all()


def test_sum_without_clamp_is_running_sum_minus_its_minimum():
    x = np.random.default_rng(5).normal(size=20_000)
    g, _, _ = cusum.scan(cusum.CusumParams(0.1, 9.0, np.inf, DT), cusum.initial_state(), x)
    total = np.concatenate([[0.0], np.cumsum((x - 0.1) * DT)])
    assert g == pytest.approx((total - np.minimum.accumulate(total))[1:], abs=1e-9)


def test_alarm_time_does_not_depend_on_the_sample_rate():
    times = []
    for dt in (0.002, 0.01, 0.02):
        t = np.arange(0, 10, dt)
        _, active, _ = cusum.scan(
            cusum.CusumParams(0.1, 0.2, 0.4, dt), cusum.initial_state(), np.where(t > 2, 0.3, 0.0)
        )
        times.append(t[np.argmax(active)])
    assert times == pytest.approx([3.0] * 3, abs=0.05)


@settings(max_examples=100, deadline=None)
@given(arrays(np.float64, 200, elements=st.floats(-5, 5, width=32)), st.sampled_from([0.0, 1e3, 1e6]))
def test_variance_does_not_depend_on_an_offset(x, offset):
    p = ewvar.from_seconds(0.5, 0.5, DT)
    _, var, _ = ewvar.scan(p, ewvar.initial_state(), x)
    _, shifted, _ = ewvar.scan(p, ewvar.initial_state(), x + offset)
    assert (var >= 0).all()
    assert shifted == pytest.approx(var, abs=1e-6, rel=1e-6)


def test_equal_weights_give_the_weighted_variance():
    """E4: with alpha = beta, 2.6 is the exponentially weighted variance itself."""
    x = np.random.default_rng(7).normal(3.0, 2.0, 400)
    alpha = 0.05
    _, var, _ = ewvar.scan(ewvar.EwvarParams(alpha, alpha), ewvar.initial_state(), x)
    weights = alpha * (1 - alpha) ** np.arange(x.size)[::-1]
    weights[0] = (1 - alpha) ** (x.size - 1)
    mean = weights @ x
    assert var[-1] == pytest.approx(weights @ (x - mean) ** 2, rel=1e-9)


@pytest.mark.parametrize(("alpha", "beta", "factor"), [(0.05, 0.05, 0.97), (0.02, 0.1, 0.91), (0.1, 0.02, 1.03)])
def test_unequal_weights_have_the_documented_factor(alpha, beta, factor):
    x = np.random.default_rng(11).normal(0.0, 1.0, 400_000)
    _, var, _ = ewvar.scan(ewvar.EwvarParams(alpha, beta), ewvar.initial_state(), x)
    assert var[2000:].mean() == pytest.approx((1 - beta) * 2 / (2 - alpha), abs=0.01)
    assert var[2000:].mean() == pytest.approx(factor, abs=0.01)


def test_variance_does_not_depend_on_the_sample_rate():
    finals = []
    for dt in (0.002, 0.01):
        t = np.arange(0, 20, dt)
        _, var, _ = ewvar.scan(ewvar.from_seconds(0.5, 0.5, dt), ewvar.initial_state(), np.sin(2 * np.pi * 3 * t))
        finals.append(var[t > 10].mean())
    assert finals[0] == pytest.approx(finals[1], rel=0.03)
    assert finals[0] == pytest.approx(0.5, rel=0.05)


def test_derivative_of_a_ramp_and_after_a_gap():
    t = np.arange(0, 2, DT)
    x = 3.0 * t
    x[100:110] = np.nan
    y, _ = derivative(x, UNSET, tau=0.03, dt=DT)
    assert np.isnan(y[0])
    assert y[60:100] == pytest.approx(3.0, rel=1e-6)
    assert np.isnan(y[100:111]).all()  # the first sample after the gap has nothing to be compared with
    assert (y[111:] <= 3.0 + 1e-9).all()


def test_parameters_and_inputs_stay():
    a, dv, v = three(100, 1)
    copies = [x.copy() for x in (a, dv, v)]
    spin.scan(spin.SpinParams.make(-1.0, DT), spin.initial_state(), a, dv, v, np.ones(100, dtype=bool))
    for x, c in zip((a, dv, v), copies, strict=True):
        assert same(x, c)
