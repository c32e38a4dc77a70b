"""The verdict on a drive: aquaplaning, none, or that it cannot be judged."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from aqualog.core.errors import listed
from aqualog.core.judgement import Judgement
from aqualog.core.records import BoolArray, Event, FloatArray, Unavailable
from aqualog.detect.episodes import Stretch, episodes_of
from aqualog.detect.margin.watch import MARGIN
from aqualog.detect.registry import all_of
from aqualog.detect.spin import SPIN_DOWN

__all__ = ["JOINT", "NEVER_TOGETHER", "UNFIT", "Unjudged", "judge"]

JOINT = tuple(d.name for d in all_of("joint"))
SHORTEST_S = 1.0  # [s] of dry road are no verdict: at 80 km/h a car is not across a lane then
NEVER_TOGETHER = f"{SHORTEST_S:g} s in which all signals of the joint detectors have a value"
UNFIT = "wheel torque that fits mass and acceleration"

_INPUTS = ("omega_", "torque_", "a_x")  # of the joint detectors: beginnings of their names
_SHORTEST_GAP_S = 0.1  # [s], the last digit of the judged time
_NAMED = 3


class _Gap(NamedTuple):
    first: int
    rows: int
    names: tuple[str, ...]


class Unjudged:
    """Find, piece by piece, where the joint detectors do not judge because the log lacks values. `dt` [s]."""

    def __init__(self, dt: float) -> None:
        self._dt = dt
        self._row = self._first = 0
        self._open = False
        self._missing: Counter[str] = Counter()
        self._gaps: list[_Gap] = []

    def push(self, columns: Mapping[str, FloatArray], is_judged: BoolArray) -> None:
        """Take the signals of a piece, and where at least one joint detector judges; arrays (n,)."""
        inputs = {n: np.isnan(x) for n, x in columns.items() if n.startswith(_INPUTS)}
        edges = np.flatnonzero(np.diff(is_judged)) + 1
        for begin, end in zip((0, *edges), (*edges, is_judged.size), strict=True):
            if is_judged[begin]:
                self._close(self._row + int(begin))
                continue
            if not self._open:
                self._open, self._first = True, self._row + int(begin)
            self._missing.update({n: int(x[begin:end].sum()) for n, x in inputs.items()})
        self._row += is_judged.size

    def _close(self, end: int) -> None:
        if not self._open:
            return
        rows = end - self._first
        names = tuple(n for n, count in self._missing.items() if 2 * count >= rows)
        if names and rows * self._dt >= _SHORTEST_GAP_S:
            self._gaps.append(_Gap(self._first, rows, names))
        self._open, self._missing = False, Counter()

    def note(self) -> str:
        """Return the sentence on the longest gaps, in order of time; empty without one. No piece may follow."""
        self._close(self._row)
        if not self._gaps:
            return ""
        longest = sorted(sorted(self._gaps, key=lambda g: -g.rows)[:_NAMED])
        told = ", ".join(
            f"{g.first * self._dt:.1f}–{(g.first + g.rows) * self._dt:.1f} s (no value of {listed(g.names, 4)})"
            for g in longest
        )
        more = f" and {len(self._gaps) - _NAMED} times more" if len(self._gaps) > _NAMED else ""
        return f"not judged for {sum(g.rows for g in self._gaps) * self._dt:.1f} s: {told}{more}"


def judge(
    events: Sequence[Event], unavailable: Sequence[Unavailable], ran: Collection[str], *, judged_s: float, way: Stretch,
    is_possible: bool = True, rolling: Collection[str] = (),
) -> Judgement:  # fmt: skip
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
    is_possible : bool
        Whether the resistance measure is one that water can make.
    rolling : collection of str
        Wheels that no engine drives and whose brakes are known.

    A single detector does not decide: without a joint one the verdict is `cannot_be_judged`, whatever the others found.
    But a free wheel that loses half of its speed needs no second sign. "None" needs front wheels that were watched:
    without spin-downs a joint detector has no sign of a wheel that floats.
    """
    alone = rolling if not any(d in ran for d in JOINT) else ()
    found = episodes_of(events, way, warns=MARGIN.name in ran, rolling=alone)
    if not is_possible:
        return Judgement("cannot_be_judged", (UNFIT,), tuple(ran), found, judged_s)
    wet = any(e.kind == "aquaplaning" for e in found)
    unwatched = [m for u in unavailable if u.detector == SPIN_DOWN.name for m in u.missing]
    if wet or (any(d in ran for d in JOINT) and judged_s >= SHORTEST_S and not unwatched):
        return Judgement("aquaplaning" if wet else "none", (), tuple(ran), found, judged_s)
    lacks = [m for u in unavailable if u.detector in JOINT for m in u.missing] or unwatched
    return Judgement("cannot_be_judged", tuple(dict.fromkeys(lacks or [NEVER_TOGETHER])), tuple(ran), found, judged_s)
