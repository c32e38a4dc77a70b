"""An examination as text and as a document."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from aqualog import __version__
from aqualog.doctor.findings import Examination, Finding
from aqualog.report.wording import CELL, NOTE, cut, lacking

__all__ = ["examination_document", "examination_text"]

_MAP = "`aqualog inspect LOG --write-map map.toml` proposes which channel is which signal; then --signals map.toml"
_HEADS = {
    "unreadable": "cannot be read",
    "lost": "lost or not used",
    "mended": "mended",
    "doubt": "worth checking",
}


def examination_text(found: Examination) -> str:
    """Terminal text: the files, problems by weight, and the detectors that can run."""
    lines = []
    for f in found.files:
        if f.format:
            size = f"{f.size:,} bytes, {f.channels} channels, {f.samples:,} samples, {f.end_s or 0.0:.1f} s"
            lines.append(f"{cut(f.file, CELL)}: {f.format.upper()}, {size}")
        else:
            lines.append(f"{cut(f.file, CELL)}: {f.size:,} bytes")
    for level, head in _HEADS.items():
        own = [x for x in found.findings if x.level == level]
        if own:
            lines += ["", f"{head}:", *(line for x in own for line in _lines(x))]
    if not found.findings:
        lines += ["", "no problem found"]
    if found.ready:
        lines += ["", f"detectors that can run: {', '.join(found.ready)}"]
    lacks = [(name, signals) for name, signals in found.missing if signals]
    if lacks and not found.ready:
        lines += ["", "no detector can run", f"    try: {_MAP}"]
    none = [f"  {name}: missing {lacking(signals)}" for name, signals in lacks if name not in found.ready]
    part = [f"  {name}: without {lacking(signals)}" for name, signals in lacks if name in found.ready]
    for head, block in (("not judged:", none), ("judged in part:", part)):
        lines += ["", head, *block] if block else []
    return "\n".join(lines) + "\n"


def _lines(finding: Finding) -> list[str]:
    where = ": ".join(cut(x, CELL) for x in (finding.file, finding.channel) if x)
    what = cut(finding.what, NOTE)
    first = f"  {where}: {what}" if where else f"  {what}"
    return [first, f"    try: {cut(finding.advice, NOTE)}"] if finding.advice else [first]


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
