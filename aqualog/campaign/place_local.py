"""A store in a folder of this machine, or of a disk that machines share."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from aqualog.campaign.place import is_orphan
from aqualog.core.errors import ConfigError
from aqualog.io.whole import only_here, write_whole

__all__ = ["Folder"]


class Folder:
    """A `Place` that is a folder. Files are renamed into place; locks are the system's, which frees them."""

    is_shared = True

    def __init__(self, folder: Path) -> None:
        self.address = folder
        self.name = str(folder)

    def at(self, name: str) -> str:
        """Address of a file for messages."""
        return str(self.address / name)

    def check(self, folders: Iterable[str], files: Iterable[str]) -> bool:
        """Whether it exists.

        Raises
        ------
        ConfigError
            If it, or one of the parts, is of the wrong kind.
        """
        if not self.address.exists():
            if self.address.is_symlink():
                raise ConfigError("is a broken link", where=self.name, expected="a folder for the results")
            return False
        if not self.address.is_dir():
            raise ConfigError("is a file", where=self.name, expected="a folder for the results")
        for name in folders:
            path = self.address / name
            if os.path.lexists(path) and not path.is_dir():
                raise ConfigError("is not a folder", where=str(path), expected="the store's folder", hint="remove it")
        for name in files:
            path = self.address / name
            if path.exists() and not path.is_file():
                what = "is a folder" if path.is_dir() else "is a device or a pipe"
                raise ConfigError(what, where=str(path), expected="the store's file", hint="remove it")
        return True

    def make(self, folders: Iterable[str]) -> None:
        """Make it, and folders in it."""
        self.address.mkdir(parents=True, exist_ok=True)
        for name in folders:
            (self.address / name).mkdir(exist_ok=True)

    def held(self, lock: str, *, together: bool = False) -> AbstractContextManager[None]:
        """Hold a lock file."""
        return only_here(self.address / lock, together=together)

    def names(self, folder: str = "") -> set[str]:
        """Names in a folder."""
        try:
            with os.scandir(self.address / folder) as entries:
                return {e.name for e in entries}
        except FileNotFoundError:
            return set()

    def has(self, name: str) -> bool:
        """Whether there is such a file."""
        return (self.address / name).is_file()

    def read(self, name: str) -> bytes:
        """A file's content."""
        return (self.address / name).read_bytes()

    def write(self, name: str, data: bytes | memoryview) -> None:
        """Write a complete file. Folders are created at the start only: a missing folder means a missing disk."""
        write_whole(self.address / name, lambda temporary: _put(temporary, data), makes_folder=False)

    def remove(self, name: str) -> None:
        """Remove a file."""
        (self.address / name).unlink(missing_ok=True)

    def sweep(self, folders: Iterable[str]) -> None:
        """Remove half-written files; only with the lock held, because another process may be writing them."""
        for folder in folders:
            for orphan in (self.address / folder).glob(".*.tmp"):
                if is_orphan(orphan.name):
                    orphan.unlink(missing_ok=True)

    def copy(self, name: str) -> Path:
        """The file itself."""
        return self.address / name

    def footer(self, name: str) -> Path:
        """The file itself."""
        return self.address / name

    def look_at(self, names: Sequence[str]) -> None:
        """No preparation needed."""

    def expect(self, names: Sequence[str]) -> None:
        """No preparation needed."""

    def holds(self, path: Path) -> bool:
        """Whether a path is inside it."""
        return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(self.address))


def _put(path: Path, data: bytes | memoryview) -> None:
    path.write_bytes(data)
