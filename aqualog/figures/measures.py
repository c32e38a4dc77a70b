"""Means, lines and differences over the samples of several runs, with intervals that have the run as the unit."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.campaign.bins import Pool, pooled
from aqualog.campaign.regress import Design, estimate
from aqualog.campaign.resistance import dry_level
from aqualog.campaign.samples import RunInfo, RunSamples
from aqualog.core.records import BoolArray, FloatArray
from aqualog.figures.evidence import KMH, Evidence

__all__ = [
    "LEAST_RUNS", "TEN", "Effect", "Means", "additive", "bin_means", "common", "difference", "lines_through", "pool_of",
    "resistance_of", "trend",
]  # fmt: skip

LEAST_RUNS = 3  # for an interval
LEAST_BIN = 3  # samples of a bin that is drawn
_APART = 10_000_000  # between the steps of two wheels of one run, which are no neighbours
TEN = 10 * KMH  # [m/s] step of speed for gradients

Columns = Callable[[RunInfo, RunSamples], tuple[BoolArray, FloatArray] | None]
"""Samples of a run that count (n,), and the value at each (n,); None without any."""


@dataclass(frozen=True, slots=True)
class Effect:
    """A number with its 95 % interval; infinite ends where the runs are too few."""

    value: float
    low: float
    high: float
    runs: int

    @property
    def ci(self) -> tuple[float, float] | None:
        """The interval, if there is one."""
        return (self.low, self.high) if math.isfinite(self.low) and math.isfinite(self.high) else None

    @property
    def is_above(self) -> bool:
        """Whether the whole interval is above 0."""
        return self.low > 0.0

    @property
    def is_below(self) -> bool:
        """Whether the whole interval is below 0."""
        return self.high < 0.0

    def is_none(self, most: float) -> bool:
        """No effect that matters: the interval holds 0, or does not leave ±most."""
        return self.low <= 0.0 <= self.high or self.is_within(most)

    def is_within(self, most: float) -> bool:
        """Whether the whole interval is within ±most."""
        return -most <= self.low and self.high <= most

    def mapped(self, of: Callable[[float], float]) -> Effect:
        """The same in another measure: value and ends of the interval through a rising function."""
        return Effect(of(self.value), of(self.low), of(self.high), self.runs)

    def words(self, digits: int = 3, unit: str = "") -> str:
        """As text."""
        tail = f" {unit}" if unit else ""
        if self.ci is None:
            return f"{self.value:.{digits}f}{tail} ({self.runs} runs, no interval)"
        return f"{self.value:.{digits}f} [{self.low:.{digits}f}, {self.high:.{digits}f}]{tail}"


@dataclass(frozen=True, slots=True)
class Means:
    """Means per bin of speed, arrays (k,): speed [km/h], mean with ends of its interval (NaN without), and counts."""

    v_kmh: FloatArray
    mean: FloatArray
    low: FloatArray
    high: FloatArray
    runs: FloatArray
    samples: FloatArray


def pool_of(evidence: Evidence, runs: Sequence[RunInfo], columns: Columns) -> Pool | None:
    """Samples of runs as `y` over `v_x` [m/s]; None without samples."""
    pieces = []
    for info in sorted(runs, key=lambda r: r.index):
        samples = evidence.data.samples(info)
        found = columns(info, samples)
        if found is None:
            continue
        which, y = found
        v = samples.array("v_x")
        index = np.flatnonzero(which & np.isfinite(y) & np.isfinite(v))
        if index.size:
            pieces.append((info.index, index, {"v_x": v[index], "y": y[index]}))
    return pooled(pieces) if pieces else None


def resistance_of() -> Columns:
    """Resistance measure on water minus the run's own level on the dry road before it. [m/s²]

    A run with less than a second of dry road before the water has no value, as in `campaign.resistance`.
    """

    def columns(_: RunInfo, samples: RunSamples) -> tuple[BoolArray, FloatArray]:
        y = samples.array("delta_a_x")
        level = dry_level(samples, y)
        wet: BoolArray = (samples.on_water == 1.0) & samples.is_usable
        return (wet, y - level) if level is not None else (np.zeros_like(wet), y)

    return columns


def bin_means(pool: Pool, *, width_kmh: float = 10.0) -> Means:
    """Mean of `y` per bin of speed."""
    number = np.floor(pool.columns["v_x"] / KMH / width_kmh).astype(np.int64)
    rows = []
    for k in np.unique(number):
        part = pool.part(number == k)
        if part.step.size < LEAST_BIN:
            continue
        e = lines_through(part, [np.ones(part.step.size)])[0]
        low, high = e.ci or (math.nan, math.nan)
        rows.append(((k + 0.5) * width_kmh, e.value, low, high, float(e.runs), float(part.step.size)))
    return Means(*np.array(rows).reshape(-1, 6).T)


def common(a: Pool, b: Pool) -> tuple[Pool, Pool] | None:
    """Samples of both at the speeds that both have; None without such."""
    low = max(float(p.columns["v_x"].min()) for p in (a, b))
    high = min(float(p.columns["v_x"].max()) for p in (a, b))
    x, y = (p.part((p.columns["v_x"] >= low) & (p.columns["v_x"] <= high)) for p in (a, b))
    return (x, y) if min(x.step.size, y.step.size) >= LEAST_BIN else None


def trend(pool: Pool) -> Effect:
    """Gradient of `y` over speed, per 10 km/h."""
    v = pool.columns["v_x"]
    return lines_through(pool, [np.ones(v.size), (v - v.mean()) / TEN])[1]


def difference(a: Pool, b: Pool) -> tuple[Effect, Effect] | None:
    """b minus a: level in the middle of the speeds that both have, and gradient per 10 km/h; None without common
    speeds."""
    both = common(a, b)
    if both is None:
        return None
    v = np.concatenate([p.columns["v_x"] for p in both])
    which = np.concatenate([np.full(p.step.size, i) for i, p in enumerate(both)])
    run = np.concatenate([p.run for p in both])
    order = np.lexsort((which, run))
    v, which = v[order], which[order].astype(np.float64)
    x = (v - 0.5 * (v.min() + v.max())) / TEN
    pool = Pool(
        run[order], np.concatenate([p.step + i * _APART for i, p in enumerate(both)])[order],
        {"y": np.concatenate([p.columns["y"] for p in both])[order]},
    )  # fmt: skip
    found = lines_through(pool, [np.ones(v.size), x, which, which * x])
    least = min(p.runs for p in both)
    return tuple(e if least >= LEAST_RUNS else _open(e) for e in (found[2], found[3]))  # type: ignore[return-value]


def additive(pools: Sequence[Pool], marks: Sequence[tuple[float, ...]]) -> list[Effect]:
    """Effects of marks (0 or 1) that add to one line over speed; in the order of the marks."""
    run, step = np.concatenate([p.run for p in pools]), np.concatenate([p.step for p in pools])
    v, y = (np.concatenate([p.columns[n] for p in pools]) for n in ("v_x", "y"))
    of = np.repeat(np.arange(len(pools)), [p.step.size for p in pools])
    order = np.lexsort((step, run))
    columns = [np.ones(v.size), (v - v.mean()) / TEN, ((v - v.mean()) / TEN) ** 2]
    columns += [np.array([m[i] for m in marks])[of] for i in range(len(marks[0]))]
    found = lines_through(Pool(run[order], step[order], {"y": y[order]}), [c[order] for c in columns])
    return found[3:]


def lines_through(pool: Pool, columns: list[FloatArray], *, scatters: bool = True) -> list[Effect]:
    """Coefficients of columns (each (n,)) over `y`; the first one, the level, scatters from run to run, or does not."""
    p = len(columns)
    found = estimate(
        Design(
            np.stack(columns), pool.columns["y"], pool.run, pool.step, tuple(scatters and i == 0 for i in range(p)),
            (False,) * p,
        )
    )  # fmt: skip
    effects = [Effect(float(found.value[i]), *found.interval(i), found.runs) for i in range(p)]
    return effects if found.runs >= LEAST_RUNS else [_open(e) for e in effects]


def _open(e: Effect) -> Effect:
    return Effect(e.value, -math.inf, math.inf, e.runs)
