"""`aqualog bin-resistance`."""

from __future__ import annotations

from typing import Annotated

import typer

from aqualog.cli.bin_slipslope import BinWidth, By, Road, Robust, TableOut
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
    StoreOption,
    Verbose,
)

__all__ = ["bin_resistance"]


def bin_resistance(
    inputs: Inputs,
    by: By = "",
    width: BinWidth = 10.0,
    road: Road = "wet",
    robust: Robust = False,
    as_measured: Annotated[
        bool, typer.Option("--as-measured", help="Do not take off each run's own level on dry road.")
    ] = False,
    store: StoreOption = None,
    vehicle: CarOfLogs = None,
    signals: Signals = None,
    dbc: Dbc = None,
    out: TableOut = None,
    jobs: Jobs = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
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
    from aqualog.cli.campaigns import exit_code, open_campaign, run_campaign
    from aqualog.cli.console import Console, guarded
    from aqualog.face.bins import check_table

    with guarded(debug=debug):
        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        if out is not None:
            check_table(out)
        campaign = open_campaign(inputs, vehicle=vehicle, signals=signals, dbc=dbc, store=store)
        campaign.check_bins(by, bin_width=width, road=road)
        campaign.check_targets([out] if out is not None else [], force=force)
        runs = run_campaign(campaign, console, jobs=jobs)
        if runs.outcome.done:
            with console.hearing() as hear:
                found = runs.resistance(
                    by, bin_width=width, road=road, robust=robust, as_measured=as_measured, progress=hear
                )
            if out is not None:
                found.write(out, force=True)
                console.note(f"the table is {out}")
            console.data(found, as_json=as_json)
        code = exit_code(runs)
    if code:
        raise typer.Exit(code)
