"""The measured figures as text: one line per figure, with count, interval, target, and whether it is reached."""

from __future__ import annotations

import math
from collections.abc import Sequence

from tests.blind.metrics.measure import Measure

__all__ = ["curve_text", "measures_text"]


def measures_text(measures: Sequence[Measure]) -> str:
    """A table in plain text."""
    head = ("", "metric", "n", "measured", "95 % interval", "target", "reached")
    rows = [head]
    for m in measures:
        number = "" if m.number == 0 or m.name.startswith("  ") else str(m.number)
        span = f"{_number(m.low)} ... {_number(m.high)}" if math.isfinite(m.low) and m.count else "-"
        reached = {True: "yes", False: "NO", None: "too few"}[m.reached] if m.target != "-" else "-"
        rows.append((number, m.name, str(m.count), _number(m.value), span, m.target, reached))
    widths = [max(len(r[i]) for r in rows) for i in range(len(head))]
    lines = ["  ".join(x.ljust(w) for x, w in zip(r, widths, strict=True)).rstrip() for r in rows]
    for i, m in enumerate(measures):
        if m.note:
            lines[i + 1] += f"   [{m.note}]"
    return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:]])


def _number(x: float) -> str:
    if not math.isfinite(x):
        return "-" if math.isnan(x) else "inf"
    return f"{x:.3f}" if abs(x) < 100.0 else f"{x:.0f}"


def curve_text(curve: Sequence[tuple[float, float, float]]) -> str:
    """Risk over coverage, a line for every tenth of coverage."""
    lines = ["-log10 p asked for   share with one name   share of these wrong"]
    last = math.inf
    for least, coverage, risk in curve:
        if last - coverage >= 0.05:
            last = coverage
            lines.append(f"{least:18.1f}   {coverage:19.3f}   {risk:20.4f}")
    return "\n".join(lines)
