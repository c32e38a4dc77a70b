"""`aqualog inspect`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.options import Dbc, Debug, Force, Json, Logs, Progress, Quiet, Signals, Verbose

__all__ = ["inspect"]


def inspect(
    logs: Logs,
    signals: Signals = None,
    dbc: Dbc = None,
    write_map: Annotated[
        Path | None,
        typer.Option("--write-map", help="Write the proposed signal map to this file.", metavar="FILE"),
    ] = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
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
    from aqualog.cli.console import guarded
    from aqualog.cli.setup import prepare
    from aqualog.face.inspect import inspect

    with guarded(debug=debug):
        if any(n.lower().endswith(".toml") for n in logs):
            code = _campaign(logs, has_log_options=bool(signals or dbc or write_map), as_json=as_json)
        else:
            setup = prepare(
                logs, map_file=signals, dbc=dbc or [], targets=[write_map] if write_map else [], force=force,
                quiet=quiet, verbose=verbose, progress=progress,
            )  # fmt: skip
            console = setup.console
            with console.hearing() as hear:
                found = inspect(setup.drive, progress=hear)
            if write_map is not None:
                found.write_map(write_map, force=True)
            console.data(found, as_json=as_json)
            if write_map is not None:
                console.note(
                    f"proposed map with {len(found.proposals)} signals is in {write_map}: check it before you use it"
                )
            code = int(found.exit_code)
    if code:
        raise typer.Exit(code)


def _campaign(names: list[str], *, has_log_options: bool, as_json: bool) -> int:
    from aqualog.cli.inspect_campaign import inspect_campaign
    from aqualog.core.errors import ConfigError

    if len(names) > 1:
        raise ConfigError("a campaign file beside other inputs", where=", ".join(names)[:200], expected="it alone")
    if has_log_options:
        raise ConfigError(
            "--signals, --dbc and --write-map are for logs", where=names[0], hint="name the signal map in the file"
        )
    return inspect_campaign(Path(names[0]), as_json=as_json)
