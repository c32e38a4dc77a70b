"""What both walks through an MDF file have in common: the plan that they make of it, and how they go.

The plan is groups of records, channels, conversions, and where the stored bytes are. A walk checks every block that it
follows: whether it is there, is what its link says, and is linked once. What is cut or damaged is left out and noted.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal
from xml.etree import ElementTree

from aqualog.core.errors import LogError

__all__ = [
    "BlockError", "Channel", "Conversion", "ConversionKind", "Field", "FileHead", "Group", "Stored", "Survey", "Walk",
    "mapped", "plain_text", "short",
]  # fmt: skip


ConversionKind = Literal[
    "same", "linear", "rational", "polynomial", "exponential", "logarithmic", "formula", "interpolated", "nearest",
    "ranges", "texts", "texts of ranges", "from text",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Conversion:
    """From raw numbers to physical ones.

    `numbers` are as the file has them. `references` are what a table leads to: another conversion, a text, or None
    where the file has no link; the last one is for all other values.
    """

    kind: ConversionKind
    unit: str = ""
    numbers: tuple[float, ...] = ()
    references: tuple[Conversion | bytes | None, ...] = ()
    formula: str = ""


@dataclass(frozen=True, slots=True)
class Field:
    """Where a channel lies in a record: its first byte, its lowest bit in that byte, how many bits, and what they are.

    `letter` is that of NumPy (`u`, `i`, `f`), or `V` for plain bytes.
    """

    at: int
    shift: int
    bits: int
    letter: str
    is_big_endian: bool = False

    @property
    def octets(self) -> int:
        """Bytes that hold it."""
        return (self.shift + self.bits + 7) // 8


@dataclass(frozen=True, slots=True)
class Channel:
    """One channel of a group."""

    name: str
    unit: str
    comment: str
    sources: tuple[str, ...]  # names of what it comes from
    is_master: bool  # the time, or whatever the samples are over
    is_time: bool  # of a master: over time
    is_virtual: bool  # its raw values count the records and lie nowhere
    is_number: bool  # its samples are numbers of at most 64 bits
    field: Field
    invalidation_bit: int | None  # position behind the bytes of the record
    is_invalid: bool  # none of its samples is valid
    conversion: Conversion | None
    refused: str = ""  # why it cannot be read although it should
    values: tuple[Stored, ...] | int = ()  # of variable length, or the address of the group that holds them
    is_variable: bool = False  # whether it has such values


@dataclass(frozen=True, slots=True)
class Stored:
    """Bytes of a data block: where, how many, how many unpacked, packed how, and turned round over how many columns."""

    address: int
    size: int
    unpacked: int
    packing: Literal["", "deflate", "zstd", "lz4"] = ""
    columns: int = 0


@dataclass(frozen=True, slots=True)
class Group:
    """A channel group and the data of the records that it is in; sizes are bytes."""

    at: int  # address of its block
    owner: int  # address of its data group
    name: str = ""
    source: tuple[str, ...] = ()  # names by which a bus can be known
    record_id: int = 0
    id_size: int = 0  # of the id before each record
    behind: int = 0  # what stands behind each record
    cycles: int = 0  # number of records as declared, or as found where that is wrong
    size: int = 0  # of a record
    invalidation: int = 0  # of its invalidation bits
    channels: tuple[Channel, ...] = ()
    data: tuple[Stored, ...] = ()
    invalid_data: tuple[Stored, ...] = ()  # invalidation bits that are stored on their own
    is_bus_event: bool = False  # holds bus frames
    is_variable: bool = False  # holds nothing but values of variable length
    master_at: int = 0  # address of the group that has its time; 0: it has its own
    is_inferred: bool = False  # reconstructed from its channels: valid only if their time goes up
    is_uncounted: bool = False  # the number of its records is known only when they have been sorted
    zeros: int = 0  # at the end of the data of such a group

    @property
    def record(self) -> int:
        """Bytes of a record without its id."""
        return self.size + self.invalidation

    @property
    def unpacked(self) -> int:
        """Bytes of its data."""
        return sum(s.unpacked for s in self.data)

    @property
    def master(self) -> int | None:
        """Index of its time."""
        return max((i for i, c in enumerate(self.channels) if c.is_master), default=None)


@dataclass(slots=True)
class FileHead:
    """What stands in the head of a file: its start [ns since 1970], and whether that is local time."""

    start_ns: int = 0
    is_local: bool = False
    attachments: list[str] = field(default_factory=list)


_COMPLETE = "a complete MDF file"
_COPY_AGAIN = "copy it from the logger again or stop the recording properly"
_OWN_TOOL = "check it with the logger's own tool"
_MOST_NOTES = 30
_LARGEST_XML = 1 << 20


class BlockError(Exception):
    """A block that cannot be read: its kind as MDF names it (`CG`), where it is or should be [bytes], what is wrong.

    `is_cut`: whether the file ends before it does.
    """

    def __init__(self, kind: str, at: int, why: str, *, is_cut: bool = False) -> None:
        self.kind, self.at, self.why, self.is_cut = kind, at, why, is_cut
        super().__init__(f"its {kind} block at byte {at} {why}")


@dataclass(slots=True)
class Survey:
    """What a walk has found: the groups that can be read, and lost parts in words.

    `packed`: packed blocks of data by address. `unsorted`: size of records of several kinds in a row. [bytes]
    """

    groups: list[Group] = field(default_factory=list)
    head: FileHead = field(default_factory=FileHead)
    packed: dict[int, Stored] = field(default_factory=dict)
    unsorted: int = 0
    notes: list[str] = field(default_factory=list)
    truncated: bool = False
    finalised: bool = False
    lost_samples: int = 0

    def lost(self, what: str, broken: BlockError, samples: int = 0) -> None:
        """Note a part that is left out because of a block."""
        self.truncated = True
        self.lost_samples += samples
        self.remark(f"{what} is lost: {broken}")

    def remark(self, note: str) -> None:
        """A note; of very many the first ones are enough."""
        if len(self.notes) < _MOST_NOTES:
            self.notes.append(note)
        elif len(self.notes) == _MOST_NOTES:
            self.notes.append("more blocks are damaged than are listed here")

    def hopeless(self, path: Path, broken: BlockError) -> LogError:
        """Return the error for a file without any readable part."""
        if broken.is_cut:
            return LogError(f"file is cut: {broken}", where=str(path), expected=_COMPLETE, hint=_COPY_AGAIN)
        return LogError(f"file is damaged: {broken}", where=str(path), hint=_OWN_TOOL)


class Walk:
    """The file, bytes or mmap, what is found, and which blocks were seen."""

    def __init__(self, data: Any, path: Path) -> None:
        self._data, self._path, self._size = data, path, len(data)
        self._found = Survey()
        self._linked: set[int] = set()  # blocks that one link alone may lead to
        self._begins: set[int] = set()  # of all blocks seen
        self._conversions: dict[int, Conversion | str] = {}

    def _numbers(self, layout: str, at: int) -> tuple[Any, ...]:
        return struct.unpack_from(layout, self._data, at)

    def _block_head(self, name: str, at: int, layout: struct.Struct, mark: bytes) -> tuple[int, ...]:
        """Numbers behind the mark of a block, which must be the right one and inside the file."""
        if at + layout.size > self._size:
            raise BlockError(name, at, f"is missing, the file ends at byte {self._size}", is_cut=True)
        found, *numbers = layout.unpack_from(self._data, at)
        if found != mark:
            raise BlockError(name, at, f"is not there, the file holds {found!r}")
        return tuple(numbers)

    def _seen(self, name: str, at: int, size: int) -> None:
        if at + size > self._size:
            raise BlockError(name, at, f"is incomplete, the file ends at byte {self._size}", is_cut=True)
        self._begins.add(at)

    def _link_once(self, name: str, at: int) -> None:
        """A block of which there must be one link only: no cycles, and no tree that grows without end."""
        if at in self._linked:
            raise BlockError(name, at, "is linked twice")
        self._linked.add(at)

    def _converted(self, at: int) -> Conversion | str | None:
        """A conversion, or why raw numbers of a channel cannot be converted; None without one."""
        if at and at not in self._conversions:
            try:
                self._conversions[at] = self._conversion(at)
            except BlockError as broken:
                self._conversions[at] = f"its conversion cannot be read, {broken}"
        return self._conversions[at] if at else None

    def _conversion(self, at: int) -> Conversion:
        raise NotImplementedError


@contextmanager
def mapped(path: Path) -> Iterator[Any]:
    """The bytes of a file, without reading them."""
    with path.open("rb") as file:
        if file.seek(0, 2) == 0:
            yield b""
            return
        view = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        try:
            yield view
        finally:
            view.close()


def plain_text(text: str) -> str:
    """Content of a text that may be an XML comment; empty if that has definitions of its own, or is too long."""
    if not text.startswith("<"):
        return text
    if len(text) > _LARGEST_XML or "<!" in text.replace("<![CDATA[", "").replace("<!--", ""):
        return ""
    try:
        root = ElementTree.fromstring(text.replace(' xmlns="http://www.asam.net/mdf/v4"', ""))
    except ElementTree.ParseError:
        return ""
    content = root.find(".//TX")
    if content is not None:
        found = content.text or ""
    else:
        properties = root.find(".//common_properties")
        found = "\n".join(f"{e.get('name')}: {e.text}" for e in (() if properties is None else properties))
    return "" if found.startswith("<") else found


def short(text: str) -> str:
    """The first line of a comment, at most 120 characters."""
    return " ".join(text.strip().split("\n")[0].split())[:120]
