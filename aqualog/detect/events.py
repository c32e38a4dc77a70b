"""Turn detection bits into events, across pieces of a drive."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from aqualog.core.records import BoolArray, Event, FloatArray, Track

__all__ = ["EventBook", "EventBuilder", "Evidence", "as_they_are"]

Evidence = Mapping[str, tuple[str, FloatArray | BoolArray]]
"""Name -> (how, values): `first`, `min`, `max`; of a bit, `any` or `at_start`."""


def as_they_are(evidence: dict[str, Any]) -> dict[str, Any]:
    """Return the evidence unchanged."""
    return evidence


@dataclass(slots=True)
class _Open:
    start: int
    peak: float = -np.inf
    evidence: dict[str, Any] = field(default_factory=dict)


class EventBuilder:
    """Build the events of one detector on one wheel.

    It keeps only minima, maxima and first values, so that an event cut by a piece's end comes out the same to the bit.

    Parameters
    ----------
    detector, wheel, side : str
        As in the event.
    threshold : float
        In the unit of the statistic.
    dt_ns : int
        Sample time.
    severity : callable
        Evidence -> `partial` or `full`.
    explain : callable
        Turns gathered evidence into that of the event, where bits and values become words.
    """

    def __init__(
        self,
        detector: str,
        *,
        wheel: str | None,
        side: str | None,
        threshold: float,
        dt_ns: int,
        severity: Callable[[Mapping[str, Any]], str],
        explain: Callable[[dict[str, Any]], dict[str, Any]] = as_they_are,
    ) -> None:
        self._explain = explain
        self._detector = detector
        self._wheel = wheel
        self._side = side
        self._threshold = threshold
        self._dt_ns = dt_ns
        self._severity = severity
        self._offset = 0
        self._open: _Open | None = None

    def push(self, bits: BoolArray, statistic: FloatArray, evidence: Evidence) -> list[Event]:
        """Return events that end within this piece."""
        closed: list[Event] = []
        edges = np.flatnonzero(np.diff(np.concatenate([[False], bits, [False]]).astype(np.int8)))
        for begin, end in zip(edges[::2], edges[1::2], strict=True):
            if self._open is not None and begin > 0:
                closed.append(self._close(self._offset))
            if self._open is None:
                self._open = _Open(self._offset + int(begin))
            self._gather(slice(begin, end), statistic, evidence)
            if end < bits.size:
                closed.append(self._close(self._offset + int(end)))
        if self._open is not None and bits.size and not bits[0] and edges.size == 0:
            closed.append(self._close(self._offset))
        self._offset += bits.size
        return closed

    def finish(self) -> list[Event]:
        """Return the event that is open at the end of the drive."""
        return [self._close(self._offset)] if self._open is not None else []

    def _gather(self, part: slice, statistic: FloatArray, evidence: Evidence) -> None:
        opened = self._open
        assert opened is not None
        values = statistic[part]
        values = values[~np.isnan(values)]
        if values.size:
            opened.peak = max(opened.peak, float(values.max()))
        for name, (how, array) in evidence.items():
            piece = array[part]
            if how == "any":
                opened.evidence[name] = bool(opened.evidence.get(name, False) or piece.any())
                continue
            if how == "at_start":
                opened.evidence.setdefault(name, bool(piece[0]))
                continue
            piece = piece[~np.isnan(piece)]
            if piece.size == 0:
                continue
            old = opened.evidence.get(name)
            if how == "first":
                opened.evidence.setdefault(name, float(piece[0]))
            else:
                new = float(piece.min() if how == "min" else piece.max())
                opened.evidence[name] = new if old is None else (min(old, new) if how == "min" else max(old, new))

    def _close(self, end: int) -> Event:
        opened = self._open
        assert opened is not None
        self._open = None
        return Event(
            detector=self._detector,
            wheel=self._wheel,
            side=self._side,
            start_s=opened.start * self._dt_ns / 1e9,
            end_s=end * self._dt_ns / 1e9,
            severity=self._severity(opened.evidence),
            peak=opened.peak,
            threshold=self._threshold,
            evidence=self._explain(opened.evidence),
        )


class EventBook:
    """Build all events of a drive, with one builder per detector and place."""

    def __init__(self, dt_ns: int) -> None:
        self._dt_ns = dt_ns
        self._builders: dict[tuple[str, str | None, str | None], EventBuilder] = {}

    def take(
        self,
        track: Track,
        evidence: Evidence,
        severity: Callable[[Mapping[str, Any]], str],
        explain: Callable[[dict[str, Any]], dict[str, Any]] = as_they_are,
    ) -> list[Event]:
        """Return events of a track that end within this piece; severity and words are those of the first piece."""
        key = (track.detector, track.wheel, track.side)
        if key not in self._builders:
            self._builders[key] = EventBuilder(
                track.detector, wheel=track.wheel, side=track.side, threshold=track.threshold, dt_ns=self._dt_ns,
                severity=severity, explain=explain,
            )  # fmt: skip
        return self._builders[key].push(track.active, track.statistic, evidence)

    def finish(self) -> tuple[Event, ...]:
        """Return events that are open at the end of the drive."""
        return tuple(e for b in self._builders.values() for e in b.finish())
