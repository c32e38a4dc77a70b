"""Recorded messages by the buffer: many at once where a file has them side by side."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

__all__ = ["Batch", "Message", "batched", "counted", "first_of_each", "rows_of"]

Message = tuple[int, int, bytes]
"""Stream id, log time [ns] and bytes."""
Indices = NDArray[np.int64]

_ENOUGH = 1 << 19  # bytes from which the cost of an array operation no longer counts
_HEAD = 32  # bytes that a message counts beyond its own: empty ones must not pile up


@dataclass(frozen=True, slots=True)
class Batch:
    """Messages in file order, all in one buffer.

    `ids`, `log_times` [ns], `starts` and `ends` [bytes] are (n,): message i is `data[starts[i]:ends[i]]`.
    """

    ids: Indices
    log_times: NDArray[np.uint64]
    starts: Indices
    ends: Indices
    data: bytes

    def only(self, rows: NDArray[np.bool_] | Indices) -> Batch:
        """These rows of it, over the same buffer."""
        return Batch(self.ids[rows], self.log_times[rows], self.starts[rows], self.ends[rows], self.data)

    def messages(self) -> Iterator[Message]:
        """One by one."""
        data = self.data
        spans = zip(self.ids.tolist(), self.log_times.tolist(), self.starts.tolist(), self.ends.tolist(), strict=True)
        for stream_id, log_time, start, end in spans:
            yield stream_id, log_time, data[start:end]


def batched(pieces: Iterable[Batch | Message]) -> Iterator[Batch]:
    """Batches that are worth an array operation, in the order of the pieces."""
    whole: list[Batch] = []
    loose: list[Message] = []
    size = 0
    for piece in pieces:
        if isinstance(piece, Batch):
            whole += [_laid_out(loose), piece] if loose else [piece]
            loose = []
            size += len(piece.data)
        else:
            loose.append(piece)
            size += len(piece[2]) + _HEAD
        if size >= _ENOUGH:
            yield _joined([*whole, _laid_out(loose)] if loose else whole)
            whole, loose, size = [], [], 0
    if whole or loose:
        yield _joined([*whole, _laid_out(loose)] if loose else whole)


def _laid_out(messages: Sequence[Message]) -> Batch:
    ends = np.fromiter(accumulate(len(m[2]) for m in messages), np.int64, len(messages))
    starts = np.concatenate([[0], ends[:-1]])
    ids = np.array([m[0] for m in messages], dtype=np.int64)
    log_times = np.array([m[1] for m in messages], dtype=np.uint64)
    return Batch(ids, log_times, starts, ends, b"".join(m[2] for m in messages))


def _joined(batches: Sequence[Batch]) -> Batch:
    if len(batches) == 1:
        return batches[0]
    shifts = np.concatenate([[0], np.cumsum([len(b.data) for b in batches])])
    return Batch(
        np.concatenate([b.ids for b in batches]),
        np.concatenate([b.log_times for b in batches]),
        np.concatenate([b.starts + s for b, s in zip(batches, shifts, strict=False)]),
        np.concatenate([b.ends + s for b, s in zip(batches, shifts, strict=False)]),
        b"".join(b.data for b in batches),
    )


def rows_of(data: bytes, starts: Indices, size: int) -> NDArray[np.void]:
    """The `size` bytes from each of `starts` on, side by side, as (n,) of one void each; all must lie within `data`."""
    return np.ndarray((len(data) - size + 1,), np.dtype((np.void, size)), data, strides=(1,))[starts]


def counted(counts: dict[int, int], batch: Batch) -> None:
    """Add the messages of each stream to their number."""
    for stream_id, n in zip(*(found.tolist() for found in np.unique(batch.ids, return_counts=True)), strict=True):
        counts[stream_id] = counts.get(stream_id, 0) + n


def first_of_each(samples: dict[int, list[bytes]], batch: Batch, most: int) -> None:
    """Add to the first messages of each stream what is missing of them."""
    for stream_id in np.unique(batch.ids).tolist():
        kept = samples.setdefault(stream_id, [])
        if len(kept) < most:
            first = batch.only(np.flatnonzero(batch.ids == stream_id)[: most - len(kept)])
            kept += [data for _, _, data in first.messages()]
