"""`aqualog batch`."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from aqualog.cli.options import (
    CarOfLogs,
    Dbc,
    Debug,
    Force,
    Inputs,
    Jobs,
    Json,
    Progress,
    Quiet,
    Signals,
    Thresholds,
    Verbose,
)  # fmt: skip

if TYPE_CHECKING:
    from aqualog.campaign.batch import BatchOutcome
    from aqualog.campaign.samples import CampaignData
    from aqualog.campaign.shard import Shard
    from aqualog.cli.console import Console
    from aqualog.workers import Limits

__all__ = ["batch"]


def batch(
    inputs: Inputs,
    out: Annotated[
        str | None,
        typer.Option(
            "-o",
            "--out",
            "--store",
            help="Folder or URL (s3://...) for the results; default beside the campaign file: NAME.store.",
            metavar="DIR",
        ),
    ] = None,
    vehicle: CarOfLogs = None,
    signals: Signals = None,
    dbc: Dbc = None,
    thresholds: Thresholds = None,
    jobs: Jobs = None,
    limit_s: Annotated[
        float | None,
        typer.Option("--limit-s", help="Longest time for one log, in seconds.", min=1.0, max=1e9, metavar="S"),
    ] = None,
    limit_mb: Annotated[
        int | None,
        typer.Option("--limit-mb", help="Most memory for one process, in megabytes.", min=300, metavar="MB"),
    ] = None,
    shard: Annotated[
        str | None,
        typer.Option("--shard", help="Only the I-th of N parts, for N machines on one folder.", metavar="I/N"),
    ] = None,
    cluster: Annotated[
        str | None,
        typer.Option("--cluster", help="Work on the workers of this dask scheduler.", metavar="tcp://HOST:8786"),
    ] = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
    """Run every log of a campaign through the detectors and keep the results.

    Only what is new is done: a log is measured again when its content, its vehicle, the signal map, the thresholds or
    aqualog's own equations have changed. A log that cannot be read is named and the others go on; an interrupt or a
    kill loses nothing that is finished. --force measures all again. One batch at a time writes to a folder; --jobs
    makes at most four processes per core.

    The folder opens by itself: runs.parquet, events.parquet, samples/*.parquet (polars, DuckDB), manifest.json.

    \b
    Examples:
      aqualog batch campaign.toml
      aqualog batch campaign.toml -o results --jobs 8 --progress plain
      aqualog batch logs/*.mf4 --vehicle car.toml -o results --limit-s 60 --limit-mb 2000
      aqualog batch campaign.toml --shard 3/8
      aqualog batch campaign.toml --cluster tcp://scheduler:8786 -o s3://bucket/store
      duckdb -c "select tyre, avg(events_joint_criteria) from 'campaign.store/runs.parquet' group by tyre"
    """  # fmt: skip
    from aqualog.cli.console import Console, guarded

    with guarded(debug=debug):
        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        placed = _placed(limit_s, limit_mb, shard, cluster, jobs)
        code = _batch(
            inputs, out, vehicle, signals, dbc or [], thresholds, jobs, placed, as_json=as_json, force=force,
            console=console,
        )  # fmt: skip
    if code:
        raise typer.Exit(code)


def _batch(
    inputs: list[str],
    out: str | None,
    vehicle: Path | None,
    map_file: Path | None,
    dbc: list[Path],
    thresholds: Path | None,
    jobs: int | None,
    placed: Placed,
    *,
    as_json: bool,
    force: bool,
    console: Console,
) -> int:
    from dataclasses import replace

    from aqualog.campaign.shard import part_of
    from aqualog.cli.campaign_results import exit_code, opened, results, store_of

    began = time.monotonic()
    configured = opened(inputs, vehicle=vehicle, map_file=map_file, dbc=dbc, thresholds=thresholds)
    place = store_of(configured, out)
    if placed.shard is not None:
        configured = replace(configured, campaign=part_of(configured.campaign, placed.shard))
        if not configured.campaign.runs:  # a matrix may have more jobs than there are logs
            console.note(f"shard {placed.shard.index} of {placed.shard.count} has no log")
            return 0
    data, outcome = results(
        configured, place, console=console, jobs=jobs, force=force, shard=placed.shard, cluster=placed.cluster,
        limits=placed.limits,
    )  # fmt: skip
    if as_json:
        sys.stdout.write(json.dumps(_document(data, outcome), indent=1, allow_nan=False) + "\n")
    else:
        sys.stdout.write(_text(data, outcome))
    console.note(f"results are in {data.store.name}, {time.monotonic() - began:.0f} s")
    if placed.shard is not None:
        console.note("tables are made by the same command without --shard, when all parts are done")
    return exit_code(outcome, data)


class Placed(NamedTuple):
    """Where the work is done, and what one log may take."""

    limits: Limits
    shard: Shard | None
    cluster: str | None


def _placed(
    limit_s: float | None, limit_mb: int | None, shard: str | None, cluster: str | None, jobs: int | None
) -> Placed:
    from aqualog.campaign.shard import shard_of
    from aqualog.errors import ConfigError
    from aqualog.workers import Limits

    limits = Limits(limit_s, limit_mb)
    if cluster is not None:
        if jobs is not None:
            raise ConfigError("--jobs beside --cluster", expected="as many as there are workers")
        if not cluster.strip():
            raise ConfigError("--cluster is empty", expected="tcp://host:8786")
    return Placed(limits, shard_of(shard) if shard is not None else None, cluster)


def _document(data: CampaignData, outcome: BatchOutcome) -> dict[str, object]:
    from aqualog import __version__

    return {
        "schema_version": 1,
        "tool_version": __version__,
        "campaign": data.name,
        "store": data.store.name,
        "runs": len(data.runs),
        "made": outcome.made,
        "kept": outcome.kept,
        "failed": [{"log": name, "reason": reason} for name, reason in outcome.failed.items()],
        "events": {d: n for d, (n, _) in _counts(data).items()},
    }


def _counts(data: CampaignData) -> dict[str, tuple[int, int]]:
    """Per detector: its events, and the runs that have one."""
    from aqualog.detect.needs import DETECTORS

    of = {d: [sum(e["detector"] == d for e in r.events) for r in data.done] for d in DETECTORS}
    return {d: (sum(x), sum(n > 0 for n in x)) for d, x in of.items()}


def _text(data: CampaignData, outcome: BatchOutcome) -> str:
    from aqualog.report.text import table

    rows = [(d, str(n), f"{k} of {len(data.done)}") for d, (n, k) in _counts(data).items()]
    head = f"{outcome.done} logs done ({outcome.made} now, {outcome.kept} before), {len(outcome.failed)} failed"
    return f"{head}\n\n{table(('detector', 'events', 'runs with one'), rows)}\n"
