"""Check message definitions from a log before they are used.

The library writes Python from a definition and runs it, and its decoders follow what a definition declares. Only safe
parts reach it: names of letters, digits and underscores, known number types, and arrays of a bounded size. Constants,
which no message carries, do not reach it at all. A type that holds itself, or that can repeat without taking a byte of
the message, would keep a decoder busy without end.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from rosbags.interfaces import Nodetype

__all__ = ["MAX_TEXT", "RefusedError", "checked"]

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
