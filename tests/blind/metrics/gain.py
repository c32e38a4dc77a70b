"""What a model predicts better on a drive that was not diagnosed, beside what the truth predicts better there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model, Term
from tests.blind.metrics.engine import residual
from tests.blind.metrics.forecast import Log, white
from tests.blind.metrics.rows import Fact

__all__ = ["log_score", "true_model", "worse"]


def true_model(facts: Sequence[Fact]) -> Model | None:
    """The truth as a model of the library, at its true values; None if the library cannot hold it."""
    terms = []
    for f in facts:
        if f.effect not in EFFECTS:
            return None
        effect = EFFECTS[f.effect]
        known = {p.name for p in effect.parameters}
        try:
            terms.append(Term(effect, {k: v for k, v in f.values.items() if k in known}, _place(f)))
        except ConfigError:
            return None
    return Model(tuple(terms))


def _place(fact: Fact) -> str | None:
    places = EFFECTS[fact.effect].places
    return fact.where if fact.where in places else None


def log_score(log: Log, model: Model | None) -> float:
    """Log likelihood won over the vehicle file alone, in nats; `None`: by the hidden trace itself."""
    rest = log.residual - log.trace if model is None else residual(log.drive, model)
    before, after = white(log, log.residual), white(log, rest)
    return 0.5 * float(before @ before - after @ after)


def worse(log: Log, model: Model) -> float:
    """Relative change of the error of that channel which the model predicts worst."""
    good = log.drive.mask
    before = np.sqrt(np.nanmean(log.residual[:, good] ** 2, axis=1))
    after = np.sqrt(np.nanmean(residual(log.drive, model)[:, good] ** 2, axis=1))
    return float(np.max(after / np.maximum(before, 1e-12) - 1.0))
