"""A page of memory on which a process writes what it has in hand, for its parent to read when it has died."""

from __future__ import annotations

import mmap
import os
import struct

from aqualog.io.in_hand import InHand

__all__ = ["Board"]

_SIZE = 1 << 16
_HEAD = struct.Struct("=?I")  # whether the work is done, length of the rest
_ENTRY = struct.Struct("=dqq")  # seconds, size, step; then names, each ended by a zero


class Board:
    """Shared with processes that are forked afterwards; a crash cannot block it, as it can a pipe."""

    def __init__(self) -> None:
        self._page = mmap.mmap(-1, _SIZE)
        self._last = InHand()

    def clear(self) -> None:
        """As it was at first."""
        self._page[: _HEAD.size] = bytes(_HEAD.size)
        self._last = InHand()

    def tell(self, held: InHand) -> None:
        """Write what is in hand."""
        names = b"".join(os.fsencode(n) + b"\0" for n in (held.log, *held.temporary))
        if len(names) > _SIZE - _HEAD.size - _ENTRY.size:
            names = os.fsencode(held.log)[:4096] + b"\0"
        entry = _ENTRY.pack(held.seconds, held.size, held.step) + names
        done = self._page[:1]
        # while there is no length, what was read before still holds
        self._page[: _HEAD.size] = done + bytes(_HEAD.size - 1)
        self._page[_HEAD.size : _HEAD.size + len(entry)] = entry
        self._page[: _HEAD.size] = _HEAD.pack(done != b"\0", len(entry))

    def finish(self) -> None:
        """Write that the work is done."""
        self._page[:1] = b"\1"

    @property
    def is_finished(self) -> bool:
        """Whether the work was done."""
        return self._page[:1] != b"\0"

    def read(self) -> InHand:
        """What was written last; what a process that has gone wild wrote over it is not believed."""
        _, length = _HEAD.unpack(self._page[: _HEAD.size])
        if not _ENTRY.size < length <= _SIZE - _HEAD.size:
            return self._last
        page = self._page[: _HEAD.size + length]
        if page != self._page[: len(page)] or _HEAD.unpack_from(page)[1] != length or not page.endswith(b"\0"):
            return self._last  # the process is writing just now
        entry = page[_HEAD.size :]
        seconds, size, step = _ENTRY.unpack_from(entry)
        log, *temporary = (os.fsdecode(n) for n in entry[_ENTRY.size :].split(b"\0")[:-1])
        self._last = InHand(log, seconds, size, step, tuple(temporary))
        return self._last
