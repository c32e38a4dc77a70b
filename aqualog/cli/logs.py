"""Commands that look at logs and prepare them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aqualog.cli.frame import Output, Run, command, files_at

if TYPE_CHECKING:
    from aqualog.core.records import Signals
    from aqualog.core.vehicle import Vehicle

__all__ = ["align", "cache", "convert", "doctor", "init", "inspect"]


@command("logs signals dbc write_map:proposed data force")
def inspect(run: Run, write_map: Path | None) -> Output:
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
    files = files_at(found, {"map.toml": write_map})
    notes = [f"proposed map with {len(found.proposals)} signals is in {p}: check it before you use it" for p in files]
    return Output(found, notes, code=int(found.exit_code), files=files)


def _campaign(run: Run, *, has_log_options: bool) -> Output:
    """Show the test matrix; a missing log counts as an input that failed, without any log nothing is usable."""
    from aqualog.core.errors import ConfigError, ExitCode
    from aqualog.face.inspect import matrix

    names = run.logs
    if len(names) > 1:
        raise ConfigError("a campaign file beside other inputs", where=", ".join(names)[:200], expected="it alone")
    if has_log_options:
        raise ConfigError(
            "--signals, --dbc and --write-map are for logs", where=names[0], hint="name the signal map in the file"
        )
    found = matrix(names[0])
    return Output(found, code=None if found.logs_there else int(ExitCode.NOTHING_USABLE))


@command("logs out:start vehicle:proposed dbc data force")
def init(run: Run, out: Path) -> Output:
    """Begin with one drive: write its signal map and a vehicle file to fill in, and print what to do next.

    Guesses channel, unit and sign of each signal from names, units, size and motion. What stands behind a # in the
    files says why, what is not mapped, and what is to be filled in (SET). At most two questions are asked, and only on
    a terminal: which axle is driven, and what names and data leave open. An empty answer leaves a mark in the file.

    \b
    Examples:
      aqualog init drive.mf4 -o work
      aqualog init can.mf4 --dbc car.dbc -o work
      aqualog init wheels.csv imu.csv gps.csv -o work --vehicle car.toml
    """
    from aqualog.face.init import Question, init

    drive = run.drive()

    def ask(question: Question) -> str:
        hear.clear()
        choices = f"{', '.join(question.choices)}; " if question.choices else ""
        answer = run.console.ask(f"{question.text} ({choices}empty: not known)")
        while not question.takes(answer):
            answer = run.console.ask(f"{answer!r} is no answer to that ({choices}empty: not known)")
        return answer

    with run.hearing() as hear:
        found = init(
            drive, out, run.vehicle, ask=ask if run.console.can_ask() and not run.json else None, force=run.force,
            progress=hear,
        )  # fmt: skip
    files = {found.folder / name: write for name, write in found.files().items()}
    return Output(found, code=int(found.exit_code), files=files)


@command("logs vehicle signals dbc out:page data force")
def doctor(run: Run, out: Path | None) -> Output:
    """Report what is wrong with a log, what was lost of it, and what to do.

    Every file is read to its end: damage, time stamps that jump, samples that are no numbers, codes, signals that stand
    still. Then the drive is judged as `detect` would see it: units, ranges, sensors that contradict each other, and
    which detectors lack what. Without a map signals are guessed as `detect` guesses them. Only -o writes a file. Exit
    codes: 0 nothing lost, whatever values are left out; 3 something lost or a file of several cannot be read; 4 nothing
    lost but no detector can run, or no samples at all; 1 nothing can be read.

    \b
    Examples:
      aqualog doctor drive.mf4
      aqualog doctor wheels.csv imu.csv --signals map.toml --vehicle car.toml
      aqualog doctor broken.mcap --json
      aqualog doctor drive.mf4 -o doctor.html
    """
    from aqualog.face.inspect import doctor

    drive = run.drive([out] if out else [])
    with run.hearing() as hear:
        found = doctor(drive, progress=hear)
    files = files_at(found, {"doctor.html": out})
    return Output(found, [f"written: {path}" for path in files], code=int(found.exit_code), files=files)


@command("logs out:log vehicle signals dbc rate decimal_comma force")
def convert(run: Run, out: Path, decimal_comma: bool) -> Output:
    """Write the aligned signals of one drive as one log, in SI units and with canonical names.

    What is written needs no signal map any more. Without one the channels are guessed, as `detect` does, and said.

    \b
    Examples:
      aqualog convert can.mf4 --dbc car.dbc --signals map.toml --vehicle car.toml -o drive.parquet
      aqualog convert wheels.csv imu.csv --signals map.toml -o drive.mf4
      aqualog convert drive.mcap -o drive.csv --decimal-comma --rate 50
    """
    from aqualog.core.errors import ExitCode
    from aqualog.face.drive import check_target, convert, vehicle_of
    from aqualog.face.guess import load_or_guess

    check_target(out, decimal_comma=decimal_comma)
    drive = run.drive([out])
    with run.hearing() as hear:
        with drive.reading():
            drive, _, guessed = load_or_guess(drive, vehicle_of(None, drive), hear, whole_for="writing a log")
        convert(drive, out, decimal_comma=decimal_comma, force=True, progress=hear)
    signals, changes, quality = drive.signals, drive.changes(), drive.signals.quality
    notes = [
        *guessed,
        *([] if run.vehicle or drive.vehicle is None else _of_default_car(signals, drive.vehicle)),
        *quality.notes,
        *changes,
        f"{len(signals.symbols)} signals, {signals.frame.height} samples at {1e9 / signals.dt_ns:g} Hz are in {out}",
    ]
    has_loss = quality.has_loss or changes
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


@command("logs:sources quantity channel signals dbc vehicle max_offset start_offset write_map:clocks data force")
def align(
    run: Run,
    quantity: str,
    channel: list[str] | None,
    max_offset: float,
    start_offset: float | None,
    write_map: Path | None,
) -> Output:
    """Find the clock offset (and drift) between sources from a quantity that both carry.

    A positive offset means that the source is late against the reference. A weak or ambiguous match is refused.
    Where the clocks have nothing in common, both are first taken to begin at the same moment.

    \b
    Examples:
      aqualog align speed.csv gnss.csv
      aqualog align wheels.csv gps.csv --signals map.toml --write-map map_with_clocks.toml
      aqualog align imu.csv camera.csv --quantity yaw_rate --channel "camera.csv=gyro_z"
    """
    from aqualog.core.errors import ExitCode
    from aqualog.face.align import align, check_quantity

    check_quantity(quantity)
    drive = run.drive([write_map] if write_map else [], all_files=False)
    with run.hearing() as hear:
        result = align(
            drive, quantity=quantity, channels=dict(pair.partition("=")[::2] for pair in channel or ()),
            max_offset_s=max_offset, start_offset_s=start_offset, progress=hear,
        )  # fmt: skip
    files = files_at(result, {"map.toml": write_map if result.fits else None})
    notes = [f"clocks of {', '.join(result.fits)} are in {path}" for path in files]
    if files and run.signals is None:
        notes.append("it holds clocks only: give --signals map.toml to keep the signals of your map in it")
    code = None if result.fits else int(ExitCode.NOTHING_USABLE)
    return Output(result, [*notes, *result.notes], code=code, files=files)


@command("clean data force verbose", has_steps=False)
def cache(run: Run, clean: bool) -> Output:
    """Show or empty the folder in which aligned signals are kept.

    detect, diagnose, calibrate and slip-slope keep signals there with --cache, or always where AQUALOG_CACHE names a
    folder; the same log is then read once. A drive is found again by the content of its files, the signal map,
    databases, radii and ratios of the vehicle, the rate, and aqualog's own reading code. AQUALOG_CACHE_MB is the most
    that is kept (2000); what was not asked for longest goes first. -v lists the drives.

    \b
    Examples:
      aqualog detect drive.mf4 --vehicle car.toml --cache
      aqualog cache
      aqualog cache --clean
      AQUALOG_CACHE=/data/cache aqualog diagnose drive.mf4 --vehicle car.toml
    """
    from aqualog.face.cache import cache

    kept = cache(clean=clean)
    return Output(kept, text=kept.text(verbose=run.console.verbose))
