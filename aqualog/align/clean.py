"""Clean the samples of one channel: convert to SI, remove bad samples, repair and count time stamps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from aqualog.align.freezes import freeze_note, in_freezes, watch_of, while_moving
from aqualog.align.glitches import Glitches, glitches_of
from aqualog.align.mapping import Entry, SignalMap
from aqualog.align.resample import median_period_ns
from aqualog.align.shared import OfLast
from aqualog.align.standing import StandWatch, Stretch
from aqualog.align.timebase import ClockRepair
from aqualog.core.errors import ConfigError, SignalError
from aqualog.core.notation import ACCEPTED, SYMBOLS, Symbol
from aqualog.core.records import BoolArray, Channel, FloatArray, Origin, TimeArray
from aqualog.core.units import convert, parse_unit
from aqualog.core.vehicle import Vehicle

__all__ = [
    "Clean", "Judged", "Span", "Stamps", "clean_channel", "corrected", "glitch_note", "judged", "mean_of_steps",
    "out_note", "symbol_of",
]  # fmt: skip

_ROUNDING = 1e-7  # of a number in 32 bits, at most
BURST = 5  # median sample times; longer steps are gaps and no sample time


class Span(NamedTuple):
    """Where the usable samples of a signal lie: first and last stamp, their number, median and mean sample time. [ns]

    Gaps do not enter the mean. Stamps that arrive in bursts have a median far from their rate.
    """

    first_ns: int
    last_ns: int
    samples: int
    period_ns: int
    mean_period_ns: int


@dataclass(frozen=True, slots=True)
class Clean:
    """One signal in SI on its own repaired time stamps."""

    symbol: Symbol
    origin: Origin
    span: Span
    t_ns: TimeArray
    x: FloatArray


class Judged(NamedTuple):
    """Samples (n,) in SI, and flags for those that are not finite, that are error codes, or that are out of range."""

    values: FloatArray
    is_bad: BoolArray
    is_code: BoolArray
    is_out: BoolArray

    @property
    def keep(self) -> BoolArray:
        """Which samples are used."""
        return ~(self.is_bad | self.is_code | self.is_out)


class Stamps:
    """State of the time stamps of a drive's files while its channels are read."""

    def __init__(self) -> None:
        self._repairs: dict[str, ClockRepair] = {}
        self.period_ns = OfLast(median_period_ns)
        self.span = OfLast(_span)

    def repair(self, file: str) -> ClockRepair:
        """The repair of a file's stamps."""
        return self._repairs.setdefault(file, ClockRepair())


def clean_channel(
    name: str,
    entry: Entry,
    channel: Channel,
    signal_map: SignalMap,
    vehicle: Vehicle,
    stamps: Stamps,
    notes: list[str],
    *,
    standing: Callable[[], Sequence[Stretch]] = tuple,
    stands: StandWatch | None = None,
) -> Clean | None:
    """Clean one channel; return None (with a note) for a channel without a map whose unit is unknown.

    `standing` gives the stretches at standstill, for a torque that stays the same for long; `stands` sees the samples.
    """
    symbol = symbol_of(name)
    info = channel.info
    where = f"{info.file}:{info.path}"
    unit = entry.unit or info.unit
    is_explicit = name in signal_map.entries
    t_ns = corrected(channel.t_ns, signal_map, info.file)
    t_ns, order, faults = stamps.repair(info.file).repair(t_ns)
    is_changed = faults.back_steps or faults.duplicates or faults.strays
    raw = channel.values[order] if is_changed else channel.values
    try:
        own = judged(symbol, entry, raw, unit, vehicle, where)
    except SignalError as error:
        if is_explicit:
            raise ConfigError(error.what, where=error.where, expected=error.expected, hint=error.hint) from error
        notes.append(f"{error.line()}; the signal is left out")
        return None
    if not unit and is_explicit:
        notes.append(f"{where} has no unit; taken as {symbol.unit}")
    keep, is_out = own.keep, own.is_out
    r_e = vehicle.r_e(name[-2:]) if name.startswith("omega_") else None
    rule = glitches_of(name, r_e)
    glitch = np.zeros(keep.size, dtype=np.bool_)
    if rule is not None and keep.any():
        glitch[keep] = rule.find(t_ns[keep], own.values[keep])
        if glitch.any():
            notes.append(glitch_note(where, rule, int(glitch.sum()), int(t_ns[np.argmax(glitch)] - t_ns[0])))
            keep = keep & ~glitch
    if is_out.any():
        k = int(np.argmax(is_out))
        after_ns = int(t_ns[k] - t_ns[0])
        notes.append(out_note(where, symbol, int(is_out.sum()), keep.size, float(own.values[k]), after_ns))
    if stands is not None:
        stands.push(t_ns[keep], own.values[keep])
    frozen, watch = 0, watch_of(name, r_e)
    if watch is not None:
        watch.push(t_ns[keep], own.values[keep])
        freezes = watch.finish()
        if freezes and name.startswith("torque_"):
            freezes = while_moving(freezes, standing())
        if freezes:
            repeats = keep & in_freezes(t_ns, freezes)
            frozen = int(repeats.sum())
            notes.append(freeze_note(where, frozen, int(t_ns[0]), freezes))
            keep = keep & ~repeats
    period = stamps.period_ns(t_ns)
    origin = Origin(
        symbol=name,
        channel=info.path,
        file=info.file,
        unit=unit or symbol.unit,
        rate_hz=1e9 / period if period else 0.0,
        samples=int(channel.values.size),
        not_finite=int(own.is_bad.sum()),
        out_of_range=int((is_out | glitch).sum()),
        invalid_code=int(own.is_code.sum()),
        frozen=frozen,
        faults=faults,
    )
    values = own.values
    if not keep.all():
        t_ns, values = t_ns[keep], values[keep]
    return Clean(symbol, origin, stamps.span(t_ns), t_ns, values)


def symbol_of(name: str) -> Symbol:
    """The symbol of a name that a map may have."""
    return SYMBOLS.get(name) or ACCEPTED[name]


def judged(symbol: Symbol, entry: Entry, raw: FloatArray, unit: str, vehicle: Vehicle, where: str) -> Judged:
    """Convert the samples (n,) of a channel, each by itself.

    Raises
    ------
    SignalError
        If the unit is not one of the symbol.
    """
    values = _to_si(symbol, raw, unit, vehicle, where) * entry.scale + entry.offset
    is_code = _is_any_of(raw, entry.invalid)
    is_bad = ~np.isfinite(values)
    is_out = ~is_bad & ~is_code & ((values < symbol.low) | (values > symbol.high))
    return Judged(values, is_bad, is_code, is_out)


def _is_any_of(raw: FloatArray, codes: Sequence[float]) -> BoolArray:
    """Return which samples (n,) are error codes, up to rounding: of 32 bits, or of 1023 * 0.1 against 102.3."""
    found = np.zeros(raw.size, dtype=np.bool_)
    for code in codes:
        found |= np.isclose(raw, code, rtol=_ROUNDING, atol=0.0)
    return found


def glitch_note(where: str, rule: Glitches, count: int, after_ns: int) -> str:
    """Describe the samples that were left out because no car can make such a step."""
    return f"{where}: {count} samples (first at {float(after_ns) * 1e-9:.2f} s) {rule.what}"


def out_note(where: str, symbol: Symbol, count: int, of: int, first: float, after_ns: int) -> str:
    """Describe the samples that were left out because they are out of range."""
    return (
        f"{where}: {count} of {of} samples outside {symbol.low:g} ... {symbol.high:g} "
        f"{symbol.unit} (first: {first:.6g} at {float(after_ns) * 1e-9:.2f} s) are left out"
    )


def _span(t_ns: TimeArray) -> Span:
    if t_ns.size == 0:
        return Span(0, 0, 0, 0, 0)
    period = median_period_ns(t_ns)
    steps = np.diff(t_ns)
    steps = steps[steps < BURST * period]
    return Span(int(t_ns[0]), int(t_ns[-1]), t_ns.size, period, mean_of_steps(int(steps.sum()), steps.size))


def mean_of_steps(total_ns: int, count: int) -> int:
    """Return the mean sample time, 0 without samples. [ns]"""
    return round(total_ns / count) if count else 0


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


def corrected(t_ns: TimeArray, signal_map: SignalMap, file: str) -> TimeArray:
    """Return the stamps by the clock that the map gives the file."""
    clock = signal_map.clock_of(file)
    if not (clock.offset_s or clock.drift_ppm) or t_ns.size == 0:
        return t_ns
    shift = np.int64(round(clock.offset_s * 1e9))
    elapsed = t_ns - np.int64(round(clock.at_s * 1e9))
    drift: TimeArray = np.rint(elapsed * (clock.drift_ppm * 1e-6)).astype(np.int64)
    return np.asarray(t_ns - shift - drift)
