"""Read a file as if some of its bytes were others, without changing or copying the file."""

from __future__ import annotations

import io
from bisect import bisect_left
from collections.abc import Mapping
from pathlib import Path

__all__ = ["PatchedFile"]


class PatchedFile(io.BufferedIOBase):
    """A file, open for reading, with bytes in place of its own.

    Parameters
    ----------
    path : Path
        The file; only ever read.
    patches : mapping of int to bytes
        What stands where instead; of two that overlap the one that begins later counts. Behind the end of the file they
        make it longer, with zeros between. [bytes]
    """

    def __init__(self, path: Path, patches: Mapping[int, bytes]) -> None:
        super().__init__()
        self._file = path.open("rb")
        self._begins = sorted(patches)
        self._patches = [patches[at] for at in self._begins]
        self._longest = max((len(p) for p in self._patches), default=0)
        self._size = max([self._file.seek(0, io.SEEK_END), *(at + len(p) for at, p in patches.items())])
        self._at = 0

    def readable(self) -> bool:
        """Yes."""
        return True

    def seekable(self) -> bool:
        """Yes."""
        return True

    def tell(self) -> int:
        """Where the next byte is read."""
        return self._at

    def seek(self, offset: int, whence: int = io.SEEK_SET, /) -> int:
        """Go there. An address that no file reaches is its end."""
        begin = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._size}[whence]
        self._at = min(max(begin + offset, 0), self._size)
        return self._at

    def read(self, size: int | None = -1, /) -> bytes:
        """So many bytes, or all that are left. No more than the file holds are asked for."""
        begin, left = self._at, self._size - self._at
        n = left if size is None or size < 0 else min(size, left)
        self._file.seek(begin)
        data = self._file.read(n)
        self._at = begin + n
        first = bisect_left(self._begins, begin - self._longest)
        last = bisect_left(self._begins, begin + n)
        if first == last and len(data) == n:
            return data
        out = bytearray(data) + bytes(n - len(data))
        for at, new in zip(self._begins[first:last], self._patches[first:last], strict=True):
            piece = new[max(begin - at, 0) : begin + n - at]
            to = max(at - begin, 0)
            out[to : to + len(piece)] = piece
        return bytes(out)

    def close(self) -> None:
        """Release the file."""
        self._file.close()
        super().close()
