"""Raw CAN frames in MDF: which there are, and their payloads."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aqualog.core.records import TimeArray
from aqualog.io.can import Dbc, pgn
from aqualog.io.mdf.blocks import Group, Stored
from aqualog.io.mdf.columns import is_sound_field, unpacked_blocks

__all__ = [
    "FRAME", "FrameGroup", "bus_of", "buses_of", "census_of", "codes_of", "frame_key", "frame_members", "frame_notes",
    "lengths_of", "merged", "variable_payloads",
]  # fmt: skip

FRAME = "CAN_DataFrame."
_EMPTY = np.uint64(2**63)  # code of a record without a frame: no bus and no id
_EXTENDED = np.uint64(1 << 32)  # in a frame code: id in bits 0-28, IDE in bit 32, bus from bit 33
_DLC_LENGTH = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64])
_LONGEST_PAYLOAD = 64
_SHOWN = 8  # ids listed in a note

_Array = NDArray[Any]
_Octets = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class FrameGroup:
    """A group of raw CAN frames: where its members are and the code (bus, IDE, id) of each frame."""

    index: int
    members: dict[str, int]
    codes: NDArray[np.uint64]


def frame_members(group: Group) -> dict[str, int]:
    """Channel index by member of the CAN data frame (`ID`, `DataBytes`, ...), or nothing."""
    members = {
        c.name.removeprefix(FRAME): i
        for i, c in enumerate(group.channels)
        if c.name.startswith(FRAME) and is_sound_field(c.field, group.size)
    }
    return members if {"ID", "DataBytes"} <= members.keys() else {}


def codes_of(
    group: Group, members: Mapping[str, int], pieces: Iterator[tuple[_Array, dict[int, _Array]]]
) -> tuple[NDArray[np.uint64], int]:
    """Code of each frame: bus, IDE flag and id in one integer; and how many records are no frames.

    `pieces` are times [s] and values of the members `ID`, `IDE` and `BusChannel`, as far as there are any.
    """
    default_bus = _bus_number(group)
    codes = [np.zeros(0, dtype=np.uint64)]
    empty, latest = 0, 0.0
    for t, columns in pieces:
        ids = columns[members["ID"]].astype(np.uint64)
        ide = np.zeros(len(t)) if "IDE" not in members else columns[members["IDE"]]
        extended = (ide != 0) | (ids >> np.uint64(31) != 0)
        if "IDE" not in members:
            extended |= ids > np.uint64(0x7FF)
        bus = np.full(len(t), default_bus) if "BusChannel" not in members else columns[members["BusChannel"]]
        ids &= np.uint64(0x1FFFFFFF)
        code = ids + _EXTENDED * extended.astype(np.uint64) + _EXTENDED * np.uint64(2) * bus.astype(np.uint64)
        # a page of the file that was never written is records of zeros: no frame, and a time gone by long ago
        before = np.maximum.accumulate(np.concatenate([[latest], np.nan_to_num(t)]))
        is_empty = (t == 0.0) & (ids == 0) & ~extended & (before[:-1] > 0.0)
        empty, latest = empty + int(is_empty.sum()), float(before[-1])
        codes.append(np.where(is_empty, _EMPTY, code))
    return np.concatenate(codes), empty


def _bus_number(group: Group) -> int:
    """Bus by the name of the group or its source (`CAN2`), for loggers that do not record it per frame."""
    for name in (*(group.source or ("", "")), group.name):
        number = re.search(r"(\d+)", name)
        if number:
            return int(number[1])
    return 0


def lengths_of(declared: _Array, stored: NDArray[np.int64], *, is_code: bool) -> NDArray[np.int64]:
    """Bytes of payloads (n,) that were sent, as far as the file holds them; `is_code`: declared as a DLC."""
    length = declared.astype(np.int64)
    if is_code:
        length = _DLC_LENGTH[np.clip(length, 0, 15)]
    return np.minimum(length, stored)


def variable_payloads(path: Path, values: Sequence[Stored], at: TimeArray) -> tuple[_Octets, NDArray[np.int64]]:
    """Payloads of variable length; each is stored as its length in 4 bytes, then its bytes.

    Parameters
    ----------
    path : Path
        The file with the values.
    values : sequence of Stored
    at : int64 array (n,)
        Where each begins. [bytes]

    Returns
    -------
    payloads : uint8 array (n, width)
        Filled up with zeros.
    stored : int64 array (n,)
        How many bytes of each are stored: none behind a cut.
    """
    if not len(at) or not np.all(at >= at[0]):
        return np.zeros((len(at), 0), dtype=np.uint8), np.zeros(len(at), dtype=np.int64)
    begin, end = int(at[0]), int(at[-1]) + 4 + _LONGEST_PAYLOAD
    parts: list[Any] = []
    place = 0
    for block in values:
        low, high = max(begin - place, 0), min(end - place, block.unpacked)
        place += block.unpacked
        if low < high and not block.packing:
            parts += unpacked_blocks(path, [Stored(block.address + low, high - low, high - low)])
        elif low < high:
            parts += [data[low:high] for data in unpacked_blocks(path, [block])]
    return _variable(np.frombuffer(b"".join(parts), dtype=np.uint8), at - begin)


def _variable(stored: _Octets, at: TimeArray) -> tuple[_Octets, NDArray[np.int64]]:
    padded = np.concatenate([stored, np.zeros(4 + _LONGEST_PAYLOAD, dtype=np.uint8)])
    at = np.minimum(at, len(stored))  # the zeros behind the end are an empty payload
    length = padded[at[:, None] + np.arange(4)].astype(np.int64) @ (1 << 8 * np.arange(4))
    width = int(min(length.max(initial=0), _LONGEST_PAYLOAD))
    octet = np.arange(width)
    payload: _Octets = np.where(octet < length[:, None], padded[at[:, None] + 4 + octet], 0).astype(np.uint8)
    return payload, np.clip(length, 0, np.minimum(width, np.maximum(len(stored) - at - 4, 0)))


def merged(parts: Sequence[tuple[TimeArray, _Array, _Array]], *, by_time: bool) -> tuple[TimeArray, _Array, _Array]:
    """Times, payloads and lengths of several parts below each other; by time where each part is in order."""
    if len(parts) == 1:
        return parts[0]
    width = max((p[1].shape[1] for p in parts), default=0)
    data = np.concatenate([np.pad(x, ((0, 0), (0, width - x.shape[1]))) for _, x, _ in parts])
    t_ns, length = np.concatenate([p[0] for p in parts]), np.concatenate([p[2] for p in parts])
    if by_time and all(np.all(np.diff(p[0]) >= 0) for p in parts):
        order = np.argsort(t_ns, kind="stable")
        return t_ns[order], data[order], length[order]
    return t_ns, data, length


def frame_key(code: int) -> tuple[int, bool]:
    """Id of a frame and whether it is extended."""
    return code & 0x1FFFFFFF, bool(code >> 32 & 1)


def bus_of(code: int) -> int:
    """Number of a frame's bus."""
    return code >> 33


def census_of(groups: Sequence[FrameGroup]) -> Counter[int]:
    """How many frames there are, by code."""
    census: Counter[int] = Counter()
    for group in groups:
        for code, count in zip(*np.unique(group.codes, return_counts=True), strict=True):
            census[int(code)] += int(count) if code != _EMPTY else 0
    return +census


def frame_notes(census: Counter[int], dbc: Dbc | None) -> list[str]:
    """Return notes on the frames of a file, and on what the DBC decodes of them."""
    if not census:
        return [] if dbc is None else ["holds no raw CAN frames; --dbc has no effect on it"]
    buses = sorted({bus_of(c) for c in census})
    where = f"bus {buses[0]}" if len(buses) == 1 else "buses " + ", ".join(map(str, buses))
    ids = len({frame_key(c) for c in census})
    total = f"{census.total()} raw CAN frames with {ids} ids on {where}"
    if dbc is None:
        return [f"holds {total}; give --dbc FILE to decode them"]
    return [*dbc.notes, *_match_notes(census, dbc, total)]


def _match_notes(census: Counter[int], dbc: Dbc, total: str) -> list[str]:
    """Return notes on what the DBC decodes and what it does not, with the reason where known."""
    seen = sorted({frame_key(c) for c in census})
    missed = [k for k in seen if k not in dbc.messages]
    frames = sum(n for c, n in census.items() if frame_key(c) in dbc.messages)
    text = f"{total}: {len(seen) - len(missed)} ids ({frames} frames) are in {', '.join(dbc.names)}"
    if missed:
        more = ", ..." if len(missed) > _SHOWN else ""
        text += f", {len(missed)} are not: " + ", ".join(_id_text(k) for k in missed[:_SHOWN]) + more
    groups = {pgn(i): m.name for (i, extended), m in dbc.messages.items() if extended}
    same_group = [k for k in missed if k[1] and pgn(k[0]) in groups]
    notes = [text]
    if same_group:
        names = ", ".join(f"{_id_text(k)} ({groups[pgn(k[0])]})" for k in same_group[:_SHOWN])
        notes.append(f"same J1939 parameter group but another sender or priority, not decoded: {names}")
    twins = [k for k in missed if (k[0], not k[1]) in dbc.messages]
    if twins:
        notes.append(
            f"the DBC has these ids with the other id length: {', '.join(_id_text(k) for k in twins[:_SHOWN])}"
        )
    return notes


def _id_text(key: tuple[int, bool]) -> str:
    return f"0x{key[0]:X}" + ("x" if key[1] else "")


def buses_of(census: Counter[int]) -> Mapping[tuple[int, bool], set[int]]:
    """Buses on which each frame is sent."""
    found: dict[tuple[int, bool], set[int]] = defaultdict(set)
    for code in census:
        found[frame_key(code)].add(bus_of(code))
    return found
