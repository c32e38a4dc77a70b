"""MCAP: every sample that is told from a file with checksums is one that was recorded."""

import json
import struct
from functools import cache
from io import BytesIO

from mcap.writer import CompressionType, Writer

from tests.fuzz.readers import T0_NS, check_samples, outcome
from tests.fuzz.registry import Target, add

_SCHEMA = {"type": "object", "properties": {"v": {"type": "number", "unit": "km/h"}}}
_STATE = b"float64 v\nfloat64[3] more\n"


@cache
def seeds() -> dict[str, bytes]:
    """Small sound files: each compression, with and without a summary, JSON and ROS 2 messages."""
    return {
        "zstd": _written(CompressionType.ZSTD, indexed=True, ros=False),
        "lz4": _written(CompressionType.LZ4, indexed=False, ros=True),
        "plain_ros": _written(CompressionType.NONE, indexed=True, ros=True),
        "plain_json": _written(CompressionType.NONE, indexed=False, ros=False),
    }


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
    """Read a file with this content; it may be a file whose writer made no checksums."""
    outcome(data, "a.mcap")


def known(seed: str, damages: tuple, data: bytes) -> None:
    """Read a file of `seeds`, all of which have checksums, with these damages."""
    check_samples(outcome(data, "a.mcap").channels, lambda v: T0_NS + v * 10**7)


add("mcap", Target("MCAP, JSON and ROS 2 messages", seeds, one, known))
