"""Residuals and signatures of all drives, weighted by their noise: the data of every test and fit, around values that
the drives most likely have.

The test for any effect compares the largest gain over all hypotheses with draws of noise of the same spectrum. Near
floating, slip is proportional to one over the square of the remaining contact: a signature at the file's water is a
tangent beside a pole. So the effects of water are simulated at several sizes, and signatures are drawn around the most
likely one.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from aqualog.core.notation import AXLES
from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.channels import contrasts
from aqualog.diagnose.drive import Drive, rolling_under
from aqualog.diagnose.file_values import as_value, day_to_day, deviation
from aqualog.diagnose.hypotheses import Hypothesis, residual, signatures, value_in, with_values
from aqualog.diagnose.noise import weighing
from aqualog.diagnose.records import Significance
from aqualog.diagnose.threads import beside
from aqualog.model.term import Kind, Model, Term

__all__ = [
    "ALIKE", "FARTHEST", "SURROGATES", "Calibration", "Evidence", "Forgiven", "around_water", "calibrate", "forgiving",
    "gains_of", "gumbel_p", "make_evidence", "of_water", "recentred", "significance", "tolerant",
]  # fmt: skip

FARTHEST = 2.0  # standard deviations, beyond which a fault is likelier than an error of the file
# draws of noise: on 200 made drives without effect of 40 s, the level 0.05 was passed by 0.115 with 19, 0.080 with 49
# and 0.045 with 199 (D); Gumbel's distribution of few maxima has too short a tail
SURROGATES = 499
ALIKE = 0.97  # cosine of whitened signatures from which one stands for both
EULER = 0.5772156649015329
SIZES = (-1.5, -0.75, 0.75, 1.5, 3.0)  # of the usual deviation, that are simulated of each effect
FINER = 0.375  # the best one is shifted by, to either side
CLEARLY = 1.0  # [nats (natural logarithm)] that it must be more likely than no deviation


@dataclass(frozen=True, slots=True)
class Evidence:
    """Drives with their residuals (C, n) and the columns of signatures (K, C, n), one for each free parameter;
    `columns[i]` are those of hypothesis i."""

    drives: tuple[Drive, ...]
    asked: tuple[Hypothesis, ...]
    residuals: tuple[FloatArray, ...]
    signatures: tuple[FloatArray, ...]
    columns: tuple[tuple[int, ...], ...]
    prior: FloatArray  # (K,) standard deviation of each parameter
    low: FloatArray  # (K,) bounds of its change
    high: FloatArray
    smallest: FloatArray
    tolerance: FloatArray  # (K,) deviation of each parameter that is not worth naming
    barred: BoolArray  # (H,) hypotheses that contradict the drives: neither tested nor put into sets
    spread: FloatArray  # (K,) of the same car between drives, where measured, and of the file's own value
    kinds: tuple[Kind, ...]  # (K,) the kind of day-to-day difference that each looks like, as mass and torque gain
    as_values: FloatArray  # (K,) size of that difference and of the file's errors, expressed as its value

    @property
    def count(self) -> int:
        """Number of columns."""
        return self.prior.size

    @property
    def forgiven(self) -> FloatArray:
        """Prior standard deviation of each parameter. (K,)"""
        return np.maximum(self.tolerance, self.spread)


def make_evidence(
    drives: Sequence[Drive], asked: Sequence[Hypothesis], residuals: Sequence[FloatArray],
    signatures: Sequence[Sequence[FloatArray]], model: Model,
) -> Evidence:  # fmt: skip
    """Columns of all hypotheses about the model at hand."""
    columns: list[tuple[int, ...]] = []
    sought = [h for h in asked if not (h.allowed or h.effect.drive.begins_like)]
    variants = Counter((h.effect.name, h.where, h.drive) for h in sought)
    rows: list[tuple[float, ...]] = []
    kinds: list[Kind] = []
    # drag counts at this speed [m/s]: a head wind's v w is nearest to drag's v^2 by least squares there
    v, car = np.concatenate([d.coordinates["v_x"][d.mask] for d in drives]), drives[0].vehicle
    speed = float((v**3).sum() / max(float((v**2).sum()), 1e-9))
    apart = {(h.effect.name, h.where) for h in asked if h.drive and not h.effect.drive.begins_like}
    for h in asked:
        columns.append(tuple(range(len(rows), len(rows) + len(h.free))))
        # of one effect, which look much alike and together deviate by as much as one; moments do not
        shared = 1.0 / math.sqrt(max(variants[h.effect.name, h.where, h.drive], 1))
        for name in h.free:
            p, now = h.parameter(name), value_in(model, h, name)
            # what differs from drive to drive does so in each; what is not worth naming is half in all, half in each
            is_apart = (h.effect.name, h.where) in apart
            daily = 0.0 if is_apart and not h.drive else day_to_day(h, name, car)
            spread = shared * math.hypot(daily, deviation(h, name, car))
            tolerance = shared * h.tolerance(name) * (math.sqrt(0.5) if is_apart else 1.0)
            size, value = h.worth_naming(name), as_value(h, name, car, speed)
            rows.append((p.sigma, p.low - now, p.high - now, size, tolerance, spread, value))
            kinds.append("" if p.day_to_day is None else p.day_to_day.kind)
    flat = tuple(np.concatenate(list(s)) for s in signatures)
    prior, low, high, smallest, allowed, off, values = np.ascontiguousarray(np.array(rows).T)
    return Evidence(
        tuple(drives), tuple(asked), tuple(residuals), flat, tuple(columns), prior, low, high, smallest, allowed,
        np.zeros(len(asked), dtype=bool), off, tuple(kinds), values,
    )  # fmt: skip


class Forgiven(NamedTuple):
    """Inner products (K + 1, K + 1) that forgive deviations; `room`: half log determinant of noise and deviations."""

    gram: FloatArray
    room: float


def forgiving(gram: FloatArray, tolerance: FloatArray) -> Forgiven:
    """Inner products of K columns, or of these and residuals, with themselves and any number of residuals, in a metric
    that tolerates deviations of covariance `tolerance` (K, K). With enough samples every small error of a file or a
    simulator is significant. The covariance of the residual is that of the noise and these deviations, I + X P X',
    whose inverse Woodbury's identity gives."""
    k = np.flatnonzero((np.diag(tolerance) > 0.0) & (np.diag(gram)[: len(tolerance)] > 1e-12))
    P = tolerance[np.ix_(k, k)]
    root = np.linalg.cholesky(P + 1e-14 * np.diag(np.diag(P)))
    C = np.linalg.cholesky(np.eye(k.size) + root.T @ gram[np.ix_(k, k)] @ root)
    half = np.linalg.solve(C, root.T @ gram[k])
    return Forgiven(np.asarray(gram - half[:, : len(gram)].T @ half), float(np.log(np.diag(C)).sum()))


def tolerant(evidence: Evidence, gram: FloatArray) -> FloatArray:
    """Inner products that forgive the usual errors of every parameter."""
    return forgiving(gram, np.diag(evidence.forgiven**2)).gram


def recentred(evidence: Evidence, model: Model) -> Model:
    """The model with the file's own values where these drives most likely have them, if that is far from the file: a
    gain that is 10 % off bends signatures, and the bend would get a name. The deviations theta = (S^-2 + A'A)^-1 A'y
    stay as unsure as they were. The noise is estimated again after a first round, in which the deviations still count
    as noise."""
    car = evidence.drives[0].vehicle
    names = [(h, n) for h in evidence.asked for n in h.free]
    if not any(FARTHEST * deviation(h, n, car) >= h.worth_naming(n) for h, n in names):
        return model
    k = np.flatnonzero(evidence.forgiven > 0.0)
    theta: dict[int, float] = {}
    for _ in range(2):
        gram = np.zeros((evidence.count + 1, evidence.count + 1))
        for r, x, d in zip(evidence.residuals, evidence.signatures, evidence.drives, strict=True):
            quiet = r - sum((v * x[c] for c, v in theta.items()), np.zeros_like(r))
            rows = weighing([quiet], d.mask, contrasts(d.channels)).rows(np.concatenate([x, r[None]]))
            gram += rows @ rows.T
        inner = gram[np.ix_(k, k)] + np.diag(evidence.forgiven[k] ** -2.0)
        theta = dict(zip(k.tolist(), np.linalg.solve(inner, gram[k, -1]).tolist(), strict=True))
    within = [(*names[c], off) for c, off in theta.items() if evidence.low[c] < off < evidence.high[c]]
    return with_values(model, [
        (h, {n: value_in(model, h, n) + off}) for h, n, off in within
        if h.worth_naming(n) <= abs(off) <= FARTHEST * deviation(h, n, car)
    ])  # fmt: skip


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


def of_water(evidence: Evidence) -> list[int]:
    """Effects of water on the whole car or a side, in all drives."""
    whole = (h.of_water and not h.allowed and h.where not in AXLES and not h.drive for h in evidence.asked)
    return [i for i, is_whole in enumerate(whole) if is_whole]


class _Tried(NamedTuple):
    surprise: float
    hypothesis: int
    off: float
    residuals: tuple[FloatArray, ...]


def around_water(evidence: Evidence, model: Model) -> tuple[Evidence, Term | None]:
    """The evidence with signatures of water around its most likely single effect, and that; the same evidence and none
    on dry drives. The noise is estimated anew under each, since an effect that is left in the residual looks like
    noise. Residuals are those that a linear model around this point would have had at the start."""
    every = of_water(evidence)
    if not every:
        return evidence, None

    def tried(at: tuple[int, float]) -> _Tried | None:
        i, off = at
        h = evidence.asked[i]
        p = h.parameter(h.free[0])
        if not p.low <= value_in(model, h, p.name) + off <= p.high:
            return None
        moved = _moved(evidence, model, h, off)
        residuals = tuple(residual(d, moved) for d in evidence.drives)
        return _Tried(_surprise(evidence, residuals), i, off, residuals)

    def best_of(points: Sequence[tuple[int, float]]) -> _Tried:
        return min([best, *(t for t in beside(tried, points) if t is not None)], key=lambda t: t.surprise)

    start = best = _Tried(_surprise(evidence, evidence.residuals), every[0], 0.0, evidence.residuals)
    usual = {i: evidence.prior[evidence.columns[i][0]] for i in every}
    best = best_of([(i, float(k * usual[i])) for i in every for k in SIZES])
    if best.surprise > start.surprise - CLEARLY:
        return evidence, None
    i = best.hypothesis
    best = best_of([(i, best.off + float(k * usual[i])) for k in (-FINER, FINER)])
    h = evidence.asked[i]
    name, first = h.free[0], evidence.columns[i][0]
    moved = _moved(evidence, model, h, best.off)
    wet = [i for i, o in enumerate(evidence.asked) if o.of_water]
    columns = [c for i in wet for c in evidence.columns[i]]
    all_signatures, residuals = [], []
    for d, s, r in zip(evidence.drives, evidence.signatures, best.residuals, strict=True):
        changed = s.copy()
        changed[columns] = np.concatenate(signatures(d, moved, [evidence.asked[i] for i in wet], base=r))
        all_signatures.append(changed)
        residuals.append(r + best.off * changed[first])
    drives = tuple(rolling_under(d, moved) for d in evidence.drives)
    around = replace(evidence, drives=drives, signatures=tuple(all_signatures), residuals=tuple(residuals))
    return around, Term(h.effect, {name: value_in(model, h, name) + best.off}, h.where)


def _moved(evidence: Evidence, model: Model, h: Hypothesis, off: float) -> Model:
    """The model with the first parameter of an effect changed, axle by axle where it is asked at axles: a gain of the
    whole car would multiply theirs."""
    axles = [o for o in evidence.asked if h.where is None and o.effect is h.effect and o.where in AXLES]
    values = {n: value_in(model, h, n) for n in h.free}
    values[h.free[0]] += off
    return with_values(model, [(o, values) for o in axles or [h]])


def _surprise(evidence: Evidence, residuals: Sequence[FloatArray]) -> float:
    return sum(
        weighing([r], d.mask, contrasts(d.channels)).surprise(r)
        for r, d in zip(residuals, evidence.drives, strict=True)
    )
