"""Sets of effects that explain a campaign's deviation: all credible sets."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.diagnose.campaign.any_effect import whole_fit
from aqualog.diagnose.campaign.catalogue import Hypothesis, Library, library
from aqualog.diagnose.campaign.noise import Fit
from aqualog.diagnose.campaign.passes import Passes, expected_values
from aqualog.diagnose.campaign.refit import Refit, conditioned, refit, weighed
from aqualog.model.term import Model

__all__ = ["CREDIBLE", "Found", "credible", "is_worth", "linear_evidence", "sets_of"]

CREDIBLE = 20.0  # odds against a set within which it stays
LARGEST_SET = 3
ANCHORS = 2
REFITTED = 5
MOVES = 3  # rounds of trying the neighbours of the best set


def sets_of(lib: Library, largest: int = LARGEST_SET) -> list[tuple[int, ...]]:
    """Sets of hypotheses (indices) that may stand together."""
    index = range(len(lib.hypotheses))
    return [
        chosen
        for size in range(1, largest + 1)
        for chosen in itertools.combinations(index, size)
        if all(lib.hypotheses[i].goes_with(lib.hypotheses[j]) for i, j in itertools.combinations(chosen, 2))
    ]


def linear_evidence(
    lib: Library, y: FloatArray, nuisances: FloatArray, weight: FloatArray, per_effect: float, center: FloatArray
) -> list[tuple[float, tuple[int, ...]]]:
    """Sets by log evidence, best first, in the linear model about the point `center` (k,) of its columns."""
    information, score, cost = conditioned(lib.x, y, nuisances, weight)
    out = []
    for chosen in sets_of(lib):
        c = [k for i in chosen for k in lib.columns[i]]
        a, b = information[np.ix_(c, c)], score[c]
        # sizes relative to the point; the prior is about neutral
        full = a + np.eye(len(c))
        step = np.linalg.solve(full, b - center[c])
        quadratic = (
            cost - 2.0 * float(step @ b) + float(step @ a @ step) + float((center[c] + step) @ (center[c] + step))
        )
        log = -0.5 * quadratic - 0.5 * np.linalg.slogdet(full)[1] - len(chosen) * math.log(per_effect)
        out.append((float(log), chosen))
    return sorted(out, key=lambda item: -item[0])


class Found(NamedTuple):
    """Credible sets, best first; the scatter after the best one; every set that was fitted."""

    sets: list[Refit]
    scatter: Fit
    tried: list[Refit]


def credible(
    passes: Passes,
    base: Model,
    lib: Library,
    *,
    known: Sequence[Refit] = (),
    report: Callable[[str], None] = lambda what: None,
) -> Found:
    """Sets of effects refitted in the model, best first and all within `CREDIBLE` of it.

    Parameters
    ----------
    passes, base, lib
    known : sequence of Refit
        Sets to begin with, from other runs of the same campaign; without them every single effect is tried.
    report : callable
        Called with the name of each step.

    The linear library shows where to search, but effects are nonlinear. So every single effect is fitted in the model.
    Around the best ones the library is computed again, and the best sets that hold them, of up to three effects, are
    fitted in the model too.
    """
    per_effect = max(float(len(lib.hypotheses)), 2.0)
    if known:
        nearest = known[0]
        left = passes.values - expected_values(passes, nearest.model)[0]
        weight = whole_fit(left, lib.x, lib.road, passes.nuisances).weight
    else:
        weight = whole_fit(passes.values - lib.base, lib.x, lib.road, passes.nuisances).weight
    found: dict[frozenset[str], Refit] = {}

    def tried(chosen: Sequence[Hypothesis], start: Refit | None = None) -> None:
        key = frozenset(h.key for h in chosen)
        if key not in found:
            values = {h.key: v for h, v in zip(start.chosen, start.values, strict=True)} if start else None
            found[key] = refit(passes, base, chosen, weight, per_effect=per_effect, start=values)

    tried(())
    for old in known:
        tried(old.chosen, old)
    if not known:
        report("single effects")
        for h in lib.hypotheses:
            tried((h,))
        singles = sorted((r for r in found.values() if r.chosen), key=lambda r: -r.log_evidence)
        for anchor in singles[:ANCHORS]:
            report(f"sets with {', '.join(sorted(anchor.keys))}")
            _around(passes, lib, anchor, weight, per_effect, tried)
    report("neighbouring sets")
    for _ in range(MOVES):
        before = len(found)
        best = _best(found.values())
        for chosen in _neighbours(best.chosen, lib.hypotheses):
            tried(chosen, best)
        if len(found) == before:
            break
    best = _best(found.values())
    there = library(passes, best.model, [h for h in lib.hypotheses if _may_add(best.chosen, h)])
    settled = whole_fit(best.residual, np.concatenate([there.x, best.x], axis=-1), lib.road, passes.nuisances)
    judged = sorted((weighed(r, passes, settled.weight) for r in found.values()), key=_order)
    fit_for = [r for r in judged if r.is_physical and is_worth(r)]
    top = fit_for[0].log_evidence
    return Found([r for r in fit_for if r.log_evidence > top - math.log(CREDIBLE)], settled, judged)


def _order(found: Refit) -> float:
    return -found.log_evidence


def _best(tried: Iterable[Refit]) -> Refit:
    return min((r for r in tried if is_worth(r) and r.is_physical), key=_order)


def is_worth(found: Refit) -> bool:
    """Whether every effect of a set has a parameter as far from neutral as its smallest size worth naming."""
    far = {h.key: False for h in found.chosen}
    for h, v in zip(found.chosen, found.values, strict=True):
        far[h.key] = any(abs(v[p.name] - p.neutral) >= p.smallest for p in h.parameters)
    return all(far.values())


def _neighbours(chosen: Sequence[Hypothesis], known: Sequence[Hypothesis]) -> list[tuple[Hypothesis, ...]]:
    """Sets that differ by one move: an effect at another place, one less, or both axles taken together."""
    out = [tuple(h for h in chosen if h is not gone) for gone in chosen] if len(chosen) > 1 else []
    for old in chosen:
        for new in (h for h in known if h.effect is old.effect and h.key != old.key):
            rest = [h for h in chosen if h is not old and (h.effect is not new.effect or new.goes_with(h))]
            if all(h.key != new.key for h in rest):
                out.append((*rest, new))
    return out


def _may_add(chosen: Sequence[Hypothesis], h: Hypothesis) -> bool:
    return all(h.key != c.key and h.goes_with(c) for c in chosen)


def _around(
    passes: Passes, lib: Library, anchor: Refit, weight: FloatArray, per_effect: float,
    tried: Callable[..., None],
) -> None:  # fmt: skip
    """Fit the best sets that hold the anchor, by the library about it."""
    others = tuple(h for h in lib.hypotheses if _may_add(anchor.chosen, h))
    local = library(passes, anchor.model, others)
    own = tuple(range(local.x.shape[-1], local.x.shape[-1] + anchor.theta.size))
    joined = Library(
        (*others, *anchor.chosen), np.concatenate([local.x, anchor.x], axis=-1), (*local.columns, own), local.base,
        local.road,
    )  # fmt: skip
    center = np.concatenate([np.zeros(local.x.shape[-1]), anchor.theta])
    last = len(others)
    ranked = [
        s for _, s in linear_evidence(joined, anchor.residual, passes.nuisances, weight, per_effect, center)
        if last in s and len(s) > 1
    ]  # fmt: skip
    for chosen in ranked[:REFITTED]:
        tried([joined.hypotheses[i] for i in chosen], anchor)
