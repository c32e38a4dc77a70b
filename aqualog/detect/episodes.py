"""Detections that belong together are one episode: what happened, from when to when, and to which wheels."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from aqualog.core.judgement import EPISODE_KINDS, Episode, EpisodeKind
from aqualog.core.notation import AXLES, SIDES, WHEELS
from aqualog.core.records import Event, FloatArray
from aqualog.detect.joint_criteria import V_STOPPED
from aqualog.detect.minor_spin_down import MINOR_SPIN_DOWN
from aqualog.detect.registry import all_of
from aqualog.detect.resistance import LATEST, RESISTANCE
from aqualog.detect.slip_slope.watch import SLIP_SLOPE_DROP
from aqualog.detect.spin import SPIN_DOWN
from aqualog.detect.spin_up import SPIN_UP

__all__ = ["BRAKING_GAP_S", "GAP_S", "Way", "episodes_of"]

GAP_S = 1.0  # [s] detections nearer than this have one cause: a joint warning outlasts its criteria by that much
BRAKING_GAP_S = 3.0  # [s] lock-ups nearer than this belong to one braking
STEP_S = 0.1  # [s] of the way that is kept
STOPPED = -0.5  # [-] slip of a wheel that nothing but water or a brake makes, if no engine drives it
DEAD = -300.0  # [m/s²] at the rim: a tyre on its limit stops a wheel so, a sensor that fails faster

_JOINT = tuple(d.name for d in all_of("joint"))
_WARNINGS = tuple(d.name for d in all_of("warning"))  # they come before, and are no aquaplaning
_WHEELS = (SPIN_DOWN.name, MINOR_SPIN_DOWN.name, SPIN_UP.name)
_FORCES = (*_JOINT, RESISTANCE.name)  # what the water does to the car as a whole
_EFFECT = {MINOR_SPIN_DOWN.name: SPIN_DOWN.name}  # both see the same wheel slow down

Stretch = Callable[[float, float], tuple[float, float]]
"""(start, end) [s] -> the way between them [m], and the seconds of it with a known speed."""


class Way:
    """The way of a drive over time, kept every 0.1 s; any cut into pieces gives the same.

    Parameters
    ----------
    dt : float
        Sample time. [s]
    """

    def __init__(self, dt: float) -> None:
        self._dt = dt
        self._step = max(1, round(STEP_S / dt))
        self._rows = 0
        self._last = np.zeros(2)
        self._kept: list[FloatArray] = [np.zeros((2, 1))]

    def push(self, v_x: FloatArray) -> None:
        """Take the velocity (n,) of the next samples, NaN where unknown. [m/s]"""
        known = np.isfinite(v_x)
        steps = np.array([np.where(known, v_x, 0.0), known]) * self._dt
        # one sum after the other, so that the cut does not matter
        sums = np.cumsum(np.concatenate([self._last[:, None], steps], axis=1), axis=1)[:, 1:]
        first = self._step - 1 - self._rows % self._step
        self._kept.append(sums[:, first :: self._step].copy())
        self._rows += v_x.size
        self._last = sums[:, -1] if v_x.size else self._last

    def between(self, start_s: float, end_s: float) -> tuple[float, float]:
        """Return the way [m] and the seconds with a known speed."""
        if len(self._kept) > 1:
            self._kept = [np.concatenate(self._kept, axis=1)]
        (metres, seconds) = (self._at(end_s) - self._at(start_s)).tolist()
        return metres, seconds

    def _at(self, t_s: float) -> FloatArray:
        """Both sums at a moment (2,), linear between the kept ones beside it."""
        sums = self._kept[0]
        at = min(max(int(t_s / (self._step * self._dt)), 1), sums.shape[1] - 1)
        beside = np.arange(max(at - 1, 0), min(at + 2, sums.shape[1]))
        t = beside * self._step * self._dt
        return np.array([np.interp(t_s, t, x) for x in sums[:, beside]])


def episodes_of(
    events: Sequence[Event], way: Stretch, *, warns: bool = False, rolling: Collection[str] = ()
) -> tuple[Episode, ...]:
    """Group the detections of one drive into episodes.

    Parameters
    ----------
    events : sequence of Event
        Of one drive.
    way : callable
        As `Way.between`.
    warns : bool
        Whether the margin ran, whose warnings show how far the water goes.
    rolling : collection of str
        Wheels that no engine drives and whose brakes are known, where no joint detector ran: what stops one is water.

    Returns
    -------
    tuple of Episode
        In order of their beginning; each event but a warning is in exactly one of them.

    What the water does to the car makes an episode: joint warnings and resistance whose causes are less than 1 s apart.
    Its wheels belong to it as long as they follow without a second's pause. One that was stopped or spun needs seconds
    to find the road's speed again. So wheels neither join two episodes nor move the end of one, and a joint warning
    that such a wheel sets off, without an alarm of the resistance, belongs to the episode before. A trailer or the wind
    holds a car back for minutes. So resistance reaches at most 2 s before the first joint warning or warning of the
    margin in it, the time in which water is reported, and 1 s behind the last. Other detections are
    one episode where less than 1 s lies between them. What began under a braking force is apart: lock-ups less than 3 s
    from each other are one braking, and a lock-up within an episode of aquaplaning belongs to it.
    """
    numbered = [x for x in enumerate(events) if x[1].detector not in _WARNINGS]
    free = [x for x in numbered if not _is_braking(x[1])]
    warned = [_cause(e) for e in events if e.detector in _WARNINGS] if warns else None
    water = [_Water(group, warned) for group in _groups([x for x in free if x[1].detector in _FORCES], GAP_S)]
    others = _by_begin(x for x in free if x[1].detector not in _FORCES)
    alone = [x for x in others if not any(w.takes(x) for w in _last(water, x))]
    made = [_episode(w.members, way, w.span, rolling) for w in _without_echoes(water)]
    made += [_episode(group, way, _span(group), rolling) for group in _groups(alone, GAP_S)]
    for group in _groups([x for x in numbered if _is_braking(x[1])], BRAKING_GAP_S):
        start, end = _span(group)
        wet = (i for i, x in enumerate(made) if x.kind == "aquaplaning" and start < x.end_s and end > x.start_s)
        host = next(wet, None)
        if host is None:
            made.append(replace(_episode(group, way, (start, end)), kind="wheel_lock"))
        else:
            # lock-ups within an episode change nothing else of it
            inside = (*made[host].events, *(i for i, _ in group))
            made[host] = replace(made[host], events=tuple(sorted(inside)))
    order = list(EPISODE_KINDS)
    return tuple(sorted(made, key=lambda x: (x.start_s, order.index(x.kind))))


_Numbered = tuple[int, Event]


def _is_braking(event: Event) -> bool:
    return event.evidence.get("braking_at_start") is True


def _cause(event: Event) -> tuple[float, float]:
    return event.cause_s or (event.start_s, event.end_s)


def _span(group: Iterable[_Numbered]) -> tuple[float, float]:
    starts, ends = zip(*(_cause(e) for _, e in group), strict=True)
    return min(starts), max(ends)


def _by_begin(events: Iterable[_Numbered]) -> list[_Numbered]:
    return sorted(events, key=lambda x: (*_cause(x[1]), x[0]))


def _groups(events: Sequence[_Numbered], gap_s: float) -> list[list[_Numbered]]:
    """Events whose causes are nearer than a gap, also through others."""
    groups: list[list[_Numbered]] = []
    end = -math.inf
    for item in _by_begin(events):
        begin, until = _cause(item[1])
        if begin - end < gap_s and groups:
            groups[-1].append(item)
        else:
            groups.append([item])
            end = -math.inf
        end = max(end, until)
    return groups


class _Water:
    """Joint warnings and resistance of one episode, and the detections at wheels that follow them."""

    def __init__(self, forces: Sequence[_Numbered], warned: Sequence[tuple[float, float]] | None) -> None:
        self.members = list(forces)
        self.span = start, end = _span(forces)
        signs = [_cause(e) for _, e in forces if e.detector in _JOINT]
        if signs and warned is not None:
            begins, ends = zip(*signs, *(x for x in warned if x[0] < end and x[1] > start), strict=True)
            self.span = max(start, min(begins) - LATEST), min(end, max(ends) + GAP_S)
        self.reach = self.span[1]

    def takes(self, item: _Numbered) -> bool:
        """Take a detection that overlaps the episode or follows it; detections come in order of their beginning."""
        begin, end = _cause(item[1])
        start = self.span[0]
        if not (start - end < GAP_S and begin - self.reach < GAP_S):
            return False
        self.members.append(item)
        if item[1].detector in _WHEELS:
            self.reach = max(self.reach, end)
            if start - begin < GAP_S:
                # the first wheel meets the water before the car as a whole shows it
                self.span = min(start, begin), self.span[1]
        return True


def _without_echoes(water: Sequence[_Water]) -> list[_Water]:
    """Episodes without those that a wheel of the one before has set off alone, which become part of it."""
    kept: list[_Water] = []
    for one in water:
        if kept and one.span[0] < kept[-1].reach and not any(e.detector == RESISTANCE.name for _, e in one.members):
            kept[-1].members += one.members
            kept[-1].reach = max(kept[-1].reach, one.reach)
        else:
            kept.append(one)
    return kept


def _last(water: Sequence[_Water], item: _Numbered) -> Sequence[_Water]:
    """The episode that has begun last before a detection, then the next one."""
    begun = bisect_left(water, _cause(item[1])[0], key=lambda w: w.span[0] - GAP_S)  # starts stay in order
    return [*water[max(begun - 1, 0) : begun], *water[begun : begun + 1]]


def _kind(events: Sequence[Event], rolling: Collection[str]) -> EpisodeKind:
    """The kind of an episode that no brake has begun.

    Water that takes half of the slip slope costs at least 0.2 m/s² (thesis C3, C44, C57). So a slope that is lost
    without resistance is lost to another surface.
    """
    found = {e.detector for e in events}
    if found & set(_JOINT) or any(_is_afloat(e, rolling) for e in events):
        return "aquaplaning"
    if SLIP_SLOPE_DROP.name in found and RESISTANCE.name not in found:
        return "other_surface"
    return "suspected" if len({_EFFECT.get(d, d) for d in found}) > 1 else "single_detector"


def _is_afloat(event: Event, rolling: Collection[str]) -> bool:
    """Whether a wheel that rolled freely has lost half of its speed, as only water takes it."""
    x = event.evidence
    if event.detector != SPIN_DOWN.name or event.wheel not in rolling or _is_braking(event):
        return False
    return bool(
        x.get("slip_min", 0.0) <= STOPPED and x.get("v_x", 0.0) >= V_STOPPED and x.get("a_w_delta_min", 0.0) >= DEAD
    )


def _episode(
    group: Sequence[_Numbered], way: Stretch, span: tuple[float, float], rolling: Collection[str] = ()
) -> Episode:
    events = [e for _, e in sorted(group, key=lambda x: (x[1].start_s, x[0]))]
    joint = [e for e in events if e.detector in _JOINT]
    metres, seconds = way(*span)
    wheels = _wheels(events)
    decided = [d for e in joint for d in e.evidence.get("decided_by", ())]
    decided = decided or [e.detector for e in events if _is_afloat(e, rolling)] or [e.detector for e in events]
    return Episode(
        _kind(events, rolling), *span, wheels, _shared(wheels, AXLES), _shared(wheels, SIDES),
        "full" if any(e.severity == "full" for e in joint or events) else "partial",
        metres / seconds if seconds > 0.0 else math.nan, tuple(dict.fromkeys(decided)),
        max(_known(events, "delta_a_x_max"), default=math.nan), min(_known(events, "slip_min"), default=math.nan),
        # a drop of the slip slope has amounts of slip there, without their sign
        max(_known((e for e in events if e.detector in _WHEELS), "slip_max"), default=math.nan),
        metres if seconds > 0.0 else math.nan, tuple(sorted(i for i, _ in group)),
        next(iter(_known((e for e in events if e.wheel and e.severity == "full"), "v_x")), math.nan),
    )  # fmt: skip


def _wheels(events: Sequence[Event]) -> tuple[str, ...]:
    """Wheels that a detector of wheels names, the one with the most slip first; else any that an event names."""
    depth: dict[str, float] = {}
    for event in events:
        if event.wheel is None or event.detector not in _WHEELS:
            continue
        slips = [abs(x) for x in (*_known([event], "slip_min"), *_known([event], "slip_max"))]
        depth[event.wheel] = max(depth.get(event.wheel, 0.0), *slips, 0.0)
    found = depth or dict.fromkeys((e.wheel for e in events if e.wheel is not None), 0.0)
    return tuple(sorted(found, key=lambda w: (-found[w], WHEELS.index(w))))


def _shared(wheels: Sequence[str], places: Any) -> str | None:
    """The axle or side that has all of the wheels."""
    return next((p for p, own in places.items() if wheels and set(wheels) <= set(own)), None)


def _known(events: Iterable[Event], name: str) -> list[float]:
    """Values of the evidence that are numbers."""
    values = (e.evidence.get(name) for e in events)
    return [float(x) for x in values if isinstance(x, float | int) and math.isfinite(x)]
