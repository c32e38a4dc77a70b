"""ROS 1 bags and ROS 2 sqlite files. Chunks packed by bz2 have checksums; of the others only the form can be checked."""

import sqlite3
import struct
import tempfile
from functools import cache
from pathlib import Path

from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from tests.fuzz.readers import T0_NS, check_samples, outcome
from tests.fuzz.registry import Target, add

_WRITERS = {"plain": None, "bz2": Writer.CompressionFormat.BZ2, "lz4": Writer.CompressionFormat.LZ4}


@cache
def bags() -> dict[str, bytes]:
    """Small bags."""
    with tempfile.TemporaryDirectory() as folder:
        return {name: _bag(Path(folder, f"{name}.bag"), kind) for name, kind in _WRITERS.items()}


@cache
def bases() -> dict[str, bytes]:
    """Small sqlite files, with an index and without."""
    with tempfile.TemporaryDirectory() as folder:
        return {n: _db3(Path(folder, f"{n}.db3"), indexed=n == "indexed") for n in ("plain", "indexed")}


def _bag(path: Path, compression: Writer.CompressionFormat | None) -> bytes:
    store = get_typestore(Stores.ROS1_NOETIC)
    writer = Writer(path)
    if compression is not None:
        writer.set_compression(compression)
    writer.chunk_threshold = 800
    with writer:
        topic = writer.add_connection("/v", "std_msgs/msg/Float64", typestore=store)
        for i in range(80):
            writer.write(topic, T0_NS + i * 10**7, struct.pack("<d", i))
    return path.read_bytes()


def _db3(path: Path, *, indexed: bool) -> bytes:
    with sqlite3.connect(path) as base:
        base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)")
        base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
        if indexed:
            base.execute("CREATE INDEX timestamp_idx ON messages (timestamp ASC)")
        base.execute("INSERT INTO topics VALUES (1, '/v', 'std_msgs/msg/Float64', 'cdr')")
        rows = ((T0_NS + i * 10**7, b"\0\1\0\0" + struct.pack("<d", i)) for i in range(300))
        base.executemany("INSERT INTO messages VALUES (NULL, 1, ?, ?)", rows)
    base.close()
    return path.read_bytes()


def bag(data: bytes) -> None:
    """Read a bag with this content."""
    outcome(data, "a.bag")


def known_bag(seed: str, damages: tuple, data: bytes) -> None:
    """Read a bag of `bags` with these damages."""
    found = outcome(data, "a.bag")
    if seed == "bz2":
        # the record of the connection, which names the type, has no checksum: it is the same at the end of the bag
        told = [c for c in found.channels if c.info.path == "/v.data"]
        check_samples(told, lambda v: T0_NS + v * 10**7)


def base(data: bytes) -> None:
    """Read a sqlite file with this content."""
    outcome(data, "a.db3")


add("bag", Target("ROS 1 bags", bags, bag, known_bag))
add("db3", Target("ROS 2 sqlite files", bases, base))
