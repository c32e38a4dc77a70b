"""Limits for reading one log: time, memory, disk space; their defaults, and the variables that change them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from aqualog.core.errors import ConfigError
from aqualog.guard.system import machine_memory

__all__ = ["LEAST_MB", "VARIABLES", "ReadLimits", "limits_from", "size_of"]

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
