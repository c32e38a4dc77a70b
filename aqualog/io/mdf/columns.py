"""Read raw samples of a group of records straight from its data blocks.

Blocks are read, unpacked and cut into columns without a copy of whole records. Of a transposed block only the bytes of
the wanted channels are touched. Records of several kinds in a row are sorted into a file of our own first, where each
kind is read like any other.
"""

from __future__ import annotations

import os
import zlib
from array import array
from collections import defaultdict, deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aqualog.core.records import BoolArray
from aqualog.io.mdf.blocks import Field, Group, Stored
from aqualog.io.messages.batches import rows_of

try:
    from deflate import zlib_decompress as _libdeflate  # comes along with another library where it can
except ImportError:
    _libdeflate = None

__all__ = [
    "Kind", "Raw", "damaged_blocks", "is_sound_field", "raw_pieces", "sorted_groups", "unpacked_blocks",
]  # fmt: skip

_LARGEST_BLOCK = 1 << 28  # [bytes] stored or unpacked; the standard allows 4 MiB
_PIECE = 5 << 20  # [bytes] read at a time where nothing is packed: in the cache when it is cut; a room of huge pages
_WHOLE_BITS = {"u": (8, 16, 32, 64), "i": (8, 16, 32, 64), "f": (16, 32, 64)}

_Array = NDArray[Any]
_Bytes = memoryview | bytes | bytearray


class Raw(NamedTuple):
    """Raw samples by channel, and which of them are invalid, for channels with an invalidation bit.

    `first` is the number of the first record, `records` how many there are.
    """

    samples: dict[int, _Array]
    invalid: dict[int, BoolArray]
    first: int
    records: int


class _Block(NamedTuple):
    """Whole records: where their stored bytes are, and the first record. More than one part only if none is packed."""

    parts: tuple[Stored, ...]
    size: int
    first: int


class _Plan(NamedTuple):
    """Fields of the wanted channels, places of invalidation bits (byte, bit), blocks, size of a record. [bytes]"""

    fields: Mapping[int, Field]
    floats: Sequence[int]  # channels whose samples become float64 as they are taken out
    invalid: Mapping[int, tuple[int, int]]
    blocks: Sequence[_Block]
    size: int


def is_sound_field(field: Field, size: int) -> bool:
    """Whether a channel lies inside a record of this size and is a number that can be read there. [bytes]"""
    if not (size > 0 and field.bits > 0 and field.at >= 0 and field.at + field.octets <= size):
        return False
    if field.letter == "V":
        return True
    if field.letter == "f":
        return not field.shift and field.bits in _WHOLE_BITS["f"]
    return field.octets <= 8


def raw_pieces(
    path: Path, group: Group, wanted: Sequence[int], records: int, floats: Collection[int] = ()
) -> Iterator[Raw]:
    """Raw samples of channels of a group, none of them virtual, in pieces of whole blocks, in order.

    `records`: least number of records of a piece but for the last one. `floats`: channels whose numbers become float64
    at once, so that their raw samples take no memory.

    Raises
    ------
    OSError, zlib.error, ...
        If a block cannot be read or unpacked to the size that it declares.
    """
    size = group.record
    if not 0 < size <= _LARGEST_BLOCK:
        return
    fields = {i: group.channels[i].field for i in wanted}
    bits = {i: b for i in wanted if (b := group.channels[i].invalidation_bit) is not None}
    invalid = {i: (group.size + b // 8, b % 8) for i, b in bits.items()}
    floats = [i for i in fields if i in floats]
    blocks = None if group.invalid_data else _blocks(group.data, size, group.cycles)
    if blocks is None:
        yield from _streamed(path, _Plan(fields, floats, invalid, (), size), group, records)
        return
    plan = _Plan(fields, floats, invalid, blocks, size)
    for run in _runs(blocks, size, records):
        raw = _decoded(path, plan, run)
        count = group.cycles - raw.first
        if count < raw.records:
            cut = {i: x[:count] for i, x in raw.samples.items()}
            raw = Raw(cut, {i: x[:count] for i, x in raw.invalid.items()}, raw.first, count)
        yield raw


def unpacked_blocks(path: Path, blocks: Iterable[Stored]) -> Iterator[_Bytes]:
    """Content of blocks in turn, no longer transposed; of a plain one in pieces."""
    with path.open("rb", buffering=0) as file:
        for block in blocks:
            step = block.size if block.packing else _PIECE
            for at in range(0, max(block.size, 1), step or 1):
                size = min(step, block.size - at)
                part = block if block.packing else Stored(block.address + at, size, size)
                data = _unpacked(_stored(file, (part,), np.empty(part.size, dtype=np.uint8).data), part)
                if len(data) != part.unpacked:
                    raise OSError(f"a data block inflates to {len(data)} bytes, not {part.unpacked}")
                yield _turned_back(data, part.columns) if part.columns else data


def damaged_blocks(path: Path, blocks: Mapping[int, Stored]) -> frozenset[int]:
    """Return the addresses of the packed blocks that do not unpack to the size that they declare.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    found = set()
    with path.open("rb") as file:
        for at, block in blocks.items():
            file.seek(block.address)
            data = memoryview(file.read(block.size))
            try:
                is_right = len(_unpacked(data, block)) == block.unpacked
            except Exception:  # what its library raises is of no one kind
                is_right = False
            if not is_right:
                found.add(at)
    return frozenset(found)


# --- what lies where ---


def _blocks(stored: Sequence[Stored], size: int, cycles: int) -> list[_Block] | None:
    """Blocks of whole records, up to the declared number of them; None if a packed one ends inside a record."""
    out: list[_Block] = []
    done = 0  # records
    plain: list[Stored] = []  # stored one behind the other; a record may begin in one and end in the next
    for block in stored:
        if not block.packing:
            plain.append(block)
            continue
        if block.unpacked % size or max(block.unpacked, block.size) > _LARGEST_BLOCK:
            return None
        if block.columns not in (0, size) or sum(s.size for s in plain) % size:
            return None
        done = _put_plain(out, plain, size, done)
        out.append(_Block((block,), block.unpacked, done))
        done += block.unpacked // size
    _put_plain(out, plain, size, done)
    return [b for b in out if b.first < cycles]


def _put_plain(out: list[_Block], plain: list[Stored], size: int, done: int) -> int:
    """Cut consecutive stored bytes into pieces of whole records behind `done` ones, and forget them.

    An incomplete record is left out. Returns how many there are now.
    """
    left = sum(s.size for s in plain) // size * size
    piece = max(_PIECE // size, 1) * size
    parts: list[Stored] = []
    missing = min(piece, left)
    for address, length in ((s.address, s.size) for s in plain):
        while length and missing:
            taken = min(length, missing)
            parts.append(Stored(address, taken, taken))
            address, length, missing, left = address + taken, length - taken, missing - taken, left - taken
            if not missing:
                out.append(_Block(tuple(parts), sum(p.size for p in parts), done))
                done += out[-1].size // size
                parts, missing = [], min(piece, left)
    plain.clear()
    return done


def _runs(blocks: Sequence[_Block], size: int, records: int) -> Iterator[list[_Block]]:
    run: list[_Block] = []
    for block in blocks:
        run.append(block)
        if block.first - run[0].first + block.size // size >= records:
            yield run
            run = []
    if run:
        yield run


# --- from bytes to columns ---


def _decoded(path: Path, plan: _Plan, blocks: Sequence[_Block]) -> Raw:
    begin = blocks[0].first
    out = _empty(plan, begin, sum(b.size for b in blocks) // plan.size)
    pending = deque(blocks)
    longest = max(sum(p.size for p in b.parts) for b in blocks)

    @np.errstate(all="ignore")  # as where it was called: a thread has a state of its own
    def work() -> None:
        # one room for all blocks: pages of memory that are fresh for each cost as much as reading them
        room = np.empty(longest, dtype=np.uint8).data
        in_room = None if all(b.parts[0].packing for b in blocks) else _views(plan, room)
        try:
            with path.open("rb", buffering=0) as file:
                while pending:
                    try:
                        block = pending.popleft()
                    except IndexError:  # another thread took the last one
                        return
                    kind = block.parts[0]
                    data = _unpacked(_stored(file, block.parts, room), kind)
                    if len(data) != block.size:
                        raise OSError(f"a data block inflates to {len(data)} bytes, not {block.size}")
                    views = None if kind.packing else in_room
                    _fill(out, plan, block.first - begin, data, is_transposed=kind.columns > 0, views=views)
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


def _streamed(path: Path, plan: _Plan, group: Group, records: int) -> Iterator[Raw]:
    """Pieces of records that begin in one block and end in another, or whose invalidation bits are stored apart."""
    streams = [(plan.size, unpacked_blocks(path, group.data))]
    if group.invalid_data:
        bits = group.invalidation, unpacked_blocks(path, group.invalid_data)
        streams = [(group.size, streams[0][1]), bits]
    done = 0
    waiting = [bytearray() for _ in streams]
    is_more = True
    while is_more and done < group.cycles:
        is_more = False
        for held, (size, stream) in zip(waiting, streams, strict=True):
            while len(held) < size * min(records, max(_PIECE // size, 1)) and (data := next(stream, None)) is not None:
                held += data
                is_more = True
        n = min(*(len(h) // s for h, (s, _) in zip(waiting, streams, strict=True)), group.cycles - done)
        if not n:
            continue
        parts = [
            np.frombuffer(bytes(h[: n * s]), np.uint8).reshape(n, s) for h, (s, _) in zip(waiting, streams, strict=True)
        ]
        for held, (size, _) in zip(waiting, streams, strict=True):
            del held[: n * size]
        raw = _empty(plan, done, n)
        _fill(raw, plan, 0, np.hstack(parts).tobytes(), is_transposed=False)
        yield raw
        done += n


def _empty(plan: _Plan, first: int, count: int) -> Raw:
    samples: dict[int, _Array] = {
        i: np.empty((count, f.octets) if f.letter == "V" else count, dtype=_dtype(f))
        for i, f in plan.fields.items()
        if i not in plan.floats
    }
    # one array for all of them, of huge pages where there are many: most of the time would be spent on small ones
    samples |= zip(plan.floats, np.empty((len(plan.floats), count)), strict=True)
    return Raw(samples, {i: np.empty(count, dtype=np.bool_) for i in plan.invalid}, first, count)


def _dtype(field: Field) -> np.dtype[Any]:
    if field.letter == "V":
        return np.dtype(np.uint8)
    order = ">" if field.is_big_endian and _is_whole(field) else "<"
    return np.dtype(f"{order}{field.letter}{1 << (field.octets - 1).bit_length()}")


def _is_whole(field: Field) -> bool:
    """Whether NumPy has the type as it stands."""
    return not field.shift and field.bits in _WHOLE_BITS.get(field.letter, ())


def _threads() -> int:
    """As many as polars has: one in a worker of a batch."""
    given = os.environ.get("POLARS_MAX_THREADS", "")
    return int(given) if given.isdigit() and int(given) > 0 else min(os.cpu_count() or 1, 4)


def _stored(file: BinaryIO, parts: Sequence[Stored], room: memoryview) -> memoryview:
    """Stored bytes as they are in the file; they stand in `room`."""
    at = 0
    for part in parts:
        file.seek(part.address)
        end = at + part.size
        while at < end:
            read = file.readinto(room[at:end])  # type: ignore[attr-defined]
            if not read:
                raise OSError(f"{end - at} of {part.size} bytes of a data block are not there")
            at += read
    return room[:at]


def _unpacked(data: memoryview, block: Stored) -> _Bytes:
    """A packed block, no more of it than it declares; of the ways without a checksum exactly that much."""
    if not block.packing:
        return data
    if block.packing == "deflate":
        return _inflated(data, block.unpacked)
    if block.packing == "lz4":
        import lz4.frame

        out: bytes = lz4.frame.LZ4FrameDecompressor().decompress(bytes(data), max_length=block.unpacked + 1)
    else:
        import zstandard

        out = zstandard.ZstdDecompressor().stream_reader(bytes(data)).read(block.unpacked + 1)
    if len(out) != block.unpacked:
        raise ValueError(f"a data block inflates to another size than the {block.unpacked} bytes that it declares")
    return out


def _inflated(data: bytes | memoryview, size: int) -> bytes | bytearray:
    """A deflated block, whose checksum is right, of at most so many bytes; it may be shorter."""
    if _libdeflate is not None:
        found: bytearray = _libdeflate(data, size)
        return found
    # no more than declared: a block that inflates without end is invalid; the checksum stands behind the last byte
    inflater = zlib.decompressobj()
    out = inflater.decompress(data, size)
    if not inflater.eof and (inflater.decompress(inflater.unconsumed_tail, 1) or not inflater.eof):
        raise OSError(f"a data block inflates to more than {size} bytes, or its end is missing")
    return out


def _turned_back(data: _Bytes, columns: int) -> bytes:
    """Records of a transposed block; what is behind the last whole one was not turned round."""
    whole = len(data) // columns * columns
    octets = np.frombuffer(data, dtype=np.uint8)
    return octets[:whole].reshape(columns, -1).T.tobytes() + octets[whole:].tobytes()


def _views(plan: _Plan, data: _Bytes) -> dict[int, _Array]:
    """Samples where they stand in whole records, of the channels whose type NumPy has."""
    n = len(data) // plan.size
    return {i: np.ndarray((n,), _dtype(f), data, f.at, (plan.size,)) for i, f in plan.fields.items() if _is_whole(f)}


def _fill(
    out: Raw, plan: _Plan, first: int, data: _Bytes, *, is_transposed: bool, views: dict[int, _Array] | None = None
) -> None:
    """Put the samples of a block at their place; `views` as `_views` has them, if they are known."""
    n = len(data) // plan.size
    if views is None:
        views = {} if is_transposed else _views(plan, data)
    rows = slice(first, first + n)
    octets = np.frombuffer(data, dtype=np.uint8)
    planes = octets.reshape(plan.size, n) if is_transposed else octets.reshape(n, plan.size).T
    for i, f in plan.fields.items():
        if i in views:
            out.samples[i][rows] = views[i][:n]
        elif f.letter == "V":
            out.samples[i][rows] = planes[f.at : f.at + f.octets].T
        else:
            out.samples[i][rows] = _gathered(f, planes)
    for i, (at, bit) in plan.invalid.items():
        out.invalid[i][rows] = planes[at] >> bit & 1


def _gathered(f: Field, planes: NDArray[np.uint8]) -> _Array:
    """Samples out of the bytes of which they are made; `planes[k]` is byte k of each record."""
    width = _dtype(f).itemsize
    here = np.empty(planes.shape[1], _dtype(f))
    into = here.view(np.uint8).reshape(-1, width)
    is_turned = f.is_big_endian and not _is_whole(f)  # what is no whole number of bytes is made little-endian
    for k in range(f.octets):
        into[:, k] = planes[f.at + (f.octets - 1 - k if is_turned else k)]
    if not _is_whole(f):
        # the highest bit to the top, then the lowest to the bottom: spreads the sign, and whatever lay above is gone
        here <<= 8 * width - f.shift - f.bits
        here >>= 8 * width - f.bits
    return here


# --- records of several kinds in a row ---


class Kind(NamedTuple):
    """What was sorted of a group: where it is now, how many records or values, and their bytes without ids."""

    stored: tuple[Stored, ...]
    records: int
    size: int


def sorted_groups(path: Path, groups: Sequence[Group], into: BinaryIO) -> list[tuple[Group, Kind]]:
    """Sort the records of all groups of a data group of the log `path` to the end of a binary file.

    What follows a record of no known kind is left out.

    Raises
    ------
    OSError, zlib.error, ...
        If a block cannot be read or unpacked.
    """
    sizes = {g.record_id: -1 if g.is_variable else g.record + g.behind for g in groups}
    taken = {g.record_id: g.record for g in groups}
    id_size = groups[0].id_size
    stored: dict[int, list[Stored]] = defaultdict(list)
    counts: dict[int, int] = defaultdict(int)
    rest = b""
    for block in unpacked_blocks(path, groups[0].data):
        data = rest + bytes(block)
        starts, end, is_known = _starts(data, sizes, id_size)
        ids = np.zeros(len(starts), dtype=np.uint64)
        for k in range(id_size):
            ids |= np.frombuffer(data, dtype=np.uint8)[starts + k].astype(np.uint64) << np.uint64(8 * k)
        for kind, size in sizes.items():
            at = starts[ids == kind] + id_size
            if not at.size:
                continue
            counts[kind] += at.size
            if size < 0:
                rows = b"".join(data[a : a + 4 + int.from_bytes(data[a : a + 4], "little")] for a in at.tolist())
            else:
                rows = rows_of(data, at, taken[kind]).tobytes() if taken[kind] else b""
            stored[kind].append(Stored(into.tell(), len(rows), len(rows)))
            into.write(rows)
        if not is_known:
            break
        rest = data[end:]
    into.flush()
    kinds = {k: Kind(tuple(stored[k]), counts[k], sum(s.size for s in stored[k])) for k in sizes}
    return [(replace(g, data=kinds[g.record_id].stored), kinds[g.record_id]) for g in groups]


def _starts(data: bytes, sizes: Mapping[int, int], id_size: int) -> tuple[NDArray[np.int64], int, bool]:
    """Where the whole records begin with their ids; where the last one ends; whether all kinds are known.

    A size below 0 is that of values of variable length, each behind its length in 4 bytes.
    """
    steps = {kind: id_size + size if size >= 0 else 0 for kind, size in sizes.items()}
    found = array("q")
    add, at, size, is_known = found.append, 0, len(data), True
    try:
        while at <= size - id_size:  # what stands here is paid for each record of a log
            step = steps[data[at] if id_size == 1 else int.from_bytes(data[at : at + id_size], "little")]
            if not step:
                head = data[at + id_size : at + id_size + 4]
                step = id_size + 4 + int.from_bytes(head, "little") if len(head) == 4 else size + 1
            add(at)
            at += step
    except KeyError:
        is_known = False
    if at > size:  # the last one goes on in the next block
        at = found.pop()
    return np.array(found, dtype=np.int64), at, is_known
