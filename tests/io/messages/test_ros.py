"""ROS recordings written with rosbags and with plain sqlite3, read back to the last bit, then damaged."""

from __future__ import annotations

import bz2
import sqlite3
import struct
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from aqualog.core.errors import LogError
from aqualog.core.records import Channel
from aqualog.io.messages.bag import CHUNK, INDEX, MAGIC, BagWalk, kind_of
from aqualog.io.messages.reader import RosReader
from aqualog.io.reader import ReadOptions

T0 = 1_700_000_000 * 10**9
STEP = 10**7


def read_all(path: Path) -> tuple[dict[str, Channel], RosReader]:
    with RosReader(path, ReadOptions()) as reader:
        return {c.info.path: c for c in reader.read(reader.channels())}, reader


def ros_store(ros: int):
    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg("std_msgs/Header header\nfloat32[4] slip\nPoint[] points\n", "car/msg/Slip"))
    store.register(get_types_from_msg("float64 x\nfloat64 y\n", "car/msg/Point"))
    return store


def fill(writer, store, ros: int, numbers: range) -> None:
    """Wheel speed, a stamped custom message with arrays of numbers and of messages, and a text."""
    kinds = {"/omega_fl": "std_msgs/msg/Float64", "/slip": "car/msg/Slip", "/note": "std_msgs/msg/String"}
    connections = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}
    for i in numbers:
        for topic, message in messages(store, ros, i).items():
            serialize = store.serialize_ros1 if ros == 1 else store.serialize_cdr
            writer.write(connections[topic], T0 + i * STEP, bytes(serialize(message, kinds[topic])))


def messages(store, ros: int, i: int) -> dict[str, object]:
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](*divmod(T0 + i * STEP - 777, 10**9))
    header = types["std_msgs/msg/Header"](*([i] if ros == 1 else []), stamp, "base")
    points = [types["car/msg/Point"](float(i), -float(i))] * (i % 3)
    return {
        "/omega_fl": types["std_msgs/msg/Float64"](i * 0.1),
        "/slip": types["car/msg/Slip"](header, np.arange(4, dtype=np.float32) * i, points),
        "/note": types["std_msgs/msg/String"]("wet"),
    }


def check(channels: dict[str, Channel], n: int) -> None:
    points = {f"/slip.points[{k}].{axis}" for k in range(2) for axis in "xy"}
    assert set(channels) == {"/omega_fl.data", *(f"/slip.slip[{k}]" for k in range(4)), *points}
    i = np.arange(n)
    omega = channels["/omega_fl.data"]
    assert (omega.info.name, omega.info.count, omega.absolute) == ("omega_fl", n, True)
    np.testing.assert_array_equal(omega.values, i * 0.1)
    np.testing.assert_array_equal(omega.t_ns, T0 + i * STEP)
    slip = channels["/slip.slip[3]"]
    assert slip.info.name == "slip[3]"
    np.testing.assert_array_equal(slip.values, 3.0 * i)
    np.testing.assert_array_equal(slip.t_ns, T0 + i * STEP - 777)
    np.testing.assert_array_equal(channels["/slip.points[1].y"].values, np.where(i % 3 == 2, -i, np.nan))


def write_bag1(path: Path, n: int, compression=None, chunk: int = 4000) -> Path:
    writer = Writer1(path)
    if compression is not None:
        writer.set_compression(compression)
    writer.chunk_threshold = chunk
    with writer:
        fill(writer, ros_store(1), 1, range(n))
    return path


def write_bag2(path: Path, numbers: range, plugin=StoragePlugin.SQLITE3, compression=None) -> Path:
    writer = Writer2(path, version=9, storage_plugin=plugin)
    if compression is not None:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        fill(writer, ros_store(2), 2, numbers)
    return path


@pytest.mark.parametrize("compression", [None, *Writer1.CompressionFormat])
def test_bag1(tmp_path, compression):
    channels, reader = read_all(write_bag1(tmp_path / "a.bag", 300, compression))
    check(channels, 300)
    assert reader.faults.notes == ()
    assert not reader.faults.truncated


def test_truncated_bag1(tmp_path):
    path = write_bag1(tmp_path / "a.bag", 600)
    raw = path.read_bytes()
    path.write_bytes(raw[: len(raw) * 6 // 10])
    channels, reader = read_all(path)
    n = channels["/omega_fl.data"].values.size
    assert 150 < n < 600
    np.testing.assert_array_equal(channels["/omega_fl.data"].values, np.arange(n) * 0.1)
    assert reader.faults.truncated


def test_damaged_chunk_of_bag1_costs_that_chunk(tmp_path):
    path = write_bag1(tmp_path / "a.bag", 600, Writer1.CompressionFormat.BZ2)
    raw = bytearray(path.read_bytes())
    raw[raw.index(b"BZh", len(raw) // 3) + 30] ^= 0xFF
    path.write_bytes(raw)
    channels, reader = read_all(path)
    omega = channels["/omega_fl.data"].values
    lost = sum(600 - channels[p].values.size for p in ("/omega_fl.data", "/slip.slip[0]"))
    assert 300 < omega.size < 600
    assert np.isin(omega, np.arange(600) * 0.1).all()
    assert reader.faults.lost_samples == lost
    assert any("damaged chunk" in note for note in reader.faults.notes)


def bag_record(head: dict[bytes, bytes], data: bytes) -> bytes:
    fields = b"".join(struct.pack("<I", len(k) + 1 + len(v)) + k + b"=" + v for k, v in head.items())
    return struct.pack("<I", len(fields)) + fields + struct.pack("<I", len(data)) + data


def chunk_starts(path: Path) -> list[int]:
    with path.open("rb") as file:
        records = BagWalk(file, path.stat().st_size, len(MAGIC))
        return [offset for offset, head, _ in records if kind_of(head) == CHUNK]


@pytest.mark.parametrize("indexed", [True, False])
@pytest.mark.parametrize("length", [1 << 31, 9000, 100])
def test_a_length_that_lies_costs_that_chunk_of_a_bag(tmp_path, indexed, length):
    path = write_bag1(tmp_path / "a.bag", 600)
    raw = bytearray(path.read_bytes())
    start = chunk_starts(path)[4]
    struct.pack_into("<I", raw, start + 4 + struct.unpack_from("<I", raw, start)[0], length)
    path.write_bytes(raw if indexed else raw[:-1])
    channels, reader = read_all(path)
    omega = channels["/omega_fl.data"].values
    assert 570 < omega.size < 600
    assert np.isin(omega, np.arange(600) * 0.1).all()
    assert omega[-1] == 599 * 0.1
    lost = sum(600 - channels[p].values.size for p in ("/omega_fl.data", "/slip.slip[0]"))
    assert reader.faults.lost_samples == lost if indexed else reader.faults.truncated


@pytest.mark.parametrize("where", ["first", "last"])
def test_an_index_whose_chunks_have_moved_is_not_believed(tmp_path, where):
    """Its own place is moved by a whole record, so that all that is read from there looks sound."""
    path = write_bag1(tmp_path / "a.bag", 600)
    raw = path.read_bytes()
    index_pos = struct.unpack_from("<Q", raw, raw.index(b"index_pos=") + 10)[0]
    with path.open("rb") as file:
        last = max(o for o, head, _ in BagWalk(file, len(raw), len(MAGIC)) if kind_of(head) == INDEX and o < index_pos)
    size = index_pos - last
    foreign = bag_record(
        {b"op": b"\x04", b"pad": bytes(size - len(bag_record({b"op": b"\x04", b"pad": b""}, b"")))}, b""
    )
    assert len(foreign) == size
    at = chunk_starts(path)[0 if where == "first" else -1]
    path.write_bytes(raw[:at] + foreign + raw[at:])
    channels, _ = read_all(path)
    assert channels["/omega_fl.data"].values.size == 600


@pytest.mark.parametrize("compression", ["bz2", "lz4"])
@pytest.mark.parametrize("declared", [10, 1 << 27])
def test_bomb_in_a_bag_is_refused(tmp_path, compression, declared):
    path = write_bag1(tmp_path / "a.bag", 100)
    raw = path.read_bytes()
    bomb = bz2.compress(bytes(1 << 20)) if compression == "bz2" else lz4.frame.compress(bytes(1 << 20))
    start = chunk_starts(path)[0]
    head = {b"op": b"\x05", b"compression": compression.encode(), b"size": struct.pack("<I", declared)}
    path.write_bytes(raw[:start] + bag_record(head, bomb) + raw[start:])
    channels, reader = read_all(path)
    assert channels["/omega_fl.data"].values.size == 100
    assert any("damaged chunk" in note for note in reader.faults.notes)
    assert reader.faults.truncated


def test_messages_without_their_connection_are_counted(tmp_path):
    path = write_bag1(tmp_path / "a.bag", 100)
    raw = path.read_bytes()
    at = raw.index(b"/slip")
    # neither the record in the chunk nor the one in the index says what the connection is
    path.write_bytes(raw.replace(b"message_definition=", b"message_definitian=") if at else raw)
    _, reader = read_all(path)
    assert reader.faults.lost_samples == 300
    assert any("300 messages are left out" in note for note in reader.faults.notes)


def test_encrypted_bag_is_named(tmp_path):
    path = tmp_path / "a.bag"
    head = {b"op": b"\x03", b"index_pos": bytes(8), b"encryptor": b"rosbag/AesCbcEncryptor"}
    path.write_bytes(b"#ROSBAG V2.0\n" + bag_record(head, b" " * 50))
    with pytest.raises(LogError, match="is encrypted"):
        read_all(path)


@pytest.mark.parametrize("plugin", list(StoragePlugin))
@pytest.mark.parametrize("metadata", [True, False])
def test_bag2_directory_and_file(tmp_path, plugin, metadata):
    path = write_bag2(tmp_path / "drive", range(300), plugin)
    if not metadata:
        (path / "metadata.yaml").unlink()
    channels, reader = read_all(path)
    check(channels, 300)
    assert reader.faults.notes == ()
    (file,) = (p for p in path.iterdir() if p.suffix in (".db3", ".mcap"))
    check(read_all(file)[0], 300)


@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_compressed_bag2(tmp_path, mode):
    channels, reader = read_all(write_bag2(tmp_path / "drive", range(50), compression=mode))
    check(channels, 50)
    assert reader.faults.notes == ()


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_splits_without_metadata_come_in_number_order(tmp_path, plugin):
    drive = tmp_path / "drive"
    drive.mkdir()
    for k in range(12):
        part = write_bag2(tmp_path / f"part{k}", range(k * 10, k * 10 + 10), plugin)
        (file,) = (p for p in part.iterdir() if p.suffix in (".db3", ".mcap"))
        file.rename(drive / f"drive_{k}{file.suffix}")
    channels, _ = read_all(drive)
    check(channels, 120)


def test_missing_and_broken_splits_are_noted(tmp_path):
    path = write_bag2(tmp_path / "drive", range(20))
    (file,) = path.glob("*.db3")
    (path / "drive_1.db3").write_bytes(b"rubbish")
    metadata = path / "metadata.yaml"
    name = file.name
    text = metadata.read_text()
    assert f"- {name}" in text
    more = f"- {name}\n  - drive_1.db3\n  - ../../drive_2.db3\n"
    metadata.write_text(text.replace(f"- {name}\n", more, 1))
    channels, reader = read_all(path)
    check(channels, 20)
    assert reader.faults.truncated
    notes = " ".join(reader.faults.notes)
    assert "drive_2.db3" in notes
    assert "drive_1.db3" in notes


def write_old_db3(path: Path, n: int, unknown: bool = True) -> Path:
    """As ROS 2 Foxy wrote it: no definitions in the file."""
    store = ros_store(2)
    with sqlite3.connect(path) as base:
        base.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, "
            "offered_qos_profiles TEXT)"
        )
        base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
        base.execute("INSERT INTO topics VALUES (1, '/omega_fl', 'std_msgs/msg/Float64', 'cdr', '')")
        base.execute("INSERT INTO topics VALUES (2, '/slip', 'car/msg/Slip', 'cdr', '')")
        for i in range(n):
            found = messages(store, 2, i)
            rows = [(1, found["/omega_fl"], "std_msgs/msg/Float64"), (2, found["/slip"], "car/msg/Slip")]
            for topic, message, kind in rows[: 2 if unknown else 1]:
                data = bytes(store.serialize_cdr(message, kind))
                base.execute("INSERT INTO messages VALUES (NULL, ?, ?, ?)", (topic, T0 + i * STEP, data))
    base.close()
    return path


def test_old_db3_without_definitions(tmp_path):
    channels, reader = read_all(write_old_db3(tmp_path / "old.db3", 30))
    assert list(channels) == ["/omega_fl.data"]
    np.testing.assert_array_equal(channels["/omega_fl.data"].values, np.arange(30) * 0.1)
    assert any('"/slip"' in note and "car/msg/Slip" in note for note in reader.faults.notes)


def test_truncated_db3(tmp_path):
    path = write_old_db3(tmp_path / "cut.db3", 5000, unknown=False)
    raw = path.read_bytes()
    path.write_bytes(raw[: len(raw) * 6 // 10])
    channels, reader = read_all(path)
    omega = channels["/omega_fl.data"].values
    assert 2000 < omega.size < 5000
    np.testing.assert_array_equal(omega, np.arange(omega.size) * 0.1)
    assert reader.faults.truncated


def test_damaged_page_of_a_db3_costs_its_rows(tmp_path):
    path = write_old_db3(tmp_path / "a.db3", 5000, unknown=False)
    raw = bytearray(path.read_bytes())
    page = len(raw) // 4096 // 3 * 4096
    raw[page : page + 4096] = bytes(4096)
    path.write_bytes(raw)
    channels, reader = read_all(path)
    omega = channels["/omega_fl.data"]
    assert 4500 < omega.values.size < 5000
    assert omega.values[-1] == 4999 * 0.1
    np.testing.assert_array_equal(omega.t_ns, T0 + np.rint(omega.values * 10).astype(np.int64) * STEP)
    assert reader.faults.lost_samples == 5000 - omega.values.size
    assert any("what stands behind is read" in note for note in reader.faults.notes)


ENDLESS = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT"


@pytest.mark.parametrize(
    "script",
    [
        f"ALTER TABLE messages RENAME TO m; CREATE VIEW messages AS {ENDLESS} x id, 1 topic_id, x timestamp, x'00' data FROM c",
        f"ALTER TABLE topics RENAME TO m; CREATE VIEW topics AS {ENDLESS} x id, 'a' name, '' type, 'cdr' serialization_format FROM c",
        "DROP TABLE messages; CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, "
        "data BLOB GENERATED ALWAYS AS (zeroblob(900000000)) VIRTUAL); INSERT INTO messages VALUES (1, 1, 1)",
    ],
)
def test_nothing_in_a_db3_is_run(tmp_path, script):
    path = write_old_db3(tmp_path / "a.db3", 3, unknown=False)
    with sqlite3.connect(path) as base:
        base.executescript(script)
    base.close()
    with pytest.raises(LogError, match="is no plain table"):
        read_all(path)


def test_rows_of_other_kinds_are_counted(tmp_path):
    path = write_old_db3(tmp_path / "a.db3", 100, unknown=False)
    with sqlite3.connect(path) as base:
        base.execute("UPDATE messages SET topic_id = 'x' WHERE id <= 10")
        base.execute("UPDATE messages SET data = 3.5 WHERE id BETWEEN 41 AND 60")
        base.execute("INSERT INTO topics VALUES (3, x'FFFE2F61', NULL, NULL, NULL)")
        base.execute("UPDATE topics SET name = CAST(x'2FFF61' AS TEXT) WHERE id = 1")
    base.close()
    channels, reader = read_all(path)
    assert [c.values.size for c in channels.values()] == [70]
    assert reader.faults.lost_samples == 30


def test_packed_split_is_unpacked_within_its_size(tmp_path):
    path = write_bag2(tmp_path / "drive", range(3))
    (path / "drive_9.db3.zstd").write_bytes(zstandard.compress(b"SQLite format 3\0" + bytes(1 << 26)))
    (path / "metadata.yaml").write_text("\n" * 200_000)  # nor does a file of blank lines take long
    channels, reader = read_all(path)
    check(channels, 3)
    assert any("drive_9" in note and "is not unpacked" in note for note in reader.faults.notes)


def test_an_empty_directory_is_refused(tmp_path):
    with pytest.raises(LogError, match="no split"):
        RosReader(tmp_path, ReadOptions())


def test_log_is_not_changed(tmp_path):
    path = write_bag2(tmp_path / "drive", range(9))
    before = {p.name: p.read_bytes() for p in path.iterdir()}
    read_all(path)
    assert {p.name: p.read_bytes() for p in path.iterdir()} == before
