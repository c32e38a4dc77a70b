"""`aqualog report`."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.bin_slipslope import BinWidth, By, Robust
from aqualog.cli.options import Dbc, Debug, Force, Jobs, Progress, Quiet, StoreOption, Verbose

__all__ = ["report"]


def report(
    campaign: Annotated[
        str, typer.Argument(help="A campaign file (TOML).", metavar="CAMPAIGN.toml", show_default=False)
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", help="Folder for the report; default beside the campaign file: NAME.report.", metavar="DIR"
        ),
    ] = None,
    by: By = "",
    width: BinWidth = 10.0,
    robust: Robust = False,
    store: StoreOption = None,
    dbc: Dbc = None,
    jobs: Jobs = None,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
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
    from aqualog.cli.campaigns import exit_code, open_campaign, run_campaign
    from aqualog.cli.console import Console, guarded
    from aqualog.core.errors import ConfigError

    began = time.monotonic()
    with guarded(debug=debug):
        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        if not campaign.lower().endswith(".toml"):
            raise ConfigError(
                "is no campaign file", where=campaign, expected="a campaign file (TOML)",
                hint=f"aqualog detect {campaign} -o DIR for the page of one drive",
            )  # fmt: skip
        opened = open_campaign([campaign], dbc=dbc, store=store)
        folder = out if out is not None else opened.configured.campaign.path.with_suffix(".report")
        opened.check_report(folder, force=force)
        opened.check_bins(by, bin_width=width)
        runs = run_campaign(opened, console, jobs=jobs)
        with console.hearing() as hear:
            page = runs.report(folder, by=by, bin_width=width, robust=robust, force=True, progress=hear)
        files = sum(p.is_file() for p in page.parent.rglob("*"))
        console.note(f"{page}: {files} files, {time.monotonic() - began:.0f} s")
        code = exit_code(runs)
    if code:
        raise typer.Exit(code)
