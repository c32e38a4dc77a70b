"""A campaign's tables as CSV files."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable, Sequence

from aqualog.campaign.bins import Group
from aqualog.campaign.samples import CampaignData
from aqualog.detect.needs import DETECTORS
from aqualog.report.campaign_findings import Curve, Findings
from aqualog.report.campaign_runs import RunFacts

__all__ = ["safe_cell", "tables_of"]

_DIGITS = 6
Row = Sequence[object]


def tables_of(
    data: CampaignData, findings: Findings, facts: Sequence[RunFacts | None], pages: Sequence[str]
) -> dict[str, str]:
    """File name -> text: runs, slip slope, resistance, full_aquaplaning."""
    return {
        "runs.csv": _csv(*_runs(data, facts, pages)),
        "slip_slope.csv": _csv(*_curves(findings, findings.slopes, "slope")),
        "resistance.csv": _csv(*_curves(findings, findings.resistance, "delta_a_x")),
        "full_aquaplaning.csv": _csv(*_full(findings)),
    }


def _runs(data: CampaignData, facts: Sequence[RunFacts | None], pages: Sequence[str]) -> tuple[Row, list[Row]]:
    keys = data.keys
    heading = ["run", "log", "page", "state", "reason", *keys, "duration_s", "lane_v_kmh", "lane_s", "dry_km",
               *(f"events_{d}" for d in DETECTORS)]  # fmt: skip
    rows: list[Row] = []
    for info, fact, page in zip(data.runs, facts, pages, strict=True):
        groups = info.run.groups
        row = [info.index + 1, info.name, page, info.state, info.reason, *(groups.get(k, "") for k in keys)]
        if fact is not None:
            own = {d: sum(e["detector"] == d for e in info.events) for d in DETECTORS}
            gone = info.about["unavailable"]
            row += [info.about["duration_s"], fact.lane_kmh, fact.lane_s, fact.dry_km]
            row += ["" if d in gone else n for d, n in own.items()]
        rows.append([*row, *[""] * (len(heading) - len(row))])
    return heading, rows


def _curves(findings: Findings, curves: Sequence[Curve], name: str) -> tuple[Row, list[Row]]:
    keys = findings.plan.keys
    heading = [*keys, "place", "v_low_kmh", "v_high_kmh", "v_mean_kmh", name, "ci95_low", "ci95_high", "runs",
               "samples", "reliable", "expected", "dry", "dry_ci95_low", "dry_ci95_high", "reason"]  # fmt: skip
    rows: list[Row] = [
        [*_values(c.group), c.place, p.low_kmh, p.high_kmh, p.v_kmh, p.value, *p.ci, p.runs, p.samples,
         int(p.reliable), p.expected, c.dry, *c.dry_ci, p.reason]
        for c in curves for p in c.points
    ]  # fmt: skip
    return heading, rows


def _full(findings: Findings) -> tuple[Row, list[Row]]:
    heading = [*findings.plan.keys, "place", "way", "v_kmh", "ci95_low_kmh", "ci95_high_kmh", "rests_on", "reason"]
    rows: list[Row] = [
        [*_values(f.group), f.place, f.way, 3.6 * f.v, 3.6 * f.ci[0], 3.6 * f.ci[1], f.rests_on, f.reason]
        for f in findings.full
    ]
    return heading, rows


def _values(group: Group) -> list[object]:
    return ["" if v is None else v for _, v in group]


def _csv(heading: Row, rows: Iterable[Row]) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([safe_cell(c) for c in heading])
    writer.writerows([safe_cell(c) for c in row] for row in rows)
    return out.getvalue()


# a spreadsheet takes a cell that begins so for a formula; one that splits at semicolons or tabs makes cells of its own
_FORMULA = re.compile(r"(?:^|(?<=[;,|\t\r\n]))(?=\s*[=+\-@＝＋－＠])|^(?=[\t\r\n])")


def safe_cell(value: object) -> str:
    """A cell that no spreadsheet takes for a formula; empty for NaN and infinities."""
    if isinstance(value, float):
        return f"{value:.{_DIGITS}g}" if math.isfinite(value) else ""
    text = str(value)
    is_number = text.removeprefix("-").replace(".", "", 1).isdigit()
    return text if is_number else _FORMULA.sub("'", text)
