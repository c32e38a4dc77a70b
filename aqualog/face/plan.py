"""What a batch will cost, from a sample of its logs."""

from __future__ import annotations

import os
import re
import shutil
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ConfigError, FitError
from aqualog.face.arguments import whole_number
from aqualog.face.listener import Counted, Progress, lasting, listener
from aqualog.face.result import Result, Writers, document_head, rows_table, text_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.campaign.place import Address
    from aqualog.campaign.plan import BatchCost, Estimate, Plan, Work
    from aqualog.campaign.store import Store
    from aqualog.face.campaign_inputs import CampaignInputs

__all__ = ["BatchPlan", "plan"]

_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}


@dataclass(frozen=True, eq=False, repr=False)
class BatchPlan(Result):
    """Expected time, memory and room of a batch; `estimate` and `trial` are None where nothing is left to measure."""

    campaign: CampaignInputs
    work: Work
    store: Store
    trial: BatchCost | None = None
    estimate: Plan | None = None
    processes: int = 1
    within: str | None = None
    parts: tuple[int, float] | None = None

    @cached_property
    def document(self) -> dict[str, Any]:
        work, trial, found, parts = self.work, self.trial, self.estimate, self.parts
        logs = {
            "to_measure": len(work.new), "kept": work.kept, "failed_before": work.failed, "missing": len(work.missing),
        }  # fmt: skip
        head = {**document_head(), "logs": logs}
        if trial is None or found is None:
            return head
        from aqualog.campaign.plan import peak_memory
        from aqualog.guard.system import machine_memory

        # one process beside the workers leads; without workers it is the one that works
        all_bytes = self.processes * trial.peak_bytes + (peak_memory() if self.processes > 1 else 0)
        return {
            **head,
            "bytes": int(found.sizes.sum()),
            "formats": dict(Counter(f for _, f, _ in work.new)),
            "processes": self.processes,
            "at_a_time": found.together,
            "wall_s": _three(found.wall_s),
            "cpu_s": _three(found.cpu_s),
            "parts_s": {
                "lead": round(found.worker.lead_s, 3),
                "start_of_a_process": round(found.worker.start_s, 3),
                "hashing": round(found.hashing_s, 3),
                "logs": _three(found.logs_s),
                "tables": round(found.tables_s, 3),
            },
            "memory": {
                "process_bytes": trial.peak_bytes, "all_bytes": all_bytes, "there_bytes": machine_memory() or None,
            },
            "store": {
                "folder": self.store.name,
                "bytes": _three(found.store_bytes, digits=0),
                "free_bytes": _free(self.store.address),
            },
            "within": None if self.within is None else {
                "seconds": _seconds(self.within), "shards": parts[0] if parts else None,
                "longest_s": round(parts[1], 1) if parts else None,
            },
            "sample": [
                {
                    "log": ", ".join(map(str, t.logs)), "format": t.format, "bytes": t.size,
                    "wall_s": round(t.wall_s, 4), "cpu_s": round(t.cpu_s, 4), "store_bytes": t.store_bytes,
                    "reason": t.reason or None,
                }
                for t in trial.tried
            ],
            "notes": list(found.notes),
        }  # fmt: skip

    def text(self) -> str:
        from aqualog.guard.system import bytes_text
        from aqualog.report.text import table

        work, trial, found, document = self.work, self.trial, self.estimate, self.document
        if trial is None or found is None:
            return f"nothing to measure: {work.kept} logs are in {self.store.name}, {work.failed} failed before\n"

        def size(x: float) -> str:
            return bytes_text(int(x))

        def times(x: Estimate) -> tuple[str, str]:
            return lasting(x.value), f"{lasting(x.low)} to {lasting(x.high)}"

        formats = ", ".join(f"{n} {f}" for f, n in document["formats"].items())
        head = f"{len(work.new)} logs to measure ({formats}; {size(found.sizes.sum())}), {work.kept} are in the store"
        more = [(work.failed, "failed before"), (len(work.missing), "missing")]
        head += "".join(f", {n} {what}" for n, what in more if n)
        memory, store, processes = document["memory"], document["store"], self.processes
        at_a_time = f", {found.together} at a time" if found.together < processes else ""
        room = found.store_bytes
        free = "" if store["free_bytes"] is None else f"; {size(store['free_bytes'])} free"
        rows = [
            (f"wall time, {processes} process{'es' if processes > 1 else ''}{at_a_time}", *times(found.wall_s)),
            ("  start of each process", f"{found.worker.start_s:.1f} s", ""),
            ("  hashing the logs", lasting(found.hashing_s), ""),
            ("  tables", lasting(found.tables_s), ""),
            ("computing time", *times(found.cpu_s)),
            ("memory of a process", size(memory["process_bytes"]), ""),
            ("memory of all, at most", size(memory["all_bytes"]),
             f"of {size(memory['there_bytes'])}" if memory["there_bytes"] else ""),
            ("store", size(room.value), f"{size(room.low)} to {size(room.high)}{free}"),
        ]  # fmt: skip
        sample = f"sample: {len(trial.tried)} logs, {trial.processes} at a time"
        text = f"{head}\n{sample}\n\n{table(('', 'expected', '90 %'), rows)}\n"
        if self.within is None:
            return text
        if self.parts is None:
            start, longest = lasting(found.worker.start_s), lasting(found.seconds.max())
            alone = f"a process starts in {start}, the longest log takes {longest}"
            return f"{text}\nwithin {self.within}: no number of shards is enough: {alone}\n"
        n, longest_s = self.parts
        return f"{text}\nwithin {self.within}: {n} shard{'s' if n > 1 else ''} (longest {lasting(longest_s)})\n"

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`sample`: a row for each log that was measured."""
        return {"sample": rows_table(self.document.get("sample", []))}

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
    campaign: CampaignInputs,
    *,
    jobs: int | None = None,
    sample: int | None = None,
    within: str | None = None,
    progress: Progress = None,
) -> BatchPlan:
    """Measure a sample of the logs and estimate what the batch costs; see `Campaign.plan`."""
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
    missing = tuple(work.missing[:10])
    common: dict[str, Any] = {"notes": missing, "has_loss": bool(work.missing), "sources": campaign.sources}
    cores = os.cpu_count() or 1
    if jobs is not None:
        jobs = whole_number(jobs, "jobs", 1, 1024)
    processes = max(1, min(jobs or cores, most_processes(), len(work.new)))
    chosen = choose(work.new, sample or max(8, 2 * min(processes, cores)))
    if not chosen:
        if work.new or not work.kept:
            raise FitError("no log can be measured", where=campaign.inputs[0], expected="logs that exist")
        return BatchPlan(campaign, work, place, within=within, **common)
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
    common["notes"] = (*found.notes, *missing)
    return BatchPlan(campaign, work, place, trial, found, processes, within, parts, **common)


def _seconds(text: str) -> float:
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*(s|min|h|d)", text.strip())
    if match is None or float(match[1]) <= 0.0:
        raise ConfigError(f"within {text}", expected="a time: 90s, 30min, 8h or 2d")
    return float(match[1]) * _UNITS[match[2]]


def _three(x: Estimate, digits: int = 3) -> dict[str, float]:
    return {"value": round(x.value, digits), "low": round(x.low, digits), "high": round(x.high, digits)}


def _free(store: Address) -> int | None:
    """Room on the disk of a folder, which need not exist yet; None behind a URL. [byte]"""
    if isinstance(store, str):
        return None
    return shutil.disk_usage(next(p for p in (store, *store.absolute().parents) if p.is_dir())).free
