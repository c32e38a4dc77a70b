"""Build a drive that is longer than memory window by window, on the same grid as in one go.

The files are read twice. The first pass finds what depends on the whole of a signal: first and last stamp, sample
times, counts. (A frozen signal needs one pass more.) The second pass reads the samples. A window's values equal those
of `build_signals` bit for bit: every point of the grid has the same samples around it. A log for which that cannot be
promised raises `NotInPiecesError` before the first window.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl

from aqualog.align.clean import Clean
from aqualog.align.freezes import Freeze, while_moving
from aqualog.align.grid import Grid, columns_of, common_clock, frame_of, grid_of, missing_samples, onto_grid
from aqualog.align.mapping import Entry, SignalMap
from aqualog.align.pieces import NotInPiecesError, PieceCleaner
from aqualog.align.quality import missing_notes, quality_of
from aqualog.align.standing import SPEEDS, standing_by
from aqualog.core.errors import SignalError
from aqualog.core.notation import SYMBOLS
from aqualog.core.records import Channel, ChannelInfo, FileFaults, FloatArray, Origin, Signals, TimeArray
from aqualog.core.vehicle import Vehicle
from aqualog.io.base import Part

__all__ = ["LongDrive", "NotInPiecesError", "Parts", "long_drive"]

_MAX_ROWS = 4_000_000_000

Found = Mapping[str, tuple[Entry, ChannelInfo]]
Freezes = Mapping[str, tuple[Freeze, ...]]
Parts = Callable[[], Sequence[Part]]  # every call goes through the files anew


@dataclass(frozen=True, slots=True)
class LongDrive:
    """A drive whose first pass is done and whose windows can be made.

    `cleaned`: its signals without samples; `notes` on them; `absolute`: whether the grid counts from 1970.
    """

    grid: Grid
    absolute: bool
    cleaned: tuple[Clean, ...]
    notes: tuple[str, ...]
    _found: Found
    _parts: Parts
    _map: SignalMap
    _vehicle: Vehicle
    _freezes: Freezes

    @property
    def symbols(self) -> tuple[str, ...]:
        """Return canonical signals in their usual order."""
        names = {n for c in self.cleaned for n, _ in columns_of(c.symbol, np.zeros(0), self._vehicle)}
        return tuple(n for n in SYMBOLS if n in names)

    @property
    def files(self) -> tuple[str, ...]:
        """Return files of its signals."""
        return tuple(dict.fromkeys(c.origin.file for c in self.cleaned))

    def windows(self, rows: int) -> Iterator[tuple[Signals, Mapping[str, bool]]]:
        """Yield the drive in windows of so many rows, the last one shorter.

        Yields
        ------
        signals : Signals
            `t` from the first sample of the drive; `origins` and `quality` are empty.
        bridged : mapping signal of the map -> bool
            Whether a sample of it was missing somewhere in the window.
        """
        cleaners = _cleaners(self._found, self._map, self._vehicle, self._freezes)
        buffers = {c.origin.symbol: _Buffer(c) for c in self.cleaned}
        source = _Source(self._parts(), self._found, cleaners)
        at = 0
        while at < self.grid.rows:
            last = min(at + rows, self.grid.rows)
            points = self.grid.points(at, last)
            until = int(points[-1]) + self.grid.dt_ns
            while (
                lagging := next((b for b in buffers.values() if b.last_ns < min(until, b.end_ns)), None)
            ) is not None:
                if not source.pull(lagging.symbol, buffers):
                    raise NotInPiecesError(f"{lagging.symbol}: the second pass found less than the first")
            yield self._window(points, at, last, buffers)
            for b in buffers.values():
                b.forget(int(points[-1]))
            at = last

    def _window(
        self, points: TimeArray, at: int, last: int, buffers: Mapping[str, _Buffer]
    ) -> tuple[Signals, Mapping[str, bool]]:
        columns: dict[str, pl.Series] = {}
        bridged: dict[str, bool] = {}
        for clean in self.cleaned:
            t, x = buffers[clean.origin.symbol].samples()
            y, bridged[clean.origin.symbol] = onto_grid(clean.symbol, clean.span, t, x, points, self.grid.dt_ns)
            for name, series in columns_of(clean.symbol, y, self._vehicle):
                columns.setdefault(name, series)
        frame = frame_of(self.grid.seconds(at, last), columns, self.symbols)
        start = self.grid.start_ns if self.absolute else None
        return Signals(frame, self.grid.dt_ns, start, {}, quality_of((), (), ()), ()), bridged

    def facts(self, missing: Mapping[str, int], bridged: frozenset[str], faults: Sequence[FileFaults]) -> Signals:
        """Return origins and quality of the whole drive, with an empty table.

        Parameters
        ----------
        missing : mapping symbol -> int
            Rows without a value, of all windows.
        bridged : frozenset of str
            Signals of the map of which a sample was missing.
        faults : sequence of FileFaults
            Of the first pass.
        """
        origins: dict[str, Origin] = {}
        for clean in self.cleaned:
            seen = missing_samples(clean.span, self.grid) if clean.origin.symbol in bridged else 0.0
            for name, _ in columns_of(clean.symbol, np.zeros(0), self._vehicle):
                share = max(missing[name] / self.grid.rows, seen)
                origins.setdefault(name, replace(clean.origin, symbol=name, missing_fraction=share))
        frame = pl.DataFrame({"t": pl.Series([], dtype=pl.Float64)})
        start = self.grid.start_ns if self.absolute else None
        ordered = {n: origins[n] for n in SYMBOLS if n in origins}
        quality = quality_of(self.cleaned, faults, [*self.notes, *missing_notes(ordered.values())])
        return Signals(frame, self.grid.dt_ns, start, ordered, quality, self.files)


def long_drive(
    found: Found,
    parts: Parts,
    *,
    signal_map: SignalMap,
    vehicle: Vehicle,
    rate_hz: float | None = None,
    tell: Callable[[int], None] = lambda _: None,
) -> LongDrive:
    """Read the files once and plan the windows.

    Parameters
    ----------
    found : mapping symbol -> (entry, channel)
        As found by `resolve`.
    parts : callable
        Returns the pieces of the channels, from the start at each call.
    signal_map, vehicle, rate_hz
        As of `build_signals`.
    tell : callable
        Called with the number of samples read so far.

    Raises
    ------
    NotInPiecesError
        If a channel can only be repaired as a whole.
    SignalError, ConfigError
        As `build_signals`.
    """
    notes: list[str] = []
    cleaners = _cleaners(found, signal_map, vehicle, None, notes)
    clocks = _gone_through(cleaners, found, parts, tell)
    standing = standing_by(w for n in SPEEDS if n in clocks and (w := cleaners[n].stands) is not None)
    freezes = {
        name: while_moving(cleaner.frozen(), standing) if name.startswith("torque_") else cleaner.frozen()
        for name, cleaner in cleaners.items()
    }
    if any(freezes.values()):  # rare: sample times and counts are those without what is frozen
        cleaners = _cleaners(found, signal_map, vehicle, freezes)
        _gone_through(cleaners, found, parts, tell)
    cleaned = []
    for name, cleaner in cleaners.items():
        clean, own = cleaner.cleaned()
        notes += own
        if clean.span.samples and name in clocks:
            cleaned.append(clean)
    if not cleaned:
        raise SignalError("no usable signal", expected="at least wheel speeds", hint="`aqualog inspect LOG`")
    absolute = common_clock([clocks[c.origin.symbol] for c in cleaned], signal_map)
    grid = grid_of(cleaned, rate_hz, most_rows=_MAX_ROWS)
    kept = {c.origin.symbol: found[c.origin.symbol] for c in cleaned}
    return LongDrive(grid, absolute, tuple(cleaned), tuple(notes), kept, parts, signal_map, vehicle, freezes)


def _gone_through(
    cleaners: Mapping[str, PieceCleaner], found: Found, parts: Parts, tell: Callable[[int], None]
) -> dict[str, Channel]:
    """Pass all samples to the cleaners; return the channels with any samples, without the samples."""
    clocks: dict[str, Channel] = {}
    done = 0
    for part in parts():
        for piece in part.pieces:
            for channel in piece:
                for name in _names_of(found, channel.info):
                    if name in cleaners:
                        cleaners[name].push(channel.t_ns, channel.values, absolute=channel.absolute)
                        clocks.setdefault(name, replace(channel, t_ns=channel.t_ns[:0], values=channel.values[:0]))
                done += channel.t_ns.size
            tell(done)
    for cleaner in cleaners.values():
        cleaner.finish()
    return clocks


def _cleaners(
    found: Found, signal_map: SignalMap, vehicle: Vehicle, freezes: Freezes | None, notes: list[str] | None = None
) -> dict[str, PieceCleaner]:
    out = {}
    for name, (entry, info) in found.items():
        try:
            known = None if freezes is None else freezes.get(name, ())
            out[name] = PieceCleaner(name, entry, info, signal_map, vehicle, known)
        except SignalError as error:
            if notes is not None:
                notes.append(f"{error.line()}; the signal is left out")
    return out


def _names_of(found: Found, info: ChannelInfo) -> list[str]:
    return [s for s, (_, own) in found.items() if (own.file, own.path) == (info.file, info.path)]


class _Buffer:
    """Samples of one signal that later windows still need."""

    def __init__(self, clean: Clean) -> None:
        self.symbol = clean.origin.symbol
        self.end_ns = clean.span.last_ns
        self.last_ns = -(1 << 62)
        self._t: list[TimeArray] = []
        self._x: list[FloatArray] = []

    def add(self, t: TimeArray, x: FloatArray) -> None:
        if t.size:
            self._t.append(t)
            self._x.append(x)
            self.last_ns = int(t[-1])

    def samples(self) -> tuple[TimeArray, FloatArray]:
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

    def __init__(self, parts: Sequence[Part], found: Found, cleaners: dict[str, PieceCleaner]) -> None:
        self._pieces = [p.pieces for p in parts]
        self._found = found
        self._cleaners = cleaners
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
                buffers[name].add(*self._cleaners[name].finish())
            return True
        for channel in piece:
            for name in _names_of(self._found, channel.info):
                t, x = self._cleaners[name].push(channel.t_ns, channel.values, absolute=channel.absolute)
                buffers[name].add(t, x)
        return True
