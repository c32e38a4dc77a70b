"""A folder for temporary files of a process and its libraries, so that none outlives it, even one that is killed."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

__all__ = ["Scratch", "use_folder"]

_PREFIX = "aqualog-run-"
_TRIES = 5


class Scratch:
    """Folders in `base` (default: the system's for temporary files), one at a time.

    The system holds a lock on a folder for as long as this process lives, whatever ends it. A folder without a lock has
    no owner, and the next process that makes one removes it.
    """

    def __init__(self, base: str | None = None) -> None:
        self._base = Path(base or os.environ.get("TMPDIR") or "/tmp").absolute()
        self._folder: Path | None = None
        self._lock = -1
        with suppress(OSError):
            _sweep(self._base)

    def make(self) -> str:
        """Make a folder and return its path; "" where that cannot be done."""
        for _ in range(_TRIES):
            folder = self._base / f"{_PREFIX}{os.getpid()}-{os.urandom(4).hex()}"
            try:
                folder.mkdir(mode=0o700)
            except OSError:
                return ""
            lock = _locked(folder, exclusive=False)
            if folder.is_dir():
                self._folder, self._lock = folder, lock
                return str(folder)
            _close(lock)  # another process has taken it for left behind, before it was locked
        return ""

    def remove(self) -> None:
        """Remove the folder with all files in it."""
        if self._folder is not None:
            _remove(self._folder)
            _close(self._lock)
            self._folder, self._lock = None, -1


def use_folder(folder: str) -> None:
    """Let this process, and those that it starts, make temporary files there; "" changes nothing."""
    if folder:
        import tempfile

        os.environ["TMPDIR"] = folder
        tempfile.tempdir = None  # it may remember the one before


def _sweep(base: Path) -> None:
    """Remove what killed processes of this user have left."""
    with os.scandir(base) as entries:
        left = [Path(e.path) for e in entries if e.name.startswith(_PREFIX)]
    for folder in left:
        with suppress(OSError):
            lock = _locked(folder, exclusive=True) if folder.lstat().st_uid == os.getuid() else -1
            if lock >= 0:
                _remove(folder)
                _close(lock)


def _locked(folder: Path, *, exclusive: bool) -> int:
    """A handle that holds a lock on the folder, -1 where no lock is available."""
    try:
        import fcntl

        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except (ImportError, OSError):
        return -1
    try:
        fcntl.flock(handle, (fcntl.LOCK_EX if exclusive else fcntl.LOCK_SH) | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        return -1
    return handle


def _close(lock: int) -> None:
    if lock >= 0:
        os.close(lock)


def _remove(folder: Path) -> None:
    try:
        folder.rmdir()
    except OSError:
        import shutil

        shutil.rmtree(folder, ignore_errors=True)
