"""The streams of a recording: what a topic holds, and its samples while they come in.

Messages with the same layout are cut into columns. The codec decodes the others, and checks samples of the cut ones.
"""

from __future__ import annotations

import dataclasses
from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aqualog.core.records import ChannelInfo, Drift, FloatArray, TimeArray
from aqualog.io.clock_drift import DriftWatch
from aqualog.io.messages.batches import Batch, rows_of
from aqualog.io.messages.codecs import MAX_DEPTH, Codec, FieldPath, Getter, Leaf, UndecodableError, brief
from aqualog.io.messages.ros_types import Layout

__all__ = ["SAMPLES", "Sink", "Stream", "make_stream", "sinks_of", "taker_of"]

SAMPLES = 8
"""Messages per topic that are read to learn its fields."""

_MAX_LEAVES = 4096
_DAY_NS = 86_400 * 10**9
_MAX_INT64 = 2**63 - 1
_WORTH_A_LAYOUT = 64  # messages of a stream; fewer are decoded sooner than their layout is found
_TRIALS = 4  # batches in turn that may differ among themselves before a stream is no longer taken for fixed
_DRAWN = 4  # messages drawn at random by which a layout is compared with the decoder

_STAMP_FIELDS: tuple[FieldPath, ...] = (("header", "stamp"), ("timestamp",), ("stamp",), ("header", "timestamp"))
_STAMP_PARTS = (("sec", "nanosec"), ("sec", "nsec"), ("secs", "nsecs"), ("seconds", "nanos"))
# ROS 1 counts messages in the header; that is book-keeping of the middleware and no measurement.
_BOOKKEEPING: FieldPath = ("header", "seq")


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
        raise UndecodableError(f"its messages cannot be decoded ({brief(failure)})") from failure
    base, parts = _find_stamp({leaf.path for leaf in leaves.values()})
    stamp = _stamp_getter(*(codec.getter(part) for part in parts)) if parts else None
    kept = [x for x in leaves.values() if x.path != _BOOKKEEPING and not (base and x.path[: len(base)] == base)]
    return Stream(stream_id, topic, count, codec, tuple(kept), stamp, parts)


def _leaf_paths(codec: Codec, value: Any, path: FieldPath) -> Iterator[FieldPath]:
    for step, child in codec.children(value):
        if isinstance(child, int | float | np.number | np.bool_):
            yield (*path, step)
        elif len(path) < MAX_DEPTH and child is not None:
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


class Sink:
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
        """Samples of one leaf (n,)."""
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
        sink = Sink("", self._texts)
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


def taker_of(sink: Sink, streams: Sequence[Stream]) -> Callable[[Batch], None]:
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


def sinks_of(infos: Iterable[ChannelInfo]) -> dict[str, Sink]:
    """An empty sink for each topic of these channels."""
    texts: dict[str, list[str]] = {}
    for info in infos:
        texts.setdefault(info.key[0], []).append(info.key[1])
    return {topic: Sink(topic, list(dict.fromkeys(names))) for topic, names in texts.items()}
