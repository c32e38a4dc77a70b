"""An examination as sections and as a document."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from aqualog import __version__
from aqualog.doctor.findings import Examination, Finding, Picture
from aqualog.report.figures import axis, figure, line
from aqualog.report.sections import Cell, Figures, Headline, Lines, Para, Report, Section, Table
from aqualog.report.theme import FULL_SHADE, INK, THRESHOLD
from aqualog.report.values import CELL, NOTE, counted, cut, plot_text, pretty_unit
from aqualog.report.wording import detector_name, not_judged

__all__ = ["examination_document", "examination_report"]

_HEADS = {
    "unreadable": "Cannot be read:",
    "lost": "Lost:",
    "left_out": "Left out:",
    "mended": "Mended:",
    "doubt": "Worth checking:",
}
_LEVELS = {
    "unreadable": ("unreadable", "full", "cannot be read"),
    "lost": ("lost", "full", "lost"),
    "left_out": ("left out", "partial", "left out"),
    "doubt": ("check", "partial", "worth checking"),
    "mended": ("mended", "ran", "mended"),
}
"""Word, class of the page's style, and words for several, of each weight; the heaviest first."""
_PICTURES = (
    "Red: where the fault is, as far as its time is known; of faulty time stamps the first one. Least and greatest "
    "values are drawn, as they stand in the file."
)
_MOST_DRAWN = 24
_LEAST_MARK = 0.004  # of the width, so that a moment can be seen


def examination_report(found: Examination) -> Report:
    """The files, problems by weight, and the detectors that can run."""
    files = []
    for f in found.files:
        read = f", {counted(f.channels, 'channel')}, {f.samples:,} samples, {f.end_s or 0.0:.1f} s" if f.format else ""
        files.append(f"{cut(f.file, CELL)}: {f'{f.format.upper()}, ' if f.format else ''}{f.size:,} bytes{read}")
    lacks = [(name, signals) for name, signals in found.missing if signals]
    closing = "no problem found" if not found.findings else ""
    able = f"detectors that can run: {', '.join(found.ready)}" if found.ready else ""
    if lacks and not found.ready:
        able = f"no detector can run\n    try: {found.hint}"
    figures = _figures(found)
    sections = [
        *_page(found, lacks, figures),
        Section("", [Para("\n".join(files), "text")], where="text"),
        *(Section(head, [Lines([_line(x) for x in found.findings if x.level == level], most=1000)], where="text")
          for level, head in _HEADS.items()),
        Section("", [Para(closing, "text")], where="text"),
        Section("", [Para(able, "text")], where="text"),
        *not_judged(
            [x for x in lacks if x[0] not in found.ready], [x for x in lacks if x[0] in found.ready]
        ),
    ]  # fmt: skip
    return Report("examination", "what is wrong with a log", sections, figures=figures)


def _line(finding: Finding) -> str:
    where = [cut(x, CELL) for x in (finding.file, finding.channel) if x]
    advice = f"\ntry: {cut(finding.advice, NOTE)}" if finding.advice else ""
    return ": ".join([*where, cut(finding.what, NOTE)]) + advice


# --- the page --------------------------------------------------------------------------------------------------------


def _page(found: Examination, lacks: list[tuple[str, tuple[str, ...]]], figures: Mapping[str, Any]) -> list[Section]:
    """What was found first, then pictures of it, then what can be done with the log."""
    ordered = [f for level in _LEVELS for f in found.findings if f.level == level]
    counts = {level: sum(f.level == level for f in ordered) for level in _LEVELS}
    told = [f"{n} {_LEVELS[level][2]}" for level, n in counts.items() if n]
    head = f"{counted(len(ordered), 'finding')}: {', '.join(told)}" if ordered else "No problem found"
    able = f"{counted(len(found.ready), 'detector')} can run" if found.ready else "No detector can run"
    look = (
        "full" if found.has_loss else "partial" if counts["doubt"] or counts["left_out"] or not found.ready else "none"
    )
    rows: list[list[str | Cell]] = [
        [Cell(_LEVELS[f.level][0], tag=_LEVELS[f.level][1]), cut(f.file, CELL) or "–", cut(f.channel, CELL) or "–",
         cut(f.what, NOTE), cut(f.advice, NOTE) or "–"]
        for f in ordered
    ]  # fmt: skip
    files: list[list[str | Cell]] = [
        [cut(f.file, CELL), f.format.upper() or "–", f"{f.size:,}", f"{f.channels:,}", f"{f.samples:,}",
         f"{f.end_s:.1f}" if f.end_s is not None else "–"]
        for f in found.files
    ]  # fmt: skip
    return [
        Section("", [Headline(head, [f"{able}."])], "verdict", look=f"verdict {look}", where="page"),
        Section("Findings", [
            Table(("Kind", "File", "Channel", "What", "What to do"), rows, "findings", range(5), wide=(3, 4)),
        ], "findings-section", where="page"),
        Section("Channels with a finding", [Figures(list(figures)), Para(_PICTURES)] if figures else [],
                "pictures-section", where="page"),
        Section("Detectors", [
            Table(("Detector", "State", "Signals"), _detectors(found, dict(lacks)), "detectors", (0, 1, 2), wide=(2,)),
            Para("" if found.ready else f"Try {found.hint}."),
        ], "detector-section", where="page"),
        Section("Files", [
            Table(("File", "Format", "Bytes", "Channels", "Samples", "Length [s]"), files, "files", (0, 1)),
        ], "file-section", where="page"),
    ]  # fmt: skip


def _detectors(found: Examination, lacks: Mapping[str, tuple[str, ...]]) -> list[list[str | Cell]]:
    rows: list[list[str | Cell]] = [
        [detector_name(d), Cell("can run", tag="ran"), f"without {', '.join(lacks[d])}" if d in lacks else "–"]
        for d in found.ready
    ]
    return rows + [
        [detector_name(d), Cell("cannot run", tag="unavailable"), f"needs {', '.join(signals)}"]
        for d, signals in lacks.items() if d not in found.ready
    ]  # fmt: skip


def _figures(found: Examination) -> dict[str, Any]:
    """A picture of each channel that a finding names, by the id of its place on the page."""
    named = {(f.file, f.channel) for f in found.findings}
    shown = [p for p in found.pictures if (p.file, p.channel) in named][:_MOST_DRAWN]
    return {f"picture-{i}": _picture(p, is_alone=len(found.files) == 1) for i, p in enumerate(shown)}


def _picture(p: Picture, *, is_alone: bool) -> dict[str, Any]:
    title = plot_text(p.channel if is_alone else f"{p.file}: {p.channel}")
    least = _LEAST_MARK * float(p.t[-1] - p.t[0])
    marks = [
        {"type": "rect", "xref": "x", "x0": round(a, 3), "x1": round(max(b, a + least), 3), "yref": "paper", "y0": 0,
         "y1": 1, "fillcolor": FULL_SHADE, "line": {"width": 1, "color": THRESHOLD}, "layer": "below"}
        for a, b in p.spans
    ]  # fmt: skip
    values = line("", p.t, p.values, INK, width=1.2, showlegend=False, hovertemplate="%{x:.2f} s: %{y}<extra></extra>")
    unit = pretty_unit(p.unit) if p.unit else ""
    return figure([values], title, axis("time [s]"), axis(plot_text(unit)), height=260, shapes=marks)


def examination_document(found: Examination) -> dict[str, Any]:
    """For JSON; `healthy` if nothing was lost or left out."""
    return {
        "schema_version": 1,
        "tool_version": __version__,
        "healthy": not found.has_loss and all(f.level != "left_out" for f in found.findings),
        "files": [asdict(f) for f in found.files],
        "findings": [asdict(f) for f in found.findings],
        "detectors": {"ready": list(found.ready), "missing": {name: list(s) for name, s in found.missing if s}},
    }
