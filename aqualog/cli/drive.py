"""Commands on one drive."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aqualog.cli.frame import Output, Run, command

if TYPE_CHECKING:
    from aqualog.face.detect import Detection

__all__ = ["detect", "slip_slope"]


@command(
    "logs vehicle signals dbc out:results write layouts rate correct_offsets history configuration reference "
    "thresholds model fail_on_event cache data force"
)
def detect(
    run: Run,
    out: Path | None,
    write: Path | None,
    layouts: bool,
    history: Path | None,
    configuration: str,
    reference: str,
    fail_on_event: bool,
) -> Output:
    """Detect aquaplaning in one drive.

    The files named are ONE drive: a single log, or the files of several loggers. Events go to stdout as a table or as
    JSON; -o leaves a page to look at.

    \b
    Examples:
      aqualog detect drive.mf4 --vehicle car.toml -o out
      aqualog detect wheels.csv imu.csv gps.csv --signals map.toml --vehicle car.toml
      aqualog detect can.mf4 --dbc car.dbc --signals map.toml --json
      aqualog detect drive.mcap --vehicle car.toml --write drive_detected.mf4
      aqualog detect drive.mf4 --vehicle car.toml --write drive_detected.mcap --layouts
      aqualog detect drive.mf4 --vehicle car.toml --history slopes.json --configuration "worn summer, 1.9 bar"
      aqualog detect drive.mf4 --vehicle car.toml --model model.toml
    """
    from aqualog.core.errors import ConfigError
    from aqualog.face.arguments import refuse_existing
    from aqualog.face.detect import DETECT_FILES, detect

    targets, written = [out / name for name in DETECT_FILES] if out else [], []
    if write is not None:
        from aqualog.io.write_log import check_suffix
        from aqualog.report.layouts import layout_texts

        check_suffix(write)
        written = [write, *(layout_texts(write, ()) if layouts else ())]
    elif layouts:
        raise ConfigError("--layouts without --write", expected="--write FILE.mcap, the log that they show")
    for file in (write, history):
        if out is not None and file is not None and out.absolute() == file.absolute():
            raise ConfigError("is the folder of the results", where=str(file), expected="a file of its own")
    given = [p for p in (run.thresholds, run.model) if p is not None]
    targets += written
    drive = run.drive(targets, others=given)
    if history is not None:
        refuse_existing([history], force=True, sources=[*drive.sources, *targets, *given])
    with run.hearing() as hear:
        result = detect(
            drive, thresholds=run.thresholds, model=run.model, history=history, configuration=configuration,
            reference=reference, windows=out, whole=write is not None,
            samples=out is not None or write is not None, progress=hear,
        )  # fmt: skip
        hear("writing")
        if write is not None:  # before the folder: where it cannot be written, nothing is
            result.write(write, layouts=layouts, force=True)
        if out is not None:
            result.save(out, force=True)
        if history is not None:
            result.remember(history)
    notes = (
        []
        if run.vehicle
        else ["no --vehicle: radii of a default car are taken, and what needs mass or drivetrain is not judged"]
    )
    if result.model is not None:
        effects = ", ".join(t.effect.name for t in result.model.terms) or "no effect"
        notes.append(f"model {run.model}: the detectors allow for {effects}; signals and features are corrected for it")
    notes += [
        *_history_notes(result, history, configuration),
        *result.notes,
        *([f"results are in {out}: {', '.join(DETECT_FILES)}"] if out is not None else []),
        *([f"written: {', '.join(str(p) for p in written)}"] if written else []),
    ]
    return Output(result, notes, code=_gate(run, result) if fail_on_event else None)


def _gate(run: Run, result: Detection) -> int | None:
    """The exit code of `--fail-on-event`: a drive that could not be judged has not passed."""
    from aqualog.core.errors import ExitCode, SignalError
    from aqualog.report.drive.judged import headline

    if result.verdict == "aquaplaning":
        return int(ExitCode.GATE_TRIPPED)
    if result.verdict == "none":
        return None
    judgement = result.drive_result.judgement
    open_gate = SignalError(
        f"--fail-on-event has no answer. {headline(judgement)}", where=result.drive.title,
        expected="a drive that can be judged", hint="aqualog doctor, which says what to mend",
    )  # fmt: skip
    run.console.error(open_gate.line())
    return int(open_gate.exit_code)


def _history_notes(result: Detection, path: Path | None, configuration: str) -> list[str]:
    """What of the history was used and what was added; a new name is shown beside those that are known."""
    if path is None:
        return (
            ["--configuration names an entry of a history; without --history it does nothing"] if configuration else []
        )
    memory, slopes = result.memory, result.drive_result.slopes
    assert memory is not None
    name = memory.name(result.vehicle)
    known = list(memory.history.periods)
    used = sum(len(memory.history.of(name, s.place)) for s in slopes)
    added = sum(len(s.periods) for s in slopes)
    text = f'history {path}: {used} periods of "{name}" known, {added} of this drive written'
    text += "" if added else ", where a period takes 5 s of estimates on dry road"
    if name in known or not known:
        return [text]
    shown = ", ".join(f'"{n}"' for n in known[:5]) + (", ..." if len(known) > 5 else "")
    return [f"{text}; the name is new, known are {shown}"]


@command(
    "logs vehicle:needed signals dbc out:slopes method traction mu_max delay rate correct_offsets cache data force"
)
def slip_slope(run: Run, out: Path | None, method: str, traction: str, mu_max: float, delay: float | None) -> Output:
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
    from aqualog.face.slip_slope import SLIP_SLOPE_FILES, slip_slope

    run.need_vehicle("which axle is driven, radii, where the mass is")
    drive = run.drive([out / n for n in SLIP_SLOPE_FILES] if out else [])
    with run.hearing() as hear:
        result = slip_slope(drive, method=method, traction=traction, mu_max=mu_max, delay=delay, progress=hear)
    files = {} if out is None else {out / name: write for name, write in result.files().items()}
    where = [f"results are in {out}: {', '.join(SLIP_SLOPE_FILES)}"] if files else []
    return Output(result, [*result.notes, *where], files=files)
