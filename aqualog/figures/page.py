"""Figures on one page: one file that needs no network, with plotly.js in it once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from aqualog.figures.draw import panel_figure
from aqualog.figures.record import BORNE_OUT, IN_PART, NOT_BORNE_OUT, Figure
from aqualog.report import offline

__all__ = ["panel_ids", "render_figures"]

_TEMPLATES = Path(__file__).parent / "templates"


def panel_ids(figure: Figure) -> list[str]:
    """Ids of the plots of a figure, always the same: figure_3_09_a, ..."""
    return [f"{figure.stem}_{chr(ord('a') + i)}" for i in range(len(figure.panels))]


def render_figures(figures: Sequence[Figure], *, title: str) -> str:
    """The page as HTML; the same text for the same figures. More than one get a table of all claims first.

    Parameters
    ----------
    figures : sequence of Figure
    title : str
    """
    ids = {f.stem: panel_ids(f) for f in figures}
    plots = {i: panel_figure(p) for f in figures for i, p in zip(ids[f.stem], f.panels, strict=True)}
    return offline.render(
        "figures.html.j2",
        folders=(_TEMPLATES,),
        css=("figures.css",),
        islands={"figure-data": plots},
        title=title,
        kind="",
        about="the thesis' figures, made again",
        facts=(),
        figures=figures,
        panels={f.stem: list(zip(ids[f.stem], f.panels, strict=True)) for f in figures},
        counts=_counts(figures),
    )


def _counts(figures: Sequence[Figure]) -> str:
    of = Counter(c.verdict for f in figures for c in f.findings)
    return ", ".join(f"{of[v]} {v}" for v in (BORNE_OUT, IN_PART, NOT_BORNE_OUT))
