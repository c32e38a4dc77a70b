"""Open one log, or the several files of one drive, by content: the suffix does not count."""

from __future__ import annotations

import re
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import cached_property
from importlib import import_module
from pathlib import Path

from aqualog.core.errors import LogError
from aqualog.core.records import Channel, ChannelInfo, FileFaults
from aqualog.guard.reading import reading
from aqualog.io.joined import Joined, Split, split_of
from aqualog.io.reader import Closing, Part, Reader, ReadOptions, csv_hint, format_of

__all__ = ["LOG_SUFFIXES", "DriveLog", "open_log", "read_readable", "sniff", "stored_in"]


_HEAD = 4096
_MCAP = b"\x89MCAP0\r\n"
_NAMED = 3  # channels of a lost group that are named


# Format by content: module and class of its reader, and what a log of it stores.
# Each reader's libraries are imported when a file of its format is opened, not before.
_READERS = {
    "mdf": ("aqualog.io.mdf.reader", "MdfReader", "records"),
    "mcap": ("aqualog.io.messages.reader", "McapReader", "messages"),
    "ros": ("aqualog.io.messages.reader", "RosReader", "messages"),
    "csv": ("aqualog.io.tables.csv", "CsvReader", "rows or cells"),
    "parquet": ("aqualog.io.tables.parquet", "ParquetReader", "rows or values"),
}

LOG_SUFFIXES = (".mf4", ".mdf", ".dat", ".mcap", ".bag", ".db3", ".csv", ".tsv", ".parquet")
"""Of files that are looked for in a folder, the richest format first. A file that is named needs none of them."""


def stored_in(kind: str) -> str:
    """Return what a log of a format stores, for messages about loss."""
    return _READERS[kind][2] if kind in _READERS else "messages"


def open_log(path: Path, options: ReadOptions | None = None) -> Reader:
    """Open one file with the reader of its content.

    Raises
    ------
    LogError
        If the file is missing, unknown or damaged beyond reading.
    """
    options = options or ReadOptions()
    has_encoding = bool(format_of(options.csv, path.name).encoding)
    with reading(path):
        module, name, _ = _READERS[sniff(path, any_text=has_encoding)]
        reader: Reader = getattr(import_module(module), name)(path, options)
    return _Watched(path, reader)


class _Watched(Closing):
    """A reader each of whose steps is a step of `reading`."""

    def __init__(self, path: Path, reader: Reader) -> None:
        self._path, self._reader = path, reader
        self.format = reader.format

    def channels(self) -> Sequence[ChannelInfo]:
        with reading(self._path):
            return self._reader.channels()

    def read(self, wanted: Iterable[ChannelInfo]) -> list[Channel]:
        with reading(self._path):
            return self._reader.read(wanted)

    def parts(self, wanted: Iterable[ChannelInfo]) -> list[Part]:
        with reading(self._path):
            parts = self._reader.parts(wanted)
        return [p._replace(pieces=self._each(p.pieces)) for p in parts]

    def _each(self, pieces: Iterator[Sequence[Channel]]) -> Iterator[Sequence[Channel]]:
        try:
            while True:
                with reading(self._path):
                    piece = next(pieces, None)
                if piece is None:
                    return
                yield piece
        finally:
            if isinstance(pieces, Generator):
                pieces.close()

    @property
    def faults(self) -> FileFaults:
        return self._reader.faults

    def close(self) -> None:
        self._reader.close()


class DriveLog(Closing):
    """The files of one drive as one reader; parts of one recording are joined under the name of the first.

    If one file cannot be opened, those opened before it are closed again.
    """

    def __init__(self, paths: Sequence[Path], options: ReadOptions | None = None) -> None:
        names = [p.name for p in paths]
        twice = {n for n in names if names.count(n) > 1}
        if twice:
            raise LogError(f"two files of one drive are both called {sorted(twice)[0]}", hint="rename one of them")
        self.paths = tuple(paths)
        self._options = options or ReadOptions()
        with ExitStack() as stack:
            self._readers = [stack.enter_context(open_log(p, options)) for p in paths]
            self._stack = stack.pop_all()

    @cached_property
    def _split(self) -> Split:
        return split_of(self.paths, self._readers, self._options.own_clocks, lambda p: open_log(p, self._options))

    @cached_property
    def _recordings(self) -> list[tuple[Path, Reader | Joined]]:
        """First file and reader of each recording."""
        found: list[tuple[Path, Reader | Joined]] = []
        for chain in self._split.chains:
            first, readers = self.paths[chain[0]], [self._readers[i] for i in chain]
            found.append((first, Joined(first.name, readers) if len(readers) > 1 else readers[0]))
        return found

    @property
    def goes_on(self) -> dict[str, str]:
        """Of each file that goes on with a recording, the one that begins it and whose name the channels bear."""
        return {self.paths[i].name: self.paths[c[0]].name for c in self._split.chains for i in c[1:]}

    @property
    def apart(self) -> str:
        """Why files with the same channels are not parts of one recording; empty without such files."""
        return self._split.apart

    def channels(self) -> list[ChannelInfo]:
        """Channels of all files."""
        return [c for _, r in self._recordings for c in r.channels()]

    @property
    def formats(self) -> tuple[str, ...]:
        """Format of each file."""
        return tuple(r.format for r in self._readers)

    @property
    def faults(self) -> list[FileFaults]:
        """What each file lost; complete after `read`. The first part of a recording says which ones go on with it."""
        names = [p.name for p in self.paths]
        said = [self._split.note(names, i) for i in range(len(names))]
        found = [r.faults for r in self._readers]
        return [replace(f, notes=(s, *f.notes)) if s else f for f, s in zip(found, said, strict=True)]

    def read(self, wanted: Iterable[ChannelInfo]) -> dict[tuple[str, str], Channel]:
        """Decode channels of any of the files, keyed by (file, path)."""
        asked = list({(w.file, w.path): w for w in wanted}.values())
        result: dict[tuple[str, str], Channel] = {}
        for path, reader in self._recordings:
            own = [w for w in asked if w.file == path.name]
            if own:
                result |= {(c.info.file, c.info.path): c for c in reader.read(own)}
        return result

    def read_readable(self) -> tuple[list[Channel], list[tuple[str, str]]]:
        """All channels that can be decoded, and (file, what) of each group of records that cannot.

        Raises
        ------
        LogError
            If nothing of a file can be decoded.
        """
        channels: list[Channel] = []
        lost: list[tuple[str, str]] = []
        for path, reader in self._recordings:
            own, sentences = read_readable(reader, list(reader.channels()))
            channels += own
            lost += [(path.name, what) for what in sentences]
        return channels, lost

    def parts(self, wanted: Iterable[ChannelInfo]) -> list[Part]:
        """The same piece by piece, for logs that are longer than memory."""
        asked = list({(w.file, w.path): w for w in wanted}.values())
        out: list[Part] = []
        for path, reader in self._recordings:
            own = [w for w in asked if w.file == path.name]
            out += reader.parts(own) if own else []
        return out

    def close(self) -> None:
        """Close all files."""
        self._stack.close()


def read_readable(reader: Reader | Joined, wanted: Sequence[ChannelInfo]) -> tuple[list[Channel], list[str]]:
    """Decode channels of one file; of an MDF, group by group, with a note on each group that cannot be decoded.

    Returns
    -------
    list of Channel
        In the order of `wanted`, without those that are lost.
    list of str
        A sentence for each group that is lost.

    Raises
    ------
    LogError
        If nothing of it can be decoded.
    """
    groups = [list(wanted)]
    if reader.format == "mdf":  # channels of one group stand in the same records
        groups = [[w for w in wanted if (w.file, w.path) in part.channels] for part in reader.parts(wanted)]
    if len(groups) < 2:
        return reader.read(wanted), []
    found: dict[str, Channel] = {}
    errors: list[LogError] = []
    lost: list[str] = []
    for infos in groups:
        try:
            found |= {c.info.path: c for c in reader.read(infos)}
        except LogError as error:
            errors.append(error)
            names = ", ".join(i.path for i in infos[:_NAMED])
            more = f" and {len(infos) - _NAMED} more" if len(infos) > _NAMED else ""
            lost.append(f"{names}{more}: {error.what}")
    if errors and not found:
        raise errors[0]
    return [found[w.path] for w in wanted if w.path in found], lost


def sniff(path: Path, *, any_text: bool = False) -> str:
    """Format of a log: `mdf`, `mcap`, `ros`, `parquet` or `csv`; with `any_text` all that is no other is `csv`.

    Raises
    ------
    LogError
        If the file is missing or empty, or its content is of no known format.
    """
    if path.is_dir():
        if (path / "metadata.yaml").exists() or _is_recording(path):
            return "ros"
        raise LogError("is a folder without a ROS 2 bag", where=str(path), expected="a log file", hint="name the files")
    if path.exists() and not path.is_file():
        raise LogError("is no regular file", where=str(path), expected="a log file")
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except FileNotFoundError as error:
        raise LogError("no such file", where=str(path), hint="check the path") from error
    except OSError as error:
        raise LogError(f"cannot be opened: {error.strerror}", where=str(path)) from error
    if not head:
        raise LogError("is empty", where=str(path), expected="a log")
    for magic, name in _MAGIC:
        if head.startswith(magic):
            return name
    if any_text or _is_text(head):
        return "csv"
    if not head.strip(b"\0"):
        hint = "wait for the copy, or copy it again; a power cut leaves NULs, too"
        raise LogError(f"begins with {len(head)} NUL bytes", where=str(path), expected="a log", hint=hint)
    if _is_text(head.replace(b"\0", b"")):
        line = head.count(b"\n", 0, head.index(0)) + 1
        raise LogError(
            f"is text with NUL bytes (first at line {line})",
            where=str(path), expected="CSV in UTF-8, or in UTF-16 with its byte order mark",
            hint=f"export it as UTF-8, or {csv_hint('encoding')}; a power cut leaves NULs, too",
        )  # fmt: skip
    raise LogError(
        f"unknown format (starts with {head[:8]!r})",
        where=str(path),
        expected="MDF 3/4, MCAP, ROS 1 bag, ROS 2 bag, Parquet or CSV",
    )


def _is_recording(folder: Path) -> bool:
    """Whether a folder without metadata holds one ROS 2 recording and no other log: one file, or parts counted from 0,
    as ROS names them. A folder of drives, each in a file of its own, would otherwise be read as one.
    """
    logs = [p for p in folder.iterdir() if p.suffix.lower() in LOG_SUFFIXES]
    if len(logs) == 1:
        return logs[0].suffix.lower() in (".db3", ".mcap")
    parts = [_PART.fullmatch(p.name) for p in logs]
    found = [(m[1], m[3], int(m[2])) for m in parts if m]
    return (
        bool(found)
        and len(found) == len(logs)
        and len({(stem, suffix) for stem, suffix, _ in found}) == 1
        and sorted(n for _, _, n in found) == list(range(len(found)))
    )


_PART = re.compile(r"(.*)_(\d{1,6})\.(db3|mcap)", re.DOTALL)

_MAGIC = (
    (b"MDF     ", "mdf"),
    (b"UnFinMF ", "mdf"),
    (_MCAP, "mcap"),
    (b"#ROSBAG V", "ros"),
    (b"SQLite format 3\x00", "ros"),
    (b"PAR1", "parquet"),
)


def _is_text(head: bytes) -> bool:
    if head.startswith((b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf")):
        return True
    control = sum(b < 32 and b not in (9, 10, 12, 13, 27) for b in head)
    return control == 0
