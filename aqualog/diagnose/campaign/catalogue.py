"""Effects that a campaign can show, as terms of the simulator, and the change of its runs by each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.campaign.passes import Passes, expected_values
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Effect, Model, Parameter, Term

__all__ = ["Hypothesis", "Library", "hypotheses", "library", "model_with", "untested"]

STEP = 0.5  # standard deviations of the prior to either side, of a finite difference


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """An effect at a place."""

    effect: Effect
    where: str | None

    @property
    def key(self) -> str:
        """`contact_loss@r`."""
        return self.effect.name if self.where is None else f"{self.effect.name}@{self.where}"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its parameters."""
        return self.effect.parameters

    def goes_with(self, other: Hypothesis) -> bool:
        """Whether both may be in one set; the whole car and one axle of the same effect would count the effect
        twice."""
        return self.effect is not other.effect or (self.where is not None and other.where is not None)


class Library(NamedTuple):
    """Hypotheses and `x` (g, c, k): change of the observations by one prior standard deviation of each parameter.

    `columns` lists which of the k belong to each hypothesis; `base` (g, c) is the model's expectation, `road` its
    variances.
    """

    hypotheses: tuple[Hypothesis, ...]
    x: FloatArray
    columns: tuple[tuple[int, ...], ...]
    base: FloatArray
    road: FloatArray


def hypotheses(passes: Passes) -> tuple[Hypothesis, ...]:
    """Hypotheses that these runs can test: stiffness of the driven axles, load only where it differs."""
    driven = {n[-2] for n in passes.names if n.startswith("slip_slope_")}
    searches = sorted(((e.campaign, e) for e in EFFECTS.values() if e.campaign is not None), key=lambda x: x[0].order)
    return tuple(
        Hypothesis(e, where) for asked, e in searches for where in asked.places if not asked.driven or where in driven
    )


def untested(tested: Sequence[Hypothesis]) -> dict[str, str]:
    """Effects of the simulator that are not tested here, with the reason."""
    names = {h.effect.name for h in tested}
    reason = "acts alike on and off the water, so a campaign's wet-dry difference cancels it: diagnose single drives"
    return {name: reason for name in EFFECTS if name not in names}


def model_with(base: Model, chosen: Sequence[Hypothesis], values: Sequence[Mapping[str, float]]) -> Model:
    """The base model and terms of the chosen hypotheses."""
    for h, v in zip(chosen, values, strict=True):
        base = base.with_term(Term(h.effect, dict(v), h.where))
    return base


def library(passes: Passes, base: Model, tested: Sequence[Hypothesis]) -> Library:
    """Change of the observations by each effect, from differences of the model's expectation with the term in it.

    Parameters
    ----------
    passes : Passes
    base : Model
        Terms that are assumed to be right.
    tested : sequence of Hypothesis
    """
    expected, road = expected_values(passes, base)
    columns: list[FloatArray] = []
    places: list[tuple[int, ...]] = []
    for h in tested:
        first = len(columns)
        for p in h.parameters:
            ends = [min(max(p.neutral + s * STEP * p.sigma, p.low), p.high) for s in (-1.0, 1.0)]
            low, high = (
                expected if x == p.neutral else expected_values(passes, model_with(base, [h], [{p.name: x}]))[0]
                for x in ends
            )  # fmt: skip
            columns.append((high - low) * (p.sigma / (ends[1] - ends[0])))
        places.append(tuple(range(first, len(columns))))
    x = np.stack(columns, axis=-1) if columns else np.zeros((*expected.shape, 0))
    return Library(tuple(tested), np.nan_to_num(x), tuple(places), expected, road * _points_of_road(passes))


def _points_of_road(passes: Passes) -> FloatArray:
    """Variance of a run's mean relative to one point of its lane: correlation length over distance, (g, 1)."""
    out = np.zeros((len(passes.told), 1))
    for r, told in enumerate(passes.told):
        if told.wet is not None:
            way = float(np.mean(told.wet.v)) * float(passes.seconds[r])
            out[r] = min(2.0 * told.scenario.tyre_front.scatter_length / max(way, 1.0), 1.0)
    return out
