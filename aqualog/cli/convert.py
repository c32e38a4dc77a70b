"""`aqualog convert`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aqualog.cli.frame import Output, Run, command

if TYPE_CHECKING:
    from aqualog.core.records import Signals
    from aqualog.core.vehicle import Vehicle

__all__ = ["convert"]


@command("logs out vehicle signals dbc rate decimal_comma force")
def convert(
    run: Run,
    out: Annotated[
        Path, typer.Option("-o", "--out", help="File to write: .mf4, .mcap, .csv or .parquet.", metavar="FILE")
    ],
    decimal_comma: Annotated[
        bool, typer.Option("--decimal-comma", help="CSV with decimal comma and semicolons.")
    ] = False,
) -> Output:
    """Write the aligned signals of one drive as one log, in SI units and with canonical names.

    What is written needs no signal map any more.

    \b
    Examples:
      aqualog convert can.mf4 --dbc car.dbc --signals map.toml --vehicle car.toml -o drive.parquet
      aqualog convert wheels.csv imu.csv --signals map.toml -o drive.mf4
      aqualog convert drive.mcap -o drive.csv --decimal-comma --rate 50
    """
    from aqualog.core.errors import ExitCode
    from aqualog.face.drive import check_target, convert

    check_target(out, decimal_comma=decimal_comma)
    drive = run.drive([out])
    with run.hearing() as hear:
        convert(drive, out, decimal_comma=decimal_comma, force=True, progress=hear)
    signals, changes, quality = drive.signals, drive.changes(), drive.signals.quality
    notes = [
        *([] if run.vehicle or drive.vehicle is None else _of_default_car(signals, drive.vehicle)),
        *quality.notes,
        *changes,
        f"{len(signals.symbols)} signals, {signals.frame.height} samples at {1e9 / signals.dt_ns:g} Hz are in {out}",
    ]
    has_loss = quality.truncated or quality.lost_in_files or changes
    return Output(notes=notes, code=int(ExitCode.PARTIAL if has_loss else ExitCode.DONE))


def _of_default_car(signals: Signals, vehicle: Vehicle) -> list[str]:
    """Return a note where no car is named: its radii are in the numbers that are written, and stand nowhere else."""
    from aqualog.core.units import parse_unit

    is_speed = [
        parse_unit(o.unit, where=o.file).dimension == "speed"
        for s, o in signals.origins.items()
        if s.startswith("omega_") and o.unit
    ]
    if not any(is_speed):
        return []
    front, rear = vehicle.r_e("fl"), vehicle.r_e("rl")
    radii = f"{front:g} m" if front == rear else f"{front:g} and {rear:g} m"
    return [f"no --vehicle: wheel speeds in km/h or m/s became rad/s with a default car's radius of {radii}"]
