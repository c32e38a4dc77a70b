"""Run all detectors over a drive that is longer than memory, and keep the extremes of its stretches for a page."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from aqualog.core.notation import SYMBOLS
from aqualog.core.records import DriveResult, FileFaults, FloatArray, Signals, Track
from aqualog.core.vehicle import Vehicle
from aqualog.detect.detector import Settings
from aqualog.detect.slip_slope.history import Memory
from aqualog.detect.stream import ROWS, Piece, Through

if TYPE_CHECKING:
    from aqualog.align.windows import LongDrive

__all__ = ["Extremes", "detect_long", "present_in"]

STRETCHES = 50_000

_Key = TypeVar("_Key", bound=Hashable)


class Extremes:
    """Two rows for each stretch of a drive of so many rows: least and greatest value, in the order of their times."""

    def __init__(self, rows: int, dt_ns: int) -> None:
        self._length = max(2, -(-rows // STRETCHES))
        self._length += self._length % 2
        self.dt_ns = self._length * dt_ns // 2
        self._left = rows
        self._rest: dict[Hashable, FloatArray] = {}
        self._kept: dict[Hashable, list[FloatArray]] = {}

    def push(self, columns: Mapping[_Key, FloatArray]) -> None:
        """Take the next rows (n,) of all columns; a stretch without any number is drawn as NaN."""
        n = next(iter(columns.values())).size
        self._left -= n
        for key, new in columns.items():
            x = np.concatenate([self._rest[key], new]) if key in self._rest else new
            if self._left <= 0 and x.size % self._length:
                x = np.concatenate([x, np.full(-x.size % self._length, np.nan)])
            whole = x.size // self._length * self._length
            self._kept.setdefault(key, []).append(_extremes(x[:whole].reshape(-1, self._length)))
            self._rest[key] = x[whole:].copy()

    def columns(self) -> dict[_Key, FloatArray]:
        """Return the extremes, by the names that were given."""
        return {key: np.concatenate(parts) for key, parts in self._kept.items()}  # type: ignore[misc]


def _extremes(x: FloatArray) -> FloatArray:
    """Return least and greatest value of each row (m, k), earlier first: (2 m,)."""
    missing = np.isnan(x)
    low, high = np.where(missing, np.inf, x), np.where(missing, -np.inf, x)
    at_low, at_high = low.argmin(axis=1), high.argmax(axis=1)
    m = np.arange(len(x))
    out = np.stack([x[m, np.minimum(at_low, at_high)], x[m, np.maximum(at_low, at_high)]], axis=1)
    nothing = missing.all(axis=1)
    out[nothing] = np.nan
    return np.asarray(out.reshape(-1))


def detect_long(
    drive: LongDrive,
    vehicle: Vehicle,
    *,
    settings: Settings | None = None,
    memory: Memory | None = None,
    faults: Sequence[FileFaults] = (),
    rows: int = ROWS,
    keep: Callable[[DriveResult], None] | None = None,
    present: Sequence[str] | None = None,
    pictured: bool = False,
    tell: Callable[[float], None] = lambda _: None,
) -> DriveResult:
    """Run all detectors over a drive that is longer than memory, a window at a time.

    Parameters
    ----------
    vehicle, settings, memory
        As of `detect_drive`.
    faults : sequence of FileFaults
        Losses of the readers, as the first pass found.
    rows : int
        Of a window.
    keep : callable, optional
        Called with each window, its signals, features and tracks, in order.
    present : sequence of str, optional
        Result of `present_in`.
    pictured : bool
        With least and greatest values of stretches of the drive, for a page.
    tell : callable
        Called with the share of the drive that is done.

    Returns
    -------
    DriveResult
        Events equal those of `detect_drive`; signals, features and tracks are extremes of stretches, or empty.
    """
    import polars as pl

    present = present_in(drive, rows) if present is None else present
    dt_ns = drive.plan.grid.dt_ns
    through = Through(vehicle, dt_ns, present, settings, memory)
    missing = dict.fromkeys(drive.plan.symbols, 0)
    bridged: set[str] = set()
    extremes = Extremes(drive.plan.grid.rows, dt_ns)
    tracks: tuple[Track, ...] = ()
    for signals, gaps in drive.windows(rows):
        piece = through.push({s: signals.array(s) for s in (present or ["v_x"])})
        bridged |= {s for s, is_bridged in gaps.items() if is_bridged}
        for s in signals.symbols:
            missing[s] += signals.frame[s].null_count()
        tracks = piece.tracks
        if keep is not None:
            keep(DriveResult(signals, pl.DataFrame(dict(piece.features)), tracks, (), (), (), vehicle.name))
        if pictured:
            extremes.push(dict(_named(signals, piece)))
        tell(float(signals.frame["t"][-1]) / max(drive.plan.grid.rows * dt_ns * 1e-9, 1e-9))
    whole = drive.plan.facts(missing, frozenset(bridged), faults)
    seen: dict[tuple[str, str], FloatArray] = extremes.columns()
    features = {name: x for (kind, name), x in seen.items() if kind == "feature"}
    return through.result(_coarse(whole, drive, seen, extremes.dt_ns), features, tuple(_coarse_tracks(tracks, seen)))


def present_in(drive: LongDrive, rows: int = ROWS) -> list[str]:
    """Return symbols with a value anywhere; mostly the first window of so many rows suffices."""
    seen: set[str] = set()
    for signals, _ in drive.windows(rows):
        seen |= {s for s in signals.symbols if signals.frame[s].null_count() < signals.frame.height}
        if len(seen) == len(drive.plan.symbols):
            break
    return [s for s in drive.plan.symbols if s in seen]


def _named(signals: Signals, piece: Piece) -> Iterator[tuple[tuple[str, str], FloatArray]]:
    """Yield all columns of a window, by kind and name; tracks by their number."""
    yield from ((("signal", s), signals.array(s)) for s in signals.symbols)
    yield from ((("feature", f), x) for f, x in piece.features.items())
    yield from ((("statistic", str(i)), t.statistic) for i, t in enumerate(piece.tracks))
    yield from ((("bit", str(i)), t.active.astype(np.float64)) for i, t in enumerate(piece.tracks))


def _coarse(whole: Signals, drive: LongDrive, seen: Mapping[tuple[str, str], FloatArray], dt_ns: int) -> Signals:
    import polars as pl

    columns = {name: pl.Series(x, nan_to_null=True) for (kind, name), x in seen.items() if kind == "signal"}
    columns = {s: x.cast(pl.Boolean) if SYMBOLS[s].unit == "bool" else x for s, x in columns.items()}
    n = next(iter(columns.values())).len() if columns else 0
    empty = {s: pl.Series([], dtype=pl.Float64) for s in drive.plan.symbols}
    frame = pl.DataFrame({"t": np.arange(n) * dt_ns * 1e-9, **(columns or empty)})
    return replace(whole, frame=frame, dt_ns=dt_ns, full=(drive.plan.grid.rows, drive.plan.grid.dt_ns))


def _coarse_tracks(tracks: Sequence[Track], seen: Mapping[tuple[str, str], FloatArray]) -> Iterator[Track]:
    nothing: FloatArray = np.zeros(0)
    for i, track in enumerate(tracks):
        bits = np.asarray(seen.get(("bit", str(i)), nothing) > 0.0)
        yield replace(track, statistic=seen.get(("statistic", str(i)), nothing), active=bits)
