"""`aqualog campaign init`: from a folder of logs to a campaign file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.options import Dbc, Debug, Force, Json, Progress, Quiet, Verbose

__all__ = ["campaign_app", "init"]

campaign_app = typer.Typer(
    help="Campaign files: many drives in known configurations.", no_args_is_help=True, rich_markup_mode=None
)


@campaign_app.callback()
def _campaign() -> None:
    """Campaign files: many drives in known configurations."""


@campaign_app.command(no_args_is_help=True)
def init(
    folder: Annotated[Path, typer.Argument(help="Folder with logs, in it or below it.", metavar="FOLDER")],
    out: Annotated[Path, typer.Option("-o", "--out", help="Campaign file to write.", metavar="FILE")] = Path(
        "campaign.toml"
    ),
    vehicle: Annotated[
        Path | None,
        typer.Option("--vehicle", help="Vehicle file of all runs; without it one to fill is written.", metavar="FILE"),
    ] = None,
    dbc: Dbc = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
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
    from aqualog.cli.console import Console, guarded
    from aqualog.core.errors import ExitCode
    from aqualog.face.propose import propose

    with guarded(debug=debug):
        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        with console.hearing() as hear:
            found = propose(folder, out, vehicle=vehicle, dbc=dbc or (), force=force, progress=hear)
            found.write_files()
        for text in found.notes:
            console.note(text)
        console.data(found, as_json=as_json)
        if found.has_loss:
            raise typer.Exit(int(ExitCode.PARTIAL))
