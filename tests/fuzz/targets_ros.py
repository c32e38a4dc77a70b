"""ROS 1 bags and ROS 2 sqlite files. Chunks packed by bz2 have checksums; of the others only the form can be checked."""

import sqlite3
import struct
import tempfile
from functools import cache
from pathlib import Path

from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from tests.fuzz.damaged_files import T0_NS, check_samples, read

__all__ = ["one", "seeds", "seeds_with_checksums", "with_checksums"]


@cache
def seeds() -> tuple[bytes, ...]:
    """Small sound files without checksums."""
    with tempfile.TemporaryDirectory() as folder:
        return _bag(Path(folder, "a.bag"), None), _db3(Path(folder, "a.db3"))


@cache
def seeds_with_checksums() -> tuple[bytes, ...]:
    """A small bag in chunks of bz2."""
    with tempfile.TemporaryDirectory() as folder:
        return (_bag(Path(folder, "a.bag"), Writer.CompressionFormat.BZ2),)


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


def _db3(path: Path) -> bytes:
    with sqlite3.connect(path) as base:
        base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)")
        base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
        base.execute("INSERT INTO topics VALUES (1, '/v', 'std_msgs/msg/Float64', 'cdr')")
        rows = ((T0_NS + i * 10**7, b"\0\1\0\0" + struct.pack("<d", i)) for i in range(300))
        base.executemany("INSERT INTO messages VALUES (NULL, 1, ?, ?)", rows)
    base.close()
    return path.read_bytes()


def one(data: bytes) -> None:
    """Read a file with this content."""
    read(data, "a.bag")


def with_checksums(data: bytes) -> None:
    """Read a bag whose chunks have checksums."""
    # the record of the connection, which names the type, has none: it is the same at the end of the bag
    check_samples([c for c in read(data, "a.bag") if c.info.path == "/v.data"], lambda v: T0_NS + v * 10**7)
