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
    TAIL,
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
_SURE = 1.645  # standard deviations of a quantile of 95 %
_CLEAR = 2.6  # the same of a drag, which is asked for as long as water is held for likely
_STILL = 0.25  # variance of what wheels shake that shake as on dry road, of 0.6 s in log variance
_NEVER, _FAINT = -40.0, 1e-12  # of an evidence: below the best, and itself
_UNKNOWN = 1e4  # variance of a feature that is missing
_V, _A, _R, _D, _U_F, _U_R, _B, _VAR, _VAR_B, _S_F, _S_R = 0, 1, 2, 3, 6, 8, 10, 12, 15, 16, 18  # columns of a step
_ROUGH = 11
_SLIP, _SHAKE = (1, 2, 5), (3, 4, 6)  # places among the features of two sides and the rear axle
_NI = len(Inputs._fields)
_LEAST, _LEAST_B = 1e-10, 1e-5  # of a slip's variance, and of the accelerometer's [(m/s^2)^2]
_LEAST_S = 1e-9  # of a feature's variance that the others leave


@part
def _slip(u, slope, rolling, friction):  # type: ignore[no-untyped-def]
    """Slip of a dry wheel by the traction of its torque. [-]"""
    return _brush_slip(u - rolling, friction, slope)


@part
def _learn_line(s, x, left, lasting, trust):  # type: ignore[no-untyped-def]
    """Learn offset and slope of a line, `s[0]` and `s[1]`, by Kalman's filter; their covariance follows them.

    `left` is what was seen at x less the line, `lasting` its variance beside the line's, `trust` 0 to 1. By Student's
    law with `TAIL` degrees of freedom the further it lies from the line the less it counts: a wheel that floats slips
    hundredfold, and what little of it was trusted would bend the line for minutes.
    """
    P_m, P_q = s[2] + x * s[3], s[3] + x * s[4]
    S = P_m + x * P_q + lasting
    trust *= (TAIL + 1.0) / (TAIL + max(left * left / S, 1.0))
    gain_m, gain_q = trust * P_m / S, trust * P_q / S
    s[0] += gain_m * left
    s[1] += gain_q * left
    s[2] -= gain_m * P_m
    s[4] -= gain_q * P_q
    s[3] -= gain_m * P_q


@part
def _drag(g, a, v2):  # type: ignore[no-untyped-def]
    """Resistance of the dry road, and what its coefficients' covariance makes of that: its variance, and the gains."""
    known = g[0, 0] + g[0, 1] * a + g[0, 2] * v2
    one = g[1, 0] + g[1, 1] * a + g[1, 2] * v2
    two = g[2, 0] + g[2, 1] * a + g[2, 2] * v2
    three = g[3, 0] + g[3, 1] * a + g[3, 2] * v2
    return known, one + two * a + three * v2, (one, two, three)


@part
def _pair(row, i):  # type: ignore[no-untyped-def]
    """Slips of dry wheels that are compared: front and rear of a side, or left and right of the rear axle."""
    return (row[_S_F + i], row[_S_R + i]) if i < 2 else (row[_S_R], row[_S_R + 1])


@part
def _learn(p, m, row, trust):  # type: ignore[no-untyped-def]
    """Learn what the car shows on dry road from the step that has just left the window."""
    g = m.R
    g[1, 0] = min(g[1, 0] + p.walk_R**2 * p.dt, p.offset_R**2)
    g[2, 1] = min(g[2, 1] + p.walk_a**2 * p.dt, p.share_a**2)
    if not math.isnan(row[_R] + row[_A]):
        known, S, gain = _drag(g, row[_A], (row[_V] / p.pace) ** 2)
        left, S = row[_R] - known, S + p.noise_R**2 + m.samples[2]
        share = trust * (TAIL + 1.0) / ((TAIL + max(left * left / S, 1.0)) * S)
        for i in range(3):
            g[0, i] += share * gain[i] * left
            for j in range(3):
                g[1 + i, j] -= share * gain[i] * gain[j]
    for i in range(3):
        g = m.sides[i]
        g[2] = min(g[2] + p.walk_D**2 * p.dt, p.offset_D**2)
        g[4] = min(g[4] + p.walk_share**2 * p.dt, p.share_D**2)
        front, rear = _pair(row, i)
        if math.isnan(row[_D + i] + front + rear):
            continue
        away = row[_D + i] - (front - rear) - g[0] - g[1] * (front + rear)
        late, grade = p.doubt * (front + rear) if math.isnan(row[_R]) else 0.0, p.grade if i < 2 else 0.0
        _learn_line(g, front + rear, away, p.noise_D**2 + row[_VAR + i] + late * late + grade * grade, trust)


@part
def _shake_of_body(m):  # type: ignore[no-untyped-def]
    """Log variance of the specific force within the steps of the window, NaN where samples are too rare for one."""
    n, within = 0.0, 0.0
    for k in range(ROWS):
        if m.window[k, _VAR_B] > 0.0:
            n, within = n + 1.0, within + m.window[k, _VAR_B]
    return math.log(within / n + _LEAST_B) if n >= 3.0 else math.nan


@part
def _learn_shake(p, g, own, dry):  # type: ignore[no-untyped-def]
    """Learn a log variance of the dry road, `g[0]`; its variance follows it."""
    g[1] = min(g[1] + p.walk_M**2 * p.dt, p.offset_M**2)
    if not math.isnan(own):
        gain = dry * g[1] / (g[1] + p.noise_M**2)
        g[0] += gain * (own - g[0])
        g[1] *= 1.0 - gain


@part
def _gather(p, m):  # type: ignore[no-untyped-def]
    """Fill the features of the window, and the variances of what they are compared with; return mean traction."""
    x, P = m.x[0], m.x[1]
    n, r, r2, f, v2, traction, steps = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(ROWS):
        row = m.window[k]
        u = row[_U_F] + row[_U_F + 1] + row[_U_R] + row[_U_R + 1]
        if not math.isnan(u):
            traction += 0.5 * u
            steps += 1.0
        if not math.isnan(row[_R] + row[_A]):
            square = (row[_V] / p.pace) ** 2
            away = row[_R] - _drag(m.R, row[_A], square)[0]
            n, r, r2, f, v2 = n + 1.0, r + away, r2 + away * away, f + row[_A], v2 + square
    x[0], P[0] = 0.0, _UNKNOWN
    if n >= 3.0:
        r = r / n
        x[0] = math.asinh(r / p.scale_R)
        # what shakes the accelerometer leaves the mean of few steps unsure
        m.samples[2] = max(r2 - n * r * r, 0.0) / (n - 1.0)
        P[0] = (_drag(m.R, f / n, v2 / n)[1] + m.samples[2] / n) / (p.scale_R**2 + r * r)
    # how much more than on dry road the body shakes: a rough road shakes it and the wheels, water hardly the body
    shock = _shake_of_body(m)
    rough = 0.0 if math.isnan(shock) else max(shock - m.body[0], 0.0)
    m.body[2] = rough
    for i in range(3):
        g, slip, shake = m.sides[i], _SLIP[i], _SHAKE[i]
        n, e, e2, h, late, within = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(ROWS):
            row = m.window[k]
            front, rear = _pair(row, i)
            if math.isnan(row[_D + i] + front + rear):
                continue
            away = row[_D + i] - (front - rear) - g[0] - g[1] * (front + rear)
            n, e, e2, h, within = n + 1.0, e + away, e2 + away * away, h + front + rear, within + row[_VAR + i]
            late += front + rear if math.isnan(row[_R]) else 0.0
        x[slip], P[slip], x[shake], P[shake] = 0.0, _UNKNOWN, 0.0, _UNKNOWN
        if n >= 3.0:
            e, h, late, grade = e / n, h / n, p.doubt * late / n, p.grade if i < 2 else 0.0
            x[slip] = math.asinh(e / p.scale_D)
            x[shake] = math.log(max(e2 / n - e * e, 0.0) + within / n + _LEAST) - g[5]
            P[shake] = g[6] + rough * rough
            # what shakes on dry road leaves the mean of few samples unsure; a slip within twice of that is none
            noise = math.exp(g[5] + max(min(rough, x[shake]), 0.0)) / (n * p.block)
            noise += grade * grade
            P[slip] = (g[2] + 2.0 * h * g[3] + h * h * g[4] + late * late + noise) / (
                p.scale_D**2 + max(e * e - 4.0 * noise, 0.0)
            )
    more = 1 if P[1] >= _UNKNOWN or (P[2] < _UNKNOWN and abs(x[2]) > abs(x[1])) else 0
    return traction / max(steps, 1.0), more


@part
def _left(mean, z, x, i, k):  # type: ignore[no-untyped-def]
    """What a feature shows beyond its mean by the covariates."""
    return x[i] - mean[i, 0, k] * z[0] - mean[i, 1, k] * z[1] - mean[i, 2, k] * z[2]


@part
def _odds(determinant, square):  # type: ignore[no-untyped-def]
    """Student's density, less what all have in common: roots and products, of which the compiler makes vectors."""
    q = 1.0 + square / TAIL
    q2 = q * q
    q4 = q2 * q2
    return 1.0 / math.sqrt(determinant * q4 * q4 * q2 * q)


@part
def _count(S, y, determinant, square):  # type: ignore[no-untyped-def]
    """Count a feature by the variance that those before leave; return one over that, determinant and square."""
    S = max(S, _LEAST_S)
    return 1.0 / S, determinant * S, square + y * y / S


@partial(part, is_inline=False)  # from two places: its code once
def _scores(M, C, z, x, P, calm, score):  # type: ignore[no-untyped-def]
    """Fill log likelihoods (k,) of the features x by Student's law, of means by covariates z and covariances.

    M (features, covariates, k), C (features, features, k): the compiler makes vectors over k. A covariance is A D A'
    with ones on the diagonal of A. Written out by columns, it stays in registers.
    `calm` (k,): probability that wheels shake as on dry road, whatever drag and slips show.
    """
    still, shakes = (P[3] + _STILL) * (P[4] + _STILL), x[3] * x[3] / (P[3] + _STILL) + x[4] * x[4] / (P[4] + _STILL)
    for k in range(score.size):
        y0 = _left(M, z, x, 0, k)
        d, determinant, square = _count(C[0, 0, k] + P[0], y0, 1.0, 0.0)
        c1, c2, c3, c4 = C[1, 0, k], C[2, 0, k], C[3, 0, k], C[4, 0, k]
        a1, a2, a3, a4 = c1 * d, c2 * d, c3 * d, c4 * d
        y1, y2 = _left(M, z, x, 1, k) - a1 * y0, _left(M, z, x, 2, k) - a2 * y0
        y3, y4 = _left(M, z, x, 3, k) - a3 * y0, _left(M, z, x, 4, k) - a4 * y0
        C2, C3, C4 = C[2, 2, k] + P[2] - a2 * c2, C[3, 3, k] + P[3] - a3 * c3, C[4, 4, k] + P[4] - a4 * c4
        C32, C42, C43 = C[3, 2, k] - a3 * c2, C[4, 2, k] - a4 * c2, C[4, 3, k] - a4 * c3
        d, determinant, square = _count(C[1, 1, k] + P[1] - a1 * c1, y1, determinant, square)
        c2, c3, c4 = C[2, 1, k] - a2 * c1, C[3, 1, k] - a3 * c1, C[4, 1, k] - a4 * c1
        a2, a3, a4 = c2 * d, c3 * d, c4 * d
        y2, y3, y4 = y2 - a2 * y1, y3 - a3 * y1, y4 - a4 * y1
        C3, C4, C32, C42, C43 = C3 - a3 * c3, C4 - a4 * c4, C32 - a3 * c2, C42 - a4 * c2, C43 - a4 * c3
        d, determinant, square = _count(C2 - a2 * c2, y2, determinant, square)
        even = _odds(determinant * still, square + shakes)  # drag and slips are through
        a3, a4 = C32 * d, C42 * d
        y3, y4 = y3 - a3 * y2, y4 - a4 * y2
        d, determinant, square = _count(C3 - a3 * C32, y3, determinant, square)
        c4 = C43 - a4 * C32
        a5 = c4 * d
        d, determinant, square = _count(C4 - a4 * C42 - a5 * c4, y4 - a5 * y3, determinant, square)
        score[k] = (1.0 - calm[k]) * _odds(determinant, square) + calm[k] * even
    for k in range(score.size):
        score[k] = math.log(max(score[k], 1e-300))


@part
def _places(log_v, at, above):  # type: ignore[no-untyped-def]
    """Fill the node below each cell of the full speed, and how far the cell is on the way to the next node."""
    for i in range(_NV):
        place = min(max((_LOG[i] - log_v - NODES[0]) / LOG_STEP, 0.0), _NN - 1.001)
        at[i] = int(place)
        above[i] = place - at[i]


@part
def _is(t, m, road):  # type: ignore[no-untyped-def]
    """Probability of a road: 0 dry, 1 wet, 2 of another surface, 3 with one under one side alone."""
    total = 0.0
    for k in range(m.kinds.size):
        if t.road[k] == road:
            total += m.kinds[k]
    return total


@part
def _compare_rear(p, t, m, z, score):  # type: ignore[no-untyped-def]
    """Let the rear axle say what lies under one side: its wheel runs in water that the front wheel has cleared, and
    slips and shakes less than that. Snow does the same to both."""
    x, P = m.x[0], m.x[1]
    first, before, after, best = score.size - t.rear.shape[0], 0.0, 0.0, -1e300
    for k in range(first, score.size):
        r, C = t.rear[k - first], t.rear_scatter[k - first]
        y0, y1 = x[5], x[6]
        for c in range(COVARIATES):
            y0, y1 = y0 - r[0, c] * z[c], y1 - r[1, c] * z[c]
        for c in range(_NX):
            y0, y1 = y0 - r[0, COVARIATES + c] * x[c], y1 - r[1, COVARIATES + c] * x[c]
        d, determinant, square = _count(C[0, 0] + P[5], y0, 1.0, 0.0)
        a = C[0, 1] * d
        _, determinant, square = _count(C[1, 1] + P[6] - a * C[0, 1], y1 - a * y0, determinant, square)
        score[k] = -p.weight * (0.5 * math.log(determinant) + (0.5 * TAIL + 1.0) * math.log1p(square / TAIL))
        best = max(best, score[k])
        before += m.kinds[k]
    for k in range(first, score.size):
        m.kinds[k] *= math.exp(score[k] - best)
        after += m.kinds[k]
    for k in range(first, score.size):
        m.kinds[k] *= before / after


@part
def _judge(p, t, m, v, traction, s):  # type: ignore[no-untyped-def]
    """Let the window speak: probabilities of the kinds of road, evidence on the full speeds."""
    z, known, P, score, nodes, _, even, at, above, _ = s
    z[0], z[1], z[2] = 1.0, math.log(v / 30.0), math.asinh(traction / 0.02)
    known[0], known[1], known[2] = 1.0, z[1], min(z[2], p.most_u)
    for k in range(score.size):
        even[k] = p.calm_road if t.road[k] == 1 else 0.0
    _scores(t.kind_mean, t.kind_scatter, known, m.x[0], m.x[1], even, score)
    best = -1e300
    for k in range(score.size):
        score[k] = p.weight * score[k]
        best = max(best, score[k])
    total = 0.0
    for k in range(score.size):
        m.kinds[k] *= math.exp(score[k] - best)
        total += m.kinds[k]
    for k in range(score.size):
        m.kinds[k] /= total
    _compare_rear(p, t, m, known, score)
    keep, heard = math.exp(-p.dt / p.keep_s), _is(t, m, 1) > p.heard
    for law in range(t.law.size):
        for i in range(_NV):
            kept = keep * m.evidence[law, i]
            m.evidence[law, i] = kept if abs(kept) > _FAINT else 0.0
    if not heard:
        return
    # how much drag and shake belong to a distance differs from law to law more than what is learnt
    for i in range(_NX):
        P[i] = m.x[1, i]
    P[0], P[3], P[4] = P[0] + p.law_R**2, P[3] + p.law_M**2, P[4] + p.law_M**2
    for k in range(nodes.size):
        even[k] = p.calm
    _scores(t.mean, t.scatter, z, m.x[0], P, even, nodes)
    for law in range(t.law.size):
        own, ways = nodes[law * _NN : (law + 1) * _NN], t.ways[law]
        for n in range(_NN):
            own[n] = p.weight * (own[n] + ways[n])
        for i in range(_NV):
            m.evidence[law, i] += (1.0 - above[i]) * own[at[i]] + above[i] * own[at[i] + 1]


@part
def _predict(p, t, m):  # type: ignore[no-untyped-def]
    """Let the kinds change into each other over one step."""
    now = (_is(t, m, 0), _is(t, m, 1), _is(t, m, 2), _is(t, m, 3))
    change, ends = p.among * p.dt, p.dt * (p.to_dry + p.mistaken)
    # what lies under both sides may end under one of them, and begin
    leaves = ends + p.dt * p.sides
    out = (p.dt * (p.to_water + p.to_other + p.to_side), ends, leaves, leaves)
    into = (
        p.dt * p.to_dry * (now[1] + now[2] + now[3]),
        p.dt * (p.to_water * now[0] + p.mistaken * (now[2] + now[3])),
        p.dt * (p.to_other * now[0] + 0.5 * p.mistaken * now[1] + p.sides * now[3]),
        p.dt * (p.to_side * now[0] + 0.5 * p.mistaken * now[1] + p.sides * now[2]),
    )
    for k in range(m.kinds.size):
        road = int(t.road[k])
        m.kinds[k] *= 1.0 - change - out[road]
        m.kinds[k] += t.kind_prior[k] * (change * now[road] + into[road])


@part
def _distance(p, t, m, v, s):  # type: ignore[no-untyped-def]
    """Fill the quantiles of the distance, and contact, given that there is water; return the probability that full
    aquaplaning is near."""
    w, at, above = s[5], s[7], s[8]
    best, whole = -1e300, 0.0
    for i in range(_NV):
        beyond = max(v - FULL_SPEEDS[i], 0.0) / p.brave
        for law in range(t.law.size):
            w[law, i] = m.evidence[law, i] - 0.5 * beyond * beyond
            best = max(best, w[law, i])
    for law in range(t.law.size):
        for i in range(_NV):
            away = w[law, i] - best
            w[law, i] = t.law[law] * t.prior[i] * math.exp(away) if away > _NEVER else 0.0
            whole += w[law, i]
    v = abs(v)  # from the car's own speed
    near, total, q, L = 0.0, 0.0, 0, 0.0
    edge, limit = _LOG[0] - 0.5 * LOG_STEP, math.log(v + p.near)
    for i in range(_NV):
        here = 0.0
        for law in range(t.law.size):
            here += w[law, i] / whole
            L += w[law, i] / whole * ((1.0 - above[i]) * t.contact[law, at[i]] + above[i] * t.contact[law, at[i] + 1])
        near += here * min(max((limit - edge) / LOG_STEP, 0.0), 1.0)
        while q < 5 and total + here >= _QUANTILES[q] and here > 0.0:
            m.out[2 + q] = math.exp(edge + LOG_STEP * (_QUANTILES[q] - total) / here) - v
            q += 1
        total += here
        edge += LOG_STEP
    m.out[7] = L
    m.out[9] = m.out[4] + v
    return near


@part
def _fill(p, m, wet, near):  # type: ignore[no-untyped-def]
    """Fill what is put out of water, and whether the road shows it."""
    m.out[0] = wet
    # without a slip that is known the distance is what was assumed before: no reason to warn
    m.out[1] = near * wet if m.x[1, 1] < p.vague else 0.0
    # what a car has not shown on dry road yet is no sign of water
    x, P = m.x[0], m.x[1]
    least, unsure = math.asinh(p.drags / p.scale_R), math.sqrt(P[0])
    drags = P[0] < _UNKNOWN and x[0] > max(least, _CLEAR * unsure)
    # a tyre that loses its air only slips, and alone; a car that rolls easier than before has been taught by water
    both = x[1] * x[2] > 0.0 and abs(x[2]) > max(p.both, _SURE * math.sqrt(P[2]))
    both = both and x[0] > -max(least, _SURE * unsure)
    shakes = max(x[3], x[4]) > max(p.shakes, _SURE * m.body[2])
    m.out[8] = 1.0 if drags or both or shakes else 0.0


@part
def _step(p, t, m, row, s):  # type: ignore[no-untyped-def]
    """Take the means of one step; fill `m.out`."""
    for i in range(2):
        row[_S_F + i] = _slip(row[_U_F + i], p.slope_f, p.rolling, p.friction)
        row[_S_R + i] = _slip(row[_U_R + i], p.slope_r, p.rolling, p.friction)
    # what slips roughly as on dry road teaches nothing of it; in water that is known the slips are far larger
    if row[_ROUGH] > 0.5 and not _is(t, m, 1) > p.probable:
        row[_D : _D + 3] = math.nan
    at = int(m.samples[1]) % ROWS
    m.samples[1] += 1.0
    v = row[_V]
    dry = _is(t, m, 0)
    # a road that has only just become dry was none when the step was seen that leaves the window
    since = dry * dry / (dry + (1.0 - dry) * p.to_dry * p.dt * ROWS)
    old = m.window[at]
    if not math.isnan(old[_V]):
        # slower, a road counts as dry whatever lies on it
        _learn(p, m, old, since if old[_V] > p.v_least else 1.0)
    for k in range(row.size):  # an assignment of arrays compiles a message about their shapes, for 4 s
        m.window[at, k] = row[k]
    _predict(p, t, m)
    traction, more = _gather(p, m)
    speed = max(v, p.v_least)
    x, P = m.x[0], m.x[1]
    own = s[9]
    for i in range(3):
        own[i] = x[_SHAKE[i]] + m.sides[i, 5] if P[_SHAKE[i]] < _UNKNOWN else math.nan
    if more == 1:
        x[5] = -x[5]
        for a in (1, 3):
            x[a], x[a + 1] = x[a + 1], x[a]
            P[a], P[a + 1] = P[a + 1], P[a]
    _places(math.log(speed), s[7], s[8])
    if v > p.v_least:
        _judge(p, t, m, speed, traction, s)
    wet, dry = _is(t, m, 1), _is(t, m, 0)
    for i in range(3):
        _learn_shake(p, m.sides[i, 5:], own[i], dry)
    _learn_shake(p, m.body, _shake_of_body(m), dry)
    m.out[:] = math.nan
    _fill(p, m, wet, _distance(p, t, m, v, s) if wet > p.heard else 0.0)


@part
def _push(p, t, m, x, out, row, s):  # type: ignore[no-untyped-def]
    """Take samples (inputs, n) one by one, and fill the rows of what is put out."""
    for i in range(x.shape[1]):
        for c in range(_NI):
            value = x[c, i]
            if not math.isnan(value):
                m.sums[0, c] += value
                m.sums[1, c] += 1.0
                m.sums[2, c] += value * value
        m.samples[0] += 1.0
        if m.samples[0] >= p.block:
            for c in range(_NI):
                enough = m.sums[1, c] > 0.0 and m.sums[1, c] >= 0.5 * p.block
                row[c] = m.sums[0, c] / m.sums[1, c] if enough else math.nan
            for at, c in ((_VAR, _D), (_VAR + 1, _D + 1), (_VAR + 2, _D + 2), (_VAR_B, _B)):
                row[at] = max(m.sums[2, c] / max(m.sums[1, c], 1.0) - row[c] * row[c], 0.0)
            m.sums[:] = 0.0
            m.samples[0] = 0.0
            if not math.isnan(row[_V]):
                _step(p, t, m, row, s)
            else:
                m.out[:] = math.nan
        for k in range(m.out.size):
            out[k, i] = m.out[k]


@compiled
def _scan(p, t, m, x):  # type: ignore[no-untyped-def]
    out = np.empty((m.out.size, x.shape[1]))
    kinds, nodes = m.kinds.size, t.law.size * _NN
    # what a step works with and none remembers: parts that allocate nothing count no references
    s = (
        np.empty(COVARIATES), np.empty(COVARIATES), np.empty(_NX), np.empty(kinds), np.empty(nodes),
        np.empty((t.law.size, _NV)), np.empty(max(kinds, nodes)), np.empty(_NV, np.int64), np.empty(_NV),
        np.empty(3),
    )  # fmt: skip
    _push(p, t, m, x, out, np.empty(m.window.shape[1]), s)
    return out


def scan(p: FilterParams, emissions: Emissions, state: Filter, inputs: Inputs) -> tuple[FloatArray, Filter]:
    """Run the filter over a drive or a piece of one; rows (len(OUTPUTS), n), and the state after it.

    The rows hold from one step, a tenth of a second, to the next.
    """
    after = state.copy()
    return _scan(p, emissions.in_columns(), after, np.array(inputs, dtype=np.float64)), after
