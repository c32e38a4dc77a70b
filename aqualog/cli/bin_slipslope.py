"""`aqualog bin-slipslope`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

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
    StoreOption,
    Verbose,
)

__all__ = ["BinWidth", "By", "Road", "Robust", "TableOut", "bin_slipslope"]

By = Annotated[
    str,
    typer.Option(
        "--by",
        help="Configuration keys: tyre,pressure,water-depth,load,wear,side,manoeuvre,... Default: those that differ.",
        metavar="KEYS",
    ),
]
BinWidth = Annotated[
    float, typer.Option("--bin-width", help="Width of the speed bins.", min=1.0, max=100.0, metavar="KMH")
]
Road = Annotated[str, typer.Option("--road", help="wet, dry or both.", metavar="ROAD")]
Robust = Annotated[bool, typer.Option("--robust", help="Weigh outliers down (Huber [huber1981]).")]
TableOut = Annotated[
    Path | None, typer.Option("-o", "--out", help="Table of the rows: FILE.csv or FILE.parquet.", metavar="FILE")
]


def bin_slipslope(
    inputs: Inputs,
    by: By = "",
    width: BinWidth = 10.0,
    road: Road = "wet",
    robust: Robust = False,
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
    """Slip slope over speed for each configuration, and the speed of full aquaplaning.

    Slip is regressed on traction in bins of speed; the 95 % intervals treat a run, not a sample, as the unit, and are
    given with three runs or more. Beside each slope: the contact that is left against dry road, and what the model
    expects. Logs that have no results yet are run first, as `aqualog batch` does. The delay of v_x is estimated and
    taken off. --by side puts the wheels of a side together.

    JSON: rows, dry, delays, full_aquaplaning (from the slopes, from minor and from full spin-downs), spin_ups,
    minor_spin_downs.

    \b
    Examples:
      aqualog bin-slipslope campaign.toml
      aqualog bin-slipslope campaign.toml --by tyre,pressure --road both
      aqualog bin-slipslope campaign.toml --by water-depth,side --bin-width 20 --robust
      aqualog bin-slipslope campaign.toml --json | jq '.full_aquaplaning[] | select(.v_full_kmh)'
      aqualog bin-slipslope campaign.toml --store results -o slopes.csv
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
                found = runs.slip_slope(by, bin_width=width, road=road, robust=robust, progress=hear)
            if out is not None:
                found.write(out, force=True)
                console.note(f"the table is {out}")
            console.data(found, as_json=as_json)
        code = exit_code(runs)
    if code:
        raise typer.Exit(code)
