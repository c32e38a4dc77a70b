"""Pages: figures, or a whole reproduction with every claim, in one file that needs no network."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from aqualog.report.page import render
from aqualog.thesis.claims import KINDS, VERDICTS, Check, Conclusion
from aqualog.thesis.draw import panel_figure
from aqualog.thesis.export import counts_of
from aqualog.thesis.record import Figure, stem_of

__all__ = ["render_figures", "render_reproduction"]

_TEMPLATES = Path(__file__).parent / "templates"
_CLASSES = {v: v.replace(" ", "-") for v in VERDICTS}


def panel_ids(figure: Figure) -> list[str]:
    """Ids of the plots of a figure, always the same: figure_3_09_a, ..."""
    return [f"{figure.stem}_{chr(ord('a') + i)}" for i in range(len(figure.panels))]


def render_figures(figures: Sequence[Figure], *, title: str) -> str:
    """The page as HTML; the same text for the same figures. More than one get a table of all claims first."""
    of = Counter(c.verdict for f in figures for c in f.checks)
    counts = ", ".join(f"{of[v]} {v}" for v in VERDICTS if of[v])
    return render(
        "figures.html.j2", folders=(_TEMPLATES,), css=("figures.css",), title=title, kind="",
        about="the thesis' figures, made again", facts=(), counts=counts, **_drawn(figures),
    )  # fmt: skip


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
    return render(
        "reproduction.html.j2", folders=(_TEMPLATES,), css=("figures.css", "reproduction.css"),
        scripts=("figures.js", "reproduction.js"),
        title=f"{len(figures)} figures, {len(conclusions)} claims of the thesis", kind="the thesis reproduced",
        about="Fichtinger, TU Wien 2024, made again", missing=missing, conclusions=conclusions,
        counts=counts_of(conclusions), kinds=KINDS, facts=facts, number_of=_number_of, anchor_of=_anchor_of,
        **_drawn(figures),
    )  # fmt: skip


def _drawn(figures: Sequence[Figure]) -> dict[str, Any]:
    """Figures with the ids of their panels, and all plots as data."""
    ids = {f.stem: panel_ids(f) for f in figures}
    plots = {i: panel_figure(p) for f in figures for i, p in zip(ids[f.stem], f.panels, strict=True)}
    panels = {f.stem: list(zip(ids[f.stem], f.panels, strict=True)) for f in figures}
    return {"figures": figures, "panels": panels, "islands": {"figure-data": plots}, "classes": _CLASSES}


def _number_of(check: Check) -> str:
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
