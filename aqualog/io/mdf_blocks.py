"""Read raw samples of an MDF 4 group straight from its data blocks, for the plain layouts that most loggers write.

asammdf has parsed the file: its blocks, and the place of a channel in a record. Here the blocks are read, inflated and
cut into columns without a copy of whole records. Of a transposed block only the bytes of the wanted channels are
touched. Other layouts are left to asammdf: `raw_columns` returns None.
"""

from __future__ import annotations

import mmap
import os
import zlib
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aqualog.core.records import BoolArray

try:
    from deflate import zlib_decompress as _libdeflate  # asammdf brings it along where it can
except ImportError:
    _libdeflate = None

__all__ = ["Raw", "inflated", "let_go", "raw_columns", "raw_pieces"]

_PLAIN, _DEFLATED, _TRANSPOSED = 0, 1, 2  # asammdf's kinds of blocks
_FIXED_LENGTH, _MASTER = 0, 2
_KINDS = {0: "<u", 1: ">u", 2: "<i", 3: ">i", 4: "<f", 5: ">f"}  # by MDF's data types
_BITS = {"u": (8, 16, 32, 64), "i": (8, 16, 32, 64), "f": (32, 64)}
_SOME_INVALID = 2  # flag of a channel that has an invalidation bit
_LARGEST_BLOCK = 1 << 28  # [bytes] stored or inflated; the standard allows 4 MiB
_PIECE = 1 << 21  # [bytes] read at a time where nothing is compressed: what the cache still holds when it is cut

_Array = NDArray[Any]


class Raw(NamedTuple):
    """Raw samples (n,) by channel, and which of them are invalid (n,), for channels with an invalidation bit."""

    samples: dict[int, _Array]
    invalid: dict[int, BoolArray]


class _Field(NamedTuple):
    """Where a channel lies in a record: its first byte, how many bytes hold it, its lowest bit and how many bits."""

    at: int
    octets: int
    shift: int
    bits: int
    dtype: np.dtype[Any]

    @property
    def is_whole(self) -> bool:
        return self.bits == 8 * self.dtype.itemsize


class _Block(NamedTuple):
    """Whole records: where their stored bytes are, their stored and their inflated size, and the first record."""

    extents: tuple[tuple[int, int], ...]  # (address, size)
    stored: int
    size: int
    kind: int
    first: int


class _Plan(NamedTuple):
    """Where wanted channels lie: fields, places of invalidation bits (byte, bit), blocks, size of a record. [bytes]"""

    fields: dict[int, _Field]
    invalid: dict[int, tuple[int, int]]
    blocks: list[_Block]
    size: int


def raw_columns(path: Path, inner: Any, index: int, wanted: Sequence[int]) -> Raw | None:
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
        If a block cannot be read or inflated to the size that it declares.
    """
    plan = _plan(inner.groups[index], wanted)
    return None if plan is None else _decoded(path, plan, plan.blocks)


def raw_pieces(path: Path, inner: Any, index: int, wanted: Sequence[int], records: int) -> Iterator[Raw] | None:
    """The same in pieces of whole blocks with at least so many records, in order."""
    plan = _plan(inner.groups[index], wanted)
    return None if plan is None else (_decoded(path, plan, run) for run in _runs(plan, records))


def let_go(inner: Any) -> None:
    """Give back the memory that looking for the blocks of a file has mapped; it is mapped again where it is read.

    Around each of the blocks, 64 kB of the file count as this process's: a ninth of it.
    """
    mapped = getattr(inner, "_file", None)
    if isinstance(mapped, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):
        mapped.madvise(mmap.MADV_DONTNEED)


# --- what lies where ---


def _plan(group: Any, wanted: Sequence[int]) -> _Plan | None:
    own = int(group.channel_group.samples_byte_nr)
    size = own + int(group.channel_group.invalidation_bytes_nr)
    if not _is_plain(group) or not 0 < own <= size <= _LARGEST_BLOCK:
        return None
    fields = {i: _field(group.channels[i], own) for i in wanted}
    if any(f is None for f in fields.values()):
        return None
    invalid = {
        i: (own + at // 8, at % 8)
        for i in wanted
        if group.channels[i].flags & _SOME_INVALID and (at := int(group.channels[i].pos_invalidation_bit)) >= 0
    }
    if any(at >= size for at, _ in invalid.values()):
        return None
    blocks = _blocks(group, size, int(group.channel_group.cycles_nr))
    return None if blocks is None else _Plan({i: f for i, f in fields.items() if f is not None}, invalid, blocks, size)


def _is_plain(group: Any) -> bool:
    """Sorted records in the file itself, row by row."""
    return bool(
        group.sorted and not group.uses_ld and group.data_location == 0 and int(group.data_group.record_id_len) == 0
    )


def _field(channel: Any, size: int) -> _Field | None:
    """Whole bytes of a type that NumPy knows, or any bits of a little-endian integer; else None."""
    letters = _KINDS.get(int(channel.data_type))
    bits, at, shift = int(channel.bit_count), int(channel.byte_offset), int(channel.bit_offset)
    octets = (shift + bits + 7) // 8
    if letters is None or int(channel.channel_type) not in (_FIXED_LENGTH, _MASTER):
        return None
    if bits < 1 or not 0 <= shift < 8 or octets > 8 or at < 0 or at + octets > size:
        return None
    if (shift or bits not in _BITS[letters[1]]) and letters not in ("<u", "<i"):
        return None
    return _Field(at, octets, shift, bits, np.dtype(f"{letters}{1 << (octets - 1).bit_length()}"))


def _blocks(group: Any, size: int, cycles: int) -> list[_Block] | None:
    """Blocks of whole records that make up the group exactly; else None."""
    out: list[_Block] = []
    plain: list[tuple[int, int]] = []  # stored one behind the other; a record may begin in one and end in the next
    for info in group.data_blocks:
        kind, inflated, stored = int(info.block_type), int(info.original_size), int(info.compressed_size)
        if info.block_limit is not None or kind not in (_PLAIN, _DEFLATED, _TRANSPOSED):
            return None
        if kind == _PLAIN:
            plain.append((int(info.address), inflated))
            continue
        if inflated % size or max(inflated, stored) > _LARGEST_BLOCK or (kind == _TRANSPOSED and info.param != size):
            return None
        if not _put_plain(out, plain, size):
            return None
        out.append(_Block(((int(info.address), stored),), stored, inflated, kind, _records(out, size)))
    return out if _put_plain(out, plain, size) and _records(out, size) == cycles else None


def _records(blocks: Sequence[_Block], size: int) -> int:
    return blocks[-1].first + blocks[-1].size // size if blocks else 0


def _put_plain(out: list[_Block], plain: list[tuple[int, int]], size: int) -> bool:
    """Cut consecutive stored bytes into pieces of whole records, and forget them; False if a record is incomplete."""
    if sum(length for _, length in plain) % size:
        return False
    piece = max(_PIECE // size, 1) * size
    extents: list[tuple[int, int]] = []
    missing = piece
    for address, length in plain:
        while length:
            taken = min(length, missing)
            extents.append((address, taken))
            address, length, missing = address + taken, length - taken, missing - taken
            if not missing:
                out.append(_Block(tuple(extents), piece, piece, _PLAIN, _records(out, size)))
                extents, missing = [], piece
    if extents:
        out.append(_Block(tuple(extents), piece - missing, piece - missing, _PLAIN, _records(out, size)))
    plain.clear()
    return True


def _runs(plan: _Plan, records: int) -> Iterator[list[_Block]]:
    run: list[_Block] = []
    for block in plan.blocks:
        run.append(block)
        if block.first - run[0].first + block.size // plan.size >= records:
            yield run
            run = []
    if run:
        yield run


# --- from bytes to columns ---


def _decoded(path: Path, plan: _Plan, blocks: Sequence[_Block]) -> Raw:
    """Raw samples of consecutive blocks."""
    begin = blocks[0].first if blocks else 0
    rows = sum(b.size for b in blocks) // plan.size
    out = Raw(
        {i: np.empty(rows, dtype=f.dtype) for i, f in plan.fields.items()},
        {i: np.empty(rows, dtype=np.bool_) for i in plan.invalid},
    )
    pending = deque(b._replace(first=b.first - begin) for b in blocks)
    longest = max((b.stored for b in blocks), default=0)

    def work() -> None:
        # one room for all blocks: pages of memory that are fresh for each cost as much as reading them
        room = np.empty(longest, dtype=np.uint8).data
        try:
            with path.open("rb", buffering=0) as file:
                while pending:
                    try:
                        block = pending.popleft()
                    except IndexError:  # another thread took the last one
                        return
                    _fill(out, plan, block, _inflated(_stored(file, block, room), block))
        except BaseException:
            pending.clear()  # the other threads need not go on
            raise

    threads = min(len(blocks), _threads())
    if threads < 2:
        work()
    else:
        with ThreadPoolExecutor(threads) as pool:
            for done in [pool.submit(work) for _ in range(threads)]:
                done.result()
    return out


def _threads() -> int:
    """As many as polars has: one in a worker of a batch."""
    given = os.environ.get("POLARS_MAX_THREADS", "")
    return int(given) if given.isdigit() and int(given) > 0 else min(os.cpu_count() or 1, 4)


def _stored(file: BinaryIO, block: _Block, room: memoryview) -> memoryview:
    """The bytes of a block as they are in the file; they stand in `room`."""
    at = 0
    for address, length in block.extents:
        file.seek(address)
        end = at + length
        while at < end:
            read = file.readinto(room[at:end])  # type: ignore[attr-defined]
            if not read:
                raise OSError(f"{end - at} of {block.stored} bytes of a data block are not there")
            at += read
    return room[: block.stored]


def _inflated(data: memoryview, block: _Block) -> memoryview | bytes | bytearray:
    return data if block.kind == _PLAIN else inflated(data, block.size)


def inflated(data: bytes | memoryview, size: int) -> bytes | bytearray:
    """A deflated block, whose checksum is right, of at most so many bytes; it may be shorter.

    Raises
    ------
    OSError, zlib.error, deflate.DeflateError
        If it is damaged or would be longer.
    """
    if _libdeflate is not None:
        found: bytearray = _libdeflate(data, size)
        return found
    # no more than declared: a block that inflates without end is invalid; the checksum stands behind the last byte
    inflater = zlib.decompressobj()
    out = inflater.decompress(data, size)
    if not inflater.eof and (inflater.decompress(inflater.unconsumed_tail, 1) or not inflater.eof):
        raise OSError(f"a data block inflates to more than {size} bytes, or its end is missing")
    return out


def _fill(out: Raw, plan: _Plan, block: _Block, data: memoryview | bytes | bytearray) -> None:
    if len(data) != block.size:
        raise OSError(f"a data block inflates to {len(data)} bytes, not {block.size}")
    n = block.size // plan.size
    rows = slice(block.first, block.first + n)
    octets = np.frombuffer(data, dtype=np.uint8)
    is_transposed = block.kind == _TRANSPOSED
    planes = octets.reshape(plan.size, n) if is_transposed else octets.reshape(n, plan.size).T
    for i, f in plan.fields.items():
        here = out.samples[i][rows]
        if f.is_whole and not is_transposed:
            here[:] = np.ndarray((n,), f.dtype, data, f.at, (plan.size,))
        else:
            _gather(here, f, planes)
    for i, (at, bit) in plan.invalid.items():
        out.invalid[i][rows] = planes[at] >> bit & 1


def _gather(here: _Array, f: _Field, planes: NDArray[np.uint8]) -> None:
    """Samples out of the bytes of which they are made; `planes[k]` is byte k of each record."""
    width = f.dtype.itemsize
    into = here.view(np.uint8).reshape(-1, width)
    for k in range(f.octets):
        into[:, k] = planes[f.at + k]
    if not f.is_whole:
        # the highest bit to the top, then the lowest to the bottom: spreads the sign, and whatever lay above is gone
        here <<= 8 * width - f.shift - f.bits
        here >>= 8 * width - f.bits
