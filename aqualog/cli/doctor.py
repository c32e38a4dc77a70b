"""`aqualog doctor`."""

from __future__ import annotations

import typer

from aqualog.cli.options import Dbc, Debug, Json, Logs, Progress, Quiet, Signals, Vehicle, Verbose

__all__ = ["doctor"]


def doctor(
    logs: Logs,
    vehicle: Vehicle = None,
    signals: Signals = None,
    dbc: Dbc = None,
    as_json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
    """Report what is wrong with a log, what was lost of it, and what to do.

    Every file is read to its end: damage, time stamps that jump, samples that are no numbers, codes, signals that stand
    still. Then the drive is judged as `detect` would see it: units, ranges, sensors that contradict each other, and
    which detectors lack what. Nothing is written. Exit codes: 0 nothing lost, 3 something lost or a file of several
    cannot be read, 4 nothing lost but no signal that aqualog knows, or no samples at all, 1 nothing can be read.

    \b
    Examples:
      aqualog doctor drive.mf4
      aqualog doctor wheels.csv imu.csv --signals map.toml --vehicle car.toml
      aqualog doctor broken.mcap --json
    """
    from aqualog.cli.console import guarded
    from aqualog.cli.setup import prepare
    from aqualog.face.doctor import doctor

    with guarded(debug=debug):
        setup = prepare(
            logs, map_file=signals, dbc=dbc or [], targets=[], force=False, quiet=quiet, verbose=verbose,
            progress=progress, vehicle_file=vehicle,
        )  # fmt: skip
        with setup.console.hearing() as hear:
            found = doctor(setup.drive, setup.vehicle, progress=hear)
        setup.console.data(found, as_json=as_json)
        code = int(found.exit_code)
    if code:
        raise typer.Exit(code)
