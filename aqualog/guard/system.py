"""What the machine has and what the system allows a process: memory, processor time, length of files."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

try:
    import resource
except ImportError:  # no such limits on this system
    resource = None  # type: ignore[assignment]

__all__ = ["bound_memory", "bounded", "bytes_text", "forbid_core", "free_memory", "machine_memory", "memory_bound"]

_MEMINFO = Path("/proc/meminfo")
_STATUS = Path("/proc/self/status")
_OWN_GROUP = Path("/proc/self/cgroup")
_GROUPS = Path("/sys/fs/cgroup")
_UNKNOWN = 1 << 62


def machine_memory() -> int:
    """Return the memory of this machine, or of the control group of this process [bytes]; 0 if unknown."""
    installed = _installed()
    return 0 if installed is None else min([installed, *_group_limits(_OWN_GROUP, _GROUPS)])


def free_memory() -> int:
    """Return the bytes that this process can still take: within the system, its group and its own limit.

    A huge number where the system does not report it.
    """
    found = _field(_MEMINFO, "MemAvailable:")
    free = [f for f in (_installed() if found is None else found, _group_free(), _limit_left()) if f is not None]
    return max(min(free, default=_UNKNOWN), 0)


def bytes_text(size: int) -> str:
    """A size for a sentence."""
    for unit, factor in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size >= factor:
            return f"{size / factor:.3g} {unit}" if size < 1e15 else f"{size / factor:.0e} {unit}"
    return f"{size} bytes"


def bound_memory(most: int) -> None:
    """Limit private memory of this process, in bytes; what is only mapped (files, code) is not counted."""
    if resource is not None:
        _lower(resource.RLIMIT_DATA, most)


def memory_bound() -> int:
    """The limit that `bound_memory` has set, in bytes; 0: no limit."""
    return 0 if resource is None else max(resource.getrlimit(resource.RLIMIT_DATA)[0], 0)


def forbid_core() -> None:
    """Leave no file of the memory at a crash: it is as large as the memory, and has the log in it."""
    if resource is not None:
        resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))


@contextmanager
def bounded(seconds: float, most: int) -> Iterator[None]:
    """Within the block: `seconds` more of processor time, and no file of more than `most` bytes; 0: no limit."""
    before = []
    if resource is not None and seconds:
        used = resource.getrusage(resource.RUSAGE_SELF)
        cpu = math.ceil(used.ru_utime + used.ru_stime + seconds)
        before.append((resource.RLIMIT_CPU, _lower(resource.RLIMIT_CPU, cpu)))
    if resource is not None and most:
        before.append((resource.RLIMIT_FSIZE, _lower(resource.RLIMIT_FSIZE, most)))
    try:
        yield
    finally:
        for kind, limit in before:
            resource.setrlimit(kind, limit)


def _lower(kind: int, most: int) -> tuple[int, int]:
    """Set a limit of the system as far as one that is there already allows; returns what it was."""
    before = resource.getrlimit(kind)
    resource.setrlimit(kind, (min([most, *(b for b in before if b >= 0)]), before[1]))
    return before


def _installed() -> int | None:
    with suppress(OSError, ValueError, AttributeError):
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return None


def _group_free() -> int | None:
    """What a container leaves."""
    with suppress(OSError, ValueError):
        most = (_GROUPS / "memory.max").read_text(encoding="ascii").strip()
        taken = (_GROUPS / "memory.current").read_text(encoding="ascii").strip()
        lines = (_GROUPS / "memory.stat").read_text(encoding="ascii").splitlines() if most != "max" else []
        cached = sum(int(line.split()[1]) for line in lines if line.startswith("inactive_file "))
        return int(most) - int(taken) + cached if most != "max" else None  # what is cached is given back when needed
    return None


def _limit_left() -> int | None:
    """What limits of the process itself leave of private memory."""
    if resource is None:
        return None
    limits = ((resource.RLIMIT_DATA, "VmData:"), (resource.RLIMIT_AS, "VmSize:"))
    left = [most - (_field(_STATUS, name) or 0) for kind, name in limits if (most := resource.getrlimit(kind)[0]) >= 0]
    return min(left, default=None)


def _field(path: Path, name: str) -> int | None:
    """A line `name: number kB` of a file of the system. [bytes]"""
    with suppress(OSError, ValueError, IndexError):
        for line in path.read_text(encoding="ascii").splitlines():
            if line.startswith(name):
                return int(line.split()[1]) * 1024
    return None


def _group_limits(groups: Path, root: Path) -> list[int]:
    """Limits of the process's group and of those above it, in both versions of control groups."""
    found = []
    for folder, base, name in _group_folders(groups, root):
        for level in (folder, *folder.parents):
            if level.is_relative_to(base):
                with suppress(OSError, ValueError):  # "max", or a folder that a container does not show
                    found.append(int((level / name).read_text(encoding="ascii")))
    return [n for n in found if n > 0]


def _group_folders(groups: Path, root: Path) -> Iterator[tuple[Path, Path, str]]:
    """Folder of a group of this process, the folder above all groups, and the name of the file with the limit."""
    with suppress(OSError, UnicodeDecodeError):
        for line in groups.read_text(encoding="utf-8").splitlines():
            _, controllers, path = line.split(":", 2) if line.count(":") >= 2 else ("", "-", "")
            if controllers == "":
                yield root / path.lstrip("/"), root, "memory.max"
            elif "memory" in controllers.split(","):
                yield root / "memory" / path.lstrip("/"), root / "memory", "memory.limit_in_bytes"
