"""Read a large text file like one in memory: only requested parts are read, nothing is held."""

from __future__ import annotations

import codecs
import os
from collections.abc import Iterator
from pathlib import Path

from aqualog.core.errors import LogError

__all__ = ["LARGE", "LONGEST_LINE", "TextFile", "check_lines", "open_text"]

LARGE = 1 << 28  # [bytes] from which a file is not held as a whole
LONGEST_LINE = 1 << 24  # [bytes] beyond, a file is no table
_BLOCK = 1 << 24  # not above the longest line
_MARKS = (codecs.BOM_UTF8, codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE, codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE)


class TextFile:
    """Bytes of a file: length, slices, `find` and `count`, as of a `bytes` object.

    Parameters
    ----------
    path : Path
    """

    def __init__(self, path: Path) -> None:
        self._handle = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
        self._size = os.fstat(self._handle).st_size

    def __len__(self) -> int:
        return self._size

    def __getitem__(self, key: slice) -> bytes:
        start, stop, _ = key.indices(self._size)
        parts = []
        while start < stop:
            os.lseek(self._handle, start, os.SEEK_SET)
            part = os.read(self._handle, min(stop - start, _BLOCK))
            if not part:
                raise OSError("the file has become shorter while it was read")
            parts.append(part)
            start += len(part)
        return b"".join(parts)

    def find(self, what: bytes, start: int = 0) -> int:
        """Where one byte stands first from `start` on, or -1."""
        while start < self._size:
            at = self[start : start + _BLOCK].find(what)
            if at >= 0:
                return start + at
            start += _BLOCK
        return -1

    def count(self, what: bytes) -> int:
        """How often one byte stands in the file."""
        return sum(block.count(what) for block in self.blocks())

    def blocks(self, start: int = 0, size: int | None = None) -> Iterator[bytes]:
        """The file in blocks from a place on."""
        while start < self._size:
            block = self[start : start + (size or _BLOCK)]
            yield block
            start += len(block)

    def close(self) -> None:
        """Close the file."""
        if self._handle >= 0:
            os.close(self._handle)
            self._handle = -1


def check_lines(data: bytes, *, where: str) -> None:
    """Refuse a text with a line that is longer than any row of a table.

    Raises
    ------
    LogError
        If there is one.
    """
    start = 0
    while len(data) - start > LONGEST_LINE:
        end = data.rfind(b"\n", start, start + LONGEST_LINE + 1)
        if end < 0:
            raise _too_long(data.count(b"\n", 0, start) + 1, where)
        start = end + 1


def _too_long(line: int, where: str) -> LogError:
    return LogError(
        f"line {line} is longer than {LONGEST_LINE} bytes", where=where, expected="a table with one row per line",
        hint="export it again",
    )  # fmt: skip


class _LineLengths:
    """Lines of a text that comes in blocks no longer than the longest line."""

    def __init__(self, where: str) -> None:
        self._where = where
        self._line, self._open = 1, 0  # number of the line that the last block ended in, and its bytes so far

    def add(self, block: bytes) -> None:
        first = block.find(b"\n")
        self._open += len(block) if first < 0 else first
        if self._open > LONGEST_LINE and b"\r" not in block:
            raise _too_long(self._line, self._where)
        if first >= 0:
            self._line += block.count(b"\n")
            self._open = len(block) - block.rfind(b"\n") - 1


def open_text(path: Path) -> TextFile | None:
    """A large file that is plain UTF-8 with lines that end in `\\n`; None for every other one.

    Raises
    ------
    OSError
        If it cannot be read.
    LogError
        If a line is longer than any row of a table.
    """
    if path.stat().st_size < LARGE:
        return None
    text = TextFile(path)
    decoder = codecs.getincrementaldecoder("utf-8")()
    lines, lengths = False, _LineLengths(str(path))
    try:
        for k, block in enumerate(text.blocks()):
            if k == 0 and block.startswith(_MARKS):
                break
            lines |= b"\n" in block
            lengths.add(block)
            if not block.isascii() or decoder.getstate()[0]:
                decoder.decode(block)
        else:
            decoder.decode(b"", final=True)
            if lines:
                return text
    except UnicodeDecodeError:
        pass
    except BaseException:
        text.close()
        raise
    text.close()
    return None
