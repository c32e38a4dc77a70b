"""What a model predicts better on a drive that was not diagnosed, beside what the truth predicts better there."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model, Term
from tests.blind.metrics.engine import residual
from tests.blind.metrics.forecast import Log, white
from tests.blind.metrics.rows import Fact

__all__ = ["function_error", "log_score", "true_model", "worse"]


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


def function_error(log: Log, channel: str, x: np.ndarray, names: Sequence[str], f: np.ndarray) -> float:
    """Error of a found function (k,) at points (k, d), relative to the rms of the true trace's mean near each point.

    A constant offset is no error: the function's zero is a matter of the constant that goes with it. NaN where fewer than
    three points have enough of the drive near them.
    """
    if channel not in log.drive.channels or any(n not in log.drive.coordinates for n in names):
        return math.nan
    truth = log.trace[log.drive.channels.index(channel)]
    z = np.column_stack([log.drive.coordinates[n][: truth.size] for n in names])
    good = log.drive.mask & np.isfinite(z).all(axis=1) & np.isfinite(truth)
    x = np.asarray(x, dtype=float).reshape(len(f), -1)
    spread = np.maximum(z[good].std(axis=0), 1e-12)
    nearest = np.array([np.argmin(np.sum(((x - p) / spread) ** 2, axis=1)) for p in z[good][::3]])
    values = truth[good][::3]
    count = np.bincount(nearest, minlength=len(f))
    mean = np.bincount(nearest, weights=values, minlength=len(f)) / np.maximum(count, 1)
    used = (count >= 10) & np.isfinite(f)
    if used.sum() < 3:
        return math.nan
    w = count[used] / count[used].sum()
    true, found = mean[used] - w @ mean[used], f[used] - w @ f[used]
    return float(np.sqrt(w @ (found - true) ** 2) / max(np.sqrt(w @ true**2), 1e-12))
