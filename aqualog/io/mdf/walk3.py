"""Walk through the blocks of MDF 3: ID, HD, then DG, CG, CN with their conversions and texts, and the records."""

from __future__ import annotations

import struct
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from aqualog.io.mdf.blocks import (
    BlockError,
    Channel,
    Conversion,
    ConversionKind,
    Field,
    Group,
    Stored,
    Survey,
    Walk,
    plain_text,
    short,
)

__all__ = ["survey3"]

_HD, _BYTE_ORDER_AT = 64, 24
_LEAST = {b"HD": 164, b"DG": 24, b"CG": 26, b"CN": 218, b"CC": 46, b"CE": 6, b"TX": 4, b"TR": 10, b"CD": 8}
_LONG_NAME, _DISPLAY_NAME = 222, 226  # length of a channel block with such a link before
_FULL_CHANNEL = 228
_HD_WITH_NANOSECONDS = 164
# numbers that follow the head of a conversion, by its type
_NUMBERS = {0: 2, 6: 6, 7: 7, 8: 7, 9: 6}
_BY_COUNT = {1: 16, 2: 16, 11: 40, 12: 20}  # [bytes] an entry of a table
_FORMULA = 10
_HEAD = struct.Struct("<2sH")
_NO_CONVERSION = 65535
_MASTER = 1  # type of a channel
_KINDS: dict[int, ConversionKind] = {
    0: "linear", 1: "interpolated", 2: "nearest", 6: "polynomial", 7: "exponential", 8: "logarithmic", 9: "rational",
    10: "formula",
}  # fmt: skip
_TYPES = {
    0: ("u", None), 1: ("i", None), 2: ("f", None), 3: ("f", None), 7: ("V", None), 8: ("V", None),
    9: ("u", True), 10: ("i", True), 11: ("f", True), 12: ("f", True),
    13: ("u", False), 14: ("i", False), 15: ("f", False), 16: ("f", False),
}  # fmt: skip
"""By type of value: NumPy's letter, and whether it is big-endian; None: as the file."""
_SOURCES = {2: "6x80s32s", 19: "8x36s36s"}  # name and path: of a control unit, of a message
_BLANKS = " \t\n\r\0"


class _Declared(NamedTuple):
    """Groups of a data group, and where their records begin."""

    owner: int
    records: int
    id_size: int
    groups: list[Group]


def survey3(data: Any, path: Path) -> Survey:
    """Walk through the content of a file; `path` is for errors.

    Raises
    ------
    LogError
        If nothing of the file can be read.
    """
    return _Walk(data, path).run()


class _Walk(Walk):
    def __init__(self, data: Any, path: Path) -> None:
        super().__init__(data, path)
        self._declared: list[_Declared] = []

    def run(self) -> Survey:
        try:
            length = self._block(_HD, b"HD")
        except BlockError as broken:
            raise self._found.hopeless(self._path, broken) from broken
        self._texts(_HD, (8, 12), "the file's comment")
        self._found.head.start_ns = self._start(length)
        self._is_big_endian = bool(self._numbers("<H", _BYTE_ORDER_AT)[0])
        self._groups()
        for declared in self._declared:
            self._found.groups += self._measured(declared)
        return self._found

    def _start(self, length: int) -> int:
        start = 0
        if length > _HD_WITH_NANOSECONDS and self._size >= _HD + _HD_WITH_NANOSECONDS + 8:
            start = self._numbers("<Q", _HD + _HD_WITH_NANOSECONDS)[0]
        if not start:
            date, time = self._numbers("10s8s", _HD + 18)
            with suppress(ValueError, UnicodeDecodeError):
                text = f"{date.decode('ascii')} {time.decode('ascii')}".replace("\0", "").strip()
                moment = datetime.strptime(text, "%d:%m:%Y %H:%M:%S").replace(tzinfo=UTC)
                start = int(moment.timestamp()) * 10**9
        return start

    def _block(self, at: int, kind: bytes) -> int:
        """Length of a block of this kind, inside the file."""
        name = kind.decode()
        (length,) = self._block_head(name, at, _HEAD, kind)
        if length < _LEAST[kind]:
            raise BlockError(name, at, f"is damaged, it has {length} bytes")
        self._seen(name, at, length)
        return length

    def _once(self, at: int, kind: bytes) -> int:
        length = self._block(at, kind)
        self._link_once(kind.decode(), at)
        return length

    def _link(self, at: int) -> int:
        return int(self._numbers("<I", at)[0])

    def _texts(self, at: int, places: tuple[int, ...], what: str, kind: bytes = b"TX") -> BlockError | None:
        """Look at what links lead to; what is damaged is not followed."""
        found = None
        for place in places:
            to = self._link(at + place)
            if to:
                try:
                    self._block(to, kind)
                except BlockError as broken:
                    self._found.remark(f"{what} is left out: {broken}")
                    self._found.truncated |= broken.is_cut
                    found = broken
        return found

    def _text(self, at: int) -> str:
        if not at or at + 4 > self._size or self._data[at : at + 2] != b"TX":
            return ""
        raw = bytes(self._data[at + 4 : at + self._numbers("<H", at + 2)[0]])
        return raw.split(b"\0", 1)[0].strip(b" \r\t\n").decode("latin-1")

    # --- groups ---

    def _groups(self) -> None:
        kept, at = 0, self._link(_HD + 4)
        first: BlockError | None = None
        while at:
            try:
                self._once(at, b"DG")
            except BlockError as broken:
                self._found.lost("what follows the first " + (f"{kept} groups" if kept else "block"), broken)
                first = first or broken
                break
            try:
                self._declared.append(self._data_group(at))
            except BlockError as broken:
                self._found.lost("a group", broken)
                first = first or broken
            else:
                kept += 1
            at = self._link(at + 4)
        if first is not None and not kept:
            raise self._found.hopeless(self._path, first)

    def _data_group(self, owner: int) -> _Declared:
        self._texts(owner, (12,), "a trigger", b"TR")
        records, count, id_size = self._numbers("<IHH", owner + 16)
        if id_size > 2:
            raise BlockError("DG", owner, f"is damaged, its records have ids of {id_size} bytes")
        if count > 1 and not id_size:
            raise BlockError("DG", owner, f"is damaged, it has {count} kinds of records without ids")
        groups: list[Group] = []
        at = self._link(owner + 8)
        for _ in range(count):
            # records of a group that is lost could not be told from the others
            try:
                self._once(at, b"CG")
            except BlockError as broken:
                if not (broken.is_cut and count == 1 and not id_size):
                    raise
                groups.append(self._cut_group(owner, records, broken))
                break
            record_id, _, size, cycles = self._numbers("<HHHI", at + 16)
            self._texts(at, (12,), "a group's comment")
            # the second byte of an id stands behind the record
            groups.append(
                Group(
                    at, owner, record_id=record_id & 0xFF, id_size=min(id_size, 1), behind=max(id_size - 1, 0),
                    cycles=cycles, size=size, channels=tuple(self._channels(at)),
                )
            )  # fmt: skip
            at = self._link(at + 4)
        return _Declared(owner, records, id_size, groups)

    def _cut_group(self, owner: int, records: int, broken: BlockError) -> Group:
        """Rebuild a group whose own block is cut at the end of the file, if the size of its records is left.

        Libraries write this block last. The start of the next block gives the number of records. The reader checks it
        by their time.
        """
        at = broken.at
        if at + 22 > self._size or self._data[at : at + 2] != b"CG" or at in self._linked:
            raise broken
        self._linked.add(at)
        record = self._numbers("<H", at + 20)[0]
        channels = tuple(self._channels(at))
        end = min((b for b in self._begins if b > records), default=self._size)
        if not record or not records or (end - records) % record:
            raise broken
        cycles = (end - records) // record
        if at + 26 <= self._size and self._link(at + 22) != cycles:
            raise broken
        self._texts(at, (12,), "a group's comment")
        self._found.truncated = True
        self._found.remark(f"{broken}; the start of the next block gives the number of its records: {cycles}")
        return Group(at, owner, cycles=cycles, size=record, channels=channels, is_inferred=True)

    def _measured(self, declared: _Declared) -> list[Group]:
        """The groups with their records, as far as these are there."""
        owner, records, id_size, groups = declared
        need = sum(g.cycles * (g.record + id_size) for g in groups)
        begins = self._begins | {d.records for d in self._declared}
        end = min((b for b in begins if b > records), default=self._size)
        there = max(end - records, 0) if records else 0
        if id_size:
            self._found.unsorted += min(need, there)
        if need > there:
            next_one = "the file ends" if end == self._size else "another block begins"
            why = f"begin there and take {need} bytes, {next_one} at byte {end}"
            self._found.lost(f"a part of the records of the group at byte {owner}", BlockError("data", records, why))
        length = min(need, there)
        data = (Stored(records, length, length),) if length else ()
        if need > there and end < self._size and not id_size and len(groups) == 1 and groups[0].record:
            # what is read beyond would be the next block, taken for numbers
            fits = there // groups[0].record
            self._found.lost_samples += groups[0].cycles - fits
            return [replace(groups[0], cycles=fits, data=data)]
        found = []
        for group in groups:
            cycles = group.cycles
            if cycles and group.record + id_size > there:
                self._found.lost_samples += cycles
                cycles = 0
            found.append(replace(group, cycles=cycles, data=data))
        return found

    # --- channels ---

    def _channels(self, owner: int) -> list[Channel]:
        found: list[Channel] = []
        before, at = 0, self._link(owner + 8)
        while at:
            try:
                length = self._once(at, b"CN")
            except BlockError as broken:
                what = f"what follows its first {before} channels" if before else "all of its channels"
                self._found.lost(f"of the group at byte {owner}, {what}", broken)
                break
            channel = self._channel(at, length)
            if channel is not None:
                found.append(channel)
            before += 1
            at = self._link(at + 4)
        return found

    def _channel(self, at: int, length: int) -> Channel | None:
        """A channel; None for a type of values that nobody writes."""
        refused = ""
        is_source_lost = self._texts(at, (12,), "the description of a source", b"CE") is not None
        self._texts(at, (20,), "the comment of a channel")
        is_part_lost = self._texts(at, (16,), "the parts of a channel", b"CD") is not None
        if is_part_lost:
            refused = "its parts are lost"
        is_composed = bool(self._link(at + 16)) and not is_part_lost
        names = [218] * (length >= _LONG_NAME) + [222] * (length >= _DISPLAY_NAME)
        is_name_lost = self._texts(at, tuple(names), "the name of a channel") is not None
        if is_name_lost:
            refused = "its name is lost"
        conversion = self._converted(self._link(at + 8))
        if isinstance(conversion, str):
            refused, conversion = conversion, None
        kind, name, description, begin, bits, values = self._numbers("<H32s128s3H", at + 24)
        if values not in _TYPES:
            return None
        begin += 8 * (self._numbers("<H", at + 226)[0] if length == _FULL_CHANNEL else 0)
        long_name = self._link(at + 218) if length in (_LONG_NAME, _FULL_CHANNEL) and not is_name_lost else 0
        letter, is_big = _TYPES[values]
        comment = plain_text(self._text(self._link(at + 20)))
        return Channel(
            self._text(long_name) if long_name else name.decode("latin-1").strip(_BLANKS),
            plain_text(conversion.unit if conversion else "").strip("\0 \t\r\n"),
            short(comment or description.split(b"\0")[0].decode("latin-1")),
            () if is_source_lost else self._source(self._link(at + 12)),
            kind == _MASTER, is_time=True, is_virtual=False,
            is_number=letter != "V" and 0 < bits <= 64 and kind != _MASTER and not is_composed,
            field=Field(begin // 8, begin % 8, bits, letter, self._is_big_endian if is_big is None else is_big),
            invalidation_bit=None, is_invalid=False, conversion=conversion, refused=refused,
        )  # fmt: skip

    def _source(self, at: int) -> tuple[str, ...]:
        layout = _SOURCES.get(self._numbers("<H", at + 4)[0]) if at and at + 128 <= self._size else None
        if layout is None:
            return ()
        name, path = (t.decode("latin-1").strip(_BLANKS) for t in self._numbers(layout, at + 6))
        return (name or path,)

    def _conversion(self, at: int) -> Conversion:
        length = self._block(at, b"CC")
        kind, count = self._numbers("<HH", at + 42)
        need = 8 * _NUMBERS.get(kind, 0) + _BY_COUNT.get(kind, 0) * count
        is_known = kind in _NUMBERS or kind in _BY_COUNT or kind in (_FORMULA, _NO_CONVERSION)
        if not is_known or 46 + need > length:
            raise BlockError("CC", at, f"is damaged, it has {length} bytes for {count} numbers of type {kind}")
        unit = self._numbers("20s", at + 22)[0].decode("latin-1").strip(_BLANKS)
        if kind not in _KINDS:  # a table of texts leaves the number as it is
            return Conversion("same", unit)
        if kind == _FORMULA:
            text = bytes(self._data[at + 46 : at + length])
            return Conversion("formula", unit, formula=text.split(b"\0")[0].decode("latin-1"))
        return Conversion(_KINDS[kind], unit, self._numbers(f"<{need // 8}d", at + 46))
