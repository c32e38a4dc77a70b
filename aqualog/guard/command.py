"""A command in a process of its own, watched by the one that was called.

Logs are read by native libraries. One that crashes, never comes back, or takes memory without end ends the process
that works, not the one that watches. That one names the log and starts the work again, which then finds that this log
cannot be read and goes on as it does with any such log. The process is forked when a command begins to work, before
anything heavy is imported: `--help` costs nothing and a command a few milliseconds.
"""

from __future__ import annotations

import math
import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, NoReturn

if TYPE_CHECKING:
    from aqualog.guard.reading import ReadingState, ReadLimits, StatePage
    from aqualog.guard.streams import ForeignStderr

__all__ = ["begin_command", "is_command", "supervised", "unsupervised"]

_TICK_S = 0.25
_SOON_S = 0.005  # a library that writes much waits until there is room for it
_GRACE_S = 1.2  # after an interrupt, for a reader to come back to Python
_MOST_REFUSED = 20  # each costs another beginning
_SWITCH = "AQUALOG_LIMITS"
_FAILED, _INTERRUPTED = 1, 130
_TWICE_S = 0.5  # signals within are one request: a shell and a terminal may both send one
_DEAD_S = 5.0  # a process that a dead disk holds cannot be killed, and is not waited for
_ENDING = ("SIGINT", "SIGTERM", "SIGHUP")

_is_command = _is_awaited = False


def begin_command() -> None:
    """This process was started for one command, whose work is `supervised`."""
    global _is_command, _is_awaited
    _is_command = _is_awaited = True


def unsupervised() -> None:
    """Let the command work in this process: it reads no log."""
    global _is_awaited
    _is_awaited = False


def is_command() -> bool:
    """Whether this process was started for one command, and ends with it."""
    return _is_command


@contextmanager
def supervised(*, debug: bool) -> Iterator[None]:
    """Work within the block in a process of its own; the process that was called never leaves it.

    Without `begin_command`, where the system has no means, or with AQUALOG_LIMITS=off, the work is done here.

    Raises
    ------
    ConfigError
        If a limit is not a number.
    """
    global _is_awaited
    is_awaited, _is_awaited = _is_awaited, False
    from threading import active_count

    has_means = all(hasattr(os, n) for n in ("fork", "wait4")) and hasattr(signal, "sigtimedwait")
    is_off = os.environ.get(_SWITCH, "").strip().lower() == "off"
    if not (is_awaited and has_means) or is_off or active_count() > 1:
        yield
        return
    from aqualog.guard.reading import limits_from

    page = _in_worker(limits_from(os.environ), debug=debug)
    try:
        yield
    finally:
        page.finish()


class _End(NamedTuple):
    """How a worker has ended: exit code, or minus the signal; what it was reading; seconds if it was too slow."""

    code: int
    state: ReadingState
    seconds: float = 0.0
    is_interrupted: bool = False


def _in_worker(limits: ReadLimits, *, debug: bool) -> StatePage:
    """Returns in the worker only."""
    from aqualog.guard.reading import StatePage
    from aqualog.guard.scratch import Scratch, use_folder
    from aqualog.guard.streams import ForeignStderr

    page, scratch = StatePage(), Scratch()
    refused: dict[str, str] = {}
    waited = {getattr(signal, n) for n in _ENDING}
    waited = {s for s in waited if signal.getsignal(s) is not signal.SIG_IGN} | {signal.SIGCHLD}
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    while True:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        page.clear()
        use_folder(scratch.make())
        foreign = None if debug else ForeignStderr()
        me = os.getpid()
        before = signal.pthread_sigmask(signal.SIG_BLOCK, waited)
        worker = os.fork()
        if worker == 0:
            _begin(me, limits, page, refused, foreign)
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
            return page
        if foreign is not None:
            foreign.watch()
        end = _watch(worker, page, waited, foreign)
        if foreign is not None:
            foreign.end()
        scratch.remove()
        _clear_away(end.state)
        if end.is_interrupted:
            has_said_so = end.code == _INTERRUPTED or page.is_finished
            _leave(_INTERRUPTED, "" if has_said_so else "interrupted")
        if page.is_finished or not end.state.log:
            _leave(*_last_word(end, is_finished=page.is_finished))
        why = _why(end, limits)
        path = os.path.abspath(end.state.log)  # noqa: PTH100 - links are not followed
        if path in refused or len(refused) == _MOST_REFUSED:
            _leave(_FAILED, f"error: {end.state.log}: {why}, as {len(refused)} logs before; no more are tried")
        refused[path] = why


def _begin(
    parent: int, limits: ReadLimits, page: StatePage, refused: dict[str, str], foreign: ForeignStderr | None
) -> None:
    """Set the worker up; without `foreign` everything that libraries write passes at once."""
    from aqualog.guard.reading import watch_reading
    from aqualog.guard.system import bound_memory, forbid_core

    _die_with(parent)
    forbid_core()
    if most := limits.memory_here():
        bound_memory(most)
    if foreign is None:
        import faulthandler

        faulthandler.enable()
    else:
        os.environ["RUST_BACKTRACE"] = "0"
        foreign.begin()
    watch_reading(page.write, limits, refused)


def _die_with(parent: int) -> None:
    """End when the parent does, even when it is killed and this process hangs in a library."""
    if sys.platform != "linux":
        return
    import ctypes

    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(1, signal.SIGKILL, 0, 0, 0)  # PR_SET_PDEATHSIG
    if os.getppid() != parent:
        os._exit(_FAILED)


def _watch(worker: int, page: StatePage, waited: set[signal.Signals], foreign: ForeignStderr | None) -> _End:
    """Wait for the worker, pass signals on, end one that hangs."""
    interrupts, asked = 0, -math.inf
    step, spent, too_long = -1, 0.0, 0.0
    killed = math.inf
    then = time.monotonic()
    heard = -math.inf
    while True:
        came = signal.sigtimedwait(waited, _SOON_S if then - heard < _TICK_S else _TICK_S)
        now = time.monotonic()
        # a tick that lasted long was a machine asleep, or a job that was stopped
        tick, then = min(now - then, 4.0 * _TICK_S), now
        done, status, _ = os.wait4(worker, os.WNOHANG)
        if foreign is not None and foreign.pass_on():
            heard = now
        state = page.read()
        if done or now - killed > _DEAD_S:
            code = os.waitstatus_to_exitcode(status) if done else -signal.SIGKILL
            is_whole = page.is_finished and code >= 0
            return _End(code, state, too_long, code == _INTERRUPTED or bool(interrupts and not is_whole))
        if came is not None and came.si_signo != signal.SIGCHLD:
            if now - asked > _TWICE_S:
                interrupts, asked = interrupts + 1, now
            if came.si_code <= 0:  # sent by a process; a terminal's reaches the worker by itself
                os.kill(worker, came.si_signo)
        spent = spent + tick if state.step == step else 0.0
        step = state.step
        if state.log and 0.0 < state.seconds < spent:
            too_long = state.seconds
        # a batch finishes the logs that it has in work; a library that does not come back is not waited for
        is_deaf = interrupts > 0 and now - asked > _GRACE_S and (bool(state.log) or interrupts > 1)
        if (is_deaf or too_long) and killed == math.inf and not page.is_finished:
            killed = now
            os.kill(worker, signal.SIGKILL)


def _why(end: _End, limits: ReadLimits) -> str:
    """Why a log cannot be read, in one line."""
    size = end.state.size
    if end.seconds:
        return f"reading it took longer than {end.seconds:g} s. Try: a higher AQUALOG_LIMIT_S"
    if end.code == -signal.SIGXCPU:
        most = limits.cpu_for(size)
        return f"reading it took more than {most:g} s of processor time. Try: a higher AQUALOG_LIMIT_CPU_S"
    if end.code == -signal.SIGXFSZ:
        most = limits.file_for(size) // 1_000_000
        return f"reading it writes a file of more than {most} MB. Try: a higher AQUALOG_LIMIT_FILE_MB"
    return f"reading it ended the process ({_how(end.code, limits)})"


def _how(code: int, limits: ReadLimits) -> str:
    if code >= 0:
        return f"exit code {code}: a reading library gave up"
    name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
    if code == -signal.SIGKILL:
        return f"{name}: by the system, when memory is short, or by hand"
    if code == -signal.SIGABRT and (most := limits.memory_here()):
        return f"{name}: more memory than the {most // 1_000_000} MB of AQUALOG_LIMIT_MB, or a fault of a library"
    return f"{name}: a fault of a library that reads it"


def _last_word(end: _End, *, is_finished: bool) -> tuple[int, str]:
    """Exit code and message for a worker that no log has ended."""
    if is_finished and end.code >= 0:
        return end.code, ""
    how = f"exit code {end.code}" if end.code >= 0 else signal.Signals(-end.code).name
    when = "after its work" if is_finished else "while it read no log"
    return _FAILED, f"error: aqualog's process ended by itself, {when} ({how}). Try: --debug, and report it"


def _leave(code: int, text: str) -> NoReturn:
    """End here: what the interpreter does at its end, the worker has done."""
    if text:
        with suppress(OSError, ValueError):
            if sys.stderr.isatty() and os.environ.get("TERM") != "dumb":
                sys.stderr.write("\r\x1b[K")  # a line of progress that stayed
            sys.stderr.write("".join(c if c.isprintable() else "\ufffd" for c in text) + "\n")
            sys.stderr.flush()
    os._exit(code)


def _clear_away(state: ReadingState) -> None:
    import shutil

    for name in state.temporary:
        path = Path(name)
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            with suppress(OSError):
                path.unlink(missing_ok=True)
