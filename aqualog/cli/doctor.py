"""`aqualog doctor`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from aqualog.cli.options import Dbc, Debug, Json, Logs, Progress, Quiet, Signals, Vehicle, Verbose

if TYPE_CHECKING:
    from aqualog.doctor.records import Examination
    from aqualog.errors import ExitCode

__all__ = ["doctor", "exit_code"]


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

    with guarded(debug=debug):
        code = _doctor(
            logs, vehicle, signals, dbc or [], as_json=as_json, quiet=quiet, verbose=verbose, progress=progress
        )
    if code:
        raise typer.Exit(code)


def _doctor(
    logs: list[str],
    vehicle_file: Path | None,
    map_file: Path | None,
    dbc: list[Path],
    *,
    as_json: bool,
    quiet: bool,
    verbose: bool,
    progress: str,
) -> int:
    import json
    import sys

    from aqualog.cli.console import clean
    from aqualog.cli.setup import prepare
    from aqualog.doctor.examine import examine
    from aqualog.report.examination import examination_document, examination_text

    setup = prepare(
        logs, map_file=map_file, dbc=dbc, targets=[], force=False, quiet=quiet, verbose=verbose,
        progress=progress, vehicle_file=vehicle_file,
    )  # fmt: skip
    with setup.console.steps() as steps, setup.reading():
        found = examine(setup.paths, vehicle=setup.vehicle, signal_map=setup.signal_map, dbc=dbc, report=steps)
    if as_json:
        sys.stdout.write(json.dumps(examination_document(found), indent=1) + "\n")
    else:
        sys.stdout.write(clean(examination_text(found)))
    return int(exit_code(found))


def exit_code(found: Examination) -> ExitCode:
    """What was lost of something counts more than that there is no signal in the rest, as with `inspect`."""
    from aqualog.errors import ExitCode

    if found.is_unreadable:
        return ExitCode.FAILED
    if found.has_loss and any(f.samples for f in found.files):
        return ExitCode.PARTIAL
    if any(f.kind == "no_signals" for f in found.findings):
        return ExitCode.NOTHING_USABLE
    return ExitCode.PARTIAL if found.has_loss else ExitCode.DONE
