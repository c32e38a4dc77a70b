"""Write a table of signals as CSV or Parquet.

Everything is written to the given path; the caller renames it from a temporary name.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
import polars as pl

from aqualog.core.errors import LogError
from aqualog.core.records import FloatArray
from aqualog.io.tables.columns import split_unit

__all__ = ["METADATA_KEY", "TableColumn", "join_parquet", "write_csv", "write_parquet"]

METADATA_KEY = "aqualog"
_SCHEMA_VERSION = 1
_FORMULA = ("=", "+", "-", "@", "\t")


@dataclass(frozen=True, slots=True)
class TableColumn:
    """One column: `values` (n,) in `unit`, NaN where missing. The column `t` [s] is the time."""

    name: str
    unit: str
    values: FloatArray


def write_csv(path: Path, columns: Sequence[TableColumn], *, decimal_comma: bool = False) -> None:
    """Write CSV in UTF-8 with headers `name [unit]`; missing values are blank.

    Parameters
    ----------
    path : Path
        Overwritten.
    columns : sequence of TableColumn
        All of one length; one of them is the time.
    decimal_comma : bool
        `,` as decimal sign and `;` between cells.

    Raises
    ------
    LogError
        If the file cannot be written.
    """
    frame = _frame(columns, [_header(c) for c in columns])
    buffer = BytesIO()
    frame.write_csv(buffer, separator=";" if decimal_comma else ",", decimal_comma=decimal_comma)
    _write(path, buffer)


def write_parquet(path: Path, columns: Sequence[TableColumn], *, start_ns: int | None = None) -> None:
    """Write Parquet with plain names; units and start stand as JSON under the key `aqualog` of the file's metadata.

    Parameters
    ----------
    path : Path
        Overwritten.
    columns : sequence of TableColumn
        All of one length; one of them is the time. What is missing is null.
    start_ns : int or None
        Absolute time of t = 0, since 1970 UTC.

    Raises
    ------
    LogError
        If the file cannot be written.
    """
    about = {"schema_version": _SCHEMA_VERSION, "start_ns": start_ns, "units": {c.name: c.unit for c in columns}}
    buffer = BytesIO()
    metadata = {METADATA_KEY: json.dumps(about, ensure_ascii=True)}
    _frame(columns, [c.name for c in columns]).write_parquet(buffer, metadata=metadata)
    _write(path, buffer)


def join_parquet(path: Path, parts: Sequence[Path]) -> None:
    """Write tables of equal columns below each other without holding them; the metadata of the first one are kept.

    Parameters
    ----------
    path : Path
        Overwritten.
    parts : sequence of Path
        As `write_parquet` makes them, in order.
    """
    about = pl.read_parquet_metadata(parts[0])[METADATA_KEY]
    pl.scan_parquet(list(parts)).sink_parquet(path, metadata={METADATA_KEY: about}, maintain_order=True)


def _frame(columns: Sequence[TableColumn], names: Sequence[str]) -> pl.DataFrame:
    if len({len(c.values) for c in columns}) > 1:
        raise ValueError("columns differ in length")
    if len(set(names)) < len(names):
        raise ValueError(f"two columns have one name: {sorted(n for n in names if names.count(n) > 1)[0]}")
    return pl.DataFrame([_series(c, n) for c, n in zip(columns, names, strict=True)])


def _series(column: TableColumn, name: str) -> pl.Series:
    values = np.ascontiguousarray(column.values, dtype=np.float64)
    if column.name == "t" and column.unit == "s":
        values = np.round(values, 9)  # stamps are whole nanoseconds: 0.07, not 0.07000000000000001
    return pl.Series(name, values, nan_to_null=True)


def _header(column: TableColumn) -> str:
    """`name [unit]`; without a unit the name alone, if nothing in it reads as one.

    A spreadsheet runs a cell that begins as a formula: an apostrophe before it prevents that, and our reader drops it.
    """
    name = " ".join(column.name.split())
    text = f"{name} [{column.unit}]" if column.unit or split_unit(name) != (name, "") else name
    return f"'{text}" if column.name.startswith(_FORMULA) else text


def _write(path: Path, buffer: BytesIO) -> None:
    try:
        path.write_bytes(buffer.getbuffer())
    except OSError as error:
        raise LogError(f"cannot be written ({error.strerror})", where=str(path), hint="another folder") from error
