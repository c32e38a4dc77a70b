"""Build the common grid of a drive, and put one signal on it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import polars as pl

from aqualog.align.clean import Clean, Span
from aqualog.align.mapping import SignalMap
from aqualog.align.resample import Placed, bin_mean, gap_limit_ns, hold, linear
from aqualog.core.errors import ConfigError, SignalError
from aqualog.core.notation import WHEELS, Symbol
from aqualog.core.records import BoolArray, FloatArray, TimeArray
from aqualog.core.vehicle import Vehicle

__all__ = ["MAX_ROWS", "Grid", "columns_of", "common_clock", "frame_of", "grid_of", "missing_samples", "onto_grid"]

MAX_ROWS = 60_000_000
_SPARSE_ROWS = 1_000_000  # beyond, a grid with one sample in 50 points is a jump of the time stamps, not a drive
_NICE_HZ = (1, 2, 4, 5, 8, 10, 20, 25, 40, 50, 80, 100, 125, 200, 250, 400, 500, 1000)


class Grid(NamedTuple):
    """Integer nanoseconds `start_ns + k dt_ns`, k = 0 ... rows - 1."""

    start_ns: int
    rows: int
    dt_ns: int

    def points(self, first: int = 0, last: int | None = None) -> TimeArray:
        """Return the stamps of rows from `first` to before `last`. [ns]"""
        return self.start_ns + np.arange(first, self.rows if last is None else last, dtype=np.int64) * self.dt_ns

    def seconds(self, first: int = 0, last: int | None = None) -> FloatArray:
        """Return the same from the first point on. [s]"""
        return np.asarray((self.points(first, last) - self.start_ns) * 1e-9)


def common_clock(clocks: Sequence[tuple[str, bool]], signal_map: SignalMap) -> bool:
    """Return whether the drive has absolute time; refuse to join clocks that have nothing in common.

    `clocks` holds the file of each signal and whether its time is absolute. A file whose offset the map gives is
    already on the others' clock.
    """
    free = [c for c in clocks if not signal_map.joins(c[0])]
    kinds = {absolute for _, absolute in free or clocks}
    if len(kinds) > 1:
        by_kind = {k: sorted({file for file, absolute in clocks if absolute == k}) for k in kinds}
        raise SignalError(
            "the files do not share a clock",
            where=", ".join(by_kind[False]),
            expected=f"absolute time as in {', '.join(by_kind[True])}",
            hint="`aqualog align FILE FILE --write-map map.toml`",
        )
    return kinds.pop()


def grid_of(cleaned: Sequence[Clean], rate_hz: float | None, *, most_rows: int = MAX_ROWS) -> Grid:
    """Build the grid at the rate asked for, else at that of the wheel speeds, else at that of the fastest signal.

    Raises
    ------
    SignalError
        If no rate can be found, or the stamps jump.
    ConfigError
        If the rate asked for makes too many rows.
    """
    dt_ns = _grid_step(cleaned, rate_hz)
    anchor_of = next((c for c in cleaned if c.symbol.name.startswith("omega_")), cleaned[0])
    first = min(c.span.first_ns for c in cleaned)
    last = max(c.span.last_ns for c in cleaned)
    anchor = anchor_of.span.first_ns
    start = anchor - (anchor - first) // dt_ns * dt_ns
    rows = (last - start) // dt_ns + 1
    samples = max(c.span.samples for c in cleaned)
    if _is_too_long(rows, samples, most_rows):
        own_rows = (last - start) // _grid_step(cleaned, None) + 1
        if rate_hz is not None and not _is_too_long(own_rows, samples, most_rows):
            raise ConfigError(
                f"a rate of {rate_hz:g} Hz makes {rows} rows of {samples} samples", expected="one near that of the log"
            )
        raise SignalError(
            f"the signals span {(last - first) / 1e9:.0f} s with {samples} samples: their time stamps jump",
            where=", ".join(dict.fromkeys(c.origin.file for c in cleaned)),
            expected="time stamps of one drive, and sources that share one clock",
            hint="`aqualog inspect LOG`; [sources] offset_s in the signal map",
        )
    return Grid(start, rows, dt_ns)


def _is_too_long(rows: int, samples: int, most_rows: int) -> bool:
    return rows > most_rows or (rows > _SPARSE_ROWS and rows > 50 * samples)


def _grid_step(cleaned: Sequence[Clean], rate_hz: float | None) -> int:
    if rate_hz is not None:
        return max(1, round(1e9 / rate_hz))
    periods = [c.span.mean_period_ns for c in cleaned if c.symbol.name.startswith("omega_")]
    if not any(periods):
        periods = [c.span.mean_period_ns for c in cleaned if c.symbol.kind == "continuous"]
    periods = [p for p in periods if p > 0]
    if not periods:
        raise SignalError("no signal has two samples", expected="a drive", hint="check the log")
    period = min(periods)
    # jitter and rounding of stamps must not make the grid run at 100.02 Hz: nearest whole rate within 2 %
    for rate in _NICE_HZ:
        if abs(period * rate / 1e9 - 1.0) < 0.02:
            return round(1e9 / rate)
    return max(1_000_000, round(period / 1e5) * 100_000)


def onto_grid(
    symbol: Symbol,
    span: Span,
    t_ns: TimeArray,
    x: FloatArray,
    points: TimeArray,
    dt_ns: int,
    at: Placed | None,
) -> tuple[FloatArray, bool]:
    """Put a signal on points of the grid; flag points where a sample was missing.

    Parameters
    ----------
    symbol : Symbol
    span : Span
        Of the whole signal: its sample time decides what is bridged.
    t_ns, x : arrays (n,)
        Its samples, or a stretch of them that encloses the points.
    points : int64 array (m,)
        [ns]
    dt_ns : int
        Step of the grid. [ns]
    at : Placed, optional
        Where the points lie among these stamps; None without samples.
    """
    is_state = symbol.kind == "state"
    gap_ns = gap_limit_ns(span.period_ns, is_state=is_state)
    bridged: BoolArray
    if is_state:
        return hold(t_ns, x, points, gap_ns=gap_ns, at=at), False
    if 0 < span.period_ns < dt_ns / 2:
        y, bridged = bin_mean(t_ns, x, points, dt_ns=dt_ns, gap_ns=gap_ns, period_ns=span.period_ns, at=at)
    else:
        y, bridged = linear(t_ns, x, points, gap_ns=gap_ns, period_ns=span.period_ns, at=at)
    return y, bool(bridged.any())


def missing_samples(span: Span, grid: Grid) -> float:
    """Return samples over those of a gapless channel of this rate: jittering stamps are not missing ones."""
    if span.mean_period_ns == 0:
        return 0.0
    expected = grid.rows * grid.dt_ns / span.mean_period_ns
    return min(max(0.0, 1.0 - span.samples / expected), 1.0)


def frame_of(t: FloatArray, columns: dict[str, pl.Series], ordered: Sequence[str]) -> pl.DataFrame:
    """Build the table: time and signals in their usual order."""
    return pl.DataFrame([pl.Series("t", t), *(columns[n].rename(n) for n in ordered)])


def columns_of(symbol: Symbol, y: FloatArray, vehicle: Vehicle) -> list[tuple[str, pl.Series]]:
    """Return the canonical columns of a signal: axle torque to two wheels, steering wheel angle to road-wheel angle."""
    if symbol.name in ("torque_f", "torque_r"):
        axle = symbol.name[-1]
        half = pl.Series(0.5 * y).fill_nan(None)
        return [(f"torque_{w}", half) for w in WHEELS if w[0] == axle]
    if symbol.name == "steering_wheel_angle":
        return [("steer_angle", pl.Series(y / vehicle.steering_ratio).fill_nan(None))]
    if symbol.unit == "bool":
        return [(symbol.name, pl.Series(y).fill_nan(None).cast(pl.Boolean))]
    return [(symbol.name, pl.Series(y).fill_nan(None))]
