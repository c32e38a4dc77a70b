"""`aqualog detect`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aqualog.cli.frame import Output, Run, command

if TYPE_CHECKING:
    from aqualog.face.detect import Detection

__all__ = ["detect"]


@command(
    "logs vehicle signals dbc out write rate history configuration reference thresholds model fail_on_event cache json "
    "force"
)
def detect(
    run: Run,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="Folder for events.json, signals.parquet and report.html.", metavar="DIR"),
    ] = None,
    write: Annotated[
        Path | None,
        typer.Option(
            "--write",
            help="Signals, statistics and detection bits as channels of a log: .mf4, .mcap, .csv or .parquet.",
            metavar="FILE",
        ),
    ] = None,
    history: Annotated[
        Path | None,
        typer.Option(
            "--history",
            help="Dry slip slopes of this car from earlier drives (JSON); read, and written back with this drive's.",
            metavar="FILE",
        ),
    ] = None,
    configuration: Annotated[
        str,
        typer.Option(
            "--configuration",
            help="What the dry slope belongs to: tyre, pressure, load, in any words; default the vehicle's name.",
            metavar="TEXT",
        ),
    ] = "",
    reference: Annotated[
        str,
        typer.Option(
            "--reference",
            help="Dry slope of the history: robust (upper quartile of the periods' means) or max (as the thesis).",
            metavar="RULE",
        ),
    ] = "robust",
    fail_on_event: Annotated[
        bool, typer.Option("--fail-on-event", help="Exit with 5 if anything was detected.")
    ] = False,
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
      aqualog detect drive.mf4 --vehicle car.toml --history slopes.json --configuration "worn summer, 1.9 bar"
      aqualog detect drive.mf4 --vehicle car.toml --model model.toml
    """
    from aqualog.core.errors import ConfigError, ExitCode
    from aqualog.face.detect import DETECT_FILES, detect
    from aqualog.face.paths import refuse_existing
    from aqualog.io.write_log import check_suffix

    targets = [out / name for name in DETECT_FILES] if out else []
    if write is not None:
        check_suffix(write)
        targets.append(write)
    if out is not None and history is not None and out.absolute() == history.absolute():
        raise ConfigError("is the folder of the results", where=str(history), expected="a file of its own")
    given = [p for p in (run.thresholds, run.model) if p is not None]
    drive = run.drive(targets, others=given)
    if history is not None:
        refuse_existing([history], force=True, sources=[*drive.sources, *targets, *given])
    with run.hearing() as hear:
        result = detect(
            drive, thresholds=run.thresholds, model=run.model, history=history, configuration=configuration,
            reference=reference, windows=out, whole=write is not None, samples=out is not None or write is not None,
            progress=hear,
        )  # fmt: skip
        hear("writing")
        if out is not None:
            result.save(out, force=True)
        if write is not None:
            result.write(write, force=True)
        if history is not None:
            result.remember(history)
    notes = [
        *([] if run.vehicle else ["no --vehicle: a default RWD car is taken, and what needs its mass is not judged"]),
        *_model_notes(result, run.model),
        *_history_notes(result, history, configuration),
        *result.notes,
        *([f"results are in {out}: {', '.join(DETECT_FILES)}"] if out is not None else []),
    ]
    has_tripped = fail_on_event and bool(result.drive_result.events)
    return Output(result, notes, code=int(ExitCode.GATE_TRIPPED) if has_tripped else None)


def _model_notes(result: Detection, path: Path | None) -> list[str]:
    if result.model is None:
        return []
    effects = ", ".join(t.effect.name for t in result.model.terms) or "no effect"
    return [f"model {path}: the detectors allow for {effects}; signals and features are corrected for it"]


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
    if name in known or not known:
        return [text]
    shown = ", ".join(f'"{n}"' for n in known[:5]) + (", ..." if len(known) > 5 else "")
    return [f"{text}; the name is new, known are {shown}"]
