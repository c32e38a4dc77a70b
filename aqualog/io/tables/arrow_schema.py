"""Units in the metadata of the fields of an Arrow schema, as Parquet files carry it.

Writers such as pyarrow and pandas keep the schema as a FlatBuffers message under the key `ARROW:schema`; polars reads
the columns by it but does not show the metadata of a field. Only what is needed is decoded here.

Format: https://github.com/apache/arrow/blob/main/format/Schema.fbs [parquet2013]
"""

from __future__ import annotations

import base64
import binascii
import struct
from collections.abc import Iterator
from dataclasses import dataclass

__all__ = ["field_metadata"]

_CONTINUATION = b"\xff\xff\xff\xff"
_MESSAGE_HEADER = 2  # numbers of members in Schema.fbs and Message.fbs
_SCHEMA_FIELDS = 1
_FIELD_NAME, _FIELD_METADATA = 0, 6
_KEY, _VALUE = 0, 1


@dataclass(frozen=True, slots=True)
class _Table:
    """A FlatBuffers table: its members stand where the table of offsets before it says."""

    data: bytes
    at: int

    def member(self, number: int) -> int | None:
        """Position of a member, or None if it is not there."""
        offsets = self.at - _int(self.data, "<i", self.at)
        size = _int(self.data, "<H", offsets)
        slot = 4 + 2 * number
        offset = _int(self.data, "<H", offsets + slot) if slot < size else 0
        return self.at + offset if offset else None

    def text(self, number: int) -> str:
        """A string member."""
        at = self.member(number)
        if at is None:
            return ""
        start = at + _int(self.data, "<I", at)
        length = _int(self.data, "<I", start)
        return self.data[start + 4 : start + 4 + length].decode("utf-8")

    def table(self, number: int) -> _Table | None:
        """A table member."""
        at = self.member(number)
        return None if at is None else _Table(self.data, at + _int(self.data, "<I", at))

    def tables(self, number: int) -> Iterator[_Table]:
        """A member that is a list of tables."""
        at = self.member(number)
        if at is None:
            return
        start = at + _int(self.data, "<I", at)
        for k in range(_int(self.data, "<I", start)):
            slot = start + 4 + 4 * k
            yield _Table(self.data, slot + _int(self.data, "<I", slot))


def field_metadata(encoded: str, key: str) -> dict[str, str]:
    """Value of a key of the metadata of each field that has it; empty if the schema cannot be decoded.

    Parameters
    ----------
    encoded : str
        What stands under `ARROW:schema`.
    key : str
        Such as `unit`; upper and lower case are the same.
    """
    try:
        message = base64.b64decode(encoded)
        if message.startswith(_CONTINUATION):
            message = message[8:]
        else:
            message = message[4:]
        schema = _Table(message, _int(message, "<I", 0)).table(_MESSAGE_HEADER)
        return {} if schema is None else dict(_values(schema, key))
    except (binascii.Error, struct.error, UnicodeDecodeError, ValueError):
        return {}


def _values(schema: _Table, key: str) -> Iterator[tuple[str, str]]:
    for field in schema.tables(_SCHEMA_FIELDS):
        for pair in field.tables(_FIELD_METADATA):
            if pair.text(_KEY).casefold() == key:
                yield field.text(_FIELD_NAME), pair.text(_VALUE)


def _int(data: bytes, code: str, at: int) -> int:
    if at < 0:
        raise ValueError("offset before the start")
    return int(struct.unpack_from(code, data, at)[0])
