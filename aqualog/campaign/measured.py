"""Information that a store already has on a campaign's runs, before any log is measured again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from aqualog.campaign.batch import name_of
from aqualog.campaign.records import Campaign
from aqualog.core.errors import ConfigError

__all__ = ["Measured", "lane_faults", "measured_runs"]


@dataclass(frozen=True, slots=True)
class Measured:
    """A run in the store: `speeds` are lowest and highest v_x [km/h], () if unknown; `duration_s` of its log."""

    state: str
    reason: str
    speeds: tuple[float, ...]
    duration_s: float | None


def measured_runs(campaign: Campaign, folder: Path) -> dict[int, Measured]:
    """Runs of the campaign that the store's table holds, by index; empty without such a table.

    A run is found by its logs: the table may be older than the campaign file, and lanes do not change the content of a
    log.

    Raises
    ------
    ConfigError
        If the table cannot be read.
    """
    import polars as pl

    path = folder / "runs.parquet"
    if not path.is_file():
        return {}
    columns = ("name", "state", "reason", "v_min_kmh", "v_max_kmh", "duration_s")
    try:
        rows = pl.read_parquet(path, columns=list(columns)).rows()
    except (OSError, pl.exceptions.PolarsError) as error:
        raise ConfigError("is not a table of runs", where=str(path), hint="aqualog batch makes it again") from error
    known = {}
    for name, state, reason, low, high, duration in rows:
        known[name] = Measured(state, reason or "", () if low is None or high is None else (low, high), duration)
    names = [name_of(campaign, run.logs) for run in campaign.runs]
    return {i: known[name] for i, name in enumerate(names) if name in known}


def lane_faults(campaign: Campaign, measured: dict[int, Measured], places: Sequence[str]) -> list[str]:
    """Runs whose lane ends after their log, as far as the store knows its length."""
    return [
        f"{places[i]}: lane_end_s = {run.lane[1]:g} is after the log's end at {m.duration_s:.1f} s"
        for i, run in enumerate(campaign.runs)
        if run.lane is not None
        and (m := measured.get(i))
        and m.duration_s is not None
        and run.lane[1] > m.duration_s + 1.0
    ]
