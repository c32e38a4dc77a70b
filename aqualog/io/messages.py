"""Turn recorded messages into channels: the common part of the MCAP and ROS readers.

A `Source` is one file of recorded messages; a `Codec` turns the bytes of one message type into numbers; `MessageReader`
lists the numeric leaf fields of all topics as channels and decodes those that are asked for, in one pass per file.
Messages with the same layout are cut into columns. The codec decodes the others, and checks samples of the cut ones.
"""

from __future__ import annotations

import dataclasses
import json
import re
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import islice
from operator import attrgetter, itemgetter
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

import numpy as np
from google.protobuf.message import Message as ProtobufMessage
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.msg import normalize_msgtype
from rosbags.typesys.store import Typestore

from aqualog.core.errors import LogError
from aqualog.core.records import Channel, ChannelInfo, Drift, FileFaults, FloatArray, TimeArray
from aqualog.io.base import FaultLog, OpenFile, Part, part_of
from aqualog.io.batches import Batch, rows_of
from aqualog.io.clock_drift import DriftWatch, drift_note
from aqualog.io.fixed_layout import Layout, ros_layout
from aqualog.io.ros_types import MAX_TEXT, RefusedError, checked

__all__ = [
    "SAMPLES", "Codec", "Leaf", "MessageReader", "Source", "Stream", "UndecodableError", "codec_for",
    "make_stream",
]  # fmt: skip

SAMPLES = 8
"""Messages per topic that are read to learn its fields."""

_MAX_ELEMENTS = 16
_MAX_LEAVES = 4096
_MAX_DEPTH = 12
_DAY_NS = 86_400 * 10**9
_YEAR_2000_NS = 946_684_800 * 10**9
_MAX_INT64 = 2**63 - 1
_PIECE = 1 << 17  # samples
_WORTH_A_LAYOUT = 64  # messages of a stream; fewer are decoded sooner than their layout is found
_TRIALS = 4  # batches in turn that may differ among themselves before a stream is no longer taken for fixed
_DRAWN = 4  # messages drawn at random by which a layout is compared with the decoder

FieldPath = tuple[str | int, ...]
Getter = Callable[[Any], Any]

_STAMP_FIELDS: tuple[FieldPath, ...] = (("header", "stamp"), ("timestamp",), ("stamp",), ("header", "timestamp"))
_STAMP_PARTS = (("sec", "nanosec"), ("sec", "nsec"), ("secs", "nsecs"), ("seconds", "nanos"))
# ROS 1 counts messages in the header; that is book-keeping of the middleware and no measurement.
_BOOKKEEPING: FieldPath = ("header", "seq")


class UndecodableError(Exception):
    """A topic's encoding or type is not known; its text is the reason."""


@dataclasses.dataclass(frozen=True, slots=True)
class Leaf:
    """One numeric field of a message type."""

    path: FieldPath
    unit: str = ""
    comment: str = ""

    @property
    def text(self) -> str:
        """Path as written: `pose.position.x`, `ranges[3]`."""
        return "".join(f"[{s}]" if isinstance(s, int) else f".{s}" for s in self.path).removeprefix(".")

    @property
    def name(self) -> str:
        """Last field name, with its index if it is an array: `x`, `ranges[3]`."""
        return self.text.rpartition(".")[2]


class Codec(Protocol):
    """How the bytes of one message type become numbers."""

    def decode(self, data: bytes, /) -> Any:
        """One message as an object."""
        ...

    def children(self, value: Any) -> Iterable[tuple[str | int, Any]]:
        """Fields of an object or elements of an array; empty for anything else."""
        ...

    def getter(self, path: FieldPath) -> Getter:
        """Fast access to one field. Raises one of `_ABSENT` or gives None if a message lacks it."""
        ...

    def declared(self) -> Iterable[Leaf]:
        """Leaves that the schema names, before any message is seen."""
        ...

    def describe(self, path: FieldPath) -> tuple[str, str]:
        """Unit and comment of a leaf."""
        ...

    def layout(self, data: bytes, /) -> Layout | None:
        """Where the fields of messages like this one lie; None if that cannot be said without decoding each."""
        ...


@dataclasses.dataclass(frozen=True, slots=True)
class Stream:
    """One recorded connection of a topic.

    `id` is unique within its source; `stamp_parts` are the fields for seconds and nanoseconds that `stamp` reads.
    """

    id: int
    topic: str
    count: int
    codec: Codec
    leaves: tuple[Leaf, ...]
    stamp: Callable[[Any], int] | None
    stamp_parts: tuple[FieldPath, ...] = ()


class Source(Protocol):
    """One file of recorded messages.

    `truncated`: an unknown amount is lost; `unassigned`: lost messages of no known topic;
    `unfinalised`: the recorder has not written the index that ends a file.
    """

    truncated: bool
    unassigned: int
    unfinalised: bool

    def streams(self) -> Sequence[Stream]:
        """All connections with messages that can be decoded, in file order."""
        ...

    def batches(self, ids: frozenset[int]) -> Iterator[Batch]:
        """All messages of these streams, in file order."""
        ...

    def lost(self, stream_id: int) -> int:
        """Messages of a stream that the last pass of `batches` could not get at."""
        ...

    def notes(self) -> Sequence[str]:
        """What was left out so far, as sentences."""
        ...


# ---------------------------------------------------------------- codecs


def _elements(value: Any) -> Iterable[tuple[int, Any]]:
    """Elements of a short array; a long one is an image or a point cloud and no signal."""
    return enumerate(value) if len(value) <= _MAX_ELEMENTS else ()


class _JsonCodec:
    def __init__(self, schema: Mapping[str, Any]) -> None:
        self._schema = schema
        self.decode = json.loads

    def children(self, value: Any) -> Iterable[tuple[str | int, Any]]:
        if isinstance(value, dict):
            return value.items()
        return _elements(value) if isinstance(value, list) else ()

    def getter(self, path: FieldPath) -> Getter:
        return itemgetter(path[0]) if len(path) == 1 else _walker(path)

    def declared(self) -> Iterable[Leaf]:
        for path, _ in _schema_leaves(self._schema, (), 0):
            yield Leaf(path, *self.describe(path))

    def describe(self, path: FieldPath) -> tuple[str, str]:
        node: Any = self._schema
        for step in path:
            node = _mapping(node.get("items")) if isinstance(step, int) else _mapping(_properties(node).get(step))
        comment = node.get("description")
        comment = comment if isinstance(comment, str) else ""
        unit = node.get("unit")
        return (unit if isinstance(unit, str) else _bracket_unit(comment)), comment

    def layout(self, data: bytes, /) -> Layout | None:
        return None


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _properties(node: Mapping[str, Any]) -> Mapping[str, Any]:
    return _mapping(node.get("properties"))


def _schema_leaves(node: Mapping[str, Any], path: FieldPath, depth: int) -> Iterator[tuple[FieldPath, Any]]:
    for name, child in _properties(node).items():
        if not isinstance(child, dict) or depth > _MAX_DEPTH:
            continue
        kinds = child.get("type")
        kinds = kinds if isinstance(kinds, list) else [kinds]
        if any(kind in ("number", "integer", "boolean") for kind in kinds):
            yield (*path, name), child
        else:
            yield from _schema_leaves(child, (*path, name), depth + 1)


def _bracket_unit(comment: str) -> str:
    """Return the unit at the end of a description, `speed [km/h]`; a range `[0, 1]` or an index `[2]` is no unit."""
    found = re.search(r"\[\s*([^\[\]\s,;:]{1,16})\s*\]\s*\.?\s*$", comment)
    if found is None or not (re.search(r"[^\W\d_]|[%°]", found[1]) or found[1] == "-"):
        return ""
    return found[1]


def _walker(path: FieldPath) -> Getter:
    def get(value: Any) -> Any:
        for step in path:
            value = value[step]
        return value

    return get


class _RosCodec:
    def __init__(self, store: Typestore, msgtype: str, *, cdr: bool) -> None:
        self._deserialize = store.deserialize_cdr if cdr else store.deserialize_ros1
        self._types = store.fielddefs
        self._msgtype = msgtype
        self._cdr = cdr

    def decode(self, data: bytes, /) -> Any:
        return self._deserialize(data, self._msgtype)

    def children(self, value: Any) -> Iterable[tuple[str | int, Any]]:
        if dataclasses.is_dataclass(value):
            return [(f.name, getattr(value, f.name)) for f in dataclasses.fields(value)]
        return _elements(value) if isinstance(value, list | np.ndarray) else ()

    def getter(self, path: FieldPath) -> Getter:
        return _attribute_getter(path)

    def declared(self) -> Iterable[Leaf]:
        return ()

    def describe(self, path: FieldPath) -> tuple[str, str]:
        return "", ""

    def layout(self, data: bytes, /) -> Layout | None:
        return ros_layout(self._types, self._msgtype, data, cdr=self._cdr)


def _attribute_getter(path: FieldPath) -> Getter:
    if all(isinstance(step, str) for step in path):
        return attrgetter(".".join(str(step) for step in path))

    def get(value: Any) -> Any:
        for step in path:
            value = value[step] if isinstance(step, int) else getattr(value, step)
        return value

    return get


class _ProtobufCodec:
    def __init__(self, decode: Callable[[bytes], Any]) -> None:
        self.decode = decode

    def children(self, value: Any) -> Iterable[tuple[str | int, Any]]:
        if isinstance(value, ProtobufMessage):
            return _protobuf_fields(value)
        return _elements(value) if hasattr(value, "__len__") and not isinstance(value, str | bytes) else ()

    def getter(self, path: FieldPath) -> Getter:
        def get(value: Any) -> Any:
            for step in path:
                if isinstance(step, int):
                    value = value[step]
                    continue
                # A field that tracks its presence and is unset reads as 0, which would be a made-up sample.
                if value.DESCRIPTOR.fields_by_name[step].has_presence and not value.HasField(step):
                    return None
                value = getattr(value, step)
            return value

        return get

    def declared(self) -> Iterable[Leaf]:
        return ()

    def describe(self, path: FieldPath) -> tuple[str, str]:
        return "", ""

    def layout(self, data: bytes, /) -> Layout | None:
        return None


def _protobuf_fields(message: Any) -> Iterator[tuple[str, Any]]:
    for field in message.DESCRIPTOR.fields:
        kind = field.message_type
        if kind is not None and kind.GetOptions().map_entry:
            continue
        # An unset message may be of its own type, so it is not followed.
        if kind is not None and field.has_presence and not message.HasField(field.name):
            continue
        yield field.name, getattr(message, field.name)


@lru_cache(maxsize=512)
def codec_for(
    encoding: str, schema_encoding: str, name: str, definition: bytes, fallback: Stores = Stores.ROS2_HUMBLE
) -> Codec:
    """Codec of a message type.

    Parameters
    ----------
    encoding : str
        Of the messages: json, protobuf, ros1 or cdr.
    schema_encoding : str
        Of `definition`: jsonschema, protobuf, ros1msg, ros2msg, ros2idl or empty.
    name : str
        Name of the type.
    definition : bytes
        The schema as it stands in the file.
    fallback : Stores
        Where ROS types are looked up that the file does not define.

    Raises
    ------
    UndecodableError
        If messages of this type cannot be decoded.
    """
    try:
        if encoding == "json" and schema_encoding in ("jsonschema", ""):
            return _JsonCodec(_mapping(_json_or_none(definition)))
        if encoding == "protobuf" and schema_encoding == "protobuf":
            return _protobuf_codec(name, definition)
        if encoding == "ros1" and schema_encoding in ("ros1msg", ""):
            return _ros_codec(name, schema_encoding, definition, Stores.ROS1_NOETIC)
        if encoding == "cdr" and schema_encoding in ("ros2msg", "ros2idl", "omgidl", ""):
            return _ros_codec(name, schema_encoding, definition, fallback)
    except UndecodableError:
        raise
    except RefusedError as error:
        raise UndecodableError(f'the definition of type "{name}" is refused: {error}') from error
    except Exception as error:  # the parsers run on the file's text and raise whatever it leads them to
        raise UndecodableError(f'the definition of type "{name}" cannot be read ({_brief(error)})') from error
    raise UndecodableError(f'encoding "{encoding}" with schema "{schema_encoding}" is not supported')


def _json_or_none(text: bytes) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None  # messages say what they hold without a schema too


def _protobuf_codec(name: str, definition: bytes) -> _ProtobufCodec:
    schema = Schema(id=1, name=name, encoding="protobuf", data=definition)
    decode = DecoderFactory().decoder_for("protobuf", schema)
    if decode is None:
        raise UndecodableError(f'protobuf type "{name}" is not in its own schema')
    return _ProtobufCodec(decode)


def _ros_codec(name: str, schema_encoding: str, definition: bytes, fallback: Stores) -> _RosCodec:
    msgtype = normalize_msgtype(name)
    if len(definition) > MAX_TEXT:
        raise UndecodableError(f'the definition of type "{name}" has {len(definition)} bytes, more than {MAX_TEXT}')
    types = _ros_types(msgtype, schema_encoding, definition.decode())
    # Recorders leave common types out of a definition, and old ROS 2 bags hold no definitions at all.
    known = get_typestore(Stores.EMPTY).fielddefs
    pending, reached = [msgtype], dict(known)
    while pending:
        wanted = pending.pop()
        if wanted in reached:
            continue
        if wanted not in types:
            common = get_typestore(fallback).fielddefs
            if wanted not in common:
                raise UndecodableError(f'message type "{wanted}" is not defined in the file and not known')
            types[wanted] = common[wanted]
        reached[wanted] = types[wanted]
        pending += [used for _, field in types[wanted][1] for used in _used_types(field)]
    store = get_typestore(Stores.EMPTY)
    store.register(checked(reached))
    return _RosCodec(store, msgtype, cdr=fallback is not Stores.ROS1_NOETIC)


def _ros_types(msgtype: str, schema_encoding: str, text: str) -> dict[str, Any]:
    if not text.strip():
        return {}
    if schema_encoding in ("ros1msg", "ros2msg"):
        return dict(get_types_from_msg(text, msgtype))
    ruler = "=" * 80 + "\n"
    if not text.startswith(f"{ruler}IDL: "):
        return dict(get_types_from_idl(text))
    types: dict[str, Any] = {}
    for part in text.split(ruler)[1:]:
        types.update(get_types_from_idl(part.partition("\n")[2]))
    return types


def _used_types(field: Any) -> list[str]:
    kind, detail = field
    if kind == Nodetype.NAME:
        return [detail]
    return _used_types(detail[0]) if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) else []


# ---------------------------------------------------------------- streams


def make_stream(stream_id: int, topic: str, count: int, codec: Codec, samples: Sequence[bytes]) -> Stream:
    """Learn a topic's leaves and time stamp from its schema and first messages.

    Raises
    ------
    UndecodableError
        If none of the messages can be decoded.
    """
    leaves = {leaf.text: leaf for leaf in codec.declared()}
    failure: Exception | None = None
    good = 0
    for data in samples:
        try:
            message = codec.decode(data)
            paths = list(islice(_leaf_paths(codec, message, ()), _MAX_LEAVES))
        except Exception as error:  # generated decoders raise whatever damaged bytes lead them to
            failure = error
            continue
        good += 1
        for path in paths:
            leaf = Leaf(path, *codec.describe(path))
            leaves.setdefault(leaf.text, leaf)
    if failure is not None and not good:
        raise UndecodableError(f"its messages cannot be decoded ({_brief(failure)})") from failure
    base, parts = _find_stamp({leaf.path for leaf in leaves.values()})
    stamp = _stamp_getter(*(codec.getter(part) for part in parts)) if parts else None
    kept = [x for x in leaves.values() if x.path != _BOOKKEEPING and not (base and x.path[: len(base)] == base)]
    return Stream(stream_id, topic, count, codec, tuple(kept), stamp, parts)


def _leaf_paths(codec: Codec, value: Any, path: FieldPath) -> Iterator[FieldPath]:
    for step, child in codec.children(value):
        if isinstance(child, int | float | np.number | np.bool_):
            yield (*path, step)
        elif len(path) < _MAX_DEPTH and child is not None:
            yield from _leaf_paths(codec, child, (*path, step))


def _find_stamp(paths: set[FieldPath]) -> tuple[FieldPath, tuple[FieldPath, ...]]:
    for base in _STAMP_FIELDS:
        for sec, nsec in _STAMP_PARTS:
            if (*base, sec) in paths and (*base, nsec) in paths:
                return base, ((*base, sec), (*base, nsec))
    return (), ()


def _stamp_getter(seconds: Getter, nanoseconds: Getter) -> Callable[[Any], int]:
    def stamp(message: Any) -> int:
        try:
            t = int(seconds(message)) * 1_000_000_000 + int(nanoseconds(message))
        except _ABSENT:
            return 0
        return t if 0 < t <= _MAX_INT64 else 0

    return stamp


# A field that one message lacks shows as one of these, by codec and kind of field.
_ABSENT = (TypeError, KeyError, IndexError, AttributeError, ValueError, OverflowError)


def _brief(error: Exception) -> str:
    if isinstance(error, RecursionError):
        return "they are nested deeper than 100 levels"
    return (str(error).splitlines() or [""])[0][:120] or type(error).__name__


class _Sink:
    """Samples of one topic while they come in."""

    def __init__(self, topic: str, texts: Sequence[str]) -> None:
        self.topic = topic
        self.log_times = array("Q")
        self.stamps = array("q")
        self.columns = {text: array("d") for text in texts}
        self.undecoded = 0
        self.stamped = False
        self._unlogged = True
        self._drift = DriftWatch()
        self._taken = self._rejected = 0

    def feed(self, stream: Stream) -> Callable[[int, bytes], None]:
        """Function that takes one message of a stream."""
        leaves = {leaf.text: leaf for leaf in stream.leaves}
        targets = [(c.append, stream.codec.getter(leaves[t].path)) for t, c in self.columns.items() if t in leaves]
        absent = [c.append for t, c in self.columns.items() if t not in leaves]
        decode, stamp, nan = stream.codec.decode, stream.stamp, float("nan")
        add_log_time, add_stamp = self.log_times.append, self.stamps.append
        self.stamped |= stamp is not None

        def take(log_time: int, data: bytes) -> None:
            try:
                message = decode(data)
            except Exception:  # generated decoders raise whatever damaged bytes lead them to
                self.undecoded += 1
                return
            add_log_time(log_time)
            add_stamp(0 if stamp is None else stamp(message))
            for append, get in targets:
                try:
                    append(get(message))
                except _ABSENT:
                    append(nan)
            for append in absent:
                append(nan)

        return take

    def feed_rows(self, stream: Stream) -> Callable[[Batch], None]:
        """Function that takes messages of a stream, side by side where they are laid out alike."""
        take = self.feed(stream)
        cutter = _Cutter(stream, list(self.columns))

        def take_rows(rows: Batch) -> None:
            if (found := cutter.cut(rows)) is None:
                for _, log_time, data in rows.messages():
                    take(log_time, data)
                return
            stamps, columns = found
            self.log_times.frombytes(rows.log_times.tobytes())
            self.stamps.frombytes(stamps.tobytes())
            for column, values in zip(self.columns.values(), columns, strict=True):
                column.frombytes(values.tobytes())

        return take_rows

    def __len__(self) -> int:
        return len(self.log_times)

    def times(self) -> TimeArray:
        """Time of each sample: the message's own stamp where it is plausible, else the log time. [ns]"""
        log = np.minimum(np.array(self.log_times, dtype=np.uint64), np.uint64(_MAX_INT64)).astype(np.int64)
        self._taken += log.size
        # A recorder that sets no log time at all leaves the stamps as the only clock.
        self._unlogged &= bool(log.max(initial=0) == 0)
        if not self.stamped:
            return log
        stamps = np.array(self.stamps, dtype=np.int64)
        plausible = (stamps > 0) & (self._unlogged | (np.abs(stamps - log) <= _DAY_NS))
        self._rejected += int(np.count_nonzero(~plausible))
        if not self._unlogged:
            self._drift.push(stamps, log, plausible)
        return np.where(plausible, stamps, log)

    def forget(self) -> None:
        """Release the samples that have been handed on."""
        del self.log_times[:], self.stamps[:]
        for column in self.columns.values():
            del column[:]

    def notes(self) -> list[str]:
        """What was wrong with the messages."""
        found = []
        if self._rejected:
            found.append(
                f'topic "{self.topic}": {self._rejected} of {self._taken} time stamps are zero or more than a day off '
                "the log time; the log time stands in for them"
            )
        if self.undecoded:
            found.append(f'topic "{self.topic}": {self.undecoded} messages cannot be decoded')
        return found

    def drift(self) -> Drift | None:
        """How the time of recording runs against the messages' own stamps."""
        return self._drift.finish(f'the stamp of "{self.topic}"', "the time of recording")

    def values(self, text: str) -> FloatArray:
        return np.array(self.columns[text], dtype=np.float64)


class _Cutter:
    """Cuts a stream's messages into columns while they are laid out alike; `texts` are the leaves that are wanted.

    A layout is believed when it gives the same as the decoder, to the bit, for messages drawn at random.
    """

    def __init__(self, stream: Stream, texts: Sequence[str]) -> None:
        leaves = {leaf.text: leaf.path for leaf in stream.leaves}
        self._stream = stream
        self._texts = texts
        self._paths = [leaves.get(text) for text in texts]
        self._layout: Layout | None = None
        self._trials = _TRIALS if stream.count >= _WORTH_A_LAYOUT else 0

    def cut(self, rows: Batch) -> tuple[TimeArray, list[FloatArray]] | None:
        """Stamps and columns of these messages, each (n,); None if they have to be decoded one by one."""
        if not self._trials:
            return None
        layout = self._layout or self._learnt(rows.data[int(rows.starts[0]) : int(rows.ends[0])])
        block = None if layout is None else _block(rows, len(layout.example))
        if layout is None or block is None or not layout.holds(block):
            self._layout = None
            self._trials -= 1
            return None
        self._layout, self._trials = layout, _TRIALS
        return self._columns(layout, block)

    def _learnt(self, example: bytes) -> Layout | None:
        layout = self._stream.codec.layout(example)
        if layout is None or not example:
            return None
        for field in map(layout.field, self._stream.stamp_parts):
            if field is None or field.dtype.kind not in "iu" or field.dtype.itemsize > 4:
                return None
        return layout if self._is_right(layout) else None

    def _is_right(self, layout: Layout) -> bool:
        messages = [layout.example, *layout.drawn(_DRAWN)]
        sink = _Sink("", self._texts)
        take = sink.feed(self._stream)
        for message in messages:
            take(0, message)
        stamps, columns = self._columns(
            layout, np.frombuffer(b"".join(messages), np.dtype((np.void, len(messages[0]))))
        )
        cut = [stamps.tobytes(), *(values.tobytes() for values in columns)]
        return cut == [sink.stamps.tobytes(), *(values.tobytes() for values in sink.columns.values())]

    def _columns(self, layout: Layout, block: NDArray[np.void]) -> tuple[TimeArray, list[FloatArray]]:
        stamps = np.zeros(block.size, dtype=np.int64)
        parts = [f.of(block).astype(np.int64) for p in self._stream.stamp_parts if (f := layout.field(p)) is not None]
        if parts:
            stamps = np.maximum(parts[0] * 1_000_000_000 + parts[1], 0)
        fields = [None if path is None else layout.field(path) for path in self._paths]
        with np.errstate(invalid="ignore"):  # a NaN of float32 may be a signalling one, which is a value here
            return stamps, [np.full(block.size, np.nan) if f is None else f.floats(block) for f in fields]


def _block(rows: Batch, size: int) -> NDArray[np.void] | None:
    if (rows.ends - rows.starts != size).any():
        return None
    return rows_of(rows.data, rows.starts, size)


def _taker(sink: _Sink, streams: Sequence[Stream]) -> Callable[[Batch], None]:
    """Function that feeds a topic with its part of a batch."""
    if len(streams) > 1:  # their messages are mixed, and the file's order is kept
        feeds = {stream.id: sink.feed(stream) for stream in streams}

        def take_mixed(batch: Batch) -> None:
            for stream_id, log_time, data in batch.only(np.isin(batch.ids, list(feeds))).messages():
                feeds[stream_id](log_time, data)

        return take_mixed
    feed_rows, only_id = sink.feed_rows(streams[0]), streams[0].id

    def take(batch: Batch) -> None:
        rows = np.flatnonzero(batch.ids == only_id)
        if rows.size:
            feed_rows(batch.only(rows))

    return take


class MessageReader(OpenFile):
    """Reader of one log made of message sources, read one after the other.

    Parameters
    ----------
    path : Path
        What the user named.
    sources : sequence of Source
        Files in the order of recording.
    faults : FaultLog
        What was found while the sources were sought.
    """

    format = "messages"

    def __init__(self, path: Path, sources: Sequence[Source], faults: FaultLog) -> None:
        super().__init__(path, faults)
        self._sources = tuple(sources)
        self._lost: dict[tuple[str, int, int], int] = {}
        self._streams: list[tuple[int, Stream]] | None = None

    def channels(self) -> list[ChannelInfo]:
        """All numeric leaf fields of all topics, in file order."""
        topics: dict[str, dict[str, Leaf]] = {}
        counts: dict[str, int] = {}
        for _, stream in self._known_streams():
            leaves = topics.setdefault(stream.topic, {})
            counts[stream.topic] = counts.get(stream.topic, 0) + stream.count
            for leaf in stream.leaves:
                leaves.setdefault(leaf.text, leaf)
        return [
            self._info(topic, leaf, counts[topic], sole=len(leaves) == 1)
            for topic, leaves in topics.items()
            for leaf in leaves.values()
        ]

    def _info(self, topic: str, leaf: Leaf, count: int, *, sole: bool) -> ChannelInfo:
        # A topic that carries one number is named by the topic: `/omega_fl` with the field `data`.
        name = topic.rstrip("/").rpartition("/")[2] if sole and leaf.path[-1] in ("data", "value") else leaf.name
        path = f"{topic}.{leaf.text}"
        return ChannelInfo(path, name, leaf.unit, count, self._path.name, (topic, leaf.text), leaf.comment)

    def _known_streams(self) -> list[tuple[int, Stream]]:
        if self._streams is None:
            with self._guard():
                self._streams = [(i, stream) for i, source in enumerate(self._sources) for stream in source.streams()]
        return self._streams

    def read(self, wanted: Iterable[ChannelInfo]) -> list[Channel]:
        """Decode these channels, in the order asked for; one pass over the file."""
        infos = list(wanted)
        sinks = _sinks(infos)
        for index, source in enumerate(self._sources):
            with self._guard():
                for _ in self._pass(index, source, sinks):
                    pass
        channels = self._channels(infos, sinks, {})
        self._finish(sinks)
        return channels

    def parts(self, wanted: Iterable[ChannelInfo]) -> list[Part]:
        """The same piece by piece, all topics together as they were recorded."""
        infos = list(wanted)
        return [part_of(infos, self._pieces(infos))]

    def _pieces(self, infos: Sequence[ChannelInfo]) -> Iterator[Sequence[Channel]]:
        sinks = _sinks(infos)
        absolute: dict[str, bool] = {}
        for index, source in enumerate(self._sources):
            steps = self._pass(index, source, sinks)
            while True:
                with self._guard():
                    step = next(steps, False)
                if step is False:
                    break
                if sum(map(len, sinks.values())) >= _PIECE:
                    yield self._channels(infos, sinks, absolute)
        yield self._channels(infos, sinks, absolute)
        self._finish(sinks)

    def _pass(self, index: int, source: Source, sinks: Mapping[str, _Sink]) -> Iterator[None]:
        """Feed one source's messages, a batch a step."""
        streams = [s for i, s in self._known_streams() if i == index and s.topic in sinks]
        if not streams:
            return
        by_topic: dict[str, list[Stream]] = {}
        for stream in streams:
            by_topic.setdefault(stream.topic, []).append(stream)
        takers = [_taker(sinks[topic], members) for topic, members in by_topic.items()]
        for batch in source.batches(frozenset(stream.id for stream in streams)):
            for take in takers:
                take(batch)
            yield
        for stream in streams:
            self._lost[stream.topic, index, stream.id] = source.lost(stream.id)

    def _channels(
        self, infos: Sequence[ChannelInfo], sinks: Mapping[str, _Sink], absolute: dict[str, bool]
    ) -> list[Channel]:
        """What the sinks hold, which is gone from them then; `absolute` is said by a topic's first samples."""
        times = {topic: sink.times() for topic, sink in sinks.items()}
        for topic, t_ns in times.items():
            if t_ns.size:
                absolute.setdefault(topic, bool(np.median(t_ns) >= _YEAR_2000_NS))
        channels = [
            Channel(i, times[i.key[0]], sinks[i.key[0]].values(i.key[1]), absolute.get(i.key[0], False)) for i in infos
        ]
        for sink in sinks.values():
            sink.forget()
        return channels

    def _finish(self, sinks: Mapping[str, _Sink]) -> None:
        for topic, sink in sinks.items():
            self._lost[topic, -1, -1] = sink.undecoded
            self._faults.notes += sink.notes()
        # the topics of one recorder share its clock: the one that drifts most speaks for the file
        found = [d for sink in sinks.values() if (d := sink.drift()) is not None]
        if found:
            worst = max(found, key=lambda d: abs(d.ppm))
            self._faults.drifts = [worst]
            self._faults.notes.append(f"{self._path.name}: {drift_note(worst)}")

    def _guard(self) -> _Guard:
        return _Guard(self._path)

    @property
    def faults(self) -> FileFaults:
        """What was lost so far; complete after `read`."""
        notes = [*self._faults.notes, *(note for source in self._sources for note in source.notes())]
        truncated = self._faults.truncated or any(source.truncated for source in self._sources)
        unassigned = sum(source.unassigned for source in self._sources)
        lost = self._faults.lost_samples + sum(self._lost.values()) + unassigned
        unfinalised = any(source.unfinalised for source in self._sources)
        return FaultLog(truncated, lost, notes, unfinalised, self._faults.drifts).freeze()


def _sinks(infos: Iterable[ChannelInfo]) -> dict[str, _Sink]:
    texts: dict[str, list[str]] = {}
    for info in infos:
        texts.setdefault(info.key[0], []).append(info.key[1])
    return {topic: _Sink(topic, list(dict.fromkeys(names))) for topic, names in texts.items()}


class _Guard:
    """Turns errors of the operating system into a `LogError` that names the log."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> None:
        return None

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if isinstance(error, OSError):
            what = f"cannot be read ({error.strerror or _brief(error)})"
            raise LogError(what, where=str(self._path), hint="check that the file is there and readable") from error
