"""Which packed blocks of an MDF 4 file are damaged: looked for only when one of them could not be read."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path

from aqualog.io.mdf_harness import unpacked

__all__ = ["damaged_blocks"]

_HEAD = struct.Struct("<26xB5xQQ")  # of a DZ block: how it is packed, its size unpacked and packed [bytes]
_KINDS = (1, 1, 5, 5, 3, 3)  # asammdf's number for each way of packing; that a block is transposed makes no difference


def damaged_blocks(path: Path, addresses: Iterable[int]) -> frozenset[int]:
    """Those of the blocks at these addresses that do not unpack to what they tell of.

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
                unpacked(_KINDS[packing], data, size)
            except Exception:  # what its library raises is of no one kind
                found.add(at)
    return frozenset(found)
