"""Inputs of the simulation without their sensors' noise, which would enter on both sides, in the residual and in the
signature of an effect, and replacements for those that a log lacks."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.model.plant import understeer_gradient
from aqualog.model.tyre import Tyre
from aqualog.physics.kinematics import kinematic_steer_angle
from aqualog.physics.load import G

__all__ = [
    "A_MOST", "BRAKE_PRESSURE", "LEAST_S", "SPEED_S", "V_MIN", "brakes_in_torque", "brakes_unlogged",
    "confirmed_torque", "lasting", "needed_torque", "quiet", "quiet_speed", "quiet_torque", "road_wheel_angle",
    "roll_out", "smooth",
]  # fmt: skip

SPEED_BAND_HZ = (2.0, 4.5)  # there a speed is noise: 0.1 m/s^2 are below 8 mm/s; beyond, slow buses are interpolated
TORQUE_BAND = (0.1, 0.2)  # of the rate at which a torque is sampled: there it is noise, pedals and tyres are slower
LEAST_BAND_HZ = (3.0, 4.5)  # at least
SPEED_S = 1.0  # [s] over which a measured speed is averaged: its noise must not pass for motion
NOT_TORQUE = 15.0  # [N·m] rms of a difference that comes from a sensor, not from the car
NOT_TORQUE_SHARE = 0.05  # of the rms of all wheels
# of the mean power of noise: the spectrum of a mirrored signal is real apart from a phase, and its squares have one
# degree of freedom (D)
MEDIAN = 0.4549
END_S = 1.0  # [s] for the values at the beginning and end of a signal
STANDS_OUT, LEAST_EVENT = 4.0, 10.0  # standard deviations, and [N m] of an axle: braking, not noise
BESIDE_EVENT_S = 0.5  # [s]
SEGMENT_S, NEIGHBOURS = 12.8, 0.3  # stretches whose spectra are averaged, and share of a frequency to either side
SURE_HZ = (0.05, 0.3)  # drivers act there: whatever a torque has there is torque
JUMP_S, JUMPS = 1.0, 25.0  # [s] over which what stands out of a torque is judged, and by how much it must (D)
LATEST_S = 0.3  # that a torque is early or late
SURELY = 2.0  # standard deviations by which a share may be overestimated
WITHIN = (0.5, 1.5)  # of the expected acceleration per torque, which the car must show for the comparison
LOCAL = 9  # frequencies over which a spectrum is smoothed
OVER = 3.0  # multiple of the noise that a frequency needs to pass: one of a thousand passes by chance (D)
STEER_S = 0.5  # [s]
V_MIN = 4.0  # [m/s] below it, creeping, clutch and standstill dominate
A_MOST = 3.0  # [m/s^2] of replaced torque beyond resistance: with more, the simulated car spins in a curve
UNEXPLAINED = 0.8  # [m/s^2] more than a grade of 8 %
IDLE = 0.3  # [m/s^2] nobody drives the car further while braking
OFTEN = 0.01  # share of the driving
LEAST_S = 20.0  # [s] of usable driving
BRAKE_PRESSURE = 0.5e5  # [Pa]
BRAKED = 2.0 * BRAKE_PRESSURE  # [Pa] above what a released brake shows
FRICTION = 0.13  # share of the braking that the pressure explains at most, where the torque holds the brakes (K)


def smooth(x: FloatArray, dt: float, over: float) -> FloatArray:
    """Mean with a raised cosine over some time, centred: it has no delay."""
    k = round(over / dt) | 1
    if k < 3:
        return x
    window = np.hanning(k + 2)[1:-1]
    return np.convolve(np.pad(x, k // 2, mode="edge"), window / window.sum(), "valid")


def lasting(bits: BoolArray, least_s: float, dt: float) -> BoolArray:
    """Samples (n,) of stretches that are true for longer than a time [s]."""
    out = np.zeros(bits.size, dtype=bool)
    edge = np.flatnonzero(np.diff(np.concatenate([[0], bits.astype(np.int8), [0]])))
    for a, b in zip(edge[::2], edge[1::2], strict=True):
        out[a:b] = (b - a) * dt > least_s
    return out


def quiet(x: FloatArray, dt: float, rate_hz: float | None = None) -> FloatArray:
    """A signal (n,) after Wiener's filter [wiener1949]: each frequency weighted by its share above the white noise,
    which is estimated well above the frequencies of drivers' actions. Zero phase: no delay. Unchanged if it is sampled
    too slowly for that. `dt`: step of the grid [s]; `rate_hz`: of the signal on the bus, if slower: lines between
    samples have less noise."""
    rate = min(rate_hz or 1.0 / dt, 1.0 / dt)
    low, high = (max(share * rate, least) for share, least in zip(TORQUE_BAND, LEAST_BAND_HZ, strict=True))
    if 0.5 * rate < high:
        return x
    return _filtered(x, dt, (low, high), lines=1.0 / rate if rate < 0.99 / dt else 0.0)


def quiet_speed(v: FloatArray, dt: float) -> FloatArray:
    """A speed (n,) [m/s] without its noise, which the simulated car would follow, by Wiener's filter and a mean over a
    second; it has no delay."""
    return smooth(_filtered(v, dt, SPEED_BAND_HZ), dt, SPEED_S)


def _filtered(x: FloatArray, dt: float, band_hz: tuple[float, float], lines: float = 0.0) -> FloatArray:
    """The signal with each frequency weighted by its share above the noise of the band; `lines`: time between samples
    that straight lines connect. [s]"""
    n = x.size
    frequency = np.fft.rfftfreq(2 * n, dt)
    band = (frequency > band_hz[0]) & (frequency < band_hz[1])
    if band.sum() <= LOCAL:
        return x
    ends = _ends(x, dt)
    line = np.linspace(*ends, n)
    # mirrored, so that the ends meet
    f = np.fft.rfft(np.concatenate([x - line, -(x - line)[::-1]]))
    power = np.abs(f) ** 2
    noise = float(np.median(power[band] / np.sinc(frequency[band] * lines) ** 4)) / MEDIAN
    local = np.convolve(np.pad(power, LOCAL // 2, mode="edge"), np.full(LOCAL, 1.0 / LOCAL), "valid")
    share = np.maximum(1.0 - OVER * noise / np.maximum(local, 1e-300), 0.0)
    return np.asarray(line + np.fft.irfft(f * share, 2 * n)[:n])


def _ends(x: FloatArray, dt: float) -> tuple[float, float]:
    """Where a signal begins and ends, by lines through its first and last seconds: one noisy sample would be a jump."""
    k = min(max(2, round(END_S / dt)), x.size)
    at = np.arange(k) - 0.5 * (k - 1)
    both = (x[:k], x[::-1][:k])
    begin, end = (float(y.mean()) + float(at @ y) / float(at @ at) * float(at[0]) for y in both)
    return begin, end


def quiet_torque(torque: FloatArray, dt: float, rate_hz: float | None = None) -> FloatArray:
    """Wheel torques (4, n) [N·m] without noise; `rate_hz` as in `quiet`. Left and right of an axle get its mean, unless
    they differ by more than sensors do. Light braking at an undriven axle is torque like any other. Where such an axle
    scatters by less than `NOT_TORQUE`, events that stand out are kept, and the mean replaces the rest."""
    out = np.empty_like(torque)
    driven = 0 if float((torque[:2].sum(axis=0) ** 2).mean()) > float((torque[2:].sum(axis=0) ** 2).mean()) else 2
    total = float(np.sqrt((torque.sum(axis=0) ** 2).mean()))
    least = max(NOT_TORQUE, NOT_TORQUE_SHARE * total)
    for a, b in ((0, 1), (2, 3)):
        both, half = torque[a] + torque[b], 0.5 * (torque[a] - torque[b])
        axle = quiet(both, dt, rate_hz)
        if a != driven and float(both.std()) < NOT_TORQUE:
            axle = _events(axle, dt)
        apart = quiet(half, dt, rate_hz) if float(np.sqrt((half**2).mean())) > least else np.zeros_like(half)
        out[a], out[b] = 0.5 * axle + apart, 0.5 * axle - apart
    return out


def confirmed_torque(torque: FloatArray, a: FloatArray, dt: float, per_torque: float) -> FloatArray:
    """Wheel torques (4, n) [N·m] with each frequency weighted by the share that the car's acceleration confirms: cross
    spectrum over the torque's power, the weight of Wiener's filter [wiener1949]. Around a jump, the share there.

    `a` (n,): measured acceleration, finite, whose own noise does not matter [m/s²]; `per_torque`: acceleration per
    torque of the car of the file, compared at low frequencies only [m/s²/(N·m)]. Unchanged if the drive is too short or
    steady.
    """
    n, size = a.size, round(SEGMENT_S / dt)
    if n < 4 * size:
        return torque
    cut = np.lib.stride_tricks.sliding_window_view(np.array([torque.sum(axis=0), a]), size, axis=1)[:, :: size // 2]
    lines = np.fft.rfft((cut - cut.mean(axis=2, keepdims=True)) * np.hanning(size), axis=2)
    f = np.fft.rfftfreq(size, dt)
    reach, cross = _neighbours((lines[0].conj() * lines[1]).mean(axis=0))
    power, moved = (_neighbours((np.abs(x) ** 2).mean(axis=0))[1].real for x in lines)
    low, most = (f >= SURE_HZ[0]) & (f <= SURE_HZ[1]), f <= LEAST_BAND_HZ[1]
    gain = float(cross[low].real.sum() / max(float(power[low].sum()), 1e-300)) / per_torque
    if not WITHIN[0] <= gain <= WITHIN[1]:
        return torque
    late = np.linspace(-LATEST_S, LATEST_S, 61)
    turns = np.exp(2j * np.pi * np.outer(late, f))
    lag = int(np.argmax((turns * np.where(most, cross, 0.0)).real.sum(axis=1)))
    # what is sure: torque that is left out is lost, noise that is left in becomes an effect
    coherence = np.clip(np.abs(cross) ** 2 / np.maximum(power * moved, 1e-300), 0.0, 1.0)
    unsure = np.sqrt((1.0 - coherence) * moved * power / (lines.shape[1] * (2.0 * reach + 1.0)))
    share = ((turns[lag] * cross).real - SURELY * unsure) / np.maximum(power, 1e-300) / (gain * per_torque)
    share = np.where(f <= SURE_HZ[1], 1.0, np.clip(share, 0.0, 1.0))
    both = np.concatenate([torque, a[None]])
    ends = np.array([_ends(x, dt) for x in both])
    line = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * np.linspace(0.0, 1.0, n)
    mirrored = np.concatenate([both - line, (line - both)[:, ::-1]], axis=1)
    weights = np.interp(np.fft.rfftfreq(2 * n, dt), f, share)
    sure = line + np.fft.irfft(np.fft.rfft(mirrored, axis=1) * weights, 2 * n, axis=1)[:, :n]
    left = torque - sure[:4]
    answer = np.roll(a - sure[4], -round(float(late[lag]) / dt)) / (gain * per_torque)
    return np.asarray(sure[:4] + _answered(left.sum(axis=0), answer, dt) * left)


def _answered(x: FloatArray, answer: FloatArray, dt: float) -> FloatArray:
    """The share of what is left of a torque that the car's `answer` confirms around each sample, where it stands out
    there: a jump, which no filter of frequencies follows, is not noise. (n,)"""
    local = smooth(x * x, dt, JUMP_S)
    stands_out = local > JUMPS * float(np.median(local))
    share = smooth(x * answer, dt, JUMP_S) / np.maximum(local, 1e-300)
    return np.where(stands_out, np.clip(share, 0.0, 1.0), 0.0)


def _neighbours(x: NDArray[np.complex128] | FloatArray) -> tuple[NDArray[np.intp], NDArray[np.complex128]]:
    """Number of neighbours to either side, and means over these frequencies. (F,)"""
    k = np.arange(x.size)
    reach = np.minimum((NEIGHBOURS * k).astype(np.intp), np.minimum(k, x.size - 1 - k))
    total = np.concatenate([[0.0], np.cumsum(x)])
    return reach, np.asarray((total[k + reach + 1] - total[k - reach]) / (2.0 * reach + 1.0), dtype=np.complex128)


def _events(x: FloatArray, dt: float) -> FloatArray:
    """A torque where it exceeds its own scatter, with the samples next to it; elsewhere the mean of the rest."""
    off = np.abs(x - np.median(x))
    out = off > max(STANDS_OUT * 1.4826 * float(np.median(off)), LEAST_EVENT)
    out = np.convolve(out, np.ones(2 * round(BESIDE_EVENT_S / dt) + 1), "same") > 0.5
    return np.where(out, x, x[~out].mean() if not out.all() else 0.0)


def roll_out(v: FloatArray, vehicle: Vehicle) -> FloatArray:
    """How fast the car of the file slows down on a flat dry road without torque. (n,) [m/s] to [m/s²], positive"""
    drag = 0.5 * vehicle.air_density * vehicle.drag_area * v * v / vehicle.mass
    return drag + G * vehicle.rolling_resistance


def needed_torque(v: FloatArray, vehicle: Vehicle, dt: float) -> FloatArray:
    """Torque at the driven wheels that the car of the file needs for a speed on a flat road, at most for `A_MOST`. (4,
    n) [N·m], >= 0: brakes are on all wheels, and one axle alone would lock at their deceleration."""
    inertia = np.gradient(smooth(v, dt, SPEED_S), dt)
    force = vehicle.mass * np.maximum(np.minimum(inertia, A_MOST) + roll_out(v, vehicle), 0.0)
    rear = {"rwd": 1.0, "fwd": 0.0}.get(vehicle.drivetrain, vehicle.torque_split_rear)
    return np.array([0.5 * (rear if w[0] == "r" else 1.0 - rear) * force * vehicle.arm(w) for w in WHEELS])


def road_wheel_angle(
    columns: Mapping[str, FloatArray], v: FloatArray, vehicle: Vehicle, dt: float, *, most: float
) -> FloatArray:
    """Angle of the front wheels (n,), left positive [rad], measured or computed from the gyro with the model; `most`:
    lateral acceleration beyond which it is cut, because the simulated car could spin [m/s²]."""
    understeer = understeer_gradient(Tyre().cornering_slope)
    if "steer_angle" in columns:
        angle = columns["steer_angle"]
    elif "yaw_rate" in columns:
        rolling = kinematic_steer_angle(columns["yaw_rate"], v, wheelbase=vehicle.wheelbase)
        angle = rolling + understeer * v * columns["yaw_rate"]
    else:
        return np.zeros_like(v)
    limit = most * (vehicle.wheelbase / np.maximum(v, V_MIN) ** 2 + understeer)
    return smooth(np.clip(angle, -limit, limit), dt, STEER_S)


def brakes_in_torque(pressure: FloatArray, torque: FloatArray, v: FloatArray, vehicle: Vehicle, dt: float) -> bool:
    """Whether the torque (4, n) holds the brakes: beside it, the pressure explains little of the braking. Both shares
    are fitted: an engine drags with 300 N·m and more, a motor that only helps the brakes with 1500."""
    moving = v > V_MIN
    braked = (pressure > BRAKED) & moving
    if braked.sum() < 10:
        return True
    slowed = -(_acceleration(v, dt) + roll_out(v, vehicle)) * vehicle.arm("fl") * vehicle.mass
    pressed = np.where(braked, pressure, 0.0)
    held, applied = (smooth(smooth(x, dt, SPEED_S), dt, SPEED_S) for x in (-torque.sum(axis=0), pressed))
    shapes = np.stack([held, applied, np.ones_like(held)])[:, moving]
    share = np.linalg.lstsq(shapes.T, slowed[moving], rcond=None)[0][1] * float(pressure[braked].mean())
    return bool(share < FRICTION * float(slowed[braked].mean()))


def _acceleration(v: FloatArray, dt: float) -> FloatArray:
    return smooth(np.gradient(smooth(v, dt, SPEED_S), dt), dt, SPEED_S)


def brakes_unlogged(torque: FloatArray, v: FloatArray, wet: BoolArray, vehicle: Vehicle, dt: float) -> bool:
    """Whether the car often slows down much more than torque and resistance explain off the water, so by braking. One
    that speeds up less than its torque says pulls a trailer, or has another gain."""
    a = _acceleration(v, dt)
    driven = smooth(torque.sum(axis=0), dt, SPEED_S) / (vehicle.arm("fl") * vehicle.mass)
    moving = (v > V_MIN) & ~wet
    if moving.sum() * dt < LEAST_S:
        return False
    braked = (a < driven - roll_out(v, vehicle) - UNEXPLAINED) & (a < 0.0) & (driven < IDLE)
    return bool((braked & moving).sum() > OFTEN * moving.sum())
