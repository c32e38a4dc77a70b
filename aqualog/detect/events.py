"""Turn detection bits into events, across pieces of a drive."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from aqualog.core.records import BoolArray, Event, FloatArray, Track

__all__ = ["AFTER", "DURATION", "SINCE", "EventBook", "Evidence", "Explain", "Severity", "as_they_are"]

Evidence = Mapping[str, tuple[str, FloatArray | BoolArray]]
"""Name -> (how, values): `first`, `last`, `min`, `max`; of a bit, `any` or `at_start`; of ones and
zeros, their `share` of ones."""

SINCE, AFTER, DURATION = "since_s", "after_s", "duration_s"
"""Evidence of when the cause began and ended: seconds from there to the first (`first`) and last sample (`last`);
and how long the event is, for its severity."""

REACH_S = 10.0  # [s] no cause began so long before its detection

Severity = Callable[[Mapping[str, Any]], str]
Explain = Callable[[dict[str, Any]], dict[str, Any]]


def as_they_are(evidence: dict[str, Any]) -> dict[str, Any]:
    """Return the evidence unchanged."""
    return evidence


@dataclass(slots=True)
class _Open:
    start: int
    peak: float = -np.inf
    evidence: dict[str, Any] = field(default_factory=dict)
    counts: dict[str, tuple[int, int]] = field(default_factory=dict)

    def gather(self, part: slice, statistic: FloatArray, evidence: Evidence) -> None:
        """Take the samples of a piece in which the bit is set."""
        values = statistic[part]
        values = values[~np.isnan(values)]
        if values.size:
            self.peak = max(self.peak, float(values.max()))
        for name, (how, array) in evidence.items():
            piece = array[part]
            if how == "any":
                self.evidence[name] = bool(self.evidence.get(name, False) or piece.any())
                continue
            if how == "at_start":
                self.evidence.setdefault(name, bool(piece[0]))
                continue
            piece = piece[~np.isnan(piece)]
            if piece.size == 0:
                continue
            if how == "first":
                self.evidence.setdefault(name, float(piece[0]))
                continue
            if how == "last":
                self.evidence[name] = float(piece[-1])
                continue
            if how == "share":
                ones, of = self.counts.get(name, (0, 0))
                self.counts[name] = ones + int(np.count_nonzero(piece)), of + piece.size
                self.evidence[name] = self.counts[name][0] / self.counts[name][1]
                continue
            new, least = float(piece.min() if how == "min" else piece.max()), min if how == "min" else max
            self.evidence[name] = least(self.evidence[name], new) if name in self.evidence else new


class _Builder:
    """Build the events of one detector at one place.

    It keeps only minima, maxima, first values and counts, so that an event cut by a piece's end comes out the same to
    the bit.
    """

    def __init__(self, track: Track, dt_ns: int, severity: Severity, explain: Explain) -> None:
        self._place: dict[str, Any] = {"detector": track.detector, "wheel": track.wheel, "side": track.side}
        self._threshold = track.threshold
        self._dt_ns = dt_ns
        self._severity = severity
        self._explain = explain
        self._offset = 0
        self._open: _Open | None = None
        self._gaps: list[tuple[int, int]] = []  # samples without a statistic, [first, end)

    def push(self, bits: BoolArray, statistic: FloatArray, evidence: Evidence) -> list[Event]:
        """Return events that end within this piece."""
        closed: list[Event] = []
        self._note_gaps(np.isnan(statistic))
        runs = _runs(bits)
        for begin, end in runs:
            if begin > 0:
                closed += self._close(self._offset)
            if self._open is None:
                self._open = _Open(self._offset + begin)
            self._open.gather(slice(begin, end), statistic, evidence)
            if end < bits.size:
                closed += self._close(self._offset + end)
        if bits.size and not runs:
            closed += self._close(self._offset)
        self._offset += bits.size
        return closed

    def finish(self) -> list[Event]:
        """Return the event that is open at the end of the drive."""
        return self._close(self._offset, cut=True)

    def _note_gaps(self, lacks: BoolArray) -> None:
        oldest = (self._offset if self._open is None else self._open.start) - REACH_S * 1e9 / self._dt_ns
        self._gaps = [g for g in self._gaps if g[1] >= oldest]
        for begin, end in _runs(lacks):
            is_one = self._gaps and self._gaps[-1][1] == self._offset + begin
            first = self._gaps.pop()[0] if is_one else self._offset + begin
            self._gaps.append((first, self._offset + end))

    def _gap_s(self, at_s: float) -> tuple[float, float]:
        """The gap that a moment lies within, or that moment twice. [s]"""
        spans = ((first * self._dt_ns / 1e9, end * self._dt_ns / 1e9) for first, end in reversed(self._gaps))
        return next((g for g in spans if g[0] < at_s < g[1]), (at_s, at_s))

    def _close(self, end: int, *, cut: bool = False) -> list[Event]:
        """Return the open event; `cut`: by the end of the drive."""
        if self._open is None:
            return []
        opened, self._open = self._open, None
        start_s, end_s = opened.start * self._dt_ns / 1e9, end * self._dt_ns / 1e9
        since, after = (opened.evidence.pop(name, 0.0) for name in (SINCE, AFTER))
        # a wheel may report a puddle when the car has left it: then the cause is over before the event begins
        cause_end = self._gap_s(max(end_s - after, 0.0))[0]
        if cut and cause_end <= start_s:  # it has just begun: nothing shows that its cause is over
            cause_end = end_s
        cause_start = self._gap_s(max(start_s - since, 0.0))[1]  # a cause is known only where there are data
        return [
            Event(
                **self._place, start_s=start_s, end_s=end_s,
                severity=self._severity({**opened.evidence, DURATION: end_s - start_s}),
                peak=opened.peak, threshold=self._threshold, evidence=self._explain(opened.evidence),
                cause_s=(min(cause_start, cause_end), cause_end),
            )
        ]  # fmt: skip


def _runs(bits: BoolArray) -> list[tuple[int, int]]:
    """Return the first sample of each run of set bits (n,), and the first one behind."""
    if not bits.any():  # as in most pieces
        return []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], bits, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


class EventBook:
    """Build all events of a drive, with one builder per detector and place; `dt_ns` sample time. [ns]"""

    def __init__(self, dt_ns: int) -> None:
        self._dt_ns = dt_ns
        self._builders: dict[tuple[str, str | None, str | None], _Builder] = {}

    def take(self, track: Track, evidence: Evidence, severity: Severity, explain: Explain = as_they_are) -> list[Event]:
        """Return events of a track that end within this piece.

        `severity` (evidence -> `partial` or `full`) and `explain` (gathered evidence -> that of the event, where bits
        and values become words) are those of the first piece.
        """
        key = (track.detector, track.wheel, track.side)
        if key not in self._builders:
            self._builders[key] = _Builder(track, self._dt_ns, severity, explain)
        return self._builders[key].push(track.active, track.statistic, evidence)

    def finish(self) -> tuple[Event, ...]:
        """Return events that are open at the end of the drive."""
        return tuple(e for b in self._builders.values() for e in b.finish())
