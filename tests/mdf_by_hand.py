"""MDF files block by block, in layouts that loggers write and no library does: descriptions first, unsorted records."""

import struct
import zlib

import numpy as np


class Blocks:
    """MDF 4 blocks, put one behind the other; links are filled in when all addresses are known."""

    def __init__(self, version=b"4.10", unfinished=0):
        mark = b"UnFinMF " if unfinished else b"MDF     "
        self.data = bytearray(mark + version.ljust(8) + b"by hand ".ljust(8) + bytes(4) + struct.pack("<H", 410))
        self.data += bytes(60 - len(self.data)) + struct.pack("<HH", unfinished, 0)
        self.at = {}
        self.places = []

    def add(self, name, kind, links, body=b""):
        """A block; links are names, or None."""
        self.data += bytes(-len(self.data) % 8)
        self.at[name] = len(self.data)
        self.places += [(len(self.data) + 24 + 8 * i, to) for i, to in enumerate(links) if to]
        length = 24 + 8 * len(links) + len(body)
        self.data += b"##" + kind.encode() + bytes(4) + struct.pack("<QQ", length, len(links)) + bytes(8 * len(links))
        self.data += body
        return self.at[name]

    def bytes(self):
        for place, to in self.places:
            struct.pack_into("<Q", self.data, place, self.at[to])
        return bytes(self.data)

    def header(self, first="dg0", comment=None, attachment=None):
        body = struct.pack("<QhhBBBB2d", 1_700_000_000 * 10**9, 0, 0, 0, 0, 0, 0, 0.0, 0.0)
        self.add("hd", "HD", [first, None, None, attachment, None, comment], body)

    def text(self, name, text, kind="TX"):
        raw = text if isinstance(text, bytes) else text.encode()
        self.add(name, kind, [], raw + bytes(8 - len(raw) % 8))

    def group(self, name, following=None, channels=None, data=None, id_size=0):
        self.add(name, "DG", [following, channels, data, None], bytes([id_size]) + bytes(7))

    def channel_group(self, name, channel, cycles, size, *, following=None, record_id=0, flags=0, invalid=0):
        body = struct.pack("<QQHHIII", record_id, cycles, flags, 0, 0, size, invalid)
        self.add(name, "CG", [following, channel, None, None, None, None], body)

    def channel(self, name, following, offset, bits=64, *, text, kind=0, data_type=4, conversion=None, values=None,
                part=None, comment=None, sync=0, flags=0, shift=0, invalid=0):  # fmt: skip
        head = kind, sync, data_type, shift, offset, bits, flags, invalid
        body = struct.pack("<BBBBIIIIBBH6d", *head, 0, 0, 0, *[0.0] * 6)
        self.add(name, "CN", [following, part, text, None, conversion, values, None, comment], body)

    def conversion(self, name, kind, links=(), numbers=(), unit=None):
        body = struct.pack("<BBHHHdd", kind, 0, 0, len(links), len(numbers), 0.0, 0.0)
        self.add(name, "CC", [None, unit, None, None, *links], body + struct.pack(f"<{len(numbers)}d", *numbers))

    def deflated(self, name, raw, *, size=None, kind=0, width=0, of=b"DT"):
        stored = zlib.compress(raw)
        body = of + bytes([kind, 0]) + struct.pack("<IQQ", width, len(raw) if size is None else size, len(stored))
        self.add(name, "DZ", [], body + stored)

    def listed(self, name, blocks, following=None, *, size=0, slots=None):
        links = [following, *blocks, *[None] * ((slots or len(blocks)) - len(blocks))]
        self.add(name, "DL", links, struct.pack("<B3xIQ", 1, len(links) - 1, size))


def records(n, first=0):
    """Time and two channels: float64, float64, uint8 and seven bytes of nothing. [24 bytes]"""
    out = np.zeros(n, dtype=[("t", "<f8"), ("x", "<f8"), ("y", "u1"), ("pad", "V7")])
    k = np.arange(first, first + n)
    out["t"], out["x"], out["y"] = k * 0.01, np.sin(k) + k, k % 251
    return out.tobytes()


def describe(blocks, prefix, cycles, *, cg_following=None, record_id=0, size=24):
    """Channel group `{prefix}cg` with time, x (scaled by 2) and y."""
    for name in ("t", "x", "y"):
        blocks.text(f"{prefix}{name}_name", name)
    blocks.conversion(f"{prefix}cc", 1, numbers=(1.0, 2.0))
    blocks.channel(f"{prefix}t", f"{prefix}x", 0, text=f"{prefix}t_name", kind=2, sync=1)
    blocks.channel(f"{prefix}x", f"{prefix}y", 8, text=f"{prefix}x_name", conversion=f"{prefix}cc")
    blocks.channel(f"{prefix}y", None, 16, 8, text=f"{prefix}y_name", data_type=0)
    blocks.channel_group(f"{prefix}cg", f"{prefix}t", cycles, size, following=cg_following, record_id=record_id)


def streamed(n=200, *, compressed=False, unfinished=0, blocks_of=50):
    """Descriptions first, then records: one plain block, or a list of deflated ones."""
    b = Blocks(unfinished=unfinished)
    b.header()
    describe(b, "a", 0 if unfinished & 1 else n)
    b.group("dg0", None, "acg", "data" if not compressed else "hl")
    if not compressed:
        at = b.add("data", "DT", [], records(n))
        out = bytearray(b.bytes())
        if unfinished & 4:
            struct.pack_into("<Q", out, at + 8, 24)
        return bytes(out)
    names = [f"dz{k}" for k in range(0, n, blocks_of)]
    b.add("hl", "HL", ["dl"], bytes(8))
    b.listed("dl", names, size=24 * blocks_of)
    for k, name in zip(range(0, n, blocks_of), names, strict=True):
        b.deflated(name, records(min(blocks_of, n - k), k))
    return b.bytes()


def unsorted(n=100, *, unfinished=0):
    """Two kinds of records in a row, told apart by an id of one byte."""
    b = Blocks(unfinished=unfinished)
    b.header()
    describe(b, "b", 0 if unfinished & 1 else n // 2, record_id=2)
    describe(b, "a", 0 if unfinished & 1 else n, cg_following="bcg", record_id=1)
    b.group("dg0", None, "acg", "data", 1)
    one, two = records(n), records(n // 2)
    rows = bytearray()
    for k in range(n):
        rows += b"\1" + one[24 * k : 24 * k + 24]
        if k % 2 == 1:
            rows += b"\2" + two[12 * (k - 1) : 12 * (k - 1) + 24]
    at = b.add("data", "DT", [], bytes(rows))
    out = bytearray(b.bytes())
    if unfinished & 4:
        struct.pack_into("<Q", out, at + 8, 24)
    return bytes(out)
