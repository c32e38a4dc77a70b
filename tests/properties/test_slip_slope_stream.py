"""Laws of the slip-slope estimator: any cut equals the whole, gaps hold the state, signs, units of time and of slip."""

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from aqualog.detect.slip_slope import estimator
from aqualog.detect.slip_slope.tuning import TUNING, Params

DT = 0.01
FIELDS = estimator.Estimate.__slots__
seeds = st.integers(0, 10_000)
lengths = st.integers(1, 1500)
# alarms, rests and all states within a few seconds
QUICK = TUNING._replace(h=5e-4, tau_settle=1.0, tau_sort=0.5, tau_fade=1.0, tau_window=1.0, told_k=1.0, told_beta=1.0)


def drive(n, seed, holes=True):
    """Random driving with changes of the slope, spins, standstills of traction, gaps and what is not active."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * DT
    mu_i = rng.uniform(0, 0.2) + 0.1 * np.sin(2 * np.pi * t / rng.uniform(0.5, 6.0))
    rho_mu_j = rng.uniform(0, 0.1) + 0.1 * np.sin(2 * np.pi * t / rng.uniform(0.5, 6.0))
    slope = np.where(np.sin(2 * np.pi * t / rng.uniform(2, 10)) > 0.3, 10.0, 30.0)
    y = (mu_i - 1.1 * rho_mu_j) / slope + 2e-3 + rng.normal(0, 5e-4, n)
    y[rng.random(n) < 0.02] *= 20.0
    mu_i[rng.random(n) < 0.02] *= 5.0
    is_active = rng.random(n) > 0.05
    if holes:
        for x in (y, mu_i, rho_mu_j):
            x[rng.random(n) < 0.03] = np.nan
    return y, mu_i, rho_mu_j, is_active


def run(data, tuning=QUICK, *, dt=DT, slope=30.0, state=None):
    if state is None:
        state = estimator.initial_state(tuning, slope=slope)
    return estimator.scan(Params.make(tuning, dt), state, *data)


def same(a, b):
    return np.asarray(a).tobytes() == np.asarray(b).tobytes()


def outputs(e, *without):
    return {f: getattr(e, f) for f in FIELDS if f not in without}


def assert_same(a, b, **factors):
    """All outputs of `a` times their factor are those of `b`, to the bit."""
    for name in FIELDS:
        assert same(getattr(a, name) * factors.get(name, 1.0), getattr(b, name)), name


def test_the_drives_show_everything():
    """What the laws below are tried on: all states, drops and rises."""
    runs = [run(drive(1500, seed))[0] for seed in range(20)]
    assert {int(s) for e in runs for s in e.status} == set(estimator.STATUS)
    assert {int(a) for e in runs for a in e.alarm} == {-1, 0, 1}
    assert {int(b) for e in runs for b in e.beta_told} == {0, 1}


@settings(max_examples=60, deadline=None)
@given(lengths, seeds, st.lists(st.integers(0, 1500), max_size=20), st.booleans())
def test_any_cut_equals_the_whole(n, seed, at, adapted):
    data = drive(n, seed)
    tuning = QUICK._replace(adapted=adapted)
    whole, end = run(data, tuning)
    state, parts = estimator.initial_state(tuning, slope=30.0), []
    for a, b in itertools.pairwise(sorted({0, n, *(min(x, n) for x in at)})):
        e, state = run([d[a:b] for d in data], tuning, state=state)
        parts.append(e)
    for name in FIELDS:
        assert same(getattr(whole, name), np.concatenate([getattr(e, name) for e in parts])), name
    assert state == end


def test_sample_by_sample_equals_the_whole():
    data = drive(1500, 3)
    whole, end = run(data)
    state, parts = estimator.initial_state(QUICK, slope=30.0), []
    for i in range(1500):
        e, state = run([d[i : i + 1] for d in data], state=state)
        parts.append(e)
    for name in FIELDS:
        assert same(getattr(whole, name), np.concatenate([getattr(e, name) for e in parts])), name
    assert state == end


@settings(max_examples=60, deadline=None)
@given(lengths, seeds)
def test_gaps_hold_what_is_known(n, seed):
    """A sample with a hole, or that is not active: slope, ratio and offset stay, sums fade."""
    data = drive(n, seed)
    used = data[3] & ~np.isnan(np.sum(data[:3], axis=0))
    e, _ = run(data)
    gap = np.flatnonzero(~used[1:]) + 1
    for name in ("slope", "slope_sd", "beta", "offset"):
        assert same(getattr(e, name)[gap], getattr(e, name)[gap - 1]), name
    for name in ("g_drop", "g_rise"):
        assert (getattr(e, name)[gap] <= getattr(e, name)[gap - 1]).all(), name
    assert (e.status[~used] == estimator.INACTIVE).all()
    assert np.isnan(e.innovation[~used]).all()
    assert not e.alarm[~used].any()
    for name in ("slope", "slope_sd", "beta", "offset", "g_drop", "g_rise"):
        assert np.isfinite(getattr(e, name)).all()


@settings(max_examples=40, deadline=None)
@given(lengths, seeds)
def test_driving_and_braking_are_alike(n, seed):
    """All signs turned: slope, ratio, sums and alarms stay, offset and errors turn theirs."""
    y, mu_i, rho_mu_j, is_active = drive(n, seed)
    e, _ = run((y, mu_i, rho_mu_j, is_active))
    mirrored, _ = run((-y, -mu_i, -rho_mu_j, is_active))
    for name in FIELDS:
        sign = -1.0 if name in ("offset", "innovation") else 1.0
        assert np.array_equal(getattr(e, name) * sign, getattr(mirrored, name), equal_nan=True), name


@settings(max_examples=40, deadline=None)
@given(lengths, seeds)
def test_driving_and_braking_swap_the_standard_sums(n, seed):
    """3.23 without the sign: what is a drop in driving is a rise in braking."""
    y, mu_i, rho_mu_j, is_active = drive(n, seed)
    tuning = QUICK._replace(adapted=False)
    e, _ = run((y, mu_i, rho_mu_j, is_active), tuning)
    mirrored, _ = run((-y, -mu_i, -rho_mu_j, is_active), tuning)
    assert same(e.g_drop, mirrored.g_rise)
    assert same(e.g_rise, mirrored.g_drop)
    assert np.array_equal(e.alarm, -mirrored.alarm)
    assert same(e.slope, mirrored.slope)


@settings(max_examples=40, deadline=None)
@given(lengths, seeds, st.sampled_from([0.25, 0.5, 2.0, 4.0]))
def test_slower_time(n, seed, factor):
    """Only products with time count: samples, memory and thresholds stretched alike give the same."""
    data = drive(n, seed)
    e, _ = run(data)
    f = factor
    stretched = QUICK._replace(
        r=QUICK.r * f, q_k=QUICK.q_k / f, q_beta=QUICK.q_beta / f, q_delta=QUICK.q_delta / f, h=QUICK.h * f,
        tau_settle=QUICK.tau_settle * f, tau_window=QUICK.tau_window * f, tau_sort=QUICK.tau_sort * f,
        tau_fade=QUICK.tau_fade * f,
    )  # fmt: skip
    assert_same(e, run(data, stretched, dt=DT * f)[0], g_drop=f, g_rise=f)


@settings(max_examples=40, deadline=None)
@given(lengths, seeds, st.sampled_from([0.5, 2.0]))
def test_scale_of_slip(n, seed, f):
    """Slips, their noise and thresholds times a factor: slopes divided by it."""
    y, *others = drive(n, seed)
    e, _ = run((y, *others))
    scaled = QUICK._replace(
        r=QUICK.r * f * f, q_k=QUICK.q_k * f * f, q_delta=QUICK.q_delta * f * f, sd_delta=QUICK.sd_delta * f,
        sd_k_reset=QUICK.sd_k_reset * f, zeta=QUICK.zeta * f, h=QUICK.h * f, s_max=QUICK.s_max * f,
        sd_delta_release=QUICK.sd_delta_release * f,
    )  # fmt: skip
    other, _ = run((y * f, *others), scaled, slope=30.0 / f)
    bounded = np.isin(e.slope, (1.0, 300.0)) | (e.slope < 2.5) | (e.slope > 120.0)
    if not bounded.any():  # the bounds of the slope do not scale
        k = 1.0 / f
        assert_same(e, other, slope=k, slope_sd=k, offset=f, innovation=f, innovation_sd=f, g_drop=f, g_rise=f)


@settings(max_examples=40, deadline=None)
@given(lengths, seeds, st.sampled_from([0.5, 2.0]))
def test_scale_of_traction(n, seed, f):
    """Traction and its bounds times a factor: slopes times it."""
    y, mu_i, rho_mu_j, is_active = drive(n, seed)
    e, _ = run((y, mu_i, rho_mu_j, is_active))
    scaled = QUICK._replace(
        q_k=QUICK.q_k / f / f, sd_k_reset=QUICK.sd_k_reset / f, mu_min=QUICK.mu_min * f, mu_max=QUICK.mu_max * f
    )
    other, _ = run((y, mu_i * f, rho_mu_j * f, is_active), scaled, slope=30.0 * f)
    if ((e.slope > 2.5) & (e.slope < 120.0)).all():
        assert_same(e, other, slope=f, slope_sd=f)


@settings(max_examples=40, deadline=None)
@given(lengths, seeds)
def test_bounds_of_the_outputs(n, seed):
    e, _ = run(drive(n, seed))
    assert ((e.slope > 0.999) & (e.slope < 300.001)).all()
    assert ((e.beta >= 0.2) & (e.beta <= 5.0)).all()
    assert (e.slope_sd > 0).all()
    assert ((e.g_drop >= 0) & (e.g_drop <= QUICK.h)).all()
    assert ((e.g_rise >= 0) & (e.g_rise <= QUICK.h)).all()
    alarmed = e.alarm != 0
    assert (e.g_drop[alarmed] == 0).all()
    assert (e.g_rise[alarmed] == 0).all()


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 400), seeds)
def test_sides_do_not_see_each_other(n, seed):
    """Left and right are two estimators: swapped inputs swap the outputs, and nothing of one is left in the other."""
    left, right = drive(n, seed), drive(n, seed + 1)
    alone = [run(side)[0] for side in (left, right)]
    swapped = [run(side)[0] for side in (right, left)]
    assert_same(alone[0], swapped[1])
    assert_same(alone[1], swapped[0])


def test_inputs_are_left_as_they_are():
    data = drive(500, 1)
    before = [d.copy() for d in data]
    run([d[::-1] for d in data])
    run([d.astype(np.float32) if d.dtype == np.float64 else d.astype(int) for d in data])
    for d, b in zip(data, before, strict=True):
        assert same(d, b)


def test_views_and_other_types_are_taken():
    y, mu_i, rho_mu_j, is_active = drive(500, 1)
    wide = np.column_stack([y, mu_i, rho_mu_j])
    e, _ = run((wide[:, 0], wide[:, 1], wide[:, 2], is_active.astype(float)))
    assert_same(run((y, mu_i, rho_mu_j, is_active))[0], e)
    assert len(estimator._scan.nopython_signatures) == 1  # each would be compiled for seconds
