"""Fewer points for the same picture: minima and maxima over the whole drive, every sample around the events."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aqualog.core.records import BoolArray, Event, FloatArray

__all__ = [
    "ALL_SAMPLES", "DRIVE", "POINTS", "Budget", "Plan", "Spans", "make_plan", "merge_spans", "reduce_indices",
    "spans_of",
]  # fmt: skip

Spans = NDArray[np.int64]
"""Half-open index ranges (m, 2), sorted."""

POINTS = 4000  # per line over the whole drive: more than twice the pixels of a wide screen
ALL_SAMPLES = 20_000  # a drive up to this length goes into the page as it is
LONG_S = 20.0  # [s] of a longer event only both ends are shown in full: nothing sudden happens between them
MAX_WINDOWS = 40


@dataclass(frozen=True, slots=True)
class Budget:
    """How many samples of a line a page may hold.

    A drive of up to `all_samples` goes in as it is. Of a longer one every sample from `margin_s` [s] before to
    `margin_s` after an event does, `detail_samples` at most in all windows together: this bounds the page at high
    sample rates.
    """

    all_samples: int = ALL_SAMPLES
    margin_s: float = 3.0
    detail_samples: int = 40_000


DRIVE = Budget()
"""Of the page of one drive."""


@dataclass(frozen=True, slots=True)
class Plan:
    """Which samples go into the page: everything inside `windows`, minima and maxima outside.

    `events_in_full` counts the events whose windows found room.
    """

    n: int
    windows: Spans
    events_in_full: int

    @property
    def is_complete(self) -> bool:
        """Whether every sample is in."""
        return bool(self.windows.size) and int(self.windows[0, 0]) == 0 and int(self.windows[0, 1]) == self.n


def make_plan(events: Sequence[Event], n: int, dt: float, budget: Budget = DRIVE) -> Plan:
    """Windows of full resolution around the most important events, within the budget.

    Parameters
    ----------
    events : sequence of Event
        The most important first.
    n : int
        Samples of the drive.
    dt : float
        Sample time. [s]
    budget : Budget, optional
    """
    if n <= budget.all_samples:
        return Plan(n, np.array([[0, n]], dtype=np.int64).reshape(-1, 2)[: int(n > 0)], len(events))
    windows = np.empty((0, 2), dtype=np.int64)
    done = 0
    for event in events:
        grown = merge_spans(np.vstack([windows, _windows_of(event, n, dt, budget.margin_s)]))
        # several detectors report one incident; an event in or next to an existing window costs little
        if len(grown) <= MAX_WINDOWS and np.diff(grown).sum() <= budget.detail_samples:
            windows, done = grown, done + 1
    return Plan(n, windows, done)


def _windows_of(event: Event, n: int, dt: float, margin_s: float) -> Spans:
    ends = [(event.start_s, event.end_s)]
    if event.end_s - event.start_s > LONG_S:
        ends = [(event.start_s, event.start_s), (event.end_s, event.end_s)]
    cut = [(np.floor((a - margin_s) / dt), np.ceil((b + margin_s) / dt) + 1) for a, b in ends]
    return np.clip(np.array(cut), 0, n).astype(np.int64)


def merge_spans(spans: Spans, gap: int = 0) -> Spans:
    """Union of spans; those at most `gap` samples apart become one."""
    if len(spans) == 0:
        return spans.reshape(0, 2)
    spans = spans[np.argsort(spans[:, 0], kind="stable")]
    reach = np.maximum.accumulate(spans[:, 1])
    begins = np.flatnonzero(np.concatenate([[True], spans[1:, 0] > reach[:-1] + gap]))
    ends = np.concatenate([begins[1:] - 1, [len(spans) - 1]])
    return np.column_stack([spans[begins, 0], reach[ends]])


def spans_of(bits: BoolArray, *, at_most: int | None = None) -> Spans:
    """Index ranges where a bit is set.

    With `at_most`, neighbours are joined over ever longer pauses until few enough are left; no set sample is lost.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], bits, [False]]).astype(np.int8)))
    spans = edges.reshape(-1, 2).astype(np.int64)
    gap = 1
    while at_most is not None and len(spans) > at_most:
        spans, gap = merge_spans(spans, gap), 2 * gap
    return spans


def reduce_indices(values: FloatArray, points: int = POINTS) -> NDArray[np.int64]:
    """Samples that draw the same line: minimum and maximum of each of `points / 2` stretches, gaps kept as gaps.

    Parameters
    ----------
    values : array (n,)
        NaN (or infinite) where there is no value.
    points : int
        About how many to keep.

    Returns
    -------
    indices : int array, ascending
        One index of each gap is among them, so that the line breaks there. Where there are more gaps than could be
        seen, the shortest ones are closed.
    """
    finite = np.isfinite(values)
    if values.size <= points:
        return np.arange(values.size)
    if finite.all():
        return _extremes(values, points)
    stretches, gaps = _stretches(finite, at_most=points // 8)
    total = max(1, int(finite.sum()))
    parts = [gaps]
    for begin, end in stretches:
        inside = begin + np.flatnonzero(finite[begin:end])
        share = max(4, 2 * round(0.5 * points * inside.size / total))
        parts.append(inside[_extremes(values[inside], share)])
    return _distinct(np.concatenate(parts).astype(np.int64))


def _stretches(finite: BoolArray, *, at_most: int) -> tuple[Spans, NDArray[np.int64]]:
    """Stretches between the longest gaps, and one index in each of these gaps."""
    gaps = spans_of(~finite)
    if len(gaps) > at_most:
        lengths = gaps[:, 1] - gaps[:, 0]
        longest = np.sort(np.argsort(-lengths, kind="stable")[:at_most])
        gaps = gaps[longest]
    edges = np.concatenate([[0], gaps.ravel(), [finite.size]]).reshape(-1, 2)
    return edges[edges[:, 1] > edges[:, 0]], gaps[:, 0]


def _extremes(values: FloatArray, points: int) -> NDArray[np.int64]:
    from tsdownsample import MinMaxDownsampler

    if values.size <= points:
        return np.arange(values.size)
    # both ends too: the line must reach to its gap
    found = MinMaxDownsampler().downsample(np.ascontiguousarray(values), n_out=points)
    return _distinct(np.concatenate([[0], found.astype(np.int64), [values.size - 1]]))


def _distinct(indices: NDArray[np.int64]) -> NDArray[np.int64]:
    """In order, each once; `np.unique` takes ten times as long for as few as these."""
    ordered = np.sort(indices)
    return ordered[np.concatenate([[True], ordered[1:] != ordered[:-1]])] if ordered.size else ordered
