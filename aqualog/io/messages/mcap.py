"""MCAP logs: JSON, protobuf, ROS 1 and ROS 2 messages, indexed or not, whole or damaged.

The reader walks the data section record by record. It unpacks every chunk within its declared size and checks it
against its checksum. A file that was cut off, or that has lost its index, therefore gives all messages before the cut.
A damaged chunk costs that chunk only. An intact summary at the end saves a pass over the file.

A wrong length leads anywhere. It shows if it leads beyond the file, over the place where the summary knows a chunk, or
to bytes that are no record. Without a summary reading resumes at the next place whose lengths agree with each other as
those of a chunk do.

Format: https://mcap.dev/spec [mcap2022]
"""

from __future__ import annotations

import struct
import zlib
from array import array
from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, Literal, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel as ChannelRecord
from mcap.records import Schema as SchemaRecord
from mcap.summary import Summary

from aqualog.core.errors import LogError
from aqualog.io.decompress import LONGEST, Allowance, DamagedError, unpack
from aqualog.io.messages.batches import Batch, Message, rows_of
from aqualog.io.messages.codecs import Codec, UndecodableError, codec_for
from aqualog.io.messages.streams import SAMPLES, Stream
from aqualog.io.messages.walk import ChunkSource, RecordWalk

__all__ = ["McapSource", "scanned"]


MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")  # opcode and length of a record

_WITH_BODY = frozenset(
    {Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.DATA_END}
)
_BEHIND_DATA = frozenset(
    {
        Opcode.FOOTER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX,
        Opcode.METADATA_INDEX, Opcode.STATISTICS, Opcode.SUMMARY_OFFSET,
    }
)  # fmt: skip
_FOOTER_LENGTH, _DATA_END_LENGTH = 20, 4
_U32, _U64 = struct.Struct("<I"), struct.Struct("<Q")
_ATTACHMENT = 2 * 8 + 2 * 4 + 8 + 4  # bytes of an attachment beside its name, its type and its data

_NAMES = {0: "plain", 3: "lz4", 4: "zstd"}  # length of the compression's name: where the length of the data stands
_FIXED = 40  # bytes of a chunk beside that name and the data
_CHUNK_HEAD = np.dtype({
    "names": ["length", "name", *_NAMES.values()],
    "formats": ["<u8", "<u4", *["<u8"] * len(_NAMES)],
    "offsets": [1, 37, *(41 + n for n in _NAMES)],
    "itemsize": 53,
})  # fmt: skip


_PRIVATE = 0x80  # from there on opcodes are private and skipped
_STRETCH = 1 << 14  # records
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_RECORD = np.dtype({
    "names": ["length", "channel", "log_time"],
    "formats": ["<u8", "<u2", "<u8"],
    "offsets": [1, HEAD.size, HEAD.size + 6],
    "itemsize": HEAD.size + _MESSAGE.size,
})  # fmt: skip
_CHUNK = struct.Struct("<QQQII")  # start, end, unpacked size, crc, length of the compression's name
_FOOTER = struct.Struct("<BQQQI")  # opcode, length, summary start, offsets start, crc
_TAIL = _FOOTER.size + len(MAGIC)


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
            file.seek(max(self._size - len(MAGIC), 0))
            if file.read() != MAGIC:
                self.unfinalised = True
                self._notes.append("file was not finalised by the recorder: it has no index; read from its beginning")
            if summary is None:
                samples = self._scan(file)
            else:
                self._take_over(summary)
                chunks = {c.chunk_start_offset: c.message_index_offsets.keys() for c in summary.chunk_indexes}
                samples = self._sample(file, chunks, SAMPLES)
        channels = ((i, self._channels[i].topic) for i in sorted(self._channels))
        return self._listed(channels, lambda i: self._codec(i, samples), samples)

    def _codec(self, channel_id: int, samples: Mapping[int, Sequence[bytes]]) -> Codec:
        channel = self._channels[channel_id]
        if not samples.get(channel_id):
            self.unassigned += self._counts[channel_id]
            raise UndecodableError("none of its messages can be read")
        schema = self._schemas.get(channel.schema_id)
        if schema is None and channel.schema_id:
            raise UndecodableError("its schema is missing")
        described = (schema.encoding, schema.name, schema.data) if schema else ("", "", b"")
        return codec_for(channel.message_encoding, *described)

    def _take_over(self, summary: Summary) -> None:
        assert summary.statistics is not None
        self._schemas, self._channels = dict(summary.schemas), dict(summary.channels)
        self._counts = dict(summary.statistics.channel_message_counts)
        self._indexed = True
        self._chunks = tuple(c.chunk_start_offset for c in summary.chunk_indexes)

    def _is_described(self, stream_id: int) -> bool:
        return stream_id in self._channels

    def _records(self, file: BinaryIO, start: int = len(MAGIC)) -> McapWalk:
        self._unproven = False
        return McapWalk(file, self._size, start, self._chunks)

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
            scan = scanned(data)
            for opcode, record in scan.records:
                self._note_record(opcode, record)
            if scan.fault:
                raise DamagedError(scan.fault)
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


class McapWalk(RecordWalk[int]):
    """One pass over the data section; the head of a record is its opcode."""

    overlap = _CHUNK_HEAD.itemsize - 1
    has_end_record = True

    def _record_at(self, offset: int) -> tuple[int, int, int] | None:
        opcode, length = self._head(offset)
        end = offset + HEAD.size + length
        if opcode == 0 or end > self._size:
            return None
        if opcode == Opcode.FOOTER and (length != _FOOTER_LENGTH or end + len(MAGIC) != self._size):
            return None
        if opcode == Opcode.DATA_END and (length != _DATA_END_LENGTH or self._head(end)[0] not in _BEHIND_DATA):
            return None
        if opcode in _WITH_BODY and length > LONGEST:
            return None
        if opcode == Opcode.ATTACHMENT and not self._is_attachment(offset + HEAD.size, length):
            return None
        known = self._known(offset + 1)
        return None if known is not None and end > known else (opcode, offset + HEAD.size, end)

    def _head(self, offset: int) -> tuple[int, int]:
        """Opcode and length; zeros if there is no room for them."""
        self._file.seek(offset)
        head = self._file.read(HEAD.size)
        return HEAD.unpack(head) if len(head) == HEAD.size else (0, 0)

    def _has_body(self, head: int) -> bool:
        return head in _WITH_BODY

    def _is_last(self, head: int) -> bool:
        return head in (Opcode.DATA_END, Opcode.FOOTER)

    def _is_attachment(self, start: int, length: int) -> bool:
        """Whether the sizes of its parts fill it: nothing else of it is read."""
        left, at = length - _ATTACHMENT, start + 16
        for size in (_U32, _U32, _U64):  # name, type, data
            self._file.seek(at)
            raw = self._file.read(size.size)
            if len(raw) < size.size:
                return False
            part = int(size.unpack(raw)[0])
            left -= part
            at += size.size + part
            if left < 0:
                return False
        return left == 0

    def _chunk_in(self, block: bytes, offset: int) -> int | None:
        """The first place where the lengths are those of a chunk that ends within the file."""
        room = self._size - offset
        octets = np.frombuffer(block, np.uint8)[: max(len(block) - self.overlap, 0)]
        at = np.flatnonzero(octets == Opcode.CHUNK)
        if not at.size:
            return None
        heads = rows_of(block, at, _CHUNK_HEAD.itemsize).view(_CHUNK_HEAD)
        length = heads["length"].astype(np.float64)
        agrees = np.zeros(at.size, dtype=np.bool_)
        for size, name in _NAMES.items():
            agrees |= (heads["name"] == size) & (length == heads[name].astype(np.float64) + (_FIXED + size))
        found = at[agrees & (length <= room - at - HEAD.size)]
        return offset + int(found[0]) if found.size else None


class Scan(NamedTuple):
    """What a chunk holds: its messages, opcode and body of each schema and channel, and what ends it before its end."""

    messages: Batch
    records: tuple[tuple[int, bytes], ...]
    fault: str


def scanned(data: bytes) -> Scan:
    """Records of a chunk, none of them copied, up to the first one that cannot stand there."""
    found = array("q")  # a list would hold ten times the chunk where its records are empty
    position, size, fault = 0, len(data), ""
    add, length_at = found.append, _U64.unpack_from
    try:
        while position < size:
            # zeros are records without an end to it: no further than the first stretch of them
            for _ in range(_STRETCH):
                add(position)
                position += HEAD.size + length_at(data, position + 1)[0]
                if position >= size:
                    break
            if not data[found[-1]]:
                break
    except struct.error:
        fault, position = "a record has no length", found.pop()
    if position > size:
        fault, position = "a record is longer than its chunk", found.pop()
    at = np.array(found, dtype=np.int64)
    ends = np.append(at[1:], position)
    opcodes = np.frombuffer(data, np.uint8)[at]
    is_schema = (opcodes == Opcode.SCHEMA) | (opcodes == Opcode.CHANNEL)
    strange = np.flatnonzero((opcodes != Opcode.MESSAGE) & ~is_schema & (opcodes < _PRIVATE))
    if strange.size:
        fault = f"a record of kind {opcodes[strange[0]]} stands in a chunk"
        at, is_schema = at[: strange[0]], is_schema[: strange[0]]
    of_messages = np.flatnonzero(opcodes[: at.size] == Opcode.MESSAGE)
    if of_messages.size and at[of_messages[-1]] + _RECORD.itemsize > size:
        fault, of_messages = fault or "a message is shorter than its head", of_messages[:-1]
    starts, ends_message = at[of_messages], ends[of_messages]
    heads = rows_of(data, starts, _RECORD.itemsize).view(_RECORD) if starts.size else np.zeros(0, _RECORD)
    contents = np.minimum(starts + _RECORD.itemsize, ends_message)
    batch = Batch(heads["channel"].astype(np.int64), heads["log_time"], contents, ends_message, data)
    schemas = np.flatnonzero(is_schema).tolist()
    return Scan(batch, tuple((int(opcodes[i]), data[found[i] + HEAD.size : int(ends[i])]) for i in schemas), fault)
