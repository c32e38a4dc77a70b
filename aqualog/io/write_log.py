"""Write signals into a log file of any format, chosen by the suffix."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.core.records import FloatArray, TimeArray
from aqualog.io.log_event import LogEvent

__all__ = ["LogGroup", "check_suffix", "write_log"]

SUFFIXES = (".mf4", ".mcap", ".csv", ".parquet")


@dataclass(frozen=True, slots=True)
class LogGroup:
    """Channels that share stamps (n,), counted from the start; name -> (unit, meaning, samples (n,), NaN missing).

    `t_ns` are stamps of the group's own, for formats that have them (MDF, MCAP); None: those of the log.
    """

    name: str
    columns: Mapping[str, tuple[str, str, FloatArray]]
    t_ns: TimeArray | None = None


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
    comment: str = "written by aqualog",
    written_ns: int | None = None,
    events: Sequence[LogEvent] = (),
) -> None:
    """Write groups of channels, on one time base where the format is a table.

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
    comment : str
        About the log, for formats that have a place for it (MDF, MCAP).
    written_ns : int, optional
        Time of writing for formats that keep it (MDF), since 1970 UTC; default now.
    events : sequence of LogEvent
        For formats that have a place for them (MDF, MCAP).
    """
    if suffix == ".mf4":
        from aqualog.io.write_mdf import MdfGroup, write_mf4

        seconds = [(t_ns if g.t_ns is None else g.t_ns).astype(np.float64) * 1e-9 for g in groups]
        mdf_groups = [MdfGroup(g.name, t, g.columns) for g, t in zip(groups, seconds, strict=True)]
        write_mf4(path, mdf_groups, start_ns, comment, written_ns=written_ns, events=events)
        return
    if suffix == ".mcap":
        from aqualog.io.write_mcap import McapTopic, write_mcap

        topics = [McapTopic(f"/{g.name}", t_ns if g.t_ns is None else g.t_ns, g.columns) for g in groups]
        write_mcap(path, topics, start_ns, comment, events=events)
        return
    if any(g.t_ns is not None for g in groups):
        raise ValueError(f"{suffix} is one table: bring the groups onto one time base first")
    from aqualog.io.write_table import TableColumn, write_csv, write_parquet

    columns = [TableColumn("t", "s", np.asarray(t_ns * 1e-9))]
    columns += [TableColumn(n, unit, x) for g in groups for n, (unit, _, x) in g.columns.items()]
    if suffix == ".csv":
        write_csv(path, columns, decimal_comma=decimal_comma)
    else:
        write_parquet(path, columns, start_ns=start_ns)
