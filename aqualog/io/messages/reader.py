"""Turn recorded messages into channels, for all formats that hold messages.

A `Source` is one file of recorded messages. `MessageReader` lists the numeric leaf fields of all topics as channels and
decodes those that are asked for, in one pass per file.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Protocol

import numpy as np

from aqualog.core.errors import LogError
from aqualog.core.records import Channel, ChannelInfo, FileFaults
from aqualog.io.clock_drift import drift_note
from aqualog.io.messages.batches import Batch
from aqualog.io.messages.codecs import Leaf, brief
from aqualog.io.messages.streams import Sink, Stream, sinks_of, taker_of
from aqualog.io.reader import FaultLog, OpenFile, Part, part_of

__all__ = ["MessageReader", "Source"]

_YEAR_2000_NS = 946_684_800 * 10**9
_PIECE = 1 << 17  # samples


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
        sinks = sinks_of(infos)
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
        sinks = sinks_of(infos)
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

    def _pass(self, index: int, source: Source, sinks: Mapping[str, Sink]) -> Iterator[None]:
        """Feed one source's messages, a batch a step."""
        streams = [s for i, s in self._known_streams() if i == index and s.topic in sinks]
        if not streams:
            return
        by_topic: dict[str, list[Stream]] = {}
        for stream in streams:
            by_topic.setdefault(stream.topic, []).append(stream)
        takers = [taker_of(sinks[topic], members) for topic, members in by_topic.items()]
        for batch in source.batches(frozenset(stream.id for stream in streams)):
            for take in takers:
                take(batch)
            yield
        for stream in streams:
            self._lost[stream.topic, index, stream.id] = source.lost(stream.id)

    def _channels(
        self, infos: Sequence[ChannelInfo], sinks: Mapping[str, Sink], absolute: dict[str, bool]
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

    def _finish(self, sinks: Mapping[str, Sink]) -> None:
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
            what = f"cannot be read ({error.strerror or brief(error)})"
            raise LogError(what, where=str(self._path), hint="check that the file is there and readable") from error
