"""`aqualog plan`."""

from __future__ import annotations

import json
import re
import sys
import time
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aqualog.cli.options import (
    CarOfLogs,
    Dbc,
    Debug,
    Inputs,
    Jobs,
    Json,
    Progress,
    Quiet,
    Signals,
    StoreOption,
    Thresholds,
    Verbose,
)  # fmt: skip

if TYPE_CHECKING:
    from aqualog.campaign.place import Address
    from aqualog.campaign.plan import Estimate, Plan, Work
    from aqualog.campaign.store import Store
    from aqualog.campaign.trial import Trial
    from aqualog.cli.console import Console

__all__ = ["plan"]

_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}


def plan(
    inputs: Inputs,
    store: StoreOption = None,
    jobs: Jobs = None,
    sample: Annotated[
        int | None,
        typer.Option("--sample", help="Logs to measure; default 8, or 2 per process.", min=2, max=1000, metavar="K"),
    ] = None,
    within: Annotated[
        str | None,
        typer.Option(
            "--within", help="Report how many --shard are done in that time: 90s, 30min, 8h, 2d.", metavar="TIME"
        ),
    ] = None,
    vehicle: CarOfLogs = None,
    signals: Signals = None,
    dbc: Dbc = None,
    thresholds: Thresholds = None,
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
    """Estimate what `aqualog batch` on a campaign will cost: time, memory, room in the store, shards.

    A few logs of every format, from the smallest to the largest, are measured in processes as the batch has them, into
    a store that is thrown away. What is in the campaign's store already is not counted. The interval (90 %) is from how
    the sample scatters; it knows nothing of a machine that is busier later. -v lists the sample.

    \b
    Examples:
      aqualog plan campaign.toml
      aqualog plan campaign.toml --jobs 16 --sample 32 --within 1h
      aqualog plan logs/*.mf4 --vehicle car.toml --store results --json
    """  # fmt: skip
    from aqualog.cli.console import Console, guarded

    with guarded(debug=debug):
        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        code = _plan(inputs, store, jobs, sample, within, vehicle, signals, dbc or [], thresholds, console, as_json)
    if code:
        raise typer.Exit(code)


def _plan(
    inputs: list[str],
    out: str | None,
    jobs: int | None,
    count: int | None,
    within: str | None,
    vehicle: Path | None,
    map_file: Path | None,
    dbc: list[Path],
    thresholds: Path | None,
    console: Console,
    as_json: bool,
) -> int:
    import os

    from aqualog.cli.campaign_results import opened, store_of
    from aqualog.cli.console import clean
    from aqualog.errors import ExitCode, FitError

    began, began_cpu = time.monotonic(), time.process_time()
    seconds = _seconds(within) if within is not None else None
    configured = opened(inputs, vehicle=vehicle, map_file=map_file, dbc=dbc, thresholds=thresholds)
    with console.steps() as steps:
        from aqualog.campaign.plan import choose, foretell, shards_within, work_of
        from aqualog.campaign.store import Store
        from aqualog.campaign.trial import tried
        from aqualog.face.progress import Progress as Counted
        from aqualog.workers import most_processes

        place = Store(store_of(configured, out))
        place.check()
        steps("looking at the logs")
        lead_cpu_s = time.process_time()
        # the interpreter's own start has no clock; it is taken to be as slow as what came behind it
        lead_s = (time.monotonic() - began) * lead_cpu_s / max(lead_cpu_s - began_cpu, 1e-3)
        work = work_of(configured, place)
        cores = os.cpu_count() or 1
        processes = max(1, min(jobs or cores, most_processes(), len(work.new)))
        chosen = choose(work.new, count or max(8, 2 * min(processes, cores)))
        found = None
        if chosen:

            def told() -> None:
                steps.clear()
                console.note("the detectors were compiled, once after an installation; the sample is measured again")

            trial = tried(
                configured, chosen, processes=min(processes, cores, len(chosen)),
                reporter=lambda: Counted(steps, "logs"), told=told,
            )  # fmt: skip
            failed = [t for t in trial.tried if t.reason]
            if len(failed) == len(trial.tried):
                raise FitError(
                    f"none of {len(failed)} logs of the sample gives anything: {failed[0].reason}",
                    hint="`aqualog inspect CAMPAIGN`, or a larger --sample",
                )
            found = foretell(work, trial, processes=processes, cores=cores, lead_s=lead_s, lead_cpu_s=lead_cpu_s)
    if found is None:
        if work.new or not work.kept:
            raise FitError("no log can be measured", where=inputs[0], expected="logs that are there")
        sys.stdout.write(_nothing(work, place) if not as_json else json.dumps(_left(work), indent=1) + "\n")
        return int(ExitCode.PARTIAL if work.missing else ExitCode.DONE)
    parts = shards_within(configured, work, found, seconds) if seconds is not None else None
    document = _document(work, trial, found, processes, place, seconds, parts)
    if as_json:
        sys.stdout.write(json.dumps(document, indent=1, allow_nan=False) + "\n")
    else:
        sys.stdout.write(clean(_text(work, trial, found, document, within, parts)))
    for line in (*found.notes, *work.missing[:10]):
        console.note(line)
    for t in trial.tried:
        name = ", ".join(p.name for p in t.logs)
        console.detail(f"  {name}: {t.size / 1e6:.1f} MB, {t.wall_s:.2f} s, {t.cpu_s:.2f} s computing {t.reason}")
    return int(ExitCode.PARTIAL if work.missing else ExitCode.DONE)


def _seconds(text: str) -> float:
    from aqualog.errors import ConfigError

    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*(s|min|h|d)", text.strip())
    if match is None or float(match[1]) <= 0.0:
        raise ConfigError(f"--within {text}", expected="a time: 90s, 30min, 8h or 2d")
    return float(match[1]) * _UNITS[match[2]]


def _left(work: Work) -> dict[str, Any]:
    from aqualog import __version__

    logs = {"to_measure": len(work.new), "kept": work.kept, "failed_before": work.failed, "missing": len(work.missing)}
    return {"schema_version": 1, "tool_version": __version__, "logs": logs}


def _document(
    work: Work, trial: Trial, found: Plan, processes: int, store: Store, within_s: float | None,
    parts: tuple[int, float] | None,
) -> dict[str, Any]:  # fmt: skip
    from aqualog.campaign.trial import peak_memory

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
    """Memory of this machine; None where the system does not tell. [byte]"""
    import os

    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None


def _free(store: Address) -> int | None:
    """Room on the disk of a folder, which need not be there yet; None behind a URL. [byte]"""
    import shutil

    if isinstance(store, str):
        return None
    return shutil.disk_usage(next(p for p in (store, *store.absolute().parents) if p.is_dir())).free


def _nothing(work: Work, store: Store) -> str:
    return f"nothing to measure: {work.kept} logs are in {store.name}, {work.failed} failed before\n"


def _text(
    work: Work, trial: Trial, found: Plan, document: dict[str, Any], within: str | None, parts: tuple[int, float] | None
) -> str:
    from aqualog.face.progress import lasting
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
