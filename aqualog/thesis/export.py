"""Figures and verdicts as data: the table that is drawn, the JSON documents, the table of claims."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from typing import Any

import numpy as np

from aqualog import __version__
from aqualog.core.records import FloatArray
from aqualog.thesis.claims import VERDICTS, Check, Conclusion
from aqualog.thesis.draw import rounded
from aqualog.thesis.record import Figure, Line, Panel

__all__ = ["claims_csv", "claims_document", "counts_of", "figure_csv", "figures_document"]

Column = tuple[str, FloatArray]
Cells = tuple[str, list[str]]


def figure_csv(figure: Figure) -> str:
    """The drawn data as columns: x, followed by the lines over it; units in the header.

    Lines over the same x share its column. Columns end where their line ends; a cell is empty where a line is broken.
    Columns of one of several panels begin with its letter. The campaign's runs used for it follow as further columns.
    """
    columns: list[Column] = []
    for i, panel in enumerate(figure.panels):
        letter = f"({chr(ord('a') + i)}) " if len(figure.panels) > 1 else ""
        columns += [(letter + name, values) for name, values in _columns(panel)]
    cells: list[Cells] = [(name, ["" if v is None else repr(v) for v in rounded(values)]) for name, values in columns]
    if figure.runs is not None:
        cells += [
            ("run used [-]", [r for r, _ in figure.runs.used]),
            ("shown as [-]", [s for _, s in figure.runs.used]),
        ]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([name for name, _ in cells])
    writer.writerows(zip_longest(*(values for _, values in cells), fillvalue=""))
    return text.getvalue()


def _columns(panel: Panel) -> list[Column]:
    columns: list[Column] = []
    shown: FloatArray | None = None
    for line in panel.lines:
        if line.z is None and shown is not None and np.array_equal(line.x, shown):
            columns += [(f"{line.name}: {panel.y.title}", line.y), *_ends(line, panel)]
            continue
        shown = line.x if line.z is None else None
        columns += _of_line(line, panel)
    for sheet in panel.sheets:
        x, y = np.meshgrid(sheet.x, sheet.y)
        of = f"{sheet.name}: "
        columns += [(of + panel.x.title, x.ravel()), (of + panel.y.title, y.ravel())]
        if panel.z is not None:
            columns.append((of + panel.z.title, sheet.z.ravel()))
    return columns


def _of_line(line: Line, panel: Panel) -> list[Column]:
    if line.z is None:
        columns = [(panel.x.title, line.x), (f"{line.name}: {panel.y.title}", line.y), *_ends(line, panel)]
    else:
        of = f"{line.name}: "
        columns = [(of + panel.x.title, line.x), (of + panel.y.title, line.y)]
        if panel.z is not None:
            columns.append((of + panel.z.title, line.z))
    if line.count is not None:
        columns.append((f"{line.name}: samples [-]", line.count))
    return columns


def _ends(line: Line, panel: Panel) -> list[Column]:
    """Ends of the intervals."""
    ends = (("low", line.low), ("high", line.high))
    return [(f"{line.name}, 95 % {n}: {panel.y.title}", x) for n, x in ends if x is not None]


def figures_document(
    figures: Sequence[Figure], files: Sequence[str], not_made: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Figures with their checks and runs, the files that were written, and the reason for each figure that was not
    made."""
    return {
        "schema_version": 1,
        "tool_version": __version__,
        "figures": [
            {
                "figure": f.number,
                "title": f.title,
                "findings": [
                    {
                        "claim": c.name, "thesis": c.statement, "criterion": c.criterion, "found": c.found,
                        "value": c.value, "ci95": None if c.ci95 is None else list(c.ci95), "unit": c.unit or None,
                        "verdict": c.verdict, "reason": c.reason,
                    }
                    for c in f.checks
                ],
                "runs": None if f.runs is None else {
                    "campaign": f.runs.campaign,
                    "used": [{"run": r, "shown_as": s} for r, s in f.runs.used],
                    "left_out": [{"reason": why, "runs": n} for why, n in f.runs.left_out],
                },
            }
            for f in figures
        ],
        "not_made": [{"figure": number, "reason": why} for number, why in (not_made or {}).items()],
        "files": list(files),
    }  # fmt: skip


_HEADER = (
    "claim", "where", "kind", "statement", "verdict", "part", "criterion", "found", "value", "low", "high",
    "unit", "check_verdict", "reason", "source",
)  # fmt: skip


def counts_of(conclusions: Sequence[Conclusion]) -> dict[str, int]:
    """Claims by verdict, all verdicts."""
    of = Counter(c.verdict for c in conclusions)
    return {v: of[v] for v in VERDICTS}


def claims_document(
    conclusions: Sequence[Conclusion], figures: Sequence[Figure], missing: Mapping[str, str], facts: Mapping[str, Any]
) -> dict[str, Any]:
    """Verdicts, checks and which figures there are; `facts` on how it was made."""
    return {
        "schema_version": 1,
        "tool_version": __version__,
        **facts,
        "counts": counts_of(conclusions),
        "claims": [
            {
                "claim": c.claim.id, "where": c.claim.where, "kind": c.claim.kind, "statement": c.claim.statement,
                "verdict": c.verdict, "checks": [_check(k) for k in c.checks],
            }
            for c in conclusions
        ],
        "figures": [{"figure": f.number, "title": f.title, "table": f"figures/{f.stem}.csv"} for f in figures],
        "figures_missing": dict(missing),
    }  # fmt: skip


def _check(check: Check) -> dict[str, Any]:
    return {
        "part": check.part, "statement": check.statement, "criterion": check.criterion, "found": check.found,
        "value": check.value, "interval": list(check.ci95) if check.ci95 else None, "unit": check.unit or "-",
        "verdict": check.verdict, "reason": check.reason, "source": check.source,
    }  # fmt: skip


def claims_csv(conclusions: Sequence[Conclusion]) -> str:
    """A line per check; `low` and `high` are its 95 % interval, or the range that `found` or `source` names."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_HEADER)
    for c in conclusions:
        for k in c.checks:
            low, high = k.ci95 or ("", "")
            writer.writerow(
                (
                    c.claim.id, c.claim.where, c.claim.kind, c.claim.statement, c.verdict, k.part, k.criterion, k.found,
                    "" if k.value is None else repr(float(k.value)), low, high, k.unit or "-", k.verdict, k.reason,
                    k.source,
                )
            )  # fmt: skip
    return text.getvalue()
