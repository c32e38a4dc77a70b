"""Match events to episodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from aqualog.evaluate.labels import Labels, Span, joined, overlaps, without

__all__ = ["LIMITS_S", "Cell", "Hit", "beginning_in", "cells_of", "hits", "outlasting", "rows_of"]

LIMITS_S = {"full": 0.5, "partial": 2.0}
"""Longest time from the beginning of an episode to its detection. [s]"""

OUTLASTS_S = 10.0  # [s] an alarm that is still on so long after the water is a false one too


@dataclass(frozen=True, slots=True)
class Hit:
    """Result of a detector for one episode.

    `found` within the limit. `latency` from the episode's beginning to the first event that belongs to it, also if that
    came too late; NaN without an event. `before`: the event was already on when the episode began (latency 0).
    """

    found: bool
    latency: float
    before: bool


@dataclass(frozen=True, slots=True)
class Cell:
    """A detector in one row of the confusion table: episodes, those with an event, and events that began there."""

    episodes: int = 0
    hit: int = 0
    events: int = 0
    seconds: float = 0.0

    def __add__(self, other: Cell) -> Cell:
        return Cell(
            self.episodes + other.episodes, self.hit + other.hit, self.events + other.events,
            self.seconds + other.seconds,
        )  # fmt: skip


def hits(episodes: Sequence[Span], events: Sequence[Span], *, limit: float, water: Sequence[Span]) -> tuple[Hit, ...]:
    """Match events to episodes.

    Parameters
    ----------
    episodes, events : sequence of (start, end)
        Of one effect, of one detector. [s]
    limit : float
        An event that overlaps the first `limit` seconds finds the episode. [s]
    water : sequence of (start, end)
        An event that was on before the episode counts only if it began on the same stretch of water: else a stuck
        alarm would find all episodes.

    Returns
    -------
    tuple of Hit
        One per episode.
    """
    return tuple(_hit(span, sorted(events), limit, water) for span in episodes)


def _hit(episode: Span, events: Sequence[Span], limit: float, water: Sequence[Span]) -> Hit:
    start, end = episode
    for begin, stop in events:
        if stop <= start or begin > max(end, start + limit):
            continue
        if begin >= start:
            return Hit(begin - start <= limit + 1e-9, begin - start, before=False)
        if any(_is_in(begin, [stretch]) and _is_in(start, [stretch]) for stretch in water):
            return Hit(found=True, latency=0.0, before=True)
    return Hit(found=False, latency=float("nan"), before=False)


def outlasting(events: Sequence[Span], water: Sequence[Span]) -> list[float]:
    """Return times at which events from water had lasted `OUTLASTS_S` beyond the end of their stretch. [s]"""
    return [b + OUTLASTS_S for begin, stop in events for a, b in water if a <= begin < b and stop > b + OUTLASTS_S]


def beginning_in(events: Sequence[Span], spans: Sequence[Span]) -> list[Span]:
    """Return events that begin within any of the stretches."""
    return [e for e in events if _is_in(e[0], spans)]


def _is_in(t: float, spans: Sequence[Span]) -> bool:
    # half a sample of slack: stamps of truth and detector are not the same floats
    return any(a - 1e-6 <= t < b for a, b in spans)


def rows_of(labels: Labels, duration_s: float) -> dict[str, list[Span]]:
    """Return rows of the confusion table: `full`, `partial` (without full), `water only`, other labels, `none`.

    Parameters
    ----------
    labels : Labels
    duration_s : float
        Of the drive. [s]
    """
    full, afloat, water = labels.of("full"), labels.afloat, labels.water
    others = {e: labels.of(e) for e in labels.others}
    taken = joined([*labels.water_widened, *(s for spans in others.values() for s in spans)], 0.0)
    rows = {
        "full": full,
        "partial": without(labels.of("partial"), full),
        "water only": without(water, afloat),
        **others,
        "none": without([(0.0, duration_s)], taken),
    }
    return {name: spans for name, spans in rows.items() if spans}


def cells_of(rows: dict[str, list[Span]], events: Sequence[Span]) -> dict[str, Cell]:
    """Return a detector's column of the confusion table. `events` are those of the car: disjoint stretches."""
    return {
        name: Cell(
            len(spans),
            sum(overlaps(s, events) for s in spans),
            len(beginning_in(events, spans)),
            sum(b - a for a, b in spans),
        )
        for name, spans in rows.items()
    }
