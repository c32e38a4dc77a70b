"""Speed of the slip-slope estimator beside the same filter in NumPy, plain Python and filterpy.

`python -m tests.bench.ekf` from the checkout. First all must give the same slopes, then they are timed in turns, by
process time. filterpy is no dependency: without the extra `bench` it is left out, and said so.
"""

from __future__ import annotations

import importlib.util
import statistics
import time
from functools import partial

import numpy as np

from aqualog.core.compiled import compiled
from aqualog.detect.slip_slope import ekf, estimator
from aqualog.detect.slip_slope.tuning import TUNING, Params

DT = 0.01
ROUNDS = 9
SLOPE = 30.0
# nothing gated, nothing frozen and no alarm: then the estimator is the filter and nothing else
OPEN = TUNING._replace(h=np.inf, mu_min=0.0, mu_max=np.inf, s_max=np.inf, told_k=np.inf, told_beta=np.inf)


def drive(n, seed=0, dt=DT):
    """A drive with traction of both axles that varies: differential slip, mu_i, rho mu_j."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * dt
    mu_i = 0.08 + 0.05 * np.sin(2 * np.pi * t / 5.0)
    rho_mu_j = 0.02 + 0.05 * np.sin(2 * np.pi * t / 3.1)
    y = (mu_i - 1.1 * rho_mu_j) / 27.0 + 2e-3
    return y + rng.normal(0.0, 5e-4, n), mu_i, rho_mu_j


def textbook_update(x, P, y, mu_i, rho_mu_j, r):
    """One update of the extended Kalman filter in matrices: H, S, K, x + K e, (1 - K H) P."""
    k, beta, delta = x
    H = np.array([mu_i - beta * rho_mu_j, -rho_mu_j * k, 1.0])
    innovation = y - ((mu_i - beta * rho_mu_j) * k + delta)
    S = H @ P @ H + r
    K = P @ H / S
    return x + K * innovation, (np.eye(3) - np.outer(K, H)) @ P, innovation, S


def prior(slope=SLOPE):
    """State and covariance before the first sample."""
    b = estimator.initial_state(TUNING, slope=slope).belief
    return np.array(b[:3]), np.diag([b.P_kk, b.P_bb, b.P_dd])


def aqualog_slopes(data, tuning=OPEN, dt=DT):
    """The estimator of the package."""
    state = estimator.initial_state(tuning, slope=SLOPE)
    is_active = np.ones(data[0].size, dtype=bool)
    return estimator.scan(Params.make(tuning, dt), state, *data, is_active)[0].slope


@compiled
def _filtered(b, q_k, q_beta, q_delta, r, y, mu_i, rho_mu_j):
    out = np.empty_like(y)
    for i in range(y.size):
        b = ekf.predict(b, q_k, q_beta, q_delta)
        b, _, _ = ekf.update(b, y[i], mu_i[i], rho_mu_j[i], r, True, True, True)
        out[i] = 1.0 / b.k
    return out


def filter_slopes(data, tuning=OPEN, dt=DT):
    """The filter of the package without what the estimator adds: what can be told, two sums, gates, eleven outputs."""
    p = Params.make(tuning, dt)
    belief = estimator.initial_state(tuning, slope=SLOPE).belief
    return _filtered(belief, p.q_k, p.q_beta, p.q_delta, p.r, *data)


def numpy_slopes(data, tuning=OPEN, dt=DT):
    """The textbook's matrices in NumPy, a loop over the samples."""
    p = Params.make(tuning, dt)
    x, P = prior()
    Q = np.diag([p.q_k, p.q_beta, p.q_delta])
    slopes = np.empty(data[0].size)
    for i, (y, mu_i, rho_mu_j) in enumerate(zip(*data, strict=True)):
        x, P, _, _ = textbook_update(x, P + Q, y, mu_i, rho_mu_j, p.r)
        slopes[i] = 1.0 / x[0]
    return slopes


def python_slopes(data, tuning=OPEN, dt=DT):
    """Plain Python on scalars."""
    p = Params.make(tuning, dt)
    x, P = prior()
    k, beta, delta = (float(v) for v in x)
    kk, bb, dd = (float(v) for v in np.diag(P))
    kb = kd = bd = 0.0
    slopes = []
    for y, a, b in zip(*(d.tolist() for d in data), strict=True):
        kk, bb, dd = kk + p.q_k, bb + p.q_beta, dd + p.q_delta
        h_k, h_b = a - beta * b, -b * k
        c_k, c_b, c_d = kk * h_k + kb * h_b + kd, kb * h_k + bb * h_b + bd, kd * h_k + bd * h_b + dd
        s = h_k * c_k + h_b * c_b + c_d + p.r
        e = (y - (h_k * k + delta)) / s
        k, beta, delta = k + c_k * e, beta + c_b * e, delta + c_d * e
        kk, kb, kd = kk - c_k * c_k / s, kb - c_k * c_b / s, kd - c_k * c_d / s
        bb, bd, dd = bb - c_b * c_b / s, bd - c_b * c_d / s, dd - c_d * c_d / s
        slopes.append(1.0 / k)
    return np.array(slopes)


def filterpy_slopes(data, tuning=OPEN, dt=DT):
    """`filterpy.kalman.ExtendedKalmanFilter`."""
    from filterpy.kalman import ExtendedKalmanFilter

    p = Params.make(tuning, dt)
    f = ExtendedKalmanFilter(dim_x=3, dim_z=1)
    x, f.P = prior()
    f.x = x[:, None]
    f.Q, f.R = np.diag([p.q_k, p.q_beta, p.q_delta]), np.array([[p.r]])

    def jacobian(x, a, b):
        return np.array([[a - x[1, 0] * b, -b * x[0, 0], 1.0]])

    def predicted(x, a, b):
        return np.array([[(a - x[1, 0] * b) * x[0, 0] + x[2, 0]]])

    slopes = np.empty(data[0].size)
    for i, (y, a, b) in enumerate(zip(*data, strict=True)):
        f.predict()
        f.update(np.array([[y]]), jacobian, predicted, args=(a, b), hx_args=(a, b))
        slopes[i] = 1.0 / f.x[0, 0]
    return slopes


def disagreement(slopes, reference):
    """Largest relative difference of two runs."""
    return float(np.abs(slopes / reference - 1.0).max())


def seconds(call):
    """Process time of a call."""
    begin = time.process_time()
    call()
    return time.process_time() - begin


def main():
    """Check, measure, print."""
    assert disagreement(filter_slopes(drive(10_000)), aqualog_slopes(drive(10_000))) < 1e-12
    others = {"NumPy matrices": (numpy_slopes, 20_000), "plain Python": (python_slopes, 50_000)}
    if importlib.util.find_spec("filterpy"):
        others["filterpy"] = (filterpy_slopes, 10_000)
    else:
        print("filterpy is not installed and is left out: pip install '.[bench]'")
    print("largest relative difference of the slopes to aqualog's, 10000 samples:")
    small = drive(10_000)
    own = aqualog_slopes(small)
    for name, (slopes, _) in others.items():
        off = disagreement(slopes(small), own)
        print(f"  {name:16s} {off:.1e}")
        assert off < 1e-9, name
    print(f"after 100 s: slope {own[-1]:.2f}, true 27")

    big = drive(3_000_000)
    calls = {
        "aqualog": (partial(aqualog_slopes, big), big[0].size),
        "aqualog, filter": (partial(filter_slopes, big), big[0].size),
        "aqualog, gated": (partial(aqualog_slopes, big, TUNING), big[0].size),
    } | {name: (partial(slopes, drive(n)), n) for name, (slopes, n) in others.items()}
    rates = {name: [] for name in calls}
    for _ in range(ROUNDS):
        for name, (call, n) in calls.items():
            rates[name].append(n / seconds(call) / 1e6)
    print(f"million samples per second of process time, min / median / max of {ROUNDS} rounds in turns:")
    for name, r in rates.items():
        print(f"  {name:16s} {min(r):9.4f} {statistics.median(r):9.4f} {max(r):9.4f}")
    print("aqualog over the other, round by round:")
    for name in others:
        r = [a / b for a, b in zip(rates["aqualog"], rates[name], strict=True)]
        print(f"  {name:16s} {min(r):9.1f} {statistics.median(r):9.1f} {max(r):9.1f}")


if __name__ == "__main__":
    main()
