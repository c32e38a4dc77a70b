"""Clean the samples of one signal that arrive piece by piece, with the same result as in one piece.

Stamps out of order, resets and wraps need the whole channel. They raise `NotInPiecesError`: such a log is read at once.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from aqualog.align.clean import BURST, Clean, Span, corrected, glitch_note, judged, mean_of_steps, out_note, symbol_of
from aqualog.align.freezes import Freeze, freeze_note, in_freezes, watch_of
from aqualog.align.glitches import KNOWN_NS, glitches_of
from aqualog.align.mapping import Entry, SignalMap
from aqualog.align.resample import MEDIAN_OF
from aqualog.align.standing import stand_watch_of
from aqualog.align.timebase import DAY_NS
from aqualog.core.errors import ConfigError, SignalError
from aqualog.core.records import BoolArray, ChannelInfo, FloatArray, Origin, TimeArray, TimeFaults
from aqualog.core.vehicle import Vehicle

__all__ = ["NotInPiecesError", "PieceCleaner"]

_SECOND = 1_000_000_000
_NO_TIMES: TimeArray = np.zeros(0, dtype=np.int64)
_NO_VALUES: FloatArray = np.zeros(0)


class NotInPiecesError(Exception):
    """The log can only be cleaned as a whole."""


@dataclass(slots=True)
class _Steps:
    """Sample times of stamps that arrive in pieces: their median, and the mean without gaps."""

    first: list[TimeArray] = field(default_factory=list)
    kept: int = 0
    median: int = 0
    total: int = 0
    count: int = 0
    late: bool = False  # steps have been counted by the median

    def add(self, steps: TimeArray) -> None:
        room = MEDIAN_OF - self.kept
        if room > 0:
            self.first.append(steps[:room].copy())
            self.kept += self.first[-1].size
            if self.kept == MEDIAN_OF:
                self._settle()
            steps = steps[room:]
        if steps.size:
            self._count(steps)

    def _settle(self) -> None:
        steps = np.concatenate(self.first) if self.first else _NO_TIMES
        self.median = int(np.median(steps)) if steps.size else 0
        self.first, self.late = [], True
        self._count(steps)

    def _count(self, steps: TimeArray) -> None:
        steps = steps[steps < BURST * self.median]
        self.total += int(steps.sum())
        self.count += steps.size

    def finish(self) -> tuple[int, int]:
        """Return median and mean. [ns]"""
        if not self.late:
            self._settle()
        return self.median, mean_of_steps(self.total, self.count)


class PieceCleaner:
    """One signal of a drive.

    Parameters
    ----------
    name : str
        As the map has it.
    entry : Entry
    info : ChannelInfo
    signal_map : SignalMap
    vehicle : Vehicle
    freezes : tuple of Freeze, optional
        Where the signal is frozen, from `frozen` of an earlier pass; without them no sample is left out as frozen.

    Raises
    ------
    SignalError, ConfigError
        If the unit does not fit the signal; ConfigError where the map gives the unit.
    """

    def __init__(
        self, name: str, entry: Entry, info: ChannelInfo, signal_map: SignalMap, vehicle: Vehicle,
        freezes: tuple[Freeze, ...] | None = None,
    ) -> None:  # fmt: skip
        self.name, self.info = name, info
        self.symbol = symbol_of(name)
        self.unit = entry.unit or info.unit
        self.absolute: bool | None = None
        self._entry, self._map, self._vehicle = entry, signal_map, vehicle
        self._where = f"{info.file}:{info.path}"
        self._is_explicit = name in signal_map.entries
        try:
            judged(self.symbol, entry, _NO_VALUES, self.unit, vehicle, self._where)
        except SignalError as error:
            if self._is_explicit:
                raise ConfigError(error.what, where=error.where, expected=error.expected, hint=error.hint) from error
            raise
        r_e = vehicle.r_e(name[-2:]) if name.startswith("omega_") else None
        self._rule = glitches_of(name, r_e)
        self._freezes = freezes or ()
        self._watch = watch_of(name, r_e) if freezes is None else None
        # when the car stands by this signal, if it is a speed; complete after `finish` of the first pass
        self.stands = stand_watch_of(name, r_e) if freezes is None else None
        # counts
        self._frozen = 0
        self._samples = self._duplicates = self._bad = self._code = self._out = self._glitches = self._repaired = 0
        self._pauses: list[tuple[int, int]] = []  # how long, and after which stamp [ns]
        self._first_duplicate_ns: int | None = None
        self._first_ns: int | None = None
        self._first_glitch_ns: int | None = None
        self._first_out: tuple[int, float] | None = None
        self._all, self._used = _Steps(), _Steps()
        self._ends: tuple[int, int] | None = None
        self._used_count = 0
        # what is held back
        self._held_t, self._held_raw = _NO_TIMES, _NO_VALUES  # the last sample: one with the same stamp may follow
        self._last_ns: int | None = None  # of the stamps let through
        self._wait_t, self._wait_x = _NO_TIMES, _NO_VALUES  # the time in which a jump may turn back
        self._done = 0  # of these, let through already
        self._dead: float | None = None  # the value at which a sensor stands since a step that no wheel can make

    def push(self, t_ns: TimeArray, raw: FloatArray, *, absolute: bool) -> tuple[TimeArray, FloatArray]:
        """Return usable samples that are now certain, in SI; the rest comes with later pieces."""
        if t_ns.size == 0:
            return _NO_TIMES, _NO_VALUES
        if self.absolute is None:
            self.absolute = absolute
        self._samples += t_ns.size
        t = np.concatenate([self._held_t, corrected(t_ns, self._map, self.info.file)])
        raw = np.concatenate([self._held_raw, raw])
        self._held_t, self._held_raw = t[-1:].copy(), raw[-1:].copy()
        steps = np.diff(t)
        if (steps < 0).any():
            raise NotInPiecesError(f"{self._where}: time stamps out of order")
        if (steps > DAY_NS).any():
            raise NotInPiecesError(f"{self._where}: time stamps that leap")
        same = steps == 0
        self._duplicates += int(same.sum())
        if self._first_duplicate_ns is None and same.any():
            self._first_duplicate_ns = int(t[np.argmax(same)])
        return self._settled(t[:-1][~same], raw[:-1][~same])

    def finish(self) -> tuple[TimeArray, FloatArray]:
        """Return the samples that were held back."""
        t, x = self._settled(self._held_t, self._held_raw)
        self._held_t, self._held_raw = _NO_TIMES, _NO_VALUES
        if self._rule is None:
            return t, x
        rest_t, rest_x = self._without_glitches(_NO_TIMES, _NO_VALUES, is_last=True)
        return np.concatenate([t, rest_t]), np.concatenate([x, rest_x])

    def _settled(self, t: TimeArray, raw: FloatArray) -> tuple[TimeArray, FloatArray]:
        if t.size == 0:
            return t, raw
        if self._first_ns is None:
            self._first_ns = int(t[0])
        steps = np.diff(t) if self._last_ns is None else np.diff(t, prepend=self._last_ns)
        self._last_ns = int(t[-1])
        self._all.add(steps)
        is_long = steps > _SECOND
        self._pauses += zip(steps[is_long].tolist(), (t[t.size - steps.size :] - steps)[is_long].tolist(), strict=True)
        self._repaired += t.size
        own = judged(self.symbol, self._entry, raw, self.unit, self._vehicle, self._where)
        self._bad += int(own.is_bad.sum())
        self._code += int(own.is_code.sum())
        self._out += int(own.is_out.sum())
        if self._first_out is None and own.is_out.any():
            k = int(np.argmax(own.is_out))
            self._first_out = int(t[k]), float(own.values[k])
        keep = own.keep
        t, x = t[keep], own.values[keep]
        return self._let_through(t, x) if self._rule is None else self._without_glitches(t, x, is_last=False)

    def _let_through(self, t: TimeArray, x: FloatArray) -> tuple[TimeArray, FloatArray]:
        if self._watch is not None:
            self._watch.push(t, x)
        if self.stands is not None:
            self.stands.push(t, x)
        if self._freezes:
            repeats = in_freezes(t, self._freezes)
            self._frozen += int(repeats.sum())
            t, x = t[~repeats], x[~repeats]
        if t.size:
            last = None if self._ends is None else self._ends[1]
            self._used.add(np.diff(t) if last is None else np.diff(t, prepend=last))
            self._ends = int(t[0]) if self._ends is None else self._ends[0], int(t[-1])
            self._used_count += t.size
        return t, x

    def _without_glitches(self, t: TimeArray, x: FloatArray, *, is_last: bool) -> tuple[TimeArray, FloatArray]:
        """Return samples whose next second is known, without those that no car can have made."""
        if self._dead is not None:
            moving = np.flatnonzero(x != self._dead)
            dead = int(moving[0]) if moving.size else x.size
            self._found(t[:dead], x[:dead])
            t, x = t[dead:], x[dead:]
            if not moving.size:
                return _NO_TIMES, _NO_VALUES
            self._dead, self._wait_t, self._wait_x, self._done = None, _NO_TIMES, _NO_VALUES, 0
        t, x = np.concatenate([self._wait_t, t]), np.concatenate([self._wait_x, x])
        if t.size == 0:
            return t, x
        glitch = self._judged_glitches(t, x)
        # a jump is judged once what may lead back, and the stamps behind that, are known
        certain = t.size if is_last else int(np.searchsorted(t, t[-1] - KNOWN_NS, side="left"))
        if not is_last and glitch[-1] and _dead_since(glitch, x) < certain:
            self._dead, certain = float(x[-1]), t.size
        while 0 < certain < t.size and glitch[max(certain - 2, 0) : certain + 1].any():
            certain -= 1  # neither in a glitch nor at its end, nor behind that
        new = slice(self._done, max(certain, self._done))
        out = ~glitch[new]
        self._found(t[new][~out], x[new][~out])
        found = self._let_through(t[new][out], x[new][out])
        start = max(new.stop - 2, 0)  # the samples before are what the next one is compared with
        self._wait_t, self._wait_x, self._done = t[start:].copy(), x[start:].copy(), new.stop - start
        return found

    def _judged_glitches(self, t: TimeArray, x: FloatArray) -> BoolArray:
        assert self._rule is not None
        if self._used_count + self._frozen + self._glitches + t.size - self._done < 3:
            return np.zeros(t.size, dtype=bool)
        # a rest of two samples is part of a long signal: something is to the left of it
        t, x = np.concatenate([t[0] + np.array([-2, -1]), t]), np.concatenate([[np.nan, np.nan], x])
        return self._rule.find(t, x)[2:]

    def _found(self, t: TimeArray, x: FloatArray) -> None:
        if t.size == 0:
            return
        self._glitches += t.size
        if self._first_glitch_ns is None:
            self._first_glitch_ns = int(t[0])

    def frozen(self) -> tuple[Freeze, ...]:
        """Return where the signal is frozen; complete after `finish`."""
        return self._freezes if self._watch is None else self._watch.finish()

    def cleaned(self) -> tuple[Clean, list[str]]:
        """Return the signal without its samples, and the notes on it; complete after `finish`."""
        period, _ = self._all.finish()
        used, mean = self._used.finish()
        first, last = self._ends or (0, 0)
        notes = []
        if not self.unit and self._is_explicit:
            notes.append(f"{self._where} has no unit; taken as {self.symbol.unit}")
        begin = self._first_ns or 0
        if self._rule is not None and self._first_glitch_ns is not None:
            notes.append(glitch_note(self._where, self._rule, self._glitches, self._first_glitch_ns - begin))
        if self._first_out is not None:
            at, value = self._first_out
            notes.append(out_note(self._where, self.symbol, self._out, self._repaired, value, at - begin))
        if self._freezes:
            notes.append(freeze_note(self._where, self._frozen, begin, self._freezes))
        pauses = [at for step, at in self._pauses if step > 10 * period]
        places = {"duplicates": self._first_duplicate_ns, "pauses": pauses[0] if pauses else None}
        first_s = {kind: (at - begin) * 1e-9 for kind, at in places.items() if at is not None}
        faults = TimeFaults(duplicates=self._duplicates, pauses=len(pauses), first_s=first_s)
        origin = Origin(
            symbol=self.name,
            channel=self.info.path,
            file=self.info.file,
            unit=self.unit or self.symbol.unit,
            rate_hz=1e9 / period if period else 0.0,
            samples=self._samples,
            not_finite=self._bad,
            out_of_range=self._out + self._glitches,
            invalid_code=self._code,
            frozen=self._frozen,
            faults=faults,
        )
        span = Span(first, last, self._used_count, used, mean)
        return Clean(self.symbol, origin, span, _NO_TIMES, _NO_VALUES), notes


def _dead_since(glitch: BoolArray, x: FloatArray) -> int:
    """Return where the constant value of the glitch at the end begins; beyond the end if the sensor is not dead."""
    last = np.flatnonzero(~glitch)
    start = int(last[-1]) + 1 if last.size else 0
    return start if bool((x[start:] == x[-1]).all()) else glitch.size
