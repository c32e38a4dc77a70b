"""Propose a signal map for a log with names of its own, or the channel that carries one quantity.

A name suggests which signal a channel may be, and its unit rules out wrong ones. The data decide among the rest: an
accelerometer must follow the derivative of the speed, a yaw rate the difference of the wheel speeds.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from aqualog.align.grid import linear
from aqualog.align.mapping import Entry, SignalMap, channel_id, matching
from aqualog.align.overview import ChannelOverview, overview, rotated_channels
from aqualog.align.timebase import ClockRepair
from aqualog.core.errors import SignalError
from aqualog.core.notation import ACCEPTED, SYMBOLS, WHEELS
from aqualog.core.records import Channel, FloatArray, TimeArray
from aqualog.core.units import convert, is_unit, parse_unit
from aqualog.core.vehicle import Vehicle

__all__ = [
    "CANONICAL", "QUANTITIES", "Look", "Proposal", "Quantity", "find_quantity", "look_at", "propose_map", "words_of",
]  # fmt: skip


CANONICAL = "its canonical name"
"""Reason of a proposal that needs no map."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """A channel proposed for a symbol, and why."""

    entry: Entry
    reason: str
    score: float


_POSITIONS = {
    "fl": ("fl", "vl", "lf", "front left", "left front", "vorne links", "frontleft", "leftfront"),
    "fr": ("fr", "vr", "rf", "front right", "right front", "vorne rechts", "frontright", "rightfront"),
    "rl": ("rl", "hl", "lr", "rear left", "left rear", "hinten links", "rearleft", "leftrear"),
    "rr": ("rr", "hr", "rear right", "right rear", "hinten rechts", "rearright", "rightrear"),
}
_NOT_A_VALUE = {
    "fault", "valid", "status", "qbit", "counter", "checksum", "crc", "flag", "state", "error", "quality", "accuracy",
    "offset", "sensor", "max", "min", "req", "request", "requested", "target", "displayed", "init", "initializing",
}  # fmt: skip


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
_SIDES = {"fl": ("left", "links", "l", "li"), "fr": ("right", "rechts", "r", "re")}
_OF_WHEELS = (
    _OfWheels("omega", _WHEEL_WORDS, ("speed", "angular_speed"), _POSITIONS),
    _OfWheels("torque", _TORQUE_WORDS, ("torque",), _POSITIONS),
    _OfWheels("pressure", ("tire", "tyre", "tpms", "reifen"), ("pressure",), _POSITIONS),
    _OfWheels("tie_rod", ("spurstange", "spurstangenkraft", "tie rod", "tierod"), ("force",),
              {w: (*_POSITIONS[w], *more) for w, more in _SIDES.items()}),
)  # fmt: skip
_LANE_WORDS = ("nass", "nassbahn", "wet", "on water", "onwater", "lichtschranke", "light barrier")
_LANE_FLAGS = {"flag", "state", "status", "sensor", "valid"}  # of a state these words may be the name
_RULES = (
    _Rule("v_x", ("speed", "velocity", "vel", "geschw", "geschwindigkeit", "v", "vx", "spd"), ("speed",),
          ("gps", "gnss", "optical", "correvit", "reference", "referenz", "vx"),
          ("wheel", "whl", "wind", "engine", "fan", "limit",
          "set", "steer", "accuracy", "vertical", "lateral", "east", "north", "up", "down", *_WHEEL_WORDS)),
    _Rule("a_x", ("ax", "accel", "acceleration", "acc", "inline", "laengs", "longitudinal", "gvc", "beschl"),
          ("acceleration",), ("longitudinal", "inline", "laengs", "long", "x", "ax", "esc", "esp"),
          ("lateral", "vertical", "querb", "quer", "y", "z", "ay", "az", "angular")),
    _Rule("a_y", ("ay", "accel", "acceleration", "acc", "quer", "lateral", "beschl"), ("acceleration",),
          ("lateral", "quer", "y", "ay"), ("longitudinal", "inline", "vertical", "x", "z", "ax", "az", "laengs")),
    _Rule("yaw_rate", ("yaw", "gier", "yawrate", "gierrate"), ("angular_speed",), ("rate",), ("acceleration",)),
    _Rule("steering_wheel_angle", ("steer", "steering", "lenk", "lenkrad", "lenkradwinkel", "lwi", "swa"),
          ("angle",), ("angle", "winkel", "pos", "wheel"), ("rate", "speed", "torque", "spd", "fraction")),
    _Rule("brake_pressure", ("brake", "brk", "brems", "bremse", "bremsdruck"), ("pressure",), ("pressure", "druck"),
          may_rest=True),
    _Rule("torque_f", _TORQUE_WORDS, ("torque",), ("axle",), ("rear", "hinten", "steer", "motor")),
    _Rule("torque_r", _TORQUE_WORDS, ("torque",), ("axle",), ("front", "vorne", "steer", "motor")),
    _Rule("gear", ("gear", "gang"), ("", "ratio"), ("actual", "current")),
    _Rule("latitude", ("latitude", "lat"), ("", "angle"), (), ("lateral", "acc"), "deg"),
    _Rule("longitude", ("longitude", "lon", "lng"), ("", "angle"), (), ("longitudinal", "acc"), "deg"),
    _Rule("altitude", ("altitude", "elevation", "height", "alt"), ("length",)),
    _Rule("ambient_temperature", ("ambient", "outside", "aussen", "outdoor"), ("temperature",)),
)  # fmt: skip


class Look(NamedTuple):
    """What the channels of one drive look like: figures of each, and the signals that they may be."""

    overviews: list[ChannelOverview]
    proposals: dict[str, Proposal]


def look_at(channels: Sequence[Channel]) -> Look:
    """Summarise channels and propose signals; axes of accelerometers that are not the car's are passed over.

    Times count from the first sample of all channels.
    """
    origin = min((int(c.t_ns.min()) for c in channels if c.t_ns.size), default=0)
    found = [overview(c, origin_ns=origin) for c in channels]
    rotated = rotated_channels(found)
    return Look(found, propose_map([c for c in channels if (c.info.file, c.info.path) not in rotated]))


def propose_map(channels: Sequence[Channel]) -> dict[str, Proposal]:
    """Return the most likely channel of each signal, by symbol, of the channels with samples of one drive.

    Name and unit support each of them; the reason holds the evidence of the data. Check a proposal before use.
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
            _keep_best(found, f"{several.quantity}_{wheel}", candidates)
    _keep_best(found, "on_water", [p for c in usable if (p := _lane_candidate(c, usable)) is not None])
    speed = _speed(found, usable)
    for rule in _RULES:
        candidates = [p for c in usable if (p := _candidate(rule, c, usable)) is not None]
        if rule.symbol in ("torque_f", "torque_r"):
            want = {"torque_f": ("front", "vorne", "va"), "torque_r": ("rear", "hinten", "ha")}[rule.symbol]
            candidates = [p for p in candidates if set(words_of(p.entry.channel[0])) & set(want)]
        if rule.symbol == "v_x" and all(f"omega_{w}" in found for w in WHEELS):
            # beside four wheel speeds, a "vehicle speed" is made from them: only a sensor of its own is a reference
            named = [(p, channel_id(usable.by_address[p.entry.channel[0]].info)) for p in candidates]
            candidates = [p for p, name in named if set(words_of(name)) & set(rule.bonus)]
        if rule.symbol == "a_x" and speed is not None:
            candidates = [_check_acceleration(p, usable, speed) for p in candidates]
        if rule.symbol == "yaw_rate":
            candidates = [_check_yaw(p, usable, found) for p in candidates]
        _keep_best(found, rule.symbol, candidates)
        if rule.symbol == "v_x" and speed is None:
            speed = _speed(found, usable)
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
    elif unit:
        reason = f"name; the file gives no unit: {unit} by its kind, check it"
    else:
        reason = "name; THE FILE GIVES NO UNIT, add it"
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
    if not has_position or not has_word or set(name) & _NOT_A_VALUE or dimension not in (*rule.dimensions, ""):
        return None
    score = 3.0 + ("speed" in joined or "spd" in joined) - 2.0 * (dimension == "")
    return _proposal(f"{rule.quantity}_{wheel}", channel, channels, score)


def _candidate(rule: _Rule, channel: Channel, channels: _Named) -> Proposal | None:
    words = words_of(channel.info.name)
    path_words = set(words_of(channel_id(channel.info)))
    dimension = _dimension(channel)
    named = _has(rule.words, words) or (set(rule.words) & path_words and set(rule.bonus) & set(words))
    never = set(rule.never) & set(words) or _has([w for w in rule.never if len(w) > 4], words)
    if not named or never or set(words) & _NOT_A_VALUE:
        return None
    # a channel without a unit is proposed only where the name leaves no doubt what the unit is
    is_clear = dimension == "" and (rule.fallback_unit or rule.symbol == "gear")
    if dimension not in rule.dimensions and not is_clear:
        return None
    score = 2.0 + len(set(rule.bonus) & path_words) + _has(rule.bonus, words)
    return _proposal(rule.symbol, channel, channels, score, rule.fallback_unit, may_rest=rule.may_rest)


def _lane_candidate(channel: Channel, channels: _Named) -> Proposal | None:
    """Propose a channel that is 0 or 1 and is named after a wet lane or the light barriers at its ends."""
    words = words_of(channel.info.name)
    named = _has(_LANE_WORDS, words) or any(w in " ".join(words) for w in _LANE_WORDS if " " in w)
    if not named or set(words) & (_NOT_A_VALUE - _LANE_FLAGS) or channel.info.unit == "%":
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


def _clean(channel: Channel, values: FloatArray | None = None) -> tuple[TimeArray, FloatArray]:
    """Stamps in order, and the finite values there: the channel's own, or these in place of them."""
    t, order, _ = ClockRepair().repair(channel.t_ns)
    x = (channel.values if values is None else values)[order]
    good = np.isfinite(x)
    return t[good], x[good]


def _on_grid(channel: Channel, grid: TimeArray) -> FloatArray:
    t, x = _clean(channel)
    return linear(t, x, grid, gap_ns=2_000_000_000)[0]


_GRID_NS = 100_000_000
_LONGEST_NS = 10**15  # 12 days: beyond, the time stamps jump


def _even_times(channel: Channel, least: int) -> TimeArray | None:
    """Stamps every 0.1 s over a channel; None if it has no more samples than `least`, or its stamps jump."""
    t, _ = _clean(channel)
    is_drive = t.size > least and int(t[-1]) - int(t[0]) < _LONGEST_NS
    return np.arange(t[0], t[-1], _GRID_NS, dtype=np.int64) if is_drive else None


def _speed(found: dict[str, Proposal], channels: _Named) -> tuple[TimeArray, FloatArray] | None:
    """Return the speed on a 0.1 s grid from a wheel or the reference, in its own unit."""
    for symbol in ("omega_rl", "omega_fl", "v_x"):
        if symbol in found:
            channel = channels.by_address[found[symbol].entry.channel[0]]
            grid = _even_times(channel, 20)
            if grid is not None:
                return grid, _on_grid(channel, grid)
    return None


def _correlation(a: FloatArray, b: FloatArray) -> float:
    good = np.isfinite(a) & np.isfinite(b)
    if good.sum() < 50 or a[good].std() == 0.0 or b[good].std() == 0.0:
        return np.nan
    return float(np.corrcoef(a[good], b[good])[0, 1])


def _smooth(x: FloatArray) -> FloatArray:
    return np.convolve(x, np.ones(11) / 11, mode="same")


def _check_acceleration(p: Proposal, channels: _Named, speed: tuple[TimeArray, FloatArray]) -> Proposal:
    grid, v = speed
    a = _on_grid(channels.by_address[p.entry.channel[0]], grid)
    r = _correlation(_smooth(np.gradient(v)), _smooth(a))
    if np.isnan(r):
        return p
    reason = f"{p.reason}; correlation {r:+.2f} with the derivative of the speed"
    if abs(r) < 0.5:
        return replace(p, reason=f"{reason}: not the car's a_x", score=-1.0)
    if r < 0:
        # a wrong sign is a guess too far for the map: said, and ranked behind any channel that needs none
        return replace(p, reason=f"{reason}: sign turned", score=p.score - 1.0 - r, entry=replace(p.entry, scale=-1.0))
    return replace(p, reason=reason, score=p.score + 2.0 * r)


def _check_yaw(p: Proposal, channels: _Named, found: dict[str, Proposal]) -> Proposal:
    if "omega_rl" not in found or "omega_rr" not in found:
        return p
    left, right = (channels.by_address[found[f"omega_{w}"].entry.channel[0]] for w in ("rl", "rr"))
    grid = _even_times(left, 1)
    if grid is None:
        return p
    turn = _on_grid(right, grid) - _on_grid(left, grid)
    r = _correlation(_smooth(turn), _smooth(_on_grid(channels.by_address[p.entry.channel[0]], grid)))
    if np.isnan(r) or abs(r) < 0.5:
        return replace(p, reason=f"{p.reason}; the wheels turn too little to check its sign")
    reason = f"{p.reason}; correlation {r:+.2f} with the rear wheels' difference"
    if r < 0:
        return replace(p, reason=f"{reason}: sign turned", entry=replace(p.entry, scale=-1.0))
    return replace(p, reason=reason, score=p.score + r)


QUANTITIES = {"speed": "m/s", "yaw_rate": "rad/s"}


@dataclass(frozen=True, slots=True)
class Quantity:
    """Samples of a quantity in one file. `t_ns` strictly increasing, `x` in m/s or rad/s."""

    file: str
    label: str
    t_ns: TimeArray
    x: FloatArray
    absolute: bool
    note: str = ""


def find_quantity(
    channels: Sequence[Channel], *, quantity: str, signal_map: SignalMap, vehicle: Vehicle, named: str | None = None
) -> Quantity:
    """Find the quantity in the channels of ONE file.

    Order of preference: the channel that is named; the signal map; names and units. A reference speed is preferred to
    the mean of the wheel speeds.

    Raises
    ------
    SignalError
        If the file carries no such quantity.
    """
    infos = [c.info for c in channels]
    if named is not None:
        hits = [c for c in channels if c.info in matching(infos, named)]
        if len(hits) != 1:
            raise SignalError(
                f'{"no" if not hits else "more than one"} channel "{named}"',
                where=channels[0].info.file if channels else "",
                hint="`aqualog inspect` lists the channels",
            )
        return _single(hits[0], Entry("v_x", (named,)), quantity)
    known = {s: e for s, e in signal_map.entries.items() if any(len(matching(infos, c)) == 1 for c in e.channel)}
    proposed = {s: p.entry for s, p in propose_map(channels).items()}
    for entries in (known, proposed):
        found = _from_entries(channels, entries, quantity, vehicle)
        if found is not None:
            return found
    if quantity == "speed":
        bare = [c for c in channels if not c.info.unit and {"speed", "velocity"} & set(words_of(c.info.name))]
        if bare:
            return _single(bare[0], Entry("v_x", (bare[0].info.path,)), quantity)
    raise SignalError(
        f"no {quantity.replace('_', ' ')} found",
        where=channels[0].info.file if channels else "",
        expected="a channel that both sources carry",
        hint="name it with --channel FILE=CHANNEL",
    )


def _channel(channels: Sequence[Channel], entry: Entry) -> Channel:
    infos = [c.info for c in channels]
    hit = next(m for c in entry.channel if (m := matching(infos, c)))[0]
    return next(c for c in channels if c.info is hit)


def _from_entries(
    channels: Sequence[Channel], entries: dict[str, Entry], quantity: str, vehicle: Vehicle
) -> Quantity | None:
    symbol = "yaw_rate" if quantity == "yaw_rate" else "v_x"
    if symbol in entries:
        return _single(_channel(channels, entries[symbol]), entries[symbol], quantity)
    wheels = [(w, entries[f"omega_{w}"]) for w in WHEELS if f"omega_{w}" in entries]
    if quantity == "yaw_rate" or len(wheels) < 2:
        return None
    parts = [_single(_channel(channels, e), e, quantity, r_e=vehicle.r_e(w)) for w, e in wheels]
    t = parts[0].t_ns
    mean = np.mean([p.x if p.t_ns is t else linear(p.t_ns, p.x, t, gap_ns=10**9)[0] for p in parts], axis=0)
    return replace(parts[0], label=f"mean of {len(wheels)} wheels", x=mean)


def _single(channel: Channel, entry: Entry, quantity: str, *, r_e: float | None = None) -> Quantity:
    """One channel in SI; a turning wheel becomes a speed by its effective radius [m]."""
    unit, target = entry.unit or channel.info.unit, QUANTITIES[quantity]
    note = ""
    if r_e is not None and unit and parse_unit(unit).dimension == "angular_speed":
        values, note = convert(channel.values, unit, "rad/s") * entry.scale * r_e, f"r_e = {r_e:g} m"
    elif not unit or not is_unit(unit):
        values, note = channel.values, f"no unit: taken as {target}"
    else:
        values = convert(channel.values, unit, target, where=channel_id(channel.info)) * entry.scale + entry.offset
    return Quantity(channel.info.file, channel.info.path, *_clean(channel, values), channel.absolute, note)
