"""Work through a plan in processes, keep each row at once, and tell how long it will take."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence

from aqualog.face.listener import lasting
from aqualog.guard.worker import Crashed, work_on
from tests.blind.metrics.plan import Job
from tests.blind.metrics.rows import Row
from tests.blind.metrics.store import Store

__all__ = ["run"]


def run(
    jobs: Sequence[Job],
    store: Store,
    work: Callable[[Job], Row],
    *,
    processes: int,
    say: Callable[[str], None] | None = None,
) -> list[Row]:
    """Rows of all jobs; those that the store has already are not done again, but for those that failed.

    `processes` 1: in this one, which a stub of a test needs; a case that brings its process down gives a row with an error.
    """
    tell = say or (lambda text: print(text, file=sys.stderr, flush=True))
    todo = {j.key: j for j in jobs if j.key not in store.rows or store.rows[j.key].error}
    done, began, last = 0, time.monotonic(), [0.0]

    def record(key: str, result: Row | Crashed) -> None:
        nonlocal done
        job = todo[key]
        if isinstance(result, Crashed):
            result = Row(
                key, job.group, job.spec.programme, job.spec.noise, job.spec.seed, error="Crashed: the process ended"
            )
        store.add(result)
        done += 1
        now = time.monotonic()
        if now - last[0] > 30.0 or done == len(todo):
            last[0] = now
            left = (len(todo) - done) * (now - began) / done
            tell(
                f"{len(jobs) - len(todo) + done} of {len(jobs)} cases, {lasting(left)} left ({result.key}: {result.verdict or result.error})"
            )

    if len(todo) < len(jobs):
        tell(f"{len(jobs) - len(todo)} of {len(jobs)} cases are in the store")
    if processes == 1:
        for key, job in todo.items():
            record(key, work(job))
    else:
        work_on({k: (j,) for k, j in todo.items()}, work, jobs=processes, record=record)
    return store.having(j.key for j in jobs)
