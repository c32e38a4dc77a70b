"""Run all detectors over a drive that is longer than memory, window by window with the detectors' state kept."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import polars as pl

from aqualog.align.windows import LongDrive
from aqualog.core.notation import SYMBOLS
from aqualog.core.records import DriveResult, Event, FileFaults, FloatArray, Signals, Track
from aqualog.core.vehicle import Vehicle
from aqualog.detect.picture import Picture
from aqualog.detect.plausibility import Plausibility
from aqualog.detect.slip_slope.remarks import remarks
from aqualog.detect.slip_slope.watch import Memory
from aqualog.detect.stream import DriveStream, Settings, in_order

__all__ = ["ROWS", "detect_long", "present_in"]

ROWS = 20_000  # of a window: 3 min at 100 Hz, some hundred arrays of 160 kB, which a cache holds


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
    """Run all detectors over one drive, a window at a time.

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
        Events equal those of `detect_drive`; signals, features and tracks are a picture of the drive, or empty.
    """
    present = present_in(drive, rows) if present is None else present
    dt_ns = drive.plan.grid.dt_ns
    stream = DriveStream(vehicle, dt_ns, present, settings=settings, memory=memory)
    plausibility = Plausibility(present, vehicle, stream.dt)
    missing = dict.fromkeys(drive.plan.symbols, 0)
    bridged: set[str] = set()
    events: list[Event] = []
    picture = Picture(drive.plan.grid.rows, dt_ns)
    tracks: tuple[Track, ...] = ()
    for signals, gaps in drive.windows(rows):
        columns = {s: signals.array(s) for s in (present or ["v_x"])}
        piece = stream.push(columns)
        plausibility.push(columns, piece.features)
        events += piece.events
        bridged |= {s for s, is_bridged in gaps.items() if is_bridged}
        for s in signals.symbols:
            missing[s] += signals.frame[s].null_count()
        tracks = piece.tracks
        if keep is not None:
            features = pl.DataFrame(dict(piece.features))
            keep(DriveResult(signals, features, tracks, (), (), (), vehicle.name))
        if pictured:
            picture.push({
                **{("signal", s): signals.array(s) for s in signals.symbols},
                **{("feature", f): x for f, x in piece.features.items()},
                **{("statistic", str(i)): t.statistic for i, t in enumerate(tracks)},
                **{("bit", str(i)): t.active.astype(np.float64) for i, t in enumerate(tracks)},
            })  # fmt: skip
        tell(float(signals.frame["t"][-1]) / max(drive.plan.grid.rows * dt_ns * 1e-9, 1e-9))
    slopes = tuple(w.summary() for w in stream.slope_watches)
    whole = drive.plan.facts(missing, frozenset(bridged), faults)
    seen: dict[tuple[str, str], FloatArray] = picture.columns()
    return DriveResult(
        signals=_pictured(whole, drive, seen, picture.dt_ns),
        features=pl.DataFrame({name: x for (kind, name), x in seen.items() if kind == "feature"}),
        tracks=_tracks(tracks, seen),
        events=in_order((*events, *stream.finish())),
        unavailable=stream.unavailable,
        limited=stream.limited,
        vehicle_name=vehicle.name,
        notes=(*plausibility.notes(), *remarks(slopes)),
        slopes=slopes,
    )


def present_in(drive: LongDrive, rows: int = ROWS) -> list[str]:
    """Return symbols with a value anywhere; mostly the first window of so many rows suffices."""
    seen: set[str] = set()
    for signals, _ in drive.windows(rows):
        seen |= {s for s in signals.symbols if signals.frame[s].null_count() < signals.frame.height}
        if len(seen) == len(drive.plan.symbols):
            break
    return [s for s in drive.plan.symbols if s in seen]


def _pictured(whole: Signals, drive: LongDrive, seen: Mapping[tuple[str, str], FloatArray], dt_ns: int) -> Signals:
    columns = {name: pl.Series(x).fill_nan(None) for (kind, name), x in seen.items() if kind == "signal"}
    columns = {s: x.cast(pl.Boolean) if SYMBOLS[s].unit == "bool" else x for s, x in columns.items()}
    n = next(iter(columns.values())).len() if columns else 0
    empty = {s: pl.Series([], dtype=pl.Float64) for s in drive.plan.symbols}
    frame = pl.DataFrame({"t": np.arange(n) * dt_ns * 1e-9, **(columns or empty)})
    return replace(whole, frame=frame, dt_ns=dt_ns, full=(drive.plan.grid.rows, drive.plan.grid.dt_ns))


def _tracks(tracks: Sequence[Track], seen: Mapping[tuple[str, str], FloatArray]) -> tuple[Track, ...]:
    nothing: FloatArray = np.zeros(0)
    return tuple(
        replace(
            t,
            statistic=seen.get(("statistic", str(i)), nothing),
            active=np.asarray(seen.get(("bit", str(i)), nothing) > 0.0),
        )
        for i, t in enumerate(tracks)
    )
