"""The common grid of a drive, and one signal on it: linear or hold, never across a gap, never beyond the ends."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
import polars as pl

from aqualog.align.clean import Clean, Span
from aqualog.align.mapping import SignalMap, align_command
from aqualog.align.timebase import MEDIAN_OF
from aqualog.core.errors import ConfigError, SignalError
from aqualog.core.notation import WHEELS, Symbol
from aqualog.core.records import BoolArray, FloatArray, TimeArray
from aqualog.core.vehicle import Vehicle

__all__ = [
    "MAX_ROWS", "Grid", "Placed", "between_samples", "bin_mean", "columns_of", "common_clock", "gap_limit_ns",
    "grid_of", "hold", "linear", "median_period_ns", "missing_samples", "onto_grid", "placed",
]  # fmt: skip


def median_period_ns(t_ns: TimeArray) -> int:
    """Return the median sample time of the first 2^18 steps. [ns] 0 for fewer than two samples."""
    return int(np.median(np.diff(t_ns[: MEDIAN_OF + 1]))) if t_ns.size > 1 else 0


def gap_limit_ns(period_ns: int, *, is_state: bool) -> int:
    """Return the longest interval across which a value may be carried, by the median sample time. [ns]

    Five sample times for a continuous signal (at least 50 ms), ten for a state (at least 2 s): a lost frame or two is
    bridged, an outage is not.
    """
    return max(10 * period_ns, 2_000_000_000) if is_state else max(5 * period_ns, 50_000_000)


class Placed(NamedTuple):
    """Positions of the points (m,) of a grid among stamps (n,).

    `right` (m,): the first stamp that is not before the point, n behind the last; `exact` (m,): it is at the point;
    `between`: indices (k,) of the points with a stamp on either side, `before` and `after` (k,) those of the stamps,
    `span` (k,) the interval there [ns], and `share` (k,) how much of it lies before the point. Indices that go up by
    one are a slice: what it takes is no copy.
    """

    right: TimeArray
    exact: BoolArray
    between: TimeArray | slice
    before: TimeArray | slice
    after: TimeArray | slice
    span: TimeArray
    share: FloatArray


def placed(t_ns: TimeArray, grid_ns: TimeArray, dt_ns: int | None = None) -> Placed:
    """Find the points of a grid among strictly increasing stamps, at least one; signals with the same stamps share it.

    With the step [ns] of even points, stamps are counted by the step that they fall into; else each point is searched
    for.
    """
    n, m = t_ns.size, grid_ns.size
    if dt_ns is not None and m:
        step = t_ns - grid_ns[0]  # in place from here: pages of memory that are fresh cost more than the arithmetic
        step //= dt_ns
        step += 1
        right = np.bincount(np.clip(step, 0, m, out=step), minlength=m + 1)[:m]
        np.cumsum(right, out=right)
    else:
        right = np.searchsorted(t_ns, grid_ns, side="left")
    exact = (right < n) & (t_ns.take(right, mode="clip") == grid_ns)
    between = _indices(np.flatnonzero(~exact & (right > 0) & (right < n)))
    after = _indices(right[between])
    before = slice(after.start - 1, after.stop - 1) if isinstance(after, slice) else after - 1
    low = t_ns[before]
    span = t_ns[after] - low
    # integers are subtracted before they become floats: epoch nanoseconds do not fit a double
    share = (grid_ns[between] - low) / span
    return Placed(right, exact, between, before, after, span, share)


def _indices(i: TimeArray) -> TimeArray | slice:
    """A slice of indices (k,) that do not go down, if they go up by one each."""
    is_run = i.size and i[-1] - i[0] == i.size - 1 and (i[1:] > i[:-1]).all()
    return slice(int(i[0]), int(i[-1]) + 1) if is_run else i


def linear(
    t_ns: TimeArray, x: FloatArray, grid_ns: TimeArray, *, gap_ns: int, period_ns: int | None = None,
    at: Placed | None = None, out: FloatArray | None = None,
) -> tuple[FloatArray, BoolArray]:  # fmt: skip
    """Interpolate finite samples (n,) at strictly increasing stamps (n,) linearly to points (m,). [ns]

    Intervals up to `gap_ns` are bridged. `period_ns`: median sample time, default that of the stamps; `at`: positions
    of these points among these stamps, if known; `out` (m,): where the result goes, as in NumPy.

    Returns
    -------
    y : array (m,)
        NaN outside the first and last stamp and inside longer intervals.
    bridged : bool array (m,)
        Grid points inside an interval of more than 1.5 median sample times: a sample was missing there.
    """
    bridged = np.zeros(grid_ns.size, dtype=bool)
    y = np.empty(grid_ns.size) if out is None else out
    if t_ns.size == 0:
        y.fill(np.nan)
        return y, bridged
    right, exact, between, before, after, span, share = at or placed(t_ns, grid_ns)
    if not span.size and t_ns.size == grid_ns.size and exact.all():  # the stamps are the grid
        y[:] = x
        return y, bridged
    if isinstance(between, slice) and between.stop - between.start == y.size:
        pass  # all of it is written below
    elif exact.any():
        y[:] = np.where(exact, x.take(right, mode="clip"), np.nan)
    else:
        y.fill(np.nan)
    low = x[before]
    values = np.subtract(x[after], low, out=y[between] if isinstance(between, slice) else None)
    values *= share
    values += low
    longest = span.max(initial=0)
    if longest > gap_ns:
        values[span > gap_ns] = np.nan
    if not isinstance(between, slice):
        y[between] = values
    if longest > (least := 1.5 * (median_period_ns(t_ns) if period_ns is None else period_ns)):
        bridged[between] = span > least
    return y, bridged


def hold(
    t_ns: TimeArray, x: FloatArray, grid_ns: TimeArray, *, gap_ns: int, at: Placed | None = None,
    out: FloatArray | None = None,
) -> FloatArray:  # fmt: skip
    """Hold the last value for at most `gap_ns`, also beyond the last stamp. Shapes as `linear`."""
    y = np.empty(grid_ns.size) if out is None else out
    y.fill(np.nan)
    if t_ns.size == 0:
        return y
    right, exact, *_ = at or placed(t_ns, grid_ns)
    last = right - ~exact
    known = last >= 0
    age = grid_ns[known] - t_ns[last[known]]
    y[known] = np.where(age <= gap_ns, x[last[known]], np.nan)
    return y


def bin_mean(
    t_ns: TimeArray, x: FloatArray, grid_ns: TimeArray, *, dt_ns: int, gap_ns: int, period_ns: int | None = None,
    at: Placed | None = None, out: FloatArray | None = None,
) -> tuple[FloatArray, BoolArray]:  # fmt: skip
    """Average the samples within half a grid step on either side, for signals much faster than the grid.

    Plain interpolation would alias their noise into the grid. Where a bin is empty, linear interpolation takes over.
    Returns as `linear`.
    """
    y, bridged = linear(t_ns, x, grid_ns, gap_ns=gap_ns, period_ns=period_ns, at=at, out=out)
    if t_ns.size == 0:
        return y, bridged
    low = np.searchsorted(t_ns, grid_ns - dt_ns // 2, side="left")
    high = np.searchsorted(t_ns, grid_ns + dt_ns - dt_ns // 2, side="left")
    count = high - low
    full = count >= 2
    # sums of each bin by itself: differences of one long running sum would lose digits over hours
    edges = np.column_stack([low[full], np.minimum(high[full], x.size - 1)]).ravel()
    sums = np.add.reduceat(x, edges)[::2] if edges.size else np.zeros(0)
    tail = high[full] == x.size  # reduceat needs an end index; the last sample is added where the bin holds it
    sums = sums + np.where(tail, x[-1], 0.0)
    y[full & ~np.isnan(y)] = (sums / count[full])[~np.isnan(y[full])]
    return y, bridged


MAX_ROWS = 60_000_000
_SPARSE_ROWS = 1_000_000  # beyond, a grid with one sample in 50 points is a jump of the time stamps, not a drive
_LEAST_PERIOD_NS = 50_000  # 20 kHz: no signal of a car is sampled faster; seconds read as milliseconds are
_PHASES = 1000  # points of a drive at which a grid is compared with stamps
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


def common_clock(
    clocks: Sequence[tuple[str, bool]], signal_map: SignalMap, *, with_speed: Collection[str] = (),
    dbc: Sequence[str] = (),
) -> bool:  # fmt: skip
    """Return whether the drive has absolute time; refuse to join clocks that have nothing in common.

    `clocks` holds the file of each signal and whether its time is absolute. A file whose offset the map gives is
    already on the others' clock. `with_speed`: files that carry one, by which clocks can be compared.
    """
    free = [c for c in clocks if not signal_map.joins(c[0])]
    kinds = {absolute for _, absolute in free or clocks}
    if len(kinds) > 1:
        by_kind = {k: sorted({file for file, absolute in clocks if absolute == k}) for k in kinds}
        speeds = {k: [f for f in files if f in with_speed] for k, files in by_kind.items()}
        compared = speeds if all(speeds.values()) else by_kind
        raise SignalError(
            "the files do not share a clock",
            where=", ".join(by_kind[False]),
            expected=f"absolute time as in {', '.join(by_kind[True])}",
            hint=align_command([*compared[True], *compared[False]], signal_map.path, dbc),
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
        raise SignalError(
            "no signal has two samples at different times", where=cleaned[0].origin.file if cleaned else "",
            expected="a drive", hint="check the column of the time, and its unit",
        )  # fmt: skip
    period = min(periods)
    if period < _LEAST_PERIOD_NS:
        raise SignalError(
            f"the time stamps are {period * 1e-9:.1e} s apart", where=cleaned[0].origin.file,
            expected=f"{_LEAST_PERIOD_NS * 1e-9:g} s or more",
            hint="check the unit of the time; --rate takes another rate",
        )  # fmt: skip
    # jitter and rounding of stamps must not make the grid run at 100.02 Hz: nearest whole rate within 2 %
    for rate in _NICE_HZ:
        if abs(period * rate / 1e9 - 1.0) < 0.02:
            return round(1e9 / rate)
    # four digits of the rate: what the signals' own rates are shown with
    return max(1_000_000, round(1e9 / float(f"{1e9 / period:.4g}")))


def onto_grid(
    symbol: Symbol, span: Span, t_ns: TimeArray, x: FloatArray, points: TimeArray, dt_ns: int, at: Placed | None,
    out: FloatArray,
) -> bool:  # fmt: skip
    """Put samples (n,) of a signal, at least those around the points (m,) [ns], on the grid; whether one is missing.

    `span` is that of the whole signal: its sample time decides what is bridged. `at`: where the points lie among these
    stamps; None without samples. `out` (m,): where the values go.
    """
    is_state = symbol.kind == "state"
    gap_ns = gap_limit_ns(span.period_ns, is_state=is_state)
    if is_state:
        hold(t_ns, x, points, gap_ns=gap_ns, at=at, out=out)
        return False
    if 0 < span.period_ns < dt_ns / 2:
        _, bridged = bin_mean(t_ns, x, points, dt_ns=dt_ns, gap_ns=gap_ns, period_ns=span.period_ns, at=at, out=out)
    else:
        _, bridged = linear(t_ns, x, points, gap_ns=gap_ns, period_ns=span.period_ns, at=at, out=out)
    return bool(bridged.any())


def missing_samples(span: Span, grid: Grid) -> float:
    """Return samples over those of a gapless channel of this rate: jittering stamps are not missing ones."""
    if span.mean_period_ns == 0:
        return 0.0
    expected = grid.rows * grid.dt_ns / span.mean_period_ns
    return min(max(0.0, 1.0 - span.samples / expected), 1.0)


def between_samples(span: Span, grid: Grid) -> float:
    """Return the mean of phi (1 - phi) over the grid, see `core.records.Origin`; 0 for means over bins."""
    period = span.mean_period_ns
    if not period or span.period_ns < grid.dt_ns / 2:
        return 0.0
    point = np.arange(min(grid.rows, _PHASES), dtype=np.int64) * max(1, grid.rows // _PHASES)
    phi = ((grid.start_ns - span.first_ns + point * grid.dt_ns) % period) / period
    return float((phi * (1.0 - phi)).mean())


def columns_of(symbol: Symbol, y: FloatArray, vehicle: Vehicle) -> list[tuple[str, pl.Series]]:
    """Return the canonical columns of a signal: axle torque to two wheels, steering wheel angle to road-wheel angle."""
    if symbol.name in ("torque_f", "torque_r"):
        axle = symbol.name[-1]
        half = pl.Series(0.5 * y, nan_to_null=True)
        return [(f"torque_{w}", half) for w in WHEELS if w[0] == axle]
    if symbol.name == "steering_wheel_angle":
        return [("steer_angle", pl.Series(y / vehicle.steering_ratio, nan_to_null=True))]
    if symbol.unit == "bool":
        return [(symbol.name, pl.Series(y, nan_to_null=True).cast(pl.Boolean))]
    return [(symbol.name, pl.Series(y, nan_to_null=True))]
