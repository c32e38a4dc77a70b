"""Sets of effects on whitened inner products: the best ones, those that look alike, and those that a log supports.

Every set is searched, not one effect after the other. In addition to the twins of an effect, which look like it one by
one, two effects together may look like a third one on every log: an accelerometer reads a slope like an offset, while
the force balance responds to the offset like to a rolling resistance. No drive breaks such a relation, so the smaller
set has no better evidence than the larger one.

Effects that act everywhere must also show off the water. On water, errors of the water laws shape the residual. A wheel
with little contact amplifies any slip, and two dry effects that cancel on dry road could replace a wrong water law.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from aqualog.core.notation import AXLES, WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.diagnose.channels import block_step, contrasts
from aqualog.diagnose.drive import Drive
from aqualog.diagnose.evidence import Evidence, gram_of, tolerant
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.diagnose.noise import fit_noise
from aqualog.model.effects import EFFECTS

__all__ = ["PRIOR_WIDTH", "SetFit", "best_sets", "compatible", "fit_set", "gains_on_top", "imitations", "supported"]

PRIOR_WIDTH = 3.0  # the prior is this much wider than the effect's: it only keeps huge, cancelling pairs apart
SINGULAR = 1e-3  # share of a column's energy that the others of its set must leave
TWINS = 0.1  # the same between two effects that are each other's twins, to stand in one set
CANDIDATES = 40  # hypotheses that sets of three and more are made of


@dataclass(frozen=True, slots=True)
class SetFit:
    """Hypotheses `members`, values `theta` of their columns and twice the log-likelihood gained, without the prior."""

    members: tuple[int, ...]
    columns: tuple[int, ...]
    theta: FloatArray
    gain: float


def fit_set(evidence: Evidence, gram: FloatArray, members: Sequence[int]) -> SetFit | None:
    """Least squares of one set; None if its members cannot be distinguished or a value is outside its bounds."""
    if evidence.barred[list(members)].any():
        return None
    columns = tuple(c for m in members for c in evidence.columns[m])
    c = list(columns)
    G, b = gram[np.ix_(c, c)], gram[c, -1]
    scale = np.sqrt(np.maximum(np.diag(G), 1e-300))
    unit = G / np.outer(scale, scale)
    # a ridge keeps the direction in which exact twins cancel, which a pseudoinverse would leave out
    if len(c) > 1 and 1.0 / np.max(np.diag(np.linalg.inv(unit + 1e-9 * np.eye(len(c))))) < SINGULAR:
        return None
    if any(_cancel(evidence, gram, pair) for pair in combinations(members, 2)):
        return None
    P = np.diag(1.0 / (PRIOR_WIDTH * evidence.prior[c]) ** 2)
    theta: FloatArray = np.linalg.solve(G + P, b).astype(np.float64)
    if np.any(theta < evidence.low[c]) or np.any(theta > evidence.high[c]):
        return None
    return SetFit(tuple(members), columns, theta, float(b @ theta))


def _cancel(evidence: Evidence, gram: FloatArray, pair: tuple[int, int]) -> bool:
    """Whether two effects are known twins and alike on these drives; large twins that cancel explain nothing."""
    a, b = (evidence.asked[m].effect for m in pair)
    if b.name not in a.twins and a.name not in b.twins:
        return False
    i, j = (evidence.columns[m][0] for m in pair)
    energy = gram[i, i] * gram[j, j]
    return bool(energy > 0.0 and 1.0 - gram[i, j] ** 2 / energy < TWINS)


def gains_on_top(evidence: Evidence, gram: FloatArray, base: Sequence[int]) -> FloatArray:
    """Twice the log-likelihood that each hypothesis gains beside the columns of `base`, without prior. (H,)"""
    taken = [c for m in base for c in evidence.columns[m]]
    rest = gram
    if taken:
        inner = np.linalg.pinv(gram[np.ix_(taken, taken)], hermitian=True)
        rest = gram - gram[:, taken] @ inner @ gram[taken, :]
    out = np.zeros(len(evidence.asked))
    for i, columns in enumerate(evidence.columns):
        c = list(columns)
        energy = np.diag(rest)[c]
        if evidence.asked[i].allowed or evidence.barred[i] or i in base:
            continue
        if np.any(energy < SINGULAR * np.maximum(np.diag(gram)[c], 1e-300)):
            continue
        out[i] = float(rest[c, -1] @ np.linalg.solve(rest[np.ix_(c, c)], rest[c, -1]))
    return out


def compatible(evidence: Evidence, members: Sequence[int]) -> bool:
    """Whether a set holds each effect once per wheel, in one variant, and does not delay every signal.

    Delays are relative: a delay of all signals only shifts the start of the log's clock.
    """
    for effect in {evidence.asked[m].effect.name for m in members if evidence.asked[m].effect.drive.is_relative}:
        late = {evidence.asked[m].where for m in members if evidence.asked[m].effect.name == effect}
        if len(late) > 1 and late == {h.where for h in evidence.asked if h.effect.name == effect}:
            return False
    seen: set[tuple[str, str]] = set()
    for m in members:
        h = evidence.asked[m]
        # a load at the front and one removed at the rear are not two loads, but a shift of the centre of mass
        whole = h.where is None or h.effect.drive.is_single
        places = WHEELS if whole else AXLES.get(h.where or "", (h.where or "",))
        for p in places:
            if (h.effect.name, p) in seen:
                return False
            seen.add((h.effect.name, p))
    return True


def best_sets(evidence: Evidence, gram: FloatArray, size: int, *, within: float, most: int) -> list[SetFit]:
    """All sets of a size whose gain is within a distance of the best one's, best first, at most so many.

    Pairs are searched completely; larger sets among the hypotheses that gain most alone, beside the best single one and
    beside the best pair.
    """
    alive = [
        i for i, c in enumerate(evidence.columns)
        if np.all(np.diag(gram)[list(c)] > 1e-12) and not evidence.asked[i].allowed and not evidence.barred[i]
    ]  # fmt: skip
    if size == 1:
        fits = [f for i in alive if (f := fit_set(evidence, gram, (i,)))]
    elif size == 2:
        fits = [f for pair in _promising_pairs(evidence, gram, alive) if (f := fit_set(evidence, gram, pair))]
    else:
        smaller = best_sets(evidence, gram, size - 1, within=2.0 * within, most=8)
        pool: list[int] = []
        for s in smaller:
            order = np.argsort(-gains_on_top(evidence, gram, s.members))
            pool += [*s.members, *order[: CANDIDATES // 4].tolist()]
        unique = list(dict.fromkeys(pool))[:CANDIDATES]
        sets = [s for s in combinations(sorted(unique), size) if compatible(evidence, s)]
        fits = [f for s in _screened(evidence, gram, sets) if (f := fit_set(evidence, gram, s))]
    fits.sort(key=lambda f: -f.gain)
    return [f for f in fits if f.gain >= fits[0].gain - within][:most]


def _promising_pairs(evidence: Evidence, gram: FloatArray, alive: Sequence[int]) -> list[tuple[int, ...]]:
    return _screened(evidence, gram, [p for p in combinations(alive, 2) if compatible(evidence, p)])


def _screened(evidence: Evidence, gram: FloatArray, sets: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """The 300 sets of one size that gain most without prior and bounds; those with several columns are all kept."""
    plain = [s for s in sets if all(len(evidence.columns[m]) == 1 for m in s)]
    other = [s for s in sets if s not in set(plain)] if len(plain) < len(sets) else []
    if not plain:
        return list(sets)
    index = np.array([[evidence.columns[m][0] for m in s] for s in plain])
    G = gram[index[:, :, None], index[:, None, :]]
    b = gram[index, -1]
    P = np.array([np.diag(d) for d in 1.0 / (PRIOR_WIDTH * evidence.prior[index]) ** 2])
    theta = np.linalg.solve(G + P + 1e-12 * G * np.eye(index.shape[1]), b[..., None])[..., 0]
    gain = np.einsum("ij,ij->i", b, theta)
    outside = (theta < evidence.low[index]).any(axis=1) | (theta > evidence.high[index]).any(axis=1)
    order = np.argsort(-np.where(outside, -np.inf, gain))[:300]
    return [plain[i] for i in order if not outside[i]] + other


def imitations(asked: Sequence[Hypothesis], members: Sequence[int]) -> list[tuple[int, ...]]:
    """Sets of hypotheses that a relation makes equal to `members`, none of which holds them all; sorted indices.

    Any two effects of a relation span what all three do. Effects are taken at the whole car or at their usual place.
    """
    out = []
    for relation in [(e.name, *e.drive.equals) for e in EFFECTS.values() if e.drive.equals]:
        usual = {
            h.effect.name: i for i, h in enumerate(asked)
            if h.effect.name in relation and h.where in (None, h.effect.default)
        }  # fmt: skip
        related = {i for i in members if i in usual.values()}
        if not related or len(usual) < len(relation):
            continue
        for two in combinations(usual.values(), 2):
            if not related <= set(two):
                out.append(tuple(sorted({*members} - related | set(two))))
    return out


SHOWN = 4.0  # of twice the log-likelihood off the water: two standard deviations
BESIDE_S = 1.0  # [s] after a stretch, in which the rear axle and the speed still have it
LEAST = 300  # samples off the water that the check needs at the least


def supported(evidence: Evidence) -> Evidence:
    """The evidence without effects that have no gain off the water; the same evidence on dry drives.

    Effects of water are exempt, and so are drives that are wet nearly all the time.
    """
    if not any(d.course.lanes for d in evidence.drives):
        return evidence
    dry = [_off_water(d) for d in evidence.drives]
    if sum(int(m.sum()) for m in dry) < LEAST or any(m.sum() < LEAST // 4 for m in dry):
        return evidence
    noises = [
        fit_noise(r, m, contrasts(d.channels)) for r, m, d in zip(evidence.residuals, dry, evidence.drives, strict=True)
    ]
    gains = gains_on_top(evidence, tolerant(evidence, gram_of(evidence, noises, evidence.residuals)), ())
    of_water = np.array([h.of_water for h in evidence.asked])
    sizes = np.array([len(c) for c in evidence.columns])
    return replace(evidence, barred=(gains < SHOWN * sizes) & ~of_water)


def _off_water(drive: Drive) -> BoolArray:
    """Usable samples without water, nor shortly after it. (m,)"""
    wet = drive.coordinates.get("water_depth", np.zeros(drive.mask.size))[: drive.mask.size] > 0.0
    k = round(BESIDE_S / block_step(drive.dt))
    late = np.convolve(wet.astype(np.float64), np.ones(k + 1), "full")[: wet.size] > 0.5
    return drive.mask & ~late
