"""A page of memory on which a process writes what it reads, for its parent to look at when it has died."""

from __future__ import annotations

import json
import mmap
import struct
import zlib

from aqualog.guard.reading import ReadingState

__all__ = ["StatePage"]

_SIZE = 1 << 16
_HEAD = struct.Struct("=?II")  # whether the work is done; length and checksum of the rest


class StatePage:
    """Shared with processes that are forked afterwards. A crash cannot block it, as it can a pipe."""

    def __init__(self) -> None:
        self._page = mmap.mmap(-1, _SIZE)
        self._last = ReadingState()

    def clear(self) -> None:
        """As it was at first."""
        self._page[: _HEAD.size] = bytes(_HEAD.size)
        self._last = ReadingState()

    def write(self, state: ReadingState) -> None:
        """Replace the state; files that do not fit on the page are left out."""
        data = json.dumps(state).encode()  # file names of any bytes: what is no text is escaped
        if len(data) > _SIZE - _HEAD.size:
            data = json.dumps(state._replace(log=state.log[:4096], temporary=())).encode()
        self._page[_HEAD.size : _HEAD.size + len(data)] = data
        self._page[: _HEAD.size] = _HEAD.pack(self.is_finished, len(data), zlib.crc32(data))

    def finish(self) -> None:
        """Note that the work is done."""
        self._page[:1] = b"\1"

    @property
    def is_finished(self) -> bool:
        """Whether the work was done."""
        return self._page[:1] != b"\0"

    def read(self) -> ReadingState:
        """The last whole state; half-written ones, and what a wild process wrote over it, do not count."""
        _, length, checksum = _HEAD.unpack(self._page[: _HEAD.size])
        data = self._page[_HEAD.size : _HEAD.size + length] if length <= _SIZE - _HEAD.size else b""
        if data and zlib.crc32(data) == checksum:
            log, seconds, size, step, temporary = json.loads(data)
            self._last = ReadingState(log, seconds, size, step, tuple(temporary))
        return self._last
