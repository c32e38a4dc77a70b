"""The diagnosis of one or more drives, from signals to verdict."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aqualog.checks.follows import Follow, follow, passed_from
from aqualog.core.errors import ConfigError, SignalError
from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.diagnose import isolate
from aqualog.diagnose.arena import by_drives, competing
from aqualog.diagnose.channels import CHANNELS, block_step, contrasts
from aqualog.diagnose.competition import COARSE
from aqualog.diagnose.consequence import consequences
from aqualog.diagnose.drive import ON_WATER, Drive, calm, floating, led_by, prepare
from aqualog.diagnose.evidence import SURROGATES, Evidence, around_water, recentred, tolerant
from aqualog.diagnose.faster import Late, faster, found_late, joined, with_rings
from aqualog.diagnose.file_values import in_words, not_calibrated, with_known
from aqualog.diagnose.gain import BLOCK_S, KEPT, gains_by_burst, measured_gain
from aqualog.diagnose.grade import HILLY, Profile, find_profile, with_profile
from aqualog.diagnose.hypotheses import Hypothesis, hypotheses, residual
from aqualog.diagnose.isolate import supported
from aqualog.diagnose.next_manoeuvre import Rival, next_manoeuvre
from aqualog.diagnose.noise import Noise, fit_noise
from aqualog.diagnose.outcome import agreements, conclude, contradicted, widened, with_causes
from aqualog.diagnose.records import SURE, Agreement, Consequence, Diagnosis, Gain, Remainder, ResidualView
from aqualog.diagnose.refit import Refit, likeliest, metric, strained
from aqualog.diagnose.search import Found, Option, Tell, search, simulated
from aqualog.diagnose.threads import beside
from aqualog.diagnose.unexplained import slow_force
from aqualog.diagnose.unknown_term import as_term, short_form
from aqualog.diagnose.verdict import Outcome
from aqualog.diagnose.words import listed, term_words, verdict_sentence
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model

__all__ = ["Options", "accelerometer_defect", "diagnose"]

LEAST_USED_S = 20.0
LEAST_CORRELATION = 0.5
LEAST_GAIN, MOST_GAIN = 0.5, 1.5  # bounds of an accelerometer's gain
LEAST_MOTION = 0.1  # [m/s^2] sd of the change of the acceleration
_WET = "Laws of water differ by that much; `aqualog calibrate --wet` fits one to the car's own passes."
_SHARED = "The extended model has what all drives share, not what some have alone."
_MOVES = {"v_x": ("v_x",), "wheel speeds": [f"omega_{w}" for w in WHEELS], "a_x": ("a_x",)}
LEAST_LATE_S = 0.1  # [s] asked about where more than noise is left
SAME = 0.2  # of what a signal changes by from sample to sample, a difference that is rounding


@dataclass(frozen=True, slots=True)
class Options:
    """`level` of false alarms for any effect, `surrogates` for its calibration, 0: none; `seed` of all draws; `views`:
    with the residuals for a page; `consequences`: with the model's effect on the detectors."""

    seed: int = 1
    level: float = 0.01
    surrogates: int = SURROGATES
    views: bool = True
    consequences: bool = True


def diagnose(
    drives: Sequence[tuple[str, Signals]], vehicle: Vehicle, *, model: Model | None = None,
    holdout: Sequence[tuple[str, Signals]] = (), options: Options | None = None, progress: Tell | None = None,
) -> Diagnosis:  # fmt: skip
    """Errors of the model on drives, each with its name, with their causes. The same for the same input and seed.

    The drives were measured with the same car in the same state; each has a noise of its own. `model`: terms that are
    known already; `holdout`: drives that are used only for the gain. `progress` gets the name of each step and the
    share that is done. SignalError if no drive can be used, ConfigError if two drives have the same name.
    """
    options, tell, given = options or Options(), progress or (lambda _text, _share: None), model or Model()
    late = found_late([s for _, s in drives], vehicle, with_known(given, vehicle))
    found = _diagnosed(drives, vehicle, given, holdout, options, tell, Late(doubts=late.doubts))
    left = late.beyond(found.causes)
    test = found.significance
    if found.verdict == "no_effect" and not left.causes and test is not None and test.p_value <= options.level:
        # noise has taken what is left, and no effect gains beside it, a straight line of a delay least of all
        left = found_late([s for _, s in drives], vehicle, with_known(given, vehicle), least=LEAST_LATE_S)
    if found.verdict == "not_testable" or not left.causes:
        return found
    shifted = _diagnosed(drives, vehicle, given, holdout, options, tell, left)
    if shifted.gain is None or shifted.gain.log_score > 0.0:
        return shifted
    said = " ".join(c.sentence for c in left.causes)
    return replace(found, notes=(*found.notes, f"Not named: {said} The drives are predicted worse with it."))


def _diagnosed(
    drives: Sequence[tuple[str, Signals]], vehicle: Vehicle, given: Model, holdout: Sequence[tuple[str, Signals]],
    options: Options, tell: Tell, late: Late,
) -> Diagnosis:  # fmt: skip
    """The diagnosis beside delays that are known from elsewhere."""
    model = known = with_known(given, vehicle)
    tell("preparing", 0.0)
    ready, notes = _prepared(drives, vehicle)
    notes += tuple(f"Known: {term_words(t)}." for t in model.terms[len(given.terms) :])
    if reason := _unusable(ready, drives):
        return Diagnosis(
            "not_testable", f"Not testable: {reason}.", tuple(d.name for d in ready), sum(d.duration_s for d in ready),
            sum(d.used_s for d in ready), model, ready[0].channels, notes=notes,
            caution=not_calibrated(vehicle, ready[0].channels),
        )  # fmt: skip
    names = {d.name for d in ready}
    if (model := Model((*model.terms, *late.terms))).terms:
        ready = [led_by(d, model) for d in ready]
    evidence, model, shifted, roads, untested, about = _simulated(ready, model, late, tell)
    bare = late.without(shifted)
    ready, notes = list(evidence.drives), notes + about
    found = search(evidence, model, level=options.level, surrogates=options.surrogates, seed=options.seed, tell=tell)
    notes += competing(found.arena.parts, ready)
    found, outcome = _with_slow_force(found, conclude(found, model), model)
    chosen = outcome.best.option.refit if outcome.best else None
    agreed = () if chosen is None else agreements(found, chosen)
    outcome = _agreed(outcome, agreed)
    named = {c.key for c in outcome.causes}
    quiet = evidence.residuals if chosen is None else chosen.residuals
    noises = [fit_noise(r, d.mask, contrasts(d.channels)) for r, d in zip(quiet, ready, strict=True)]
    constant = tuple(c for c in outcome.causes if c.effect == "road_grade")
    sloped = outcome._replace(causes=tuple(c for c in outcome.causes if c not in constant))
    named_too = _extended(sloped, chosen, (), shifted, evidence.asked)
    for d in (d for d in ready if d.name in roads):
        outcome = _with_road(outcome, _road(d, named_too, roads[d.name].drive) or roads[d.name])
    outcome = late.beside(outcome)
    hilly = {c.drives for c in outcome.causes if c.effect == "road_grade" and "grade_rms" in c.parameters}
    other = [r.term for r in roads.values() if r.cause.drives not in hilly]
    with_roads = Model(tuple(t for t in model.terms if t not in other)) if hilly else shifted
    # a constant slope that the road's cause stands for is on its hills in the model
    whole = outcome._replace(causes=(*outcome.causes, *(c for c in constant if c not in outcome.causes)))
    extended = _extended(whole, chosen, found.forms, with_roads, evidence.asked)
    seen = faster([(n, s) for n, s in drives if n in names], vehicle, model, seed=options.seed)
    outcome, forms = joined(outcome, seen), (*found.forms, *seen.forms)
    least = isolate.likelier_than_none(evidence, found.arena.blocks, tolerant(evidence, COARSE * found.plain))
    sizes = isolate.reference_sizes(evidence, found.gram, found.calibration.threshold, least)
    before = [_led(d, bare) if d.name in roads or late.causes else residual(d, model) for d in ready]
    differs, is_unclear = extended.terms != bare.terms, outcome.verdict == "cannot_tell"
    alone, settled, after = _at_likeliest(found, evidence, bare, extended) if differs else (bare, extended, before)
    tell("searching for a run that distinguishes the causes" if is_unclear else "measuring the gain", 0.8)
    rivals = [Rival(s.option.refit, q) for s, q in outcome.rivals if s.option.refit is not None]
    last: list[Callable[[], Any]] = []
    if differs:
        last.append(lambda: _gained(ready, holdout, vehicle, (bare, alone, settled), extended, noises[0], options))
    if is_unclear:
        last.append(lambda: next_manoeuvre(evidence, rivals, noises, model))
    done = beside(lambda f: f(), last)
    gained, next_run = done[0] if differs else None, done[-1] if is_unclear else None
    outcome = _by_gain(outcome, gained, frozenset(c.effect for c in (*seen.causes, *late.causes)))
    if outcome.verdict == "no_effect":
        extended, settled, after, gained, next_run = bare, bare, before, None, None
    p, reason = found.significance.p_value, f" ({short_form(forms[0])})" if forms else ""
    sentence = by_drives(found.arena.parts, len(drives)) + verdict_sentence(
        outcome.verdict, outcome.causes, level=options.level, reason=reason, certain=outcome.certain,
        seen=p if p <= options.level else None, untested=untested | seen.untested,
        moved=in_words(bare.terms[len(known.terms) :], evidence.asked, known, vehicle),
        unjudged=[n for d in ready for n in d.notes if ON_WATER in n],
    )  # fmt: skip
    strain = _strained(found, evidence, extended, settled, vehicle)
    return Diagnosis(
        verdict=outcome.verdict,
        sentence=f"{sentence} {strain}".strip() if outcome.verdict == "no_effect" else sentence,
        drives=tuple(d.name for d in ready),
        duration_s=sum(d.duration_s for d in ready),
        used_s=sum(d.used_s for d in ready),
        causes=outcome.causes,
        alternatives=outcome.alternatives,
        significance=found.significance,
        limits=(*isolate.limits(evidence, sizes), *seen.limits),
        confusions=isolate.confusions(evidence, found.gram, sizes),
        remainders=forms,
        manoeuvre=next_run,
        gain=gained,
        model=with_rings(extended, seen).of(""),
        deviations=tuple(t for t in settled.terms if t not in extended.terms),
        channels=ready[0].channels,
        untested=untested | seen.untested,
        notes=(
            *notes,
            *outcome.notes,
            *seen.notes,
            *([strain] if strain and outcome.verdict != "no_effect" else ()),
            *((_SHARED,) if any(c.drives for c in outcome.causes) else ()),
            *((_NOT_HELD_OUT,) if holdout and (gained is None or gained.in_sample) else ()),
        ),
        views=_views(ready, before, after, {n for c in outcome.causes for n in c.drives}) if options.views else (),
        agreement=tuple(a for a in agreed if a.key in named),
        caution=not_calibrated(vehicle, ready[0].channels),
    )


_NOT_HELD_OUT = (
    "The held-out drives are not used: they show no road of another drive, no gain without a cause, and none without "
    "the channels of the diagnosed drives."
)


def _strained(found: Found, evidence: Evidence, extended: Model, settled: Model, vehicle: Vehicle) -> str:
    """What is as far from no effect as a tolerance goes, and is not named; empty without."""
    if settled == extended:  # nothing is named: not looked for yet
        settled = likeliest(evidence, metric(found.arena, found.posterior.weighings), evidence.residuals, extended)
    each = strained(evidence, extended, settled)
    if not each:
        return ""
    said = listed(in_words(each, evidence.asked, extended, vehicle))
    return f"Not named, but at the end of what is tolerated: {said}. Check {'it' if len(each) == 1 else 'them'}."


def _simulated(
    ready: list[Drive], model: Model, late: Late, tell: Tell
) -> tuple[Evidence, Model, Model, dict[str, Profile], dict[str, str], tuple[str, ...]]:
    """Evidence, model, model without roads, roads by drive, effects that are not tested, and notes: each drive's road
    first, then the effects, around values that the file is not sure of."""
    bare = model
    notes: tuple[str, ...] = ()
    found = {d.name: _road(d, model, d.name if len(ready) > 1 else "") for d in ready}
    roads = {n: road for n, road in found.items() if road is not None}
    for road in roads.values():
        # named or not: a car needs more torque uphill, and the torque would appear to be the cause
        model = with_profile(model, road)
    if roads:
        ready = [led_by(d, model) for d in ready]
    ready = [calm(d) for d in ready]
    asked, untested = hypotheses(ready, model)
    asked = late.known(asked)
    evidence = simulated(ready, asked, model, tell)
    moved = recentred(evidence, model)
    if moved != model:
        new = tuple(t for t in moved.terms if t not in model.terms)
        fitted = listed(in_words(new, asked, bare, ready[0].vehicle))
        notes = (f"The vehicle file allows other values. The verdict holds with those that fit best: {fitted}.",)
        model, bare = moved, Model((*bare.terms, *new))
        ready = [led_by(d, model) for d in ready]
        evidence = simulated(ready, asked, model, tell)
    evidence, water = around_water(evidence, model)
    if water is not None and water.effect.belongs == "tyre" and not ready[0].vehicle.water:
        notes += (f"On water the drive is likeliest with {term_words(water)}. {_WET}",)
    return supported(evidence), model, bare, roads, untested, notes


def _agreed(outcome: Outcome[Option], agreed: Sequence[Agreement]) -> Outcome[Option]:
    """The outcome with intervals that hold for all drives, without a name that they contradict."""
    outcome = outcome._replace(causes=tuple(widened(c, agreed) for c in outcome.causes))
    if outcome.verdict not in ("named", "compound") or not contradicted(outcome.causes, agreed):
        return outcome
    return outcome.doubted("the drives contradict each other, see drive by drive.")


def _with_slow_force(found: Found, outcome: Outcome[Option], model: Model) -> tuple[Found, Outcome[Option]]:
    """Where a single drive has no other finding, a force that changes over minutes; several have one each."""
    evidence = found.arena.evidence
    if outcome.verdict != "no_effect" or len(evidence.drives) > 1:
        return found, outcome
    force = slow_force(evidence.drives[0], evidence.residuals[0], model)
    if force is None:
        return found, outcome
    return replace(found, forms=(force,)), outcome._replace(verdict="unexplained")


def _gained(
    ready: Sequence[Drive], holdout: Sequence[tuple[str, Signals]], vehicle: Vehicle,
    models: tuple[Model, Model, Model], extended: Model, noise: Noise, options: Options,
) -> Gain:  # fmt: skip
    """Gain of the last of the models over the given one, on unseen drives if there are any, else on the diagnosed ones;
    what the extended model means for the detectors."""
    own = {id(t) for t in models[0].terms}  # a road is this drive's own

    def elsewhere(m: Model) -> Model:
        return Model(tuple(t for t in m.of("").terms if id(t) in own or t.effect.name != "unexplained_grade"))

    unseen = _prepared(holdout, vehicle)[0] if holdout else []
    is_elsewhere = elsewhere(extended).terms != elsewhere(models[0]).terms  # else no other drive shows it
    unseen = [d for d in unseen if d.channels == ready[0].channels and is_elsewhere]
    effects: tuple[Consequence, ...] = ()
    if options.consequences and "mass" in vehicle.given:
        effects = consequences(vehicle, elsewhere(extended), seed=options.seed)

    def measured(models: tuple[Model, Model, Model]) -> Gain:
        return measured_gain(
            unseen or ready, (*models[:2], elsewhere(models[2])) if unseen else models, noise, seed=options.seed,
            in_sample=not unseen, consequences=effects,
        )  # fmt: skip

    try:
        found = measured(models)
        return replace(found, is_burst=gains_by_burst(ready, models, noise)) if unseen else found
    except ConfigError:  # no car drives there with its likeliest values together
        return measured((models[0], models[0], extended))


def _at_likeliest(
    found: Found, evidence: Evidence, bare: Model, extended: Model
) -> tuple[Model, Model, list[FloatArray]]:  # fmt: skip
    """Both models at the car's likeliest values, and what the second leaves of the drives."""
    measure, left = metric(found.arena, found.posterior.weighings), [_led(d, extended) for d in evidence.drives]
    alone = likeliest(evidence, measure, evidence.residuals, bare)
    settled = likeliest(evidence, measure, left, extended)
    try:
        return alone, settled, [_led(d, settled) for d in evidence.drives]
    except ConfigError:  # no car drives with these values together
        return bare, extended, left


def _by_gain(outcome: Outcome[Option], gained: Gain | None, rings: frozenset[str]) -> Outcome[Option]:
    """The outcome, without a name where the drives gain too little of what it promises them; of held-out drives only a
    name of car or tyre: others may be the diagnosed drive's alone. `rings` are certain without other drives. Where one
    block alone gains, and the rest of the drive loses, there is no answer."""
    if gained is None or outcome.verdict in ("unexplained", "no_effect"):
        return outcome
    if gained.is_burst and not outcome.certain & rings:
        said = " ".join(c.sentence for c in outcome.causes)
        against = f"Not named: {said} Only {BLOCK_S:g} s speak for it, and the rest of the drive against it."
        return Outcome("no_effect", notes=(*outcome.notes, against))
    if gained.log_score > KEPT * gained.promised:
        return outcome
    belong = {EFFECTS[c.effect].belongs for c in outcome.causes if not c.drives}
    stays = gained.in_sample or (bool(belong) and belong <= {"car", "tyre"})
    if not stays or outcome.verdict not in ("named", "compound"):
        return outcome
    whose = "the diagnosed drives" if gained.in_sample else "held-out drives"
    why = f"{whose} are not predicted better with it, or by much less than it promises."
    return outcome.doubted(why, certain=rings)


def _led(drive: Drive, model: Model) -> FloatArray:
    return residual(led_by(drive, model), model)


def _road(drive: Drive, model: Model, name: str) -> Profile | None:
    """The road in what a model leaves, of a drive by its `name`: a force that has a name is no slope."""
    led = led_by(drive, model)
    road = find_profile(led, residual(led, model))
    return None if road is None else replace(road, drive=name)


def _with_road(outcome: Outcome[Option], road: Profile) -> Outcome[Option]:
    cause = road.cause
    if road.rms.value < HILLY or cause.probability < SURE:
        small = f"Significant, but below {HILLY:.0%} rms, from which a road is named"
        why = f"Probability {cause.probability:.2f}, not named" if cause.probability < SURE else small
        return outcome._replace(notes=(*outcome.notes, f"{why}: {cause.sentence}"))
    if outcome.verdict != "cannot_tell" or cause.effect in outcome.certain:
        # one road: a constant slope is its mean, whose interval knows that it is an offset as well
        mean = (cause.effect, cause.drives)
        outcome = outcome._replace(causes=tuple(c for c in outcome.causes if (c.effect, c.drives) != mean))
    is_sure = outcome.verdict != "cannot_tell" or "accelerometer_bias" in outcome.certain
    # an offset of the accelerometer has the constant that a mean would repeat
    if is_sure and any(c.key == "accelerometer_bias@a_x" for c in outcome.causes):
        cause = replace(road, mean=None).cause
    return outcome.beside(cause)


def _extended(
    outcome: Outcome[Option], best: Refit | None, forms: Sequence[Remainder], model: Model, asked: Sequence[Hypothesis]
) -> Model:
    """The model with the named effects of the best set, or those beside an unknown form, and with the forms."""
    own = asked if outcome.verdict == "unexplained" else best.members if best is not None else ()
    extended = with_causes(model, outcome.causes, own)
    for term in map(as_term, forms):
        if term is not None and all(t.effect is not term.effect for t in extended.terms):
            extended = extended.with_term(term)
    return extended


def _prepared(drives: Sequence[tuple[str, Signals]], vehicle: Vehicle) -> tuple[list[Drive], tuple[str, ...]]:
    """Drives that can be used and notes on the others; all have the channels of the first."""
    if len({n for n, _ in drives}) < len(drives):
        raise ConfigError("two drives have the same name", expected="a name of its own for each")
    out: list[Drive] = []
    notes: list[str] = []
    for name, signals in drives:
        try:
            d = prepare(signals, vehicle, name)
        except SignalError as error:
            if len(drives) == 1:
                raise
            notes.append(error.line())
            continue
        if out and d.channels != out[0].channels:
            notes.append(f"{name}: other channels than {out[0].name}, left out")
            continue
        again = next((o.name for o in out if _is_same(o, d)), None)
        if again is not None:
            notes.append(f"{name}: the same drive as {again}, left out: it would count twice")
            continue
        out.append(d)
        notes += [f"{name}: {n}" for n in d.notes]
    if not out:
        raise SignalError("no drive can be used", hint="; ".join(notes[:3]))
    return out, tuple(notes)


def _is_same(a: Drive, b: Drive) -> bool:
    """Whether two logs hold one drive, perhaps in two formats: their signals differ by less than noise does."""
    n = min(a.speed.size, b.speed.size)
    if a.dt != b.dt or abs(a.speed.size - b.speed.size) * a.dt > 0.1:
        return False
    return all(
        float(np.std(a.columns[s][:n] - b.columns[s][:n])) <= SAME * float(np.std(np.diff(a.columns[s][:n])))
        for s in a.present & b.present
    )


def accelerometer_defect(drive: Drive) -> Follow | None:
    """How `a_x` is not the car's longitudinal acceleration, by its changes over 2 s against those of dv/dt, braking
    included; None if it is, or if the speed changes too little for a judgement. It follows the velocity or the mean of
    the wheels' speeds: noise of one of them alone does not show a wrong accelerometer."""
    if "a_x" not in drive.columns:
        return None
    a, wheels = drive.columns["a_x"], [n for n in drive.columns if n.startswith("omega_")]
    # not the course's target: it leads the simulation of a car that is heavier than its file by more than the speed
    speeds = [drive.speed]
    if wheels:
        speeds.append(np.mean([drive.vehicle.r_e(n[-2:]) * drive.columns[n] for n in wheels], axis=0))
    # nor where a wheel floats: the velocity of many references is that of two wheels
    rolls = np.isfinite(a) & ~floating(drive.columns, drive.speed, drive.vehicle, drive.course, ())
    found = [follow(a, v, rolls & np.isfinite(v), drive.dt) for v in speeds]
    moved = [f for f in found if f is not None and f.motion >= LEAST_MOTION]
    if any(f.correlation >= LEAST_CORRELATION and LEAST_GAIN <= f.gain <= MOST_GAIN for f in moved):
        return None
    return max(moved, key=lambda f: f.correlation, default=None)


def _unusable(ready: Sequence[Drive], drives: Sequence[tuple[str, Signals]]) -> str:
    """Why the drives cannot be tested; empty if they can."""
    for d in ready:
        defect = accelerometer_defect(d)
        if defect is not None:
            origin = dict(drives)[d.name].origins.get("a_x")
            channel = origin.channel if origin is not None else "a_x"
            return (
                f"a_x (channel {channel}) is not the acceleration of the car in {d.name}: the correlation of its "
                f"changes with those of the speed is {defect.correlation:.2f}, and their ratio is {defect.gain:.2f}"
            )
        a, v = d.columns.get("a_x", np.empty(0)), d.speed
        # the time constant of the high pass that it has been through
        if a.size and (corner := passed_from(a, v, np.isfinite(a) & np.isfinite(v), d.dt)) is not None:
            return (
                f"a_x of {d.name} forgets what lasts: it is the car's acceleration behind a high pass of about "
                f"{corner:.0f} s, as of a sensor that is coupled without its constant part"
            )
    used = sum(d.used_s for d in ready)
    if used >= LEAST_USED_S:
        return ""
    lacks = [n for n, signals in _MOVES.items() if not any(set(signals) & d.present for d in ready)]
    hint = f"; the log has no {listed(lacks, 'or')}: name the channels in a map (--signals)" if lacks else ""
    return f"{used:.0f} s of usable driving, {LEAST_USED_S:.0f} s are needed{hint}"


def _views(
    drives: Sequence[Drive], before: Sequence[FloatArray], after: Sequence[FloatArray], first: Container[str]
) -> tuple[ResidualView, ...]:
    """Residuals of each drive by channel, without what is left out; drives that alone have a cause come `first`."""
    each = sorted(zip(drives, before, after, strict=True), key=lambda x: x[0].name not in first)
    return tuple(
        ResidualView(
            d.name, c, CHANNELS[c].title, CHANNELS[c].unit, block_step(d.dt), d.coordinates,
            *(np.where(d.mask, x[i], np.nan) for x in own),
        )
        for d, *own in each for i, c in enumerate(d.channels)
    )  # fmt: skip
