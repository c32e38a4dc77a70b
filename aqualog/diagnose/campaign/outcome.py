"""From a campaign's sets with evidence to a verdict: named causes with probabilities, causes that look alike."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aqualog.diagnose.campaign.compete import Found, Option
from aqualog.diagnose.campaign.gain import gain
from aqualog.diagnose.campaign.passes import Passes
from aqualog.diagnose.campaign.refit import Refit, estimates
from aqualog.diagnose.competition import COARSE
from aqualog.diagnose.hypotheses import value_in
from aqualog.diagnose.records import Cause, Estimate
from aqualog.diagnose.verdict import PLACES, Candidate, Outcome, candidates, decided, whole
from aqualog.model.term import Effect, Model

__all__ = ["cause_sentence", "conclude"]

SHARE = 0.1  # of the largest change of a channel, in its scatter, that a cause needs in order to explain it
_PLACES = {
    None: "all wheels", "f": "the front wheels", "r": "the rear wheels", "left": "the left track",
    "right": "the right track",
}  # fmt: skip


def conclude(found: Found, passes: Passes, given: Model, *, seed: int) -> Outcome[Option]:
    """The verdict on what a competition found.

    An unknown form comes before any name. A name needs a gain on runs that were not fitted.
    """
    if found.forms:
        return Outcome("unexplained")

    def failing(best: Candidate[Option]) -> tuple[str, ...]:
        won = gain(passes, best.option.refit, found.nothing, found.scatter, seed=seed)
        return () if won is None or won.low > 0.0 else ("it does not improve the prediction of runs left out.",)

    sets = candidates(
        [(o, COARSE * o.evidence) for o in found.options], lambda o: _causes(found, o.refit, passes, given)
    )  # fmt: skip
    return decided(sets, _at_place, failing)


def _at_place(group: Sequence[Candidate[Option]]) -> Candidate[Option]:
    """The set at the whole car, unless another place is clearly better."""
    return max((s for s in group if s.share * PLACES > group[0].share), key=whole)


def _causes(found: Found, chosen: Refit, passes: Passes, given: Model) -> tuple[tuple[Cause, bool], ...]:
    """The members of a set, and whether a value reaches its smallest size and its interval excludes no change."""
    all_values = iter(estimates(chosen, passes, found.scatter.weight))
    spread = np.sqrt(np.diag(found.scatter.sigma))
    out, at = [], 0
    for h in chosen.members:
        values = {n: next(all_values) for n in h.free}
        k = slice(at, at + len(h.free))
        at = k.stop
        size = np.sqrt(np.mean((chosen.x[:, :, k] @ chosen.theta[k]) ** 2, axis=0)) / spread
        wet = [(n, s) for n, s in zip(passes.names, size.tolist(), strict=True) if not n.startswith("dry_")]
        explains = tuple(n for n, s in wet if s > SHARE * size.max())
        large = any(
            abs(e.value - value_in(given, h, n)) >= max(h.parameter(n).smallest, e.high - e.value)
            for n, e in values.items()
        )
        sentence = cause_sentence(h.effect, h.where, [*values.values()])
        out.append((Cause(h.effect.name, h.where, values, explains, sentence), large))
    return tuple(out)


def cause_sentence(effect: Effect, where: str | None, values: Sequence[Estimate]) -> str:
    """An effect with its sizes and intervals."""
    asked = effect.campaign
    assert asked is not None
    k = asked.scale
    scaled = [Estimate(k * e.value, k * e.low, k * e.high, e.unit) for e in values]
    place = _PLACES.get(where, str(where))
    return asked.sentence.format(*scaled, place=place, Place=place[0].upper() + place[1:])
