"""Tables of a store that open by themselves in polars or DuckDB: runs, events; and the manifest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import polars as pl

from aqualog import __version__
from aqualog.campaign.key import code_stamp
from aqualog.campaign.store import Store
from aqualog.core.errors import AqualogError
from aqualog.detect.registry import DETECTORS

if TYPE_CHECKING:
    from aqualog.campaign.batch import Configured, Job

__all__ = ["NUMBERS", "TEXTS", "write_tables"]

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


def write_tables(configured: Configured, store: Store, jobs: Sequence[Job]) -> None:
    """Write runs.parquet, events.parquet and manifest.json, a row per run of the campaign."""
    done, failed = store.keys()
    store.look_at(done & {j.key for j in jobs})
    of_run = {index: job for job in jobs for index in job.runs}
    runs, events, logs = [], [], []
    for index, run in enumerate(configured.campaign.runs):
        job = of_run[index]
        about: Mapping[str, Any] = {}
        state, reason = "to do", job.reason
        if job.reason:
            state = "failed"
        elif job.key in done:
            try:
                about, state = store.about(job.key), "done"
            except AqualogError as error:
                state, reason = "failed", error.line()
        elif job.key in failed:
            state, reason = "failed", store.failure(job.key)
        name = _name(configured, run.logs)
        runs.append(_run_row(index, name, job, run.vehicle.stem, run.values, run.lane, state, reason, about))
        events += [_event_row(index, name, job.key, e) for e in about.get("events", [])]
        logs.append({"run": index, "log": name, "state": state, "reason": reason, "key": job.key,
                     "truncated": about.get("quality", {}).get("truncated", False)})  # fmt: skip
    extra = sorted({k for r in configured.campaign.runs for k in r.values if k.startswith("x_")})
    store.write_table("runs.parquet", pl.DataFrame(runs, schema=_run_schema(extra), strict=False))
    store.write_table("events.parquet", pl.DataFrame(events, schema=_EVENT, strict=False))
    states = [x["state"] for x in logs]
    store.write_json(
        "manifest.json",
        {
            "schema_version": 1, "tool_version": __version__, "code": code_stamp(),
            "campaign": configured.campaign.name, "states": {s: states.count(s) for s in dict.fromkeys(states)},
            "logs": logs,
        },
    )  # fmt: skip


def _name(configured: Configured, logs: Sequence[Any]) -> str:
    base = configured.campaign.path.parent
    return "; ".join(str(p.relative_to(base)) if p.is_relative_to(base) else str(p) for p in logs)


def _run_schema(extra: Sequence[str]) -> dict[str, Any]:
    return {
        "run": pl.Int64, "name": pl.String, "key": pl.String, "state": pl.String, "reason": pl.String,
        "vehicle": pl.String, **dict.fromkeys(TEXTS, pl.String), **dict.fromkeys(NUMBERS, pl.Float64),
        **dict.fromkeys(extra, pl.String), "start_ns": pl.Int64, "duration_s": pl.Float64, "distance_m": pl.Float64,
        "v_min_kmh": pl.Float64, "v_max_kmh": pl.Float64, "sample_rate_hz": pl.Float64, "slip_against": pl.String,
        "traction": pl.String, **{f"events_{d}": pl.Int64 for d in DETECTORS}, "unavailable": pl.String,
        "truncated": pl.Boolean, **dict.fromkeys(_QUALITY, pl.Int64), "notes": pl.String,
    }  # fmt: skip


def _run_row(
    index: int,
    name: str,
    job: Job,
    vehicle: str,
    values: Mapping[str, Any],
    lane: tuple[float, float] | None,
    state: str,
    reason: str,
    about: Mapping[str, Any],
) -> dict[str, Any]:
    row: dict[str, Any] = {
        "run": index, "name": name, "key": job.key, "state": state, "reason": reason, "vehicle": vehicle, **values
    }  # fmt: skip
    if lane is not None:
        row |= {"lane_start_s": lane[0], "lane_end_s": lane[1]}
    if not about:
        return row
    row |= {n: about[n] for n in ("start_ns", "duration_s", "distance_m", "sample_rate_hz", "slip_against", "traction")}
    row |= {f"{n}_kmh": None if about[n] is None else 3.6 * about[n] for n in ("v_min", "v_max")}
    found = [e["detector"] for e in about["events"]]
    row |= {f"events_{d}": None if d in about["unavailable"] else found.count(d) for d in DETECTORS}
    row["unavailable"] = ", ".join(about["unavailable"])
    # results of before do not count every fault
    row |= {n: about["quality"].get(n, 0) for n in _QUALITY}
    row |= {n: about["quality"][n] for n in ("truncated", "unfinalised")}
    row["notes"] = "\n".join(about["notes"])
    return row


def _event_row(index: int, name: str, key: str, event: Mapping[str, Any]) -> dict[str, Any]:
    evidence = event["evidence"]
    row = {n: event[n] for n in _EVENT if n in event}
    decided = evidence.get("decided_by")
    return row | {
        "run": index, "name": name, "key": key, "v_x": evidence.get("v_x"), "slip_min": evidence.get("slip_min"),
        "decided_by": ", ".join(decided) if decided else None,
    }  # fmt: skip
