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
from xml.sax.saxutils import escape, quoteattr

import asammdf
import numpy as np
from asammdf.blocks import v4_constants
from asammdf.blocks.v4_blocks import EventBlock, FileHistory

from aqualog.core.records import FloatArray
from aqualog.io.log_event import LogEvent

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
    *, compression: Compression = 2, written_ns: int | None = None, events: Sequence[LogEvent] = (),
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
    events : sequence of LogEvent
        Each becomes two EV blocks, the beginning and the end of a range. [asam_mdf_2019]
    """
    with writing(path, groups, start_ns, comment, compression=compression, written_ns=written_ns) as mdf:
        mdf.events.extend(b for i, e in enumerate(events) for b in _event_blocks(e, first=2 * i))


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


def _event_blocks(event: LogEvent, *, first: int) -> tuple[EventBlock, EventBlock]:
    """The beginning and the end of a range; `first` is the place of the beginning among all blocks of events."""
    begin = _event_block(event.name, event.start_ns, v4_constants.EVENT_RANGE_TYPE_BEGINNING)
    end = _event_block(event.name, event.end_ns, v4_constants.EVENT_RANGE_TYPE_END)
    begin.comment, end.range_start = _event_comment(event), first
    return begin, end


def _event_block(name: str, t_ns: int, kind: int) -> EventBlock:
    block = EventBlock(
        event_type=v4_constants.EVENT_TYPE_MARKER, sync_type=v4_constants.EVENT_SYNC_TYPE_S, range_type=kind,
        cause=v4_constants.EVENT_CAUSE_TOOL, flags=v4_constants.FLAG_EV_POST_PROCESSING, sync_base=t_ns,
        sync_factor=1e-9,
    )  # fmt: skip
    block.name = name
    return block


def _event_comment(event: LogEvent) -> str:
    """The text and properties as MDF 4 has them in XML; without what XML cannot hold."""
    values = "".join(f"<e name={quoteattr(_clean(k))}>{escape(_clean(v))}</e>" for k, v in event.properties.items())
    properties = f"<common_properties>{values}</common_properties>" if values else ""
    return (
        f'<EVcomment xmlns="http://www.asam.net/mdf/v4"><TX>{escape(_clean(event.text))}</TX>{properties}</EVcomment>'
    )


def _clean(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)
