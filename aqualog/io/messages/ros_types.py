"""Types of ROS messages: which definitions are let in, and where the numbers of a message lie.

The library writes Python from a definition and runs it, and its decoders follow what a definition declares. Only safe
parts reach it: names of letters, digits and underscores, known number types, and arrays of a bounded size. Constants,
which no message carries, do not reach it at all. A type that holds itself, or that can repeat without taking a byte of
the message, would keep a decoder busy without end.

A few bytes of a message decide where the rest lies: the byte order (CDR) and the lengths of its texts and sequences.
Messages that agree in these and in their size are cut into columns without decoding them one by one.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype

from aqualog.core.records import FloatArray

__all__ = ["MAX_TEXT", "Field", "Layout", "RefusedError", "checked", "ros_layout"]


MAX_TEXT = 1 << 18
"""Longest definition that is parsed. [byte]"""

_TYPE = re.compile(r"[A-Za-z]\w{0,127}(?:/[A-Za-z]\w{0,127}){0,4}", re.ASCII)
_FIELD = re.compile(r"[A-Za-z]\w{0,127}", re.ASCII)
_SIZES = {
    "bool": 1, "byte": 1, "char": 1, "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4, "uint32": 4,
    "int64": 8, "uint64": 8, "float32": 4, "float64": 8, "float128": 16, "string": 4,
}  # fmt: skip
_MOST_FIELDS = 4096
_MOST_NUMBERS = 1 << 24  # of a fixed array
_MOST_ELEMENTS = 4096  # of a fixed array of texts or messages: each is a line of the decoder
_MOST_PARTS = 1 << 18  # of one message, all nested ones counted

Types = Mapping[str, Any]
Checked = dict[str, tuple[list[Any], list[Any]]]


class RefusedError(Exception):
    """A definition is not what a recorder writes; its text is the reason."""


def checked(types: Types) -> Checked:
    """The types without their constants.

    Parameters
    ----------
    types : mapping type -> (constants, fields)
        As the library parses definitions; all that they use must be among them.

    Raises
    ------
    RefusedError
        If a name, a base type, a size or the nesting is not one that a recorder writes.
    """
    known: dict[str, tuple[int, int]] = {}
    for name in types:
        _measure(name, types, known, ())
    return {name: ([], list(fields)) for name, (_, fields) in types.items()}


def _measure(name: str, types: Types, known: dict[str, tuple[int, int]], above: tuple[str, ...]) -> tuple[int, int]:
    """Least bytes of a message of a type, and its parts."""
    if name in known:
        return known[name]
    if name in above:
        raise RefusedError(f'type "{name}" holds itself')
    if not _TYPE.fullmatch(name):
        raise RefusedError(f"{name[:40]!r} is no name of a type")
    if name not in types:
        raise RefusedError(f'type "{name}" is not defined')
    fields = types[name][1]
    if len(fields) > _MOST_FIELDS:
        raise RefusedError(f'type "{name}" has {len(fields)} fields, more than {_MOST_FIELDS}')
    size, parts = 0, 1
    for field, detail in fields:
        if not isinstance(field, str) or not _FIELD.fullmatch(field) or "__" in field[:2]:
            raise RefusedError(f'{str(field)[:40]!r} in type "{name}" is no name of a field')
        own = _field(detail, f"{name}.{field}", types, known, (*above, name))
        size, parts = size + own[0], parts + own[1]
        if parts > _MOST_PARTS:
            raise RefusedError(f'type "{name}" has more than {_MOST_PARTS} parts')
    known[name] = size, parts
    return size, parts


def _field(
    detail: Any, where: str, types: Types, known: dict[str, tuple[int, int]], above: tuple[str, ...]
) -> tuple[int, int]:
    kind, inner = detail
    if kind == Nodetype.BASE:
        if inner[0] not in _SIZES:
            raise RefusedError(f'"{where}" is of type "{str(inner[0])[:40]}", which is not known')
        return _SIZES[inner[0]], 1
    if kind == Nodetype.NAME:
        return _measure(inner, types, known, above)
    element, count = inner
    size, parts = _field(element, where, types, known, above)
    is_plain = element[0] == Nodetype.BASE and element[1][0] != "string"
    if size == 0:
        raise RefusedError(f'the elements of "{where}" take no room in a message')
    if kind != Nodetype.ARRAY:
        return 4, 1 + parts
    most = _MOST_NUMBERS if is_plain else _MOST_ELEMENTS
    if not 0 < count <= most:
        raise RefusedError(f'"{where}" has {count} elements; at most {most} are taken')
    return size * count, 1 if is_plain else 1 + parts * count


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
    """Layout of messages like this one; None if its type has fields without a fixed place, or it is damaged.

    `types`: constants and fields by type, as rosbags parses definitions. `cdr`: ROS 2's encoding, which is aligned, in
    either byte order, and ends texts with a zero. ROS 1's has none of these.
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
