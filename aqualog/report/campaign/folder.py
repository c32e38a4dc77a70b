"""The folder of a campaign's report: page, plotly.js, pages of the runs, tables; all of them or none."""

from __future__ import annotations

import csv
import io
import json
import re
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from aqualog.campaign.bins import Group
from aqualog.campaign.results import CampaignData
from aqualog.core.errors import ConfigError
from aqualog.detect.registry import DETECTORS
from aqualog.io.atomic_write import folder_within, move_together, write_text
from aqualog.report.campaign.findings import Curve, Findings
from aqualog.report.campaign.labels import file_name
from aqualog.report.campaign.page import campaign_page
from aqualog.report.campaign.run_page import RunFacts, facts_of, run_page
from aqualog.report.page import plotly_js
from aqualog.report.spreadsheet import safe_cell
from aqualog.report.values import KMH

__all__ = ["MARK", "check_folder", "page_names", "tables_of", "targets_of", "write_report"]

MARK = "aqualog_report.json"
_OWN = re.compile(r"runs/[a-z0-9-]{1,120}\.html|data/[a-z_]{1,60}\.csv|plotly\.min\.js|index\.html")
_TABLES = ("runs.csv", "slip_slope.csv", "resistance.csv", "full_aquaplaning.csv")
_WRITERS, _WAITING = 8, 64  # threads, and pages that wait for them
Report = Callable[[int, int], None]
_Row = Sequence[object]


def page_names(names: Sequence[str]) -> list[str]:
    """Addresses of the runs' pages from the names of the runs, in order; harmless and distinct."""
    return [f"runs/{file_name(i, name)}.html" for i, name in enumerate(names)]


def targets_of(folder: Path, names: Sequence[str]) -> list[Path]:
    """All files that a report of runs with these names consists of."""
    return [folder / name for name in _own(page_names(names))]


def _own(pages: Sequence[str]) -> list[str]:
    return [*pages, *(f"data/{t}" for t in _TABLES), "plotly.min.js", "index.html", MARK]


def check_folder(folder: Path, *, force: bool) -> None:
    """Refuse a folder that holds files of another origin.

    Raises
    ------
    ConfigError
        If it is a file, below one, or holds other files; the last not with `force`, which leaves these files alone.
    """
    if folder.exists() and not folder.is_dir():
        raise ConfigError("is a file", where=str(folder), expected="a folder for the report")
    there = next((p for p in folder.absolute().parents if p.exists()), Path())
    if not there.is_dir():
        raise ConfigError(f"is below a file, {there}", where=str(folder), expected="a folder for the report")
    for name in ("runs", "data"):
        if (folder / name).is_symlink():
            raise ConfigError("is a link to another place", where=str(folder / name), expected="a folder of the report")
    if folder.is_dir() and not force and not (folder / MARK).is_file() and any(folder.iterdir()):
        raise ConfigError(
            "holds other files", where=str(folder), expected="an empty folder, or an earlier report",
            hint="another folder, or --force to write beside them",
        )  # fmt: skip


def write_report(data: CampaignData, findings: Findings, folder: Path, *, report: Report = lambda *_: None) -> int:
    """Write the report; number of files. `check_folder` must have been asked before.

    All files are complete before the first takes its place, and the page comes last, so that its links work. Pages of
    an earlier report that have no run any more are removed, and files that are not of a report stay.
    """
    pages = page_names([r.name for r in data.runs])
    own = _own(pages)
    facts: list[RunFacts | None] = []
    # most of a small file's time is the wait until the disk has it
    with folder_within(folder) as made:
        with ThreadPoolExecutor(_WRITERS) as writers:
            writing: deque[Future[None]] = deque()
            for i, info in enumerate(data.runs):
                samples = data.samples(info) if info.is_done else None
                facts.append(facts_of(info, samples) if samples is not None else None)
                full = data.full(info) if info.is_done else None
                text = _clean(run_page(data, info, samples, facts[i], back="../index.html", full=full))
                writing.append(writers.submit(write_text, made / pages[i], text))
                while len(writing) > (_WAITING if i + 1 < len(pages) else 0):
                    writing.popleft().result()
                report(i + 1, len(pages))
        for name, text in tables_of(data, findings, facts, pages).items():
            write_text(made / "data" / name, _clean(text))
        write_text(made / "plotly.min.js", plotly_js())
        write_text(made / "index.html", _clean(campaign_page(data, findings, facts, pages)))
        document = {"schema_version": 1, "files": sorted(own[:-1])}
        write_text(made / MARK, json.dumps(document, indent=1) + "\n")
        gone = [folder / name for name in _earlier(folder) if name not in own]
        move_together([(made / name, folder / name) for name in own], gone)
    return len(own)


def _clean(text: str) -> str:
    """Text that UTF-8 can hold: a lone surrogate of a file name becomes a question mark."""
    return text.encode("utf-8", "replace").decode("utf-8")


def _earlier(folder: Path) -> list[str]:
    """Files of an earlier report as its mark file lists them; the rest of the mark file is ignored."""
    try:
        files = json.loads((folder / MARK).read_text(encoding="utf-8"))["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    return [f for f in files if isinstance(f, str) and _OWN.fullmatch(f)] if isinstance(files, list) else []


# --- tables ----------------------------------------------------------------------------------------------------------


def tables_of(
    data: CampaignData, findings: Findings, facts: Sequence[RunFacts | None], pages: Sequence[str]
) -> dict[str, str]:
    """File name -> text: runs, slip slope, resistance, full_aquaplaning."""
    speeds: list[_Row] = [
        [*_values(f.group), f.place, f.way, KMH * f.v, KMH * f.ci[0], KMH * f.ci[1], f.rests_on, f.reason]
        for f in findings.full
    ]
    heads = [*findings.plan.keys, "place", "way", "v_kmh", "ci95_low_kmh", "ci95_high_kmh", "rests_on", "reason"]
    return {
        "runs.csv": _runs(data, facts, pages),
        "slip_slope.csv": _curves(findings, findings.slopes, "slope"),
        "resistance.csv": _curves(findings, findings.resistance, "delta_a_x"),
        "full_aquaplaning.csv": _csv(heads, speeds),
    }


def _runs(data: CampaignData, facts: Sequence[RunFacts | None], pages: Sequence[str]) -> str:
    heading = ["run", "log", "page", "state", "reason", *data.keys, "duration_s", "lane_v_kmh", "lane_s", "dry_km",
               "verdict", "missing", "episodes", *(f"events_{d}" for d in DETECTORS)]  # fmt: skip
    rows: list[_Row] = []
    for info, fact, page in zip(data.runs, facts, pages, strict=True):
        groups, found = info.run.groups, [e["detector"] for e in info.events]
        row = [info.index + 1, info.name, page, info.state, info.reason, *(groups.get(k, "") for k in data.keys)]
        if fact is not None:
            row += [info.about["duration_s"], fact.lane_kmh, fact.lane_s, fact.dry_km]
            judgement = info.judgement
            is_open = judgement.verdict == "cannot_be_judged"
            row += [judgement.verdict, ", ".join(judgement.missing),
                    "" if is_open else len(judgement.of("aquaplaning"))]  # fmt: skip
            row += ["" if d in info.about["unavailable"] else found.count(d) for d in DETECTORS]
        rows.append([*row, *[""] * (len(heading) - len(row))])
    return _csv(heading, rows)


def _curves(findings: Findings, curves: Sequence[Curve], name: str) -> str:
    heading = [*findings.plan.keys, "place", "v_low_kmh", "v_high_kmh", "v_mean_kmh", name, "ci95_low", "ci95_high",
               "runs", "samples", "reliable", "expected", "dry", "dry_ci95_low", "dry_ci95_high", "reason"]  # fmt: skip
    return _csv(heading, [
        [*_values(c.group), c.place, p.low_kmh, p.high_kmh, p.v_kmh, p.value, *p.ci, p.runs, p.samples,
         int(p.reliable), p.expected, c.dry, *c.dry_ci, p.reason]
        for c in curves for p in c.points
    ])  # fmt: skip


def _values(group: Group) -> list[object]:
    return ["" if v is None else v for _, v in group]


def _csv(heading: _Row, rows: Iterable[_Row]) -> str:
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([safe_cell(c) for c in heading])
    writer.writerows([safe_cell(c) for c in row] for row in rows)
    return out.getvalue()
