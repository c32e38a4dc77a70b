"""A store behind a URL of fsspec: an object store, or a file system on another machine."""

from __future__ import annotations

import errno
import io
import re
import struct
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from aqualog.campaign.place import Place, is_orphan, temporary_name
from aqualog.core.errors import AqualogError, ConfigError

__all__ = ["Remote"]

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

    There are no locks: parallel writers write the same complete bytes under the same names.

    Parameters
    ----------
    url : str

    Raises
    ------
    ConfigError
        If a package for it is missing, or fsspec does not know it.
    AqualogError
        If it cannot be reached.
    """

    address: str

    def __init__(self, url: str) -> None:
        self.address = url
        self.name = _shown(url)
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
        self._folder: tempfile.TemporaryDirectory[str] | None = None

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
            temporary = self._path(temporary_name(name))
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
                    if datetime.now(UTC) - _aware(self._fs.modified(path)) > _OLD:
                        self._fs.rm_file(path)

    def copy(self, name: str) -> Path:
        """A copy of a file, which goes with this object; those that come next are fetched with it."""
        if name not in self._copies:
            if self._folder is None:
                self._folder = tempfile.TemporaryDirectory(prefix="aqualog-store-")
            first = self._order.get(name)
            among = [name] if first is None else self._expected[first : first + _AHEAD]
            wanted = [n for n in among if n not in self._copies]
            for n, data in zip(wanted, self._together(wanted, None), strict=True):
                if isinstance(data, bytes):
                    path = Path(self._folder.name, f"{len(self._copies)}{Path(n).suffix}")
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
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None

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
        secret = urlsplit(self.address).password
        text = text.replace(self.address, self.name)
        return (text.replace(secret, "***") if secret else text)[:300]


def _shown(url: str) -> str:
    """A URL without user and password."""
    return re.sub(r"://[^/]*@", "://***@", url)


def _aware(time: datetime) -> datetime:
    return time if time.tzinfo else time.replace(tzinfo=UTC)
