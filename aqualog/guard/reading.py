"""Reading a log within limits: what they are, and what is reported of the work of this process meanwhile.

A watching process sees the log that is read and the files that are not finished, so that it knows which log to blame
and what to remove. Reading has limits while it is watched; a program that uses the library by itself has none.
"""

from __future__ import annotations

import errno
import json
import math
import mmap
import os
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from aqualog.core.errors import AqualogError, ConfigError, LogError
from aqualog.guard.system import bounded, machine_memory, memory_bound

__all__ = [
    "LEAST_MB", "VARIABLES", "ReadLimits", "ReadingState", "StatePage", "limits_from", "reading", "size_of",
    "unfinished", "watch_reading",
]  # fmt: skip


VARIABLES = {
    "wall": "AQUALOG_LIMIT_S",
    "cpu": "AQUALOG_LIMIT_CPU_S",
    "memory": "AQUALOG_LIMIT_MB",
    "file": "AQUALOG_LIMIT_FILE_MB",
}
_LEAST_S, _S_PER_MB = 300.0, 5.0  # one step of reading; the slowest reader there is does 1 MB in 1 s on a busy core
_MEMORY_SHARE, _LEAST_MEMORY = 0.8, 2_000_000_000  # what is asked for counts, which is more than what is in use
_LEAST_FILE, _FILE_PER_BYTE = 10_000_000_000, 4  # an unfinished MF4 is copied once before it is read
_MB = 1_000_000
LEAST_MB = 300  # of a process: with less its libraries do not even load
_MOST = 1e9  # seconds or megabytes; system calls overflow at ten times that


class ReadLimits(NamedTuple):
    """Limits as they were set; None: the default of the log and the machine, 0: none.

    `wall_s` and `cpu_s` are for one step of reading (opening, listing, decoding, a piece), `memory` and `file` in
    bytes for the process and for any file that it writes meanwhile.
    """

    wall_s: float | None = None
    cpu_s: float | None = None
    memory: int | None = None
    file: int | None = None

    def wall_for(self, size: int) -> float:
        """Longest time of one step with a log of `size` bytes, in seconds; 0: no limit."""
        return _LEAST_S + _S_PER_MB * size / _MB if self.wall_s is None else self.wall_s

    def cpu_for(self, size: int) -> float:
        """The same for the time of all processors together."""
        return _LEAST_S + _S_PER_MB * size / _MB if self.cpu_s is None else self.cpu_s

    def file_for(self, size: int) -> int:
        """Longest file that may be written while a log of `size` bytes is read; 0: no limit."""
        return _LEAST_FILE + _FILE_PER_BYTE * size if self.file is None else self.file

    def memory_here(self) -> int:
        """Most private memory of the process; 0: no limit."""
        if self.memory is not None:
            return self.memory
        there = machine_memory()
        return max(int(_MEMORY_SHARE * there), _LEAST_MEMORY) if there else 0


def limits_from(environment: Mapping[str, str]) -> ReadLimits:
    """Limits as the variables say: seconds and megabytes; 0 lifts one.

    Raises
    ------
    ConfigError
        If one is no number, or less memory than any command needs.
    """
    given = {key: _number(environment, name) for key, name in VARIABLES.items()}
    if 0.0 < (given["memory"] or 0.0) < LEAST_MB:
        name = VARIABLES["memory"]
        raise ConfigError(
            f"is {environment[name].strip()[:40]!r}", where=name, expected=f"{LEAST_MB} or more, or 0 for no limit"
        )
    memory, file = (None if (x := given[key]) is None else math.ceil(x * _MB) for key in ("memory", "file"))
    return ReadLimits(given["wall"], given["cpu"], memory, file)


def _number(environment: Mapping[str, str], name: str) -> float | None:
    text = environment.get(name, "").strip()
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= _MOST:  # NaN too
        unit = "seconds" if name.endswith("_S") else "megabytes"
        most = f"a number of {unit}, at most {_MOST:.0e}, or 0 for no limit"
        raise ConfigError(f"is {text[:40]!r}", where=name, expected=most)
    return value


def size_of(path: Path) -> int:
    """Return the bytes of a log, of a folder those of the files in it; 0 if unknown."""
    try:
        if path.is_dir():
            return sum(p.stat().st_size for p in path.iterdir() if p.is_file())
        return path.stat().st_size
    except OSError:
        return 0


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


_SIZE = 1 << 16
_HEAD = struct.Struct("=?II")  # whether the work is done; length and checksum of the rest


class StatePage:
    """Shared with processes that are forked afterwards. A crash cannot block it, as it can a pipe."""

    def __init__(self) -> None:
        self._page = mmap.mmap(-1, _SIZE)
        self._last = ReadingState()

    def clear(self) -> None:
        """As it was at first."""
        self._page[: _HEAD.size] = bytes(_HEAD.size)
        self._last = ReadingState()

    def write(self, state: ReadingState) -> None:
        """Replace the state; files that do not fit on the page are left out."""
        data = json.dumps(state).encode()  # file names of any bytes: what is no text is escaped
        if len(data) > _SIZE - _HEAD.size:
            data = json.dumps(state._replace(log=state.log[:4096], temporary=())).encode()
        self._page[_HEAD.size : _HEAD.size + len(data)] = data
        self._page[: _HEAD.size] = _HEAD.pack(self.is_finished, len(data), zlib.crc32(data))

    def finish(self) -> None:
        """Note that the work is done."""
        self._page[:1] = b"\1"

    @property
    def is_finished(self) -> bool:
        """Whether the work was done."""
        return self._page[:1] != b"\0"

    def read(self) -> ReadingState:
        """The last whole state; half-written ones, and what a wild process wrote over it, do not count."""
        _, length, checksum = _HEAD.unpack(self._page[: _HEAD.size])
        data = self._page[_HEAD.size : _HEAD.size + length] if length <= _SIZE - _HEAD.size else b""
        if data and zlib.crc32(data) == checksum:
            log, seconds, size, step, temporary = json.loads(data)
            self._last = ReadingState(log, seconds, size, step, tuple(temporary))
        return self._last
