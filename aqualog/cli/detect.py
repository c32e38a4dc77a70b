"""`aqualog detect`."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
    from aqualog.cli.console import Console
    from aqualog.detect.slip_slope.watch import Memory
    from aqualog.model.term import Model
    from aqualog.types import DriveResult
    from aqualog.types import Signals as LoadedSignals
    from aqualog.vehicle import Vehicle as Car

__all__ = ["detect"]

_RESULTS = ("events.json", "signals.parquet", "report.html")


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
    from dataclasses import replace

    from aqualog.cli.files import refuse_existing
    from aqualog.cli.setup import prepare
    from aqualog.config.history import update_history
    from aqualog.config.settings import load_settings
    from aqualog.detect.slip_slope.history import drive_key, remembered
    from aqualog.io.write_log import check_suffix

    targets = [out / name for name in _RESULTS] if out else []
    if write is not None:
        check_suffix(write)
        targets.append(write)
    memory = _memory(history_file, configuration, reference, out)
    settings = load_settings(thresholds_file) if thresholds_file else None
    setup = prepare(
        logs, map_file=map_file, dbc=dbc, targets=targets, force=force, quiet=quiet, verbose=verbose,
        progress=progress, vehicle_file=vehicle_file, cached=cached,
    )  # fmt: skip
    console, paths = setup.console, setup.paths
    vehicle = setup.vehicle
    given = [p for p in (thresholds_file, model_file) if p is not None]
    if history_file is not None:
        refuse_existing([history_file], force=True, sources=[*setup.sources, *targets, *given])
    if given:
        refuse_existing(targets, force=force, sources=given)
    model = None
    if model_file is not None:
        from aqualog.config.model import load_model

        model = load_model(model_file)
    with console.steps() as steps, setup.reading():
        from aqualog.align.load_long import LoadedLong, load_drive

        options = (("--write", write), ("--model", model), ("--history", history_file))
        drive = load_drive(
            paths, vehicle=vehicle, signal_map=setup.signal_map, dbc=dbc, rate_hz=rate, report=steps, cache=setup.cache,
            note=console.note, whole_for=", ".join(name for name, given in options if given is not None),
        )  # fmt: skip
        told: tuple[str, ...] = ()
        key = ""
        if isinstance(drive, LoadedLong):
            from aqualog.cli.detect_long import detect_in_windows

            grid = drive.drive.grid
            _something_to_do(drive.drive.symbols, 1e9 / grid.dt_ns, drive.drive.notes, vehicle, paths)
            console.detail(f"{grid.rows} samples at {1e9 / grid.dt_ns:g} Hz, gone through in windows")
            result = detect_in_windows(drive, vehicle, settings=settings, memory=memory, out=out, report=steps)
        else:
            _something_to_do(drive.symbols, 1e9 / drive.dt_ns, drive.quality.notes, vehicle, paths)
            steps("detecting")
            # what an earlier look at this very drive has left is not what it is compared with
            key = drive_key(drive) if history_file else ""
            result, told = _whole(
                drive, vehicle, model, settings, memory, key, console, samples=out is not None or write is not None
            )
        changes = setup.changes()
        result = replace(result, notes=(*told, *result.notes, *changes))
        loaded = result.signals
        terms = _model_document(model)
        name = ", ".join(str(p) for p in paths)
        title = name if len(paths) <= 2 else f"{paths[0].parent.name or paths[0].name} ({len(paths)} files)"
        steps("writing")
        if out is not None:
            _write_results(result, out, name, title, terms)
        if write is not None:
            _write_log(result, write)
        if history_file is not None:
            update_history(history_file, lambda h: remembered(h, memory.name(vehicle), result.slopes, drive=key))
    _print(result, name, terms, as_json=as_json)
    if vehicle_file is None:
        console.note("no --vehicle: a default RWD car is taken, and what needs its mass is not judged")
    if terms is not None:
        effects = ", ".join(t["effect"] for t in terms) or "no effect"
        console.note(f"model {model_file}: the detectors know of {effects}; signals and features are as it has them")
    if history_file is not None:
        console.note(_history_told(memory, vehicle, result, history_file))
    if configuration and history_file is None:
        console.note("--configuration names an entry of a history; without --history it does nothing")
    for text in (*loaded.quality.notes, *result.notes):
        console.note(text)
    if out is not None:
        console.note(f"results are in {out}: {', '.join(_RESULTS)}")
    return _exit_code(result, fail_on_event=fail_on_event, has_changed=bool(changes))


def _whole(
    loaded: LoadedSignals,
    vehicle: Car,
    model: Model | None,
    settings: Any,
    memory: Memory,
    key: str,
    console: Console,
    *,
    samples: bool,
) -> tuple[DriveResult, tuple[str, ...]]:
    """Detection in one go: the result, sample by sample if that is written anywhere, and what the model said."""
    from contextlib import nullcontext
    from dataclasses import replace

    from aqualog.detect.stream import detect_drive

    console.detail(f"{len(loaded.symbols)} signals, {loaded.frame.height} samples at {1e9 / loaded.dt_ns:g} Hz")
    for name, origin in loaded.origins.items():
        console.detail(f"  {name}: {origin.file}:{origin.channel} [{origin.unit}] {origin.rate_hz:.4g} Hz")
    told: tuple[str, ...] = ()
    if model is not None:
        from aqualog.diagnose.extended import extended_inputs

        loaded, vehicle, told = extended_inputs(loaded, vehicle, model)
    # what takes long of a short drive is the compiler; of a long one it is the drive
    with console.told_if_slow("the detectors") if loaded.frame.height < 200_000 else nullcontext():
        known = replace(memory, history=memory.history.without(key))
        return detect_drive(loaded, vehicle, settings=settings, memory=known, samples=samples), told


def _memory(history_file: Path | None, configuration: str, reference: str, out: Path | None) -> Memory:
    """What is known of the dry slope before the drive."""
    from aqualog.config.history import check_history_file, load_history
    from aqualog.detect.slip_slope.history import History, check_configuration
    from aqualog.detect.slip_slope.watch import Memory
    from aqualog.errors import ConfigError

    if reference not in ("robust", "max"):
        raise ConfigError(f"--reference {reference[:40]!r}", expected="robust or max")
    check_configuration(configuration, where="--configuration")
    history = History()
    if history_file is not None:
        if out is not None and out.absolute() == history_file.absolute():
            raise ConfigError("is the folder of the results", where=str(history_file), expected="a file of its own")
        check_history_file(history_file)
        history = load_history(history_file)
    return Memory(history, configuration.strip(), "max" if reference == "max" else "robust")


def _history_told(memory: Memory, vehicle: Any, result: DriveResult, path: Path) -> str:
    """What of the history was used and what was added; a name that is new is told beside those that are known."""
    name = memory.name(vehicle)
    known = list(memory.history.periods)
    used = sum(len(memory.history.of(name, s.place)) for s in result.slopes)
    added = sum(len(s.periods) for s in result.slopes)
    text = f'history {path}: {used} periods of "{name}" known, {added} of this drive written'
    if name in known or not known:
        return text
    shown = ", ".join(f'"{n}"' for n in known[:5]) + (", ..." if len(known) > 5 else "")
    return f"{text}; the name is new, known are {shown}"


def _model_document(model: Model | None) -> list[dict[str, Any]] | None:
    """The terms that the detectors knew; null without a model file."""
    if model is None:
        return None
    return [
        {
            "effect": t.effect.name,
            "where": t.where,
            "parameters": dict(t.values),
            **({"knots": [list(k) for k in t.knots]} if t.knots else {}),
        }
        for t in model.terms
    ]


def _something_to_do(
    symbols: Sequence[str], rate_hz: float, notes: Sequence[str], vehicle: Any, paths: list[Path]
) -> None:
    """Stop with one line if no detector can run."""
    from aqualog.detect.needs import DETECTORS, check_needs
    from aqualog.errors import SignalError

    unavailable, _ = check_needs(vehicle, symbols, rate_hz=rate_hz)
    if len(unavailable) < len(DETECTORS):
        return
    asked = ("omega_", "torque_", "a_x", "wheel speeds", "signals at")
    missing = dict.fromkeys(s for u in unavailable for s in u.missing if s.startswith(asked))
    raise SignalError(
        f"no detector can run: missing {', '.join(missing)}" + (f" ({notes[0]})" if notes else ""),
        where=", ".join(p.name for p in paths),
        expected="wheel speeds omega_fl ... omega_rr, or a_x with wheel torques",
        hint="`aqualog inspect LOG --write-map map.toml`, then --signals map.toml",
    )


def _write_results(result: DriveResult, out: Path, name: str, title: str, model: Any) -> None:
    from aqualog.cli.files import write_text, write_whole
    from aqualog.io.write_log import write_log
    from aqualog.report.document import document, result_groups
    from aqualog.report.page import write_page

    out.mkdir(parents=True, exist_ok=True)
    text = json.dumps({**document(result, log=name), "model": model}, indent=1, allow_nan=False) + "\n"
    write_text(out / "events.json", text)
    t_ns, start_ns = _times(result)
    groups = result_groups(result)
    if result.signals.full is None:
        write_whole(out / "signals.parquet", lambda p: write_log(p, t_ns, groups, suffix=".parquet", start_ns=start_ns))
    write_whole(out / "report.html", lambda p: write_page(result, p, title=title))


def _times(result: DriveResult) -> tuple[Any, int | None]:
    import numpy as np

    signals = result.signals
    return np.arange(signals.frame.height, dtype=np.int64) * signals.dt_ns, signals.start_ns


def _write_log(result: DriveResult, path: Path) -> None:
    from aqualog.cli.files import write_whole
    from aqualog.io.write_log import check_suffix, write_log
    from aqualog.report.document import result_groups

    t_ns, start_ns = _times(result)
    groups, suffix = result_groups(result), check_suffix(path)
    write_whole(path, lambda p: write_log(p, t_ns, groups, suffix=suffix, start_ns=start_ns))


def _print(result: DriveResult, name: str, model: Any, *, as_json: bool) -> None:
    if as_json:
        from aqualog.report.document import document

        whole = {**document(result, log=name), "model": model}
        sys.stdout.write(json.dumps(whole, indent=1, allow_nan=False) + "\n")
        return
    from aqualog.cli.console import clean
    from aqualog.report.text import event_table

    sys.stdout.write(clean(event_table(result)))


def _exit_code(result: DriveResult, *, fail_on_event: bool, has_changed: bool) -> int:
    from aqualog.errors import ExitCode

    quality = result.signals.quality
    if fail_on_event and result.events:
        return int(ExitCode.GATE_TRIPPED)
    lossy = quality.truncated or quality.lost_in_files or has_changed
    return int(ExitCode.PARTIAL) if lossy else int(ExitCode.DONE)
