"""Commands on campaigns: many drives in known configurations."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from aqualog.cli.frame import Output, Run, command

if TYPE_CHECKING:
    from aqualog.cli.console import Heard
    from aqualog.face.campaign_runs import BinnedResistance, BinnedSlopes, CampaignRuns

__all__ = ["batch", "bin_resistance", "bin_slipslope", "campaign_app", "init", "plan", "report"]

# half of what a worker imports, and the machine code of that
_AHEAD = ("aqualog.detect.stream", "aqualog.io.mdf.reader", "aqualog.align.lines", "aqualog.campaign.ahead")

campaign_app = typer.Typer(
    help="Campaign files: many drives in known configurations.", no_args_is_help=True, rich_markup_mode=None
)


@campaign_app.callback()
def _campaign() -> None:
    """Campaign files: many drives in known configurations."""


@campaign_app.command(no_args_is_help=True)
@command("folder out:campaign vehicle:proposed dbc data force")
def init(run: Run, folder: Path, out: Path) -> Output:
    """Propose a campaign file for a folder of logs.

    Looks at every log in the folder and below it, puts together files of one drive, reads tyre, pressure, water depth,
    speed and so on from the names, and finds out which channel is which signal. Written beside the campaign file:
    runs.csv (a line per drive), map.toml (where channels have names of their own) and vehicle.toml (to be filled in).
    Everything in them is a guess from names, units and data, printed with its rule: read it before you use it.

    \b
    Examples:
      aqualog campaign init measurements
      aqualog campaign init measurements -o wet2024/campaign.toml --vehicle car.toml
      aqualog campaign init can_logs --dbc car.dbc
    """
    from aqualog.face.campaign import Campaign

    with run.hearing() as hear:
        found = Campaign.propose(folder, out, vehicle=run.vehicle, dbc=run.dbc, force=run.force, progress=hear)
    return Output(found, found.notes, files={out.parent / n: write for n, write in found.files().items()})


@command(
    "logs:campaign store:out vehicle:of_logs signals dbc thresholds jobs limit_s limit_mb shard cluster data force"
)
def batch(run: Run, limit_s: float | None, limit_mb: int | None, shard: str | None, cluster: str | None) -> Output:
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
    if cluster is None and run.jobs != 1:
        from aqualog.guard.worker import share_imports

        share_imports(_AHEAD)
    campaign = run.campaign()
    runs = run.measured(campaign, force=run.force, shard=shard, cluster=cluster, limit_s=limit_s, limit_mb=limit_mb)
    if not runs.data.runs and runs.shard is not None:  # a matrix may have more jobs than there are logs
        return Output(notes=[f"shard {runs.shard.index} of {runs.shard.count} has no log"])
    return run.of_runs(runs, result=runs, notes=runs.notes)


@command("logs:campaign store jobs sample within vehicle:of_logs signals dbc thresholds data force")
def plan(run: Run, sample: int | None, within: str | None) -> Output:
    """Estimate what `aqualog batch` on a campaign will cost: time, memory, room in the store, shards.

    A few logs of every format, from the smallest to the largest, are measured in processes as the batch has them, into
    a store that is thrown away. What is in the campaign's store already is not counted. The interval (90 %) is from how
    the sample scatters; it knows nothing of a machine that is busier later. -v lists the sample.

    \b
    Examples:
      aqualog plan campaign.toml
      aqualog plan campaign.toml --jobs 16 --sample 32 --within 1h
      aqualog plan logs/*.mf4 --vehicle car.toml --store results --json
    """
    campaign = run.campaign()
    with run.hearing() as hear:
        found = campaign.plan(jobs=run.jobs, sample=sample, within=within, progress=hear)
    details = [
        f"  {', '.join(p.name for p in t.logs)}: {t.size / 1e6:.1f} MB, {t.wall_s:.2f} s, {t.cpu_s:.2f} s computing "
        f"{t.reason}"
        for t in (found.trial.tried if found.trial else ())
    ]
    return Output(found, found.notes, details)


@command("logs:campaign by width road robust store vehicle:of_logs signals dbc table jobs data force")
def bin_slipslope(run: Run, by: str, width: float, road: str, robust: bool, table: Path | None) -> Output:
    """Slip slope over speed for each configuration, and the speed of full aquaplaning.

    Slip is regressed on traction in bins of speed; the 95 % intervals treat a run, not a sample, as the unit, and are
    given with three runs or more. Beside each slope: the contact that is left against dry road, and what the model
    expects. Logs that have no results yet are run first, as `aqualog batch` does. The delay of v_x is estimated and
    taken off. --by side puts the wheels of a side together.

    JSON: rows, dry, delays, full_aquaplaning (from slopes, minor and full spin-downs, margin), spin_ups,
    minor_spin_downs.

    \b
    Examples:
      aqualog bin-slipslope campaign.toml
      aqualog bin-slipslope campaign.toml --by tyre,pressure --road both
      aqualog bin-slipslope campaign.toml --by water-depth,side --bin-width 20 --robust
      aqualog bin-slipslope campaign.toml --json | jq '.full_aquaplaning[] | select(.v_full_kmh)'
      aqualog bin-slipslope campaign.toml --store results -o slopes.csv
    """

    def find(runs: CampaignRuns, hear: Heard) -> BinnedSlopes:
        return runs.slip_slope(by, bin_width=width, road=road, robust=robust, progress=hear)

    return _binned(run, find, by, width, road, table)


@command("logs:campaign by width road robust as_measured store vehicle:of_logs signals dbc table jobs data force")
def bin_resistance(
    run: Run, by: str, width: float, road: str, robust: bool, table: Path | None, as_measured: bool
) -> Output:
    """Mean resistance measure over speed for each configuration.

    The acceleration that the torques should give less the one that is measured, less the run's own level on dry road
    before the lane (at least a second of it). The 95 % intervals treat a run, not a sample, as the unit, and are given
    with three runs or more. Logs that have no results yet are run first, as `aqualog batch` does.

    \b
    Examples:
      aqualog bin-resistance campaign.toml
      aqualog bin-resistance campaign.toml --by tyre,water-depth --json
      aqualog bin-resistance campaign.toml --by load --bin-width 20 --robust -o resistance.csv
      aqualog bin-resistance campaign.toml --road both --as-measured
    """

    def find(runs: CampaignRuns, hear: Heard) -> BinnedResistance:
        return runs.resistance(by, bin_width=width, road=road, robust=robust, as_measured=as_measured, progress=hear)

    return _binned(run, find, by, width, road, table)


def _binned(
    run: Run,
    find: Callable[[CampaignRuns, Heard], BinnedSlopes | BinnedResistance],
    by: str,
    width: float,
    road: str,
    table: Path | None,
) -> Output:
    """Bring the campaign up to date and find what is asked for, if any of its logs gives a result."""
    from aqualog.face.campaign_runs import check_table

    if table is not None:
        check_table(table)
    campaign = run.campaign()
    campaign.check_bins(by, bin_width=width, road=road)
    campaign.check_targets([table] if table is not None else [], force=run.force)
    runs = run.measured(campaign)
    if not runs.outcome.done:
        return run.of_runs(runs)
    with run.hearing() as hear:
        found = find(runs, hear)
    kinds = {Path(name).suffix: write for name, write in found.files().items()}
    files = {} if table is None else {table: kinds[table.suffix.lower()]}
    return run.of_runs(runs, result=found, notes=[*found.notes, *(f"the table is {p}" for p in files)], files=files)


@command("campaign:file out:report by width robust store dbc jobs force")
def report(run: Run, campaign: str, out: Path | None, by: str, width: float, robust: bool) -> Output:
    """Make the page of a campaign: quality, test matrix, slip slope and resistance over speed, detections, all runs.

    Logs that are new or have changed are measured first, as `aqualog batch` does. The folder opens without a network:
    index.html, a page per run (runs/), the tables (data/*.csv), one plotly.min.js for all. An earlier report in the
    folder is replaced; --force writes beside other files.

    \b
    Examples:
      aqualog report campaign.toml
      aqualog report campaign.toml -o report --by tyre,pressure,depth,manoeuvre
      aqualog report campaign.toml --robust --bin-width 5 --store results
      aqualog report can_campaign.toml --dbc car.dbc
    """
    from aqualog.core.errors import ConfigError

    began = time.monotonic()
    if not campaign.lower().endswith(".toml"):
        raise ConfigError(
            "is no campaign file", where=campaign, expected="a campaign file (TOML)",
            hint=f"aqualog detect {campaign} -o DIR for the page of one drive",
        )  # fmt: skip
    opened = run.campaign([campaign])
    folder = out if out is not None else opened.configured.campaign.path.with_suffix(".report")
    opened.check_report(folder, force=run.force)
    opened.check_bins(by, bin_width=width)
    runs = run.measured(opened)
    with run.hearing() as hear:
        page = runs.report(folder, by=by, bin_width=width, robust=robust, force=True, progress=hear)
    files = sum(p.is_file() for p in page.parent.rglob("*"))
    # the first note says where the results are, the others what is missing
    return run.of_runs(runs, notes=[*runs.notes[1:], f"{page}: {files} files, {time.monotonic() - began:.0f} s"])
