"""`aqualog detect`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aqualog.cli.options import (
    Cache,
    Dbc,
    Debug,
    Force,
    Json,
    Logs,
    Progress,
    Quiet,
    Rate,
    Signals,
    Thresholds,
    Vehicle,
    Verbose,
)  # fmt: skip

if TYPE_CHECKING:
    from aqualog.face.detect import Detection

__all__ = ["detect"]


def detect(
    logs: Logs,
    vehicle: Vehicle = None,
    signals: Signals = None,
    dbc: Dbc = None,
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
    rate: Rate = None,
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
    thresholds: Thresholds = None,
    model: Annotated[
        Path | None,
        typer.Option(
            "--model",
            help="Model file (TOML), as `aqualog diagnose` writes it: effects that the car is known to have.",
            metavar="FILE",
        ),
    ] = None,
    fail_on_event: Annotated[
        bool, typer.Option("--fail-on-event", help="Exit with 5 if anything was detected.")
    ] = False,
    cache: Cache = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
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
    from aqualog.cli.console import guarded

    with guarded(debug=debug):
        code = _detect(
            logs, vehicle, signals, dbc or [], out, write, rate, history, configuration, reference, thresholds,
            model, cached=cache, fail_on_event=fail_on_event, as_json=as_json, force=force, quiet=quiet,
            verbose=verbose, progress=progress,
        )  # fmt: skip
    if code:
        raise typer.Exit(code)


def _detect(
    logs: list[str],
    vehicle_file: Path | None,
    map_file: Path | None,
    dbc: list[Path],
    out: Path | None,
    write: Path | None,
    rate: float | None,
    history_file: Path | None,
    configuration: str,
    reference: str,
    thresholds_file: Path | None,
    model_file: Path | None,
    *,
    cached: bool | None,
    fail_on_event: bool,
    as_json: bool,
    force: bool,
    quiet: bool,
    verbose: bool,
    progress: str,
) -> int:
    from aqualog.cli.setup import prepare
    from aqualog.core.errors import ConfigError, ExitCode
    from aqualog.face.detect import DETECT_FILES, detect
    from aqualog.face.paths import refuse_existing
    from aqualog.io.write_log import check_suffix

    targets = [out / name for name in DETECT_FILES] if out else []
    if write is not None:
        check_suffix(write)
        targets.append(write)
    if out is not None and history_file is not None and out.absolute() == history_file.absolute():
        raise ConfigError("is the folder of the results", where=str(history_file), expected="a file of its own")
    setup = prepare(
        logs, map_file=map_file, dbc=dbc, targets=targets, force=force, quiet=quiet, verbose=verbose,
        progress=progress, vehicle_file=vehicle_file, cached=cached, rate_hz=rate,
    )  # fmt: skip
    console = setup.console
    given = [p for p in (thresholds_file, model_file) if p is not None]
    if history_file is not None:
        refuse_existing([history_file], force=True, sources=[*setup.drive.sources, *targets, *given])
    if given:
        refuse_existing(targets, force=force, sources=given)
    with console.hearing() as hear:
        result = detect(
            setup.drive, setup.vehicle, thresholds=thresholds_file, model=model_file, history=history_file,
            configuration=configuration, reference=reference, windows=out, whole=write is not None,
            samples=out is not None or write is not None, progress=hear,
        )  # fmt: skip
        hear("writing")
        if out is not None:
            result.save(out, force=True)
        if write is not None:
            result.write(write, force=True)
        if history_file is not None:
            result.remember(history_file)
    console.data(result, as_json=as_json)
    notes = [
        *(
            ["no --vehicle: a default RWD car is taken, and what needs its mass is not judged"]
            if not vehicle_file
            else []
        ),
        *_model_notes(result, model_file),
        *_history_notes(result, history_file, configuration),
        *result.notes,
        *([f"results are in {out}: {', '.join(DETECT_FILES)}"] if out is not None else []),
    ]
    for text in notes:
        console.note(text)
    if fail_on_event and result.drive_result.events:
        return int(ExitCode.GATE_TRIPPED)
    return int(ExitCode.PARTIAL) if result.has_loss else int(ExitCode.DONE)


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
