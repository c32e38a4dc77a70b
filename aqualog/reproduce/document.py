"""A reproduction as data: the JSON document, and the table of claims."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from aqualog import __version__
from aqualog.figures.record import Figure
from aqualog.reproduce.check import Check
from aqualog.reproduce.run import Conclusion
from aqualog.reproduce.verdict import VERDICTS

__all__ = ["claims_csv", "counts_of", "document"]

_HEADER = (
    "claim", "where", "kind", "statement", "verdict", "part", "criterion", "found", "value", "low", "high",
    "unit", "check_verdict", "reason", "source",
)  # fmt: skip


def counts_of(conclusions: Sequence[Conclusion]) -> dict[str, int]:
    """Claims by verdict, all verdicts."""
    of = Counter(c.verdict for c in conclusions)
    return {v: of[v] for v in VERDICTS}


def document(
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
        "value": check.value, "interval": list(check.ci95) if check.ci95 else None, "unit": check.unit,
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
                    "" if k.value is None else repr(k.value), low, high, k.unit, k.verdict, k.reason, k.source,
                )
            )  # fmt: skip
    return text.getvalue()
