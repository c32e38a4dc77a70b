"""Walk through the blocks of MDF 3: ID, HD, then DG, CG, CN with their conversions and texts, and the records."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, NamedTuple

from aqualog.io.mdf_survey import BlockError, Survey, Walk

__all__ = ["survey3"]

_HD = 64
_LEAST = {b"HD": 164, b"DG": 24, b"CG": 26, b"CN": 218, b"CC": 46, b"CE": 6, b"TX": 4, b"TR": 10, b"CD": 8}
_LONG_NAME, _DISPLAY_NAME = 222, 226  # length of a channel block with such a link before
# numbers that follow the head of a conversion, by its type
_NUMBERS = {0: 2, 6: 6, 7: 7, 8: 7, 9: 6}
_BY_COUNT = {1: 16, 2: 16, 11: 40, 12: 20}  # [bytes] an entry of a table
_FORMULA = 10
_HEAD = struct.Struct("<2sH")
_NO_CONVERSION = 65535


class _Group(NamedTuple):
    """What is needed of a channel group."""

    at: int
    record: int
    cycles: int


def survey3(data: Any, path: Path) -> Survey:
    """Walk through a file.

    Parameters
    ----------
    data : buffer of bytes
        The file's content.
    path : Path
        For errors.

    Raises
    ------
    LogError
        If nothing of the file can be read.
    """
    return _Walk(data, path).run()


class _Walk(Walk):
    def __init__(self, data: Any, path: Path) -> None:
        super().__init__(data, path)
        self._declared: list[tuple[int, int, int, list[_Group]]] = []

    def run(self) -> Survey:
        try:
            self._block(_HD, b"HD")
        except BlockError as broken:
            raise self._found.hopeless(self._path, broken) from broken
        self._texts(_HD, (8, 12), "the file's comment")
        self._groups()
        for owner, records, id_size, groups in self._declared:
            self._measured(owner, records, id_size, groups)
        return self._found

    def _block(self, at: int, kind: bytes) -> int:
        """Length of a block of this kind, inside the file."""
        name = kind.decode()
        (length,) = self._head(name, at, _HEAD, kind)
        if length < _LEAST[kind]:
            raise BlockError(name, at, f"is damaged, it has {length} bytes")
        self._seen(name, at, length)
        return length

    def _once(self, at: int, kind: bytes) -> int:
        """The same, of which there must be one link only."""
        length = self._block(at, kind)
        self._link_once(kind.decode(), at)
        return length

    def _link(self, at: int) -> int:
        return int(struct.unpack_from("<I", self._data, at)[0])

    def _texts(self, at: int, places: tuple[int, ...], what: str, kind: bytes = b"TX") -> BlockError | None:
        """Look at what links lead to; a damaged one is not followed."""
        found = None
        for place in places:
            to = self._link(at + place)
            if to:
                try:
                    self._block(to, kind)
                except BlockError as broken:
                    self._found.patch(at + place, "<I", 0)
                    self._found.remark(f"{what} is left out: {broken}")
                    self._found.truncated |= broken.is_cut
                    found = broken
        return found

    def _groups(self) -> None:
        place, kept = _HD + 4, 0
        first: BlockError | None = None
        at = self._link(place)
        while at:
            try:
                self._once(at, b"DG")
            except BlockError as broken:
                self._found.patch(place, "<I", 0)
                self._found.lost("what follows the first " + (f"{kept} groups" if kept else "block"), broken)
                first = first or broken
                break
            following = self._link(at + 4)
            try:
                self._group(at)
            except BlockError as broken:
                self._found.patch(place, "<I", following)
                self._found.lost("a group", broken)
                first = first or broken
            else:
                place, kept = at + 4, kept + 1
            at = following
        if first is not None and not kept:
            raise self._found.hopeless(self._path, first)

    def _group(self, owner: int) -> None:
        self._texts(owner, (12,), "a trigger", b"TR")
        records, count, id_size = struct.unpack_from("<IHH", self._data, owner + 16)
        if id_size > 2:
            raise BlockError("DG", owner, f"is damaged, its records have ids of {id_size} bytes")
        if count > 1 and not id_size:
            raise BlockError("DG", owner, f"is damaged, it has {count} kinds of records without ids")
        groups: list[_Group] = []
        at = self._link(owner + 8)
        for _ in range(count):
            # records of a group that is lost could not be told from the others
            try:
                self._once(at, b"CG")
            except BlockError as broken:
                if not (broken.is_cut and count == 1 and not id_size):
                    raise
                groups.append(self._cut_group(records, broken))
                break
            _, _, record, cycles = struct.unpack_from("<HHHI", self._data, at + 16)
            groups.append(_Group(at, record, cycles))
            self._texts(at, (12,), "a group's comment")
            self._channels(at)
            at = self._link(at + 4)
        self._declared.append((owner, records, id_size, groups))

    def _cut_group(self, records: int, broken: BlockError) -> _Group:
        """Rebuild a group whose own block is cut at the end of the file, if the size of its records is left.

        Libraries write this block last. The start of the next block gives the number of records. The reader checks it
        by their time.
        """
        at = broken.at
        if at + 22 > self._size or self._data[at : at + 2] != b"CG" or at in self._linked:
            raise broken
        self._linked.add(at)
        first, text, _, channels, record = struct.unpack_from("<IIHHH", self._data, at + 8)
        self._channels(at)
        end = min((b for b in self._begins if b > records), default=self._size)
        if not record or not records or (end - records) % record:
            raise broken
        cycles = (end - records) // record
        if at + 26 <= self._size and self._link(at + 22) != cycles:
            raise broken
        self._found.patches[at] = struct.pack("<2sHIIIHHHI", b"CG", 26, 0, first, text, 0, channels, record, cycles)
        self._texts(at, (12,), "a group's comment")
        self._found.inferred.add(at)
        self._found.truncated = True
        self._found.remark(f"{broken}; the start of the next block gives the number of its records: {cycles}")
        return _Group(at, record, cycles)

    def _measured(self, owner: int, records: int, id_size: int, groups: list[_Group]) -> None:
        declared = sum(g.cycles * (g.record + id_size) for g in groups)
        begins = self._begins | {r for _, r, _, _ in self._declared}
        end = min((b for b in begins if b > records), default=self._size)
        there = max(end - records, 0) if records else 0
        self._found.inflated |= {g.at: min(declared, there) for g in groups}
        if id_size:
            self._found.unsorted += min(declared, there)
        if declared > there:
            next_one = "the file ends" if end == self._size else "another block begins"
            why = f"begin there and take {declared} bytes, {next_one} at byte {end}"
            self._found.lost(f"a part of the records of the group at byte {owner}", BlockError("data", records, why))
        if declared > there and end < self._size and not id_size and len(groups) == 1 and groups[0].record:
            # what is read beyond would be the next block, taken for numbers
            fits = there // groups[0].record
            self._found.patch(groups[0].at + 22, "<I", fits)
            self._found.lost_samples += groups[0].cycles - fits
            return
        for group in groups:
            if group.cycles and group.record + id_size > there:
                self._found.patch(group.at + 22, "<I", 0)
                self._found.lost_samples += group.cycles

    def _channels(self, owner: int) -> None:
        place, before = owner + 8, 0
        at = self._link(place)
        while at:
            try:
                length = self._once(at, b"CN")
            except BlockError as broken:
                self._found.patch(place, "<I", 0)
                what = f"what follows its first {before} channels" if before else "all of its channels"
                self._found.lost(f"of the group at byte {owner}, {what}", broken)
                return
            self._channel(at, length)
            before += 1
            place, at = at + 4, self._link(at + 4)

    def _channel(self, at: int, length: int) -> None:
        self._texts(at, (12,), "the description of a source", b"CE")
        self._texts(at, (20,), "the comment of a channel")
        if self._texts(at, (16,), "the parts of a channel", b"CD") is not None:
            self._found.refused[at] = "its parts are lost"
        names = [218] * (length >= _LONG_NAME) + [222] * (length >= _DISPLAY_NAME)
        if self._texts(at, tuple(names), "the name of a channel") is not None:
            self._found.refused[at] = "its name is lost"
        conversion = self._link(at + 8)
        if conversion:
            reason = self._conversion_fault(conversion)
            if reason is not None:
                self._found.patch(at + 8, "<I", 0)
                self._found.refused[at] = reason

    def _conversion_fault(self, at: int) -> str | None:
        """Why raw numbers of a channel cannot be converted, or None."""
        if at not in self._conversions:
            self._conversions[at] = None
            try:
                length = self._block(at, b"CC")
                kind, count = struct.unpack_from("<HH", self._data, at + 42)
                need = 8 * _NUMBERS.get(kind, 0) + _BY_COUNT.get(kind, 0) * count
                is_known = kind in _NUMBERS or kind in _BY_COUNT or kind in (_FORMULA, _NO_CONVERSION)
                if not is_known or 46 + need > length:
                    raise BlockError("CC", at, f"is damaged, it has {length} bytes for {count} numbers of type {kind}")
            except BlockError as broken:
                self._conversions[at] = f"its conversion cannot be read, {broken}"
        return self._conversions[at]
