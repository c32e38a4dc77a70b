"""Effects that a campaign can show, and the change of its runs by each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.campaign.passes import Passes, expected_values
from aqualog.diagnose.evidence import Evidence
from aqualog.diagnose.hypotheses import WORTH, Hypothesis, value_in, with_values
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model

__all__ = ["Library", "hypotheses", "library", "untested"]

STEP = 0.5  # standard deviations of the prior to either side, of a finite difference


class Library(NamedTuple):
    """`evidence`: hypotheses with priors and bounds; `x` (g, c, k): change of the observations by one prior standard
    deviation of each parameter, about a model whose expectation is `base` (g, c), with the road's variances `road`.
    """

    evidence: Evidence
    x: FloatArray
    base: FloatArray
    road: FloatArray


def hypotheses(passes: Passes) -> tuple[Hypothesis, ...]:
    """Hypotheses that these runs can test: stiffness of the driven axles only."""
    driven = {n[-2] for n in passes.names if n.startswith("slip_slope_")}
    searches = sorted(((e.campaign, e) for e in EFFECTS.values() if e.campaign is not None), key=lambda x: x[0].order)
    return tuple(
        Hypothesis(e, where, tuple(p.name for p in e.parameters), room=e.parameters[0].smallest / WORTH)
        for asked, e in searches for where in asked.places if not asked.driven or where in driven
    )  # fmt: skip


def untested(tested: Sequence[Hypothesis]) -> dict[str, str]:
    """Effects of the simulator that are not tested here, with the reason."""
    names = {h.effect.name for h in tested}
    reason = "acts alike on and off the water, so a campaign's wet-dry difference cancels it: diagnose single drives"
    return {name: reason for name in EFFECTS if name not in names}


def library(passes: Passes, model: Model, asked: Sequence[Hypothesis], given: Model) -> Library:
    """Change of the observations by each hypothesis about a model, from differences of the expectation.

    `given`: the model at hand, from whose values bounds count.
    """
    expected, road = expected_values(passes, model)
    columns: list[FloatArray] = []
    places, parameters = [], []
    for h in asked:
        places.append(tuple(range(len(columns), len(columns) + len(h.free))))
        for n in h.free:
            p, at = h.parameter(n), value_in(model, h, n)
            ends = [min(max(at + s * STEP * p.sigma, p.low), p.high) for s in (-1.0, 1.0)]
            low, high = (
                expected if x == at else expected_values(passes, with_values(model, [(h, {n: x})]))[0] for x in ends
            )
            columns.append((high - low) * (p.sigma / (ends[1] - ends[0])))
            parameters.append((p, value_in(given, h, n)))
    sigma, low, high = (
        np.array(x) for x in zip(*((p.sigma, p.low - now, p.high - now) for p, now in parameters), strict=True)
    )
    none = np.zeros(sigma.size)
    evidence = Evidence(
        (), tuple(asked), (), (), tuple(places), sigma, low, high, np.array([p.smallest for p, _ in parameters]),
        none, np.zeros(len(asked), dtype=bool), none, tuple("" for _ in sigma), none,
    )  # fmt: skip
    # variance of a run's mean relative to one point of its lane: correlation length over distance
    of_mean = np.zeros((len(passes.told), 1))
    for r, told in enumerate(passes.told):
        if told.wet is not None:
            way = float(np.mean(told.wet.v)) * float(passes.seconds[r])
            of_mean[r] = min(2.0 * told.scenario.tyre_front.scatter_length / max(way, 1.0), 1.0)
    return Library(evidence, np.nan_to_num(np.stack(columns, axis=-1)), expected, road * of_mean)
