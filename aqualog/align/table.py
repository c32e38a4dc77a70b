"""Build one table of the channels of a drive."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import polars as pl

from aqualog.align.clean import Stamps, clean_channel
from aqualog.align.grid import columns_of, common_clock, frame_of, grid_of, missing_samples, onto_grid
from aqualog.align.mapping import Entry, SignalMap
from aqualog.align.quality import missing_notes, quality_of
from aqualog.align.resample import placed
from aqualog.align.shared import OfLast
from aqualog.align.standing import SPEEDS, StandWatch, Stretch, stand_watch_of, standing_by
from aqualog.core.errors import SignalError
from aqualog.core.notation import SYMBOLS
from aqualog.core.records import Channel, FileFaults, Origin, Signals
from aqualog.core.vehicle import Vehicle

__all__ = ["build_signals"]


def build_signals(
    mapped: Mapping[str, tuple[Entry, Channel]],
    *,
    signal_map: SignalMap,
    vehicle: Vehicle,
    file_faults: Sequence[FileFaults] = (),
    rate_hz: float | None = None,
) -> Signals:
    """Bring the mapped channels of one drive onto one integer-nanosecond grid.

    Continuous signals are interpolated linearly, or averaged over a grid step where they are more than twice as fast
    as the grid; states are held. Nothing is extrapolated, and nothing is carried across a gap of more than five sample
    times (states: ten). The grid runs at the rate of the wheel speeds, else at that of the fastest signal.

    Parameters
    ----------
    mapped : mapping symbol -> (entry, channel)
        As found by `resolve`, with samples.
    signal_map : SignalMap
        For the clock corrections.
    vehicle : Vehicle
        Effective radii (wheel speeds in km/h or m/s) and steering ratio.
    file_faults : sequence
        What the readers lost.
    rate_hz : float, optional
        Grid rate; default as above.

    Raises
    ------
    SignalError
        If no signal is usable, units do not fit, or the sources' clocks cannot be joined.
    """
    notes: list[str] = []
    stamps = Stamps()

    def watched() -> Iterator[StandWatch]:
        """Yield the speeds of the drive one by one, each on demand."""
        for name in SPEEDS:
            watch = stand_watch_of(name, vehicle.r_e(name[-2:]) if name != "v_x" else None)
            if watch is not None and name in mapped:
                clean = clean_channel(name, *mapped[name], signal_map, vehicle, stamps, [], stands=watch)
                if clean is not None and clean.origin.samples:
                    yield watch

    def standing() -> tuple[Stretch, ...]:
        """Return when the car stands, by the best speed of the drive."""
        return standing_by(watched())

    cleaned = [
        c
        for symbol, (entry, channel) in mapped.items()
        if (c := clean_channel(symbol, entry, channel, signal_map, vehicle, stamps, notes, standing=standing))
        is not None
    ]
    cleaned = [c for c in cleaned if c.span.samples > 0]
    if not cleaned:
        raise SignalError("no usable signal", expected="at least wheel speeds", hint="`aqualog inspect LOG`")
    absolute = common_clock([mapped[c.origin.symbol][1] for c in cleaned], signal_map)
    grid = grid_of(cleaned, rate_hz)
    points = grid.points()
    place = OfLast(lambda t_ns: placed(t_ns, points, grid.dt_ns))
    columns: dict[str, pl.Series] = {}
    origins: dict[str, Origin] = {}
    for clean in cleaned:
        at = place(clean.t_ns)
        y, bridged = onto_grid(clean.symbol, clean.span, clean.t_ns, clean.x, points, grid.dt_ns, at)
        missing = max(float(np.mean(np.isnan(y))), missing_samples(clean.span, grid) if bridged else 0.0)
        for name, series in columns_of(clean.symbol, y, vehicle):
            if name in columns:
                continue  # a signal that the log has by its canonical name wins over one that is derived
            columns[name] = series
            origins[name] = replace(clean.origin, symbol=name, missing_fraction=missing)
    ordered = [name for name in SYMBOLS if name in columns]
    frame = frame_of(grid.seconds(), columns, ordered)
    files = tuple(dict.fromkeys(c.origin.file for c in cleaned))
    start = grid.start_ns if absolute else None
    origins = {n: origins[n] for n in ordered}
    quality = quality_of(cleaned, file_faults, [*notes, *missing_notes(origins.values())])
    return Signals(frame, grid.dt_ns, start, origins, quality, files)
