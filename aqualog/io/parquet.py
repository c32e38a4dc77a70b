"""Parquet logs."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import polars as pl

from aqualog.errors import LogError
from aqualog.io.base import ReadOptions
from aqualog.io.table_time import choose_time, numbers_to_ns, split_unit, texts_to_ns
from aqualog.types import BoolArray, Channel, ChannelInfo, FileFaults, TimeArray

__all__ = ["METADATA_KEY", "ParquetReader"]

METADATA_KEY = "aqualog"


class ParquetReader:
    """One Parquet file. A null is no sample, a NaN a bad one. Units: in the column's name, or in our own metadata."""

    format = "parquet"

    def __init__(self, path: Path, options: ReadOptions) -> None:
        self._path = path
        self._name = path.name
        self._notes: list[str] = []
        try:
            schema = pl.read_parquet_schema(path)
            stored = _own_metadata(path)
            self._rows = int(pl.scan_parquet(path).select(pl.len()).collect().item())
        except (pl.exceptions.PolarsError, OSError) as error:
            raise LogError(f"cannot be read ({error})", where=str(path), expected="a complete Parquet file") from error
        self._start_ns = stored.get("start_ns")
        own_units = stored.get("units", {})
        columns = list(schema)
        parts = [split_unit(c) for c in columns]
        names = [n for n, _ in parts]
        units = [u or own_units.get(n, "") for n, u in parts]
        self._time = choose_time(names, units, options, where=str(path))
        self._columns = columns
        self._types = list(schema.values())
        self._infos = tuple(
            ChannelInfo(names[i], names[i], units[i], self._rows, self._name, key=i)
            for i, kind in enumerate(self._types)
            if i not in self._time.columns and (kind.is_numeric() or kind == pl.Boolean)
        )

    def channels(self) -> Sequence[ChannelInfo]:
        """Columns of numbers, in file order."""
        return self._infos

    @property
    def faults(self) -> FileFaults:
        """Notes on how the time was read."""
        return FileFaults(notes=tuple(self._notes))

    def read(self, wanted: Iterable[ChannelInfo]) -> list[Channel]:
        """Read these columns and the time."""
        wanted = list(wanted)
        names = dict.fromkeys(self._columns[i] for i in (*self._time.columns, *(w.key for w in wanted)))
        try:
            table = pl.read_parquet(self._path, columns=list(names))
        except (pl.exceptions.PolarsError, OSError) as error:
            raise LogError(f"cannot be read ({error})", where=str(self._path)) from error
        t_ns, known, absolute = self._stamps(table)
        channels = []
        for info in wanted:
            column = table[self._columns[info.key]]
            use = known & column.is_not_null().to_numpy()
            values = column.cast(pl.Float64).fill_null(np.nan).to_numpy().astype(np.float64)
            channels.append(Channel(info, t_ns[use], values[use], absolute))
        return channels

    def _stamps(self, table: pl.DataFrame) -> tuple[TimeArray, BoolArray, bool]:
        column = table[self._columns[self._time.columns[0]]]
        where = f"{self._name}:{column.name}"
        known = column.is_not_null().to_numpy()
        if column.dtype in (pl.Datetime, pl.Date):
            stamps = column.cast(pl.Datetime("ns")).dt.epoch("ns")
            return stamps.fill_null(0).to_numpy().astype(np.int64), known, True
        if column.dtype in (pl.Duration, pl.Time):
            return (
                column.cast(pl.Int64 if column.dtype == pl.Time else pl.Duration("ns"))
                .cast(pl.Int64)
                .fill_null(0)
                .to_numpy()
                .astype(np.int64),
                known,
                False,
            )
        if column.dtype == pl.String:
            found = texts_to_ns(column.fill_null(""))
            if found is None:
                raise LogError("the time is text that is no date", where=where)
            return found
        numbers = column.cast(pl.Float64).fill_null(np.nan).to_numpy().astype(np.float64)
        known = known & np.isfinite(numbers)
        t_ns = np.zeros(numbers.size, dtype=np.int64)
        t_ns[known], absolute, note = numbers_to_ns(numbers[known], self._time.unit, where=where)
        if self._start_ns is not None:
            t_ns, absolute = t_ns + np.int64(self._start_ns), True
        elif note:
            self._notes.append(note)
        return t_ns, known, absolute

    def close(self) -> None:
        """Nothing is kept open."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _own_metadata(path: Path) -> dict[str, Any]:
    """Units and start time that our own writer left; empty for files of others."""
    text = pl.read_parquet_metadata(path).get(METADATA_KEY, "{}")
    try:
        stored = json.loads(text)
    except ValueError:
        return {}
    return stored if isinstance(stored, dict) else {}
