"""ROS logs: ROS 1 bags and ROS 2 recordings in sqlite3 or MCAP, a single file or a directory of splits.

A ROS 2 directory is read from its files; `metadata.yaml` only names and orders them, so one that lost it, or lost a
split, is still read. Messages are decoded with the definitions in the recording, or with those of its ROS release
where an old recording holds none.

Formats: http://wiki.ros.org/Bags/Format/2.0, https://github.com/ros2/rosbag2
"""

from __future__ import annotations

import re
import shutil
import sqlite3
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import BinaryIO

import zstandard
from rosbags.rosbag1 import Reader as Bag1IndexReader
from rosbags.typesys import Stores

from aqualog.errors import LogError
from aqualog.io.base import FaultLog, ReadOptions
from aqualog.io.batches import Batch, Message, batched
from aqualog.io.mcap import DamagedError, McapSource, unpack
from aqualog.io.messages import (
    MAX_UNPACKED,
    SAMPLES,
    MessageReader,
    Source,
    Stream,
    UndecodableError,
    codec_for,
    make_stream,
)

__all__ = ["BagSource", "Db3Source", "RosReader"]

_BAG_MAGIC = b"#ROSBAG V2.0\n"
_DB3_MAGIC = b"SQLite format 3\0"
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_U32 = struct.Struct("<I")
_OP_MESSAGE, _OP_BAG, _OP_INDEX, _OP_CHUNK, _OP_CONNECTION = 2, 3, 4, 5, 7
_SPLIT = re.compile(r"\.(db3|mcap)(\.zstd)?$")


class RosReader(MessageReader):
    """Reader of a ROS 1 bag, a ROS 2 file, or a ROS 2 directory."""

    format = "ros"

    def __init__(self, path: Path, options: ReadOptions) -> None:
        faults = FaultLog()
        self._temporary: TemporaryDirectory[str] | None = None
        try:
            super().__init__(path, self._sources_of(path, faults), faults)
        except BaseException:
            self.close()
            raise

    def _sources_of(self, path: Path, faults: FaultLog) -> list[Source]:
        if not path.exists():
            raise LogError("does not exist", where=str(path), hint="check the path")
        if not path.is_dir():
            return [self._open(path, Stores.ROS2_HUMBLE)]
        release = _release(_metadata(path))
        sources: list[Source] = []
        for split in _splits(path, faults):
            try:
                sources.append(self._open(split, release))
            except LogError as error:
                faults.truncated = True
                faults.notes.append(f"a split is left out: {error.line()}")
        if not sources:
            raise LogError(
                "no split can be read",
                where=str(path),
                expected="a directory with .db3 or .mcap files",
                hint=faults.notes[0] if faults.notes else "name the file itself",
            )
        return sources

    def _open(self, path: Path, release: Stores) -> Source:
        if path.suffix == ".zstd":
            path = self._decompressed(path)
        with _opened(path) as file:
            magic = file.read(16)
        if magic.startswith(_BAG_MAGIC):
            return BagSource(path)
        if magic == _DB3_MAGIC:
            return Db3Source(path, release)
        if magic.startswith(b"\x89MCAP"):
            return McapSource(path)
        what = "is no ROS recording" if magic else "is empty"
        raise LogError(what, where=str(path), expected="a ROS 1 bag (version 2.0), a .db3 or an .mcap file")

    def _decompressed(self, path: Path) -> Path:
        """A split that the recorder compressed as a whole, unpacked to a temporary file."""
        if self._temporary is None:
            self._temporary = TemporaryDirectory(prefix="aqualog-")
        target = Path(self._temporary.name, path.stem)
        room = shutil.disk_usage(self._temporary.name).free // 2
        try:
            with _opened(path) as packed, target.open("wb") as out:
                reader = zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True)
                while block := reader.read(1 << 20):
                    room -= len(block)
                    if room < 0:
                        raise LogError("has no room to be unpacked", where=str(path), hint="free space for temp files")
                    out.write(block)
        except zstandard.ZstdError as error:
            what = f"cannot be unpacked ({error})"
            raise LogError(what, where=str(path), hint="copy it again from the vehicle") from error
        return target

    def close(self) -> None:
        """Release the file and remove what was unpacked."""
        if self._temporary is not None:
            self._temporary.cleanup()
            self._temporary = None


# ---------------------------------------------------------------- directory


def _metadata(path: Path) -> str:
    try:
        return (path / "metadata.yaml").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def _release(metadata: str) -> Stores:
    found = re.search(r"^\s*ros_distro:\s*['\"]?(\w+)", metadata, re.MULTILINE)
    return _store(found[1] if found else "")


def _store(distro: str) -> Stores:
    return Stores.__members__.get(f"ROS2_{distro.upper()}", Stores.ROS2_HUMBLE)


def _splits(path: Path, faults: FaultLog) -> list[Path]:
    """Files of a recording in the order of `metadata.yaml`, or in the order of their numbers."""
    present = {p.name: p for p in path.iterdir() if p.is_file() and _SPLIT.search(p.name)}
    # Only the bare name counts: a path in the metadata may point anywhere.
    listed = re.findall(
        r"^\s*-\s*['\"]?(?:[^\s'\"]*/)?([^\s/'\"]+\.(?:db3|mcap)(?:\.zstd)?)", _metadata(path), re.MULTILINE
    )
    listed = list(dict.fromkeys(listed))
    missing = [name for name in listed if name not in present]
    if missing:
        faults.truncated = True
        faults.notes.append(f"{path.name}: metadata.yaml names files that are missing: {', '.join(missing[:5])}")
    found = [present[name] for name in listed if name in present]
    return found or [present[name] for name in sorted(present, key=_split_number)]


def _split_number(name: str) -> tuple[str, int]:
    """`drive_10.db3` comes after `drive_9.db3`."""
    stem = _SPLIT.sub("", name)
    found = re.search(r"^(.*?)_(\d+)$", stem)
    return (found[1], int(found[2])) if found else (stem, -1)


def _opened(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except OSError as error:
        raise LogError(f"cannot be opened ({error.strerror})", where=str(path), hint="check the path") from error


# ---------------------------------------------------------------- ROS 2 sqlite3


class Db3Source:
    """One sqlite3 file of a ROS 2 recording."""

    def __init__(self, path: Path, release: Stores) -> None:
        self.path = path
        self.truncated = False
        self._release = release
        self._notes: list[str] = []
        self._counts: dict[int, int] = {}
        self._lost: dict[int, int] = {}
        log = path.with_name(path.name + "-wal")
        if log.exists() and log.stat().st_size:
            # Reading it would write to the folder, and a log is never changed.
            self._notes.append(f"{path.name}: the recording was not closed; messages in {log.name} are not read")
            self.truncated = True

    def _connect(self) -> closing[sqlite3.Connection]:
        base = sqlite3.connect(f"{self.path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)
        # SQLite refuses a file that is shorter than its head says, unless it is told to bear with damage.
        base.execute("PRAGMA writable_schema = ON")
        return closing(base)

    def streams(self) -> Sequence[Stream]:
        """All topics with messages that can be decoded."""
        try:
            with self._connect() as base:
                topics = base.execute("SELECT id, name, type, serialization_format FROM topics ORDER BY id").fetchall()
                definitions = _definitions(base)
                release = _db3_release(base) or self._release
                samples = self._scan(base)
        except sqlite3.Error as error:
            what = f"is damaged ({error})"
            raise LogError(what, where=str(self.path), hint="sqlite3 .recover on a copy of the file") from error
        found = []
        for topic_id, name, msgtype, serialization in topics:
            if not self._counts.get(topic_id):
                continue
            try:
                encoding, definition = definitions.get(msgtype, ("", b""))
                codec = codec_for(str(serialization), encoding, str(msgtype), definition, release)
                found.append(make_stream(topic_id, str(name), self._counts[topic_id], codec, samples.get(topic_id, [])))
            except UndecodableError as error:
                self._notes.append(f'topic "{name}" is left out: {error}')
        return found

    def _scan(self, base: sqlite3.Connection) -> dict[int, list[bytes]]:
        """Count the messages of each topic and get its first ones."""
        firsts: dict[int, list[int]] = {}
        self._counts = {}
        try:
            for row, topic_id in base.execute("SELECT id, topic_id FROM messages ORDER BY id"):
                self._counts[topic_id] = self._counts.get(topic_id, 0) + 1
                kept = firsts.setdefault(topic_id, [])
                if len(kept) < SAMPLES:
                    kept.append(row)
        except sqlite3.Error as error:
            self._cut(error)
        return {topic_id: list(_rows(base, rows)) for topic_id, rows in firsts.items()}

    def batches(self, ids: frozenset[int]) -> Iterator[Batch]:
        """These topics' messages with their times of reception, in the order of recording."""
        return batched(self._messages(ids))

    def _messages(self, ids: frozenset[int]) -> Iterator[Message]:
        marks = ",".join("?" * len(ids))
        query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks}) ORDER BY id"
        seen = dict.fromkeys(ids, 0)
        with self._connect() as base:
            try:
                for topic_id, t, data in base.execute(query, tuple(ids)):
                    seen[topic_id] += 1
                    yield topic_id, t if isinstance(t, int) and t > 0 else 0, _plain(data)
            except sqlite3.Error as error:
                self._cut(error)
        self._lost = {i: max(0, self._counts.get(i, 0) - n) for i, n in seen.items()}

    def _cut(self, error: sqlite3.Error) -> None:
        self.truncated = True
        self._notes.append(f"{self.path.name}: the file is cut off or damaged ({error}); what stands before is read")

    def lost(self, stream_id: int) -> int:
        """Messages of a topic that were counted and could not be read in the last pass."""
        return self._lost.get(stream_id, 0)

    def notes(self) -> Sequence[str]:
        """What was left out so far."""
        return self._notes


def _rows(base: sqlite3.Connection, rows: Sequence[int]) -> Iterator[bytes]:
    for row in rows:
        try:
            data = base.execute("SELECT data FROM messages WHERE id = ?", (row,)).fetchone()
        except sqlite3.Error:
            return  # the pages of this message are beyond the cut
        if data is not None:
            yield _plain(data[0])


def _definitions(base: sqlite3.Connection) -> dict[str, tuple[str, bytes]]:
    """Message definitions by type; recordings before ROS 2 Iron have none."""
    try:
        rows = base.execute("SELECT topic_type, encoding, encoded_message_definition FROM message_definitions")
        return {kind: (str(encoding), text.encode()) for kind, encoding, text in rows if isinstance(text, str)}
    except sqlite3.OperationalError:
        return {}


def _db3_release(base: sqlite3.Connection) -> Stores | None:
    try:
        row = base.execute("SELECT ros_distro FROM schema").fetchone()
    except sqlite3.OperationalError:
        return None
    return _store(row[0]) if row and isinstance(row[0], str) else None


def _plain(data: object) -> bytes:
    """A message that the recorder compressed by itself, unpacked. No CDR message begins like a zstd frame."""
    if not isinstance(data, bytes):
        return b""  # a damaged row; counted as a message that cannot be decoded
    if data[:4] != _ZSTD_MAGIC:
        return data
    try:
        size = zstandard.frame_content_size(data)
        return unpack(data, "zstd", size) if 0 <= size <= MAX_UNPACKED else data
    except (DamagedError, zstandard.ZstdError):
        return data  # counted as a message that cannot be decoded


# ---------------------------------------------------------------- ROS 1


class BagSource:
    """One ROS 1 bag, walked record by record, so one that was never closed or indexed is read up to its end.

    Where the bag has a sound index, `streams` takes the counts from it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.truncated = False
        self._notes: list[str] = []
        self._damaged: dict[int, str] = {}
        self._lost: dict[int, int] = {}
        self._size = path.stat().st_size
        self._connections: dict[int, tuple[str, str, bytes]] = {}
        self._counts: dict[int, int] = {}

    def streams(self) -> Sequence[Stream]:
        """All connections with messages that can be decoded."""
        samples = self._from_index()
        if samples is None:
            samples = self._scan()
        found = []
        for number, (topic, msgtype, definition) in sorted(self._connections.items()):
            if not self._counts.get(number):
                continue
            try:
                codec = codec_for("ros1", "ros1msg", msgtype, definition)
                found.append(make_stream(number, topic, self._counts[number], codec, samples.get(number, [])))
            except UndecodableError as error:
                self._notes.append(f'topic "{topic}" is left out: {error}')
        return found

    def _from_index(self) -> dict[int, list[bytes]] | None:
        try:
            with Bag1IndexReader(self.path) as reader:
                connections = list(reader.connections)
                self._connections = {c.id: (c.topic, c.msgtype, c.msgdef.data.encode()) for c in connections}
                self._counts = {c.id: c.msgcount for c in connections}
                chunks = sorted((c.pos, frozenset(c.connection_counts)) for c in reader.chunk_infos)
            return self._sample(chunks)
        except Exception:  # no index or a damaged one, which shows in many ways: the records are still there
            self._connections, self._counts = {}, {}
            return None

    def _sample(self, chunks: Sequence[tuple[int, frozenset[int]]]) -> dict[int, list[bytes]]:
        """First messages of each connection, from as few chunks as hold them all."""
        missing = {number for number, count in self._counts.items() if count}
        samples: dict[int, list[bytes]] = {}
        for position, numbers in chunks:
            if missing.isdisjoint(numbers):
                continue
            offset, head, data = next(self._records(position))
            for number, _, message in self._chunk(offset, head, data):
                if number in missing:
                    _keep(samples, number, message)
            missing.difference_update(samples)
        return samples

    def _scan(self) -> dict[int, list[bytes]]:
        """Count all messages and keep the first ones of each connection: for a bag without a sound index."""
        samples: dict[int, list[bytes]] = {}
        for number, _, data in self._walk():
            self._counts[number] = self._counts.get(number, 0) + 1
            _keep(samples, number, data)
        return samples

    def batches(self, ids: frozenset[int]) -> Iterator[Batch]:
        """These connections' messages with their times of reception, in file order."""
        return batched(self._messages(ids))

    def _messages(self, ids: frozenset[int]) -> Iterator[Message]:
        self._lost = {}
        for message in self._walk():
            if message[0] in ids:
                yield message

    def lost(self, stream_id: int) -> int:
        """Messages of a connection in damaged chunks of the last pass."""
        return self._lost.get(stream_id, 0)

    def notes(self) -> Sequence[str]:
        """What was left out so far."""
        if not self._damaged:
            return self._notes
        offset, reason = min(self._damaged.items())
        many = f"{len(self._damaged)} damaged chunk{'s are' if len(self._damaged) > 1 else ' is'} left out"
        return [*self._notes, f"{self.path.name}: {many} (first at byte {offset}: {reason})"]

    def _walk(self) -> Iterator[Message]:
        in_damaged = False
        for offset, head, data in self._records():
            kind = _kind(head)
            if kind == _OP_CHUNK:
                messages = self._chunk(offset, head, data)
                in_damaged = offset in self._damaged
                yield from messages
            elif kind == _OP_INDEX and in_damaged:
                number, count = (_U32.unpack(head[key])[0] for key in (b"conn", b"count"))
                self._lost[number] = self._lost.get(number, 0) + count
            elif kind == _OP_CONNECTION:
                self._note_connection(head, data)
            elif kind == _OP_BAG and not 0 < int.from_bytes(head.get(b"index_pos", b""), "little") < self._size:
                self.truncated = True
                self._notes.append(f"{self.path.name}: the bag was never closed or is cut off; it has no index")

    def _records(self, offset: int = len(_BAG_MAGIC)) -> Iterator[tuple[int, Mapping[bytes, bytes], bytes]]:
        with self.path.open("rb") as file:
            while offset < self._size:
                file.seek(offset)
                head = _sized(file, self._size - offset)
                data_size = _U32.unpack(raw)[0] if len(raw := file.read(4)) == 4 else self._size
                end = file.tell() + data_size
                fields = None if head is None else _fields(head)
                if fields is None or head is None or end > self._size:
                    self._cut(offset)
                    return
                wanted = _kind(fields) in (_OP_CHUNK, _OP_CONNECTION)
                yield offset, fields, file.read(data_size) if wanted else b""
                offset = end

    def _cut(self, offset: int) -> None:
        self.truncated = True
        self._notes.append(
            f"{self.path.name}: no sound record from byte {offset} of {self._size} on: cut off, damaged there or never "
            "closed; what stands before is read"
        )

    def _chunk(self, offset: int, head: Mapping[bytes, bytes], data: bytes) -> list[Message]:
        """Messages of one chunk; none if it is damaged."""
        try:
            size = _U32.unpack(head[b"size"])[0]
            return list(self._split(unpack(data, head[b"compression"].decode(), size)))
        except (DamagedError, KeyError, struct.error, UnicodeDecodeError) as error:
            self._damaged[offset] = str(error)
            return []

    def _split(self, data: bytes) -> Iterator[Message]:
        position, size = 0, len(data)
        while position < size:
            head_size = _U32.unpack_from(data, position)[0]
            head = _fields(data[position + 4 : position + 4 + head_size])
            position += 4 + head_size
            start = position + 4
            position = start + _U32.unpack_from(data, position)[0]
            if head is None or position > size:
                raise DamagedError("a record is longer than its chunk")
            kind = _kind(head)
            if kind == _OP_MESSAGE:
                seconds, nanoseconds = struct.unpack("<II", head[b"time"])
                yield _U32.unpack(head[b"conn"])[0], seconds * 1_000_000_000 + nanoseconds, data[start:position]
            elif kind == _OP_CONNECTION:
                self._note_connection(head, data[start:position])

    def _note_connection(self, head: Mapping[bytes, bytes], data: bytes) -> None:
        fields = _fields(data)
        if fields is None or not {b"type", b"message_definition"} <= fields.keys() or b"conn" not in head:
            return
        topic = head.get(b"topic", fields.get(b"topic", b"")).decode(errors="replace")
        msgtype = fields[b"type"].decode(errors="replace")
        number = _U32.unpack(head[b"conn"])[0]
        self._connections.setdefault(number, (topic, msgtype, fields[b"message_definition"]))


def _keep(samples: dict[int, list[bytes]], number: int, data: bytes) -> None:
    kept = samples.setdefault(number, [])
    if len(kept) < SAMPLES:
        kept.append(data)


def _sized(file: BinaryIO, room: int) -> bytes | None:
    raw = file.read(4)
    if len(raw) < 4 or (size := _U32.unpack(raw)[0]) > room:
        return None
    data = file.read(size)
    return data if len(data) == size else None


def _fields(data: bytes) -> dict[bytes, bytes] | None:
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


def _kind(head: Mapping[bytes, bytes]) -> int:
    return int.from_bytes(head.get(b"op", b""), "little")
