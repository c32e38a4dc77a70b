"""What the loggers saw: edges of tone rings, an accelerometer on a pitching body, messages with stamps of their own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from aqualog.core.compiled import compiled

from .car import Car, gradients
from .driver import ROWS

__all__ = [
    "NOISES", "WHEELS", "Error", "Message", "coloured", "edges", "gusts", "hardly_read", "ideal", "measure",
    "misread",
]  # fmt: skip

DT = 0.01
G = 9.81
TEETH = 48
WHEELS = ("fl", "fr", "rl", "rr")
NOISES = ("white", "ou01", "ou1", "ou5", "pink", "student", "gusts", "quantised")
TAU = {"ou01": 0.1, "ou1": 1.0, "ou5": 5.0}  # [s]
# message: rate [Hz] to draw from, signals
BUS: Mapping[str, tuple[tuple[float, ...], tuple[str, ...]]] = {
    "esc": ((100.0, 100.0, 50.0), ("a_x", "a_y", "yaw_rate")),
    "steering": ((100.0,), ("steer_angle",)),
    "wheels": ((100.0,), tuple(f"omega_{w}" for w in WHEELS)),
    "powertrain": ((50.0, 100.0), tuple(f"torque_{w}" for w in WHEELS)),
    "gnss": ((20.0, 50.0, 10.0), ("v_x",)),
}
UNITS = {
    "a": "m/s^2",
    "yaw": "rad/s",
    "steer": "rad",
    "omega": "rad/s",
    "torque": "N*m",
    "v": "m/s",
    "water": "m",
    "on": "",
}
RMS = {"a": 0.04, "yaw": 1.5e-3, "steer": 4e-4, "omega": 0.012, "torque": 4.0, "v": 0.03}
SHARE = {"a": 1.0, "yaw": 0.3, "steer": 0.2, "omega": 0.2, "torque": 0.4, "v": 0.5}  # of the variance that is coloured
STEP = {"a": 0.005, "yaw": 2e-4, "steer": 1e-4, "omega": 0.004, "torque": 0.5, "v": 0.003}
COARSE = {"a": 0.03, "yaw": 1e-3, "steer": 4e-4, "omega": 0.028, "torque": 4.0, "v": 0.02}
STAMP_SD = 1e-3  # [s] what is left of a message's latency when the logger has corrected it
LEAK_SD, BIAS_SD = 1.5e-3, 8e-3  # accelerometer after its own correction: relative, [m/s^2]


class Error(NamedTuple):
    """Hidden errors of a signal: gain (1 + by_speed (v - 15)) x + bias + drift t, late; of a wheel speed the ring as well.

    `by_torque`: relative reading per square of the wheel's torque in kN m. `square`: added per square of the signal.
    `shake`: added at a speed [m/s], half of it so much beside that [m/s]. `tip`: added with the sign of the lateral
    acceleration that was last beyond so much [m/s^2]. `dead`: of the signal, below which it is hardly read.
    `pulse`: relative, up and down over a period [s] from a phase on [rad]. `lean`: added per kN m of all pull.
    `arm`: taken off per square of the yaw rate [m]. `fresh`: added at the start, and the time in which it goes [s].
    `missed`: share of a wheel's teeth that is not seen below a speed and its width [m/s].
    """

    gain: float = 1.0
    bias: float = 0.0
    drift: float = 0.0
    delay: float = 0.0
    skew: float = 0.0  # [ppm]
    by_speed: float = 0.0
    by_torque: float = 0.0
    ring: float = 0.0
    square: float = 0.0
    shake: tuple[float, float, float] = (0.0, 20.0, 2.0)
    tip: tuple[float, float] = (0.0, 0.5)
    dead: float = 0.0
    pulse: tuple[float, float, float] = (0.0, 30.0, 0.0)
    lean: float = 0.0
    arm: float = 0.0
    fresh: tuple[float, float] = (0.0, 30.0)
    missed: tuple[float, float, float] = (0.0, 6.0, 0.7)


class Message(NamedTuple):
    """Signals (n,) with common stamps [s]."""

    name: str
    t: np.ndarray
    columns: Mapping[str, np.ndarray]


def coloured(kind: str, n: int, dt: float, rng: np.random.Generator) -> np.ndarray:
    """Noise (n,) of unit variance: `white`, `ou01`, `ou1`, `ou5`, `pink`, `student`; other kinds are white."""
    white = rng.standard_normal(n)
    if kind in TAU:
        keep = np.exp(-dt / TAU[kind])
        return lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], white, zi=[keep * rng.standard_normal()])[0]
    if kind == "student":
        return rng.standard_t(3.5, n) * np.sqrt(1.5 / 3.5)
    if kind == "pink":  # a sum of relaxations, three an octave apart by four
        parts = [_relaxed(dt, tau, n, rng) for tau in (0.02, 0.08, 0.32, 1.28, 5.12, 20.5)]
        return np.sum(parts, axis=0) / np.sqrt(len(parts))
    return white


def _relaxed(dt: float, tau: float, n: int, rng: np.random.Generator) -> np.ndarray:
    keep = np.exp(-dt / tau)
    x = np.sqrt(1.0 - keep**2) * rng.standard_normal(n)
    return lfilter([1.0], [1.0, -keep], x, zi=[keep * rng.standard_normal()])[0]


def gusts(kind: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """Wind along the road (n,) [m/s]: a breath always, gusts if asked for."""
    size = 1.5 if kind == "gusts" else 0.1
    return size * _relaxed(DT, 3.0, n, rng)


def ideal(rows: np.ndarray, car: Car, errors: Mapping[str, Error], rng: np.random.Generator) -> list[Message]:
    """The same without noise, steps, teeth and stamps that are off: but for the hidden errors, all is seen as it is."""
    return _messages(rows, car, errors, None, rng)


def measure(
    rows: np.ndarray, car: Car, errors: Mapping[str, Error], noise: str, rng: np.random.Generator
) -> list[Message]:
    """Messages of a drive, with a noise of `NOISES`."""
    return _messages(rows, car, errors, noise, rng)


def _messages(rows, car, errors, noise, rng):
    n = rows.shape[0]
    middle = (np.arange(n) + 0.5) * DT
    phases = rng.uniform(0.0, 2.0 * np.pi, 4)
    truth = _truth(rows, car, errors, phases, noise, rng)
    slow = 1.0 + (2e-3 * _relaxed(DT, 20.0, n, rng) if noise else 0.0)  # of all torques together
    out = []
    for name, (rates, signals) in BUS.items():
        rate = 100.0 if noise is None else float(rng.choice(rates))
        offset = 0.0 if noise is None else STAMP_SD * rng.standard_normal()
        t = middle if noise is None else np.arange(1, round(n * DT * rate) - 1) / rate + rng.uniform(0.0, 0.5 / rate)
        columns = {}
        for symbol in signals:
            stem = symbol.split("_")[0]
            e = errors.get(symbol, Error())
            x = truth[symbol] * (slow if stem == "torque" else 1.0)
            v, yaw = rows[:, ROWS["v_x"]], rows[:, ROWS["yaw_rate"]]
            torque = rows[:, ROWS["torque_fl"] :][:, :4].sum(axis=1)
            x = misread(x, e, v, torque, yaw) + e.tip[0] * _last_side(rows[:, ROWS["a_y"]], e.tip[1])
            if e.dead != 0.0:
                x = hardly_read(x, e.dead)
            x = x * (1.0 + e.pulse[0] * np.tanh(3.0 * np.sin(2.0 * np.pi * middle / e.pulse[1] + e.pulse[2])))
            when = t / (1.0 + e.skew * 1e-6) - e.delay + offset
            x = CubicSpline(middle, x)(np.clip(when, middle[0], middle[-1]))
            x = e.gain * x + e.bias + e.drift * t + e.fresh[0] * np.exp(-t / e.fresh[1])
            if noise is not None:
                share = SHARE[stem]
                white = rng.standard_normal(t.size)
                colour = coloured(noise, t.size, 1.0 / rate, rng)
                x = x + RMS[stem] * (np.sqrt(1.0 - share) * white + np.sqrt(share) * colour)
                step = COARSE[stem] if noise == "quantised" else STEP[stem]
                x = np.floor(x / step + 0.5) * step
            columns[symbol] = x
        out.append(Message(name, t, columns))
    return out


def misread(x, e, v, torque=0.0, yaw=0.0):
    """A signal as its error has it by the speed, by its own square, by the torque of all wheels and by the yaw rate."""
    x = x * (1.0 + e.by_speed * (v - 15.0)) + e.square * x * x
    x = x + e.shake[0] / (1.0 + ((v - e.shake[1]) / e.shake[2]) ** 2)
    return x + e.lean * np.maximum(torque / 1e3, 0.0) - e.arm * yaw * yaw


def hardly_read(x, dead):
    """A signal of which little is read below a size."""
    return -x * np.expm1(-((x / np.maximum(dead, 1e-9)) ** 2))


def _last_side(x: np.ndarray, threshold: float) -> np.ndarray:
    """Sign (n,) of what was last beyond the threshold, nought before the first."""
    last = np.maximum.accumulate(np.where(np.abs(x) > threshold, np.arange(x.size), -1))
    return np.where(last < 0, 0.0, np.sign(x[last]))


def _truth(rows, car, errors, phases, noise, rng):
    """Signals (n,) before the bus, in the middle of each sample."""
    x = {s: rows[:, ROWS[s]] for s in ("yaw_rate", "steer_angle")}
    x["v_x"] = rows[:, ROWS["v_x"]] + 1.0 * rows[:, ROWS["pitch_rate"]]  # an antenna on the roof
    pitch, roll = gradients(car)
    leak = LEAK_SD * rng.standard_normal(2) if noise else np.zeros(2)
    bias = BIAS_SD * rng.standard_normal(2) if noise else np.zeros(2)
    for i, (symbol, tilt) in enumerate((("a_x", pitch), ("a_y", roll))):
        felt = rows[:, ROWS[symbol]]
        keep = np.exp(-DT / 0.12)
        slow = lfilter([1.0 - keep], [1.0, -keep], felt, zi=[keep * felt[0]])[0]
        x[symbol] = felt - slow * (G * tilt / (1.0 + G * tilt)) + leak[i] * felt + bias[i]
    for i, w in enumerate(WHEELS):
        e = errors.get(f"omega_{w}", Error())
        torque = rows[:, ROWS[f"torque_{w}"]]
        omega, angle = rows[:, ROWS[f"omega_{w}"]], rows[:, ROWS[f"angle_{w}"]]
        if noise:
            angle = angle - e.ring * np.cos(angle + phases[i])
            omega = edges(angle, 2e-3 * rng.standard_normal(TEETH))
        else:
            omega = omega * (1.0 + e.ring * np.sin(angle + phases[i]))
        unseen = e.missed[0] * 0.5 * (1.0 - np.tanh((rows[:, ROWS["v_x"]] - e.missed[1]) / e.missed[2]))
        x[f"omega_{w}"] = omega * (1.0 + e.by_torque * (torque / 1e3) ** 2) * (1.0 - unseen)
        keep = np.exp(-DT / 0.012)
        lagged = lfilter([1.0 - keep], [1.0, -keep], torque)
        # the estimate comes late by its filter, and the logger knows by how much
        x[f"torque_{w}"] = (lagged if noise is None else _earlier(lagged, 0.012)) / car.torque_gain
        if noise is None:
            x[f"torque_{w}"] = torque / car.torque_gain
    return x


def _earlier(x: np.ndarray, by: float) -> np.ndarray:
    n = np.arange(x.size, dtype=np.float64)
    return np.interp(n + by / DT, n, x)


@compiled
def edges(angle, uneven):
    """Wheel speed (n,) [rad/s] as a control unit has it from the edges of a tone ring.

    In every window of 10 ms it counts the edges, and divides by the time from the last edge of the window before to the
    last one in this. `angle` (n,) [rad] at the windows' beginnings; `uneven` (teeth,) displaced edges, in pitches.
    """
    n = angle.size
    teeth = uneven.size
    pitch = 2.0 * np.pi / teeth
    out = np.zeros(n)
    count = np.floor(angle[0] / pitch)
    last_t, last_count = 0.0, count
    speed = (angle[1] - angle[0]) / DT
    for k in range(n - 1):
        a, b = angle[k], angle[k + 1]
        t = -1.0
        while b > a:
            nxt = count + 1.0
            place = (nxt + uneven[int(nxt % teeth)]) * pitch
            if place > b:
                break
            t = (k + min(max((place - a) / (b - a), 0.0), 1.0)) * DT
            count = nxt
        if t >= 0.0:
            if last_t > 0.0 and t > last_t:
                speed = (count - last_count) * pitch / (t - last_t)
            last_t, last_count = t, count
        else:
            waited = (k + 1) * DT - last_t
            speed = min(speed, pitch / waited) if waited < 0.4 else 0.0
        out[k] = speed
    out[n - 1] = speed
    return out
