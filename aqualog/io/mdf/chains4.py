"""Chains of data blocks of MDF 4: what there is of them, in the order in which they are read."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Any, Literal

from aqualog.io.mdf.records import Stored
from aqualog.io.mdf.walk import BlockError, Walk

__all__ = ["HEAD", "Block", "BlockWalk", "Chain"]

HEAD = 24
"""Bytes of every block before its links."""
_HEAD_OF = struct.Struct("<4s4xQQ")
_LAST_DT, _LAST_DL = 0x4, 0x10  # what an unfinished file has not been given
_PLAIN = (b"DT", b"DV", b"SD", b"DI", b"RD", b"RV", b"RI")
_ZEROS_AT_ONCE = 1 << 20
_DL_EQUAL, _LD_INVALIDATION = 0x1, 0x80
_PACKINGS: tuple[Literal["deflate", "zstd", "lz4"], ...] = ("deflate", "zstd", "lz4")  # odd kinds are turned round too


@dataclass(frozen=True, slots=True)
class Block:
    """Where a block is, its length, its links, and where its data begin. [bytes]"""

    kind: str
    at: int
    length: int
    links: tuple[int, ...]
    data: int


@dataclass(slots=True)
class Chain:
    """Data blocks, those of invalidation bits beside them, and what is missing.

    `inflated` is what they take, `largest` the largest packed block, `zeros` the zeros at the end of a file that was
    still being written. [bytes]
    """

    blocks: list[Stored] = field(default_factory=list)
    invalid: list[Stored] = field(default_factory=list)
    inflated: int = 0
    largest: int = 0
    zeros: int = 0
    broken: BlockError | None = None


class BlockWalk(Walk):
    """Blocks of MDF 4, and chains of those that hold data. `unfinished` are the flags of an unfinished file."""

    unfinished = 0
    damaged: frozenset[int] = frozenset()

    def _block(self, at: int, kind: bytes, links: int, length: int) -> Block:
        """A block of this kind with at least so many links and bytes, inside the file."""
        name = kind.decode()
        size, count = self._block_head(name, at, _HEAD_OF, b"##" + kind)
        if size < max(length, HEAD) or count < links or count > (size - HEAD) // 8:
            raise BlockError(name, at, f"is damaged, it has {size} bytes and {count} links")
        self._seen(name, at, size)
        return Block(name, at, size, struct.unpack_from(f"<{count}Q", self._data, at + HEAD), at + HEAD + 8 * count)

    def _once(self, block: Block) -> Block:
        """The same, of which there must be one link only."""
        self._link_once(block.kind, block.at)
        return block

    def _mark(self, at: int) -> bytes:
        if at + HEAD > self._size:
            raise BlockError("data", at, f"is missing, the file ends at byte {self._size}", is_cut=True)
        mark: bytes = self._data[at : at + 4]
        return mark[2:] if mark[:2] == b"##" else b""

    def _numbers(self, layout: str, at: int) -> tuple[Any, ...]:
        return struct.unpack_from(layout, self._data, at)

    def _chain(self, at: int, record: int, *, is_last: bool = False) -> Chain:
        """Follow a link to data. A plain block ends with a whole record."""
        out = Chain()
        try:
            mark = self._mark(at) if at else b""
            if mark == b"HL":
                at = self._once(self._block(at, b"HL", 1, 40)).links[0]
                mark = self._mark(at) if at else b""
            if mark == b"DL":
                self._list(at, out, is_last=is_last)
            elif mark == b"LD":
                self._column_list(at, out)
            elif at:
                self._add(at, out, record, is_end=is_last)
        except BlockError as broken:
            out.broken = broken
            out.blocks, out.invalid, out.inflated = [], [], 0
        return out

    def _list(self, at: int, out: Chain, *, is_last: bool) -> None:
        seen: set[int] = set()  # one small block, listed again and again, would unpack to more than any disk holds
        while at:
            try:
                block = self._once(self._block(at, b"DL", 1, 40))
                flags, count = self._numbers("<B3xI", block.data)
                behind = 8 if flags & _DL_EQUAL else 8 * (len(block.links) - 1)
                if count > len(block.links) - 1 or block.data + 8 + behind > at + block.length:
                    raise BlockError("DL", at, f"is damaged, it has {len(block.links)} links and {count} blocks")
            except BlockError as broken:
                out.broken = broken
                return
            is_end = is_last and not block.links[0]
            for index, link in enumerate(block.links[1 : 1 + count]):
                if not link and is_end and self.unfinished & _LAST_DL:
                    self._unlinked(block, index, count, out)
                    return
                try:
                    if not link:
                        raise BlockError("DT", 0, f"has no address, number {index + 1} of the list at byte {at}")
                    if link in seen:
                        raise BlockError("data", link, "is linked twice")
                    seen.add(link)
                    is_last_block = is_end and (index == count - 1 or not block.links[2 + index])
                    self._add(link, out, 1, is_end=is_last_block)
                except BlockError as broken:
                    out.broken = broken
                if out.broken is not None:
                    return
            at = block.links[0]

    def _unlinked(self, block: Block, done: int, count: int, out: Chain) -> None:
        """Data blocks behind the last list of an unfinished file, which the list does not link yet."""
        at = block.links[done] if done else block.at
        for index in range(done, count):
            length = self._numbers("<Q", at + 8)[0] if at + HEAD <= self._size else self._size
            at = -(-(at + length) // 8) * 8
            if at + HEAD > self._size or self._data[at + 2 : at + 4] not in (b"DT", b"DZ", b"DV"):
                return
            self._add(at, out, 1, is_end=index == count - 1)
            if out.broken is not None:
                return

    def _column_list(self, at: int, out: Chain) -> None:
        seen: set[int] = set()
        while at:
            block = self._once(self._block(at, b"LD", 1, 40))
            flags, count = self._numbers("<4BI", block.data)[3:]
            if count > len(block.links) - 1:
                raise BlockError("LD", at, f"is damaged, it has {len(block.links)} links and {count} blocks")
            for index, link in enumerate(block.links[1:]):
                if link in seen:
                    raise BlockError("data", link, "is linked twice")
                if link:
                    seen.add(link)
                    before = len(out.blocks)
                    self._add(link, out, 1, is_end=False)
                    if flags & _LD_INVALIDATION and index >= count:
                        out.invalid += out.blocks[before:]
                        del out.blocks[before:]
                    if out.broken is not None:
                        raise out.broken
            at = block.links[0]

    def _add(self, at: int, out: Chain, record: int, *, is_end: bool) -> None:
        """One block of data. What is there of a plain one that the file ends in is kept."""
        mark = self._mark(at)
        if mark == b"DZ":
            self._packed(at, out)
            return
        if mark not in _PLAIN:
            raise BlockError("data", at, f"is not there, the file holds {self._data[at : at + 4]!r}")
        length = self._numbers("<Q", at + 8)[0]
        if is_end and self.unfinished & _LAST_DT:
            length = self._open_end(at, length)
        if length < HEAD:
            raise BlockError(mark.decode(), at, f"is damaged, it has {length} bytes")
        if at + length > self._size:
            left = (self._size - at - HEAD) // record * record
            why = f"is incomplete, the file ends at byte {self._size} and {at + length - self._size} bytes are missing"
            out.broken = BlockError(mark.decode(), at, why, is_cut=True)
            length = HEAD + left
        out.inflated += length - HEAD
        out.blocks.append(Stored(at + HEAD, length - HEAD, length - HEAD))
        if self.unfinished and at + length == self._size:
            out.zeros = self._zeros(at + HEAD)

    def _zeros(self, begin: int) -> int:
        """Zero bytes at the end of the file, of those from a place on."""
        end = self._size
        while end > begin:
            block = bytes(self._data[max(begin, end - _ZEROS_AT_ONCE) : end])
            left = len(block.rstrip(b"\0"))
            end -= len(block) - left
            if left:
                break
        return self._size - end

    def _open_end(self, at: int, length: int) -> int:
        """Length of a block that was still being written: to the next block, or to the end of the file."""
        end = min((b for b in self._begins if b > at), default=self._size)
        is_right = HEAD < length <= end - at and end < self._size
        return length if is_right else end - at

    def _packed(self, at: int, out: Chain) -> None:
        if at + 48 > self._size:
            raise BlockError("DZ", at, f"is incomplete, the file ends at byte {self._size}", is_cut=True)
        length = self._numbers("<Q", at + 8)[0]
        kind, width, unpacked, size = self._numbers("<B1xIQQ", at + 26)
        if kind // 2 >= len(_PACKINGS) or size > max(length, 48) - 48 or (kind % 2 and unpacked and not width):
            raise BlockError("DZ", at, f"is damaged, it has {length} bytes for {size} of data of type {kind}")
        if at + 48 + size > self._size:
            raise BlockError("DZ", at, f"is incomplete, the file ends at byte {self._size}", is_cut=True)
        if at in self.damaged:
            raise BlockError("DZ", at, "is damaged, or not of the size that it declares")
        self._found.deflated.append(at)
        out.inflated += unpacked
        out.largest = max(out.largest, unpacked)
        out.blocks.append(Stored(at + 48, size, unpacked, _PACKINGS[kind // 2], width if kind % 2 else 0))
