"""A folder for temporary files of a command and its libraries, so that none outlives it, even one that is killed."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

__all__ = ["Scratch"]

_PREFIX = "aqualog-run-"
_TRIES = 5


class Scratch:
    """Folders in the system's for temporary files, one at a time.

    The system holds a lock on a folder for as long as the command lives, whatever ends it: one without a lock is
    nobody's, and the next command removes it.
    """

    def __init__(self) -> None:
        self._base = Path(os.environ.get("TMPDIR") or "/tmp").absolute()
        self._folder: Path | None = None
        self._lock = -1
        with suppress(OSError):
            _sweep(self._base)

    def make(self) -> None:
        """Make one, if that can be done, and let TMPDIR name it."""
        for _ in range(_TRIES):
            folder = self._base / f"{_PREFIX}{os.getpid()}-{os.urandom(4).hex()}"
            try:
                folder.mkdir(mode=0o700)
            except OSError:
                return
            lock = _locked(folder, exclusive=False)
            if folder.is_dir():
                break
            _let_go(lock)  # another command has taken it for left behind, before it was locked
        else:
            return
        self._folder, self._lock = folder, lock
        os.environ["TMPDIR"] = str(folder)
        import tempfile

        tempfile.tempdir = None  # it may remember the one before

    def remove(self) -> None:
        """Remove it with what is in it."""
        if self._folder is None:
            return
        _remove(self._folder)
        _let_go(self._lock)
        self._folder, self._lock = None, -1


def _sweep(base: Path) -> None:
    """Remove what killed commands of this user have left."""
    with os.scandir(base) as entries:
        left = [Path(e.path) for e in entries if e.name.startswith(_PREFIX)]
    for folder in left:
        with suppress(OSError):
            if folder.lstat().st_uid != os.getuid():
                continue
            lock = _locked(folder, exclusive=True)
            if lock >= 0:
                _remove(folder)
                _let_go(lock)


def _locked(folder: Path, *, exclusive: bool) -> int:
    """A handle that holds a lock on the folder, -1 where no lock is available."""
    import fcntl

    try:
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        return -1
    try:
        fcntl.flock(handle, (fcntl.LOCK_EX if exclusive else fcntl.LOCK_SH) | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        return -1
    return handle


def _let_go(lock: int) -> None:
    if lock >= 0:
        os.close(lock)


def _remove(folder: Path) -> None:
    try:
        folder.rmdir()
    except OSError:
        import shutil

        shutil.rmtree(folder, ignore_errors=True)
