"""Hash the content of files, and check whether they still hold it."""

from __future__ import annotations

import errno
import hashlib
import os
import stat
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

__all__ = ["Contents", "Remembered", "Seen", "change_since", "changed_files", "hash_of", "sources_stamp", "state_of"]

Seen = tuple[tuple[str, int, int], ...]
"""Files with size and time of change."""

_PIECE = 1 << 20
_LENGTH = 32  # hexadecimal digits of a key: 128 bit


class Contents:
    """Hashes of files, remembered as long as size and time of change stay; `known` maps path -> [size, mtime, hash]."""

    def __init__(self, known: Any = None) -> None:
        # it comes from a file: what is not as it should be is not known
        entries = known.items() if isinstance(known, dict) else ()
        self.known: dict[str, list[int | str]] = {
            k: v for k, v in entries if isinstance(v, list) and [type(x) for x in v] == [int, int, str]
        }
        self.has_changed = False

    def of(self, path: Path) -> str:
        """Hash of a file, or of the files in a folder (a ROS 2 bag).

        Raises
        ------
        OSError
            If it cannot be read, also for a device or a pipe, which has no end or no content of its own.
        """
        if path.is_dir():
            return hash_of(f"{p.relative_to(path)}:{self.of(p)}" for p in _files(path))
        state, name = path.stat(), os.path.realpath(path)
        entry = self.known.get(name)
        if entry and entry[:2] == [state.st_size, state.st_mtime_ns]:
            return str(entry[2])
        return self._unknown(path, name, state)

    def _unknown(self, path: Path, name: str, state: os.stat_result) -> str:
        if not stat.S_ISREG(state.st_mode):
            raise OSError(errno.EINVAL, "is a device or a pipe; expected a log", str(path))
        digest = _digest(path, state.st_size)
        self.known[name] = [state.st_size, state.st_mtime_ns, digest]
        self.has_changed = True
        return digest

    def seen(self, paths: Iterable[Path]) -> Seen:
        """The files behind `paths`, in the state in which they were hashed."""
        files = [f for p in paths for f in _files(p)]
        entries = (self.known.get(os.path.realpath(f), [-1, -1]) for f in files)
        return tuple((str(f), int(e[0]), int(e[1])) for f, e in zip(files, entries, strict=True))


class Remembered(Contents):
    """Known hashes, without reading any file: an unknown one gets a value that no file's hash has."""

    def _unknown(self, path: Path, name: str, state: os.stat_result) -> str:
        return f"not known: {name}"


def change_since(paths: Sequence[Path], seen: Seen) -> str:
    """Say what has happened to files since they were hashed; empty if their content still fits the key."""
    try:
        states = [(str(f), f.stat()) for p in paths for f in _files(p)]
    except OSError as error:
        return f"{error.filename}: {error.strerror} while it was read"
    now = tuple((name, state.st_size, state.st_mtime_ns) for name, state in states)
    if now == seen:
        return ""
    name = min(set(now) ^ set(seen), default=(", ".join(map(str, paths)),))[0]
    return f"{name}: changed while it was read. Try: run the batch again"


def state_of(paths: Iterable[Path]) -> Seen:
    """Return the state of the files behind `paths` without reading them; other paths have no state."""
    found = []
    for file in (f for p in paths for f in _files(p)):
        try:
            state = file.stat()
        except OSError:
            continue
        if stat.S_ISREG(state.st_mode):
            found.append((str(file), state.st_size, state.st_mtime_ns))
    return tuple(found)


def changed_files(paths: Iterable[Path], before: Seen) -> tuple[str, ...]:
    """Return the files that differ from what `state_of` found before: written to, replaced or gone.

    New files in a folder do not count: results may lie there, and a recording that begins another part has written to
    one of the known files.
    """
    return tuple(sorted(name for name, _, _ in set(before) - set(state_of(paths))))


@cache
def sources_stamp(names: tuple[str, ...]) -> str:
    """Hash of aqualog's own modules and folders of these names: it changes with the code."""
    package = Path(__file__).resolve().parents[1]
    assert all((package / n).exists() for n in names), names  # a folder of another name would leave results stale
    paths = [p for n in names for p in ([package / n] if n.endswith(".py") else (package / n).rglob("*.py"))]
    return hash_of(f"{p.relative_to(package)}:{hashlib.sha256(p.read_bytes()).hexdigest()}" for p in sorted(paths))


def hash_of(parts: Iterable[str]) -> str:
    """One key of many texts; 32 hexadecimal digits."""
    return hashlib.sha256("\n".join(parts).encode(errors="surrogateescape")).hexdigest()[:_LENGTH]


def _digest(path: Path, size: int) -> str:
    """Hash of the first `size` bytes: a file that grows faster than it is read would have no end."""
    digest = hashlib.sha256()
    left = size
    with path.open("rb", buffering=0) as file:
        while left > 0 and (piece := file.read(min(left, _PIECE))):
            digest.update(piece)
            left -= len(piece)
    return digest.hexdigest()


def _files(path: Path) -> list[Path]:
    return [p for p in sorted(path.rglob("*")) if p.is_file()] if path.is_dir() else [path]
