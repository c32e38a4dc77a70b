"""Channels of one drive onto one table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl

from aqualog.align.glitches import sensor_glitches
from aqualog.align.mapping import Entry, SignalMap
from aqualog.align.resample import bin_mean, gap_limit_ns, hold, linear, median_period_ns
from aqualog.align.timebase import ClockRepair
from aqualog.errors import ConfigError, SignalError
from aqualog.notation import ACCEPTED, SYMBOLS, WHEELS, Symbol
from aqualog.types import BoolArray, Channel, FileFaults, FloatArray, Origin, Quality, Signals, TimeArray, TimeFaults
from aqualog.units import convert, parse_unit
from aqualog.vehicle import Vehicle

__all__ = ["build_signals"]

_MAX_ROWS = 60_000_000
_SPARSE_ROWS = 1_000_000  # beyond, a grid with one sample in 50 points is a jump of the time stamps, not a drive
_NICE_HZ = (1, 2, 4, 5, 8, 10, 20, 25, 40, 50, 80, 100, 125, 200, 250, 400, 500, 1000)


@dataclass(frozen=True, slots=True)
class _Clean:
    """One signal in SI on its own repaired time stamps."""

    symbol: Symbol
    t_ns: TimeArray
    x: FloatArray
    origin: Origin


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
    repairs: dict[str, ClockRepair] = {}
    cleaned = [
        c
        for symbol, (entry, channel) in mapped.items()
        if (c := _clean(symbol, entry, channel, signal_map, vehicle, repairs, notes)) is not None
    ]
    cleaned = [c for c in cleaned if c.t_ns.size > 0]
    if not cleaned:
        raise SignalError("no usable signal", expected="at least wheel speeds", hint="`aqualog inspect LOG`")
    absolute = _common_clock([mapped[c.origin.symbol][1] for c in cleaned], signal_map)
    dt_ns = _grid_step(cleaned, rate_hz)
    grid = _grid(cleaned, dt_ns)
    columns: dict[str, pl.Series] = {}
    origins: dict[str, Origin] = {}
    for clean in cleaned:
        y, missing = _onto_grid(clean, grid, dt_ns)
        for name, series in _columns(clean.symbol, y, vehicle):
            if name in columns:
                continue  # a signal that the log has by its canonical name wins over one that is derived
            columns[name] = series
            origins[name] = replace(clean.origin, symbol=name, missing_fraction=missing)
    ordered = [name for name in SYMBOLS if name in columns]
    t = pl.Series("t", (grid - grid[0]) * 1e-9)
    frame = pl.DataFrame([t, *(columns[n].rename(n) for n in ordered)])
    quality = _quality(cleaned, file_faults, notes)
    files = tuple(dict.fromkeys(c.origin.file for c in cleaned))
    start = int(grid[0]) if absolute else None
    return Signals(frame, dt_ns, start, {n: origins[n] for n in ordered}, quality, files)


def _clean(
    name: str,
    entry: Entry,
    channel: Channel,
    signal_map: SignalMap,
    vehicle: Vehicle,
    repairs: dict[str, ClockRepair],
    notes: list[str],
) -> _Clean | None:
    """Bad samples out, SI, stamps repaired; None (with a note) for a channel without a map whose unit is unknown."""
    symbol = SYMBOLS.get(name) or ACCEPTED[name]
    info = channel.info
    where = f"{info.file}:{info.path}"
    unit = entry.unit or info.unit
    is_explicit = name in signal_map.entries
    try:
        values = _to_si(symbol, channel.values, unit, vehicle, where)
    except SignalError as error:
        if is_explicit:
            raise ConfigError(error.what, where=error.where, expected=error.expected, hint=error.hint) from error
        notes.append(f"{error.line()}; the signal is left out")
        return None
    if not unit and is_explicit:
        notes.append(f"{where} has no unit; taken as {symbol.unit}")
    values = values * entry.scale + entry.offset
    t_ns = _corrected(channel.t_ns, signal_map, info.file)
    t_ns, order, faults = repairs.setdefault(info.file, ClockRepair()).repair(t_ns)
    values, raw = values[order], channel.values[order]
    is_code = np.isin(raw, np.array(entry.invalid)) if entry.invalid else np.zeros(raw.size, dtype=bool)
    is_bad = ~np.isfinite(values)
    is_out = ~is_bad & ~is_code & ((values < symbol.low) | (values > symbol.high))
    keep = ~(is_bad | is_code | is_out)
    if name.startswith("omega_") and keep.any():
        glitch = np.zeros(values.size, dtype=bool)
        glitch[keep] = sensor_glitches(t_ns[keep], values[keep], r_e=vehicle.r_e(name[-2:]))
        if glitch.any():
            at = float(t_ns[np.argmax(glitch)] - t_ns[0]) * 1e-9
            notes.append(
                f"{where}: {int(glitch.sum())} samples (first at {at:.2f} s) step faster than a wheel can; sensor "
                "dropouts or spikes, left out"
            )
            keep, is_out = keep & ~glitch, is_out | glitch
    if is_out.any():
        first = float(values[np.argmax(is_out)])
        notes.append(
            f"{where}: {int(is_out.sum())} of {values.size} samples outside {symbol.low:g} ... {symbol.high:g} "
            f"{symbol.unit} (first: {first:.6g}) are left out"
        )
    period = median_period_ns(t_ns)
    origin = Origin(
        symbol=name,
        channel=info.path,
        file=info.file,
        unit=unit or symbol.unit,
        rate_hz=1e9 / period if period else 0.0,
        samples=int(channel.values.size),
        not_finite=int(is_bad.sum()),
        out_of_range=int(is_out.sum()),
        invalid_code=int(is_code.sum()),
        faults=faults,
    )
    return _Clean(symbol, t_ns[keep], values[keep], origin)


def _to_si(symbol: Symbol, raw: FloatArray, unit: str, vehicle: Vehicle, where: str) -> FloatArray:
    if symbol.unit == "bool" or (not unit and not symbol.name.startswith("torque_")):
        return raw
    if symbol.name.startswith("omega_") and parse_unit(unit, where=where).dimension == "speed":
        # speed at the rim: the control unit used some radius of its own; the vehicle's makes it a wheel speed again
        return convert(raw, unit, "m/s", where=where) / vehicle.r_e(symbol.name[-2:])
    if symbol.unit == "-":
        return raw
    values = convert(raw, unit, symbol.unit, where=where) if unit else raw
    if symbol.name.startswith("torque_") and vehicle.torque_gain != 1.0:
        values = vehicle.torque_gain * values
    return values


def _corrected(t_ns: TimeArray, signal_map: SignalMap, file: str) -> TimeArray:
    clock = signal_map.clock_of(file)
    if not (clock.offset_s or clock.drift_ppm) or t_ns.size == 0:
        return t_ns
    shift = np.int64(round(clock.offset_s * 1e9))
    elapsed = t_ns - np.int64(round(clock.at_s * 1e9))
    drift: TimeArray = np.rint(elapsed * (clock.drift_ppm * 1e-6)).astype(np.int64)
    corrected: TimeArray = t_ns - shift - drift
    return corrected


def _common_clock(channels: Sequence[Channel], signal_map: SignalMap) -> bool:
    """Whether the drive has absolute time; refuses to join clocks that have nothing in common.

    A file whose offset the map gives has been moved onto the others' clock already.
    """
    free = [c for c in channels if not signal_map.joins(c.info.file)]
    kinds = {c.absolute for c in free or channels}
    if len(kinds) > 1:
        by_kind = {k: sorted({c.info.file for c in channels if c.absolute == k}) for k in kinds}
        raise SignalError(
            "the files do not share a clock",
            where=", ".join(by_kind[False]),
            expected=f"absolute time as in {', '.join(by_kind[True])}",
            hint="`aqualog align FILE FILE --write-map map.toml`",
        )
    return kinds.pop()


def _grid_step(cleaned: Sequence[_Clean], rate_hz: float | None) -> int:
    if rate_hz is not None:
        return max(1, round(1e9 / rate_hz))
    periods = [_mean_period_ns(c.t_ns) for c in cleaned if c.symbol.name.startswith("omega_")]
    if not any(periods):
        periods = [_mean_period_ns(c.t_ns) for c in cleaned if c.symbol.kind == "continuous"]
    periods = [p for p in periods if p > 0]
    if not periods:
        raise SignalError("no signal has two samples", expected="a drive", hint="check the log")
    period = min(periods)
    # jitter and rounding of stamps must not make the grid run at 100.02 Hz: nearest whole rate within 2 %
    for rate in _NICE_HZ:
        if abs(period * rate / 1e9 - 1.0) < 0.02:
            return round(1e9 / rate)
    return max(1_000_000, round(period / 1e5) * 100_000)


def _mean_period_ns(t_ns: TimeArray) -> int:
    """Mean sample time without gaps: stamps that arrive in bursts have a median far from their rate. [ns]"""
    steps = np.diff(t_ns)
    steps = steps[steps < 5 * median_period_ns(t_ns)]
    return round(float(steps.mean())) if steps.size else 0


def _grid(cleaned: Sequence[_Clean], dt_ns: int) -> TimeArray:
    anchor_of = next((c for c in cleaned if c.symbol.name.startswith("omega_")), cleaned[0])
    first = min(int(c.t_ns[0]) for c in cleaned)
    last = max(int(c.t_ns[-1]) for c in cleaned)
    anchor = int(anchor_of.t_ns[0])
    start = anchor - (anchor - first) // dt_ns * dt_ns
    rows = (last - start) // dt_ns + 1
    samples = max(c.t_ns.size for c in cleaned)
    if rows > _MAX_ROWS or (rows > _SPARSE_ROWS and rows > 50 * samples):
        raise SignalError(
            f"the signals span {(last - first) / 1e9:.0f} s with {samples} samples: their time stamps jump",
            where=", ".join(dict.fromkeys(c.origin.file for c in cleaned)),
            expected="time stamps of one drive, and sources that share one clock",
            hint="`aqualog inspect LOG`; [sources] offset_s in the signal map",
        )
    return start + np.arange(rows, dtype=np.int64) * dt_ns


def _onto_grid(clean: _Clean, grid: TimeArray, dt_ns: int) -> tuple[FloatArray, float]:
    is_state = clean.symbol.kind == "state"
    gap_ns = gap_limit_ns(clean.t_ns, is_state=is_state)
    bridged: BoolArray
    if is_state:
        y = hold(clean.t_ns, clean.x, grid, gap_ns=gap_ns)
        bridged = np.zeros(grid.size, dtype=bool)
    elif 0 < median_period_ns(clean.t_ns) < dt_ns / 2:
        y, bridged = bin_mean(clean.t_ns, clean.x, grid, dt_ns=dt_ns, gap_ns=gap_ns)
    else:
        y, bridged = linear(clean.t_ns, clean.x, grid, gap_ns=gap_ns)
    return y, max(float(np.mean(np.isnan(y))), _missing_samples(clean, grid, dt_ns) if bridged.any() else 0.0)


def _missing_samples(clean: _Clean, grid: TimeArray, dt_ns: int) -> float:
    """Share of the samples that a gapless channel of this rate would have: jittering stamps are not missing ones."""
    period = _mean_period_ns(clean.t_ns)
    if period == 0:
        return 0.0
    expected = (int(grid[-1]) - int(grid[0]) + dt_ns) / period
    return min(max(0.0, 1.0 - clean.t_ns.size / expected), 1.0)


def _columns(symbol: Symbol, y: FloatArray, vehicle: Vehicle) -> list[tuple[str, pl.Series]]:
    """Canonical columns of a signal: an axle torque becomes two wheels', a steering wheel angle a road-wheel angle."""
    if symbol.name in ("torque_f", "torque_r"):
        axle = symbol.name[-1]
        half = pl.Series(0.5 * y).fill_nan(None)
        return [(f"torque_{w}", half) for w in WHEELS if w[0] == axle]
    if symbol.name == "steering_wheel_angle":
        return [("steer_angle", pl.Series(y / vehicle.steering_ratio).fill_nan(None))]
    if symbol.unit == "bool":
        return [(symbol.name, pl.Series(y).fill_nan(None).cast(pl.Boolean))]
    return [(symbol.name, pl.Series(y).fill_nan(None))]


def _time_note(file: str, faults: TimeFaults) -> str:
    words = {
        "duplicates": "doubled",
        "back_steps": "out of order",
        "resets": "resets",
        "wraps": "wraps",
        "pauses": "pauses",
    }
    counts = ", ".join(f"{getattr(faults, n)} {word}" for n, word in words.items() if getattr(faults, n))
    return f"{file}: time stamps: {counts}"


def _quality(cleaned: Sequence[_Clean], file_faults: Sequence[FileFaults], notes: Sequence[str]) -> Quality:
    by_file: dict[str, TimeFaults] = {}
    for clean in cleaned:  # the channels of one file mostly share their stamps: the worst one speaks for the file
        seen, new = by_file.get(clean.origin.file, TimeFaults()), clean.origin.faults
        by_file[clean.origin.file] = TimeFaults(*(max(getattr(seen, n), getattr(new, n)) for n in TimeFaults.__slots__))
    faults = sum(by_file.values(), TimeFaults())
    own = sum(
        c.origin.not_finite + c.origin.out_of_range + c.origin.invalid_code + c.origin.faults.duplicates
        for c in cleaned
    )
    doubled = max((c.origin.faults.duplicates for c in cleaned), default=0)
    # a doubled stamp here and there is a logger's habit; many are samples lost to a wrong clock
    is_lossy = any(c.origin.faults.duplicates > 0.01 * c.origin.samples for c in cleaned)
    lost = sum(f.lost_samples for f in file_faults) + (doubled if is_lossy else 0)
    notes = [*(_time_note(file, faults) for file, faults in by_file.items() if faults != TimeFaults()), *notes]
    return Quality(
        dropped_samples=own + lost,
        lost_in_files=lost,
        time_jumps=faults.back_steps + faults.resets + faults.wraps + faults.pauses,
        truncated=any(f.truncated for f in file_faults),
        faults=faults,
        notes=tuple(dict.fromkeys([*(n for f in file_faults for n in f.notes), *notes])),
    )
