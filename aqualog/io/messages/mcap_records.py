"""The records of an MCAP file, and those within a chunk.

A wrong length leads anywhere. It shows if it leads beyond the file, over the place where the summary knows a chunk, or
to bytes that are no record. Without a summary reading resumes at the next place whose lengths agree with each other as
those of a chunk do.
"""

from __future__ import annotations

import struct
from array import array
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode

from aqualog.io.decompress import LONGEST
from aqualog.io.messages.batches import Batch, rows_of
from aqualog.io.messages.walk import RecordWalk

__all__ = ["HEAD", "MAGIC", "McapWalk", "Scan", "scanned"]

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


_STAMPED = 22  # bytes before the content of a message: channel, sequence, log time, publish time
_PRIVATE = 0x80  # from there on opcodes are private and skipped
_STRETCH = 1 << 16  # records
_RECORD = np.dtype({
    "names": ["length", "channel", "log_time"],
    "formats": ["<u8", "<u2", "<u8"],
    "offsets": [1, HEAD.size, HEAD.size + 6],
    "itemsize": HEAD.size + _STAMPED,
})  # fmt: skip


class McapWalk(RecordWalk[int]):
    """One pass over the data section; the head of a record is its opcode."""

    has_end_record = True

    def _record_at(self, offset: int) -> tuple[int, int, int] | None:
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
        return None if known is not None and end > known else (opcode, offset + HEAD.size, end)

    def _head(self, offset: int) -> tuple[int, int]:
        """Opcode and length; zeros if there is no room for them."""
        self._file.seek(offset)
        head = self._file.read(HEAD.size)
        return HEAD.unpack(head) if len(head) == HEAD.size else (0, 0)

    def _has_body(self, head: int) -> bool:
        return head in _WITH_BODY

    def _is_last(self, head: int) -> bool:
        return head in (Opcode.DATA_END, Opcode.FOOTER)

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


class Scan(NamedTuple):
    """What a chunk holds: its messages, and opcode and body of each schema and channel."""

    messages: Batch
    records: tuple[tuple[int, bytes], ...]


def scanned(data: bytes) -> Scan | None:
    """Records of a chunk, none of them copied; None if anything about them is unusual."""
    found = array("q")  # a list would hold ten times the chunk where its records are empty
    position, size = 0, len(data)
    add, length_at = found.append, struct.Struct("<Q").unpack_from
    try:
        while position < size:
            # zeros are records without an end to it: no further than the first stretch of them
            for _ in range(_STRETCH):
                add(position)
                position += HEAD.size + length_at(data, position + 1)[0]
                if position >= size:
                    break
            if not data[found[-1]]:
                return None
    except struct.error:
        return None
    if position != size:
        return None
    at = np.array(found, dtype=np.int64)
    ends = np.append(at[1:], size)
    opcodes = np.frombuffer(data, np.uint8)[at]
    of_messages = opcodes == Opcode.MESSAGE
    others = np.flatnonzero(~of_messages & (opcodes < _PRIVATE)).tolist()
    if any(opcodes[i] not in (Opcode.SCHEMA, Opcode.CHANNEL) for i in others):
        return None
    at_message, ends_message = at[of_messages], ends[of_messages]
    starts = at_message + HEAD.size + _STAMPED
    if (starts > ends_message).any():
        return None
    heads = rows_of(data, at_message, _RECORD.itemsize).view(_RECORD) if starts.size else np.zeros(0, _RECORD)
    batch = Batch(heads["channel"].astype(np.int64), heads["log_time"], starts, ends_message, data)
    return Scan(batch, tuple((int(opcodes[i]), data[found[i] + HEAD.size : int(ends[i])]) for i in others))
