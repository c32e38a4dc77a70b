"""A whole campaign against the model: errors of the tyre and water model, with size, interval and probability."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aqualog.campaign.results import CampaignData
from aqualog.core.records import FloatArray
from aqualog.diagnose import isolate
from aqualog.diagnose.campaign.advice import advice
from aqualog.diagnose.campaign.compete import Found, Option, compete, hypotheses, untested
from aqualog.diagnose.campaign.outcome import conclude
from aqualog.diagnose.campaign.passes import RESISTANCE, Passes, doubted, passes_of, steady
from aqualog.diagnose.campaign.refit import settled
from aqualog.diagnose.outcome import with_causes
from aqualog.diagnose.records import Diagnosis, Gain, ResidualView
from aqualog.diagnose.run import Options
from aqualog.diagnose.unknown_term import short_form
from aqualog.diagnose.verdict import Outcome
from aqualog.diagnose.words import verdict_sentence
from aqualog.model.term import Model

__all__ = ["diagnose_campaign"]

LEAST_RUNS = 12


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
