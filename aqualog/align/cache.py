"""Keep the aligned signals of drives between runs, under a key of all that they depend on.

FOLDER/signals/STAMP-KEY-CRC.parquet   a drive; STAMP of aqualog's reading and aligning code, CRC of the file
FOLDER/signals/contents.json           hashes of logs by size and time of change, so that a log is hashed once

The cache never raises an error to the user. It skips what it cannot keep, discards what is damaged and reads it again.
"""

from __future__ import annotations

import json
import os
import re
import stat
import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

from aqualog.align.mapping import SignalMap, map_text, values_read
from aqualog.core.errors import ConfigError
from aqualog.core.records import Signals
from aqualog.core.user_folders import user_cache
from aqualog.core.vehicle import Vehicle
from aqualog.io.atomic_write import write_text, write_whole
from aqualog.io.fingerprint import Contents, Seen, change_since, hash_of, sources_stamp

__all__ = ["Kept", "Key", "SignalCache", "cache_folder", "cache_limit"]

_BEHIND = ("core", "guard", "io", "align")
_LIBRARIES = ("asammdf", "cantools", "mcap", "mcap-protobuf-support", "rosbags", "numpy", "polars")
_ENTRY = re.compile(r"[0-9a-f]{8}-[0-9a-f]{32}-[0-9a-f]{8}\.parquet")
_ORPHAN = re.compile(r"\.[0-9a-z-]{1,40}-\w{8}\.(parquet|json)\.tmp")  # as `write_whole` names them
_CONTENTS = "contents.json"
_MOST_CONTENTS = 5000
_LIMIT_MB = 2000
_SETTLED_S = 2.0  # a file younger than the clock of a file system is coarse may change and look the same
_ABANDONED_S = 3600.0  # a half-written file so old is nobody's


class Key(NamedTuple):
    """The inputs that a drive's signals depend on, and the state of the files whose content was hashed."""

    text: str
    paths: tuple[Path, ...]
    seen: Seen


class Kept(NamedTuple):
    """One drive in the cache. `used`: last request [s since 1970]; `fits`: made by this version of aqualog."""

    path: Path
    size: int
    used: float
    fits: bool

    @property
    def files(self) -> tuple[str, ...]:
        """Return the names of the drive's files; empty if they cannot be read."""
        from aqualog.align.signals_file import files_of

        try:
            return files_of(self.path)
        except ValueError:
            return ()


class SignalCache:
    """A folder of signals. It is created with the first entry, for the user alone.

    `limit` [bytes] is the largest size of all drives together; the entry with the oldest request is removed first.
    `tell` is called with the reason why something was not kept.
    """

    def __init__(self, folder: Path, *, limit: int, tell: Callable[[str], None] = lambda _: None) -> None:
        self.folder = folder / "signals"
        self.limit = limit
        self._tell = tell

    def key(
        self, paths: Sequence[Path], vehicle: Vehicle, signal_map: SignalMap, dbc: Sequence[Path], rate_hz: float | None
    ) -> Key | None:
        """Return the key of a drive; None where a file cannot be read, which the readers report in more detail.

        Of the vehicle only the values that alignment uses count, of paths only the names: a copied log is found, too.
        """
        contents = Contents(self._known())
        try:
            files = [f"{p.name}:{contents.of(p)}" for p in (*paths, *dbc)]
        except OSError:
            return None
        settings = (map_text(signal_map), repr(values_read(vehicle)), repr(rate_hz))
        text = hash_of([_stamp(), str(len(paths)), *files, *settings])
        if contents.has_changed:
            self._keep_known(contents)
        return Key(text, (*paths, *dbc), contents.seen((*paths, *dbc)))

    def get(self, key: Key) -> Signals | None:
        """Return the signals of a drive; None if the cache has no intact entry."""
        from aqualog.align.signals_file import from_parquet

        for entry in self.kept():
            if not entry.path.name.startswith(f"{_stamp()}-{key.text}-"):
                continue
            try:
                data = entry.path.read_bytes()
                if _check(data) != entry.path.stem[-8:]:
                    raise ValueError("damaged")
                found = from_parquet(data)
            except ValueError:
                with suppress(OSError):
                    entry.path.unlink()
            except OSError:
                continue
            else:
                with suppress(OSError):  # a folder that is only read
                    os.utime(entry.path)
                return found
        return None

    def put(self, key: Key, signals: Signals) -> None:
        """Keep the signals of a drive, unless its files have changed since the key was made."""
        from aqualog.align.signals_file import to_parquet

        folders = {f"{p}{os.sep}" for path in key.paths for p in (path, path.parent)} - {f".{os.sep}"}
        # a note that names the place of a file would be wrong for a copy of it
        if change_since(key.paths, key.seen) or any(f in note for f in folders for note in signals.quality.notes):
            return
        buffer = to_parquet(signals)
        data = buffer.getbuffer()
        if data.nbytes > self.limit:
            self._tell(f"the signals ({data.nbytes / 1e6:.0f} MB) are larger than the cache may be; they are not kept")
            return
        try:
            self._make()
            path = self.folder / f"{_stamp()}-{key.text}-{_check(data)}.parquet"
            write_whole(path, lambda temporary: temporary.write_bytes(buffer.getbuffer()))
            self._shrink()
        except OSError as error:
            self._tell_unwritable(error)

    def kept(self) -> list[Kept]:
        """List all drives, the one with the oldest request first."""
        stamp = _stamp()
        found = []
        for path, state in self._files(_ENTRY):
            found.append(Kept(path, state.st_size, state.st_mtime, path.name.startswith(stamp)))
        return sorted(found, key=lambda k: (k.used, k.path.name))

    def clean(self) -> tuple[int, int]:
        """Remove all drives and hashes, nothing else; return number and bytes of the drives.

        Raises
        ------
        OSError
        """
        entries = self.kept()
        for path in (*(e.path for e in entries), *(p for p, _ in self._files(_ORPHAN)), self.folder / _CONTENTS):
            path.unlink(missing_ok=True)
        with suppress(OSError):  # another's file in it, or a process that is at work
            self.folder.rmdir()
        return len(entries), sum(e.size for e in entries)

    def _files(self, pattern: re.Pattern[str]) -> Iterator[tuple[Path, os.stat_result]]:
        try:
            names = [n for n in os.listdir(self.folder) if pattern.fullmatch(n)]  # noqa: PTH208 - half the time
        except OSError:
            return
        for name in names:
            with suppress(OSError):  # another process has just thrown it away
                state = (self.folder / name).lstat()
                if stat.S_ISREG(state.st_mode):  # a pipe or a link to a device would be read without end
                    yield self.folder / name, state

    def _make(self) -> None:
        self.folder.parent.mkdir(parents=True, exist_ok=True)
        self.folder.mkdir(mode=0o700, exist_ok=True)

    def _shrink(self) -> None:
        entries = self.kept()
        total = sum(e.size for e in entries)
        for entry in entries:
            if total <= self.limit:
                break
            with suppress(OSError):  # another process has it open, or has removed it
                entry.path.unlink()
            total -= entry.size
        for path, state in self._files(_ORPHAN):
            if time.time() - state.st_mtime > _ABANDONED_S:
                with suppress(OSError):
                    path.unlink()

    def _known(self) -> Any:
        try:
            path = self.folder / _CONTENTS
            return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None
        except (OSError, ValueError, RecursionError):
            return None

    def _keep_known(self, contents: Contents) -> None:
        # of two processes at once one may lose an entry, which costs it a hash the next time
        latest = time.time_ns() - int(_SETTLED_S * 1e9)
        settled = [(name, entry) for name, entry in contents.known.items() if int(entry[1]) < latest]
        try:
            self._make()
            write_text(self.folder / _CONTENTS, json.dumps(dict(settled[-_MOST_CONTENTS:]), indent=0) + "\n")
        except OSError as error:
            self._tell_unwritable(error)

    def _tell_unwritable(self, error: OSError) -> None:
        self._tell(f"the cache {self.folder} cannot be written ({error.strerror or error}); nothing is kept")
        self._tell = lambda _: None  # once


def cache_folder() -> Path:
    """Return the folder of the cache: $AQUALOG_CACHE, else the user's cache folder.

    Raises
    ------
    RuntimeError
        If the user has no home folder.
    """
    given = os.environ.get("AQUALOG_CACHE")
    return Path(given).expanduser() if given else user_cache()


def cache_limit() -> int:
    """Return the largest size of the cache [bytes]: $AQUALOG_CACHE_MB, else 2 GB.

    Raises
    ------
    ConfigError
    """
    text = os.environ.get("AQUALOG_CACHE_MB") or str(_LIMIT_MB)
    if not re.fullmatch(r"\d{1,9}", text):
        raise ConfigError(f"AQUALOG_CACHE_MB is {text!r}", expected="a whole number of megabytes")
    return int(text) * 1_000_000


@cache
def _stamp() -> str:
    """Return a stamp of the code that makes signals of logs, and of the libraries that it reads them with."""
    libraries = list(_LIBRARIES)
    for i, library in enumerate(_LIBRARIES):
        with suppress(PackageNotFoundError):
            libraries[i] = f"{library} {version(library)}"
    return hash_of([sources_stamp(_BEHIND), *libraries])[:8]


def _check(data: bytes | memoryview) -> str:
    """Return a check sum: Parquet has none over numbers, so a flipped bit would pass for a measured value."""
    return f"{zlib.crc32(data):08x}"
