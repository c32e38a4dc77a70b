"""An examination as sections and as a document."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from aqualog import __version__
from aqualog.doctor.findings import Examination, Finding
from aqualog.report.sections import Lines, Para, Report, Section
from aqualog.report.values import CELL, NOTE, cut
from aqualog.report.wording import not_judged

__all__ = ["examination_document", "examination_report"]

_MAP = "`aqualog inspect LOG --write-map map.toml` proposes which channel is which signal; then --signals map.toml"
_HEADS = {
    "unreadable": "Cannot be read:",
    "lost": "Lost or not used:",
    "mended": "Mended:",
    "doubt": "Worth checking:",
}


def examination_report(found: Examination) -> Report:
    """The files, problems by weight, and the detectors that can run."""
    files = []
    for f in found.files:
        read = f", {f.channels} channels, {f.samples:,} samples, {f.end_s or 0.0:.1f} s" if f.format else ""
        files.append(f"{cut(f.file, CELL)}: {f'{f.format.upper()}, ' if f.format else ''}{f.size:,} bytes{read}")
    lacks = [(name, signals) for name, signals in found.missing if signals]
    closing = "no problem found" if not found.findings else ""
    able = f"detectors that can run: {', '.join(found.ready)}" if found.ready else ""
    if lacks and not found.ready:
        able = f"no detector can run\n    try: {_MAP}"
    sections = [
        Section("", [Para("\n".join(files), "everywhere")]),
        *(Section(head, [Lines([_line(x) for x in found.findings if x.level == level], most=1000)])
          for level, head in _HEADS.items()),
        Section("", [Para(closing, "everywhere")]),
        Section("", [Para(able, "everywhere")]),
        *not_judged(
            [x for x in lacks if x[0] not in found.ready], [x for x in lacks if x[0] in found.ready]
        ),
    ]  # fmt: skip
    return Report("examination", "what is wrong with a log", sections)


def _line(finding: Finding) -> str:
    where = [cut(x, CELL) for x in (finding.file, finding.channel) if x]
    advice = f"\ntry: {cut(finding.advice, NOTE)}" if finding.advice else ""
    return ": ".join([*where, cut(finding.what, NOTE)]) + advice


def examination_document(found: Examination) -> dict[str, Any]:
    """For JSON; `healthy` if nothing was lost."""
    return {
        "schema_version": 1,
        "tool_version": __version__,
        "healthy": not found.has_loss,
        "files": [asdict(f) for f in found.files],
        "findings": [asdict(f) for f in found.findings],
        "detectors": {"ready": list(found.ready), "missing": {name: list(s) for name, s in found.missing if s}},
    }
