"""`aqualog convert`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aqualog.cli.options import (
    Dbc,
    Debug,
    Force,
    Logs,
    Progress,
    Quiet,
    Rate,
    Signals,
    Vehicle,
    Verbose,
)  # fmt: skip

if TYPE_CHECKING:
    from aqualog.core.records import Signals as SignalTable
    from aqualog.core.vehicle import Vehicle as VehicleRecord

__all__ = ["convert"]


def convert(
    logs: Logs,
    out: Annotated[
        Path, typer.Option("-o", "--out", help="File to write: .mf4, .mcap, .csv or .parquet.", metavar="FILE")
    ],
    vehicle: Vehicle = None,
    signals: Signals = None,
    dbc: Dbc = None,
    rate: Rate = None,
    decimal_comma: Annotated[
        bool, typer.Option("--decimal-comma", help="CSV with decimal comma and semicolons.")
    ] = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
    """Write the aligned signals of one drive as one log, in SI units and with canonical names.

    What is written needs no signal map any more.

    \b
    Examples:
      aqualog convert can.mf4 --dbc car.dbc --signals map.toml --vehicle car.toml -o drive.parquet
      aqualog convert wheels.csv imu.csv --signals map.toml -o drive.mf4
      aqualog convert drive.mcap -o drive.csv --decimal-comma --rate 50
    """
    from aqualog.cli.console import guarded

    with guarded(debug=debug):
        code = _convert(
            logs, out, vehicle, signals, dbc or [], rate,
            decimal_comma=decimal_comma, force=force, quiet=quiet, verbose=verbose, progress=progress,
        )  # fmt: skip
    if code:
        raise typer.Exit(code)


def _convert(
    logs: list[str],
    out: Path,
    vehicle_file: Path | None,
    map_file: Path | None,
    dbc: list[Path],
    rate: float | None,
    *,
    decimal_comma: bool,
    force: bool,
    quiet: bool,
    verbose: bool,
    progress: str,
) -> int:
    from aqualog.cli.setup import prepare
    from aqualog.core.errors import ExitCode
    from aqualog.face.convert import check_target, convert

    check_target(out, decimal_comma=decimal_comma)
    setup = prepare(
        logs, map_file=map_file, dbc=dbc, targets=[out], force=force, quiet=quiet, verbose=verbose,
        progress=progress, vehicle_file=vehicle_file, rate_hz=rate,
    )  # fmt: skip
    console, drive = setup.console, setup.drive
    with console.hearing() as hear:
        convert(drive, out, setup.vehicle, decimal_comma=decimal_comma, force=True, progress=hear)
    loaded, changes = drive.load(setup.vehicle), drive.changes()
    assumed = _of_default_car(loaded, setup.vehicle) if vehicle_file is None else []
    for text in (*assumed, *loaded.quality.notes, *changes):
        console.note(text)
    count = loaded.frame.height
    console.note(f"{len(loaded.symbols)} signals, {count} samples at {1e9 / loaded.dt_ns:g} Hz are in {out}")
    lost = loaded.quality.truncated or loaded.quality.lost_in_files or changes
    return int(ExitCode.PARTIAL) if lost else int(ExitCode.DONE)


def _of_default_car(signals: SignalTable, vehicle: VehicleRecord) -> list[str]:
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
