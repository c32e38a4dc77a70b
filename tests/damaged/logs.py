"""Small sound logs, one for each way in which a format is written; all hold the same signals."""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import polars as pl

from aqualog.core.notation import SYMBOLS
from tests.mdf_by_hand import Blocks

T = np.arange(400) * 0.01  # [s]
T_NS = np.rint(T * 1e9).astype(np.int64)
START_NS = 1_750_000_000 * 10**9
SPEED = 25.0 + 2.0 * T
SIGNALS = {
    **{f"omega_{w}": SPEED / 0.31 * (1.0 + 1e-4 * k) for k, w in enumerate(("fl", "fr", "rl", "rr"))},
    "v_x": SPEED,
    "a_x": 2.0 + 0.1 * np.sin(T),
    "yaw_rate": 0.02 * np.cos(T),
}
WITH_META = {n: (SYMBOLS[n].unit, SYMBOLS[n].meaning, x) for n, x in SIGNALS.items()}


def mf4(folder: Path, compression: int) -> Path:
    from aqualog.io.write_mdf import MdfGroup, write_mf4

    path = folder / f"mf4_{compression}.mf4"
    write_mf4(path, [MdfGroup("signals", T, WITH_META)], START_NS, "", compression=compression, written_ns=START_NS)
    return path


def mf4_unfinished(folder: Path) -> Path:
    """As a logger leaves it that has lost its power: two kinds of records in turns, none of them counted."""
    b = Blocks(unfinished=1 | 4)
    b.header()
    groups = {1: ("omega_fl", "omega_fr", "omega_rl", "omega_rr"), 2: ("v_x", "a_x", "yaw_rate")}
    for number, names in reversed(groups.items()):
        for k, name in enumerate(("t", *names)):
            following = f"{number}{names[k]}" if k < len(names) else None
            b.text(f"{number}{name}_name", name)
            if name != "t":
                b.text(f"{name}_unit", SYMBOLS[name].unit)
                b.conversion(f"{name}_cc", 1, numbers=(0.0, 1.0), unit=f"{name}_unit")
            about = {"kind": 2, "sync": 1} if name == "t" else {"conversion": f"{name}_cc"}
            b.channel(f"{number}{name}", following, 8 * k, text=f"{number}{name}_name", **about)
        behind = "cg2" if number == 1 else None
        b.channel_group(f"cg{number}", f"{number}t", 0, 8 + 8 * len(names), record_id=number, following=behind)
    b.group("dg0", None, "cg1", "data", 1)
    rows = {number: np.column_stack([T, *(SIGNALS[n] for n in names)]) for number, names in groups.items()}
    b.add("data", "DT", [], b"".join(bytes([i]) + rows[i][k].tobytes() for k in range(len(T)) for i in groups))
    data = bytearray(b.bytes())
    data[b.at["data"] + 8 : b.at["data"] + 16] = (24).to_bytes(8, "little")
    path = folder / "unfinished.mf4"
    path.write_bytes(data)
    return path


def mdf3(folder: Path) -> Path:
    import asammdf

    path = folder / "old.mdf"
    out = asammdf.MDF(version="3.30")
    out.header.start_time = datetime.fromtimestamp(START_NS // 10**9, UTC)
    out.append([asammdf.Signal(x, T, name=n, unit=SYMBOLS[n].unit) for n, x in SIGNALS.items()], common_timebase=True)
    out.save(path)
    out.close()
    # the library writes the time of day into a comment: the same log every time instead
    path.write_bytes(
        re.sub(rb"\w{3} \w{3} [ \d]\d [\d:]{8} \d{4}(?=: updated)", b"Sun Jun 15 15:06:40 2025", path.read_bytes())
    )
    return path


def mcap_json(folder: Path, compression: str) -> Path:
    from mcap.writer import CompressionType, Writer

    path = folder / f"json_{compression}.mcap"
    with path.open("wb") as handle:
        out = Writer(handle, chunk_size=4000, compression=CompressionType[compression])
        out.start(profile="", library="test")
        schema = out.register_schema("car", "jsonschema", b'{"type": "object"}')
        channel = out.register_channel("/car", "json", schema)
        for k, t in enumerate(T_NS):
            cells = ", ".join(
                f'"{n}": {x[k]!r}'.replace("np.float64(", "").replace(")", "") for n, x in SIGNALS.items()
            )
            out.add_message(channel, START_NS + int(t), f"{{{cells}}}".encode(), START_NS + int(t))
        out.finish()
    return path


def _ros(ros: int):  # type: ignore[no-untyped-def]
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    serialize = store.serialize_ros1 if ros == 1 else store.serialize_cdr
    kind = "std_msgs/msg/Float64"
    return store, kind, lambda x: bytes(serialize(store.types[kind](float(x)), kind))


def _filled(writer, ros: int) -> None:  # type: ignore[no-untyped-def]
    store, kind, data = _ros(ros)
    topics = {n: writer.add_connection(f"/{n}", kind, typestore=store) for n in SIGNALS}
    for k, t in enumerate(T_NS):
        for n, x in SIGNALS.items():
            writer.write(topics[n], START_NS + int(t), data(x[k]))


def mcap_ros2(folder: Path) -> Path:
    from rosbags.rosbag2 import StoragePlugin, Writer

    with Writer(folder / "ros2_mcap", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        _filled(writer, 2)
    return next((folder / "ros2_mcap").glob("*.mcap"))


def bag1(folder: Path, compression: str) -> Path:
    from rosbags.rosbag1 import Writer

    path = folder / f"ros1_{compression or 'plain'}.bag"
    writer = Writer(path)
    writer.chunk_threshold = 4000
    if compression:
        writer.set_compression(Writer.CompressionFormat[compression])
    with writer:
        _filled(writer, 1)
    return path


def db3(folder: Path) -> Path:
    from rosbags.rosbag2 import StoragePlugin, Writer

    with Writer(folder / "ros2_db3", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        _filled(writer, 2)
    path = next((folder / "ros2_db3").glob("*.db3"))
    with sqlite3.connect(path) as connection:
        connection.execute("VACUUM")
    connection.close()
    return path


def csv(folder: Path) -> Path:
    from aqualog.io.write_table import write_csv

    path = folder / "point.csv"
    write_csv(path, _columns())
    return path


def csv_german(folder: Path) -> Path:
    from aqualog.io.write_table import write_csv

    path = folder / "german.csv"
    write_csv(path, _columns(), decimal_comma=True)
    path.write_bytes(path.read_text(encoding="utf-8").encode("utf-16"))
    return path


def parquet(folder: Path, compression: str) -> Path:
    path = folder / f"{compression}.parquet"
    names = {"t [s]": T, **{f"{n} [{SYMBOLS[n].unit}]": x for n, x in SIGNALS.items()}}
    pl.DataFrame(names).write_parquet(path, compression=compression, row_group_size=100)  # type: ignore[arg-type]
    return path


def _columns():  # type: ignore[no-untyped-def]
    from aqualog.io.write_table import TableColumn

    return [TableColumn("t", "s", T), *(TableColumn(n, SYMBOLS[n].unit, x) for n, x in SIGNALS.items())]


FORMATS: dict[str, Callable[[Path], Path]] = {
    "MF4": lambda p: mf4(p, 0),
    "MF4 deflated": lambda p: mf4(p, 1),
    "MF4 transposed": lambda p: mf4(p, 2),
    "MF4 unfinished": mf4_unfinished,
    "MDF 3": mdf3,
    "MCAP JSON": lambda p: mcap_json(p, "NONE"),
    "MCAP JSON, zstd": lambda p: mcap_json(p, "ZSTD"),
    "MCAP JSON, lz4": lambda p: mcap_json(p, "LZ4"),
    "MCAP ROS 2": mcap_ros2,
    "ROS 1 bag": lambda p: bag1(p, ""),
    "ROS 1 bag, bz2": lambda p: bag1(p, "BZ2"),
    "ROS 1 bag, lz4": lambda p: bag1(p, "LZ4"),
    "ROS 2 database": db3,
    "CSV": csv,
    "CSV, UTF-16, comma": csv_german,
    "Parquet, zstd": lambda p: parquet(p, "zstd"),
    "Parquet, plain": lambda p: parquet(p, "uncompressed"),
}


def folder_of(name: str) -> str:
    """A format's name as that of a folder."""
    return name.replace(" ", "_").replace(",", "")
