"""Find the records of an unpacked MCAP chunk by their lengths, and read all their heads at once.

Only a chunk without any fault is scanned. For any other `scanned` returns None, and the walk record by record reports
the fault, so that there is one set of errors.
"""

from __future__ import annotations

import struct
from array import array
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode

from aqualog.io.batches import Batch, rows_of

__all__ = ["Scan", "scanned"]

_HEAD = 9  # bytes: opcode, length
_STAMPED = 22  # bytes before the content of a message: channel, sequence, log time, publish time
_PRIVATE = 0x80  # from there on opcodes are private and skipped
_STRETCH = 1 << 16  # records
_RECORD = np.dtype({
    "names": ["length", "channel", "log_time"],
    "formats": ["<u8", "<u2", "<u8"],
    "offsets": [1, _HEAD, _HEAD + 6],
    "itemsize": _HEAD + _STAMPED,
})  # fmt: skip


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
                position += _HEAD + length_at(data, position + 1)[0]
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
    starts = at_message + _HEAD + _STAMPED
    if (starts > ends_message).any():
        return None
    heads = rows_of(data, at_message, _RECORD.itemsize).view(_RECORD) if starts.size else np.zeros(0, _RECORD)
    batch = Batch(heads["channel"].astype(np.int64), heads["log_time"], starts, ends_message, data)
    return Scan(batch, tuple((int(opcodes[i]), data[found[i] + _HEAD : int(ends[i])]) for i in others))
