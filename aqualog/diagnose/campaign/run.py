"""A whole campaign against the model: errors of the tyre and water model, with size, interval and probability."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aqualog.campaign.results import CampaignData
from aqualog.core.records import FloatArray
from aqualog.diagnose import isolate
from aqualog.diagnose.campaign.advice import advice
from aqualog.diagnose.campaign.compete import Found, Option, compete, hypotheses, untested
from aqualog.diagnose.campaign.passes import RESISTANCE, Passes, doubted, passes_of, steady
from aqualog.diagnose.campaign.refit import Refit, estimates, settled
from aqualog.diagnose.competition import COARSE
from aqualog.diagnose.gain import log_score_gain, rms_of_both
from aqualog.diagnose.hypotheses import value_in
from aqualog.diagnose.outcome import with_causes
from aqualog.diagnose.records import Cause, ChannelGain, Diagnosis, Estimate, Gain, ResidualView
from aqualog.diagnose.run import Options
from aqualog.diagnose.unknown_term import short_form
from aqualog.diagnose.verdict import PLACES, Candidate, Causes, Outcome, candidates, decided, whole
from aqualog.diagnose.words import verdict_sentence
from aqualog.model.term import Effect, Model

__all__ = ["cause_sentence", "conclude", "diagnose_campaign", "gain"]

FOLDS = 5
LEAST = 3  # groups of a key, each left out once
MOST = 0.35  # share of the runs in a group; without more of them the rest is another campaign
KEYS = (("depth", "water_depth_mm", 1e3), ("pressure", "pressure_rear_bar", 1e-5))
SHARE = 0.1  # of the largest change of a channel, in its scatter, that a cause needs in order to explain it
_PLACES = {
    None: "all wheels", "f": "the front wheels", "r": "the rear wheels", "left": "the left track",
    "right": "the right track",
}  # fmt: skip
LEAST_RUNS = 12


def conclude(found: Found, passes: Passes, *, seed: int) -> tuple[Outcome[Option], Gain | None]:
    """The verdict on what a competition found, and the gain of its best set; None without one, or with few wet runs. An
    unknown form comes before any name. A name needs a gain on runs that were not fitted."""
    if found.forms:
        return Outcome("unexplained"), None
    won: list[Gain | None] = [None]

    def failing(best: Candidate[Option]) -> tuple[str, ...]:
        won[0] = gain(passes, best.option.refit, found, seed=seed)
        return () if won[0] is None or won[0].low > 0.0 else ("it does not improve the prediction of runs left out.",)

    sets = candidates([(o, COARSE * o.evidence) for o in found.options], lambda o: _causes(found, o.refit, passes))

    def at_place(group: Sequence[Candidate[Option]]) -> Candidate[Option]:
        # the set at the whole car, unless another place is clearly better
        return max((s for s in group if s.share * PLACES > group[0].share), key=whole)

    return decided(sets, at_place, failing), won[0]


def _causes(found: Found, chosen: Refit, passes: Passes) -> Causes:
    """The members of a set, and whether a value reaches its smallest size and its interval excludes no change."""
    all_values = iter(estimates(chosen, passes, found.scatter.weight))
    spread = np.sqrt(np.diag(found.scatter.sigma))
    out, at = [], 0
    for h in chosen.members:
        values = {n: next(all_values) for n in h.free}
        k = slice(at, at + len(h.free))
        at = k.stop
        size = np.sqrt(np.mean((chosen.x[:, :, k] @ chosen.theta[k]) ** 2, axis=0)) / spread
        wet = [(n, s) for n, s in zip(passes.names, size.tolist(), strict=True) if not n.startswith("dry_")]
        explains = tuple(n for n, s in wet if s > SHARE * size.max())
        large = any(
            abs(e.value - value_in(found.nothing.model, h, n)) >= max(h.parameter(n).smallest, e.high - e.value)
            for n, e in values.items()
        )
        sentence = cause_sentence(h.effect, h.where, [*values.values()])
        out.append((Cause(h.effect.name, h.where, values, explains, sentence), large))
    return tuple(out)


def cause_sentence(effect: Effect, where: str | None, values: Sequence[Estimate]) -> str:
    """An effect with its sizes and intervals."""
    asked = effect.campaign
    assert asked is not None
    k = asked.scale
    scaled = [Estimate(k * e.value, k * e.low, k * e.high, e.unit) for e in values]
    place = _PLACES.get(where, str(where))
    return asked.sentence.format(*scaled, place=place, Place=place[0].upper() + place[1:])


def gain(passes: Passes, chosen: Refit, found: Found, *, seed: int) -> Gain | None:
    """Leave groups of runs out, fit the sizes on the others, and predict those left out; None with few wet runs.
    `log_score` over all runs left out, with a bootstrap interval over runs. [nats (natural logarithm)]"""
    wet = np.flatnonzero(np.isfinite(passes.values[:, -1]))
    if wet.size < 2 * FOLDS:
        return None
    groups, names = _groups(passes, wet, np.random.default_rng([seed, 7]))
    slips = [i for i, n in enumerate(passes.names) if not n.startswith("dry_")]
    before, after = np.full((2, *passes.values.shape), np.nan)
    for held in groups:
        rest = np.setdiff1d(np.arange(passes.values.shape[0], dtype=np.int64), held)
        for s, into in ((found.nothing, before), (chosen, after)):
            into[held] = settled(s, passes, found.scatter.weight, rest)[held]
    scores = [_scores(x, slips, found)[wet] for x in (before, after)]
    won = log_score_gain(scores[:1], scores[1:], seed=seed)
    every = np.ones(wet.size, dtype=np.bool_)
    channels = tuple(
        ChannelGain(
            passes.names[i], "m/s^2" if passes.names[i] == RESISTANCE else "-",
            *rms_of_both([before[wet, i]], [after[wet, i]], [every]),
        )
        for i in slips
    )  # fmt: skip
    return Gain(channels, *won, tuple(names), in_sample=False)


def _groups(
    passes: Passes, wet: NDArray[np.int64], rng: np.random.Generator
) -> tuple[list[NDArray[np.int64]], list[str]]:
    for word, key, factor in KEYS:
        x = np.round(passes.coordinates[word][wet] * factor, 3)
        values, counts = np.unique(x, return_counts=True)
        if values.size >= LEAST and min(counts) >= 2 and max(counts) <= MOST * wet.size:
            return [wet[x == v] for v in values], [f"runs with {key} = {v:g}" for v in values]
    order = rng.permutation(wet)
    names = [f"fold {k + 1} of {FOLDS} of the runs" for k in range(FOLDS)]
    return [np.sort(order[k::FOLDS]) for k in range(FOLDS)], names


def _scores(e: FloatArray, channels: list[int], found: Found) -> FloatArray:
    """Log score (g,) of the channels on the water; the dry ones' free offsets are not known there."""
    out = np.zeros(e.shape[0])
    for r in range(e.shape[0]):
        c = [i for i in channels if np.isfinite(e[r, i])]
        if c:
            # marginal precision of these channels
            whole = np.linalg.pinv(found.scatter.weight[r], hermitian=True)[np.ix_(c, c)]
            out[r] = -0.5 * float(e[r, c] @ np.linalg.solve(whole, e[r, c]))
    return out


def diagnose_campaign(
    data: CampaignData, model: Model | None = None, *, options: Options | None = None,
    progress: Callable[[str], None] = lambda _what: None,
) -> Diagnosis:  # fmt: skip
    """Name the errors of the tyre and water model over a campaign, from its results; `model`: terms that are known
    already. A run is the independent unit: its slips and resistance on water minus those on dry road, against the
    model's at the driven speed and traction. Channels are `slip_slope_<wheel>` and `resistance`. `duration_s`: driving
    on water of all runs; `used_s`: the part that was used."""
    o, given = options or Options(), model or Model()
    progress("reading the runs")
    passes = passes_of(data)
    wet = int(np.isfinite(passes.values[:, -1]).sum()) if passes.values.size else 0
    if wet < LEAST_RUNS:
        reason = f"{wet} usable runs on water, at least {LEAST_RUNS} needed"
        return Diagnosis(
            "not_testable", f"Not testable: {reason}.", tuple(t.info.name for t in passes.told), _driven_s(data),
            float(passes.seconds.sum()), given, passes.names, notes=(reason, *_notes(passes)),
        )  # fmt: skip
    asked, passes = hypotheses(passes), doubted(passes, given)
    found = compete(passes, given, asked, o, progress)
    if found.options:
        kept = steady(passes, found.options[0].refit.model)
        if kept is not passes and np.isfinite(kept.values[:, -1]).sum() >= LEAST_RUNS:
            progress("repeating without runs that float in the new model")
            passes = kept
            found = compete(passes, given, asked, o, progress)._replace(significance=found.significance)
    progress("gain on runs left out")
    return _diagnosed(data, passes, found, *conclude(found, passes, seed=o.seed), o.level)


def _diagnosed(
    data: CampaignData, passes: Passes, found: Found, d: Outcome[Option], won: Gain | None, level: float
) -> Diagnosis:
    evidence, c, p = found.evidence, found.calibration, found.significance.p_value
    after = d.best.option.refit if d.best is not None and d.verdict != "cannot_tell" else found.nothing
    # limits are what the runs show, whether or not it is worth naming
    shown = replace(evidence, smallest=np.zeros(evidence.count))
    sizes = isolate.reference_sizes(shown, found.gram, c.threshold)
    reason = f" ({short_form(found.forms[0])})" if found.forms else ""
    sentence = verdict_sentence(
        d.verdict, d.causes, level=level, reason=reason, certain=d.certain,
        seen=p if p <= level else None, source="campaign",
    )  # fmt: skip
    given = found.nothing.model
    before, then = (settled(r, passes, found.scatter.weight) for r in (found.nothing, after))
    return Diagnosis(
        verdict=d.verdict,
        sentence=sentence,
        drives=tuple(t.info.name for t in passes.told),
        duration_s=_driven_s(data),
        used_s=float(passes.seconds.sum()),
        causes=d.causes,
        alternatives=d.alternatives,
        significance=found.significance,
        limits=isolate.limits(evidence, sizes),
        confusions=isolate.confusions(evidence, found.gram, sizes),
        remainders=found.forms,
        manoeuvre=advice(passes, [s.option for s, _ in d.rivals], found.scatter),
        gain=won,
        model=with_causes(given, d.causes, after.members),
        channels=tuple(n for n in passes.names if not n.startswith("dry_")),
        untested=untested(evidence.asked),
        notes=(*_notes(passes), *d.notes),
        views=_views(data.name, passes, before, then),
    )


def _driven_s(data: CampaignData) -> float:
    return float(sum(float(i.about.get("duration_s", 0.0)) for i in data.done))


def _notes(passes: Passes) -> tuple[str, ...]:
    return tuple(f"{n} {'run' if n == 1 else 'runs'} left out: {why}" for why, n in sorted(passes.left_out.items()))


def _views(name: str, passes: Passes, before: FloatArray, after: FloatArray) -> tuple[ResidualView, ...]:
    """Views of the channels on the water; coordinates are those of the runs, in the order of their speed."""
    order = np.argsort(passes.coordinates["v_x"], kind="stable")
    order = order[np.isfinite(passes.values[order, -1])]
    coordinates = {k: x[order] for k, x in passes.coordinates.items()}
    told = {n: (f"slip of {n[-2:]} on water minus slip on dry road", "-") for n in passes.names if n[:4] != "dry_"}
    told[RESISTANCE] = "resistance on the water", "m/s^2"
    return tuple(
        ResidualView(name, n, *told[n], np.nan, coordinates, before[order, c], after[order, c])
        for c, n in enumerate(passes.names) if n in told
    )  # fmt: skip
