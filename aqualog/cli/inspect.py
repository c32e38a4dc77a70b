"""`aqualog inspect`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.frame import Output, Run, command

__all__ = ["inspect"]


@command("logs signals dbc write_map json force")
def inspect(
    run: Run,
    write_map: Annotated[
        Path | None,
        typer.Option("--write-map", help="Write the proposed signal map to this file.", metavar="FILE"),
    ] = None,
) -> Output:
    """List what a log holds, and propose which channel is which signal; of a campaign file, show the test matrix.

    Every channel with its rate, unit, range, gaps and faults; how an IMU is mounted; a signal map to start from. The
    proposal is a guess from names, units and data: read it before you use it.

    Of a campaign: faults of all its files at once, logs that are missing, which configurations were driven how often
    and how fast, and which are missing.

    \b
    Examples:
      aqualog inspect drive.mf4
      aqualog inspect campaign.toml
      aqualog inspect can.mf4 --dbc car.dbc --write-map map.toml
      aqualog inspect wheels.csv imu.csv gps.csv --write-map map.toml
    """
    from aqualog.face.inspect import inspect

    if any(n.lower().endswith(".toml") for n in run.logs):
        return _campaign(run, has_log_options=bool(run.signals or run.dbc or write_map))
    drive = run.drive([write_map] if write_map else [])
    with run.hearing() as hear:
        found = inspect(drive, progress=hear)
    notes = []
    if write_map is not None:
        found.write_map(write_map, force=True)
        notes = [f"proposed map with {len(found.proposals)} signals is in {write_map}: check it before you use it"]
    return Output(found, notes, code=int(found.exit_code))


def _campaign(run: Run, *, has_log_options: bool) -> Output:
    """Show the test matrix; a missing log counts as an input that failed, without any log nothing is usable."""
    from aqualog.core.errors import ConfigError, ExitCode
    from aqualog.face.matrix import matrix

    names = run.logs
    if len(names) > 1:
        raise ConfigError("a campaign file beside other inputs", where=", ".join(names)[:200], expected="it alone")
    if has_log_options:
        raise ConfigError(
            "--signals, --dbc and --write-map are for logs", where=names[0], hint="name the signal map in the file"
        )
    found = matrix(names[0])
    return Output(found, code=None if found.logs_there else int(ExitCode.NOTHING_USABLE))
