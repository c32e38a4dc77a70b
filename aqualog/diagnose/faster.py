"""What a log shows beside the residuals of the search, joined to the verdict: uneven tone rings, seams of the log, and
signals that come so late that the competition did not find it. Their lags are known to hundredths of a second from
curves and braking, which the force balance leaves out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from aqualog.checks.delays import LATE_S, delays_in
from aqualog.checks.doubts import Doubt
from aqualog.core.intervals import Z95
from aqualog.core.notation import AXLES, SIDES, WHEELS, side_of
from aqualog.core.records import FloatArray, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.full_rate import LEVEL, Kind, PerTurn, per_turn, wheel_columns
from aqualog.diagnose.hypotheses import Hypothesis
from aqualog.diagnose.isolate import POWER
from aqualog.diagnose.records import MOST, SURE, Cause, Estimate, Limit, Remainder, Verdict, tempered
from aqualog.diagnose.seams import seams
from aqualog.diagnose.search import DOUBT, Option
from aqualog.diagnose.shapes import POINTS
from aqualog.diagnose.verdict import Outcome
from aqualog.diagnose.words import cause_sentence, place
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model, Term

__all__ = [
    "Faster", "Late", "faster", "found_late", "joined", "limits", "odd_wheels", "pooled", "remarks", "to_causes",
    "why_untested", "with_rings", "without_known",
]  # fmt: skip

SHOWN = 5e-4  # smallest amplitude that is worth a remark
SOUND = 20.0  # cars without a fault of this kind for one with it (K)
# amplitude from which a wheel may be odd, and how many times that of any other wheel: on a measured sound car all four
# vary alike, by up to 0.12 % once per turn (D)
ODD, TIMES = 1e-3, 3.0
_OFTEN = {1: "once", 2: "twice", 3: "3 times"}  # by the order
_RING = EFFECTS["tone_ring"]
_AMPLITUDE = _RING.parameters[0]
HALF_S = 0.15  # [s] of the 95 % interval: by so much filters of three measured cars differ (D)
DOUBTED = 0.5  # of a probability beside a signal that comes late, which no set of effects explains (K)
DELAY = EFFECTS["signal_delay"]
_SHIFTS = ("signal_delay", "clock_skew")


class Faster(NamedTuple):
    """Causes of all drives together, sentences on what is no cause, why an effect cannot be tested, by name, the
    detection limits of the others, and what varies with a wheel's angle as no effect makes it."""

    causes: tuple[Cause, ...] = ()
    notes: tuple[str, ...] = ()
    untested: dict[str, str] = {}  # noqa: RUF012 (a default that nobody changes)
    limits: tuple[Limit, ...] = ()
    forms: tuple[Remainder, ...] = ()


def faster(drives: Sequence[tuple[str, Signals]], vehicle: Vehicle, model: Model, *, seed: int = 1) -> Faster:
    """Look at the signals of one car in one state at their own rate. Rings that the `model` has are no finding at that
    size; `seed`: of the permutations that calibrate the search for seams."""
    found = pooled([per_turn(wheel_columns(s), s.dt, s.origins) for _, s in drives])
    sharp = limits(found)
    found = without_known(found, _known(model))
    causes = to_causes(found)
    notes = [f"Not named (probability {c.probability:.2f}): {c.sentence}" for c in causes if c.probability < SURE]
    notes += remarks(found)
    for name, s in drives:
        own = f"{name}: " if len(drives) > 1 else ""
        notes += [own + seam.sentence for seam in seams(s, vehicle, seed=seed)]
    reason = why_untested(found)
    named = tuple(c for c in causes if c.probability >= SURE)
    return Faster(named, tuple(notes), {_RING.name: reason} if reason else {}, sharp, odd_wheels(found))


def joined(outcome: Outcome[Option], seen: Faster) -> Outcome[Option]:
    """The outcome with the causes beside its own: they act on no residual of the search, so neither hides the other."""
    is_form = bool(seen.forms) and outcome.verdict in ("no_effect", "named", "compound")
    outcome = outcome.beside(*seen.causes)
    return outcome._replace(verdict="unexplained") if is_form else outcome


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
    for t in (t for t in model.terms if t.effect is _RING):
        for w in (w for w in WHEELS if t.place in (w, w[0], side_of(w))):
            out[w] = out.get(w, 0.0) + t.values.get("amplitude", 0.0)
    return out


def to_causes(found: Sequence[PerTurn]) -> tuple[Cause, ...]:
    """What is found once per turn as causes `tone_ring`, larger than the effect's smallest size, those of an axle or a
    side with one value together."""
    rings = {f.wheel: f for f in found if f.order == 1 and f.kind == "ring" and f.amplitude >= _AMPLITUDE.smallest}
    out = []
    for where, wheels in (*AXLES.items(), *SIDES.items()):
        pair = [rings[w] for w in wheels if w in rings]
        if len(pair) == 2 and max(f.low for f in pair) <= min(f.high for f in pair):
            out.append((where, pair))
            for w in wheels:
                del rings[w]
    out += [(w, [f]) for w, f in rings.items()]
    causes = []
    for where, pair in out:
        mean = float(np.mean([f.amplitude for f in pair]))
        half = 0.5 * math.sqrt(sum((f.high - f.low) ** 2 for f in pair)) / len(pair)
        half = math.hypot(half, Z95 * DOUBT * mean)  # filters of control units and loggers
        value = Estimate(mean, max(mean - half, 0.0), mean + half, _AMPLITUDE.unit)
        own, channels = {_AMPLITUDE.name: value}, tuple(f"omega_{f.wheel}" for f in pair)
        sentence = cause_sentence(_RING, where, own)
        causes.append(Cause(_RING.name, where, own, channels, sentence, _probability(pair, value)))
    return tuple(causes)


def odd_wheels(found: Sequence[PerTurn]) -> tuple[Remainder, ...]:
    """Wheels whose speed varies with their angle much more than any other wheel's, and not as a ring makes it: a force
    with every turn, a tyre out of true, an uneven pick-up."""
    out = []
    angle: FloatArray = np.linspace(0.0, 2.0 * math.pi, POINTS)
    for f in found:
        times = _times(f, found)
        if not times:
            continue
        how = f"the speed of wheel {f.wheel.upper()}, varying {_OFTEN[f.order]} per turn by {f.amplitude:.2%}, "
        how += f"{times:.0f} times as much as any other wheel's"
        p = tempered(1.0 / (1.0 - SOUND * math.e * f.p_value * math.log(max(f.p_value, 1e-300))))
        said = f"Unexplained: {how} (probability {p:.2f})."
        made, half = f.amplitude * np.cos(f.order * angle), 0.5 * (f.high - f.low)
        out.append(Remainder(
            f"slip_{f.wheel}", ("angle",), math.nan, f.p_value, angle[:, None], made, made - half, made + half, (),
            None, math.nan, said, "slip", "-", p, how,
        ))  # fmt: skip
    return tuple(out)


def _times(f: PerTurn, found: Sequence[PerTurn]) -> float:
    """How many times as much as any other wheel's a speed varies, where that is an unknown form; else 0."""
    is_ring = (f.order == 1 and f.kind == "ring") or any(f"omega_{f.wheel}" in c.explains for c in to_causes(found))
    others = [o.amplitude for o in found if o.order == f.order and o.wheel != f.wheel and o.kind != "untested"]
    times = f.amplitude / max(*others, 1e-5) if others and f.found and not is_ring else 0.0
    return times if f.amplitude >= ODD and times >= TIMES else 0.0


def limits(found: Sequence[PerTurn]) -> tuple[Limit, ...]:
    """Amplitude of a ring that is named with a power of 0.9, of each wheel and of axles and sides with one value; NaN
    beyond the effect's bound, and where a resonance covers it."""
    p = _AMPLITUDE
    once = {f.wheel: f for f in found if f.order == 1 and f.kind != "untested"}
    own = {w: (w,) for w in once} | {k: v for k, v in (AXLES | SIDES).items() if all(w in once for w in v)}
    sure = sum(NormalDist().inv_cdf(q) for q in (SURE, POWER))
    out = []
    for where, wheels in own.items():
        sd = 0.5 / Z95 * math.hypot(*(once[w].high - once[w].low for w in wheels)) / len(wheels)
        size = p.smallest + sure * math.hypot(sd, DOUBT * p.smallest)
        size = p.smallest + sure * math.hypot(sd, DOUBT * size)  # the doubt is a share of the amplitude itself
        hidden = size > p.high or any(once[w].kind == "speed" for w in wheels)
        out.append(Limit(_RING.name, where, math.nan if hidden else size, p.unit, p.smallest))
    return tuple(out)


def _probability(wheels: Sequence[PerTurn], value: Estimate) -> float:
    """That it is there, by the bound -e p ln p of each wheel's p-value on the evidence for chance [sellke2001], and
    larger than what sound wheels show, by the interval as of a normal distribution."""
    there = 1.0
    for f in wheels:
        p = min(max(f.p_value, 1e-300), math.exp(-1.0))
        there *= 1.0 / (1.0 - SOUND * math.e * p * math.log(p))
    sd = max((value.value - value.low) / Z95, 1e-12)
    return there * NormalDist().cdf((value.value - _AMPLITUDE.smallest) / sd)


def pooled(by_drive: Sequence[Sequence[PerTurn]]) -> tuple[PerTurn, ...]:
    """Drives of one car together: amplitudes weighted by their intervals, the smallest p-value times the drives."""
    drives: dict[tuple[str, int], list[PerTurn]] = {}
    for f in (f for found in by_drive for f in found):
        drives.setdefault((f.wheel, f.order), []).append(f)
    return tuple(_together(own) for own in drives.values())


def _together(own: Sequence[PerTurn]) -> PerTurn:
    tested = [f for f in own if f.kind != "untested"]
    if len(tested) < 2:
        return (tested or own)[0]
    surest = min(tested, key=lambda f: f.p_value)
    p = min(1.0, surest.p_value * len(tested))
    weight = np.array([max(f.high - f.low, 1e-9) ** -2.0 for f in tested])
    weight /= weight.sum()
    mean = float(weight @ [f.amplitude for f in tested])
    half = 0.5 * math.sqrt(float(weight**2 @ [(f.high - f.low) ** 2 for f in tested]))
    kind: Kind = "nothing" if p > LEVEL else "speed" if any(f.kind == "speed" for f in tested) else "ring"
    return replace(surest, kind=kind, amplitude=mean, low=max(mean - half, 0.0), high=mean + half, p_value=p)


def without_known(found: Sequence[PerTurn], known: Mapping[str, float]) -> tuple[PerTurn, ...]:
    """Without what a model's tone rings give already, by wheel: no more than the smallest size from it."""
    least = _AMPLITUDE.smallest
    return tuple(f for f in found if f.order > 1 or abs(f.amplitude - known.get(f.wheel, math.inf)) >= least)


def why_untested(found: Sequence[PerTurn]) -> str:
    """Why no wheel could be tested; empty if one was, or if a model knows the rings of all others."""
    once = [f for f in found if f.order == 1]
    if not found:
        return "no wheel speeds in the log"
    return "" if any(f.kind != "untested" for f in once) else " and ".join(sorted({f.reason for f in once}))


def remarks(found: Sequence[PerTurn]) -> tuple[str, ...]:
    """Sentences about what is found and is no cause."""
    out, small = [], []
    for f in found:
        if not f.found or (f.most if f.kind == "speed" else f.amplitude) < SHOWN or _times(f, found):
            continue
        what = f"The wheel speed{place(f.wheel)} varies {_OFTEN[f.order]} per turn by {f.amplitude:.2%}"
        if f.kind == "speed":
            out.append(f"{what}; {f.reason or 'not at all speeds'}: a resonance or the tyre, not the tone ring.")
        elif f.order > 1:
            out.append(f"{what} at all speeds: the tyre or the pick-up, not an eccentric ring.")
        elif f.amplitude < _AMPLITUDE.smallest:
            small.append(f"{f.amplitude:.2%}{place(f.wheel)}")
    if small:
        out.append(f"Wheel speeds vary once per turn, too little to be worth naming: by {', '.join(small)}.")
    if to_causes(found):
        out.append("A tyre or rim that runs out of true, by its share of the radius, looks like an uneven tone ring.")
    return tuple(out)


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


def found_late(drives: Sequence[Signals], vehicle: Vehicle, model: Model, *, least: float = LATE_S) -> Late:
    """What comes late by `least` [s] or more and is not in the model; of several drives all are doubts: each may have
    clocks of its own. So is a delay beyond its physical bounds."""
    known = {t.place for t in model.terms if t.effect.name in _SHIFTS}
    doubts = [d for s in drives for d in delays_in(s, vehicle, least=least) if not known & _places(d)]
    low, high = DELAY.parameters[0].low, DELAY.parameters[0].high
    if len(drives) > 1 or any(len(_places(d)) > 1 or not low <= d.value <= high for d in doubts):
        return Late((), tuple(doubts))
    return Late(tuple(_cause(next(iter(_places(d))), d.value) for d in doubts))


def _places(doubt: Doubt) -> set[str]:
    return {s.partition("_")[0] if s.startswith(("omega", "torque")) else s for s in doubt.signals}


def _cause(where: str, delay: float) -> Cause:
    own = {"delay": Estimate(delay, delay - HALF_S, delay + HALF_S, "s")}
    return Cause(DELAY.name, where, own, ("kinematic",), cause_sentence(DELAY, where, own), MOST)
