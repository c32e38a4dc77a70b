"""The folder in which a campaign's results are kept: one file per log, and tables that open by themselves.

STORE/samples/KEY.parquet   samples of one log; what was found stands as JSON under "aqualog" in the file's metadata
STORE/failed/KEY.json       why a log gave nothing; tried again when the log or its configuration changes
STORE/runs.parquet          a row per run        (made anew by every batch)
STORE/events.parquet        a row per event      (as above)
STORE/manifest.json         state of every log   (as above)
STORE/contents.json         hashes of the logs by size and time of change
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import polars as pl

from aqualog.campaign.measure import Measurement
from aqualog.errors import ConfigError, LogError
from aqualog.io.whole import write_text, write_whole

__all__ = ["MARK", "Store"]

MARK = "aqualog_store.json"
_METADATA_KEY = "aqualog"
_OWN = ("samples", "failed", "pages", "runs.parquet", "events.parquet", "manifest.json", "contents.json", MARK)


class Store:
    """A store folder.

    Parameters
    ----------
    folder : Path
        Made by `prepare` if it is not there.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def prepare(self) -> None:
        """Make the folder, and refuse one that holds something else.

        Raises
        ------
        ConfigError
        """
        if self.folder.exists() and not self.folder.is_dir():
            raise ConfigError("is a file", where=str(self.folder), expected="a folder for the results")
        if self.folder.is_dir() and not (self.folder / MARK).exists() and any(self.folder.iterdir()):
            raise ConfigError(
                "holds other files", where=str(self.folder), expected="an empty folder, or one of `aqualog batch`"
            )
        for name in ("samples", "failed"):
            (self.folder / name).mkdir(parents=True, exist_ok=True)
        if not (self.folder / MARK).exists():
            write_text(self.folder / MARK, json.dumps({"schema_version": 1}) + "\n")
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
        """Keep the result of a log, whole."""
        metadata = {_METADATA_KEY: json.dumps(measurement.about, ensure_ascii=True, separators=(",", ":"))}
        write_whole(
            self.samples_path(key),
            lambda p: measurement.samples.write_parquet(p, metadata=metadata, compression="zstd", statistics=False),
        )
        self._failure_path(key).unlink(missing_ok=True)

    def put_failure(self, key: str, reason: str) -> None:
        """Keep why a log gave nothing."""
        write_text(self._failure_path(key), json.dumps({"reason": reason}) + "\n")

    def failure(self, key: str) -> str:
        """Why a log gave nothing."""
        try:
            return str(json.loads(self._failure_path(key).read_text(encoding="utf-8"))["reason"])
        except (OSError, ValueError, KeyError, TypeError):
            return "failed, and the reason cannot be read"

    def forget(self, key: str) -> None:
        """Remove what is kept of a log."""
        self.samples_path(key).unlink(missing_ok=True)
        self._failure_path(key).unlink(missing_ok=True)

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
        except (OSError, ValueError, KeyError, pl.exceptions.PolarsError) as error:
            raise LogError(
                "is damaged", where=str(path), expected="a file that `aqualog batch` has written",
                hint="remove it; the next batch makes it again",
            ) from error  # fmt: skip
        return found

    def samples(self, key: str) -> pl.DataFrame:
        """Samples of a log.

        Raises
        ------
        LogError
            If its file is damaged.
        """
        path = self.samples_path(key)
        try:
            return pl.read_parquet(path, hive_partitioning=False)
        except (OSError, pl.exceptions.PolarsError) as error:
            raise LogError("is damaged", where=str(path), hint="remove it; the next batch makes it again") from error

    def read_json(self, name: str) -> Any:
        """A JSON file of the store; None where it is not there or damaged."""
        try:
            return json.loads((self.folder / name).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None

    def write_json(self, name: str, document: Any) -> None:
        """A JSON file of the store, whole."""
        write_text(self.folder / name, json.dumps(document, indent=1, allow_nan=False) + "\n")

    def write_table(self, name: str, frame: pl.DataFrame) -> None:
        """A table of the store, whole."""
        write_whole(self.folder / name, lambda p: frame.write_parquet(p, compression="zstd"))

    def holds(self, path: Path) -> bool:
        """Whether a path lies in this store."""
        return path.resolve().is_relative_to(self.folder.resolve())

    def _failure_path(self, key: str) -> Path:
        return self.folder / "failed" / f"{key}.json"

    def _sweep(self) -> None:
        """Remove what a killed process has left half-written."""
        for folder in (self.folder, self.folder / "samples", self.folder / "failed"):
            for orphan in folder.glob(".*.tmp"):
                orphan.unlink(missing_ok=True)


def _stems(folder: Path, suffix: str) -> set[str]:
    try:
        with os.scandir(folder) as entries:
            return {e.name.removesuffix(suffix) for e in entries if e.name.endswith(suffix) and e.name[0] != "."}
    except FileNotFoundError:
        return set()
