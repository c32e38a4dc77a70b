"""Write MDF 4.10.

Everything is written to the given path; the caller renames it from a temporary name.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import asammdf
import numpy as np
from asammdf.blocks.v4_blocks import FileHistory

from aqualog.core.records import FloatArray

__all__ = ["MdfGroup", "write_mf4", "writing"]

Compression = Literal[0, 2]


@dataclass(frozen=True, slots=True)
class MdfGroup:
    """One channel group: channels that share their time stamps.

    `t_s` (n,) are seconds from the start; `columns` map a channel's name to its unit, its meaning and its samples (n,).
    A missing sample is NaN and is written as NaN: every tool shows a gap, and no tool has to honour invalidation bits.
    """

    acq_name: str
    t_s: FloatArray
    columns: Mapping[str, tuple[str, str, FloatArray]]


def write_mf4(
    path: Path, groups: Sequence[MdfGroup], start_ns: int | None, comment: str,
    *, compression: Compression = 2, written_ns: int | None = None,
) -> None:  # fmt: skip
    """Write measured channels.

    Parameters
    ----------
    path : Path
        Written as it is, whatever its suffix; overwritten.
    groups : sequence of MdfGroup
        In the order of the file.
    start_ns : int or None
        Nanoseconds since 1970 UTC; None if the start is not known.
    comment : str
        Comment of the file.
    compression : 0 or 2
        None, or transposed deflate.
    written_ns : int, optional
        Time of writing for the file's history, since 1970 UTC; default now. With one the same channels give the same
        bytes.
    """
    with writing(path, groups, start_ns, comment, compression=compression, written_ns=written_ns):
        pass


@contextmanager
def writing(
    path: Path, groups: Sequence[MdfGroup], start_ns: int | None, comment: str,
    *, compression: Compression = 2, written_ns: int | None = None,
) -> Iterator[Any]:  # fmt: skip
    """The same, open for more groups until the end of the block."""
    mdf: Any = asammdf.MDF(version="4.10")
    try:
        # 0 stands for "not known": readers take a start in 1970 for a logger without a clock
        mdf.header.start_time = datetime.fromtimestamp((start_ns or 0) // 10**9, UTC)
        mdf.header.abs_time = start_ns or 0
        mdf.header.comment = comment
        for group in groups:
            t = np.ascontiguousarray(group.t_s, dtype=np.float64)
            signals = [
                asammdf.Signal(np.ascontiguousarray(v, dtype=np.float64), t, name=n, unit=unit, comment=meaning)
                for n, (unit, meaning, v) in group.columns.items()
            ]
            mdf.append(signals, acq_name=group.acq_name, comment="", common_timebase=True)
        yield mdf
        if written_ns is not None:
            history = FileHistory()
            history.comment = "<FHcomment><TX>created</TX><tool_id>aqualog</tool_id></FHcomment>"
            history.abs_time, history.tz_offset, history.daylight_save_time, history.time_flags = written_ns, 0, 0, 0
            mdf.file_history.append(history)
        with path.open("wb+") as file:  # given a name, asammdf would replace its suffix by .mf4
            mdf.save(file, compression=compression, add_history_block=written_ns is None)
    finally:
        mdf.close()
