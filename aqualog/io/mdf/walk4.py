"""Walk through the blocks of MDF 4: ID, HD, then DG, CG, CN with their conversions and texts, and the data chains.

It also finishes a recording that its logger left unfinished, without a copy of it.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from aqualog.core.errors import LogError
from aqualog.guard.system import bytes_text
from aqualog.io.mdf.blocks import BlockError, Channel, Field, Group, Survey, plain_text, short
from aqualog.io.mdf.blocks4 import HEAD, Block, BlockWalk, Chain

__all__ = ["LARGEST_BLOCK", "survey4"]

LARGEST_BLOCK = 1 << 28  # [bytes] inflated; the standard allows 4 MiB
_LARGEST_UNSORTED = 1 << 25  # [bytes] every record of such a block becomes an object
_LONGEST_RECORD = 1 << 30
_MOST_CYCLES = 1 << 40
_MOST_PACKED = 100_000  # records, of a byte at least, that a byte of a file may stand for, however well it is packed
_DEEPEST = 16  # channels in channels
_MOST_ELEMENTS = 1_000_000  # of an array
_HD = 64
_FLAGS_AT = 60
_COUNTERS, _VLSD_OFFSETS = 0x1, 0x40  # what an unfinished file has not been given
_CG_FORMS = ((104, 6), (112, 7))
_CN_FORMS = {160: 8, 168: 9}
_CG_VLSD, _CG_BUS_EVENT, _CG_REMOTE_MASTER = 0x1, 0x2, 0x8
_CN_ALL_INVALID, _CN_SOME_INVALID = 0x1, 0x2
_FIXED, _VARIABLE, _MASTER, _VIRTUAL_MASTER, _VIRTUAL = 0, 1, 2, 3, 6  # types of channels
_INTEGERS, _REALS, _COMPLEX = (0, 1, 2, 3), (4, 5), (15, 16)  # types of values
_REAL_BITS, _COMPLEX_BITS = (16, 32, 64), (64, 128)
_MOST_TYPES = 17
_LETTERS = {0: "u", 1: "u", 2: "i", 3: "i", 4: "f", 5: "f"}
_LOCAL_TIME = 0x1


class _Records(NamedTuple):
    """A group whose records were not looked at yet, and what is known of them from its own channels."""

    group: Group
    block: Block
    cycles: int


def survey4(data: Any, path: Path, damaged: Collection[int] = ()) -> Survey:
    """Walk through the content of a file; `path` is for errors.

    `damaged`: addresses of packed blocks that are known not to unpack: their records end before them.

    Raises
    ------
    LogError
        If nothing of the file can be read, or a block would not fit into any memory.
    """
    return _Walk(data, path, frozenset(damaged)).run()


class _Walk(BlockWalk):
    def __init__(self, data: Any, path: Path, damaged: frozenset[int]) -> None:
        super().__init__(data, path, damaged)
        self._chains: dict[int, Chain] = {}  # of groups that were gone through before the others
        self._extent, self._has_invalidation = 0, False  # what the channels of a group take of a record
        self._invalidation_bits = 0  # that records of the group have
        self._group_source: tuple[str, ...] = ()

    def run(self) -> Survey:
        self._identification()
        try:
            header = self._block(_HD, b"HD", 6, 24 + 48 + 24)
        except BlockError as broken:
            raise self._found.hopeless(self._path, broken) from broken
        self._found.head.start_ns, flags = self._numbers("<Q4xB", header.data)
        self._found.head.is_local = bool(flags & _LOCAL_TIME)
        self._side_branches(header)
        self._groups(header)
        return self._found

    # --- what is no measurement ---

    def _identification(self) -> None:
        if self._size < _HD:
            broken = BlockError("HD", _HD, f"is missing, the file ends at byte {self._size}", is_cut=True)
            raise self._found.hopeless(self._path, broken)
        flags, own = self._numbers("<HH", _FLAGS_AT)
        is_marked = self._data[:8] == b"UnFinMF "
        if not (is_marked or flags):
            return
        if flags & _VLSD_OFFSETS:
            raise LogError(
                "was not finalised: the places of values of variable length are not known", where=str(self._path),
                hint="finalise it with the logger's own tool",
            )  # fmt: skip
        self.unfinished = flags
        self._found.finalised = True
        told = f" (flags of its own: {own:#x})" if own else ""
        self._found.notes.append(f"file was not finalised by the logger; aqualog completes it while reading{told}")

    def _side_branches(self, header: Block) -> None:
        """Histories, hierarchies, attachments and events: a branch that is damaged is left out."""
        branches = ((1, b"FH", 2, 56, (1,)), (3, b"AT", 4, 96, (1, 2, 3)), (4, b"EV", 5, 96, (3, 4)))
        for index, kind, links, least, texts in branches:
            at = header.links[index]
            while at:
                try:
                    block = self._once(self._block(at, kind, links, least))
                except BlockError as broken:
                    self._found.remark(f"part of the file's description is left out: {broken}")
                    break
                for text in texts:
                    self._described(block, text, "part of the file's description")
                if kind == b"AT":
                    self._found.head.attachments.append(self._attached(block.links[1]))
                at = block.links[0]
        self._described(header, 5, "the file's comment")

    def _attached(self, at: int) -> str:
        try:
            block = self._block(at, b"TX", 0, HEAD)
        except BlockError:
            return ""
        name: bytes = self._data[block.data : min(block.at + block.length, block.data + 300)]
        return name.split(b"\0")[0].decode("utf-8", "replace")

    # --- groups ---

    def _groups(self, header: Block) -> None:
        at = header.links[0]
        first: BlockError | None = None
        pending: list[tuple[Block, list[_Records]]] = []
        while at:
            try:
                block = self._once(self._block(at, b"DG", 4, HEAD + 33))
            except BlockError as broken:
                self._found.lost("what follows the first " + (f"{len(pending)} groups" if pending else "block"), broken)
                first = first or broken
                break
            try:
                pending.append((block, self._channel_groups(block)))
            except BlockError as broken:
                self._found.lost("a group", broken)
                first = first or broken
            at = block.links[0]
        if first is not None and not pending:
            raise self._found.hopeless(self._path, first)
        self._begins |= {block.links[2] for block, _ in pending}  # where a block ends is told by those that begin
        for block, records in pending:
            self._measured(block, records)

    def _channel_groups(self, owner: Block) -> list[_Records]:
        id_size = self._data[owner.data]
        if id_size not in (0, 1, 2, 4, 8):
            raise BlockError("DG", owner.at, f"is damaged, its records have ids of {id_size} bytes")
        self._described(owner, 3, "a group's comment")
        found: list[_Records] = []
        at = owner.links[1]
        while at:
            # records of a group that is lost could not be told from the others
            try:
                block = self._once(self._block(at, b"CG", 6, HEAD + 80))
            except BlockError as broken:
                if not (broken.is_cut and not found and not id_size and not self.unfinished):
                    raise
                return [self._cut_group(owner, broken)]
            if (block.length, len(block.links)) not in _CG_FORMS:
                raise BlockError("CG", at, f"is damaged, it has {block.length} bytes and {len(block.links)} links")
            record_id, cycles, flags, size, invalidation = self._numbers("<QQH6xII", block.data)
            if not flags & _CG_VLSD and size + invalidation > _LONGEST_RECORD:
                raise BlockError("CG", at, f"is damaged, its records have {bytes_text(size + invalidation)}")
            if flags & _CG_REMOTE_MASTER and len(block.links) < 7:
                raise BlockError("CG", at, "is damaged, it has no link to its time")
            group = Group(
                at, owner.at, record_id=record_id, id_size=id_size, size=size, invalidation=invalidation,
                is_bus_event=bool(flags & _CG_BUS_EVENT), is_variable=bool(flags & _CG_VLSD),
                master_at=block.links[6] if flags & _CG_REMOTE_MASTER else 0,
            )  # fmt: skip
            self._invalidation_bits = 8 * invalidation
            found.append(_Records(self._with_channels(group, block), block, cycles))
            if block.links[0] and not id_size:
                other = BlockError("CG", block.links[0], "is a second kind of records, which have no ids")
                self._found.lost("a group", other)
                return found
            at = block.links[0]
        return found

    def _with_channels(self, group: Group, block: Block) -> Group:
        self._described(block, 2, "a group's name")
        self._described(block, 5, "a group's comment")
        source = self._source(block, 3)
        self._group_source = (source[0] or source[1],) if source else ()
        channels: list[Channel | None] = []
        self._channels(block, 1, 0, channels)
        known = tuple(c for c in channels if c is not None)
        return replace(group, name=self._text(block.links[2]), source=source, channels=known)

    def _cut_group(self, owner: Block, broken: BlockError) -> _Records:
        """Rebuild a group whose own block is cut at the end of the file, if its links are left, from its channels.

        Libraries write this block last. The size of a record is that of its channels if the records are a multiple of
        it. The reader checks it by their time.
        """
        at = broken.at
        if at + HEAD + 48 > self._size or self._data[at : at + 4] != b"##CG":
            raise broken
        block = self._once(Block("CG", at, 104, (0, *self._numbers("<6Q", at + HEAD)[1:]), at + HEAD + 48))
        self._extent, self._has_invalidation = 0, False
        group = self._with_channels(Group(at, owner.at, is_inferred=True), block)
        size = self._extent
        chain = self._chains[owner.at] = self._chain(owner.links[2], max(size, 1))
        is_whole = size > 0 and chain.broken is None and chain.inflated and chain.inflated % size == 0
        cycles = chain.inflated // max(size, 1)
        if block.data + 16 <= self._size and self._numbers("<Q", block.data + 8)[0] != cycles:
            is_whole = False
        if self._has_invalidation or not is_whole:
            raise broken
        self._found.truncated = True
        self._found.remark(f"{broken}; its channels give its records: {cycles} of {size} bytes")
        return _Records(replace(group, size=size), block, cycles)

    # --- channels ---

    def _channels(self, owner: Block, index: int, depth: int, into: list[Channel | None]) -> None:
        at, before = owner.links[index], 0
        while at:
            try:
                block = self._once(self._block(at, b"CN", 8, 24 + 64 + 72))
                count = self._numbers("<H", block.data + 22)[0]
                is_known = _CN_FORMS.get(block.length, len(block.links)) == len(block.links)
                if len(block.links) < 8 + count or block.at + block.length < block.data + 72 or not is_known:
                    raise BlockError("CN", at, f"is damaged, it has {len(block.links)} links and {count} attachments")
            except BlockError as broken:
                what = f"what follows its first {before} channels" if before else "all of its channels"
                self._found.lost(f"of the group at byte {owner.at}, {what}", broken)
                return
            self._channel(block, depth, into)
            before += 1
            at = block.links[0]

    def _channel(self, block: Block, depth: int, into: list[Channel | None]) -> None:
        kind, sync, values, shift, begin, bits, flags, invalid = self._numbers("<4B4I", block.data)
        is_virtual = kind in (_VIRTUAL_MASTER, _VIRTUAL)
        if not is_virtual:
            self._extent = max(self._extent, begin + (shift + bits + 7) // 8)
            if not _is_layout(values, shift, bits):
                what = f"it is damaged, values of type {values} with {bits} bits from bit {shift} on"
                self._refused[block.at] = what
                values, shift, bits = 0, 0, 8
        self._has_invalidation |= bool(flags & (_CN_ALL_INVALID | _CN_SOME_INVALID))
        bit = self._invalidation_bit(block, invalid) if flags & _CN_SOME_INVALID else None
        if self._described(block, 2, f"the name of the channel at byte {block.at}") is not None:
            self._refused[block.at] = "its name is lost"
        if self._described(block, 6, f"the unit of the channel at byte {block.at}") is not None:
            self._refused[block.at] = "its unit is lost"
        self._described(block, 7, f"the comment of the channel at byte {block.at}")
        source = self._source(block, 3)
        conversion = self._converted(block.links[4])
        if isinstance(conversion, str):
            self._refused[block.at], conversion = conversion, None
        stored = self._signal_data(block) if block.links[5] else ()
        place = len(into)
        if values < _MOST_TYPES:
            into.append(None)
        parts = self._composition(block, 1, block.at, depth, into) if block.links[1] else False
        if values >= _MOST_TYPES:
            del into[place:]
            return
        refused = self._refused.get(block.at, "")
        unit = (conversion.unit if conversion is not None else "") or self._text(block.links[6])
        into[place] = Channel(
            self._text(block.links[2]), plain_text(unit).strip("\0 \t\r\n"),
            short(plain_text(self._text(block.links[7]))),
            (*((source[0] or source[1],) if source else ()), *self._group_source),
            kind in (_MASTER, _VIRTUAL_MASTER), sync in (0, 1), is_virtual,
            not parts and bits <= 64 and values in _LETTERS and kind in (_FIXED, _VIRTUAL)
            and (conversion is None or conversion.kind != "from text"),
            Field(begin, shift, bits, "u" if kind == _VARIABLE else _LETTERS.get(values, "V"), values in (1, 3, 5)),
            bit, bool(flags & _CN_ALL_INVALID), conversion, refused, stored, kind == _VARIABLE,
        )  # fmt: skip

    def _invalidation_bit(self, block: Block, bit: int) -> int | None:
        """Check the bit that marks invalid samples; None if records lack it."""
        if bit < self._invalidation_bits:
            return bit
        if self._invalidation_bits:
            what = (
                f"it is damaged, its invalidation bit {bit} is not among the {self._invalidation_bits} of its records"
            )
            self._refused[block.at] = what
        else:
            what = "declares an invalidation bit, and its records have none; its samples are taken for valid"
            self._found.remark(f"the channel at byte {block.at} {what}")
        return None

    def _composition(self, owner: Block, index: int, channel: int, depth: int, into: list[Channel | None]) -> bool:
        """The parts of a channel: a list of channels, or an array of whatever follows. Whether there are any."""
        at = owner.links[index]
        try:
            mark = self._mark(at)
            if depth >= _DEEPEST:
                raise BlockError("CN", at, "lies too deep")
            if mark == b"CN":
                before = len(into)
                self._channels(owner, index, depth + 1, into)
                return len(into) > before
            array = self._once(self._block(at, b"CA", 1, HEAD + 8 + 16))
            dimensions = self._numbers("<H", array.data + 2)[0]
            if array.data + 16 + 8 * dimensions > array.at + array.length:
                raise BlockError("CA", at, f"is damaged, it has {dimensions} dimensions")
            elements = math.prod(max(n, 1) for n in self._numbers(f"<{dimensions}Q", array.data + 16))
            if elements > _MOST_ELEMENTS:
                raise BlockError("CA", at, f"has {elements:.1e} elements")
            if array.links[0]:
                self._composition(array, 0, channel, depth + 1, into)
        except BlockError as broken:
            self._refused[channel] = f"its parts cannot be read, {broken}"
            return False
        return True

    # --- records ---

    def _signal_data(self, block: Block) -> Any:
        """Check values of variable length: missing ones are read as empty. Or the address of the group of them."""
        at = block.links[5]
        if at + 4 <= self._size and self._data[at : at + 4] in (b"##CG", b"##AT"):
            return at
        chain = self._chain(at, 1)
        if chain.broken is not None:
            self._found.lost(f"a part of the values of the channel at byte {block.at}", chain.broken)
        self._bounded(chain, LARGEST_BLOCK)
        return tuple(chain.blocks)

    def _measured(self, owner: Block, records: list[_Records]) -> None:
        """The records of a data group: what there is of them, and of an unfinished one how many."""
        id_size = self._data[owner.data]
        plain = [r for r in records if not r.group.is_variable]
        record = plain[0].group.record if plain and not id_size else 1
        chain = self._chains.get(owner.at)
        if chain is None:
            chain = self._chain(owner.links[2], max(record, 1), is_last=True)
        self._bounded(chain, _LARGEST_UNSORTED if id_size else LARGEST_BLOCK)
        if chain.broken is not None:
            self._found.lost(f"a part of the records of the group at byte {owner.at}", chain.broken)
        if id_size:
            self._found.unsorted += chain.inflated
        for group, block, cycles in records:
            known = replace(group, cycles=cycles, data=tuple(chain.blocks), invalid_data=tuple(chain.invalid))
            if not group.is_variable:
                known = self._counted(known, block, chain)
            self._found.groups.append(known)

    def _counted(self, group: Group, block: Block, chain: Chain) -> Group:
        """The group with the number of its records as it is."""
        record, id_size = group.record, group.id_size
        there = chain.inflated // max(record + id_size, 1)
        if group.cycles > min(_MOST_CYCLES, _MOST_PACKED * self._size):
            broken = BlockError("CG", block.at, f"declares {group.cycles:.1e} records")
            self._found.lost("the number of records of a group", broken)
            return replace(group, cycles=there)
        if self.unfinished & _COUNTERS:
            if id_size:
                return replace(group, cycles=there + 1, is_uncounted=True, zeros=chain.zeros)
            return replace(group, cycles=self._written(chain, block.at, record) if record else there)
        if not there and group.cycles and record + id_size:
            if chain.broken is None:
                broken = BlockError("CG", block.at, f"declares {group.cycles} records and holds no record")
                self._found.lost("a group", broken)
            self._found.lost_samples += group.cycles
            return replace(group, cycles=0)
        return group

    def _written(self, chain: Chain, at: int, record: int) -> int:
        """Number of whole records of an unfinished file. A logger that reserves room has zeros behind the last one."""
        zeros = chain.zeros if chain.zeros >= record else 0
        there, rest = divmod(chain.inflated - zeros, record)
        if rest and zeros and there:
            # what is zero in the record before as well is no room that was never written
            begin = self._size - zeros - rest
            if not any(self._data[begin - record + rest : begin]):
                return there + 1
        if rest > chain.zeros - zeros and chain.broken is None:
            self._found.truncated = True
            self._found.lost_samples += 1
            self._found.remark(f"the last record of the group at byte {at} is incomplete, and left out")
        return there

    def _bounded(self, chain: Chain, most: int) -> None:
        if chain.largest > most:
            raise LogError(
                f"a data block of it declares {bytes_text(chain.largest)} when inflated", where=str(self._path),
                expected=f"at most {bytes_text(most)}; the standard allows 4 MB",
                hint="write it anew with the logger's own tool",
            )  # fmt: skip


def _is_layout(values: int, shift: int, bits: int) -> bool:
    """Whether a number of this type can have so many bits from this bit on."""
    if values in _INTEGERS:
        return shift < 8 and (bits > 64 or 1 <= bits <= 64 - shift)  # longer ones are bytes
    known = {**dict.fromkeys(_REALS, _REAL_BITS), **dict.fromkeys(_COMPLEX, _COMPLEX_BITS)}.get(values)
    return known is None or (shift == 0 and bits in known)
