"""Track the work of this process: the log that it reads, and files that it has not finished.

A watching process learns this, so that it knows what to blame and what to remove. Reading has limits while it is
watched; a program that uses the library by itself has none.
"""

from __future__ import annotations

import errno
import math
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from aqualog.core.errors import AqualogError, LogError
from aqualog.io.limits import VARIABLES, ReadLimits, size_of

__all__ = ["InHand", "bound_memory", "bounded", "memory_bound", "reading", "unfinished", "watched_by"]


class InHand(NamedTuple):
    """State of the reading: the log (if any), the limit of this step in seconds (0: no limit), the size of the log, and
    which step it is. Also files or folders to be removed if the process ends now.
    """  # fmt: skip

    log: str = ""
    seconds: float = 0.0
    size: int = 0
    step: int = 0
    temporary: tuple[str, ...] = ()


class _Watch(NamedTuple):
    tell: Callable[[InHand], None]
    limits: ReadLimits
    refused: Mapping[str, str]


_watch: _Watch | None = None
_held = InHand()


def watched_by(
    tell: Callable[[InHand], None], limits: ReadLimits, refused: Mapping[str, str] | None = None
) -> None:  # fmt: skip
    """Report each change of the work in hand from now on.

    Parameters
    ----------
    tell : callable
        Called at every change, here and at once; it must be quick.
    limits : ReadLimits
        Processor time and file size are limited here; the wall-clock time is the watcher's business.
    refused : mapping, optional
        Logs, by absolute path, that are not to be opened, and why.
    """
    global _watch
    _watch = _Watch(tell, limits, refused or {})


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
    if watch is None or _held.log:
        yield
        return
    why = watch.refused.get(os.path.abspath(path))  # noqa: PTH100 - links are not followed
    if why is not None:
        raise LogError(why, where=str(path)) from ChildProcessError(why)  # another time it may be well
    size = size_of(path)
    _tell(watch, log=str(path), seconds=watch.limits.wall_for(size), size=size)
    try:
        with bounded(watch.limits, size):
            yield
    except AqualogError as error:
        excess = _excess(error.__cause__, watch.limits, size)
        if excess is None:
            raise
        raise LogError(excess[0], where=str(path), hint=excess[1]) from error.__cause__
    except (OSError, MemoryError) as error:
        excess = _excess(error, watch.limits, size)
        if excess is None:
            raise
        raise LogError(excess[0], where=str(path), hint=excess[1]) from error
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # the panic of a compiled library is no Exception
        what = f"its reader failed ({type(error).__name__}: {str(error)[:200]})"
        raise AqualogError(what, where=str(path), hint="--debug, and report it") from error
    finally:
        _tell(watch, log="", seconds=0.0, size=0)


@contextmanager
def unfinished(path: Path) -> Iterator[None]:
    """A file or folder that is to be removed if this process ends within the block."""
    name = str(path.absolute())
    if _watch is None:
        yield
        return
    _tell(_watch, temporary=(*_held.temporary, name))
    try:
        yield
    finally:
        _tell(_watch, temporary=tuple(t for t in _held.temporary if t != name))


def _tell(
    watch: _Watch,
    *,
    log: str | None = None,
    seconds: float = 0.0,
    size: int = 0,
    temporary: tuple[str, ...] | None = None,
) -> None:
    global _held
    if log is not None:
        _held = _held._replace(log=log, seconds=seconds, size=size, step=_held.step + 1)
    if temporary is not None:
        _held = _held._replace(temporary=temporary)
    watch.tell(_held)


def _excess(error: BaseException | None, limits: ReadLimits, size: int) -> tuple[str, str] | None:
    """Return the limit that the error names, and how to raise it; None for other errors."""
    if isinstance(error, MemoryError):
        most = memory_bound()
        told = f" than the {most // 1_000_000} MB that it may have" if most else " than there is"
        return f"reading it takes more memory{told}", f"a higher {VARIABLES['memory']} (--limit-mb of a batch)"
    if isinstance(error, OSError) and error.errno == errno.EFBIG and limits.file_for(size):
        most = limits.file_for(size) // 1_000_000
        return f"reading it writes a file of more than {most} MB", f"a higher {VARIABLES['file']}"
    return None


@contextmanager
def bounded(limits: ReadLimits, size: int) -> Iterator[None]:
    """Within the block: so much more processor time, and no longer files."""
    try:
        import resource
    except ImportError:  # no such limits on this system
        yield
        return
    used = resource.getrusage(resource.RUSAGE_SELF)
    seconds, most = limits.cpu_for(size), limits.file_for(size)
    before = []
    if seconds:
        cpu = math.ceil(used.ru_utime + used.ru_stime + seconds)
        before.append((resource.RLIMIT_CPU, _lower(resource.RLIMIT_CPU, cpu)))
    if most:
        before.append((resource.RLIMIT_FSIZE, _lower(resource.RLIMIT_FSIZE, most)))
    try:
        yield
    finally:
        for kind, limit in before:
            resource.setrlimit(kind, limit)


def bound_memory(most: int) -> None:
    """Private memory of this process, in bytes; what is only mapped (files, code) is not counted."""
    try:
        import resource
    except ImportError:
        return
    _lower(resource.RLIMIT_DATA, most)


def memory_bound() -> int:
    """The limit that `bound_memory` has set, in bytes; 0: none."""
    try:
        import resource
    except ImportError:
        return 0
    return max(resource.getrlimit(resource.RLIMIT_DATA)[0], 0)


def _lower(kind: int, most: int) -> tuple[int, int]:
    """Set a limit as far as one that is there already allows; what it was."""
    import resource

    before = resource.getrlimit(kind)
    resource.setrlimit(kind, (min([most, *(b for b in before if b >= 0)]), before[1]))
    return before
