"""A rival that is in the log: the user's own detector as a channel, scored by the same windows and rules."""

from __future__ import annotations

import difflib
import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aqualog.align.clean import corrected
from aqualog.align.mapping import SignalMap, channel_id, matching
from aqualog.align.motion import clean_samples
from aqualog.core.errors import ConfigError, SignalError
from aqualog.core.records import BoolArray, Channel, ChannelInfo, FloatArray, Signals
from aqualog.detect.registry import BY_NAME
from aqualog.evaluate.labels import Span, spans_of
from aqualog.io.open_log import DriveLog
from aqualog.io.reader import ReadOptions

__all__ = ["Heard", "LoggedRival", "heard_in", "parse_rivals"]

_OPERATORS: Mapping[str, Callable[[FloatArray, float], BoolArray]] = {
    ">=": operator.ge, "<=": operator.le, ">": operator.gt, "<": operator.lt,
}  # fmt: skip
_RIVAL = re.compile(r"(?P<name>[A-Za-z][\w-]*)\s*=\s*(?P<channel>.+?)(?:\s*(?P<sign>>=|<=|>|<)\s*(?P<level>[^<>=]+))?")
_EXAMPLE = "NAME=CHANNEL, or NAME=CHANNEL>=LEVEL for a number"
GAP_S = 1.0  # [s] and ten sample times: what it said last does not hold longer


@dataclass(frozen=True, slots=True)
class LoggedRival:
    """A detector in the log: `name` in the tables, its `channel`; on where a number is beyond `level` by `sign`.

    Without a level the channel holds true and false, or 1 and 0.
    """

    name: str
    channel: str
    sign: str = ">"
    level: float | None = None

    @property
    def text(self) -> str:
        """`DAI.Level>=2`."""
        return self.channel if self.level is None else f"{self.channel}{self.sign}{self.level:g}"


@dataclass(frozen=True, slots=True)
class Heard:
    """What such a channel says on one drive: stretches in which it is on [s], and its least and greatest value.

    `missing`: why it could not be read, empty if it was; `note` on its sample rate.
    """

    spans: tuple[Span, ...] = ()
    low: float = math.nan
    high: float = math.nan
    missing: str = ""
    note: str = ""


def parse_rivals(texts: Sequence[str]) -> tuple[LoggedRival, ...]:
    """Read rivals such as `easyrain=DAI.Flag` and `own=Margin<=5`.

    Raises
    ------
    ConfigError
        For another form, a name that a detector bears, and one that stands twice.
    """
    found = tuple(_parsed(text) for text in texts)
    names = [r.name for r in found]
    twice = next((n for n in names if names.count(n) > 1), None)
    if twice is not None:
        raise ConfigError(f"--rival {twice} is given twice", expected="one channel for each name")
    return found


def _parsed(text: str) -> LoggedRival:
    where = f"--rival {text[:80]}"
    match = _RIVAL.fullmatch(text.strip())
    if match is None:
        raise ConfigError("is no rival", where=where, expected=_EXAMPLE)
    name, level = match["name"], match["level"]
    if name in BY_NAME:
        raise ConfigError(f'"{name}" is a detector of aqualog', where=where, expected="another name")
    if level is None:
        return LoggedRival(name, match["channel"])
    try:
        value = float(level)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ConfigError(f'"{level[:40]}" is no number', where=where, expected=_EXAMPLE)
    return LoggedRival(name, match["channel"], match["sign"], value)


def heard_in(
    paths: Sequence[Path], options: ReadOptions, signal_map: SignalMap, signals: Signals, rivals: Sequence[LoggedRival]
) -> dict[str, Heard]:
    """Read the channels of rivals from the files of a drive, on the clock of its signals.

    Each counts on its own stamps: its latency is not that of the grid.

    Raises
    ------
    SignalError
        If a channel holds numbers and no level was given, or the name fits several channels.
    LogError
        If a file cannot be read.
    """
    if not rivals:
        return {}
    with DriveLog(paths, options) as log:
        infos = log.channels()
        wanted = {r.name: _channel(infos, r) for r in rivals}
        anchor = _anchor(infos, signals)
        channels = log.read([*dict.fromkeys(c for c in (*wanted.values(), anchor) if isinstance(c, ChannelInfo))])
    out = {}
    zero = None if anchor is None else _zero_ns(channels[anchor.file, anchor.path], signal_map, signals)
    for r in rivals:
        info = wanted[r.name]
        if isinstance(info, str):
            out[r.name] = Heard(missing=info)
        else:
            out[r.name] = _heard(channels[info.file, info.path], r, signal_map, signals, zero)
    return out


def _channel(infos: Sequence[ChannelInfo], rival: LoggedRival) -> ChannelInfo | str:
    hits = matching(infos, rival.channel)
    if len(hits) == 1:
        return hits[0]
    if hits:
        raise SignalError(
            f'channel "{rival.channel}" of rival {rival.name} is ambiguous: '
            f"{', '.join(channel_id(h) for h in hits[:4])}",
            expected="one channel", hint="name its file, group or message too",
        )  # fmt: skip
    near = difflib.get_close_matches(rival.channel, [n for c in infos for n in (c.name, c.path)], n=1, cutoff=0.5)
    return f'no channel "{rival.channel}"' + (f' (nearest: "{near[0]}")' if near else "")


def _anchor(infos: Sequence[ChannelInfo], signals: Signals) -> ChannelInfo | None:
    """The channel on whose first sample a point of the grid lies."""
    wheels = [o for n, o in signals.origins.items() if n.startswith("omega_")]
    origin = next(iter([*wheels, *signals.origins.values()]), None)
    if origin is None:
        return None
    return next((c for c in infos if (c.file, c.path) == (origin.file, origin.channel)), None)


def _zero_ns(channel: Channel, signal_map: SignalMap, signals: Signals) -> int:
    """The stamp of t = 0 on the clock of a log that has no absolute time. [ns]"""
    symbol = next(o.symbol for o in signals.origins.values() if o.channel == channel.info.path)
    t, _ = clean_samples(channel)
    first = int(corrected(t, signal_map, channel.info.file)[0]) if t.size else 0
    known = np.flatnonzero(np.isfinite(np.asarray(signals.array(symbol), dtype=np.float64)))
    return first - int(known[0]) * signals.dt_ns if known.size else first


def _heard(channel: Channel, rival: LoggedRival, signal_map: SignalMap, signals: Signals, zero_ns: int | None) -> Heard:
    t_ns, x = clean_samples(channel)
    if not x.size:
        return Heard(missing=f'channel "{rival.channel}" holds no value')
    start = signals.start_ns if channel.absolute and signals.start_ns is not None else zero_ns
    own = corrected(t_ns, signal_map, channel.info.file)
    t: FloatArray = (own - (own[0] if start is None else start)).astype(np.float64) * 1e-9
    low, high = float(x.min()), float(x.max())
    if rival.level is None:
        if not np.isin(x, (0.0, 1.0)).all():
            raise SignalError(
                f'channel "{rival.channel}" of rival {rival.name} holds numbers ({low:g} ... {high:g})',
                expected="true and false", hint=f"--rival '{rival.name}={rival.channel}>=LEVEL'",
            )  # fmt: skip
        on = x > 0.5
    else:
        on = np.asarray(_OPERATORS[rival.sign](x, rival.level), dtype=bool)
    step = float(np.median(np.diff(t))) if t.size > 1 else math.nan
    end = signals.frame.height * signals.dt
    longest = max(GAP_S, 10.0 * step)
    cut = [(max(a, 0.0), min(b, end)) for a, b in _held(t, on, longest) if b > 0.0 and a < end]
    note = ""
    if step > 1.5 * signals.dt:
        note = (
            f"rival {rival.name}: its channel has {1.0 / step:.3g} Hz, the signals {1.0 / signals.dt:.3g} Hz: "
            f"its latency is known to {step:.2g} s"
        )
    return Heard(tuple(cut), low, high, note=note)


def _held(t: FloatArray, bits: BoolArray, longest: float) -> list[Span]:
    """Stretches in which it is on; across a gap what it said last holds no longer than `longest`. [s]"""
    out: list[Span] = []
    cuts = np.flatnonzero(np.diff(t) > longest) + 1
    for part_t, part_on in zip(np.split(t, cuts), np.split(bits, cuts), strict=True):
        out += spans_of(part_t, part_on)
    return out
