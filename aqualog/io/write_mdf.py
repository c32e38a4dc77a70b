"""Write MDF 4.10: measured channels, and raw CAN frames for bus logging.

Everything is written to the given path; the caller renames it from a temporary name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import asammdf
import numpy as np
from asammdf.blocks.v4_blocks import FileHistory
from numpy.typing import NDArray

from aqualog.core.errors import ConfigError
from aqualog.core.records import FloatArray, TimeArray
from aqualog.io.can import load_dbc

__all__ = ["CanFrames", "CanMessage", "MdfGroup", "write_can_mf4", "write_frames_mf4", "write_mf4"]

Compression = Literal[0, 2]

_FRAME = np.dtype([
    ("CAN_DataFrame.BusChannel", "<u1"), ("CAN_DataFrame.ID", "<u4"), ("CAN_DataFrame.IDE", "<u1"),
    ("CAN_DataFrame.DLC", "<u1"), ("CAN_DataFrame.DataLength", "<u1"), ("CAN_DataFrame.DataBytes", "(64,)u1"),
    ("CAN_DataFrame.Dir", "<u1"), ("CAN_DataFrame.EDL", "<u1"), ("CAN_DataFrame.BRS", "<u1"),
])  # fmt: skip
_DLC_LENGTH = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64])
_SOURCE_BUS, _BUS_CAN = 2, 2


@dataclass(frozen=True, slots=True)
class MdfGroup:
    """One channel group: channels that share their time stamps.

    `t_s` (n,) are seconds from the start; `columns` map a channel's name to its unit, its meaning and its samples (n,).
    A missing sample is NaN and is written as NaN: every tool shows a gap, and no tool has to honour invalidation bits.
    """

    acq_name: str
    t_s: FloatArray
    columns: Mapping[str, tuple[str, str, FloatArray]]


@dataclass(frozen=True, slots=True)
class CanFrames:
    """Raw frames in the order they were sent; `t_ns` from the start, `payloads` of 0 to 64 bytes."""

    t_ns: TimeArray
    ids: Sequence[int]
    extended: Sequence[bool]
    payloads: Sequence[bytes]
    bus: Sequence[int]


@dataclass(frozen=True, slots=True)
class CanMessage:
    """Physical samples of the signals of one message of a DBC; a signal that is not given is sent as raw 0."""

    name: str
    t_s: FloatArray
    columns: Mapping[str, FloatArray]
    bus: int = 0


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
    mdf = _new(start_ns, comment)
    try:
        _append_groups(mdf, groups)
        _save(mdf, path, compression, written_ns)
    finally:
        mdf.close()


def write_frames_mf4(
    path: Path, frames: CanFrames, start_ns: int | None, comment: str, *, compression: Compression = 2
) -> None:
    """Write raw CAN frames as ASAM bus logging [asam_mdf_2019], one group `CAN_DataFrame`."""
    mdf = _new(start_ns, comment)
    try:
        _append_frames(mdf, frames)
        _save(mdf, path, compression)
    finally:
        mdf.close()


def write_can_mf4(
    path: Path, dbc_path: Path, messages: Sequence[CanMessage], start_ns: int | None, comment: str,
    *, groups: Sequence[MdfGroup] = (), compression: Compression = 2,
) -> None:  # fmt: skip
    """Encode signals by a DBC and write the frames, with measured `groups` beside them if there are any.

    The physical values come back rounded to the resolution of the DBC.

    Raises
    ------
    ConfigError
        If the DBC has no such message or signal, or a value does not fit.
    """
    by_name = {m.name: m for m in load_dbc((dbc_path,)).messages.values()}
    parts = [_encoded(_named(by_name, m, dbc_path), m) for m in messages]
    rows = sorted((row for part in parts for row in part), key=lambda r: r[0])
    frames = CanFrames(
        np.array([r[0] for r in rows], dtype=np.int64), [r[1] for r in rows], [r[2] for r in rows],
        [r[3] for r in rows], [r[4] for r in rows],
    )  # fmt: skip
    mdf = _new(start_ns, comment)
    try:
        _append_groups(mdf, groups)
        _append_frames(mdf, frames)
        _save(mdf, path, compression)
    finally:
        mdf.close()


def _new(start_ns: int | None, comment: str) -> Any:
    mdf = asammdf.MDF(version="4.10")
    # 0 stands for "not known": readers take a start in 1970 for a logger without a clock
    mdf.header.start_time = datetime.fromtimestamp((start_ns or 0) // 10**9, UTC)
    mdf.header.abs_time = start_ns or 0
    mdf.header.comment = comment
    return mdf


def _save(mdf: Any, path: Path, compression: Compression, written_ns: int | None = None) -> None:
    if written_ns is not None:
        history = FileHistory()
        history.comment = "<FHcomment><TX>created</TX><tool_id>aqualog</tool_id></FHcomment>"
        history.abs_time, history.tz_offset, history.daylight_save_time, history.time_flags = written_ns, 0, 0, 0
        mdf.file_history.append(history)
    with path.open("wb+") as file:  # given a name, asammdf would replace its suffix by .mf4
        mdf.save(file, compression=compression, add_history_block=written_ns is None)


def _append_groups(mdf: Any, groups: Sequence[MdfGroup]) -> None:
    for group in groups:
        t = np.ascontiguousarray(group.t_s, dtype=np.float64)
        signals = [
            asammdf.Signal(np.ascontiguousarray(v, dtype=np.float64), t, name=n, unit=unit, comment=meaning)
            for n, (unit, meaning, v) in group.columns.items()
        ]
        mdf.append(signals, acq_name=group.acq_name, comment="", common_timebase=True)


def _append_frames(mdf: Any, frames: CanFrames) -> None:
    source = asammdf.Source(
        "CAN", "CAN", "", _SOURCE_BUS, _BUS_CAN
    )  # a bus source makes asammdf set the bus event flags
    t = np.asarray(frames.t_ns, dtype=np.float64) * 1e-9
    signal = asammdf.Signal(_rows(frames), t, name="CAN_DataFrame", source=source)
    mdf.append([signal], acq_name="CAN", acq_source=source, comment="", common_timebase=True)


def _rows(frames: CanFrames) -> NDArray[Any]:
    rows = np.zeros(len(frames.ids), dtype=_FRAME)
    length = np.array([len(p) for p in frames.payloads], dtype=np.int64)
    rows["CAN_DataFrame.BusChannel"] = frames.bus
    rows["CAN_DataFrame.ID"] = frames.ids
    rows["CAN_DataFrame.IDE"] = frames.extended
    rows["CAN_DataFrame.DLC"] = np.searchsorted(_DLC_LENGTH, length)
    rows["CAN_DataFrame.DataLength"] = length
    rows["CAN_DataFrame.EDL"] = length > 8
    packed = b"".join(p.ljust(64, b"\0") for p in frames.payloads)
    rows["CAN_DataFrame.DataBytes"] = np.frombuffer(packed, dtype=np.uint8).reshape(-1, 64)
    return rows


def _named(by_name: Mapping[str, Any], message: CanMessage, dbc_path: Path) -> Any:
    found = by_name.get(message.name)
    if found is None:
        raise ConfigError(f"no message {message.name}", where=str(dbc_path))
    unknown = sorted(set(message.columns) - {s.name for s in found.signals})
    if unknown:
        raise ConfigError(f"message {message.name} has no signal {unknown[0]}", where=str(dbc_path))
    return found


def _encoded(definition: Any, message: CanMessage) -> list[tuple[int, int, bool, bytes, int]]:
    """Time [ns], id, IDE flag, payload and bus of each frame."""
    idle = {s.name: s.conversion.raw_to_scaled(0, decode_choices=False) for s in definition.signals}
    t_ns = np.round(np.asarray(message.t_s, dtype=np.float64) * 1e9).astype(np.int64)
    rows = []
    for k, t in enumerate(t_ns):
        values = idle | {n: float(v[k]) for n, v in message.columns.items() if np.isfinite(v[k])}
        try:
            payload = definition.encode(values, strict=False)
        except Exception as error:  # cantools and bitstruct raise many kinds
            raise ConfigError(f"message {message.name} at {message.t_s[k]} s cannot be sent: {error}") from error
        rows.append((int(t), int(definition.frame_id), bool(definition.is_extended_frame), payload, message.bus))
    return rows
