"""What a batch will cost, from a sample of its logs."""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ConfigError, FitError
from aqualog.face.arguments import whole_number
from aqualog.face.listener import Progress, listener
from aqualog.face.progress import Progress as Counted
from aqualog.face.progress import lasting
from aqualog.face.result import Result, Writers, text_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.campaign.place import Address
    from aqualog.campaign.plan import BatchCost, Estimate, Plan, Work
    from aqualog.campaign.store import Store
    from aqualog.face.campaign import Campaign

__all__ = ["BatchPlan", "plan"]

_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}


@dataclass(frozen=True, eq=False, repr=False)
class BatchPlan(Result):
    """Expected time, memory and room of a batch; `estimate` and `trial` are None where nothing is left to measure."""

    campaign: Campaign
    work: Work
    store: Store
    trial: BatchCost | None = None
    estimate: Plan | None = None
    processes: int = 1
    within: str | None = None
    parts: tuple[int, float] | None = None

    @property
    def notes(self) -> tuple[str, ...]:  # type: ignore[override]
        """Remarks on the estimate, and logs that are missing."""
        return (*(self.estimate.notes if self.estimate else ()), *self.work.missing[:10])

    @property
    def has_loss(self) -> bool:  # type: ignore[override]
        """Whether a log is missing."""
        return bool(self.work.missing)

    @property
    def sources(self) -> tuple[Path, ...]:  # type: ignore[override]
        """All files that the campaign reads."""
        return self.campaign.sources

    @cached_property
    def document(self) -> dict[str, Any]:
        """The JSON document of `aqualog plan`."""
        if self.trial is None or self.estimate is None:
            return _left(self.work)
        seconds = None if self.within is None else _seconds(self.within)
        return _document(self.work, self.trial, self.estimate, self.processes, self.store, seconds, self.parts)

    def text(self) -> str:
        """Return the table that the command prints."""
        if self.trial is None or self.estimate is None:
            kept = f"{self.work.kept} logs are in {self.store.name}"
            return f"nothing to measure: {kept}, {self.work.failed} failed before\n"
        return _text(self.work, self.trial, self.estimate, self.document, self.within, self.parts)

    def headline(self) -> str:
        """Return logs to measure and the expected time."""
        return "\n".join(self.text().split("\n")[:6])

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`sample`: a row for each log that was measured."""
        import polars as pl

        return {"sample": pl.DataFrame(self.document.get("sample", []), infer_schema_length=None)}

    def plot(self) -> go.Figure:
        """Return time over size of the sample's logs."""
        import plotly.graph_objects as go

        rows = self.document.get("sample", [])
        made = go.Figure()
        for kind in dict.fromkeys(r["format"] for r in rows):
            own = [r for r in rows if r["format"] == kind]
            made.add_scatter(
                x=[r["bytes"] / 1e6 for r in own], y=[r["wall_s"] for r in own], name=kind, mode="markers",
                text=[r["log"] for r in own],
            )  # fmt: skip
        made.update_layout(title=self.campaign.name, template="plotly_white")
        made.update_xaxes(title="size [MB]")
        made.update_yaxes(title="time of a log [s]")
        return made

    def files(self) -> Writers:
        """Return `plan.json` and `plan.txt`."""
        return {"plan.json": self._json_file(), "plan.txt": text_file(self.text)}


def plan(
    campaign: Campaign,
    *,
    jobs: int | None = None,
    sample: int | None = None,
    within: str | None = None,
    progress: Progress = None,
) -> BatchPlan:
    """Measure a sample of the logs and estimate what the batch costs; see `Campaign.plan`."""
    import os

    began, began_cpu = time.monotonic(), time.process_time()
    seconds = _seconds(within) if within is not None else None
    hear = listener(progress)
    from aqualog.campaign.plan import choose, foretell, measure_cost, shards_within, work_of
    from aqualog.campaign.store import Store
    from aqualog.guard.worker import most_processes

    place = Store(campaign.store)
    place.check()
    hear("looking at the logs")
    lead_cpu_s = time.process_time()
    # the interpreter's own start has no clock; it is taken to be as slow as what came behind it
    lead_s = (time.monotonic() - began) * lead_cpu_s / max(lead_cpu_s - began_cpu, 1e-3)
    work = work_of(campaign.configured, place)
    cores = os.cpu_count() or 1
    if jobs is not None:
        jobs = whole_number(jobs, "jobs", 1, 1024)
    processes = max(1, min(jobs or cores, most_processes(), len(work.new)))
    chosen = choose(work.new, sample or max(8, 2 * min(processes, cores)))
    if not chosen:
        if work.new or not work.kept:
            raise FitError("no log can be measured", where=campaign.inputs[0], expected="logs that exist")
        return BatchPlan(campaign, work, place, within=within)
    trial = measure_cost(
        campaign.configured, chosen, processes=min(processes, cores, len(chosen)),
        reporter=lambda: Counted(hear, "logs"),
        told=lambda: hear.note("the detectors were compiled, once after an installation; the sample is measured again"),
    )  # fmt: skip
    failed = [t for t in trial.tried if t.reason]
    if len(failed) == len(trial.tried):
        raise FitError(
            f"none of {len(failed)} logs of the sample gives a result: {failed[0].reason}",
            hint="`aqualog inspect CAMPAIGN`, or a larger sample",
        )
    found = foretell(work, trial, processes=processes, cores=cores, lead_s=lead_s, lead_cpu_s=lead_cpu_s)
    parts = shards_within(campaign.configured, work, found, seconds) if seconds is not None else None
    return BatchPlan(campaign, work, place, trial, found, processes, within, parts)


def _seconds(text: str) -> float:
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*(s|min|h|d)", text.strip())
    if match is None or float(match[1]) <= 0.0:
        raise ConfigError(f"within {text}", expected="a time: 90s, 30min, 8h or 2d")
    return float(match[1]) * _UNITS[match[2]]


def _left(work: Work) -> dict[str, Any]:
    from aqualog import __version__

    logs = {"to_measure": len(work.new), "kept": work.kept, "failed_before": work.failed, "missing": len(work.missing)}
    return {"schema_version": 1, "tool_version": __version__, "logs": logs}


def _document(
    work: Work, trial: BatchCost, found: Plan, processes: int, store: Store, within_s: float | None,
    parts: tuple[int, float] | None,
) -> dict[str, Any]:  # fmt: skip
    from aqualog.campaign.plan import peak_memory

    worker = found.worker
    # one process beside the workers leads; without workers it is the one that works
    all_bytes = processes * trial.peak_bytes + (peak_memory() if processes > 1 else 0)
    return {
        **_left(work),
        "bytes": int(found.sizes.sum()),
        "formats": dict(Counter(f for _, f, _ in work.new)),
        "processes": processes,
        "at_a_time": found.together,
        "wall_s": _three(found.wall_s),
        "cpu_s": _three(found.cpu_s),
        "parts_s": {
            "lead": round(worker.lead_s, 3),
            "start_of_a_process": round(worker.start_s, 3),
            "hashing": round(found.hashing_s, 3),
            "logs": _three(found.logs_s),
            "tables": round(found.tables_s, 3),
        },
        "memory": {"process_bytes": trial.peak_bytes, "all_bytes": all_bytes, "there_bytes": _memory()},
        "store": {
            "folder": store.name,
            "bytes": _three(found.store_bytes, digits=0),
            "free_bytes": _free(store.address),
        },
        "within": None if within_s is None else {
            "seconds": within_s, "shards": parts[0] if parts else None,
            "longest_s": round(parts[1], 1) if parts else None,
        },
        "sample": [
            {
                "log": ", ".join(map(str, t.logs)), "format": t.format, "bytes": t.size, "wall_s": round(t.wall_s, 4),
                "cpu_s": round(t.cpu_s, 4), "store_bytes": t.store_bytes, "reason": t.reason or None,
            }
            for t in trial.tried
        ],
        "notes": list(found.notes),
    }  # fmt: skip


def _three(x: Estimate, digits: int = 3) -> dict[str, float]:
    return {"value": round(x.value, digits), "low": round(x.low, digits), "high": round(x.high, digits)}


def _memory() -> int | None:
    """Memory of this machine; None where the system does not say. [byte]"""
    import os

    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None


def _free(store: Address) -> int | None:
    """Room on the disk of a folder, which need not exist yet; None behind a URL. [byte]"""
    import shutil

    if isinstance(store, str):
        return None
    return shutil.disk_usage(next(p for p in (store, *store.absolute().parents) if p.is_dir())).free


def _text(
    work: Work,
    trial: BatchCost,
    found: Plan,
    document: dict[str, Any],
    within: str | None,
    parts: tuple[int, float] | None,
) -> str:
    from aqualog.report.text import table

    def times(x: Estimate) -> tuple[str, str]:
        return lasting(x.value), f"{lasting(x.low)} to {lasting(x.high)}"

    formats = ", ".join(f"{n} {f}" for f, n in document["formats"].items())
    head = f"{len(work.new)} logs to measure ({formats}; {_room(found.sizes.sum())}), {work.kept} are in the store"
    more = [(work.failed, "failed before"), (len(work.missing), "missing")]
    head += "".join(f", {n} {what}" for n, what in more if n)
    memory, store, worker = document["memory"], document["store"], found.worker
    processes = document["processes"]
    at_a_time = f", {found.together} at a time" if found.together < processes else ""
    there = f"of {_room(memory['there_bytes'])}" if memory["there_bytes"] else ""
    room = found.store_bytes
    free = "" if store["free_bytes"] is None else f"; {_room(store['free_bytes'])} free"
    rows = [
        (f"wall time, {processes} process{'es' if processes > 1 else ''}{at_a_time}", *times(found.wall_s)),
        ("  start of each process", f"{worker.start_s:.1f} s", ""),
        ("  hashing the logs", lasting(found.hashing_s), ""),
        ("  tables", lasting(found.tables_s), ""),
        ("computing time", *times(found.cpu_s)),
        ("memory of a process", _room(memory["process_bytes"]), ""),
        ("memory of all, at most", _room(memory["all_bytes"]), there),
        ("store", _room(room.value), f"{_room(room.low)} to {_room(room.high)}{free}"),
    ]
    sample = f"sample: {len(trial.tried)} logs, {trial.processes} at a time"
    text = f"{head}\n{sample}\n\n{table(('', 'expected', '90 %'), rows)}\n"
    if within is None:
        return text
    if parts is None:
        alone = f"a process starts in {lasting(worker.start_s)}, the longest log takes {lasting(found.seconds.max())}"
        return f"{text}\nwithin {within}: no number of shards is enough: {alone}\n"
    return f"{text}\nwithin {within}: {parts[0]} shard{'s' if parts[0] > 1 else ''} (longest {lasting(parts[1])})\n"


def _room(size: float) -> str:
    for unit, factor in (("GB", 1e9), ("MB", 1e6)):
        if size >= factor:
            return f"{size / factor:.1f} {unit}"
    return f"{size / 1e3:.0f} kB"
