"""Sensors and buses of a series car: the signals that a logger records of a simulated drive."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from aqualog.core.compiled import compiled
from aqualog.core.notation import SYMBOLS, WHEELS
from aqualog.core.records import FloatArray
from aqualog.model.pickup import edge_times, reported_speed, ring_angles, rolled_angle

__all__ = [
    "ESC", "FAULT_KINDS", "IDEAL", "SENSORS", "Channel", "FaultKind", "Group", "Measured", "SensorFault", "Sensors",
    "Truth", "measure", "of_place", "with_faults",
]  # fmt: skip

SNAP = 1e-6  # [grid steps] a time this close to a point of the fine grid is that point


@dataclass(frozen=True, slots=True)
class Truth:
    """A simulated drive without sensors: `t` (n,) [s] on an even fine grid from 0, and columns (n,) by name, SI.

    Holds every canonical signal that the simulation knows, `angle_fl` ... `angle_rr` (wheel rotation from the start,
    rad), and names that begin with `true_`.
    """

    t: FloatArray
    columns: Mapping[str, FloatArray]


@dataclass(frozen=True, slots=True)
class Measured:
    """Signals of one bus message or sensor: they share time stamps `t` (m,) [s]; columns (m,) by canonical name."""

    name: str
    t: FloatArray
    columns: Mapping[str, FloatArray]


@dataclass(frozen=True, slots=True)
class Channel:
    """How one signal is measured; all zero (gain 1) is a perfect sensor. SI units of the signal.

    `noise` rms; `resolution` step of the bus signal; `lag_s` first-order low-pass; `latency_s` value sampled at t bears
    the stamp t + latency; `gain_spread`, `offset_spread`, `drift_spread` [1/s]: rms of the random values of a run.
    `gain`, `bias`, `drift` [1/s] and `delay_s` are set, not random: terms of a model act on them. `pitching` [s²]: what
    the rate of `a_x` adds, as an antenna on the roof of a car that pitches has it for the velocity. `ahead` [m]: how
    far the accelerometer sits ahead of the centre of gravity: with the yaw rate r its a_x has -ahead r^2 besides, its
    a_y +ahead dr/dt.
    """

    noise: float = 0.0
    resolution: float = 0.0
    lag_s: float = 0.0
    latency_s: float = 0.0
    gain_spread: float = 0.0
    offset_spread: float = 0.0
    drift_spread: float = 0.0
    gain: float = 1.0
    bias: float = 0.0
    drift: float = 0.0
    delay_s: float = 0.0
    pitching: float = 0.0
    ahead: float = 0.0


@dataclass(frozen=True, slots=True)
class Group:
    """Signals that travel together, at `rate_hz` (None: the scenario's sample rate); `skew_ppm` its clock runs fast.

    `one_draw`: gain, offset and drift are drawn once for the group, not per signal, because all its signals come from
    one estimate: an engine's torque with an error of 2 % has this error at each wheel.
    """

    name: str
    signals: tuple[str, ...]
    rate_hz: float | None = None
    skew_ppm: float = 0.0
    one_draw: bool = False


@dataclass(frozen=True, slots=True)
class Sensors:
    """A set of sensors: groups of signals, the channel of each (missing: perfect), and the wheel-speed pick-ups."""

    name: str
    groups: tuple[Group, ...]
    channels: Mapping[str, Channel] = field(default_factory=dict)
    teeth: int = 0  # per turn; 0: the wheel speed itself
    tooth_jitter: float = 0.0  # rms of an edge, in tooth pitches
    tooth_pattern: float = 0.0  # rms of the fixed pitch error, in tooth pitches
    tone_ring: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)  # once-per-turn speed error, relative amplitude
    faults: tuple[SensorFault, ...] = ()

    def with_channel(self, signal: str, channel: Channel) -> Sensors:
        """Return the same with another channel."""
        return replace(self, channels={**self.channels, signal: channel})


def measure(truth: Truth, sensors: Sensors, *, rate_hz: float, seed: int) -> list[Measured]:
    """Return the records of a logger for a drive.

    Parameters
    ----------
    truth : Truth
        At least two points; finite.
    rate_hz : float
        Rate of groups without one of their own, and of the truth. [Hz]
    seed : int
        Seed of all draws, >= 0. Each signal has streams of its own: a change of one leaves the others unchanged.

    Returns
    -------
    groups : list of Measured
        In the order of `sensors.groups`, without signals that the truth lacks and without empty groups. Last the
        group "truth" with the columns `true_*`, which no sensor changes.

    Per signal: lag, value at (sample time - latency - delay), gain, bias, drift over the time since the start, noise,
    rounding. Limits: before the start the first value is held; states (`on_water`, `gear`) have latency and delay only
    and are never interpolated; the noise is white and does not pass the lag; a perfect channel gives the samples of
    the truth bit for bit at times of the fine grid.
    """
    places: dict[tuple[float, float, float], _Places] = {}  # most signals are sampled at the same times

    def seen_at(rate: float, channel: Channel) -> _Places:
        key = (rate, channel.latency_s, channel.delay_s)
        if key not in places:
            places[key] = _places(truth, _sample_times(truth, rate) - channel.latency_s - channel.delay_s)
        return places[key]

    groups = [_measure_group(truth, sensors, g, g.rate_hz or rate_hz, seed, seen_at) for g in sensors.groups]
    exact = seen_at(rate_hz, Channel())
    names = [n for n in truth.columns if n.startswith("true_")]
    known = {n: exact.of(_column(truth, n), held=_is_state(truth, n)) for n in names}
    return [g for g in (*groups, Measured("truth", _sample_times(truth, rate_hz), known)) if g.columns]


def _measure_group(truth: Truth, sensors: Sensors, group: Group, rate_hz: float, seed: int, seen_at: _Seen) -> Measured:
    at = _sample_times(truth, rate_hz)
    columns = {}
    for name in group.signals:
        if name not in truth.columns:
            continue
        channel = sensors.channels.get(name, Channel())
        if _is_state(truth, name):
            x = seen_at(rate_hz, channel).of(_column(truth, name), held=True)
            columns[name] = with_faults(x, at, sensors.faults, names=(name, group.name))
            continue
        if name in _OMEGA and sensors.teeth > 0:
            # the controller's filter runs at the rate of its reports
            edges = _picked_up(truth, sensors, name, at - channel.latency_s - channel.delay_s, 1.0 / rate_hz, seed)
            x = _lagged(edges, channel.lag_s, 1.0 / rate_hz)
        else:
            x = seen_at(rate_hz, channel).of(_lagged(_rolling(truth, sensors, name, seed), channel.lag_s, _step(truth)))
        x = _through(channel, x, at, name, group.name if group.one_draw else name, seed)
        columns[name] = with_faults(x, at, sensors.faults, names=(name, group.name))
    return Measured(group.name, at * (1.0 + group.skew_ppm * 1e-6), columns)


def _through(channel: Channel, x: FloatArray, at: FloatArray, name: str, draw_key: str, seed: int) -> FloatArray:
    """Apply gain, offset, drift, noise and rounding; neutral values are skipped: a perfect channel keeps the bits."""
    is_random = channel.gain_spread != 0.0 or channel.offset_spread != 0.0 or channel.drift_spread != 0.0
    draws = _stream(seed, draw_key, "spread").standard_normal(3) if is_random else np.zeros(3)
    gain = channel.gain * (1.0 + channel.gain_spread * draws[0])
    offset = channel.bias + channel.offset_spread * draws[1]
    drift = channel.drift + channel.drift_spread * draws[2]
    if gain != 1.0:
        x = gain * x
    if offset != 0.0:
        x = x + offset
    if drift != 0.0:
        x = x + drift * at
    if channel.noise > 0.0:
        x = x + channel.noise * _stream(seed, name, "noise").standard_normal(x.size)
    if channel.resolution > 0.0:
        x = np.rint(x / channel.resolution) * channel.resolution
    return x


def _picked_up(truth: Truth, sensors: Sensors, name: str, seen: FloatArray, window: float, seed: int) -> FloatArray:
    """Return the wheel speed of the pick-ups and their controller at the times `seen`."""
    place = _stream(seed, name, "ring")
    phase = place.uniform(0.0, 2.0 * math.pi)
    pattern = sensors.tooth_pattern * place.standard_normal(sensors.teeth)
    ring = ring_angles(pattern, phase=phase, tone_ring=sensors.tone_ring[_OMEGA[name]])
    edges = edge_times(
        truth.t, _angle(truth, name), ring, jitter=sensors.tooth_jitter, rng=_stream(seed, name, "edges"),
        before=max(0.0, -float(seen[0])) + window,
    )  # fmt: skip
    return reported_speed(edges, np.minimum(seen, truth.t[-1]), window=window, teeth=sensors.teeth)


def _rolling(truth: Truth, sensors: Sensors, name: str, seed: int) -> FloatArray:
    """Return a column of the truth at the place of its sensor; a wheel speed with the error of its tone ring, in the
    same phase as with teeth."""
    x = _column(truth, name)
    channel = sensors.channels.get(name, Channel())
    if channel.pitching != 0.0:
        x = x + channel.pitching * np.gradient(_column(truth, "a_x"), _step(truth))
    if channel.ahead != 0.0:
        x = x + channel.ahead * of_place(name, _column(truth, "yaw_rate"), _step(truth))
    amplitude = sensors.tone_ring[_OMEGA[name]] if name in _OMEGA else 0.0
    if amplitude == 0.0:
        return x
    phase = _stream(seed, name, "ring").uniform(0.0, 2.0 * math.pi)
    return x * (1.0 + amplitude * np.sin(_angle(truth, name) + phase))


def of_place(name: str, yaw_rate: FloatArray, dt: float) -> FloatArray:
    """What an accelerometer (`a_x` or `a_y`) one metre ahead of the centre of gravity has besides. (n,) [m/s²]"""
    return np.gradient(yaw_rate, dt) if name == "a_y" else -(yaw_rate**2)


def _angle(truth: Truth, name: str) -> FloatArray:
    angle = name.replace("omega", "angle")
    return _column(truth, angle) if angle in truth.columns else rolled_angle(_column(truth, name), dt=_step(truth))


_Seen = Callable[[float, Channel], "_Places"]  # where a rate and a channel look into the fine grid


class _Places(NamedTuple):
    """Times as places between the rows of a fine grid: the row before, and how far it is on the way to the next."""

    before: npt.NDArray[np.intp]
    share: FloatArray
    is_between: bool

    def of(self, x: FloatArray, *, held: bool = False) -> FloatArray:
        """Return values of a column there; `held`: the value before, else linear between two."""
        if held or not self.is_between:
            return x[self.before]
        i, share = self.before, self.share
        between = x[i] + share * (x[np.minimum(i + 1, x.size - 1)] - x[i])
        return np.where(share > 0.0, between, x[i])


def _places(truth: Truth, at: FloatArray) -> _Places:
    place = np.clip(at / _step(truth), 0.0, truth.t.size - 1.0)
    near = np.rint(place)
    place = np.where(np.abs(place - near) < SNAP, near, place)
    i = place.astype(np.intp)
    share = place - i
    return _Places(i, share, bool(share.any()))


def _lagged(x: FloatArray, tau: float, dt: float) -> FloatArray:
    """First-order low-pass, exact for an input that is linear between its samples, at rest at the start."""
    return _lag(tau / dt, math.exp(-dt / tau), x) if tau > 0.0 else x


@compiled
def _lag(ratio, keep, x):  # type: ignore[no-untyped-def]
    out = np.empty_like(x)
    out[0] = x[0]
    for i in range(1, x.size):
        behind = ratio * (x[i] - x[i - 1])  # of a lasting ramp
        out[i] = x[i] - behind + keep * (out[i - 1] - x[i - 1] + behind)
    return out


def _stream(seed: int, name: str, purpose: str) -> np.random.Generator:
    """Return random numbers of one signal for one purpose; the name's bytes are the key, the same in every process."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=tuple(f"{name}/{purpose}".encode())))


def _sample_times(truth: Truth, rate_hz: float) -> FloatArray:
    """Return times from 0 to before the end, so that a drive of 20 s at 100 Hz has 2000 samples."""
    return np.arange(max(math.ceil(float(truth.t[-1]) * rate_hz - SNAP), 1)) / rate_hz


def _step(truth: Truth) -> float:
    return float(truth.t[-1]) / (truth.t.size - 1)


def _column(truth: Truth, name: str) -> FloatArray:
    return np.ascontiguousarray(truth.columns[name], dtype=np.float64)


def _is_state(truth: Truth, name: str) -> bool:
    return truth.columns[name].dtype.kind in "biu" or (name in SYMBOLS and SYMBOLS[name].kind == "state")


_OMEGA = {f"omega_{w}": i for i, w in enumerate(WHEELS)}
_TORQUE = tuple(f"torque_{w}" for w in WHEELS)

IDEAL = Sensors("ideal", (Group("signals", tuple(SYMBOLS)),))

_KMH = 1.0 / 3.6  # [m/s]
_R_E = 0.317  # [m] of the rim speed on the bus

_WHEEL = Channel(
    resolution=0.0075 * _KMH / _R_E,  # [rad/s] 0.0075 km/h on the bus, V: [opendbc2026], VW ESP_19
    latency_s=0.005,  # [s] K
)
_ACCELERATION = Channel(
    noise=0.06,  # [m/s^2] V: 6 mg rms
    resolution=0.03125,  # [m/s^2] V: opendbc, VW ESP_02
    latency_s=0.010,  # [s] K
    offset_spread=0.05,  # [m/s^2] after the ESC's own zeroing, K; without it 0.2-1.0, V: 20-100 mg
    drift_spread=2e-4,  # [m/s^3] K; 0.2 m/s^2 of short drift (V) in a quarter of an hour
)
_TORQUE_ESTIMATE = Channel(
    noise=2.0,  # [N m] K
    resolution=1.0,  # [N m] K
    lag_s=0.02,  # [s] K
    latency_s=0.010,  # [s] K
    gain_spread=0.02,  # [-] K; axle efficiency alone is 0.95-0.97, V
)
_TIE_ROD = Channel(noise=10.0)  # [N] K

ESC = Sensors(
    "esc",
    (
        Group("wheels", tuple(_OMEGA)),
        Group("esc", ("a_x", "a_y", "yaw_rate"), rate_hz=50.0),  # V: opendbc, VW ESP_02
        Group("drive", _TORQUE, rate_hz=50.0, one_draw=True),  # K
        Group("brake", ("brake_pressure",), rate_hz=50.0),  # K
        Group("steering", ("steer_angle", "steering_torque"), rate_hz=100.0),  # K
        Group("gnss", ("v_x",), rate_hz=20.0),  # K
        Group("tie_rods", ("tie_rod_fl", "tie_rod_fr")),  # test equipment, at the logger's rate
        Group("road", ("on_water", "water_depth_left", "water_depth_right")),  # labels, perfect
    ),
    {
        **dict.fromkeys(_OMEGA, _WHEEL),
        "a_x": _ACCELERATION,
        "a_y": _ACCELERATION,
        "yaw_rate": Channel(noise=2e-3, latency_s=0.010),  # [rad/s], [s] K
        **dict.fromkeys(_TORQUE, _TORQUE_ESTIMATE),
        "brake_pressure": Channel(resolution=0.3e5),  # [Pa] 0.3 bar, V: opendbc, VW ESP
        # [rad] at the road wheel: 0.1 deg of the steering wheel over a ratio of 15, K
        "steer_angle": Channel(noise=5e-4, resolution=math.radians(0.1) / 15.0),
        # [N m] assistance and column; friction of the rack shows as an offset, K
        "steering_torque": Channel(noise=0.1, resolution=0.05, latency_s=0.010, offset_spread=0.2),
        "v_x": Channel(noise=0.02, latency_s=0.1),  # [m/s] V: 2 cm/s (Stanford); [s] V: ms to 0.5 s (race-technology)
        "tie_rod_fl": _TIE_ROD,
        "tie_rod_fr": _TIE_ROD,
    },
    teeth=48,  # V: Toyota, and Gustafsson's ABS log [gustafsson2000]
    tooth_jitter=4.8e-4,  # [pitches] D: 6.8e-4 per cog (V: [gustafsson2000]) is that of two edges
    # [pitches] D: with the jitter 1.1 m/s^2 rms in differences of 10 ms samples; V: 1.0 at 20.6 m/s, D: 1.3 at 27.8 m/s
    tooth_pattern=1e-3,
)

SENSORS: Mapping[str, Sensors] = {"esc": ESC, "ideal": IDEAL}

FaultKind = Literal["missing", "frozen"]
FAULT_KINDS: tuple[FaultKind, ...] = ("missing", "frozen")


@dataclass(frozen=True, slots=True)
class SensorFault:
    """A signal, or all of a bus message by the name of its group, fails from `start_s` to before `end_s`.

    `missing`: no value (NaN); `frozen`: the last value before; without one, missing.
    """

    where: str
    start_s: float
    end_s: float
    kind: FaultKind = "missing"


def with_faults(x: FloatArray, t: FloatArray, faults: Collection[SensorFault], *, names: Collection[str]) -> FloatArray:
    """Put the faults that name a signal (its own name, its group's) into it: signal (n,) at the times t (n,) [s].

    A signal without faults is returned unchanged.
    """
    for fault in faults:
        if fault.where not in names:
            continue
        out = (t >= fault.start_s) & (t < fault.end_s)
        before = int(np.searchsorted(t, fault.start_s)) - 1
        x = np.where(out, x[before] if fault.kind == "frozen" and before >= 0 else np.nan, x)
    return x
