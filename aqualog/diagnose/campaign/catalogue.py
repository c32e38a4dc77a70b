"""Effects that a campaign can show, and the change of its runs by each."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.campaign.passes import Passes, expected_values
from aqualog.diagnose.evidence import Evidence
from aqualog.diagnose.hypotheses import WORTH, Hypothesis, value_in, with_values
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model

__all__ = ["evidence_of", "hypotheses", "signatures", "untested"]

STEP = 0.5  # standard deviations of the prior to either side, of a finite difference


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


def evidence_of(asked: Sequence[Hypothesis], given: Model) -> Evidence:
    """Hypotheses with priors and bounds, as for drives; bounds count from the values of the model at hand."""
    names = [(h, n) for h in asked for n in h.free]
    ends = np.cumsum([0, *(len(h.free) for h in asked)]).tolist()
    columns = tuple(tuple(range(a, b)) for a, b in pairwise(ends))
    now = np.array([value_in(given, h, n) for h, n in names])
    sigma, low, high, smallest = (
        np.array([getattr(h.parameter(n), of) for h, n in names]) for of in ("sigma", "low", "high", "smallest")
    )
    none = np.zeros(sigma.size)
    return Evidence(
        (), tuple(asked), (), (), columns, sigma, low - now, high - now, smallest, none,
        np.zeros(len(asked), dtype=bool), none, tuple("" for _ in names), none,
    )  # fmt: skip


def signatures(passes: Passes, model: Model, asked: Sequence[Hypothesis], expected: FloatArray) -> FloatArray:
    """Change (g, c, k) of the observations by one prior standard deviation of each parameter, from differences of the
    expectation about a model, whose own is `expected` (g, c)."""
    columns = []
    for h in asked:
        for n in h.free:
            p, at = h.parameter(n), value_in(model, h, n)
            ends = [min(max(at + s * STEP * p.sigma, p.low), p.high) for s in (-1.0, 1.0)]
            low, high = (
                expected if x == at else expected_values(passes, with_values(model, [(h, {n: x})]))[0] for x in ends
            )
            columns.append((high - low) * (p.sigma / (ends[1] - ends[0])))
    return np.nan_to_num(np.stack(columns, axis=-1))
