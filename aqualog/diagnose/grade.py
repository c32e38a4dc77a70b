"""The road's profile: a slope angle over position that two channels show independently of each other.

    kinematic                  = g sin(theta(s)) + b    accelerometer minus dv/dt, b its drift
    kinematic - force_balance  = g sin(theta(s)) + w    torque minus dv/dt, w wind and torque error

The velocity is in both, with little slow error. The part that both share over 150 m and more is the road.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.channels import block_step
from aqualog.diagnose.drive import Drive
from aqualog.diagnose.records import Cause, Estimate
from aqualog.model.effects import EMPIRICAL
from aqualog.model.term import Knots, Model, Term
from aqualog.physics.load import G

__all__ = ["HILLY", "Profile", "find_profile", "with_profile"]

BIN_M = 25.0  # [m]
OVER_M = 150.0  # [m] shorter waves are the car's pitching and the driver's pedal
HALF_M = 200.0  # [m] wavelength of which the estimate keeps half
FADES_M = 2000.0  # [m] from data the estimate falls to nothing
# rms of a slope that is named: trips there and back show roads of 1 % alike, though heights in steps of a metre do not
HILLY = 0.01
OFTEN = 0.2  # share of drives on hilly roads (K)
UNSURE = 0.8  # probability on one pass without torque: place and time cannot be distinguished (K)
LEAST = 0.005  # rms of the slope that is worth naming: half of the grade that goes unnoticed on a motorway (K)
LEAST_ALONE = 0.02  # rms without torque and on one pass: 20 mg are an accelerometer's own wander (V, ESC data sheets)
LEAST_BINS = 40
STANDS_OUT = 3.5  # standard deviations of a correlation by chance
SMOOTHED = 0.03  # share of the rms that smoothing may remove or noise may add
LAGS = 50.0  # of a drive that differ, each of which may look like a lap by chance
LAP_LEAST_M, LAP_SIGMAS, LAP_CORRELATION = 500.0, 4.5, 0.7
ALIKE_M = 2000.0  # [m] over which the road's autocorrelation counts
SPEED, GOES_WITH_ACCELERATION = 1, slice(3, None)  # of the shapes of `_motion`
CLIPPED = 5.0  # robust standard deviations
# [m/s^2] mean slope hidden by an offset of the accelerometer (V, ESC), or by 4 m/s of wind and cold tyres (K)
BIAS_SD, FORCE_SD = 0.1, 0.05


@dataclass(frozen=True, slots=True)
class Profile:
    """A hilly road: slope angle `theta` [rad] over the knots `s` [m], (k,) each, uphill positive, without its mean over
    the drive, which could also be the accelerometer's offset. `rms` and `mean` [rad] with 95 % intervals, no mean where
    something else has the constant; `shared`: correlation of the two channels over 150 m, NaN without torque; `lap_m`:
    length after which the road repeats itself, None on one pass; `drive`: its name, of several."""

    s: FloatArray
    theta: FloatArray
    rms: Estimate
    mean: Estimate | None
    p_value: float
    shared: float
    lap_m: float | None
    drive: str = ""

    @property
    def knots(self) -> Knots:
        """Position [m] and slope angle [rad], as a term or a scenario takes them."""
        return tuple(zip(self.s.tolist(), np.clip(self.theta, -0.3, 0.3).tolist(), strict=True))

    @property
    def term(self) -> Term:
        """The profile as a term of a model of this drive."""
        return Term(EMPIRICAL["unexplained_grade"], knots=self.knots, drive=self.drive)

    @property
    def cause(self) -> Cause:
        """The cause that the diagnosis reports."""
        text = f"The road climbs and falls with {self.rms.value:.1%} rms along the way"
        if self.lap_m is not None:
            text += f", and again after {self.lap_m:.0f} m"
        elif not np.isfinite(self.shared):
            text += "; with one pass and no torque, place and time cannot be distinguished"
        where = f" In {self.drive}." if self.drive else ""
        if self.mean is not None and not self.mean.low <= 0.0 <= self.mean.high:
            does = "climbs" if self.mean.value > 0.0 else "falls"
            where = f" On the whole it {does} by {abs(self.mean.value):.1%}.{where}"
        text += f"; 95 % interval {self.rms.low:.1%} to {self.rms.high:.1%}.{where}"
        values = {"grade_rms": self.rms} | ({} if self.mean is None else {"grade_mean": self.mean})
        drives = (self.drive,) if self.drive else ()
        return Cause("road_grade", None, values, ("kinematic",), text, self.probability, drives)

    @property
    def probability(self) -> float:
        """That the road does it: the bound of a p-value's evidence [sellke2001], one drive in five being hilly (K)."""
        if not math.isfinite(self.p_value):
            return UNSURE
        p = max(self.p_value, 1e-300)
        against = -math.e * p * math.log(p) if p < 1.0 / math.e else 1.0
        return 1.0 / (1.0 + against * (1.0 - OFTEN) / OFTEN)


def with_profile(model: Model, profile: Profile) -> Model:
    """The model of a drive with its road, added to a profile that the model already has."""
    for i, t in enumerate(model.terms):
        if t.effect is profile.term.effect and t.drive == profile.drive:
            s = np.unique([x for x, _ in (*t.knots, *profile.knots)])
            both = sum(np.interp(s, *np.array(k).T) for k in (t.knots, profile.knots))
            knots = tuple(zip(s.tolist(), np.clip(both, -0.3, 0.3).tolist(), strict=True))
            return Model((*model.terms[:i], replace(t, knots=knots), *model.terms[i + 1 :]))
    return model.with_term(profile.term)


def find_profile(drive: Drive, residual: FloatArray) -> Profile | None:
    """The slope of the road along a drive, or None if the drive does not show one. `residual` (C, n): of the drive's
    channels under the model at hand [m/s²]. With torque: the part that both channels share, beyond chance and beyond
    0.5 % rms. Without torque: only if a second pass shows the same profile, or beyond 2 % rms."""
    if "kinematic" not in drive.channels:
        return None
    bins = _Bins.of(drive, residual)
    if bins is None:
        return None
    K = bins.smooth(bins.cleaned(bins.kinematic))
    at, (lap, sigmas) = bins.used, _lap(bins, K)
    if bins.force is None:
        rough = float(np.sqrt(np.mean(K[at] ** 2))) / G
        if rough < (LEAST if lap is not None else LEAST_ALONE):
            return None
        z, shared = bins.kinematic, float("nan")
        p = float("nan") if lap is None else min(1.0, LAGS * 0.5 * math.erfc(sigmas / math.sqrt(2.0)))
    else:
        F = bins.smooth(bins.cleaned(bins.force))
        common, shared, score = _together(K, K - F, at)
        if common < (LEAST * G) ** 2 or score < STANDS_OUT:
            return None
        # the accelerometer's drift is in both and cancels; wind and brakes are in the force balance alone
        power = float(np.mean(F[at] ** 2))
        share = min(max(float(np.mean((K * F)[at])) / max(power, 1e-12), 0.0), 1.0)
        z, p = bins.kinematic - share * bins.drift(bins.force), math.erfc(score / math.sqrt(2.0))
    s, theta, half = _estimate(bins, z)
    return Profile(s, theta, _rms(theta, half, bins), _mean(bins), p, shared, lap)


def _rms(theta: FloatArray, half: FloatArray, bins: _Bins) -> Estimate:
    """Rms of the slope over the driven road; its error is correlated over a wavelength of the estimate. [rad]"""
    at = bins.used
    noise = float(np.mean((half[at] / 1.96) ** 2))
    power = float(np.mean((theta[at] - theta[at].mean()) ** 2))
    value = math.sqrt(power)
    count = max(float(at.sum()) * BIN_M / HALF_M, 3.0)
    spread = 1.96 * math.sqrt((4.0 * power * noise + 2.0 * noise**2) / count) / (2.0 * value) + SMOOTHED * value
    return Estimate(value, max(value - spread, 0.0), value + spread, "rad")


@dataclass(frozen=True, slots=True)
class _Bins:
    """Channels as means over 25 m (k,), `weight` (k,) samples in each, `used` where there are any, and the shapes that
    follow the motion (k, q)."""

    kinematic: FloatArray
    force: FloatArray | None
    weight: FloatArray
    used: BoolArray
    motion: FloatArray

    @staticmethod
    def of(drive: Drive, residual: FloatArray) -> _Bins | None:
        good = (drive.mask | drive.settling) & np.isfinite(residual).all(axis=0)
        position = drive.coordinates["position"]
        where = np.floor_divide(np.maximum(position, 0.0), BIN_M).astype(np.intp)
        k = int(where.max()) + 1
        weight = np.bincount(where[good], minlength=k).astype(np.float64)
        if np.count_nonzero(weight) < LEAST_BINS:
            return None

        def mean(x: FloatArray) -> FloatArray:
            return np.asarray(np.bincount(where[good], x[good], minlength=k) / np.maximum(weight, 1.0))

        by_name = {c: mean(_clipped(x, good)) for c, x in zip(drive.channels, residual, strict=True)}
        motion = np.array([mean(x) for x in _motion(drive)]).T
        return _Bins(by_name["kinematic"], by_name.get("force_balance"), weight, weight > 0.0, motion)

    def cleaned(self, x: FloatArray) -> FloatArray:
        """A channel without the part that follows the motion, by least squares."""
        root = np.sqrt(self.weight)
        beta = np.linalg.lstsq(self.motion * root[:, None], x * root, rcond=1e-10)[0]
        return np.asarray(np.where(self.used, x - self.motion @ beta, 0.0))

    def drift(self, x: FloatArray) -> FloatArray:
        """A force balance without the part that follows the speed: wind and drag are no road."""
        v, root = self.motion[:, SPEED : SPEED + 1], np.sqrt(self.weight)[:, None]
        shapes = np.concatenate([self.motion, v * v], axis=1)
        beta = np.linalg.lstsq(shapes * root, x * root[:, 0], rcond=1e-10)[0]
        return np.asarray(x - np.concatenate([v, v * v], axis=1) @ beta[[SPEED, -1]])

    def smooth(self, x: FloatArray) -> FloatArray:
        """Mean with a raised cosine of 150 m half width, over the used bins."""
        window = np.hanning(2 * round(OVER_M / BIN_M) + 1)[1:-1]
        total = np.convolve(x * self.weight, window, "same")
        return np.asarray(np.where(self.used, total / np.maximum(np.convolve(self.weight, window, "same"), 1e-9), 0.0))


def _motion(drive: Drive) -> list[FloatArray]:
    """Offset, speed, acceleration, jerk, their growth over time: shapes of sensors' and the car's errors. (n,) each"""
    v, t = drive.coordinates["v_x"], drive.coordinates["t"] / max(drive.duration_s, 1.0)
    a = np.gradient(v, block_step(drive.dt))
    jerk = np.gradient(a, block_step(drive.dt))
    return [np.ones_like(v), v / 20.0, t, a, jerk, t * a, t * jerk, v / 20.0 * a]


def _clipped(x: FloatArray, good: BoolArray) -> FloatArray:
    middle = float(np.median(x[good]))
    sd = 1.4826 * float(np.median(np.abs(x[good] - middle))) + 1e-9
    return np.clip(x, middle - CLIPPED * sd, middle + CLIPPED * sd)


def _together(K: FloatArray, Y: FloatArray, at: BoolArray) -> tuple[float, float, float]:
    """Covariance, correlation and its distance from zero in standard deviations by Fisher's transform [fisher1921]."""
    k, y = (np.where(at, x - x[at].mean(), 0.0) for x in (K, Y))
    sd = float(k[at].std() * y[at].std())
    covariance = float(np.mean((k * y)[at]))
    if sd == 0.0:
        return 0.0, 0.0, 0.0
    correlation = covariance / sd
    return covariance, correlation, _score(correlation, _independent(k, y, at))


def _score(correlation: float, count: float) -> float:
    return float(np.arctanh(np.clip(correlation, -0.9999, 0.9999)) * np.sqrt(max(count - 3.0, 0.0)))


def _independent(a: FloatArray, b: FloatArray, at: BoolArray) -> float:
    """Effective number of independent samples of two series over position, from their autocorrelation
    [bartlett1946]."""
    n = 2 * at.size
    pairs = np.fft.irfft(np.abs(np.fft.rfft(at.astype(np.float64), n)) ** 2, n)
    own = [np.fft.irfft(np.abs(np.fft.rfft(x, n)) ** 2, n) / np.maximum(pairs, 1.0) for x in (a, b)]
    reach = min(round(ALIKE_M / BIN_M), at.size - 1)
    a, b = (x[: reach + 1] / max(x[0], 1e-30) for x in own)
    both = a * b * np.linspace(1.0, 0.0, reach + 1)
    total = float(both[0] + 2.0 * both[1:].sum())
    return float(at.sum()) / max(total, 2.0 * OVER_M / BIN_M / 2.0)


def _lap(bins: _Bins, K: FloatArray) -> tuple[float | None, float]:
    """Length after which the channel repeats itself along the road [m], and by how many standard deviations; a drifting
    sensor does not repeat."""
    best, found, sigmas = LAP_CORRELATION, None, 0.0
    centred = np.where(bins.used, K - K[bins.used].mean(), 0.0)
    share = _independent(centred, centred, bins.used) / bins.used.sum()
    for lag in range(round(LAP_LEAST_M / BIN_M), K.size // 2 + 1):
        both = bins.used[lag:] & bins.used[:-lag]
        a, b = centred[lag:][both], centred[:-lag][both]
        if both.sum() * share < 8.0 or a.std() == 0.0 or b.std() == 0.0:
            continue
        c = float(np.corrcoef(a, b)[0, 1])
        # the first lap, not a multiple of it
        nearer = found is None or c > best + 0.1 or lag * BIN_M < found + 3.0 * OVER_M
        score = _score(c, float(both.sum()) * share)
        if c > best and nearer and score > LAP_SIGMAS:
            best, found, sigmas = c, lag * BIN_M, score
    return found, sigmas


def _estimate(bins: _Bins, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Penalised slope over position, fitted with the motion's shapes: knots [m], theta, half of its band [rad]."""
    # speed and time would pass for slow waves of the road
    motion = bins.motion[:, GOES_WITH_ACCELERATION]
    k, q = z.size, motion.shape[1]
    weight = bins.weight / max(float(np.median(bins.weight[bins.used])), 1.0)
    D = np.diff(np.eye(k), 2, axis=0)
    stiff = (HALF_M / (2.0 * np.pi * BIN_M)) ** 4
    penalty = stiff * (D.T @ D) + stiff * (2.0 * np.pi * BIN_M / FADES_M) ** 4 * np.eye(k)
    A = np.concatenate([np.eye(k), motion], axis=1) * np.sqrt(weight)[:, None]
    P = np.zeros((k + q, k + q))
    P[:k, :k] = penalty
    P[k:, k:] = 1e-9 * np.eye(q)
    inverse = np.linalg.inv(A.T @ A + P)
    x = inverse @ (A.T @ (z * np.sqrt(weight)))
    left = np.where(bins.used, z - x[:k] - motion @ x[k:], 0.0)
    # smoothing once more removes about as much as smoothing did the first time
    bias = x[:k] - np.linalg.solve(np.diag(weight) + penalty, weight * x[:k])
    variance = np.diag(inverse @ (A.T @ A) @ inverse)[:k] * float(np.mean(left[bins.used] ** 2))
    theta: FloatArray = x[:k] / G
    theta = theta - float(np.average(theta, weights=bins.weight))
    s: FloatArray = (np.arange(k, dtype=np.float64) + 0.5) * BIN_M
    return s, theta, (1.96 * np.sqrt(np.maximum(variance, 0.0)) + np.abs(bias)) / G


def _mean(bins: _Bins) -> Estimate:
    """Mean slope from both channels, weighted by their possible offsets. [rad]"""
    kinematic = float(np.average(bins.kinematic, weights=bins.weight))
    looks: list[tuple[float, float]] = [(kinematic, BIAS_SD)]
    if bins.force is not None:
        looks.append((kinematic - float(np.average(bins.force, weights=bins.weight)), FORCE_SD))
    precision = math.fsum(1.0 / (sd * sd) for _, sd in looks)
    value = math.fsum(x / (sd * sd) for x, sd in looks) / precision / G
    half = 1.96 / math.sqrt(precision) / G
    return Estimate(value, value - half, value + half, "rad")
