"""MCAP logs: JSON, protobuf, ROS 1 and ROS 2 messages, indexed or not, whole or damaged.

The reader walks the data section record by record. It unpacks every chunk within its declared size and checks it
against its checksum. A file that was cut off, or that has lost its index, therefore gives all messages before the cut.
A damaged chunk or a wrong length costs that chunk only. An intact summary at the end saves a pass over the file.

Format: https://mcap.dev/spec [mcap2022]
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, Literal

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel as ChannelRecord
from mcap.records import Schema as SchemaRecord
from mcap.summary import Summary

from aqualog.core.errors import LogError
from aqualog.io.decompress import LONGEST, Allowance, DamagedError, unpack
from aqualog.io.messages.batches import Batch, Message, batched, first_of_each
from aqualog.io.messages.codecs import UndecodableError, codec_for
from aqualog.io.messages.mcap_records import HEAD, MAGIC, McapWalk, scanned
from aqualog.io.messages.reader import MessageReader
from aqualog.io.messages.streams import SAMPLES, Stream, make_stream
from aqualog.io.messages.walk import ChunkSource
from aqualog.io.reader import FaultLog, ReadOptions

__all__ = ["McapReader", "McapSource"]

_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CHUNK = struct.Struct("<QQQII")  # start, end, unpacked size, crc, length of the compression's name
_FOOTER = struct.Struct("<BQQQI")  # opcode, length, summary start, offsets start, crc
_TAIL = _FOOTER.size + len(MAGIC)


class McapReader(MessageReader):
    """Reader of one MCAP file."""

    format = "mcap"

    def __init__(self, path: Path, options: ReadOptions) -> None:
        super().__init__(path, [McapSource(path)], FaultLog())


class McapSource(ChunkSource[int]):
    """One MCAP file as a source of messages.

    Raises
    ------
    LogError
        If the file is not MCAP.
    """

    def __init__(self, path: Path) -> None:
        _check_magic(path)
        super().__init__(path)
        self._schemas: dict[int, SchemaRecord] = {}
        self._channels: dict[int, ChannelRecord] = {}
        self._unproven = False  # something without a checksum of its own has been read

    def streams(self) -> Sequence[Stream]:
        """All connections with messages that can be decoded, in the order of their ids."""
        with self.path.open("rb") as file:
            summary = _sound_summary(file, self._size)
            if not _is_ended(file, self._size):
                self.unfinalised = True
                self._notes.append("file was not finalised by the recorder: it has no index; read from its beginning")
            samples = self._scan(file) if summary is None else self._sample(file, summary)
        return [s for i in sorted(self._channels) if (s := self._stream(i, samples.get(i, []))) is not None]

    def _stream(self, channel_id: int, samples: Sequence[bytes]) -> Stream | None:
        channel, count = self._channels[channel_id], self._counts.get(channel_id, 0)
        if not count:
            return None
        try:
            if not samples:
                self.unassigned += count
                raise UndecodableError("none of its messages can be read")
            schema = self._schemas.get(channel.schema_id)
            if schema is None and channel.schema_id:
                raise UndecodableError("its schema is missing")
            described = (schema.encoding, schema.name, schema.data) if schema else ("", "", b"")
            codec = codec_for(channel.message_encoding, *described)
            return make_stream(channel_id, channel.topic, count, codec, samples)
        except UndecodableError as error:
            self._notes.append(f'topic "{channel.topic}" is left out: {error}')
            return None

    def _sample(self, file: BinaryIO, summary: Summary) -> dict[int, list[bytes]]:
        """First messages of each channel, from as few chunks as hold them all."""
        assert summary.statistics is not None
        self._schemas, self._channels = dict(summary.schemas), dict(summary.channels)
        self._counts = dict(summary.statistics.channel_message_counts)
        self._indexed = True
        self._chunks = tuple(c.chunk_start_offset for c in summary.chunk_indexes)
        self._allowance = Allowance()
        missing = {i for i, n in self._counts.items() if n and i in self._channels}
        samples: dict[int, list[bytes]] = {}
        for chunk in sorted(summary.chunk_indexes, key=lambda c: c.chunk_start_offset):
            here = frozenset(missing.intersection(chunk.message_index_offsets))
            if not here:
                continue
            file.seek(chunk.chunk_start_offset)
            opcode, length = HEAD.unpack(file.read(HEAD.size))
            if opcode == Opcode.CHUNK and length <= min(self._size, LONGEST):
                for batch in batched(self._chunk(chunk.chunk_start_offset, opcode, file.read(length), here)):
                    first_of_each(samples, batch, SAMPLES)
            missing = {i for i in missing if len(samples.get(i, ())) < min(SAMPLES, self._counts[i])}
        return samples

    def _is_described(self, stream_id: int) -> bool:
        return stream_id in self._channels

    def _records(self, file: BinaryIO) -> McapWalk:
        self._unproven = False
        return McapWalk(file, self._size, len(MAGIC), self._chunks)

    def _kind(self, head: int) -> Literal["chunk", "index", "other"]:
        return "chunk" if head == Opcode.CHUNK else "index" if head == Opcode.MESSAGE_INDEX else "other"

    def _outside(
        self, offset: int, head: int, body: bytes, ids: frozenset[int] | None, file: BinaryIO
    ) -> Iterator[Message]:
        if head == Opcode.MESSAGE and len(body) >= _MESSAGE.size:
            self._unproven = True
            channel_id, _, log_time, _ = _MESSAGE.unpack_from(body)
            if ids is None or channel_id in ids:
                yield channel_id, log_time, body[_MESSAGE.size :]
        elif head in (Opcode.SCHEMA, Opcode.CHANNEL):
            self._unproven |= not self._indexed
            self._note_record(head, body)
        elif head == Opcode.DATA_END and self._unproven:
            self._check_data(file, offset, body)

    def _chunk(self, offset: int, head: int, body: bytes, ids: frozenset[int] | None) -> Sequence[Batch | Message]:
        try:
            data, is_proven = _unpacked(body, self._allowance)
            self._unproven |= not is_proven
            if (scan := scanned(data)) is None:
                return list(_split(data, ids, self._note_record))
            for opcode, record in scan.records:
                self._note_record(opcode, record)
            batch = scan.messages
            if ids is not None:
                batch = batch.only(np.isin(batch.ids, list(ids)))
            return [batch] if batch.ids.size else []
        except (DamagedError, struct.error, UnicodeDecodeError) as error:
            self._damaged[offset] = str(error)
            return []

    def _note_record(self, opcode: int, body: bytes) -> None:
        if self._indexed:
            return  # the summary has them, and under its own checksum
        try:
            stream = ReadDataStream(BytesIO(body))
            if opcode == Opcode.SCHEMA:
                schema = SchemaRecord.read(stream)
                self._schemas.setdefault(schema.id, schema)
            else:
                channel = ChannelRecord.read(stream)
                self._channels.setdefault(channel.id, channel)
        except Exception as error:  # the record parser raises whatever the bytes lead it to
            self._notes.append(f"{self.path.name}: a schema or channel record is damaged ({error})")

    def _count_lost(self, head: int, body: bytes) -> bool:
        if len(body) >= 6:
            channel_id, size = struct.unpack_from("<HI", body)
            self._lost[channel_id] = self._lost.get(channel_id, 0) + min(size, len(body)) // 16  # bytes a message
        return True

    def _check_data(self, file: BinaryIO, end: int, body: bytes) -> None:
        """What stands outside of chunks has no other checksum than the one over the whole data section."""
        expected = int.from_bytes(body[:4], "little")
        if expected and _crc(file, 0, end) != expected:
            self.truncated = True
            self._notes.append(f"{self.path.name}: the checksum of the data is wrong; values may be altered")


def _check_magic(path: Path) -> None:
    try:
        with path.open("rb") as file:
            magic = file.read(len(MAGIC))
    except OSError as error:
        raise LogError(f"cannot be opened ({error.strerror})", where=str(path), hint="check the path") from error
    if magic != MAGIC:
        what = "is empty" if not magic else "is no MCAP file"
        raise LogError(what, where=str(path), expected="a file that begins with \\x89MCAP0", hint="record it again")


def _split(data: bytes, ids: frozenset[int] | None, on_record: Callable[[int, bytes], None]) -> Iterator[Message]:
    """Messages of an unpacked chunk."""
    position, size = 0, len(data)
    while position < size:
        opcode, length = HEAD.unpack_from(data, position)
        start = position + HEAD.size
        position = start + length
        if position > size:
            raise DamagedError("a record is longer than its chunk")
        if opcode == Opcode.MESSAGE:
            channel_id, _, log_time, _ = _MESSAGE.unpack_from(data, start)
            if ids is None or channel_id in ids:
                yield channel_id, log_time, data[start + _MESSAGE.size : position]
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            on_record(opcode, data[start:position])
        elif opcode < 0x80:  # from there on opcodes are private and skipped
            raise DamagedError(f"a record of kind {opcode} stands in a chunk")


def _unpacked(body: bytes, allowance: Allowance) -> tuple[bytes, bool]:
    """Content of a chunk record, checked against its size and checksum, and whether it has one."""
    _, _, size, crc, name_length = _CHUNK.unpack_from(body)
    data_start = _CHUNK.size + name_length + 8
    if data_start > len(body):
        raise DamagedError("it is shorter than its head")
    if int.from_bytes(body[data_start - 8 : data_start], "little") != len(body) - data_start:
        raise DamagedError("its record is not as long as its content")
    compression = body[_CHUNK.size : _CHUNK.size + name_length].decode()
    data = unpack(body[data_start:], compression, size, allowance)
    if crc and zlib.crc32(data) != crc:
        raise DamagedError("its checksum is wrong")
    return data, crc != 0


def _is_ended(file: BinaryIO, size: int) -> bool:
    file.seek(max(size - len(MAGIC), 0))
    return file.read() == MAGIC


def _sound_summary(file: BinaryIO, size: int) -> Summary | None:
    """The summary, if it is whole, passes its checksum and knows where every message is."""
    if size < len(MAGIC) + _TAIL:
        return None
    file.seek(size - _TAIL)
    tail = file.read(_TAIL)
    opcode, length, start, _, crc = _FOOTER.unpack_from(tail)
    if not tail.endswith(MAGIC) or (opcode, length) != (Opcode.FOOTER, 20) or not 0 < start < size:
        return None
    if crc and _crc(file, start, size - len(MAGIC) - 4) != crc:
        return None
    file.seek(0)  # the library looks for the magic bytes where the file stands
    try:
        summary = SeekingReader(file, record_size_limit=min(size, LONGEST)).get_summary()
    except Exception:  # whatever is wrong with it, the data section is still there to be walked
        return None
    return summary if summary is not None and _is_complete(summary, size) else None


def _is_complete(summary: Summary, size: int) -> bool:
    statistics = summary.statistics
    if statistics is None or not summary.channels or not summary.chunk_indexes:
        return False
    counts = statistics.channel_message_counts
    listed = {channel for chunk in summary.chunk_indexes for channel in chunk.message_index_offsets}
    used = {channel for channel, count in counts.items() if count}
    return (
        sum(counts.values()) == statistics.message_count
        and len(summary.chunk_indexes) == statistics.chunk_count
        and used <= listed
        and used <= summary.channels.keys()
        and all(len(MAGIC) <= c.chunk_start_offset < size - HEAD.size for c in summary.chunk_indexes)
        and all(c.schema_id == 0 or c.schema_id in summary.schemas for c in summary.channels.values())
    )


def _crc(file: BinaryIO, start: int, end: int) -> int:
    file.seek(start)
    crc = 0
    while start < end and (block := file.read(min(1 << 20, end - start))):
        crc = zlib.crc32(block, crc)
        start += len(block)
    return crc
