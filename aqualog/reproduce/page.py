"""The page of a reproduction: every claim with its verdict, every figure, in one file that needs no network."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from aqualog.figures.draw import panel_figure
from aqualog.figures.page import panel_ids
from aqualog.figures.record import Figure, stem_of
from aqualog.report import offline
from aqualog.reproduce.catalogue import KINDS
from aqualog.reproduce.check import Check
from aqualog.reproduce.document import counts_of
from aqualog.reproduce.run import Conclusion
from aqualog.reproduce.verdict import VERDICTS

__all__ = ["render_reproduction"]

_TEMPLATES = Path(__file__).parent / "templates"
_FIGURES = Path(__file__).parents[1] / "figures" / "templates"


def render_reproduction(
    conclusions: Sequence[Conclusion], figures: Sequence[Figure], missing: Mapping[str, str], facts: Sequence[str]
) -> str:
    """The page as HTML; the same text for the same results.

    Parameters
    ----------
    conclusions : sequence of Conclusion
    figures : sequence of Figure
    missing : mapping
        Number of a figure -> why it could not be made.
    facts : sequence of str
        Sentences on how it was made.
    """
    ids = {f.stem: panel_ids(f) for f in figures}
    plots = {i: panel_figure(p) for f in figures for i, p in zip(ids[f.stem], f.panels, strict=True)}
    return offline.render(
        "reproduction.html.j2",
        folders=(_TEMPLATES, _FIGURES),
        css=("figures.css", "reproduction.css"),
        scripts=("figures.js", "reproduction.js"),
        islands={"figure-data": plots},
        title=f"{len(figures)} figures and {len(conclusions)} claims of the thesis",
        kind="the thesis reproduced",
        about="Fichtinger, TU Wien 2024, made again",
        figures=figures,
        panels={f.stem: list(zip(ids[f.stem], f.panels, strict=True)) for f in figures},
        missing=missing,
        conclusions=conclusions,
        counts=counts_of(conclusions),
        classes={v: v.replace(" ", "-") for v in VERDICTS},
        kinds=KINDS,
        facts=facts,
        number_told=_number_told,
        anchor_of=_anchor_of,
    )


def _number_told(check: Check) -> str:
    """The number that was judged, with its interval and unit; empty without one."""
    if check.value is None:
        return ""
    unit = "" if check.unit in ("", "-") else f" {check.unit}"
    interval = f" [{check.ci95[0]:.4g}, {check.ci95[1]:.4g}]" if check.ci95 else ""
    return f"{check.value:.4g}{interval}{unit}"


def _anchor_of(source: str) -> str:
    """The section of the figure that a check is from; empty for any other source."""
    match = re.fullmatch(r"figure (\d\.\d{1,2})", source)
    return stem_of(match[1]) if match else ""
