"""Clean the samples of one signal: convert to SI, leave out what no car can have made, count.

A signal arrives in any pieces, a whole drive in one. The result does not depend on the cuts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from aqualog.align.freezes import (
    SPEEDS,
    Freeze,
    StartWatch,
    Stretch,
    freeze_note,
    joined_note,
    stand_watch_of,
    unread_note,
    watch_of,
    within,
)  # fmt: skip
from aqualog.align.glitches import KNOWN_NS, Glitches, glitches_of
from aqualog.align.mapping import Entry, SignalMap
from aqualog.align.timebase import MEDIAN_OF
from aqualog.core.errors import ConfigError, SignalError
from aqualog.core.notation import ACCEPTED, SYMBOLS, Symbol
from aqualog.core.records import BoolArray, ChannelInfo, FloatArray, Origin, TimeArray, TimeFaults
from aqualog.core.units import convert, parse_unit
from aqualog.core.vehicle import Vehicle

__all__ = ["Clean", "Cleaner", "Samples", "Span", "SpanWatch", "Taken", "Unmeasured", "corrected", "span_of"]

_ROUNDING = 1e-7  # of a number in 32 bits, at most
_BURST = 5  # median sample times; longer steps are gaps and no sample time
_NO_TIMES: TimeArray = np.zeros(0, dtype=np.int64)
_NO_VALUES: FloatArray = np.zeros(0)

Samples = tuple[TimeArray, FloatArray]
"""Strictly increasing stamps (n,) [ns] and values (n,)."""


class Span(NamedTuple):
    """Where the usable samples of a signal lie: first and last stamp, their number, median and mean sample time. [ns]

    Gaps do not enter the mean. Stamps that arrive in bursts have a median far from their rate.
    """

    first_ns: int
    last_ns: int
    samples: int
    period_ns: int
    mean_period_ns: int

    @property
    def rate_hz(self) -> float:
        """Samples per second outside gaps [Hz]; 0 for fewer than two samples."""
        return 1e9 / self.mean_period_ns if self.mean_period_ns else 0.0


class SpanWatch:
    """Find the span of strictly increasing stamps, in any pieces."""

    def __init__(self) -> None:
        self.first_ns: int | None = None
        self._last_ns = self._samples = 0
        self._first_steps: list[TimeArray] = []
        self._room = MEDIAN_OF
        self._median: int | None = None
        self._total = self._count = 0

    def push(self, t_ns: TimeArray) -> TimeArray:
        """Take stamps (n,); return the steps that lead to them, n - 1 for the first ones. [ns]"""
        if not t_ns.size:
            return t_ns
        steps = np.diff(t_ns) if self.first_ns is None else np.diff(t_ns, prepend=self._last_ns)
        if self.first_ns is None:
            self.first_ns = int(t_ns[0])
        self._last_ns = int(t_ns[-1])
        self._samples += t_ns.size
        early, late = steps[: self._room], steps[self._room :]
        if self._median is None:
            self._first_steps.append(early.copy())
            self._room -= early.size
            if not self._room:
                self._settle()
        if late.size:
            self._add(late)
        return steps

    def _settle(self) -> None:
        steps = np.concatenate([_NO_TIMES, *self._first_steps])
        self._median = int(np.median(steps)) if steps.size else 0
        self._first_steps = []
        self._add(steps)

    def _add(self, steps: TimeArray) -> None:
        assert self._median is not None
        if steps.max(initial=0) >= _BURST * self._median:
            steps = steps[steps < _BURST * self._median]
        self._total += int(steps.sum())
        self._count += steps.size

    def finish(self) -> Span:
        """Return the span; no stamps may follow."""
        if self._median is None:
            self._settle()
        assert self._median is not None
        mean = round(self._total / self._count) if self._count else 0
        return Span(self.first_ns or 0, self._last_ns, self._samples, self._median, mean)


def span_of(t_ns: TimeArray) -> Span:
    """Return the span of stamps (n,)."""
    watch = SpanWatch()
    watch.push(t_ns)
    return watch.finish()


@dataclass(frozen=True, slots=True)
class Clean:
    """One signal that was cleaned, without its samples."""

    symbol: Symbol
    origin: Origin
    span: Span


class Taken(NamedTuple):
    """What is known of a signal once all its samples have gone through a cleaner.

    `samples`: of the channel; `every`, `used`: spans of the stamps in order and of the samples that are used;
    `absolute`: whether its clock counts from 1970.
    """

    samples: int
    every: Span
    used: Span
    faults: TimeFaults
    absolute: bool


class Unmeasured(NamedTuple):
    """Where no sensor made the samples of a signal: it repeats itself, a logger joined a gap by a line, or no message
    had come yet."""

    frozen: tuple[Freeze, ...] = ()
    joined: tuple[Stretch, ...] = ()
    unread: tuple[Freeze, ...] = ()


class Cleaner:
    """Clean one signal, under the name that the map has.

    `unmeasured`, from an earlier pass: what is left out; without it nothing is as frozen or joined. If the unit does
    not fit the signal: SignalError, or ConfigError where the map gives the unit.
    """

    def __init__(
        self, name: str, entry: Entry, info: ChannelInfo, signal_map: SignalMap, vehicle: Vehicle,
        unmeasured: Unmeasured | None = None,
    ) -> None:  # fmt: skip
        from aqualog.align.lines import line_watch_of  # compiled: only for whom reads samples

        self.info, self.where = info, f"{info.file}:{info.path}"
        self._name, self._symbol = name, SYMBOLS.get(name) or ACCEPTED[name]
        self._unit = entry.unit or info.unit
        self._entry, self._vehicle = entry, vehicle
        self._is_explicit = name in signal_map.entries
        try:
            _judged(self._symbol, entry, _NO_VALUES, self._unit, vehicle, self.where)
        except SignalError as error:
            if self._is_explicit:
                raise ConfigError(error.what, where=error.where, expected=error.expected, hint=error.hint) from error
            raise
        r_e = vehicle.r_e(name[-2:]) if name.startswith("omega_") else None
        self._rule = glitches_of(name, r_e)
        self._unmeasured = unmeasured or Unmeasured()
        self.repeats = watch_of(name, r_e) if unmeasured is None else None
        self._lines = line_watch_of(name) if unmeasured is None else None
        # when the car stands by this signal, if it is a speed; complete once all samples of the first pass are through
        self.stands = stand_watch_of(name, r_e) if unmeasured is None else None
        is_watched = unmeasured is None and self._symbol.kind == "continuous"
        self.start = StartWatch((r_e or 1.0) if name in SPEEDS else None) if is_watched else None
        # counts, and where something was first found
        self._in_order = self._bad = self._code = self._out = self._glitches = self._through = 0
        self._frozen = self._joined = self._unread = 0
        self._first_glitch_ns: int | None = None
        self._first_out: tuple[int, float] | None = None
        # the time in which a jump may turn back
        self._wait_t, self._wait_x = _NO_TIMES, _NO_VALUES
        self._done = 0  # of these, let through already
        self._dead: float | None = None  # the value at which a sensor stands since a step that no wheel can make

    def push(self, t_ns: TimeArray, raw: FloatArray, *, is_last: bool = False) -> Samples:
        """Take samples (n,) as the file has them; return those in SI that are now certain.

        The rest comes with later pieces, with the last one all of it. Stamps increase strictly.
        """
        self._in_order += t_ns.size
        own = _judged(self._symbol, self._entry, raw, self._unit, self._vehicle, self.where)
        self._bad += int(own.is_bad.sum())
        self._code += int(own.is_code.sum())
        self._out += int(own.is_out.sum())
        if self._first_out is None and own.is_out.any():
            k = int(np.argmax(own.is_out))
            self._first_out = int(t_ns[k]), float(own.values[k])
        t, x = _where(own.keep, t_ns, own.values)
        return (
            self._let_through(t, x) if self._rule is None else self._without_glitches(self._rule, t, x, is_last=is_last)
        )

    def _let_through(self, t: TimeArray, x: FloatArray) -> Samples:
        self._through += t.size
        if self.repeats is not None:
            self.repeats.push(t, x)
        if self._lines is not None:
            self._lines.push(t, x)
        if self.stands is not None:
            self.stands.push(t, x)
        if self.start is not None:
            self.start.push(t, x)
        if any(self._unmeasured):
            silent = within(t, self._unmeasured.unread, has_end=True)
            self._unread += int(silent.sum())
            t, x = _where(~silent, t, x)
            repeats = within(t, self._unmeasured.frozen, has_end=True)
            joined = within(t, self._unmeasured.joined, has_end=False) & ~repeats  # its ends were measured
            self._frozen += int(repeats.sum())
            self._joined += int(joined.sum())
            t, x = _where(~(repeats | joined), t, x)
        return t, x

    def _without_glitches(self, rule: Glitches, t: TimeArray, x: FloatArray, *, is_last: bool) -> Samples:
        """Return samples whose next second is known, without those that no car can have made."""
        if self._dead is not None:
            moving = np.flatnonzero(x != self._dead)
            dead = int(moving[0]) if moving.size else x.size
            self._note_glitches(t[:dead])
            t, x = t[dead:], x[dead:]
            if not moving.size:
                return _NO_TIMES, _NO_VALUES
            self._dead, self._wait_t, self._wait_x, self._done = None, _NO_TIMES, _NO_VALUES, 0
        if self._wait_t.size:
            t, x = np.concatenate([self._wait_t, t]), np.concatenate([self._wait_x, x])
        if not t.size:
            return t, x
        glitch = self._judged_glitches(rule, t, x)
        # a jump is judged once what may lead back, and the stamps behind that, are known
        certain = t.size if is_last else int(np.searchsorted(t, t[-1] - KNOWN_NS, side="left"))
        if not is_last and glitch[-1]:
            since = int(np.flatnonzero(~glitch).max(initial=-1)) + 1  # where the glitch at the end begins
            if since < certain and bool((x[since:] == x[-1]).all()):  # the sensor is dead
                self._dead, certain = float(x[-1]), t.size
        while 0 < certain < t.size and glitch[max(certain - 2, 0) : certain + 1].any():
            certain -= 1  # neither in a glitch nor at its end, nor behind that
        new = slice(self._done, max(certain, self._done))
        self._note_glitches(t[new][glitch[new]])
        start = max(new.stop - 2, 0)  # the samples before are what the next one is compared with
        self._wait_t, self._wait_x, self._done = t[start:].copy(), x[start:].copy(), new.stop - start
        if new.stop - new.start < t.size:
            t, x, glitch = t[new], x[new], glitch[new]
        return self._let_through(*_where(~glitch, t, x))

    def _judged_glitches(self, rule: Glitches, t: TimeArray, x: FloatArray) -> BoolArray:
        before = self._through + self._glitches - self._done  # samples to the left of these
        if not before:
            return rule.find(t, x)
        # a rest of two samples is part of a long signal: something is to the left of it
        t, x = np.concatenate([t[0] + np.array([-2, -1]), t]), np.concatenate([[np.nan, np.nan], x])
        return rule.find(t, x)[2:]

    def _note_glitches(self, t: TimeArray) -> None:
        self._glitches += t.size
        if self._first_glitch_ns is None and t.size:
            self._first_glitch_ns = int(t[0])

    def unmeasured(self) -> Unmeasured:
        """Return where no sensor made the signal; complete once all samples are through."""
        frozen = self._unmeasured.frozen if self.repeats is None else self.repeats.finish()
        return Unmeasured(frozen, self._unmeasured.joined if self._lines is None else self._lines.finish())

    def cleaned(self, taken: Taken) -> tuple[Clean, list[str]]:
        """Return the signal, and the notes on it, once all samples are through."""
        begin = taken.every.first_ns
        notes = []
        if not self._unit and self._is_explicit and self._symbol.kind != "state":
            notes.append(f"{self.where} has no unit; taken as {self._symbol.unit}")
        if self._rule is not None and self._first_glitch_ns is not None:
            after_s = float(self._first_glitch_ns - begin) * 1e-9
            notes.append(f"{self.where}: {self._glitches} samples (first at {after_s:.2f} s) {self._rule.what}")
        if self._first_out is not None:
            at, value = self._first_out
            notes.append(
                f"{self.where}: {self._out} of {self._in_order} samples outside {self._symbol.low:g} ... "
                f"{self._symbol.high:g} {self._symbol.unit} (first: {value:.6g} at {float(at - begin) * 1e-9:.2f} s) "
                f"are left out{': all of them, its unit or its sign is wrong' if self._out == self._in_order else ''}"
            )
        if self._unread:
            notes.append(unread_note(self.where, self._unread))
        if self._frozen:
            notes.append(freeze_note(self.where, self._frozen, begin, self._unmeasured.frozen))
        if self._unmeasured.joined:
            notes.append(joined_note(self.where, self._joined, begin, self._unmeasured.joined))
        origin = Origin(
            symbol=self._name,
            channel=self.info.path,
            file=self.info.file,
            unit=self._unit or self._symbol.unit,
            rate_hz=taken.every.rate_hz,
            samples=taken.samples,
            not_finite=self._bad,
            out_of_range=self._out + self._glitches,
            invalid_code=self._code,
            frozen=self._frozen + self._unread,
            joined=self._joined,
            faults=taken.faults,
            mapped=mapped_as(self._entry),
        )
        return Clean(self._symbol, origin, taken.used), notes


def mapped_as(entry: Entry) -> dict[str, Any]:
    """Return the line of a map by key, in plain values; without those that do nothing."""
    idle = Entry(entry.symbol, entry.channel)
    said = {k: getattr(entry, k) for k in ("unit", "scale", "offset") if getattr(entry, k) != getattr(idle, k)}
    return {"channel": list(entry.channel), **said, **({"invalid": list(entry.invalid)} if entry.invalid else {})}


def _where(keep: BoolArray, t: TimeArray, x: FloatArray) -> Samples:
    """Return these samples: the same arrays if all, so that signals with the same stamps are still known by them."""
    return (t, x) if keep.all() else (t[keep], x[keep])


class _Judged(NamedTuple):
    """Samples (n,) in SI, and flags for those that are not finite, that are error codes, or that are out of range."""

    values: FloatArray
    is_bad: BoolArray
    is_code: BoolArray
    is_out: BoolArray

    @property
    def keep(self) -> BoolArray:
        """Which samples are used."""
        return ~(self.is_bad | self.is_code | self.is_out)


def _judged(symbol: Symbol, entry: Entry, raw: FloatArray, unit: str, vehicle: Vehicle, where: str) -> _Judged:
    """Convert samples (n,), each by itself; raise SignalError if the unit is not one of the symbol."""
    values = _to_si(symbol, raw, unit, vehicle, where) * entry.scale + entry.offset
    is_code = np.zeros(raw.size, dtype=np.bool_)
    for code in entry.invalid:  # up to rounding: of 32 bits, or of 1023 * 0.1 against 102.3
        is_code |= np.isclose(raw, code, rtol=_ROUNDING, atol=0.0)
    is_bad = ~np.isfinite(values)
    is_out = ~is_bad & ~is_code & ((values < symbol.low) | (values > symbol.high))
    return _Judged(values, is_bad, is_code, is_out)


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
