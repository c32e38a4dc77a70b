"""Work on many items in processes of their own: results as they come, nothing lost by an interrupt or a crash."""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import signal
import time
import traceback
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
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
        Called here with name and result as each is done; the result is `Crashed` if the process ended, and
        ended once more with the item alone in a new one.
    limits : Limits
        An item that takes longer ends its process; one that wants more memory gets a MemoryError. Without `seconds`,
        reading a log has the time that `aqualog.io.limits` gives it.

    An interrupt lets the items in work finish and records them before it is raised.
    """
    # what has ended a process is tried again when all others are done: the process may have been ended for what earlier
    # items had left in it, or for what others took beside it
    for name in _round(tasks, work, min(jobs, len(tasks), most_processes()), record, limits):
        _round({name: tasks[name]}, work, 1, record, limits)


def most_processes() -> int:
    """Most processes that are made on this machine, whatever is asked for."""
    return _PER_CORE * (os.cpu_count() or 1)


class _Raised(NamedTuple):
    """What an item's work has raised, on its way here."""

    error: BaseException


class _Seat:
    """A process, and the item that it works on: one at a time, so that it is known which one has ended it."""

    def __init__(self, begin: tuple[Limits, ReadLimits]) -> None:
        self.pipe, self._theirs = multiprocessing.Pipe()
        self.is_new = True
        self._process = multiprocessing.get_context("spawn").Process(target=_serve, args=(self._theirs, *begin))
        self._began = 0.0

    def start(self) -> None:
        """Start the process."""
        if hasattr(signal, "pthread_sigmask"):
            # it is started by the first process else, and lets interrupts in that were to wait
            resource_tracker.ensure_running()
        with _no_interrupt():
            self._process.start()
            self._theirs.close()  # the process has its own; when that is closed, it has ended

    def give(self, work: Callable[..., Any], task: tuple[Any, ...]) -> None:
        """Let it begin an item."""
        self._began = time.monotonic()
        with suppress(BrokenPipeError, ConnectionResetError):  # it has ended since the last: `take` says so
            self.pipe.send((work, task))

    def take(self) -> Any:
        """The result of the item, if there is one; `Crashed` if the process has ended."""
        try:
            result = self.pipe.recv()
        except (EOFError, OSError):  # at its end, or in the middle of what it said
            return Crashed(time.monotonic() - self._began)
        self.is_new = False
        return result

    def end(self) -> None:
        """Let the process go; `wait_for_end` waits for it."""
        self.pipe.close()
        self._theirs.close()

    def wait_for_end(self) -> None:
        """Wait until it has gone, if it was there."""
        if self._process.pid is not None:
            self._process.join()


def _serve(pipe: Connection, limits: Limits, read_limits: ReadLimits) -> None:
    """Work on what comes through the pipe, until that is closed."""
    begin_worker(limits, read_limits)
    while True:
        try:
            work, task = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            result = within(limits.seconds, work, *task)
        except BaseException as error:
            error.add_note(traceback.format_exc())
            result = _Raised(error)
        try:
            pipe.send(result)
        except OSError:  # nobody waits for it any more
            return
        except Exception as error:  # what cannot be sent raises one of many
            pipe.send(_Raised(TypeError(f"{type(result).__name__} cannot be sent: {error}")))
        del work, task, result  # nothing of it is held while there is nothing to do


def _round(
    tasks: Mapping[Name, tuple[Any, ...]],
    work: Callable[..., Any],
    jobs: int,
    record: Callable[[Name, Any], None],
    limits: Limits,
) -> list[Name]:
    """Work on all; what was alone in a new process and ended it is recorded as that. Returns others that ended one."""
    begin = (limits, limits_from(os.environ))
    todo = iter(tasks.items())
    in_doubt: list[Name] = []
    seats: list[_Seat] = []
    free: list[_Seat] = []
    busy: dict[Any, tuple[_Seat, Name]] = {}

    def seat_more() -> None:
        seats.append(_Seat(begin))
        seats[-1].start()
        free.append(seats[-1])

    def take(pipe: Any) -> None:
        with _no_interrupt():  # what has come is recorded
            seat, name = busy.pop(pipe)
            is_alone = jobs == 1 and seat.is_new
            result = seat.take()
            if isinstance(result, _Raised):
                raise result.error
            if isinstance(result, Crashed) and not is_alone:
                in_doubt.append(name)
            else:
                record(name, result)
        if isinstance(result, Crashed):
            seat.end()
            seat.wait_for_end()
            seats.remove(seat)
        else:
            free.append(seat)

    try:
        while len(seats) < jobs:  # all, before the first waits for what it is given
            seat_more()
        for name, task in todo:
            if not free and len(busy) < jobs:
                seat_more()
            with _no_interrupt():
                seat = free.pop(0)
                seat.give(work, task)
                busy[seat.pipe] = seat, name
            while not free and len(busy) == jobs:
                for pipe in wait(list(busy)):
                    take(pipe)
        while busy:
            for pipe in wait(list(busy)):
                take(pipe)
    except BaseException:
        while busy:
            for pipe in wait(list(busy)):
                with _no_interrupt():
                    seat, name = busy.pop(pipe)
                    result = seat.take()
                    if not isinstance(result, Crashed | _Raised):
                        record(name, result)
        raise
    finally:
        for seat in seats:
            seat.end()
        for seat in seats:
            seat.wait_for_end()
    return in_doubt


@contextmanager
def _no_interrupt() -> Iterator[None]:
    """Let an interrupt wait until the end of the block.

    A process started within inherits that, and is not torn from its imports by one; nor is what it reads from here cut
    off, which the mask alone does not ensure: a thread of a library may take the signal for the main thread.
    """
    if current_thread() is not main_thread():
        yield
        return
    came: list[int] = []
    asked = [getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)]
    handlers = {n: h for n in asked if callable(h := signal.getsignal(n))}
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
