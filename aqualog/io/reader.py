"""The protocol of a reader, and what the user may say about a file.

A reader opens a file without changing it, lists its channels without decoding samples where the format allows, and
decodes only the channels that are asked for.
"""

from __future__ import annotations

import codecs
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple, Protocol, Self

from aqualog.core.records import Channel, ChannelInfo, Drift, FileFaults

__all__ = [
    "Closing", "CsvFormat", "FaultLog", "OpenFile", "Part", "ReadOptions", "Reader", "csv_hint", "format_fault",
    "format_of", "one_piece", "part_of",
]  # fmt: skip

_DECIMALS = (".", ",")
_NAMES = {"tab": "\t", "comma": ",", "semicolon": ";", "space": " "}
_NO_SEPARATOR = set("\"'+-.\r\n")


@dataclass(frozen=True, slots=True)
class CsvFormat:
    """Separator (one character), decimal sign (`.` or `,`) and encoding (a name that Python knows); empty: not said."""

    separator: str = ""
    decimal: str = ""
    encoding: str = ""

    @classmethod
    def of(cls, table: Mapping[str, str]) -> CsvFormat:
        """From the keys of a map; a separator may be named `tab`, `comma`, `semicolon` or `space`."""
        separator = table.get("separator", "")
        return cls(_NAMES.get(separator, separator), table.get("decimal", ""), table.get("encoding", ""))


def format_fault(key: str, value: object) -> str:
    """Say what is wrong with one of these keys; empty if it is valid."""
    if not isinstance(value, str) or not value:
        return f"{key} = {str(value)[:40]!r} is no text"
    if key == "separator":
        sign = _NAMES.get(value, value)
        if len(sign) != 1 or sign.isalnum() or sign in _NO_SEPARATOR:
            return f'separator = "{value[:40]}" separates no cells; use one of , ; | tab space or another single sign'
    if key == "decimal" and value not in _DECIMALS:
        return f'decimal = "{value[:40]}" is no decimal sign; use . or ,'
    if key == "encoding" and not _is_encoding(value):
        return (
            f'encoding = "{value[:40]}" is not known; use utf-8, cp1252, utf-16-le, shift_jis or another of Python\'s'
        )
    return ""


def _is_encoding(name: str) -> bool:
    try:
        codecs.lookup(name)
        return "a".encode(name).decode(name) == "a"
    except (LookupError, ValueError, AttributeError, TypeError):  # among them codecs that make no text
        return False


def format_of(formats: Mapping[str, CsvFormat], file: str) -> CsvFormat:
    """What is said of a file: under its own name or pattern, else under `*`."""
    own = (f for pattern, f in formats.items() if pattern != "*" and fnmatchcase(file, pattern))
    return next(own, formats.get("*", CsvFormat()))


def csv_hint(*keys: str, encoding: str = "cp1252") -> str:
    """How to say it, with an `encoding` that is likely."""
    examples = {"separator": 'separator = ";"', "decimal": 'decimal = ","', "encoding": f'encoding = "{encoding}"'}
    return f"say it in a signal map: [csv] {' '.join(examples[k] for k in keys)}"


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """What the user says about the files beyond their content.

    `time_channel` and `time_unit` apply to tables (CSV, Parquet), `csv` to CSV files by name or pattern; `dbc` decodes
    raw CAN frames. `own_clocks`: names or patterns of files whose clock is corrected.
    """

    dbc: tuple[Path, ...] = ()
    time_channel: str | None = None
    time_unit: str | None = None
    csv: Mapping[str, CsvFormat] = field(default_factory=dict)
    own_clocks: tuple[str, ...] = ()


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

    def __exit__(self, *_: object) -> None: ...


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


class Closing:
    """A context manager that closes itself."""

    def close(self) -> None:
        """Release what is open; nothing by itself."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class OpenFile(Closing):
    """What all readers have in common: one file, and what was lost of it.

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
        self._faults.notes.append(f"{self._path.name}: {text}")

    @property
    def faults(self) -> FileFaults:
        """What was lost so far; complete after `read`."""
        return self._faults.freeze()
