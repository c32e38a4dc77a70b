"""One drive in every format: the same events to 10 ms."""

import json

import numpy as np
import polars as pl
import pytest
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet
from google.protobuf.descriptor_pool import DescriptorPool
from google.protobuf.message_factory import GetMessageClass
from make_samples import HERE, START_NS, csv_columns, sample_drive, write_ros2
from rosbags.rosbag1 import Writer as Bag1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Bag2Writer
from rosbags.typesys import Stores, get_typestore

from aqualog.align.load import load_signals
from aqualog.align.mapping import Entry, SignalMap
from aqualog.config.signal_map import load_signal_map
from aqualog.config.vehicle import load_vehicle
from aqualog.core.notation import SYMBOLS, WHEELS
from aqualog.detect.stream import detect_drive
from aqualog.io.write_mcap import McapTopic, write_mcap
from aqualog.io.write_mdf import MdfGroup, write_mf4
from aqualog.io.write_table import TableColumn, write_csv, write_parquet
from tests.can_log import CanMessage, write_can_mf4
from tests.mcap_log import writing

T, S = sample_drive()
CAR = load_vehicle(HERE / "vehicle.toml")
WITH_META = {n: (SYMBOLS[n].unit, SYMBOLS[n].meaning, x) for n, x in S.items()}
TABLE = [TableColumn("t", "s", T), *(TableColumn(n, SYMBOLS[n].unit, x) for n, x in S.items())]
T_NS = np.rint(T * 1e9).astype(np.int64)

DBC = """VERSION ""
NS_ :
BS_:
BU_: ESC
BO_ 256 Wheels: 8 ESC
 SG_ w_fl : 0|16@1+ (0.01,0) [0|655] "rad/s" X
 SG_ w_fr : 16|16@1+ (0.01,0) [0|655] "rad/s" X
 SG_ w_rl : 32|16@1+ (0.01,0) [0|655] "rad/s" X
 SG_ w_rr : 48|16@1+ (0.01,0) [0|655] "rad/s" X
BO_ 257 Motion: 8 ESC
 SG_ ax : 7|16@0- (0.001,0) [-30|30] "m/s^2" X
 SG_ ay : 23|16@0- (0.001,0) [-30|30] "m/s^2" X
 SG_ yaw : 39|16@0- (0.0001,0) [-3|3] "rad/s" X
 SG_ v : 55|16@0+ (0.005,0) [0|300] "km/h" X
BO_ 258 Torque: 8 ESC
 SG_ t_fl : 0|16@1- (0.5,0) [-16000|16000] "Nm" X
 SG_ t_fr : 16|16@1- (0.5,0) [-16000|16000] "Nm" X
 SG_ t_rl : 32|16@1- (0.5,0) [-16000|16000] "Nm" X
 SG_ t_rr : 48|16@1- (0.5,0) [-16000|16000] "Nm" X
BO_ 259 Driver: 4 ESC
 SG_ steer : 0|16@1- (0.0001,0) [-3|3] "rad" X
 SG_ brake : 16|16@1+ (0.01,0) [0|300] "bar" X
"""
CAN_MAP = SignalMap(
    {
        **{f"omega_{w}": Entry(f"omega_{w}", (f"Wheels.w_{w}",)) for w in WHEELS},
        **{f"torque_{w}": Entry(f"torque_{w}", (f"Torque.t_{w}",)) for w in WHEELS},
        "a_x": Entry("a_x", ("Motion.ax",)),
        "a_y": Entry("a_y", ("Motion.ay",)),
        "yaw_rate": Entry("yaw_rate", ("Motion.yaw",)),
        "v_x": Entry("v_x", ("Motion.v",)),
        "steer_angle": Entry("steer_angle", ("Driver.steer",)),
        "brake_pressure": Entry("brake_pressure", ("Driver.brake",)),
    }
)


def raw_can(tmp_path):
    dbc = tmp_path / "car.dbc"
    dbc.write_text(DBC)
    messages = [
        CanMessage("Wheels", T, {f"w_{w}": S[f"omega_{w}"] for w in WHEELS}),
        CanMessage("Motion", T, {"ax": S["a_x"], "ay": S["a_y"], "yaw": S["yaw_rate"], "v": S["v_x"] * 3.6}),
        CanMessage("Torque", T, {f"t_{w}": S[f"torque_{w}"] for w in WHEELS}),
        CanMessage("Driver", T, {"steer": S["steer_angle"], "brake": S["brake_pressure"] * 1e-5}),
    ]
    path = tmp_path / "can.mf4"
    write_can_mf4(path, dbc, messages, START_NS, "")
    return path, CAN_MAP, [dbc]


def mf4(tmp_path, compression):
    path = tmp_path / f"drive{compression}.mf4"
    write_mf4(path, [MdfGroup("signals", T, WITH_META)], START_NS, "", compression=compression)
    return path, None, []


def mcap_json(tmp_path):
    path = tmp_path / "json.mcap"
    write_mcap(path, [McapTopic("/car", T_NS, WITH_META)], START_NS)
    return path, None, []


def mcap_protobuf(tmp_path):
    file = FileDescriptorProto(name="car.proto", package="car", syntax="proto3")
    message = file.message_type.add(name="State")
    for i, name in enumerate(S, 1):
        message.field.add(
            name=name, number=i, type=FieldDescriptorProto.TYPE_DOUBLE, label=FieldDescriptorProto.LABEL_OPTIONAL
        )
    pool = DescriptorPool()
    pool.Add(file)
    kind = GetMessageClass(pool.FindMessageTypeByName("car.State"))
    path = tmp_path / "proto.mcap"
    with writing(path) as writer:
        schema = writer.register_schema("car.State", "protobuf", FileDescriptorSet(file=[file]).SerializeToString())
        channel = writer.register_channel("/state", "protobuf", schema)
        for k, t in enumerate(T_NS):
            data = kind(**{n: float(x[k]) for n, x in S.items()}).SerializeToString()
            writer.add_message(channel, START_NS + int(t), data, START_NS + int(t))
    return path, None, []


def mcap_ros2(tmp_path):
    path = tmp_path / "ros2.mcap"
    write_ros2(path, T, S)
    return path, load_signal_map(HERE / "map_mcap.toml"), []


def bag(tmp_path, kind):
    ros = 1 if kind == "bag1" else 2
    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    float64 = store.types["std_msgs/msg/Float64"]
    path = tmp_path / ("drive.bag" if ros == 1 else f"bag_{kind}")
    plugin = StoragePlugin.MCAP if kind == "bag2 mcap" else StoragePlugin.SQLITE3
    writer = Bag1Writer(path) if ros == 1 else Bag2Writer(path, version=9, storage_plugin=plugin)
    with writer:
        topics = {n: writer.add_connection(f"/{n}", "std_msgs/msg/Float64", typestore=store) for n in S}
        for k, t in enumerate(T_NS):
            for n, x in S.items():
                message = float64(float(x[k]))
                data = (
                    store.serialize_ros1(message, "std_msgs/msg/Float64")
                    if ros == 1
                    else store.serialize_cdr(message, "std_msgs/msg/Float64")
                )
                writer.write(topics[n], START_NS + int(t), bytes(data))
    if kind == "bag2 without metadata":
        (path / "metadata.yaml").unlink()
    return path, None, []


def csv_german(tmp_path):
    path = tmp_path / "german.csv"
    write_csv(path, csv_columns(T, S, CAR.steering_ratio), decimal_comma=True)
    path.write_bytes(path.read_text(encoding="utf-8").encode("cp1252"))
    return path, load_signal_map(HERE / "map_csv.toml"), []


def csv_point(tmp_path):
    path = tmp_path / "point.csv"
    write_csv(path, TABLE)
    return path, None, []


def csv_units_row(tmp_path):
    path = tmp_path / "units_row.txt"
    frame = pl.DataFrame({"t_ms": np.rint(T * 1e3).astype(np.int64), **S})
    header, *rows = frame.write_csv(separator="\t").splitlines()
    units = "\t".join(["ms", *(SYMBOLS[n].unit for n in S)])
    path.write_text("\n".join(["# logger 3.1", header, units, *rows]) + "\n", encoding="utf-16")
    return path, None, []


def parquet(tmp_path):
    path = tmp_path / "drive.parquet"
    write_parquet(path, TABLE, start_ns=START_NS)
    return path, None, []


def split_over_files(tmp_path):
    wheels = [c for c in TABLE if c.name == "t" or c.name.startswith("omega")]
    rest = [c for c in TABLE if not c.name.startswith("omega")]
    write_csv(tmp_path / "wheels.csv", wheels)
    write_csv(tmp_path / "rest.csv", rest, decimal_comma=True)
    return [tmp_path / "wheels.csv", tmp_path / "rest.csv"], None, []


FORMATS = {
    "mf4 plain": lambda p: mf4(p, 0),
    "mf4 deflate": lambda p: mf4(p, 1),
    "mf4 transposed deflate": lambda p: mf4(p, 2),
    "mf4 raw can": raw_can,
    "mcap json": mcap_json,
    "mcap protobuf": mcap_protobuf,
    "mcap ros2": mcap_ros2,
    "ros1 bag": lambda p: bag(p, "bag1"),
    "ros2 bag": lambda p: bag(p, "bag2"),
    "ros2 bag without metadata": lambda p: bag(p, "bag2 without metadata"),
    "ros2 bag mcap": lambda p: bag(p, "bag2 mcap"),
    "csv german": csv_german,
    "csv point": csv_point,
    "csv tabs, units row, ms, utf-16": csv_units_row,
    "parquet": parquet,
    "two csv files": split_over_files,
}


def found_in(source, signal_map, dbc):
    paths = source if isinstance(source, list) else [source]
    signals = load_signals(paths, vehicle=CAR, signal_map=signal_map, dbc=dbc)
    return signals, detect_drive(signals, CAR).events


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    _, events = found_in(*parquet(tmp_path_factory.mktemp("reference")))
    found = {e.detector for e in events}
    joint = {"joint_criteria", "joint_cusum"}
    assert found == {"spin_down", "minor_spin_down", "resistance", "slip_slope_drop", "margin", *joint}
    return events


@pytest.mark.parametrize("name", list(FORMATS))
def test_same_events(name, tmp_path, reference):
    signals, events = found_in(*FORMATS[name](tmp_path))
    assert signals.dt == pytest.approx(0.01)
    assert [(e.detector, e.wheel, e.severity) for e in events] == [(e.detector, e.wheel, e.severity) for e in reference]
    for mine, theirs in zip(events, reference, strict=True):
        assert mine.start_s == pytest.approx(theirs.start_s, abs=0.0101)
        # the German file has the torques of axles, and the end of a slope's drop is read off an estimate, which creeps
        # back over its limit with the traction of the wheel; both joint detectors hold it. The margin has a value ten
        # times a second
        creeps = mine.detector in ("slip_slope_drop", "joint_criteria", "joint_cusum")
        step = 0.1001 if mine.detector == "margin" else 0.0101
        assert mine.end_s == pytest.approx(theirs.end_s, abs=0.15 if creeps else step)


@pytest.mark.parametrize("name", ["lane_drive.mf4", "lane_drive.mcap", "lane_drive.csv"])
def test_shipped_samples_are_one_drive(name):
    """An earlier simulator made it, so that its events are not those of the drive above."""
    _, reference = found_in(HERE / "lane_drive.parquet", None, [])
    assert {e.detector for e in reference} >= {"spin_down", "joint_criteria", "joint_cusum"}
    maps = {"lane_drive.mcap": "map_mcap.toml", "lane_drive.csv": "map_csv.toml"}
    signal_map = load_signal_map(HERE / maps[name]) if name in maps else None
    _, events = found_in(HERE / name, signal_map, [])
    assert [(e.detector, e.wheel) for e in events] == [(e.detector, e.wheel) for e in reference]


def test_samples_are_small():
    assert sum(p.stat().st_size for p in HERE.glob("lane_drive.*")) < 5_000_000


def test_only_mapped_channels_are_decoded(tmp_path, monkeypatch):
    from aqualog.io.mdf.reader import MdfReader

    asked = []
    read = MdfReader.read

    def spy(self, wanted):
        wanted = list(wanted)
        asked.extend(w.name for w in wanted)
        return read(self, wanted)

    monkeypatch.setattr(MdfReader, "read", spy)
    extra = {**WITH_META, "true_contact_fl": ("-", "", S["v_x"]), "other": ("-", "", S["v_x"])}
    path = tmp_path / "x.mf4"
    write_mf4(path, [MdfGroup("signals", T, extra)], None, "")
    load_signals([path], vehicle=CAR)
    assert set(asked) == set(S)


def test_json_of_a_map_is_stable():
    not_on_the_bus = {
        "on_water",
        "water_depth_left",
        "water_depth_right",
        "tie_rod_fl",
        "tie_rod_fr",
        "steering_torque",
    }
    assert json.dumps(sorted(CAN_MAP.entries)) == json.dumps(sorted(set(S) - not_on_the_bus))
