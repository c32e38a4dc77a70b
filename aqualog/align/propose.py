"""Propose a signal map for a log with names of its own.

A name suggests which signal a channel may be, and its unit rules out wrong ones. The data decide among the rest: an
accelerometer must follow the derivative of the speed, a yaw rate the course or the difference of the wheel speeds.
Where a file gives no units, range and motion give them (`guess_units`, `evidence`).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from aqualog.align.evidence import CHECKS, Known, Proposal, quantity_of, settle_by_range, speed_unit, to_si, with_unit
from aqualog.align.guess_units import CHOICES, by_range
from aqualog.align.mapping import Entry, channel_id
from aqualog.align.motion import Motion, derivative, even_times, fit, on_grid, smooth, track, wheel_turn
from aqualog.align.mounting import gyro_beside, turned_axes
from aqualog.align.overview import ChannelOverview, overview, rotated_triples
from aqualog.align.timebase import without_copies
from aqualog.core.notation import ACCEPTED, SYMBOLS, WHEELS
from aqualog.core.records import Channel, FloatArray, TimeArray
from aqualog.core.units import is_unit, parse_unit

__all__ = ["CANONICAL", "NOT_A_VALUE", "Look", "Proposal", "look_at", "propose_map", "words_of"]


CANONICAL = "its canonical name"
"""Reason of a proposal that needs no map."""

_POSITIONS = {
    "fl": ("fl", "vl", "lf", "front left", "left front", "vorne links", "frontleft", "leftfront"),
    "fr": ("fr", "vr", "rf", "front right", "right front", "vorne rechts", "frontright", "rightfront"),
    "rl": ("rl", "hl", "lr", "rear left", "left rear", "hinten links", "rearleft", "leftrear"),
    "rr": ("rr", "hr", "rear right", "right rear", "hinten rechts", "rearright", "rightrear"),
}
NOT_A_VALUE = {
    "fault", "valid", "status", "qbit", "counter", "checksum", "crc", "flag", "state", "error", "quality", "accuracy",
    "offset", "sensor", "max", "min", "req", "request", "requested", "target", "displayed", "init", "initializing",
    "alive", "cnt", "lockout", "parity", "encoder",
}  # fmt: skip
"""Words of channels about a signal, a message or a wish, which hold no measured value."""


@dataclass(frozen=True, slots=True)
class _Rule:
    """One of `words` in the name and a unit of `dimensions` ("" = none given); `bonus` words raise the score."""

    symbol: str
    words: tuple[str, ...]
    dimensions: tuple[str, ...]
    bonus: tuple[str, ...] = ()
    never: tuple[str, ...] = ()
    fallback_unit: str = ""
    may_rest: bool = False  # constant in many a drive, as a brake that nobody treads on


class _OfWheels(NamedTuple):
    """A quantity of several wheels: words in the name, or a part of the path, and words for each position."""

    quantity: str
    words: tuple[str, ...]
    dimensions: tuple[str, ...]
    positions: Mapping[str, tuple[str, ...]]


_WHEEL_WORDS = ("wheel", "whl", "rad", "radgeschw", "radgeschwindigkeit", "raddrehzahl", "wss", "ws", "omega", "wspd")
_TORQUE_WORDS = ("torque", "trq", "moment", "tq")
_AXLE_WORDS = (*_TORQUE_WORDS, "achsmoment")
_SIDES = {"fl": ("left", "links", "l", "li"), "fr": ("right", "rechts", "r", "re")}
_OF_WHEELS = (
    _OfWheels("omega", _WHEEL_WORDS, ("speed", "angular_speed"), _POSITIONS),
    _OfWheels("torque", _TORQUE_WORDS, ("torque",), _POSITIONS),
    _OfWheels("pressure", ("tire", "tyre", "tpms", "reifen"), ("pressure",), _POSITIONS),
    _OfWheels("tie_rod", ("spurstange", "spurstangenkraft", "tie rod", "tierod"), ("force",),
              {w: (*_POSITIONS[w], *more) for w, more in _SIDES.items()}),
)  # fmt: skip
_STATES = 5  # values of a switch or a state, at most
_SEEN = 5000  # samples that are looked at for their number of values
_LANE_WORDS = ("nass", "nassbahn", "wet", "on water", "onwater", "lichtschranke", "light barrier")
_LANE_FLAGS = {"flag", "state", "status", "sensor", "valid"}  # of a state these words may be the name
_PLACES = (
    _Rule("latitude", ("latitude", "lat", "breitengrad"), ("", "angle"), (), ("lateral", "acc"), "deg"),
    _Rule("longitude", ("longitude", "lon", "lng", "laengengrad"), ("", "angle"), (), ("longitudinal", "acc"), "deg"),
    _Rule("altitude", ("altitude", "elevation", "height", "alt", "hoehe"), ("length", ""), (), ("cam", "ride"), "m"),
)  # fmt: skip
_SPEED = _Rule(
    "v_x", ("speed", "velocity", "vel", "geschw", "geschwindigkeit", "v", "vx", "spd"), ("speed",),
    ("gps", "gnss", "optical", "correvit", "reference", "referenz", "vx"),
    ("wheel", "whl", "wind", "engine", "fan", "limit", "set", "steer", "accuracy", "vertical", "lateral", "east",
     "north", "up", "down", "motor", "rotor", "pump", "turbine", "shaft", "idle", "cruise", *_WHEEL_WORDS),
)  # fmt: skip
_FORWARD = _Rule(
    "a_x", ("ax", "accel", "acceleration", "acc", "inline", "laengs", "longitudinal", "gvc", "beschl"),
    ("acceleration",), ("longitudinal", "inline", "laengs", "long", "x", "ax", "esc", "esp"),
    ("lateral", "vertical", "querb", "quer", "y", "z", "ay", "az", "angular", "pedal"),
)  # fmt: skip
_RULES = (
    _FORWARD,
    _Rule("yaw_rate", ("yaw", "gier", "yawrate", "gierrate"), ("angular_speed",), ("rate",), ("acceleration",)),
    _Rule("a_y", ("ay", "accel", "acceleration", "acc", "quer", "lateral", "beschl"), ("acceleration",),
          ("lateral", "quer", "y", "ay"),
          ("longitudinal", "inline", "vertical", "x", "z", "ax", "az", "laengs", "pedal")),
    _Rule("steering_wheel_angle", ("steer", "steering", "lenk", "lenkrad", "lenkradwinkel", "lwi", "swa"),
          ("angle",), ("angle", "winkel", "pos", "wheel"), ("rate", "speed", "torque", "spd", "fraction")),
    _Rule("brake_pressure", ("brake", "brk", "brems", "bremse", "bremsdruck"), ("pressure",),
          ("pressure", "press", "druck"), ("pressed", "pedal", "switch", "sw"), may_rest=True),
    _Rule("torque_f", _AXLE_WORDS, ("torque",), ("axle", "achsmoment"), ("rear", "hinten", "steer", "motor")),
    _Rule("torque_r", _AXLE_WORDS, ("torque",), ("axle", "achsmoment"), ("front", "vorne", "steer", "motor")),
    _Rule("gear", ("gear", "gang"), ("", "ratio"), ("actual", "current")),
    _Rule("ambient_temperature", ("ambient", "amb", "outside", "aussen", "aussentemperatur", "outdoor"),
          ("temperature",), ("temp", "temperature", "temperatur")),
)  # fmt: skip
"""In the order in which they are looked for: what is found is what later ones are held against."""


class Look(NamedTuple):
    """What the channels of one drive look like: figures of each, and the signals that they may be."""

    overviews: list[ChannelOverview]
    proposals: dict[str, Proposal]


def look_at(channels: Sequence[Channel]) -> Look:
    """Summarise channels and propose signals; axes of a turned accelerometer only where the speed shows how.

    Times count from the first sample of all channels.
    """
    channels = list(without_copies(dict(enumerate(channels)))[0].values())
    origin = min((int(c.t_ns.min()) for c in channels if c.t_ns.size), default=0)
    found = [overview(c, origin_ns=origin) for c in channels]
    triples = rotated_triples(found)
    named = {(c.info.file, c.info.path): c for c in channels}
    rotated = [({a: named[o.file, o.path] for a, o in axes.items()}, up) for axes, up in triples]
    passed = {(o.file, o.path) for axes, _ in triples for o in axes.values()}
    return Look(found, propose_map([c for c in channels if (c.info.file, c.info.path) not in passed], rotated))


def propose_map(
    channels: Sequence[Channel], rotated: Sequence[tuple[Mapping[str, Channel], str]] = ()
) -> dict[str, Proposal]:
    """Return the most likely channel of each signal, by symbol, of the channels with samples of one drive.

    Name and unit support each of them; the reason holds the evidence of the data. Check a proposal before use.
    `rotated`: accelerometers by axis that are mounted turned, not among the channels, with the axis that points up.
    """
    usable = _Named(c for c in channels if c.values.size > 1 and np.isfinite(c.values).any())
    found: dict[str, Proposal] = {}
    for symbol in (*SYMBOLS, *ACCEPTED):
        exact = [c for c in usable if c.info.name == symbol]
        if len(exact) == 1:
            found[symbol] = Proposal(Entry(symbol, (_address(exact[0], usable),)), CANONICAL, 10.0)
    for several in _OF_WHEELS:
        for wheel, positions in several.positions.items():
            candidates = [
                p for c in usable if (p := _wheel_candidate(several, wheel, positions, c, usable)) is not None
            ]
            if several.quantity != "omega":
                candidates = [settle_by_range(p, usable.of(p)) for p in candidates]
            _keep_best(found, f"{several.quantity}_{wheel}", candidates)
    _keep_best(found, "on_water", [p for c in usable if (p := _lane_candidate(c, usable)) is not None])
    for rule in (*_PLACES, _SPEED):
        candidates = [p for c in usable if (p := _candidate(rule, c, usable)) is not None]
        if rule is _SPEED and all(f"omega_{w}" in found for w in WHEELS):
            # beside four wheel speeds, a "vehicle speed" is made from them: only a sensor of its own is a reference
            named = [(p, channel_id(usable.of(p).info)) for p in candidates]
            candidates = [p for p, name in named if set(words_of(name)) & set(rule.bonus)]
        _keep_best(found, rule.symbol, candidates)
    motion = _motion(found, usable)
    if motion is not None:
        for axes, up in rotated:
            _take_turned(found, usable, axes, up, motion)
    for rule in _RULES:
        candidates = [p for c in usable if (p := _candidate(rule, c, usable)) is not None]
        if rule.symbol in ("torque_f", "torque_r"):
            want = {"torque_f": ("front", "frnt", "vorne", "va"), "torque_r": ("rear", "hinten", "ha")}[rule.symbol]
            candidates = [p for p in candidates if set(words_of(p.entry.channel[0])) & set(want)]
        check = CHECKS.get(rule.symbol)
        if motion is not None and check is not None:
            candidates = [check(p, usable.of(p), motion) for p in candidates]
        settled = [settle_by_range(p, usable.of(p)) if p.score > 0 else p for p in candidates]
        if motion is not None and motion.in_doubt:
            settled = [_in_doubt(p, usable.of(p)) for p in settled]
        if rule.symbol == "a_y":
            settled = [_as_beside(p, found.get("a_x"), usable) for p in settled]
        _keep_best(found, rule.symbol, settled)
        if rule.symbol == "yaw_rate" and motion is not None and "yaw_rate" in found:
            channel = usable.of(found["yaw_rate"])
            turn = smooth(to_si(found["yaw_rate"], channel, on_grid(channel, motion.grid))[0])
            motion = replace(motion, turns=(("the yaw rate", turn), *motion.turns))
    if "steer_angle" in found:
        found.pop("steering_wheel_angle", None)
    return {s: found[s] for s in (*SYMBOLS, *ACCEPTED) if s in found}


def _keep_best(found: dict[str, Proposal], symbol: str, candidates: list[Proposal]) -> None:
    good = [p for p in candidates if p.score > 0.0]
    if symbol not in found and good:
        found[symbol] = max(good, key=lambda p: p.score)


@lru_cache(maxsize=1 << 15)  # every rule asks for the words of every name, and a logger has thousands of them
def words_of(text: str) -> tuple[str, ...]:
    """Split a name into words, lower case: `VehSpd_FL` -> veh, spd, fl."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", text)
    return tuple(w.lower() for w in re.split(r"[^A-Za-z]+", spaced) if w)


class _Named(list[Channel]):
    """Channels of one drive, found by path or file and path; not changed once made."""

    def __init__(self, channels: Iterable[Channel]) -> None:
        super().__init__(channels)
        self.times = Counter(c.info.path for c in self)
        self.by_address: dict[str, Channel] = {}
        for channel in self:
            self.by_address.setdefault(channel.info.path, channel)
            self.by_address.setdefault(channel_id(channel.info), channel)

    def add(self, channel: Channel) -> str:
        """Take a channel in, if it is not there, and return what a map calls it."""
        self.by_address.setdefault(channel.info.path, channel)
        self.by_address.setdefault(channel_id(channel.info), channel)
        is_alone = self.by_address[channel.info.path] is channel
        return channel.info.path if is_alone else channel_id(channel.info)

    def of(self, proposal: Proposal) -> Channel:
        """Return the channel of a proposal."""
        return self.by_address[proposal.entry.channel[0]]


def _has(wanted: Sequence[str], words: Sequence[str]) -> bool:
    """Return whether one of the words stands in a name, by itself or (from four letters on) inside a compound."""
    return any(w in words or (len(w) >= 4 and any(w in word for word in words)) for w in wanted)


def _dimension(channel: Channel) -> str:
    unit = channel.info.unit
    if not unit:
        return ""
    return parse_unit(unit).dimension if is_unit(unit) else "?"


def _address(channel: Channel, channels: _Named) -> str:
    """Return the shortest unique name: the path where it is unique, else with the file."""
    return channel.info.path if channels.times[channel.info.path] == 1 else channel_id(channel.info)


def _proposal(
    symbol: str, channel: Channel, channels: _Named, score: float, unit: str = "", *, may_rest: bool = False
) -> Proposal:
    own = channel.info.unit
    entry = Entry(symbol, (_address(channel, channels),), own if own and is_unit(own) else (unit or None))
    if own:
        reason = "name and unit"
    else:
        reason = f"name; the file gives no unit: {unit} by its kind, check it" if unit else "name"
    finite = channel.values[np.isfinite(channel.values)]
    if finite.size > 10 and finite.min() == finite.max():
        return Proposal(entry, f"{reason}, but it is constant", score - (1.0 if may_rest else 5.0))
    return Proposal(entry, reason, score)


def _wheel_candidate(
    rule: _OfWheels, wheel: str, positions: tuple[str, ...], channel: Channel, channels: _Named
) -> Proposal | None:
    name = words_of(channel.info.name)
    joined = " ".join(name)
    has_position = any(p in name if " " not in p else p in joined for p in positions)
    has_word = set(rule.words) & set(words_of(channel.info.path)) or any(w in joined for w in rule.words if len(w) > 4)
    dimension = _dimension(channel)
    if not has_position or not has_word or set(name) & NOT_A_VALUE or dimension not in (*rule.dimensions, ""):
        return None
    score = 3.0 + ("speed" in joined or "spd" in joined) - 2.0 * (dimension == "")
    return _proposal(f"{rule.quantity}_{wheel}", channel, channels, score)


def _candidate(rule: _Rule, channel: Channel, channels: _Named) -> Proposal | None:
    words = words_of(channel.info.name)
    path_words = set(words_of(channel_id(channel.info)))
    dimension = _dimension(channel)
    named = _has(rule.words, words) or (set(rule.words) & path_words and set(rule.bonus) & set(words))
    never = set(rule.never) & set(words) or _has([w for w in rule.never if len(w) > 4], words)
    if not named or never or set(words) & NOT_A_VALUE:
        return None
    # a channel without a unit is proposed only where its name says which quantity it is
    is_clear = dimension == "" and (rule.fallback_unit or rule.symbol == "gear" or _is_measured(rule, channel, words))
    if dimension not in rule.dimensions and not is_clear:
        return None
    score = 2.0 + len(set(rule.bonus) & path_words) + _has(rule.bonus, words) - 1.5 * (dimension == "")
    return _proposal(rule.symbol, channel, channels, score, rule.fallback_unit, may_rest=rule.may_rest)


def _is_measured(rule: _Rule, channel: Channel, words: Sequence[str]) -> bool:
    """Whether a channel without a unit bears a name that is clear enough, and more values than a switch or a state."""
    is_clear = rule is _SPEED or _has(rule.bonus, words)
    seen = channel.values[:: max(1, channel.values.size // _SEEN)]
    values = np.unique(seen[np.isfinite(seen)])
    is_measured = values.size > _STATES or (rule.may_rest and values.size == 1 and values[0] == 0.0)
    return bool(quantity_of(rule.symbol) and is_clear and is_measured)


def _lane_candidate(channel: Channel, channels: _Named) -> Proposal | None:
    """Propose a channel that is 0 or 1 and is named after a wet lane or the light barriers at its ends."""
    words = words_of(channel.info.name)
    named = _has(_LANE_WORDS, words) or any(w in " ".join(words) for w in _LANE_WORDS if " " in w)
    if not named or set(words) & (NOT_A_VALUE - _LANE_FLAGS) or channel.info.unit == "%":
        return None
    finite = channel.values[np.isfinite(channel.values)]
    if _dimension(channel) not in ("", "ratio") or not finite.size or not np.isin(finite, (0.0, 1.0)).all():
        return None
    is_gate = _has(("lichtschranke", "barrier"), words)
    reason = "name; 0 or 1: check that it is 1 on the whole lane" + (", not at its gates only" if is_gate else "")
    plain = _proposal("on_water", channel, channels, 2.0 - 0.5 * is_gate, "bool", may_rest=True)
    reason += ", but it is constant in the drive looked at" if finite.min() == finite.max() else ""
    return replace(plain, reason=reason, entry=replace(plain.entry, unit="bool"))  # - in one log, nothing in another


# --- the data's word ---------------------------------------------------------------------------------------------


def _motion(found: dict[str, Proposal], channels: _Named) -> Motion | None:
    """Return the motion by the speeds and positions that are found, and give units to speeds that have none."""
    speeds = [s for s in ("v_x", *(f"omega_{w}" for w in WHEELS)) if s in found]
    bases = [s for s in ("omega_rl", "omega_fl", *speeds, "latitude") if s in found]
    grid = next((g for s in bases if (g := even_times(channels.of(found[s]), 20)) is not None), None)
    if grid is None:
        for s in speeds:
            found[s] = settle_by_range(found[s], channels.of(found[s]))
        return None
    raw = {s: on_grid(channels.of(found[s]), grid) for s in speeds}
    course = _course(found, channels, grid)
    _settle_speeds(found, channels, raw, grid, None if course is None else course[0])
    si = {s: np.abs(to_si(found[s], channels.of(found[s]), x)[0]) for s, x in raw.items() if s in found}
    wheels = [si[f"omega_{w}"] for w in WHEELS if f"omega_{w}" in si]
    if not si and course is None:
        return None
    v = si["v_x"] if "v_x" in si else np.mean(wheels, axis=0) if wheels or course is None else course[0]
    turns = [] if course is None else [("the course of the positions", course[1])]
    for name, left, right in (("rear", "omega_rl", "omega_rr"), ("front", "omega_fl", "omega_fr")):
        if left in si and right in si:
            turns.append((f"the {name} wheels' difference", wheel_turn(si[left], si[right])))
    # the middle one of the wheels, as one that spins or locks says nothing of the car
    speeds_of = [*([np.median(wheels, axis=0)] if wheels else []), v]
    return Motion(grid, v, tuple(derivative(x) for x in speeds_of), tuple(turns), any(found[s].doubt for s in si))


def _course(found: Mapping[str, Proposal], channels: _Named, grid: TimeArray) -> tuple[FloatArray, FloatArray] | None:
    """Return speed [m/s] and yaw rate [rad/s] by the positions; None without any or where they hardly move."""
    if "latitude" not in found or "longitude" not in found:
        return None
    degrees = []
    for symbol in ("latitude", "longitude"):
        channel = channels.of(found[symbol])
        x, dimension = to_si(found[symbol], channel, on_grid(channel, grid))
        degrees.append(np.degrees(x) if dimension == "angle" else x)
    v, turn = track(degrees[0], degrees[1])
    return (v, turn) if (v > _MOVING).sum() >= _LEAST else None


def _take_turned(
    found: dict[str, Proposal], channels: _Named, axes: Mapping[str, Channel], up: str, motion: Motion
) -> None:
    """Propose the axes of a turned accelerometer and the rate beside it, where the speed shows how it is turned."""
    for symbol, axis in turned_axes(axes, gyro_beside(channels, axes["x"]), up, motion).items():
        info = axis.channel.info
        entry = Entry(symbol, (channels.add(axis.channel),), info.unit, scale=axis.scale)
        found.setdefault(symbol, Proposal(entry, f"unit; {axis.reason}", 3.0))


def _in_doubt(p: Proposal, channel: Channel) -> Proposal:
    """Return a proposal whose unit was found by a speed in doubt with the doubt that its range leaves."""
    quantity = quantity_of(p.entry.symbol)
    if channel.info.unit or p.doubt or not quantity or p.reason == CANONICAL:
        return p
    guess = by_range(channel.values, CHOICES[quantity])
    others = () if guess is None else (guess.unit, *guess.doubt)
    return replace(p, doubt=tuple(u for u in others if u != p.entry.unit))


def _as_beside(p: Proposal, other: Proposal | None, channels: _Named) -> Proposal:
    """Return a proposal whose unit is in doubt with that of the other axis of its accelerometer, which is not."""
    if other is None or other.doubt or not p.doubt or not other.entry.unit:
        return p
    is_beside = channels.of(p).info.file == channels.of(other).info.file
    if not is_beside or other.entry.unit not in (p.entry.unit, *p.doubt):
        return p
    reason = f"name; the file gives no unit: {other.entry.unit} as a_x"
    return replace(p, entry=replace(p.entry, unit=other.entry.unit), doubt=(), reason=reason)


def _settle_speeds(
    found: dict[str, Proposal], channels: _Named, raw: Mapping[str, FloatArray], grid: TimeArray,
    course: FloatArray | None,
) -> None:  # fmt: skip
    """Give a unit to each speed that has none: by one that is known, else by an accelerometer or by its range."""

    def is_bare(symbol: str) -> bool:
        p = found[symbol]
        return not (p.entry.unit or channels.of(p).info.unit or p.reason == CANONICAL)

    def as_known(symbol: str) -> Known:
        x, dimension = to_si(found[symbol], channels.of(found[symbol]), raw[symbol])
        return Known(symbol, np.abs(x), _TURNING if dimension == "angular_speed" else _SPREAD)

    bare = [s for s in raw if is_bare(s)]
    if not bare:
        return
    sure = [as_known(s) for s in raw if not is_bare(s)]
    if course is not None:
        sure.append(Known("the positions", course, 1.5 * _SPREAD))
    sure.sort(key=lambda k: k.spread)
    accelerometer = None if sure else _accelerometer(channels, raw[bare[0]], grid)
    doubt: tuple[str, ...] = ()
    for symbol in bare:
        p, is_wheel = found[symbol], symbol != "v_x"
        known: list[Known | None] = [*sure] or [None]
        asked = (speed_unit(raw[symbol], is_wheel=is_wheel, known=k, accelerometer=accelerometer) for k in known)
        guess = next((g for g in asked if g is not None), None)
        if guess is None and is_wheel:  # whatever another speed says, it is a wheel's
            guess = by_range(raw[symbol], CHOICES["wheel"])
        if guess is None:
            del found[symbol]
            continue
        found[symbol] = replace(with_unit(p, guess), doubt=doubt or guess.doubt)
        if not sure:
            sure, doubt = [as_known(symbol)], guess.doubt


_SPREAD = 0.04  # of two speeds of one car: radius that a control unit assumes, slip
_TURNING = 0.3  # of a speed from a wheel whose radius is not known
_MOVING = 5.0  # speed from which positions show it [m/s]
_LEAST = 100  # points of the grid that must show it: 10 s


def _accelerometer(channels: _Named, speed: FloatArray, grid: TimeArray) -> tuple[FloatArray, str] | None:
    """Return the accelerometer that follows the derivative of a raw speed (n,) best, raw on its grid, and its unit."""
    own = [channels.of(p) for c in channels if (p := _candidate(_FORWARD, c, channels)) is not None]
    found = [(on_grid(c, grid), c.info.unit) for c in own]
    return max(found, key=lambda f: np.nan_to_num(abs(fit(derivative(speed), smooth(f[0])).r)), default=None)
