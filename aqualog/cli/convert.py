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
    from aqualog.types import Signals as SignalTable
    from aqualog.vehicle import Vehicle as VehicleRecord

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
    from aqualog.errors import ConfigError, ExitCode
    from aqualog.face.paths import write_whole
    from aqualog.io.write_log import check_suffix, write_log

    suffix = check_suffix(out)
    if decimal_comma and suffix != ".csv":
        raise ConfigError(f"--decimal-comma says nothing to {suffix}", where=str(out), expected="a .csv")
    setup = prepare(
        logs, map_file=map_file, dbc=dbc, targets=[out], force=force, quiet=quiet, verbose=verbose,
        progress=progress, vehicle_file=vehicle_file,
    )  # fmt: skip
    console, paths = setup.console, setup.paths
    with console.steps() as steps, setup.reading():
        import numpy as np

        from aqualog.align.load import load_signals
        from aqualog.report.document import signal_groups

        loaded = load_signals(
            paths, vehicle=setup.vehicle, signal_map=setup.signal_map, dbc=dbc, rate_hz=rate, report=steps
        )
        changes = setup.changes()
        steps("writing")
        t_ns = np.arange(loaded.frame.height, dtype=np.int64) * loaded.dt_ns
        groups = signal_groups(loaded)
        write_whole(
            out,
            lambda p: write_log(p, t_ns, groups, suffix=suffix, start_ns=loaded.start_ns, decimal_comma=decimal_comma),
        )
    assumed = _of_default_car(loaded, setup.vehicle) if vehicle_file is None else []
    for text in (*assumed, *loaded.quality.notes, *changes):
        console.note(text)
    console.note(f"{len(loaded.symbols)} signals, {t_ns.size} samples at {1e9 / loaded.dt_ns:g} Hz are in {out}")
    lost = loaded.quality.truncated or loaded.quality.lost_in_files or changes
    return int(ExitCode.PARTIAL) if lost else int(ExitCode.DONE)


def _of_default_car(signals: SignalTable, vehicle: VehicleRecord) -> list[str]:
    """What is told where nobody has named the car: radii stand in the numbers that are written, and not beside them."""
    from aqualog.units import parse_unit

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
