"""The filter of slip slope, slope ratio and offset, and the estimator around it.

Against matrices, least squares and the statistics that a filter shows whose model is the truth; then what it does with
data that cannot tell a parameter, with gaps and with changes of the road.
"""

import itertools
import math

import numpy as np
import pytest
from numba import njit

from aqualog.detect.slip_slope import ekf, estimator
from aqualog.detect.slip_slope.ekf import Belief
from aqualog.detect.slip_slope.estimator import cusum_input
from aqualog.detect.slip_slope.tuning import TUNING, Params
from aqualog.model.half_car import HalfCar, HalfCarRun, SurfaceChange, simulate_half_car
from aqualog.model.scenario import Excitation
from aqualog.physics import differential
from tests.bench.ekf import OPEN, aqualog_slopes, disagreement, drive, numpy_slopes, python_slopes, textbook_update

DT = 0.01
ESTIMATING, FROZEN, BLIND, TOO_LARGE, SPINNING, INACTIVE = range(6)


def belief_of(x, P):
    return Belief(*(float(v) for v in (*x, P[0, 0], P[0, 1], P[0, 2], P[1, 1], P[1, 2], P[2, 2])))


def matrices_of(b):
    P = np.array([[b.P_kk, b.P_kb, b.P_kd], [b.P_kb, b.P_bb, b.P_bd], [b.P_kd, b.P_bd, b.P_dd]])
    return np.array([b.k, b.beta, b.delta]), P


def random_belief(rng):
    x = np.array([rng.uniform(0.015, 0.12), rng.uniform(0.5, 2.0), rng.normal(0, 5e-3)])
    A = rng.normal(size=(3, 3)) * np.array([0.01, 0.05, 5e-3])[:, None]
    return x, A @ A.T + 1e-14 * np.eye(3)


def scan(y, mu_i, rho_mu_j=0.0, *, tuning=TUNING, dt=DT, slope=30.0, beta=1.0, active=True, state=None):
    """The estimator on arrays or numbers; the state goes on if one is given."""
    y, mu_i, rho_mu_j = (np.array(a, dtype=float) for a in np.broadcast_arrays(y, mu_i, rho_mu_j))
    if state is None:
        state = estimator.initial_state(tuning, slope=slope, beta=beta)
    is_active = np.broadcast_to(active, y.shape)
    return estimator.scan(Params.make(tuning, dt), state, y, mu_i, rho_mu_j, is_active)


def white(n, dt=DT, seed=0, density=TUNING.r):
    """White noise of a spectral density."""
    return np.random.default_rng(seed).normal(0.0, math.sqrt(density / dt), n)


def disparity(a, b, prior):
    """Largest difference of two covariances in units of the standard deviations before the update."""
    sd = np.sqrt(np.diag(prior))
    return np.abs((a - b) / np.outer(sd, sd)).max()


def test_update_is_the_textbooks():
    """Joseph's form with the optimal gain is (1 - K H) P."""
    rng = np.random.default_rng(1)
    for _ in range(500):
        x, P = random_belief(rng)
        y, a, b, r = rng.normal(0, 0.01), rng.normal(0, 0.1), rng.normal(0, 0.1), 10 ** rng.uniform(-7, -4)
        after, innovation, S = ekf.update(belief_of(x, P), y, a, b, r, True, True, True)
        x_1, P_1, innovation_1, S_1 = textbook_update(x, P, y, a, b, r)
        x_2, P_2 = matrices_of(after)
        assert x_2 == pytest.approx(x_1, rel=1e-12, abs=1e-15)
        assert disparity(P_2, P_1, P) < 1e-12
        assert innovation == pytest.approx(innovation_1, rel=1e-12, abs=1e-16)
        assert pytest.approx(S_1, rel=1e-12) == S


@pytest.mark.parametrize("learn", list(itertools.product([True, False], repeat=3)))
def test_masked_update_is_josephs_with_that_gain(learn):
    """A gain with zeros: P <- (1 - K H) P (1 - K H)' + K r K', symmetric, positive, no smaller than the optimal one."""
    rng = np.random.default_rng(2)
    for _ in range(200):
        x, P = random_belief(rng)
        y, a, b, r = rng.normal(0, 0.01), rng.normal(0, 0.1), rng.normal(0, 0.1), 10 ** rng.uniform(-7, -4)
        after, innovation, S = ekf.update(belief_of(x, P), y, a, b, r, *learn)
        H = np.array([a - x[1] * b, -b * x[0], 1.0])
        K = P @ H / (H @ P @ H + r) * np.array(learn)
        A = np.eye(3) - np.outer(K, H)
        joseph = A @ P @ A.T + r * np.outer(K, K)
        x_2, P_2 = matrices_of(after)
        assert disparity(P_2, joseph, P) < 1e-12
        assert x_2 == pytest.approx(x + K * innovation, rel=1e-12, abs=1e-15)
        assert pytest.approx(H @ P @ H + r, rel=1e-12) == S
        if not learn[0]:
            assert (after.k, after.P_kk) == (x[0], pytest.approx(P[0, 0], rel=1e-12))
        if not learn[1]:
            assert (after.beta, after.P_bb) == (x[1], pytest.approx(P[1, 1], rel=1e-12))
        if not learn[2]:
            assert (after.delta, after.P_dd) == (x[2], pytest.approx(P[2, 2], rel=1e-12))
        _, optimal, *_ = textbook_update(x, P, y, a, b, r)
        scale = 1.0 / np.sqrt(np.diag(P))
        assert np.linalg.eigvalsh((P_2 - optimal) * np.outer(scale, scale)).min() > -1e-12


def test_prediction_adds_what_a_random_walk_gains():
    x, P = random_belief(np.random.default_rng(3))
    x_2, P_2 = matrices_of(ekf.predict(belief_of(x, P), 1e-6, 2e-6, 3e-6))
    assert (x_2 == x).all()
    assert pytest.approx(np.diag([1e-6, 2e-6, 3e-6]), abs=1e-18) == P_2 - P


@pytest.mark.parametrize("q", [1.0, 0.0])
def test_covariance_stays_positive(q):
    """A million steps of spikes, standstills, signs, tiny and huge numbers, in pieces; also without process noise."""
    tuning = TUNING._replace(
        mu_max=np.inf, s_max=np.inf, q_k=q * TUNING.q_k, q_beta=q * TUNING.q_beta, q_delta=q * TUNING.q_delta
    )
    state = estimator.initial_state(tuning, slope=30.0)
    rng = np.random.default_rng(4)
    n, least = 2000, 1.0
    for piece in range(500):
        scale = 10.0 ** rng.uniform(-6, 3, 2) if piece % 5 else np.ones(2)
        mu_i, rho_mu_j = rng.normal(0, 0.1, (2, n)) * scale[:, None]
        if piece % 3 == 0:
            mu_i[:], rho_mu_j[:] = mu_i[0], 0.0
        y = rng.standard_t(1.5, n) * 1e-3 + (mu_i - rho_mu_j) / 30.0
        y[rng.random(n) < 0.01] *= 1e3
        y[rng.random(n) < 0.02] = np.nan
        e, state = scan(y, mu_i, rho_mu_j, tuning=tuning, state=state)
        assert np.isfinite(e.slope_sd).all()
        assert ((e.slope >= 1.0) & (e.slope <= 300.0001)).all()
        assert ((e.beta >= 0.2) & (e.beta <= 5.0)).all()
        _, P = matrices_of(state.belief)
        sd = np.sqrt(np.diag(P))
        least = min(least, np.linalg.eigvalsh(P / np.outer(sd, sd)).min())
    # correlations: positive definite with process noise, to rounding without
    assert least > (0.0 if q else -1e-12)


def batch(H, y, x0, P0, r):
    """Least squares with a prior."""
    information = np.linalg.inv(P0) + H.T @ H / r
    return np.linalg.solve(information, np.linalg.inv(P0) @ x0 + H.T @ y / r), np.linalg.inv(information)


@pytest.mark.parametrize("seed", range(5))
def test_known_ratio_is_least_squares(seed):
    """beta known: linear in k and delta, and the filter without process noise is the least-squares solution."""
    rng = np.random.default_rng(seed)
    a, b = rng.normal(0.05, 0.05, (2, 400))
    y = (a - 1.2 * b) * 0.04 + 3e-3 + rng.normal(0, 1e-3, 400)
    belief = Belief(1 / 30, 1.2, 0.0, 1e-4, 0.0, 2e-6, 0.0, 0.0, 2.5e-5)
    x, P = batch(
        np.column_stack([a - 1.2 * b, np.ones(400)]), y, np.array([1 / 30, 0.0]), np.array([[1e-4, 2e-6], [2e-6, 2.5e-5]]), 1e-6
    )  # fmt: skip
    for one in zip(y, a, b, strict=True):
        belief, _, _ = ekf.update(belief, *one, 1e-6, True, True, True)
    assert (belief.k, belief.delta) == pytest.approx(tuple(x), rel=1e-9)
    assert (belief.P_kk, belief.P_kd, belief.P_dd) == pytest.approx((P[0, 0], P[0, 1], P[1, 1]), rel=1e-9)
    assert (belief.beta, belief.P_bb, belief.P_kb, belief.P_bd) == (1.2, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("seed", range(5))
def test_known_slope_is_least_squares(seed):
    """k known: linear in beta and delta."""
    rng = np.random.default_rng(seed)
    a, b = rng.normal(0.05, 0.05, (2, 400))
    y = (a - 1.2 * b) * 0.04 + 3e-3 + rng.normal(0, 1e-3, 400)
    belief = Belief(0.04, 1.0, 0.0, 0.0, 0.0, 0.0, 0.09, 1e-5, 2.5e-5)
    x, P = batch(
        np.column_stack([-b * 0.04, np.ones(400)]), y - 0.04 * a, np.array([1.0, 0.0]), np.array([[0.09, 1e-5], [1e-5, 2.5e-5]]), 1e-6
    )  # fmt: skip
    for one in zip(y, a, b, strict=True):
        belief, _, _ = ekf.update(belief, *one, 1e-6, True, True, True)
    assert (belief.beta, belief.delta) == pytest.approx(tuple(x), rel=1e-9)
    assert (belief.P_bb, belief.P_bd, belief.P_dd) == pytest.approx((P[0, 0], P[0, 1], P[1, 1]), rel=1e-9)
    assert belief.k == 0.04


def test_a_window_tells_as_much_as_least_squares():
    """The window's standard deviations are those of a regression with the other parameters unknown."""
    rng = np.random.default_rng(6)
    n, dt, k, beta, r = 3000, 0.01, 1 / 28, 1.3, 1.4e-7
    a = 0.05 + 0.03 * np.sin(np.arange(n) * 0.01) + rng.normal(0, 0.01, n)
    b = 0.03 + 0.5 * a + rng.normal(0, 0.02, n)
    window = ekf.EMPTY
    for one in zip(a, b, strict=True):
        window = ekf.window_step(window, 1.0, dt, *one)
    assert window == pytest.approx(
        (n * dt, a.mean(), b.mean(), a.var(), np.cov(a, b, bias=True)[0, 1], b.var()), rel=1e-9
    )
    H = np.column_stack([a - beta * b, -b * k, np.ones(n)])
    _, P = batch(H, np.zeros(n), np.zeros(3), 1e12 * np.eye(3), r / dt)
    assert ekf.sd_beta(window, k, beta, r) == pytest.approx(np.sqrt(P[1, 1]), rel=1e-4)
    # that of the slope takes the ratio as known
    _, P = batch(H[:, [0, 2]], np.zeros(n), np.zeros(2), 1e12 * np.eye(2), r / dt)
    assert ekf.sd_slope(window, beta, r) == pytest.approx(np.sqrt(P[0, 0]), rel=1e-4)


@pytest.mark.parametrize("dt", [0.01, 0.002])
def test_the_window_forgets(dt):
    """Moments with exponential weights, and a weight in seconds that ends at the time constant."""
    tau = 5.0
    n = round(30.0 / dt)
    rng = np.random.default_rng(7)
    a, b = rng.normal(0.1, 0.05, (2, n))
    window = ekf.EMPTY
    for one in zip(a, b, strict=True):
        window = ekf.window_step(window, math.exp(-dt / tau), dt, *one)
    weights = np.exp(-np.arange(n)[::-1] * dt / tau)
    share = weights / weights.sum()
    mean_a, mean_b = share @ a, share @ b
    hand = (
        weights.sum() * dt, mean_a, mean_b, share @ (a - mean_a) ** 2, share @ ((a - mean_a) * (b - mean_b)), share @ (b - mean_b) ** 2,
    )  # fmt: skip
    assert window == pytest.approx(hand, rel=1e-9)
    assert window.seconds == pytest.approx(tau, rel=0.01)


def test_nothing_told_is_infinite_doubt():
    """E10: constant traction leaves the slope open, a fixed split the ratio."""
    window = ekf.EMPTY
    for _ in range(1000):
        window = ekf.window_step(window, 0.9995, DT, 0.08, 0.03)
    assert ekf.sd_slope(window, 1.0, TUNING.r) > 100.0
    window = ekf.EMPTY
    for a in 0.08 + 0.05 * np.sin(np.arange(3000) * 0.01):
        window = ekf.window_step(window, 0.9995, DT, a, 0.4 * a)
    assert ekf.sd_slope(window, 1.0, TUNING.r) < 0.01
    assert ekf.sd_beta(window, 1 / 30, 1.0, TUNING.r) > 100.0


def test_agrees_with_plain_loops():
    """What the measurement of speed compares: NumPy's matrices and scalars in plain Python."""
    data = drive(2000)
    own = aqualog_slopes(data)
    assert disagreement(numpy_slopes(data), own) < 1e-9
    assert disagreement(python_slopes(data), own) < 1e-9
    assert np.ptp(own) > 1.0


def test_begins_as_its_tuning_says():
    state = estimator.initial_state(TUNING, slope=30.0, beta=1.2)
    x, P = matrices_of(state.belief)
    assert x == pytest.approx([1 / 30, 1.2, 0.0])
    assert np.sqrt(np.diag(P)) == pytest.approx([0.01 * 33 / 30, 0.05, 5e-3])
    assert np.count_nonzero(P) == 3
    assert (state.g_drop, state.g_rise, state.window.seconds) == (0.0, 0.0, 0.0)
    # a soft tyre is as well known as a stiff one, in per cent
    soft = estimator.initial_state(TUNING, slope=12.0).belief
    assert math.sqrt(soft.P_kk) / soft.k == pytest.approx(math.sqrt(state.belief.P_kk) / state.belief.k)


RUNS, SECONDS, RATE = 400, 60, 50.0
CHECKS = (2.0, 5.0, 20.0, 60.0)  # [s]
# the tuning itself, and one in which the parameters wander as much as they are unknown
MATCHED = {"tuning": TUNING, "wandering": TUNING._replace(q_k=1e-6, q_beta=1e-5, q_delta=1e-8)}


def matched_data(tuning, seed):
    """Runs that follow the filter's model: prior, random walks and noise drawn; both tractions vary independently."""
    rng = np.random.default_rng(seed)
    n, dt = round(SECONDS * RATE), 1.0 / RATE
    t = np.arange(n) * dt

    def traction(mean):
        mu = np.full((RUNS, n), mean)
        for _ in range(4):
            period, phase = rng.uniform(1.5, 6.0, (RUNS, 1)), rng.uniform(0, 2 * np.pi, (RUNS, 1))
            mu += 0.04 * np.sin(2 * np.pi * t / period + phase)
        return mu

    mu_i, rho_mu_j = traction(0.08), traction(0.03)
    b = estimator.initial_state(tuning, slope=30.0).belief
    x = np.empty((3, RUNS, n))
    for row, (mean, P, q) in enumerate(
        ((b.k, b.P_kk, tuning.q_k), (b.beta, b.P_bb, tuning.q_beta), (b.delta, b.P_dd, tuning.q_delta))
    ):
        start = rng.normal(mean, math.sqrt(P), (RUNS, 1))
        x[row] = start + np.cumsum(rng.normal(0.0, math.sqrt(q * dt), (RUNS, n)), axis=1)
    y = differential.predicted_differential_slip(mu_i, rho_mu_j, inverse_slope=x[0], beta=x[1], offset=x[2])
    y += rng.normal(0.0, math.sqrt(tuning.r / dt), (RUNS, n))
    return y, mu_i, rho_mu_j, x


@njit
def filter_runs(belief, y, mu_i, rho_mu_j, r, q_k, q_beta, q_delta):  # pragma: no cover
    """The bare filter over all runs: states, covariances, innovations and their variances at every sample."""
    runs, n = y.shape
    out = np.empty((11, runs, n))
    for run in range(runs):
        b = belief
        for i in range(n):
            b = ekf.predict(b, q_k, q_beta, q_delta)
            b, innovation, S = ekf.update(b, y[run, i], mu_i[run, i], rho_mu_j[run, i], r, True, True, True)
            for row in range(9):
                out[row, run, i] = b[row]
            out[9, run, i] = innovation
            out[10, run, i] = S
    return out


def filtered(tuning, data, **wrong):
    """`filter_runs` on matched data with a tuning that may be wrong."""
    p = Params.make(tuning._replace(**wrong), 1.0 / RATE)
    belief = estimator.initial_state(tuning, slope=30.0).belief
    return filter_runs(belief, *data[:3], p.r, p.q_k, p.q_beta, p.q_delta)


def nees(out, truth):
    """Mean over the runs of the normalised squared error at the checks; 3 if the covariance is true."""
    means = []
    for i in [round(t * RATE) - 1 for t in CHECKS]:
        error = (out[:3, :, i] - truth[:, :, i]).T
        kk, kb, kd, bb, bd, dd = out[3:9, :, i]
        P = np.array([[kk, kb, kd], [kb, bb, bd], [kd, bd, dd]]).transpose(2, 0, 1)
        means.append(float(np.mean(np.einsum("ni,ni->n", error, np.linalg.solve(P, error[:, :, None])[:, :, 0]))))
    return means


def band(degrees, n, checks=1):
    """95 % of the means of n chi-squares lie here, of several of them all at once (n degrees is large: normal)."""
    half = {1: 1.96, 4: 2.50}[checks] * math.sqrt(2.0 * degrees / n)
    return degrees - half, degrees + half


def inside(value, limits):
    return limits[0] < value < limits[1]


def chi2_survival(x, degrees):
    """Probability of more than x, even number of degrees."""
    terms = np.array([(x / 2) ** j / math.factorial(j) for j in range(degrees // 2)])
    return np.exp(-x / 2) * terms.sum(axis=0)


def ljung_box(e, lags=20):
    """Statistic of each row, chi-square of `lags` degrees if white."""
    n = e.shape[1]
    e = e - e.mean(axis=1, keepdims=True)
    power = np.sum(e * e, axis=1)
    rho = np.array([np.sum(e[:, k:] * e[:, :-k], axis=1) / power for k in range(1, lags + 1)])
    return n * (n + 2) * np.sum(rho**2 / (n - np.arange(1, lags + 1))[:, None], axis=0), rho


@pytest.fixture(scope="module", params=list(MATCHED))
def matched(request):
    tuning = MATCHED[request.param]
    data = matched_data(tuning, seed=20)
    return tuning, data, filtered(tuning, data)


def test_errors_are_as_large_as_the_covariance_says(matched):
    _, data, out = matched
    assert [v for v in nees(out, data[3]) if not inside(v, band(3, RUNS, checks=4))] == []


def test_innovations_are_as_large_as_expected(matched):
    _, _, out = matched
    nis = out[9] ** 2 / out[10]
    assert inside(nis.mean(), band(1, nis.size))
    for piece in np.array_split(nis, 4, axis=1):
        assert inside(piece.mean(), band(1, piece.size, checks=4))


def test_innovations_are_white(matched):
    """Ljung-Box over 20 lags: mean of the statistic and uniform p-values over the runs; each lag by itself."""
    _, _, out = matched
    statistic, rho = ljung_box(out[9] / np.sqrt(out[10]))
    assert inside(statistic.mean(), band(20, RUNS))
    p = np.sort(chi2_survival(statistic, 20))
    kolmogorov = np.abs(p - (np.arange(RUNS) + 0.5) / RUNS).max() + 0.5 / RUNS
    assert kolmogorov < 1.36 / math.sqrt(RUNS)
    # 20 lags at 5 % each: the bound of one per cent for all of them together
    assert np.abs(rho.mean(axis=1)).max() * math.sqrt(out[9].size) < 3.5


@pytest.mark.parametrize("factor", [1.5, 1 / 1.5])
@pytest.mark.parametrize("name", list(MATCHED))
def test_a_wrong_variance_would_be_seen(name, factor):
    """The bands are narrow enough: a noise that is wrong by half is far outside of them."""
    data = matched_data(MATCHED[name], seed=21)
    out = filtered(MATCHED[name], data, r=MATCHED[name].r * factor)
    assert not any(inside(v, band(3, RUNS, checks=4)) for v in nees(out, data[3])[1:])
    nis = out[9] ** 2 / out[10]
    assert nis.mean() == pytest.approx(1 / factor, rel=0.05)
    if name == "wandering":  # and so is a random walk
        out = filtered(MATCHED[name], data, q_k=MATCHED[name].q_k * factor**2)
        assert not inside(nees(out, data[3])[-1], band(3, RUNS, checks=4))


@pytest.mark.parametrize("gates", [True, False])
def test_slope_within_its_standard_deviation(gates):
    """The whole estimator, change detection off: coverage of +- 1.96 sd, and the innovations' variance."""
    tuning = TUNING._replace(h=np.inf) if gates else OPEN
    y, mu_i, rho_mu_j, x = matched_data(TUNING, seed=22)
    covered, nis = [], []
    for run in range(RUNS):
        e, _ = scan(y[run], mu_i[run], rho_mu_j[run], tuning=tuning, dt=1.0 / RATE)
        at = [round(t * RATE) - 1 for t in CHECKS[1:]]
        covered.append(np.abs(e.slope - 1.0 / x[0, run])[at] < 1.96 * e.slope_sd[at])
        nis.append(np.nanmean((e.innovation / e.innovation_sd) ** 2))
    share = np.mean(covered, axis=0)
    # slope is 1 / k: at 5 s, with k known to 10 %, its distribution is still skew
    assert (share[1:] > 0.92).all()
    assert (share[1:] < 0.98).all()
    assert share[0] > 0.90
    if not gates:
        assert inside(np.mean(nis), band(1, RUNS * y.shape[1]))
    else:  # samples beyond the bounds of traction and slip are left out
        assert np.mean(nis) == pytest.approx(1.0, abs=0.02)


T600 = np.arange(60_000) * DT


def vary(t, mean, period=5.0, amplitude=0.05):
    return mean + amplitude * np.sin(2 * np.pi * t / period)


def test_fixed_split_tells_no_ratio():
    """E10: the ratio stays at what it was, and so does its variance, though the slope is learnt."""
    t = T600[:12_000]
    mu_i = vary(t, 0.08)
    e, state = scan(
        (mu_i - 1.4 * 0.3 * mu_i) / 30.0 + white(t.size), mu_i, 0.3 * mu_i, tuning=TUNING._replace(h=np.inf)
    )
    assert (e.beta == 1.0).all()
    assert not e.beta_told.any()
    assert state.belief.P_bb == pytest.approx(TUNING.sd_beta**2, rel=1e-9)
    # the slope is that which the wrong ratio makes of it, and its doubt says so
    assert e.slope[-1] == pytest.approx(30.0 * 0.7 / 0.58, rel=0.05)
    assert np.mean(e.status[1000:] == ESTIMATING) > 0.99


@pytest.mark.parametrize("ratio", [0.92, 1.1])
def test_independent_traction_tells_the_ratio(ratio):
    t = T600[:30_000]
    mu_i, rho_mu_j = vary(t, 0.12, 5.0, 0.08), vary(t, 0.02, 3.3, 0.08)
    y = (mu_i - ratio * rho_mu_j) / 30.0 + 2e-3 + white(t.size, seed=5)
    e, state = scan(y, mu_i, rho_mu_j, tuning=TUNING._replace(h=np.inf))
    sd = math.sqrt(state.belief.P_bb)
    assert sd < 0.5 * TUNING.sd_beta
    assert abs(e.beta[-1] - ratio) < 2.5 * sd
    assert e.beta_told[3000:].all()
    clean, _ = scan((mu_i - ratio * rho_mu_j) / 30.0 + 2e-3, mu_i, rho_mu_j, tuning=TUNING._replace(r=1e-9))
    assert clean.beta[-1] == pytest.approx(ratio, rel=0.005)
    assert clean.slope[-1] == pytest.approx(30.0, rel=0.01)
    assert clean.offset[-1] == pytest.approx(2e-3, abs=3e-5)


def test_one_driven_axle_leaves_the_ratio():
    """E10: beta is absent, whatever it was taken to be."""
    t = T600[:6000]
    mu = vary(t, 0.08)
    for beta in (0.7, 1.0, 1.6):
        e, state = scan(mu / 25.0 + 1e-3, mu, 0.0, beta=beta)
        assert (e.beta == beta).all()
        assert state.belief.P_bb == pytest.approx(TUNING.sd_beta**2, rel=1e-9)
        assert e.slope[-1] == pytest.approx(25.0, rel=0.02)
        assert e.offset[-1] == pytest.approx(1e-3, abs=2e-4)


@pytest.mark.parametrize("learnt", [False, True])
def test_constant_traction_freezes_the_slope(learnt):
    """E10: no process noise, and a radius that changes slowly goes to the offset."""
    state = None
    if learnt:
        t = T600[:6000]
        mu = vary(t, 0.08)
        _, state = scan(mu / 30.0, mu, 0.0)
        # the window forgets the variation
        _, state = scan(np.full(12_000, 0.08 / 30.0), 0.08, state=state)
    else:
        _, state = scan(np.full(6000, 0.08 / 30.0), 0.08)
    before = state.belief
    drift = 3e-3 * T600 / 600.0
    e, state = scan(0.08 / 30.0 + drift + white(T600.size, seed=3, density=1e-9), 0.08, state=state)
    assert (e.status == FROZEN).all()
    assert not e.alarm.any()
    assert np.abs(e.slope / e.slope[0] - 1.0).max() < 0.02
    assert e.offset[-1] - e.offset[0] == pytest.approx(3e-3, abs=4e-4)
    # nothing was added to what is not known of the slope
    assert state.belief.P_kk <= before.P_kk


def test_status_of_even_and_uneven_traction():
    """The window opens and closes as traction varies and rests."""
    t = T600[:30_000]
    resting = (t > 60.0) & (t < 240.0)
    mu = np.where(resting, 0.08, vary(t, 0.08))
    e, _ = scan(mu / 30.0, mu, 0.0)
    assert (e.status[500:6000] == ESTIMATING).all()
    assert (e.status[(t > 180) & (t < 239)] == FROZEN).all()
    assert (e.status[t > 250] == ESTIMATING).all()


def test_process_noise_only_where_it_is_told():
    """q_k while the slope is told, q_beta while the ratio is, q_delta always; each alone."""
    t = T600[:6000]
    mu_i, rho_mu_j = vary(t, 0.15), vary(t, 0.02, 3.3)
    told = {
        "k": (mu_i, 0.0),
        "both": (mu_i, rho_mu_j),
        "none": (np.full(t.size, 0.08), 0.0),
        "blind": (1e-3 * mu_i, 0.0),
    }
    # a filter that learns next to nothing shows what is added
    deaf = TUNING._replace(r=1e3, h=np.inf)
    for name, (a, b) in told.items():
        for told_k, told_beta in ((0.0, 0.0), (np.inf, 0.0), (np.inf, np.inf)):
            _, state = scan(np.zeros(t.size), a, b, tuning=deaf._replace(told_k=told_k, told_beta=told_beta))
            start = estimator.initial_state(deaf, slope=30.0).belief
            gained = [(getattr(state.belief, P) - getattr(start, P)) / 60.0 for P in ("P_kk", "P_bb", "P_dd")]
            learns = name != "blind"
            wanted = [deaf.q_k * (told_k > 0 and learns), deaf.q_beta * (told_beta > 0 and learns), deaf.q_delta]
            assert gained == pytest.approx(wanted, rel=0.01, abs=1e-12), name


@pytest.mark.parametrize("mu", [0.0, 0.05, 0.15])
def test_equal_slips_are_blind(mu):
    """E10: nothing is learnt of the slope, and the radii are."""
    t = T600[:6000]
    a = vary(t, mu)
    e, state = scan(2e-3 + white(t.size, seed=2), a, a)
    assert (e.status == BLIND).all()
    assert (e.slope == 30.0).all()
    assert (e.beta == 1.0).all()
    assert (e.g_drop == 0.0).all()
    assert not e.alarm.any()
    assert e.offset[-1] == pytest.approx(2e-3, abs=3 * math.sqrt(state.belief.P_dd))


def test_both_forms_give_the_same_slopes():
    """Formulated at the front axle and at the rear one, on the same drive."""
    t = T600
    C_F, C_R, mu_F, mu_R = 30.0, 26.0, vary(t, 0.09, 5.0), vary(t, 0.02, 3.3)
    v_F, v_R = 25.0 * 1.002 / (1 - mu_F / C_F), 25.0 / (1 - mu_R / C_R)
    found = {}
    for axle, (v_i, v_j, mu_i, mu_j) in {"F": (v_F, v_R, mu_F, mu_R), "R": (v_R, v_F, mu_R, mu_F)}.items():
        y, rho = differential.differential_slip(v_i, v_j), differential.speed_ratio(v_i, v_j)
        e, _ = scan(y, mu_i, rho * mu_j, tuning=TUNING._replace(r=1e-9))
        found[axle] = (e.slope[-1], e.beta[-1], e.offset[-1])
    assert found["F"] == pytest.approx((C_F, C_F / C_R, 2e-3), rel=0.02)
    assert found["R"] == pytest.approx((C_R, C_R / C_F, -2e-3), rel=0.02)


def test_slope_and_ratio_stay_within_sense():
    """Data that no tyre makes: slopes from 1 to 300, ratios from 0.2 to 5."""
    t = T600[:6000]
    a, b = vary(t, 0.0, 5.0, 0.1), vary(t, 0.0, 3.3, 0.1)
    tuning = OPEN._replace(sd_k=1.0, sd_beta=50.0)
    for k, slope in ((-0.1, 300.0), (5.0, 1.0)):
        reached = scan(k * a, a, 0.0, tuning=tuning)[0].slope
        assert (reached.max() if k < 0 else reached.min()) == pytest.approx(slope, rel=1e-9)
        assert ((reached > 0.999) & (reached < 300.001)).all()
    for beta, bound in ((-4.0, 0.2), (40.0, 5.0)):
        e, _ = scan((a - beta * b) / 30.0, a, b, tuning=tuning._replace(sd_k=1e-6))
        assert e.beta[-1] == bound


@pytest.mark.parametrize("what", ["y", "mu_i", "rho_mu_j", "active"])
def test_a_missing_sample_holds_the_state(what):
    t = T600[:3000]
    data = {"y": vary(t, 0.08) / 28.0, "mu_i": vary(t, 0.08), "rho_mu_j": vary(t, 0.0, 3.3, 0.02)}
    _, state = scan(*data.values())
    one = {k: np.array([v[100]]) for k, v in data.items()}
    if what != "active":
        one[what][:] = np.nan
    e, after = scan(*one.values(), state=state, active=what != "active")
    # radii go on drifting while nothing is seen of them; all else is held
    drifted = state.belief._replace(P_dd=state.belief.P_dd + TUNING.q_delta * 0.01)
    window = state.window._replace(seconds=state.window.seconds * math.exp(-0.01 / TUNING.tau_window))
    fade = math.exp(-0.01 / TUNING.tau_fade)
    sums = {n: g * fade if (g := getattr(state, n)) > TUNING.zeta * DT else 0.0 for n in ("g_drop", "g_rise")}
    assert after == state._replace(belief=drifted, window=window, **sums)
    assert e.status[0] == INACTIVE
    assert np.isnan([e.innovation[0], e.innovation_sd[0]]).all()
    held = (e.slope[0], e.beta[0], e.offset[0], e.g_drop[0], e.g_rise[0], e.alarm[0], e.beta_told[0])
    assert held == (1 / state.belief.k, state.belief.beta, state.belief.delta, sums["g_drop"], sums["g_rise"], 0.0, 0.0)
    assert e.slope_sd[0] == pytest.approx(math.sqrt(state.belief.P_kk) / state.belief.k**2, rel=1e-12)


@pytest.mark.parametrize("y", [0.003, np.inf, -np.inf])
@pytest.mark.parametrize("mu_i", [0.08, np.inf, -np.inf])
@pytest.mark.parametrize("rho_mu_j", [0.02, np.inf, -np.inf])
def test_infinite_samples_do_no_lasting_harm(y, mu_i, rho_mu_j):
    t = T600[:3000]
    good = (vary(t, 0.08) / 28.0, vary(t, 0.08), np.zeros(t.size))
    _, state = scan(*good)
    _, after = scan(np.array([y]), mu_i, rho_mu_j, state=state)
    e, _ = scan(*good, state=after)
    assert np.isfinite([e.slope, e.slope_sd, e.beta, e.offset]).all()
    assert (e.status == ESTIMATING).mean() > 0.9


def test_nothing_in_nothing_out():
    e, state = scan(np.empty(0), np.empty(0))
    assert e.slope.size == e.status.size == 0
    assert state == estimator.initial_state(TUNING, slope=30.0)


def road_noise(n, seed=0):
    """5e-4 rms with a correlation of 0.48 after 0.2 s, as measured on a road: at low frequency of the density `r`."""
    keep = 0.48 ** (DT / 0.2)
    rows = np.random.default_rng(seed).normal(0.0, 5e-4, n)
    for k in range(1, n):
        rows[k] = keep * rows[k - 1] + math.sqrt(1 - keep * keep) * rows[k]
    return rows


def changing_road(n, waves, low=10.0, offset=2e-3):
    """Alternating excitation on a road whose slope is 30, `low` from 40 to 70 s, then 30 again."""
    t = np.arange(n) * DT
    mu_i, rho_mu_j = vary(t, 0.0, waves), -vary(t, 0.0, waves, 0.04)
    slope = np.where((t > 40.0) & (t < 70.0), low, 30.0)
    return t, (mu_i - rho_mu_j) / slope + offset, mu_i, rho_mu_j


@pytest.mark.parametrize("waves", [2.0, 4.0, 8.0])
@pytest.mark.parametrize("low", [10.0, 15.0])
@pytest.mark.parametrize("seed", [None, 1, 2])
def test_a_drop_and_a_rise_are_one_alarm_each(waves, low, seed):
    t, y, mu_i, rho_mu_j = changing_road(10_000, waves, low)
    noise = road_noise(t.size, seed) if seed else 0.0
    e, _ = scan(y + noise, mu_i, rho_mu_j)
    at = np.flatnonzero(e.alarm)
    assert e.alarm[at].tolist() == [1.0, -1.0]
    # 3 s at a third of the slope, 7 s at half of it: half of the error is drift
    assert 40.0 < t[at[0]] < (44.0 if low == 10.0 else 47.0)
    assert 70.0 < t[at[1]] < (76.0 if low == 10.0 else 78.0)
    assert e.slope[3990] == pytest.approx(30.0, rel=0.1)
    assert e.slope[6990] == pytest.approx(low, rel=0.1)
    assert e.slope[-1] == pytest.approx(30.0, rel=0.1)


@pytest.mark.parametrize("rate", [20.0, 50.0, 100.0, 500.0])
@pytest.mark.parametrize("amplitude", [0.0, 0.04, 0.08])
def test_noise_of_the_filters_own_density_is_no_change(rate, amplitude):
    """White noise of the density that the tuning allows for: no alarm in ten minutes, at any sample rate.

    The sign that multiplies the error must not know the noise in it: E[sgn(slip + noise) noise] > 0 is a drift upwards.
    """
    t = np.arange(round(600 * rate)) / rate
    mu = vary(t, 0.02, 8.0, amplitude)
    e, _ = scan(mu / 30.0 + white(t.size, 1 / rate, seed=11), mu, 0.0, dt=1 / rate)
    assert np.flatnonzero(e.alarm).size == 0
    assert max(e.g_drop.max(), e.g_rise.max()) < 0.6 * TUNING.h


def test_direction_of_the_error():
    """3.25: by the sign of the slip; (3.23) leaves it."""
    assert cusum_input(2e-3, 1e-3, True) == 2e-3
    assert cusum_input(2e-3, -1e-3, True) == -2e-3
    assert cusum_input(-2e-3, -1e-3, True) == 2e-3
    assert cusum_input(2e-3, 0.0, True) == 0.0
    assert cusum_input(2e-3, -1e-3, False) == 2e-3


def test_after_an_alarm_only_the_slope_is_unknown():
    t, y, mu_i, rho_mu_j = changing_road(10_000, 4.0)
    at = int(np.flatnonzero(scan(y, mu_i, rho_mu_j)[0].alarm)[0])
    _, before = scan(y[:at], mu_i[:at], rho_mu_j[:at])
    e, after = scan(y[at : at + 1], mu_i[at : at + 1], rho_mu_j[at : at + 1], state=before)
    assert e.alarm[0] == 1.0
    # what the sample at the alarm would leave without one
    high = TUNING._replace(h=1e3, rest=TUNING.rest * TUNING.h / 1e3)
    _, calm = scan(y[at : at + 1], mu_i[at : at + 1], rho_mu_j[at : at + 1], state=before, tuning=high)
    b = calm.belief
    assert after.belief == Belief(
        b.k, b.beta, before.before_drop.delta, TUNING.sd_k_reset**2, 0.0, 0.0, b.P_bb, 0.0, before.before_drop.P_dd
    )
    # the offset is that from before the change, not what the change has made of it
    assert t[at] - t[np.flatnonzero(scan(y, mu_i, rho_mu_j)[0].g_drop[:at] == 0.0)[-1]] < 5.0
    assert after.belief.delta == pytest.approx(2e-3, abs=1e-4)
    assert (after.g_drop, after.g_rise) == (0.0, 0.0)
    assert after.window == calm.window
    assert calm.g_drop > TUNING.h
    # a slope that is less known than that stays so
    known = TUNING._replace(sd_k_reset=1e-6)
    e, after = scan(y[at : at + 1], mu_i[at : at + 1], rho_mu_j[at : at + 1], state=before, tuning=known)
    assert e.alarm[0] == 1.0
    assert after.belief.P_kk == calm.belief.P_kk


@pytest.mark.parametrize("dt", [0.02, 0.005])
@pytest.mark.parametrize(("before", "after"), [(30.0, 10.0), (10.0, 30.0)])
def test_the_offset_rests_while_the_road_changes(dt, before, after):
    """From a share of the threshold on, and for `tau_settle` after the alarm; then it is learnt again."""
    t = np.arange(round(120.0 / dt)) * dt
    mu = vary(t, 0.1, 4.0, 0.03)
    y = mu / np.where(t < 40.0, before, after) + 2e-3 + np.where(t > 60.0, 5e-4, 0.0)
    e, _ = scan(y, mu, 0.0, dt=dt, slope=before)
    g = e.g_drop if after < before else e.g_rise
    (at,) = np.flatnonzero(e.alarm)
    moves = np.diff(e.offset, prepend=0.0) != 0.0
    rests = g > TUNING.rest * TUNING.h
    settled = round(TUNING.tau_settle / dt)
    assert 40.0 < t[at] < 43.0
    # the rest begins one sample after the sum has passed the share
    first = np.flatnonzero(rests & (t > 39.0))[0]
    assert moves[1000:first].mean() > 0.99
    assert not moves[first + 1 : at].any()
    assert g[first] == pytest.approx(TUNING.rest * TUNING.h, abs=0.01 * dt)
    # at the alarm the offset goes back to that before the change
    began = np.flatnonzero(g[:at] == 0.0)[-1]
    assert e.offset[at] == e.offset[began]
    assert not moves[at + 1 : at + settled + 1].any()
    assert moves[at + settled + 1 : at + settled + 100].all()
    # the offset has changed meanwhile, and that is learnt in the end
    assert e.offset[at + settled] == pytest.approx(2e-3, abs=2e-4)
    assert e.offset[-1] > 2.2e-3


def test_a_second_alarm_does_not_prolong_the_rest():
    t = T600[:10_000]
    mu = vary(t, 0.1, 4.0, 0.03)
    y = mu / np.where((t < 40.0) | (t > 50.0), 30.0, 10.0) + 2e-3
    e, _ = scan(y, mu, 0.0)
    first, second = np.flatnonzero(e.alarm)
    moves = np.diff(e.offset, prepend=0.0) != 0.0
    settled = first + round(TUNING.tau_settle / DT)
    assert first < second < settled
    assert not moves[second + 1 : settled + 1].any()
    assert moves[settled + 1 : settled + 50].all()


def test_a_rise_is_on_the_other_side():
    _, *data = changing_road(10_000, 4.0)
    e, _ = scan(*data)
    drop, rise = np.flatnonzero(e.alarm)
    assert e.g_drop[drop - 1] > 0.9 * TUNING.h > 10 * e.g_rise[drop - 1]
    assert e.g_rise[rise - 1] > 0.9 * TUNING.h > 10 * e.g_drop[rise - 1]


@pytest.mark.parametrize("adapted", [True, False])
def test_sums_are_of_the_innovations(adapted):
    """3.24 with E11, where differential traction keeps its sign; nothing is summed where there is none."""
    t = T600[:4000]
    mu = np.where(t % 7.0 < 1.0, 0.0, vary(t, -0.08, 5.0, 0.04))
    e, _ = scan(
        mu / np.where(t < 30.0, 30.0, 11.0) + white(t.size, density=1e-10),
        mu,
        0.0,
        tuning=TUNING._replace(h=np.inf, adapted=adapted),
    )
    drop = rise = 0.0
    for i in range(t.size):
        if mu[i] != 0.0:
            nu = -e.innovation[i] if adapted else e.innovation[i]
            drop = max(0.0, drop + (nu - TUNING.zeta) * DT)
            rise = max(0.0, rise + (-nu - TUNING.zeta) * DT)
        else:
            fade = math.exp(-DT / TUNING.tau_fade)
            drop, rise = (g * fade if g > TUNING.zeta * DT else 0.0 for g in (drop, rise))
        assert (e.g_drop[i], e.g_rise[i]) == pytest.approx((drop, rise), abs=1e-15)
    assert (e.g_drop if adapted else e.g_rise).max() > TUNING.h
    assert (e.status[mu == 0.0] == BLIND).all()


def test_threshold_and_drift_are_those_of_the_tuning():
    """An error of x beyond zeta is found after h / (x - zeta), at any rate."""
    for dt in (0.02, 0.002):
        t = np.arange(round(60.0 / dt)) * dt
        mu = np.where(t < 1.0, 0.0, 0.1)
        # a filter that takes nothing in: the error stays what it is
        tuning = TUNING._replace(sd_k=1e-9, sd_delta=1e-9, q_k=0.0, q_delta=0.0)
        e, _ = scan(mu / 30.0 + np.where(t < 1.0, 0.0, 1.5e-3), mu, 0.0, tuning=tuning, dt=dt)
        assert t[np.argmax(e.alarm)] == pytest.approx(1.0 + TUNING.h / 5e-4, abs=2.1 * dt)
        e, _ = scan(mu / 30.0 + np.where(t < 1.0, 0.0, 0.99e-3), mu, 0.0, tuning=tuning, dt=dt)
        assert not e.alarm.any()


CAR = HalfCar()
ON_SNOW = SurfaceChange(40.0, 10.0, 10.0, 0.4)


@pytest.fixture(scope="module")
def physical_run():
    exc = Excitation("sine", 0.05, "mu", 4.0)
    return simulate_half_car(CAR, HalfCarRun(60.0, v0=20.0, nu=0.3, excitation=exc, surface=(ON_SNOW,)))


def sampled(r, every, noise=None):
    """The run at a lower rate; noise of the base rate as its mean over each sample."""
    v_F, v_R = r.omega_f[::every] * CAR.r_e_f, r.omega_r[::every] * CAR.r_e_r
    rho = differential.speed_ratio(v_F, v_R)
    y = differential.differential_slip(v_F, v_R)
    if noise is not None:
        y[1:] += noise[: (y.size - 1) * every].reshape(-1, every).mean(axis=1)
    return y, r.mu_f[::every], rho * r.mu_r[::every]


def test_any_sample_rate_gives_the_same(physical_run):
    """50, 100 and 500 Hz: the same detection without noise, the same slope with noise of one spectral density."""
    times, slopes = [], []
    for seed in (None, 1, 2, 3):
        noise = None if seed is None else white(60_000, 1e-3, seed)
        row = []
        for every in (20, 10, 2):
            dt = 1e-3 * every
            tuning = TUNING if seed is None else TUNING._replace(h=np.inf)
            e, _ = scan(*sampled(physical_run, every, noise), dt=dt, tuning=tuning)
            if seed is None:
                assert e.alarm.sum() == np.abs(e.alarm).sum() == 1.0
                times.append(np.argmax(e.alarm) * dt)
            row.append(e.slope[[round(20 / dt), round(39.9 / dt), round(60 / dt)]])
        slopes.append(row)
    assert np.ptp(times) < 0.05
    assert 40.0 < times[0] < 42.0
    for row in slopes:
        assert (np.ptp(row, axis=0) / np.mean(row, axis=0)).max() < 0.02


def test_doubt_does_not_depend_on_the_rate(physical_run):
    doubt = [
        scan(*sampled(physical_run, every), dt=1e-3 * every)[0].slope_sd[round(39.9e3 / every)] for every in (20, 10, 2)
    ]
    assert np.ptp(doubt) / np.mean(doubt) < 0.01


@pytest.mark.parametrize("drift", [3e-3, -3e-3])
@pytest.mark.parametrize("noisy", [False, True])
def test_radii_that_drift_are_no_change_of_the_road(drift, noisy):
    """3.2: "adaption of slowly varying differences [...] while sudden drops of the slip slope [...] can be detected"."""
    t = T600
    mu_F, mu_R = vary(t, 0.06), vary(t, 0.03, 7.0)
    slope = np.where(t > 590.0, 10.0, 30.0)
    v_F = 25.0 * (1 + drift * t / 600.0) / (1 - mu_F / slope)
    v_R = 25.0 / (1 - mu_R / slope)
    y, rho = differential.differential_slip(v_F, v_R), differential.speed_ratio(v_F, v_R)
    e, _ = scan(y + (road_noise(t.size, 9) if noisy else 0.0), mu_F, rho * mu_R)
    at = np.flatnonzero(e.alarm)
    assert e.alarm[at].tolist() == [1.0]
    assert 590.0 < t[at[0]] < 593.0
    assert e.offset[58_900] == pytest.approx(drift * 589 / 600, abs=4e-4 if noisy else 3e-4)
    assert e.slope[3000:58_900] == pytest.approx(30.0, rel=0.15 if noisy else 0.05)
    assert e.slope[-1] == pytest.approx(10.0, rel=0.15)


@pytest.mark.parametrize("step", [-6e-3, -3e-3, -2e-3, 2e-3, 3e-3, 6e-3])
@pytest.mark.parametrize("amplitude", [0.0, 0.01, 0.03])
def test_a_radius_that_changes_at_once_is_sorted_out(step, amplitude):
    """A puncture: first booked on the road, after the rest on the car wherever the traction varies.

    At constant traction slope and radius cannot be told apart (E10): the estimate says so by its standard deviation.
    """
    t = np.arange(0.0, 400.0, DT)
    mu = vary(t, 0.05, 20.0, amplitude)
    e, _ = scan(mu / 30.0 + np.where(t > 100.0, step, 0.0) + white(t.size, seed=4, density=2e-9), mu, 0.0)
    assert np.flatnonzero(e.alarm).size <= 4
    assert t[np.flatnonzero(e.alarm)[-1]] < 140.0  # the rest of half a minute, and the sorting
    if amplitude:
        assert e.slope[-1] == pytest.approx(30.0, rel=0.05)
        assert e.offset[-1] == pytest.approx(step, abs=1e-4)
    told = (e.slope_sd < 0.2 * e.slope) & (t > 170.0)
    assert (np.abs(e.slope[told] - 30.0) < 4.0 * e.slope_sd[told]).all()


def test_a_real_drop_survives_the_sorting():
    """After half a minute on snow, with some traction to tell by, the slope is still that of snow."""
    t = np.arange(0.0, 200.0, DT)
    mu = vary(t, 0.05, 20.0, 0.015)
    e, _ = scan(mu / np.where(t > 100.0, 10.0, 30.0) + white(t.size, seed=5, density=2e-9), mu, 0.0)
    assert e.alarm[e.alarm != 0.0].tolist() == [1.0]
    assert e.slope[t > 110.0].max() < 13.0
    assert e.slope[-1] == pytest.approx(10.0, rel=0.05)


def test_evidence_fades_where_nothing_is_seen():
    """Half a sum, ten minutes of coasting, half a sum: no alarm."""
    mu = np.full(300, 0.08)
    _, state = scan(mu / 30.0, mu, 0.0)
    error = mu / 30.0 + TUNING.zeta + 0.6 * TUNING.h
    for pause, alarms in ((0, 1), (60_000, 0)):
        rest = np.zeros(pause, dtype=bool)
        active = np.concatenate([np.ones(100, dtype=bool), rest, np.ones(100, dtype=bool)])
        frozen = TUNING._replace(q_k=0.0, q_delta=0.0, sd_k=1e-6, sd_delta=1e-6)
        y, u = np.full(active.size, error[0]), np.full(active.size, 0.08)
        e, _ = scan(y, u, 0.0, active=active, tuning=frozen)
        assert np.flatnonzero(e.alarm).size == alarms
    assert state.g_drop == 0.0
