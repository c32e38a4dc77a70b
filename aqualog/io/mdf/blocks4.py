"""Blocks of MDF 4 and what they say of others: chains of data, texts, sources and conversions."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from aqualog.core.errors import LogError
from aqualog.guard.system import bytes_text
from aqualog.io.mdf.blocks import BlockError, Conversion, ConversionKind, Stored, Walk

__all__ = ["HEAD", "Block", "BlockWalk", "Chain"]


HEAD = 24
"""Bytes of every block before its links."""
_HEAD_OF = struct.Struct("<4s4xQQ")
_LAST_DT, _LAST_DL = 0x4, 0x10  # what an unfinished file has not been given
_PLAIN = (b"DT", b"DV", b"SD", b"DI", b"RD", b"RV", b"RI")
_ZEROS_AT_ONCE = 1 << 20
_DL_EQUAL, _LD_INVALIDATION = 0x1, 0x80
_PACKINGS: tuple[Literal["deflate", "zstd", "lz4"], ...] = ("deflate", "zstd", "lz4")  # odd kinds are turned round too
_LARGEST_TEXT = 1 << 24
_MOST_TEXT = 1 << 28  # [bytes] of all texts together, as often as they are linked
_ENCODING_SAMPLE = 512  # [bytes] of a text by which its encoding is guessed; all of it would take minutes
_DEEPEST = 16  # conversions in conversions
_MOST_CONVERSIONS = 10_000  # that one channel leads to
_RANGES, _ALGEBRAIC = 8, 3  # types of conversions
_CONVERSIONS: tuple[ConversionKind, ...] = (
    "same", "linear", "rational", "formula", "interpolated", "nearest", "ranges", "texts", "texts of ranges",
    "from text", "from text", "same",
)  # fmt: skip


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
    """A walk that knows the texts and conversions it has seen, and why channels are refused, by address.

    `unfinished` are the flags of an unfinished file, `damaged` packed blocks that are known not to unpack.
    """

    def __init__(self, data: Any, path: Path, damaged: frozenset[int] = frozenset()) -> None:
        super().__init__(data, path)
        self.unfinished, self.damaged = 0, damaged
        self._refused: dict[int, str] = {}
        self._sizes: dict[int, int] = {}  # of texts
        self._decoded: dict[int, str] = {}
        self._text_bytes = 0

    def _block(self, at: int, kind: bytes, links: int, length: int) -> Block:
        """A block of this kind with at least so many links and bytes, inside the file."""
        name = kind.decode()
        size, count = self._block_head(name, at, _HEAD_OF, b"##" + kind)
        if size < max(length, HEAD) or count < links or count > (size - HEAD) // 8:
            raise BlockError(name, at, f"is damaged, it has {size} bytes and {count} links")
        self._seen(name, at, size)
        return Block(name, at, size, struct.unpack_from(f"<{count}Q", self._data, at + HEAD), at + HEAD + 8 * count)

    def _once(self, block: Block) -> Block:
        self._link_once(block.kind, block.at)
        return block

    def _mark(self, at: int) -> bytes:
        if at + HEAD > self._size:
            raise BlockError("data", at, f"is missing, the file ends at byte {self._size}", is_cut=True)
        mark: bytes = self._data[at : at + 4]
        return mark[2:] if mark[:2] == b"##" else b""

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
        if is_end and self.unfinished & _LAST_DT:  # it was still being written: to the next block, or to the file's end
            end = min((b for b in self._begins if b > at), default=self._size)
            length = length if HEAD < length <= end - at and end < self._size else end - at
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
        out.inflated += unpacked
        out.largest = max(out.largest, unpacked)
        out.blocks.append(Stored(at + 48, size, unpacked, _PACKINGS[kind // 2], width if kind % 2 else 0))
        self._found.packed[at] = out.blocks[-1]

    # --- texts, sources, conversions ---

    def _described(self, block: Block, index: int, what: str) -> BlockError | None:
        """Look at the text that a link leads to; one that is damaged or without measure is not followed."""
        at = block.links[index]
        if not at:
            return None
        if at in self._sizes:
            size = self._sizes[at]
        else:
            try:
                mark = self._mark(at)
                if mark not in (b"TX", b"MD"):
                    raise BlockError("TX", at, "is no text block")
                size = self._block(at, mark, 0, HEAD).length
                if size > _LARGEST_TEXT:
                    raise BlockError(mark.decode(), at, f"has {bytes_text(size)} of text")
            except BlockError as broken:
                self._found.remark(f"{what} is left out: {broken}")
                self._found.truncated |= broken.is_cut
                return broken
            self._sizes[at] = size
        self._text_bytes += size
        if self._text_bytes > _MOST_TEXT:
            raise LogError(
                f"its names and comments take more than {bytes_text(_MOST_TEXT)} as often as they are linked",
                where=str(self._path), hint="check it with the logger's own tool",
            )  # fmt: skip
        return None

    def _text(self, at: int) -> str:
        """The text at a place, which `_described` has found sound; empty for any other."""
        if at not in self._sizes:
            return ""
        if at not in self._decoded:
            raw = bytes(self._data[at + HEAD : at + self._sizes[at]]).split(b"\0", 1)[0].strip(b" \r\t\n")
            try:
                self._decoded[at] = raw.decode("utf-8")
            except UnicodeDecodeError:
                from charset_normalizer import from_bytes

                best = from_bytes(raw[:_ENCODING_SAMPLE]).best()
                self._decoded[at] = raw.decode("latin-1" if best is None else best.encoding, "ignore")
        return self._decoded[at]

    def _source(self, block: Block, index: int) -> tuple[str, ...]:
        """Name and path of a source; nothing without one."""
        at = block.links[index]
        if not at:
            return ()
        try:
            source = self._block(at, b"SI", 3, 56)
        except BlockError as broken:
            self._found.remark(f"the description of a source is left out: {broken}")
            return ()
        for text in range(3):
            self._described(source, text, "the name of a source")
        return self._text(source.links[0]), self._text(source.links[1])

    def _conversion(self, at: int, depth: int = 0, budget: list[int] | None = None) -> Conversion:
        budget = [_MOST_CONVERSIONS] if budget is None else budget
        block = self._block(at, b"CC", 4, HEAD + 32 + 24)
        budget[0] -= 1
        if depth > _DEEPEST or budget[0] < 0:
            raise BlockError("CC", at, "leads to conversions without end")
        kind, numbers = self._conversion_numbers(block)
        if self._described(block, 1, f"the unit of the conversion at byte {at}") is not None:
            raise BlockError("CC", at, "has lost its unit")
        for link in (0, 2):
            self._described(block, link, f"a text of the conversion at byte {at}")
        if kind == _RANGES and any(a and self._mark(a) == b"CC" for a in block.links[4:]):
            ranges = list(zip(numbers[::2], numbers[1::2], strict=True))
            if len(set(ranges)) < len(ranges):
                raise BlockError("CC", at, "is damaged, it has a range twice")
        references: list[Conversion | bytes | None] = []
        for index in range(4, len(block.links)):
            link = block.links[index]
            if not link:
                references.append(None)
            elif self._mark(link) == b"CC" and kind != _ALGEBRAIC:
                references.append(self._conversion(link, depth + 1, budget))
            elif self._described(block, index, f"a text of the conversion at byte {at}") is not None:
                raise BlockError("CC", at, "has lost one of its texts")
            else:
                references.append(b"")
        formula = self._text(block.links[4]) if kind == _ALGEBRAIC else ""
        return Conversion(_CONVERSIONS[kind], self._text(block.links[1]), numbers, tuple(references), formula)

    def _conversion_numbers(self, block: Block) -> tuple[int, tuple[float, ...]]:
        """Type of a conversion and its numbers, of which there must be as many as its type needs."""
        if block.data + 24 > block.at + block.length:
            raise BlockError("CC", block.at, f"is damaged, it has {len(block.links)} links")
        kind, references, count = self._numbers("<B3xHH", block.data)
        if len(block.links) != 4 + references or block.data + 24 + 8 * count > block.at + block.length:
            what = f"is damaged, it has {len(block.links)} links for {references} references"
            raise BlockError("CC", block.at, what)
        is_whole = {
            0: True, 1: count == 2, 2: count == 6, 3: references == 1, 4: count >= 2 and count % 2 == 0,
            5: count >= 2 and count % 2 == 0, 6: count % 3 == 1, 7: references == count + 1,
            8: 2 * (references - 1) == count, 9: count == references + 1, 10: references % 2 == 1,
            11: references == count,
        }.get(kind)  # fmt: skip
        if not is_whole:
            what = f"is damaged, type {kind} has {count} numbers and {references} references"
            raise BlockError("CC", block.at, what)
        return kind, self._numbers(f"<{count}d", block.data + 24)
