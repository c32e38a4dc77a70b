"""Metrics 1 to 7 and the honesty of the verdicts: false discovery, names, intervals, forecasts, confounds."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aqualog.model.effects import EFFECTS
from tests.blind.metrics.intervals import bootstrap
from tests.blind.metrics.measure import Measure, by, right_first, right_or_listed, share
from tests.blind.metrics.rows import Row

__all__ = [
    "confounds", "coverage", "false_discovery", "forecasts", "honesty", "naming", "risk_coverage", "weak", "wrong_names",
]  # fmt: skip

STRONG, SURE = 8.0, 0.95
_BINS = 5


def false_discovery(rows: Sequence[Row]) -> list[Measure]:
    """Metric 1: anything found where nothing is hidden, over all and in the worst cell of noise and programme."""
    nulls = [r for r in rows if not r.truth and not r.error]
    out = [share(
        1, "false discovery, nothing hidden", [r.found for r in nulls],
        "<= 0.05, upper bound <= 0.075", accept=lambda v, _, high: v <= 0.05 and high <= 0.075, least=400,
    )]  # fmt: skip
    out.append(share(1, "p-value below its level", [r.p_value <= 0.01 for r in nulls], "-"))
    cells = by(nulls, lambda r: f"{r.noise}, {r.programme}")
    if cells:
        name, worst = max(cells.items(), key=lambda c: (sum(r.found for r in c[1]) / len(c[1]), len(c[1])))
        note = f"{name}; {len(cells)} cells"
        out.append(share(1, "the worst cell", [r.found for r in worst], "<= 0.10", least=10, note=note))
    for name, group in sorted(by(nulls, lambda r: r.noise).items()):
        out.append(share(1, f"noise {name}", [r.found for r in group], "<= 0.10", least=10))
    return out


def _singles(rows: Sequence[Row], group: str) -> list[Row]:
    return [r for r in rows if r.group == group and len(r.truth) == 1 and r.truth[0].known]


def _isolable(rows: Sequence[Row]) -> list[Row]:
    """Cases of one effect that is strong and, by the forecast made before the residual was seen, can be told.

    A case that failed has no forecast and counts.
    """
    return [r for r in rows if r.error or (r.truth[0].z >= STRONG and r.truth[0].p_right >= SURE)]


def naming(rows: Sequence[Row]) -> list[Measure]:
    """Metric 2: names at z >= 8 where the forecast says that they can be told; a case that failed is a miss."""
    cases = _isolable(_singles(rows, "named"))
    effects = by(cases, lambda r: r.truth[0].effect)
    note = f"{len(effects)} effects"
    out = [
        share(2, "right name first", [right_first(r) for r in cases], ">= 0.95", least=300, note=note),
        share(2, "right name named or left open", [right_or_listed(r) for r in cases], ">= 0.98", least=300),
    ]  # fmt: skip
    for effect, group in sorted(effects.items()):
        places = by([r for r in group if not right_first(r)], _mistake)
        missed = ", ".join(f"{n} {len(g)}" for n, g in sorted(places.items(), key=lambda c: -len(c[1])))
        out.append(share(2, f"  {effect}", [right_first(r) for r in group], ">= 0.95", least=10, note=missed))
    return out


def _mistake(row: Row) -> str:
    return row.error.split(":")[0] or ("+".join(c.key for c in row.causes) or row.verdict)


def wrong_names(rows: Sequence[Row]) -> list[Measure]:
    """Metric 3: a name given without reserve that is not hidden; everything that was not detected counts as a case."""
    out = []
    for group, text, most in (("named", "moderate sizes", 0.01), ("third", "30 % sizes", 0.03)):
        cases = _singles(rows, group)
        out.append(share(3, f"wrong and sure, {text}", [r.wrong for r in cases], f"<= {most}", least=100))
    return out


def weak(rows: Sequence[Row]) -> list[Measure]:
    """Metric 4: effects of z = 3 ... 5, and the power at the limit that was stated in other logs of the same kind."""
    cases = [r for r in _singles(rows, "weak") if 3.0 <= r.truth[0].z <= 5.0]
    at_limit = [r for r in _singles(rows, "limit") if not r.error]
    # a limit that is the smallest size worth naming may be seen more often than it says
    named = [r for r in at_limit if _at_smallest(r)]
    at_limit = [r for r in at_limit if not _at_smallest(r)]
    return [
        share(4, "wrong and sure at z 3 ... 5", [r.wrong for r in cases], "<= 0.05", least=40),
        share(4, "found at z 3 ... 5", [r.found for r in cases], "-", least=10**9),
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


def honesty(rows: Sequence[Row]) -> list[Measure]:
    """Who always abstains is never wrong: how often one name is given where it can be."""
    cases = _isolable(_singles(rows, "named"))
    return [share(0, "one name given, z >= 8 and isolable", [r.single for r in cases], ">= 0.8", least=100)]


def risk_coverage(rows: Sequence[Row]) -> list[tuple[float, float, float]]:
    """(evidence asked for, share with one name, share of these that is wrong) as ever more evidence is asked for.

    The evidence is -log10 of the p-value of the test for anything at all.
    """
    cases = [r for g in ("named", "third", "weak") for r in _singles(rows, g) if not r.error]
    strength = {r.key: -math.log10(max(r.p_value, 1e-12)) if math.isfinite(r.p_value) else 0.0 for r in cases}
    curve = []
    for least in sorted({round(s, 1) for s in strength.values()}):
        named = [r for r in cases if r.single and strength[r.key] >= least]
        if named:
            curve.append((least, len(named) / len(cases), sum(r.wrong for r in named) / len(named)))
    return curve
