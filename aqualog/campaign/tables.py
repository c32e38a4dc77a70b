"""Tables of a store that open by themselves in polars or DuckDB; the manifest; and what they hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from aqualog import __version__
from aqualog.campaign.definition import Campaign
from aqualog.campaign.jobs import code_stamp, in_utf8, name_of
from aqualog.campaign.results import CampaignData, RunInfo
from aqualog.core.errors import ConfigError
from aqualog.detect.registry import DETECTORS

__all__ = [
    "NUMBERS", "TEXTS", "StoredRun", "episodes_table", "events_table", "lane_faults", "runs_table", "stored_runs",
    "write_tables",
]  # fmt: skip

TEXTS = ("tyre", "wear", "manoeuvre")
NUMBERS = (
    "tread_depth_mm", "pressure_front_bar", "pressure_rear_bar", "water_depth_mm", "water_depth_left_mm",
    "load_front_kg", "load_rear_kg", "lane_start_s", "lane_end_s",
)  # fmt: skip
_QUALITY = (
    "dropped_samples", "time_jumps", "lost_in_files", "duplicates", "back_steps", "resets", "wraps", "pauses", "drifts",
    "strays",
)  # fmt: skip
_EVENT = {
    "run": pl.Int64, "name": pl.String, "key": pl.String, "detector": pl.String, "wheel": pl.String, "side": pl.String,
    "start_s": pl.Float64, "end_s": pl.Float64, "severity": pl.String, "peak": pl.Float64, "threshold": pl.Float64,
    "v_x": pl.Float64, "slip_min": pl.Float64, "decided_by": pl.String,
}  # fmt: skip
_EPISODE = {
    "run": pl.Int64, "name": pl.String, "key": pl.String, "kind": pl.String, "start_s": pl.Float64, "end_s": pl.Float64,
    "wheels": pl.String, "axle": pl.String, "side": pl.String, "severity": pl.String, "v_x_kmh": pl.Float64,
    "decided_by": pl.String, "delta_a_x_max": pl.Float64, "slip_min": pl.Float64, "slip_max": pl.Float64,
    "distance_m": pl.Float64, "events": pl.Int64,
}  # fmt: skip


def write_tables(data: CampaignData) -> None:
    """Write runs.parquet, events.parquet, episodes.parquet and manifest.json of a campaign into its store."""
    store, infos = data.store, data.runs
    store.write_table("runs.parquet", runs_table(infos))
    store.write_table("events.parquet", events_table(infos))
    store.write_table("episodes.parquet", episodes_table(infos))
    states = [i.state for i in infos]
    store.write_json(
        "manifest.json",
        {
            "schema_version": 1, "tool_version": __version__, "code": code_stamp(),
            "campaign": data.name, "states": {s: states.count(s) for s in dict.fromkeys(states)},
            "logs": [
                {"run": i.index, "log": i.name, "state": i.state, "reason": i.reason, "key": i.key,
                 "truncated": i.about.get("quality", {}).get("truncated", False)} for i in infos
            ],
        },
    )  # fmt: skip


def runs_table(infos: Sequence[RunInfo]) -> pl.DataFrame:
    """A row for each run: state, configuration, range, verdict, events of each detector, quality. [s, m, km/h, Hz]"""
    extra = sorted({k for i in infos for k in i.run.values if k.startswith("x_")})
    schema: dict[str, Any] = {
        "run": pl.Int64, "name": pl.String, "key": pl.String, "state": pl.String, "reason": pl.String,
        "vehicle": pl.String, **dict.fromkeys(TEXTS, pl.String), **dict.fromkeys(NUMBERS, pl.Float64),
        **dict.fromkeys(extra, pl.String), "start_ns": pl.Int64, "duration_s": pl.Float64, "distance_m": pl.Float64,
        "v_min_kmh": pl.Float64, "v_max_kmh": pl.Float64, "sample_rate_hz": pl.Float64, "slip_against": pl.String,
        "traction": pl.String, "verdict": pl.String, "missing": pl.String, "episodes": pl.Int64,
        "full_episodes": pl.Int64, **{f"events_{d}": pl.Int64 for d in DETECTORS}, "unavailable": pl.String,
        "truncated": pl.Boolean, **dict.fromkeys(_QUALITY, pl.Int64), "notes": pl.String,
    }  # fmt: skip
    rows = [{k: in_utf8(x) if isinstance(x, str) else x for k, x in _run_row(i).items()} for i in infos]
    return pl.DataFrame(rows, schema=schema, strict=False)


def events_table(infos: Sequence[RunInfo]) -> pl.DataFrame:
    """A row for each event of each run. [s, m/s]"""
    return pl.DataFrame([_event_row(i, e) for i in infos for e in i.events], schema=_EVENT, strict=False)


def episodes_table(infos: Sequence[RunInfo]) -> pl.DataFrame:
    """A row for each episode of each run. [s, km/h, m/s², m]"""
    rows = [
        {**e.document(), "run": i.index, "name": i.name, "key": i.key, "wheels": ", ".join(e.wheels),
         "decided_by": ", ".join(e.decided_by), "events": len(e.events)}
        for i in infos for e in i.judgement.episodes
    ]  # fmt: skip
    return pl.DataFrame(rows, schema=_EPISODE, strict=False)


def _run_row(info: RunInfo) -> dict[str, Any]:
    about = info.about
    row: dict[str, Any] = {
        "run": info.index, "name": info.name, "key": info.key, "state": info.state, "reason": info.reason,
        "vehicle": info.run.vehicle.stem, **info.run.values,
    }  # fmt: skip
    if info.run.lane is not None:
        row |= dict(zip(("lane_start_s", "lane_end_s"), info.run.lane, strict=True))
    if not about:
        return row
    row |= {n: about[n] for n in ("start_ns", "duration_s", "distance_m", "sample_rate_hz", "slip_against", "traction")}
    row |= {f"{n}_kmh": None if about[n] is None else 3.6 * about[n] for n in ("v_min", "v_max")}
    judgement = info.judgement
    wet = judgement.of("aquaplaning")
    row |= {"verdict": judgement.verdict, "missing": ", ".join(judgement.missing)}
    if judgement.verdict != "cannot_be_judged":
        row |= {"episodes": len(wet), "full_episodes": sum(e.severity == "full" for e in wet)}
    found = [e["detector"] for e in about["events"]]
    row |= {f"events_{d}": None if d in about["unavailable"] else found.count(d) for d in DETECTORS}
    row["unavailable"] = ", ".join(about["unavailable"])
    # results of before do not count every fault
    row |= {n: about["quality"].get(n, 0) for n in _QUALITY}
    row |= {n: about["quality"][n] for n in ("truncated", "unfinalised")}
    row["notes"] = "\n".join(about["notes"])
    return row


def _event_row(info: RunInfo, event: Mapping[str, Any]) -> dict[str, Any]:
    evidence = event["evidence"]
    decided = evidence.get("decided_by")
    return {n: event[n] for n in _EVENT if n in event} | {
        "run": info.index, "name": info.name, "key": info.key, "v_x": evidence.get("v_x"),
        "slip_min": evidence.get("slip_min"), "decided_by": ", ".join(decided) if decided else None,
    }  # fmt: skip


@dataclass(frozen=True, slots=True)
class StoredRun:
    """A run in the store: `speeds` are lowest and highest v_x [km/h], () if unknown; `duration_s` of its log."""

    state: str
    reason: str
    speeds: tuple[float, ...]
    duration_s: float | None


def stored_runs(campaign: Campaign, folder: Path) -> dict[int, StoredRun]:
    """Runs of the campaign that the store's table holds, by index; empty without such a table.

    A run is found by its logs: the table may be older than the campaign file, and lanes do not change the content of a
    log.

    Raises
    ------
    ConfigError
        If the table cannot be read.
    """
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
        known[name] = StoredRun(state, reason or "", () if low is None or high is None else (low, high), duration)
    names = [name_of(campaign, run.logs) for run in campaign.runs]
    return {i: known[name] for i, name in enumerate(names) if name in known}


def lane_faults(campaign: Campaign, stored: dict[int, StoredRun], places: Sequence[str]) -> list[str]:
    """Runs whose lane ends after their log, as far as the store knows its length."""
    return [
        f"{places[i]}: lane_end_s = {run.lane[1]:g} is after the log's end at {m.duration_s:.1f} s"
        for i, run in enumerate(campaign.runs)
        if run.lane is not None
        and (m := stored.get(i))
        and m.duration_s is not None
        and run.lane[1] > m.duration_s + 1.0
    ]
