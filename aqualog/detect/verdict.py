"""The verdict on a drive: aquaplaning, none, or that it cannot be judged."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from aqualog.core.judgement import Judgement
from aqualog.core.records import Event, Unavailable
from aqualog.detect.episodes import Stretch, episodes_of
from aqualog.detect.margin.watch import MARGIN
from aqualog.detect.registry import all_of

__all__ = ["JOINT", "NEVER_TOGETHER", "judge"]

JOINT = tuple(d.name for d in all_of("joint"))
SHORTEST_S = 1.0  # [s] of dry road are no verdict: at 80 km/h a car is not across a lane then
NEVER_TOGETHER = f"{SHORTEST_S:g} s in which all signals of the joint detectors have a value"


def judge(
    events: Sequence[Event], unavailable: Sequence[Unavailable], ran: Collection[str], *, judged_s: float, way: Stretch
) -> Judgement:
    """Return the verdict and the episodes of one drive.

    Parameters
    ----------
    events, unavailable
        Of the drive, from all detectors.
    ran : collection of str
        Detectors that ran.
    judged_s : float
        Time in which the joint detectors had all of their signals. [s]
    way : callable
        As `Way.between`.

    A single detector never decides: without a joint one the verdict is `cannot_be_judged`, whatever the others found.
    """
    found = episodes_of(events, way, warns=MARGIN.name in ran)
    wet = any(e.kind == "aquaplaning" for e in found)
    if wet or (any(d in ran for d in JOINT) and judged_s >= SHORTEST_S):
        return Judgement("aquaplaning" if wet else "none", (), tuple(ran), found, judged_s)
    lacks = [m for u in unavailable if u.detector in JOINT for m in u.missing]
    return Judgement("cannot_be_judged", tuple(dict.fromkeys(lacks or [NEVER_TOGETHER])), tuple(ran), found, judged_s)
