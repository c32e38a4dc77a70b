"""Processes that work on one item at a time, within limits: an item that ends one is known and costs itself only.

Results come as they are done, and nothing is lost by an interrupt or a crash.
"""

from __future__ import annotations

import atexit
import faulthandler
import gc
import multiprocessing
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.util import Finalize
from threading import Lock, Thread, Timer, current_thread, main_thread
from typing import Any, NamedTuple, TypeVar

from aqualog.guard.reading import ReadLimits, limits_from, watch_reading
from aqualog.guard.scratch import Scratch, use_folder
from aqualog.guard.system import bound_memory, forbid_core

__all__ = [
    "NO_LIMITS", "Bounds", "Crashed", "Limits", "Raised", "WorkOn", "Worker", "kept_worker", "most_processes",
    "share_imports", "uninterrupted", "work_on",
]  # fmt: skip


_THREADS = ("POLARS_MAX_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
_starting = Lock()
_context: Any = multiprocessing.get_context("spawn")
_PER_CORE = 4  # more processes than this many a core only take memory
_IDLE_S = 30.0  # a kept worker waits so long for the next task, and then gives its memory back


class Crashed(NamedTuple):
    """The process of an item ended without a message: out of memory, killed, or `seconds` beyond its limit."""

    seconds: float = 0.0


class Limits(NamedTuple):
    """What one item may take: wall-clock `seconds`, and `memory_mb` of a process's own data; None: no limit."""

    seconds: float | None = None
    memory_mb: int | None = None


NO_LIMITS = Limits()


class Bounds(NamedTuple):
    """Limits of the work: for one item, and for one step of reading."""

    item: Limits
    reading: ReadLimits


class Raised(NamedTuple):
    """What an item's work has raised, on its way here."""

    error: BaseException


def share_imports(modules: Sequence[str]) -> None:
    """Let processes from here on be forked from one that imports these modules now, beside what this process does.

    The modules must start no threads, which a fork would lose: not polars. Elsewhere than on Linux, where libraries
    do not survive a fork, each process imports everything by itself.
    """
    global _context
    if sys.platform == "linux":
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload([*modules])
        resource_tracker.ensure_running()  # as in `Worker.start`
        with suppress(OSError), uninterrupted():  # no place for a socket, or one with too long a name
            forkserver.ensure_running()
            _context = context


class Worker:
    """A process that is spawned when it is needed: a fork would copy the threads of polars and numba.

    Without `item.seconds` in `bounds`, a step of reading has the time of `reading`. In `folder` the process gets a
    folder of its own for temporary files, removed with it; default: it shares this one's.
    """

    def __init__(self, bounds: Bounds, folder: str | None = None) -> None:
        self.bounds, self._folder = bounds, folder
        self.is_new = True
        self.pipe: Connection[Any, Any] | None = None
        self._process: multiprocessing.process.BaseProcess | None = None
        self._scratch: Scratch | None = None
        self._began = 0.0

    def start(self) -> None:
        """Start the process."""
        self._scratch = Scratch(self._folder) if self._folder else None
        begin = (self.bounds, self._scratch.make() if self._scratch else "")
        self.is_new = True
        self.pipe, theirs = multiprocessing.Pipe()
        self._process = _context.Process(target=_serve, args=(theirs, *begin))
        if hasattr(signal, "pthread_sigmask"):
            # the first process starts it otherwise, and lets interrupts in that were to wait
            resource_tracker.ensure_running()
        with uninterrupted(), _may_have_children():
            self._process.start()
            theirs.close()  # the process has its own; when that is closed, it has ended

    def give(self, work: Callable[..., Any], task: tuple[Any, ...]) -> None:
        """Let it begin an item."""
        self._began = time.monotonic()
        with suppress(BrokenPipeError, ConnectionResetError):  # it has ended since the last: `take` reports that
            self.pipe.send((work, task))  # type: ignore[union-attr]

    def take(self) -> Any:
        """The item's result, or `Raised`; `Crashed` if the process has ended."""
        try:
            result = self.pipe.recv()  # type: ignore[union-attr]
        except (EOFError, OSError):  # at its end, or in the middle of its message
            return Crashed(time.monotonic() - self._began)
        self.is_new = False
        return result

    def do(self, work: Callable[..., Any], *task: Any) -> Any:
        """The result of an item, or `Crashed` if it has ended a new process; what the work raises is raised."""
        if self.pipe is None:
            self.start()
        was_new = self.is_new
        self.give(work, task)
        result = self.take()
        if isinstance(result, Raised):
            raise result.error
        if not isinstance(result, Crashed):
            return result
        self.end()
        # a process used before may have been ended for what earlier items had left in it
        return result if was_new else self.do(work, *task)

    def let_go(self) -> None:
        """Let the process end when it has done its item."""
        if self.pipe is not None:
            self.pipe.close()

    def end(self) -> None:
        """Wait for its end and remove its files."""
        self.let_go()
        self.pipe = None
        if self._process is not None and self._process.pid is not None:
            self._process.join()
        if self._scratch is not None:
            self._scratch.remove()


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


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let an interrupt wait until the end of the block.

    A process started within inherits that, and is not torn from its imports by one; nor is what it reads from here cut
    off, which the mask alone does not ensure: a thread of a library may take the signal for the main thread.
    """
    if current_thread() is not main_thread():
        yield
        return
    came: list[int] = []
    numbers = [getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)]
    handlers = {n: h for n in numbers if callable(h := signal.getsignal(n))}
    for number in handlers:
        signal.signal(number, lambda number, _: came.append(number))
    can_mask = hasattr(signal, "pthread_sigmask")
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT]) if can_mask else set()
    try:
        yield
    finally:
        if can_mask:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for number in came[:1]:
            signal.raise_signal(number)


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
        reading a log has the time that `aqualog.guard.reading` gives it.

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

    `folder`: for temporary files, in a separate folder that is removed with the process; default: the system's. One
    thread at a time has a process, which is kept for a while: its start takes longer than many a log.
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


# --- in the process ---------------------------------------------------------------------------------------------------


def _serve(pipe: Connection[Any, Any], bounds: Bounds, scratch: str) -> None:
    """Work on what comes through the pipe, until that is closed."""
    _begin(bounds, scratch)
    seconds = bounds.item.seconds
    with open(os.devnull, "w") as nowhere:  # noqa: PTH123 - a file with a number, for the watchdog

        def allow(most: float) -> None:
            """End this process after so many seconds, even in a library that never comes back to Python; 0: never."""
            faulthandler.cancel_dump_traceback_later()
            if most:
                faulthandler.dump_traceback_later(most, exit=True, file=nowhere)

        if seconds is None:
            watch_reading(lambda state: allow(state.seconds), bounds.reading)
        else:  # the item has a watchdog, and there is one only
            watch_reading(lambda _: None, bounds.reading._replace(wall_s=0.0, cpu_s=0.0))
        while True:
            try:
                work, task = pipe.recv()
            except (EOFError, OSError):
                return
            allow(seconds or 0.0)
            try:
                result = work(*task)
            except BaseException as error:
                error.add_note(traceback.format_exc())
                result = Raised(error)
            allow(0.0)
            try:
                pipe.send(result)
            except OSError:  # nobody waits for it any more
                return
            except Exception as error:  # what cannot be sent raises one of many
                pipe.send(Raised(TypeError(f"{type(result).__name__} cannot be sent: {error}")))
            del work, task, result  # nothing of it is held while there is nothing to do


def _begin(bounds: Bounds, scratch: str) -> None:
    """An interrupt is the parent's business; a worker finishes its item, and ends when its parent has."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.set_threshold(200_000, 20)  # modules are no garbage to look for, least of all at the end, which is waited for
    atexit.register(gc.freeze)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    os.environ.update(dict.fromkeys(_THREADS, "1"))  # one a process: these are as many as the cores
    use_folder(scratch)
    forbid_core()
    for most in (bounds.reading.memory, (bounds.item.memory_mb or 0) * 1_000_000):
        if most:
            bound_memory(most)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Without this, workers of a parent that was killed would wait for work for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
