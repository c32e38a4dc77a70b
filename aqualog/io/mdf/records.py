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
    """One channel of a group.

    Parameters
    ----------
    name, unit, comment : str
    sources : tuple of str
        Names of what it comes from.
    is_master : bool
        Whether it is the time, or whatever the samples are over.
    is_time : bool
        Of a master, whether it is over time.
    is_virtual : bool
        Whether its raw values count the records and lie nowhere.
    is_number : bool
        Whether its samples are numbers of at most 64 bits.
    field : Field
    invalidation_bit : int or None
        Position behind the bytes of the record. [bit]
    is_invalid : bool
        Whether none of its samples is valid.
    conversion : Conversion or None
    refused : str
        Why it cannot be read although it should; empty if it can.
    values : tuple of Stored, or int
        Values of variable length, or the address of the group that holds them; empty for others.
    is_variable : bool
        Whether it has such values.
    """

    name: str
    unit: str
    comment: str
    sources: tuple[str, ...]
    is_master: bool
    is_time: bool
    is_virtual: bool
    is_number: bool
    field: Field
    invalidation_bit: int | None
    is_invalid: bool
    conversion: Conversion | None
    refused: str = ""
    values: tuple[Stored, ...] | int = ()
    is_variable: bool = False


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
    """A channel group and the data of the records that it is in.

    Parameters
    ----------
    at, owner : int
        Addresses of its block and of its data group.
    name : str
        Empty without one.
    source : tuple of str
        Names by which a bus can be known.
    record_id, id_size, behind : int
        What tells its records from others: the id, its size, and bytes behind a record. [bytes]
    cycles : int
        Number of records as declared, or as found where the declared number is wrong.
    size, invalidation : int
        Bytes of a record, and of its invalidation bits behind them. [bytes]
    channels : tuple of Channel
    data, invalid_data : tuple of Stored
        The records; invalidation bits where they are stored apart from them.
    is_bus_event, is_variable : bool
        Whether it holds bus frames; whether it holds nothing but values of variable length.
    master_at : int
        Address of the group that has its time; 0: it has its own.
    is_inferred : bool
        Whether its records were reconstructed from its channels: valid only if their time goes up.
    is_uncounted : bool
        Whether the number of its records is known only when they have been sorted.
    zeros : int
        Of the data of such a group, how many bytes at the end are zero. [bytes]
    """

    at: int
    owner: int
    name: str = ""
    source: tuple[str, ...] = ()
    record_id: int = 0
    id_size: int = 0
    behind: int = 0
    cycles: int = 0
    size: int = 0
    invalidation: int = 0
    channels: tuple[Channel, ...] = ()
    data: tuple[Stored, ...] = ()
    invalid_data: tuple[Stored, ...] = ()
    is_bus_event: bool = False
    is_variable: bool = False
    master_at: int = 0
    is_inferred: bool = False
    is_uncounted: bool = False
    zeros: int = 0

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
