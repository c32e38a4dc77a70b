"""Each run of a campaign in a few numbers: its pass over the water, its dry distance, events on and off water."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from aqualog.campaign.samples import RunInfo, RunSamples
from aqualog.core.records import FloatArray

__all__ = ["BEHIND_S", "EventCount", "RunFacts", "facts_of"]

BEHIND_S = 1.0  # [s] after the water in which an event still counts as on water, as in `evaluate`
LEAST_S = 0.5  # [s] on the lane that count as a pass, as for the speed of full aquaplaning
_KMH = 3.6
_OFF, _ON, _UNKNOWN = "off", "on", "unknown"


@dataclass(frozen=True, slots=True)
class EventCount:
    """Events of a detector at a place (wheel, side; empty: the car): on water, off water, and unknown."""

    detector: str
    place: str
    on: int
    off: int
    unknown: int


@dataclass(frozen=True, slots=True)
class RunFacts:
    """`lane_kmh` mean speed on the lane, NaN without a pass; `lane_s` time on it; `dry_km` driven off it, NaN where the
    lane is not known; `full` events that were full.
    """

    lane_kmh: float
    lane_s: float
    dry_km: float
    events: tuple[EventCount, ...]
    full: int


def facts_of(info: RunInfo, samples: RunSamples) -> RunFacts:
    """The numbers of one run."""
    v = samples.array("v_x")
    step = samples.step_s
    wet = (samples.on_water == 1.0) & np.isfinite(v)
    dry = (samples.on_water == 0.0) & np.isfinite(v)
    seconds = float(np.count_nonzero(wet)) * step if wet.any() else 0.0
    is_known = bool(np.isfinite(samples.on_water).any())
    counts: dict[tuple[str, str], dict[str, int]] = {}
    for event in info.events:
        at = (str(event["detector"]), str(event["wheel"] or event["side"] or ""))
        of = counts.setdefault(at, {_ON: 0, _OFF: 0, _UNKNOWN: 0})
        of[_where(event, samples.t, samples.on_water, is_known=is_known)] += 1
    return RunFacts(
        lane_kmh=_KMH * float(v[wet].mean()) if seconds >= LEAST_S else math.nan,
        lane_s=seconds,
        dry_km=float(v[dry].sum()) * step / 1e3 if is_known and dry.any() else 0.0 if is_known else math.nan,
        events=tuple(EventCount(d, p, n[_ON], n[_OFF], n[_UNKNOWN]) for (d, p), n in sorted(counts.items())),
        full=sum(e["severity"] == "full" for e in info.events),
    )


def _where(event: Mapping[str, Any], t: FloatArray, on_water: FloatArray, *, is_known: bool) -> str:
    """Whether an event begins on water or within a second after it; the ends where wheels settle count as water."""
    if not is_known:
        return _UNKNOWN
    start = float(event["start_s"])
    near = on_water[(t >= start - BEHIND_S) & (t <= start + 0.5 * float(t[1] - t[0] if t.size > 1 else 1.0))]
    return _OFF if near.size == 0 or bool(np.all(near == 0.0)) else _ON
