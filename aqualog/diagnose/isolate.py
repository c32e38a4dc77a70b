"""Sets of effects: those that a log can distinguish, before its residual is used, and those that may stand together.

Two effects together may look like a third one on every log: an accelerometer reads a slope like an offset, while the
force balance responds to the offset like to a rolling resistance. So the smaller set has no better evidence than the
larger one. Effects that act everywhere must also show off the water: on it, errors of the water laws shape the
residual.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from statistics import NormalDist

import numpy as np

from aqualog.core.notation import AXLES, WHEELS
from aqualog.core.records import FloatArray
from aqualog.diagnose.channels import contrasts
from aqualog.diagnose.competition import SCALES, Block
from aqualog.diagnose.drive import stretches
from aqualog.diagnose.evidence import Evidence, gains_of, tolerant
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.diagnose.noise import weighing
from aqualog.diagnose.records import Confusion, Limit
from aqualog.diagnose.words import listed, name_of, quantity
from aqualog.model.effects import EFFECTS

__all__ = [
    "POWER", "TWINS", "compatible", "confusions", "imitations", "likelier_than_none", "limits", "p_correct",
    "reference_sizes", "supported",
]  # fmt: skip

POWER = 0.9
TOLD_APART = 0.95  # probability of naming the right one of two, from which they count as distinguished
EXACT = 1e-3  # largest share of an effect's energy that an exact relation may leave
RIVALS = 10  # most similar rivals, from which sets are formed
TWINS = 0.1  # share of its energy that an effect must keep beside its twin, to stand in one set with it
SHOWN = 4.0  # of twice the log-likelihood off the water: two standard deviations
TURNING = {"a_y", "yaw_rate"}
LEAST = 300  # samples off the water that the check needs at the least


def p_correct(lam: float) -> float:
    """Probability of naming the right one of two: Phi(sqrt(lambda) / 2)."""
    return NormalDist().cdf(0.5 * math.sqrt(max(lam, 0.0)))


def likelier_than_none(evidence: Evidence, blocks: Sequence[Block], shared: FloatArray) -> FloatArray:
    """Size of each column (K,) from which its effect is more likely than none, against its prior and its freedom.
    `shared` (K + 1, K + 1): inner products with the tolerances, of noise that counts by its share."""
    out = np.zeros(evidence.count)
    for b in blocks:
        for c in evidence.columns[b.tag] if b.kind == "effect" else ():
            variance = 1.0 / max(shared[c, c], 1e-30)
            # the competition gains the mean over two scales of the prior
            priors = [(s * float(evidence.prior[c])) ** 2 for s in SCALES]
            nats = [-b.log_prior + 0.5 * math.log1p(p / variance) + math.log(len(SCALES)) for p in priors]
            squares = [2.0 * n * variance * (1.0 + variance / p) for n, p in zip(nats, priors, strict=True)]
            out[c] = math.sqrt(min(squares))
    return out


def reference_sizes(
    evidence: Evidence, gram: FloatArray, threshold: float, least: FloatArray | None = None
) -> FloatArray:  # fmt: skip
    """Size of each column (K,) that is detected with a power of 0.9, or the smallest worth naming if that is larger;
    NaN where no physical size would be. `least` (K,): sizes that it must reach besides, in the same way."""
    out = np.full(evidence.count, np.nan)
    for columns in evidence.columns:
        for c in columns:
            energy = gram[c, c]
            if energy <= 1e-12:
                continue
            # the test's statistic is the gain per value of the effect
            tested = math.sqrt(threshold * len(columns) / energy)
            asked = tested if least is None else max(tested, float(least[c]))
            seen = asked + NormalDist().inv_cdf(POWER) / math.sqrt(energy)
            if seen <= max(evidence.high[c], -evidence.low[c]):
                out[c] = max(seen, evidence.smallest[c])
    return out


def limits(evidence: Evidence, sizes: FloatArray) -> tuple[Limit, ...]:
    """Detection limit of each effect and place, by its first parameter."""
    out: dict[str, Limit] = {}
    shared = {h.key for h in evidence.asked if not h.drive}
    for h, columns in zip(evidence.asked, evidence.columns, strict=True):
        if h.allowed or (h.drive and h.key in shared):
            continue
        size = float(sizes[columns[0]])
        old = out.get(h.key)
        if old is None or (math.isfinite(size) and not (old.size <= size)):
            out[h.key] = Limit(h.effect.name, h.where, size, h.parameter(h.free[0]).unit, h.worth_naming(h.free[0]))
    return tuple(out.values())


def confusions(evidence: Evidence, gram: FloatArray, sizes: FloatArray) -> tuple[Confusion, ...]:
    """All pairs, and for each effect the sets of two and three rivals that imitate it much better than any one, at
    their reference sizes; without effects that the log cannot show."""
    G = gram[:-1, :-1]
    shared = {h.key for h in evidence.asked if not h.drive}
    seen = [
        i for i, c in enumerate(evidence.columns)
        if math.isfinite(sizes[c[0]]) and len(c) == 1
        and not (evidence.asked[i].allowed or (evidence.asked[i].drive and evidence.asked[i].key in shared))
    ]  # fmt: skip
    index = sorted({evidence.asked[i].key: i for i in reversed(seen)}.values())  # the first one of each
    c = np.array([evidence.columns[i][0] for i in index], dtype=np.intp)
    inner = G[np.ix_(c, c)]
    energy, theta = np.diag(inner), sizes[c]
    # energy of row i that column j cannot imitate
    pairs = np.maximum((energy[:, None] - inner**2 / energy[None, :]) * theta[:, None] ** 2, 0.0)
    out = []
    for k, i in enumerate(index):
        own = float(theta[k] ** 2 * energy[k])
        out += [_confusion(evidence, G, i, (j,), float(pairs[k, m]), own) for m, j in enumerate(index) if m != k]
        near = [m for m in np.argsort(pairs[k]).tolist() if m != k and compatible(evidence, (i, index[m]))][:RIVALS]
        for size in (2, 3):
            sets = [s for s in combinations(near, size) if compatible(evidence, (i, *(index[m] for m in s)))]
            lam = _kept(inner, k, np.array(sets, dtype=np.intp).reshape(-1, size)) * theta[k] ** 2
            if not sets:
                continue
            best = int(np.argmin(lam))
            if lam[best] < 0.5 * min(pairs[k, m] for m in sets[best]) and p_correct(lam[best]) < TOLD_APART:
                out.append(_confusion(evidence, G, i, tuple(index[m] for m in sets[best]), float(lam[best]), own))
                break
    return tuple(out)


def _kept(inner: FloatArray, k: int, sets: np.ndarray[tuple[int, int], np.dtype[np.intp]]) -> FloatArray:
    """Energy that column k keeps when each of the sets (m, size) may imitate it. (m,)"""
    scale = np.sqrt(np.diag(inner))
    unit = inner / np.outer(scale, scale)
    R = unit[sets[:, :, None], sets[:, None, :]] + 1e-9 * np.eye(sets.shape[1])
    r = unit[sets, k]
    left = 1.0 - np.einsum("ij,ij->i", r, np.linalg.solve(R, r[..., None])[..., 0])
    return np.asarray(np.maximum(left, 0.0) * inner[k, k])


def _confusion(
    evidence: Evidence, G: FloatArray, i: int, rivals: tuple[int, ...], lam: float, energy: float
) -> Confusion:
    key, others = evidence.asked[i].key, tuple(evidence.asked[j].key for j in rivals)
    if lam >= EXACT * energy:
        return Confusion(key, others, lam, p_correct(lam))
    c = evidence.columns[i][0]
    r = [evidence.columns[j][0] for j in rivals]
    size = float(evidence.smallest[c])
    sizes = (size, *(np.linalg.lstsq(G[np.ix_(r, r)], G[r, c], rcond=1e-9)[0] * size).tolist())
    each = zip((evidence.asked[j] for j in (i, *rivals)), sizes, strict=True)
    said = [(h, quantity(x, h.parameter(h.free[0]).unit, change=True)) for h, x in each]
    parts = [f"{name_of(h.effect.name, h.where)} of {x}" for h, x in said]
    relation = f"On this log {parts[0]} looks exactly like {listed(parts[1:])}."
    return Confusion(key, others, lam, p_correct(lam), relation, sizes)


def compatible(evidence: Evidence, members: Sequence[int]) -> bool:
    """Whether a set holds each effect once per wheel, in one variant, and does not delay every signal. A delay of all
    signals that are compared with each other only shifts the start of their clock, and one of all but one is that
    signal's own, with the other sign. Those of turning are apart from the others."""
    own = [evidence.asked[m] for m in members]
    if len({h.effect.name for h in own}) == len(own):
        return True
    for effect, drive in {(h.effect.name, h.drive) for h in own if h.effect.drive.is_relative}:
        late = {h.where for h in own if h.effect.name == effect and h.drive in ("", drive)}
        every = {h.where for h in evidence.asked if h.effect.name == effect}
        for compared in (every & TURNING, every - TURNING):
            if len(late & compared) > 1 and len(late & compared) >= len(compared) - 1:
                return False
    shared, at = {h.effect.name for h in own if not h.drive}, []
    for h in own:
        if h.drive and h.effect.name in shared:
            return False  # what all drives have, and what each has besides, would differ by one value only
        # a load at the front and one removed at the rear are not two loads, but a shift of the centre of mass
        whole = h.where is None or h.effect.drive.is_single
        at += [(h.effect.name, p, h.drive) for p in (WHEELS if whole else AXLES.get(h.where or "", (h.where or "",)))]
    return len(set(at)) == len(at)


def imitations(asked: Sequence[Hypothesis], members: Sequence[int]) -> list[tuple[int, ...]]:
    """Sets of hypotheses that a relation makes equal to `members`, none of which holds them all; sorted indices.
    Effects are taken at the whole car or at their usual place; none joins its own twin."""
    out = []
    for relation in [(e.name, *others) for e in EFFECTS.values() for others in e.drive.equals]:
        usual = {
            h.effect.name: i for i, h in enumerate(asked)
            if h.effect.name in relation and h.where in (None, h.effect.default) and not h.drive
        }  # fmt: skip
        related = {i for i in members if i in usual.values()}
        if not related or len(usual) < len(relation):
            continue
        for two in combinations(usual.values(), 2):
            rest = {*members} - related
            pairs = [(asked[a].effect, asked[b].effect) for a in rest for b in two]
            if not related <= set(two) and not any(b.name in a.twins or a.name in b.twins for a, b in pairs):
                out.append(tuple(sorted(rest | set(two))))
    return list(dict.fromkeys(out))


def supported(evidence: Evidence) -> Evidence:
    """The evidence without effects that have no gain off the water; the same evidence on dry drives, and on those that
    are wet nearly all the time. Effects of water are exempt."""
    if not any(d.course.lanes for d in evidence.drives):
        return evidence
    dry = [d.mask & (stretches(d) == 0) for d in evidence.drives]
    if sum(int(m.sum()) for m in dry) < LEAST or any(m.sum() < LEAST // 4 for m in dry):
        return evidence
    gram = np.zeros((evidence.count + 1, evidence.count + 1))
    for r, s, m, d in zip(evidence.residuals, evidence.signatures, dry, evidence.drives, strict=True):
        rows = weighing([r], m, contrasts(d.channels)).rows(np.concatenate([s, r[None]]))
        gram += rows @ rows.T
    of_water = np.array([h.of_water for h in evidence.asked])
    sizes = np.array([len(c) for c in evidence.columns])
    return replace(evidence, barred=(gains_of(evidence, tolerant(evidence, gram)) < SHOWN * sizes) & ~of_water)
