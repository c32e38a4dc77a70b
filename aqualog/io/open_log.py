"""Open one log, or the several files of one drive."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self, cast

from aqualog.core.errors import LogError
from aqualog.core.records import Channel, ChannelInfo, FileFaults
from aqualog.guard.reading import reading
from aqualog.io.base import Part, Reader, ReadOptions, part_of
from aqualog.io.csv_format import format_of
from aqualog.io.sniff import sniff
from aqualog.io.sound import read_sound

__all__ = ["DriveLog", "open_log"]


def _mdf(path: Path, options: ReadOptions) -> Reader:
    from aqualog.io.mdf.reader import MdfReader

    return MdfReader(path, options)


def _mcap(path: Path, options: ReadOptions) -> Reader:
    from aqualog.io.mcap import McapReader

    return McapReader(path, options)


def _ros(path: Path, options: ReadOptions) -> Reader:
    from aqualog.io.ros import RosReader

    return RosReader(path, options)


def _csv(path: Path, options: ReadOptions) -> Reader:
    from aqualog.io.csv import CsvReader

    return CsvReader(path, options)


def _parquet(path: Path, options: ReadOptions) -> Reader:
    from aqualog.io.parquet import ParquetReader

    return ParquetReader(path, options)


# Each reader's libraries are imported when a file of its format is opened, not before.
_READERS: dict[str, Callable[[Path, ReadOptions], Reader]] = {
    "mdf": _mdf, "mcap": _mcap, "ros": _ros, "csv": _csv, "parquet": _parquet,
}  # fmt: skip


def open_log(path: Path, options: ReadOptions | None = None) -> Reader:
    """Open one file with the reader of its content.

    Raises
    ------
    LogError
        If the file is missing, unknown or damaged beyond reading.
    """
    options = options or ReadOptions()
    is_told = bool(format_of(options.csv, path.name).encoding)
    with reading(path):
        reader = _READERS[sniff(path, any_text=is_told)](path, options)
    return (_WatchedInPieces if hasattr(reader, "parts") else _Watched)(path, reader)


class _Watched:
    """A reader each of whose steps is a step of `reading`."""

    def __init__(self, path: Path, reader: Any) -> None:
        self._path, self._reader = path, reader
        self.format: str = reader.format

    def channels(self) -> Sequence[ChannelInfo]:
        with reading(self._path):
            return cast("Sequence[ChannelInfo]", self._reader.channels())

    def read(self, wanted: Iterable[ChannelInfo]) -> list[Channel]:
        with reading(self._path):
            return cast("list[Channel]", self._reader.read(wanted))

    @property
    def faults(self) -> FileFaults:
        return cast("FileFaults", self._reader.faults)

    def close(self) -> None:
        self._reader.close()

    def __enter__(self) -> Self:
        self._reader.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._reader.__exit__(kind, error, trace)


class _WatchedInPieces(_Watched):
    def parts(self, wanted: Sequence[ChannelInfo]) -> list[Part]:
        with reading(self._path):
            parts: list[Part] = self._reader.parts(wanted)
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


def _whole(reader: Reader, wanted: Sequence[ChannelInfo]) -> Iterator[Sequence[Channel]]:
    yield reader.read(wanted)


class DriveLog:
    """The files of one drive as one reader; a context manager.

    If one file cannot be opened, those opened before it are closed again.
    """

    def __init__(self, paths: Sequence[Path], options: ReadOptions | None = None) -> None:
        names = [p.name for p in paths]
        twice = {n for n in names if names.count(n) > 1}
        if twice:
            raise LogError(f"two files of one drive are both called {sorted(twice)[0]}", hint="rename one of them")
        self.paths = tuple(paths)
        with ExitStack() as stack:
            self._readers = [stack.enter_context(open_log(p, options)) for p in paths]
            self._stack = stack.pop_all()

    def channels(self) -> list[ChannelInfo]:
        """Channels of all files."""
        return [c for r in self._readers for c in r.channels()]

    @property
    def formats(self) -> tuple[str, ...]:
        """Format of each file."""
        return tuple(r.format for r in self._readers)

    @property
    def faults(self) -> list[FileFaults]:
        """What each file lost; complete after `read`."""
        return [r.faults for r in self._readers]

    def read(self, wanted: Iterable[ChannelInfo]) -> dict[tuple[str, str], Channel]:
        """Decode channels of any of the files, keyed by (file, path)."""
        asked = list({(w.file, w.path): w for w in wanted}.values())
        result: dict[tuple[str, str], Channel] = {}
        for path, reader in zip(self.paths, self._readers, strict=True):
            own = [w for w in asked if w.file == path.name]
            if own:
                result |= {(c.info.file, c.info.path): c for c in reader.read(own)}
        return result

    def read_sound(self) -> tuple[list[Channel], list[tuple[str, str]]]:
        """All channels that can be decoded, and (file, what) of each group of records that cannot.

        Raises
        ------
        LogError
            If nothing of a file can be decoded.
        """
        channels: list[Channel] = []
        lost: list[tuple[str, str]] = []
        for path, reader in zip(self.paths, self._readers, strict=True):
            own, told = read_sound(reader, list(reader.channels()))
            channels += own
            lost += [(path.name, what) for what in told]
        return channels, lost

    def parts(self, wanted: Iterable[ChannelInfo]) -> list[Part]:
        """The same piece by piece, for logs that are longer than memory; a reader that cannot gives one piece."""
        asked = list({(w.file, w.path): w for w in wanted}.values())
        out: list[Part] = []
        for path, reader in zip(self.paths, self._readers, strict=True):
            own = [w for w in asked if w.file == path.name]
            if own:
                piecewise = getattr(reader, "parts", None)
                out += piecewise(own) if piecewise is not None else [part_of(own, _whole(reader, own))]
        return out

    def close(self) -> None:
        """Close all files."""
        self._stack.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
