"""An examination as text and as a document."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from aqualog import __version__
from aqualog.doctor.records import Examination, Finding

__all__ = ["examination_document", "examination_text"]

_HEADS = {
    "unreadable": "cannot be read",
    "lost": "lost or not used",
    "mended": "mended",
    "doubt": "worth a look",
}


def examination_text(found: Examination) -> str:
    """For a terminal: the files, what is wrong by weight, and which detectors can work."""
    lines = []
    for f in found.files:
        if f.format:
            lines.append(f"{f.file}: {f.format.upper()}, {f.size:,} bytes, {f.channels} channels, {f.samples:,} samples"
                         f", {f.end_s or 0.0:.1f} s")  # fmt: skip
        else:
            lines.append(f"{f.file}: {f.size:,} bytes")
    for level, head in _HEADS.items():
        own = [x for x in found.findings if x.level == level]
        if own:
            lines += ["", f"{head}:", *(line for x in own for line in _lines(x))]
    if not found.findings:
        lines += ["", "nothing is wrong with it"]
    if found.ready:
        lines += ["", f"detectors that can work: {', '.join(found.ready)}"]
    lacks = [f"  {name}: missing {', '.join(signals)}" for name, signals in found.missing if signals]
    if lacks:
        lines += ["", "not, or in part only:", *lacks]
    return "\n".join(lines) + "\n"


def _lines(finding: Finding) -> list[str]:
    where = ": ".join(x for x in (finding.file, finding.channel) if x)
    first = f"  {where}: {finding.what}" if where else f"  {finding.what}"
    return [first, f"    try: {finding.advice}"] if finding.advice else [first]


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
