"""Work on many items in processes of their own: results as they come, nothing lost by an interrupt or a crash."""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Hashable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from threading import Thread, current_thread, main_thread
from typing import Any, NamedTuple, TypeVar

from aqualog.io.in_hand import InHand, bound_memory, watched_by
from aqualog.io.limits import ReadLimits, limits_from

__all__ = [
    "NO_LIMITS", "Crashed", "Limits", "WorkOn", "begin_worker", "most_processes", "within", "work_on",
]  # fmt: skip

_PER_CORE = 4  # more processes than this many a core only take memory
_THREADS = ("POLARS_MAX_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

Name = TypeVar("Name", bound=Hashable)


class Crashed(NamedTuple):
    """The process that worked on an item ended without a word: out of memory, killed, or `seconds` beyond its limit."""

    seconds: float = 0.0


class Limits(NamedTuple):
    """What one item may take: wall-clock `seconds`, and `memory_mb` of a process's own data; None: no limit."""

    seconds: float | None = None
    memory_mb: int | None = None


NO_LIMITS = Limits()
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
        Processes, >= 1; no more than `most_processes` are made. They are spawned: a fork would copy the threads of
        polars and numba.
    record : callable
        Called here with name and result as each is done; the result is `Crashed` if the process ended. An item that
        was merely in work beside one that crashed is done again, alone.
    limits : Limits
        An item that takes longer ends its process; one that wants more memory gets a MemoryError. Without `seconds`,
        reading a log has the time that `aqualog.io.limits` gives it.

    An interrupt lets the items in work finish and records them before it is raised.
    """
    left = dict(tasks)
    suspects = _round(left, work, min(jobs, len(left), most_processes()), record, limits) if left else []
    while suspects:
        # one of them has taken the pool down; each gets a process of its own, which tells which
        name = suspects.pop(0)
        began = time.monotonic()
        if name in left and _round({name: left[name]}, work, 1, lambda n, r: _taken(left, record, n, r), limits):
            left.pop(name)
            record(name, Crashed(time.monotonic() - began))
    if left and len(left) < len(tasks):
        work_on(left, work, jobs=jobs, record=record, limits=limits)


def most_processes() -> int:
    """Most processes that are made on this machine, whatever is asked for."""
    return _PER_CORE * (os.cpu_count() or 1)


def _taken(left: dict[Name, tuple[Any, ...]], record: Callable[[Name, Any], None], name: Name, result: Any) -> None:
    left.pop(name, None)
    record(name, result)


def _round(
    left: dict[Name, tuple[Any, ...]],
    work: Callable[..., Any],
    jobs: int,
    record: Callable[[Name, Any], None],
    limits: Limits,
) -> list[Name]:
    """Work until all is done or the pool breaks; what is done leaves `left`. Returns those that were in work then."""
    todo = iter(list(left.items()))
    pending: dict[Future[Any], Name] = {}
    spawn = multiprocessing.get_context("spawn")
    begin = (limits, limits_from(os.environ))
    with ProcessPoolExecutor(jobs, spawn, initializer=begin_worker, initargs=begin) as pool:
        try:
            # few in the queue: when a pool breaks, only those that it held are in doubt
            for name, task in todo:
                with _no_interrupt():
                    pending[pool.submit(within, limits.seconds, work, *task)] = name
                if len(pending) >= 2 * jobs:
                    broken = _collect(pending, left, record)
                    if broken:
                        return broken
            while pending:
                broken = _collect(pending, left, record)
                if broken:
                    return broken
        except BrokenProcessPool:
            return [name for name in pending.values() if name in left]
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            for future, name in pending.items():
                if future.done() and not future.cancelled() and future.exception() is None:
                    _taken(left, record, name, future.result())
            raise
    return []


def _collect(
    pending: dict[Future[Any], Name], left: dict[Name, tuple[Any, ...]], record: Callable[[Name, Any], None]
) -> list[Name]:
    """Wait for one or more results; if the pool has broken, the names that were in it."""
    ready, _ = wait(pending, return_when=FIRST_COMPLETED)
    in_doubt: list[Name] = []
    for future in ready:
        name = pending.pop(future)
        if isinstance(future.exception(), BrokenProcessPool):
            in_doubt.append(name)
        else:
            _taken(left, record, name, future.result())
    return [*in_doubt, *pending.values()] if in_doubt else []


@contextmanager
def _no_interrupt() -> Iterator[None]:
    """Let an interrupt wait until the end of the block.

    A process started within inherits that, and is not torn from its imports by one; nor is what it reads from here cut
    off, which the mask alone does not ensure: a thread of a library may take the signal for the main thread.
    """
    if not hasattr(signal, "pthread_sigmask") or current_thread() is not main_thread():
        yield
        return
    came: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, handler)
        if came:
            signal.raise_signal(signal.SIGINT)


def within(seconds: float | None, work: Callable[..., Any], *task: Any) -> Any:
    """`work(*task)`; this process ends if that takes too long, be it in a library that never comes back to Python."""
    if seconds is None:
        return work(*task)
    with open(os.devnull, "w") as nowhere:  # noqa: PTH123 - a file with a number, for the watchdog
        faulthandler.dump_traceback_later(seconds, exit=True, file=nowhere)
        try:
            return work(*task)
        finally:
            faulthandler.cancel_dump_traceback_later()


def begin_worker(limits: Limits, read_limits: ReadLimits) -> None:
    """An interrupt is the parent's business; a worker finishes what it has in hand, and ends when its parent has."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    os.environ.update(dict.fromkeys(_THREADS, "1"))  # one a process: these are as many as the cores
    if limits.memory_mb is not None:
        bound_memory(limits.memory_mb * 1_000_000)
    if limits.seconds is not None:  # the item has a watchdog, and there is one only
        watched_by(lambda _: None, read_limits._replace(wall_s=0.0, cpu_s=0.0))
    else:
        watched_by(_Alarm().set, read_limits)
    Thread(target=_end_with_parent, daemon=True).start()


class _Alarm:
    """Ends this process if a step of reading takes too long."""

    def __init__(self) -> None:
        self._nowhere = open(os.devnull, "w")  # noqa: PTH123, SIM115 - as long as the process

    def set(self, held: InHand) -> None:
        """Begin to wait, or stop."""
        if held.log and held.seconds:
            faulthandler.dump_traceback_later(held.seconds, exit=True, file=self._nowhere)
        else:
            faulthandler.cancel_dump_traceback_later()


def _end_with_parent() -> None:
    """Without this, workers of a parent that was killed would wait for work for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
