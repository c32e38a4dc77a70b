"""The records of a ROS 1 bag; behind a damaged one the next chunk is sought.

Format: http://wiki.ros.org/Bags/Format/2.0 [rosbag2010]
"""

from __future__ import annotations

import struct
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from typing import BinaryIO

from aqualog.io.unpack import LONGEST

__all__ = [
    "BAG", "CHUNK", "CHUNK_INFO", "CONNECTION", "INDEX", "MAGIC", "MESSAGE", "BagRecords", "Head", "head_fields",
    "kind_of", "number",
]  # fmt: skip

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, BAG, INDEX, CHUNK, CHUNK_INFO, CONNECTION = range(2, 8)
"""Kinds of records."""

Head = Mapping[bytes, bytes]

_U32 = struct.Struct("<I")
_LONGEST_HEAD = 1 << 16  # [byte]
_CHUNK_MARK = b"\x04\0\0\0op=" + bytes([CHUNK])
_BEFORE_MARK = 80  # bytes: how far before that field the head of a chunk may begin
_BLOCK = 1 << 20


class BagRecords:
    """One pass over a bag from a place on.

    Parameters
    ----------
    file : BinaryIO
    size : int
        Of the file. [byte]
    start : int
        Where the first record stands.
    chunks : sequence of int
        Where the index knows chunks; empty without one.
    """

    def __init__(self, file: BinaryIO, size: int, start: int = len(MAGIC), chunks: Sequence[int] = ()) -> None:
        self.gaps: list[tuple[int, int]] = []
        """Where no record could be read: from, to. [byte]"""
        self._file, self._size, self._start = file, size, start
        self._chunks = sorted(chunks)
        self._doubted = False

    def doubt(self) -> None:
        """The record just given is not what it says, so its length may be wrong, too."""
        self._doubted = True

    def __iter__(self) -> Iterator[tuple[int, Head, bytes]]:
        """Offset, head and data (empty where nobody reads it)."""
        offset = trusted = self._start
        while offset < self._size:
            found = self._at(offset)
            if found is None:
                following = self._known(offset + 1) if self._chunks else self._sought(trusted)
                back = following is not None and following < offset  # a length has led over it
                self.gaps.append((trusted if back else offset, self._size if following is None else following))
                if following is None:
                    return
                offset = following
                trusted = offset + 1
                continue
            head, start, end = found
            self._file.seek(start)
            self._doubted = False
            yield offset, head, self._file.read(end - start) if kind_of(head) != INDEX else b""
            trusted = offset + 1 if self._doubted else end
            offset = end

    def _at(self, offset: int) -> tuple[Head, int, int] | None:
        """Head of the record there, and where its data stand; None if it cannot be one."""
        self._file.seek(offset)
        raw = self._file.read(4)
        if len(raw) < 4 or (size := _U32.unpack(raw)[0]) > min(self._size - offset, _LONGEST_HEAD):
            return None
        head = head_fields(self._file.read(size))
        raw = self._file.read(4)
        if head is None or not MESSAGE <= kind_of(head) <= CONNECTION or len(raw) < 4:
            return None
        start = offset + size + 8
        end = start + int(_U32.unpack(raw)[0])
        known = self._known(offset + 1)
        is_long = kind_of(head) != INDEX and end - start > LONGEST
        return None if is_long or end > (self._size if known is None else known) else (head, start, end)

    def _known(self, offset: int) -> int | None:
        """The first chunk of the index from a place on."""
        at = bisect_left(self._chunks, offset)
        return self._chunks[at] if at < len(self._chunks) else None

    def _sought(self, offset: int) -> int | None:
        """The first place from `offset` on that looks like a chunk."""
        while offset < self._size:
            self._file.seek(offset)
            block = self._file.read(_BLOCK)
            mark = block.find(_CHUNK_MARK)
            while mark >= 0:
                found = self._head_before(offset + mark, offset)
                if found is not None:
                    return found
                mark = block.find(_CHUNK_MARK, mark + 1)
            if len(block) < _BLOCK:
                return None
            offset += len(block) - _BEFORE_MARK - len(_CHUNK_MARK)
        return None

    def _head_before(self, mark: int, least: int) -> int | None:
        """Where the chunk begins whose kind stands at `mark`."""
        for start in range(mark - 4, max(least, mark - _BEFORE_MARK) - 1, -1):
            found = self._at(start)
            if found is not None and kind_of(found[0]) == CHUNK and {b"size", b"compression"} <= found[0].keys():
                return start
        return None


def head_fields(data: bytes) -> dict[bytes, bytes] | None:
    """Fields of a record's head, `<size>name=value`; None if they do not fill it."""
    fields: dict[bytes, bytes] = {}
    position, size = 0, len(data)
    while position + 4 <= size:
        start = position + 4
        position = start + _U32.unpack_from(data, position)[0]
        name, sign, value = data[start:position].partition(b"=")
        if position > size or not sign:
            return None
        fields[name] = value
    return fields if position == size else None


def kind_of(head: Head) -> int:
    """What a record is."""
    return int.from_bytes(head.get(b"op", b"")[:2], "little")


def number(head: Head, name: bytes, size: int = 4) -> int | None:
    """A field that is a whole number of so many bytes; None if it is not."""
    value = head.get(name, b"")
    return int.from_bytes(value, "little") if len(value) == size else None
