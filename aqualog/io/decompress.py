"""Decompress blocks to no more than a log can hold.

Zeros shrink to a thousandth and less; measured signals do not, since messages carry counters and stamps. The unpacked
size may therefore be a multiple of the packed one, plus a store that refills as a file is read.
"""

from __future__ import annotations

import bz2

import lz4.frame
import zstandard

__all__ = ["FREE", "LONGEST", "MAX_UNPACKED", "RATIO", "Allowance", "DamagedError", "unpack"]

MAX_UNPACKED = 1 << 28
"""Largest block that is decompressed. [byte]"""
LONGEST = MAX_UNPACKED + (1 << 16)
"""Longest record of a recording that is read as a whole: one that holds such a block. [byte]"""
RATIO = 1000
"""To what part recorded messages shrink at most: those of 200 numbers that never change shrink to a 200th."""
FREE = 1 << 25
"""What may be unpacked beyond that ratio. [byte]"""


class DamagedError(Exception):
    """A block cannot be unpacked; its text is the reason."""


class Allowance:
    """How much the blocks of one file may unpack to."""

    def __init__(self) -> None:
        self._spare = FREE

    def take(self, packed: int, size: int) -> None:
        """Allow a block. [byte]

        Raises
        ------
        DamagedError
            If it would unpack to more than its compressed size and the blocks before it speak for.
        """
        room = min(MAX_UNPACKED, self._spare + RATIO * packed)
        if size > room:
            raise DamagedError(f"it would unpack to {size} bytes from {packed}, more than {room}")
        self._spare = min(FREE, self._spare + RATIO * packed - size)


def unpack(data: bytes, compression: str, size: int, allowance: Allowance) -> bytes:
    """Decompress a block to its declared size [byte] and not a byte further.

    `compression`: `zstd`, `lz4`, `bz2`, or empty or `none` for plain bytes. `allowance`: of the file it stands in.

    Raises
    ------
    DamagedError
        If the block is damaged, of another size, larger than is allowed or of an unknown compression.
    """
    allowance.take(len(data), size)
    try:
        plain = _decompress(data, compression, size + 1)
    except (zstandard.ZstdError, RuntimeError, EOFError, OSError, ValueError) as error:
        raise DamagedError(f"{compression} cannot unpack it ({error})") from error
    if len(plain) != size:
        raise DamagedError(f"it does not unpack to the {size} bytes that it declares")
    return plain


def _decompress(data: bytes, compression: str, limit: int) -> bytes:
    if compression in ("", "none"):
        return data
    if compression == "zstd":
        # As a stream, for the one-call form believes the size in the frame and not the limit.
        with zstandard.ZstdDecompressor().stream_reader(data, read_across_frames=True) as stream:
            return stream.read(limit)
    if compression == "lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=limit))
    if compression == "bz2":
        return bz2.BZ2Decompressor().decompress(data, max_length=limit)
    raise DamagedError(f'compression "{compression}" is not known')
