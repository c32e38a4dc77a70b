"""Everything that the script of a campaign's page works on, as one document of plain lists."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from aqualog.campaign.bins import Group, group_of
from aqualog.campaign.matrix import campaign_matrix
from aqualog.campaign.samples import CampaignData, RunInfo
from aqualog.core.notation import WHEELS
from aqualog.detect.registry import DETECTORS
from aqualog.report.campaign.answers import RESISTANCE_LEVEL, Answer
from aqualog.report.campaign.findings import Curve, Findings
from aqualog.report.campaign.labels import group_text, key_title, value_text
from aqualog.report.campaign.quality import Problem
from aqualog.report.campaign.runs import RunFacts
from aqualog.report.wording import cut, detector_name

__all__ = ["page_data"]

MOST_VALUES = 12  # of an own column that becomes a filter; more is for the search
_ORDER = (
    "tyre", "pressure_rear_bar", "pressure_front_bar", "water_depth_mm", "water_depth_left_mm", "wear",
    "tread_depth_mm", "load_front_kg", "load_rear_kg", "manoeuvre", "vehicle",
)  # fmt: skip
_DROPPED = ("pressure_front_bar", "water_depth_left_mm", "tread_depth_mm")  # where they repeat another key
_STATES = ("done", "failed", "to do")
_DIGITS = 5


def page_data(
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
    constant = [k for k in findings.plan.keys if len({_value(r, k) for r in data.runs}) == 1]
    return {
        "level": RESISTANCE_LEVEL,
        "facets": [f["shown"] for f in facets],
        "keys": [i for i, f in enumerate(facets) if f["key"] in findings.plan.keys],
        "detectors": [detector_name(d) for d in DETECTORS],
        "groups": [_group(g, facets, constant) for g in findings.groups],
        "runs": _runs(data, facts, pages, facets, index, findings.plan.keys),
        "slopes": [_curve(c, index) for c in findings.slopes],
        "resistance": [_curve(c, index) for c in findings.resistance],
        "full": [
            [index[f.group], f.place, f.way, *(_n(3.6 * x) for x in (f.v, *f.ci)), f.rests_on, f.reason]
            for f in findings.full
        ],
        "answers": [
            [index[a.group], *([*map(_n, n[:3]), *n[3:]] for n in (*a.full, a.resistance, a.half))] for a in answers
        ],
        "matrix": _matrix(data, facets),
        "problems": [[p.weight, p.title, p.means, [list(r) for r in p.runs]] for p in problems],
        "wheels": [w for w in WHEELS if _has_wheel(facts, findings, w)],
    }


def _has_wheel(facts: Sequence[RunFacts | None], findings: Findings, wheel: str) -> bool:
    return any(c.place == wheel for c in findings.slopes) or any(
        e.place == wheel for f in facts if f is not None for e in f.events
    )


def _n(x: float) -> float | None:
    return float(f"{x:.{_DIGITS}g}") if math.isfinite(x) else None


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
        if (key in own or key in _DROPPED) and any(_same(of_runs, f["runs"]) for f in facets):
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


def _same(a: Sequence[int], b: Sequence[int]) -> bool:
    """Whether two columns divide the runs alike."""
    return len(set(zip(a, b, strict=True))) == len(set(a)) == len(set(b))


def _group(group: Group, facets: Sequence[Mapping[str, Any]], constant: Sequence[str]) -> list[Any]:
    values = dict(group)
    return [
        group_text(group, without=constant),
        [f["values"].index(values[f["key"]]) if f["key"] in values else -1 for f in facets],
    ]


def _runs(
    data: CampaignData,
    facts: Sequence[RunFacts | None],
    pages: Sequence[str],
    facets: Sequence[Mapping[str, Any]],
    index: Mapping[Group, int],
    keys: Sequence[str],
) -> dict[str, Any]:
    gone: dict[tuple[int, ...], int] = {}
    rows = [_run(info, fact, gone) for info, fact in zip(data.runs, facts, strict=True)]
    return {
        "name": [cut(r.name, 120) for r in data.runs],
        "page": list(pages),
        "state": [_STATES.index(r.state) for r in data.runs],
        "facets": [f["runs"] for f in facets],
        "group": [index[group_of(r, keys)] for r in data.runs],
        **{name: [row[i] for row in rows] for i, name in enumerate(("v", "s", "km", "dry", "full", "events", "gone"))},
        "unavailable": [list(g) for g in gone],
    }


def _run(info: RunInfo, fact: RunFacts | None, gone: dict[tuple[int, ...], int]) -> tuple[Any, ...]:
    if fact is None:
        return (None, None, None, None, 0, [], gone.setdefault(tuple(range(len(DETECTORS))), len(gone)))
    without = tuple(i for i, d in enumerate(DETECTORS) if d in info.about["unavailable"])
    events = [[DETECTORS.index(e.detector), e.place, e.on, e.off, e.unknown] for e in fact.events]
    return (
        _n(fact.lane_kmh), _n(info.about["duration_s"]), _n((info.about["distance_m"] or 0.0) / 1e3), _n(fact.dry_km),
        fact.full, events, gone.setdefault(without, len(gone)),
    )  # fmt: skip


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
