"""Location of a store: the few operations that it needs, on a folder or behind a URL of fsspec."""

from __future__ import annotations

import io
import re
import secrets
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol

from aqualog.core.errors import ConfigError

__all__ = ["Address", "Place", "address_of", "is_of_process", "is_orphan", "is_url", "place_of", "temporary_name"]

Address = Path | str
"""A folder, or a URL that fsspec supports."""

_URL = re.compile(r"([a-z][a-z0-9+.\-]+)://(.*)", re.IGNORECASE | re.DOTALL)
_FILE = re.compile(r"(?:file|local):(?://(?:localhost(?=/))?)?(.*)", re.IGNORECASE | re.DOTALL)
_CHAIN = re.compile(r"[a-z][a-z0-9+.\-]+(://.*)?::.*://", re.IGNORECASE | re.DOTALL)
_ORPHAN = re.compile(r"\..{1,40}-\w{8}\.(parquet|json)\.tmp", re.DOTALL)


class Place(Protocol):
    """Files by their names below the store, `runs.parquet`, `samples/KEY.parquet`.

    Every operation that fails raises an OSError with number, reason and file.
    """

    @property
    def address(self) -> Address:
        """Address from which another process opens the same place."""

    @property
    def name(self) -> str:
        """Address for messages, without secrets."""

    @property
    def is_shared(self) -> bool:
        """Whether other processes can see it."""

    def at(self, name: str) -> str:
        """Address of a file for messages."""

    def check(self, folders: Iterable[str], files: Iterable[str]) -> bool:
        """Whether it exists; ConfigError if it, or one of these parts, is of the wrong kind."""

    def make(self, folders: Iterable[str]) -> None:
        """Create it and folders in it where they are missing."""

    def held(self, lock: str, *, together: bool = False) -> AbstractContextManager[None]:
        """Keep others out by a lock file, as `aqualog.io.whole.only_here`, where locks exist."""

    def names(self, folder: str = "") -> set[str]:
        """Names in a folder; empty if there is no such folder."""

    def has(self, name: str) -> bool:
        """Whether there is such a file."""

    def read(self, name: str) -> bytes:
        """A file's content."""

    def write(self, name: str, data: bytes | memoryview) -> None:
        """Write a file, complete or not at all."""

    def remove(self, name: str) -> None:
        """Remove a file if it exists."""

    def sweep(self, folders: Iterable[str]) -> None:
        """Remove half-written files of killed processes."""

    def copy(self, name: str) -> Path:
        """A local file to read: the file itself or a copy."""

    def footer(self, name: str) -> Path | io.BytesIO:
        """A source with a Parquet file's metadata and schema, and possibly its data."""

    def look_at(self, names: Sequence[str]) -> None:
        """Announce that the footers of these are needed next."""

    def expect(self, names: Sequence[str]) -> None:
        """Announce that copies of these are needed, probably in this order."""

    def holds(self, path: Path) -> bool:
        """Whether a path of this machine is inside it."""


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


def place_of(address: Address) -> Place:
    """The place behind an address.

    Raises
    ------
    ConfigError
        If a package for it is missing, or fsspec does not know it.
    AqualogError
        If it cannot be reached.
    """
    address = address_of(address)
    if isinstance(address, Path):
        from aqualog.campaign.place_local import Folder

        return Folder(address)
    from aqualog.campaign.place_remote import Remote

    return Remote(address)


def temporary_name(name: str) -> str:
    """A temporary name next to a file, which `is_orphan` recognises."""
    path = Path(name)
    return path.with_name(f".{path.stem[:40]}-{secrets.token_hex(4)}{path.suffix}.tmp").as_posix()


def is_orphan(name: str) -> bool:
    """Whether a file has such a temporary name, as `aqualog.io.whole.write_whole` also gives."""
    return _ORPHAN.fullmatch(name) is not None
