"""Find the channel of a file that carries one quantity, by which the clocks of two files are compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aqualog.align.grid import linear
from aqualog.align.mapping import Entry, SignalMap, channel_id, matching
from aqualog.align.motion import clean_samples
from aqualog.align.propose import propose_map, words_of
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
    channels: Sequence[Channel], entries: Mapping[str, Entry], quantity: str, vehicle: Vehicle
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
    return Quantity(channel.info.file, channel.info.path, *clean_samples(channel, values), channel.absolute, note)
