"""MCAP files of JSON messages with their units, for Foxglove, PlotJuggler and our own reader."""

from __future__ import annotations

import heapq
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import starmap
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer

from aqualog.core.errors import LogError
from aqualog.core.records import FloatArray, TimeArray
from aqualog.io.log_event import LogEvent

__all__ = ["EVENT_TOPIC", "McapTopic", "write_mcap"]

EVENT_TOPIC = "/aqualog/events"
_BLOCK = 4096
_TIME = {
    "type": "object", "title": "time",
    "properties": {
        "sec": {"type": "integer", "minimum": 0}, "nsec": {"type": "integer", "minimum": 0, "maximum": 999_999_999},
    },
}  # fmt: skip
_PAIR = {
    "type": "object", "title": "foxglove.KeyValuePair",
    "properties": {"key": {"type": "string"}, "value": {"type": "string"}}, "required": ["key", "value"],
}  # fmt: skip
_EVENT = {
    "title": "foxglove.Event", "description": "A discrete event that occurred over a time range", "type": "object",
    "properties": {"start_time": _TIME, "end_time": _TIME, "metadata": {"type": "array", "items": _PAIR}},
    "required": ["start_time", "end_time"],
}  # fmt: skip
"""The JSON schema that a timeline knows by its name. [foxglove_event2026]"""


@dataclass(frozen=True, slots=True)
class McapTopic:
    """Signals that share one time base.

    `t_ns` (n,) are int64 nanoseconds; `columns` maps a field to its unit, its meaning and n samples, NaN where missing.
    """

    name: str
    t_ns: TimeArray
    columns: Mapping[str, tuple[str, str, FloatArray]]


def write_mcap(
    path: Path, topics: Sequence[McapTopic], start_ns: int | None, comment: str = "written by aqualog",
    *, events: Sequence[LogEvent] = (),
) -> None:  # fmt: skip
    """Write topics into one file, message by message in the order of time.

    Parameters
    ----------
    path : Path
        File to write; an existing one is overwritten.
    topics : sequence of McapTopic
        One JSON message per topic and sample; a sample that is not finite is written as null.
    start_ns : int or None
        Added to all times; None leaves them as they are, counted from 0 or from 1970. [ns]
    comment : str
        Kept as metadata of the file.
    events : sequence of LogEvent
        Messages `foxglove.Event` at their start, on a topic of their own; without events there is no such topic.

    Raises
    ------
    LogError
        If a time is before 0, which MCAP cannot express, or the file cannot be written.
    """
    offset = 0 if start_ns is None else start_ns
    for topic in topics:
        _check(path, topic, offset)
    try:
        with path.open("wb") as file:
            writer = Writer(file, compression=CompressionType.ZSTD)
            writer.start(profile="", library="aqualog")
            writer.add_metadata("aqualog", {"comment": comment})
            channels = [_register(writer, topic) for topic in topics]
            rows = heapq.merge(*starmap(_rows, zip(channels, topics, strict=True)), _event_rows(writer, events, offset))
            for sequence, (t, channel, _, data) in enumerate(rows):
                writer.add_message(channel, t + offset, data, t + offset, sequence & 0xFFFFFFFF)
            writer.finish()
    except OSError as error:
        raise LogError(f"cannot be written ({error.strerror})", where=str(path), hint="another folder") from error


def _check(path: Path, topic: McapTopic, offset: int) -> None:
    if any(len(values) != len(topic.t_ns) for _, _, values in topic.columns.values()):
        raise ValueError(f"{topic.name}: a column and the times differ in length")
    if topic.t_ns.size and int(topic.t_ns.min()) + offset < 0:
        what = f'topic "{topic.name}" has a time before 0'
        raise LogError(what, where=str(path), expected="times from 0 on", hint="give the start of the drive")


def _register(writer: Writer, topic: McapTopic) -> int:
    properties: dict[str, Any] = {}
    for field, (unit, meaning, _) in topic.columns.items():
        properties[field] = {"type": "number", "unit": unit, "description": f"{meaning} [{unit}]" if unit else meaning}
    # [json_schema_2020]
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", "type": "object", "properties": properties}
    name = topic.name.strip("/").replace("/", ".") or "signals"
    schema_id = writer.register_schema(name=name, encoding="jsonschema", data=json.dumps(schema).encode())
    return int(writer.register_channel(topic=topic.name, message_encoding="json", schema_id=schema_id))


def _rows(channel: int, topic: McapTopic) -> Iterator[tuple[int, int, int, bytes]]:
    """Time, channel, number and JSON of each sample; built in blocks, for Python numbers take four times the room."""
    fields = list(topic.columns)
    encode = json.JSONEncoder(allow_nan=False, separators=(",", ":")).encode
    for start in range(0, len(topic.t_ns), _BLOCK):
        block = slice(start, start + _BLOCK)
        times = topic.t_ns[block].tolist()
        columns = [_nullable(values[block]) for _, _, values in topic.columns.values()]
        samples = zip(*columns, strict=True) if columns else iter([()] * len(times))
        for number, (t, row) in enumerate(zip(times, samples, strict=True), start):
            yield t, channel, number, encode(dict(zip(fields, row, strict=True))).encode()


def _nullable(values: FloatArray) -> list[float | None]:
    finite = np.isfinite(values)
    plain: list[float | None] = values.tolist()
    return plain if finite.all() else [v if ok else None for v, ok in zip(plain, finite, strict=True)]


def _event_rows(writer: Writer, events: Sequence[LogEvent], offset: int) -> Iterator[tuple[int, int, int, bytes]]:
    """Time, channel, number and JSON of each event, in the order of their start."""
    if not events:
        return iter(())
    schema_id = writer.register_schema(name=_EVENT["title"], encoding="jsonschema", data=json.dumps(_EVENT).encode())
    channel = writer.register_channel(topic=EVENT_TOPIC, message_encoding="json", schema_id=schema_id)
    ordered = sorted(events, key=lambda e: e.start_ns)
    return iter([(e.start_ns, channel, i, _event_json(e, offset)) for i, e in enumerate(ordered)])


def _event_json(event: LogEvent, offset: int) -> bytes:
    start, end = (
        dict(zip(("sec", "nsec"), divmod(t + offset, 10**9), strict=True)) for t in (event.start_ns, event.end_ns)
    )
    about = {"name": event.name, "text": event.text, **event.properties}
    pairs = [{"key": k, "value": v} for k, v in about.items()]
    return json.dumps({"start_time": start, "end_time": end, "metadata": pairs}).encode()
