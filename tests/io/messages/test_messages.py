"""Messages cut into columns by their layout: the same as decoded one by one, to the bit, faults and notes included."""

from __future__ import annotations

import sqlite3
import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, IndexType
from rosbags.interfaces import Nodetype
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from aqualog.io.messages import batches, codecs, streams
from aqualog.io.messages.mcap import scanned
from aqualog.io.open_log import open_log
from aqualog.io.reader import ReadOptions
from tests.mcap_log import writing

T0 = 1_700_000_000 * 10**9
STEP = 10**7
NUMBERS = {
    "bool": "u1", "byte": "i1", "char": "u1", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
UNINDEXED = {"index_types": IndexType.NONE, "use_statistics": False, "repeat_channels": False, "repeat_schemas": False}
WHEELS = (
    "std_msgs/Header header\nfloat64[4] omega\nfloat32[] torque\nstring[] names\nuint8 gear\nint64 ticks\nbool[2] on\n"
)


def outcome(path: Path) -> tuple:
    """All channels as bytes, and the faults."""
    with open_log(path, ReadOptions()) as reader:
        found = reader.read(reader.channels())
        channels = {c.info.path: (c.info.count, c.absolute, c.t_ns.tobytes(), c.values.tobytes()) for c in found}
        return channels, reader.faults


def compared(path: Path, batch: int = 1 << 19) -> list[bool]:
    """Read both ways and compare; which batches of a topic were cut."""
    cuts: list[bool] = []
    cut = streams._Cutter.cut

    def counted(self, rows):
        found = cut(self, rows)
        cuts.append(found is not None)
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(batches, "_ENOUGH", batch)
        patch.setattr(streams._Cutter, "cut", counted)
        fast = outcome(path)
        patch.setattr(streams._Cutter, "cut", lambda *_: None)
        plain = outcome(path)
    assert fast[0].keys() == plain[0].keys()
    for name, channel in fast[0].items():
        assert channel == plain[0][name], name
    assert fast[1] == plain[1]
    return cuts


class Types:
    """Types of one's own, messages of them, and their bytes."""

    def __init__(self, ros: int, definitions: dict[str, str]) -> None:
        self.ros = ros
        self.store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
        for name, text in definitions.items():
            self.store.register(get_types_from_msg(text, name))

    def message(self, name: str, rng: np.random.Generator, lengths, text) -> object:
        """Any values; `lengths(path)` tells how many elements a sequence has, `text(path)` what a text is."""
        return self._value((Nodetype.NAME, name), rng, lengths, text, "")

    def _value(self, field, rng, lengths, text, path):
        kind, detail = field
        if kind == Nodetype.NAME:
            fields = self.store.fielddefs[detail][1]
            return self.store.types[detail](*(self._value(f, rng, lengths, text, f"{path}.{n}") for n, f in fields))
        if kind == Nodetype.BASE:
            return text(path) if detail[0] == "string" else drawn(detail[0], None, rng)
        count = detail[1] if kind == Nodetype.ARRAY else lengths(path)
        if detail[0][0] == Nodetype.BASE and detail[0][1][0] != "string":
            return drawn(detail[0][1][0], count, rng)
        return [self._value(detail[0], rng, lengths, text, f"{path}[{i}]") for i in range(count)]

    def serialized(self, message: object, name: str, *, little: bool = True) -> bytes:
        if self.ros == 1:
            return bytes(self.store.serialize_ros1(message, name))
        return bytes(self.store.serialize_cdr(message, name, little_endian=little))

    def schema(self, name: str) -> tuple[str, str, bytes]:
        text = self.store.generate_msgdef(name, ros_version=self.ros)[0].encode()
        return ("ros1", "ros1msg", text) if self.ros == 1 else ("cdr", "ros2msg", text)


def drawn(base: str, count: int | None, rng: np.random.Generator):
    dtype = np.dtype(NUMBERS[base])
    values = rng.integers(0, 256, dtype.itemsize * (count or 1), dtype=np.uint8).view(dtype)[
        : 1 if count is None else count
    ]
    if base == "bool":
        values = values % 2 == 1
    return values[0].item() if count is None else values


def write_mcap(path: Path, types: Types, topics: dict[str, tuple[str, list[bytes]]], **options) -> Path:
    """Messages of all topics in turns; shorter topics end earlier."""
    with writing(path, profile=f"ros{types.ros}", **options) as writer:
        queues = []
        for topic, (kind, raw) in topics.items():
            encoding, schema_encoding, text = types.schema(kind)
            schema = writer.register_schema(kind, schema_encoding, text)
            queues.append((writer.register_channel(topic, encoding, schema), raw))
        for i in range(max(len(raw) for _, raw in queues)):
            for channel, raw in queues:
                if i < len(raw):
                    writer.add_message(channel, T0 + i * STEP, raw[i], T0)
    return path


def drawn_types(rng: np.random.Generator, ros: int) -> Types:
    """Three types, each may hold the ones before it."""
    definitions: dict[str, str] = {}
    bases = [*NUMBERS, "string", *(["time"] if ros == 1 else ["builtin_interfaces/Time"])]
    for k in range(3):
        lines = ["std_msgs/Header header"] if k == 2 and rng.random() < 0.7 else []
        for i in range(int(rng.integers(1, 6))):
            base = str(rng.choice([*bases, *(f"car/T{j}" for j in range(k))]))
            lines.append(f"{base}{rng.choice(['', '', f'[{rng.integers(1, 4)}]', '[]'])} f{i}")
        definitions[f"car/msg/T{k}"] = "\n".join(lines) + "\n"
    return Types(ros, definitions)


def drawn_messages(types: Types, rng: np.random.Generator, count: int, how: str, orders: str) -> list[bytes]:
    """Messages of type T2 whose texts and sequences are as long in all (`same`), mostly, or in none of them."""
    seed = int(rng.integers(1 << 30))
    words = ("base", "wet", "", "Straße", "nasse Fahrbahn")
    found = []
    for i in range(count):
        own = how == "any" or (how == "mostly" and i % 30 == 29)

        def length(path: str, own: bool = own) -> int:
            return int(rng.integers(0, 4)) if own else (seed ^ sum(path.encode())) % 4

        def text(path: str, own: bool = own) -> str:
            if own:
                return str(rng.choice(words))
            constant = words[(seed ^ sum(path.encode())) % len(words)]
            return constant if sum(path.encode()) % 2 else "".join(rng.choice(list("abc"), len(constant)))

        little = orders == "little" or (orders == "mixed" and i % 30 > 5)
        found.append(types.serialized(types.message("car/msg/T2", rng, length, text), "car/msg/T2", little=little))
    return found


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 2**32 - 1), ros=st.sampled_from([1, 2, 2]), how=st.sampled_from(["same", "same", "mostly", "any"]),
    orders=st.sampled_from(["little", "big", "mixed"]), compression=st.sampled_from(CompressionType),
    chunk=st.sampled_from([200, 5000, 1 << 20]), batch=st.sampled_from([1, 3000, 1 << 19]),
    layout=st.sampled_from(["indexed", "unindexed", "unchunked"]),
)  # fmt: skip
def test_any_type(tmp_path, seed, ros, how, orders, compression, chunk, batch, layout):
    rng = np.random.default_rng(seed)
    types = drawn_types(rng, ros)
    options = UNINDEXED if layout == "unindexed" else {"use_chunking": layout != "unchunked"}
    topics = {
        "/a": ("car/msg/T2", drawn_messages(types, rng, 100, how, orders)),
        "/b": ("car/msg/T2", drawn_messages(types, rng, 70, "same", orders)),
        "/few": ("std_msgs/msg/String", [b"\0\1\0\0\2\0\0\0a\0"] * 5),
    }
    path = write_mcap(tmp_path / "a.mcap", types, topics, compression=compression, chunk_size=chunk, **options)
    cuts = compared(path, batch)
    if how == "same" and orders != "mixed" and batch == 1 << 19:
        assert all(cuts)


def wheels(count: int, *, ros: int = 2, little: bool = True, change=lambda i, message: None) -> list[bytes]:
    types = wheel_types(ros)
    found = []
    for i in range(count):
        stamp = types.store.types["builtin_interfaces/msg/Time"](*divmod(T0 + i * STEP - 777, 10**9))
        header = types.store.types["std_msgs/msg/Header"](*([i] if ros == 1 else []), stamp, "base_link")
        omega = np.array([i * 0.1, -0.0, np.inf, 5e-324])
        torque, on = np.array([i / 3, np.nan, 1e-45], dtype=np.float32), np.array([i % 2 == 0, True])
        message = types.store.types["car/msg/Wheels"](
            header, omega, torque, ["fl", "fr"], i % 7, (-1) ** i * (2**63 - 1 - i), on
        )
        change(i, message)
        found.append(types.serialized(message, "car/msg/Wheels", little=little))
    return found


def wheel_types(ros: int) -> Types:
    return Types(ros, {"car/msg/Wheels": WHEELS})


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("little", [True, False])
def test_wheels_come_back_exactly(tmp_path, ros, little):
    topics = {"/wheels": ("car/msg/Wheels", wheels(300, ros=ros, little=little))}
    path = write_mcap(tmp_path / "a.mcap", wheel_types(ros), topics)
    assert compared(path) == [True]
    with open_log(path, ReadOptions()) as reader:
        found = {c.info.path: c for c in reader.read(reader.channels())}
    i = np.arange(300)
    np.testing.assert_array_equal(found["/wheels.omega[0]"].values, i * 0.1)
    np.testing.assert_array_equal(found["/wheels.torque[0]"].values, (i / 3).astype(np.float32).astype(float))
    np.testing.assert_array_equal(found["/wheels.on[0]"].values, i % 2 == 0)
    np.testing.assert_array_equal(found["/wheels.ticks"].values, [(-1.0) ** k * (2**63 - 1 - k) for k in range(300)])
    np.testing.assert_array_equal(found["/wheels.ticks"].t_ns, T0 + i * STEP - 777)
    assert np.isnan(found["/wheels.torque[1]"].values).all()


def changed(message, field, value) -> None:
    *path, name = field.split(".")
    for part in path:
        message = getattr(message, part)
    setattr(message, name, value)


@pytest.mark.parametrize(
    ("field", "value", "spoilt"),
    [
        ("torque", np.zeros(5, dtype=np.float32), 1), ("header.frame_id", "odom", 1), ("header.frame_id", "base-line", 0),
        ("header.frame_id", "bäse_li\u0144"[:8], 1), ("header.stamp.sec", -5, 0),
        ("names", ["f", "fle"], 1),  # as many bytes as before, the second elsewhere
    ],
)  # fmt: skip
def test_one_message_that_differs_costs_its_batch(tmp_path, field, value, spoilt):
    raw = wheels(600, change=lambda i, message: changed(message, field, value) if i == 450 else None)
    path = write_mcap(tmp_path / "a.mcap", wheel_types(2), {"/wheels": ("car/msg/Wheels", raw)}, chunk_size=4000)
    cuts = compared(path, batch=4000)
    assert len(cuts) > 10
    assert cuts.count(False) == spoilt


def test_all_that_differ_from_the_middle_on(tmp_path):
    raw = wheels(600, change=lambda i, message: changed(message, "header.frame_id", "odom") if i > 300 else None)
    path = write_mcap(tmp_path / "a.mcap", wheel_types(2), {"/wheels": ("car/msg/Wheels", raw)}, chunk_size=4000)
    assert compared(path, batch=4000).count(False) == 1


@pytest.mark.parametrize(
    "spoil",
    [
        lambda b: b[:-1], lambda b: b[:-9], lambda b: b + bytes(3), lambda b: b + bytes(4), lambda b: b"",
        lambda b: b"\0\2" + b[2:], lambda b: b"\0\0" + b[2:], lambda b: b[:2] + b"\7\7" + b[4:],
        lambda b: b.replace(b"base_link\0", b"base_link!"), lambda b: b.replace(b"base", b"\xff\xfe\0a"),
        lambda b: b[:-2] + b"\2\xff", lambda b: b.replace(struct.pack("<I", 3), struct.pack("<I", 2**31)),
    ],
)  # fmt: skip
@pytest.mark.parametrize("where", [slice(450, 451), slice(0, 1), slice(0, None, 40)])
def test_damaged_messages(tmp_path, spoil, where):
    raw = wheels(600)
    for i in range(600)[where]:
        raw[i] = spoil(raw[i])
    path = write_mcap(tmp_path / "a.mcap", wheel_types(2), {"/wheels": ("car/msg/Wheels", raw)})
    compared(path, batch=4000)


@pytest.mark.parametrize("checked", [True, False])
@pytest.mark.parametrize("layout", [{}, UNINDEXED, {"use_chunking": False}])
@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4])
def test_flipped_bytes(tmp_path, checked, layout, compression):
    """Without checksums the damage gets as far as the records' heads and the messages."""
    topics = {"/wheels": ("car/msg/Wheels", wheels(150)), "/more": ("car/msg/Wheels", wheels(80))}
    path = write_mcap(
        tmp_path / "a.mcap", wheel_types(2), topics, chunk_size=6000, compression=compression, enable_crcs=checked, **layout
    )  # fmt: skip
    sound = path.read_bytes()
    rng = np.random.default_rng(3)
    for position in rng.integers(8, len(sound), 12):
        octets = bytearray(sound)
        octets[position] ^= 1 << int(rng.integers(8))
        path.write_bytes(octets)
        compared(path, batch=4000)


def test_a_topic_on_two_connections_keeps_the_order_of_the_file(tmp_path):
    path = tmp_path / "a.mcap"
    types = wheel_types(2)
    encoding, schema_encoding, text = types.schema("car/msg/Wheels")
    with writing(path) as writer:
        schema = writer.register_schema("car/msg/Wheels", schema_encoding, text)
        channels = [writer.register_channel("/wheels", encoding, schema) for _ in range(2)]
        for i, raw in enumerate(wheels(200)):
            writer.add_message(channels[i % 3 == 0], T0 + i, raw, T0)
    compared(path)
    with open_log(path, ReadOptions()) as reader:
        found = {c.info.path: c for c in reader.read(reader.channels())}
    np.testing.assert_array_equal(found["/wheels.omega[0]"].values, np.arange(200) * 0.1)


def test_a_layout_that_is_wrong_is_not_believed(tmp_path, monkeypatch):
    path = write_mcap(tmp_path / "a.mcap", wheel_types(2), {"/wheels": ("car/msg/Wheels", wheels(200))})
    right = codecs.ros_layout

    def wrong(*args, **kwargs):
        layout = right(*args, **kwargs)
        field, count = layout.runs["omega",]
        layout.runs["omega",] = type(field)(field.at + 8, field.dtype), count
        return layout

    monkeypatch.setattr(codecs, "ros_layout", wrong)
    assert not any(compared(path))


def test_few_messages_are_not_worth_it(tmp_path):
    path = write_mcap(tmp_path / "a.mcap", wheel_types(2), {"/wheels": ("car/msg/Wheels", wheels(20))})
    assert compared(path) == [False]


def test_some_channels_of_some_topics(tmp_path):
    topics = {"/wheels": ("car/msg/Wheels", wheels(200)), "/more": ("car/msg/Wheels", wheels(90))}
    path = write_mcap(tmp_path / "a.mcap", wheel_types(2), topics, chunk_size=4000)
    with open_log(path, ReadOptions()) as reader:
        infos = {c.path: c for c in reader.channels()}
        gear, omega = reader.read([infos["/more.gear"], infos["/more.omega[0]"]])
    np.testing.assert_array_equal(gear.values, np.arange(90) % 7)
    np.testing.assert_array_equal(omega.values, np.arange(90) * 0.1)


def test_recordings_in_sqlite_and_of_ros_1(tmp_path):
    with Writer2(tmp_path / "two", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection("/wheels", "car/msg/Wheels", typestore=wheel_types(2).store)
        for i, raw in enumerate(wheels(200)):
            writer.write(connection, T0 + i, raw)
    with Writer1(tmp_path / "one.bag") as writer:
        connection = writer.add_connection("/wheels", "car/msg/Wheels", typestore=wheel_types(1).store)
        for i, raw in enumerate(wheels(200, ros=1)):
            writer.write(connection, T0 + i, raw)
    assert compared(tmp_path / "two") == [True]
    assert compared(tmp_path / "one.bag") == [True]
    (base,) = (tmp_path / "two").glob("*.db3")
    with sqlite3.connect(base) as opened:
        opened.execute("UPDATE messages SET data = x'00010000' WHERE id = 77")
        opened.execute("UPDATE messages SET timestamp = -1 WHERE id = 78")
    opened.close()
    assert compared(base, batch=4000).count(False) == 1
    octets = bytearray(base.read_bytes())
    for at in range(5000, len(octets), 3001):
        octets[at] ^= 0xFF
    base.write_bytes(octets)
    compared(base)


def test_the_sample_drive():
    cuts = compared(Path(__file__).resolve().parents[3] / "sample_logs" / "lane_drive.mcap")
    assert cuts
    assert all(cuts)


def record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def message_record(channel: int, data: bytes) -> bytes:
    return record(5, struct.pack("<HIQQ", channel, 0, T0 + channel, 0) + data)


SOUND = message_record(1, b"one") + record(0x81, b"private") + message_record(2, b"") + message_record(1, b"three")


def walked(data):
    """Messages of a chunk, record by record."""
    while data:
        kind, size = struct.unpack_from("<BQ", data)
        if kind == 5:
            channel, _, t, _ = struct.unpack_from("<HIQQ", data, 9)
            yield channel, t, data[9 + 22 : 9 + size]
        data = data[9 + size :]


@pytest.mark.parametrize(
    "data", [b"", SOUND, record(0x80, b""), message_record(9, b""), SOUND + record(5, bytes(10)) + SOUND]
)
def test_a_scanned_chunk_holds_what_a_walk_finds(data):
    assert list(scanned(data).messages.messages()) == list(walked(data))
    assert not scanned(data).fault


@pytest.mark.parametrize(
    "data",
    [
        SOUND + record(5, bytes(10)), SOUND + record(6, b"chunk"), SOUND[:-1],
        SOUND + b"\5\0", SOUND + b"\5" + b"\xff" * 8, SOUND + record(0, b"") + SOUND,
    ],
)  # fmt: skip
def test_what_cannot_stand_in_a_chunk_ends_it(data):
    assert scanned(data).fault
    found = list(scanned(data).messages.messages())
    assert found == list(walked(SOUND))[: len(found)]


def test_schemas_and_channels_of_a_chunk_are_told():
    data = record(3, b"schema") + SOUND + record(4, b"channel")
    assert scanned(data).records == ((3, b"schema"), (4, b"channel"))


@pytest.mark.parametrize("enough", [1, 100, 1 << 19])
def test_batches_keep_the_order_of_messages_in_and_outside_of_chunks(monkeypatch, enough):
    monkeypatch.setattr(batches, "_ENOUGH", enough)
    chunk = scanned(SOUND).messages
    loose = [(7, 5, b"a"), (8, 0, b""), (7, 2**64 - 1, b"bcd")]
    pieces = [*loose, chunk, loose[0], chunk, chunk, *loose]
    expected = [m for piece in pieces for m in (piece.messages() if piece is chunk else [piece])]
    assert [m for batch in batches.batched(pieces) for m in batch.messages()] == expected
