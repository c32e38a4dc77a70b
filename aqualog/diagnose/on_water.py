"""The water of a drive at the sizes that its effects most likely have, before anything competes. Near floating, slip is
proportional to one over the square of the remaining contact: a signature at the file's water is a tangent beside a
pole. So the effects of water are simulated at several sizes, and signatures are drawn around the most likely one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from aqualog.core.notation import AXLES
from aqualog.core.records import FloatArray
from aqualog.diagnose.channels import contrasts
from aqualog.diagnose.drive import rolling_under
from aqualog.diagnose.evidence import Evidence
from aqualog.diagnose.hypotheses import Hypothesis, residual, signatures, value_in, with_values
from aqualog.diagnose.noise import weighing
from aqualog.diagnose.threads import beside
from aqualog.model.term import Model, Term

__all__ = ["around_water", "of_water"]

SIZES = (-1.5, -0.75, 0.75, 1.5, 3.0)  # of the usual deviation, that are simulated of each effect
FINER = 0.375  # the best one is shifted by, to either side
CLEARLY = 1.0  # [nats (natural logarithm)] that it must be more likely than no deviation


def of_water(evidence: Evidence) -> list[int]:
    """Effects of water on the whole car or a side, in all drives."""
    whole = (h.of_water and not h.allowed and h.where not in AXLES and not h.drive for h in evidence.asked)
    return [i for i, is_whole in enumerate(whole) if is_whole]


class _Tried(NamedTuple):
    surprise: float
    hypothesis: int
    off: float
    residuals: tuple[FloatArray, ...]


def around_water(evidence: Evidence, model: Model) -> tuple[Evidence, Term | None]:
    """The evidence with signatures of water around its most likely single effect, and that; the same evidence and none
    on dry drives. The noise is estimated anew under each, since an effect that is left in the residual looks like
    noise. Residuals are those that a linear model around this point would have had at the start."""
    every = of_water(evidence)
    if not every:
        return evidence, None

    def tried(at: tuple[int, float]) -> _Tried | None:
        i, off = at
        h = evidence.asked[i]
        p = h.parameter(h.free[0])
        if not p.low <= value_in(model, h, p.name) + off <= p.high:
            return None
        moved = _moved(evidence, model, h, off)
        residuals = tuple(residual(d, moved) for d in evidence.drives)
        return _Tried(_surprise(evidence, residuals), i, off, residuals)

    def best_of(points: Sequence[tuple[int, float]]) -> _Tried:
        return min([best, *(t for t in beside(tried, points) if t is not None)], key=lambda t: t.surprise)

    start = best = _Tried(_surprise(evidence, evidence.residuals), every[0], 0.0, evidence.residuals)
    usual = {i: evidence.prior[evidence.columns[i][0]] for i in every}
    best = best_of([(i, float(k * usual[i])) for i in every for k in SIZES])
    if best.surprise > start.surprise - CLEARLY:
        return evidence, None
    i = best.hypothesis
    best = best_of([(i, best.off + float(k * usual[i])) for k in (-FINER, FINER)])
    h = evidence.asked[i]
    name, first = h.free[0], evidence.columns[i][0]
    moved = _moved(evidence, model, h, best.off)
    wet = [i for i, o in enumerate(evidence.asked) if o.of_water]
    columns = [c for i in wet for c in evidence.columns[i]]
    all_signatures, residuals = [], []
    for d, s, r in zip(evidence.drives, evidence.signatures, best.residuals, strict=True):
        changed = s.copy()
        changed[columns] = np.concatenate(signatures(d, moved, [evidence.asked[i] for i in wet], base=r))
        all_signatures.append(changed)
        residuals.append(r + best.off * changed[first])
    drives = tuple(rolling_under(d, moved) for d in evidence.drives)
    around = replace(evidence, drives=drives, signatures=tuple(all_signatures), residuals=tuple(residuals))
    return around, Term(h.effect, {name: value_in(model, h, name) + best.off}, h.where)


def _moved(evidence: Evidence, model: Model, h: Hypothesis, off: float) -> Model:
    """The model with the first parameter of an effect changed, axle by axle where it is asked at axles: a gain of the
    whole car would multiply theirs."""
    axles = [o for o in evidence.asked if h.where is None and o.effect is h.effect and o.where in AXLES]
    values = {n: value_in(model, h, n) for n in h.free}
    values[h.free[0]] += off
    return with_values(model, [(o, values) for o in axles or [h]])


def _surprise(evidence: Evidence, residuals: Sequence[FloatArray]) -> float:
    return sum(
        weighing([r], d.mask, contrasts(d.channels)).surprise(r)
        for r, d in zip(residuals, evidence.drives, strict=True)
    )
