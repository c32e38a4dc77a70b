"""What was lost on the way from the files to the grid."""

from __future__ import annotations

from collections.abc import Sequence

from aqualog.align.clean import Clean
from aqualog.types import FileFaults, Quality, TimeFaults

__all__ = ["quality_of"]


def quality_of(cleaned: Sequence[Clean], file_faults: Sequence[FileFaults], notes: Sequence[str]) -> Quality:
    """Counts and notes of a drive, from its signals' origins and what the readers lost."""
    by_file: dict[str, TimeFaults] = {}
    for clean in cleaned:  # the channels of one file mostly share their stamps: the worst one speaks for the file
        seen, new = by_file.get(clean.origin.file, TimeFaults()), clean.origin.faults
        by_file[clean.origin.file] = TimeFaults(*(max(getattr(seen, n), getattr(new, n)) for n in TimeFaults.__slots__))
    faults = sum(by_file.values(), TimeFaults())
    own = sum(
        c.origin.not_finite + c.origin.out_of_range + c.origin.invalid_code + c.origin.frozen
        + c.origin.faults.duplicates
        for c in cleaned
    )  # fmt: skip
    doubled = max((c.origin.faults.duplicates for c in cleaned), default=0)
    # a doubled stamp here and there is a logger's habit; many are samples lost to a wrong clock
    is_lossy = any(c.origin.faults.duplicates > 0.01 * c.origin.samples for c in cleaned)
    lost = sum(f.lost_samples for f in file_faults) + (doubled if is_lossy else 0)
    notes = [*(_time_note(file, faults) for file, faults in by_file.items() if faults != TimeFaults()), *notes]
    return Quality(
        dropped_samples=own + lost,
        lost_in_files=lost,
        frozen_samples=sum(c.origin.frozen for c in cleaned),
        time_jumps=faults.back_steps + faults.resets + faults.wraps + faults.pauses,
        truncated=any(f.truncated for f in file_faults),
        faults=faults,
        notes=tuple(dict.fromkeys([*(n for f in file_faults for n in f.notes), *notes])),
    )


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
