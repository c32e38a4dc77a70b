"""`aqualog batch`."""

from __future__ import annotations

from typing import Annotated

import typer

from aqualog.cli.frame import Output, Run, command

__all__ = ["batch"]


@command(
    "logs:campaign store:out vehicle:of_logs signals dbc thresholds jobs limit_s limit_mb shard cluster json force"
)
def batch(
    run: Run,
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
) -> Output:
    """Run every log of a campaign through the detectors and keep the results.

    Only what is new is done: a log is measured again when its content, its vehicle, the signal map, the thresholds or
    aqualog's own equations have changed. A log that cannot be read is reported and the others go on. An interrupt or a
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
    """
    campaign = run.campaign()
    runs = run.measured(campaign, force=run.force, shard=shard, cluster=cluster, limit_s=limit_s, limit_mb=limit_mb)
    if not runs.data.runs and runs.shard is not None:  # a matrix may have more jobs than there are logs
        return Output(notes=[f"shard {runs.shard.index} of {runs.shard.count} has no log"])
    return run.of_runs(runs, result=runs, notes=runs.notes)
