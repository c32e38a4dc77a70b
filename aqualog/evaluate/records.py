"""Result of one drive: small records that can be added up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from aqualog.core.records import Remark

__all__ = ["Cell", "DetectorRun", "Hit", "RunRecord"]


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


@dataclass(frozen=True, slots=True)
class DetectorRun:
    """One detector on one drive.

    `full` and `partial` are episodes of the car; `wheel_full` and `wheel_partial` those of the wheels that the detector
    names, matched with its events on that wheel; `own` those of the label with the detector's name. `false_alarms` are
    times at which an event began outside water [s]; `on_water` counts events on water that began outside aquaplaning;
    `cells` is the column of the confusion table.
    """

    full: tuple[Hit, ...] = ()
    partial: tuple[Hit, ...] = ()
    wheel_full: tuple[Hit, ...] = ()
    wheel_partial: tuple[Hit, ...] = ()
    own: tuple[Hit, ...] = ()
    false_alarms: tuple[float, ...] = ()
    on_water: int = 0
    cells: Mapping[str, Cell] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class RunRecord:
    """One drive under all detectors.

    `dry_s` [s] and `dry_m` [m] are time and way outside water (and the second after it); `wet_s` is the time on water
    without aquaplaning. `detectors` holds those that could run, `unavailable` the others; `is_lossy` if the
    log was cut or damaged. `heard`: least and greatest value of the channel of each rival in the log. `checks`: inputs
    that do not fit each other.
    """

    name: str
    groups: Mapping[str, str]
    duration_s: float
    dry_s: float
    dry_m: float
    wet_s: float
    detectors: Mapping[str, DetectorRun]
    unavailable: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    is_lossy: bool = False
    heard: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    checks: tuple[Remark, ...] = ()
