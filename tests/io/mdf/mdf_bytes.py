"""MDF 4.10 files byte by byte, in layouts that asammdf reads but never writes."""

from __future__ import annotations

import itertools
import struct
import zlib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

UNSIGNED, UNSIGNED_BIG, SIGNED, SIGNED_BIG, FLOAT, FLOAT_BIG = range(6)


@dataclass(frozen=True)
class Bits:
    """A channel: `kind` by MDF's data types, first byte behind the time, lowest bit, number of bits, invalidation bit."""

    kind: int
    at: int
    shift: int
    bits: int
    invalid: int | None = None


@dataclass(frozen=True)
class Group:
    """Records (n, size) of bytes: time as float64, channels, anything else, invalidation bytes."""

    channels: tuple[Bits, ...]
    records: np.ndarray
    invalidation: int = 0


@dataclass(frozen=True)
class Layout:
    """How records are stored: `cuts` into blocks [bytes], `packing` of each block in turn (None, "deflate", "transpose")."""

    cuts: tuple[int, ...] = ()
    packing: tuple[str | None, ...] = (None,)
    is_listed: bool = False
    has_header: bool = False


@dataclass
class _File:
    octets: bytearray = field(default_factory=lambda: bytearray(64))

    def block(self, mark: bytes, links: list[int], data: bytes) -> int:
        self.octets += bytes(-len(self.octets) % 8)
        at = len(self.octets)
        self.octets += struct.pack("<4s4xQQ", mark, 24 + 8 * len(links) + len(data), len(links))
        self.octets += struct.pack(f"<{len(links)}Q", *links) + data
        return at

    def text(self, text: str) -> int:
        return self.block(b"##TX", [], text.encode() + bytes(8 - len(text) % 8))


def _data_block(file: _File, data: bytes, packing: str | None, size: int) -> int:
    if packing is None:
        return file.block(b"##DT", [], data)
    turned = data
    if packing == "transpose":
        whole = len(data) // size * size
        turned = np.frombuffer(data[:whole], np.uint8).reshape(-1, size).T.tobytes() + data[whole:]
    packed = zlib.compress(turned)
    head = struct.pack(
        "<2sBxIQQ", b"DT", packing == "transpose", size if packing == "transpose" else 0, len(data), len(packed)
    )
    return file.block(b"##DZ", [], head + packed)


def _data(file: _File, data: bytes, layout: Layout, size: int) -> int:
    edges = [0, *sorted({c for c in layout.cuts if 0 < c < len(data)}), len(data)]
    pieces = [data[a:b] for a, b in itertools.pairwise(edges)]
    blocks = [_data_block(file, p, layout.packing[k % len(layout.packing)], size) for k, p in enumerate(pieces)]
    if len(blocks) == 1 and not layout.is_listed:
        return blocks[0]
    # two lists, so that a list has a next one
    half = (len(blocks) + 1) // 2
    at = 0
    for part, first in ((blocks[half:], half), (blocks[:half], 0)):
        if part:
            offsets = struct.pack(f"<{len(part)}Q", *edges[first : first + len(part)])
            at = file.block(b"##DL", [at, *part], struct.pack("<B3xI", 0, len(part)) + offsets)
    return file.block(b"##HL", [at], struct.pack("<HB5x", 0, 0)) if layout.has_header else at


def written(path: Path, groups: list[Group], layout: Layout, *, is_unsorted: bool = False) -> Path:
    """A file with a data group for each group; unsorted: one for all, their records in turns behind an id."""
    file = _File()
    head = file.block(b"##HD", [0] * 6, bytes(32))
    heads = [_group(file, g, k) for k, g in enumerate(groups)]
    if is_unsorted:
        for a, b in itertools.pairwise(heads):
            struct.pack_into("<Q", file.octets, a + 24, b)
        mixed = [(i / len(g.records), k, r) for k, g in enumerate(groups) for i, r in enumerate(g.records)]
        data = b"".join(bytes([k + 1]) + r.tobytes() for _, k, r in sorted(mixed, key=lambda m: m[:2]))
        first = file.block(b"##DG", [0, heads[0], _data(file, data, layout, 1), 0], struct.pack("<B7x", 1))
    else:
        first = 0
        for group, at in reversed(list(zip(groups, heads, strict=True))):
            data = _data(file, group.records.tobytes(), layout, group.records.shape[1])
            first = file.block(b"##DG", [first, at, data, 0], bytes(8))
    struct.pack_into("<Q", file.octets, head + 24, first)
    struct.pack_into("<8s8s8s4xH", file.octets, 0, b"MDF     ", b"4.10    ", b"bytes   ", 410)
    path.write_bytes(file.octets)
    return path


def _group(file: _File, group: Group, number: int) -> int:
    channel = 0
    for k, c in reversed(list(enumerate(group.channels))):
        facts = struct.pack("<BBBBIII", 0, 0, c.kind, c.shift, 8 + c.at, c.bits, 0 if c.invalid is None else 2)
        name = file.text(f"c{number}_{k}")
        channel = file.block(
            b"##CN", [channel, 0, name, *[0] * 5], facts + struct.pack("<IBBH", c.invalid or 0, 0, 0, 0) + bytes(48)
        )
    facts = struct.pack("<BBBBIII", 2, 1, FLOAT, 0, 0, 64, 0) + bytes(56)
    channel = file.block(b"##CN", [channel, 0, file.text("t"), *[0] * 5], facts)
    n, size = group.records.shape
    return file.block(
        b"##CG", [0, channel, 0, 0, 0, 0],
        struct.pack("<QQHHIII", number + 1, n, 0, 0, 0, size - group.invalidation, group.invalidation),
    )  # fmt: skip


def expected(group: Group, k: int) -> np.ndarray:
    """Samples of a channel by the standard's words, a record at a time; NaN where invalid."""
    c = group.channels[k]
    own = group.records.shape[1] - group.invalidation
    return np.array([_sample(c, r.tobytes(), own) for r in group.records], dtype=np.float64)


def _sample(c: Bits, record: bytes, own: int) -> float:
    if c.invalid is not None and record[own + c.invalid // 8] >> c.invalid % 8 & 1:
        return float("nan")
    octets = record[8 + c.at : 8 + c.at + (c.shift + c.bits + 7) // 8]
    order = "big" if c.kind in (UNSIGNED_BIG, SIGNED_BIG, FLOAT_BIG) else "little"
    number = int.from_bytes(octets, order) >> c.shift & (1 << c.bits) - 1
    if c.kind in (FLOAT, FLOAT_BIG):
        return struct.unpack({32: "<f", 64: "<d"}[c.bits], number.to_bytes(c.bits // 8, "little"))[0]
    if c.kind in (SIGNED, SIGNED_BIG) and number >> c.bits - 1:
        number -= 1 << c.bits
    return float(number)
