"""`aqualog doctor`."""

from __future__ import annotations

from aqualog.cli.frame import Output, Run, command

__all__ = ["doctor"]


@command("logs vehicle signals dbc json")
def doctor(run: Run) -> Output:
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
    from aqualog.face.doctor import doctor

    drive = run.drive()
    with run.hearing() as hear:
        found = doctor(drive, progress=hear)
    return Output(found, code=int(found.exit_code))
