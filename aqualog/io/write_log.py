"""Signals into a log file of any format, chosen by the suffix."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aqualog.errors import ConfigError
from aqualog.types import FloatArray, TimeArray

__all__ = ["LogGroup", "check_suffix", "write_log"]

SUFFIXES = (".mf4", ".mcap", ".csv", ".parquet")


@dataclass(frozen=True, slots=True)
class LogGroup:
    """Channels that share `t_ns` (n,), counted from the start; name -> (unit, meaning, samples (n,), NaN missing)."""

    name: str
    columns: Mapping[str, tuple[str, str, FloatArray]]


def check_suffix(path: Path) -> str:
    """Suffix of an output file, before any work is done for it.

    Raises
    ------
    ConfigError
        If no writer has it.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise ConfigError(f'no writer for "{suffix}"', where=str(path), expected=" ".join(SUFFIXES))
    return suffix


def write_log(
    path: Path,
    t_ns: TimeArray,
    groups: Sequence[LogGroup],
    *,
    suffix: str,
    start_ns: int | None,
    decimal_comma: bool = False,
) -> None:
    """Write groups of channels on one time base.

    Parameters
    ----------
    path : Path
        Written as named; the caller renames it when it is whole.
    t_ns : int64 array (n,)
        Nanoseconds from the start.
    groups : sequence of LogGroup
        MDF: channel groups; MCAP: topics; CSV and Parquet: one table.
    suffix : str
        Format, see `check_suffix`.
    start_ns : int or None
        Absolute time of t = 0, since 1970 UTC.
    decimal_comma : bool
        CSV only: `,` as decimal sign and `;` between cells.
    """
    if suffix == ".mf4":
        from aqualog.io.write_mdf import MdfGroup, write_mf4

        t_s: FloatArray = t_ns.astype(np.float64) * 1e-9
        write_mf4(path, [MdfGroup(g.name, t_s, g.columns) for g in groups], start_ns, "written by aqualog")
        return
    if suffix == ".mcap":
        from aqualog.io.write_mcap import McapTopic, write_mcap

        write_mcap(path, [McapTopic(f"/{g.name}", t_ns, g.columns) for g in groups], start_ns)
        return
    from aqualog.io.write_table import TableColumn, write_csv, write_parquet

    columns = [TableColumn("t", "s", np.asarray(t_ns * 1e-9))]
    columns += [TableColumn(n, unit, x) for g in groups for n, (unit, _, x) in g.columns.items()]
    if suffix == ".csv":
        write_csv(path, columns, decimal_comma=decimal_comma)
    else:
        write_parquet(path, columns, start_ns=start_ns)
