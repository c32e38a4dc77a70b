"""Storage of a campaign's results, a folder or a URL: a file per log, and tables for other programs.

STORE/samples/KEY.parquet   samples of one log; findings as JSON under "aqualog" in the file's metadata
STORE/full/KEY.parquet      samples of one log at its own rate around its episodes; not there without any
STORE/failed/KEY.json       reason for no result; tried again when the log or its configuration changes
STORE/runs.parquet          a row per run        (made again by every batch)
STORE/events.parquet        a row per event      (as above)
STORE/episodes.parquet      a row per episode    (as above)
STORE/manifest.json         state of every log   (as above)
STORE/contents.json         hashes of the logs by size and time of change
STORE/lock                  held by the batch that writes here; readers do not need it
STORE/parts/                hashes and lock of each shard, which writes samples and failures only
"""

from __future__ import annotations

import errno
import io
import json
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import polars as pl

from aqualog.campaign.measure import Measurement
from aqualog.campaign.place import Address, Place, is_orphan, place_of
from aqualog.core.errors import AqualogError, ConfigError, LogError
from aqualog.core.notation import WHEELS

__all__ = ["MARK", "Store"]

MARK = "aqualog_store.json"
_METADATA_KEY = "aqualog"
_SCHEMA = 1
_LOCK = "lock"
_FOLDERS = ("samples", "full", "failed", "parts")
_CONTENTS = "contents.json"
_FILES = ("runs.parquet", "events.parquet", "episodes.parquet", "manifest.json", "contents.json", MARK, _LOCK)
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_UNREADABLE = (pl.exceptions.PolarsError, pl.exceptions.PanicException)
# names that readers of the store rely on
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
    """A store; `address`, `name`, `is_shared`, `at` and `holds` are those of its `Place`.

    The address is its folder, made by `held` if it is not there, or a URL of fsspec; AqualogError if that is invalid,
    lacks its package, or cannot be reached. `part`: the shard that works here beside others; it makes no tables.
    """

    def __init__(self, address: Address, part: str = "") -> None:
        self._place: Place = place_of(address)
        self.part = part
        self.address, self.name, self.is_shared = self._place.address, self._place.name, self._place.is_shared
        self.at, self.holds = self._place.at, self._place.holds

    def check(self) -> None:
        """Refuse (ConfigError) a folder that is not a store; a missing folder is accepted."""
        with self._reached():
            if not self._place.check(_FOLDERS, _FILES):
                return
            if not self._place.has(MARK):
                if any(n != _LOCK and not is_orphan(n) for n in self._place.names()):
                    raise ConfigError(
                        "holds other files", where=self.name, expected="an empty folder, or one of `aqualog batch`"
                    )
                return
        mark = self.read_json(MARK)
        version = mark.get("schema_version") if isinstance(mark, dict) else None
        if version != _SCHEMA:
            raise ConfigError(
                f"is a store of schema_version {version}", where=self.at(MARK),
                expected=f"schema_version {_SCHEMA}", hint="another folder for this version's results",
            )  # fmt: skip

    @contextmanager
    def held(self, *, must: bool) -> Iterator[bool]:
        """Prepare the folder and keep other batches out; yields whether that was possible.

        Behind a URL there are no locks: two batches would do the same work twice, to the same result. `must`: whether
        there is something to write; then AqualogError if another batch holds it or it cannot be written.
        """
        with ExitStack() as stack:
            is_held = False
            try:
                self._place.make(())
                stack.enter_context(self._place.held(_LOCK, together=bool(self.part)))
                if not self._place.has(MARK):
                    self._place.write(MARK, (json.dumps({"schema_version": _SCHEMA}) + "\n").encode())
                self._place.make(_FOLDERS)
                if not self.part:  # another shard's file may be in the making
                    self._place.sweep(("", "samples", "full", "failed"))
                if self.part:
                    stack.enter_context(self._place.held(f"parts/{self.part}.lock"))
                is_held = True
            except BlockingIOError as error:
                if must:
                    raise AqualogError(
                        f"is in use by another batch (process {error.strerror})", where=self.name,
                        hint="wait until it is done, or --store DIR",
                    ) from error  # fmt: skip
            except OSError as error:
                if must:
                    raise self._unwritable(error) from error
            yield is_held

    @property
    def exists(self) -> bool:
        """Whether this folder is a store."""
        return self._place.has(MARK)

    def size_of(self, key: str) -> int:
        """Size of a log's file, 0 without one. [byte]"""
        name = _samples(key)
        return self._place.copy(name).stat().st_size if self._place.has(name) else 0

    def keys(self) -> tuple[set[str], set[str]]:
        """Keys of all logs that are done, and of those that failed; one look at each folder."""
        return _stems(self._place.names("samples"), ".parquet"), _stems(self._place.names("failed"), ".json")

    def put(self, key: str, measurement: Measurement) -> None:
        """Keep the result of a log, whole. This and all methods that write: AqualogError if that is not possible."""
        metadata = {_METADATA_KEY: json.dumps(measurement.about, ensure_ascii=True, separators=(",", ":"))}
        with self._told():
            if measurement.full is None:
                self._place.remove(_full(key))
            else:  # before the samples, which say that the log is done
                self._write_frame(_full(key), measurement.full, statistics=False)
            self._write_frame(_samples(key), measurement.samples, metadata=metadata, statistics=False)
            self._place.remove(_failure(key))

    def put_failure(self, key: str, reason: str) -> None:
        """Store the reason why a log gave no result."""
        with self._told():
            self._place.write(_failure(key), (json.dumps({"reason": reason}) + "\n").encode())

    def failure(self, key: str) -> str:
        """Reason why a log gave no result."""
        try:
            return str(json.loads(self._place.read(_failure(key)))["reason"])
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return "failed, and the reason cannot be read"

    def drop(self, key: str) -> None:
        """Remove a log's file, a damaged one."""
        with self._told():
            self._place.remove(_samples(key))
            self._place.remove(_full(key))

    def look_at(self, keys: Collection[str]) -> None:
        """Announce that the findings of these logs are needed next: behind a URL many are read together."""
        with self._reached():
            self._place.look_at([_samples(k) for k in sorted(keys)])

    def expect(self, keys: Iterable[str]) -> None:
        """Announce that samples of these logs are needed, probably in this order; earlier reads are repeated."""
        self._place.expect([_samples(k) for k in keys])

    def is_sound(self, key: str) -> bool:
        """Whether a log's file is readable, judged by its metadata and columns."""
        try:
            self.about(key)
        except LogError:
            return False
        return True

    def about(self, key: str) -> Mapping[str, Any]:
        """Findings of a log; LogError if its file is damaged, AqualogError if the store cannot be reached."""
        name = _samples(key)
        with self._reached():
            try:
                source = self._place.footer(name)
            except FileNotFoundError as error:
                raise self._damaged(name) from error
        try:
            found: Mapping[str, Any] = json.loads(pl.read_parquet_metadata(source)[_METADATA_KEY])
            is_whole = _is_about(found) and pl.read_parquet_schema(source).keys() >= _COLUMNS
        except (OSError, ValueError, KeyError, *_UNREADABLE) as error:
            raise self._damaged(name) from error
        if not is_whole:
            raise self._damaged(name)
        return found

    def samples(self, key: str) -> pl.DataFrame:
        """Samples of a log; LogError if they cannot be read. A damaged file is removed, to be made again."""
        name = _samples(key)
        try:
            frame = pl.read_parquet(self._place.copy(name), hive_partitioning=False)
        except OSError as error:
            raise LogError(f"cannot be read ({error.strerror or error})", where=self.at(name)) from error
        except _UNREADABLE as error:
            with suppress(OSError):  # a store that is only read
                self._place.remove(name)
            raise self._damaged(name) from error
        if not set(frame.columns) >= _COLUMNS:
            raise self._damaged(name)
        return frame

    def full(self, key: str) -> pl.DataFrame | None:
        """Samples at the log's own rate; None without an episode, in a store of an older version, or damaged."""
        name = _full(key)
        try:
            if not self._place.has(name):
                return None
            frame = pl.read_parquet(self._place.copy(name), hive_partitioning=False)
        except (OSError, *_UNREADABLE):
            return None
        is_whole = {"t", "v_x"} <= set(frame.columns) and all(t.is_numeric() or t == pl.Boolean for t in frame.dtypes)
        return frame if is_whole else None

    def contents(self) -> dict[str, Any]:
        """Hashes that batches and shards have kept."""
        parts = sorted(n for n in self._place.names("parts") if n.endswith(".json") and n[0] != ".")
        known = [self.read_json(n) for n in (_CONTENTS, *(f"parts/{p}" for p in parts))]
        return {path: entry for d in known if isinstance(d, dict) for path, entry in d.items()}

    def keep_contents(self, known: Mapping[str, Any]) -> None:
        """Keep hashes."""
        self.write_json(f"parts/{self.part}.json" if self.part else _CONTENTS, known)

    def read_json(self, name: str) -> Any:
        """A JSON file of the store; None where it is not there or damaged, AqualogError if a URL cannot be reached."""
        with self._reached():
            try:
                return json.loads(self._place.read(name))
            except (FileNotFoundError, ValueError, RecursionError):
                return None
            except OSError:
                if isinstance(self.address, Path):
                    return None
                raise

    def write_json(self, name: str, document: Any) -> None:
        """A JSON file of the store, whole."""
        with self._told():
            self._place.write(name, (json.dumps(document, indent=1, allow_nan=False) + "\n").encode())

    def write_table(self, name: str, frame: pl.DataFrame) -> None:
        """A table of the store, whole."""
        with self._told():
            self._write_frame(name, frame)

    def _write_frame(self, name: str, frame: pl.DataFrame, **options: Any) -> None:
        # into memory first: then a disk that is full is an OSError with its number
        buffer = io.BytesIO()
        frame.write_parquet(buffer, compression="zstd", **options)
        self._place.write(name, buffer.getbuffer())

    @contextmanager
    def _told(self) -> Iterator[None]:
        """A fault in writing is the store's, not that of the log whose result it is."""
        try:
            yield
        except OSError as error:
            raise self._unwritable(error) from error

    @contextmanager
    def _reached(self) -> Iterator[None]:
        """Report a store that cannot be reached, which gives no information on its files; folder errors stay as they
        are."""
        try:
            yield
        except OSError as error:
            if isinstance(self.address, Path) or isinstance(error, FileNotFoundError):
                raise
            raise AqualogError(
                f"cannot be read ({error.strerror or error})", where=str(error.filename or self.name),
                hint="the network, and the credentials in the environment; the same command goes on",
            ) from error  # fmt: skip

    def _unwritable(self, error: OSError) -> AqualogError:
        if error.errno in _NO_ROOM:
            return AqualogError(
                f"{error.strerror}".lower(), where=self.name, expected="room for the results",
                hint="make room, or --store DIR; the same command goes on with the rest",
            )  # fmt: skip
        if isinstance(error, FileNotFoundError):
            return AqualogError(
                "is gone", where=self.name, expected="the folder in which this batch began",
                hint="its disk or the network; then the same command goes on with the rest",
            )  # fmt: skip
        file = error.filename2 or error.filename or self.name
        return AqualogError(
            f"cannot be written ({error.strerror or error})", where=str(file), hint="its permissions, or --store DIR"
        )

    def _damaged(self, name: str) -> LogError:
        return LogError(
            "is damaged", where=self.at(name), expected="a file that `aqualog batch` has written",
            hint="the same command once more, which makes it again",
        )  # fmt: skip


def _samples(key: str) -> str:
    return f"samples/{key}.parquet"


def _full(key: str) -> str:
    return f"full/{key}.parquet"


def _failure(key: str) -> str:
    return f"failed/{key}.json"


def _is_about(found: Any) -> bool:
    if not isinstance(found, dict) or not found.keys() >= _PARTS.keys():
        return False
    if not all(isinstance(found[name], kind) for name, kind in _PARTS.items()):
        return False
    return all(isinstance(e, dict) and "detector" in e and isinstance(e.get("evidence"), dict) for e in found["events"])


def _stems(names: Iterable[str], suffix: str) -> set[str]:
    return {n.removesuffix(suffix) for n in names if n.endswith(suffix) and n[0] != "."}
