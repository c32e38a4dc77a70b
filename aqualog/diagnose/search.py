"""From residuals to the sets of effects that explain them, adding effects until the test finds no more."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from aqualog.core.notation import AXLES
from aqualog.core.records import FloatArray
from aqualog.diagnose.any_effect import Calibration, bonferroni, calibrate, chance, gumbel_p, largest
from aqualog.diagnose.channels import contrasts
from aqualog.diagnose.drive import Drive, led_by
from aqualog.diagnose.evidence import Evidence, make_evidence, noises_after
from aqualog.diagnose.hypotheses import THREADS, Hypothesis, residual, signatures, value_in
from aqualog.diagnose.noise import Noise, bridged, fit_noise, spectra
from aqualog.diagnose.records import Significance
from aqualog.diagnose.refit import KNOWN, Metric, Refit, metric, refit, whitened_residual
from aqualog.diagnose.subsets import SetFit, best_sets, compatible, fit_set, imitations
from aqualog.model.term import Model

__all__ = ["CREDIBLE", "Candidate", "Found", "search", "simulated"]

MOST = 3  # effects in one set
CREDIBLE = 20.0  # evidence ratio within which sets cannot be distinguished
REFITTED = 6  # sets that are refitted in the simulator
# of twice the log-likelihood by which a linear signature may have misjudged a set, and the share of its gain
SLACK, BENT = 8.0, 0.05
# factor on the threshold for every further effect: errors of the simulator grow with the size of the hidden effects
FURTHER = 1.5
# share of the best set's gain by which the form of a water law may have misjudged another effect of water
FORM = 0.3
UNUSUAL = 3.0  # of its prior's standard deviations, beyond which a value is not listed by a relation alone
HALF = 0.5  # share of the test's threshold that a set must still gain after refitting
PER_PARAMETER = 6.0  # of twice the log-likelihood that a further parameter must gain

Tell = Callable[[str, float], None]


@dataclass(frozen=True, slots=True)
class Candidate:
    """A refitted set with the ratio of the best set's evidence to its own; `inflation` of the noise's variances.

    `sharp`: its loss with only a part of the tolerances, in a metric that all candidates share; it distinguishes places
    of one effect. NaN where it was not computed.
    """

    refit: Refit
    evidence_ratio: float
    inflation: float
    sharp: float = math.nan

    @property
    def sd(self) -> FloatArray:
        """Standard deviations of the values; the drive-to-drive spread is not scaled with the noise. (k,)"""
        variance = np.diag(self.refit.covariance)
        days = self.refit.apart**2 if self.refit.apart is not None else np.zeros_like(variance)
        return np.asarray(np.sqrt((variance - days) * self.inflation + days))


@dataclass(frozen=True, slots=True)
class Found:
    """`tests`: one for each effect that was looked for, the last one without a finding. `gram` and `calibration` are
    those of the first test and describe what the log can distinguish. `candidates` best first, empty without a finding.
    `noises` after the best set. """  # fmt: skip

    tests: tuple[Significance, ...]
    gram: FloatArray
    calibration: Calibration
    candidates: tuple[Candidate, ...]
    noises: tuple[Noise, ...]


def simulated(drives: Sequence[Drive], asked: Sequence[Hypothesis], model: Model, tell: Tell) -> Evidence:
    """Residuals of the drives under a model, and their change by every hypothesis."""
    residuals, all_signatures = [], []
    total = len(asked) * len(drives)
    done = [0]

    def tick() -> None:
        done[0] += 1
        tell("simulating each effect along the drive", 0.02 + 0.28 * done[0] / total)

    for d in drives:
        residuals.append(residual(d, model))
        all_signatures.append(signatures(d, model, asked, base=residuals[-1], tick=tick))
    values = {(i, n): value_in(model, h, n) for i, h in enumerate(asked) for n in h.free}
    return make_evidence(drives, asked, residuals, all_signatures, values)


def search(
    evidence: Evidence, model: Model, *, level: float, surrogates: int, seed: int, tell: Tell = lambda _t, _s: None
) -> Found:
    """Test, best set, refit; repeated beside that set until the test finds no more or the set has three effects."""
    tests: list[Significance] = []
    first: tuple[FloatArray, Calibration] | None = None
    accepted: tuple[int, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    work = evidence
    while True:
        tell("testing for any effect" if not accepted else "testing for one more effect", 0.3 + 0.1 * len(tests))
        gains, gram = largest(work, work.residuals, accepted)
        if first is not None and (nothing := _surely_nothing(work, gains, first[1], level)) is not None:
            tests.append(nothing)
            break
        sets = best_sets(work, gram, len(accepted) + 1, within=0.0, most=1) if len(accepted) < MOST else []
        quiet = _after(work, sets[0]) if sets else list(work.residuals)
        calibration = calibrate(
            work, quiet, gram, base=accepted, surrogates=surrogates, level=level, seed=seed + len(tests)
        )
        tests.append(_tested(work, gains, accepted, calibration, level, surrogates))
        first = first or (gram, calibration)
        least = FURTHER * calibration.threshold if accepted else 0.0
        if tests[-1].p_value > level or tests[-1].statistic < least or not sets:
            break
        now = candidates[0].refit if candidates else None
        found = _refitted(work, gram, accepted, calibration, model, now, tell, 0.35 + 0.1 * len(tests))
        if not found:
            break
        candidates = found
        best = found[0].refit
        accepted = tuple(_index(evidence, h) for h in best.members)
        work = _around(evidence, best, accepted, model)
        work = replace(work, drives=tuple(led_by(d, best.model) for d in evidence.drives))
    assert first is not None
    quiet = list(candidates[0].refit.residuals) if candidates else list(evidence.residuals)
    noises = tuple(fit_noise(r, d.mask, contrasts(d.channels)) for r, d in zip(quiet, evidence.drives, strict=True))
    return Found(tuple(tests), first[0], first[1], candidates, noises)


def _tested(
    evidence: Evidence, gains: FloatArray, base: Sequence[int], c: Calibration, level: float, surrogates: int
) -> Significance:
    sizes = np.array([len(x) for x in evidence.columns], dtype=np.float64)
    ratio = gains / c.inflation / sizes
    statistic = float(ratio.max())
    if c.maxima.size:
        p = max(gumbel_p(c.maxima, statistic), chance(statistic, c.tested), 1e-12)
        return Significance(statistic, c.threshold, p, level, c.achieved, surrogates)
    p = max(chance(statistic, c.tested), 1e-12)
    return Significance(statistic, c.threshold, p, level, float("nan"), 0)


def _surely_nothing(evidence: Evidence, gains: FloatArray, c: Calibration, level: float) -> Significance | None:
    """The test's result if no gain reaches Bonferroni's bound [bonferroni1936], even without coloured noise.

    The bound is the minimum of every threshold. Surrogates, which take most of the time, could not turn this into a
    finding.
    """
    statistic = float((gains / [len(x) for x in evidence.columns]).max())
    p = chance(statistic, c.tested)
    if p <= level:
        return None
    return Significance(statistic, bonferroni(level, c.tested), p, level, c.achieved, 0)


def _after(evidence: Evidence, fit: SetFit) -> list[FloatArray]:
    return [
        r - np.tensordot(fit.theta, s[list(fit.columns)], axes=1)
        for r, s in zip(evidence.residuals, evidence.signatures, strict=True)
    ]


def _refitted(
    evidence: Evidence,
    gram: FloatArray,
    base: Sequence[int],
    calibration: Calibration,
    model: Model,
    now: Refit | None,
    tell: Tell,
    share: float,
) -> tuple[Candidate, ...]:
    """Sets of one effect more than `base`, refitted in the simulator, best first; those at a physical bound are out.

    None if the best of them gains less over the known set `now` than the test requires: the finding then does not have
    the form of any effect.
    """
    size = len(base) + 1
    top = best_sets(evidence, gram, size, within=0.0, most=1)
    if not top:
        return ()
    inflation = max(1.0, float(np.mean([calibration.inflation[m] for m in top[0].members])))
    noises = noises_after(evidence, evidence.residuals, dict(zip(top[0].columns, top[0].theta.tolist(), strict=True)))
    known = fit_set(evidence, gram, base) if base else None
    won = top[0].gain - (known.gain if known is not None else 0.0)
    within = (2.0 * math.log(CREDIBLE)) * inflation + SLACK + BENT * max(won, 0.0)
    fits = best_sets(evidence, gram, size, within=within, most=REFITTED)
    fits += _twins(evidence, gram, fits[0], {f.members for f in fits})
    if size == 1:
        fits += _of_water(evidence, gram, {f.members for f in fits})
    measure = metric(evidence, noises)
    tell("refitting in the simulator", min(share, 0.95))
    with ThreadPoolExecutor(THREADS) as pool:
        refits = list(pool.map(lambda fit: refit(evidence, fit, measure, model), fits))
    done = [r for r in refits if r is not None and not r.at_bound]
    losses = {id(r): r.loss / inflation + PER_PARAMETER * len(r.values) for r in done}
    done.sort(key=lambda r: losses[id(r)])
    large = [r for r in done if _all_there(r, model)]
    if base and not large:
        return ()
    # a set with a member too small to be named is dropped if another effect explains as much
    if large and losses[id(large[0])] - losses[id(done[0])] < 2.0 * math.log(CREDIBLE):
        done = large
    y = whitened_residual(evidence, noises, now.residuals if now is not None else evidence.residuals)[None]
    # the penalty of known values is in the loss of every set that has them
    known_loss = float(measure.inner(y, y)[0, 0]) + (now.unlikely if now is not None else 0.0)
    if known is not None and (again := refit(evidence, known, measure, model)) is not None:
        known_loss = min(known_loss, again.loss)
    if not done or known_loss - done[0].loss < HALF * calibration.threshold * inflation:
        return ()
    best = done[0]
    members = next(f.members for f, own in zip(fits, refits, strict=True) if own is best)
    for fit, same in _imitated(evidence, gram, members, measure, model):
        # the relation holds on every log: that it takes more effects, in these sizes, is no evidence against it
        fits.append(fit)
        refits.append(same)
        done.append(same)
        worse = (same.loss - same.unlikely) - (best.loss - best.unlikely)
        losses[id(same)] = losses[id(best)] + max(worse, 0.0) / inflation
    done.sort(key=lambda r: losses[id(r)])
    wet = (known_loss - done[0].loss) / inflation if _about_water(done[0]) else 0.0
    behind = [losses[id(r)] - losses[id(done[0])] - (FORM * wet if _about_water(r) else 0.0) for r in done]
    ratios = [math.exp(min(0.5 * max(x, 0.0), 700.0)) for x in behind]
    credible = [(r, x) for r, x in zip(done, ratios, strict=True) if x < CREDIBLE]
    starts = [_at(next(f for f, own in zip(fits, refits, strict=True) if own is r), r, model) for r, _ in credible]

    def sharpened(start: SetFit, found: Refit) -> Refit | None:
        led = replace(evidence, drives=tuple(led_by(d, found.model) for d in evidence.drives))
        return refit(led, start, metric(evidence, noises, share=KNOWN, beside=start.columns), model)

    with ThreadPoolExecutor(THREADS) as pool:
        sharp = list(pool.map(sharpened, starts, (r for r, _ in credible)))
    known_only = metric(evidence, noises, share=KNOWN)

    def as_candidate(r: Refit, ratio: float) -> Candidate:
        y = whitened_residual(evidence, noises, r.residuals)[None]
        return Candidate(r, ratio, inflation, float(known_only.inner(y, y)[0, 0]) + r.unlikely)

    return tuple(
        as_candidate(s if s is not None and not s.at_bound else r, x) for (r, x), s in zip(credible, sharp, strict=True)
    )


def _twins(evidence: Evidence, gram: FloatArray, top: SetFit, known: set[tuple[int, ...]]) -> list[SetFit]:
    """The best set with one member replaced by its known twin: always refitted, whatever their signatures predict."""
    out = []
    for k, m in enumerate(top.members):
        for name in evidence.asked[m].effect.twins:
            for i, h in enumerate(evidence.asked):
                if h.effect.name != name or h.where not in (None, h.effect.default):
                    continue
                members = tuple(sorted((*top.members[:k], i, *top.members[k + 1 :])))
                fit = fit_set(evidence, gram, members) if len(set(members)) == len(members) else None
                if fit is not None and members not in known and compatible(evidence, members):
                    known = known | {members}
                    out.append(fit)
    return out


def _of_water(evidence: Evidence, gram: FloatArray, known: set[tuple[int, ...]]) -> list[SetFit]:
    """Effects of water on the whole car or a side: refitted on every wet log, whatever the signatures predict.

    Near floating, slip is proportional to one over the square of the remaining contact, so a linear signature is valid
    only locally.
    """
    alone = [
        (i,) for i, h in enumerate(evidence.asked)
        if h.of_water and not h.allowed and h.where not in AXLES and (i,) not in known
    ]  # fmt: skip
    return [f for m in alone if (f := fit_set(evidence, gram, m)) is not None]


def _about_water(r: Refit) -> bool:
    return any(h.of_water for h in r.members)


def _imitated(
    evidence: Evidence, gram: FloatArray, members: Sequence[int], measure: Metric, model: Model
) -> list[tuple[SetFit, Refit]]:
    """Refits of the sets that a relation makes equal to the best one, without those at a physical bound."""
    out = []
    for other in imitations(evidence.asked, members):
        fit = fit_set(evidence, gram, other) if len(other) <= MOST else None
        same = refit(evidence, fit, measure, model) if fit is not None and compatible(evidence, other) else None
        if fit is not None and same is not None and not same.at_bound and _all_there(same, model) and _usual(same):
            out.append((fit, same))
    return out


def _usual(r: Refit) -> bool:
    """Whether every value stays within three times its usual size; a huge offset is not a plausible rival."""
    own = [(r.members[i].parameter(n), v) for (i, n), v in zip(r.names, r.values.tolist(), strict=True)]
    return all(abs(v - p.neutral) <= UNUSUAL * p.sigma for p, v in own)


def _at(fit: SetFit, r: Refit, model: Model) -> SetFit:
    """The set at refitted values, as a start."""
    base = np.array([value_in(model, r.members[i], n) for i, n in r.names])
    return replace(fit, theta=r.values - base)


def _all_there(r: Refit, model: Model) -> bool:
    """Whether every value is worth naming."""
    return all(
        abs(v - value_in(model, r.members[i], n)) >= r.members[i].worth_naming(n)
        for (i, n), v in zip(r.names, r.values.tolist(), strict=True)
    )


def _index(evidence: Evidence, h: Hypothesis) -> int:
    return evidence.asked.index(h)


def _around(evidence: Evidence, best: Refit, members: Sequence[int], model: Model) -> Evidence:
    """The evidence with the signatures of the best set at its own values.

    Residuals are those that a linear model around these values would have had at the start, so that the search for sets
    can begin again from there.
    """
    columns = [c for m in members for c in evidence.columns[m]]
    start = best.values - np.array([value_in(model, best.members[i], n) for i, n in best.names])
    new_signatures, new_residuals = [], []
    for s, r, own in zip(evidence.signatures, best.residuals, best.signatures, strict=True):
        changed = s.copy()
        changed[columns] = own
        new_signatures.append(changed)
        new_residuals.append(r + np.tensordot(start, own, axes=1))
    prepared = tuple(spectra(bridged(x, d.mask)) for x, d in zip(new_signatures, evidence.drives, strict=True))
    return replace(evidence, residuals=tuple(new_residuals), signatures=tuple(new_signatures), prepared=prepared)
