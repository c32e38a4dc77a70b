"""Cost of a campaign, from a sample of its logs measured as the batch measures: time, memory, disk space, shards."""

from __future__ import annotations

import heapq
import math
import os
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from aqualog.campaign.batch import CRASHED, Fault, compared, measure_one, run_batch
from aqualog.campaign.definition import number_of
from aqualog.campaign.jobs import Configured, Job, plan_jobs
from aqualog.campaign.store import Store
from aqualog.core.compiled import kept_code
from aqualog.core.errors import LogError
from aqualog.core.intervals import student_quantile
from aqualog.core.records import FloatArray
from aqualog.guard.worker import Crashed, work_on
from aqualog.io.fingerprint import Remembered
from aqualog.io.open_log import sniff

__all__ = [
    "BatchCost", "Estimate", "LogCost", "Plan", "Work", "Worker", "choose", "foretell", "makespan", "measure_cost",
    "peak_memory", "shards_within", "work_of",
]  # fmt: skip

Report = Callable[[int, int, int], None]

_met: set[str] = set()  # formats that this process has met: their libraries are loaded


class Times(NamedTuple):
    """Wall-clock and computing time. [s]"""

    wall: float
    cpu: float

    def since(self, began: Times) -> Times:
        """Time that has passed."""
        return Times(self.wall - began.wall, self.cpu - began.cpu)


class Timing(NamedTuple):
    """One log in its process: `took` once everything is loaded.

    Where the process met its format first it was measured twice, and `loading` is what the first time took longer; else
    None. `ended` are the process's own clocks afterwards, `peak_bytes` the most memory that it has held so far, 0 where
    the system gives no value.
    """

    outcome: Fault | None
    process: int
    took: Times
    loading: Times | None
    ended: Times
    peak_bytes: int


@dataclass(frozen=True, slots=True)
class LogCost:
    """One log of the sample; `reason` if it gave no result."""

    logs: tuple[Path, ...]
    format: str
    size: int
    wall_s: float
    cpu_s: float
    store_bytes: int
    reason: str


@dataclass(frozen=True, slots=True)
class BatchCost:
    """Timing of a batch of the sample.

    `hashing_s` before and `tables_s` behind the logs, in the process that leads; `start_s` and `start_cpu_s` of a
    process that meets all formats: all but the logs themselves; `ending_s` until all processes have ended; `peak_bytes`
    of the process that held most.
    """

    tried: tuple[LogCost, ...]
    processes: int
    hashing_s: float
    tables_s: float
    start_s: float
    start_cpu_s: float
    ending_s: float
    peak_bytes: int


def measure_cost(
    configured: Configured, sample: Sequence[tuple[Job, str, int]], *, processes: int,
    reporter: Callable[[], Report] = lambda: lambda done, total, failed: None, told: Callable[[], None] = lambda: None,
) -> BatchCost:  # fmt: skip
    """Measure a few logs, (job, format, bytes) each, into a store that is thrown away.

    After an installation the detectors are compiled with the first logs, which no other run pays: the sample is then
    measured once more, and `told` is called before. So many `processes` work at a time, so that they are in each
    other's way as in the batch. `reporter` makes the callable that receives the numbers of finished, all, failed logs.
    """
    before = kept_code()
    found = _measured_once(configured, sample, processes, reporter())
    if kept_code() <= before:
        return found
    told()
    return _measured_once(configured, sample, processes, reporter())


def _measured_once(
    configured: Configured, sample: Sequence[tuple[Job, str, int]], processes: int, report: Report
) -> BatchCost:
    runs = tuple(configured.campaign.runs[j.runs[0]] for j, _, _ in sample)
    of = {j.logs: (form, size) for j, form, size in sample}
    costs: dict[str, Timing | Crashed] = {}
    spent: dict[str, tuple[Path, ...]] = {}
    marks: list[float] = []
    asked: list[float] = []  # of a clock that all processes of a machine share and nobody sets

    def work_timed(
        tasks: Mapping[Any, tuple[Any, ...]], work: Callable[..., Any], record: Callable[[Any, Any], None]
    ) -> None:
        marks.append(time.perf_counter())
        asked.append(time.monotonic())
        timed = {key: (of[task[3]][0], task) for key, task in tasks.items()}
        spent.update({key: task[3] for key, task in tasks.items()})

        def taken(key: str, cost: Timing | Crashed) -> None:
            costs[key] = cost
            record(key, cost if isinstance(cost, Crashed) else cost.outcome)

        work_on(timed, _timed, jobs=processes, record=taken)
        marks.append(time.perf_counter())
        asked.append(time.monotonic())

    def log_cost(key: str, cost: Timing | Crashed) -> LogCost:
        logs = spent[key]
        if isinstance(cost, Crashed):
            return LogCost(logs, *of[logs], cost.seconds, 0.0, 0, CRASHED)
        return LogCost(logs, *of[logs], *cost.took, store.size_of(key), cost.outcome.reason if cost.outcome else "")

    with tempfile.TemporaryDirectory(prefix="aqualog-plan-") as folder:
        store = Store(Path(folder) / "store")
        began = time.perf_counter()
        some = replace(configured, campaign=replace(configured.campaign, runs=runs))
        run_batch(some, store, elsewhere=work_timed, report=report)
        ended = time.perf_counter()
        found = tuple(log_cost(k, c) for k, c in costs.items())
    real = [(of[spent[k]][0], c) for k, c in costs.items() if isinstance(c, Timing)]
    first, last = marks[:2] or (ended, ended)
    start = [_besides_logs(real, asked[0] if n == 0 else 0.0, n) for n in (0, 1)]
    return BatchCost(
        found, processes, first - began, ended - last, start[0], start[1],
        max(asked[1] - max((c.ended.wall for _, c in real), default=asked[1]), 0.0),
        max((c.peak_bytes for _, c in real), default=0),
    )  # fmt: skip


def _besides_logs(costs: Sequence[tuple[str, Timing]], began: float, clock: int) -> float:
    """Time of a process besides its logs: its start, libraries of all formats, waiting. Median; `clock` of `Times`."""
    loading: dict[str, list[float]] = {}
    of: dict[int, list[tuple[str, Timing]]] = {}
    for form, cost in costs:
        of.setdefault(cost.process, []).append((form, cost))
    totals = []
    for own in of.values():
        own.sort(key=lambda x: x[1].ended.wall)
        for form, c in own[1:]:  # with its first log a process loads much that is of no format
            if c.loading is not None:
                loading.setdefault(form, []).append(c.loading[clock])
        logs = sum(c.took[clock] * (1 if c.loading is None else 2) for _, c in own)
        totals.append((max(own[-1][1].ended[clock] - began - logs, 0.0), {f for f, _ in own}))
    each = {form: median(x) for form, x in loading.items()}
    return median(t + sum(s for f, s in each.items() if f not in met) for t, met in totals) if totals else 0.0


def _timed(form: str, task: tuple[Any, ...]) -> Timing:
    """Measure a log, and once more if this process had to load something for it."""
    outcome, took = _measured(task)
    loading = None
    if form not in _met and outcome is None:
        _met.add(form)
        first = took
        outcome, took = _measured(task)
        loading = first.since(took)
    return Timing(
        outcome, os.getpid(), took, loading, Times(time.monotonic(), time.process_time()), peak_memory()
    )  # fmt: skip


def _measured(task: tuple[Any, ...]) -> tuple[Fault | None, Times]:
    began = Times(time.perf_counter(), time.process_time())
    outcome = measure_one(*task)
    return outcome, Times(time.perf_counter(), time.process_time()).since(began)


def peak_memory() -> int:
    """Most memory that this process has held; 0 where the system gives no value. [byte]"""
    try:
        import resource
    except ImportError:  # no such count on this system
        return 0
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else 1024 * most


LEVEL = 0.9  # of the intervals
_MOST_SHARDS = 2000
_OWN_LINE = 3  # logs of a format from which its time over size is fitted separately


@dataclass(frozen=True, slots=True)
class Work:
    """Logs to measure: job, format and size [byte] of each; how many are in the store, failed there, or are missing."""

    new: tuple[tuple[Job, str, int], ...]
    kept: int
    failed: int
    missing: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value with its interval."""

    value: float
    low: float
    high: float

    def times(self, factor: float) -> Estimate:
        """The same in another unit."""
        return Estimate(factor * self.value, factor * self.low, factor * self.high)


@dataclass(frozen=True, slots=True)
class Worker:
    """Times besides the logs: `lead_s` of the leading process until it looks at the logs, `start_s` of a worker,
    `hashing_s_per_byte`, `tables_s` per log. [s]
    """

    lead_s: float
    start_s: float
    hashing_s_per_byte: float
    tables_s: float


@dataclass(frozen=True, slots=True)
class Plan:
    """Cost of the logs. `seconds` (n,) is the time of each log in its process; `together` how many processes
    work side by side; `stretch` wall-clock over computing time of a log; times in s, sizes in byte.
    """

    seconds: FloatArray
    sizes: FloatArray
    together: int
    worker: Worker
    wall_s: Estimate
    logs_s: Estimate
    cpu_s: Estimate
    store_bytes: Estimate
    stretch: float
    notes: tuple[str, ...] = field(default=())

    @property
    def hashing_s(self) -> float:
        """Time in which the logs are hashed before the work begins."""
        return self.worker.hashing_s_per_byte * float(self.sizes.sum())

    @property
    def tables_s(self) -> float:
        """Time in which the tables are made."""
        return self.worker.tables_s * self.seconds.size


def work_of(configured: Configured, store: Store) -> Work:
    """Work of a batch. No log is read for it: a log that was never hashed is new."""
    todo = plan_jobs(configured, Remembered(store.contents()))
    found = compared(todo, store, force=False)
    new, missing = [], []
    for job in found.new.values():
        try:
            forms = sorted({sniff(p) for p in job.logs})
        except LogError:
            forms = ["unknown"]
        new.append((job, "+".join(forms), sum(map(_bytes, job.logs))))
    missing = [reason for job, reason in found.failed if job.reason]
    return Work(tuple(new), found.kept, len(found.failed) - len(missing), tuple(missing))


def choose(new: Sequence[tuple[Job, str, int]], count: int) -> list[tuple[Job, str, int]]:
    """A sample of so many logs: every format, and within it every part of the sizes with the smallest and the largest.

    A format gets one at least and more by its share of the bytes; files that are not logs have no share.
    """
    by_form: dict[str, list[tuple[Job, str, int]]] = {}
    for entry in sorted(new, key=lambda e: (e[2], e[0].logs)):
        if entry[1] != "unknown":
            by_form.setdefault(entry[1], []).append(entry)
    if not by_form:
        return []
    total = sum(e[2] for entries in by_form.values() for e in entries) or 1
    shares = {f: sum(e[2] for e in entries) / total for f, entries in by_form.items()}
    given = dict.fromkeys(by_form, 1)
    while sum(given.values()) < count:
        open_ = [f for f, entries in by_form.items() if given[f] < len(entries)]
        if not open_:
            break
        given[max(open_, key=lambda f: (shares[f] / given[f], f))] += 1

    def spread(n: int, k: int) -> list[int]:
        """k of n places, ends included; a single one is the last, which shows most about memory."""
        return [n - 1] if k == 1 else sorted({round(x) for x in np.linspace(0, n - 1, k)})

    return [by_form[f][i] for f, k in given.items() for i in spread(len(by_form[f]), k)]


def foretell(work: Work, trial: BatchCost, *, processes: int, cores: int, lead_s: float, lead_cpu_s: float) -> Plan:
    """Cost of the whole from that of the sample.

    Computing time is a constant plus a part that grows with size, per format where there are enough logs of it.
    Wall-clock time has the same ratio to it as in the sample, which includes the machine's other work and its disks.
    The interval is that of the sum over all logs, from the scatter of the sample; it does not cover a machine that is
    busier later.

    `work` holds at least one log of a known format, `trial` one with a result. No more of the requested `processes`
    work in parallel than there are `cores`. `lead_s`, `lead_cpu_s`: time until the leading process is ready. [s]
    """
    good = [t for t in trial.tried if not t.reason]
    forms = [f for _, f, _ in work.new]
    sizes = np.array([s for _, _, s in work.new], dtype=np.float64)
    cpu, cpu_spread = _over_all(good, lambda t: t.cpu_s, forms, sizes)
    stretch, uncertain = _stretch(good)
    seconds = stretch * cpu
    stored, stored_spread = _over_all(good, lambda t: float(t.store_bytes), forms, sizes)
    processes = max(1, min(processes, sizes.size))
    together = min(processes, cores)
    tried_bytes = sum(t.size for t in trial.tried)
    worker = Worker(
        lead_s, trial.start_s + trial.ending_s, trial.hashing_s / max(tried_bytes, 1),
        trial.tables_s / max(len(trial.tried), 1),
    )  # fmt: skip
    around = lead_s + worker.hashing_s_per_byte * float(sizes.sum()) + worker.tables_s * sizes.size
    half = math.hypot(_half_width(cpu_spread, len(good), sizes.size), uncertain)
    # processes that share a core get ready one after another
    starts = trial.start_s * processes / together + trial.ending_s
    start_cpu = lead_cpu_s + processes * trial.start_cpu_s
    return Plan(
        seconds, sizes, together, worker,
        _interval(makespan(seconds, together), half, around + starts),
        _interval(float(seconds.sum()), half, 0.0),
        _interval(float(cpu.sum()), _half_width(cpu_spread, len(good), sizes.size), around - lead_s + start_cpu),
        _interval(float(stored.sum()), _half_width(stored_spread, len(good), sizes.size), 0.0),
        stretch, _notes(work, trial, makespan(seconds, together), starts),
    )  # fmt: skip


def shards_within(configured: Configured, work: Work, plan: Plan, seconds: float) -> tuple[int, float] | None:
    """Fewest parts of `--shard` of which each ends in that time on a machine like this, and time of the longest.

    None if no number does.
    """
    numbers = np.array([number_of(configured.campaign, j.logs) for j, _, _ in work.new], dtype=np.int64)
    fixed = plan.worker.lead_s + plan.worker.start_s
    per_log = plan.seconds + plan.worker.hashing_s_per_byte * plan.sizes * plan.together
    longest = float(plan.seconds.max(initial=0.0))
    if fixed + longest > seconds:
        return None
    least = max(1, math.ceil(float(per_log.sum()) / plan.together / (seconds - fixed + 1e-9)))
    for count in range(least, least + _MOST_SHARDS):
        parts = np.bincount(numbers % count, weights=per_log, minlength=count)
        at_most = fixed + float(parts.max()) / plan.together + longest * (1.0 - 1.0 / plan.together)
        if at_most <= seconds:
            return count, at_most
    return None


def makespan(seconds: FloatArray, processes: int) -> float:
    """Time until all are done where each process takes the next as soon as it is free. [s]"""
    ends = [0.0] * processes
    for s in seconds:
        heapq.heapreplace(ends, ends[0] + float(s))
    return max(ends)


def _over_all(
    good: Sequence[LogCost], cost: Callable[[LogCost], float], forms: Sequence[str], sizes: FloatArray
) -> tuple[FloatArray, float]:
    """Cost of every log, and the relative scatter of the sample about its line."""
    x = np.array([t.size for t in good], dtype=np.float64)
    y = np.array([max(cost(t), 1e-6) for t in good])
    of = [t.format for t in good]
    lines: dict[str, tuple[float, float]] = {}
    every = _line(x, y)
    used = 2
    for form in dict.fromkeys(of):
        own = np.array([f == form for f in of])
        if own.sum() >= _OWN_LINE and x[own].max() > 1.5 * x[own].min():
            lines[form] = _line(x[own], y[own])
            used += 2
        else:
            factor = float(y[own].sum() / (every[0] + every[1] * x[own]).sum())
            lines[form] = (factor * every[0], factor * every[1])
            used += 1
    fitted = np.array([lines[f][0] + lines[f][1] * s for f, s in zip(of, x, strict=True)])
    dof = max(len(good) - min(used, len(good) - 1), 1)
    spread = math.sqrt(float(np.sum((y / fitted - 1.0) ** 2)) / dof)
    lines["unknown"] = (0.0, 0.0)
    found = np.array([lines.get(f, every)[0] + lines.get(f, every)[1] * s for f, s in zip(forms, sizes, strict=True)])
    return found, spread


def _line(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    """y = a + b x with the least relative deviations and the sum of y, a and b not negative."""
    a, b = _shape(x, y)
    # relative deviations alone favour small logs: the result is a sum, which must be right
    factor = float(y.sum() / (a * y.size + b * x.sum()))
    return factor * a, factor * b


def _shape(x: FloatArray, y: FloatArray) -> tuple[float, float]:
    one, slope = 1.0 / y, x / y
    if np.ptp(x) > 0.0:
        (a, b), *_ = np.linalg.lstsq(np.column_stack([one, slope]), np.ones_like(y), rcond=None)
        if a >= 0.0 and b >= 0.0:
            return float(a), float(b)
        if a < 0.0:
            return 0.0, float(np.sum(slope) / np.sum(slope**2))
    return float(np.sum(one) / np.sum(one**2)), 0.0


def _stretch(good: Sequence[LogCost]) -> tuple[float, float]:
    """Wall-clock over computing time of the sample, and half its interval relative to it."""
    wall, cpu = np.array([t.wall_s for t in good]), np.array([t.cpu_s for t in good])
    ratio = float(wall.sum() / max(cpu.sum(), 1e-6))
    if wall.size < 2:
        return ratio, 1.0
    off = math.sqrt(float(np.sum((wall - ratio * cpu) ** 2)) * wall.size / (wall.size - 1)) / float(wall.sum())
    return ratio, min(student_quantile(0.5 + 0.5 * LEVEL, wall.size - 1) * off, 5.0)


def _half_width(spread: float, sampled: int, total: int) -> float:
    """Half the interval of a sum over all logs, relative to it; 0 where all were measured."""
    if sampled < 2 or sampled >= total:
        return 0.0 if sampled >= total else 1.0
    t = student_quantile(0.5 + 0.5 * LEVEL, max(sampled - 2, 1))
    return min(t * spread * math.sqrt(1.0 / sampled + 1.0 / total), 5.0)


def _interval(value: float, half: float, around: float) -> Estimate:
    # a sum of times is not below its measured share
    return Estimate(value + around, value / (1.0 + half) + around, value * (1.0 + half) + around)


def _notes(work: Work, trial: BatchCost, logs_s: float, start_s: float) -> tuple[str, ...]:
    notes = []
    failed = [t for t in trial.tried if t.reason]
    if failed:
        notes.append(f"{len(failed)} of {len(trial.tried)} logs of the sample give no result: {failed[0].reason}")
    unknown = sum(f == "unknown" for _, f, _ in work.new)
    if unknown:
        notes.append(f"{unknown} file{'s are not logs and fail' if unknown > 1 else ' is not a log and fails'} at once")
    met = {t.format for t in trial.tried if not t.reason}
    blind = sorted({f for _, f, _ in work.new} - met - {"unknown"})
    if blind:
        notes.append(f"no log of format {', '.join(blind)} was measured; the times of other formats are used")
    if logs_s < 5.0 * start_s:
        notes.append("starting processes takes much of the time, and varies more than the logs do")
    return tuple(notes)


def _bytes(path: Path) -> int:
    if path.is_dir():
        return sum(_bytes(p) for p in path.iterdir() if not p.is_dir())
    return path.stat().st_size
