"""ROS 2 messages in MCAP, all columns, beside rosbags' reader."""

from __future__ import annotations

from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from tests.bench.compare import Row
from tests.bench.scale import Scale

T0 = 1_700_000_000 * 10**9
TOPICS = {  # type, rate [Hz]
    "/imu": ("sensor_msgs/msg/Imu", 100),
    "/wheels": ("sensor_msgs/msg/JointState", 100),
    "/velocity": ("geometry_msgs/msg/TwistStamped", 20),
    "/brake": ("sensor_msgs/msg/FluidPressure", 50),
    "/steering": ("std_msgs/msg/Float64", 80),
}
XYZ, XYZW = ("x", "y", "z"), ("x", "y", "z", "w")
SCALARS = {
    "/imu": [f"orientation.{a}" for a in XYZW]
    + [f"{v}.{a}" for v in ("angular_velocity", "linear_acceleration") for a in XYZ],
    "/wheels": [],
    "/velocity": [f"twist.{v}.{a}" for v in ("linear", "angular") for a in XYZ],
    "/brake": ["fluid_pressure", "variance"],
    "/steering": ["data"],
}
ARRAYS = {
    "/imu": ["orientation_covariance", "angular_velocity_covariance", "linear_acceleration_covariance"],
    "/wheels": ["position", "velocity", "effort"],
}
JOINTS = ["front_left", "front_right", "rear_left", "rear_right"]

Columns = dict[str, tuple[np.ndarray, np.ndarray]]
"""Path of a column -> stamps [ns], values (n,)."""


def made_bag(folder: Path, seconds: float) -> Path:
    """A bag in MCAP, chunks deflated by zstd as recorders do; its folder."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    rng = np.random.default_rng(0)
    due = sorted(
        (round(k * 1e9 / rate), topic) for topic, (_, rate) in TOPICS.items() for k in range(round(seconds * rate))
    )
    path = folder / "bag"
    writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        links = {t: writer.add_connection(t, kind, typestore=store) for t, (kind, _) in TOPICS.items()}
        for t, topic in due:
            data = store.serialize_cdr(_message(store.types, topic, T0 + t, rng), TOPICS[topic][0])
            writer.write(links[topic], T0 + t + 5_000_000, bytes(data))
    return path


def _message(types: Any, topic: str, t_ns: int, rng: np.random.Generator) -> Any:
    stamp = types["builtin_interfaces/msg/Time"](*divmod(t_ns, 10**9))
    header = types["std_msgs/msg/Header"](stamp, "car")
    x = rng.standard_normal(14).tolist()
    vector, nine = types["geometry_msgs/msg/Vector3"], np.full(9, x[0])
    if topic == "/imu":
        turn = types["geometry_msgs/msg/Quaternion"](*x[:4])
        return types["sensor_msgs/msg/Imu"](header, turn, nine, vector(*x[4:7]), nine, vector(*x[7:10]), nine)
    if topic == "/wheels":
        return types["sensor_msgs/msg/JointState"](
            header, JOINTS, np.array(x[:4]), np.array(x[4:8]), np.array(x[8:12])
        )  # fmt: skip
    if topic == "/velocity":
        twist = types["geometry_msgs/msg/Twist"](vector(*x[:3]), vector(*x[3:6]))
        return types["geometry_msgs/msg/TwistStamped"](header, twist)
    if topic == "/brake":
        return types["sensor_msgs/msg/FluidPressure"](header, x[0], x[1])
    return types["std_msgs/msg/Float64"](x[0])


def with_aqualog(path: Path) -> Columns:
    """Every column that the reader lists."""
    from aqualog.io.open_log import open_log

    with open_log(path) as reader:
        return {c.info.path: (c.t_ns, c.values) for c in reader.read(reader.channels())}


def with_rosbags(path: Path) -> Columns:
    """The same by rosbags: message by message, the fields of each topic named beforehand."""
    from rosbags.highlevel import AnyReader

    taken: dict[str, tuple[list[int], list[Any], list[list[np.ndarray]]]] = {
        t: ([], [], [[] for _ in ARRAYS.get(t, [])]) for t in TOPICS
    }
    scalars = {t: attrgetter(*names) for t, names in SCALARS.items() if names}
    arrays = {t: attrgetter(*names) for t, names in ARRAYS.items()}
    with AnyReader([path]) as reader:
        for link, t_ns, raw in reader.messages():
            topic = link.topic
            message = reader.deserialize(raw, link.msgtype)
            times, rows, parts = taken[topic]
            if topic == "/steering":
                times.append(t_ns)
            else:
                stamp = message.header.stamp
                times.append(stamp.sec * 1_000_000_000 + stamp.nanosec)
            if topic in scalars:
                rows.append(scalars[topic](message))
            if topic in arrays:
                for part, x in zip(parts, arrays[topic](message), strict=True):
                    part.append(x)
    out: Columns = {}
    for topic, (times, rows, parts) in taken.items():
        t = np.array(times, dtype=np.int64)
        table = np.array(rows, dtype=np.float64).reshape(t.size, -1)
        out |= {f"{topic}.{n}": (t, table[:, i]) for i, n in enumerate(SCALARS[topic])}
        for name, part in zip(ARRAYS.get(topic, []), parts, strict=True):
            whole = np.stack(part)
            out |= {f"{topic}.{name}[{k}]": (t, whole[:, k]) for k in range(whole.shape[1])}
    return out


def unlike(a: Columns, b: Columns) -> str:
    """Empty if both have the same columns, equal to the last bit."""
    if set(a) != set(b):
        return f"columns {sorted(set(a) ^ set(b))[:5]} are on one side only"
    off = [n for n in a if not all(np.array_equal(x, y, equal_nan=True) for x, y in zip(a[n], b[n], strict=True))]
    return f"columns {off[:5]} differ" if off else ""


def rows(folder: Path, scale: Scale) -> list[Row]:
    """Five topics, 350 messages a second."""
    bag = made_bag(folder, scale.messages_s)
    (file,) = bag.glob("*.mcap")
    messages = sum(round(rate * scale.messages_s) for _, rate in TOPICS.values())
    return [Row(
        "MCAP, ROS 2 messages, all columns", "rosbags, message by message", 12.0, lambda: with_aqualog(file),
        lambda: with_rosbags(bag), unlike, rounds=3,
        conditions=f"{messages} messages of 5 types, {file.stat().st_size / 1e6:.0f} MB, warm",
    )]  # fmt: skip
