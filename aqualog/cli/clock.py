"""`aqualog align`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.options import Dbc, Debug, Force, Json, Progress, Quiet, Signals, Vehicle, Verbose

__all__ = ["align"]


def align(
    logs: Annotated[
        list[str],
        typer.Argument(help="Reference first, then the sources to compare with it.", metavar="REFERENCE SOURCE..."),
    ],
    quantity: Annotated[
        str, typer.Option("--quantity", help="speed or yaw_rate: what both carry.", metavar="NAME")
    ] = "speed",
    channel: Annotated[
        list[str] | None,
        typer.Option("--channel", help="Channel of a file, if names do not decide.", metavar="FILE=CHANNEL"),
    ] = None,
    signals: Signals = None,
    dbc: Dbc = None,
    vehicle: Vehicle = None,
    max_offset: Annotated[float, typer.Option("--max-offset", help="Search range in s.", min=0.1, max=3600.0)] = 10.0,
    start_offset: Annotated[
        float | None,
        typer.Option("--start-offset", help="Rough offset in s of clocks that are far apart."),
    ] = None,
    write_map: Annotated[
        Path | None,
        typer.Option("--write-map", help="Write the signal map with the clocks found.", metavar="FILE"),
    ] = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
    """Find the clock offset (and drift) between sources from a quantity that both carry.

    A positive offset means that the source is late against the reference. A weak or ambiguous match is refused.
    Where the clocks have nothing in common, both are first taken to begin at the same moment.

    \b
    Examples:
      aqualog align speed.csv gnss.csv
      aqualog align wheels.csv gps.csv --signals map.toml --write-map map_with_clocks.toml
      aqualog align imu.csv camera.csv --quantity yaw_rate --channel "camera.csv=gyro_z"
    """
    from aqualog.cli.console import guarded

    with guarded(debug=debug):
        code = _align(
            logs, quantity, channel or [], signals, dbc or [], vehicle, max_offset, start_offset, write_map,
            as_json=as_json, force=force, quiet=quiet, verbose=verbose, progress=progress,
        )  # fmt: skip
    if code:
        raise typer.Exit(code)


def _align(
    logs: list[str],
    quantity: str,
    named: list[str],
    map_file: Path | None,
    dbc: list[Path],
    vehicle_file: Path | None,
    max_offset: float,
    start_offset: float | None,
    write_map: Path | None,
    *,
    as_json: bool,
    force: bool,
    quiet: bool,
    verbose: bool,
    progress: str,
) -> int:
    from aqualog.cli.setup import prepare
    from aqualog.core.errors import ExitCode
    from aqualog.face.align import align, check_quantity

    check_quantity(quantity)
    setup = prepare(
        logs, map_file=map_file, dbc=dbc, targets=[write_map] if write_map else [], force=force, quiet=quiet,
        verbose=verbose, progress=progress, vehicle_file=vehicle_file,
    )  # fmt: skip
    console = setup.console
    with console.hearing() as hear:
        result = align(
            setup.drive, quantity=quantity, channels=dict(pair.partition("=")[::2] for pair in named),
            max_offset_s=max_offset, start_offset_s=start_offset, progress=hear,
        )  # fmt: skip
    console.data(result, as_json=as_json)
    if write_map is not None and result.fits:
        result.write_map(write_map, force=True)
        console.note(f"clocks of {', '.join(result.fits)} are in {write_map}")
        if map_file is None:
            console.note("it holds clocks only: give --signals map.toml to keep the signals of your map in it")
    for text in result.notes:
        console.note(text)
    if not result.fits:
        return int(ExitCode.NOTHING_USABLE)
    return int(ExitCode.PARTIAL) if result.has_loss else int(ExitCode.DONE)
