"""Several drives of the same car: does each say the same, and is it predicted by what the others say?

An effect that only one drive has is no property of the car: an open window, a head wind, a loaded boot.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aqualog.diagnose.bench import Bench
from aqualog.diagnose.noise import Noise, bridged, spectra, whitened
from aqualog.diagnose.outcome import Z
from aqualog.diagnose.records import AGREES, Agreement, ByDrive, Cause, Estimate
from aqualog.diagnose.refit import KNOWN, Refit, metric, whitened_residual
from aqualog.diagnose.search import Candidate
from aqualog.diagnose.subsets import PRIOR_WIDTH
from aqualog.diagnose.words import cause_sentence
from aqualog.intervals import chi2_log_p
from aqualog.model.effects import EFFECTS
from aqualog.types import FloatArray

__all__ = ["agreements", "widened"]


def agreements(bench: Bench, candidate: Candidate, noises: Sequence[Noise], base: FloatArray) -> tuple[Agreement, ...]:
    """One for each value of the refitted set; none for a single drive.

    Parameters
    ----------
    bench : Bench
    candidate : Candidate
        Its signatures at its values are those of every drive.
    noises : sequence of Noise
        One a drive.
    base : array (k,)
        Values without the effects.

    By the tangent at the set's values: no drive is simulated again. Tolerances count for each drive by itself, as if
    the file were off by something else in each.
    """
    r = candidate.refit
    if len(bench.drives) < 2:
        return ()
    G, b = _normal(bench, r, noises)
    G, b = G / candidate.inflation, b / candidate.inflation
    keep = np.diag((PRIOR_WIDTH * _prior(bench, r)) ** -2.0)
    joint = np.linalg.solve(G.sum(axis=0) + keep, b.sum(axis=0))
    alone = np.array([np.linalg.solve(g + keep, x) for g, x in zip(G, b, strict=True)])
    sd = np.array([np.sqrt(np.diag(np.linalg.inv(g + keep))) for g in G])
    others = np.array([np.linalg.solve(G.sum(axis=0) - g + keep, b.sum(axis=0) - x) for g, x in zip(G, b, strict=True)])
    without = base - r.values
    gains = [
        0.5 * (_loss(g, x, without) - _loss(g, x, o)) for g, x, o in zip(G, b, others, strict=True)
    ]  # fmt: skip
    out = []
    for k, (i, name) in enumerate(r.names):
        unit = r.members[i].parameter(name).unit
        q = float((((alone[:, k] - joint[k]) / sd[:, k]) ** 2).sum())
        p = 10.0 ** -chi2_log_p(q, len(bench.drives) - 1)
        values = r.values[k] + alone[:, k]
        half = Z * sd[:, k]
        of_drives = tuple(
            ByDrive(d.name, Estimate(float(v), float(v - h), float(v + h), unit), float(r.values[k] + o), float(gain))
            for d, v, h, o, gain in zip(bench.drives, values, half, others[:, k], gains, strict=True)
        )
        out.append(Agreement(r.members[i].key, name, of_drives, p))
    return tuple(out)


def widened(cause: Cause, found: Sequence[Agreement]) -> Cause:
    """The cause with intervals as wide as the drives differ, where they do (Birge's ratio, K)."""
    parameters = dict(cause.parameters)
    for a in found:
        if a.key != cause.key or a.p_value >= AGREES or a.parameter not in parameters:
            continue
        e = parameters[a.parameter]
        spread = np.std([d.alone.value for d in a.drives], ddof=1) / math.sqrt(len(a.drives))
        half = max(0.5 * (e.high - e.low), Z * float(spread))
        parameters[a.parameter] = replace(e, low=e.value - half, high=e.value + half)
    if parameters == dict(cause.parameters):
        return cause
    sentence = cause_sentence(cause.effect, cause.where, EFFECTS[cause.effect].sentence, parameters)
    return replace(cause, parameters=parameters, sentence=sentence)


def _normal(bench: Bench, r: Refit, noises: Sequence[Noise]) -> tuple[FloatArray, FloatArray]:
    """Normal equations of each drive around the set's values: (D, k, k), (D, k)."""
    columns = [c for h in r.members for c in bench.columns[bench.asked.index(h)]]
    G, b = [], []
    for d, noise, residual, own, s, p in zip(
        bench.drives, noises, r.residuals, r.signatures, bench.signatures, bench.prepared, strict=True
    ):
        one = replace(bench, drives=(d,), residuals=(residual,), signatures=(s,), prepared=(p,))
        measure = metric(one, [noise], share=KNOWN, beside=columns)
        J = whitened(spectra(bridged(own, d.mask)), noise)
        y = whitened_residual(one, [noise], [residual])
        G.append(measure.inner(J, J))
        b.append(measure.inner(J, y[None])[:, 0])
    return np.array(G), np.array(b)


def _prior(bench: Bench, r: Refit) -> FloatArray:
    return np.array([r.members[i].parameter(n).sigma for i, n in r.names])


def _loss(G: FloatArray, b: FloatArray, delta: FloatArray) -> float:
    """Sum of squares but for a constant, at values that are `delta` off the set's."""
    return float(delta @ G @ delta - 2.0 * b @ delta)
