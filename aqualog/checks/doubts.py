"""What a check has found, and how it is said: with the line that the signal map needs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from aqualog.align.mapping import Entry, entry_line
from aqualog.core.records import Origin, Remark

__all__ = ["Change", "Doubt", "exchanged", "remarks_of"]

_OTHER_NAMES = {"steer_angle": "steering_wheel_angle", "torque_f": "torque_fl", "torque_r": "torque_rl"}


class Change(NamedTuple):
    """What turns a signal as it was read into the right one: factor * (signal - offset). Offset in SI.

    `of`: the signal whose channel it must be read from, empty for its own.
    """

    factor: float = 1.0
    offset: float = 0.0
    of: str = ""

    def beside(self, other: Change) -> Change:
        """Return both changes, each found on the signal as it was read."""
        return Change(self.factor * other.factor, self.offset + other.offset, self.of or other.of)


def exchanged(one: str, other: str) -> dict[str, Change]:
    """Return what puts two signals right whose channels are exchanged."""
    return {one: Change(of=other), other: Change(of=one)}


@dataclass(frozen=True, slots=True)
class Doubt:
    """One finding of a check.

    `ways`: by symbol, what would put it right; with several ways the log does not show which. `advice`: what else to
    do, or where no change of the map helps. `value` with `ci95`: what was measured, SI.
    """

    kind: str
    signals: tuple[str, ...]
    what: str
    advice: str = ""
    ways: tuple[Mapping[str, Change], ...] = ()
    value: float = math.nan
    ci95: tuple[float, float] = (math.nan, math.nan)


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
    ways = []
    for way in doubt.ways:
        whole = {s: sure[s] for s in way} if len(doubt.ways) == 1 else way
        ways.append([line_of(origins, s, c) for s, c in whole.items()])
    lines = tuple(line for way in ways for line in way)
    put = " or ".join(", ".join(way) for way in ways)
    said = "" if not put else f"in the signal map, under [signals]: {'either ' if len(ways) > 1 else ''}{put}"
    advice = "; ".join(x for x in (said, doubt.advice) if x)
    return Remark(doubt.kind, doubt.signals, doubt.what, advice, lines, doubt.value, doubt.ci95)


def line_of(origins: Mapping[str, Origin], symbol: str, change: Change) -> str:
    """Return the line of a signal map that reads the signal with a change: `a_y = { channel = "LatAcc", scale = -1 }`.

    SI value = scale * to_SI(raw) + offset; the change applies to that value.
    """
    source = change.of or symbol
    name = source if source in origins else _OTHER_NAMES.get(source, source)
    origin = origins.get(name)
    entry = Entry(symbol, (source,)) if origin is None else Entry(**_given(origin))
    if change.of:
        entry = replace(entry, symbol=symbol)
    scale = _short(change.factor * entry.scale)
    offset = _short(change.factor * (entry.offset - change.offset))
    return entry_line(replace(entry, scale=scale, offset=offset))


def _given(origin: Origin) -> dict[str, Any]:
    given = {"channel": [origin.channel], **origin.mapped, "symbol": origin.symbol}
    return {k: tuple(x) if isinstance(x, list) else x for k, x in given.items()}


def _short(x: float) -> float:
    """Return a number for a reader: four digits are more than any check knows."""
    return float(f"{x:.4g}") + 0.0
