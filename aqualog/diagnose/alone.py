"""Several drives of a car where no name holds for all of them: what each shows by itself.

One value is shared by all drives. A load or a wind of one of three is a third of that, which no drive confirms.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from aqualog.diagnose.agreement import mean_of
from aqualog.diagnose.records import Cause, Diagnosis, Verdict
from aqualog.diagnose.words import cause_sentence, listed, verdict_sentence
from aqualog.model.effects import EFFECTS

__all__ = ["MOST", "with_each"]

MOST = 8  # drives that are also diagnosed by themselves


def with_each(together: Diagnosis, each: Mapping[str, Diagnosis], level: float) -> Diagnosis:
    """The diagnosis of several drives, with what `each` (by name) shows by itself in its notes.

    Where the drives together show no effect, it has the names that single drives have, if those are a drive's own. A
    fault of the car would be in all of them.
    """
    seen = {n: d for n, d in each.items() if d.verdict != "no_effect"}
    notes = (*together.notes, *(f"{n} by itself: {d.sentence}" for n, d in seen.items()))
    own: dict[str, list[tuple[str, Cause]]] = {}
    for n, d in seen.items():
        if d.verdict in ("named", "compound") and all(_differs(c) for c in d.causes):
            for c in d.causes:
                own.setdefault(c.key, []).append((n, c))
    if not own or together.verdict != "no_effect":
        return replace(together, notes=notes)
    causes = tuple(_of_some(found) for found in own.values())
    verdict: Verdict = "named" if len(causes) == 1 else "compound"
    # its pictures come first
    having = {n for found in own.values() for n, _ in found}
    shown = [v for n in each if n in having for v in each[n].views]
    views = (*shown, *(v for v in together.views if v.drive not in having))
    return replace(
        together, verdict=verdict, sentence=verdict_sentence(verdict, causes, level=level), causes=causes, notes=notes,
        views=views,
    )  # fmt: skip


def _differs(cause: Cause) -> bool:
    return EFFECTS[cause.effect].belongs in ("drive", "moment")


def _of_some(found: Sequence[tuple[str, Cause]]) -> Cause:
    """One cause of the drives that have it, with the mean of their values."""
    first, only = found[0][1], f" In {listed([n for n, _ in found])} only."
    if len(found) == 1:
        return replace(first, sentence=first.sentence + only)
    bounds = {p.name: (p.low, p.high) for p in EFFECTS[first.effect].parameters}
    values = {
        n: mean_of([c.parameters[n] for _, c in found], *bounds[n]) if math.isfinite(e.low) else e
        for n, e in first.parameters.items()
    }
    sentence = cause_sentence(EFFECTS[first.effect], first.where, values) + only
    return replace(first, parameters=values, sentence=sentence, probability=min(c.probability for _, c in found))
