"""Build one table of the signals of a drive, and count what was lost between the files and it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl

from aqualog.align.clean import Clean, Cleaner, Samples, Taken, Unmeasured, corrected, span_of
from aqualog.align.freezes import SPEEDS, dead_speeds, limits_of, standing_by, unread, while_moving
from aqualog.align.grid import (
    MAX_ROWS,
    Grid,
    between_samples,
    columns_of,
    common_clock,
    gap_limit_ns,
    grid_of,
    missing_samples,
    onto_grid,
    placed,
)
from aqualog.align.mapping import Entry, SignalMap
from aqualog.align.timebase import ClockRepair, OfLast, with_spread_stamps, without_copies
from aqualog.core.errors import SignalError, listed
from aqualog.core.notation import SYMBOLS
from aqualog.core.records import Channel, ChannelInfo, FileFaults, Origin, Quality, Signals, TimeFaults
from aqualog.core.vehicle import Vehicle

__all__ = ["Found", "Plan", "build_signals", "cleaners_of", "missing_notes", "plan_drive", "quality_of"]

MUCH = 0.2  # share of a drive; dropouts and sources that begin a little later stay below
NAMED = 6  # signals in one line
_TIME_WORDS = {
    "duplicates": "doubled", "back_steps": "out of order", "resets": "resets", "wraps": "wraps", "pauses": "pauses",
    "strays": "from elsewhere, left out",
}  # fmt: skip


def missing_notes(origins: Iterable[Origin]) -> list[str]:
    """Return notes on signals without values for much of the drive; signals of one file that are alike share a line.

    A rate that falls to less than a fifth shows up only here: each step is then a gap, and no detector judges there.
    """
    alike: dict[tuple[str, int, int], list[str]] = {}
    for o in origins:
        if SYMBOLS[o.symbol].kind == "continuous" and o.missing_fraction >= MUCH:
            limit_ns = gap_limit_ns(round(1e9 / o.rate_hz) if o.rate_hz else 0, is_state=False)
            alike.setdefault((o.file, round(100.0 * o.missing_fraction), limit_ns), []).append(o.symbol)
    return [
        f"{file}: {listed(names, NAMED)}: no value for {share} % of the drive: not recorded there, left out, or "
        f"samples further apart than {1e-6 * limit_ns:.0f} ms, which are not joined (a rate that changes?)"
        for (file, share, limit_ns), names in alike.items()
    ]


def quality_of(cleaned: Sequence[Clean], file_faults: Sequence[FileFaults], notes: Sequence[str]) -> Quality:
    """Collect counts and notes of a drive, from its signals' origins and the losses that the readers report."""
    by_file: dict[str, TimeFaults] = {}
    for clean in cleaned:  # the channels of one file mostly share their stamps: the worst one speaks for the file
        seen, new = by_file.get(clean.origin.file, TimeFaults()), clean.origin.faults
        by_file[clean.origin.file] = seen.worse(new)
    faults = sum(by_file.values(), TimeFaults(drifts=sum(len(f.drifts) for f in file_faults)))
    own = sum(
        c.origin.not_finite + c.origin.out_of_range + c.origin.invalid_code + c.origin.frozen
        + c.origin.joined + c.origin.faults.duplicates + c.origin.faults.strays
        for c in cleaned
    )  # fmt: skip
    left_out = [(c.origin.faults.duplicates + c.origin.faults.strays, c.origin.samples) for c in cleaned]
    # a doubled or stray stamp here and there is a logger's habit; many are samples lost to a wrong clock
    is_lossy = any(n > 0.01 * samples for n, samples in left_out)
    lost = sum(f.lost_samples for f in file_faults) + (max(n for n, _ in left_out) if is_lossy else 0)
    on_time = [
        f"{file}: time stamps: "
        + ", ".join(f"{getattr(own, n)} {word}{own.place(n)}" for n, word in _TIME_WORDS.items() if getattr(own, n))
        for file, own in by_file.items()
        if own != TimeFaults()
    ]
    told = [*(n for f in file_faults for n in f.notes), *on_time, *_reset_notes(by_file), *notes]
    return Quality(
        dropped_samples=own + lost,
        lost_in_files=lost,
        frozen_samples=sum(c.origin.frozen for c in cleaned),
        time_jumps=faults.back_steps + faults.resets + faults.wraps + faults.pauses,
        truncated=any(f.truncated for f in file_faults),
        unfinalised=any(f.unfinalised for f in file_faults),
        faults=faults,
        notes=tuple(dict.fromkeys(told)),
    )


def _reset_notes(by_file: Mapping[str, TimeFaults]) -> list[str]:
    """Return files whose clock restarts; beside others whose clock goes on, only they are moved."""
    went_on = [file for file, faults in by_file.items() if not faults.resets]
    beside = f", that of {listed(went_on, NAMED)} does not" if went_on else ""
    doubt = "times and places after it are in doubt by the true pause"
    if went_on:
        doubt = "it may be out of step with the other files (`aqualog align` compares them; else cut the file there)"
    return [
        f"{file}: its clock restarts{faults.place('resets')}{beside}. The part after the restart is placed 1 s behind "
        f"the part before, which assumes a pause of 1 s; {doubt}"
        for file, faults in by_file.items()
        if faults.resets
    ]


Found = Mapping[str, tuple[Entry, ChannelInfo]]


@dataclass(frozen=True, slots=True)
class Plan:
    """A drive whose signals have gone through their cleaners once.

    `cleaned`: its signals; `notes` on them; `absolute`: whether the grid counts from 1970; `unmeasured`: where no
    sensor made its signals.
    """

    grid: Grid
    absolute: bool
    cleaned: tuple[Clean, ...]
    notes: tuple[str, ...]
    unmeasured: Mapping[str, Unmeasured]
    vehicle: Vehicle

    @property
    def symbols(self) -> tuple[str, ...]:
        """Return canonical signals in their usual order."""
        names = {n for c in self.cleaned for n, _ in columns_of(c.symbol, np.zeros(0), self.vehicle)}
        return tuple(n for n in SYMBOLS if n in names)

    @property
    def files(self) -> tuple[str, ...]:
        """Return files of its signals."""
        return tuple(dict.fromkeys(c.origin.file for c in self.cleaned))

    def table(
        self, samples: Mapping[str, Samples], first: int = 0, last: int | None = None
    ) -> tuple[Signals, Mapping[str, bool]]:
        """Return the rows from `first` to before `last` without origins and quality, and which signals were bridged.

        `samples`: of each signal of the map, at least those around these rows. A signal is bridged where a sample of it
        was missing somewhere in these rows.
        """
        points = self.grid.points(first, last)
        place = OfLast(lambda t_ns: placed(t_ns, points, self.grid.dt_ns))
        columns: dict[str, pl.Series] = {}
        bridged: dict[str, bool] = {}
        # one room for all, of huge pages: small ones that are fresh cost more than the arithmetic
        room = np.empty((len(self.cleaned), points.size))
        for clean, y in zip(self.cleaned, room, strict=True):
            name = clean.origin.symbol
            t, x = samples[name]
            at = place(t) if t.size else None
            bridged[name] = onto_grid(clean.symbol, clean.span, t, x, points, self.grid.dt_ns, at, y)
            for column, series in columns_of(clean.symbol, y, self.vehicle):
                columns.setdefault(column, series)  # a signal under its canonical name wins over a derived one
        time = pl.Series("t", self.grid.seconds(first, last))
        return self._signals(pl.DataFrame([time, *(columns[n].rename(n) for n in self.symbols)])), bridged

    def _signals(self, frame: pl.DataFrame) -> Signals:
        start = self.grid.start_ns if self.absolute else None
        return Signals(frame, self.grid.dt_ns, start, {}, quality_of((), (), ()), ())

    def facts(self, missing: Mapping[str, int], bridged: frozenset[str], faults: Sequence[FileFaults]) -> Signals:
        """Return origins and quality of the whole drive, with an empty table.

        `missing`: rows of the whole table without a value, by symbol; `bridged`: signals of the map of which a sample
        was missing; `faults`: what the readers lost.
        """
        origins: dict[str, Origin] = {}
        for clean in self.cleaned:
            seen = missing_samples(clean.span, self.grid) if clean.origin.symbol in bridged else 0.0
            between = between_samples(clean.span, self.grid)
            for name, _ in columns_of(clean.symbol, np.zeros(0), self.vehicle):
                share = max(missing[name] / self.grid.rows, seen)
                origins.setdefault(name, replace(clean.origin, symbol=name, missing_fraction=share, between=between))
        ordered = {n: origins[n] for n in SYMBOLS if n in origins}
        quality = quality_of(self.cleaned, faults, [*self.notes, *missing_notes(ordered.values())])
        empty = self._signals(pl.DataFrame({"t": pl.Series([], dtype=pl.Float64)}))
        return replace(empty, origins=ordered, quality=quality, files=self.files)


def build_signals(
    mapped: Mapping[str, tuple[Entry, Channel]], *, signal_map: SignalMap, vehicle: Vehicle,
    file_faults: Sequence[FileFaults] = (), rate_hz: float | None = None, dbc: Sequence[str] = (),
) -> Signals:  # fmt: skip
    """Bring the mapped channels of one drive onto one integer-nanosecond grid.

    Continuous signals are interpolated linearly, or averaged over a grid step where they are more than twice as fast
    as the grid; states are held. Nothing is extrapolated, and nothing is carried across a gap of more than five sample
    times (states: ten). The grid runs at the rate of the wheel speeds, else at that of the fastest signal.

    Parameters
    ----------
    mapped : mapping symbol -> (entry, channel)
        As found by `resolve`, with samples.
    signal_map, vehicle
        Clock corrections; effective radii (wheel speeds in km/h or m/s) and steering ratio.
    file_faults : sequence
        What the readers lost.
    rate_hz : float, optional
        Grid rate; default as above.

    Raises
    ------
    SignalError
        If no signal is usable, units do not fit, or the sources' clocks cannot be joined.
    """
    channels, copies = without_copies({name: channel for name, (_, channel) in mapped.items()})
    channels, spread = with_spread_stamps(channels)
    repairs: dict[str, ClockRepair] = {}
    span = OfLast(span_of)  # channels of one group have the same stamps
    samples: dict[str, Samples] = {}

    def take(cleaners: Mapping[str, Cleaner]) -> dict[str, Taken]:
        taken = {}
        for name, cleaner in cleaners.items():
            channel = channels[name]
            repair = repairs.setdefault(channel.info.file, ClockRepair())
            t_ns, order, faults = repair.repair(corrected(channel.t_ns, signal_map, channel.info.file))
            is_changed = faults.back_steps or faults.duplicates or faults.strays
            raw = channel.values[order] if is_changed else channel.values
            samples[name] = cleaner.push(t_ns, raw, is_last=True)
            every, used = span(t_ns), span(samples[name][0])
            taken[name] = Taken(channel.values.size, every, used, faults, channel.absolute)
        return taken

    found = {name: (entry, channel.info) for name, (entry, channel) in mapped.items()}
    plan = plan_drive(found, take, signal_map=signal_map, vehicle=vehicle, rate_hz=rate_hz, dbc=dbc)
    table, bridged = plan.table(samples)
    missing = {name: table.frame[name].null_count() for name in plan.symbols}
    facts = plan.facts(
        missing,
        frozenset(name for name, gaps in bridged.items() if gaps),
        [*file_faults, FileFaults(notes=(*copies, *spread))],
    )
    return replace(facts, frame=table.frame)


def plan_drive(
    found: Found, take: Callable[[Mapping[str, Cleaner]], Mapping[str, Taken]], *, signal_map: SignalMap,
    vehicle: Vehicle, rate_hz: float | None = None, most_rows: int = MAX_ROWS, dbc: Sequence[str] = (),
) -> Plan:  # fmt: skip
    """Clean the signals of a drive and plan its grid.

    `take` passes all samples of some signals through their cleaners; signals without a sample may be left out. A signal
    that is frozen or joined somewhere, which is rare, goes through twice.

    Raises
    ------
    SignalError, ConfigError
        As `build_signals`.
    """
    faults: dict[str, str] = {}
    cleaners = cleaners_of(found, signal_map, vehicle, faults=faults)
    taken = dict(take(cleaners))
    speeds = {name: w for name in SPEEDS if name in cleaners and (w := cleaners[name].stands) is not None}
    standing = standing_by(speeds.values())
    unmeasured = {name: cleaner.unmeasured() for name, cleaner in cleaners.items()}
    unmeasured |= {name: Unmeasured((dead,)) for name, dead in dead_speeds(speeds).items()}
    watches = {name: c.repeats for name, c in cleaners.items() if c.repeats is not None}
    # measured wheels have noise, and so has what accelerates the car
    if "a_x" in watches and (whole := watches["a_x"].whole) and any(watches[name].is_noisy for name in speeds):
        unmeasured["a_x"] = Unmeasured((whole,))
    for name, own in unmeasured.items():
        if limits := limits_of(name):
            unmeasured[name] = own._replace(frozen=while_moving(own.frozen, standing, limits[0]))
    for name, zeros in unread({name: c.start for name, c in cleaners.items() if c.start is not None}).items():
        unmeasured[name] = unmeasured[name]._replace(unread=(zeros,))
    in_part = {name: found[name] for name, own in unmeasured.items() if any(own)}
    if in_part:  # sample times and counts are those without what nobody measured
        again = cleaners_of(in_part, signal_map, vehicle, unmeasured)
        cleaners |= again
        taken |= take(again)
    cleaned: list[Clean] = []
    empty: list[Clean] = []
    notes: list[str] = []
    for name in found:
        if name in faults:
            notes.append(faults[name])
        if name in taken:
            clean, own_notes = cleaners[name].cleaned(taken[name])
            notes += own_notes
            (cleaned if clean.span.samples else empty).append(clean)
    is_usable = any(c.symbol.kind == "continuous" for c in cleaned)
    if not cleaned or ((faults or empty) and not is_usable):
        raise _nothing_usable([*faults.values(), *(_why_empty(c.origin) for c in empty)], found)
    clocks = [(c.origin.file, taken[c.origin.symbol].absolute) for c in cleaned]
    with_speed = {c.origin.file for c in cleaned if c.origin.symbol in SPEEDS}
    absolute = common_clock(clocks, signal_map, with_speed=with_speed, dbc=dbc)
    grid = grid_of(cleaned, rate_hz, most_rows=most_rows)
    return Plan(grid, absolute, tuple(cleaned), tuple(notes), unmeasured, vehicle)


_WHY = {
    "not_finite": "no numbers", "invalid_code": 'codes for "no value"', "out_of_range": "out of range",
    "frozen": "frozen", "joined": "a filled gap",
}  # fmt: skip


def _why_empty(origin: Origin) -> str:
    """Return why no sample of a signal is used."""
    counts = [f"{n} {word}" for kind, word in _WHY.items() if (n := getattr(origin, kind))]
    of = f"of {origin.samples} samples {', '.join(counts)}" if counts else "no sample"
    return f"{origin.symbol} ({origin.file}:{origin.channel} [{origin.unit}]): {of}"


def _nothing_usable(whys: Sequence[str], found: Found) -> SignalError:
    return SignalError(
        f"no usable signal{': ' if whys else ''}{'; '.join(whys[:NAMED])}",
        where=", ".join(dict.fromkeys(info.file for _, info in found.values())),
        expected="at least wheel speeds",
        hint="`aqualog inspect LOG` shows what each channel holds; a unit or a channel that is wrong is put right in "
        "the signal map",
    )


def cleaners_of(
    found: Found, signal_map: SignalMap, vehicle: Vehicle, unmeasured: Mapping[str, Unmeasured] | None = None,
    faults: dict[str, str] | None = None,
) -> dict[str, Cleaner]:  # fmt: skip
    """Return a cleaner for each signal whose unit fits, and in `faults` a note on each other."""
    cleaners = {}
    for name, (entry, info) in found.items():
        try:
            known = None if unmeasured is None else unmeasured.get(name, Unmeasured())
            cleaners[name] = Cleaner(name, entry, info, signal_map, vehicle, known)
        except SignalError as error:
            if faults is not None:
                faults[name] = f"{error.line()}; the signal is left out"
    return cleaners
