"""Sources of messages, and the walk through files of records with chunks of messages, as MCAP and ROS 1 bags are.

A damaged chunk or a wrong length costs that chunk only: behind it the walk goes on at the next chunk that the index
knows, or at the next place that looks like one.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_left
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import BinaryIO, Generic, Literal, TypeVar

from aqualog.io.decompress import Allowance
from aqualog.io.messages.batches import Batch, Message, batched, counted, first_of_each
from aqualog.io.messages.codecs import Codec, UndecodableError
from aqualog.io.messages.streams import SAMPLES, Stream, make_stream

__all__ = ["ChunkSource", "MessageSource", "RecordWalk"]

Head = TypeVar("Head")
_BLOCK = 1 << 20  # bytes


class RecordWalk(ABC, Generic[Head]):
    """One pass over the records of a file of this size [byte], from `start` on, where the first one stands.

    `chunks`: where the index knows chunks; empty without a sound one.
    """

    overlap = 0
    """Bytes that two blocks share in which a chunk is sought."""
    has_end_record = False
    """Whether a record says where the records end; else the file does."""

    def __init__(self, file: BinaryIO, size: int, start: int, chunks: Sequence[int] = ()) -> None:
        self.gaps: list[tuple[int, int]] = []
        """Where no record could be read: from, to. [byte]"""
        self._file, self._size, self._start = file, size, start
        self._chunks = sorted(chunks)
        self._doubted = False

    def doubt(self) -> None:
        """The record just given is not what it says, so its length may be wrong, too."""
        self._doubted = True

    def __iter__(self) -> Iterator[tuple[int, Head, bytes]]:
        """Offset, head and body (empty where nobody reads it) of each record."""
        offset = trusted = self._start
        while self.has_end_record or offset < self._size:
            found = self._record_at(offset)
            if found is None:
                following = self._known(offset + 1) if self._chunks else self._sought(trusted)
                back = following is not None and following < offset  # a length has led over it
                self.gaps.append((trusted if back else offset, self._size if following is None else following))
                if following is None:
                    return
                offset = following
                trusted = offset + 1
                continue
            head, start, end = found
            self._doubted = False
            self._file.seek(start)
            yield offset, head, self._file.read(end - start) if self._has_body(head) else b""
            if self._is_last(head):
                return
            trusted = offset + 1 if self._doubted else end
            offset = end

    @abstractmethod
    def _record_at(self, offset: int) -> tuple[Head, int, int] | None:
        """Head of the record there, and where its body stands; None if it cannot be one."""

    def _sought(self, offset: int) -> int | None:
        """The first place from `offset` on that looks like a chunk."""
        while offset < self._size:
            self._file.seek(offset)
            block = self._file.read(_BLOCK)
            found = self._chunk_in(block, offset)
            if found is not None or len(block) < _BLOCK:
                return found
            offset += len(block) - self.overlap
        return None

    @abstractmethod
    def _chunk_in(self, block: bytes, offset: int) -> int | None:
        """The first place in a block of the file, read from `offset` on, that looks like a chunk."""

    @abstractmethod
    def _has_body(self, head: Head) -> bool: ...

    def _is_last(self, head: Head) -> bool:
        return False

    def _known(self, offset: int) -> int | None:
        """The first chunk of the index from a place on."""
        at = bisect_left(self._chunks, offset)
        return self._chunks[at] if at < len(self._chunks) else None


class MessageSource(ABC):
    """One file of recorded messages.

    `truncated`: an unknown amount is lost; `unassigned`: lost messages of no known topic;
    `unfinalised`: the recorder has not written the index that ends a file.
    """

    missing = "channel records"
    """What a message lacks that belongs to no stream."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.truncated = self.unfinalised = False
        self.unassigned = 0
        self._notes: list[str] = []
        self._counts: dict[int, int] = {}
        self._lost: dict[int, int] = {}

    @abstractmethod
    def streams(self) -> Sequence[Stream]:
        """All connections with messages that can be decoded, in file order."""

    @abstractmethod
    def batches(self, ids: frozenset[int]) -> Iterator[Batch]:
        """Messages of these streams, in file order."""

    def lost(self, stream_id: int) -> int:
        """Messages of a stream that the last pass of `batches` could not get at."""
        return self._lost.get(stream_id, 0)

    def notes(self) -> Sequence[str]:
        """What was left out so far, as sentences."""
        return self._notes

    def _listed(
        self,
        topics: Iterable[tuple[int, str]],
        codec_of: Callable[[int], Codec],
        samples: Mapping[int, Sequence[bytes]],
    ) -> list[Stream]:
        """Streams by id and topic, as far as they have messages that can be decoded."""
        found = []
        for stream_id, topic in topics:
            if count := self._counts.get(stream_id):
                try:
                    found.append(make_stream(stream_id, topic, count, codec_of(stream_id), samples.get(stream_id, [])))
                except UndecodableError as error:
                    self._notes.append(f'topic "{topic}" is left out: {error}')
        return found

    def _count_strays(self, is_known: Callable[[int], bool]) -> None:
        strays = sum(n for i, n in self._counts.items() if not is_known(i))
        if strays:
            self.unassigned += strays
            self._notes.append(f"{self.path.name}: {strays} messages are left out, their {self.missing} are lost")


class ChunkSource(MessageSource, Generic[Head]):
    """One file of such records as a source of messages."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._damaged: dict[int, str] = {}  # chunks, and why
        self._chunks: tuple[int, ...] = ()  # by the index
        self._indexed = False
        self._allowance = Allowance()
        self._size = path.stat().st_size

    def batches(self, ids: frozenset[int]) -> Iterator[Batch]:
        """Messages of these streams, in file order."""
        self._lost = {}
        seen = dict.fromkeys(ids, 0)
        with self.path.open("rb") as file:
            for batch in batched(self._walk(file, ids)):
                counted(seen, batch)
                yield batch
        if self._indexed:
            self._lost = {i: max(0, self._counts.get(i, 0) - n) for i, n in seen.items()}

    def notes(self) -> Sequence[str]:
        """What was left out so far, as sentences."""
        if not self._damaged:
            return self._notes
        offset, reason = min(self._damaged.items())
        many = f"{len(self._damaged)} damaged chunk{'s are' if len(self._damaged) > 1 else ' is'} left out"
        return [*self._notes, f"{self.path.name}: {many} (first at byte {offset}: {reason})"]

    def _chunk_at(self, file: BinaryIO, position: int) -> tuple[Head, bytes] | None:
        """Head and body of the chunk that the index knows at a place, if there is one."""
        for offset, head, body in self._records(file, position):
            return (head, body) if offset == position and self._kind(head) == "chunk" else None
        return None

    def _sample(self, file: BinaryIO, chunks: Mapping[int, Collection[int]], enough: int) -> dict[int, list[bytes]]:
        """First messages of each stream, from as few chunks (position -> streams) as hold enough of all."""
        missing = {i for i, n in self._counts.items() if n and self._is_described(i)}
        samples: dict[int, list[bytes]] = {}
        self._allowance = Allowance()
        for position in sorted(chunks):
            here = frozenset(missing.intersection(chunks[position]))
            if here and (chunk := self._chunk_at(file, position)) is not None:
                for batch in batched(self._chunk(position, *chunk, here)):
                    first_of_each(samples, batch, SAMPLES)
                missing = {i for i in missing if len(samples.get(i, ())) < min(enough, self._counts[i])}
        return samples

    def _scan(self, file: BinaryIO) -> dict[int, list[bytes]]:
        """Count all messages and keep the first ones of each stream: for a file without a sound index."""
        samples: dict[int, list[bytes]] = {}
        for batch in batched(self._walk(file, None)):
            counted(self._counts, batch)
            first_of_each(samples, batch, SAMPLES)
        self._count_strays(self._is_described)
        return samples

    def _walk(self, file: BinaryIO, ids: frozenset[int] | None) -> Iterator[Batch | Message]:
        """Messages of these streams, or of all."""
        in_damaged = is_uncounted = False
        self._allowance = Allowance()
        records = self._records(file)
        for offset, head, body in records:
            kind = self._kind(head)
            if kind == "chunk":
                self.truncated |= is_uncounted
                yield from (pieces := self._chunk(offset, head, body, ids))
                in_damaged = not pieces and offset in self._damaged
                is_uncounted = in_damaged and not self._indexed
                if in_damaged:
                    records.doubt()
            elif kind == "index" and in_damaged:
                is_uncounted &= not self._count_lost(head, body)
            elif kind == "other":
                yield from self._outside(offset, head, body, ids, file)
        self.truncated |= is_uncounted
        for gap in records.gaps:
            # with counts of all messages what a gap costs is known
            self.truncated |= not self._indexed
            self._notes.append(self._gap_note(*gap))

    def _gap_note(self, start: int, end: int) -> str:
        """What a stretch of bytes without a sound record means for what is read."""
        name, size = self.path.name, self._size
        if end < size:
            what = f"no sound record from byte {start} to {end}: damaged there"
            return f"{name}: {what}; what stands before and behind is read"
        what = f"no sound record from byte {start} of {size} on: cut off, damaged there or never closed"
        return f"{name}: {what}; what stands before is read"

    @abstractmethod
    def _records(self, file: BinaryIO, start: int = ...) -> RecordWalk[Head]:
        """The pass over all records, or over those from a place on."""

    @abstractmethod
    def _kind(self, head: Head) -> Literal["chunk", "index", "other"]: ...

    @abstractmethod
    def _is_described(self, stream_id: int) -> bool:
        """Whether the file says what a stream holds."""

    @abstractmethod
    def _chunk(self, offset: int, head: Head, body: bytes, ids: frozenset[int] | None) -> Sequence[Batch | Message]:
        """Messages of one chunk; none if it is damaged, for then no byte of it can be trusted."""

    @abstractmethod
    def _count_lost(self, head: Head, body: bytes) -> bool:
        """Add what the index behind a damaged chunk says was in it; whether it says so."""

    @abstractmethod
    def _outside(
        self, offset: int, head: Head, body: bytes, ids: frozenset[int] | None, file: BinaryIO
    ) -> Iterator[Message]:
        """Messages outside of chunks; what else the record says is noted."""
