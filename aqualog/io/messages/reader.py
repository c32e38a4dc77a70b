"""Readers of recorded messages: MCAP, ROS 1 bags, and ROS 2 recordings in sqlite3 or MCAP, one file or a folder.

The numeric leaf fields of all topics are channels, and those that are asked for are decoded in one pass per file. A
ROS 2 folder is read from its files; `metadata.yaml` only names and orders them, so one that lost it, or lost a split,
is still read. Messages are decoded with the definitions in the recording, or with those of its ROS release where an old
recording holds none.

Formats: http://wiki.ros.org/Bags/Format/2.0, https://github.com/ros2/rosbag2 [rosbag2010]
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import BinaryIO

import numpy as np
import zstandard
from rosbags.typesys import Stores

from aqualog.core.errors import LogError
from aqualog.core.records import Channel, ChannelInfo, FileFaults
from aqualog.io.clock_drift import drift_note
from aqualog.io.decompress import FREE, RATIO
from aqualog.io.messages.bag import MAGIC as BAG_MAGIC
from aqualog.io.messages.bag import BagSource
from aqualog.io.messages.codecs import Leaf, brief
from aqualog.io.messages.db3 import Db3Source, release_of
from aqualog.io.messages.mcap import McapSource
from aqualog.io.messages.streams import Sink, Stream, sinks_of, taker_of
from aqualog.io.messages.walk import MessageSource
from aqualog.io.reader import FaultLog, OpenFile, Part, ReadOptions, part_of

__all__ = ["McapReader", "MessageReader", "RosReader"]


_YEAR_2000_NS = 946_684_800 * 10**9
_PIECE = 1 << 17  # samples
_DB3_MAGIC = b"SQLite format 3\0"
_SPLIT = re.compile(r"\.(db3|mcap)(\.zstd)?$")
_MOST_METADATA = 1 << 20  # [byte]


class MessageReader(OpenFile):
    """Reader of one log made of message sources, read one after the other.

    Parameters
    ----------
    path : Path
        What the user named.
    sources : sequence of MessageSource
        Files in the order of recording.
    faults : FaultLog
        What was found while the sources were sought.
    """

    format = "messages"

    def __init__(self, path: Path, sources: Sequence[MessageSource], faults: FaultLog) -> None:
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
        found = []
        for topic, leaves in topics.items():
            for text, leaf in leaves.items():
                # A topic that carries one number is named by the topic: `/omega_fl` with the field `data`.
                is_topic = len(leaves) == 1 and leaf.path[-1] in ("data", "value")
                name = topic.rstrip("/").rpartition("/")[2] if is_topic else leaf.name
                path, about = f"{topic}.{text}", (self._path.name, (topic, text), leaf.comment)
                found.append(ChannelInfo(path, name, leaf.unit, counts[topic], *about))
        return found

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

    def _pass(self, index: int, source: MessageSource, sinks: Mapping[str, Sink]) -> Iterator[None]:
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

    @contextmanager
    def _guard(self) -> Iterator[None]:
        """Turn errors of the operating system into a `LogError` that names the log."""
        try:
            yield
        except OSError as error:
            what = f"cannot be read ({error.strerror or brief(error)})"
            raise LogError(what, where=str(self._path), hint="check that the file is there and readable") from error

    @property
    def faults(self) -> FileFaults:
        """What was lost so far; complete after `read`."""
        notes = [*self._faults.notes, *(note for source in self._sources for note in source.notes())]
        truncated = self._faults.truncated or any(source.truncated for source in self._sources)
        unassigned = sum(source.unassigned for source in self._sources)
        lost = self._faults.lost_samples + sum(self._lost.values()) + unassigned
        unfinalised = any(source.unfinalised for source in self._sources)
        return FaultLog(truncated, lost, notes, unfinalised, self._faults.drifts).freeze()


class McapReader(MessageReader):
    """Reader of one MCAP file."""

    format = "mcap"

    def __init__(self, path: Path, options: ReadOptions) -> None:
        super().__init__(path, [McapSource(path)], FaultLog())


class RosReader(MessageReader):
    """Reader of a ROS 1 bag, a ROS 2 file, or a ROS 2 directory."""

    format = "ros"

    def __init__(self, path: Path, options: ReadOptions) -> None:
        faults = FaultLog()
        self._temporary: TemporaryDirectory[str] | None = None
        try:
            super().__init__(path, self._sources_of(path, faults), faults)
        except BaseException:
            self.close()
            raise

    def _sources_of(self, path: Path, faults: FaultLog) -> list[MessageSource]:
        if not path.exists():
            raise LogError("does not exist", where=str(path), hint="check the path")
        if not path.is_dir():
            return [self._open(path, Stores.ROS2_HUMBLE)]
        told = re.search(r"^[ \t]*ros_distro:\s*['\"]?(\w+)", _metadata(path), re.MULTILINE)
        release = release_of(told[1] if told else "")
        sources: list[MessageSource] = []
        for split in _splits(path, faults):
            try:
                sources.append(self._open(split, release))
            except LogError as error:
                faults.truncated = True
                faults.notes.append(f"a split is left out: {error.line()}")
        if not sources:
            raise LogError(
                "no split can be read",
                where=str(path),
                expected="a directory with .db3 or .mcap files",
                hint=faults.notes[0] if faults.notes else "name the file itself",
            )
        return sources

    def _open(self, path: Path, release: Stores) -> MessageSource:
        if path.suffix == ".zstd":
            path = self._decompressed(path)
        with _opened(path) as file:
            magic = file.read(16)
        if magic.startswith(BAG_MAGIC):
            return BagSource(path)
        if magic == _DB3_MAGIC:
            return Db3Source(path, release)
        if magic.startswith(b"\x89MCAP"):
            return McapSource(path)
        what = "is no ROS recording" if magic else "is empty"
        raise LogError(what, where=str(path), expected="a ROS 1 bag (version 2.0), a .db3 or an .mcap file")

    def _decompressed(self, path: Path) -> Path:
        """A split that the recorder compressed as a whole, unpacked to a temporary file."""
        if self._temporary is None:
            self._temporary = TemporaryDirectory(prefix="aqualog-")
        target = Path(self._temporary.name, path.stem)
        on_disk = shutil.disk_usage(self._temporary.name).free // 2
        room = min(on_disk, FREE + RATIO * path.stat().st_size)
        try:
            with _opened(path) as packed, target.open("wb") as out:
                reader = zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True)
                while block := reader.read(1 << 20):
                    room -= len(block)
                    if room < 0:
                        what = f"is not unpacked: {out.tell() + len(block)} bytes and more in {path.stat().st_size}"
                        raise LogError(what, where=str(path), hint="free space for temp files; or it is no recording")
                    out.write(block)
        except zstandard.ZstdError as error:
            what = f"cannot be unpacked ({error})"
            raise LogError(what, where=str(path), hint="copy it again from the vehicle") from error
        return target

    def close(self) -> None:
        """Release the file and remove what was unpacked."""
        if self._temporary is not None:
            self._temporary.cleanup()
            self._temporary = None


def _metadata(path: Path) -> str:
    try:
        with (path / "metadata.yaml").open("rb") as file:
            return file.read(_MOST_METADATA).decode(errors="replace")
    except OSError:
        return ""


def _splits(path: Path, faults: FaultLog) -> list[Path]:
    """Files of a recording in the order of `metadata.yaml`, or in the order of their numbers."""
    present = {p.name: p for p in path.iterdir() if p.is_file() and _SPLIT.search(p.name)}
    # Only the bare name counts: a path in the metadata may point anywhere.
    listed = re.findall(
        r"^[ \t]*-[ \t]*['\"]?(?:[^\s'\"]*/)?([^\s/'\"]+\.(?:db3|mcap)(?:\.zstd)?)", _metadata(path), re.MULTILINE
    )
    listed = list(dict.fromkeys(listed))
    missing = [name for name in listed if name not in present]
    if missing:
        faults.truncated = True
        faults.notes.append(f"{path.name}: metadata.yaml names files that are missing: {', '.join(missing[:5])}")
    found = [present[name] for name in listed if name in present]
    return found or [present[name] for name in sorted(present, key=_split_number)]


def _split_number(name: str) -> tuple[str, int]:
    """`drive_10.db3` comes after `drive_9.db3`."""
    stem = _SPLIT.sub("", name)
    found = re.search(r"^(.*?)_(\d+)$", stem)
    return (found[1], int(found[2])) if found else (stem, -1)


def _opened(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except OSError as error:
        raise LogError(f"cannot be opened ({error.strerror})", where=str(path), hint="check the path") from error
