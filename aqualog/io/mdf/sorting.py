"""Sort records of several kinds in a row into a file of our own, where each kind is read like any other."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from aqualog.io.mdf.columns import unpacked_blocks
from aqualog.io.mdf.records import Group, Stored
from aqualog.io.messages.batches import rows_of

__all__ = ["Kind", "sorted_groups"]


class Kind(NamedTuple):
    """What was sorted of a group: where it is now, how many records or values, and their bytes without ids."""

    stored: tuple[Stored, ...]
    records: int
    size: int


def sorted_groups(path: Path, groups: Sequence[Group], into: BinaryIO) -> list[tuple[Group, Kind]]:
    """Sort the records of the groups of one data group; what follows a record of no known kind is left out.

    Parameters
    ----------
    path : Path
        The log.
    groups : sequence of Group
        All groups of the data group.
    into : binary file
        To whose end the records are written.

    Raises
    ------
    OSError, zlib.error, ...
        If a block cannot be read or unpacked.
    """
    sizes = {g.record_id: -1 if g.is_variable else g.record + g.behind for g in groups}
    taken = {g.record_id: g.record for g in groups}
    id_size = groups[0].id_size
    stored: dict[int, list[Stored]] = defaultdict(list)
    counts: dict[int, int] = defaultdict(int)
    rest = b""
    for block in unpacked_blocks(path, groups[0].data):
        data = rest + bytes(block) if rest else bytes(block)
        starts, end, is_known = _starts(data, sizes, id_size)
        for kind, at in starts.items():
            counts[kind] += len(at)
            if sizes[kind] < 0:
                rows = b"".join(data[a : a + 4 + int.from_bytes(data[a : a + 4], "little")] for a in at)
            else:
                rows = rows_of(data, np.array(at), taken[kind]).tobytes() if taken[kind] else b""
            stored[kind].append(Stored(into.tell(), len(rows), len(rows)))
            into.write(rows)
        if not is_known:
            break
        rest = data[end:]
    into.flush()
    kinds = {k: Kind(tuple(stored[k]), counts[k], sum(s.size for s in stored[k])) for k in sizes}
    return [(replace(g, data=kinds[g.record_id].stored), kinds[g.record_id]) for g in groups]


def _starts(data: bytes, sizes: dict[int, int], id_size: int) -> tuple[dict[int, list[int]], int, bool]:
    """Where the contents of the whole records begin, by kind; where the last one ends; whether all kinds are known."""
    found: dict[int, list[int]] = {kind: [] for kind in sizes}
    known = {kind: (length, found[kind].append) for kind, length in sizes.items()}
    at, end, last, is_known = 0, 0, len(data) - id_size, True
    while at <= last:
        kind = data[at] if id_size == 1 else int.from_bytes(data[at : at + id_size], "little")
        if kind not in known:
            is_known = False
            break
        length, add = known[kind]
        at += id_size
        if length < 0:
            length = 4 + int.from_bytes(data[at : at + 4], "little") if at + 4 <= len(data) else len(data)
        if at + length > len(data):
            break
        add(at)
        at += length
        end = at
    return {kind: starts for kind, starts in found.items() if starts}, end, is_known
