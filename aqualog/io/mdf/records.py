"""What both walks make of an MDF file: groups of records, channels, conversions, and where the stored bytes are."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

__all__ = ["Channel", "Conversion", "ConversionKind", "Field", "FileHead", "Group", "Stored"]

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
