"""Location of a store: the few operations that it needs, in a folder; `place_remote` has them behind a URL."""

from __future__ import annotations

import io
import os
import re
import secrets
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from aqualog.core.errors import ConfigError
from aqualog.io.atomic_write import only_here, write_whole

__all__ = ["Address", "Folder", "Place", "address_of", "is_of_process", "is_orphan", "is_url", "temporary_name"]

Address = Path | str
"""A folder, or a URL that fsspec supports."""

_URL = re.compile(r"([a-z][a-z0-9+.\-]+)://(.*)", re.IGNORECASE | re.DOTALL)
_FILE = re.compile(r"(?:file|local):(?://(?:localhost(?=/))?)?(.*)", re.IGNORECASE | re.DOTALL)
_CHAIN = re.compile(r"[a-z][a-z0-9+.\-]+(://.*)?::.*://", re.IGNORECASE | re.DOTALL)
_ORPHAN = re.compile(r"\..{1,40}-\w{8}\.(parquet|json)\.tmp", re.DOTALL)


class Place(ABC):
    """Files by their names below the store, `runs.parquet`, `samples/KEY.parquet`.

    `address` opens the same place in another process, `name` is for messages, without secrets; `is_shared` if other
    processes can see it. Every operation that fails raises an OSError with number, reason and file.
    """

    address: Address
    name: str
    is_shared = True

    def at(self, name: str) -> str:
        """Address of a file for messages."""
        return f"{self.name.rstrip('/')}/{name}"

    @abstractmethod
    def check(self, folders: Iterable[str], files: Iterable[str]) -> bool:
        """Whether it exists; ConfigError if it, or one of these parts, is of the wrong kind."""

    @abstractmethod
    def make(self, folders: Iterable[str]) -> None:
        """Create it and folders in it where they are missing."""

    def held(self, lock: str, *, together: bool = False) -> AbstractContextManager[None]:
        """Keep others out by a lock file, as `aqualog.io.atomic_write.only_here`, where locks exist."""
        return nullcontext()

    @abstractmethod
    def names(self, folder: str = "") -> set[str]:
        """Names in a folder; empty if there is no such folder."""

    @abstractmethod
    def has(self, name: str) -> bool:
        """Whether there is such a file."""

    @abstractmethod
    def read(self, name: str) -> bytes:
        """A file's content."""

    @abstractmethod
    def write(self, name: str, data: bytes | memoryview) -> None:
        """Write a file, complete or not at all."""

    @abstractmethod
    def remove(self, name: str) -> None:
        """Remove a file if it exists."""

    @abstractmethod
    def sweep(self, folders: Iterable[str]) -> None:
        """Remove half-written files of killed processes."""

    @abstractmethod
    def copy(self, name: str) -> Path:
        """A local file to read: the file itself or a copy."""

    def footer(self, name: str) -> Path | io.BytesIO:
        """A source with a Parquet file's metadata and schema, and possibly its data."""
        return self.copy(name)

    def look_at(self, names: Sequence[str]) -> None:  # noqa: B027 - a folder needs no preparation
        """Announce that the footers of these are needed next."""

    def expect(self, names: Sequence[str]) -> None:  # noqa: B027 - as above
        """Announce that copies of these are needed, probably in this order."""

    def holds(self, path: Path) -> bool:
        """Whether a path of this machine is inside it."""
        return False


class Folder(Place):
    """A `Place` that is a folder. Files are renamed into place; locks are the system's, which frees them."""

    address: Path

    def __init__(self, folder: Path) -> None:
        self.address = folder
        self.name = str(folder)

    def at(self, name: str) -> str:
        return str(self.address / name)

    def check(self, folders: Iterable[str], files: Iterable[str]) -> bool:
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
        self.address.mkdir(parents=True, exist_ok=True)
        for name in folders:
            (self.address / name).mkdir(exist_ok=True)

    def held(self, lock: str, *, together: bool = False) -> AbstractContextManager[None]:
        return only_here(self.address / lock, together=together)

    def names(self, folder: str = "") -> set[str]:
        try:
            with os.scandir(self.address / folder) as entries:
                return {e.name for e in entries}
        except FileNotFoundError:
            return set()

    def has(self, name: str) -> bool:
        return (self.address / name).is_file()

    def read(self, name: str) -> bytes:
        return (self.address / name).read_bytes()

    def write(self, name: str, data: bytes | memoryview) -> None:
        """Write a complete file. Folders are created at the start only: a missing folder means a missing disk."""
        write_whole(self.address / name, lambda temporary: _put(temporary, data), makes_folder=False)

    def remove(self, name: str) -> None:
        (self.address / name).unlink(missing_ok=True)

    def sweep(self, folders: Iterable[str]) -> None:
        """Remove half-written files; only with the lock held, because another process may be writing them."""
        for folder in folders:
            for orphan in (self.address / folder).glob(".*.tmp"):
                if is_orphan(orphan.name):
                    orphan.unlink(missing_ok=True)

    def copy(self, name: str) -> Path:
        return self.address / name

    def holds(self, path: Path) -> bool:
        return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(self.address))


def _put(path: Path, data: bytes | memoryview) -> None:
    path.write_bytes(data)


def address_of(text: Address) -> Address:
    """The place of a store as typed; `file://` is a folder.

    Raises
    ------
    ConfigError
        If it is empty, a chain of file systems, or a file of another machine.
    """
    if isinstance(text, Path):
        return text
    if not text:  # it would mean the current folder
        raise ConfigError(
            "the name of the store is empty", expected="a folder or a URL", hint="check the shell's variables"
        )
    if _CHAIN.match(text):
        raise ConfigError(
            "is a chain of file systems", where=text.split("::")[0], expected="one, as s3://bucket/store",
            hint="without the cache before it, which would hide files written by others",
        )  # fmt: skip
    if file := _FILE.fullmatch(text):
        if not file[1].startswith("/"):  # the text is a host; the libraries would read it as a local folder
            raise ConfigError("names no folder of this machine", where=text, expected="the folder, or file:///folder")
        return Path(file[1])
    return text if _URL.fullmatch(text) else Path(text)


def is_url(text: str) -> bool:
    """Whether a text is the address of a place behind a URL."""
    return bool(_URL.fullmatch(text))


def is_of_process(address: Address) -> bool:
    """Whether a place is in the memory of this process."""
    return str(address).lower().startswith("memory:")


def temporary_name(name: str) -> str:
    """A temporary name next to a file, which `is_orphan` recognises."""
    path = Path(name)
    return path.with_name(f".{path.stem[:40]}-{secrets.token_hex(4)}{path.suffix}.tmp").as_posix()


def is_orphan(name: str) -> bool:
    """Whether a file has such a temporary name, as `aqualog.io.atomic_write.write_whole` also gives."""
    return _ORPHAN.fullmatch(name) is not None
