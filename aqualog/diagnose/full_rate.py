"""What repeats with every turn of a wheel, at the log's own rate: rings, wheels and tyres that are uneven. Each wheel
speed is compared with its own mean over a second, over the wheel's own angle. Orders next to a whole one are the null:
they have the noise of the same frequencies, whatever its colour."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from aqualog.core.intervals import Z95, chi2_log_p
from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray, Origin, Signals
from aqualog.core.units import is_unit, parse_unit
from aqualog.diagnose.inputs import SPEED_S, lasting, smooth

__all__ = ["LEVEL", "ORDERS", "PerTurn", "per_turn", "wheel_columns"]

ORDERS = (1, 2, 3)
LEVEL = 0.01  # false alarms per drive, over all wheels and orders
LEAST_HZ = 2.0  # slower, the driver and the springs move the car: the mean over a second ends there
NYQUIST = 0.8  # share of the highest frequency that a rate can show
LEAST_TURNS = 100
GAP_S = 0.25  # [s] of missing samples that a straight line may bridge, as in `drive`
OUTLIER = 6.0  # [sd] of the local scatter
BINS = 8  # of a turn: an order 0.15 off turns by 0.06 rad within half a bin
FINER = 4  # points of the transform per block's own resolution, where the order is sought
BLOCKS = (512, 64, 16)  # [turns] beside the whole drive: the noise of a wheel speed makes the angle drift
GUARD, NULL = 0.03, 0.17  # nearest and farthest order of the null
ORDER_SLACK = 0.05  # of the order, where a control unit has turned the angle into a speed with a radius of its own
UNEQUAL, UNEQUAL_LOG_P = 1.6, 3.0  # ratio of amplitudes at low and high speed, and how sure it must be
APART = 1.2  # ratio of the two speeds
LEAST_CHANGES, IN_STEP, MOST_HELD = 50, 0.97, 25

Kind = Literal["ring", "speed", "nothing", "untested"]


@dataclass(frozen=True, slots=True)
class PerTurn:
    """What one wheel's speed has of one order: `amplitude` relative to the speed, with its 95 % interval; `p_value`: of
    so much by chance anywhere in the drive, over all wheels and orders. `kind`: `ring` if the relative amplitude is the
    same at low and high speed, `speed` if not, with the largest of the thirds by speed as `most`; `untested` with the
    `reason`."""

    wheel: str
    order: int
    kind: Kind
    amplitude: float = math.nan
    low: float = math.nan
    high: float = math.nan
    p_value: float = 1.0
    reason: str = ""
    most: float = math.nan

    @property
    def found(self) -> bool:
        """Whether it is there, at `LEVEL`."""
        return self.kind in ("ring", "speed")


class _Wheel(NamedTuple):
    """A wheel speed at its own step: mean and relative rest (m,), weight 1 / variance of the rest, angle [turns];
    `rate` [Hz] at which the bus has it; `lines`: time between samples that straight lines connect, else 0 [s];
    `between`: as in `Origin`."""

    dt: float
    rate: float
    lines: float
    between: float
    mean: FloatArray
    rest: FloatArray
    weight: FloatArray
    turns: FloatArray

    @property
    def place_of(self) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
        """Bin of the angle that each sample is in. (m,)"""
        return np.asarray(np.floor((self.turns - self.turns[0]) * BINS), dtype=np.intp)


class _Sum(NamedTuple):
    """Sums over blocks of turns: weight (b,), transforms (b, j) at the orders `offset` (j,) beside the whole one,
    `speed` (b,) mean [rad/s]."""

    weight: FloatArray
    transform: np.ndarray[tuple[int, int], np.dtype[np.complex128]]
    offset: FloatArray
    speed: FloatArray
    finer: int


class _Fit(NamedTuple):
    log_p: float
    square: float  # of the amplitude
    sd: float  # of the square
    tries: int
    sums: _Sum
    at: int


def wheel_columns(signals: Signals) -> dict[str, FloatArray]:
    """Wheel speeds of a log at its own rate, NaN where a sample is missing. (n,) each [rad/s]"""
    return {f"omega_{w}": signals.array(f"omega_{w}") for w in WHEELS if f"omega_{w}" in signals.symbols}


def per_turn(
    columns: Mapping[str, FloatArray], dt: float, origins: Mapping[str, Origin]
) -> tuple[PerTurn, ...]:  # fmt: skip
    """What repeats with every turn, half and third of a turn of each wheel: one for each wheel and order. `columns`:
    `omega_*` (n,) [rad/s] at the step `dt` [s], not averaged, NaN where a sample is missing; `origins`: rate of each
    signal on its bus, and its unit.

    A control unit averages over nothing up to the period of its reports: the interval covers both. What lines between
    samples and grid take is put back. Limits: a tyre that runs out of true looks like a ring; a speed that is rounded
    without noise hides what is smaller than half a step; a logger that put all channels on one time base has taken a
    part of the amplitude with it.
    """
    found = []
    for w in WHEELS:
        origin = origins.get(f"omega_{w}")
        if f"omega_{w}" not in columns:
            continue
        wheel = _prepared(columns[f"omega_{w}"], dt, origin)
        # a speed has the angle of a radius that nobody knows
        has_speed = origin is not None and is_unit(origin.unit) and parse_unit(origin.unit).dimension == "speed"
        for order in ORDERS:
            r = wheel if isinstance(wheel, str) else _tested(wheel, order, ORDER_SLACK if has_speed else 0.0)
            found.append(PerTurn(w, order, "untested", reason=r) if isinstance(r, str) else replace(r, wheel=w))
    tests = sum(r.kind != "untested" for r in found)
    return tuple(_at_level(r, tests) for r in found)


def _at_level(r: PerTurn, tests: int) -> PerTurn:
    if r.kind == "untested":
        return r
    p = min(1.0, r.p_value * tests)
    return replace(r, p_value=p) if p <= LEVEL else replace(r, p_value=p, kind="nothing", reason="")


def _prepared(x: FloatArray, dt: float, origin: Origin | None) -> _Wheel | str:
    held = _held(x)
    if held > 1:
        changes = np.flatnonzero(np.diff(x) != 0.0) + 1
        first = int(np.bincount(changes % held, minlength=held).argmax())
        x, dt = x[first::held], held * dt
    rate, lines = 1.0 / dt, 0.0
    between = origin.between if origin is not None and held <= 1 else 0.0  # held samples are taken as they are
    if origin is not None and 0.0 < origin.rate_hz < 0.8 * rate:
        rate, lines = origin.rate_hz, 1.0 / origin.rate_hz
    good = np.isfinite(x)
    if good.sum() * dt < 2.0 * SPEED_S or 0.5 * NYQUIST * rate <= LEAST_HZ:
        return f"the wheel speeds come at {rate:.3g} Hz" if good.any() else "no wheel speed"
    missing = lasting(~good, GAP_S, dt)
    filled = np.interp(np.arange(x.size), np.flatnonzero(good), x[good])
    mean = smooth(filled, dt, SPEED_S)
    scatter, step = _scatter(filled - mean, dt), _step(x)
    good &= np.abs(filled - mean) <= OUTLIER * np.maximum(scatter, step)
    filled = np.where(good | missing, filled, mean)  # outliers would turn the angle
    mean = smooth(filled, dt, SPEED_S)
    variance = np.maximum(_scatter(filled - mean, dt) ** 2, max(step**2 / 12.0, 1e-12))
    turns = np.concatenate(([0.0], np.cumsum(0.5 * dt * (filled[1:] + filled[:-1])))) / (2.0 * math.pi)
    safe = np.maximum(mean, 1e-3)
    beside = round(0.5 * SPEED_S / dt)
    edge = np.convolve(np.pad(missing, beside, constant_values=True), np.ones(2 * beside + 1), "valid") > 0.5
    weight = np.where(good & ~edge & (mean > 1e-3), safe**2 / variance, 0.0)
    return _Wheel(dt, rate, lines, between, mean, (filled - mean) / safe, weight, turns)


def _tested(wheel: _Wheel, order: int, slack: float) -> PerTurn | str:
    f = order * wheel.mean / (2.0 * math.pi)
    used = (wheel.weight > 0.0) & (f > LEAST_HZ) & (f < 0.5 * NYQUIST * wheel.rate)
    if not used.any():
        if not ((wheel.weight > 0.0) & (f > LEAST_HZ)).any():
            return f"no wheel turns faster than {LEAST_HZ:g} times a second"
        return f"wheel speeds at {wheel.rate:.3g} Hz are too slow for one turn of a wheel at the speeds of the drive"
    part = _Wheel(wheel.dt, wheel.rate, wheel.lines, wheel.between, *(a[used] for a in wheel[4:]))
    f = f[used]
    # share of the amplitude that is left: no window or the whole period of the reports, and lines between samples
    most = np.sinc(f * wheel.lines) ** 2
    if wheel.lines == 0.0:
        most *= np.sqrt(1.0 - 2.0 * wheel.between * (1.0 - np.cos(2.0 * np.pi * f * wheel.dt)))
    least = most * np.sinc(f * max(1.0 / wheel.rate, wheel.dt))
    gain = 0.5 * (least + most)
    best = _best(part, order, gain, slack)
    if isinstance(best, str):
        return best
    w = part.weight * gain
    by_most, by_least = (float(w @ g) / float(w @ gain) for g in (most, least))
    low = math.sqrt(max(best.square - Z95 * best.sd, 0.0)) / by_most
    high = math.sqrt(max(best.square + Z95 * best.sd, 0.0)) / by_least
    unlike = _speed_dependence(part, order, gain, best)
    return PerTurn(
        "", order, "speed" if unlike[0] else "ring", math.sqrt(max(best.square, 0.0)), low, high,
        min(1.0, best.tries * 10.0**-best.log_p), *unlike,
    )  # fmt: skip


def _best(part: _Wheel, order: int, gain: FloatArray, slack: float) -> _Fit | str:
    """The surest of the sums over the whole drive and over blocks of it, at the surest order within `slack`."""
    place_of = part.place_of
    turns = int(place_of[-1] // BINS) + 1
    filled = np.unique(place_of // BINS).size
    if filled < LEAST_TURNS:
        return f"{filled} turns at usable speeds, {LEAST_TURNS} are needed"
    lengths = (turns, *(b for b in BLOCKS if 2 * b <= turns))
    sums = (_summed(part, order, gain, length, FINER if slack else 1) for length in lengths)
    fits = [f for f in (_fitted(s, order * slack) for s in sums) if f is not None]
    if not fits:
        return "too few turns"
    best = max(fits, key=lambda f: f.log_p - math.log10(f.tries))
    size = _lossless(fits)
    return best._replace(tries=best.tries * len(fits), square=size.square, sd=size.sd)


def _lossless(fits: Sequence[_Fit]) -> _Fit:
    """The longest sums that have no less amplitude than shorter ones: an angle that drifts takes it from long sums."""
    for i, f in enumerate(fits[:-1]):
        if f.square >= max(s.square - 0.5 * s.sd for s in fits[i + 1 :]):
            return f
    return fits[-1]


def _summed(part: _Wheel, order: int, gain: FloatArray, length: int, finer: int) -> _Sum:
    """Sums over blocks of `length` turns; the transform over the bins of a block gives the orders beside the whole."""
    place_of = part.place_of
    blocks = int(place_of[-1] // (BINS * length)) + 1
    size = blocks * length * BINS
    w = part.weight * gain
    z = w * part.rest * np.exp(-2j * math.pi * order * part.turns)
    bins = np.bincount(place_of, z.real, size) + 1j * np.bincount(place_of, z.imag, size)
    block = place_of // (BINS * length)
    weight = np.bincount(block, w * gain, blocks)
    speed = np.bincount(block, w * gain * part.mean, blocks)
    k = math.ceil((NULL + order * ORDER_SLACK) * length * finer) + 1
    transform = np.fft.fft(bins.reshape(blocks, length * BINS), length * BINS * finer, axis=1)
    near = np.concatenate([transform[:, -k:], transform[:, : k + 1]], axis=1)
    full = weight > 0.02 * weight.max()
    offset = np.arange(-k, k + 1) / (length * finer)
    return _Sum(weight[full], near[full], offset, speed[full] / weight[full], finer)


def _fitted(sums: _Sum, slack: float) -> _Fit | None:
    """F-type test: power at the order over the mean power at its neighbours."""
    count = sums.weight.size
    each = np.abs(sums.transform) ** 2 / sums.weight[:, None]
    power = each.sum(axis=0)
    off = np.abs(sums.offset)
    beside = each[:, (off >= GUARD + slack) & (off <= NULL + slack)]
    null = beside.sum(axis=0)
    if null.size < 4:
        return None
    noise = float(null.mean()) / count
    # unequal noise of the blocks: fewer degrees of freedom than their number
    wider = max(1.0, 0.5 * float((beside**2).mean()) / max(float(beside.mean()), 1e-300) ** 2)
    at = np.flatnonzero(off <= slack + 1e-9)
    best = int(at[np.argmax(power[at])])
    ratio = float(power[best]) / noise
    below = null.size / sums.finer * count / wider
    x = below * math.log1p(ratio / wider / below)  # exact for one block
    log_p = chi2_log_p(2.0 * x, max(2, round(2.0 * count / wider)))
    total = float(sums.weight.sum())
    square = 4.0 / total * (float(power[best]) - count * noise)
    sd = 4.0 / total * math.sqrt(wider * (count * noise**2 + 0.5 * noise * total * max(square, 0.0)))
    return _Fit(log_p, square, sd, max(1, at.size // 2), sums, best)


def _speed_dependence(part: _Wheel, order: int, gain: FloatArray, best: _Fit) -> tuple[str, float]:
    """How the amplitude differs between thirds of the drive by speed, and the largest; empty if it does not."""
    sums = _summed(part, order, gain, BLOCKS[-1], best.sums.finer)
    at = int(np.argmin(np.abs(sums.offset - best.sums.offset[best.at])))
    by_speed = np.argsort(sums.speed, kind="stable")
    share = np.cumsum(sums.weight[by_speed]) / sums.weight.sum()
    thirds = [by_speed[(share > a) & (share <= b + 1e-12)] for a, b in ((0.0, 1 / 3), (1 / 3, 2 / 3), (2 / 3, 1.0))]
    if min(t.size for t in thirds) < 2:
        return "", math.nan
    offset = sums.offset - sums.offset[at]
    parts = (sums._replace(weight=sums.weight[i], transform=sums.transform[i], offset=offset) for i in thirds)
    fits = [f for f in (_fitted(p, 0.0) for p in parts) if f is not None]
    if len(fits) < len(thirds):
        return "", math.nan
    square, sd = (np.array([getattr(f, n) for f in fits]) for n in ("square", "sd"))
    square = np.maximum(square, 0.0)
    speeds = [float(sums.weight[i] @ sums.speed[i] / sums.weight[i].sum()) for i in thirds]
    middle = float((square / sd**2).sum() / (1.0 / sd**2).sum())
    log_p = chi2_log_p(float((((square - middle) / sd) ** 2).sum()), 2)
    low, high = int(np.argmin(square)), int(np.argmax(square))
    apart = max(speeds[high], speeds[low]) >= APART * min(speeds[high], speeds[low])
    if not apart or log_p < UNEQUAL_LOG_P or square[high] < UNEQUAL**2 * square[low]:
        return "", math.nan
    most, least = math.sqrt(square[high]), math.sqrt(square[low])
    turns = [speeds[i] / (2.0 * math.pi) for i in (high, low)]
    return f"{most:.2%} at {turns[0]:.1f} turns a second and {least:.2%} at {turns[1]:.1f}", most


def _held(x: FloatArray) -> int:
    """For how many samples a value is repeated: a slow bus on a fast grid; 1 if it is not."""
    changes = np.flatnonzero(np.diff(np.nan_to_num(x, nan=0.0)) != 0.0) + 1
    if changes.size < LEAST_CHANGES:
        return 1
    for h in range(MOST_HELD, 1, -1):
        if np.bincount(changes % h, minlength=h).max() >= IN_STEP * changes.size:
            return h
    return 1


def _scatter(rest: FloatArray, dt: float) -> FloatArray:
    """Robust standard deviation over blocks of a second, smoothed over three: (m,)."""
    k = max(4, round(1.0 / dt))
    m = max(rest.size // k, 1)
    blocks = rest[: m * k].reshape(m, -1) if rest.size >= k else rest[None]
    sd = np.median(np.abs(blocks), axis=1) / 0.6745
    sd = np.maximum(sd, 0.25 * np.median(sd))
    sd = np.convolve(np.pad(sd, 1, mode="edge"), np.ones(3) / 3.0, "valid")
    return np.asarray(np.interp(np.arange(rest.size), (np.arange(m) + 0.5) * k, sd))


def _step(x: FloatArray) -> float:
    """Step of a quantised signal; next to nothing of one that is not."""
    change = np.abs(np.diff(x))
    change = change[np.isfinite(change) & (change > 1e-9)]
    return float(np.quantile(change, 0.01)) if change.size else 0.0
