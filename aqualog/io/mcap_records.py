"""Walk the records of an MCAP file's data section; behind a damaged one, seek the next chunk.

A wrong length leads anywhere. It shows if it leads beyond the file, over the place where the summary knows a chunk, or
to bytes that are no record. Reading then resumes at the next chunk of the summary. Without a summary it resumes at the
next place whose lengths agree with each other as those of a chunk do.
"""

from __future__ import annotations

import struct
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from typing import BinaryIO

import numpy as np
from mcap.opcode import Opcode

from aqualog.io.batches import rows_of
from aqualog.io.unpack import LONGEST

__all__ = ["HEAD", "MAGIC", "Records"]

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")
"""Opcode and length of a record."""

_WITH_BODY = frozenset(
    {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.DATA_END}
)
_BEHIND_DATA = frozenset(
    {
        Opcode.FOOTER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX,
        Opcode.METADATA_INDEX, Opcode.STATISTICS, Opcode.SUMMARY_OFFSET,
    }
)  # fmt: skip
_FOOTER_LENGTH, _DATA_END_LENGTH = 20, 4
_U32, _U64 = struct.Struct("<I"), struct.Struct("<Q")
_ATTACHMENT = 2 * 8 + 2 * 4 + 8 + 4  # bytes of an attachment beside its name, its type and its data

_BLOCK = 1 << 20
_NAMES = {0: "plain", 3: "lz4", 4: "zstd"}  # length of the compression's name: where the length of the data stands
_FIXED = 40  # bytes of a chunk beside that name and the data
_CHUNK = np.dtype({
    "names": ["length", "name", *_NAMES.values()],
    "formats": ["<u8", "<u4", *["<u8"] * len(_NAMES)],
    "offsets": [1, 37, *(41 + n for n in _NAMES)],
    "itemsize": 53,
})  # fmt: skip


class Records:
    """One pass over the data section.

    Parameters
    ----------
    file : BinaryIO
    size : int
        Of the file. [byte]
    chunks : sequence of int
        Where the summary knows chunks; empty without a sound one.
    """

    def __init__(self, file: BinaryIO, size: int, chunks: Sequence[int] = ()) -> None:
        self.gaps: list[tuple[int, int]] = []
        """Where no record could be read: from, to. [byte]"""
        self._file, self._size = file, size
        self._chunks = sorted(chunks)
        self._doubted = False

    def doubt(self) -> None:
        """The record just given is not what it says, so its length may be wrong, too."""
        self._doubted = True

    def __iter__(self) -> Iterator[tuple[int, int, bytes]]:
        """Offset, opcode and body (empty where nobody reads it) up to the end of the data."""
        offset = trusted = len(MAGIC)
        while True:
            end = self._end(offset)
            if end is None:
                found = self._known(offset + 1) if self._chunks else self._sought(trusted)
                back = found is not None and found < offset  # a length has led over it
                self.gaps.append((trusted if back else offset, self._size if found is None else found))
                if found is None:
                    return
                offset = found
                trusted = offset + 1
                continue
            opcode, length = self._head(offset)
            self._doubted = False
            yield offset, opcode, self._file.read(length) if opcode in _WITH_BODY else b""
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                return
            trusted = offset + 1 if self._doubted else end
            offset = end

    def _head(self, offset: int) -> tuple[int, int]:
        """Opcode and length; zeros if there is no room for them."""
        self._file.seek(offset)
        head = self._file.read(HEAD.size)
        return HEAD.unpack(head) if len(head) == HEAD.size else (0, 0)

    def _end(self, offset: int) -> int | None:
        """Where the record ends; None if it cannot be one."""
        opcode, length = self._head(offset)
        end = offset + HEAD.size + length
        if opcode == 0 or end > self._size:
            return None
        if opcode == Opcode.FOOTER and (length != _FOOTER_LENGTH or end + len(MAGIC) != self._size):
            return None
        if opcode == Opcode.DATA_END and (length != _DATA_END_LENGTH or self._head(end)[0] not in _BEHIND_DATA):
            return None
        if opcode in _WITH_BODY and length > LONGEST:
            return None
        if opcode == Opcode.ATTACHMENT and not self._is_attachment(offset + HEAD.size, length):
            return None
        known = self._known(offset + 1)
        return None if known is not None and end > known else end

    def _is_attachment(self, start: int, length: int) -> bool:
        """Whether the sizes of its parts fill it: nothing else of it is read."""
        left, at = length - _ATTACHMENT, start + 16
        for size in (_U32, _U32, _U64):  # name, type, data
            self._file.seek(at)
            raw = self._file.read(size.size)
            if len(raw) < size.size:
                return False
            part = int(size.unpack(raw)[0])
            left -= part
            at += size.size + part
            if left < 0:
                return False
        return left == 0

    def _known(self, offset: int) -> int | None:
        """The first chunk of the summary from a place on."""
        at = bisect_left(self._chunks, offset)
        return self._chunks[at] if at < len(self._chunks) else None

    def _sought(self, offset: int) -> int | None:
        """The first place from `offset` on that looks like a chunk."""
        while offset + _CHUNK.itemsize <= self._size:
            self._file.seek(offset)
            block = self._file.read(_BLOCK)
            if len(block) < _CHUNK.itemsize:
                return None
            found = _chunks_in(block, self._size - offset)
            if found.size:
                return offset + int(found[0])
            offset += len(block) - _CHUNK.itemsize + 1
        return None


def _chunks_in(block: bytes, room: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Where in a block the lengths are those of a chunk that ends within `room`."""
    at = np.flatnonzero(np.frombuffer(block, np.uint8)[: len(block) - _CHUNK.itemsize + 1] == Opcode.CHUNK)
    if not at.size:
        return at
    heads = rows_of(block, at, _CHUNK.itemsize).view(_CHUNK)
    length = heads["length"].astype(np.float64)
    agrees = np.zeros(at.size, dtype=np.bool_)
    for size, name in _NAMES.items():
        agrees |= (heads["name"] == size) & (length == heads[name].astype(np.float64) + (_FIXED + size))
    return at[agrees & (length <= room - at - HEAD.size)]
