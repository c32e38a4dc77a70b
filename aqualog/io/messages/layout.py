"""Find where the numbers of a ROS message lie, if every message of its type and lengths has them at the same place.

A few bytes of a message decide where the rest lies: the byte order (CDR) and the lengths of its texts and sequences.
Messages that agree in these and in their size are cut into columns without decoding them one by one.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype

from aqualog.core.records import FloatArray

__all__ = ["Field", "Layout", "ros_layout"]

_CODES = {
    "bool": "?", "byte": "i1", "char": "u1", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
_MOST_STEPS = 4096  # elements and fields beyond which a message is no set of signals
_PREFIX = 4  # bytes before the content of a CDR message: two of its kind and byte order, two of options

FieldPath = tuple[str | int, ...]
Span = tuple[int, int]
Block = NDArray[np.void]


@dataclass(frozen=True, slots=True)
class Field:
    """Where a number lies in a message: its first byte and its type."""

    at: int
    dtype: np.dtype[Any]

    def of(self, block: Block) -> NDArray[Any]:
        """This number of each message (n,), without a copy."""
        return np.ndarray(block.shape, self.dtype, block, offset=self.at, strides=block.strides)

    def floats(self, block: Block) -> FloatArray:
        """This number of each message (n,)."""
        found = self.of(block)
        return (found.view(np.uint8) != 0 if self.dtype.kind == "b" else found).astype(np.float64)


@dataclass(frozen=True, slots=True)
class Layout:
    """How messages like `example` are laid out.

    `steering` are the bytes that decide where others lie; `texts` those that have to be text; any value may stand in
    all the rest. `runs` maps a field to its first number and to how many there are, None if it is no array.
    """

    example: bytes
    steering: tuple[Span, ...]
    texts: tuple[Span, ...]
    runs: Mapping[FieldPath, tuple[Field, int | None]]

    def field(self, path: FieldPath) -> Field | None:
        """Where a field lies; None if such a message has it not, or not as a number."""
        found, count = self.runs.get(path, (None, 0))
        if found is not None:
            return found if count is None else None
        found, count = self.runs.get(path[:-1], (None, 0))
        step = path[-1]
        if found is None or count is None or not isinstance(step, int) or step >= count:
            return None
        return Field(found.at + step * found.dtype.itemsize, found.dtype)

    def holds(self, block: Block) -> bool:
        """Whether all these messages, each as long as the example, are laid out like it."""
        if _alike(block, self.example, _merged([*self.steering, *self.texts])):
            return True
        # Plain ASCII is text whatever it says; of anything else that is new the decoder has to judge.
        octets = block.view(np.uint8).reshape(block.size, block.itemsize)
        return _alike(block, self.example, self.steering) and all(
            _alike(block, self.example, [(a, b)]) or bool((octets[:, a:b] < 0x80).all()) for a, b in self.texts
        )

    def drawn(self, count: int) -> Iterator[bytes]:
        """Messages that are laid out like the example, with anything in all other places; always the same ones."""
        rng = np.random.default_rng(0)
        octets = np.frombuffer(self.example, np.uint8)
        for _ in range(count):
            message = rng.integers(0, 256, octets.size, dtype=np.uint8)
            for a, b in self.steering:
                message[a:b] = octets[a:b]
            for a, b in self.texts:
                message[a:b] %= 0x80
            yield message.tobytes()


def _alike(block: Block, example: bytes, spans: Iterable[Span]) -> bool:
    for start, end in spans:
        while start < end:
            size = next(s for s in (8, 4, 2, 1) if s <= end - start)
            word = Field(start, np.dtype(f"<u{size}")).of(block)
            if (word != int.from_bytes(example[start : start + size], "little")).any():
                return False
            start += size
    return True


def _merged(spans: Sequence[Span]) -> tuple[Span, ...]:
    merged: list[Span] = []
    for start, end in sorted(spans):
        if merged and start == merged[-1][1]:
            merged[-1] = (merged[-1][0], end)
        elif start < end:
            merged.append((start, end))
    return tuple(merged)


class _NotFixedError(Exception):
    """A message holds what has no fixed place."""


def ros_layout(types: Mapping[str, Any], msgtype: str, data: bytes, *, cdr: bool) -> Layout | None:
    """Layout of messages like this one.

    Parameters
    ----------
    types : mapping
        Constants and fields by type, as rosbags parses definitions.
    msgtype : str
        The message's type.
    data : bytes
        A message.
    cdr : bool
        ROS 2's encoding: aligned, in either byte order, texts end with a zero. ROS 1's has none of these.

    Returns
    -------
    Layout or None
        None if the type has fields without a fixed place, or the message is damaged.
    """
    walk = _Walk(types, data, cdr=cdr)
    try:
        walk.message(msgtype, ())
    except (_NotFixedError, struct.error, RecursionError):
        return None
    if walk.position > len(data):
        return None
    return Layout(data, _merged(walk.steering), _merged(walk.texts), walk.runs)


class _Walk:
    """One pass over a message along its type."""

    def __init__(self, types: Mapping[str, Any], data: bytes, *, cdr: bool) -> None:
        self.steering: list[Span] = [(0, 2)] if cdr else []
        self.texts: list[Span] = []
        self.runs: dict[FieldPath, tuple[Field, int | None]] = {}
        self.position = _PREFIX if cdr else 0
        self._types = types
        self._data = data
        self._cdr = cdr
        self._order = ">" if cdr and data[1:2] == b"\0" else "<"
        self._steps = 0

    def message(self, msgtype: str, path: FieldPath) -> None:
        for name, field in self._types[msgtype][1]:
            self._field(field, (*path, name))

    def _field(self, field: Any, path: FieldPath) -> None:
        self._steps += 1
        if self._steps > _MOST_STEPS:
            raise _NotFixedError
        kind, detail = field
        if kind == Nodetype.NAME:
            self.message(detail, path)
        elif kind == Nodetype.BASE and detail[0] == "string":
            self._text()
        elif kind == Nodetype.BASE:
            self._numbers(detail[0], None, path)
        elif kind == Nodetype.ARRAY:
            self._elements(detail[0], detail[1], path)
        else:
            self._elements(detail[0], self._length(), path)

    def _elements(self, field: Any, count: int, path: FieldPath) -> None:
        kind, detail = field
        if kind == Nodetype.BASE and detail[0] != "string":
            self._numbers(detail[0], count, path)
            return
        for i in range(count):
            self._field(field, (*path, i))

    def _numbers(self, base: str, count: int | None, path: FieldPath) -> None:
        if base not in _CODES:
            raise _NotFixedError
        dtype = np.dtype(self._order + _CODES[base])
        if count != 0:
            self._align(dtype.itemsize)
        self.runs[path] = Field(self.position, dtype), count
        self.position += dtype.itemsize * (1 if count is None else count)

    def _text(self) -> None:
        end = self._length() + self.position
        last = end - 1 if self._cdr else end  # a zero stands behind the text
        if last < self.position or end > len(self._data):
            raise _NotFixedError
        self.texts.append((self.position, last))
        self.steering.append((last, end))
        self.position = end

    def _length(self) -> int:
        self._align(4)
        (length,) = struct.unpack_from(f"{self._order}I", self._data, self.position)
        self.steering.append((self.position, self.position + 4))
        self.position += 4
        return int(length)

    def _align(self, size: int) -> None:
        if self._cdr:
            self.position += -(self.position - _PREFIX) % size
