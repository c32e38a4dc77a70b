"""Family-wise test for any effect: the largest gain over all hypotheses, compared with simulated noise of the same
spectrum."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.channels import contrasts
from aqualog.diagnose.evidence import Evidence, gram_of, noises_after, tolerant
from aqualog.diagnose.hypotheses import THREADS
from aqualog.diagnose.noise import Noise, surrogate, white_noise
from aqualog.diagnose.subsets import fit_set, gains_on_top

__all__ = ["Calibration", "bonferroni", "calibrate", "chance", "gumbel_p", "largest"]

FEW = 2  # hypotheses after which the noise is tried
ALIKE = 0.97  # cosine of whitened signatures from which one stands for both in the simulated noise
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
            surprise = sum(n.surprise for n in tried)
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
    tick: Callable[[], None] = lambda: None,
) -> Calibration:
    """Null distribution of the largest gain.

    Parameters
    ----------
    evidence : Evidence
    quiet : sequence of array (C, n)
        Residuals after the best set: their smoothed spectra make the surrogates [theiler1992].
    gram : array (K + 1, K + 1)
        Shows which hypotheses are alike, so that one test covers them.
    base : sequence of int
        Hypotheses that are accepted already; noise is tested beside them.
    surrogates : int
        0: no surrogates; the gains are assumed to be inflated by 1.3, and Bonferroni's bound [bonferroni1936] applies.
    level : float
        Share of logs without effect that may be reported as having one.
    seed : int
    """
    H = len(evidence.asked)
    sizes = np.array([len(c) for c in evidence.columns], dtype=np.float64)
    groups = _groups(evidence, gram)
    leaders = sorted({g for g in groups.tolist() if not evidence.asked[g].allowed})
    allowed = [i for i, h in enumerate(evidence.asked) if h.allowed]
    if surrogates == 0:
        return Calibration(
            np.full(H, PLAIN_INFLATION), np.zeros(0), bonferroni(level, len(leaders)), level, len(leaders)
        )
    wanted = sorted({*leaders, *base, *allowed})
    small = _restricted(evidence, wanted)
    at = {m: i for i, m in enumerate(wanted)}

    def one(s: int) -> FloatArray:
        rng = np.random.default_rng(np.random.SeedSequence([seed, s]))
        noise_only = [surrogate(r, d.mask, rng) for r, d in zip(quiet, evidence.drives, strict=True)]
        gains, _ = largest(small, noise_only, [at[m] for m in base])
        tick()
        return gains

    with ThreadPoolExecutor(THREADS) as pool:
        drawn = np.array(list(pool.map(one, range(surrogates))))
    mean = np.ones(H)
    for i, m in enumerate(wanted):
        mean[m] = max(float(drawn[:, i].mean()) / sizes[m], 1.0)
    inflation = mean[groups]
    maxima = (drawn / inflation[wanted] / sizes[wanted]).max(axis=1)
    # where tolerances are larger than the noise, noise alone gives almost no gain; the car's own deviations do
    threshold = max(_gumbel_quantile(maxima, level), bonferroni(level, len(leaders)))
    return Calibration(inflation, maxima, threshold, float((maxima > threshold).mean()), len(leaders))


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


def _restricted(evidence: Evidence, wanted: Sequence[int]) -> Evidence:
    keep = [c for m in wanted for c in evidence.columns[m]]
    columns, k = [], 0
    for m in wanted:
        columns.append(tuple(range(k, k + len(evidence.columns[m]))))
        k += len(evidence.columns[m])
    return replace(
        evidence,
        asked=tuple(evidence.asked[m] for m in wanted),
        signatures=tuple(s[keep] for s in evidence.signatures),
        prepared=tuple(p.of(keep) for p in evidence.prepared),
        columns=tuple(columns),
        prior=evidence.prior[keep],
        low=evidence.low[keep],
        high=evidence.high[keep],
        smallest=evidence.smallest[keep],
        tolerance=evidence.tolerance[keep],
        barred=evidence.barred[list(wanted)],
        spread=evidence.spread[keep],
    )
