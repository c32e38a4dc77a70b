"""The processes in which a dask worker reads its logs: a log that ends its process does not end the worker."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from threading import Lock, Timer
from typing import Any, NamedTuple

from aqualog.io.in_hand import bound_memory
from aqualog.io.limits import ReadLimits, limits_from
from aqualog.workers import Crashed, Limits, begin_worker, within

__all__ = ["Bounds", "bounds_here", "hand"]

_IDLE_S = 30.0  # after its last log a process stays for the next task, and then gives its memory back


class Bounds(NamedTuple):
    """Limits of the work: for one item, and for one reading step."""

    item: Limits
    reading: ReadLimits


def bounds_here(asked: Bounds, memory: int | None) -> Bounds:
    """The requested limits, else those of this worker's environment; never more memory than dask gives the worker.

    Parameters
    ----------
    asked : Bounds
        Of the command; None is not set.
    memory : int or None
        dask's limit of the worker, which it keeps for the worker's own process only. [byte]

    Raises
    ------
    ConfigError
        If a variable of the environment is not a number.
    """
    given = {name: value for name, value in asked.reading._asdict().items() if value is not None}
    reading = limits_from(os.environ)._replace(**given)
    most = [m for m in (reading.memory_here(), memory) if m]
    return Bounds(asked.item, reading._replace(memory=min(most, default=0)))


_free: list[_Hand] = []
_lock = Lock()
_starting = Lock()


@contextmanager
def hand(bounds: Bounds, folder: str | None = None) -> Iterator[Callable[..., Any]]:
    """Within the block `do(work, *task)` calls `work(*task)` in another process; `Crashed` where that has ended it.

    Parameters
    ----------
    bounds : Bounds
        As of `bounds_here`.
    folder : str, optional
        For temporary files, in a separate folder that is removed with the process; default: the system's.

    A thread at a time has a process; it is kept for a while, since its start takes longer than many a log.
    """
    with _lock:
        mine = next((h for h in _free if h.bounds == bounds), None) or _Hand(bounds, folder)
        mine.stay()
        if mine in _free:
            _free.remove(mine)
    try:
        yield mine.do
    finally:
        with _lock:
            _free.append(mine)
            mine.leave_after(_IDLE_S)


class _Hand:
    """One process, made when it is needed and again when an item has ended it."""

    def __init__(self, bounds: Bounds, folder: str | None) -> None:
        self.bounds = bounds
        self._folder = folder
        self._pool: ProcessPoolExecutor | None = None
        self._scratch = ""
        self._timer: Timer | None = None

    def do(self, work: Callable[..., Any], *task: Any) -> Any:
        """The result of an item, or `Crashed`; what the work raises is raised."""
        is_new = self._pool is None
        began = time.monotonic()
        try:
            if self._pool is None:
                self._pool = self._made()
            with _may_have_children():
                future = self._pool.submit(within, self.bounds.item.seconds, work, *task)
            return future.result()
        except BrokenProcessPool:
            seconds = time.monotonic() - began
            self.end()
        # a process used before may have been ended for exceeding limits then
        return Crashed(seconds) if is_new else self.do(work, *task)

    def end(self) -> None:
        """End the process and remove its files."""
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            shutil.rmtree(self._scratch, ignore_errors=True)
            self._pool = None

    def stay(self) -> None:
        """Mark it as needed."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def leave_after(self, seconds: float) -> None:
        """End it at that time if it is not needed."""
        self._timer = Timer(seconds, self._leave)
        self._timer.daemon = True
        self._timer.start()

    def _leave(self) -> None:
        with _lock:
            if self not in _free or self._timer is None:
                return
            _free.remove(self)
        self.end()

    def _made(self) -> ProcessPoolExecutor:
        self._scratch = tempfile.mkdtemp(prefix="aqualog-", dir=self._folder)
        begin = (*self.bounds, self._scratch)
        return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), initializer=_begin, initargs=begin)


@contextmanager
def _may_have_children() -> Iterator[None]:
    """Let a daemonic dask worker have child processes, which multiprocessing forbids because they might outlive it.

    These children end with their parent by themselves, and multiprocessing has no public option for that.
    """
    config: dict[str, Any] = vars(multiprocessing.current_process()).get("_config", {})
    with _starting:
        before = config.get("daemon")
        config["daemon"] = False
        try:
            yield
        finally:
            config["daemon"] = before


def _begin(item: Limits, reading: ReadLimits, scratch: str) -> None:
    """Set the process up as a command sets up the one that it works in (`aqualog.cli.apart`)."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
    os.environ["TMPDIR"] = tempfile.tempdir = scratch
    if reading.memory:
        bound_memory(reading.memory)
    begin_worker(item, reading)
