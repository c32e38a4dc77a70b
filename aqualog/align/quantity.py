"""Find the channels of two files that carry the same quantity, to compare the clocks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.align.mapping import Entry, SignalMap, matching
from aqualog.align.propose import propose_map, words_of
from aqualog.align.resample import linear
from aqualog.align.timebase import ClockRepair
from aqualog.core.errors import SignalError
from aqualog.core.notation import WHEELS
from aqualog.core.records import Channel, FloatArray, TimeArray
from aqualog.core.units import convert, is_unit, parse_unit
from aqualog.core.vehicle import Vehicle

__all__ = ["QUANTITIES", "Quantity", "find_quantity"]

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
    if named is not None:
        hits = [c for c in channels if c.info in matching([k.info for k in channels], named)]
        if len(hits) != 1:
            raise SignalError(
                f'{"no" if not hits else "more than one"} channel "{named}"',
                where=channels[0].info.file if channels else "",
                hint="`aqualog inspect` lists the channels",
            )
        return _single(hits[0], Entry("v_x", (named,)), quantity)
    known = _mapped(channels, signal_map) or {}
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


def _mapped(channels: Sequence[Channel], signal_map: SignalMap) -> dict[str, Entry]:
    infos = [c.info for c in channels]
    return {s: e for s, e in signal_map.entries.items() if any(len(matching(infos, c)) == 1 for c in e.channel)}


def _channel(channels: Sequence[Channel], entry: Entry) -> Channel:
    infos = [c.info for c in channels]
    hit = next(m for c in entry.channel if (m := matching(infos, c)))[0]
    return next(c for c in channels if c.info is hit)


def _from_entries(
    channels: Sequence[Channel], entries: dict[str, Entry], quantity: str, vehicle: Vehicle
) -> Quantity | None:
    if quantity == "yaw_rate":
        return (
            _single(_channel(channels, entries["yaw_rate"]), entries["yaw_rate"], quantity)
            if "yaw_rate" in entries
            else None
        )
    if "v_x" in entries:
        return _single(_channel(channels, entries["v_x"]), entries["v_x"], quantity)
    wheels = [(w, entries[f"omega_{w}"]) for w in WHEELS if f"omega_{w}" in entries]
    if len(wheels) < 2:
        return None
    parts = [_rim_speed(_channel(channels, e), e, vehicle.r_e(w)) for w, e in wheels]
    t = parts[0].t_ns
    mean = np.mean([p.x if p.t_ns is t else linear(p.t_ns, p.x, t, gap_ns=10**9)[0] for p in parts], axis=0)
    label = f"mean of {len(wheels)} wheels"
    return Quantity(parts[0].file, label, t, mean, parts[0].absolute, parts[0].note)


def _rim_speed(channel: Channel, entry: Entry, r_e: float) -> Quantity:
    unit = entry.unit or channel.info.unit
    if unit and parse_unit(unit).dimension == "angular_speed":
        own = _clean(channel, convert(channel.values, unit, "rad/s") * entry.scale * r_e)
        return Quantity(own.file, own.label, own.t_ns, own.x, own.absolute, f"r_e = {r_e:g} m")
    return _single(channel, entry, "speed")


def _single(channel: Channel, entry: Entry, quantity: str) -> Quantity:
    unit = entry.unit or channel.info.unit
    target = QUANTITIES[quantity]
    if not unit or not is_unit(unit):
        own = _clean(channel, channel.values)
        return Quantity(own.file, own.label, own.t_ns, own.x, own.absolute, f"no unit: taken as {target}")
    where = f"{channel.info.file}:{channel.info.path}"
    values = convert(channel.values, unit, target, where=where) * entry.scale + entry.offset
    return _clean(channel, values)


def _clean(channel: Channel, values: FloatArray) -> Quantity:
    t, order, _ = ClockRepair().repair(channel.t_ns)
    x = values[order]
    good = np.isfinite(x)
    return Quantity(channel.info.file, channel.info.path, t[good], x[good], channel.absolute)
