"""Read ROS 1 bags record by record: one that was never closed or indexed is read up to its end.

A damaged chunk or a wrong length costs that chunk only. A bag has no checksums but those of bz2 and lz4: an altered
value in a plain chunk cannot be detected.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

from aqualog.core.errors import LogError
from aqualog.io.bag_records import (
    BAG,
    CHUNK,
    CHUNK_INFO,
    CONNECTION,
    INDEX,
    MESSAGE,
    BagRecords,
    Head,
    head_fields,
    kind_of,
    number,
)
from aqualog.io.batches import Batch, Message, batched, damage_notes, gap_note
from aqualog.io.messages import SAMPLES, Stream, UndecodableError, codec_for, make_stream
from aqualog.io.unpack import Allowance, DamagedError, unpack

__all__ = ["BagSource"]

_U32 = struct.Struct("<I")
_PAIR = struct.Struct("<II")


class BagSource:
    """One ROS 1 bag as a source of messages. Where it has a sound index, `streams` takes the counts from it.

    Raises
    ------
    LogError
        If it is encrypted.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.truncated = False
        self.unassigned = 0
        self.unfinalised = False
        self._notes: list[str] = []
        self._damaged: dict[int, str] = {}
        self._lost: dict[int, int] = {}
        self._size = path.stat().st_size
        self._connections: dict[int, tuple[str, str, bytes]] = {}
        self._counts: dict[int, int] = {}
        self._chunks: tuple[int, ...] = ()  # by the index
        self._indexed = False
        self._allowance = Allowance()

    def streams(self) -> Sequence[Stream]:
        """All connections with messages that can be decoded."""
        with self.path.open("rb") as file:
            chunks = self._index(file)
            samples = self._scan(file) if chunks is None else self._sample(file, chunks)
        found = []
        for connection, (topic, msgtype, definition) in sorted(self._connections.items()):
            if not self._counts.get(connection):
                continue
            try:
                codec = codec_for("ros1", "ros1msg", msgtype, definition)
                known = samples.get(connection, [])
                found.append(make_stream(connection, topic, self._counts[connection], codec, known))
            except UndecodableError as error:
                self._notes.append(f'topic "{topic}" is left out: {error}')
        return found

    def _index(self, file: BinaryIO) -> dict[int, frozenset[int]] | None:
        """Return the chunks and the connections in them by the index at the end; None without a whole index."""
        _, head, _ = next(iter(BagRecords(file, self._size)), (0, {}, b""))
        start = number(head, b"index_pos", 8)
        if head.get(b"encryptor"):
            raise LogError("is encrypted", where=str(self.path), expected="a plain bag", hint="rosbag decrypt")
        if kind_of(head) != BAG or not start or start >= self._size:
            return None
        chunks: dict[int, frozenset[int]] = {}
        counts: dict[int, int] = {}
        records = BagRecords(file, self._size, start)
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
        is_whole = is_whole and all(self._is_chunk(file, at) for at in {min(chunks, default=0), max(chunks, default=0)})
        if not is_whole or len(self._connections) != number(head, b"conn_count") or counts.keys() - self._connections:
            self._connections = {}
            return None
        self._counts, self._chunks, self._indexed = counts, tuple(chunks), True
        return chunks

    def _is_chunk(self, file: BinaryIO, at: int) -> bool:
        offset, head, _ = next(iter(BagRecords(file, self._size, at)), (-1, {}, b""))
        return offset == at and kind_of(head) == CHUNK

    def _sample(self, file: BinaryIO, chunks: dict[int, frozenset[int]]) -> dict[int, list[bytes]]:
        """First messages of each connection, from as few chunks as hold them all."""
        missing = {connection for connection, count in self._counts.items() if count}
        samples: dict[int, list[bytes]] = {}
        self._allowance = Allowance()
        for position in sorted(chunks):
            if missing.isdisjoint(chunks[position]):
                continue
            offset, head, data = next(iter(BagRecords(file, self._size, position, self._chunks)), (0, {}, b""))
            if offset != position or kind_of(head) != CHUNK:
                continue
            for connection, _, message in self._chunk(offset, head, data):
                if connection in missing:
                    _keep(samples, connection, message)
            missing.difference_update(samples)
        return samples

    def _scan(self, file: BinaryIO) -> dict[int, list[bytes]]:
        """Count all messages and keep the first ones of each connection: for a bag without a sound index."""
        samples: dict[int, list[bytes]] = {}
        for connection, _, data in self._walk(file):
            self._counts[connection] = self._counts.get(connection, 0) + 1
            _keep(samples, connection, data)
        self.unassigned = sum(n for i, n in self._counts.items() if i not in self._connections)
        if self.unassigned:
            what = f"{self.unassigned} messages are left out, their connection records are lost"
            self._notes.append(f"{self.path.name}: {what}")
        return samples

    def batches(self, ids: frozenset[int]) -> Iterator[Batch]:
        """These connections' messages with their times of reception, in file order."""
        return batched(self._messages(ids))

    def _messages(self, ids: frozenset[int]) -> Iterator[Message]:
        self._lost = {}
        seen = dict.fromkeys(ids, 0)
        with self.path.open("rb") as file:
            for message in self._walk(file):
                if message[0] in ids:
                    seen[message[0]] += 1
                    yield message
        if self._indexed:
            self._lost = {i: max(0, self._counts.get(i, 0) - n) for i, n in seen.items()}

    def lost(self, stream_id: int) -> int:
        """Messages of a connection that the last pass could not get at."""
        return self._lost.get(stream_id, 0)

    def notes(self) -> Sequence[str]:
        """What was left out so far."""
        return [*self._notes, *damage_notes(self.path.name, self._damaged)]

    def _walk(self, file: BinaryIO) -> Iterator[Message]:
        in_damaged = is_uncounted = False
        self._allowance = Allowance()
        records = BagRecords(file, self._size, chunks=self._chunks)
        for offset, head, data in records:
            kind = kind_of(head)
            if kind == CHUNK:
                self.truncated |= is_uncounted
                messages = self._chunk(offset, head, data)
                in_damaged = offset in self._damaged
                is_uncounted = in_damaged and not self._indexed
                if in_damaged:
                    records.doubt()
                yield from messages
            elif kind == MESSAGE and (message := _message(head, data)) is not None:
                yield message
            elif kind == INDEX and in_damaged:
                connection, count = number(head, b"conn"), number(head, b"count")
                if connection is not None:
                    self._lost[connection] = self._lost.get(connection, 0) + (count or 0)
                    is_uncounted = False
            elif kind == CONNECTION:
                self._note_connection(head, data)
            elif kind == BAG and not 0 < (number(head, b"index_pos", 8) or 0) < self._size:
                self.truncated = True
                self._notes.append(f"{self.path.name}: the bag was never closed or is cut off; it has no index")
        self.truncated |= is_uncounted
        for gap in records.gaps:
            self._note_gap(*gap)

    def _note_gap(self, start: int, end: int) -> None:
        # with counts of all messages what a gap costs is known
        self.truncated |= not self._indexed
        self._notes.append(gap_note(self.path.name, start, end, self._size))

    def _chunk(self, offset: int, head: Head, data: bytes) -> list[Message]:
        """Messages of one chunk; none if it is damaged."""
        try:
            size = _U32.unpack(head[b"size"])[0]
            return list(self._split(unpack(data, head[b"compression"].decode(), size, self._allowance)))
        except (DamagedError, KeyError, struct.error, UnicodeDecodeError) as error:
            self._damaged[offset] = str(error)
            return []

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


def _keep(samples: dict[int, list[bytes]], connection: int, data: bytes) -> None:
    kept = samples.setdefault(connection, [])
    if len(kept) < SAMPLES:
        kept.append(data)
