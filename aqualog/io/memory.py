"""Estimate the memory that is free for reading."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

__all__ = ["bytes_text", "free_memory"]

_MEMINFO = Path("/proc/meminfo")
_STATUS = Path("/proc/self/status")
_CGROUP = Path("/sys/fs/cgroup")
_UNKNOWN = 1 << 62


def free_memory() -> int:
    """Return the bytes that this process can still take: within the system, its group and its own limit.

    A huge number where the system does not report it.
    """
    free = [_meminfo(), _group(), _limit()]
    return max(min(f for f in free if f is not None) if any(f is not None for f in free) else _UNKNOWN, 0)


def bytes_text(size: int) -> str:
    """A size for a sentence."""
    for unit, factor in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size >= factor:
            return f"{size / factor:.3g} {unit}" if size < 1e15 else f"{size / factor:.0e} {unit}"
    return f"{size} bytes"


def _meminfo() -> int | None:
    with suppress(OSError, ValueError, IndexError):
        for line in _MEMINFO.read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    with suppress(OSError, ValueError, AttributeError):
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return None


def _group() -> int | None:
    """What a container leaves."""
    with suppress(OSError, ValueError):
        most = (_CGROUP / "memory.max").read_text(encoding="ascii").strip()
        taken = (_CGROUP / "memory.current").read_text(encoding="ascii").strip()
        if most != "max":
            cached = 0
            for line in (_CGROUP / "memory.stat").read_text(encoding="ascii").splitlines():
                if line.startswith("inactive_file "):
                    cached = int(line.split()[1])  # given back when needed
            return int(most) - int(taken) + cached
    return None


def _limit() -> int | None:
    """What limits of the process itself leave of private memory."""
    try:
        import resource
    except ImportError:
        return None
    left = []
    for limit, field in ((resource.RLIMIT_DATA, "VmData:"), (resource.RLIMIT_AS, "VmSize:")):
        most = resource.getrlimit(limit)[0]
        if most >= 0:
            left.append(most - _own(field))
    return min(left, default=None)


def _own(field: str) -> int:
    with suppress(OSError, ValueError, IndexError):
        for line in _STATUS.read_text(encoding="ascii").splitlines():
            if line.startswith(field):
                return int(line.split()[1]) * 1024
    return 0
