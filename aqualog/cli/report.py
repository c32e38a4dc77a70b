"""`aqualog report`."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.frame import Output, Run, command

__all__ = ["report"]


@command("campaign out by width robust store dbc jobs force")
def report(
    run: Run,
    campaign: Annotated[
        str, typer.Argument(help="A campaign file (TOML).", metavar="CAMPAIGN.toml", show_default=False)
    ],
    by: str,
    width: float,
    robust: bool,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", help="Folder for the report; default beside the campaign file: NAME.report.", metavar="DIR"
        ),
    ] = None,
) -> Output:
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
    return run.of_runs(runs, notes=[f"{page}: {files} files, {time.monotonic() - began:.0f} s"])
