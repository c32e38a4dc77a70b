"""Relations among effects that hold on every log: two effects together look like a third one.

They come in addition to the twins of an effect, which look like it one by one. An accelerometer reads a slope like an
offset. The force balance does not respond to a slope; it responds to the offset like to a rolling resistance. No drive
breaks such a relation, so the smaller set has no better evidence than the larger one.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.model.effects import EFFECTS

__all__ = ["imitations"]


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
