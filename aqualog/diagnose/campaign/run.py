"""A whole campaign against the model: errors of the tyre and water model, with size and interval."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from aqualog.campaign.definition import Campaign
from aqualog.campaign.results import CampaignData
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.campaign.advice import advice
from aqualog.diagnose.campaign.any_effect import Anything, anything, whole_fit
from aqualog.diagnose.campaign.catalogue import Library, hypotheses, library, untested
from aqualog.diagnose.campaign.gain import gain
from aqualog.diagnose.campaign.judge import confusions, limits
from aqualog.diagnose.campaign.noise import Fit, design_of, inverse_of, prior_of
from aqualog.diagnose.campaign.observe import passes_of
from aqualog.diagnose.campaign.passes import RESISTANCE, Passes, doubted, steady
from aqualog.diagnose.campaign.refit import Refit, intervals
from aqualog.diagnose.campaign.remainder import remainders
from aqualog.diagnose.campaign.search import Found, credible
from aqualog.diagnose.campaign.words import cause_sentence, verdict_sentence
from aqualog.diagnose.records import (
    Alternative,
    Cause,
    Diagnosis,
    Estimate,
    Remainder,
    ResidualView,
    Significance,
    Verdict,
)
from aqualog.model.term import Model

__all__ = ["diagnose_campaign", "views"]

LEAST_RUNS = 12
AGAIN_WITHIN = 15.0  # log evidence: sets that are fitted again where runs fell out
SHARE = 0.1  # share of a channel's change that a cause needs in order to explain it

Progress = Callable[[str], None]


def diagnose_campaign(
    campaign: Campaign,
    data: CampaignData,
    vehicle: Vehicle | None = None,
    *,
    seed: int = 1,
    level: float = 0.01,
    surrogates: int = 299,
    model: Model | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Name the errors of the tyre and water model over a campaign.

    Parameters
    ----------
    campaign : Campaign
        For its name.
    data : CampaignData
        Its results (`aqualog.campaign.results.load_results`).
    vehicle : Vehicle, optional
        In place of the runs' vehicle files, without load.
    seed : int
        Of the surrogates and draws; the same seed gives the same diagnosis.
    level : float
        Family-wise probability of a finding where no effect is present.
    surrogates : int
        Campaigns without effect that the test is calibrated with; at least 1 / level.
    model : Model, optional
        Terms that are assumed to be right.
    progress : callable, optional
        Called with the name of each step.

    Returns
    -------
    Diagnosis
        Channels `slip_slope_<wheel>` and `resistance`. `duration_s`: driving on water of all runs; `used_s`: the part
        that was used.

    A run is the independent unit throughout: each is one vector of means, its slips and resistance on water minus those
    on dry road. It is compared with the model's expectation at the driven speed and traction.
    """
    say = progress or (lambda what: None)
    base = model or Model()
    rng = np.random.default_rng([seed, 7])
    say("reading the runs")
    passes = passes_of(data, vehicle)
    wet = int(np.isfinite(passes.values[:, -1]).sum()) if passes.values.size else 0
    if wet < LEAST_RUNS:
        return _not_testable(data, passes, base, wet)
    tested = hypotheses(passes)
    passes = doubted(passes, base)
    say("signatures of the effects")
    lib = library(passes, base, tested)
    say("testing for any effect")
    groups = [(h.key, c) for h, c in zip(lib.hypotheses, lib.columns, strict=True)]
    first = anything(
        passes.values - lib.base, lib.x, groups, lib.road, passes.nuisances, rng=rng, level=level, surrogates=surrogates
    )  # fmt: skip
    found = credible(passes, base, lib, report=say) if first.p_value <= level else None
    if found is not None:
        kept = steady(passes, found.sets[0].model)
        if len(kept) < len(passes.told) and len(kept) >= LEAST_RUNS:
            say("repeating without runs that float in the new model")
            passes = passes.part(kept)
            lib = library(passes, base, tested)
            near = [r for r in found.tried if r.log_evidence > found.sets[0].log_evidence - AGAIN_WITHIN]
            found = credible(passes, base, lib, known=[*found.sets, *near], report=say)
    return _diagnosed(data, passes, base, lib, first, found, level, rng, surrogates, say)


def _not_testable(data: CampaignData, passes: Passes, base: Model, wet: int) -> Diagnosis:
    notes = (f"{wet} usable runs on water, at least {LEAST_RUNS} needed", *_notes(passes))
    sentence = verdict_sentence("not_testable", (), (), (), wet)
    return Diagnosis(
        "not_testable", sentence, _names(passes), _driven_s(data), float(passes.seconds.sum()), (), (), None, (), (),
        (), None, None, base, passes.names, {}, notes,
    )  # fmt: skip


def _diagnosed(
    data: CampaignData, passes: Passes, base: Model, lib: Library, first: Anything, found: Found | None, level: float,
    rng: np.random.Generator, surrogates: int, say: Progress,
) -> Diagnosis:  # fmt: skip
    nothing = np.zeros((*passes.values.shape, 0))
    y = passes.values - lib.base
    scatter = found.scatter if found else whole_fit(y, lib.x, lib.road, passes.nuisances)
    best = found.sets[0] if found else None
    say("describing what is not explained")
    left, _ = remainders(
        passes, best.residual if best else y, best.x if best else nothing, lib, scatter, rng=rng, level=level,
        surrogates=max(surrogates // 2, math.ceil(1.0 / level)),
    )  # fmt: skip
    verdict, chosen, rivals = judged(found, left)
    say("gain on runs left out")
    won = gain(passes, compared(found), scatter, lib.base, rng) if found else None
    notes = list(_notes(passes))
    if verdict in ("named", "compound") and won is not None and not won.low > 0.0:
        notes.append("the effects found do not improve the prediction of held-out runs and are not named")
        verdict, chosen, rivals = "no_effect", None, []
    if verdict == "no_effect" and first.p_value <= level:
        notes.append("the runs deviate from the model, but no effect worth naming is 20 times more likely than none")
    causes = _causes(chosen, passes, scatter) if chosen else ()
    others = tuple(
        Alternative(_causes(r, passes, scatter), float(np.exp(best.log_evidence - r.log_evidence)))
        for r in rivals
    ) if best else ()  # fmt: skip
    model = chosen.model if chosen else base
    say("next runs")
    survivors = [chosen, *rivals] if chosen else rivals
    after = chosen.residual if chosen else y
    free = passes.nuisances
    significance = Significance(
        first.statistic, first.threshold, first.p_value, level, first.achieved, first.surrogates
    )  # fmt: skip
    return Diagnosis(
        verdict, verdict_sentence(verdict, causes, others, left, len(passes.told)), _names(passes), _driven_s(data),
        float(passes.seconds.sum()), causes, others, significance,
        limits(lib, free, scatter.weight, passes.values, first.threshold),
        confusions(lib, free, scatter.weight, passes.values), left, advice(passes, survivors, scatter), won, model,
        tuple(n for n in passes.names if not n.startswith("dry_")), untested(lib.hypotheses), tuple(notes),
        views(data.name, passes, settled(y, nothing, passes, scatter),
              settled(after, chosen.x if chosen else nothing, passes, scatter)),
    )  # fmt: skip


def judged(found: Found | None, left: Sequence[Remainder]) -> tuple[Verdict, Refit | None, list[Refit]]:
    """Verdict, the reported set, and the other credible sets.

    Effects in every credible set are named. If no credible set consists of just these, the runs cannot distinguish the
    causes. A function that remains after the best set means that the library does not hold the cause.
    """
    if left:
        return "unexplained", None, []
    if found is None or any(not r.chosen for r in found.sets):
        return "no_effect", None, []
    names = [frozenset(h.effect.name for h in r.chosen) for r in found.sets]
    sure = frozenset.intersection(*names)
    chosen = next((r for r, n in zip(found.sets, names, strict=True) if n == sure), None) if sure else None
    if chosen is None:
        return "cannot_tell", None, found.sets
    return "named" if len(chosen.chosen) == 1 else "compound", chosen, [r for r in found.sets if r is not chosen]


def compared(found: Found) -> list[Refit]:
    """Sets among which a fold of the gain chooses: the credible ones, and the model as it is."""
    return [*found.sets, *(r for r in found.tried if not r.chosen and found.sets[0].chosen)]


def settled(e: FloatArray, x: FloatArray, passes: Passes, scatter: Fit) -> FloatArray:
    """Residual with the free sizes (radii, delay) and those of `x` at their best."""
    both = np.concatenate([passes.nuisances, x], axis=-1)
    d = design_of(e, both, np.zeros_like(e), prior_of(both.shape[-1], 0))
    wx = (scatter.weight @ d.x).reshape(e.size, -1)
    a = d.x.reshape(e.size, -1).T @ wx + np.diag(d.prior)
    left: FloatArray = e - d.x @ (inverse_of(a) @ (np.nan_to_num(e).ravel() @ wx))
    return left


def _causes(chosen: Refit, passes: Passes, scatter: Fit) -> tuple[Cause, ...]:
    found = iter(intervals(chosen, passes, scatter.weight))
    out = []
    column = 0
    for h in chosen.chosen:
        values = {p.name: Estimate(*next(found), p.unit) for p in h.parameters}
        k = len(h.parameters)
        change = np.einsum("rck,k->rc", chosen.x[:, :, column : column + k], chosen.theta[column : column + k])
        column += k
        spread = np.sqrt(np.diag(scatter.scatter.sigma))
        size = np.sqrt(np.mean(change**2, axis=0)) / spread
        explains = tuple(
            n for n, s in zip(passes.names, size, strict=True) if not n.startswith("dry_") and s > SHARE * size.max()
        )  # fmt: skip
        out.append(
            Cause(h.effect.name, h.where, values, explains, cause_sentence(h.effect, h.where, [*values.values()]))
        )
    return tuple(out)


def _names(passes: Passes) -> tuple[str, ...]:
    return tuple(i.name for i in passes.infos)


def _driven_s(data: CampaignData) -> float:
    return float(sum(float(i.about.get("duration_s", 0.0)) for i in data.done))


def _notes(passes: Passes) -> tuple[str, ...]:
    return tuple(f"{n} {'run' if n == 1 else 'runs'} left out: {why}" for why, n in sorted(passes.left_out.items()))


def views(name: str, passes: Passes, before: FloatArray, after: FloatArray) -> tuple[ResidualView, ...]:
    """Views of the channels on the water; coordinates are those of the runs, in the order of their speed."""
    order = np.argsort(passes.coordinates["v_x"], kind="stable")
    order = order[np.isfinite(passes.values[order, -1])]
    coordinates = {k: x[order] for k, x in passes.coordinates.items()}
    out = []
    for c, channel in enumerate(passes.names):
        if channel.startswith("dry_"):
            continue
        is_force = channel == RESISTANCE
        title = "resistance on the water" if is_force else f"slip of {channel[-2:]} on water minus slip on dry road"
        unit = "m/s^2" if is_force else "-"
        out.append(
            ResidualView(name, channel, title, unit, math.nan, coordinates, before[order, c], after[order, c])
        )  # fmt: skip
    return tuple(out)
