"""Sets of effects: those that may stand together, those that look alike on every log, and those that a log supports.

Two effects together may look like a third one on every log: an accelerometer reads a slope like an offset, while the
force balance responds to the offset like to a rolling resistance. So the smaller set has no better evidence than the
larger one. Effects that act everywhere must also show off the water: on it, errors of the water laws shape the
residual.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from aqualog.core.notation import AXLES, WHEELS
from aqualog.diagnose.channels import contrasts
from aqualog.diagnose.drive import stretches
from aqualog.diagnose.evidence import Evidence, gains_of, tolerant
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.diagnose.noise import weighing
from aqualog.model.effects import EFFECTS

__all__ = ["TWINS", "compatible", "imitations", "supported"]

TWINS = 0.1  # share of its energy that an effect must keep beside its twin, to stand in one set with it
SHOWN = 4.0  # of twice the log-likelihood off the water: two standard deviations
TURNING = {"a_y", "yaw_rate"}
LEAST = 300  # samples off the water that the check needs at the least


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
