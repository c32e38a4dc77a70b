"""What a drive's detections come to: episodes, and whether there was aquaplaning."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

__all__ = ["EPISODE_KINDS", "VERDICTS", "Episode", "EpisodeKind", "Judgement", "Verdict"]

EpisodeKind = Literal["aquaplaning", "suspected", "other_surface", "wheel_lock", "single_detector"]
Verdict = Literal["aquaplaning", "none", "cannot_be_judged"]

EPISODE_KINDS: dict[EpisodeKind, str] = {
    "aquaplaning": "a joint detector decided",
    "suspected": "two different effects at once, no joint detector decided",
    "other_surface": "the slip slope was lost without the resistance of water: snow, ice, gravel, or a wrong estimate",
    "wheel_lock": "wheels slowed down while a brake acted on them",
    "single_detector": "one effect alone",
}
"""Kinds of episodes, the most important first, and what each means."""

_KMH = 3.6  # [km/h per m/s]

VERDICTS: dict[Verdict, str] = {
    "aquaplaning": "at least one episode of aquaplaning",
    "none": "the joint detectors ran and found no aquaplaning",
    "cannot_be_judged": "the joint detectors could not run",
}


@dataclass(frozen=True, slots=True)
class Episode:
    """Detections of one drive that belong together.

    `start_s` and `end_s` are estimates of when the cause began and ended, from the log's first sample. [s]
    `wheels` are those that lost speed or grip, the worst first; `axle` (`f`, `r`) and `side` (`left`, `right`) where
    all of them share it. `v_x` is the mean speed [m/s], `distance_m` the way [m]; NaN where the speed is unknown.
    `decided_by` are the detectors behind the decision. `delta_a_x_max` is the largest resistance measure [m/s²],
    `slip_min` and `slip_max` the least and greatest slip [-]; NaN where unknown. `events` are indices into the events
    of the drive. `v_full` is the speed at which the first wheel was lost for good [m/s], NaN without one.
    """

    kind: EpisodeKind
    start_s: float
    end_s: float
    wheels: tuple[str, ...]
    axle: str | None
    side: str | None
    severity: str
    v_x: float
    decided_by: tuple[str, ...]
    delta_a_x_max: float
    slip_min: float
    slip_max: float
    distance_m: float
    events: tuple[int, ...]
    v_full: float = math.nan

    @property
    def duration_s(self) -> float:
        """From beginning to end. [s]"""
        return self.end_s - self.start_s

    def document(self) -> dict[str, Any]:
        """Return the episode as JSON has it: speed in km/h, null for NaN, nine digits."""
        return {
            "kind": self.kind, "start_s": _short(self.start_s), "end_s": _short(self.end_s),
            "wheels": list(self.wheels), "axle": self.axle, "side": self.side, "severity": self.severity,
            "v_x_kmh": _short(_KMH * self.v_x), "v_full_kmh": _short(_KMH * self.v_full),
            "decided_by": list(self.decided_by), "delta_a_x_max": _short(self.delta_a_x_max),
            "slip_min": _short(self.slip_min), "slip_max": _short(self.slip_max),
            "distance_m": _short(self.distance_m), "events": list(self.events),
        }  # fmt: skip

    @staticmethod
    def of_document(e: Mapping[str, Any]) -> Episode:
        """Return the episode that JSON holds."""
        speed, delta, least, most, metres, lost = (
            math.nan if (x := e.get(n)) is None else float(x)  # older results lack the last ones
            for n in ("v_x_kmh", "delta_a_x_max", "slip_min", "slip_max", "distance_m", "v_full_kmh")
        )
        return Episode(
            e["kind"], e["start_s"], e["end_s"], tuple(e["wheels"]), e["axle"], e["side"], e["severity"], speed / _KMH,
            tuple(e["decided_by"]), delta, least, most, metres, tuple(e["events"]), lost / _KMH,
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Judgement:
    """The answer of `detect` for one drive.

    `missing` names what the joint detectors lack where the verdict is `cannot_be_judged`; `ran` are the detectors that
    ran. `judged_s` is the time in which the joint detectors had all of their signals. [s]
    """

    verdict: Verdict = "cannot_be_judged"
    missing: tuple[str, ...] = ()
    ran: tuple[str, ...] = ()
    episodes: tuple[Episode, ...] = field(default=())
    judged_s: float = 0.0

    def of(self, *kinds: EpisodeKind) -> tuple[Episode, ...]:
        """Return the episodes of some kinds."""
        return tuple(e for e in self.episodes if e.kind in kinds)

    def document(self) -> dict[str, Any]:
        """Return verdict, what is missing, detectors that ran, judged seconds and episodes, as JSON has them."""
        return {
            "verdict": self.verdict, "missing": list(self.missing), "ran": list(self.ran),
            "judged_s": _short(self.judged_s), "episodes": [e.document() for e in self.episodes],
        }  # fmt: skip

    @staticmethod
    def of_document(document: Mapping[str, Any]) -> Judgement:
        """Return the judgement that JSON holds."""
        return Judgement(
            document["verdict"], tuple(document["missing"]), tuple(document["ran"]),
            tuple(Episode.of_document(e) for e in document["episodes"]), document["judged_s"],
        )  # fmt: skip


def _short(x: float) -> float | None:
    return float(f"{x:.9g}") if math.isfinite(x) else None
