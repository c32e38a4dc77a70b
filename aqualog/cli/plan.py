"""`aqualog plan`."""

from __future__ import annotations

from typing import Annotated

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

__all__ = ["plan"]


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
    from aqualog.cli.campaigns import open_campaign
    from aqualog.cli.console import Console, guarded
    from aqualog.core.errors import ExitCode

    with guarded(debug=debug):
        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        campaign = open_campaign(inputs, vehicle=vehicle, signals=signals, dbc=dbc, thresholds=thresholds, store=store)
        with console.hearing() as hear:
            found = campaign.plan(jobs=jobs, sample=sample, within=within, progress=hear)
        console.data(found, as_json=as_json)
        for line in found.notes:
            console.note(line)
        for t in found.trial.tried if found.trial else ():
            name = ", ".join(p.name for p in t.logs)
            console.detail(f"  {name}: {t.size / 1e6:.1f} MB, {t.wall_s:.2f} s, {t.cpu_s:.2f} s computing {t.reason}")
        if found.has_loss:
            raise typer.Exit(int(ExitCode.PARTIAL))
