"""Several drives of the same car: do they agree on a value, and does the value of the others predict each drive?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aqualog.core.intervals import Z95, chi2_log_p
from aqualog.core.records import FloatArray
from aqualog.diagnose.records import AGREES, Agreement, ByDrive, Cause, Estimate
from aqualog.diagnose.refit import KNOWN, PRIOR_WIDTH, Refit, metric
from aqualog.diagnose.search import Found
from aqualog.diagnose.words import cause_sentence
from aqualog.model.effects import EFFECTS

__all__ = ["agreements", "contradicted", "widened"]


def agreements(found: Found, r: Refit) -> tuple[Agreement, ...]:
    """One agreement for each value of the refitted set, by the linear model there; empty for a single drive. Tolerances
    count for each drive, as if the file had a different error in each."""
    evidence = found.arena.evidence
    drives = [evidence.drives[p.drive] for p in found.arena.parts]
    if len(drives) < 2:
        return ()
    columns = [c for h in r.members for c in evidence.columns[evidence.asked.index(h)]]
    G, b, apart = _normal(found, r, columns)
    keep = np.diag([(PRIOR_WIDTH * h.parameter(n).sigma) ** -2.0 for h, n in r.names])
    alone = np.array([np.linalg.solve(g + keep, x) for g, x in zip(G, b, strict=True)])
    # the car's drive-to-drive spread is added to the variance of a single drive's value
    sd = np.array([np.sqrt(np.diag(np.linalg.inv(g + keep)) + apart**2) for g in G])
    others = np.array([np.linalg.solve(G.sum(axis=0) - g + keep, b.sum(axis=0) - x) for g, x in zip(G, b, strict=True)])
    bare = np.where([bool(h.drive) for h, _ in r.names], 0.0, -r.off)  # no gain of what one drive alone has
    gains = [0.5 * (_loss(g, x, bare) - _loss(g, x, o)) for g, x, o in zip(G, b, others, strict=True)]
    out = []
    for k, (h, name) in enumerate(r.names):
        if h.drive:
            continue  # nothing to agree on
        around = zip((r.values[k] + alone[:, k]).tolist(), (Z95 * sd[:, k]).tolist(), strict=True)
        each = [Estimate(v, v - half, v + half, h.parameter(name).unit) for v, half in around]
        p = 10.0 ** -chi2_log_p(_heterogeneity(each), len(drives) - 1)
        of_drives = tuple(
            ByDrive(d.name, e, float(r.values[k] + o), float(gain))
            for d, e, o, gain in zip(drives, each, others[:, k], gains, strict=True)
        )
        out.append(Agreement(h.key, name, of_drives, p))
    return tuple(out)


def widened(cause: Cause, found: Sequence[Agreement]) -> Cause:
    """The cause with intervals widened by Birge's ratio (K) where the drives differ more than their errors allow."""
    parameters = dict(cause.parameters)
    bounds = {p.name: (p.low, p.high) for p in EFFECTS[cause.effect].parameters}
    for a in found:
        if cause.drives or a.key != cause.key or a.p_value >= AGREES or a.parameter not in parameters:
            continue
        low, high = bounds[a.parameter]
        e = parameters[a.parameter]
        ratio = math.sqrt(max(_heterogeneity([d.alone for d in a.drives]) / (len(a.drives) - 1), 1.0))
        half = 0.5 * (e.high - e.low) * ratio
        parameters[a.parameter] = replace(e, low=max(e.value - half, low), high=min(e.value + half, high))
    if parameters == dict(cause.parameters):
        return cause
    sentence = cause_sentence(EFFECTS[cause.effect], cause.where, parameters)
    return replace(cause, parameters=parameters, sentence=sentence)


def contradicted(causes: Sequence[Cause], found: Sequence[Agreement]) -> bool:
    """Whether a cause is in some drives and not in others: they differ, and its interval holds no effect."""
    differ = {a.key for a in found if a.p_value < AGREES}
    neutral = {(c.effect, p.name): p.neutral for c in causes for p in EFFECTS[c.effect].parameters}
    return any(
        c.key in differ
        and not c.drives
        and all(e.low <= neutral.get((c.effect, n), math.nan) <= e.high for n, e in c.parameters.items())
        for c in causes
    )


def _heterogeneity(each: Sequence[Estimate]) -> float:
    """Sum of squared deviations from the weighted mean in standard deviations: chi^2 of one degree less than values."""
    values = np.array([e.value for e in each])
    weight = np.array([(2.0 * Z95 / (e.high - e.low)) ** 2 for e in each])
    return float((weight * (values - float(weight @ values) / float(weight.sum())) ** 2).sum())


def _normal(found: Found, r: Refit, columns: Sequence[int]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Normal equations of each drive around the set's values (D, k, k), (D, k), and the spread between drives (k,)."""
    G, b = [], []
    for i, (p, w) in enumerate(zip(found.arena.parts, found.posterior.weighings, strict=True)):
        own = replace(found.arena, parts=(p,), rows=found.arena.rows[i : i + 1])
        measure = metric(own, [w], share=KNOWN, beside=columns)
        J, y = measure.rows(r.signatures), measure.rows([x[None] for x in r.residuals])
        G.append(measure.inner(J, J))
        b.append(measure.inner(J, y)[:, 0])
    return np.array(G), np.array(b), measure.apart[list(columns)]


def _loss(G: FloatArray, b: FloatArray, delta: FloatArray) -> float:
    """Sum of squares without its constant, at values that differ by `delta` from the set's."""
    return float(delta @ G @ delta - 2.0 * b @ delta)
