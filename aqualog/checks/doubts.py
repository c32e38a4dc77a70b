"""What a check has found, and how it is said: with the line that the signal map needs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from aqualog.align.mapping import Entry, entry_line
from aqualog.core.notation import SYMBOLS
from aqualog.core.records import Origin, Remark
from aqualog.core.units import is_unit, parse_unit

__all__ = ["Change", "Doubt", "exchanged", "remarks_of"]

_UNITS = ("m/s", "km/h", "mph", "rad/s", "rpm", "deg/s", "m/s^2", "g")
"""Units that logs have for speeds, wheels and accelerations."""
_NEAR = 0.04  # of a factor, in which a unit explains it: tyres and GNSS are not more exact
_OTHER_NAMES = {"steer_angle": "steering_wheel_angle", "torque_f": "torque_fl", "torque_r": "torque_rl"}


class Change(NamedTuple):
    """What turns a signal as it was read into the right one: factor * (signal - offset). Offset in SI.

    `of`: the signal whose channel it must be read from, empty for its own. `radius`: of its wheel [m], 1 for other
    signals; with it the factor may come from a wrong unit.
    """

    factor: float = 1.0
    offset: float = 0.0
    of: str = ""
    radius: float = math.nan

    def beside(self, other: Change) -> Change:
        """Return both changes, each found on the signal as it was read."""
        radius = other.radius if math.isnan(self.radius) else self.radius
        return Change(self.factor * other.factor, self.offset + other.offset, self.of or other.of, radius)


def exchanged(one: str, other: str) -> dict[str, Change]:
    """Return what puts two signals right whose channels are exchanged."""
    return {one: Change(of=other), other: Change(of=one)}


@dataclass(frozen=True, slots=True)
class Doubt:
    """One finding of a check.

    `ways`: by symbol, what would put it right; with several ways the log does not show which. `advice`: what else to
    do, or where no change of the map helps. `radius`: what to change in the vehicle file, which applies where the log
    has rotations: a speed at the rim does not depend on the radius. `value` with `ci95`: what was measured, SI.
    """

    kind: str
    signals: tuple[str, ...]
    what: str
    advice: str = ""
    ways: tuple[Mapping[str, Change], ...] = ()
    value: float = math.nan
    ci95: tuple[float, float] = (math.nan, math.nan)
    radius: str = ""


def remarks_of(doubts: Sequence[Doubt], origins: Mapping[str, Origin]) -> tuple[Remark, ...]:
    """Return the remarks on a drive.

    Parameters
    ----------
    origins : mapping symbol -> Origin
        Where the signals come from, and by which line of the map.

    A signal with two faults has one line that mends both.
    """
    sure: dict[str, Change] = {}
    for doubt in doubts:
        for symbol, change in doubt.ways[0].items() if len(doubt.ways) == 1 else ():
            sure[symbol] = sure[symbol].beside(change) if symbol in sure else change
    return tuple(_remark(d, sure, origins) for d in doubts)


def _remark(doubt: Doubt, sure: Mapping[str, Change], origins: Mapping[str, Origin]) -> Remark:
    wholes = [{s: sure[s] for s in way} if len(doubt.ways) == 1 else way for way in doubt.ways]
    by_unit = [w for w in wholes if all(_unit(_entry_of(origins, s, c), c) for s, c in w.items())]
    # a factor that a unit explains on one side needs no explanation on the other
    ways = [[line_of(origins, s, c) for s, c in way.items()] for way in by_unit or wholes]
    lines = tuple(line for way in ways for line in way)
    put = " or ".join(", ".join(way) for way in ways)
    said = "" if not put else f"in the signal map, under [signals]: {'either ' if len(ways) > 1 else ''}{put}"
    advice = "; ".join(x for x in (said, doubt.advice) if x)
    read = [_entry_of(origins, s, c) for way in wholes for s, c in way.items()]
    if doubt.radius and all(not r.unit or parse_unit(r.unit).dimension == "angular_speed" for r in read):
        # a unit that the log itself declares is right more often than a number that someone has typed
        is_declared = all(r.unit and r.entry.unit is None for r in read)
        lines, advice = ((), doubt.radius) if is_declared or not by_unit else (lines, f"{advice}; or {doubt.radius}")
    return Remark(doubt.kind, doubt.signals, doubt.what, advice, lines, doubt.value, doubt.ci95)


def line_of(origins: Mapping[str, Origin], symbol: str, change: Change) -> str:
    """Return the line of a signal map that reads the signal with a change: `a_y = { channel = "LatAcc", scale = -1 }`.

    SI value = scale * to_SI(raw) + offset; the change applies to that value. A factor that another unit explains
    becomes that unit.
    """
    read = _entry_of(origins, symbol, change)
    unit = _unit(read, change)
    entry = replace(read.entry, unit=unit) if unit else read.entry
    factor = 1.0 if unit else change.factor
    scale = _short(factor * entry.scale)
    offset = _short(factor * (entry.offset - change.offset))
    return entry_line(replace(entry, scale=scale, offset=offset))


class _Read(NamedTuple):
    """How a signal is read: its entry of the map, and the unit that its values are taken in; empty if not known."""

    entry: Entry
    unit: str


def _entry_of(origins: Mapping[str, Origin], symbol: str, change: Change) -> _Read:
    source = change.of or symbol
    name = source if source in origins else _OTHER_NAMES.get(source, source)
    origin = origins.get(name)
    if origin is None:
        return _Read(Entry(symbol, (source,)), "")
    given: dict[str, Any] = {"channel": [origin.channel], **origin.mapped, "symbol": origin.symbol}
    given = {k: tuple(x) if isinstance(x, list) else x for k, x in given.items()}
    entry = Entry(**given)
    return _Read(replace(entry, symbol=symbol) if change.of else entry, origin.unit)


def _unit(read: _Read, change: Change) -> str:
    """Return the unit that explains a factor; empty if none does."""
    if math.isnan(change.radius) or not read.unit or not is_unit(read.unit) or read.entry.offset:
        return ""
    sizes = {unit: _si(unit, change.radius) for unit in _UNITS if _fits(unit, read.entry.symbol)}
    now = _si(read.unit, change.radius)
    off = {unit: abs(math.log(abs(size / now / change.factor))) for unit, size in sizes.items() if change.factor > 0.0}
    best = min(off, key=lambda unit: off[unit], default="")
    is_other = bool(best) and abs(sizes[best] / now - 1.0) > _NEAR
    return best if is_other and off[best] < _NEAR else ""


def _fits(unit: str, symbol: str) -> bool:
    dimension, own = parse_unit(unit).dimension, parse_unit(SYMBOLS[symbol].unit).dimension
    return dimension == own or (symbol.startswith("omega_") and dimension == "speed")


def _si(unit: str, radius: float) -> float:
    """Return the size of a unit in SI; of a speed at the rim as a speed of the wheel."""
    found = parse_unit(unit)
    return found.factor / radius if found.dimension == "speed" else found.factor


def _short(x: float) -> float:
    """Return a number for a reader: four digits are more than any check knows."""
    return float(f"{x:.4g}") + 0.0
