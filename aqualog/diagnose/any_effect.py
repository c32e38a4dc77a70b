"""Family-wise test for any effect: the largest gain over all hypotheses, compared with draws of noise of the same
spectrum."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.channels import contrasts
from aqualog.diagnose.evidence import Evidence, gram_of, noises_after, tolerant
from aqualog.diagnose.noise import Noise, white_noise, whitened
from aqualog.diagnose.spectrum import weighing
from aqualog.diagnose.subsets import fit_set, gains_on_top

__all__ = ["OPTIMISM", "Calibration", "bonferroni", "calibrate", "chance", "gumbel_p", "largest"]

OPTIMISM = 1.5  # [nats] a column by which noise after a fit is too likely
FEW = 2  # hypotheses after which the noise is tried
ALIKE = 0.97  # cosine of whitened signatures from which one stands for both in the draws
EULER = 0.5772156649015329
PLAIN_INFLATION = 1.3  # inflation of the gains without surrogates, as found with simulated noise (D)


class Calibration(NamedTuple):
    """Null distribution: `inflation` (H,) mean gain of each hypothesis over its parameters, `maxima` (S,).

    `achieved`: share of these maxima beyond the threshold; `tested`: hypotheses that differ from each other.
    """

    inflation: FloatArray
    maxima: FloatArray
    threshold: float
    achieved: float
    tested: int


def largest(evidence: Evidence, residuals: Sequence[FloatArray], base: Sequence[int]) -> tuple[FloatArray, FloatArray]:
    """Gains (H,) of all hypotheses beside a base set, and the whitened, tolerant inner products.

    The noise is estimated after the hypothesis that makes the measurement most likely. Candidates are the hypotheses
    that gain most with the residual's spectrum, and those that gain most with white noise. Otherwise a large effect
    would count as coloured noise and could not be found.
    """
    noises = noises_after(evidence, residuals, _theta(evidence, residuals, base))
    gram = tolerant(evidence, gram_of(evidence, noises, residuals))
    plain = tolerant(
        evidence, gram_of(evidence, [_colourless(evidence, i, r) for i, r in enumerate(residuals)], residuals)
    )
    best = (sum(n.surprise for n in noises), noises)
    for metric, most in ((gram, FEW), (plain, FEW)):
        gains = gains_on_top(evidence, metric, base)
        for top in np.argsort(-gains)[:most].tolist():
            fit = fit_set(evidence, metric, (*base, top))
            if fit is None:
                continue
            tried = noises_after(evidence, residuals, dict(zip(fit.columns, fit.theta.tolist(), strict=True)))
            surprise = sum(n.surprise for n in tried) + OPTIMISM * len(fit.columns)
            if surprise < best[0]:
                best = (surprise, tried)
    gram = tolerant(evidence, gram_of(evidence, best[1], residuals))
    return gains_on_top(evidence, gram, base), gram


def _colourless(evidence: Evidence, i: int, residual: FloatArray) -> Noise:
    """White noise of the size of a residual's steps."""
    drive = evidence.drives[i]
    return white_noise(residual, drive.mask, contrasts(drive.channels))


def _theta(evidence: Evidence, residuals: Sequence[FloatArray], base: Sequence[int]) -> dict[int, float]:
    if not base:
        return {}
    gram = tolerant(evidence, gram_of(evidence, noises_after(evidence, residuals, {}), residuals))
    fit = fit_set(evidence, gram, base)
    return {} if fit is None else dict(zip(fit.columns, fit.theta.tolist(), strict=True))


def calibrate(
    evidence: Evidence,
    quiet: Sequence[FloatArray],
    gram: FloatArray,
    *,
    base: Sequence[int],
    surrogates: int,
    level: float,
    seed: int,
) -> Calibration:
    """Null distribution of the largest gain.

    Noise alone makes the columns' inner products with the residual Gaussian. Their covariance follows from the columns
    and from the smoothed cross spectrum of what the autoregression leaves of the noise. So a surrogate [theiler1992] is
    one draw of normal numbers, as many as there are columns.

    Parameters
    ----------
    evidence : Evidence
    quiet : sequence of array (C, n)
        Residuals after the best set: their noise is that of the draws.
    gram : array (K + 1, K + 1)
        Shows which hypotheses are alike, so that one test covers them.
    base : sequence of int
        Hypotheses that are accepted already; noise is tested beside them.
    surrogates : int
        Number of draws. 0: the gains are assumed to be inflated by 1.3, and Bonferroni's bound [bonferroni1936]
        applies.
    level : float
        Share of logs without effect that may be reported as having one.
    seed : int
    """
    H = len(evidence.asked)
    sizes = np.array([len(c) for c in evidence.columns], dtype=np.float64)
    groups = _groups(evidence, gram)
    leaders = sorted({g for g in groups.tolist() if not evidence.asked[g].allowed})
    if surrogates == 0:
        return Calibration(
            np.full(H, PLAIN_INFLATION), np.zeros(0), bonferroni(level, len(leaders)), level, len(leaders)
        )
    inner, root = _noise_of(evidence, quiet)
    rng = np.random.default_rng(seed)
    drawn = np.array([_drawn(evidence, inner, root @ rng.standard_normal(len(root)), base) for _ in range(surrogates)])
    inflation = np.maximum(drawn.mean(axis=0) / sizes, 1.0)[groups]
    maxima = (drawn / inflation / sizes)[:, leaders].max(axis=1)
    # where tolerances are larger than the noise, noise alone gives almost no gain; the car's own deviations do
    threshold = max(_gumbel_quantile(maxima, level), bonferroni(level, len(leaders)))
    return Calibration(inflation, maxima, threshold, float((maxima > threshold).mean()), len(leaders))


def _noise_of(evidence: Evidence, quiet: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Inner products (K, K) of the columns, and a root (K, K) of the covariance of theirs with noise."""
    K = evidence.count
    inner, covariance = np.zeros((K, K)), np.zeros((K, K))
    for r, drive, ready in zip(quiet, evidence.drives, evidence.prepared, strict=True):
        left = weighing(r, drive.mask, contrasts(drive.channels))
        columns = whitened(ready, left.noise)
        inner += columns @ columns.T
        rows = left.coloured(columns.reshape(K, *r.shape))
        covariance += rows @ rows.T
    values, vectors = np.linalg.eigh(covariance)
    return inner, np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _drawn(evidence: Evidence, inner: FloatArray, b: FloatArray, base: Sequence[int]) -> FloatArray:
    """Gains (H,) where the columns have these inner products with the residual."""
    return gains_on_top(
        evidence, tolerant(evidence, np.block([[inner, b[:, None]], [b[None], np.zeros((1, 1))]])), base
    )


def gumbel_p(maxima: FloatArray, x: float) -> float:
    """Share of null maxima beyond x, by a Gumbel distribution of their mean and spread; never below theirs counted."""
    beta = max(float(maxima.std(ddof=1)) * math.sqrt(6.0) / math.pi, 1e-9)
    mu = float(maxima.mean()) - EULER * beta
    tail = -math.expm1(-math.exp(min(-(x - mu) / beta, 50.0)))
    counted = float((maxima >= x).mean())
    return max(tail, counted)


def chance(x: float, count: int) -> float:
    """Bound of the share of nulls whose largest of `count` gains, each of one degree of freedom, is beyond x."""
    return min(1.0, count * math.erfc(math.sqrt(0.5 * max(x, 0.0))))


def _gumbel_quantile(maxima: FloatArray, level: float) -> float:
    beta = float(maxima.std(ddof=1)) * math.sqrt(6.0) / math.pi
    mu = float(maxima.mean()) - EULER * beta
    return mu - beta * math.log(-math.log1p(-level))


def bonferroni(level: float, count: int) -> float:
    """Threshold of the largest of `count` gains, each of one degree of freedom, whatever their dependence."""
    return NormalDist().inv_cdf(1.0 - 0.5 * level / max(count, 1)) ** 2


def _groups(evidence: Evidence, gram: FloatArray) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """Leader of each hypothesis: the first one with nearly the same whitened signature."""
    energy = np.diag(gram)
    out = np.arange(len(evidence.asked))
    leaders: list[int] = []
    for i, columns in enumerate(evidence.columns):
        if len(columns) > 1 or energy[columns[0]] <= 1e-12:
            leaders.append(i)
            continue
        for j in leaders:
            other = evidence.columns[j]
            if len(other) == 1 and energy[other[0]] > 1e-12:
                cosine = gram[columns[0], other[0]] / math.sqrt(energy[columns[0]] * energy[other[0]])
                if abs(cosine) > ALIKE:
                    out[i] = j
                    break
        else:
            leaders.append(i)
    return out
