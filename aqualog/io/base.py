"""The protocol of a reader.

A reader opens a file without changing it, lists its channels without decoding samples where the format allows, and
decodes only the channels that are asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Protocol, Self

from aqualog.core.records import Channel, ChannelInfo, Drift, FileFaults
from aqualog.io.csv_format import CsvFormat

__all__ = ["FaultLog", "OpenFile", "Part", "ReadOptions", "Reader", "one_piece", "part_of"]


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """What the user says about the files beyond their content.

    `time_channel` and `time_unit` apply to tables (CSV, Parquet), `csv` to CSV files by name or pattern; `dbc` decodes
    raw CAN frames.
    """

    dbc: tuple[Path, ...] = ()
    time_channel: str | None = None
    time_unit: str | None = None
    csv: Mapping[str, CsvFormat] = field(default_factory=dict)


class Part(NamedTuple):
    """Channels of a file, by (file, path), that are read piece by piece together: each piece goes on where the one
    before has ended, in the order of the file.
    """  # fmt: skip

    channels: frozenset[tuple[str, str]]
    pieces: Iterator[Sequence[Channel]]


def part_of(wanted: Sequence[ChannelInfo], pieces: Iterator[Sequence[Channel]]) -> Part:
    """Pieces of these channels."""
    return Part(frozenset((w.file, w.path) for w in wanted), pieces)


def one_piece(wanted: Sequence[ChannelInfo], read: Callable[[Sequence[ChannelInfo]], list[Channel]]) -> Part:
    """These channels in one piece, which is read when it is asked for."""
    return part_of(wanted, (read(wanted) for _ in range(1)))


class Reader(Protocol):
    """One open log.

    Every reader is constructed as `XReader(path, options)` and is a context manager. It raises `LogError` for
    anything that the file's content causes, with the foreign exception as cause.
    """

    format: str

    def channels(self) -> Sequence[ChannelInfo]:
        """All channels, in file order; `path` unique."""
        ...

    def read(self, wanted: Iterable[ChannelInfo]) -> list[Channel]:
        """Decode these channels (as given by `channels()`), in the order asked for."""
        ...

    def parts(self, wanted: Iterable[ChannelInfo]) -> list[Part]:
        """The same piece by piece, for logs that are longer than memory; what has no pieces is one."""
        ...

    @property
    def faults(self) -> FileFaults:
        """What was lost so far; complete after `read`."""
        ...

    def close(self) -> None:
        """Release the file."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


@dataclass(slots=True)
class FaultLog:
    """Collects what a reader had to leave out while it works."""

    truncated: bool = False
    lost_samples: int = 0
    notes: list[str] = field(default_factory=list)
    unfinalised: bool = False
    drifts: list[Drift] = field(default_factory=list)

    def freeze(self) -> FileFaults:
        """Return the record of all losses."""
        notes, drifts = tuple(dict.fromkeys(self.notes)), tuple(dict.fromkeys(self.drifts))
        return FileFaults(self.truncated, self.lost_samples, notes, self.unfinalised, drifts)


class OpenFile:
    """What all readers have in common: a context manager for one file, and what was lost of it.

    Parameters
    ----------
    path : Path
    faults : FaultLog, optional
        What was lost before.
    """

    def __init__(self, path: Path, faults: FaultLog | None = None) -> None:
        self._path = path
        self._faults = faults or FaultLog()

    def _note(self, text: str) -> None:
        """A note that names the file."""
        self._faults.notes.append(f"{self._path.name}: {text}")

    @property
    def faults(self) -> FileFaults:
        """What was lost so far; complete after `read`."""
        return self._faults.freeze()

    def close(self) -> None:
        """Release the file; nothing is held open."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
