"""Read ROS 1 bags record by record: one that was never closed or indexed is read up to its end.

A bag has no checksums but those of bz2 and lz4: an altered value in a plain chunk cannot be detected.

Format: http://wiki.ros.org/Bags/Format/2.0 [rosbag2010]
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO, Literal

from aqualog.core.errors import LogError
from aqualog.io.decompress import LONGEST, DamagedError, unpack
from aqualog.io.messages.batches import Message
from aqualog.io.messages.codecs import codec_for
from aqualog.io.messages.streams import Stream
from aqualog.io.messages.walk import ChunkSource, RecordWalk

__all__ = ["CHUNK", "INDEX", "MAGIC", "BagSource", "BagWalk", "kind_of"]

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, BAG, INDEX, CHUNK, CHUNK_INFO, CONNECTION = range(2, 8)
"""Kinds of records."""

Head = Mapping[bytes, bytes]

_U32 = struct.Struct("<I")
_LONGEST_HEAD = 1 << 16  # [byte]
_CHUNK_MARK = b"\x04\0\0\0op=" + bytes([CHUNK])
_BEFORE_MARK = 80  # bytes: how far before that field the head of a chunk may begin
_PAIR = struct.Struct("<II")


class BagWalk(RecordWalk[Head]):
    """One pass over a bag from a place on."""

    overlap = _BEFORE_MARK + len(_CHUNK_MARK)

    def _has_body(self, head: Head) -> bool:
        return kind_of(head) != INDEX

    def _record_at(self, offset: int) -> tuple[Head, int, int] | None:
        self._file.seek(offset)
        raw = self._file.read(4)
        if len(raw) < 4 or (size := _U32.unpack(raw)[0]) > min(self._size - offset, _LONGEST_HEAD):
            return None
        head = head_fields(self._file.read(size))
        raw = self._file.read(4)
        if head is None or not MESSAGE <= kind_of(head) <= CONNECTION or len(raw) < 4:
            return None
        start = offset + size + 8
        end = start + int(_U32.unpack(raw)[0])
        known = self._known(offset + 1)
        is_long = kind_of(head) != INDEX and end - start > LONGEST
        return None if is_long or end > (self._size if known is None else known) else (head, start, end)

    def _chunk_in(self, block: bytes, offset: int) -> int | None:
        mark = block.find(_CHUNK_MARK)
        while mark >= 0:
            found = self._head_before(offset + mark, offset)
            if found is not None:
                return found
            mark = block.find(_CHUNK_MARK, mark + 1)
        return None

    def _head_before(self, mark: int, least: int) -> int | None:
        """Where the chunk begins whose kind stands at `mark`."""
        for start in range(mark - 4, max(least, mark - _BEFORE_MARK) - 1, -1):
            found = self._record_at(start)
            if found is not None and kind_of(found[0]) == CHUNK and {b"size", b"compression"} <= found[0].keys():
                return start
        return None


class BagSource(ChunkSource[Head]):
    """One ROS 1 bag as a source of messages. Where it has a sound index, `streams` takes the counts from it.

    Raises
    ------
    LogError
        If it is encrypted.
    """

    missing = "connection records"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._connections: dict[int, tuple[str, str, bytes]] = {}

    def streams(self) -> Sequence[Stream]:
        """All connections with messages that can be decoded."""
        with self.path.open("rb") as file:
            chunks = self._index(file)
            samples = self._scan(file) if chunks is None else self._sample(file, chunks, 1)
        topics = ((i, topic) for i, (topic, _, _) in sorted(self._connections.items()))
        return self._listed(topics, lambda i: codec_for("ros1", "ros1msg", *self._connections[i][1:]), samples)

    def _index(self, file: BinaryIO) -> dict[int, frozenset[int]] | None:
        """Return the chunks and the connections in them by the index at the end; None without a whole index."""
        _, head, _ = next(iter(self._records(file)), (0, {}, b""))
        start = number(head, b"index_pos", 8)
        if head.get(b"encryptor"):
            raise LogError("is encrypted", where=str(self.path), expected="a plain bag", hint="rosbag decrypt")
        if kind_of(head) != BAG or not start or start >= self._size:
            return None
        chunks: dict[int, frozenset[int]] = {}
        counts: dict[int, int] = {}
        records = self._records(file, start)
        is_pure = True
        for _, record, data in records:
            is_pure &= kind_of(record) in (CONNECTION, CHUNK_INFO)
            at = number(record, b"chunk_pos", 8)
            if kind_of(record) == CONNECTION:
                self._note_connection(record, data)
            elif kind_of(record) == CHUNK_INFO and at is not None and at < start and len(data) % _PAIR.size == 0:
                pairs = list(_PAIR.iter_unpack(data))
                chunks[at] = frozenset(connection for connection, _ in pairs)
                for connection, count in pairs:
                    counts[connection] = counts.get(connection, 0) + count
        is_whole = is_pure and not records.gaps and len(chunks) == number(head, b"chunk_count")
        # bytes too many or too few before it move the last chunk at least
        is_whole = is_whole and all(self._chunk_at(file, at) for at in {min(chunks, default=0), max(chunks, default=0)})
        if not is_whole or len(self._connections) != number(head, b"conn_count") or counts.keys() - self._connections:
            self._connections = {}
            return None
        self._counts, self._chunks, self._indexed = counts, tuple(chunks), True
        return chunks

    def _is_described(self, stream_id: int) -> bool:
        return stream_id in self._connections

    def _records(self, file: BinaryIO, start: int = len(MAGIC)) -> BagWalk:
        return BagWalk(file, self._size, start, self._chunks)

    def _kind(self, head: Head) -> Literal["chunk", "index", "other"]:
        kind = kind_of(head)
        return "chunk" if kind == CHUNK else "index" if kind == INDEX else "other"

    def _outside(
        self, offset: int, head: Head, body: bytes, ids: frozenset[int] | None, file: BinaryIO
    ) -> Iterator[Message]:
        kind = kind_of(head)
        if kind == MESSAGE and (message := _message(head, body)) is not None:
            if ids is None or message[0] in ids:
                yield message
        elif kind == CONNECTION:
            self._note_connection(head, body)
        elif kind == BAG and not 0 < (number(head, b"index_pos", 8) or 0) < self._size:
            self.truncated = True
            self._notes.append(f"{self.path.name}: the bag was never closed or is cut off; it has no index")

    def _count_lost(self, head: Head, body: bytes) -> bool:
        connection, count = number(head, b"conn"), number(head, b"count")
        if connection is not None:
            self._lost[connection] = self._lost.get(connection, 0) + (count or 0)
        return connection is not None

    def _chunk(self, offset: int, head: Head, body: bytes, ids: frozenset[int] | None) -> Sequence[Message]:
        try:
            size = _U32.unpack(head[b"size"])[0]
            found = list(self._split(unpack(body, head[b"compression"].decode(), size, self._allowance)))
        except (DamagedError, KeyError, struct.error, UnicodeDecodeError) as error:
            self._damaged[offset] = str(error)
            return []
        return [m for m in found if ids is None or m[0] in ids]

    def _split(self, data: bytes) -> Iterator[Message]:
        position, size = 0, len(data)
        while position < size:
            head_size = _U32.unpack_from(data, position)[0]
            head = head_fields(data[position + 4 : position + 4 + head_size])
            position += 4 + head_size
            start = position + 4
            position = start + _U32.unpack_from(data, position)[0]
            if head is None or position > size:
                raise DamagedError("a record is longer than its chunk")
            kind = kind_of(head)
            if kind == MESSAGE:
                message = _message(head, data[start:position])
                if message is None:
                    raise DamagedError("a message has no connection or no time")
                yield message
            elif kind == CONNECTION:
                self._note_connection(head, data[start:position])
            else:
                raise DamagedError(f"a record of kind {kind} stands in a chunk")

    def _note_connection(self, head: Head, data: bytes) -> None:
        fields, connection = head_fields(data), number(head, b"conn")
        if fields is None or connection is None or not {b"type", b"message_definition"} <= fields.keys():
            return
        topic = head.get(b"topic", fields.get(b"topic", b"")).decode(errors="replace")
        topic = "/" * topic.startswith("/") + "/".join(part for part in topic.split("/") if part)
        msgtype = fields[b"type"].decode(errors="replace")
        self._connections.setdefault(connection, (topic, msgtype, fields[b"message_definition"]))


def _message(head: Head, data: bytes) -> Message | None:
    connection, time = number(head, b"conn"), head.get(b"time", b"")
    if connection is None or len(time) != _PAIR.size:
        return None
    seconds, nanoseconds = _PAIR.unpack(time)
    return connection, seconds * 1_000_000_000 + nanoseconds, data


def head_fields(data: bytes) -> dict[bytes, bytes] | None:
    """Fields of a record's head, `<size>name=value`; None if they do not fill it."""
    fields: dict[bytes, bytes] = {}
    position, size = 0, len(data)
    while position + 4 <= size:
        start = position + 4
        position = start + _U32.unpack_from(data, position)[0]
        name, sign, value = data[start:position].partition(b"=")
        if position > size or not sign:
            return None
        fields[name] = value
    return fields if position == size else None


def kind_of(head: Head) -> int:
    """What a record is."""
    return int.from_bytes(head.get(b"op", b"")[:2], "little")


def number(head: Head, name: bytes, size: int = 4) -> int | None:
    """A field that is a whole number of so many bytes; None if it is not."""
    value = head.get(name, b"")
    return int.from_bytes(value, "little") if len(value) == size else None
