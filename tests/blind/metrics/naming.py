"""Metrics 4 to 7: power at the stated limit, intervals, forecasts, confounds; and how risk falls with coverage."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aqualog.model.effects import EFFECTS
from tests.blind.metrics.intervals import bootstrap
from tests.blind.metrics.measure import Measure, by, share
from tests.blind.metrics.rows import Row

__all__ = ["confounds", "coverage", "forecasts", "limits", "risk_coverage"]

STRONG = 8.0
_BINS = 5


def _singles(rows: Sequence[Row], group: str) -> list[Row]:
    return [r for r in rows if r.group == group and len(r.truth) == 1 and r.truth[0].known]


def _mistake(row: Row) -> str:
    return row.error.split(":")[0] or ("+".join(c.key for c in row.causes) or row.verdict)


def limits(rows: Sequence[Row]) -> list[Measure]:
    """Metric 4: the power at the limit that was stated in other logs of the same kind."""
    at_limit = [r for r in _singles(rows, "limit") if not r.error]
    # a limit that is the smallest size worth naming may be seen more often than it says
    named = [r for r in at_limit if _at_smallest(r)]
    at_limit = [r for r in at_limit if not _at_smallest(r)]
    return [
        share(4, "found at the stated limit", [r.found for r in at_limit], "0.85 ... 0.95", least=40),
        share(4, "found at the smallest size worth naming", [r.found for r in named], ">= 0.85", least=20),
    ]


def _at_smallest(row: Row) -> bool:
    """Whether what is hidden is no larger than what is worth naming."""
    fact = row.truth[0]
    p = EFFECTS[fact.effect].parameters[0]
    return abs(fact.values.get(p.name, p.neutral) - p.neutral) <= 1.01 * p.smallest


def coverage(rows: Sequence[Row]) -> list[Measure]:
    """Metric 5: share of 95 % intervals that hold the true value, where the name is right; per effect."""
    hits: dict[str, list[bool]] = {}
    for row in rows:
        if row.verdict not in ("named", "compound"):
            continue
        facts = {f.key: f for f in row.truth}
        for cause in row.causes:
            fact = facts.get(cause.key)
            for name, (_, low, high) in cause.values.items() if fact else ():
                if name in fact.values and math.isfinite(low + high):  # the others were not sought
                    hits.setdefault(f"{cause.effect}.{name}", []).append(low <= fact.values[name] <= high)
    every = [h for x in hits.values() for h in x]
    out = [share(5, "true value within the 95 % interval", every, "0.92 ... 0.98", least=100)]
    for name, x in sorted(hits.items()):
        # a cell of twenty cannot show more than that 0.92 ... 0.98 is within its exact interval
        out.append(share(5, f"  {name}", x, "0.92 ... 0.98 within", accept=_holds_the_level, least=10))
    return out


def _holds_the_level(_: float, low: float, high: float) -> bool:
    return low <= 0.98 and high >= 0.92


def forecasts(rows: Sequence[Row]) -> list[Measure]:
    """Metric 6: the forecast chance to tell one effect from another beside the share in which it was so."""
    pairs = [p for r in rows for p in r.pairs]
    if len(pairs) < 2 * _BINS:
        return [Measure(6, "forecast against outcome", len(pairs), math.nan, math.nan, math.nan, "<= 0.05", None)]
    forecast, right = np.array([p for p, _ in pairs]), np.array([float(o) for _, o in pairs])
    per_case = [np.array(r.pairs, dtype=float) for r in rows if r.pairs]
    errors, skill = _bin_errors(forecast, right), _skill(forecast, right)

    def drawn(statistic):  # the tests of one log share its noise: a log is what is drawn
        def of(picked):
            x = np.vstack([per_case[int(i)] for i in picked])
            return statistic(x[:, 0], x[:, 1])

        return bootstrap(range(len(per_case)), of)  # fmt: skip

    enough = len(pairs) >= 500
    worst, low, high = float(np.max(errors)), *drawn(lambda p, o: float(np.max(_bin_errors(p, o))))
    s_low, s_high = drawn(_skill)
    return [
        Measure(6, "forecast against outcome, worst bin", len(pairs), worst, low, high, "<= 0.05", worst <= 0.05 if enough else None,
                f"{len(per_case)} logs; bins {' '.join(f'{e:.3f}' for e in errors)}"),
        Measure(6, "Brier skill over a constant", len(pairs), skill, s_low, s_high, "> 0", skill > 0.0 if enough else None),
    ]  # fmt: skip


def _bin_errors(forecast: np.ndarray, right: np.ndarray) -> np.ndarray:
    order = np.argsort(forecast, kind="stable")
    return np.array([abs(forecast[i].mean() - right[i].mean()) for i in np.array_split(order, _BINS) if i.size])


def _skill(forecast: np.ndarray, right: np.ndarray) -> float:
    constant = float(np.mean((right - right.mean()) ** 2))
    return 1.0 - float(np.mean((forecast - right) ** 2)) / constant if constant > 0.0 else math.nan


def confounds(rows: Sequence[Row]) -> list[Measure]:
    """Metric 7: causes that the log cannot part; only cases where nothing in the log breaks the relation."""
    twins = [r for r in rows if r.group == "twins" and not r.error]
    cases = [r for r in twins if r.truth[0].z >= STRONG and _exact(r)]
    out = [
        share(7, "cannot tell, all members listed", [_tells_not(r) for r in cases], "1.00", least=20),
        share(7, "one name without reserve", [r.single for r in cases], "<= 0.01", least=20),
    ]
    for name, group in sorted(by(cases, lambda r: " = ".join(r.members)).items()):
        said = ", ".join(f"{n} {len(g)}" for n, g in by([r for r in group if not _lists(r)], _mistake).items())
        out.append(share(7, f"  {name}", [_tells_not(r) for r in group], "1.00", least=5, note=said))
    return out


def _exact(row: Row) -> bool:
    """The twins leave next to nothing of the trace: less than noise hides, or than two simulators differ."""
    return row.separation < max(2.0, 1e-3 * row.truth[0].z ** 2)


def _tells_not(row: Row) -> bool:
    return row.verdict == "cannot_tell" and _lists(row)


def _lists(row: Row) -> bool:
    effects = {k.split("@")[0] for k in row.listed}
    return set(row.members) <= effects


def risk_coverage(rows: Sequence[Row]) -> list[tuple[float, float, float]]:
    """(evidence asked for, share with one name, share of these that is wrong) as ever more evidence is asked for.

    The evidence is -log10 of the p-value of the test for anything at all.
    """
    cases = [r for r in _singles(rows, "named") if not r.error]
    strength = {r.key: -math.log10(max(r.p_value, 1e-12)) if math.isfinite(r.p_value) else 0.0 for r in cases}
    curve = []
    for least in sorted({round(s, 1) for s in strength.values()}):
        named = [r for r in cases if r.single and strength[r.key] >= least]
        if named:
            curve.append((least, len(named) / len(cases), sum(r.wrong for r in named) / len(named)))
    return curve
