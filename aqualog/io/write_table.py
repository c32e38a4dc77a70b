"""Tables: CSV and Parquet."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from aqualog.io.parquet import METADATA_KEY
from aqualog.types import FloatArray

__all__ = ["TableColumn", "write_csv", "write_parquet"]

_FORMULA = ("=", "+", "-", "@", "\t", "\r")


@dataclass(frozen=True, slots=True)
class TableColumn:
    """One column; NaN is a missing sample."""

    name: str
    unit: str
    values: FloatArray


def write_csv(path: Path, columns: Sequence[TableColumn], *, decimal_comma: bool = False) -> None:
    """Write a CSV with `name [unit]` headers; a missing sample is a blank cell.

    Parameters
    ----------
    path : Path
        Overwritten.
    columns : sequence of TableColumn
    decimal_comma : bool
        `,` as decimal sign, `;` between cells, as spreadsheets in Europe read it.

    A header that a spreadsheet would run as a formula gets an apostrophe in front.
    """
    data = {_header(c): pl.Series(c.values).fill_nan(None) for c in columns}
    frame = pl.DataFrame(data)
    frame.write_csv(path, separator=";" if decimal_comma else ",", decimal_comma=decimal_comma)


def _header(column: TableColumn) -> str:
    text = f"{column.name} [{column.unit}]" if column.unit else column.name
    return f"'{text}" if text.startswith(_FORMULA) else text


def write_parquet(path: Path, columns: Sequence[TableColumn], *, start_ns: int | None) -> None:
    """Write a Parquet file with plain names; units and the start time stand in its metadata. NaN becomes null."""
    frame = pl.DataFrame({c.name: pl.Series(c.values).fill_nan(None) for c in columns})
    stored = {"units": {c.name: c.unit for c in columns}, "start_ns": start_ns}
    frame.write_parquet(path, compression="zstd", metadata={METADATA_KEY: json.dumps(stored)})
