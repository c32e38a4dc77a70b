"""The folder in which a campaign's results are kept: one file per log, and tables that open by themselves.

STORE/samples/KEY.parquet   samples of one log; what was found stands as JSON under "aqualog" in the file's metadata
STORE/failed/KEY.json       why a log gave nothing; tried again when the log or its configuration changes
STORE/runs.parquet          a row per run        (made anew by every batch)
STORE/events.parquet        a row per event      (as above)
STORE/manifest.json         state of every log   (as above)
STORE/contents.json         hashes of the logs by size and time of change
STORE/lock                  held by the batch that writes here; readers need none
STORE/parts/                hashes and lock of each shard, which writes samples and failures only
"""

from __future__ import annotations

import errno
import io
import json
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import polars as pl

from aqualog.campaign.measure import Measurement
from aqualog.errors import AqualogError, ConfigError, LogError
from aqualog.io.whole import only_here, write_text, write_whole
from aqualog.notation import WHEELS

__all__ = ["MARK", "Store"]

MARK = "aqualog_store.json"
_METADATA_KEY = "aqualog"
_SCHEMA = 1
_LOCK = "lock"
_FOLDERS = ("samples", "failed", "parts")
_CONTENTS = "contents.json"
_FILES = ("runs.parquet", "events.parquet", "manifest.json", "contents.json", MARK, _LOCK)
_ORPHAN = re.compile(r"\..{1,40}-\w{8}\.(parquet|json)\.tmp", re.DOTALL)
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_UNREADABLE = (pl.exceptions.PolarsError, pl.exceptions.PanicException)
# what readers of the store rely on
_COLUMNS = frozenset(
    ["t", "v_x", "a_x", "a_over_v", "delta_a_x", "reason"]
    + [f"{n}_{w}" for n in ("slip", "slip_min", "slip_max", "mu", "spin", "minor") for w in WHEELS]
)
_PARTS: Mapping[str, type] = {
    "start_ns": object, "duration_s": float, "sample_rate_hz": float, "distance_m": object, "v_min": object,
    "v_max": object, "slip_against": str, "traction": str, "signals": list, "events": list, "unavailable": dict,
    "limited": dict, "quality": dict, "notes": list,
}  # fmt: skip


class Store:
    """A store folder.

    Parameters
    ----------
    folder : Path
        Made by `held` if it is not there.
    part : str
        Name of the shard that works here beside others; it makes no tables.
    """

    def __init__(self, folder: Path, part: str = "") -> None:
        self.folder = folder
        self.part = part

    def check(self) -> None:
        """Refuse a folder that is none of a store; one that is not there will do.

        Raises
        ------
        ConfigError
        """
        if not self.folder.exists():
            if self.folder.is_symlink():
                raise ConfigError("is a link to nothing", where=str(self.folder), expected="a folder for the results")
            return
        if not self.folder.is_dir():
            raise ConfigError("is a file", where=str(self.folder), expected="a folder for the results")
        self._check_parts()
        if not (self.folder / MARK).exists():
            if any(p.name != _LOCK and not _is_orphan(p) for p in self.folder.iterdir()):
                raise ConfigError(
                    "holds other files", where=str(self.folder), expected="an empty folder, or one of `aqualog batch`"
                )
            return
        mark = self.read_json(MARK)
        version = mark.get("schema_version") if isinstance(mark, dict) else None
        if version != _SCHEMA:
            raise ConfigError(
                f"is a store of schema_version {version}", where=str(self.folder / MARK),
                expected=f"schema_version {_SCHEMA}", hint="another folder for this version's results",
            )  # fmt: skip

    def _check_parts(self) -> None:
        for name in _FOLDERS:
            path = self.folder / name
            if os.path.lexists(path) and not path.is_dir():
                raise ConfigError("is no folder", where=str(path), expected="the store's folder", hint="remove it")
        for name in _FILES:
            path = self.folder / name
            if path.is_dir():
                raise ConfigError("is a folder", where=str(path), expected="the store's file", hint="remove it")

    @contextmanager
    def held(self, *, must: bool) -> Iterator[bool]:
        """Make the folder ready and keep other batches out; within, whether that could be done.

        Parameters
        ----------
        must : bool
            Whether there is something to write; if not, a store that is only read may be in use or read-only.

        Raises
        ------
        AqualogError
            If it must be held and another batch holds it, or it cannot be written.
        """
        with ExitStack() as stack:
            is_held = False
            try:
                self.folder.mkdir(parents=True, exist_ok=True)
                stack.enter_context(only_here(self.folder / _LOCK, together=bool(self.part)))
                self._make()
                if self.part:
                    stack.enter_context(only_here(self.folder / "parts" / f"{self.part}.lock"))
                is_held = True
            except BlockingIOError as error:
                if must:
                    raise AqualogError(
                        f"is in use by another batch (process {error.strerror})", where=str(self.folder),
                        hint="wait until it is done, or --store DIR",
                    ) from error  # fmt: skip
            except OSError as error:
                if must:
                    raise self._unwritable(error) from error
            yield is_held

    def _make(self) -> None:
        if not (self.folder / MARK).exists():
            write_text(self.folder / MARK, json.dumps({"schema_version": _SCHEMA}) + "\n")
        for name in _FOLDERS:
            (self.folder / name).mkdir(exist_ok=True)
        if not self.part:  # another shard's file may be in the making
            self._sweep()

    @property
    def exists(self) -> bool:
        """Whether this folder is a store."""
        return (self.folder / MARK).is_file()

    def samples_path(self, key: str) -> Path:
        """File of a log's samples."""
        return self.folder / "samples" / f"{key}.parquet"

    def state_of(self, key: str) -> str:
        """`done`, `failed`, or empty where nothing is known."""
        if self.samples_path(key).is_file():
            return "done"
        return "failed" if self._failure_path(key).is_file() else ""

    def keys(self) -> tuple[set[str], set[str]]:
        """Keys of all logs that are done, and of those that failed; one look at each folder."""
        return _stems(self.folder / "samples", ".parquet"), _stems(self.folder / "failed", ".json")

    def put(self, key: str, measurement: Measurement) -> None:
        """Keep the result of a log, whole.

        Raises
        ------
        AqualogError
            If the store cannot be written; this and the methods below that write.
        """
        metadata = {_METADATA_KEY: json.dumps(measurement.about, ensure_ascii=True, separators=(",", ":"))}
        with self._told():
            _write_frame(self.samples_path(key), measurement.samples, metadata=metadata, statistics=False)
            self._failure_path(key).unlink(missing_ok=True)

    def put_failure(self, key: str, reason: str) -> None:
        """Keep why a log gave nothing."""
        with self._told():
            write_text(self._failure_path(key), json.dumps({"reason": reason}) + "\n")

    def failure(self, key: str) -> str:
        """Why a log gave nothing."""
        try:
            return str(json.loads(self._failure_path(key).read_text(encoding="utf-8"))["reason"])
        except (OSError, ValueError, KeyError, TypeError):
            return "failed, and the reason cannot be read"

    def drop(self, key: str) -> None:
        """Remove a log's file, a damaged one."""
        with self._told():
            self.samples_path(key).unlink(missing_ok=True)

    def is_sound(self, key: str) -> bool:
        """Whether a log's file can be read as far as its metadata and columns tell."""
        try:
            self.about(key)
        except LogError:
            return False
        return True

    def about(self, key: str) -> Mapping[str, Any]:
        """What was found in a log.

        Raises
        ------
        LogError
            If its file is damaged.
        """
        path = self.samples_path(key)
        try:
            found: Mapping[str, Any] = json.loads(pl.read_parquet_metadata(path)[_METADATA_KEY])
            is_whole = _is_about(found) and pl.read_parquet_schema(path).keys() >= _COLUMNS
        except (OSError, ValueError, KeyError, *_UNREADABLE) as error:
            raise _damaged(path) from error
        if not is_whole:
            raise _damaged(path)
        return found

    def samples(self, key: str) -> pl.DataFrame:
        """Samples of a log. A file whose data are damaged is removed, so that the next batch makes it again.

        Raises
        ------
        LogError
            If its file is damaged or cannot be read.
        """
        path = self.samples_path(key)
        try:
            frame = pl.read_parquet(path, hive_partitioning=False)
        except OSError as error:
            raise LogError(f"cannot be read ({error.strerror or error})", where=str(path)) from error
        except _UNREADABLE as error:
            with suppress(OSError):  # a store that is only read
                path.unlink()
            raise _damaged(path) from error
        if not set(frame.columns) >= _COLUMNS:
            raise _damaged(path)
        return frame

    def contents(self) -> dict[str, Any]:
        """Hashes that batches and shards have kept."""
        names = [_CONTENTS, *(f"parts/{p.name}" for p in sorted((self.folder / "parts").glob("*.json")))]
        known = [self.read_json(n) for n in names]
        return {path: entry for d in known if isinstance(d, dict) for path, entry in d.items()}

    def keep_contents(self, known: Mapping[str, Any]) -> None:
        """Keep hashes."""
        self.write_json(f"parts/{self.part}.json" if self.part else _CONTENTS, known)

    def read_json(self, name: str) -> Any:
        """A JSON file of the store; None where it is not there or damaged."""
        try:
            return json.loads((self.folder / name).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None

    def write_json(self, name: str, document: Any) -> None:
        """A JSON file of the store, whole."""
        with self._told():
            write_text(self.folder / name, json.dumps(document, indent=1, allow_nan=False) + "\n")

    def write_table(self, name: str, frame: pl.DataFrame) -> None:
        """A table of the store, whole."""
        with self._told():
            _write_frame(self.folder / name, frame)

    def holds(self, path: Path) -> bool:
        """Whether a path lies in this store."""
        return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(self.folder))

    @contextmanager
    def _told(self) -> Iterator[None]:
        """A fault in writing is the store's, not that of the log whose result it is."""
        try:
            yield
        except OSError as error:
            raise self._unwritable(error) from error

    def _unwritable(self, error: OSError) -> AqualogError:
        if error.errno in _NO_ROOM:
            return AqualogError(
                f"{error.strerror}".lower(), where=str(self.folder), expected="room for the results",
                hint="make room, or --store DIR; the same command goes on with the rest",
            )  # fmt: skip
        file = error.filename2 or error.filename or self.folder
        return AqualogError(
            f"cannot be written ({error.strerror or error})", where=str(file), hint="its permissions, or --store DIR"
        )

    def _failure_path(self, key: str) -> Path:
        return self.folder / "failed" / f"{key}.json"

    def _sweep(self) -> None:
        """Remove what a killed process has left half-written."""
        for folder in (self.folder, self.folder / "samples", self.folder / "failed"):
            for orphan in folder.glob(".*.tmp"):
                if _is_orphan(orphan):
                    orphan.unlink(missing_ok=True)


def _is_orphan(path: Path) -> bool:
    # the names that `write_whole` gives
    return _ORPHAN.fullmatch(path.name) is not None


def _write_frame(path: Path, frame: pl.DataFrame, **options: Any) -> None:
    # into memory first: then a disk that is full is an OSError with its number
    buffer = io.BytesIO()
    frame.write_parquet(buffer, compression="zstd", **options)
    write_whole(path, lambda temporary: _put(temporary, buffer))


def _put(path: Path, buffer: io.BytesIO) -> None:
    path.write_bytes(buffer.getbuffer())


def _is_about(found: Any) -> bool:
    if not isinstance(found, dict) or not found.keys() >= _PARTS.keys():
        return False
    if not all(isinstance(found[name], kind) for name, kind in _PARTS.items()):
        return False
    return all(isinstance(e, dict) and "detector" in e and isinstance(e.get("evidence"), dict) for e in found["events"])


def _damaged(path: Path) -> LogError:
    return LogError(
        "is damaged", where=str(path), expected="a file that `aqualog batch` has written",
        hint="the same command once more, which makes it again",
    )  # fmt: skip


def _stems(folder: Path, suffix: str) -> set[str]:
    try:
        with os.scandir(folder) as entries:
            return {e.name.removesuffix(suffix) for e in entries if e.name.endswith(suffix) and e.name[0] != "."}
    except FileNotFoundError:
        return set()
