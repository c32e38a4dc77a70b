"""The page of a campaign: quality, matrix, regressions, detections and runs, filtered together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from aqualog import __version__
from aqualog.campaign.bins import Group, group_of
from aqualog.campaign.matrix import campaign_matrix
from aqualog.campaign.results import CampaignData, RunInfo
from aqualog.core.judgement import VERDICTS
from aqualog.core.notation import WHEELS
from aqualog.detect.registry import DETECTORS
from aqualog.report.campaign.answers import (
    RESISTANCE_LEVEL,
    Answer,
    answers_of,
    headline,
    off_water,
    summaries,
    verdicts,
)
from aqualog.report.campaign.findings import Curve, Findings
from aqualog.report.campaign.labels import group_text, key_title, value_text
from aqualog.report.campaign.quality import Problem, problems_of
from aqualog.report.campaign.run_page import BEHIND_S, RunFacts
from aqualog.report.page import render
from aqualog.report.values import KMH, counted, cut, plain
from aqualog.report.wording import detector_name

__all__ = ["campaign_page"]

MOST_VALUES = 12  # of an own column that becomes a filter; more is for the search
_ORDER = (
    "tyre", "pressure_rear_bar", "pressure_front_bar", "water_depth_mm", "water_depth_left_mm", "wear",
    "tread_depth_mm", "load_front_kg", "load_rear_kg", "manoeuvre", "vehicle",
)  # fmt: skip
_DROPPED = ("pressure_front_bar", "water_depth_left_mm", "tread_depth_mm")  # where they repeat another key
_STATES = ("done", "failed", "to do")
_VERDICTS = tuple(VERDICTS)
_DIGITS = 5
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
    return render(
        "campaign.html.j2",
        css=("campaign.css",),
        scripts=_SCRIPTS,
        islands={"campaign-data": _data(data, findings, answers, facts, problems, pages)},
        plotly="plotly.min.js",
        title=cut(data.name, 200),
        kind="campaign",
        about="measuring campaign",
        facts=(),
        level="open",
        headline=headline(data, findings),
        verdicts=verdicts(data),
        summaries=summaries(answers),
        off_water=off_water(facts),
        has_losses=any(p.weight == "loss" for p in problems),
        quality_line=_quality_line(problems),
        empty=_empty(findings, answers, facts),
        is_dry=bool(findings.dry),
        level_text=f"{RESISTANCE_LEVEL:g}",
        behind=f"{BEHIND_S:g}",
        made=_made(data, findings),
    )


_SECTIONS = {
    "answers": "speeds", "slopes": "slip slope", "resistance": "resistance", "full": "full aquaplaning",
    "detections": "detections",
}  # fmt: skip


def _empty(findings: Findings, answers: Sequence[Answer], facts: Sequence[RunFacts | None]) -> dict[str, str]:
    """Sections that have nothing to show whatever the filters leave, with their short names."""
    has = {
        "answers": bool(answers),
        "slopes": any(c.points for c in findings.slopes),
        "resistance": any(c.points for c in (*findings.resistance, *findings.dry)),
        "full": bool(findings.full),
        "detections": any(f is not None and (f.lane_s > 0.0 or f.events) for f in facts),
    }  # fmt: skip
    return {name: title for name, title in _SECTIONS.items() if not has[name]}


def _quality_line(problems: Sequence[Problem]) -> str:
    words = {"loss": "with data missing", "limit": "with limits on what can be judged", "note": "with notes"}
    counts = {w: len({i for p in problems if p.weight == w for i, _ in p.runs}) for w in words}
    told = [f"{counted(n, 'run')} {words[w]}" for w, n in counts.items() if n]
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
        "Full aquaplaning is estimated in four ways. Slip slope: slope / dry slope = L², with contact share "
        "L = 1 − (v / v_full)ⁿ. Minor spin-downs: speed at which half of the passes have one, plus 20 km/h. "
        "Spin-downs: speed at which half of the passes have one. Intervals: bootstrap over runs. Foretold: mean of "
        "what the margin expects of each pass, the fastest first, with the interval of one pass. These are different "
        "events: on uneven water single wheels stop at lower speeds than an even contact ends.",
        f"Resistance {RESISTANCE_LEVEL:g} m/s² and half of the dry slope: interpolated between bins with an interval. "
        "The interval ends where the ends of the band cross the level. Of several wheels, the lowest speed counts.",
    ]  # fmt: skip
    for kind, reasons in findings.left_out.items():
        if reasons:
            told = ", ".join(f"{n} ({cut(why)})" for why, n in sorted(reasons.items(), key=lambda x: -x[1]))
            lines.append(f"Samples left out (of 10 per second), {kind}: {told}.")
    return [*lines, *(cut(n, 300) for n in findings.notes)]


# --- what the page's script works on ---------------------------------------------------------------------------------


def _data(
    data: CampaignData,
    findings: Findings,
    answers: Sequence[Answer],
    facts: Sequence[RunFacts | None],
    problems: Sequence[Problem],
    pages: Sequence[str],
) -> dict[str, Any]:
    """The document.

    Parameters
    ----------
    pages : sequence of str
        Address of each run's page, from the page itself.

    Returns
    -------
    dict
        Runs as columns, texts as indices into lists, so that thousands of them stay small. Numbers with five digits,
        null for NaN and infinities.
    """
    facets = _facets(data)
    index = {g: i for i, g in enumerate(findings.groups)}
    places = {c.place for c in findings.slopes} | {e.place for f in facts if f is not None for e in f.events}
    constant = [k for k in findings.plan.keys if len({_value(r, k) for r in data.runs}) == 1]
    return {
        "level": RESISTANCE_LEVEL,
        "is_dry": bool(findings.dry),
        "facets": [f["shown"] for f in facets],
        "keys": [i for i, f in enumerate(facets) if f["key"] in findings.plan.keys],
        "detectors": [detector_name(d) for d in DETECTORS],
        "groups": [
            [group_text(g, without=constant),
             [f["values"].index(dict(g)[f["key"]]) if f["key"] in dict(g) else -1 for f in facets]]
            for g in findings.groups
        ],
        "runs": _runs(data, facts, pages, facets, index, findings.plan.keys),
        "slopes": [_curve(c, index) for c in findings.slopes],
        "resistance": [_curve(c, index) for c in findings.dry or findings.resistance],
        "full": [
            [index[f.group], f.place, f.way, *(_n(KMH * x) for x in (f.v, *f.ci)), f.rests_on, f.reason]
            for f in findings.full
        ],
        "answers": [
            [index[a.group], *([*map(_n, n[:3]), *n[3:]] for n in (*a.full, a.resistance, a.half))] for a in answers
        ],
        "matrix": _matrix(data, facets),
        "problems": [[p.weight, p.title, p.means, [list(r) for r in p.runs]] for p in problems],
        "wheels": [w for w in WHEELS if w in places],
    }  # fmt: skip


def _n(x: float) -> float | None:
    shown: float | None = plain(float(x), _DIGITS)
    return shown


def _value(info: RunInfo, key: str) -> float | str | None:
    return info.run.vehicle.stem if key == "vehicle" else info.run.values.get(key)


def _facets(data: CampaignData) -> list[dict[str, Any]]:
    """Keys in which the runs differ: values in order, and the value of each run by index."""
    own = [k for k in data.keys if k.startswith("x_")]
    facets: list[dict[str, Any]] = []
    for key in (*_ORDER, *own):
        column = [_value(r, key) for r in data.runs]
        values = sorted(set(column), key=lambda v: (v is None, isinstance(v, str), v if v is not None else 0.0))
        if len(values) < 2 or (key in own and len(values) > MOST_VALUES):
            continue
        values = _by_number(values)
        place = {v: i for i, v in enumerate(values)}
        of_runs = [place[v] for v in column]
        if (key in own or key in _DROPPED) and any(
            # two columns that divide the runs alike
            len(set(zip(of_runs, f["runs"], strict=True))) == len(set(of_runs)) == len(set(f["runs"]))
            for f in facets
        ):
            continue
        shown = {"key": cut(key), "title": key_title(key), "values": [value_text(key, v) for v in values]}
        facets.append({"key": key, "values": values, "runs": of_runs, "shown": shown})
    return facets


def _by_number(values: list[float | str | None]) -> list[float | str | None]:
    """Texts that are all numbers in their order."""
    texts = [v for v in values if v is not None]
    try:
        rank = {v: float(v) for v in texts}
    except ValueError:
        return values
    return sorted(values, key=lambda v: (v is None, rank.get(v, 0.0) if v is not None else 0.0, str(v)))


def _runs(
    data: CampaignData,
    facts: Sequence[RunFacts | None],
    pages: Sequence[str],
    facets: Sequence[Mapping[str, Any]],
    index: Mapping[Group, int],
    keys: Sequence[str],
) -> dict[str, Any]:
    gone: dict[tuple[int, ...], int] = {}  # detectors that could not judge -> index
    rows = []
    for info, fact in zip(data.runs, facts, strict=True):
        if fact is None:
            own: list[Any] = [None, None, None, None, 0, []]
            without = tuple(range(len(DETECTORS)))
        else:
            km = (info.about["distance_m"] or 0.0) / 1e3
            events = [[DETECTORS.index(e.detector), e.place, e.on, e.off, e.unknown] for e in fact.events]
            own = [*map(_n, (fact.lane_kmh, info.about["duration_s"], km, fact.dry_km)), fact.full, events]
            without = tuple(i for i, d in enumerate(DETECTORS) if d in info.about["unavailable"])
        rows.append([*own, gone.setdefault(without, len(gone))])
    return {
        "name": [cut(r.name, 120) for r in data.runs],
        "page": list(pages),
        "state": [_STATES.index(r.state) for r in data.runs],
        "verdict": [_VERDICTS.index(r.judgement.verdict) if r.is_done else -1 for r in data.runs],
        "doubtful": [int(bool(r.checks) and r.judgement.verdict != "cannot_be_judged") for r in data.runs],
        "episodes": [len(r.judgement.of("aquaplaning")) for r in data.runs],
        "facets": [f["runs"] for f in facets],
        "group": [index[group_of(r.run, keys)] for r in data.runs],
        **{name: [row[i] for row in rows] for i, name in enumerate(("v", "s", "km", "dry", "full", "events", "gone"))},
        "unavailable": [list(g) for g in gone],
    }


def _curve(c: Curve, index: Mapping[Group, int]) -> list[Any]:
    points = [
        [p.low_kmh, p.high_kmh, _n(p.v_kmh), _n(p.value), _n(p.ci[0]), _n(p.ci[1]), p.runs, p.samples, _n(p.expected),
         p.reason]
        for p in c.points
    ]  # fmt: skip
    return [index[c.group], c.place, points, _n(c.dry), _n(c.dry_ci[0]), _n(c.dry_ci[1]), c.dry_runs]


def _matrix(data: CampaignData, facets: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Facets of the rows and of the columns, and combinations that are missing between driven ones."""
    matrix = campaign_matrix(data.configured.campaign)
    place = {f["key"]: i for i, f in enumerate(facets)}
    factors = [f for f in matrix.factors if f.key in place]
    names = [f.key for f in factors]
    column = "water_depth_mm" if "water_depth_mm" in names else next((f.key for f in factors if f.is_ordered), "")
    rows = [k for k in names if k != column]
    texts = {k: [_text(v) for v in facets[place[k]]["values"]] for k in names}
    gaps = []
    if len(factors) == len(matrix.factors):
        for gap in matrix.gaps:
            values = dict(zip(names, gap.values, strict=True))
            at = [texts[k].index(values[k]) if values[k] in texts[k] else -1 for k in (*rows, column) if k]
            gaps.append(at)
    return {"rows": [place[k] for k in rows], "column": place.get(column, -1), "gaps": gaps}


def _text(value: float | str | None) -> str:
    return "" if value is None else value if isinstance(value, str) else f"{value:g}"
