"""A filter over the speed of full aquaplaning, the water's depth, the dry offset, and whether there is water.

Three hypotheses compete: a dry road, something else that disturbs the car, and water of each full speed and depth.
Within each the offset of the resistance is a Kalman filter of its own (Rao-Blackwell); each cell of water also carries
how far this tyre is from the mean of all tyres.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.compiled import compiled, part
from aqualog.core.records import FloatArray
from aqualog.detect.margin.laws import COLUMNS, DEPTHS, FULL_SPEEDS, SPEED_STEP, Tables
from aqualog.detect.margin.state import Filter, FilterParams, Inputs

__all__ = ["scan"]

_NV, _NH = FULL_SPEEDS.size, DEPTHS.size
_STEP = float(SPEED_STEP)
_R, _R_SD, _W_F, _W_R, _W_SD, _K_F, _K_R, _K_SD, _F_F, _F_R, _L = range(len(COLUMNS))
_LOG = np.log(FULL_SPEEDS)
_LOG_STEP = float(_LOG[1] - _LOG[0])
_KINDS = np.array([[0.4, 1.0, 0.0], [0.4, 0.0, 1.0], [0.2, 1.0, 1.0]])  # share, disturbs resistance, disturbs slip
_QUANTILES = np.array([0.05, 0.25, 0.5, 0.75, 0.95])


@part
def _at(t, k, a, i, j, column):  # type: ignore[no-untyped-def]
    return (1.0 - a) * t.x[k, i, j, column] + a * t.x[k + 1, i, j, column]


@part
def _slip(u, w, K, f, slope, rolling):  # type: ignore[no-untyped-def]
    """Slip of an axle by its traction, the water's torque and the contact that is left; within ±1. [-]"""
    F = u - w - rolling
    left = max(1.0 - abs(F) / max(f, 1e-3), 0.01)
    return min(max(F / slope * K / math.sqrt(left), -1.0), 1.0)


@part
def _dry_slip(p, u, slope):  # type: ignore[no-untyped-def]
    return _slip(u, 0.0, 1.0, p.friction, slope, p.rolling)


@part
def _brave(p, v, i):  # type: ignore[no-untyped-def]
    return 1.0 / (1.0 + math.exp(min((v - FULL_SPEEDS[i] - p.brave) / (0.3 * p.brave), 50.0)))


@part
def _predict(p, t, m, v):  # type: ignore[no-untyped-def]
    """Let the hypotheses change into each other over one step; return what enters the water."""
    w, d, o = m.w, m.dry, m.others
    wet = 0.0
    for i in range(_NV):
        for j in range(_NH):
            wet += w[i, j]
    into, out, upset, settle = p.to_water * p.dt, p.to_dry * p.dt, p.to_other * p.dt, p.from_other * p.dt
    was_dry, other = d[0], o[0, 0] + o[1, 0] + o[2, 0]
    d[0] = was_dry * (1.0 - into - upset) + out * wet + (1.0 - p.other_wets) * settle * other
    enters = into * was_dry + p.other_wets * settle * other
    keep = math.exp(-p.dt / p.other_s)
    for c in range(3):
        came = _KINDS[c, 0] * upset * (was_dry + wet)
        o[c, 0] = o[c, 0] * (1.0 - settle) + came
        # they follow what is seen all the time, so that who comes late finds them where the disturbance is
        for at, tau in ((1, _KINDS[c, 1] * p.other_R), (3, _KINDS[c, 2] * p.other_y)):
            o[c, at] *= keep
            o[c, at + 1] = keep * keep * o[c, at + 1] + (1.0 - keep * keep) * tau * tau
    stay = 1.0 - out - upset
    for j in range(_NH):
        below = w[0, j]
        for i in range(_NV):
            here = w[i, j]
            above = w[i + 1, j] if i + 1 < _NV else here
            kappa = 0.5 * p.drift_V**2 * p.dt / (_LOG_STEP * FULL_SPEEDS[i]) ** 2
            came = enters * t.prior[i, j] * _brave(p, v, i)
            w[i, j] = stay * (here + kappa * (below - 2.0 * here + above)) + came
            below = here
    d[3] = min(d[3] + (p.walk_R**2 + other * p.anew_R**2) * p.dt, p.offset_R**2)
    d[5] = min(d[5] + p.walk_a**2 * p.dt, p.share_a**2)
    for side in range(2):
        q = m.sides[side]
        q[2] = max(q[2], min(q[2] + (p.walk_D**2 + other * p.anew_D**2) * p.dt, 0.9 * p.anew_most**2))
        q[4] = min(q[4] + p.walk_share**2 * p.dt, p.share_D**2)
    return enters


@part
def _gauss(z2, S, clip):  # type: ignore[no-untyped-def]
    return -0.5 * (min(z2 / S, clip) + math.log(S))


@part
def _learn_line(s, at, x, left, lasting, trust):  # type: ignore[no-untyped-def]
    """Learn offset and slope of a line, `s[at]` and `s[at + 1]`, by Kalman's filter; their covariance follows them.

    `left` is what was seen at x less the line, `lasting` its variance beside the line's, `trust` 0 to 1.
    """
    P_m, P_q = s[at + 2] + x * s[at + 3], s[at + 3] + x * s[at + 4]
    S = P_m + x * P_q + lasting
    gain_m, gain_q = trust * P_m / S, trust * P_q / S
    s[at] += gain_m * left
    s[at + 1] += gain_q * left
    s[at + 2] -= gain_m * P_m
    s[at + 4] -= gain_q * P_q
    s[at + 3] -= gain_m * P_q


@part
def _learn_D(p, g, trust, D, u_f, u_r, noise):  # type: ignore[no-untyped-def]
    """Learn offset and slope of a side's dry slip by as much as the road is dry."""
    f, r = _dry_slip(p, u_f, p.slope_f), _dry_slip(p, u_r, p.slope_r)
    both = p.share_axle * min(abs(f), abs(r))
    lasting = p.noise_D**2 + p.noisy**2 * noise + g[6] + both * both
    _learn_line(g, 0, f - r, D - (1.0 + g[1]) * (f - r) - g[0], lasting, trust)


@part
def _other(p, s, at, z, S, tau):  # type: ignore[no-untyped-def]
    """Log likelihood of a deviation z by what else disturbs, which stays for a while; update its estimate."""
    away = z - s[at]
    if away * away > p.clip * (S + s[at + 1]):
        s[at + 1] = tau * tau  # it has changed
    S += s[at + 1]
    gain = s[at + 1] / S
    s[at] += gain * away
    s[at + 1] *= 1.0 - gain
    return _gauss(away * away, S, p.clip)


class _Seen(NamedTuple):
    """What one step shows: of the side that deviates more, and of the resistance.

    `R` less what an unknown load makes; `lasting_R` variance of that; `force` specific force. `e` deviation of the slip
    from the dry one and `y` the same on its own scale; traction `u_f`, `u_r`, dry slip `s`, share `q` by which its
    slope is off; variances: `known` of offset and slope, `both` what the axles share (as a deviation), `noise`.
    """

    has_R: bool
    R: float
    force: float
    lasting_R: float
    has_D: bool
    e: float
    y: float
    u_f: float
    u_r: float
    s: float
    q: float
    both: float
    known: float
    noise: float


@part
def _seen(p, m, x, var_l, var_r):  # type: ignore[no-untyped-def]
    """Compare the means of one step with a dry road; keep the noise of the slip while it is dry."""
    d, has_D = m.dry, False
    force = 0.0 if math.isnan(x[1]) else x[1]
    lasting_R = 2.0 * force * d[4] + force * force * d[5]
    e, noise, q, both, known = 0.0, p.noise_D**2, 0.0, 0.0, 0.0
    u_f, u_r, s = 0.0, 0.0, 0.0
    for side in range(2):
        D, f, r = x[3 + side], x[5 + side], x[7 + side]
        if math.isnan(D + f + r):
            continue
        g, var = m.sides[side], var_l if side == 0 else var_r
        dry_f, dry_r = _dry_slip(p, f, p.slope_f), _dry_slip(p, r, p.slope_r)
        h = dry_f - dry_r
        if g[2] > p.anew_most**2:
            # the first value is the offset: radii differ by more than any water takes
            _learn_D(p, g, 1.0, D, f, r, var)
            continue
        away = D - (1.0 + g[1]) * h - g[0]
        # the side that deviates more: the deeper water
        if not has_D or abs(away) > abs(e):
            e, u_f, u_r, s, q = away, f, r, h, g[1]
            both = p.share_axle * min(abs(dry_f), abs(dry_r))
            known = g[2] + 2.0 * h * g[3] + h * h * g[4]
            noise = p.noise_D**2 + p.noisy**2 * var + g[6]
        # noise from step to step, while the road is dry: rough asphalt shakes the wheels as water does
        if not math.isnan(g[5]):
            share = p.dt / p.noise_s * (1.0 if math.isnan(m.out[0]) else 1.0 - m.out[0])
            g[6] += share * (min(0.5 * (away - g[5]) ** 2, 1e-4) - g[6])
        g[5] = away
        has_D = True
    y = math.asinh(e / p.scale_D)
    has_R, R = not math.isnan(x[2]), x[2] - d[2] * force
    return _Seen(has_R, R, force, lasting_R, has_D, e, y, u_f, u_r, s, q, both, known, noise)


@part
def _score_R(p, t, m, c, z, share, keep):  # type: ignore[no-untyped-def]
    """Log likelihood of the resistance in cell (i, j) of `c`, and the update of its offset."""
    k, a, i, j = c
    d = m.dry
    R_i = _at(t, k, a, i, j, _R)
    tau = _at(t, k, a, i, j, _R_SD) + 0.1 * R_i
    own = tau * tau + z.lasting_R
    # what has just come from the dry road brings its offset along
    away = m.b_R[i, j] - d[1]
    m.b_R[i, j] -= share * away
    stays = m.P_R[i, j] + share * away * away + (1.0 - keep * keep) * own
    m.P_R[i, j] = (1.0 - share) * stays + share * (d[3] + own)
    if not z.has_R:
        return 0.0
    S = m.P_R[i, j] + p.noise_R**2
    left = z.R - R_i - m.b_R[i, j]
    gain = m.P_R[i, j] / max(S, left * left / p.clip)
    most = p.most * math.sqrt(own + d[3])
    m.b_R[i, j] = min(max(m.b_R[i, j] + gain * left, d[1] - most), d[1] + most)
    m.P_R[i, j] *= 1.0 - gain
    return _gauss(left * left, S, p.clip)


@part
def _score_y(p, t, m, c, z, share, keep):  # type: ignore[no-untyped-def]
    """Log likelihood of the slip in cell (i, j) of `c`, and the update of how far this tyre is from the mean."""
    if not z.has_D:
        return 0.0
    k, a, i, j = c
    w_f, w_r = _at(t, k, a, i, j, _W_F), _at(t, k, a, i, j, _W_R)
    K_f, f_f = _at(t, k, a, i, j, _K_F), _at(t, k, a, i, j, _F_F)
    slip_f = _slip(z.u_f, w_f, K_f, f_f, p.slope_f, p.rolling)
    slip_r = _slip(z.u_r, w_r, _at(t, k, a, i, j, _K_R), _at(t, k, a, i, j, _F_R), p.slope_r, p.rolling)
    D = (1.0 + z.q) * (slip_f - slip_r - z.s)
    big = abs(slip_f) + abs(slip_r)
    by_w = min(_at(t, k, a, i, j, _W_SD) / p.slope_f * K_f, 1.0)
    held = min(max(2.0 * (abs(z.u_f - w_f - p.rolling) / f_f - 0.15), 0.0), 1.0)
    log2 = _at(t, k, a, i, j, _K_SD) ** 2 + p.share_F**2 + (p.stopped * held) ** 2
    tau2 = (log2 * big * big + by_w * by_w + z.known + z.both**2) / (p.scale_D**2 + D * D)
    away = m.b_y[i, j]
    b = (1.0 - share) * keep * away
    stays = keep * keep * m.P_y[i, j] + (1.0 - keep * keep) * tau2 + share * away * away
    P = (1.0 - share) * stays + share * tau2
    # noise of what is seen, not of what a cell expects: else a steady wheel would speak against every cell that shakes
    S = P + (z.noise + (p.shake * z.e) ** 2) / (p.scale_D**2 + z.e * z.e) + (p.floats * held) ** 2
    left = z.y - math.asinh(D / p.scale_D) - b
    gain = P / max(S, left * left / p.clip)
    # no tyre is further off than this: what is more stays a contradiction
    most = p.most * math.sqrt(tau2)
    m.b_y[i, j] = min(max(b + gain * left, -most), most)
    m.P_y[i, j] = P * (1.0 - gain)
    return _gauss(left * left, S, p.clip)


@part
def _score_dry(p, d, z):  # type: ignore[no-untyped-def]
    """Log likelihood on a dry road, and the update of what its slip has beyond offset and slope."""
    score = 0.0
    if z.has_R:
        score += _gauss((z.R - d[1]) ** 2, d[3] + p.noise_R**2 + z.lasting_R, p.clip)
    if z.has_D:
        slow = math.exp(-p.dt / p.slip_s)
        d[6] *= slow
        d[7] = slow * slow * d[7] + (1.0 - slow * slow) * (z.both / p.scale_D) ** 2
        S = d[7] + (z.noise + z.known) / p.scale_D**2
        left = z.y - d[6]
        score += _gauss(left * left, S, p.clip)
        gain = d[7] / max(S, left * left / p.clip)
        d[6] += gain * left
        d[7] *= 1.0 - gain
    return score


@part
def _score_other(p, d, o, c, z):  # type: ignore[no-untyped-def]
    """Log likelihood of what else disturbs, of the kind c."""
    score = 0.0
    if z.has_R:
        S = d[3] + p.noise_R**2 + z.lasting_R
        score += _other(p, o, 1, z.R - d[1], S, _KINDS[c, 1] * p.other_R)
    if z.has_D:
        lasting = z.noise + z.known + z.both**2
        S = lasting / p.scale_D**2
        if _KINDS[c, 2] > 0.0:
            S = (lasting + (p.shake * z.e) ** 2) / (p.scale_D**2 + z.e * z.e)
        score += _other(p, o, 3, z.y, S, _KINDS[c, 2] * p.other_y)
        if abs(z.e) > p.slip_most:
            score -= 0.25 * p.clip  # a kerb or hole lets a wheel go that far, but not for long
    return score


@part
def _fill(p, t, m, v, k, a):  # type: ignore[no-untyped-def]
    """Fill what is put out: quantiles of the distance where there is water."""
    wet, L = 0.0, 0.0
    for i in range(_NV):
        for j in range(_NH):
            wet += m.w[i, j]
            L += m.w[i, j] * (_at(t, k, a, i, j, _L))
    m.out[0] = wet
    m.out[7] = L / max(wet, 1e-300)
    near, total, q = 0.0, 0.0, 0
    edge = _LOG[0] - 0.5 * _LOG_STEP
    limit = math.log(max(v + p.near, 1.0))
    for i in range(_NV):
        here = 0.0
        sure = 0.0
        for j in range(_NH):
            here += m.w[i, j]
            R_i = _at(t, k, a, i, j, _R)
            sure += m.w[i, j] if m.b_R[i, j] - m.dry[1] > -p.sure * R_i else 0.0
        # the resistance that this water would make must be there
        near += sure * min(max((limit - edge) / _LOG_STEP, 0.0), 1.0)
        while q < 5 and total + here >= _QUANTILES[q] * wet and here > 0.0:
            m.out[2 + q] = math.exp(edge + _LOG_STEP * (_QUANTILES[q] * wet - total) / here) - v
            q += 1
        total += here
        edge += _LOG_STEP
    m.out[1] = near
    m.out[8] = m.out[4] + v


@compiled
def _step(p, t, m, x, var_l, var_r):  # type: ignore[no-untyped-def]
    """Take the means of one step; fill `m.out`."""
    w, d, o = m.w, m.dry, m.others
    enters = _predict(p, t, m, x[0])
    place = min(max(x[0] / _STEP, 0.0), t.x.shape[0] - 1.001)
    k = int(place)
    a = place - k
    z = _seen(p, m, x, var_l, var_r)
    keep = math.exp(-p.dt / p.bias_s)
    score = np.empty((_NV, _NH))
    best = -1e300
    for i in range(_NV):
        brave = enters * _brave(p, x[0], i)
        for j in range(_NH):
            share = min(brave * t.prior[i, j] / max(w[i, j], 1e-300), 1.0)
            cell = (k, a, i, j)
            score[i, j] = _score_R(p, t, m, cell, z, share, keep) + _score_y(p, t, m, cell, z, share, keep)
            best = max(best, score[i, j])
    dry = _score_dry(p, d, z)
    best = max(best, dry)
    other = np.empty(3)
    for c in range(3):
        other[c] = _score_other(p, d, o[c], c, z)
        best = max(best, other[c])
    d[0] *= math.exp(dry - best)
    total = d[0]
    for c in range(3):
        o[c, 0] *= math.exp(other[c] - best)
        total += o[c, 0]
    for i in range(_NV):
        for j in range(_NH):
            w[i, j] *= math.exp(score[i, j] - best)
            total += w[i, j]
    total = max(total, 1e-300)
    d[0] /= total
    for c in range(3):
        o[c, 0] /= total
    for i in range(_NV):
        for j in range(_NH):
            w[i, j] /= total
    if z.has_R:
        # offset and share of the specific force; `z.R` has the share taken off
        _learn_line(d, 1, z.force, z.R - d[1], p.noise_R**2, d[0])
    for side in range(2):
        if not math.isnan(x[3 + side] + x[5 + side] + x[7 + side]):
            _learn_D(p, m.sides[side], d[0], x[3 + side], x[5 + side], x[7 + side], var_l if side == 0 else var_r)
    _fill(p, t, m, x[0], k, a)


@compiled
def _scan(p, t, m, x):  # type: ignore[no-untyped-def]
    n = x[0].size
    out = np.empty((m.out.size, n))
    mean = np.empty(9)
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
                mean[c] = m.sums[0, c] / m.sums[1, c] if enough else math.nan
            var_l = max(m.sums[2, 3] / max(m.sums[1, 3], 1.0) - mean[3] * mean[3], 0.0)
            var_r = max(m.sums[2, 4] / max(m.sums[1, 4], 1.0) - mean[4] * mean[4], 0.0)
            m.sums[:] = 0.0
            m.samples[0] = 0.0
            if not math.isnan(mean[0]):
                _step(p, t, m, mean, var_l, var_r)
            else:
                m.out[:] = math.nan
        out[:, i] = m.out
    return out


def scan(p: FilterParams, tables: Tables, state: Filter, inputs: Inputs) -> tuple[FloatArray, Filter]:
    """Run the filter over a drive or a piece of one; rows (len(OUTPUTS), n), and the state after it.

    The rows hold from one step, a tenth of a second, to the next.
    """
    after = state.copy()
    return _scan(p, tables, after, np.array(inputs, dtype=np.float64)), after
