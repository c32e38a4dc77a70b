"""Labels of a drive: which effect, when, and at which wheel."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from aqualog.detect.registry import all_of

__all__ = [
    "AQUAPLANING", "EFFECTS", "SURFACES", "WATER_AFTER_S", "Label", "Labels", "Span", "after", "joined", "overlaps",
    "until", "without",
]  # fmt: skip

Span = tuple[float, float]
"""Start and end. [s]"""

AQUAPLANING = ("full", "partial", "water")
EFFECTS = tuple(d.name for d in all_of("effect"))
SURFACES = (
    "dry", "damp", "snow", "ice", "gravel", "rough", "split", "braking", "abs", "kerb", "pothole", "cornering",
    "gear_shift",
)  # fmt: skip

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
