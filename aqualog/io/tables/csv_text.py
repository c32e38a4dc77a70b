"""Read a text file as UTF-8, whatever its encoding: a small one as a whole, a large one like one in memory.

A wrong encoding spoils the names and units of channels (`Temperature [°C]`), so the choice is made on evidence: a byte
order mark, strict UTF-8, and among the old code pages the one that makes the most known units. Of a large file only
requested parts are read, and nothing is held.
"""

from __future__ import annotations

import codecs
import os
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aqualog.core.errors import LogError
from aqualog.core.units import is_unit
from aqualog.io.reader import csv_hint
from aqualog.io.tables.columns import split_unit

__all__ = [
    "LARGE", "LONGEST_LINE", "LogText", "TextFile", "check_lines", "count_of", "marks_of", "open_text", "read_text",
]  # fmt: skip

LARGE = 1 << 28  # [bytes] from which a file is read piece by piece
LONGEST_LINE = 1 << 24  # [bytes] beyond, a file is no table
_SMALL = 1 << 20  # [bytes] below which a file is held
_BLOCK = 1 << 20  # [bytes] not above the longest line; larger ones cost more in new pages than in copying
_NO_MARKS = bytes(range(256)).translate(None, b',;\t|\n\0"#%!/')
_MARKS = (
    (codecs.BOM_UTF32_LE, "utf-32"), (codecs.BOM_UTF32_BE, "utf-32"), (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)  # fmt: skip
_CODE_PAGES = ("cp1252", "cp1250", "mac_roman", "cp850", "cp1251", "gb18030", "cp932", "cp949")
_HEAD = 1 << 16
_CACHED = 1 << 18


class TextFile:
    """Bytes of a file: length, slices, `find` and `count`, as of a `bytes` object.

    `lines` is the number of its ends of lines, `marks` what shapes a table in it (`marks_of`), unless it is large.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.lines, self.marks = path, 0, b""
        self._handle = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
        self._size = os.fstat(self._handle).st_size

    def __len__(self) -> int:
        return self._size

    @property
    def is_large(self) -> bool:
        """Whether it is to be read piece by piece."""
        return self._size >= LARGE

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


def marks_of(data: bytes) -> bytes:
    """Separators, quotes, comment signs, NUL bytes and ends of lines of a text, in their order."""
    return data.translate(None, _NO_MARKS)


def count_of(what: bytes, data: bytes) -> int:
    """How often one byte stands in a text: four times as fast as its own `count` where lines are short."""
    octets = np.frombuffer(data, dtype=np.uint8)
    blocks = (octets[k : k + _CACHED] == what[0] for k in range(0, octets.size, _CACHED))
    return sum(int(np.count_nonzero(block)) for block in blocks)


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

    def add(self, block: bytes, ends: int) -> None:
        first = block.find(b"\n")
        self._open += len(block) if first < 0 else first
        if self._open > LONGEST_LINE and b"\r" not in block:
            raise _too_long(self._line, self._where)
        if first >= 0:
            self._line += ends
            self._open = len(block) - block.rfind(b"\n") - 1


def open_text(path: Path) -> TextFile | None:
    """A file that is plain UTF-8 with lines that end in `\\n`; None for a small one and every other.

    Raises
    ------
    OSError
        If it cannot be read.
    LogError
        If a line is longer than any row of a table.
    """
    if path.stat().st_size < min(_SMALL, LARGE):
        return None
    text = TextFile(path)
    decoder = codecs.getincrementaldecoder("utf-8")()
    lengths, marks = _LineLengths(str(path)), []
    try:
        for k, block in enumerate(text.blocks()):
            if k == 0 and block.startswith((codecs.BOM_UTF8, *(mark for mark, _ in _MARKS))):
                break
            if not text.is_large:
                marks.append(marks_of(block))
            ends = (marks[-1] if marks else block).count(b"\n")
            text.lines += ends
            lengths.add(block, ends)
            if not block.isascii() or decoder.getstate()[0]:
                decoder.decode(block)
        else:
            decoder.decode(b"", final=True)
            text.marks = b"".join(marks)
            if text.lines:
                return text
    except UnicodeDecodeError:
        pass
    except BaseException:
        text.close()
        raise
    text.close()
    return None


@dataclass(frozen=True, slots=True)
class LogText:
    """Content as UTF-8 without a byte order mark, lines ended by `\\n` or `\\r\\n`."""

    data: bytes
    encoding: str
    notes: tuple[str, ...]


def read_text(path: Path, encoding: str = "") -> LogText:
    """Read a whole text file, in an encoding that the user names or in the one that it seems to be in.

    Raises
    ------
    LogError
        If the file cannot be read, is not text in the encoding that it declares, or has a line without an end.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise LogError(f"cannot be opened: {error.strerror}", where=str(path)) from error
    text = _as_told(raw, path, encoding) if encoding else _decoded(raw, path)
    if b"\n" not in text.data and b"\r" in text.data:
        text = LogText(text.data.replace(b"\r", b"\n"), text.encoding, text.notes)
    check_lines(text.data, where=str(path))
    return text


def _as_told(raw: bytes, path: Path, encoding: str) -> LogText:
    """In the encoding that the user has named, strictly."""
    try:
        text = raw.decode(encoding)
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        bad = raw[error.start : error.start + 4].hex(" ")
        what = f"is not in the {encoding} that the map names (line {line}, byte {error.start}: {bad})"
        raise LogError(what, where=str(path), hint="name another encoding, or none") from error
    except UnicodeError as error:
        raise LogError(f"is not in the {encoding} that the map names ({error})", where=str(path)) from error
    return LogText(text.removeprefix("\ufeff").encode("utf-8", errors="replace"), encoding, ())


def _decoded(raw: bytes, path: Path) -> LogText:
    for mark, encoding in _MARKS:
        if raw.startswith(mark):
            return LogText(_marked(raw, encoding, path), encoding, ())
    raw = raw.removeprefix(codecs.BOM_UTF8)
    if raw.isascii():
        return LogText(raw, "ascii", ())
    try:
        raw.decode("utf-8")
    except UnicodeDecodeError as error:
        if _is_damaged_utf8(raw):
            line = raw.count(b"\n", 0, error.start) + 1
            note = f"{path.name}: is UTF-8, but not everywhere (first at line {line}); the cells there are bad"
            return LogText(raw.decode("utf-8", errors="replace").encode(), "utf-8", (note,))
        return _code_page(raw, path)
    return LogText(raw, "utf-8", ())


def _marked(raw: bytes, encoding: str, path: Path) -> bytes:
    """Text that declares its encoding; a cut inside its last character costs that character only."""
    width = 4 if encoding == "utf-32" else 2
    try:
        return raw[: len(raw) // width * width].decode(encoding).encode()
    except UnicodeError as error:
        raise LogError(f"is not the {encoding} that it begins as ({error})", where=str(path)) from error


def _is_damaged_utf8(raw: bytes) -> bool:
    """Whether the head's lines beyond ASCII are mostly UTF-8: chance does not produce its sequences of bytes."""
    beyond = [line for line in raw[:_HEAD].split(b"\n")[:-1] if not line.isascii()]
    sound = 0
    for line in beyond:
        with suppress(UnicodeDecodeError):
            line.decode("utf-8")
            sound += 1
    return sound > 0 and 2 * sound >= len(beyond)


def _code_page(raw: bytes, path: Path) -> LogText:
    beyond = b"\n".join(line for line in raw[:_HEAD].split(b"\n") if not line.isascii()) or raw[-_HEAD:]
    usable = [c for c in _CODE_PAGES if _known_units(beyond, c) >= 0]
    best = max(usable, key=lambda c: _known_units(beyond, c), default="latin-1")
    notes: tuple[str, ...] = ()
    if not usable or _known_units(beyond, best) == 0:
        best = _guessed(beyond, usable)
        # the first one that reads these bytes alike is the more frequent one: ä and ß are the same in cp1252 and cp1250
        best = next((c for c in usable if beyond.decode(c) == beyond.decode(best)), best)
        notes = (
            f"{path.name}: does not declare its encoding; taken as {best} ({csv_hint('encoding', encoding=best)})",
        )
    try:
        return LogText(raw.decode(best).encode(), best, notes)
    except UnicodeDecodeError as error:  # a byte that the code page does not have, somewhere behind the head
        line = raw.count(b"\n", 0, error.start) + 1
        note = f"{path.name}: is {best}, but not everywhere (first at line {line}); taken as latin-1"
        return LogText(raw.decode("latin-1").encode(), "latin-1", (f"{note} ({csv_hint('encoding', encoding=best)})",))


def _known_units(beyond: bytes, encoding: str) -> int:
    """How many cells of the lines beyond ASCII hold a known unit that is not ASCII; -1 if the bytes do not decode."""
    try:
        text = beyond.decode(encoding)
    except UnicodeDecodeError:
        return -1
    cells = [c.strip().strip('"') for line in text.splitlines()[:20] for c in re.split(r"[,;\t|]", line)]
    units = [split_unit(c)[1] or c.strip("[]()") for c in cells if not c.isascii()]
    return sum(not u.isascii() and is_unit(u) for u in units)


def _guessed(beyond: bytes, usable: list[str]) -> str:
    from charset_normalizer import from_bytes

    found = from_bytes(beyond, cp_isolation=usable).best() if usable else None
    if found is not None and found.encoding in usable:
        return found.encoding
    return usable[0] if usable else "latin-1"
