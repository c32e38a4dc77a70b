"""Slip slopes of bins as points with errors: change over speed, and relative difference between levels."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from aqualog.campaign.slip_slope import SlopeRow
from aqualog.core.intervals import student_quantile
from aqualog.core.records import FloatArray
from aqualog.figures.evidence import KMH
from aqualog.figures.measures import TEN, Effect

__all__ = ["fall", "line_of_logs", "ratio", "uneven", "usable"]

_ROUNDS = 50


def usable(rows: Sequence[SlopeRow]) -> list[SlopeRow]:
    """Bins with an interval."""
    return [r for r in rows if r.reliable]


def _log(r: SlopeRow) -> tuple[float, float]:
    """Logarithm of the slope and its standard error."""
    low, high = r.slope_ci
    return math.log(r.slope), 0.5 * (math.log(high) - math.log(low)) / student_quantile(0.975, max(r.dof, 1.0))


def line_of_logs(rows: Sequence[SlopeRow], columns: Sequence[FloatArray]) -> list[Effect] | None:
    """Coefficients of columns (each (n,)) over the logarithms of the slopes; None with no more bins than columns.

    Weights come from each bin's own error and from the additional scatter about the line. The scatter is DerSimonian
    and Laird's moment [dersimonian1986], repeated until it converges. The interval is Student's, with bins minus
    columns as degrees of freedom. A run passes through two or three neighbouring bins, and both wheels of an axle share
    it; the bins are assumed to be independent.
    """
    x = np.stack(columns, axis=1)
    n, p = x.shape
    if n <= p or np.linalg.matrix_rank(x) < p:
        return None
    y, se = (np.array(v) for v in zip(*(_log(r) for r in rows), strict=True))
    se = np.maximum(se, 1e-4)
    tau2 = 0.0
    for _ in range(_ROUNDS):
        w = 1.0 / (se**2 + tau2)
        cov = np.linalg.inv((x.T * w) @ x)
        b = cov @ ((x.T * w) @ y)
        q = float(np.sum(w * (y - x @ b) ** 2))
        more = (q - (n - p)) / float(np.sum(w))
        new = max(tau2 + more, 0.0)
        if abs(new - tau2) <= 1e-6 * max(tau2, 1e-8):
            break
        tau2 = new
    t = student_quantile(0.975, float(n - p))
    runs = min(r.runs for r in rows)
    half = t * np.sqrt(np.diag(cov) * max(q / (n - p), 1.0))
    return [Effect(float(v), float(v - h), float(v + h), runs) for v, h in zip(b, half, strict=True)]


def _tens(rows: Sequence[SlopeRow]) -> FloatArray:
    v = np.array([r.v_mean for r in rows])
    tens: FloatArray = (v - v.mean()) / TEN
    return tens


def fall(rows: Sequence[SlopeRow]) -> Effect | None:
    """Relative change of the slope per 10 km/h; None with fewer than three bins."""
    told = usable(rows)
    found = line_of_logs(told, [np.ones(len(told)), _tens(told)]) if len(told) > 2 else None
    return _percent(found[1]) if found else None


def ratio(a: Sequence[SlopeRow], b: Sequence[SlopeRow], *, up_to_kmh: float = math.inf) -> tuple[Effect, Effect] | None:
    """Slope of b over that of a, at the speeds of bins that both have, and how the fall differs per 10 km/h (relative).

    None with fewer than two such bins; with two, the second value has no interval.
    """
    first, second = ({(r.wheel, r.low_kmh): r for r in usable(rows) if r.high_kmh <= up_to_kmh} for rows in (a, b))
    keys = sorted(set(first) & set(second), key=lambda k: (k[1], k[0]))
    if len(keys) < 2:
        return None
    rows = [first[k] for k in keys] + [second[k] for k in keys]
    v = np.array([0.5 * (r.low_kmh + r.high_kmh) * KMH for r in rows])
    x = (v - v.mean()) / TEN
    which = np.repeat([0.0, 1.0], len(keys))
    left = np.array([float(r.wheel.endswith("l")) for r in rows])
    columns = [np.ones(x.size), which, x, which * x]
    # wheels of each side may have a separate level
    columns += [left] if 0.0 < left.mean() < 1.0 else []
    found = line_of_logs(rows, columns)
    if found is None:
        return None
    e = found[1]
    return e.mapped(lambda x: math.exp(min(x, 20.0))), _percent(found[3])


def uneven(rows: Sequence[SlopeRow]) -> float:
    """Root mean square deviation of the slopes from their own line over speed, relative; NaN with fewer than 3 bins."""
    told = usable(rows)
    if len(told) < 3:
        return math.nan
    y, x = np.array([math.log(r.slope) for r in told]), _tens(told)
    line = np.polynomial.polynomial.polyfit(x, y, 1)
    return float(np.sqrt(np.sum((y - np.polynomial.polynomial.polyval(x, line)) ** 2) / (len(told) - 2)))


def _percent(e: Effect) -> Effect:
    """From a logarithm to a relative change. [%]"""
    return e.mapped(lambda x: 100.0 * math.expm1(min(x, 20.0)))
