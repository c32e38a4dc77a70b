"""Work on many items in processes of their own: results as they come, nothing lost by an interrupt or a crash."""

from __future__ import annotations

import os
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager
from multiprocessing.connection import wait
from multiprocessing.util import Finalize
from threading import Lock, Timer
from typing import Any, TypeVar

from aqualog.guard.limits import limits_from
from aqualog.guard.worker import NO_LIMITS, Bounds, Crashed, Limits, Raised, Worker, uninterrupted

__all__ = ["WorkOn", "kept_worker", "most_processes", "work_on"]

_PER_CORE = 4  # more processes than this many a core only take memory
_IDLE_S = 30.0  # a kept worker waits so long for the next task, and then gives its memory back

Name = TypeVar("Name", bound=Hashable)
WorkOn = Callable[[Mapping[Any, tuple[Any, ...]], Callable[..., Any], Callable[[Any, Any], None]], None]
"""Something that calls work(*task) for every task, anywhere, and then record(name, result) here, `Crashed` included."""


def work_on(
    tasks: Mapping[Name, tuple[Any, ...]],
    work: Callable[..., Any],
    *,
    jobs: int,
    record: Callable[[Name, Any], None],
    limits: Limits = NO_LIMITS,
) -> None:
    """Call `work(*task)` for every task in up to `jobs` processes.

    Parameters
    ----------
    tasks : mapping name -> arguments
        Picklable, as is `work`, a function of a module. It should return failures it expects as values.
    jobs : int
        Processes, >= 1; no more than `most_processes` are made.
    record : callable
        Called here with name and result as each is done; the result is `Crashed` if the process ended, and
        ended once more with the item alone in a new one.
    limits : Limits
        An item that takes longer ends its process; one that wants more memory gets a MemoryError. Without `seconds`,
        reading a log has the time that `aqualog.guard.limits` gives it.

    An interrupt lets the items in work finish and records them before it is raised.
    """
    # what has ended a process is tried again when all others are done: the process may have been ended for what earlier
    # items had left in it, or for what others took beside it
    bounds = Bounds(limits, limits_from(os.environ))
    for name in _round(tasks, work, min(jobs, len(tasks), most_processes()), record, bounds):
        _round({name: tasks[name]}, work, 1, record, bounds)


def most_processes() -> int:
    """Most processes that are made on this machine, whatever is asked for."""
    return _PER_CORE * (os.cpu_count() or 1)


def _round(
    tasks: Mapping[Name, tuple[Any, ...]],
    work: Callable[..., Any],
    jobs: int,
    record: Callable[[Name, Any], None],
    bounds: Bounds,
) -> list[Name]:
    """Work on all; what was alone in a new process and ended it is recorded as that. Returns others that ended one."""
    in_doubt: list[Name] = []
    workers: list[Worker] = []
    free: list[Worker] = []
    busy: dict[Any, tuple[Worker, Name]] = {}

    def hire() -> None:
        workers.append(Worker(bounds))
        workers[-1].start()
        free.append(workers[-1])

    def take(pipe: Any, *, is_interrupted: bool = False) -> None:
        with uninterrupted():  # what has come is recorded
            worker, name = busy.pop(pipe)
            is_alone = jobs == 1 and worker.is_new
            result = worker.take()
            if is_interrupted:
                if not isinstance(result, Crashed | Raised):
                    record(name, result)
                return
            if isinstance(result, Raised):
                raise result.error
            if isinstance(result, Crashed) and not is_alone:
                in_doubt.append(name)
            else:
                record(name, result)
        if isinstance(result, Crashed):
            worker.end()
            workers.remove(worker)
        else:
            free.append(worker)

    try:
        while len(workers) < jobs:  # all, before the first waits for what it is given
            hire()
        for name, task in tasks.items():
            if not free:
                hire()
            with uninterrupted():
                worker = free.pop(0)
                worker.give(work, task)
                busy[worker.pipe] = worker, name
            while not free and len(busy) == jobs:
                for pipe in wait(list(busy)):
                    take(pipe)
        while busy:
            for pipe in wait(list(busy)):
                take(pipe)
    except BaseException:
        while busy:
            for pipe in wait(list(busy)):
                take(pipe, is_interrupted=True)
        raise
    finally:
        for worker in workers:
            worker.let_go()
        for worker in workers:
            worker.end()
    return in_doubt


_idle: dict[Worker, Timer] = {}
_lock = Lock()


@contextmanager
def kept_worker(bounds: Bounds, folder: str | None = None) -> Iterator[Callable[..., Any]]:
    """Within the block `do(work, *task)` calls `work(*task)` in another process; `Crashed` where that has ended it.

    Parameters
    ----------
    bounds : Bounds
        Of the work.
    folder : str, optional
        For temporary files, in a separate folder that is removed with the process; default: the system's.

    One thread at a time has a process. It is kept for a while, since its start takes longer than many a log.
    """
    with _lock:
        worker = next((w for w in _idle if w.bounds == bounds), None)
        if worker is not None:
            _idle.pop(worker).cancel()
    if worker is None:
        worker = Worker(bounds, folder)
        Finalize(None, worker.end, exitpriority=0)  # or the end of this process waits for the worker's
    try:
        yield worker.do
    finally:
        timer = Timer(_IDLE_S, _dismiss, [worker])
        timer.daemon = True
        with _lock:
            _idle[worker] = timer
        timer.start()


def _dismiss(worker: Worker) -> None:
    with _lock:
        is_idle = _idle.pop(worker, None) is not None
    if is_idle:
        worker.end()
