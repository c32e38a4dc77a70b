"""Write raw CAN frames as MDF 4.10, for tests: as ASAM bus logging [asam_mdf_2019], one group `CAN_DataFrame`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import asammdf
import numpy as np

from aqualog.core.records import FloatArray, TimeArray
from aqualog.io.can import load_dbc
from aqualog.io.write_mdf import MdfGroup, writing

_FRAME = np.dtype([
    ("CAN_DataFrame.BusChannel", "<u1"), ("CAN_DataFrame.ID", "<u4"), ("CAN_DataFrame.IDE", "<u1"),
    ("CAN_DataFrame.DLC", "<u1"), ("CAN_DataFrame.DataLength", "<u1"), ("CAN_DataFrame.DataBytes", "(64,)u1"),
    ("CAN_DataFrame.Dir", "<u1"), ("CAN_DataFrame.EDL", "<u1"), ("CAN_DataFrame.BRS", "<u1"),
])  # fmt: skip
_DLC_LENGTH = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64])


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


def frame_rows(frames: CanFrames):
    """Frames as records of the group."""
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


def write_frames_mf4(path: Path, frames: CanFrames, start_ns: int | None, comment: str, *, groups=(), compression=2):
    """Write raw frames, with measured `groups` beside them if there are any."""
    with writing(path, groups, start_ns, comment, compression=compression) as mdf:
        source = asammdf.Source("CAN", "CAN", "", 2, 2)  # a bus source makes asammdf set the bus event flags
        t = np.asarray(frames.t_ns, dtype=np.float64) * 1e-9
        signal = asammdf.Signal(frame_rows(frames), t, name="CAN_DataFrame", source=source)
        mdf.append([signal], acq_name="CAN", acq_source=source, comment="", common_timebase=True)


def write_can_mf4(
    path: Path, dbc_path: Path, messages: Sequence[CanMessage], start_ns: int | None, comment: str,
    *, groups: Sequence[MdfGroup] = (), compression=2,
) -> None:  # fmt: skip
    """Encode signals by a DBC and write the frames. Values come back rounded to the resolution of the DBC."""
    by_name = {m.name: m for m in load_dbc((dbc_path,)).messages.values()}
    rows = []
    for message in messages:
        definition = by_name[message.name]
        idle = {s.name: s.conversion.raw_to_scaled(0, decode_choices=False) for s in definition.signals}
        t_ns = np.round(np.asarray(message.t_s, dtype=np.float64) * 1e9).astype(np.int64)
        for k, t in enumerate(t_ns):
            values = idle | {n: float(v[k]) for n, v in message.columns.items() if np.isfinite(v[k])}
            payload = definition.encode(values, strict=False)
            rows.append((int(t), int(definition.frame_id), bool(definition.is_extended_frame), payload, message.bus))
    t_ns, *rest = zip(*sorted(rows, key=lambda r: r[0]), strict=True)
    frames = CanFrames(np.array(t_ns, dtype=np.int64), *rest)
    write_frames_mf4(path, frames, start_ns, comment, groups=groups, compression=compression)
