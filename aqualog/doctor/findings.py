"""What an examination found: faults, files, and what a drive lacks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from aqualog.align.mapping import MAP_HINT
from aqualog.core.records import FloatArray

__all__ = ["Examination", "FileState", "Finding", "Level", "Picture"]

Level = Literal["unreadable", "lost", "left_out", "mended", "doubt"]
"""`unreadable`: nothing could be read; `lost`: samples are gone; `left_out`: they are there, but not used; `mended`: a
fault of the time stamps was repaired; `doubt`: nothing is lost, but the user should check."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One fault. `count` of `of` samples (0, 0: does not apply); `channel` empty for the whole file.

    `first_s`: time of the first fault of time stamps, from the channel's first sample. [s]
    """

    level: Level
    kind: str
    file: str
    channel: str
    what: str
    advice: str = ""
    count: int = 0
    of: int = 0
    first_s: float | None = None


@dataclass(frozen=True, slots=True)
class FileState:
    """One file: its format (empty if unreadable), size [bytes], channels and samples read, and its time span [s]."""

    file: str
    format: str
    size: int
    channels: int = 0
    samples: int = 0
    start_s: float | None = None
    end_s: float | None = None


@dataclass(frozen=True, slots=True)
class Picture:
    """A channel (n,) with the times [s] from its first sample between which it is faulty.

    Values are as the file has them, in `unit`; NaN leaves a gap. A span of no length is one moment.
    """

    file: str
    channel: str
    unit: str
    t: FloatArray
    values: FloatArray
    spans: tuple[tuple[float, float], ...]
    kinds: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Examination:
    """Everything that was found in the files of one drive.

    `missing` are signals that a detector lacks, by detector; `pictures` channels that a finding names; `hint` what to
    try where no detector can run.
    """

    files: tuple[FileState, ...]
    findings: tuple[Finding, ...]
    ready: tuple[str, ...] = ()
    missing: tuple[tuple[str, tuple[str, ...]], ...] = ()
    pictures: tuple[Picture, ...] = ()
    hint: str = MAP_HINT

    @property
    def is_unreadable(self) -> bool:
        """Return whether nothing of the drive could be read."""
        return all(not f.format for f in self.files)

    @property
    def has_loss(self) -> bool:
        """Return whether data was lost."""
        return any(f.level in ("lost", "unreadable") for f in self.findings)
