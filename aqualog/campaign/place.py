"""Location of a store: the few operations that it needs, in a folder, or behind a URL of fsspec."""

from __future__ import annotations

import errno
import io
import os
import re
import secrets
import struct
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from aqualog.core.errors import AqualogError, ConfigError
from aqualog.io.atomic_write import only_here, write_whole

__all__ = ["Address", "Place", "Remote", "address_of", "is_of_process", "is_orphan", "is_url", "place_of"]

Address = Path | str
"""A folder, or a URL that fsspec supports."""

_URL = re.compile(r"([a-z][a-z0-9+.\-]+)://(.*)", re.IGNORECASE | re.DOTALL)
_FILE = re.compile(r"(?:file|local):(?://(?:localhost(?=/))?)?(.*)", re.IGNORECASE | re.DOTALL)
_CHAIN = re.compile(r"[a-z][a-z0-9+.\-]+(://.*)?::.*://", re.IGNORECASE | re.DOTALL)
_ORPHAN = re.compile(r"\..{1,40}-\w{8}\.(parquet|json)\.tmp", re.DOTALL)


class Place:
    """Files by their names below a folder, `runs.parquet`, `samples/KEY.parquet`; `Remote` has the same behind a URL.

    `address` opens the same place in another process, `name` is for messages, without secrets; `is_shared` if other
    processes can see it. Every operation that fails raises an OSError with number, reason and file. Files are renamed
    into place; locks are the system's, which frees them.
    """

    address: Address
    is_shared = True

    def __init__(self, folder: Path) -> None:
        self.address = self._folder = folder
        self.name = str(folder)

    def at(self, name: str) -> str:
        """Address of a file for messages."""
        return str(self._folder / name)

    def check(self, folders: Iterable[str], files: Iterable[str]) -> bool:
        """Whether it exists; ConfigError if it, or one of these parts, is of the wrong kind."""
        if not self._folder.exists():
            if self._folder.is_symlink():
                raise ConfigError("is a broken link", where=self.name, expected="a folder for the results")
            return False
        if not self._folder.is_dir():
            raise ConfigError("is a file", where=self.name, expected="a folder for the results")
        for path in (self._folder / name for name in folders):
            if os.path.lexists(path) and not path.is_dir():
                raise ConfigError("is not a folder", where=str(path), expected="the store's folder", hint="remove it")
        for path in (self._folder / name for name in files):
            if path.exists() and not path.is_file():
                what = "is a folder" if path.is_dir() else "is a device or a pipe"
                raise ConfigError(what, where=str(path), expected="the store's file", hint="remove it")
        return True

    def make(self, folders: Iterable[str]) -> None:
        """Create it and folders in it where they are missing."""
        self._folder.mkdir(parents=True, exist_ok=True)
        for name in folders:
            (self._folder / name).mkdir(exist_ok=True)

    def held(self, lock: str, *, together: bool = False) -> AbstractContextManager[None]:
        """Keep others out by a lock file, as `aqualog.io.atomic_write.only_here`, where locks exist."""
        return only_here(self._folder / lock, together=together)

    def names(self, folder: str = "") -> set[str]:
        """Names in a folder; empty if there is no such folder."""
        try:
            with os.scandir(self._folder / folder) as entries:
                return {e.name for e in entries}
        except FileNotFoundError:
            return set()

    def has(self, name: str) -> bool:
        """Whether there is such a file."""
        return (self._folder / name).is_file()

    def read(self, name: str) -> bytes:
        """A file's content."""
        return (self._folder / name).read_bytes()

    def write(self, name: str, data: bytes | memoryview) -> None:
        """Write a file, complete or not at all. A missing folder means a missing disk: `make` creates folders."""
        write_whole(self._folder / name, lambda temporary: temporary.write_bytes(data), makes_folder=False)

    def remove(self, name: str) -> None:
        """Remove a file if it exists."""
        (self._folder / name).unlink(missing_ok=True)

    def sweep(self, folders: Iterable[str]) -> None:
        """Remove half-written files of killed processes; only with the lock held, as others may be writing them."""
        for folder in folders:
            for orphan in (self._folder / folder).glob(".*.tmp"):
                if is_orphan(orphan.name):
                    orphan.unlink(missing_ok=True)

    def copy(self, name: str) -> Path:
        """A local file to read: the file itself or a copy."""
        return self._folder / name

    def footer(self, name: str) -> Path | io.BytesIO:
        """A source with a Parquet file's metadata and schema, and possibly its data."""
        return self._folder / name

    def look_at(self, names: Sequence[str]) -> None:
        """Announce that the footers of these are needed next."""

    def expect(self, names: Sequence[str]) -> None:
        """Announce that copies of these are needed, probably in this order."""

    def holds(self, path: Path) -> bool:
        """Whether a path of this machine is inside it."""
        return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(self._folder))


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
    return Place(address) if isinstance(address, Path) else Remote(address)


def is_url(text: str) -> bool:
    """Whether a text is the address of a place behind a URL."""
    return bool(_URL.fullmatch(text))


def is_of_process(address: Address) -> bool:
    """Whether a place is in the memory of this process."""
    return str(address).lower().startswith("memory:")


def is_orphan(name: str) -> bool:
    """Whether a file has such a temporary name, as `aqualog.io.atomic_write.write_whole` also gives."""
    return _ORPHAN.fullmatch(name) is not None


# here a put is complete or absent; elsewhere a file gets a temporary name first
_OBJECTS = frozenset(
    ["s3", "s3a", "gs", "gcs", "az", "abfs", "abfss", "oci", "oss", "tos", "r2", "memory"]
)  # fmt: skip
_TAIL = 32_768  # [byte] in which nearly every footer lies
_FOOTERS = 256  # that are read together
_AHEAD = 8  # copies that are fetched together: the round trip takes longer than the bytes
_OLD = timedelta(days=1)  # age of a half-written file that nobody can still be writing
_MAGIC = b"PAR1"


class Remote(Place):
    """A `Place` behind a URL. Options, as an endpoint or keys, come from the environment and fsspec's own files.

    There are no locks: parallel writers write the same complete bytes under the same names. Errors as of `place_of`.
    """

    def __init__(self, url: str) -> None:
        self.address = self._url = url
        self.name = re.sub(r"://[^/]*@", "://***@", url)  # without user and password
        self._fs, root = self._opened(url)
        self._root = root.rstrip("/")
        if not self._root.strip("/"):
            raise ConfigError("names no place", where=self.name, expected="one for the results, s3://bucket/store")
        protocols = {self._fs.protocol} if isinstance(self._fs.protocol, str) else set(self._fs.protocol)
        self._is_objects = bool(protocols & _OBJECTS)
        self.is_shared = "memory" not in protocols
        self._footers: dict[str, bytes] = {}
        self._order: dict[str, int] = {}
        self._expected: Sequence[str] = ()
        self._copies: dict[str, Path] = {}
        self._temporary: tempfile.TemporaryDirectory[str] | None = None

    def at(self, name: str) -> str:
        return f"{self.name.rstrip('/')}/{name}"

    def check(self, folders: Iterable[str], files: Iterable[str]) -> bool:
        with self._told(""):
            self._fs.invalidate_cache()
            try:
                kind = self._fs.info(self._root)["type"]
            except FileNotFoundError:
                return False
        if kind == "file":
            raise ConfigError("is a file", where=self.name, expected="a place for the results")
        return True

    def make(self, folders: Iterable[str]) -> None:
        """Create folders where the place has folders; a bucket is never created."""
        if not self._is_objects:
            with self._told(""):
                for name in ("", *folders):
                    self._fs.makedirs(self._path(name), exist_ok=True)

    def held(self, lock: str, *, together: bool = False) -> AbstractContextManager[None]:
        return nullcontext()

    def names(self, folder: str = "") -> set[str]:
        with self._told(folder):
            self._fs.invalidate_cache()
            try:
                found = self._fs.ls(self._path(folder), detail=False)
            except FileNotFoundError:
                return set()
        # some list the folder itself among what is in it
        paths = (p.strip("/") for p in found)
        return {p.rsplit("/", 1)[-1] for p in paths if p != self._path(folder).strip("/")}

    def has(self, name: str) -> bool:
        with self._told(name):
            self._fs.invalidate_cache()
            try:
                return bool(self._fs.info(self._path(name))["type"] == "file")
            except FileNotFoundError:
                return False

    def read(self, name: str) -> bytes:
        with self._told(name):
            return bytes(self._fs.cat_file(self._path(name)))

    def write(self, name: str, data: bytes | memoryview) -> None:
        self._footers.pop(name, None)
        with self._told(name):
            if self._is_objects:
                self._fs.pipe_file(self._path(name), bytes(data))
                return
            path = Path(name)  # beside it, a temporary name that `is_orphan` recognises
            hidden = path.with_name(f".{path.stem[:40]}-{secrets.token_hex(4)}{path.suffix}.tmp")
            temporary = self._path(hidden.as_posix())
            try:
                self._fs.pipe_file(temporary, bytes(data))
                self._fs.mv(temporary, self._path(name))
            except BaseException:
                with suppress(Exception):  # the user should see the first error
                    self._fs.rm_file(temporary)
                raise

    def remove(self, name: str) -> None:
        self._footers.pop(name, None)
        try:
            with self._told(name):
                self._fs.rm_file(self._path(name))
        except OSError:
            if self.has(name):  # some signal a missing file by another error than FileNotFoundError
                raise

    def sweep(self, folders: Iterable[str]) -> None:
        """Remove half-written files older than a day; younger ones may still be written."""
        if self._is_objects:
            return
        for folder in folders:
            for name in filter(is_orphan, self.names(folder)):
                path = self._path(f"{folder}/{name}" if folder else name)
                with suppress(Exception):  # no time on some file systems, or removed by another process
                    changed = self._fs.modified(path)
                    if datetime.now(UTC) - (changed if changed.tzinfo else changed.replace(tzinfo=UTC)) > _OLD:
                        self._fs.rm_file(path)

    def copy(self, name: str) -> Path:
        """A copy of a file, which goes with this object; those that come next are fetched with it."""
        if name not in self._copies:
            if self._temporary is None:
                self._temporary = tempfile.TemporaryDirectory(prefix="aqualog-store-")
            first = self._order.get(name)
            among = [name] if first is None else self._expected[first : first + _AHEAD]
            wanted = [n for n in among if n not in self._copies]
            for n, data in zip(wanted, self._together(wanted, None), strict=True):
                if isinstance(data, bytes):
                    path = Path(self._temporary.name, f"{len(self._copies)}{Path(n).suffix}")
                    path.write_bytes(data)
                    self._copies[n] = path
                elif n == name:
                    with self._told(name):
                        raise data
        return self._copies[name]

    def footer(self, name: str) -> io.BytesIO:
        """A Parquet file without its data; the whole content of any other file."""
        if name not in self._footers:
            self._look_at([name])
        return io.BytesIO(self._footers[name] if name in self._footers else self.read(name))

    def look_at(self, names: Sequence[str]) -> None:
        """Read footers, many at a time where that can be done; whatever was read before is forgotten."""
        self._footers = {}
        for i in range(0, len(names), _FOOTERS):
            self._look_at(names[i : i + _FOOTERS])

    def _look_at(self, names: Sequence[str]) -> None:
        for name, tail in zip(names, self._together(names, _TAIL), strict=True):
            if not isinstance(tail, bytes) or len(tail) < 12 or tail[-4:] != _MAGIC:
                continue  # `footer` reads it whole, which then shows the error
            size = struct.unpack("<I", tail[-8:-4])[0] + 8
            if size > len(tail):
                longer = self._together([name], size)[0]
                tail = longer if isinstance(longer, bytes) else b""
            if size <= len(tail):
                self._footers[name] = _MAGIC + tail[-size:]

    def expect(self, names: Sequence[str]) -> None:
        """Announce copies needed next; earlier announcements are forgotten."""
        self._expected = list(dict.fromkeys(names))
        self._order = {n: i for i, n in enumerate(self._expected)}
        self._copies = {}
        if self._temporary is not None:
            self._temporary.cleanup()
            self._temporary = None

    def holds(self, path: Path) -> bool:
        return False

    def _path(self, name: str) -> str:
        return f"{self._root}/{name}" if name else self._root

    def _together(self, names: Sequence[str], tail: int | None) -> list[Any]:
        """Contents of files, or their last bytes; an exception in the place of one that cannot be read."""
        if not names:
            return []
        with self._told(""):
            found: list[Any] = self._fs.cat_ranges(
                [self._path(n) for n in names], None if tail is None else -tail, None, on_error="return"
            )
        return found

    def _opened(self, url: str) -> tuple[Any, str]:
        try:
            from fsspec.core import url_to_fs
        except ImportError as error:
            raise ConfigError(
                "a store behind a URL needs fsspec", where=self.name, hint="pip install 'aqualog[remote]'"
            ) from error
        try:
            found: tuple[Any, str] = url_to_fs(url)
        except ImportError as error:
            raise ConfigError(
                f"needs a package that is not installed ({error})", where=self.name,
                hint="pip install it, on every machine that works on the logs",
            ) from error  # fmt: skip
        except ValueError as error:
            raise ConfigError(
                f"is not a place that fsspec supports ({self._clean(str(error))})", where=self.name,
                expected="a folder, or a URL as s3://bucket/store or sftp://host/store",
            ) from error  # fmt: skip
        except Exception as error:
            reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
            raise AqualogError(
                f"cannot be reached ({self._clean(reason)})", where=self.name,
                hint="the address, the network, and the credentials in the environment",
            ) from error  # fmt: skip
        return found

    @contextmanager
    def _told(self, name: str) -> Iterator[None]:
        """Whatever a library raises becomes an OSError with number, reason and file."""
        where = self.at(name) if name else self.name
        try:
            yield
        except FileNotFoundError as error:
            reason = error.strerror or "there is no such file or bucket"
            raise FileNotFoundError(errno.ENOENT, self._clean(reason), where) from error
        except PermissionError as error:
            reason = error.strerror or str(error) or "permission denied"
            raise PermissionError(errno.EACCES, self._clean(reason), where) from error
        except OSError as error:
            raise OSError(error.errno or errno.EIO, self._clean(error.strerror or str(error)), where) from error
        except NotImplementedError as error:
            raise OSError(errno.EROFS, "fsspec can only read there", where) from error
        except Exception as error:
            raise OSError(errno.EIO, self._clean(f"{type(error).__name__}: {error}"), where) from error

    def _clean(self, text: str) -> str:
        secret = urlsplit(self._url).password
        text = text.replace(self._url, self.name)
        return (text.replace(secret, "***") if secret else text)[:300]
