"""Places where the clock of one signal jumps against the others: a logger's seam, samples lost without a gap in time.
Over some seconds the delay of one source of the car's acceleration against another is measured; a step of it that stays
is a seam. A gear shift is over within its window, and a clock that drifts makes a ramp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.evidence import gumbel_p
from aqualog.diagnose.inputs import smooth

__all__ = ["SEAM_LEVEL", "Seam", "seams"]

SEAM_LEVEL = 0.01  # false alarms per drive, over all pairs of sources
STEP_S = 0.02  # [s] of the comparison
FAST_S, SLOW_S = 0.3, 4.0  # [s] means between which the motion is compared: noise is faster, offsets and hills slower
WINDOW_S, BLOCK_S = 6.0, 0.5
FARTHEST_S = 1.0  # [s] of a jump to either side
ALIKE = 0.7  # correlation that a window needs: less shows no delay
LEAST_MOTION = 0.05  # [m/s²] rms in a window
LEAST_WINDOWS = 12
SIDE = 4  # windows before and after a step
LEAST_S = 0.05  # [s] smallest step that counts as a jump: the tyre's own delay changes by 0.04 with the driving
LEAST_SAMPLES = 0.75
DRAWS = 199  # permutations
NEAR_S = 5.0 * WINDOW_S  # [s] within which steps of several pairs are one seam


@dataclass(frozen=True, slots=True)
class Seam:
    """A jump of a signal's clock at `t` [s], known to a window: from there on it comes `size` [s] later; earlier if
    negative. `signals`: the one that jumps; two where no third one shows which. `p_value`: of such a step by chance
    anywhere in the drive."""

    t: float
    size: float
    signals: tuple[str, ...]
    p_value: float

    @property
    def sentence(self) -> str:
        """In one sentence."""
        what = f"{abs(self.size):.2f} s {'later' if self.size > 0.0 else 'earlier'}"
        against = f" against {self.signals[1]}" if len(self.signals) > 1 else ""
        return f"From {self.t:.0f} s on, {self.signals[0]} comes {what}{against}: a seam of the log."


class _Delays(NamedTuple):
    """Delay of one source against another by window: middle [s], delay [s], weight; `least`: smallest step [s]."""

    t: FloatArray
    delay: FloatArray
    weight: FloatArray
    least: float = LEAST_S


def seams(signals: Signals, vehicle: Vehicle, *, seed: int = 1) -> tuple[Seam, ...]:
    """Jumps of the clock of accelerometer, wheels, reference velocity or torque, first ones first. `signals` at the
    log's own rate; of the vehicle the radii only; `seed` of the permutations of windows that calibrate the test.
    Limits: two jumps of one signal within half a minute are one; without acceleration there is nothing to see."""
    sources = _sources(signals, vehicle)
    pairs = list(combinations(sources, 2))
    steps: list[Seam] = []
    for i, (a, b) in enumerate(pairs):
        delays = _delays(sources[a], sources[b], max(1, round(STEP_S / signals.dt)) * signals.dt)
        if delays is not None:
            # half a sample of a slow bus is no jump
            rates = [o.rate_hz for n, o in signals.origins.items() if n.split("_")[0] in (a, b) or n in (a, b)]
            slowest = min((r for r in rates if r > 0.0), default=1.0 / signals.dt)
            delays = delays._replace(least=max(LEAST_S, LEAST_SAMPLES / min(slowest, 1.0 / signals.dt)))
            steps += _steps((a, b), delays, len(pairs), np.random.default_rng([seed, i]))
    return tuple(sorted(_named(steps, list(sources)), key=lambda s: s.t))


def _sources(signals: Signals, vehicle: Vehicle) -> dict[str, FloatArray]:
    """Accelerations (m,) [m/s²] by source, without what is slow and without noise; NaN where samples are missing."""
    dt = signals.dt
    has = {s for s in signals.symbols if signals.frame[s].null_count() < signals.frame.height}
    out: dict[str, FloatArray] = {}
    if "a_x" in has:
        out["a_x"] = _band(signals.array("a_x"), dt, is_speed=False)
    if all(f"omega_{w}" in has for w in WHEELS):
        free = [w for w in WHEELS if w not in vehicle.driven] or list(WHEELS)
        rim = np.mean([signals.array(f"omega_{w}") * vehicle.r_e(w) for w in free], axis=0)
        out["omega"] = _band(rim, dt, is_speed=True)
    if "v_x" in has:
        out["v_x"] = _band(signals.array("v_x"), dt, is_speed=True)
    torques = [w for w in WHEELS if f"torque_{w}" in has]
    if torques:
        pull = np.sum([signals.array(f"torque_{w}") / vehicle.arm(w) for w in torques], axis=0) / vehicle.mass
        out["torque"] = _band(pull, dt, is_speed=False)
    return out


def _band(x: FloatArray, dt: float, *, is_speed: bool) -> FloatArray:
    good = np.isfinite(x)
    filled = np.interp(np.arange(x.size), np.flatnonzero(good), x[good])
    fast = smooth(filled, dt, FAST_S)
    if is_speed:
        fast = np.gradient(fast, dt)
    out = fast - smooth(fast, dt, SLOW_S)
    # single lost samples are bridged
    k = max(1, round(0.1 / dt))
    share = np.convolve(good.astype(np.float64), np.ones(2 * k + 1) / (2 * k + 1), "same")
    step = max(1, round(STEP_S / dt))
    return np.where(share > 0.5, out, np.nan)[::step]


def _delays(x: FloatArray, y: FloatArray, dt: float) -> _Delays | None:
    """By how much x comes later than y, window by window, around their delay in the whole drive."""
    reach = round(FARTHEST_S / dt)
    good = np.isfinite(x) & np.isfinite(y)
    x, y = np.where(good, x, 0.0), np.where(good, y, 0.0)
    n = x.size
    size = max(1, round(BLOCK_S / dt))
    block_s = size * dt
    blocks = n // size
    per = round(WINDOW_S / block_s)
    if blocks // per < LEAST_WINDOWS:
        return None
    wide = _products(x, y, np.arange(-2 * reach, 2 * reach + 1), blocks, size)
    centre = int(np.argmax(wide[0].sum(axis=0) / np.sqrt(np.maximum(wide[1].sum(axis=0), 1e-12)))) - 2 * reach
    shifts = np.clip(centre, -reach, reach) + np.arange(-reach, reach + 1)
    at = shifts + 2 * reach
    xy, yy, xx = wide[0][:, at], wide[1][:, at], wide[2]
    m = blocks // per
    sums = [a[: m * per].reshape(m, per, -1).sum(axis=1) for a in (xy, yy, xx[:, None])]
    rho = sums[0] / np.sqrt(np.maximum(sums[1] * sums[2], 1e-12))
    best = np.argmax(rho, axis=1)
    inside = (best > 0) & (best < shifts.size - 1)
    i = np.clip(best, 1, shifts.size - 2)
    row = np.arange(m)
    left, top, right = rho[row, i - 1], rho[row, i], rho[row, i + 1]
    curve = np.maximum(2.0 * top - left - right, 1e-9)
    moved = np.sqrt(sums[2][:, 0] / (per * size)) > LEAST_MOTION
    used = inside & moved & (top > ALIKE)
    if used.sum() < LEAST_WINDOWS:
        return None
    delay = (shifts[i] + 0.5 * (right - left) / curve) * dt
    weight = curve / np.maximum(1.0 - top**2, 1e-3)
    return _Delays((row[used] + 0.5) * per * block_s, delay[used], weight[used])


def _products(
    x: FloatArray, y: FloatArray, shifts: np.ndarray[tuple[int], np.dtype[np.intp]], blocks: int, size: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sums over blocks of x(t) y(t - shift) and y(t - shift)^2 (b, L), and of x^2 (b,)."""
    reach = int(np.abs(shifts).max())
    padded = np.pad(y, reach)
    n = blocks * size
    moved = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)[:n, ::-1]
    moved = moved.reshape(blocks, size, -1)
    own = x[:n].reshape(blocks, size)
    xy = np.matmul(own[:, None, :], moved)[:, 0]
    square = np.concatenate([[0.0], np.cumsum(padded**2)])
    starts = np.arange(blocks)[:, None] * size + reach - shifts[None, :]
    return xy, square[starts + size] - square[starts], (own**2).sum(axis=1)


def _steps(pair: tuple[str, str], d: _Delays, tests: int, rng: np.random.Generator, depth: int = 0) -> list[Seam]:
    """Steps of the delay of one pair: the surest, then those before and after it."""
    if d.t.size < LEAST_WINDOWS or depth > 2:
        return []
    gains, sizes = _scan(d, d.delay[None])
    at = int(np.argmax(gains[0]))
    size = float(sizes[0, at])
    if abs(size) < d.least:
        return []
    rest = d.delay - size * (np.arange(d.t.size) > at + SIDE - 1)
    drawn = np.array([rng.permutation(rest) for _ in range(DRAWS)])
    maxima = _scan(d, drawn)[0].max(axis=1)
    p = min(1.0, gumbel_p(maxima, float(gains[0, at])) * tests) if gains[0, at] > maxima.max() else 1.0
    k = at + SIDE
    size = float(np.median(d.delay[k:]) - np.median(d.delay[:k]))
    if p > SEAM_LEVEL or abs(size) < d.least:
        return []
    found = [Seam(0.5 * float(d.t[k - 1] + d.t[k]), size, pair, p)]
    for part in (slice(0, k), slice(k, None)):
        half = d._replace(t=d.t[part], delay=d.delay[part], weight=d.weight[part])
        found += _steps(pair, half, tests, rng, depth + 1)
    return found


def _scan(d: _Delays, delays: FloatArray) -> tuple[FloatArray, FloatArray]:
    """F-type gain of a step beside what is no step, a level and a ramp (a clock that drifts), for series (s, m) and all
    places: gains and sizes (s, places)."""
    t, w = d.t, np.sqrt(d.weight)
    base, _ = np.linalg.qr(np.stack([w, w * (t - t.mean()) / max(float(np.ptp(t)), 1e-9)], axis=1))
    y = delays * w
    y = y - (y @ base) @ base.T
    places = np.arange(SIDE, t.size - SIDE + 1)
    steps = (np.arange(t.size)[None, :] >= places[:, None]) * w
    steps = steps - (steps @ base) @ base.T
    energy = (steps**2).sum(axis=1)
    along = y @ steps.T
    gain = along**2 / energy
    left = np.maximum((y**2).sum(axis=1, keepdims=True) - gain, 1e-12)
    return gain / left * (t.size - 4), along / energy


def _named(steps: Sequence[Seam], sources: Sequence[str]) -> list[Seam]:
    """Steps of pairs as jumps of sources: the source that is in most of the pairs that step at one time."""
    out = []
    left = sorted(steps, key=lambda s: s.p_value)
    while left:
        surest = left[0]
        group = [s for s in left if abs(s.t - surest.t) <= NEAR_S and set(s.signals) & set(surest.signals)]
        score = {s: sum(s in step.signals for step in group) for s in sources}
        names = tuple(s for s in sources if score[s] == max(score.values()))
        if len(names) > 1:
            names, group = surest.signals, [surest]
        own = [s for s in group if names[0] in s.signals]
        size = float(np.median([s.size * (1.0 if s.signals[0] == names[0] else -1.0) for s in own]))
        out.append(Seam(float(np.median([s.t for s in own])), size, names, surest.p_value))
        left = [s for s in left if s not in group]
    return out
