"""Walk through the blocks of MDF 4: ID, HD, then DG, CG, CN with their conversions and texts, and the data chains.

asammdf follows addresses and trusts sizes. A link to itself never ends, a conversion that it cannot read leaves raw
numbers, and a list of data blocks beyond the end of the file ends the whole reading. This walk checks each of them
first. It also finishes a recording that its logger left unfinished, without a copy of it.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from aqualog.core.errors import LogError
from aqualog.io.mdf_survey import BlockError, Survey, Walk
from aqualog.io.memory import bytes_text

__all__ = ["LARGEST_BLOCK", "survey4"]

LARGEST_BLOCK = 1 << 28  # [bytes] inflated; the standard allows 4 MiB
_LARGEST_UNSORTED = 1 << 25  # [bytes] every record of such a block becomes an object
_LARGEST_TEXT = 1 << 24
_MOST_TEXT = 1 << 28  # [bytes] of all texts together, as often as they are linked
_LONGEST_RECORD = 1 << 30
_MOST_CYCLES = 1 << 40
_MOST_PACKED = 100_000  # records, of a byte at least, that a byte of a file may stand for, however well it is packed
_DEEPEST = 16  # conversions in conversions, channels in channels
_MOST_CONVERSIONS = 10_000  # that one channel leads to
_MOST_ELEMENTS = 1_000_000  # of an array
_HEAD, _HD = 24, 64
_HEAD_OF = struct.Struct("<4s4xQQ")
_FLAGS_AT = 60
_COUNTERS, _LAST_DT, _LAST_DL, _VLSD_OFFSETS = 0x1, 0x4, 0x10, 0x40  # what an unfinished file has not been given
_CG_FORMS = ((104, 6), (112, 7))
_CN_FORMS = {160: 8, 168: 9}
_PLAIN = (b"DT", b"DV", b"SD", b"DI", b"RD", b"RV", b"RI")
_CG_VLSD, _CG_REMOTE_MASTER = 0x1, 0x8
_ZEROS_AT_ONCE = 1 << 20
_CN_INVALIDATION = 0x3
_CN_SOME_INVALID = 0x2
_VIRTUAL = (3, 6)  # types of channels without bytes in the record
_RANGES = 8  # type of a conversion
_INTEGERS, _REALS, _COMPLEX = (0, 1, 2, 3), (4, 5), (15, 16)  # types of values
_REAL_BITS, _COMPLEX_BITS = (16, 32, 64), (64, 128)
_DL_EQUAL = 0x1
_KINDS_OF_DZ = range(6)
_ALGEBRAIC = 3


class _Block(NamedTuple):
    """Where a block is, its length, its links, and where its data begin. [bytes]"""

    kind: str
    at: int
    length: int
    links: tuple[int, ...]
    data: int

    def link_at(self, index: int) -> int:
        return self.at + _HEAD + 8 * index


@dataclass(slots=True)
class _Records:
    """A chain of data blocks: what it takes inflated, its largest deflated block, the zeros at the end of a file that
    was still being written [bytes], and what is missing.
    """

    inflated: int = 0
    largest: int = 0
    zeros: int = 0
    broken: BlockError | None = None


class _Group(NamedTuple):
    """What is needed of a channel group."""

    block: _Block
    record_id: int
    cycles: int
    flags: int
    data_bytes: int
    invalidation_bytes: int

    @property
    def record(self) -> int:
        return 0 if self.flags & _CG_VLSD else self.data_bytes + self.invalidation_bytes


def survey4(data: Any, path: Path, damaged: Collection[int] = ()) -> Survey:
    """Walk through a file.

    Parameters
    ----------
    data : buffer of bytes
        The file's content.
    path : Path
        For errors.
    damaged : collection of int
        Addresses of deflated blocks that are known not to inflate: their records end before them.

    Raises
    ------
    LogError
        If nothing of the file can be read, or a block would not fit into any memory.
    """
    return _Walk(data, path, frozenset(damaged)).run()


class _Walk(Walk):
    def __init__(self, data: Any, path: Path, damaged: frozenset[int]) -> None:
        super().__init__(data, path)
        self._damaged = damaged
        self._texts: dict[int, int] = {}
        self._text_bytes = 0
        self._unfinished = 0
        self._records: dict[int, _Records] = {}  # of groups that were gone through before the others
        self._extent, self._has_invalidation = 0, False  # what the channels of a group take of a record
        self._invalidation_bits = 0  # that records of the group have

    def run(self) -> Survey:
        self._identification()
        try:
            header = self._block(_HD, b"HD", 6, 24 + 48 + 24)
        except BlockError as broken:
            raise self._found.hopeless(self._path, broken) from broken
        self._side_branches(header)
        self._groups(header)
        return self._found

    # --- blocks ---

    def _block(self, at: int, kind: bytes, links: int, length: int) -> _Block:
        """A block of this kind with at least so many links and bytes, inside the file."""
        name = kind.decode()
        size, count = self._head(name, at, _HEAD_OF, b"##" + kind)
        if size < max(length, _HEAD) or count < links or count > (size - _HEAD) // 8:
            raise BlockError(name, at, f"is damaged, it has {size} bytes and {count} links")
        self._seen(name, at, size)
        return _Block(name, at, size, struct.unpack_from(f"<{count}Q", self._data, at + _HEAD), at + _HEAD + 8 * count)

    def _once(self, block: _Block) -> _Block:
        """The same, of which there must be one link only."""
        self._link_once(block.kind, block.at)
        return block

    def _mark(self, at: int) -> bytes:
        if at + _HEAD > self._size:
            raise BlockError("data", at, f"is missing, the file ends at byte {self._size}", is_cut=True)
        mark: bytes = self._data[at : at + 4]
        return mark[2:] if mark[:2] == b"##" else b""

    # --- what is no measurement ---

    def _identification(self) -> None:
        if self._size < _HD:
            broken = BlockError("HD", _HD, f"is missing, the file ends at byte {self._size}", is_cut=True)
            raise self._found.hopeless(self._path, broken)
        flags, own = struct.unpack_from("<HH", self._data, _FLAGS_AT)
        is_marked = self._data[:8] == b"UnFinMF "
        if not (is_marked or flags):
            return
        if flags & _VLSD_OFFSETS:
            raise LogError(
                "was not finalised: the places of values of variable length are not known", where=str(self._path),
                hint="finalise it with the logger's own tool",
            )  # fmt: skip
        self._unfinished = flags
        self._found.finalised = True
        self._found.patches[0] = b"MDF     "
        self._found.patch(_FLAGS_AT, "<H", 0)
        told = f" (flags of its own: {own:#x})" if own else ""
        self._found.notes.append(f"file was not finalised by the logger; aqualog completes it while reading{told}")

    def _side_branches(self, header: _Block) -> None:
        """Histories, hierarchies, attachments and events: a branch that is damaged is left out."""
        branches = ((1, b"FH", 2, 56, (1,)), (3, b"AT", 4, 96, (1, 2, 3)), (4, b"EV", 5, 96, (3, 4)))
        for index, kind, links, least, texts in branches:
            place, at = header.link_at(index), header.links[index]
            while at:
                try:
                    block = self._once(self._block(at, kind, links, least))
                except BlockError as broken:
                    self._found.patch(place, "<Q", 0)
                    self._found.remark(f"part of the file's description is left out: {broken}")
                    break
                for text in texts:
                    self._described(block, text, "part of the file's description")
                if kind == b"AT":
                    self._found.attachments.append(self._text(block.links[1]))
                place, at = block.link_at(0), block.links[0]
        self._described(header, 5, "the file's comment")

    def _text(self, at: int) -> str:
        """A name for a list."""
        try:
            block = self._block(at, b"TX", 0, _HEAD)
        except BlockError:
            return ""
        name: bytes = self._data[block.data : min(block.at + block.length, block.data + 300)]
        return name.split(b"\0")[0].decode("utf-8", "replace")

    def _described(self, block: _Block, index: int, what: str) -> BlockError | None:
        """Look at the text that a link leads to; one that is damaged or without measure is not followed."""
        at = block.links[index]
        if not at:
            return None
        if at in self._texts:
            size = self._texts[at]
        else:
            try:
                mark = self._mark(at)
                if mark not in (b"TX", b"MD"):
                    raise BlockError("TX", at, "is no text block")
                size = self._block(at, mark, 0, _HEAD).length
                if size > _LARGEST_TEXT:
                    raise BlockError(mark.decode(), at, f"has {bytes_text(size)} of text")
            except BlockError as broken:
                self._found.patch(block.link_at(index), "<Q", 0)
                self._found.remark(f"{what} is left out: {broken}")
                self._found.truncated |= broken.is_cut
                return broken
            self._texts[at] = size
        self._text_bytes += size
        if self._text_bytes > _MOST_TEXT:
            raise LogError(
                f"its names and comments take more than {bytes_text(_MOST_TEXT)} as often as they are linked",
                where=str(self._path), hint="check it with the logger's own tool",
            )  # fmt: skip
        return None

    # --- groups ---

    def _groups(self, header: _Block) -> None:
        place, at, kept = header.link_at(0), header.links[0], 0
        first: BlockError | None = None
        pending: list[tuple[_Block, list[_Group]]] = []
        while at:
            try:
                block = self._once(self._block(at, b"DG", 4, _HEAD + 33))
            except BlockError as broken:
                self._found.patch(place, "<Q", 0)
                self._found.lost("what follows the first " + (f"{kept} groups" if kept else "block"), broken)
                first = first or broken
                break
            try:
                groups = self._channel_groups(block)
            except BlockError as broken:
                self._found.patch(place, "<Q", block.links[0])
                self._found.lost("a group", broken)
                first = first or broken
            else:
                pending.append((block, groups))
                place, kept = block.link_at(0), kept + 1
            at = block.links[0]
        if first is not None and not kept:
            raise self._found.hopeless(self._path, first)
        self._begins |= {block.links[2] for block, _ in pending}  # where a block ends is told by those that begin
        for block, groups in pending:
            self._measured(block, groups)

    def _channel_groups(self, owner: _Block) -> list[_Group]:
        id_size = self._data[owner.data]
        if id_size not in (0, 1, 2, 4, 8):
            raise BlockError("DG", owner.at, f"is damaged, its records have ids of {id_size} bytes")
        self._described(owner, 3, "a group's comment")
        groups: list[_Group] = []
        at = owner.links[1]
        while at:
            # records of a group that is lost could not be told from the others
            try:
                block = self._once(self._block(at, b"CG", 6, _HEAD + 80))
            except BlockError as broken:
                if not (broken.is_cut and not groups and not id_size and not self._unfinished):
                    raise
                return [self._cut_group(owner, broken)]
            if (block.length, len(block.links)) not in _CG_FORMS:
                raise BlockError("CG", at, f"is damaged, it has {block.length} bytes and {len(block.links)} links")
            record_id, cycles, flags, data_bytes, invalidation = struct.unpack_from("<QQH6xII", self._data, block.data)
            group = _Group(block, record_id, cycles, flags, data_bytes, invalidation)
            if group.record > _LONGEST_RECORD:
                raise BlockError("CG", at, f"is damaged, its records have {bytes_text(group.record)}")
            if flags & _CG_REMOTE_MASTER and len(block.links) < 7:
                raise BlockError("CG", at, "is damaged, it has no link to its time")
            groups.append(group)
            self._described(block, 2, "a group's name")
            self._described(block, 5, "a group's comment")
            self._source(block, 3)
            self._invalidation_bits = 8 * invalidation
            self._channels(block, 1, 0)
            if block.links[0] and not id_size:
                other = BlockError("CG", block.links[0], "is a second kind of records, which have no ids")
                self._found.patch(block.link_at(0), "<Q", 0)
                self._found.lost("a group", other)
                return groups
            at = block.links[0]
        return groups

    def _cut_group(self, owner: _Block, broken: BlockError) -> _Group:
        """Rebuild a group whose own block is cut at the end of the file, if its links are left, from its channels.

        Libraries write this block last. The size of a record is that of its channels if the records are a multiple of
        it. The reader checks it by their time.
        """
        at = broken.at
        if at + _HEAD + 48 > self._size or self._data[at : at + 4] != b"##CG":
            raise broken
        links = struct.unpack_from("<6Q", self._data, at + _HEAD)
        block = self._once(_Block("CG", at, 104, (0, *links[1:]), at + _HEAD + 48))
        self._extent, self._has_invalidation = 0, False
        for index, what in ((2, "a group's name"), (5, "a group's comment")):
            self._described(block, index, what)
        self._source(block, 3)
        self._channels(block, 1, 0)
        size = self._extent
        chain = self._records[owner.at] = self._chain(owner.link_at(2), owner.links[2], max(size, 1))
        is_whole = size > 0 and chain.broken is None and chain.inflated and chain.inflated % size == 0
        cycles = chain.inflated // max(size, 1)
        if block.data + 16 <= self._size and struct.unpack_from("<Q", self._data, block.data + 8)[0] != cycles:
            is_whole = False
        if self._has_invalidation or not is_whole:
            raise broken
        head = struct.pack("<4s4xQQ6Q", b"##CG", 104, 6, *block.links)
        self._found.patches[at] = head + struct.pack("<QQHHIII", 0, cycles, 0, 0, 0, size, 0)
        self._found.inferred.add(at)
        self._found.truncated = True
        self._found.remark(f"{broken}; its channels give its records: {cycles} of {size} bytes")
        return _Group(block, 0, cycles, 0, size, 0)

    def _source(self, block: _Block, index: int) -> None:
        at = block.links[index]
        if at:
            try:
                source = self._block(at, b"SI", 3, 56)
            except BlockError as broken:
                self._found.patch(block.link_at(index), "<Q", 0)
                self._found.remark(f"the description of a source is left out: {broken}")
                return
            for text in range(3):
                self._described(source, text, "the name of a source")

    # --- channels ---

    def _channels(self, owner: _Block, index: int, depth: int) -> None:
        place, at = owner.link_at(index), owner.links[index]
        before = 0
        while at:
            try:
                block = self._once(self._block(at, b"CN", 8, 24 + 64 + 72))
                count = struct.unpack_from("<H", self._data, block.data + 22)[0]
                is_known = _CN_FORMS.get(block.length, len(block.links)) == len(block.links)
                if len(block.links) < 8 + count or block.at + block.length < block.data + 72 or not is_known:
                    raise BlockError("CN", at, f"is damaged, it has {len(block.links)} links and {count} attachments")
            except BlockError as broken:
                self._found.patch(place, "<Q", 0)
                what = f"what follows its first {before} channels" if before else "all of its channels"
                self._found.lost(f"of the group at byte {owner.at}, {what}", broken)
                return
            self._channel(block, depth)
            before += 1
            place, at = block.link_at(0), block.links[0]

    def _channel(self, block: _Block, depth: int) -> None:
        _, part, _, _, conversion, values = block.links[:6]
        kind, bit, begin, bits, flags = struct.unpack_from("<BxxBIII", self._data, block.data)
        if kind not in _VIRTUAL:
            self._extent = max(self._extent, begin + (bit + bits + 7) // 8)
            self._layout(block, bit, bits)
        self._has_invalidation |= bool(flags & _CN_INVALIDATION)
        if flags & _CN_SOME_INVALID:
            self._invalidation(block, flags)
        if self._described(block, 2, f"the name of the channel at byte {block.at}") is not None:
            self._found.refused[block.at] = "its name is lost"
        if self._described(block, 6, f"the unit of the channel at byte {block.at}") is not None:
            self._found.refused[block.at] = "its unit is lost"
        self._described(block, 7, f"the comment of the channel at byte {block.at}")
        self._source(block, 3)
        if conversion:
            reason = self._conversion_fault(conversion)
            if reason is not None:
                self._found.patch(block.link_at(4), "<Q", 0)
                self._found.refused[block.at] = reason
        if values:
            self._signal_data(block)
        if part:
            self._composition(block, 1, block.at, depth)

    def _invalidation(self, block: _Block, flags: int) -> None:
        """Check the bit that marks invalid samples: if records lack it, asammdf would read it from unrelated memory."""
        bit = struct.unpack_from("<I", self._data, block.data + 16)[0]
        if bit < self._invalidation_bits:
            return
        self._found.patch(block.data + 12, "<I", flags & ~_CN_SOME_INVALID)
        if self._invalidation_bits:
            what = (
                f"it is damaged, its invalidation bit {bit} is not among the {self._invalidation_bits} of its records"
            )
            self._found.refused[block.at] = what
        else:
            what = "declares an invalidation bit, and its records have none; its samples are taken for valid"
            self._found.remark(f"the channel at byte {block.at} {what}")

    def _layout(self, block: _Block, bit: int, bits: int) -> None:
        """Refuse numbers that no number is laid out as: asammdf would give up the file, or take others for them."""
        values = self._data[block.data + 2]
        is_number = {
            **dict.fromkeys(_INTEGERS, bit < 8 and (bits > 64 or 1 <= bits <= 64 - bit)),  # longer ones are bytes
            **dict.fromkeys(_REALS, bit == 0 and bits in _REAL_BITS),
            **dict.fromkeys(_COMPLEX, bit == 0 and bits in _COMPLEX_BITS),
        }.get(values, True)
        if not is_number:
            self._found.patch(block.data + 2, "<BB", 0, 0)
            self._found.patch(block.data + 8, "<I", 8)
            self._found.refused[block.at] = f"it is damaged, values of type {values} with {bits} bits from bit {bit} on"

    def _composition(self, owner: _Block, index: int, channel: int, depth: int) -> None:
        """The parts of a channel: a list of channels, or an array of whatever follows."""
        at = owner.links[index]
        try:
            mark = self._mark(at)
            if depth >= _DEEPEST:
                raise BlockError("CN", at, "lies too deep")
            if mark == b"CN":
                self._channels(owner, index, depth + 1)
                return
            array = self._once(self._block(at, b"CA", 1, _HEAD + 8 + 16))
            dimensions = struct.unpack_from("<H", self._data, array.data + 2)[0]
            if array.data + 16 + 8 * dimensions > array.at + array.length:
                raise BlockError("CA", at, f"is damaged, it has {dimensions} dimensions")
            elements = math.prod(max(n, 1) for n in struct.unpack_from(f"<{dimensions}Q", self._data, array.data + 16))
            if elements > _MOST_ELEMENTS:
                raise BlockError("CA", at, f"has {elements:.1e} elements")
            if array.links[0]:
                self._composition(array, 0, channel, depth + 1)
        except BlockError as broken:
            self._found.patch(owner.link_at(index), "<Q", 0)
            self._found.refused[channel] = f"its parts cannot be read, {broken}"

    def _conversion_fault(self, at: int) -> str | None:
        """Why raw numbers of a channel cannot be converted, or None."""
        if at not in self._conversions:
            self._conversions[at] = None
            budget = [_MOST_CONVERSIONS]
            try:
                self._conversion(at, 0, budget)
            except BlockError as broken:
                self._conversions[at] = f"its conversion cannot be read, {broken}"
        return self._conversions[at]

    def _conversion(self, at: int, depth: int, budget: list[int]) -> None:
        block = self._block(at, b"CC", 4, _HEAD + 32 + 24)
        budget[0] -= 1
        if depth > _DEEPEST or budget[0] < 0:
            raise BlockError("CC", at, "leads to conversions without end")
        if block.data + 24 > at + block.length:
            raise BlockError("CC", at, f"is damaged, it has {len(block.links)} links")
        kind, references, numbers = struct.unpack_from("<B3xHH", self._data, block.data)
        if len(block.links) != 4 + references or block.data + 24 + 8 * numbers > at + block.length:
            raise BlockError("CC", at, f"is damaged, it has {len(block.links)} links for {references} references")
        is_whole = {
            0: True, 1: numbers == 2, 2: numbers == 6, 3: references == 1, 4: numbers >= 2 and numbers % 2 == 0,
            5: numbers >= 2 and numbers % 2 == 0, 6: numbers % 3 == 1, 7: references == numbers + 1,
            8: 2 * (references - 1) == numbers, 9: numbers == references + 1, 10: references % 2 == 1,
            11: references == numbers,
        }.get(kind)  # fmt: skip
        if not is_whole:
            raise BlockError("CC", at, f"is damaged, type {kind} has {numbers} numbers and {references} references")
        if self._described(block, 1, f"the unit of the conversion at byte {at}") is not None:
            raise BlockError("CC", at, "has lost its unit")
        for link in (0, 2):
            self._described(block, link, f"a text of the conversion at byte {at}")
        inner = [a for a in block.links[4:] if a and self._mark(a) == b"CC"]
        if kind == _RANGES and inner:  # asammdf sorts the ranges and, of equal ones, what they lead to
            ranges = list(struct.iter_unpack("<2d", self._data[block.data + 24 : block.data + 24 + 8 * numbers]))
            if len(set(ranges)) < len(ranges):
                raise BlockError("CC", at, "is damaged, it has a range twice")
        for index in range(4, len(block.links)):
            if not block.links[index]:
                continue
            if self._mark(block.links[index]) == b"CC" and kind != _ALGEBRAIC:
                self._conversion(block.links[index], depth + 1, budget)
            elif self._described(block, index, f"a text of the conversion at byte {at}") is not None:
                raise BlockError("CC", at, "has lost one of its texts")

    # --- records ---

    def _signal_data(self, block: _Block) -> None:
        """Check values of variable length: missing ones are read as empty."""
        at = block.links[5]
        if at + 4 <= self._size and self._data[at : at + 4] in (b"##CG", b"##AT"):
            return
        chain = self._chain(block.link_at(5), at, 1)
        if chain.broken is not None:
            self._found.lost(f"a part of the values of the channel at byte {block.at}", chain.broken)
        self._bounded(chain, LARGEST_BLOCK)

    def _measured(self, owner: _Block, groups: list[_Group]) -> None:
        """The records of a data group: what there is of them, and of an unfinished one how many."""
        id_size = self._data[owner.data]
        plain = [g for g in groups if not g.flags & _CG_VLSD]
        record = plain[0].record if plain and not id_size else 1
        chain = self._records.get(owner.at)
        if chain is None:
            chain = self._chain(owner.link_at(2), owner.links[2], max(record, 1), is_last=True)
        self._bounded(chain, _LARGEST_UNSORTED if id_size else LARGEST_BLOCK)
        if chain.broken is not None:
            self._found.lost(f"a part of the records of the group at byte {owner.at}", chain.broken)
        self._found.inflated |= {g.block.at: chain.inflated for g in groups}
        if id_size:
            self._found.unsorted += chain.inflated
        for group in plain:
            there = chain.inflated // max(group.record + id_size, 1)
            if group.cycles > min(_MOST_CYCLES, _MOST_PACKED * self._size):
                self._found.patch(group.block.data + 8, "<Q", there)
                broken = BlockError("CG", group.block.at, f"declares {group.cycles:.1e} records")
                self._found.lost("the number of records of a group", broken)
                continue
            if self._unfinished & _COUNTERS:
                if id_size:
                    self._found.recount.add(group.block.at)
                    self._found.zeros[group.block.at] = chain.zeros
                    there += 1
                elif group.record:
                    there = self._written(chain, group)
                self._found.patch(group.block.data + 8, "<Q", there)
            elif not there and group.cycles and group.record + id_size:
                self._found.patch(group.block.data + 8, "<Q", 0)
                if chain.broken is None:
                    broken = BlockError("CG", group.block.at, f"declares {group.cycles} records and holds no record")
                    self._found.lost("a group", broken)
                self._found.lost_samples += group.cycles

    def _written(self, chain: _Records, group: _Group) -> int:
        """Number of whole records of an unfinished file. A logger that reserves room has zeros behind the last one."""
        zeros = chain.zeros if chain.zeros >= group.record else 0
        there, rest = divmod(chain.inflated - zeros, group.record)
        if rest and zeros and there:
            # what is zero in the record before as well is no room that was never written
            begin = self._size - zeros - rest
            if not any(self._data[begin - group.record + rest : begin]):
                return there + 1
        if rest > chain.zeros - zeros and chain.broken is None:
            self._found.truncated = True
            self._found.lost_samples += 1
            self._found.remark(f"the last record of the group at byte {group.block.at} is incomplete, and left out")
        return there

    def _bounded(self, chain: _Records, most: int) -> None:
        if chain.largest > most:
            raise LogError(
                f"a data block of it declares {bytes_text(chain.largest)} when inflated", where=str(self._path),
                expected=f"at most {bytes_text(most)}; the standard allows 4 MB",
                hint="write it anew with the logger's own tool",
            )  # fmt: skip

    def _chain(self, place: int, at: int, record: int, *, is_last: bool = False) -> _Records:
        """Follow a link to data, and unlink missing blocks. A plain block ends with a whole record."""
        out = _Records()
        if not at:
            return out
        try:
            mark = self._mark(at)
            if mark == b"HL":
                head = self._once(self._block(at, b"HL", 1, 40))
                place, at = head.link_at(0), head.links[0]
                mark = b"DL" if at else b""
            if mark == b"DL":
                self._list(place, at, out, is_last=is_last)
            elif mark == b"LD":
                self._column_list(at, out)
            elif at:
                self._add(at, out, record, is_end=is_last)
        except BlockError as broken:
            self._found.patch(place, "<Q", 0)
            out.broken = broken
        return out

    def _list(self, place: int, at: int, out: _Records, *, is_last: bool) -> None:
        seen: set[int] = set()  # one small block, listed again and again, would unpack to more than any disk holds
        while at:
            try:
                block = self._once(self._block(at, b"DL", 1, 40))
                flags, count = struct.unpack_from("<B3xI", self._data, block.data)
                behind = 8 if flags & _DL_EQUAL else 8 * (len(block.links) - 1)
                if count > len(block.links) - 1 or block.data + 8 + behind > at + block.length:
                    raise BlockError("DL", at, f"is damaged, it has {len(block.links)} links and {count} blocks")
            except BlockError as broken:
                self._found.patch(place, "<Q", 0)
                out.broken = broken
                return
            is_end = is_last and not block.links[0]
            for index, link in enumerate(block.links[1 : 1 + count]):
                is_last_block = is_end and (index == count - 1 or not block.links[2 + index])
                if not link and is_end and self._unfinished & _LAST_DL:
                    self._unlinked(block, index, count, out)
                    return
                kept = 0
                try:
                    if not link:
                        raise BlockError("DT", 0, f"has no address, number {index + 1} of the list at byte {at}")
                    if link in seen:
                        raise BlockError("data", link, "is linked twice")
                    seen.add(link)
                    self._add(link, out, 1, is_end=is_last_block)
                    kept = 1  # also where only its beginning is there
                except BlockError as broken:
                    out.broken = broken
                if out.broken is not None:
                    self._shortened(block, index + kept)
                    return
            place, at = block.link_at(0), block.links[0]

    def _shortened(self, block: _Block, count: int) -> None:
        self._found.patch(block.data + 4, "<I", count)
        self._found.patch(block.link_at(0), "<Q", 0)

    def _unlinked(self, block: _Block, done: int, count: int, out: _Records) -> None:
        """Data blocks behind the last list of an unfinished file, which the list does not link yet."""
        at = block.links[done] if done else block.at
        for index in range(done, count):
            length = struct.unpack_from("<Q", self._data, at + 8)[0] if at + _HEAD <= self._size else self._size
            at = -(-(at + length) // 8) * 8
            if at + _HEAD > self._size or self._data[at + 2 : at + 4] not in (b"DT", b"DZ", b"DV"):
                self._shortened(block, index)
                return
            self._found.patch(block.link_at(1 + index), "<Q", at)
            self._add(at, out, 1, is_end=index == count - 1)
            if out.broken is not None:
                self._shortened(block, index)
                return

    def _column_list(self, at: int, out: _Records) -> None:
        seen: set[int] = set()
        while at:
            block = self._once(self._block(at, b"LD", 1, 40))
            count = struct.unpack_from("<I", self._data, block.data + 4)[0]
            if count > len(block.links) - 1:
                raise BlockError("LD", at, f"is damaged, it has {len(block.links)} links and {count} blocks")
            for link in block.links[1:]:
                if link in seen:
                    raise BlockError("data", link, "is linked twice")
                if link:
                    seen.add(link)
                    self._add(link, out, 1, is_end=False)
                    if out.broken is not None:
                        raise out.broken
            at = block.links[0]

    def _add(self, at: int, out: _Records, record: int, *, is_end: bool) -> None:
        """One block of data. What is there of a plain one that the file ends in is kept."""
        mark = self._mark(at)
        if mark == b"DZ":
            self._deflated(at, out)
            return
        if mark not in _PLAIN:
            raise BlockError("data", at, f"is not there, the file holds {self._data[at : at + 4]!r}")
        length = struct.unpack_from("<Q", self._data, at + 8)[0]
        if is_end and self._unfinished & _LAST_DT:
            length = self._open_end(at, length)
            self._found.patch(at + 8, "<Q", length)
        if length < _HEAD:
            raise BlockError(mark.decode(), at, f"is damaged, it has {length} bytes")
        if at + length > self._size:
            left = (self._size - at - _HEAD) // record * record
            self._found.patch(at + 8, "<Q", _HEAD + left)
            why = f"is incomplete, the file ends at byte {self._size} and {at + length - self._size} bytes are missing"
            out.broken = BlockError(mark.decode(), at, why, is_cut=True)
            length = _HEAD + left
        out.inflated += length - _HEAD
        if self._unfinished and at + length == self._size:
            out.zeros = self._zeros(at + _HEAD)

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
        is_right = _HEAD < length <= end - at and end < self._size
        return length if is_right else end - at

    def _deflated(self, at: int, out: _Records) -> None:
        if at + 48 > self._size:
            raise BlockError("DZ", at, f"is incomplete, the file ends at byte {self._size}", is_cut=True)
        length = struct.unpack_from("<Q", self._data, at + 8)[0]
        kind, width, inflated, stored = struct.unpack_from("<B1xIQQ", self._data, at + 26)
        if kind not in _KINDS_OF_DZ or stored > max(length, 48) - 48 or (kind % 2 and inflated and not width):
            raise BlockError("DZ", at, f"is damaged, it has {length} bytes for {stored} of data of type {kind}")
        if at + 48 + stored > self._size:
            raise BlockError("DZ", at, f"is incomplete, the file ends at byte {self._size}", is_cut=True)
        if at in self._damaged:
            raise BlockError("DZ", at, "is damaged, or not of the size that it declares")
        self._found.deflated.append(at)
        out.inflated += inflated
        out.largest = max(out.largest, inflated)
