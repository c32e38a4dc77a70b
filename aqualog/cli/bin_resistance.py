"""`aqualog bin-resistance`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aqualog.cli.bin_slipslope import BinWidth, By, Road, Robust, TableOut, check_table, split, write_table
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

if TYPE_CHECKING:
    from aqualog.cli.console import Console

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
    from aqualog.cli.console import Console, guarded

    with guarded(debug=debug):
        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        code = _bin_resistance(
            inputs, by, width, road, store, vehicle, signals, dbc or [], out, jobs, robust=robust,
            relative=not as_measured, as_json=as_json, force=force, console=console,
        )  # fmt: skip
    if code:
        raise typer.Exit(code)


def _bin_resistance(
    inputs: list[str],
    by: str,
    width: float,
    road: str,
    store: str | None,
    vehicle: Path | None,
    map_file: Path | None,
    dbc: list[Path],
    out: Path | None,
    jobs: int | None,
    *,
    robust: bool,
    relative: bool,
    as_json: bool,
    force: bool,
    console: Console,
) -> int:
    from aqualog.campaign.bins import check_plan, plan
    from aqualog.cli.campaign_results import check_targets, exit_code, opened, results
    from aqualog.cli.console import clean

    check_table(out)
    configured = opened(inputs, vehicle=vehicle, map_file=map_file, dbc=dbc)
    check_plan(configured.campaign, split(by), width_kmh=width, road=road)
    check_targets(configured, [out] if out is not None else [], force=force, store=store)
    data, outcome = results(configured, store, console=console, jobs=jobs)
    if not outcome.done:
        return exit_code(outcome, data)
    with console.steps() as steps:
        steps("averaging")
        from aqualog.campaign.resistance import resistances
        from aqualog.report.campaign_document import resistance_document
        from aqualog.report.campaign_tables import resistance_text

        found = resistances(
            data, plan(data, split(by), width_kmh=width, road=road), relative=relative, robust=robust
        )  # fmt: skip
    document = resistance_document(data.name, found)
    if out is not None:
        write_table(out, document["rows"])
        console.note(f"the table is {out}")
    if as_json:
        sys.stdout.write(json.dumps(document, indent=1, allow_nan=False) + "\n")
    else:
        sys.stdout.write(clean(resistance_text(found)))
    return exit_code(outcome, data)
