"""From residuals to sets of effects with probabilities: a competition on linear signatures visits thousands of sets,
and is repeated around its own best set. The sets that hold most of the posterior are refitted in the simulator, which
gives their evidence anew."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import count

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.core.records import FloatArray
from aqualog.diagnose.arena import Arena, known_only, make_arena
from aqualog.diagnose.channels import CHANNELS
from aqualog.diagnose.compete import Members, Posterior, begin, compete
from aqualog.diagnose.competition import COARSE, fitted_in, joined, placed
from aqualog.diagnose.drive import Drive, led_by
from aqualog.diagnose.elements import moments, with_elements
from aqualog.diagnose.evidence import (
    Calibration,
    Evidence,
    calibrate,
    forgiving,
    make_evidence,
    of_water,
    significance,
    tolerant,
)
from aqualog.diagnose.hypotheses import Hypothesis, residual, signatures, value_in, with_free
from aqualog.diagnose.isolate import compatible, imitations
from aqualog.diagnose.records import Remainder, Significance
from aqualog.diagnose.refit import KNOWN, Metric, Refit, metric, refit, secants, silent
from aqualog.diagnose.threads import beside
from aqualog.diagnose.unexplained import outshone, unknown_forms
from aqualog.diagnose.words import listed, name_of
from aqualog.model.term import Model

__all__ = ["Found", "Option", "search", "sharpened", "simulated"]

AROUND = 2  # times that the competition is repeated around its best set
COVERED, REFITTED = 0.98, 6  # share of the posterior that is refitted, and the most sets
# share of the best set's gain by which the form of a water law may have misjudged another effect of water
FORM = 0.3
NEAR = 10.0  # [nats] behind the best set, within which a single effect is refitted, and the rival of each of its own
# share of what an effect shows that a channel may show more or less than in the simulator, and an interval allows (K)
DOUBT = 0.05
# share of what a set explains, by which a simulator of other structure errs: one more effect has to explain more
STRUCTURE = DOUBT**2
SOFT = ("slip_stiffness", "slip_stiffness_drift")  # beside which every force shows in another slip
UNUSUAL = 3.0  # of its prior's standard deviations, beyond which a value is not listed by a relation alone

Tell = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class Option:
    """A set of blocks of the arena and its log evidence; `refit` None where only the linear one was computed; `beyond`:
    blocks beside it that would stand at a physical bound, which its evidence needs; `relief`: what it gains if the
    simulator may as well have the response exactly."""

    members: Members
    evidence: float
    refit: Refit | None = None
    beyond: Members = ()
    relief: float = 0.0


@dataclass(frozen=True, slots=True)
class Found:
    """Inner products (K + 1, K + 1), `plain` and in `gram` with tolerances, and `calibration` describe what the log can
    distinguish. With unknown `forms`, `arena` and `posterior` are those of all that competes and there are no
    `options`. Else they are those of known effects, and `options` the sets with what they gain; `outshone`: effects
    that a form makes unlikely, by name, with the form."""

    significance: Significance
    plain: FloatArray
    gram: FloatArray
    calibration: Calibration
    arena: Arena
    posterior: Posterior
    forms: tuple[Remainder, ...] = ()
    options: tuple[Option, ...] = ()
    outshone: Mapping[str, str] = field(default_factory=dict)


def simulated(drives: Sequence[Drive], asked: Sequence[Hypothesis], model: Model, tell: Tell) -> Evidence:
    """Residuals of the drives under a model, and their change by every hypothesis."""
    done = count(1)

    def tick() -> None:
        tell("simulating each effect along the drive", 0.05 + 0.15 * next(done) / (len(asked) * len(drives)))

    residuals = [residual(d, model) for d in drives]
    all_signatures = [
        signatures(d, model, asked, base=r, tick=tick) for d, r in zip(drives, residuals, strict=True)
    ]  # fmt: skip
    begun = [
        h if len(drives) == 1 else replace(h, drive=d.name)
        for d, r, s in zip(drives, residuals, all_signatures, strict=True)
        for h in (moments(d, r, asked, s) if len(drives) == 1 or any(h.drive for h in asked) else ())
    ]
    for d, r, s in zip(drives, residuals, all_signatures, strict=True):
        s += signatures(d, model, begun, base=r)
    return make_evidence(drives, (*asked, *begun), residuals, all_signatures, model)


def search(
    evidence: Evidence, model: Model, *, level: float, surrogates: int, seed: int, tell: Tell = lambda _t, _s: None
) -> Found:
    """Unknown forms and known effects in one competition; without a form, known effects alone, refitted, and only if
    the test for any effect finds more than chance at this `level`."""
    tell("comparing known effects", 0.2)
    arena = make_arena(evidence, model)
    # a first answer for whom waits: a tenth of the time that the whole takes
    first = known_only(arena)
    begun = begin(first)

    def look() -> Arena:
        seen = _likeliest(first, compete(first, rounds=1, begun=begun))
        tell(f"at first sight {seen}; comparing with unknown forms", 0.25)
        return first

    both: list[Callable[[], Arena]] = [look, partial(with_elements, arena)]
    arena = beside(lambda f: f(), both)[1]
    known = _repeated(first, compete(first, begun=begun), model)
    posterior = compete(arena := _known_exactly(arena, known[0]))
    k = np.r_[np.arange(evidence.count), -1]
    scale = np.append(arena.sd[: evidence.count], 1.0)
    plain = posterior.gram[np.ix_(k, k)] / np.outer(scale, scale)
    gram = tolerant(evidence, plain)
    calibration = calibrate(evidence, plain, surrogates=surrogates, level=level, seed=seed)
    test = significance(evidence, gram, calibration, level)
    forms = unknown_forms(arena, posterior, seed=seed)
    if forms:
        return Found(test, plain, gram, calibration, arena, posterior, forms)
    so_far = f"so far {_likeliest(arena, posterior)}" if test.p_value <= level else "nothing beyond noise"
    tell(f"{so_far}; comparing known effects", 0.55)
    if test.p_value > level:
        return Found(test, plain, gram, calibration, arena, posterior)
    doubts = outshone(arena, posterior)
    arena, posterior = known
    tell(f"so far {_likeliest(arena, posterior)}; refitting in the simulator", 0.7)
    options = sorted(_refitted(evidence, arena, posterior, model), key=lambda o: -o.evidence)
    return Found(test, plain, gram, calibration, arena, posterior, (), tuple(options), doubts)


def _likeliest(arena: Arena, posterior: Posterior) -> str:
    """The likeliest set for a user who waits: `payload mass (0.93)`."""
    blocks = [arena.blocks[m] for m in posterior.best]
    known = [arena.evidence.asked[b.tag] for b in blocks if b.kind == "effect"]
    names = [name_of(h.effect.name, h.where) for h in known]
    forms = ["an unknown form"] if len(known) < len(blocks) else []
    said = listed([*names, *forms]) if blocks else "no effect"
    return f"{said} ({float(posterior.probability[0]):.2f})"


def _effects(arena: Arena, members: Members) -> list[int]:
    """Hypotheses of a set."""
    return [arena.blocks[m].tag for m in members]


def _start(arena: Arena, posterior: Posterior, members: Members) -> FloatArray:
    """Linear values of a set's effects, as changes. (k,)"""
    fit = fitted_in(arena.blocks, posterior.tolerant, members)
    return np.asarray(fit.mean * arena.sd[fit.columns])


def _repeated(arena: Arena, posterior: Posterior, model: Model) -> tuple[Arena, Posterior]:
    """The competition around its own best set, until that stays the same."""
    done: list[int] = []
    for _ in range(AROUND):
        best = _effects(arena, posterior.best)
        if not best or best == done:
            break
        measure = metric(arena, posterior.weighings)
        led = _led(arena, posterior, model)
        found = refit(led, best, _start(arena, posterior, posterior.best), measure, model)
        if found is None or any(found.bounded):
            break
        arena, done = _around(_softened(arena, led, found, best), found, secants(led, found, model), best), best
        posterior = compete(arena)
    return arena, posterior


def _softened(arena: Arena, led: Evidence, found: Refit, chosen: Sequence[int]) -> Arena:
    """The arena with the signatures of all other effects on tyres as soft as a set has found them.

    A force shows in the slip as its share of the slip stiffness. With the file's, a brake that drags on soft tyres
    would look like two effects.
    """
    asked = arena.evidence.asked
    if not any(asked[i].effect.name in SOFT for i in chosen):
        return arena
    sought = [i for i, h in enumerate(asked) if not (h.allowed or h.effect.drive.begins_like)]
    again = [asked[i] for i in sought]
    found_by = [signatures(d, found.model, again, base=r) for d, r in zip(led.drives, found.residuals, strict=True)]
    columns = [c for i in sought for c in arena.evidence.columns[i]]
    own = [np.concatenate(x) for x in found_by]
    parts = []
    for p in arena.parts:
        changed = p.signatures.copy()
        changed[columns] = own[p.drive][..., p.at]
        parts.append(replace(p, signatures=changed))
    return replace(arena, parts=tuple(parts))


def _led(arena: Arena, posterior: Posterior, model: Model) -> Evidence:
    """The evidence whose drives meet the measured speed under the best set: an effect on the measured velocity would
    get what a load changes of the target speed."""
    evidence, best = arena.evidence, _effects(arena, posterior.best)
    columns = [c for h in best for c in evidence.columns[h]]
    off = np.clip(_start(arena, posterior, posterior.best), evidence.low[columns], evidence.high[columns])
    own = [evidence.asked[i] for i in best]
    values = np.array([value_in(model, h, n) for h in own for n in h.free]) + off
    try:
        found = with_free(model, own, values)
        return replace(evidence, drives=tuple(led_by(d, found) for d in evidence.drives))
    except ConfigError:
        return evidence


def _around(arena: Arena, found: Refit, slopes: Sequence[FloatArray], chosen: Sequence[int]) -> Arena:
    """The arena with a set's signatures from the start to its own values, and the residuals that a linear model with
    these `slopes` would have had at the start. Then the start is as far away for the tolerances as in the simulator: a
    slip slope of two thirds of the file's is one third off, though it shows as half as much slip again."""
    columns = [c for h in chosen for c in arena.evidence.columns[h]]
    parts = []
    for p in arena.parts:
        own, changed = slopes[p.drive], p.signatures.copy()
        changed[columns] = own[..., p.at]
        start = found.residuals[p.drive] + np.tensordot(found.off, own, axes=1)
        parts.append(replace(p, signatures=changed, residual=start[:, p.at]))
    return replace(arena, parts=tuple(parts))


def _known_exactly(arena: Arena, known: Arena) -> Arena:
    """The arena with what a competition of known effects has simulated around its best set. Else an unknown form may
    explain what the straight line of a large delay misses."""
    parts = []
    for p, own in zip(arena.parts, known.parts, strict=True):
        parts.append(replace(p, residual=own.residual, signatures=own.signatures))
    return replace(arena, parts=tuple(parts))


def _refitted(evidence: Evidence, arena: Arena, posterior: Posterior, model: Model) -> list[Option]:
    """The sets of the posterior; those that hold most of it, twins, relations and effects of water are refitted."""
    linear, best = dict(posterior.sets), posterior.best
    chosen, equal = _chosen(evidence, arena, posterior)
    measure = metric(arena, posterior.weighings, coarse=COARSE)
    led = _led(arena, posterior, model)
    y = measure.rows([r[None] for r in evidence.residuals])
    nothing = 0.5 * float(measure.inner(y, y)[0, 0])

    def one(members: Members) -> Option | None:
        own = _effects(arena, members)
        found = refit(led, own, _start(arena, posterior, members), measure, model)
        if found is None:
            return None
        doubted, exact = _evidence(arena, found, own, measure, nothing)
        relief = max(float(np.logaddexp(doubted, exact)) - math.log(2.0) - doubted, 0.0)
        return Option(members, doubted, found, relief=relief)

    done: dict[Members, Option | None] = dict(zip(chosen, beside(one, chosen), strict=True))
    # an effect that does not show where it acts is out of every set; what remains may stand, if all of it shows
    noises, absent = [w.noise for w in posterior.weighings], set[str]()
    shown = {
        m: silent(o.refit, arena, noises, measure) for m, o in done.items() if o is not None and o.refit is not None
    }
    for m, own in shown.items():
        # beside the best set, no further effect has to make visible what does not show in it
        if names := own | (shown.get(best, frozenset()) if set(best) <= set(m) else frozenset()):
            absent |= names
            done[m] = None
            rest = tuple(b for b in m if arena.name(b) not in names)
            if rest and rest not in done:
                left = one(rest)
                done[rest] = None if left and left.refit and silent(left.refit, arena, noises, measure) else left
    within = {}  # the members of a refitted set that are not at a physical bound
    for m, o in done.items():
        if o is not None and o.refit is not None:
            at_bound = [h for (h, _), is_at in zip(o.refit.names, o.refit.bounded, strict=True) if is_at]
            within[m] = tuple(b for b in m if evidence.asked[arena.blocks[b].tag] not in at_bound)
    smaller = [m for m in dict.fromkeys(within.values()) if m and m not in done]
    done |= dict(zip(smaller, beside(one, smaller), strict=True))
    # a value at a bound that means no effect, a trailer of no mass: the set is that of its other effects
    done = {m: None if o and o.refit and _without_effect(o.refit) else o for m, o in done.items()}
    within = {m: kept for m, kept in within.items() if done[m]}
    # water is not linear: without any effect, the simulator may differ from what signatures say of it
    y = measure.rows([residual(d, model)[None] for d in evidence.drives])
    bare = nothing - 0.5 * float(measure.inner(y, y)[0, 0])
    out = _relieved({m: o for m, o in done.items() if o is not None}) | {(): Option((), bare)}
    if best in out and best:
        # what the simulator says more or less of the best set than its signatures, it would say of the others too
        shift = out[best].evidence - linear[best]
        others_of = {m: e for m, e in linear.items() if m not in done and m}
        out |= {m: Option(m, e + shift) for m, e in others_of.items() if not absent & {arena.name(b) for b in m}}
    # of several effects one at its physical bound stands for what no effect is: the set counts as its other effects
    beyond = {b for m, kept in within.items() for b in set(m) - set(kept)}
    for m, kept in within.items():
        if kept and kept in out and out[kept].evidence < out[m].evidence:
            out[kept] = replace(out[kept], evidence=out[m].evidence, beyond=tuple(b for b in m if b not in kept))
    out = {m: o for m, o in out.items() if (within.get(m, m) == m if o.refit else not beyond & set(m))}
    none = max(bare, max(o.evidence for o in out.values()) - posterior.most)
    return _levelled(evidence, arena, out | {(): Option((), none)}, within.get(best, best), equal)


def _without_effect(refit: Refit) -> bool:
    return any(refit.bounded) and bool(np.any(np.abs(refit.off) < 1e-12))


def _relieved(options: dict[Members, Option]) -> dict[Members, Option]:
    """Options where the simulator may as well have the response exactly; of a set, no more than of any smaller one in
    it."""
    out = {}
    for members, o in options.items():
        least = min(own.relief for m, own in options.items() if set(m) <= set(members))
        out[members] = replace(o, evidence=o.evidence + least)
    return out


def _levelled(
    evidence: Evidence, arena: Arena, options: dict[Members, Option], best: Members, equal: set[Members]
) -> list[Option]:
    """Options whose evidence does not rest on what no log shows, or no law of water knows. That a relation takes more
    effects, in these sizes, is no evidence against it. Near floating, slip is proportional to one over the square of
    the remaining contact: the form of the law decides."""
    top = options.get(best)
    structure = STRUCTURE * max(0.0, *(o.evidence for o in options.values()))
    of_water = {m for m in (best, *options) if any(evidence.asked[h].of_water for h in _effects(arena, m))}
    out = []
    for members, o in options.items():
        gained = o.evidence
        if members in equal and o.refit is not None:
            if top is None or top.refit is None or not _plausible(o.refit):
                continue
            gained = top.evidence - 0.5 * max(o.refit.loss - top.refit.loss, 0.0)
        # an effect in place of another; one more has no better claim than its evidence
        elif top is not None and members != best and len(members) <= len(best) and {members, best} <= of_water:
            gained = min(top.evidence, o.evidence + FORM * max(top.evidence, 0.0))
        more = len(best if members in equal else members) - 1
        out.append(replace(o, evidence=gained - structure * max(more, 0)))
    return out


def _evidence(
    arena: Arena, found: Refit, own: Sequence[int], measure: Metric, nothing: float
) -> tuple[float, float]:  # fmt: skip
    """Log of the marginal likelihood of a refitted set with its prior, in the linear model at its values: with doubts
    in what it shows, and where the simulator has this exactly. `nothing`: half the sum of squares without any effect.
    """
    columns = [c for h in own for c in arena.evidence.columns[h]]
    J = measure.rows(found.signatures) * arena.sd[columns, None]
    y = measure.rows([r[None] for r in found.residuals])[0] + (found.off / arena.sd[columns]) @ J
    doubtful = _doubtful(arena, found)
    doubts, exact = measure.rows(doubtful, np.float32), np.concatenate([J, y[None]])
    order = [*range(len(J)), *range(len(exact), len(exact) + len(doubts)), len(J)]  # the residual last
    shared = measure.inner(exact, doubts)
    gram = np.block([[measure.inner(exact, exact), shared], [shared.T, measure.inner(doubts, doubts)]])
    by_tag = {b.tag: b for b in arena.blocks}
    blocks = placed([by_tag[h] for h in own])

    def under(doubt: float) -> float:
        allowed = np.diag(doubt**2 * (np.arange(len(order) - 1) >= len(J)))
        forgiven = forgiving(gram[np.ix_(order, order)], allowed)
        gained = joined(forgiven.gram, blocks, range(len(own))).evidence
        return gained + nothing - 0.5 * float(forgiven.gram[-1, -1]) - forgiven.room

    return under(DOUBT), under(0.0)


def _doubtful(arena: Arena, found: Refit) -> list[FloatArray]:
    """What each value shows in one channel, in that channel and in each other one of its unit, where it is large there.
    (m, C, n) of each drive. A body that pitches on a slope lets the accelerometer show more than the slope, against the
    wheels and the torque: a second effect must not make up for that."""
    channels = arena.parts[0].channels
    count, off = len(channels), found.off
    size, noise = np.zeros((off.size, count)), np.zeros(count)
    for p in arena.parts:
        size += ((off[:, None, None] * found.signatures[p.drive][..., p.at][..., p.mask]) ** 2).sum(axis=-1)
        noise += (found.residuals[p.drive][:, p.at][..., p.mask] ** 2).sum(axis=-1)
    units = np.array([CHANNELS[c].unit for c in channels])
    k, c, to = np.nonzero((units[:, None] == units) & (size[:, :, None] > noise))
    out = [np.zeros((k.size, *own.shape[1:])) for own in found.signatures]
    for each, own in zip(out, found.signatures, strict=True):
        each[np.arange(k.size), to] = off[k, None] * own[k, c]
    return out


def _chosen(evidence: Evidence, arena: Arena, posterior: Posterior) -> tuple[list[Members], set[Members]]:
    """The sets that are refitted; those of them that a relation makes equal to the best one."""
    linear, best = dict(posterior.sets), posterior.best
    covered = 1 + int(np.searchsorted(np.cumsum(posterior.probability), COVERED))
    chosen = [members for members, _ in posterior.sets[: min(covered, REFITTED)]]
    by_hypothesis = {b.tag: i for i, b in enumerate(arena.blocks)}
    equal: set[Members] = set()

    def as_blocks(own: Sequence[int]) -> Members:
        return tuple(sorted(by_hypothesis[h] for h in own)) if all(h in by_hypothesis for h in own) else ()

    of_one = [(i,) for i in of_water(evidence)]
    chosen += [as_blocks(own) for own in _twins(evidence, _effects(arena, best)) + of_one]
    for own in imitations(evidence.asked, _effects(arena, best)):
        if compatible(evidence, own):
            equal.add(as_blocks(own))
    # one effect that two others imitate: its evidence rests on how well the simulator knows what it does
    near = linear[best] - max(NEAR, 2.0 * STRUCTURE * linear[best])
    chosen += [m for m, e in posterior.sets if len(m) == 1 < len(best) and e > near]
    # of each effect its nearest rival, too, rather a small set: sets that differ in small members may come first, and
    # what stands for a large effect as well may be further behind by straight lines than it is
    bent = linear[best] - max(NEAR, DOUBT * linear[best])
    for name in dict.fromkeys(arena.name(b) for b in best):
        others = [(e - 2.0 * STRUCTURE * linear[best] * len(m), m) for m, e in posterior.sets if m and e > bent]
        chosen += [m for _, m in sorted(others, reverse=True) if all(arena.name(b) != name for b in m)][:1]
    return [m for m in dict.fromkeys([*chosen, *sorted(equal)]) if m], equal


def _twins(evidence: Evidence, own: Sequence[int]) -> list[tuple[int, ...]]:
    """The set with one member replaced by its known twin: always refitted, whatever their signatures predict."""
    out = []
    for k, m in enumerate(own):
        for name in evidence.asked[m].effect.twins:
            for i, h in enumerate(evidence.asked):
                members = tuple(sorted((*own[:k], i, *own[k + 1 :])))
                there = h.effect.name == name and h.where in (None, evidence.asked[m].where, h.effect.default)
                there &= h.drive == evidence.asked[m].drive
                if there and len(set(members)) == len(members) and compatible(evidence, members):
                    out.append(members)
    return out


def _plausible(r: Refit) -> bool:
    """Whether every value is worth naming and within three times its usual size: a huge offset is no likely rival."""
    return all(
        abs(x) >= h.worth_naming(n) and abs(v - (p := h.parameter(n)).neutral) <= UNUSUAL * p.sigma
        for (h, n), v, x in zip(r.names, r.values.tolist(), r.off.tolist(), strict=True)
    )


def sharpened(found: Found, option: Option, model: Model) -> tuple[Refit | None, float]:
    """An option's values with only a part of the tolerances, and its loss there: all of them can hide a wrong place, as
    the form of a tyre's curve absorbs a difference between left and right wheel."""
    if option.refit is None:
        return None, math.nan
    evidence, own = found.arena.evidence, _effects(found.arena, option.members)
    columns = [c for h in own for c in evidence.columns[h]]
    led = replace(evidence, drives=tuple(led_by(d, option.refit.model) for d in evidence.drives))
    measure = metric(found.arena, found.posterior.weighings, share=KNOWN, beside=columns)
    again = refit(led, own, option.refit.off, measure, model)
    known = metric(found.arena, found.posterior.weighings, share=KNOWN)

    def loss(r: Refit) -> float:
        y = known.rows([x[None] for x in r.residuals])
        return float(known.inner(y, y)[0, 0])

    best = option.refit if again is None or any(again.bounded) else min(again, option.refit, key=loss)
    return best, loss(best)
