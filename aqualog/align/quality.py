"""Count what was lost between the files and the grid."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from aqualog.align.clean import Clean
from aqualog.align.resample import gap_limit_ns
from aqualog.core.notation import SYMBOLS
from aqualog.core.records import FileFaults, Origin, Quality, TimeFaults

__all__ = ["missing_notes", "quality_of"]

MUCH = 0.2  # share of a drive; dropouts and sources that begin a little later stay below
NAMED = 6  # signals in one line


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
        f"{file}: {_listed(names)}: no value for {share} % of the drive: not recorded there, left out, or samples "
        f"further apart than {1e-6 * limit_ns:.0f} ms, which are not joined (a rate that changes?)"
        for (file, share, limit_ns), names in alike.items()
    ]


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more


def quality_of(cleaned: Sequence[Clean], file_faults: Sequence[FileFaults], notes: Sequence[str]) -> Quality:
    """Collect counts and notes of a drive, from its signals' origins and the losses that the readers report."""
    by_file: dict[str, TimeFaults] = {}
    for clean in cleaned:  # the channels of one file mostly share their stamps: the worst one speaks for the file
        seen, new = by_file.get(clean.origin.file, TimeFaults()), clean.origin.faults
        by_file[clean.origin.file] = seen.worse(new)
    faults = sum(by_file.values(), TimeFaults(drifts=sum(len(f.drifts) for f in file_faults)))
    own = sum(
        c.origin.not_finite + c.origin.out_of_range + c.origin.invalid_code + c.origin.frozen
        + c.origin.faults.duplicates + c.origin.faults.strays
        for c in cleaned
    )  # fmt: skip
    left_out = [(c.origin.faults.duplicates + c.origin.faults.strays, c.origin.samples) for c in cleaned]
    # a doubled or stray stamp here and there is a logger's habit; many are samples lost to a wrong clock
    is_lossy = any(n > 0.01 * samples for n, samples in left_out)
    lost = sum(f.lost_samples for f in file_faults) + (max(n for n, _ in left_out) if is_lossy else 0)
    on_time = [_time_note(file, faults) for file, faults in by_file.items() if faults != TimeFaults()]
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


def _time_note(file: str, faults: TimeFaults) -> str:
    words = {
        "duplicates": "doubled",
        "back_steps": "out of order",
        "resets": "resets",
        "wraps": "wraps",
        "pauses": "pauses",
        "strays": "from elsewhere, left out",
    }
    counts = ", ".join(
        f"{getattr(faults, n)} {word}{faults.place(n)}" for n, word in words.items() if getattr(faults, n)
    )
    return f"{file}: time stamps: {counts}"


def _reset_notes(by_file: Mapping[str, TimeFaults]) -> list[str]:
    """Return files whose clock restarts beside others whose clock goes on: only they are moved."""
    went_on = [file for file, faults in by_file.items() if not faults.resets]
    return [
        f"{file}: its clock restarts{faults.place('resets')}, that of {_listed(went_on)} does not. The part after the "
        "restart is placed 1 s behind the part before, which assumes a pause of 1 s; it may be out of step with the "
        "other files (`aqualog align` compares them; else cut the file there)"
        for file, faults in by_file.items()
        if faults.resets and went_on
    ]
