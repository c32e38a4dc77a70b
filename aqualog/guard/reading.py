"""Track the work of this process: the log that it reads, and files that it has not finished.

A watching process sees this, so that it knows which log to blame and what to remove. Reading has limits while it is
watched; a program that uses the library by itself has none.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from aqualog.core.errors import AqualogError, LogError
from aqualog.guard.limits import VARIABLES, ReadLimits, size_of
from aqualog.guard.system import bounded, memory_bound

__all__ = ["ReadingState", "reading", "unfinished", "watch_reading"]


class ReadingState(NamedTuple):
    """The log that is being read (if any), the limit of this step in seconds (0: no limit), the size of the log, the
    number of the step, and files or folders to be removed if the process ends now.
    """  # fmt: skip

    log: str = ""
    seconds: float = 0.0
    size: int = 0
    step: int = 0
    temporary: tuple[str, ...] = ()


class _Watch(NamedTuple):
    report: Callable[[ReadingState], None]
    limits: ReadLimits
    refused: Mapping[str, str]


_watch: _Watch | None = None
_state = ReadingState()


def watch_reading(
    report: Callable[[ReadingState], None], limits: ReadLimits, refused: Mapping[str, str] | None = None
) -> None:
    """Report each change of the state from now on.

    Parameters
    ----------
    report : callable
        Called at every change, here and at once; it must be quick.
    limits : ReadLimits
        Processor time and file size are limited here; the wall-clock time is the watcher's business.
    refused : mapping, optional
        Logs, by absolute path, that are not to be opened, and why.
    """
    global _watch
    _watch = _Watch(report, limits, refused or {})


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """One step of reading a log, watched and within limits.

    Raises
    ------
    LogError
        If the log is refused, or wants more than it may have.
    AqualogError
        For a fault that no reader foresees, which is then that log's.
    """
    watch = _watch
    if watch is None or _state.log:
        yield
        return
    why = watch.refused.get(os.path.abspath(path))  # noqa: PTH100 - links are not followed
    if why is not None:
        raise LogError(why, where=str(path)) from ChildProcessError(why)  # another time it may be well
    size = size_of(path)
    _change(watch, log=str(path), seconds=watch.limits.wall_for(size), size=size, step=_state.step + 1)
    try:
        with bounded(watch.limits.cpu_for(size), watch.limits.file_for(size)):
            yield
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # the panic of a compiled library is no Exception
        cause = error.__cause__ if isinstance(error, AqualogError) else error
        if excess := _excess(cause, watch.limits, size):
            raise LogError(excess[0], where=str(path), hint=excess[1]) from cause
        if isinstance(error, AqualogError | OSError | MemoryError):
            raise
        what = f"its reader failed ({type(error).__name__}: {str(error)[:200]})"
        raise AqualogError(what, where=str(path), hint="--debug, and report it") from error
    finally:
        _change(watch, log="", seconds=0.0, size=0, step=_state.step + 1)


@contextmanager
def unfinished(path: Path) -> Iterator[None]:
    """A file or folder that is to be removed if this process ends within the block."""
    name = str(path.absolute())
    if _watch is None:
        yield
        return
    _change(_watch, temporary=(*_state.temporary, name))
    try:
        yield
    finally:
        _change(_watch, temporary=tuple(t for t in _state.temporary if t != name))


def _change(watch: _Watch, **values: Any) -> None:
    global _state
    _state = _state._replace(**values)
    watch.report(_state)


def _excess(error: BaseException | None, limits: ReadLimits, size: int) -> tuple[str, str] | None:
    """Return the limit that the error names, and how to raise it; None for other errors."""
    if isinstance(error, MemoryError):
        most = memory_bound()
        than = f"the {most // 1_000_000} MB that it may have" if most else "there is"
        return f"reading it takes more memory than {than}", f"a higher {VARIABLES['memory']} (--limit-mb of a batch)"
    if isinstance(error, OSError) and error.errno == errno.EFBIG and (most := limits.file_for(size)):
        return f"reading it writes a file of more than {most // 1_000_000} MB", f"a higher {VARIABLES['file']}"
    return None
