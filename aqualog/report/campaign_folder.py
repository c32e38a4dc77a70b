"""The folder of a campaign's report: page, plotly.js, pages of the runs, tables; each file whole, the page last."""

from __future__ import annotations

import json
import re
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from aqualog.campaign.samples import CampaignData
from aqualog.core.errors import ConfigError
from aqualog.io.whole import write_text
from aqualog.report.campaign_csv import tables_of
from aqualog.report.campaign_findings import Findings
from aqualog.report.campaign_labels import file_name
from aqualog.report.campaign_page import render_campaign_page
from aqualog.report.campaign_runs import RunFacts, facts_of
from aqualog.report.offline import plotly_js
from aqualog.report.run_page import render_run_page

__all__ = ["MARK", "check_folder", "page_names", "targets_of", "write_report"]

MARK = "aqualog_report.json"
_OWN = re.compile(r"runs/[a-z0-9-]{1,120}\.html|data/[a-z_]{1,60}\.csv|plotly\.min\.js|index\.html")
_TABLES = ("runs.csv", "slip_slope.csv", "resistance.csv", "full_aquaplaning.csv")
_WRITERS, _WAITING = 8, 64  # threads, and pages that wait for them
Report = Callable[[int, int], None]


def page_names(names: Sequence[str]) -> list[str]:
    """Addresses of the runs' pages from the names of the runs, in order; harmless and distinct."""
    return [f"runs/{file_name(i, name)}.html" for i, name in enumerate(names)]


def targets_of(folder: Path, names: Sequence[str]) -> list[Path]:
    """All files that a report of runs with these names consists of."""
    own = [*page_names(names), *(f"data/{t}" for t in _TABLES), "plotly.min.js", "index.html", MARK]
    return [folder / name for name in own]


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

    Each file is complete or absent, and the page comes last, so that its links work. Pages of an
    earlier report that have no run any more are removed; files that are not of a report stay.
    """
    pages = page_names([r.name for r in data.runs])
    earlier = _earlier(folder)
    own = sorted({*pages, *(f"data/{t}" for t in _TABLES), "plotly.min.js", "index.html"})
    _mark(folder, sorted({*own, *earlier}))
    facts: list[RunFacts | None] = []
    # most of a small file's time is the wait until the disk has it
    with ThreadPoolExecutor(_WRITERS) as writers:
        writing: deque[Future[None]] = deque()
        for i, info in enumerate(data.runs):
            samples = data.samples(info) if info.is_done else None
            facts.append(facts_of(info, samples) if samples is not None else None)
            text = _clean(render_run_page(data, info, samples, facts[i], back="../index.html"))
            writing.append(writers.submit(write_text, folder / pages[i], text))
            while len(writing) > (_WAITING if i + 1 < len(pages) else 0):
                writing.popleft().result()
            report(i + 1, len(pages))
    for name, text in tables_of(data, findings, facts, pages).items():
        write_text(folder / "data" / name, _clean(text))
    write_text(folder / "plotly.min.js", plotly_js())
    page = render_campaign_page(data, findings, facts, pages)
    write_text(folder / "index.html", _clean(page))
    for name in set(earlier) - set(own):
        (folder / name).unlink(missing_ok=True)
    _mark(folder, own)
    return len(own) + 1


def _clean(text: str) -> str:
    """Text that UTF-8 can hold: a lone surrogate of a file name becomes a question mark."""
    return text.encode("utf-8", "replace").decode("utf-8")


def _mark(folder: Path, files: Sequence[str]) -> None:
    document: Mapping[str, object] = {"schema_version": 1, "files": list(files)}
    write_text(folder / MARK, json.dumps(document, indent=1) + "\n")


def _earlier(folder: Path) -> list[str]:
    """Files of an earlier report as its mark file lists them; the rest of the mark file is ignored."""
    try:
        files = json.loads((folder / MARK).read_text(encoding="utf-8"))["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    return [f for f in files if isinstance(f, str) and _OWN.fullmatch(f)] if isinstance(files, list) else []
