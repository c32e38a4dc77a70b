"""MCAP: every sample that is told from a file with checksums is one that was recorded."""

import json
import struct
from functools import cache
from io import BytesIO

from mcap.writer import CompressionType, Writer

from tests.fuzz.damaged_files import T0_NS, check_samples, read

__all__ = ["one", "seeds"]

_SCHEMA = {"type": "object", "properties": {"v": {"type": "number", "unit": "km/h"}}}
_STATE = b"float64 v\nfloat64[3] more\n"


@cache
def seeds() -> tuple[bytes, ...]:
    """Small sound files: each compression, with and without a summary, JSON and ROS 2 messages."""
    return tuple(
        _written(compression, indexed=indexed, ros=ros)
        for compression, indexed, ros in (
            (CompressionType.ZSTD, True, False), (CompressionType.LZ4, False, True), (CompressionType.NONE, True, True),
            (CompressionType.NONE, False, False),
        )
    )  # fmt: skip


def _written(compression: CompressionType, *, indexed: bool, ros: bool) -> bytes:
    file = BytesIO()
    writer = Writer(file, chunk_size=600, compression=compression, use_statistics=indexed, use_chunking=True)
    writer.start()
    text = _STATE if ros else json.dumps(_SCHEMA).encode()
    schema = writer.register_schema("car/msg/State" if ros else "Car", "ros2msg" if ros else "jsonschema", text)
    topic = writer.register_channel("/car", "cdr" if ros else "json", schema)
    for i in range(80):
        body = b"\0\1\0\0" + struct.pack("<dddd", i, i, i, i) if ros else json.dumps({"v": i, "note": "dry"}).encode()
        t = T0_NS + i * 10**7
        writer.add_message(topic, t, body, t)
    writer.finish()
    return file.getvalue()


def one(data: bytes) -> None:
    """Read a file with this content."""
    check_samples(read(data, "a.mcap"), lambda v: T0_NS + v * 10**7)
