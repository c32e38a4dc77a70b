"""MDF 4.10 files byte by byte, in layouts that asammdf reads but never writes."""

from __future__ import annotations

import itertools
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.mdf_by_hand import Blocks

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


def _data(b: Blocks, name: str, data: bytes, layout: Layout, size: int) -> str:
    edges = [0, *sorted({c for c in layout.cuts if 0 < c < len(data)}), len(data)]
    names = [f"{name}_{k}" for k in range(len(edges) - 1)]
    for k, (block, (begin, end)) in enumerate(zip(names, itertools.pairwise(edges), strict=True)):
        piece, packing = data[begin:end], layout.packing[k % len(layout.packing)]
        if packing is None:
            b.add(block, "DT", [], piece)
        elif packing == "transpose":
            whole = len(piece) // size * size
            turned = np.frombuffer(piece[:whole], np.uint8).reshape(-1, size).T.tobytes() + piece[whole:]
            b.deflated(block, turned, kind=1, width=size)
        else:
            b.deflated(block, piece)
    if len(names) == 1 and not layout.is_listed:
        return names[0]
    # two lists, so that a list has a next one
    half = (len(names) + 1) // 2
    following = None
    for first, end in ((half, len(names)), (0, half)):
        if first < end:
            offsets = struct.pack(f"<{end - first}Q", *edges[first:end])
            head = struct.pack("<B3xI", 0, end - first)
            b.add(f"{name}_list{first}", "DL", [following, *names[first:end]], head + offsets)
            following = f"{name}_list{first}"
    if layout.has_header:
        b.add(f"{name}_hl", "HL", [following], struct.pack("<HB5x", 0, 0))
    return f"{name}_hl" if layout.has_header else following


def written(path: Path, groups: list[Group], layout: Layout, *, is_unsorted: bool = False) -> Path:
    """A file with a data group for each group; unsorted: one for all, their records in turns behind an id."""
    b = Blocks()
    b.header()
    for k, group in enumerate(groups):
        n, size = group.records.shape
        names = [f"g{k}c{j}" for j in range(len(group.channels))]
        for name, following, c in zip(names, [*names[1:], None], group.channels, strict=True):
            b.text(f"{name}_name", f"c{k}_{name.rpartition('c')[2]}")
            b.channel(
                name, following, 8 + c.at, c.bits, text=f"{name}_name", data_type=c.kind, shift=c.shift,
                flags=0 if c.invalid is None else 2, invalid=c.invalid or 0,
            )  # fmt: skip
        b.text(f"g{k}_time", "t")
        b.channel(f"g{k}t", names[0] if names else None, 0, text=f"g{k}_time", kind=2, sync=1)
        following = f"g{k + 1}" if is_unsorted and k + 1 < len(groups) else None
        own = size - group.invalidation
        b.channel_group(f"g{k}", f"g{k}t", n, own, following=following, record_id=k + 1, invalid=group.invalidation)
    if is_unsorted:
        mixed = [(i / len(g.records), k, r) for k, g in enumerate(groups) for i, r in enumerate(g.records)]
        data = b"".join(bytes([k + 1]) + r.tobytes() for _, k, r in sorted(mixed, key=lambda m: m[:2]))
        b.group("dg0", None, "g0", _data(b, "data", data, layout, 1), 1)
    else:
        for k, group in enumerate(groups):
            data = _data(b, f"data{k}", group.records.tobytes(), layout, group.records.shape[1])
            b.group(f"dg{k}", f"dg{k + 1}" if k + 1 < len(groups) else None, f"g{k}", data)
    path.write_bytes(b.bytes())
    return path


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
