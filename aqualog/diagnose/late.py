"""Signals that come so late that the competition did not find it, by the lags of the whole drive: curves and braking,
which the force balance leaves out, show them to hundredths of a second."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from aqualog.checks.delays import delays_in
from aqualog.checks.doubts import Doubt
from aqualog.core.records import Signals
from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.diagnose.records import MOST, Cause, Estimate, Verdict
from aqualog.diagnose.verdict import Option, Outcome
from aqualog.diagnose.words import cause_sentence
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model, Term

__all__ = ["Late", "found_late"]

HALF_S = 0.15  # [s] of the 95 % interval: by so much filters of three measured cars differ (D)
DOUBTED = 0.5  # of a probability beside a signal that comes late, which no set of effects explains (K)
DELAY = EFFECTS["signal_delay"]
_SHIFTS = ("signal_delay", "clock_skew")


@dataclass(frozen=True, slots=True)
class Late:
    """`causes`: delays of one signal each; `doubts`: those of two signals, of which either may come late."""

    causes: tuple[Cause, ...] = ()
    doubts: tuple[Doubt, ...] = ()

    @property
    def terms(self) -> tuple[Term, ...]:
        """The delays as terms of a model."""
        return tuple(Term(DELAY, {"delay": c.parameters["delay"].value}, c.where) for c in self.causes)

    def known(self, asked: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
        """Hypotheses, in which such a signal's delay may be off by what the lag leaves open."""
        own = {c.key for c in self.causes}
        return tuple(replace(h, room=0.5 * HALF_S) if h.key in own else h for h in asked)

    def beyond(self, causes: Sequence[Cause]) -> Late:
        """Delays that are not among the causes of a diagnosis, with about this value."""
        found = {c.key: c.parameters["delay"].value for c in causes if "delay" in c.parameters}
        own = ((c, c.parameters["delay"]) for c in self.causes)
        return Late(tuple(c for c, lag in own if not lag.low <= found.get(c.key, math.nan) <= lag.high))

    def without(self, model: Model) -> Model:
        """A model without them."""
        return Model(tuple(t for t in model.terms if t not in self.terms))

    def beside(self, outcome: Outcome[Option]) -> Outcome[Option]:
        """The outcome with the delays; nothing is certain beside a signal that comes late unexplained."""
        shifted = {c.where for c in outcome.causes if c.effect in _SHIFTS}
        outcome = outcome.beside(*(c for c in self.causes if c.where not in shifted))
        left = [d for d in self.doubts if not shifted & _places(d)]
        if not left or not outcome.causes:
            return outcome
        why = f"Not certain: {left[0].what}, which these causes do not explain."
        causes = tuple(replace(c, probability=DOUBTED * c.probability) for c in outcome.causes)
        verdict: Verdict = "cannot_tell" if outcome.verdict in ("named", "compound") else outcome.verdict
        return outcome._replace(verdict=verdict, causes=causes, certain=frozenset(), notes=(*outcome.notes, why))


def found_late(drives: Sequence[Signals], vehicle: Vehicle, model: Model) -> Late:
    """What comes late and is not in the model; of several drives all are doubts: each may have clocks of its own. So is
    a delay beyond its physical bounds."""
    known = {t.place for t in model.terms if t.effect.name in _SHIFTS}
    doubts = [d for s in drives for d in delays_in(s, vehicle) if not known & _places(d)]
    least, most = DELAY.parameters[0].low, DELAY.parameters[0].high
    if len(drives) > 1 or any(len(_places(d)) > 1 or not least <= d.value <= most for d in doubts):
        return Late((), tuple(doubts))
    return Late(tuple(_cause(next(iter(_places(d))), d.value) for d in doubts))


def _places(doubt: Doubt) -> set[str]:
    return {s.partition("_")[0] if s.startswith(("omega", "torque")) else s for s in doubt.signals}


def _cause(where: str, delay: float) -> Cause:
    own = {"delay": Estimate(delay, delay - HALF_S, delay + HALF_S, "s")}
    return Cause(DELAY.name, where, own, ("kinematic",), cause_sentence(DELAY, where, own), MOST)
