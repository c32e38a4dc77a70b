"""Find the damaged packed blocks of an MDF 4 file, after one of them could not be read."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable
from pathlib import Path

from aqualog.io.mdf_harness import unpacked

__all__ = ["damaged_blocks"]

_HEAD = struct.Struct("<26xB5xQQ")  # of a DZ block: how it is packed, its size unpacked and packed [bytes]
_DEFLATED = (0, 1)
_KINDS = {2: 5, 3: 5, 4: 3, 5: 3}  # asammdf's numbers for the other ways; that it is transposed makes no difference
_PIECE = 1 << 20  # [bytes]


def damaged_blocks(path: Path, addresses: Iterable[int]) -> frozenset[int]:
    """Return the blocks at these addresses that do not unpack to their declared size.

    Parameters
    ----------
    path : Path
    addresses : iterable of int
        Of DZ blocks whose lengths lie inside the file. [byte]

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    found = set()
    with path.open("rb") as file:
        for at in addresses:
            file.seek(at)
            packing, size, stored = _HEAD.unpack(file.read(_HEAD.size))
            data = file.read(stored)
            try:
                if packing not in _DEFLATED:
                    unpacked(_KINDS[packing], data, size)
                elif _inflates_to(data) != size:
                    found.add(at)
            except Exception:  # what its library raises is of no one kind
                found.add(at)
    return frozenset(found)


def _inflates_to(data: bytes) -> int:
    """Return the size of deflated data, a piece at a time; the declared size may be far more than there is. [bytes]"""
    inflater, size = zlib.decompressobj(), 0
    while not inflater.eof:
        piece = inflater.decompress(data, _PIECE)
        data = inflater.unconsumed_tail
        if not piece and not data:
            return -1  # its end is missing
        size += len(piece)
    return size
