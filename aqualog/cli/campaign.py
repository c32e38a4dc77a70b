"""`aqualog campaign init`: from a folder of logs to a campaign file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.frame import Output, Run, command

__all__ = ["campaign_app", "init"]

campaign_app = typer.Typer(
    help="Campaign files: many drives in known configurations.", no_args_is_help=True, rich_markup_mode=None
)


@campaign_app.callback()
def _campaign() -> None:
    """Campaign files: many drives in known configurations."""


@campaign_app.command(no_args_is_help=True)
@command("folder out vehicle:proposed dbc json force")
def init(
    run: Run,
    folder: Annotated[Path, typer.Argument(help="Folder with logs, in it or below it.", metavar="FOLDER")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Campaign file to write.", metavar="FILE")] = Path(
        "campaign.toml"
    ),
) -> Output:
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
    from aqualog.face.propose import propose

    with run.hearing() as hear:
        found = propose(folder, out, vehicle=run.vehicle, dbc=run.dbc, force=run.force, progress=hear)
        found.write_files()
    return Output(found, found.notes)
