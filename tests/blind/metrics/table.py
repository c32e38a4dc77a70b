"""The measured figures as text: one line per figure, with count, interval, target, and whether it is reached."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from tests.blind.metrics.measure import Measure, quantity, share
from tests.blind.metrics.rows import Row

__all__ = ["curve_text", "measures_text", "rivals_measures", "rivals_text"]


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


def rivals_measures(rows: Sequence[Row]) -> dict[str, tuple[Measure, Measure, Measure]]:
    """Method -> false discovery, right name first, share of the oracle's gain, each on the same logs for all."""
    with_rivals = [r for r in rows if r.rivals]
    methods: Mapping[str, None] = dict.fromkeys(m for r in with_rivals for m in r.rivals)
    # the library, not the method, decides about effects that no log shows: they count for none
    hidden = [r for r in with_rivals if r.truth and r.truth[0].known and r.truth[0].z >= 8.0]
    nulls = [r for r in with_rivals if not r.truth]
    out = {}
    for method in methods:
        gains = [r.rivals[method].get("gain", math.nan) for r in hidden]
        out[method] = (
            share(13, "false discovery", [r.rivals[method]["found"] > 0.0 for r in nulls], lambda *_: True, "-"),
            share(13, "right name first", [r.rivals[method]["right"] > 0.0 for r in hidden], lambda *_: True, "-"),
            quantity(13, "share of the oracle's gain", gains, _median, lambda _: True, "-"),
        )
    return out


def _median(x: object) -> float:
    import numpy as np

    return float(np.median(np.asarray(x)))


def rivals_text(rows: Sequence[Row], own: str = "aqualog") -> tuple[str, list[Measure]]:
    """The table for the page of rivals in markdown, and whether `own` is ahead of the best of the others on all three."""
    found = rivals_measures(rows)
    lines = [
        "| method | finds something where nothing is (n) | right name first (n) | held-out gain, share of the oracle's, median |",
        "|---|---|---|---|",
    ]
    order = sorted(found, key=lambda m: m != own)
    for method in order:
        null, name, gain = found[method]
        lines.append(f"| {method} | {_cell(null)} | {_cell(name)} | {_cell(gain, count=False)} |")
    if own not in found or len(found) < 2:
        return "\n".join(lines), []
    others = [found[m] for m in found if m != own]
    mine = found[own]
    ahead = []
    for i, (what, better) in enumerate((("false discovery", min), ("right name first", max), ("held-out gain", max))):
        best = better(o[i].value for o in others)
        # a tie with one that says nothing at all on nulls is no defeat
        is_ahead = mine[i].value <= best if better is min else mine[i].value > best
        ahead.append(Measure(13, f"{what}, best of the others {best:.3f}", mine[i].count, mine[i].value, mine[i].low, mine[i].high,
                             "ahead", is_ahead if mine[i].count >= 20 else None))  # fmt: skip
    n = mine[0].count
    dominated = [m for m in found if m != own and all(_at_least(found[m][i].value, mine[i].value, i) for i in range(3))]
    ahead.append(Measure(13, "rivals as good on all three at once", len(others), float(len(dominated)), math.nan, math.nan, "0", not dominated if n >= 20 else None,
                         ", ".join(dominated)))  # fmt: skip
    return "\n".join(lines), ahead


def _at_least(theirs: float, mine: float, i: int) -> bool:
    return theirs <= mine if i == 0 else theirs >= mine


def _cell(m: Measure, *, count: bool = True) -> str:
    if not m.count:
        return "-"
    return f"{m.value:.3f} ({m.low:.3f} ... {m.high:.3f})" + (f" ({m.count})" if count else "")
