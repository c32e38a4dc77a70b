"""Decode raw CAN frames into signals, by the DBC files of the vehicle.

cantools parses the DBC and decodes one frame at a time in Python; here a signal is decoded from all payloads of its
message at once, with the same results to the last bit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aqualog.core.errors import LogError
from aqualog.core.records import BoolArray, FloatArray

__all__ = ["BitField", "Dbc", "decode_signal", "is_decodable", "load_dbc", "pgn", "selected"]

_Payload = NDArray[np.uint8]
_Raw = NDArray[np.uint64]
_FLOATS = {16: np.float16, 32: np.float32, 64: np.float64}


@dataclass(frozen=True, slots=True)
class BitField:
    """Where a signal lies in the payload.

    `octets` are the payload's bytes that hold it, the least significant first; `shift` counts the bits to drop below.
    """

    octets: tuple[int, ...]
    shift: int
    bits: int
    is_signed: bool
    is_float: bool

    @classmethod
    def of(cls, signal: Any) -> BitField:
        """The field of a cantools signal."""
        bits = int(signal.length)
        if signal.byte_order == "little_endian":
            first, last = signal.start // 8, (signal.start + bits - 1) // 8
            octets, shift = tuple(range(first, last + 1)), signal.start % 8
        else:  # the DBC gives the most significant bit, counted upwards inside each byte
            start = 8 * (signal.start // 8) + 7 - signal.start % 8
            end = start + bits - 1
            octets, shift = tuple(range(end // 8, start // 8 - 1, -1)), 7 - end % 8
        return cls(octets, shift, bits, bool(signal.is_signed), bool(signal.conversion.is_float))

    @property
    def needed(self) -> int:
        """Bytes a payload must have to carry the field."""
        return max(self.octets) + 1

    def unsigned(self, data: _Payload) -> _Raw:
        """The field's bits. `data` (n, width) must be wide enough."""
        value = data[:, self.octets[0]].astype(np.uint64) >> np.uint64(self.shift)
        for k, octet in enumerate(self.octets[1:], start=1):
            value |= data[:, octet].astype(np.uint64) << np.uint64(8 * k - self.shift)
        return value & np.uint64((1 << self.bits) - 1)

    def numbers(self, data: _Payload) -> NDArray[Any]:
        """Raw numbers: uint64, int64 or a float type."""
        value = self.unsigned(data)
        if self.is_float:
            width = _FLOATS[self.bits]
            return value.astype(f"<u{self.bits // 8}").view(width)
        if self.is_signed:
            up = np.uint64(64 - self.bits)
            return (value << up).view(np.int64) >> np.int64(64 - self.bits)
        return value


@dataclass(frozen=True, slots=True)
class Dbc:
    """Messages of one or more DBC files by (id, is extended)."""

    messages: Mapping[tuple[int, bool], Any]
    names: tuple[str, ...]
    notes: tuple[str, ...]


def load_dbc(paths: Sequence[Path]) -> Dbc:
    """Load DBC files; where two define the same id, the first one counts.

    Raises
    ------
    LogError
        If a file is missing or is not a DBC.
    """
    messages: dict[tuple[int, bool], Any] = {}
    notes: list[str] = []
    for path in paths:
        for message in _load(path):
            key = (int(message.frame_id), bool(message.is_extended_frame))
            if key in messages:
                notes.append(f"{path.name}: id 0x{key[0]:X} ({message.name}) is already {messages[key].name}; left out")
            elif message.is_container:
                notes.append(f"{path.name}: {message.name} holds other messages; not supported, left out")
            else:
                messages[key] = message
    return Dbc(messages, tuple(p.name for p in paths), tuple(notes))


def _load(path: Path) -> Sequence[Any]:
    import cantools.database
    from cantools.database.can.database import Database

    if path.exists() and not path.is_file():  # some devices have no end
        raise LogError("is a folder, a device or a pipe", where=str(path), expected="a .dbc file", hint="check --dbc")
    try:
        database = cantools.database.load_file(str(path), database_format="dbc", strict=False)
    except OSError as error:
        raise LogError(f"cannot be opened: {error.strerror}", where=str(path), hint="check --dbc") from error
    except Exception as error:  # cantools, its grammar and bitstruct raise many kinds
        reason = f"is not a DBC that cantools understands ({type(error).__name__}: {error})"
        raise LogError(reason, where=str(path), expected="a .dbc file", hint="check --dbc") from error
    if not isinstance(database, Database):
        raise LogError("is not a CAN database", where=str(path), expected="a .dbc file", hint="check --dbc")
    return list(database.messages)


def is_decodable(signal: Any) -> bool:
    """Whether a signal has a size that a number can have."""
    bits = int(signal.length)
    return bits in _FLOATS if signal.conversion.is_float else 1 <= bits <= 64


def decode_signal(message: Any, name: str, data: _Payload, length: NDArray[np.integer]) -> tuple[BoolArray, FloatArray]:
    """Decode one signal from all frames of its message.

    Parameters
    ----------
    message : cantools message
    name : str
        Signal of the message.
    data : array (n, width)
        Payloads, filled up behind `length`.
    length : array (n,)
        Bytes that were sent.

    Returns
    -------
    carried : bool array (n,)
        The frames whose multiplexer selects the signal and whose payload is long enough for it.
    values : float array (m,)
        Physical values of those frames, in their order.
    """
    signal = message.get_signal_by_name(name)
    carried = selected(message, signal, data, length) & (length >= BitField.of(signal).needed)
    if not carried.any():
        return carried, np.zeros(0)
    raw = BitField.of(signal).numbers(data[carried])
    with np.errstate(invalid="ignore", over="ignore"):  # a float signal may hold any bit pattern
        values = raw.astype(np.float64) * float(signal.conversion.scale) + float(signal.conversion.offset)
    return carried, values


def selected(message: Any, signal: Any, data: _Payload, length: NDArray[np.integer]) -> BoolArray:
    """The frames whose multiplexer, if the signal has one, selects the signal; also over several levels."""
    if not signal.multiplexer_ids or signal.multiplexer_signal is None:
        return np.ones(len(data), dtype=np.bool_)
    switch = message.get_signal_by_name(signal.multiplexer_signal)
    field = BitField.of(switch)
    chosen = selected(message, switch, data, length) & (length >= field.needed)
    if chosen.any():
        raw = field.numbers(data[chosen])
        chosen[chosen] = np.isin(raw, np.asarray(signal.multiplexer_ids).astype(raw.dtype))
    return chosen


def pgn(frame_id: int) -> int:
    """J1939 parameter group number of a 29-bit id."""
    group = (frame_id >> 8) & 0x3FFFF
    return group if (group >> 8) & 0xFF >= 240 else group & 0x3FF00
