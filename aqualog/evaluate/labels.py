"""Labels of a drive: which effect, when, and at which wheel; given, or from the simulated truth."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.detect.registry import all_of

__all__ = [
    "AQUAPLANING", "CONTACT_FULL", "CONTACT_PARTIAL", "EFFECTS", "SURFACES", "TRUTH_STEMS", "WATER_AFTER_S", "Label",
    "Labels", "Span", "after", "disputed", "joined", "overlaps", "spans_of", "truth_labels", "until", "without",
]  # fmt: skip

Span = tuple[float, float]
"""Start and end. [s]"""

AQUAPLANING = ("full", "partial", "water")
EFFECTS = tuple(d.name for d in all_of("effect"))
SURFACES = (
    "dry", "damp", "snow", "ice", "gravel", "rough", "split", "braking", "abs", "kerb", "pothole", "cornering",
    "gear_shift",
)  # fmt: skip

LANE_SLACK_S = 0.3  # [s] by which a light barrier and a road sensor may differ: wheels settle for as long
CAR_GAP_S = 1.0  # [s] episodes of the car that are nearer than this are one
WATER_AFTER_S = 1.0  # [s] what water has set off may still come to light this long after it


@dataclass(frozen=True, slots=True)
class Label:
    """One stretch of a drive.

    `effect` is one of `AQUAPLANING`, one of `EFFECTS` (the effects of single detectors), or anything else: a surface or
    a situation, which only enters the confusion table. `wheel` is None for labels of the whole car.
    """

    start_s: float
    end_s: float
    effect: str
    wheel: str | None = None


@dataclass(frozen=True, slots=True)
class Labels:
    """All labels of one drive.

    `knows` names the effects of `AQUAPLANING` whose absence is known: truth and a labels file know all three, a lane's
    times or the signal `on_water` only water. `source` says where the labels come from.
    """

    items: tuple[Label, ...]
    knows: frozenset[str]
    source: str

    def of(self, effect: str, wheel: str | None = None) -> list[Span]:
        """Return stretches of an effect: of one wheel, or of the car (union over wheels, gaps below 1 s closed)."""
        spans = [(x.start_s, x.end_s) for x in self.items if x.effect == effect and wheel in (None, x.wheel)]
        return joined(spans, CAR_GAP_S if wheel is None and effect in ("full", "partial") else 0.0)

    def names_wheels(self, effect: str) -> bool:
        """Return whether the labels name the wheel of an effect."""
        return any(x.effect == effect and x.wheel is not None for x in self.items)

    @property
    def afloat(self) -> list[Span]:
        """Return partial or full aquaplaning of any wheel, to distinguish it from mere water."""
        return joined([*self.of("partial"), *self.of("full")], 0.0)

    @property
    def water(self) -> list[Span]:
        """Return water under any wheel; aquaplaning and its effects count as water even without a label of water."""
        found = [(x.start_s, x.end_s) for x in self.items if x.effect in (*AQUAPLANING, *EFFECTS)]
        return joined(found, 0.0)

    @property
    def water_widened(self) -> list[Span]:
        """Return water and the second after it: only an event that begins outside of this is a false alarm."""
        return joined([(a, b + WATER_AFTER_S) for a, b in self.water], 0.0)

    @property
    def others(self) -> tuple[str, ...]:
        """Return effects beside aquaplaning that the labels name, in order of appearance."""
        return tuple(dict.fromkeys(x.effect for x in self.items if x.effect not in AQUAPLANING))

    @property
    def unknown(self) -> tuple[str, ...]:
        """Return effects that are neither aquaplaning, nor a detector's, nor a surface that aqualog knows by name."""
        return tuple(e for e in self.others if e not in (*EFFECTS, *SURFACES))


def after(items: Iterable[Label], end_s: float) -> tuple[Label, ...]:
    """Return labels that begin after the end of the drive: they belong to another drive, or to another clock."""
    return tuple(x for x in items if x.start_s >= end_s)


def until(items: Iterable[Label], end_s: float) -> tuple[Label, ...]:
    """Return labels of a drive of `end_s` [s]: cut where it ends, without those that begin later."""
    return tuple(replace(x, end_s=min(x.end_s, end_s)) for x in items if x.start_s < end_s)


def joined(spans: Iterable[Span], gap: float) -> list[Span]:
    """Unite stretches; those whose gap is below `gap` [s], or that touch, become one. Sorted."""
    out: list[Span] = []
    for start, end in sorted(spans):
        if out and (start <= out[-1][1] or start - out[-1][1] < gap - 1e-9):
            out[-1] = (out[-1][0], max(out[-1][1], end))
        else:
            out.append((start, end))
    return out


def disputed(lane: Span, wet: Sequence[Span], *, is_dry: bool = False) -> tuple[str, bool]:
    """Return how the lane of a campaign differs from the water in its log, and whether they share less than a half.

    Parameters
    ----------
    lane : (float, float)
        [s] `is_dry`: by the campaign it is dry.
    wet : sequence of (float, float)
        Water in the log, without that of other lanes; sorted and disjoint. [s]

    What is shared is time in both over time in either, of the water that touches the lane. Ends that differ by less
    than `LANE_SLACK_S` are the same.
    """
    near = [s for s in wet if overlaps(s, [lane])] or list(wet)
    first, last = (near[0][0], near[-1][1]) if near else lane
    inside = sum(max(min(b, lane[1]) - max(a, lane[0]), 0.0) for a, b in near)
    apart = inside if is_dry else max(abs(first - lane[0]), abs(last - lane[1]))
    if apart <= LANE_SLACK_S:
        return "", False
    either = sum(b - a for a, b in near) + lane[1] - lane[0] - inside
    shared = 1.0 - inside / (lane[1] - lane[0]) if is_dry else inside / either
    what = f"the campaign has {'dry road' if is_dry else 'water'} from {lane[0]:.2f} to {lane[1]:.2f} s"
    return f"{what}, the log has water from {first:.2f} to {last:.2f} s", shared < 0.5


def without(spans: Sequence[Span], holes: Sequence[Span]) -> list[Span]:
    """Subtract the holes from the stretches. Both sorted and disjoint."""
    out: list[Span] = []
    for start, end in spans:
        for a, b in holes:
            if b <= start or a >= end:
                continue
            if a > start:
                out.append((start, a))
            start = b
            if start >= end:
                break
        if start < end:
            out.append((start, end))
    return out


def overlaps(span: Span, others: Iterable[Span]) -> bool:
    """Return whether a stretch shares time with any of the others."""
    return any(span[0] < b and a < span[1] for a, b in others)


TRUTH_STEMS = ("true_contact", "true_film")
CONTACT_FULL = 0.05  # [-] share of the contact length that is left
CONTACT_PARTIAL = 0.7
FULL_S, FULL_GAP_S = 0.1, 0.3  # [s] least length; gaps below are closed
PARTIAL_S = 1.0  # [s] least length without a break
V_MIN = 5.0  # [m/s] below, no tyre floats


def truth_labels(t: FloatArray, columns: Mapping[str, FloatArray]) -> Labels | None:
    """Return labels of a simulated drive.

    Parameters
    ----------
    t : array (n,)
        Increasing. [s]
    columns : mapping name -> array (n,)
        `true_contact_fl` ... [-]; `true_film_fl` ... [m] and `on_water` as far as they are there; `true_v_x` or `v_x`
        [m/s]. NaN is no aquaplaning.

    Returns
    -------
    Labels, or None
        None without the contact of any wheel. `full` on a wheel: contact below 0.05 for 0.1 s, gaps below 0.3 s closed;
        `partial`: below 0.7 without a break for 1 s; both faster than 5 m/s. `water`: a film before any wheel, or
        `on_water`.
    """
    wheels = [w for w in WHEELS if f"true_contact_{w}" in columns]
    if not wheels:
        return None
    items: list[Label] = []
    v_x = columns.get("true_v_x", columns.get("v_x"))
    with np.errstate(invalid="ignore"):
        is_fast = np.ones(t.size, dtype=bool) if v_x is None else v_x > V_MIN
        for w in wheels:
            contact = columns[f"true_contact_{w}"]
            full = [s for s in spans_of(t, (contact < CONTACT_FULL) & is_fast) if s[1] - s[0] >= FULL_S - 1e-9]
            items += [Label(a, b, "full", w) for a, b in joined(full, FULL_GAP_S)]
            partial = spans_of(t, (contact < CONTACT_PARTIAL) & is_fast)
            items += [Label(a, b, "partial", w) for a, b in partial if b - a >= PARTIAL_S - 1e-9]
        wet = np.zeros(t.size, dtype=bool)
        for w in WHEELS:
            if f"true_film_{w}" in columns:
                wet |= columns[f"true_film_{w}"] > 0.0
        if "on_water" in columns:
            wet |= columns["on_water"] > 0.5
    items += [Label(a, b, "water") for a, b in spans_of(t, wet)]
    return Labels(tuple(items), frozenset(AQUAPLANING), "simulated truth")


def spans_of(t: FloatArray, bits: BoolArray) -> list[Span]:
    """Return stretches in which a bit is set; a sample lasts until the next one, the last as long as the one before."""
    if t.size == 0:
        return []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], bits, [False]]).astype(np.int8)))
    ends = np.append(t, 2.0 * t[-1] - t[-2] if t.size > 1 else t[-1])
    return [(float(t[a]), float(ends[b])) for a, b in zip(edges[::2], edges[1::2], strict=True)]
