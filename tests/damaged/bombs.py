"""Small files that tell of, or unpack to, more than any machine holds; two of each format."""

from __future__ import annotations

import bz2
import sqlite3
import struct
import tempfile
import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path

import lz4.frame
import zstandard

from aqualog.io.tables.parquet_pages import decode, read_index

BIG, HUGE = 1 << 26, 1 << 40
_CHUNK, _MCAP_HEAD = 6, struct.Struct("<BQ")


def bombs_of(name: str) -> tuple[Callable[[bytes], bytes], Callable[[bytes], bytes]]:
    """For the name of a format: what content makes it that unpacks to more than it says, and what it says is huge."""
    for start, made in _MAKERS:
        if name.startswith(start):
            packing = name.partition(", ")[2] or "plain"
            return partial(made, packing, False), partial(made, packing, True)
    raise KeyError(name)


def _packed(packing: str, size: int) -> bytes:
    if packing == "zstd":
        return zstandard.compress(bytes(size))
    if packing == "lz4":
        return lz4.frame.compress(bytes(size))
    return bz2.compress(bytes(size)) if packing == "bz2" else bytes(1000)


def _mf4(_: str, lies: bool, data: bytes) -> bytes:
    """A deflated block that is 64 MB, or says that it is 1 TB; without one a number of records."""
    at = data.find(b"##DZ")
    if at < 0:
        cycles = data.index(b"##CG") + 24 + 6 * 8 + 8
        return data[:cycles] + struct.pack("<Q", HUGE if lies else 1 << 33) + data[cycles + 8 :]
    body = zlib.compress(bytes(BIG), 9)
    head = data[at + 24 : at + 32] + (struct.pack("<Q", HUGE) if lies else data[at + 32 : at + 40])
    head += struct.pack("<Q", len(body))
    pad = bytes(-len(data) % 8)
    block = b"##DZ" + bytes(4) + struct.pack("<QQ", 24 + len(head) + len(body), 0) + head + body
    moved = data.replace(struct.pack("<Q", at), struct.pack("<Q", len(data) + len(pad)))
    return moved + pad + block


def _mdf3(_: str, lies: bool, data: bytes) -> bytes:
    group = struct.unpack_from("<I", data, struct.unpack_from("<I", data, 64 + 4)[0] + 8)[0]
    return data[: group + 22] + struct.pack("<I", 2**32 - 1 if lies else 2**28) + data[group + 26 :]


def _mcap(packing: str, lies: bool, data: bytes) -> bytes:
    """A chunk in front of the others."""
    at = 8
    while data[at] != _CHUNK:
        at += _MCAP_HEAD.size + _MCAP_HEAD.unpack_from(data, at)[1]
    if packing not in ("zstd", "lz4"):
        name, content = b"", bytes(1000)
    else:
        name, content = packing.encode(), _packed(packing, BIG)
    body = struct.pack("<QQQII", 0, 0, HUGE if lies else 10, 0, len(name)) + name + struct.pack("<Q", len(content))
    return data[:at] + _MCAP_HEAD.pack(_CHUNK, len(body + content)) + body + content + data[at:]


def _bag(packing: str, lies: bool, data: bytes) -> bytes:
    head = {
        b"op": b"\x05",
        b"compression": b"none" if packing == "plain" else packing.encode(),
        b"size": struct.pack("<I", 2**32 - 1 if lies else 10),
    }
    fields = b"".join(struct.pack("<I", len(k) + 1 + len(v)) + k + b"=" + v for k, v in head.items())
    content = _packed(packing, BIG)
    record = struct.pack("<I", len(fields)) + fields + struct.pack("<I", len(content)) + content
    at = 13 + 4096  # behind the bag's head, which has that size
    return data[:at] + record + data[at:]


def _database(_: str, lies: bool, data: bytes) -> bytes:
    """Messages without end from a view; or one of many MB of zeros."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.db3"
        path.write_bytes(data)
        connection = sqlite3.connect(path)
        with connection:
            if lies:
                connection.execute("ALTER TABLE messages RENAME TO m")
                connection.execute(
                    "CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n) "
                    "SELECT n.id AS id, m.topic_id AS topic_id, m.timestamp AS timestamp, m.data AS data FROM n, m"
                )
            else:
                connection.execute("UPDATE messages SET data = zeroblob(50000000) WHERE id = 1000")
        connection.close()
        return path.read_bytes()


def _csv(_: str, lies: bool, data: bytes) -> bytes:
    """A line without an end, or a header of half a million names."""
    encoding = "utf-16-le" if data[:2] == b"\xff\xfe" else "utf-8"
    if lies:
        return data + ("1" * (1 << 25)).encode(encoding)
    sign = "," if encoding == "utf-8" else ";"
    head, _end, rest = data.partition("\n".encode(encoding))
    return head + (sign + sign.join(f"x{k}" for k in range(500_000)) + "\n").encode(encoding) + rest


def _parquet(packing: str, lies: bool, data: bytes) -> bytes:
    """A page whose header tells of 2 GB, and which is so large where it is packed; or as many rows in the index."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.parquet"
        path.write_bytes(data)
        index = read_index(path)
    assert index is not None
    if lies:
        footer, old = data[index.end : -8], b"\x16" + _varint(2 * 400) + b"\x19"
        assert footer.count(old) == 1
        new = footer.replace(old, b"\x16" + _varint(2 * HUGE) + b"\x19")
        return data[: index.end] + new + struct.pack("<I", len(new)) + b"PAR1"
    chunk = index.groups[-1].chunks["yaw_rate [rad/s]"]
    header, body = decode(data, chunk.at)
    content = _packed(packing, BIG) if packing != "plain" else data[body : body + header[3]]
    old = b"\x15\x00\x15" + _varint(2 * header[2]) + b"\x15" + _varint(2 * header[3])
    new = b"\x15\x00\x15" + _varint(2 * (2**31 - 1)) + b"\x15" + _varint(2 * len(content))
    assert data[chunk.at :].startswith(old)
    # the last of all: nothing behind it moves but the index, whose place is told from the file's end
    page = data[chunk.at : body].replace(old, new) + content
    size = _varint(2 * chunk.size)
    footer = data[index.end : -8]
    at = footer.rindex(b"\x16" + size)
    footer = footer[: at + 1] + _varint(2 * len(page)) + footer[at + 1 + len(size) :]
    return data[: chunk.at] + page + footer + struct.pack("<I", len(footer)) + b"PAR1"


def _varint(number: int) -> bytes:
    out = bytearray()
    while number > 127:
        out.append(number & 127 | 128)
        number >>= 7
    return bytes([*out, number])


_MAKERS: tuple[tuple[str, Callable[[str, bool, bytes], bytes]], ...] = (
    ("MF4", _mf4), ("MDF 3", _mdf3), ("MCAP", _mcap), ("ROS 1 bag", _bag), ("ROS 2 database", _database), ("CSV", _csv),
    ("Parquet", _parquet),
)  # fmt: skip
