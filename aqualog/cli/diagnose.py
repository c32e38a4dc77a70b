"""`aqualog diagnose`."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aqualog.cli.options import (
    Cache,
    Dbc,
    Debug,
    Force,
    Json,
    Progress,
    Quiet,
    Rate,
    Signals,
    Verbose,
)  # fmt: skip

if TYPE_CHECKING:
    from collections.abc import Callable

    from aqualog.cli.console import Console, Steps
    from aqualog.cli.diagnose_drives import Drives
    from aqualog.cli.diagnose_results import Targets
    from aqualog.diagnose.records import Diagnosis
    from aqualog.diagnose.run import Options
    from aqualog.model.term import Model
    from aqualog.vehicle import Vehicle as VehicleRecord

__all__ = ["diagnose"]


def diagnose(
    logs: Annotated[
        list[str],
        typer.Argument(
            help="Logs, each argument a drive of its own; a folder is one drive of several files. Or a campaign file.",
            metavar="LOG...|CAMPAIGN.toml",
            show_default=False,
        ),
    ],
    vehicle: Annotated[
        Path | None,
        typer.Option(
            "--vehicle",
            help="Vehicle file (TOML): what the simulation believes. Drives need one; a campaign names its own.",
            metavar="FILE",
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option("--model", help="Model file (TOML): what is known already, on top of the base.", metavar="FILE"),
    ] = None,
    signals: Signals = None,
    dbc: Dbc = None,
    holdout: Annotated[
        list[str] | None,
        typer.Option(
            "--holdout",
            help="Drive on which the gain is measured and nothing is fitted; may be repeated.",
            metavar="LOG",
        ),
    ] = None,
    out: Annotated[
        str | None, typer.Option("-o", "--out", help="Extended model: a file that --model takes.", metavar="FILE")
    ] = None,
    page: Annotated[
        str | None, typer.Option("--page", help="Page with the pictures before and after (HTML).", metavar="FILE")
    ] = None,
    level: Annotated[
        float, typer.Option("--level", help="Share of drives without effect that may be given one.", min=1e-4, max=0.5)
    ] = 0.01,
    seed: Annotated[int, typer.Option("--seed", help="Of all that is drawn at random.", min=0, max=2**63 - 1)] = 1,
    surrogates: Annotated[
        int | None,
        typer.Option(
            "--surrogates", help="How many drives without effect calibrate the test.", min=1, max=100_000, metavar="N"
        ),
    ] = None,
    bootstrap: Annotated[
        bool, typer.Option("--bootstrap/--no-bootstrap", help="Without: quicker, the test by its formula alone.")
    ] = True,
    rate: Rate = None,
    cache: Cache = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
    """Say what the simulation gets wrong on measured drives: the cause, its size, how sure, and what it gains.

    The vehicle file is what the simulation believes. The verdict is one of: no_effect, named, compound, cannot_tell
    (the log does not separate the causes; a drive that would is named), unexplained, not_testable. The extended model
    is a file that simulate, detect and diagnose take with --model.

    \b
    Examples:
      aqualog diagnose drive.mf4 --vehicle car.toml
      aqualog diagnose monday/ tuesday.mcap --vehicle car.toml --holdout friday.mf4 -o model.toml --page diagnosis.html
      aqualog diagnose drive.csv --vehicle car.toml --signals map.toml --model model.toml --json
      aqualog diagnose drive.mf4 --vehicle car.toml --no-bootstrap
      aqualog diagnose campaign.toml --page campaign.html
    """
    from aqualog.cli.console import Console, guarded

    with guarded(debug=debug):
        from aqualog.cli.diagnose_results import Targets, target
        from aqualog.errors import ConfigError
        from aqualog.face.campaign import is_campaign

        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        if surrogates is not None and not bootstrap:
            raise ConfigError("--surrogates beside --no-bootstrap", expected="one of them")
        number = surrogates if bootstrap else 0
        targets = Targets(target(out, "-o"), target(page, "--page"), as_json, force)
        if is_campaign(logs):
            strange = {
                "--holdout": bool(holdout),
                "--rate": rate is not None,
                "--no-bootstrap": not bootstrap,
                "--cache": cache is True,
            }
            given = [option for option, is_given in strange.items() if is_given]
            code = _campaign(
                logs, vehicle, model, signals, dbc or [], targets, given, seed=seed, level=level, surrogates=surrogates,
                console=console,
            )  # fmt: skip
        else:
            code = _diagnose(
                logs, holdout or [], vehicle, model, signals, dbc or [], targets, rate, seed=seed, level=level,
                surrogates=number, console=console, cached=cache,
            )  # fmt: skip
    if code:
        raise typer.Exit(code)


def _diagnose(
    logs: list[str],
    holdout: list[str],
    vehicle_file: Path | None,
    model_file: Path | None,
    map_file: Path | None,
    dbc: list[Path],
    targets: Targets,
    rate: float | None,
    *,
    seed: int,
    level: float,
    surrogates: int | None,
    console: Console,
    cached: bool | None,
) -> int:
    from aqualog.cli.console import clean_line, told_if_interrupted
    from aqualog.cli.diagnose_drives import check_apart, check_once, find_drives, load_drives
    from aqualog.cli.diagnose_results import tell
    from aqualog.cli.setup import prepare
    from aqualog.errors import ConfigError, ExitCode
    from aqualog.face.paths import expand, list_files, refuse_existing

    if vehicle_file is None:
        raise ConfigError("no --vehicle", expected="a vehicle file: it is what the simulation believes")
    setup = prepare(
        logs, map_file=map_file, dbc=dbc, targets=targets.paths, force=targets.force, quiet=console.quiet,
        verbose=console.verbose, progress=console.progress, vehicle_file=vehicle_file, cached=cached,
    )  # fmt: skip
    missing = next((p for p in expand(holdout) if not p.exists()), None)
    if missing is not None:
        raise ConfigError(
            "no such file or folder", where=f"--holdout {missing}", expected="a drive to measure the gain on"
        )
    others = [*expand(holdout), *list_files(holdout), *([model_file] if model_file is not None else [])]
    refuse_existing(targets.paths, force=True, sources=others)
    known = _model(model_file)
    drives, unseen = find_drives(logs, holdout)
    check_apart(drives, unseen)
    repeated = check_once(logs, drives)
    with console.steps() as steps, told_if_interrupted("nothing was written"):
        given = load_drives([*drives, *unseen], setup, dbc, rate, steps)
        from aqualog.diagnose.run import Options

        options = Options(seed=seed, level=level, views=targets.page is not None)
        if surrogates is not None:
            options = replace(options, surrogates=surrogates)
        result = _result(given, [n for n, _ in unseen], setup.vehicle, known, options, steps)
    for line in given.failed:
        sys.stderr.write(f"error: {clean_line(line)}\n")
    if result is None:
        return int(ExitCode.NOTHING_USABLE)
    paths = [str(p) for n, files in drives if n in given.loaded for p in files]
    changes = setup.changes()
    tell(result, targets, paths, [*repeated, *given.notes, *changes], setup.vehicle.name, console)
    asked = [n for n, _ in drives if n in given.loaded]
    is_partial = given.failed or given.is_lossy or changes or len(result.drives) < len(asked)
    return int(ExitCode.PARTIAL) if is_partial else int(ExitCode.DONE)


def _model(path: Path | None) -> Model:
    from aqualog.model.term import Model

    if path is None:
        return Model()
    from aqualog.config.model import load_model

    return load_model(path)


def _result(
    given: Drives, unseen: list[str], vehicle: VehicleRecord, known: Model, options: Options, steps: Steps
) -> Diagnosis | None:
    """The diagnosis; a drive that lacks a signal leaves `given` for a line in `failed`; None if all do."""
    from aqualog.diagnose.run import diagnose as run
    from aqualog.errors import SignalError

    while drives := [(n, s) for n, s in given.loaded.items() if n not in unseen]:
        held = [(n, s) for n, s in given.loaded.items() if n in unseen]
        try:
            return run(drives, vehicle, model=known, holdout=held, options=options, progress=_progress(steps))
        except SignalError as error:
            if error.where not in given.loaded:  # it is about all of them
                given.failed.append(error.line())
                break
            given.drop(error.where, error.line())
    return None


def _progress(steps: Steps) -> Callable[[str, float], None]:
    """A line for each step of work, with how far it is: renewed on a terminal, at most every tenth as lines."""
    last: list[object] = []

    def told(what: str, share: float) -> None:
        now = [what, round(10.0 * share) if steps.mode == "plain" else round(100.0 * share)]
        if now != last:
            last[:] = now
            steps(f"{what}, {100.0 * min(max(share, 0.0), 1.0):.0f} %")

    return told


def _campaign(
    inputs: list[str],
    vehicle_file: Path | None,
    model_file: Path | None,
    map_file: Path | None,
    dbc: list[Path],
    targets: Targets,
    strange: list[str],
    *,
    seed: int,
    level: float,
    surrogates: int | None,
    console: Console,
) -> int:
    """The same of a campaign's runs together, which carry what no single drive shows."""
    from aqualog.cli.campaign_results import check_targets, exit_code, opened, results
    from aqualog.cli.diagnose_results import tell
    from aqualog.errors import ConfigError
    from aqualog.face.paths import refuse_existing

    if strange:
        raise ConfigError(f"{strange[0]} says nothing to a campaign", expected="what a campaign takes: --help")
    configured = opened(inputs, vehicle=vehicle_file, map_file=map_file, dbc=dbc)
    check_targets(configured, targets.paths, force=targets.force)
    refuse_existing(targets.paths, force=True, sources=[model_file] if model_file is not None else [])
    known = _model(model_file)
    data, outcome = results(configured, None, console=console)
    if not outcome.done:
        return exit_code(outcome, data)
    with console.steps() as steps:
        from aqualog.diagnose.level import diagnose_campaign

        work = diagnose_campaign if surrogates is None else partial(diagnose_campaign, surrogates=surrogates)
        result = work(configured.campaign, data, seed=seed, level=level, model=known, progress=steps)
    names = dict.fromkeys(car.name for car in configured.vehicles.values())
    tell(result, targets, inputs, [], ", ".join(names), console)
    return exit_code(outcome, data)
