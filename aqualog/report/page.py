"""The sections of a report as a page that needs no network, and as a part of a notebook."""

from __future__ import annotations

from dataclasses import replace

from aqualog.report import offline
from aqualog.report.sections import Figures, Part, Report, Residuals, shown

__all__ = ["report_fragment", "report_page"]


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
        kind_of=_kind_of,
    )


def report_fragment(report: Report) -> str:
    """The sections without their figures as HTML for a notebook, which has its own style."""
    drawn = (Figures, Residuals)
    sections = [
        replace(s, parts=parts)
        for s in shown(report.sections, "page")
        if (parts := [p for p in s.parts if not isinstance(p, drawn)])
    ]
    return offline.fragment("fragment.html.j2", sections=sections, kind_of=_kind_of)


def _kind_of(part: Part) -> str:
    return type(part).__name__
