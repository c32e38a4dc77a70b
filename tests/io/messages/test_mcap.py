"""MCAP files written with the format's own library, read back to the last bit, then damaged."""

from __future__ import annotations

import json
import struct
import tracemalloc
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType
from rosbags.typesys import Stores, get_typestore

from aqualog.align.load import load_signals
from aqualog.align.mapping import Entry, SignalMap
from aqualog.core.errors import LogError, SignalError
from aqualog.core.records import Channel
from aqualog.core.vehicle import Vehicle
from aqualog.io.decompress import FREE, Allowance, DamagedError
from aqualog.io.messages import mcap
from aqualog.io.messages.mcap import McapSource, scanned
from aqualog.io.messages.reader import McapReader, RosReader
from aqualog.io.reader import ReadOptions
from aqualog.io.write_mcap import McapTopic, write_mcap
from tests.mcap_log import writing

LONGEST = 1 << 24
T0 = 1_700_000_000 * 10**9
SCHEMA = {
    "type": "object",
    "properties": {
        "omega_fl": {"type": "number", "unit": "rad/s"},
        "v": {"type": "number", "description": "speed over ground [km/h]"},
        "state": {"type": "string"},
    },
}


def read_all(path: Path) -> tuple[dict[str, Channel], McapReader]:
    reader = McapReader(path, ReadOptions())
    return {c.info.path: c for c in reader.read(reader.channels())}, reader


def write_json(path: Path, messages: list[dict], topic: str = "/car", schema: dict | None = SCHEMA, **options) -> Path:
    with writing(path, **options) as writer:
        schema_id = writer.register_schema("Car", "jsonschema", json.dumps(schema).encode()) if schema else 0
        channel = writer.register_channel(topic, "json", schema_id)
        for i, message in enumerate(messages):
            writer.add_message(channel, T0 + i * 10**7, json.dumps(message).encode(), T0)
    return path


def numbered(n: int) -> list[dict]:
    return [{"omega_fl": i * 0.1, "v": float(i), "state": "dry"} for i in range(n)]


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("indexed", [True, False])
def test_json_comes_back_exactly_with_units(tmp_path, compression, indexed):
    layout = {} if indexed else {"index_types": IndexType.NONE, "use_statistics": False, "repeat_channels": False}
    path = write_json(tmp_path / "a.mcap", numbered(500), compression=compression, chunk_size=2000, **layout)
    channels, reader = read_all(path)
    assert list(channels) == ["/car.omega_fl", "/car.v"]
    omega = channels["/car.omega_fl"]
    assert (omega.info.name, omega.info.unit, omega.info.count) == ("omega_fl", "rad/s", 500)
    assert omega.info.file == "a.mcap"
    assert channels["/car.v"].info.unit == "km/h"
    np.testing.assert_array_equal(omega.values, np.arange(500) * 0.1)
    np.testing.assert_array_equal(omega.t_ns, T0 + np.arange(500) * 10**7)
    assert omega.absolute
    assert omega.values.dtype == np.float64
    assert omega.t_ns.dtype == np.int64
    assert reader.faults.lost_samples == 0
    assert not reader.faults.truncated
    assert reader.faults.notes == ()


def test_unchunked_file_and_only_what_is_wanted(tmp_path):
    path = write_json(tmp_path / "a.mcap", numbered(20), use_chunking=False, enable_data_crcs=True)
    with McapReader(path, ReadOptions()) as reader:
        infos = reader.channels()
        (v,) = reader.read([infos[1]])
        assert v.info is infos[1]
        np.testing.assert_array_equal(v.values, np.arange(20.0))
        assert reader.faults.notes == ()


def test_altered_unchunked_data_are_noted(tmp_path):
    path = write_json(tmp_path / "a.mcap", numbered(20), use_chunking=False, enable_data_crcs=True)
    raw = path.read_bytes()
    path.write_bytes(raw.replace(b'"v": 7.0', b'"v": 9.0'))
    _, reader = read_all(path)
    assert "checksum" in reader.faults.notes[0]


def test_null_missing_and_text_are_nan_and_order_is_the_files(tmp_path):
    messages = [
        {"a": None, "b": True, "n": {"x": 1}},
        {"a": 2, "n": {"x": "text"}},
        {"a": 3.5, "b": False, "n": None, "list": [1, [2, 3]], "long": list(range(17))},
    ]
    path = write_json(tmp_path / "a.mcap", messages, schema=None)
    channels, _ = read_all(path)
    assert set(channels) == {"/car.a", "/car.b", "/car.n.x", "/car.list[0]", "/car.list[1][0]", "/car.list[1][1]"}
    np.testing.assert_array_equal(channels["/car.a"].values, [np.nan, 2, 3.5])
    np.testing.assert_array_equal(channels["/car.b"].values, [1, np.nan, 0])
    np.testing.assert_array_equal(channels["/car.n.x"].values, [1, np.nan, np.nan])
    np.testing.assert_array_equal(channels["/car.list[1][1]"].values, [np.nan, np.nan, 3])
    assert channels["/car.n.x"].info.name == "x"
    assert channels["/car.list[1][0]"].info.name == "list[1][0]"


def test_out_of_order_messages_stay_in_file_order(tmp_path):
    path = tmp_path / "a.mcap"
    times = [50, 10, 30, 10]
    with writing(path) as writer:
        channel = writer.register_channel("/w", "json", 0)
        for t in times:
            writer.add_message(channel, t, json.dumps({"value": t}).encode(), t)
    channels, _ = read_all(path)
    assert channels["/w.value"].info.name == "w"
    assert channels["/w.value"].t_ns.tolist() == times
    assert not channels["/w.value"].absolute


def test_json_stamp_is_used_when_plausible(tmp_path):
    stamps = [{"sec": 1_700_000_000, "nsec": 5}, {"sec": 0, "nsec": 0}, {"sec": 1_600_000_000, "nsec": 0}]
    path = write_json(tmp_path / "a.mcap", [{"timestamp": s, "x": 1} for s in stamps], schema=None)
    channels, reader = read_all(path)
    assert list(channels) == ["/car.x"]
    assert channels["/car.x"].t_ns.tolist() == [T0 + 5, T0 + 10**7, T0 + 2 * 10**7]
    assert "2 of 3 time stamps" in reader.faults.notes[0]


@pytest.mark.parametrize(
    ("description", "unit"),
    [("a [km/h]", "km/h"), ("in [0, 1]", ""), ("wheel [2]", ""), ("slip [-]", "-"), ("[m/s] forward", "")],
)
def test_bracket_units(tmp_path, description, unit):
    schema = {"type": "object", "properties": {"a": {"type": "number", "description": description}}}
    path = write_json(tmp_path / "a.mcap", [{"a": 1}], schema=schema)
    assert McapReader(path, ReadOptions()).channels()[0].unit == unit


@pytest.fixture
def wheel_type():
    file = FileDescriptorProto(name="wheel.proto", package="car", syntax="proto3")
    file.dependency.append("google/protobuf/timestamp.proto")
    inner = file.message_type.add(name="Inner")
    inner.field.add(name="x", number=1, type=FieldDescriptorProto.TYPE_FLOAT, label=1)
    wheel = file.message_type.add(name="Wheel")
    message, repeated = FieldDescriptorProto.TYPE_MESSAGE, FieldDescriptorProto.LABEL_REPEATED
    wheel.field.add(name="timestamp", number=1, type=message, type_name=".google.protobuf.Timestamp", label=1)
    wheel.field.add(name="omega", number=2, type=FieldDescriptorProto.TYPE_DOUBLE, label=1)
    wheel.field.add(name="inner", number=3, type=message, type_name=".car.Inner", label=1)
    wheel.field.add(name="raw", number=4, type=FieldDescriptorProto.TYPE_INT32, label=repeated)
    wheel.field.add(name="text", number=5, type=FieldDescriptorProto.TYPE_STRING, label=1)
    wheel.field.add(name="inners", number=6, type=message, type_name=".car.Inner", label=repeated)
    stamp = FileDescriptorProto()
    Timestamp.DESCRIPTOR.file.CopyToProto(stamp)
    files = FileDescriptorSet(file=[stamp, file])
    pool = DescriptorPool()
    for f in files.file:
        pool.Add(f)
    return GetMessageClass(pool.FindMessageTypeByName("car.Wheel")), files.SerializeToString()


def test_protobuf(tmp_path, wheel_type):
    wheel, files = wheel_type
    path = tmp_path / "p.mcap"
    with writing(path) as writer:
        schema = writer.register_schema("car.Wheel", "protobuf", files)
        channel = writer.register_channel("/wheel", "protobuf", schema)
        for i in range(4):
            message = wheel(omega=i / 3, raw=[i, 2 * i], text="t", inners=[{"x": 0.5}])
            message.timestamp.FromNanoseconds(T0 + i)
            if i != 1:
                message.inner.x = i + 0.5
            writer.add_message(channel, T0 + 10**9, message.SerializeToString(), T0)
    channels, _ = read_all(path)
    assert set(channels) == {f"/wheel.{f}" for f in ("omega", "inner.x", "raw[0]", "raw[1]", "inners[0].x")}
    np.testing.assert_array_equal(channels["/wheel.omega"].values, np.arange(4) / 3)
    np.testing.assert_array_equal(channels["/wheel.inner.x"].values, [0.5, np.nan, 2.5, 3.5])
    np.testing.assert_array_equal(channels["/wheel.raw[1]"].values, [0, 2, 4, 6])
    assert channels["/wheel.omega"].t_ns.tolist() == [T0 + i for i in range(4)]


def imu_message(store, ros1: bool, i: int, stamp_ns: int):
    types = store.types
    seconds, nanoseconds = divmod(stamp_ns, 10**9)
    stamp = types["builtin_interfaces/msg/Time"](seconds, nanoseconds)
    header_type = types["std_msgs/msg/Header"]
    header = header_type(i, stamp, "imu") if ros1 else header_type(stamp, "imu")
    vector = types["geometry_msgs/msg/Vector3"]
    nine = np.arange(9.0) + i
    return types["sensor_msgs/msg/Imu"](
        header,
        types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
        nine,
        vector(0.0, 0.0, i * 0.01),
        nine,
        vector(i * 1.5, 0.0, 9.81),
        nine,
    )


@pytest.mark.parametrize("ros", [1, 2])
def test_ros_messages(tmp_path, ros):
    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    path = tmp_path / "r.mcap"
    with writing(path, profile=f"ros{ros}") as writer:
        encoding = {1: ("ros1", "ros1msg", "sensor_msgs/Imu"), 2: ("cdr", "ros2msg", "sensor_msgs/msg/Imu")}[ros]
        text = store.generate_msgdef("sensor_msgs/msg/Imu", ros_version=ros)[0].encode()
        channel = writer.register_channel(
            "/imu/data", encoding[0], writer.register_schema(encoding[2], encoding[1], text)
        )
        for i in range(10):
            message = imu_message(store, ros == 1, i, T0 + i * 10**7)
            raw = (store.serialize_ros1 if ros == 1 else store.serialize_cdr)(message, "sensor_msgs/msg/Imu")
            writer.add_message(channel, T0 + i * 10**7 + 1234, bytes(raw), T0)
    channels, reader = read_all(path)
    assert len(channels) == 10 + 27
    a_x = channels["/imu/data.linear_acceleration.x"]
    assert a_x.info.name == "x"
    np.testing.assert_array_equal(a_x.values, np.arange(10) * 1.5)
    np.testing.assert_array_equal(channels["/imu/data.orientation_covariance[8]"].values, np.arange(10) + 8.0)
    assert a_x.t_ns.tolist() == [T0 + i * 10**7 for i in range(10)]
    assert reader.faults.notes == ()


def test_idl_definition_and_missing_log_time(tmp_path):
    path = tmp_path / "i.mcap"
    text = (
        "=" * 80 + "\nIDL: car/msg/Wheel\nmodule car { module msg { struct Wheel {\n"
        "  builtin_interfaces::msg::Time stamp;\n  double omega;\n}; }; };\n"
    )
    with writing(path, profile="ros2") as writer:
        channel = writer.register_channel(
            "/w", "cdr", writer.register_schema("car/msg/Wheel", "ros2idl", text.encode())
        )
        for i in range(3):
            writer.add_message(channel, 0, b"\0\1\0\0" + struct.pack("<iId", 1_700_000_000, i, i / 3), 0)
    channels, _ = read_all(path)
    assert list(channels) == ["/w.omega"]
    assert channels["/w.omega"].values.tolist() == [0, 1 / 3, 2 / 3]
    assert channels["/w.omega"].t_ns.tolist() == [T0, T0 + 1, T0 + 2]


def test_unknown_topics_are_left_out_with_a_note(tmp_path):
    path = tmp_path / "u.mcap"
    with writing(path) as writer:
        good = writer.register_channel("/good", "json", 0)
        flat = writer.register_channel("/flat", "flatbuffer", writer.register_schema("F", "flatbuffer", b"x"))
        odd = writer.register_channel("/odd", "cdr", writer.register_schema("a/msg/B", "ros2msg", b"foo/Missing x"))
        broken = writer.register_channel("/broken", "json", 0)
        for i in range(3):
            for channel, data in ((good, b'{"data": 1}'), (flat, b"xx"), (odd, b"\0\1\0\0"), (broken, b"{")):
                writer.add_message(channel, i, data, i)
    channels, reader = read_all(path)
    assert list(channels) == ["/good.data"]
    notes = " ".join(reader.faults.notes)
    assert all(word in notes for word in ('"/flat"', "flatbuffer", "foo/msg/Missing", '"/broken"'))


def test_message_that_cannot_be_decoded_is_counted(tmp_path):
    path = tmp_path / "a.mcap"
    with writing(path) as writer:
        channel = writer.register_channel("/a", "json", 0)
        for i, data in enumerate([b'{"x": 1}', b'{"x": ', b"[" * 100_000, b'{"x": 4}']):
            writer.add_message(channel, i, data, i)
    channels, reader = read_all(path)
    assert channels["/a.x"].values.tolist() == [1, 4]
    assert channels["/a.x"].t_ns.tolist() == [0, 3]
    assert reader.faults.lost_samples == 2


def test_truncated_file_gives_what_stands_before_the_cut(tmp_path):
    path = write_json(tmp_path / "a.mcap", numbered(5000), chunk_size=4000)
    raw = path.read_bytes()
    path.write_bytes(raw[: len(raw) * 6 // 10])
    channels, reader = read_all(path)
    v = channels["/car.v"].values
    assert 2000 < v.size < 4500
    np.testing.assert_array_equal(v, np.arange(v.size))
    assert channels["/car.v"].info.count == v.size
    assert reader.faults.truncated
    assert any("cut off" in note for note in reader.faults.notes)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.01, 0.2, 0.5, 0.9, 0.99, 0.999])
def test_no_cut_crashes(tmp_path, share):
    path = write_json(tmp_path / "a.mcap", numbered(300), chunk_size=1000)
    raw = path.read_bytes()
    path.write_bytes(raw[: int(len(raw) * share)])
    if share * len(raw) < 8:
        with pytest.raises(LogError):
            McapReader(path, ReadOptions())
        return
    channels, _ = read_all(path)
    for channel in channels.values():
        assert channel.values.size <= 300


def chunk_offsets(path: Path) -> list[tuple[int, int]]:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return [(c.chunk_start_offset, c.chunk_length) for c in summary.chunk_indexes]


def test_sound_summary_saves_a_pass_and_tells_the_same_channels(tmp_path, monkeypatch):
    messages = [{"x": i, "late": [i] * (i // 3)} for i in range(40)]
    path = write_json(tmp_path / "a.mcap", messages, schema=None, chunk_size=60)
    cut = write_json(tmp_path / "b.mcap", messages, schema=None, chunk_size=60, use_statistics=False)
    with McapReader(cut, ReadOptions()) as reader:
        scanned = [(c.path, c.count) for c in reader.channels()]
    monkeypatch.setattr(McapSource, "_scan", None)
    with McapReader(path, ReadOptions()) as reader:
        assert [(c.path, c.count) for c in reader.channels()] == scanned
    assert scanned[-1] == ("/car.late[1]", 40)


@pytest.mark.parametrize("with_summary", [True, False])
def test_flipped_chunk_costs_that_chunk_only(tmp_path, with_summary):
    path = write_json(tmp_path / "a.mcap", numbered(2000), chunk_size=4000)
    start, length = chunk_offsets(path)[3]
    raw = bytearray(path.read_bytes())
    raw[start + length - 40] ^= 0x55
    path.write_bytes(raw if with_summary else raw[:-1])
    channels, reader = read_all(path)
    v = channels["/car.v"].values
    assert 1800 < v.size < 2000
    assert np.all(np.diff(v) > 0)
    assert reader.faults.lost_samples == 2000 - v.size
    assert any("damaged chunk" in note for note in reader.faults.notes)


def test_a_topic_of_which_nothing_can_be_read_is_a_loss_and_the_reason(tmp_path):
    path = write_json(tmp_path / "a.mcap", numbered(50), chunk_size=100_000)
    ((start, length),) = chunk_offsets(path)
    raw = bytearray(path.read_bytes())
    raw[start + length - 40] ^= 0x55
    path.write_bytes(raw)
    channels, reader = read_all(path)
    assert not channels
    assert reader.faults.lost_samples == 50
    with pytest.raises(SignalError, match="none of its messages can be read"):
        load_signals([path], vehicle=Vehicle(), signal_map=SignalMap({"v_x": Entry("v_x", ("/car.v",))}))


def test_random_flips_never_crash_nor_alter_values(tmp_path):
    path = write_json(tmp_path / "a.mcap", numbered(400), chunk_size=1500)
    raw = path.read_bytes()
    rng = np.random.default_rng(1)
    for position in rng.integers(8, len(raw), 150):
        damaged = bytearray(raw)
        damaged[position] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        channels, _ = read_all(path)
        if "/car.v" in channels:
            v = channels["/car.v"].values
            assert np.isin(v, np.arange(400)).all()


def chunk_record(data: bytes, compression: str, size: int) -> bytes:
    head = struct.pack("<QQQII", 0, 0, size, 0, len(compression)) + compression.encode()
    body = head + struct.pack("<Q", len(data)) + data
    return struct.pack("<BQ", Opcode.CHUNK, len(body)) + body


def zeros_packed(compression: str, size: int) -> bytes:
    if compression == "zstd":
        return zstandard.compress(bytes(size))
    return lz4.frame.compress(bytes(size))


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
@pytest.mark.parametrize(
    ("declared", "reason"), [(10, "declares"), (1 << 26, "more than"), (1 << 40, "more than"), (1 << 20, "of kind 0")]
)
def test_bomb_is_refused_and_the_rest_is_read(tmp_path, compression, declared, reason):
    path = write_json(tmp_path / "a.mcap", numbered(3), index_types=IndexType.NONE)
    raw = path.read_bytes()
    first = raw.index(bytes([Opcode.CHUNK]), 8 + 9 + struct.unpack_from("<Q", raw, 9)[0])
    size = min(declared, 1 << 26) if declared != 10 else 1 << 26
    data = zeros_packed("zstd", size) if compression == "zstd" else zeros_packed("lz4", min(size, 1 << 24))
    if compression == "lz4" and declared == 1 << 26:
        data = data[:4096]  # a head that lies
    path.write_bytes(raw[:first] + chunk_record(data, compression, declared) + raw[first:])
    tracemalloc.start()
    channels, reader = read_all(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert channels["/car.v"].values.tolist() == [0, 1, 2]
    assert any(reason in note for note in reader.faults.notes)
    assert reader.faults.truncated  # what was in it is not known
    assert peak < 60e6


def test_zeros_are_not_walked_to_their_end():
    zeros = bytes(1 << 22)
    tracemalloc.start()
    assert scanned(zeros).fault
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2e6


def test_many_small_bombs_are_no_more_than_one(tmp_path):
    spare = Allowance()
    spare.take(1000, FREE)
    with pytest.raises(DamagedError, match="more than"):
        spare.take(1000, FREE)
    spare.take(4_000_000, 40_000_000)  # a sound block fills the store again
    spare.take(1000, FREE)


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("indexed", [True, False])
@pytest.mark.parametrize("length", [1 << 60, 30, 9000])
def test_a_length_that_lies_costs_that_chunk_only(tmp_path, compression, indexed, length):
    path = write_json(tmp_path / "a.mcap", numbered(2000), chunk_size=4000, compression=compression)
    offsets = chunk_offsets(path)
    raw = bytearray(path.read_bytes())
    struct.pack_into("<Q", raw, offsets[3][0] + 1, length)
    path.write_bytes(raw if indexed else raw[:-1])
    channels, reader = read_all(path)
    v = channels["/car.v"].values
    assert 1800 < v.size < 2000
    assert np.all(np.diff(v) > 0)
    assert v[-1] == 1999
    assert any(f"{offsets[3][0]}" in note for note in reader.faults.notes)
    assert reader.faults.lost_samples == 2000 - v.size if indexed else reader.faults.truncated


@pytest.mark.parametrize("opcode", [Opcode.MESSAGE, Opcode.CHUNK, Opcode.SCHEMA, Opcode.ATTACHMENT, Opcode.METADATA])
@pytest.mark.parametrize("length", [2**63, LONGEST + (1 << 17)])
@pytest.mark.parametrize("at_end", [False, True])
def test_a_record_that_tells_of_more_than_there_is_costs_no_memory(tmp_path, monkeypatch, opcode, length, at_end):
    """Before a chunk, or in front of a hole as large as it tells of."""
    monkeypatch.setattr(mcap, "LONGEST", LONGEST)
    path = write_json(tmp_path / "a.mcap", numbered(500), chunk_size=4000)
    raw = path.read_bytes()
    start = chunk_offsets(path)[2][0]
    lie = struct.pack("<BQ", opcode, length) + struct.pack("<QQII", 1, 1, 2**32 - 1, 7)
    with path.open("wb") as file:
        file.write(raw[:start] + lie)
        if at_end:
            file.truncate(LONGEST + (1 << 19))
        else:
            file.write(raw[start:])
    tracemalloc.start()
    channels, reader = read_all(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < LONGEST / 2
    v = channels["/car.v"].values
    assert v[-1] == (499 if not at_end else v.size - 1)
    assert np.all(np.diff(v) == 1)
    if opcode != Opcode.METADATA or length > 1 << 40:  # of what is never read the length may be any
        assert reader.faults.truncated
        assert any(f"from byte {start}" in note for note in reader.faults.notes)


@pytest.mark.parametrize("grown", [0, 5, 3000, 1 << 40])
def test_an_attachment_that_lies_about_its_size_costs_nothing_else(tmp_path, grown):
    path = tmp_path / "a.mcap"
    with writing(path, chunk_size=4000, use_statistics=False) as writer:
        channel = writer.register_channel("/car", "json", writer.register_schema("Car", "jsonschema", b"{}"))
        for i in range(500):
            if i == 100:
                writer.add_attachment(T0, T0, "video.bin", "application/octet-stream", bytes(500))
            writer.add_message(channel, T0 + i * 10**7, b'{"v": %d}' % i, T0)
    raw = bytearray(path.read_bytes())
    start = raw.index(b"video.bin") - 9 - 8 - 8 - 4
    assert raw[start] == Opcode.ATTACHMENT
    struct.pack_into("<Q", raw, start + 1, struct.unpack_from("<Q", raw, start + 1)[0] + grown)
    path.write_bytes(raw)
    channels, reader = read_all(path)
    assert channels["/car.v"].values.tolist() == list(range(500))
    assert reader.faults.truncated == (grown > 0)


@pytest.mark.parametrize("outside", [2**63, 2**40, "size", 8])
def test_a_chunk_index_that_points_elsewhere_is_not_believed(tmp_path, outside):
    path = write_json(tmp_path / "a.mcap", numbered(500), chunk_size=4000)
    raw = bytearray(path.read_bytes())
    with path.open("rb") as file:
        entry = make_reader(file).get_summary().chunk_indexes[2]
    raw[-12:-8] = bytes(4)  # no checksum over the summary
    at = raw.rindex(struct.pack("<QQ", entry.chunk_start_offset, entry.chunk_length))
    struct.pack_into("<Q", raw, at, len(raw) - 20 if outside == "size" else outside)
    path.write_bytes(raw)
    channels, reader = read_all(path)
    v = channels["/car.v"].values
    assert np.isin(v, np.arange(500)).all()
    assert v.size == 500 or reader.faults.lost_samples or reader.faults.truncated


@pytest.mark.parametrize("opcode", [Opcode.DATA_END, Opcode.FOOTER, 0])
def test_an_end_that_is_none_is_passed_over(tmp_path, opcode):
    path = write_json(tmp_path / "a.mcap", numbered(2000), chunk_size=4000, use_statistics=False)
    start, _ = chunk_offsets(path)[3]
    raw = bytearray(path.read_bytes())
    raw[start] = opcode
    raw[start + 1 : start + 9] = {Opcode.DATA_END: 4, Opcode.FOOTER: 20, 0: 0}[opcode].to_bytes(8, "little")
    path.write_bytes(raw)
    channels, reader = read_all(path)
    assert 1800 < channels["/car.v"].values.size < 2000
    assert channels["/car.v"].values[-1] == 1999
    assert reader.faults.truncated


def test_chunks_without_checksums_are_proven_by_that_of_the_data(tmp_path):
    options = {"chunk_size": 4000, "compression": CompressionType.NONE, "enable_crcs": False}
    path = write_json(tmp_path / "a.mcap", numbered(500), enable_data_crcs=True, **options)
    assert not read_all(path)[1].faults.truncated
    raw = path.read_bytes()
    path.write_bytes(raw.replace(b'"v": 123.0', b'"v": 163.0', 1))
    channels, reader = read_all(path)
    assert channels["/car.v"].values[123] == 163
    assert reader.faults.truncated
    assert any("checksum" in note for note in reader.faults.notes)


@pytest.mark.parametrize("content", [b"", b"something else entirely"])
@pytest.mark.parametrize(("reader", "name"), [(McapReader, "x.mcap"), (RosReader, "x.bag")])
def test_other_files_are_refused(tmp_path, reader, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(LogError, match=name):
        reader(path, ReadOptions())
    with pytest.raises(LogError, match=r"cannot be opened|does not exist"):
        reader(tmp_path / f"no_{name}", ReadOptions())


@pytest.mark.parametrize("start", [None, T0])
def test_written_log_comes_back(tmp_path, start):
    t = np.arange(0, 5000, dtype=np.int64) * 10**7
    rng = np.random.default_rng(0)
    omega, a_x = rng.normal(size=t.size), rng.normal(size=t.size)
    omega[17], a_x[3] = np.nan, np.inf
    topics = [
        McapTopic("/signals", t, {"omega_fl": ("rad/s", "wheel speed", omega), "a_x": ("m/s^2", "", a_x)}),
        McapTopic("/gnss", t[::10], {"v_x": ("m/s", "velocity", omega[::10])}),
        McapTopic("/none", t[:0], {}),
    ]
    path = tmp_path / "out.mcap"
    write_mcap(path, topics, start)
    channels, reader = read_all(path)
    assert list(channels) == ["/signals.omega_fl", "/signals.a_x", "/gnss.v_x"]
    np.testing.assert_array_equal(channels["/signals.omega_fl"].values, omega)
    a_x[3] = np.nan
    np.testing.assert_array_equal(channels["/signals.a_x"].values, a_x)
    gnss = channels["/gnss.v_x"]
    np.testing.assert_array_equal(gnss.t_ns, t[::10] + (start or 0))
    assert gnss.absolute == (start is not None)
    assert (gnss.info.name, gnss.info.unit, gnss.info.count) == ("v_x", "m/s", 500)
    assert reader.faults.notes == ()


def test_written_file_is_in_time_order_and_strict_json(tmp_path):
    t = np.arange(100, dtype=np.int64)
    columns = {"x": ("m", "way", np.where(t == 5, np.nan, t.astype(float)))}
    path = tmp_path / "out.mcap"
    write_mcap(path, [McapTopic("/a", t, columns), McapTopic("/b", t + 50, columns)], None)
    with path.open("rb") as file:
        rows = list(make_reader(file, validate_crcs=True).iter_messages(log_time_order=False))
    assert [r[2].log_time for r in rows] == sorted(r[2].log_time for r in rows)
    schema = json.loads(rows[0][0].data)
    assert schema["type"] == "object"
    assert schema["properties"]["x"] == {"type": "number", "unit": "m", "description": "way [m]"}
    assert rows[5][2].data == b'{"x":null}'


def test_negative_time_is_refused(tmp_path):
    topic = McapTopic("/a", np.array([-1], dtype=np.int64), {"x": ("m", "", np.zeros(1))})
    with pytest.raises(LogError, match="before 0"):
        write_mcap(tmp_path / "out.mcap", [topic], None)
    assert not (tmp_path / "out.mcap").exists()


def test_a_recording_without_its_end_is_told_and_read(tmp_path):
    path = write_json(tmp_path / "a.mcap", numbered(100))
    data = path.read_bytes()
    assert not read_all(path)[1].faults.unfinalised
    end = data.rindex(bytes([Opcode.DATA_END]) + struct.pack("<Q", 4)) + 13  # all messages, and nothing behind them
    path.write_bytes(data[:end])
    channels, reader = read_all(path)
    assert channels["/car.v"].values.tolist() == list(range(100))
    assert reader.faults.unfinalised
    assert any("was not finalised" in n for n in reader.faults.notes)
    assert reader.faults.lost_samples == 0
