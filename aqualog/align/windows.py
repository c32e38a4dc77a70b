"""Build a drive that is longer than memory window by window, on the same grid as in one go.

The files are read twice. The first pass finds what depends on the whole of a signal: first and last stamp, sample
times, counts. (A frozen or joined one needs one pass more.) The second pass reads the samples. A window's values
equal those of `build_signals` bit for bit: both use the same cleaner, and every point of the grid has the same samples
around it.
Stamps out of order or rounded, resets and wraps need the whole channel: such a log raises `NotInPiecesError` before
the first window.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.align.clean import Cleaner, Samples, SpanWatch, Taken, corrected
from aqualog.align.mapping import SignalMap
from aqualog.align.table import Found, Plan, cleaners_of, plan_drive
from aqualog.align.timebase import DAY_NS
from aqualog.core.records import Channel, ChannelInfo, FloatArray, Signals, TimeArray, TimeFaults
from aqualog.core.vehicle import Vehicle
from aqualog.io.reader import Part

__all__ = ["LongDrive", "NotInPiecesError", "Parts", "long_drive"]

_MAX_ROWS = 4_000_000_000
_MANY = 100  # steps, of which half are no doubled samples: rounded stamps are spread in a whole channel
_SECOND = 1_000_000_000

Parts = Callable[[], Sequence[Part]]  # every call goes through the files anew


class NotInPiecesError(Exception):
    """The log can only be cleaned as a whole."""


@dataclass(frozen=True, slots=True)
class LongDrive:
    """A drive whose first pass is done and whose windows can be made."""

    plan: Plan
    _found: Found
    _parts: Parts
    _map: SignalMap

    def windows(self, rows: int) -> Iterator[tuple[Signals, Mapping[str, bool]]]:
        """Yield the drive in windows of so many rows, the last one shorter.

        Yields
        ------
        signals : Signals
            `t` from the first sample of the drive; `origins` and `quality` are empty.
        bridged : mapping signal of the map -> bool
            Whether a sample of it was missing somewhere in the window.
        """
        grid = self.plan.grid
        cleaners = cleaners_of(self._found, self._map, self.plan.vehicle, self.plan.unmeasured)
        buffers = {c.origin.symbol: _Buffer(c.origin.symbol, c.span.last_ns) for c in self.plan.cleaned}
        signals = {n: _InOrder(c, self._map, is_known=True) for n, c in cleaners.items()}
        source = _Source(self._parts(), self._found, signals)
        for first in range(0, grid.rows, rows):
            last = min(first + rows, grid.rows)
            end_ns = grid.start_ns + (last - 1) * grid.dt_ns
            until = end_ns + grid.dt_ns
            while (
                lagging := next((b for b in buffers.values() if b.last_ns < min(until, b.end_ns)), None)
            ) is not None:
                if not source.pull(lagging.symbol, buffers):
                    raise NotInPiecesError(f"{lagging.symbol}: the second pass found less than the first")
            yield self.plan.table({name: b.samples() for name, b in buffers.items()}, first, last)
            for b in buffers.values():
                b.forget(end_ns)


def long_drive(
    found: Found, parts: Parts, *, signal_map: SignalMap, vehicle: Vehicle, rate_hz: float | None = None,
    dbc: Sequence[str] = (), tell: Callable[[int], None] = lambda _: None,
) -> LongDrive:  # fmt: skip
    """Read the files once and plan the windows, of channels as `resolve` finds them; the rest as of `build_signals`.

    `parts` returns the pieces of the channels, from the start at each call; `tell` is called with the number of samples
    read so far.

    Raises
    ------
    NotInPiecesError
        If a channel can only be repaired as a whole.
    SignalError, ConfigError
        As `build_signals`.
    """

    def take(cleaners: Mapping[str, Cleaner]) -> dict[str, Taken]:
        signals = {name: _InOrder(cleaner, signal_map) for name, cleaner in cleaners.items()}
        done = 0
        for part in parts():
            for piece in part.pieces:
                for channel in piece:
                    for name in _names_of(found, channel.info):
                        if name in signals:
                            signals[name].push(channel)
                    done += channel.t_ns.size
                tell(done)
        for signal in signals.values():
            signal.finish()
        return {name: signal.taken() for name, signal in signals.items()}

    plan = plan_drive(
        found, take, signal_map=signal_map, vehicle=vehicle, rate_hz=rate_hz, most_rows=_MAX_ROWS, dbc=dbc
    )
    return LongDrive(plan, {c.origin.symbol: found[c.origin.symbol] for c in plan.cleaned}, parts, signal_map)


def _names_of(found: Found, info: ChannelInfo) -> list[str]:
    return [s for s, (_, own) in found.items() if (own.file, own.path) == (info.file, info.path)]


class _InOrder:
    """One signal that arrives piece by piece: doubled stamps are left out, and none may run backwards.

    `is_known`: an earlier pass has found its spans, and `taken` is not called.
    """

    def __init__(self, cleaner: Cleaner, signal_map: SignalMap, *, is_known: bool = False) -> None:
        self._cleaner, self._map, self._is_known = cleaner, signal_map, is_known
        self._held_t: TimeArray = np.zeros(0, dtype=np.int64)  # the last sample: one with the same stamp may follow
        self._held_raw: FloatArray = np.zeros(0)
        self._every, self._used = SpanWatch(), SpanWatch()
        self._samples = self._duplicates = 0
        self._pauses: list[tuple[int, int]] = []  # how long, and after which stamp [ns]
        self._first_duplicate_ns: int | None = None
        self._absolute = False

    def push(self, channel: Channel) -> Samples:
        """Return usable samples that are now certain, in SI; the rest comes with later pieces."""
        if not channel.t_ns.size:
            return channel.t_ns, channel.values
        if not self._samples:
            self._absolute = channel.absolute
        self._samples += channel.t_ns.size
        t = np.concatenate([self._held_t, corrected(channel.t_ns, self._map, self._cleaner.info.file)])
        raw = np.concatenate([self._held_raw, channel.values])
        self._held_t, self._held_raw = t[-1:].copy(), raw[-1:].copy()
        steps = np.diff(t)
        shortest, longest = steps.min(initial=1), steps.max(initial=1)
        if shortest < 0:
            raise NotInPiecesError(f"{self._cleaner.where}: time stamps out of order")
        if longest > DAY_NS:
            raise NotInPiecesError(f"{self._cleaner.where}: time stamps that leap")
        if shortest > 0:
            return self._clean(t[:-1], raw[:-1])
        same = steps == 0
        if 2 * int(same.sum()) > steps.size > _MANY:
            raise NotInPiecesError(f"{self._cleaner.where}: time stamps that many samples share")
        self._duplicates += int(same.sum())
        if self._first_duplicate_ns is None:
            self._first_duplicate_ns = int(t[np.argmax(same)])
        return self._clean(t[:-1][~same], raw[:-1][~same])

    def finish(self) -> Samples:
        """Return the samples that were held back."""
        return self._clean(self._held_t, self._held_raw, is_last=True)

    def _clean(self, t: TimeArray, raw: FloatArray, *, is_last: bool = False) -> Samples:
        every = t
        if t.size or is_last:
            t, raw = self._cleaner.push(t, raw, is_last=is_last)
        if not self._is_known:
            steps = self._every.push(every)
            for k in np.flatnonzero(steps > _SECOND).tolist():
                self._pauses.append((int(steps[k]), int(every[every.size - steps.size + k] - steps[k])))
            self._used.push(t)
        return t, raw

    def taken(self) -> Taken:
        """Return what is known of the signal; complete after `finish`."""
        every = self._every.finish()
        pauses = [at for step, at in self._pauses if step > 10 * every.period_ns]
        places = {"duplicates": self._first_duplicate_ns, "pauses": pauses[0] if pauses else None}
        first_s = {kind: (at - every.first_ns) * 1e-9 for kind, at in places.items() if at is not None}
        faults = TimeFaults(duplicates=self._duplicates, pauses=len(pauses), first_s=first_s)
        return Taken(self._samples, every, self._used.finish(), faults, self._absolute)


class _Buffer:
    """Samples of one signal that later windows still need."""

    def __init__(self, symbol: str, end_ns: int) -> None:
        self.symbol = symbol
        self.end_ns = end_ns
        self.last_ns = -(1 << 62)
        self._t: list[TimeArray] = []
        self._x: list[FloatArray] = []

    def add(self, t: TimeArray, x: FloatArray) -> None:
        if t.size:
            self._t.append(t)
            self._x.append(x)
            self.last_ns = int(t[-1])

    def samples(self) -> Samples:
        if len(self._t) != 1:
            self._t = [np.concatenate(self._t) if self._t else np.zeros(0, dtype=np.int64)]
            self._x = [np.concatenate(self._x) if self._x else np.zeros(0)]
        return self._t[0], self._x[0]

    def forget(self, point_ns: int) -> None:
        """Keep what later points may need: bins begin half a step before their point."""
        t, x = self.samples()
        start = max(int(np.searchsorted(t, point_ns, side="right")) - 1, 0)
        self._t, self._x = [t[start:].copy()], [x[start:].copy()]


class _Source:
    """The second pass: read pieces on demand, of the part whose signal is furthest behind."""

    def __init__(self, parts: Sequence[Part], found: Found, signals: Mapping[str, _InOrder]) -> None:
        self._pieces = [p.pieces for p in parts]
        self._found = found
        self._signals = signals
        self._symbols = [[s for s, (_, i) in found.items() if (i.file, i.path) in p.channels] for p in parts]
        self._ended: set[int] = set()

    def pull(self, symbol: str, buffers: Mapping[str, _Buffer]) -> bool:
        """Read one piece more of the part with this signal; return False at its end."""
        i = next(k for k, symbols in enumerate(self._symbols) if symbol in symbols)
        if i in self._ended:
            return False
        piece = next(self._pieces[i], None)
        if piece is None:
            self._ended.add(i)
            for name in self._symbols[i]:
                buffers[name].add(*self._signals[name].finish())
            return True
        for channel in piece:
            for name in _names_of(self._found, channel.info):
                buffers[name].add(*self._signals[name].push(channel))
        return True
