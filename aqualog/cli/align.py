"""`aqualog align`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.frame import Output, Run, command

__all__ = ["align"]


@command("logs:sources quantity channel signals dbc vehicle max_offset start_offset write_map json force")
def align(
    run: Run,
    quantity: Annotated[
        str, typer.Option("--quantity", help="speed or yaw_rate: what both carry.", metavar="NAME")
    ] = "speed",
    channel: Annotated[
        list[str] | None,
        typer.Option("--channel", help="Channel of a file, if names do not decide.", metavar="FILE=CHANNEL"),
    ] = None,
    max_offset: Annotated[float, typer.Option("--max-offset", help="Search range in s.", min=0.1, max=3600.0)] = 10.0,
    start_offset: Annotated[
        float | None,
        typer.Option("--start-offset", help="Rough offset in s of clocks that are far apart."),
    ] = None,
    write_map: Annotated[
        Path | None,
        typer.Option("--write-map", help="Write the signal map with the clocks found.", metavar="FILE"),
    ] = None,
) -> Output:
    """Find the clock offset (and drift) between sources from a quantity that both carry.

    A positive offset means that the source is late against the reference. A weak or ambiguous match is refused.
    Where the clocks have nothing in common, both are first taken to begin at the same moment.

    \b
    Examples:
      aqualog align speed.csv gnss.csv
      aqualog align wheels.csv gps.csv --signals map.toml --write-map map_with_clocks.toml
      aqualog align imu.csv camera.csv --quantity yaw_rate --channel "camera.csv=gyro_z"
    """
    from aqualog.core.errors import ExitCode
    from aqualog.face.align import align, check_quantity

    check_quantity(quantity)
    drive = run.drive([write_map] if write_map else [])
    with run.hearing() as hear:
        result = align(
            drive, quantity=quantity, channels=dict(pair.partition("=")[::2] for pair in channel or ()),
            max_offset_s=max_offset, start_offset_s=start_offset, progress=hear,
        )  # fmt: skip
    notes = []
    if write_map is not None and result.fits:
        result.write_map(write_map, force=True)
        notes = [f"clocks of {', '.join(result.fits)} are in {write_map}"]
        if run.signals is None:
            notes.append("it holds clocks only: give --signals map.toml to keep the signals of your map in it")
    return Output(result, [*notes, *result.notes], code=None if result.fits else int(ExitCode.NOTHING_USABLE))
