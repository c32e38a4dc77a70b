"""Raw samples of an MDF 4 group straight from its data blocks, for the plain layouts that most loggers write.

asammdf has parsed the file: which blocks there are, and where a channel lies in a record. Here the blocks are read,
inflated and cut into columns without a copy of whole records; of a transposed block only the bytes of the wanted
channels are touched. Whatever is not plain is left to asammdf: `raw_columns` gives None.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

try:
    from deflate import zlib_decompress as _libdeflate  # asammdf brings it along where it can
except ImportError:
    _libdeflate = None

__all__ = ["raw_columns", "raw_pieces"]

_PLAIN, _DEFLATED, _TRANSPOSED = 0, 1, 2  # asammdf's kinds of blocks
_FIXED_LENGTH, _MASTER = 0, 2
_KINDS = {0: "<u", 1: ">u", 2: "<i", 3: ">i", 4: "<f", 5: ">f"}  # by MDF's data types
_BITS = {"u": (8, 16, 32, 64), "i": (8, 16, 32, 64), "f": (32, 64)}
_LARGEST_BLOCK = 1 << 28  # [bytes] inflated; the standard allows 4 MiB
_IN_HAND = 64  # blocks

_Array = NDArray[Any]


class _Field(NamedTuple):
    """Where a channel lies in a record."""

    at: int
    dtype: np.dtype[Any]


class _Block(NamedTuple):
    """A data block: where it is, its stored and its inflated size, and the first record in it."""

    address: int
    stored: int
    size: int
    kind: int
    first: int


def raw_columns(path: Path, inner: Any, index: int, wanted: Sequence[int]) -> dict[int, _Array] | None:
    """Raw samples (cycles,) of channels of a group, all of its records; None where only asammdf knows how.

    Parameters
    ----------
    path : Path
        The file that asammdf has open.
    inner : asammdf MDF4
    index : int
        Of the group.
    wanted : sequence of int
        Channels of the group.

    Raises
    ------
    OSError, zlib.error, deflate.DeflateError
        If a block cannot be read or inflated to the size that it tells.
    """
    plan = _plan(inner.groups[index], wanted)
    return None if plan is None else _decoded(path, plan, plan.blocks)


def raw_pieces(
    path: Path, inner: Any, index: int, wanted: Sequence[int], records: int
) -> Iterator[dict[int, _Array]] | None:
    """The same in pieces of whole blocks with at least so many records, in order."""
    plan = _plan(inner.groups[index], wanted)
    return None if plan is None else (_decoded(path, plan, run) for run in _runs(plan, records))


class _Plan(NamedTuple):
    """Where wanted channels lie: their fields, the blocks, and the size of a record. [bytes]"""

    fields: dict[int, _Field]
    blocks: list[_Block]
    size: int


def _plan(group: Any, wanted: Sequence[int]) -> _Plan | None:
    size, cycles = int(group.channel_group.samples_byte_nr), int(group.channel_group.cycles_nr)
    if not _is_plain(group) or size == 0:
        return None
    fields = {i: _field(group.channels[i], size) for i in wanted}
    if any(f is None for f in fields.values()):
        return None
    blocks = _blocks(group, size, cycles)
    return None if blocks is None else _Plan({i: f for i, f in fields.items() if f is not None}, blocks, size)


def _runs(plan: _Plan, records: int) -> Iterator[list[_Block]]:
    run: list[_Block] = []
    for block in plan.blocks:
        run.append(block)
        if sum(b.size for b in run) >= records * plan.size:
            yield run
            run = []
    if run:
        yield run


def _decoded(path: Path, plan: _Plan, blocks: Sequence[_Block]) -> dict[int, _Array]:
    """Raw samples of consecutive blocks."""
    begin = blocks[0].first if blocks else 0
    rows = sum(b.size for b in blocks) // plan.size
    out = {i: np.empty(rows, dtype=f.dtype) for i, f in plan.fields.items()}
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
    try:

        def take(block: _Block) -> None:
            _fill(out, plan.fields, block._replace(first=block.first - begin), _inflated(handle, block), plan.size)

        threads = min(len(blocks), _threads())
        if threads < 2:
            for block in blocks:
                take(block)
        else:
            with ThreadPoolExecutor(threads) as pool:
                for k in range(0, len(blocks), _IN_HAND):
                    list(pool.map(take, blocks[k : k + _IN_HAND]))
    finally:
        os.close(handle)
    return out


def _threads() -> int:
    """As many as polars has: one in a worker of a batch."""
    given = os.environ.get("POLARS_MAX_THREADS", "")
    return int(given) if given.isdigit() and int(given) > 0 else min(os.cpu_count() or 1, 4)


def _is_plain(group: Any) -> bool:
    """Sorted records without invalidation bytes, in the file itself."""
    return bool(
        hasattr(os, "pread")
        and group.sorted
        and not group.uses_ld
        and group.data_location == 0
        and int(group.data_group.record_id_len) == 0
        and int(group.channel_group.invalidation_bytes_nr) == 0
    )


def _field(channel: Any, size: int) -> _Field | None:
    """Whole bytes at the start of a byte, of a type that NumPy knows; else None."""
    letters = _KINDS.get(int(channel.data_type))
    bits, at = int(channel.bit_count), int(channel.byte_offset)
    if letters is None or bits not in _BITS[letters[1]] or int(channel.bit_offset):
        return None
    if int(channel.channel_type) not in (_FIXED_LENGTH, _MASTER) or at + bits // 8 > size:
        return None
    return _Field(at, np.dtype(f"{letters}{bits // 8}"))


def _blocks(group: Any, size: int, cycles: int) -> list[_Block] | None:
    """Blocks of whole records that make up the group exactly; else None."""
    out = []
    first = 0
    for info in group.data_blocks:
        kind, inflated = int(info.block_type), int(info.original_size)
        if info.block_limit is not None or kind not in (_PLAIN, _DEFLATED, _TRANSPOSED) or inflated % size:
            return None
        if inflated > _LARGEST_BLOCK or (kind == _TRANSPOSED and int(info.param) != size):
            return None
        out.append(_Block(int(info.address), int(info.compressed_size), inflated, kind, first))
        first += inflated // size
    return out if first == cycles else None


def _inflated(handle: int, block: _Block) -> bytes:
    data = os.pread(handle, block.stored, block.address)
    if len(data) != block.stored:
        raise OSError(f"{len(data)} of {block.stored} bytes of a data block")
    if block.kind == _PLAIN:
        return data
    if _libdeflate is not None:
        return bytes(_libdeflate(data, block.size))
    # no more than it tells: a block that inflates without end is none; the checksum stands behind the last byte
    inflater = zlib.decompressobj()
    out = inflater.decompress(data, block.size)
    if not inflater.eof and (inflater.decompress(inflater.unconsumed_tail, 1) or not inflater.eof):
        raise OSError(f"a data block inflates to more than {block.size} bytes, or its end is missing")
    return out


def _fill(out: dict[int, _Array], fields: dict[int, _Field], block: _Block, data: bytes, size: int) -> None:
    if len(data) != block.size:
        raise OSError(f"a data block inflates to {len(data)} bytes, not {block.size}")
    n = block.size // size
    here = slice(block.first, block.first + n)
    octets = np.frombuffer(data, dtype=np.uint8)
    if block.kind == _TRANSPOSED:
        columns = octets.reshape(size, n)
        for i, f in fields.items():
            out[i][here] = np.ascontiguousarray(columns[f.at : f.at + f.dtype.itemsize].T).view(f.dtype)[:, 0]
        return
    for i, f in fields.items():
        out[i][here] = np.ndarray((n,), f.dtype, data, f.at, (size,))
