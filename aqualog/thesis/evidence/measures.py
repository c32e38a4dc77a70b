"""Means, lines and differences over runs, passes or bins of slip slopes; intervals have the run as the unit."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.campaign.bins import Pool, pooled
from aqualog.campaign.full_speed import fit_half
from aqualog.campaign.means import dry_level
from aqualog.campaign.results import RunInfo, RunSamples
from aqualog.campaign.slip_slope import SlopeRow
from aqualog.campaign.spin_downs import Pass, passes
from aqualog.core.intervals import half_width, student_quantile
from aqualog.core.moments import Design
from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.regression import degrees_of_freedom, estimate
from aqualog.thesis.claims import NEEDS_DATA, NOT_REPRODUCED, REPRODUCED, Verdict
from aqualog.thesis.evidence.campaign import KMH, Evidence

__all__ = [
    "TEN", "TOO_FEW", "Effect", "Means", "additive", "begins", "bin_means", "common", "difference", "fall",
    "full_speed", "half_speeds", "has_full", "has_minor", "line_of_logs", "lines_through", "over_passes", "passes_of",
    "pool_of", "ratio", "resistance_of", "trend", "uneven", "usable",
]  # fmt: skip

LEAST_RUNS = 3  # for an interval
LEAST_BIN = 3  # samples of a bin that is drawn
_APART = 10_000_000  # between the steps of two wheels of one run, which are no neighbours
TEN = 10 * KMH  # [m/s] step of speed for gradients
TOO_FEW = "Too few runs: the interval holds no effect as well as one that counts."

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

    def absent(self, most: float) -> Verdict:
        """Verdict on "no effect": the interval stays within ±most. One that holds 0 and leaves them needs more runs."""
        is_open = self.low <= 0.0 <= self.high
        return REPRODUCED if self.is_within(most) else NEEDS_DATA if is_open else NOT_REPRODUCED

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

    A run with less than a second of dry road before the water has no value, as in `campaign.means`.
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


_DRAWS, _SEED = 400, 20_240  # of passes, for the interval; as in `campaign.full_speed`


def passes_of(evidence: Evidence, runs: Sequence[RunInfo]) -> list[Pass]:
    """Passes of some runs."""
    return passes(evidence.part(runs))


def has_minor(p: Pass) -> bool:
    """Whether a free wheel has a minor spin-down."""
    return any(p.minor.values())


def has_full(p: Pass) -> bool:
    """Whether a free wheel loses half of its speed."""
    return any(p.full.values())


def begins(p: Pass) -> bool:
    """Whether a free wheel has a minor spin-down, or is beyond."""
    return has_minor(p) or has_full(p)


def half_speeds(found: Sequence[Pass], events: Sequence[Callable[[Pass], bool]]) -> list[tuple[float, FloatArray]]:
    """For each kind of event: speed at which half of the passes have one, and the same for bootstrapped passes,
    array (400,). [m/s] NaN where the passes are of one kind.
    """
    v = np.array([p.v_mean for p in found])
    rng = np.random.default_rng(_SEED)
    times = rng.multinomial(v.size, np.full(v.size, 1.0 / v.size), size=_DRAWS).astype(np.float64)
    out = []
    for event in events:
        hit: BoolArray = np.array([event(p) for p in found], dtype=bool)
        out.append((float(fit_half(v, hit, np.ones((1, v.size)))[0]), fit_half(v, hit, times)))
    return out


def full_speed(found: Sequence[Pass]) -> float:
    """Speed at which half of the passes have a full spin-down; NaN where none or all have. [m/s]"""
    return half_speeds(found, [has_full])[0][0] if found else float("nan")


def over_passes(columns: Sequence[FloatArray], y: FloatArray) -> list[Effect] | None:
    """Coefficients of columns (each (n,)) over passes, one value each; None with too few passes."""
    n = y.size
    x = np.stack(columns)
    if n < max(LEAST_RUNS, len(columns) + 2) or np.linalg.matrix_rank(x) < len(columns):
        return None
    return lines_through(Pool(np.arange(n), np.zeros(n, dtype=np.int64), {"y": y}), list(columns), scatters=False)


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
    and Laird's moment [dersimonian1986] for errors that hang together, repeated until it converges. A run passes
    through several bins, and both wheels of an axle share it: the errors of the bins are put together run by run, as
    `aqualog.core.regression` has them [bell2002]. The interval is Student's, with the degrees of freedom of the runs
    [satterthwaite1946], or bins minus columns where these are fewer.
    """
    x = np.stack(columns, axis=1)
    n, p = x.shape
    if n <= p or np.linalg.matrix_rank(x) < p:
        return None
    y, se = (np.array(v) for v in zip(*(_log(r) for r in rows), strict=True))
    se = np.maximum(se, 1e-4)
    part, share = _runs_of(rows)
    shared = (se[:, None] * part) @ (se[:, None] * part).T
    shared[np.diag_indices(n)] = se**2  # with what a late v_x adds to each
    tau2 = 0.0
    for _ in range(_ROUNDS):
        w = 1.0 / (se**2 + tau2)
        to_value = np.linalg.inv((x.T * w) @ x) @ (x.T * w)
        left = np.diag(w) - (x * w[:, None]) @ to_value  # takes the line off, and weighs
        more = (float(y @ left @ y) - float(np.vdot(left, shared))) / float(np.trace(left)) - tau2
        new = max(tau2 + more, 0.0)
        if abs(new - tau2) <= 1e-6 * max(tau2, 1e-8):
            break
        tau2 = new
    variance = np.einsum("ik,kl,il->i", to_value, shared + tau2 * np.eye(n), to_value)
    runs = min(r.runs for r in rows)
    found = []
    for a, v, square in zip(to_value, to_value @ y, variance, strict=True):
        half = half_width(math.sqrt(max(float(square), 0.0)), min(_dof(a * se, share), float(n - p)))
        found.append(Effect(float(v), float(v - half), float(v + half), runs))
    return found


def _runs_of(rows: Sequence[SlopeRow]) -> tuple[FloatArray, FloatArray]:
    """Parts and shares of all runs in the bins, each (n, g)."""
    at = {run: i for i, run in enumerate(sorted({int(i) for r in rows for i in r.by_run.run}))}
    part, share = np.zeros((len(rows), len(at))), np.zeros((len(rows), len(at)))
    for k, r in enumerate(rows):
        where = [at[int(i)] for i in r.by_run.run]
        part[k, where], share[k, where] = r.by_run.part, r.by_run.share
    return part, share


def _dof(weight: FloatArray, share: FloatArray) -> float:
    """Degrees of freedom of a sum of bins (n,): what it takes of each, and the shares of the runs in them (n, g)."""
    omega = np.zeros((share.shape[1],) * 2)
    for a, s in zip(weight, np.minimum(share, 1.0 - 1e-6), strict=True):
        root = s / np.sqrt(1.0 - s)
        omega += a * a * (np.diag(s / (1.0 - s)) - np.outer(root, root))
    return degrees_of_freedom(omega) if omega.size else math.inf


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
