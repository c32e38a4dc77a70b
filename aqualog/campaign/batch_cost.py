"""A batch of a few logs with the cost of each, run in worker processes and into a store like the whole batch."""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from aqualog.campaign.batch import CRASHED, Fault, measure_one, run_batch
from aqualog.campaign.jobs import Configured, Job
from aqualog.campaign.store import Store
from aqualog.core.compiled import kept_code
from aqualog.guard.worker import Crashed, work_on

__all__ = ["BatchCost", "LogCost", "measure_cost", "peak_memory"]

Report = Callable[[int, int, int], None]

_met: set[str] = set()  # formats that this process has met: their libraries are loaded


class Timing(NamedTuple):
    """Timing of one log in its process: wall-clock and computing time once everything is loaded [s].

    Where the process met its format first it was measured twice, and `loading_s`, `loading_cpu_s` are what the first
    time took longer; else None. `ended` and `cpu_ended_s` are the process's own clocks afterwards, `peak_bytes` the
    most memory that it has held so far, 0 where the system gives no value.
    """

    outcome: Fault | None
    process: int
    wall_s: float
    cpu_s: float
    loading_s: float | None
    loading_cpu_s: float | None
    ended: float
    cpu_ended_s: float
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
    configured: Configured,
    sample: Sequence[tuple[Job, str, int]],
    *,
    processes: int,
    reporter: Callable[[], Report] = lambda: lambda done, total, failed: None,
    told: Callable[[], None] = lambda: None,
) -> BatchCost:
    """Measure a few logs into a store that is thrown away.

    After an installation the detectors are compiled with the first logs, which no other run pays: the sample is then
    measured once more, and `told` is called before.

    Parameters
    ----------
    configured : Configured
    sample : sequence of (job, format, bytes)
    processes : int
        At a time, so that they are in each other's way as in the batch.
    reporter : callable
        Makes the callable that receives the numbers of finished, all and failed logs.
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

    with tempfile.TemporaryDirectory(prefix="aqualog-plan-") as folder:
        store = Store(Path(folder) / "store")
        began = time.perf_counter()
        run_batch(
            replace(configured, campaign=replace(configured.campaign, runs=runs)), store, elsewhere=work_timed,
            report=report,
        )  # fmt: skip
        ended = time.perf_counter()
        found = tuple(_log_cost(spent[k], of, c, store.size_of(k)) for k, c in costs.items())
    real = [(of[spent[k]][0], c) for k, c in costs.items() if isinstance(c, Timing)]
    first, last = marks[:2] or (ended, ended)
    return BatchCost(
        found, processes, first - began, ended - last, _beside(real, asked[0], is_cpu=False),
        _beside(real, 0.0, is_cpu=True), max(asked[1] - max((c.ended for _, c in real), default=asked[1]), 0.0),
        max((c.peak_bytes for _, c in real), default=0),
    )  # fmt: skip


def _beside(costs: Sequence[tuple[str, Timing]], began: float, *, is_cpu: bool) -> float:
    """Time of a process besides its logs: its start, libraries of all formats, waiting. Median. [s]"""
    loading: dict[str, list[float]] = {}
    of: dict[int, list[tuple[str, Timing]]] = {}
    for form, cost in costs:
        of.setdefault(cost.process, []).append((form, cost))
    totals = []
    for own in of.values():
        own.sort(key=lambda x: x[1].ended)
        for form, c in own[1:]:  # with its first log a process loads much that is of no format
            if c.loading_s is not None and c.loading_cpu_s is not None:
                loading.setdefault(form, []).append(c.loading_cpu_s if is_cpu else c.loading_s)
        end = own[-1][1].cpu_ended_s if is_cpu else own[-1][1].ended - began
        logs = sum((c.cpu_s if is_cpu else c.wall_s) * (1 if c.loading_s is None else 2) for _, c in own)
        totals.append((max(end - logs, 0.0), {f for f, _ in own}))
    each = {form: median(x) for form, x in loading.items()}
    return median(t + sum(s for f, s in each.items() if f not in met) for t, met in totals) if totals else 0.0


def _log_cost(
    logs: tuple[Path, ...], of: Mapping[tuple[Path, ...], tuple[str, int]], cost: Timing | Crashed, stored: int
) -> LogCost:
    form, size = of[logs]
    if isinstance(cost, Crashed):
        return LogCost(logs, form, size, cost.seconds, 0.0, 0, CRASHED)
    reason = cost.outcome.reason if cost.outcome is not None else ""
    return LogCost(logs, form, size, cost.wall_s, cost.cpu_s, stored, reason)


def _timed(form: str, task: tuple[Any, ...]) -> Timing:
    """Measure a log, and once more if this process had to load something for it."""
    outcome, wall_s, cpu_s = _measured(task)
    loading_s = loading_cpu_s = None
    if form not in _met and outcome is None:
        _met.add(form)
        first_s, first_cpu_s = wall_s, cpu_s
        outcome, wall_s, cpu_s = _measured(task)
        loading_s, loading_cpu_s = first_s - wall_s, first_cpu_s - cpu_s
    return Timing(
        outcome, os.getpid(), wall_s, cpu_s, loading_s, loading_cpu_s, time.monotonic(), time.process_time(),
        peak_memory(),
    )  # fmt: skip


def _measured(task: tuple[Any, ...]) -> tuple[Fault | None, float, float]:
    began, cpu = time.perf_counter(), time.process_time()
    outcome = measure_one(*task)
    return outcome, time.perf_counter() - began, time.process_time() - cpu


def peak_memory() -> int:
    """Most memory that this process has held; 0 where the system gives no value. [byte]"""
    try:
        import resource
    except ImportError:  # no such count on this system
        return 0
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most if sys.platform == "darwin" else 1024 * most
