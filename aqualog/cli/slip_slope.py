"""`aqualog slip-slope`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.frame import Output, Run, command

__all__ = ["slip_slope"]


@command("logs vehicle:needed signals dbc out method traction mu_max delay rate cache json force")
def slip_slope(
    run: Run,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="Folder for slip_slope.json, .csv and .html.", metavar="DIR"),
    ] = None,
    method: Annotated[
        str,
        typer.Option(
            "--method",
            help="auto, axle (driven against free wheels), velocity (against v_x) or differential (recursive only).",
            metavar="NAME",
        ),
    ] = "auto",
    traction: Annotated[
        str,
        typer.Option("--traction", help="auto, torque or accelerometer (one driven axle).", metavar="NAME"),
    ] = "auto",
    mu_max: Annotated[
        float, typer.Option("--mu-max", help="Largest traction coefficient used.", min=0.02, max=1.0)
    ] = 0.3,
    delay: Annotated[
        float | None,
        typer.Option(
            "--delay",
            help="By how much v_x is late against the wheels, where known; else it is estimated (velocity only).",
            metavar="SECONDS",
            min=-1.0,
            max=1.0,
        ),
    ] = None,
) -> Output:
    """Estimate the slip slope C_s/F_z of each driven wheel, its interval, and whether it stayed the same.

    Slip is regressed on traction over straight, unbraked driving; the intervals are from blocks of the drive left out
    in turn. The files named are ONE drive. The vehicle file must be given: it says which axle is driven.

    \b
    Examples:
      aqualog slip-slope drive.mf4 --vehicle car.toml
      aqualog slip-slope wheels.csv imu.csv --signals map.toml --vehicle car.toml -o out
      aqualog slip-slope drive.mcap --vehicle awd.toml --method velocity --json
      aqualog slip-slope drive.mcap --vehicle awd.toml --method velocity --delay 0.12
      aqualog slip-slope track.mf4 --vehicle car.toml --traction accelerometer --mu-max 0.5
    """
    from aqualog.face.slip_slope import SLIP_SLOPE_FILES, slip_slope

    run.need_vehicle("which axle is driven, radii, where the mass is")
    drive = run.drive([out / n for n in SLIP_SLOPE_FILES] if out else [])
    with run.hearing() as hear:
        result = slip_slope(drive, method=method, traction=traction, mu_max=mu_max, delay=delay, progress=hear)
        hear("writing")
        if out is not None:
            result.save(out, force=True)
    where = [f"results are in {out}: {', '.join(SLIP_SLOPE_FILES)}"] if out is not None else []
    return Output(result, [*result.notes, *where])
