"""A large text file as if it were in memory: what is asked for is read, nothing is held."""

from __future__ import annotations

import codecs
import os
from collections.abc import Iterator
from pathlib import Path

__all__ = ["LARGE", "TextFile", "open_text"]

LARGE = 1 << 28  # [bytes] from which a file is not held as a whole
_BLOCK = 1 << 24
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

    def blocks(self, start: int = 0, size: int = _BLOCK) -> Iterator[bytes]:
        """The file in blocks from a place on."""
        while start < self._size:
            block = self[start : start + size]
            yield block
            start += len(block)

    def close(self) -> None:
        """Close the file."""
        if self._handle >= 0:
            os.close(self._handle)
            self._handle = -1


def open_text(path: Path) -> TextFile | None:
    """A large file that is plain UTF-8 with lines that end in `\\n`; None for every other one.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    if path.stat().st_size < LARGE:
        return None
    text = TextFile(path)
    decoder = codecs.getincrementaldecoder("utf-8")()
    lines = False
    try:
        for k, block in enumerate(text.blocks()):
            if k == 0 and block.startswith(_MARKS):
                break
            lines |= b"\n" in block
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
