"""Family-wise test for any effect: the largest gain over all hypotheses, compared with draws of noise of the same
spectrum."""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.evidence import Evidence, tolerant
from aqualog.diagnose.records import Significance

__all__ = [
    "ALIKE", "SURROGATES", "Calibration", "calibrate", "gains_of", "gumbel_p", "significance",
]  # fmt: skip

# draws of noise: on 200 made drives without effect of 40 s, the level 0.05 was passed by 0.115 with 19, 0.080 with 49
# and 0.045 with 199 (D); Gumbel's distribution of few maxima has too short a tail
SURROGATES = 499
ALIKE = 0.97  # cosine of whitened signatures from which one stands for both
EULER = 0.5772156649015329


class Calibration(NamedTuple):
    """Null distribution: largest gains over their parameters, `maxima` (S,); `tested`: hypotheses that differ from each
    other."""

    maxima: FloatArray
    threshold: float
    tested: int


def gains_of(evidence: Evidence, gram: FloatArray) -> FloatArray:
    """Twice the log-likelihood that each hypothesis gains alone, without prior, from inner products of K columns and S
    residuals. (H,) of one residual, else (H, S)"""
    out = np.zeros((len(evidence.asked), gram.shape[1] - evidence.count))
    for i, columns in enumerate(evidence.columns):
        c = list(columns)
        energy = np.diag(gram)[c]
        if evidence.asked[i].allowed or evidence.barred[i] or np.any(energy < 1e-12):
            continue
        right = gram[c, evidence.count :]
        out[i] = (right * np.linalg.solve(gram[np.ix_(c, c)], right)).sum(axis=0)
    return out[:, 0] if out.shape[1] == 1 else out


def calibrate(evidence: Evidence, plain: FloatArray, *, surrogates: int, level: float, seed: int) -> Calibration:
    """Null distribution of the largest gain, from `surrogates` draws; of none Bonferroni's bound [bonferroni1936].
    Noise alone makes the columns' inner products with whitened residuals normal, with their own as covariance: a
    surrogate [theiler1992] is one draw. `plain` (K + 1, K + 1): inner products without tolerances; `level`: share of
    logs without effect that may be reported as having one."""
    sizes, leaders = _sizes(evidence), _leaders(evidence, plain)
    # of the largest of as many gains, each of one degree of freedom, whatever their dependence
    bound = NormalDist().inv_cdf(1.0 - 0.5 * level / max(len(leaders), 1)) ** 2
    if surrogates == 0:
        return Calibration(np.zeros(0), bound, len(leaders))
    inner = plain[:-1, :-1]
    # columns of very different units: in one scale, or rounding alone would give the small ones their gains
    scale = np.sqrt(np.diag(inner)) + 1e-30
    values, vectors = np.linalg.eigh(inner / np.outer(scale, scale))
    root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    rng = np.random.default_rng(seed)
    b = root @ rng.standard_normal((surrogates, len(root))).T
    drawn = gains_of(evidence, tolerant(evidence, np.concatenate([inner, b], axis=1)))
    maxima = (drawn.reshape(len(sizes), surrogates).T / sizes)[:, leaders].max(axis=1)
    # where tolerances are larger than the noise, noise alone gives almost no gain; the car's own deviations do
    mu, beta = _gumbel(maxima)
    threshold = max(mu - beta * math.log(-math.log1p(-level)), bound)
    return Calibration(maxima, threshold, len(leaders))


def significance(evidence: Evidence, gram: FloatArray, c: Calibration, level: float) -> Significance:
    """The test on inner products (K + 1, K + 1) that forgive the tolerances."""
    statistic = float((gains_of(evidence, gram) / _sizes(evidence)).max())
    # of the share of nulls whose largest of as many gains, each of one degree of freedom, is beyond this one
    bound = max(min(1.0, c.tested * math.erfc(math.sqrt(0.5 * max(statistic, 0.0)))), 1e-12)
    p = max(gumbel_p(c.maxima, statistic), bound) if c.maxima.size else bound
    achieved = float((c.maxima > c.threshold).mean()) if c.maxima.size else math.nan
    return Significance(statistic, c.threshold, p, level, achieved, c.maxima.size)


def _sizes(evidence: Evidence) -> FloatArray:
    return np.array([len(c) for c in evidence.columns], dtype=np.float64)


def gumbel_p(maxima: FloatArray, x: float) -> float:
    """Share of null maxima beyond x, by a Gumbel distribution of their mean and spread; never below theirs counted."""
    mu, beta = _gumbel(maxima)
    tail = -math.expm1(-math.exp(min(-(x - mu) / max(beta, 1e-9), 50.0)))
    return max(tail, float((maxima >= x).mean()))


def _gumbel(maxima: FloatArray) -> tuple[float, float]:
    beta = float(maxima.std(ddof=1)) * math.sqrt(6.0) / math.pi
    return float(maxima.mean()) - EULER * beta, beta


def _leaders(evidence: Evidence, gram: FloatArray) -> list[int]:
    """Hypotheses without tolerances, of those with nearly the same whitened signature the first one."""
    energy, seen, out = np.diag(gram), list[int](), []
    for i, (c, *more) in enumerate(evidence.columns):
        if not more and energy[c] > 1e-12:
            if any(abs(gram[c, o] / math.sqrt(energy[c] * energy[o])) > ALIKE for o in seen):
                continue
            seen.append(c)
        out.append(i)
    return [i for i in out if not evidence.asked[i].allowed]
