"""Run all detectors over one drive: in one go, in pieces, or sample by sample, with the same result to the bit."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from aqualog.core.notation import SYMBOLS
from aqualog.core.records import DriveResult, Event, FileFaults, FloatArray, Signals, SlopeSummary, Track, Unavailable
from aqualog.core.vehicle import Vehicle
from aqualog.detect.braking import BrakeWatch
from aqualog.detect.detector import Detector, Scene, Setup
from aqualog.detect.events import EventBook
from aqualog.detect.extremes import Extremes
from aqualog.detect.plausibility import Plausibility
from aqualog.detect.registry import all_of, check_needs, running_order
from aqualog.detect.settings import Settings
from aqualog.detect.slip_slope.history import Memory
from aqualog.detect.slip_slope.remarks import remarks
from aqualog.detect.slip_slope.watch import DropWatch
from aqualog.features.stream import Features, FeatureStream

if TYPE_CHECKING:
    from aqualog.align.windows import LongDrive

__all__ = ["ROWS", "DriveStream", "Piece", "Settings", "detect_drive", "detect_long", "in_order", "present_in"]

ROWS = 20_000  # samples that go through at once, 3 min at 100 Hz: some hundred arrays of 160 kB, which a cache holds


@dataclass(frozen=True, slots=True)
class Piece:
    """Result of one piece of a drive: features and tracks of its samples, and the events that ended in it."""

    features: Features
    tracks: tuple[Track, ...]
    events: tuple[Event, ...]


class DriveStream:
    """Feature and detector recursions of one drive with their state.

    Parameters
    ----------
    vehicle : Vehicle
    dt_ns : int
        Sample time. [ns]
    available : collection of str
        Symbols of the drive. Missing ones decide which detectors run (`unavailable`, `limited`).
    settings : Settings
    memory : Memory, optional
        Prior knowledge of the dry slip slope.
    detectors : iterable of Detector, optional
        The thesis' own by default.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        dt_ns: int,
        available: Collection[str],
        *,
        settings: Settings | None = None,
        memory: Memory | None = None,
        detectors: Iterable[Detector] | None = None,
    ) -> None:
        settings = settings or Settings()
        self.dt_ns = dt_ns
        self.dt = dt = dt_ns * 1e-9
        self.memory = memory or Memory()
        self._features = FeatureStream(vehicle, dt, available, correct_yaw=settings.correct_yaw)
        self._available = self._features.available
        chosen = tuple(all_of("effect", "joint") if detectors is None else detectors)
        unavailable, limited = check_needs(vehicle, available, rate_hz=1e9 / dt_ns, detectors=chosen)
        self.unavailable: tuple[Unavailable, ...] = tuple(unavailable)
        self.limited: tuple[Unavailable, ...] = tuple(limited)
        off = {u.detector for u in unavailable}
        self._book = EventBook(dt_ns)
        self._brakes = BrakeWatch(vehicle, dt)
        self.watches = {
            d: d.start(Setup(d, vehicle, dt, settings.thresholds.get(d.name, d.threshold), settings, self.memory))
            for d in running_order(chosen)
            if d.name not in off
        }

    def push(self, columns: Mapping[str, FloatArray]) -> Piece:
        """Take the next samples, one or more.

        Parameters
        ----------
        columns : mapping symbol -> array (n,)
            SI, NaN where missing.
        """
        f = self._features.push(columns)
        known = {s: columns[s] for s in self._available}
        scene = Scene(f, self._brakes.push(f, known), known)
        events: list[Event] = []
        for detector, watch in self.watches.items():
            output = watch.push(scene)
            for found in output.found:
                events += self._book.take(found.track, found.evidence, detector.severity, detector.explain)
            scene = scene.after(output)
        return Piece(scene.f, scene.tracks, tuple(events))

    def finish(self) -> tuple[Event, ...]:
        """Return events that are open at the end of the drive."""
        return self._book.finish()

    @property
    def slopes(self) -> tuple[SlopeSummary, ...]:
        """Return how the slip slope was estimated so far, place by place."""
        drops = (w for w in self.watches.values() if isinstance(w, DropWatch))
        return tuple(w.summary() for drop in drops for w in drop.watches)


def in_order(events: Iterable[Event]) -> tuple[Event, ...]:
    """Sort events by their beginning."""
    return tuple(sorted(events, key=lambda e: (e.start_s, e.detector, e.wheel or "", e.side or "")))


class _Through:
    """The one way through a drive: piece by piece through all detectors, with what is checked and gathered beside."""

    def __init__(
        self, vehicle: Vehicle, dt_ns: int, present: Sequence[str], settings: Settings | None, memory: Memory | None
    ) -> None:
        self._stream = DriveStream(vehicle, dt_ns, present, settings=settings, memory=memory)
        self._plausibility = Plausibility(present, vehicle, self._stream.dt)
        self._vehicle = vehicle
        self._events: list[Event] = []

    def push(self, columns: Mapping[str, FloatArray]) -> Piece:
        piece = self._stream.push(columns)
        self._plausibility.push(columns, piece.features)
        self._events += piece.events
        return piece

    def result(self, signals: Signals, features: Mapping[str, FloatArray], tracks: tuple[Track, ...]) -> DriveResult:
        import polars as pl

        stream = self._stream
        slopes = stream.slopes
        return DriveResult(
            signals=signals,
            features=pl.DataFrame(features),
            tracks=tracks,
            events=in_order((*self._events, *stream.finish())),
            unavailable=stream.unavailable,
            limited=stream.limited,
            vehicle_name=self._vehicle.name,
            notes=(*self._plausibility.notes(), *remarks(slopes)),
            slopes=slopes,
        )


class _Gathered:
    """Collect features and tracks of the pieces of a drive in arrays of the whole; or tracks by name alone."""

    def __init__(self, rows: int, *, samples: bool) -> None:
        self._rows = rows
        self._samples = samples
        self._at = 0
        self.features: dict[str, FloatArray] = {}
        self.tracks: tuple[Track, ...] = ()

    def add(self, piece: Piece, n: int) -> None:
        """Take the next piece, of n samples."""
        if self._samples and n == self._rows:
            self.features, self.tracks = dict(piece.features), piece.tracks
            return
        if self._at == 0:
            rows = self._rows if self._samples else 0
            self.features = {k: np.empty(rows, x.dtype) for k, x in piece.features.items()} if rows else {}
            self.tracks = tuple(
                replace(t, statistic=np.empty(rows), active=np.empty(rows, dtype=bool)) for t in piece.tracks
            )
        here = slice(self._at, self._at + n)
        self._at += n
        if not self._samples:
            return
        for name, x in piece.features.items():
            self.features[name][here] = x
        for whole, part in zip(self.tracks, piece.tracks, strict=True):
            whole.statistic[here], whole.active[here] = part.statistic, part.active


def detect_drive(
    signals: Signals,
    vehicle: Vehicle,
    *,
    settings: Settings | None = None,
    memory: Memory | None = None,
    samples: bool = True,
) -> DriveResult:
    """Run all detectors over one drive.

    Parameters
    ----------
    signals : Signals
    vehicle : Vehicle
    settings : Settings
    memory : Memory, optional
        Prior knowledge of the dry slip slope; `slip_slope.history.remembered` adds what this drive has shown.
    samples : bool
        Whether to keep features and tracks with all their samples; without them the result has them empty.

    Returns
    -------
    DriveResult
        Events in order of their beginning.
    """
    # a column without a single value is a signal that the drive does not have
    rows = signals.frame.height
    present = [s for s in signals.symbols if signals.frame[s].null_count() < rows]
    through = _Through(vehicle, signals.dt_ns, present, settings, memory)
    columns = {s: signals.array(s) for s in (present or ["v_x"])}
    gathered = _Gathered(rows, samples=samples)
    for at in range(0, max(rows, 1), ROWS):
        piece = through.push({s: x[at : at + ROWS] for s, x in columns.items()})
        gathered.add(piece, min(ROWS, rows - at))
    return through.result(signals, gathered.features, gathered.tracks)


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
    drive : LongDrive
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
    through = _Through(vehicle, dt_ns, present, settings, memory)
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

    columns = {name: pl.Series(x).fill_nan(None) for (kind, name), x in seen.items() if kind == "signal"}
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
