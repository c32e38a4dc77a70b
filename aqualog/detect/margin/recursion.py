"""A filter over the speed of full aquaplaning, and whether there is water.

Ten times a second it compares the last 0.6 s with what the same car showed on dry road. Each speed of full aquaplaning,
and each kind of dry drive, says how likely that is; what is dry is learnt from while the road is dry.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from aqualog.core.compiled import compiled, inlined, part
from aqualog.core.records import FloatArray
from aqualog.detect.margin.state import (
    COVARIATES,
    FEATURES,
    FULL_SPEEDS,
    LOG_STEP,
    NODES,
    ROWS,
    Emissions,
    Filter,
    FilterParams,
    Inputs,
)  # fmt: skip
from aqualog.physics.tyre_brush import brush_slip

__all__ = ["scan"]

_brush_slip = inlined(brush_slip)

_NV, _NX, _NN = FULL_SPEEDS.size, len(FEATURES), NODES.size
_LOG = np.log(FULL_SPEEDS)
_QUANTILES = np.array([0.05, 0.25, 0.5, 0.75, 0.95])
_UNKNOWN = 1e4  # variance of a feature that is missing
_V, _A, _R, _D, _U_F, _U_R, _VAR = 0, 1, 2, 3, 5, 7, 9  # columns of a step
_LEAST = 1e-10  # of a slip's variance


@part
def _slip(u, slope, rolling, friction):  # type: ignore[no-untyped-def]
    """Slip of a dry wheel by the traction of its torque. [-]"""
    return _brush_slip(u - rolling, friction, slope)


@part
def _learn_line(s, x, left, lasting, trust):  # type: ignore[no-untyped-def]
    """Learn offset and slope of a line, `s[0]` and `s[1]`, by Kalman's filter; their covariance follows them.

    `left` is what was seen at x less the line, `lasting` its variance beside the line's, `trust` 0 to 1.
    """
    P_m, P_q = s[2] + x * s[3], s[3] + x * s[4]
    S = P_m + x * P_q + lasting
    gain_m, gain_q = trust * P_m / S, trust * P_q / S
    s[0] += gain_m * left
    s[1] += gain_q * left
    s[2] -= gain_m * P_m
    s[4] -= gain_q * P_q
    s[3] -= gain_m * P_q


@part
def _learn(p, m, row, trust):  # type: ignore[no-untyped-def]
    """Learn what the car shows on dry road from the step that has just left the window."""
    g = m.R
    g[2] = min(g[2] + p.walk_R**2 * p.dt, p.offset_R**2)
    g[4] = min(g[4] + p.walk_a**2 * p.dt, p.share_a**2)
    if not math.isnan(row[_R] + row[_A]):
        _learn_line(g, row[_A], row[_R] - g[0] - g[1] * row[_A], p.noise_R**2, trust)
    for i in range(2):
        g = m.sides[i]
        g[2] = min(g[2] + p.walk_D**2 * p.dt, p.offset_D**2)
        g[4] = min(g[4] + p.walk_share**2 * p.dt, p.share_D**2)
        if math.isnan(row[_D + i] + row[_U_F + i] + row[_U_R + i]):
            continue
        front = _slip(row[_U_F + i], p.slope_f, p.rolling, p.friction)
        rear = _slip(row[_U_R + i], p.slope_r, p.rolling, p.friction)
        away = row[_D + i] - (front - rear) - g[0] - g[1] * (front + rear)
        _learn_line(g, front + rear, away, p.noise_D**2 + row[_VAR + i], trust)


@part
def _gather(p, m):  # type: ignore[no-untyped-def]
    """Fill the features of the window, and the variances of what they are compared with; return mean traction."""
    x, P = m.x[0], m.x[1]
    n, r, f, traction, steps = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(ROWS):
        row = m.window[k]
        u = row[_U_F] + row[_U_F + 1] + row[_U_R] + row[_U_R + 1]
        if not math.isnan(u):
            traction += 0.5 * u
            steps += 1.0
        if not math.isnan(row[_R] + row[_A]):
            r += row[_R] - m.R[0] - m.R[1] * row[_A]
            f += row[_A]
            n += 1.0
    x[0], P[0] = 0.0, _UNKNOWN
    if n >= 3.0:
        r, f = r / n, f / n
        x[0] = math.asinh(r / p.scale_R)
        P[0] = (m.R[2] + 2.0 * f * m.R[3] + f * f * m.R[4]) / (p.scale_R**2 + r * r)
    more = 0
    for i in range(2):
        g = m.sides[i]
        n, e, e2, h, within = 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(ROWS):
            row = m.window[k]
            if math.isnan(row[_D + i] + row[_U_F + i] + row[_U_R + i]):
                continue
            front = _slip(row[_U_F + i], p.slope_f, p.rolling, p.friction)
            rear = _slip(row[_U_R + i], p.slope_r, p.rolling, p.friction)
            away = row[_D + i] - (front - rear) - g[0] - g[1] * (front + rear)
            n, e, e2, h, within = n + 1.0, e + away, e2 + away * away, h + front + rear, within + row[_VAR + i]
        x[1 + i], P[1 + i], x[3 + i], P[3 + i] = 0.0, _UNKNOWN, 0.0, _UNKNOWN
        if n >= 3.0:
            e, h = e / n, h / n
            x[1 + i] = math.asinh(e / p.scale_D)
            # what shakes on dry road leaves the mean of few samples unsure; a slip within twice of that is none
            noise = math.exp(g[5]) / (n * p.block)
            P[1 + i] = (g[2] + 2.0 * h * g[3] + h * h * g[4] + noise) / (p.scale_D**2 + max(e * e - 4.0 * noise, 0.0))
            x[3 + i] = math.log(max(e2 / n - e * e, 0.0) + within / n + _LEAST) - g[5]
            P[3 + i] = g[6]
    if P[1] >= _UNKNOWN or (P[2] < _UNKNOWN and abs(x[2]) > abs(x[1])):
        more = 1
    return traction / max(steps, 1.0), more


@part
def _score(mean, scatter, z, x, P, tail, A, y):  # type: ignore[no-untyped-def]
    """Log likelihood of the features x by Student's law, of a mean by covariates z and a covariance; A, y scratch.

    The covariance is A D A', with ones and 1 / D on the diagonal of A: no roots, and one logarithm.
    """
    determinant, square = 1.0, 0.0
    for i in range(_NX):
        left = x[i]
        for c in range(COVARIATES):
            left -= mean[i, c] * z[c]
        S = scatter[i, i] + P[i]
        for j in range(i):
            AD = scatter[i, j]
            for k in range(j):
                AD -= A[k, i] * A[j, k]
            A[j, i] = AD
            A[i, j] = AD * A[j, j]
            S -= AD * A[i, j]
            left -= A[i, j] * y[j]
        S = max(S, 1e-9)
        A[i, i] = 1.0 / S
        y[i] = left
        determinant *= S
        square += left * left * A[i, i]
    return -0.5 * math.log(determinant) - 0.5 * (tail + _NX) * math.log1p(square / tail)


@part
def _copy(x, to):  # type: ignore[no-untyped-def]
    # an assignment of arrays compiles a message about their shapes, for 4 s
    for k in range(x.size):
        to[k] = x[k]


@part
def _place(log_v, i):  # type: ignore[no-untyped-def]
    """Node below a cell of the full speed, and how far it is on the way to the next."""
    place = min(max((_LOG[i] - log_v - NODES[0]) / LOG_STEP, 0.0), _NN - 1.001)
    n = int(place)
    return n, place - n


@part
def _is(t, m, road):  # type: ignore[no-untyped-def]
    """Probability of a road: 0 dry, 1 wet, 2 of another surface."""
    total = 0.0
    for k in range(m.kinds.size):
        if t.road[k] == road:
            total += m.kinds[k]
    return total


@part
def _weights(p, t, m, v, w):  # type: ignore[no-untyped-def]
    """Fill the probabilities of laws and full speeds (laws, full speeds), given that there is water."""
    best = -1e300
    for law in range(t.law.size):
        for i in range(_NV):
            beyond = max(v - FULL_SPEEDS[i], 0.0) / p.brave
            w[law, i] = m.evidence[law, i] - 0.5 * beyond * beyond
            best = max(best, w[law, i])
    total = 0.0
    for law in range(t.law.size):
        for i in range(_NV):
            w[law, i] = t.law[law] * t.prior[i] * math.exp(w[law, i] - best)
            total += w[law, i]
    for law in range(t.law.size):
        for i in range(_NV):
            w[law, i] /= total


@partial(part, allocates=True)
def _judge(p, t, m, v, traction):  # type: ignore[no-untyped-def]
    """Let the window speak: probabilities of the kinds of road, evidence on the full speeds."""
    z = np.array([1.0, math.log(v / 30.0), math.asinh(traction / 0.02)])
    known = np.array([1.0, z[1], min(z[2], p.most_u)])
    A, y = np.empty((_NX, _NX)), np.empty(_NX)
    score = np.empty(m.kinds.size)
    best = -1e300
    for k in range(score.size):
        score[k] = p.weight * _score(t.kind_mean[k], t.kind_scatter[k], known, m.x[0], m.x[1], p.tail, A, y)
        best = max(best, score[k])
    total = 0.0
    for k in range(score.size):
        m.kinds[k] *= math.exp(score[k] - best)
        total += m.kinds[k]
    for k in range(score.size):
        m.kinds[k] /= total
    # how much drag and shake belong to a distance differs from law to law more than what is learnt
    P = m.x[1] + np.array([p.law_R**2, 0.0, 0.0, p.law_M**2, p.law_M**2])
    nodes = np.zeros(_NN)
    keep, log_v, heard = math.exp(-p.dt / p.keep_s), math.log(v), _is(t, m, 1) > p.heard
    for law in range(t.law.size):
        if heard:
            for n in range(_NN):
                nodes[n] = p.weight * _score(t.mean[law, n], t.scatter[law, n], z, m.x[0], P, p.tail, A, y)
        for i in range(_NV):
            n, a = _place(log_v, i)
            m.evidence[law, i] = keep * m.evidence[law, i] + (1.0 - a) * nodes[n] + a * nodes[n + 1]


@part
def _predict(p, t, m):  # type: ignore[no-untyped-def]
    """Let the kinds change into each other over one step."""
    now = (_is(t, m, 0), _is(t, m, 1), _is(t, m, 2))
    change = p.among * p.dt
    out = (p.dt * (p.to_water + p.to_other), p.dt * (p.to_dry + p.mistaken), p.dt * (p.to_dry + p.mistaken))
    into = (
        p.dt * p.to_dry * (now[1] + now[2]),
        p.dt * (p.to_water * now[0] + p.mistaken * now[2]),
        p.dt * (p.to_other * now[0] + p.mistaken * now[1]),
    )
    for k in range(m.kinds.size):
        road = int(t.road[k])
        m.kinds[k] *= 1.0 - change - out[road]
        m.kinds[k] += t.kind_prior[k] * (change * now[road] + into[road])


@part
def _fill(p, t, m, v, w, wet):  # type: ignore[no-untyped-def]
    """Fill what is put out; distances are from the car's own speed, contact from where the tables begin."""
    log_at, v = math.log(max(v, p.v_least)), abs(v)
    m.out[0] = wet
    near, total, q, L = 0.0, 0.0, 0, 0.0
    edge = _LOG[0] - 0.5 * LOG_STEP
    limit = math.log(v + p.near)
    for i in range(_NV):
        n, a = _place(log_at, i)
        here = 0.0
        for law in range(t.law.size):
            here += w[law, i]
            L += w[law, i] * ((1.0 - a) * t.contact[law, n] + a * t.contact[law, n + 1])
        near += here * min(max((limit - edge) / LOG_STEP, 0.0), 1.0)
        while q < 5 and total + here >= _QUANTILES[q] and here > 0.0:
            m.out[2 + q] = math.exp(edge + LOG_STEP * (_QUANTILES[q] - total) / here) - v
            q += 1
        total += here
        edge += LOG_STEP
    # without a slip the distance is what was assumed before: no reason to warn
    m.out[1] = near * wet if m.x[1, 1] < _UNKNOWN else 0.0
    m.out[7] = L
    m.out[8] = m.out[4] + v


@compiled
def _step(p, t, m, row):  # type: ignore[no-untyped-def]
    """Take the means of one step; fill `m.out`."""
    at = int(m.samples[1]) % ROWS
    m.samples[1] += 1.0
    v = row[_V]
    dry = _is(t, m, 0)
    old = m.window[at]
    if not math.isnan(old[_V]):
        # slower, a road counts as dry whatever lies on it
        _learn(p, m, old, dry if old[_V] > p.v_least else 1.0)
    _copy(row, m.window[at])
    _predict(p, t, m)
    traction, more = _gather(p, m)
    w = np.empty((t.law.size, _NV))
    speed = max(v, p.v_least)
    x, P = m.x[0], m.x[1]
    own, known = (x[3], x[4]), (P[3] < _UNKNOWN, P[4] < _UNKNOWN)
    if more == 1:
        for a in (1, 3):
            x[a], x[a + 1] = x[a + 1], x[a]
            P[a], P[a + 1] = P[a + 1], P[a]
    if v > p.v_least:
        _judge(p, t, m, speed, traction)
    _weights(p, t, m, speed, w)
    wet, dry = _is(t, m, 1), _is(t, m, 0)
    for i in range(2):
        g = m.sides[i]
        g[6] = min(g[6] + p.walk_M**2 * p.dt, p.offset_M**2)
        if known[i]:
            gain = dry * g[6] / (g[6] + p.noise_M**2)
            g[5] += gain * own[i]
            g[6] *= 1.0 - gain
    _fill(p, t, m, v, w, wet)


@compiled
def _scan(p, t, m, x):  # type: ignore[no-untyped-def]
    n = x[0].size
    out = np.empty((m.out.size, n))
    row = np.empty(m.window.shape[1])
    for i in range(n):
        for c in range(9):
            value = x[c, i]
            if not math.isnan(value):
                m.sums[0, c] += value
                m.sums[1, c] += 1.0
                m.sums[2, c] += value * value
        m.samples[0] += 1.0
        if m.samples[0] >= p.block:
            for c in range(9):
                enough = m.sums[1, c] > 0.0 and m.sums[1, c] >= 0.5 * p.block
                row[c] = m.sums[0, c] / m.sums[1, c] if enough else math.nan
            for side in range(2):
                mean = row[_D + side]
                row[_VAR + side] = max(m.sums[2, _D + side] / max(m.sums[1, _D + side], 1.0) - mean * mean, 0.0)
            m.sums[:] = 0.0
            m.samples[0] = 0.0
            if not math.isnan(row[_V]):
                _step(p, t, m, row)
            else:
                m.out[:] = math.nan
        _copy(m.out, out[:, i])
    return out


def scan(p: FilterParams, emissions: Emissions, state: Filter, inputs: Inputs) -> tuple[FloatArray, Filter]:
    """Run the filter over a drive or a piece of one; rows (len(OUTPUTS), n), and the state after it.

    The rows hold from one step, a tenth of a second, to the next.
    """
    after = state.copy()
    return _scan(p, emissions, after, np.array(inputs, dtype=np.float64)), after
