"""`aqualog figures`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.options import Dbc, Debug, Force, Jobs, Json, Progress, Quiet, StoreOption, Verbose

__all__ = ["figures"]

_WIDTH = 100  # characters of a finding on a terminal; whole where it is kept or passed on


def figures(
    numbers: Annotated[
        list[str],
        typer.Argument(
            help="Figures of the thesis by number (3.6), by chapter (2, 3), or all.",
            metavar="NUMBER...",
            show_default=False,
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for pages, tables and pictures.", metavar="DIR")],
    campaign: Annotated[
        Path | None,
        typer.Option("--campaign", help="Make them from the runs of this campaign.", metavar="CAMPAIGN.toml"),
    ] = None,
    store: StoreOption = None,
    dbc: Dbc = None,
    formats: Annotated[
        str, typer.Option("--format", help="Any of html,csv,png,svg; pictures need the extra images.", metavar="LIST")
    ] = "html,csv",
    jobs: Jobs = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
    """Make figures of the thesis again, from runs, with what they say about its claims.

    Each figure leaves a page to look at and the table that is drawn, figure_3_06.html and .csv; more than one also
    figures.html with all of them. The verdicts go to stdout.

    With --campaign, the figures of chapter 2 are made from its runs, and name those that they used; logs without
    results are measured first, as by `aqualog batch`. A figure for which the campaign has not the runs is not made, and
    says why; the others are (exit code 3). 2.3 to 2.7 and 2.10 to 2.20 need a campaign.

    \b
    Examples:
      aqualog figures 3.6 -o figures
      aqualog figures 2.25 3.9 -o figures --force
      aqualog figures 2 -o figures --campaign campaign.toml
      aqualog figures 2.17 -o figures --campaign campaign.toml --format html,csv,svg
      aqualog figures 3 -o figures --json
      aqualog figures all -o figures --progress plain
    """  # fmt: skip
    from aqualog.cli.campaigns import INTERRUPTED, exit_code, open_campaign
    from aqualog.cli.console import Console, clean, guarded, told_if_interrupted
    from aqualog.core.errors import ConfigError, ExitCode
    from aqualog.face.thesis import check_formats, figures

    with guarded(debug=debug):
        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        wanted = check_formats(formats.split(","))
        if campaign is None and (store is not None or dbc):
            option = "--store" if store is not None else "--dbc"
            raise ConfigError(f"{option} without --campaign", expected="--campaign campaign.toml")
        own = None
        if campaign is not None:
            if campaign.suffix.lower() != ".toml":
                raise ConfigError("is no campaign file", where=str(campaign), expected="--campaign campaign.toml")
            own = open_campaign([str(campaign)], dbc=dbc, store=store)
        with console.hearing() as hear, told_if_interrupted(INTERRUPTED if own else ""):
            found = figures(numbers, own, out=out, formats=wanted, force=force, jobs=jobs, progress=hear)
        if as_json or not sys.stdout.isatty():
            console.data(found, as_json=as_json)
        else:
            sys.stdout.write(clean(found.text(width=_WIDTH)))
        pages = ", ".join(p.name for p in found.written if p.suffix == ".html")
        console.note(f"{len(found.written)} files are in {out}" + (f": {pages}" if pages else ""))
        code = int(ExitCode.PARTIAL) if found.not_made else exit_code(found.runs) if found.runs else 0
        raise typer.Exit(code if found.made else int(ExitCode.NOTHING_USABLE))
