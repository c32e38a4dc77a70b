"""Batches of short logs: two processes beside one, and many logs beside few."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

from tests.bench.child import Child, run
from tests.bench.compare import Row
from tests.bench.logs import CAR, many_logs
from tests.bench.scale import Scale

LIMIT_S = 3600.0  # [s] no log takes as long; with a limit one process is a worker, too


def batched(logs: Path, store: Path, jobs: int) -> Child:
    """`aqualog batch`, into a store that is not there yet."""
    try:
        return run(
            "-m", "aqualog", "batch", logs, "--vehicle", CAR, "-o", store, "--jobs", str(jobs), "--quiet",
            "--progress", "off",
        )  # fmt: skip
    finally:
        shutil.rmtree(store, ignore_errors=True)


def in_batch(logs: Path, store: Path, **options: Any) -> int:
    """The same in this process; logs that gave results."""
    from aqualog.campaign.batch import run_batch
    from aqualog.campaign.store import Store
    from aqualog.config.configured import configure_logs

    try:
        return run_batch(configure_logs(sorted(logs.iterdir()), CAR), Store(store), **options).done
    finally:
        shutil.rmtree(store, ignore_errors=True)


def steady(logs: Path, store: Path, jobs: int) -> float:
    """Wall time of a log [s] once all processes have had theirs: from the first fifth on."""
    from aqualog.guard.worker import Limits

    stamps: list[tuple[float, int]] = []

    def report(done: int, total: int, failed: int) -> None:
        assert not failed
        stamps.append((time.perf_counter(), done))

    in_batch(logs, store, jobs=jobs, limits=Limits(LIMIT_S), report=report)
    last, total = stamps[-1]
    began, before = next((t, n) for t, n in stamps if n >= max(2 * jobs, total // 5))
    return (last - began) / (total - before)


def pool_rows(folder: Path, scale: Scale) -> list[Row]:
    """Efficiency of two processes: the time of one over twice that of two."""
    logs = many_logs(folder / "logs", scale.batch, scale.log_s)
    place = _places(folder)
    what = f"{scale.batch} logs of {scale.log_s:g} s, wall; efficiency"
    return [
        Row(
            "batch, two processes, warm", "one process", 0.9, lambda: steady(logs, place(), 2),
            lambda: steady(logs, place(), 1), clock="wall", rounds=3, peer_work=2.0, cost=float,
            conditions=f"{what}; from the first fifth of the logs on, per log",
        ),
        Row(
            "batch, two processes, cold", "`--jobs 1`", 0.9, lambda: batched(logs, place(), 2),
            lambda: batched(logs, place(), 1), clock="wall", rounds=1, peer_work=2.0, cost=lambda c: c.wall_s,
            conditions=f"{what}; `aqualog batch` with its start and that of the workers",
        ),
    ]  # fmt: skip


def growth_rows(folder: Path, scale: Scale) -> list[Row]:
    """Cost of a log among many beside that among few."""
    place = _places(folder)
    few, *more = scale.logs
    rows, here = [], many_logs(folder / f"logs{few}", few, scale.log_s)
    for many in more:
        there = many_logs(folder / f"logs{many}", many, scale.log_s)

        def call(logs: Path = there) -> int:
            return in_batch(logs, place())

        def beside(logs: Path = here) -> int:
            return in_batch(logs, place())

        rows.append(Row(
            f"cost per log, {many} logs", f"itself, {few} logs", 1.0 / 1.1, call, beside, _all_done(many, few),
            rounds=3 if many <= 100 else 1, work=many, peer_work=few,
            conditions=f"batch of logs of {scale.log_s:g} s in one warm process, with hashes and tables",
        ))  # fmt: skip
        few, here = many, there
    return rows


def _all_done(many: int, few: int) -> Callable[[int, int], str]:
    return lambda a, b: "" if (a, b) == (many, few) else f"{a} and {b} logs were done"


def _places(folder: Path) -> Callable[[], Path]:
    """A folder that is not there, for each call."""
    numbers = count()
    return lambda: folder / f"store{next(numbers)}"
