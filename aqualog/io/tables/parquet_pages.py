"""Check whether the pages of a Parquet file fit its footer, before a library decodes them.

Libraries go where the footer sends them and decode the bytes there. If bytes are missing or added, those are wrong
bytes, and plain numbers shifted by a few bytes still look like numbers. So the headers of the pages are read first.
They must follow each other through the whole of a column's place and hold its number of values. They must lie before
the footer, unpack to no more than their values need, and fit their checksum where present. Only headers are held, and
one page at a time where there are checksums.

Format: https://github.com/apache/parquet-format/blob/master/src/main/thrift/parquet.thrift [parquet2013]
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from aqualog.io.decompress import MAX_UNPACKED

__all__ = [
    "Bounds", "Chunk", "Group", "Index", "MalformedError", "Struct", "decode", "is_of", "page_fault", "read_index",
]  # fmt: skip

Struct = dict[int, Any]

_TRUE, _FALSE, _BYTE, _I16, _I32, _I64, _DOUBLE, _BINARY, _LIST, _SET, _MAP, _STRUCT = range(1, 13)
_DEEPEST = 16  # Parquet's own structures are half as deep


class MalformedError(Exception):
    """Bytes that are no such structure; its text is the reason. `is_short`: more of them may be one."""

    def __init__(self, reason: str, *, is_short: bool = False) -> None:
        super().__init__(reason)
        self.is_short = is_short


def decode(data: bytes, at: int = 0) -> tuple[Struct, int]:
    """A structure, and where the bytes go on behind it.

    No more is built than the bytes hold: every element of a list takes one of them at least.

    Raises
    ------
    MalformedError
        If the bytes hold no such structure.
    """
    try:
        return _value(data, at, _STRUCT, 0)
    except (IndexError, struct.error) as error:
        raise MalformedError("it goes on behind its end", is_short=True) from error


def _value(data: bytes, at: int, kind: int, depth: int) -> tuple[Any, int]:
    """A value: a number, bytes, a structure, or a list; of a map keys and values by turns."""
    if kind in (_I16, _I32, _I64):
        return _zigzag(data, at)
    if kind == _BINARY:
        size, at = _varint(data, at)
        if at + size > len(data):
            raise MalformedError("a text in it goes on behind its end", is_short=True)
        return data[at : at + size], at + size
    if kind == _DOUBLE:
        return struct.unpack_from("<d", data, at)[0], at + 8
    if kind in (_BYTE, _TRUE, _FALSE):  # the latter two in lists
        return data[at], at + 1
    if kind not in (_STRUCT, _LIST, _SET, _MAP):
        raise MalformedError(f"type {kind} is not known")
    if depth > _DEEPEST:
        raise MalformedError("it is nested without end")
    if kind == _STRUCT:
        return _struct(data, at, depth)
    if kind == _MAP:
        count, at = _varint(data, at)
        kinds: tuple[int, ...] = (data[at] >> 4, data[at] & 15) if count else ()
        at += 1 if count else 0
    else:
        count, kinds = data[at] >> 4, (data[at] & 15,)
        at += 1
        if count == 15:
            count, at = _varint(data, at)
    out = []
    for _ in range(count):
        for inner in kinds:
            value, at = _value(data, at, inner, depth + 1)
            out.append(value)
    return out, at


def _struct(data: bytes, at: int, depth: int) -> tuple[Struct, int]:
    out: Struct = {}
    number = 0
    while head := data[at]:
        at += 1
        if head >> 4:
            number += head >> 4
        else:
            number, at = _zigzag(data, at)
        kind = head & 15
        if kind in (_TRUE, _FALSE):
            out[number] = kind == _TRUE
        else:
            out[number], at = _value(data, at, kind, depth + 1)
    return out, at + 1


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        octet = data[at]
        at += 1
        value |= (octet & 127) << shift
        if octet < 128:
            return value, at
        shift += 7
        if shift > 63:
            raise MalformedError("a number in it is longer than 64 bits")


def _zigzag(data: bytes, at: int) -> tuple[int, int]:
    value, at = _varint(data, at)
    return (value >> 1) ^ -(value & 1), at


_MAGIC = b"PAR1"
_LARGEST_FOOTER = 1 << 24  # a hundred thousand columns of row groups
_HEADER, _LARGEST_HEADER = 1 << 10, 1 << 20
_DATA, _INDEX, _DICTIONARY, _DATA_V2 = range(4)
_FIXED = {0: "", 1: "i", 2: "q", 4: "f", 5: "d"}  # physical types of numbers and how `struct` calls their bounds
_MOST_PER_VALUE, _LEVELS = 16, 1 << 16  # bytes that a number and a page's levels unpack to at most
_PLAIN = 0


class Bounds(NamedTuple):
    """Least and greatest value of a column in a row group, as they are stored."""

    low: bytes
    high: bytes

    def numbers(self, code: str) -> tuple[float, float] | None:
        """Return both as numbers of a type of `struct`; None if they are no numbers."""
        try:
            low, high = (struct.unpack("<" + code, x)[0] for x in self)
        except struct.error:
            return None
        return (low, high) if low <= high else None


@dataclass(frozen=True, slots=True)
class Chunk:
    """A column in a row group: `size` bytes of pages from `at` on."""

    at: int
    size: int
    values: int
    kind: int
    codec: int
    bounds: Bounds | None


@dataclass(frozen=True, slots=True)
class Group:
    """A row group: `rows` rows from row `first` on, and its plain columns by name."""

    first: int
    rows: int
    chunks: dict[str, Chunk]


@dataclass(frozen=True, slots=True)
class Index:
    """Content of the footer: row groups in order, where the footer begins, and bytes before it that nothing owns."""

    groups: tuple[Group, ...]
    end: int
    unowned: int


def read_index(path: Path) -> Index | None:
    """The footer of a file; None if it is too large to look at.

    Raises
    ------
    MalformedError
        If there is no footer, or its content is impossible.
    OSError
        If the file cannot be read.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(max(0, size - 8))
        tail = file.read(8)
        length = int.from_bytes(tail[:4], "little")
        if tail[4:] != _MAGIC or length > size - 12:
            raise MalformedError("it has no index at its end")
        if length > _LARGEST_FOOTER:
            return None
        end = size - 8 - length
        file.seek(end)
        footer, _ = decode(file.read(length))
    try:
        return _index(footer, end)
    except (AttributeError, LookupError, TypeError, ValueError, UnicodeDecodeError) as error:
        raise MalformedError("its index lacks what an index must have") from error


def _index(footer: Struct, end: int) -> Index:
    groups: list[Group] = []
    first, owned = 0, len(_MAGIC)
    for record in footer[4]:
        rows = int(record[3])
        if rows < 0:
            raise MalformedError(f"row group {len(groups) + 1} declares {rows} rows")
        chunks = {}
        for column in record[1]:
            about = column[3]
            name = ".".join(p.decode("utf-8") for p in about[3])
            if column.get(1):
                raise MalformedError(f'column "{name}" stands in another file')
            chunk = _chunk(about)
            owned = max(owned, chunk.at + chunk.size, *_extras(column, about))
            if len(about[3]) == 1:
                chunks[name] = chunk
        groups.append(Group(first, rows, chunks))
        first += rows
    if first != footer[3]:
        raise MalformedError(f"its row groups have {first} rows, and its index declares {footer[3]}")
    return Index(tuple(groups), end, max(0, end - owned))


def is_of(chunk: Chunk, code: str) -> bool:
    """Whether numbers of a type of `struct` are stored in a chunk as they are."""
    return _FIXED.get(chunk.kind) == code.lower()


def _chunk(about: Struct) -> Chunk:
    data, dictionary = int(about[9]), int(about.get(11) or 0)
    at = min(data, dictionary) if dictionary > 0 else data
    statistics = about.get(12) or {}
    low, high = statistics.get(6), statistics.get(5)
    bounds = Bounds(low, high) if low is not None and high is not None else None
    return Chunk(at, int(about[7]), int(about[5]), int(about[1]), int(about[4]), bounds)


def _extras(column: Struct, about: Struct) -> Iterator[int]:
    """Where a page index or a filter of a column ends."""
    for record, place, size in ((column, 4, 5), (column, 6, 7), (about, 14, 15)):
        if record.get(place):
            yield int(record[place]) + int(record.get(size) or 0)


def page_fault(path: Path, index: Index, group: Group, columns: Iterable[str]) -> str:
    """Say what is wrong with the pages of some columns in a row group; empty if nothing is.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
    try:
        for name in columns:
            chunk = group.chunks.get(name)
            if chunk is None:
                return f'it has no column "{name}"'
            try:
                _check_chunk(handle, index, group, chunk)
            except (MalformedError, AttributeError, LookupError, TypeError, ValueError, OverflowError) as error:
                reason = str(error) if isinstance(error, MalformedError) else "a page's header lacks what it must have"
                return f'column "{name}": {reason}'
        return ""
    finally:
        os.close(handle)


def _check_chunk(handle: int, index: Index, group: Group, chunk: Chunk) -> None:
    end = chunk.at + chunk.size
    if chunk.at < len(_MAGIC) or chunk.size < 0 or end > index.end:
        raise MalformedError(f"its pages (byte {chunk.at} to {end}) do not lie before the index (byte {index.end})")
    if chunk.values != group.rows:
        raise MalformedError(f"{chunk.values} values in {group.rows} rows")
    at = chunk.at
    values = 0
    while at < end:
        header, body = _header(handle, at, end)
        packed, plain = int(header[3]), int(header[2])
        if not 0 <= packed <= end - body:
            raise MalformedError(f"the page at byte {at} declares {packed} bytes, and {end - body} are left")
        count = _count(header, at)
        _check_size(header, plain, packed, count, chunk, at)
        if (told := header.get(4)) is not None and zlib.crc32(_read(handle, body, packed)) != told & 0xFFFFFFFF:
            raise MalformedError(f"the page at byte {at} does not fit to its checksum")
        values += count if header[1] in (_DATA, _DATA_V2) else 0
        at = body + packed
    if values != chunk.values:
        raise MalformedError(f"its pages hold {values} values, and the index declares {chunk.values}")


def _header(handle: int, at: int, end: int) -> tuple[Struct, int]:
    size = _HEADER
    while True:
        data = _read(handle, at, min(size, end - at))
        try:
            header, length = decode(data)
        except MalformedError as error:
            if error.is_short and len(data) == size < _LARGEST_HEADER:
                size *= 8
                continue
            raise MalformedError(f"there is no page at byte {at} ({error})") from error
        if not {1, 2, 3} <= header.keys():
            raise MalformedError(f"there is no page at byte {at}")
        return header, at + length


def _count(header: Struct, at: int) -> int:
    kind = header[1]
    if kind == _INDEX:
        return 0
    details = header.get({_DATA: 5, _DICTIONARY: 7, _DATA_V2: 8}.get(kind, 0))
    count = -1 if details is None else int(details[1])
    if count < 0:
        raise MalformedError(f"the page at byte {at} is of no known kind")
    return count


def _check_size(header: Struct, plain: int, packed: int, count: int, chunk: Chunk, at: int) -> None:
    """A page of numbers unpacks to what these need at most, every page to what memory may hold at once."""
    if chunk.codec == _PLAIN and plain != packed:
        raise MalformedError(f"the page at byte {at} is not packed, and is {packed} bytes of {plain}")
    most = MAX_UNPACKED
    if chunk.kind in _FIXED and header[1] != _INDEX:
        most = min(most, _MOST_PER_VALUE * count + _LEVELS)
    if packed > MAX_UNPACKED or not 0 <= plain <= most:
        raise MalformedError(f"the page at byte {at} would unpack to {plain} bytes, more than {count} values need")


def _read(handle: int, at: int, size: int) -> bytes:
    os.lseek(handle, at, os.SEEK_SET)
    parts = []
    while size > 0:
        part = os.read(handle, size)
        if not part:
            break
        parts.append(part)
        size -= len(part)
    return b"".join(parts)
