"""`aqualog slip-slope`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.options import (
    Cache,
    CarNeeded,
    Dbc,
    Debug,
    Force,
    Json,
    Logs,
    Progress,
    Quiet,
    Rate,
    Signals,
    Verbose,
)  # fmt: skip

__all__ = ["slip_slope"]


def slip_slope(
    logs: Logs,
    vehicle: CarNeeded = None,
    signals: Signals = None,
    dbc: Dbc = None,
    out: Annotated[
        str | None,
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
    rate: Rate = None,
    cache: Cache = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
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
    from aqualog.cli.console import guarded

    with guarded(debug=debug):
        code = _slip_slope(
            logs, vehicle, signals, dbc or [], out, method, traction, mu_max, delay, rate,
            cached=cache, as_json=as_json, force=force, quiet=quiet, verbose=verbose, progress=progress,
        )  # fmt: skip
    if code:
        raise typer.Exit(code)


def _slip_slope(
    logs: list[str],
    vehicle_file: Path | None,
    map_file: Path | None,
    dbc: list[Path],
    out_name: str | None,
    method: str,
    traction: str,
    mu_max: float,
    delay: float | None,
    rate: float | None,
    *,
    cached: bool | None,
    as_json: bool,
    force: bool,
    quiet: bool,
    verbose: bool,
    progress: str,
) -> int:
    from aqualog.cli.setup import prepare
    from aqualog.core.errors import ConfigError, ExitCode
    from aqualog.face.slip_slope import SLIP_SLOPE_FILES, slip_slope

    if vehicle_file is None:
        raise ConfigError("no --vehicle", expected="a vehicle file: which axle is driven, radii, where the mass is")
    out = None if out_name is None else _folder(out_name)
    setup = prepare(
        logs, map_file=map_file, dbc=dbc, targets=[out / n for n in SLIP_SLOPE_FILES] if out else [], force=force,
        quiet=quiet, verbose=verbose, progress=progress, vehicle_file=vehicle_file, cached=cached, rate_hz=rate,
    )  # fmt: skip
    console = setup.console
    with console.hearing() as hear:
        result = slip_slope(
            setup.drive, setup.vehicle, method=method, traction=traction, mu_max=mu_max, delay=delay, progress=hear
        )
        hear("writing")
        if out is not None:
            result.save(out, force=True)
    console.data(result, as_json=as_json)
    for text in result.notes:
        console.note(text)
    if out is not None:
        console.note(f"results are in {out}: {', '.join(SLIP_SLOPE_FILES)}")
    return int(ExitCode.PARTIAL) if result.has_loss else int(ExitCode.DONE)


def _folder(name: str) -> Path:
    """Return the folder for results. It need not exist, but a file must not be in its way."""
    from aqualog.core.errors import ConfigError

    expected = "a folder for the results"
    if not name.strip():
        raise ConfigError("-o is empty", expected=expected)
    out = Path(name)
    if out.exists() and not out.is_dir():
        raise ConfigError("-o is a file", where=name, expected=expected)
    there = next((p for p in out.parents if p.exists()), Path())
    if not there.is_dir():
        raise ConfigError(f"-o is below a file, {there}", where=name, expected=expected)
    return out
