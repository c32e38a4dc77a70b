"""`aqualog report`."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aqualog.cli.bin_slipslope import BinWidth, By, Robust, split
from aqualog.cli.options import Dbc, Debug, Force, Jobs, Progress, Quiet, StoreOption, Verbose

if TYPE_CHECKING:
    from aqualog.campaign.batch import Configured
    from aqualog.cli.console import Console

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
    from aqualog.cli.console import Console, guarded

    with guarded(debug=debug):
        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        code = _report(campaign, out, by, width, store, dbc or [], jobs, robust=robust, force=force, console=console)
    if code:
        raise typer.Exit(code)


def _report(
    name: str,
    out: Path | None,
    by: str,
    width: float,
    store: str | None,
    dbc: list[Path],
    jobs: int | None,
    *,
    robust: bool,
    force: bool,
    console: Console,
) -> int:
    from aqualog.campaign.bins import check_plan
    from aqualog.cli.campaign_results import exit_code, opened, results
    from aqualog.errors import ConfigError
    from aqualog.report.campaign_folder import check_folder, write_report

    if not name.lower().endswith(".toml"):
        raise ConfigError(
            "is no campaign file", where=name, expected="a campaign file (TOML)",
            hint=f"aqualog detect {name} -o DIR for the page of one drive",
        )  # fmt: skip
    began = time.monotonic()
    configured = opened([name], dbc=dbc)
    folder = out if out is not None else configured.campaign.path.with_suffix(".report")
    check_folder(folder, force=force)
    _check_sources(configured, folder)
    from aqualog.face.progress import Progress as Told
    from aqualog.report.campaign_findings import find

    chosen = check_plan(configured.campaign, split(by), width_kmh=width)
    data, outcome = results(configured, store, console=console, jobs=jobs)
    with console.steps() as steps:
        findings = find(data, chosen, robust=robust, report=steps)
        files = write_report(data, findings, folder, report=Told(steps, "pages of runs"))
    console.note(f"{folder / 'index.html'}: {files} files, {time.monotonic() - began:.0f} s")
    return exit_code(outcome, data)


def _check_sources(configured: Configured, folder: Path) -> None:
    """Nothing that the campaign reads may be in the way, not even with --force."""
    from aqualog.campaign.batch import name_of
    from aqualog.cli.campaign_results import check_targets
    from aqualog.report.campaign_folder import targets_of

    names = [name_of(configured.campaign, r.logs) for r in configured.campaign.runs]
    check_targets(configured, targets_of(folder, names), force=True)
