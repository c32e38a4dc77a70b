"""The page of a campaign: quality, matrix, regressions, detections and runs, filtered together."""

from __future__ import annotations

from collections.abc import Sequence

from aqualog import __version__
from aqualog.campaign.samples import CampaignData
from aqualog.report import offline
from aqualog.report.campaign.answers import RESISTANCE_LEVEL, answers_of, headline, off_water, summaries
from aqualog.report.campaign.data import page_data
from aqualog.report.campaign.findings import Findings
from aqualog.report.campaign.labels import key_title
from aqualog.report.campaign.quality import Problem, problems_of
from aqualog.report.campaign.runs import BEHIND_S, RunFacts
from aqualog.report.wording import cut

__all__ = ["campaign_page"]

_SCRIPTS = ("loader.js", "campaign_state.js", "campaign_figures.js", "campaign_tables.js")


def campaign_page(
    data: CampaignData, findings: Findings, facts: Sequence[RunFacts | None], pages: Sequence[str]
) -> str:
    """The page as HTML; the same text for the same results.

    Parameters
    ----------
    data : CampaignData
    findings : Findings
    facts : sequence
        Of each run.
    pages : sequence of str
        Address of each run's page.

    plotly.js is not in it: `plotly.min.js` beside it serves all pages.
    """
    answers = answers_of(findings)
    problems = problems_of(data, findings.plan.keys)
    return offline.render(
        "campaign.html.j2",
        css=("campaign.css",),
        scripts=_SCRIPTS,
        islands={"campaign-data": page_data(data, findings, answers, facts, problems, pages)},
        plotly="plotly.min.js",
        title=cut(data.name, 200),
        kind="campaign",
        about="measuring campaign",
        facts=(),
        level="open",
        headline=headline(data, findings),
        summaries=summaries(answers),
        off_water=off_water(facts),
        has_losses=any(p.weight == "loss" for p in problems),
        quality_line=_quality_line(problems),
        level_text=f"{RESISTANCE_LEVEL:g}",
        behind=f"{BEHIND_S:g}",
        made=_made(data, findings),
    )


def _quality_line(problems: Sequence[Problem]) -> str:
    words = {"loss": "with data missing", "limit": "with limits on what can be judged", "note": "with notes"}
    counts = {w: sum(p.weight == w for p in problems) for w in words}
    told = [f"{n} {words[w]}" for w, n in counts.items() if n]
    return f"{'; '.join(told)}; each opens to its runs" if told else "no problem: all logs are there and intact"


def _made(data: CampaignData, findings: Findings) -> list[str]:
    """Versions, settings, counts."""
    plan = findings.plan
    keys = ", ".join(key_title(k) for k in plan.keys) or "none: all runs together"
    cars = sorted({r.vehicle.name for r in data.done})
    versions = sorted({str(r.about["tool_version"]) for r in data.done})
    measured = f"; logs measured with {', '.join(versions)}" if versions and versions != [__version__] else ""
    lines = [
        f"aqualog {__version__}{measured}; campaign {cut(data.name)}; cars: {cut(', '.join(cars), 200) or 'none'}.",
        f"Configurations: {keys}. Runs that differ in other keys only are pooled. Speed bins of {plan.width_kmh:g} "
        "km/h.",
        "Slip slope: regression of slip on traction with an intercept"
        + (" and Huber's weights" if findings.robust else "")
        + ". Slope and intercept may differ from run to run. The bias from traction noise is corrected. "
        "Intervals (95 %) treat the run, not the sample, as the unit.",
        "Full aquaplaning is estimated in three ways. Slip slope: slope / dry slope = L², with contact share "
        "L = 1 − (v / v_full)ⁿ. Minor spin-downs: speed at which half of the passes have one, plus 20 km/h. "
        "Spin-downs: speed at which half of the passes have one. Intervals: bootstrap over runs.",
        f"Resistance {RESISTANCE_LEVEL:g} m/s² and half of the dry slope: interpolated between bins with an interval. "
        "The interval ends where the ends of the band cross the level. Of several wheels, the lowest speed counts.",
    ]  # fmt: skip
    for kind, reasons in findings.left_out.items():
        if reasons:
            told = ", ".join(f"{n} ({cut(why)})" for why, n in sorted(reasons.items(), key=lambda x: -x[1]))
            lines.append(f"Samples left out (of 10 per second), {kind}: {told}.")
    return [*lines, *(cut(n, 300) for n in findings.notes)]
