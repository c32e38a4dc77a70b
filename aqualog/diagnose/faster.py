"""What a log shows faster than the blocks of the search, joined to the verdict: uneven tone rings, seams of the log."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from aqualog.core.notation import WHEELS
from aqualog.core.records import Signals
from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.full_rate import per_turn, pooled, remarks, to_causes, wheel_columns, why_untested, without_known
from aqualog.diagnose.outcome import Outcome
from aqualog.diagnose.probability import SURE
from aqualog.diagnose.records import Cause, Verdict
from aqualog.diagnose.seams import seams
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model, Term

__all__ = ["Faster", "faster", "joined", "with_rings"]

_RING = EFFECTS["tone_ring"]


class Faster(NamedTuple):
    """Causes of all drives together, sentences on what is no cause, and why an effect cannot be tested, by name."""

    causes: tuple[Cause, ...] = ()
    notes: tuple[str, ...] = ()
    untested: dict[str, str] = {}  # noqa: RUF012 (a default that nobody changes)


def faster(drives: Sequence[tuple[str, Signals]], vehicle: Vehicle, model: Model, *, seed: int = 1) -> Faster:
    """Look at the signals at their own rate.

    Parameters
    ----------
    drives : sequence of (name, Signals)
        Those of the diagnosis: one car in one state, so that a ring is the same in all of them.
    vehicle : Vehicle
    model : Model
        Rings that it has are known, and are no finding at that size.
    seed : int
        Of the permutations that calibrate the search for seams.
    """
    found = pooled([per_turn(wheel_columns(s), s.dt, vehicle, s.origins) for _, s in drives])
    found = without_known(found, _known(model))
    causes = to_causes(found)
    notes = [f"Not named (probability {c.probability:.2f}): {c.sentence}" for c in causes if c.probability < SURE]
    notes += remarks(found)
    for name, s in drives:
        own = f"{name}: " if len(drives) > 1 else ""
        notes += [own + seam.sentence for seam in seams(s, vehicle, seed=seed)]
    reason = why_untested(found)
    named = tuple(c for c in causes if c.probability >= SURE)
    return Faster(named, tuple(notes), {_RING.name: reason} if reason else {})


def joined(outcome: Outcome, seen: Faster) -> Outcome:
    """The outcome with the causes beside its own: they act on no residual of the search, so neither hides the other."""
    if not seen.causes:
        return outcome
    verdict: Verdict = outcome.verdict
    causes = (*outcome.causes, *seen.causes)
    if verdict in ("no_effect", "named", "compound"):
        verdict = "named" if len(causes) == 1 else "compound"
    return outcome._replace(verdict=verdict, causes=causes, certain=outcome.certain | {c.effect for c in seen.causes})


def with_rings(model: Model, seen: Faster) -> Model:
    """The model with the rings that were found, in place of those that it has at the same wheels."""
    terms = list(model.terms)
    for c in seen.causes:
        terms = [t for t in terms if t.effect is not _RING or t.place != c.where]
        terms.append(Term(_RING, {n: e.value for n, e in c.parameters.items()}, c.where))
    return Model(tuple(terms))


def _known(model: Model) -> dict[str, float]:
    """Amplitude by wheel that the model's own terms give."""
    out: dict[str, float] = {}
    for t in model.terms:
        if t.effect is _RING:
            for w in WHEELS:
                if w == t.place or t.place in (w[0], {"l": "left", "r": "right"}[w[1]]):
                    out[w] = out.get(w, 0.0) + t.values.get("amplitude", 0.0)
    return out
