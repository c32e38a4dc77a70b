"""`aqualog figures`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.frame import BATCH_BROKEN_OFF, Output, Run, command

__all__ = ["figures"]

_WIDTH = 100  # characters of a finding on a terminal; whole where it is kept or passed on


@command("numbers out campaign store dbc formats jobs json force")
def figures(
    run: Run,
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
    formats: Annotated[
        str, typer.Option("--format", help="Any of html,csv,png,svg; pictures need the extra images.", metavar="LIST")
    ] = "html,csv",
) -> Output:
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
    """
    from aqualog.core.errors import ConfigError, ExitCode
    from aqualog.face.thesis import check_formats, figures

    wanted = check_formats(formats.split(","))
    if campaign is None and (run.store is not None or run.dbc):
        option = "--store" if run.store is not None else "--dbc"
        raise ConfigError(f"{option} without --campaign", expected="--campaign campaign.toml")
    if campaign is not None and campaign.suffix.lower() != ".toml":
        raise ConfigError("is no campaign file", where=str(campaign), expected="--campaign campaign.toml")
    own = None if campaign is None else run.campaign([str(campaign)])
    with run.hearing(BATCH_BROKEN_OFF if own else "") as hear:
        found = figures(numbers, own, out=out, formats=wanted, force=run.force, jobs=run.jobs, progress=hear)
    pages = ", ".join(p.name for p in found.written if p.suffix == ".html")
    notes = [f"{len(found.written)} files are in {out}" + (f": {pages}" if pages else "")]
    text = found.text(width=_WIDTH) if sys.stdout.isatty() else None
    if not found.made:
        return Output(found, notes, text=text, code=int(ExitCode.NOTHING_USABLE))
    if found.runs is None or found.not_made:
        return Output(found, notes, text=text)
    return run.of_runs(found.runs, result=found, notes=notes, text=text)
