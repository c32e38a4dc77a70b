"""Read structures in Thrift's compact protocol, as in the footer and the page headers of a Parquet file.

A structure becomes a mapping of field numbers to values: numbers, bytes, lists and further structures. The caller knows
the meaning of a field. Unknown fields are kept, because their length is known only by reading them.

Format: https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md
"""

from __future__ import annotations

import struct
from typing import Any

__all__ = ["MalformedError", "Struct", "decode"]

Struct = dict[int, Any]

_TRUE, _FALSE, _BYTE, _I16, _I32, _I64, _DOUBLE, _BINARY, _LIST, _SET, _MAP, _STRUCT = range(1, 13)
_DEEPEST = 16  # Parquet's own structures are half as deep


class MalformedError(Exception):
    """Bytes that are no such structure; its text is the reason. `is_short`: more of them may be one."""

    def __init__(self, reason: str, *, is_short: bool = False) -> None:
        super().__init__(reason)
        self.is_short = is_short


def decode(data: bytes, at: int = 0) -> tuple[Struct, int]:
    """A structure, and where the bytes go on behind it.

    No more is built than the bytes hold: every element of a list takes one of them at least.

    Raises
    ------
    MalformedError
        If the bytes hold no such structure.
    """
    try:
        return _struct(data, at, 0)
    except (IndexError, struct.error) as error:
        raise MalformedError("it goes on behind its end", is_short=True) from error


def _struct(data: bytes, at: int, depth: int) -> tuple[Struct, int]:
    if depth > _DEEPEST:
        raise MalformedError("it is nested without end")
    out: Struct = {}
    number = 0
    while head := data[at]:
        at += 1
        if head >> 4:
            number += head >> 4
        else:
            number, at = _zigzag(data, at)
        kind = head & 15
        if kind in (_TRUE, _FALSE):
            out[number] = kind == _TRUE
        else:
            out[number], at = _value(data, at, kind, depth)
    return out, at + 1


def _value(data: bytes, at: int, kind: int, depth: int) -> tuple[Any, int]:
    if kind in (_I16, _I32, _I64):
        return _zigzag(data, at)
    if kind == _BINARY:
        size, at = _varint(data, at)
        if at + size > len(data):
            raise MalformedError("a text in it goes on behind its end", is_short=True)
        return data[at : at + size], at + size
    if kind == _STRUCT:
        return _struct(data, at, depth + 1)
    if kind in (_LIST, _SET):
        return _list(data, at, depth + 1)
    if kind == _DOUBLE:
        return struct.unpack_from("<d", data, at)[0], at + 8
    if kind in (_BYTE, _TRUE, _FALSE):  # the latter two in lists
        return data[at], at + 1
    if kind == _MAP:
        return _map(data, at, depth + 1)
    raise MalformedError(f"type {kind} is not known")


def _list(data: bytes, at: int, depth: int) -> tuple[list[Any], int]:
    if depth > _DEEPEST:
        raise MalformedError("it is nested without end")
    count, kind = data[at] >> 4, data[at] & 15
    at += 1
    if count == 15:
        count, at = _varint(data, at)
    out = []
    for _ in range(count):
        value, at = _value(data, at, kind, depth)
        out.append(value)
    return out, at


def _map(data: bytes, at: int, depth: int) -> tuple[list[Any], int]:
    """Keys and values by turns."""
    if depth > _DEEPEST:
        raise MalformedError("it is nested without end")
    count, at = _varint(data, at)
    kinds = data[at] if count else 0
    at += 1 if count else 0
    out = []
    for _ in range(count):
        for kind in (kinds >> 4, kinds & 15):
            value, at = _value(data, at, kind, depth)
            out.append(value)
    return out, at


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        octet = data[at]
        at += 1
        value |= (octet & 127) << shift
        if octet < 128:
            return value, at
        shift += 7
        if shift > 63:
            raise MalformedError("a number in it is longer than 64 bits")


def _zigzag(data: bytes, at: int) -> tuple[int, int]:
    value, at = _varint(data, at)
    return (value >> 1) ^ -(value & 1), at
