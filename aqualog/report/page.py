"""The sections of a report as a page that needs no network."""

from __future__ import annotations

from aqualog.report import offline
from aqualog.report.sections import Report, shown

__all__ = ["report_page"]


def report_page(report: Report, *, title: str) -> str:
    """The page as HTML; the same text for the same report.

    Parameters
    ----------
    report : Report
    title : str
        Names the drives; may hold anything, it is escaped.
    """
    return offline.render(
        "report.html.j2",
        css=("report.css",),
        scripts=(*report.scripts, "figures.js"),
        islands={"figure-data": dict(report.figures), **report.islands},
        title=title,
        kind=report.kind,
        about=report.about,
        facts=report.facts,
        sections=shown(report.sections, "page"),
        footer=report.footer,
        kind_of=lambda part: type(part).__name__,
    )
