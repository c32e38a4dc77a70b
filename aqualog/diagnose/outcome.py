"""From sets with evidence to a verdict: named causes with probabilities, causes that cannot be distinguished; whether
several drives agree on a value, and the value of the others predicts each drive."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aqualog.core.intervals import Z95, chi2_log_p
from aqualog.core.notation import AXLES, SIDES, WHEELS
from aqualog.core.records import FloatArray
from aqualog.diagnose.arena import Arena
from aqualog.diagnose.competition import COARSE, Members, fitted_in
from aqualog.diagnose.hypotheses import Hypothesis, value_in, with_values
from aqualog.diagnose.records import AGREES, SURE, Agreement, ByDrive, Cause, Estimate, tempered
from aqualog.diagnose.refit import KNOWN, PRIOR_WIDTH, Refit, metric, repeats
from aqualog.diagnose.search import DOUBT, Found, Option, sharpened
from aqualog.diagnose.threads import beside
from aqualog.diagnose.unexplained import MOST
from aqualog.diagnose.verdict import CREDIBLE, PLACES, Candidate, Causes, Outcome, candidates, decided, whole
from aqualog.diagnose.words import cause_sentence, name_of
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model

__all__ = ["agreements", "conclude", "contradicted", "widened", "with_causes"]

NEAR_NONE = 1.0 - Z95 / 3.0  # of a value, at which its interval begins where it is three standard deviations
EXPLAINS = 0.03  # relative fall of a channel's rms from which on an effect explains it


def conclude(found: Found, model: Model) -> Outcome[Option]:
    """The verdict on what a search found. An unknown form comes before any name; beside it stand the effects of the
    same set whose probability is 0.95 or more, and whose values are not at a physical bound, but they are not certain.
    A name needs that probability too, and must pass the checks of `refit.repeats`. An only answer that is not named and
    leaves the channels larger than it finds them is noise."""
    if found.forms:
        linear = _linear(found, found.posterior.best, model)
        share = {n: tempered(p) for n, p in found.posterior.marginal.items()}
        causes = (replace(c, probability=share.get(c.name, 0.0)) for c, large in linear if large)
        within = (c for c in causes if c.probability >= SURE and not _is_bounded(c))
        return Outcome("unexplained", tuple(replace(c, probability=min(c.probability, MOST)) for c in within))

    def failing(best: Candidate[Option]) -> tuple[str, ...]:
        chosen, noises = best.option.refit, [w.noise for w in found.posterior.weighings]
        if chosen is None:
            return ()
        instead = [(found.outshone[c.name], c) for c in best.large if c.name in found.outshone]
        doubts = [
            f"{form[:1].upper()}{form[1:]} explains the log better than {name_of(c.effect, c.where)}."
            for form, c in instead
        ]
        doubts += [
            f"the interval of {name_of(c.effect, c.where)} reaches its physical bound." for c, _ in reaching(best)
        ]
        # a member that is too small to be worth naming is not named: its sign says nothing against the others
        return *doubts, *repeats(chosen, found.arena, noises, {(c.key, "".join(c.drives)) for c in best.large})

    def reaching(best: Candidate[Option]) -> list[tuple[Cause, Hypothesis]]:
        members = best.option.refit.members if best.option.refit else ()
        of = {(h.key, h.drive): h for h in members}
        each = ((c, of.get((c.key, "".join(c.drives)))) for c in best.large)
        return [(c, h) for c, h in each if h is not None and _reaches_bound(c, h)]

    def causes_of(o: Option) -> Causes | None:
        if o.refit is not None:
            return _refitted(found, o.refit)
        causes = _linear(found, o.members, model)
        return None if any(_is_absent(c) for c, _ in causes) else causes

    sets = candidates([(o, o.evidence) for o in found.options], causes_of)
    d = decided(sets, lambda group: _at_place(found, group, model), failing)
    if d.verdict == "cannot_tell" and not d.alternatives and d.best:
        is_all = sum(_is_any_size(c, h) for c, h in reaching(d.best)) == len(d.best.large)
        if is_all or not _is_gain(found, d.best.option.refit):
            return Outcome("no_effect", notes=d.notes)
    beyond = [found.arena.evidence.asked[found.arena.blocks[b].tag] for b in d.best.option.beyond] if d.best else []
    told = "would stand at its physical bound. Something else acts there."
    return d._replace(notes=(*d.notes, *(f"Not named: {name_of(h.effect.name, h.where)} {told}" for h in beyond)))


def _is_bounded(cause: Cause) -> bool:
    """Whether a value stands at its physical bound: of the effect, or of this car, which its interval does not pass."""
    bounds = {p.name: (p.low, p.high) for p in EFFECTS[cause.effect].parameters}
    every = cause.parameters.items()
    return any(e.value in bounds.get(n, ()) or (e.low < e.high and e.value in (e.low, e.high)) for n, e in every)


def _reaches_bound(cause: Cause, h: Hypothesis) -> bool:
    """Whether an interval reaches the physical bound that lies away from no effect."""
    each = ((h.parameter(n), e) for n, e in cause.parameters.items() if n in h.free)
    ends = ((p.neutral, p.high, e.high) if e.value > p.neutral else (p.neutral, p.low, e.low) for p, e in each)
    return any(far == end != neutral for neutral, far, end in ends)


def _is_any_size(cause: Cause, h: Hypothesis) -> bool:
    """Whether intervals begin so near to no effect that the size is unknown: tyres 1.3 to 2.5 times as stiff."""
    each = ((h.parameter(n).neutral, e) for n, e in cause.parameters.items() if n in h.free)
    return all(min(abs(e.low - x), abs(e.high - x)) < NEAR_NONE * abs(e.value - x) for x, e in each)


def _is_absent(cause: Cause) -> bool:
    """Whether a fitted value stands at a bound that means no effect: a trailer of no mass is drag alone."""
    effect = EFFECTS[cause.effect]
    fitted = ((p, cause.parameters.get(p.name)) for p in effect.parameters[: effect.drive.count])
    return any(e is not None and e.value == p.neutral and p.neutral in (p.low, p.high) for p, e in fitted)


def _at_place(found: Found, group: Sequence[Candidate[Option]], model: Model) -> Candidate[Option]:
    """The set at the whole car, unless another place is clearly better; with the values that a metric of few
    tolerances gives. One effect at two places has to be likelier with all tolerances, too: few forgive no error of the
    simulator."""
    top, count = group[0].share, len(group[0].causes)
    near = [s for s in group if s.option.refit and s.share > top / CREDIBLE and len(s.causes) <= count]
    if not near:
        return group[0]

    def sharper(s: Candidate[Option]) -> Candidate[Option]:
        refit, loss = sharpened(found, s.option, model)
        causes = _refitted(found, refit) if refit is not None else s.causes
        kept = replace(s, option=replace(s.option, refit=refit), causes=causes, sharp=loss)
        # with fewer tolerances a value may fall below what is worth naming
        return kept if kept.names == s.names else replace(s, sharp=loss)

    sharp = beside(sharper, near)
    best = min(s.sharp for s in sharp)
    as_good = [s for s in sharp if COARSE * (s.sharp - best) < 2.0 * math.log(PLACES)]
    picked = max(as_good, key=lambda s: (whole(s), s.share))
    # what was not refitted has its share of straight lines
    open_to = [*as_good, *(s for s in group if s.option.refit is None)]
    torn = (s for s in open_to if s.share > picked.share / PLACES and s.names == picked.names and _apart(s, picked))
    return replace(picked, torn=tuple(torn))


def _apart(a: Candidate[Option], b: Candidate[Option]) -> bool:
    """Whether one effect is at wheels of its own in each of two sets."""
    at = {(c.effect, c.drives): _wheels(c) for c in b.large}
    each = ((_wheels(c), at.get((c.effect, c.drives))) for c in a.large)
    return any(own and there and own.isdisjoint(there) for own, there in each)


def _wheels(cause: Cause) -> frozenset[str]:
    """Wheels at which a cause is; none where it is no matter of wheels."""
    where = cause.where or ""
    return frozenset(AXLES.get(where) or SIDES.get(where) or (where,)) & frozenset(WHEELS)


def _refitted(found: Found, r: Refit) -> Causes:
    """The members of a refitted set with values, intervals and sentences, and whether each is worth naming."""
    sd = np.sqrt(np.diag(r.covariance))
    out = []
    for h in r.members:
        k = [k for k, (owner, _) in enumerate(r.names) if owner is h]
        explains = _explains(found.arena, [r.before(d, k) for d in range(len(r.residuals))], r.residuals)
        out.append(_cause(h, r.values[k], r.off[k], sd[k], explains))
    return tuple(out)


def _linear(found: Found, members: Members, model: Model) -> Causes:
    """The known effects of a set with their values in the competition, and whether each is worth naming."""
    if not members:
        return ()
    arena = found.arena
    fit = fitted_in(arena.blocks, found.posterior.tolerant, members)
    sd = np.sqrt(np.diag(fit.covariance)) * arena.sd[fit.columns]
    mean = fit.mean * arena.sd[fit.columns]
    out = []
    for b in (arena.blocks[m] for m in members):
        if b.kind != "effect":
            continue  # an unknown form
        h, k = arena.evidence.asked[b.tag], [fit.columns.index(c) for c in b.columns]
        now = np.array([value_in(model, h, n) for n in h.free])
        made = [np.tensordot(mean[k], s[list(b.columns)], axes=1) for s in arena.evidence.signatures]
        before = arena.evidence.residuals
        explains = _explains(arena, before, [x - m for x, m in zip(before, made, strict=True)])
        out.append(_cause(h, now + mean[k], mean[k], sd[k], explains))
    return tuple(out)


def _cause(
    h: Hypothesis, values: FloatArray, off: FloatArray, sd: FloatArray, explains: tuple[str, ...]
) -> tuple[Cause, bool]:
    """A cause, and whether a value reaches its smallest size and its interval excludes zero effect; the interval also
    covers that the car's response is a few per cent off the simulator's, or a tyre's."""
    sd = np.hypot(sd, math.hypot(DOUBT, h.effect.drive.doubt) * off)
    parameters, large = {}, False
    for name, x, change, s in zip(h.free, values.tolist(), off.tolist(), sd.tolist(), strict=True):
        p = h.parameter(name)
        v = min(max(x, p.low), p.high)
        parameters[name] = Estimate(v, max(v - Z95 * s, p.low), min(v + Z95 * s, p.high), p.unit)
        large |= abs(change) >= max(h.worth_naming(name), Z95 * s)
    for name, value in h.fixed.items():
        if name in {p.name for p in h.effect.parameters} and name not in parameters:
            parameters[name] = Estimate(float(value), math.nan, math.nan, h.parameter(name).unit)
    drives = (h.drive,) if h.drive else ()
    sentence = cause_sentence(h.effect, h.where, parameters, drives)
    return Cause(h.effect.name, h.where, parameters, explains, sentence, drives=drives), large


def _is_gain(found: Found, r: Refit | None) -> bool:
    """Whether a refitted set makes the channels' rms smaller on the whole; one that is not refitted may."""
    if r is None:
        return True
    before = [r.before(d) for d in range(len(r.residuals))]
    return bool(_falls(found.arena, before, r.residuals).sum() > 0.0)


def _falls(arena: Arena, before: Sequence[FloatArray], after: Sequence[FloatArray]) -> FloatArray:
    """Share by which each channel's rms falls, from residuals without and with an effect."""
    drives = arena.evidence.drives
    fall = np.zeros(len(drives[0].channels))
    for d, x, y in zip(drives, before, after, strict=True):
        then, now = (np.sqrt((z[:, d.mask] ** 2).mean(axis=1)) for z in (x, y))
        fall += then / np.maximum(now, 1e-15) - 1.0
    return np.asarray(fall / len(drives))


def _explains(arena: Arena, before: Sequence[FloatArray], after: Sequence[FloatArray]) -> tuple[str, ...]:
    """Channels whose rms falls, from residuals without and with an effect."""
    fall, channels = _falls(arena, before, after), arena.evidence.drives[0].channels
    return tuple(c for c, x in zip(channels, fall.tolist(), strict=True) if x > EXPLAINS) or (
        channels[int(np.argmax(fall))],
    )


def with_causes(model: Model, causes: Sequence[Cause], asked: Sequence[Hypothesis]) -> Model:
    """The model with causes at their values; a road's profile has none of these, and is a term of its own."""
    found = []
    for c in causes:
        values = {n: e.value for n, e in c.parameters.items()}
        for h in asked:
            is_it = (h.key, (h.drive,) if h.drive else ()) == (c.key, c.drives)
            if is_it and set(h.free) <= set(values) and all(values.get(n, v) == v for n, v in h.fixed.items()):
                found.append((h, {n: values[n] for n in h.free}))
                break
    return with_values(model, found)


def agreements(found: Found, r: Refit) -> tuple[Agreement, ...]:
    """One agreement for each value of the refitted set, by the linear model there; empty for a single drive. Tolerances
    count for each drive, as if the file had a different error in each."""
    evidence = found.arena.evidence
    drives = [evidence.drives[p.drive] for p in found.arena.parts]
    if len(drives) < 2:
        return ()
    columns = [c for h in r.members for c in evidence.columns[evidence.asked.index(h)]]
    G, b, apart = _normal(found, r, columns)
    keep = np.diag([(PRIOR_WIDTH * h.parameter(n).sigma) ** -2.0 for h, n in r.names])
    alone = np.array([np.linalg.solve(g + keep, x) for g, x in zip(G, b, strict=True)])
    # the car's drive-to-drive spread is added to the variance of a single drive's value
    sd = np.array([np.sqrt(np.diag(np.linalg.inv(g + keep)) + apart**2) for g in G])
    others = np.array([np.linalg.solve(G.sum(axis=0) - g + keep, b.sum(axis=0) - x) for g, x in zip(G, b, strict=True)])
    bare = np.where([bool(h.drive) for h, _ in r.names], 0.0, -r.off)  # no gain of what one drive alone has
    gains = [0.5 * (_loss(g, x, bare) - _loss(g, x, o)) for g, x, o in zip(G, b, others, strict=True)]
    out = []
    for k, (h, name) in enumerate(r.names):
        if h.drive:
            continue  # nothing to agree on
        around = zip((r.values[k] + alone[:, k]).tolist(), (Z95 * sd[:, k]).tolist(), strict=True)
        each = [Estimate(v, v - half, v + half, h.parameter(name).unit) for v, half in around]
        p = 10.0 ** -chi2_log_p(_heterogeneity(each), len(drives) - 1)
        of_drives = tuple(
            ByDrive(d.name, e, float(r.values[k] + o), float(gain))
            for d, e, o, gain in zip(drives, each, others[:, k], gains, strict=True)
        )
        out.append(Agreement(h.key, name, of_drives, p))
    return tuple(out)


def widened(cause: Cause, found: Sequence[Agreement]) -> Cause:
    """The cause with intervals widened by Birge's ratio (K) where the drives differ more than their errors allow."""
    parameters = dict(cause.parameters)
    bounds = {p.name: (p.low, p.high) for p in EFFECTS[cause.effect].parameters}
    for a in found:
        if cause.drives or a.key != cause.key or a.p_value >= AGREES or a.parameter not in parameters:
            continue
        low, high = bounds[a.parameter]
        e = parameters[a.parameter]
        ratio = math.sqrt(max(_heterogeneity([d.alone for d in a.drives]) / (len(a.drives) - 1), 1.0))
        half = 0.5 * (e.high - e.low) * ratio
        parameters[a.parameter] = replace(e, low=max(e.value - half, low), high=min(e.value + half, high))
    if parameters == dict(cause.parameters):
        return cause
    sentence = cause_sentence(EFFECTS[cause.effect], cause.where, parameters)
    return replace(cause, parameters=parameters, sentence=sentence)


def contradicted(causes: Sequence[Cause], found: Sequence[Agreement]) -> bool:
    """Whether a cause is in some drives and not in others: they differ, and its interval holds no effect."""
    differ = {a.key for a in found if a.p_value < AGREES}
    neutral = {(c.effect, p.name): p.neutral for c in causes for p in EFFECTS[c.effect].parameters}
    shared = [c for c in causes if c.key in differ and not c.drives]
    by_cause = [[(neutral.get((c.effect, n), math.nan), e) for n, e in c.parameters.items()] for c in shared]
    return any(all(e.low <= x <= e.high for x, e in own) for own in by_cause)


def _heterogeneity(each: Sequence[Estimate]) -> float:
    """Sum of squared deviations from the weighted mean in standard deviations: chi^2 of one degree less than values."""
    values = np.array([e.value for e in each])
    weight = np.array([(2.0 * Z95 / (e.high - e.low)) ** 2 for e in each])
    return float((weight * (values - float(weight @ values) / float(weight.sum())) ** 2).sum())


def _normal(found: Found, r: Refit, columns: Sequence[int]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Normal equations of each drive around the set's values (D, k, k), (D, k), and the spread between drives (k,)."""
    G, b = [], []
    for i, (p, w) in enumerate(zip(found.arena.parts, found.posterior.weighings, strict=True)):
        own = replace(found.arena, parts=(p,), rows=found.arena.rows[i : i + 1])
        measure = metric(own, [w], share=KNOWN, beside=columns)
        J, y = measure.rows(r.signatures), measure.rows([x[None] for x in r.residuals])
        G.append(measure.inner(J, J))
        b.append(measure.inner(J, y)[:, 0])
    return np.array(G), np.array(b), measure.apart[list(columns)]


def _loss(G: FloatArray, b: FloatArray, delta: FloatArray) -> float:
    """Sum of squares without its constant, at values that differ by `delta` from the set's."""
    return float(delta @ G @ delta - 2.0 * b @ delta)
