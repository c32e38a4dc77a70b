"""`aqualog diagnose`."""

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
    Progress,
    Quiet,
    Rate,
    Signals,
    Verbose,
)  # fmt: skip

if TYPE_CHECKING:
    from aqualog.cli.console import Console
    from aqualog.face.diagnose import Diagnosis

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
    """Find what the simulation gets wrong on measured drives: the cause, its size and interval, and the gain.

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
        from aqualog.cli.setup import result_file
        from aqualog.core.errors import ConfigError
        from aqualog.face.campaign import is_campaign

        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        if surrogates is not None and not bootstrap:
            raise ConfigError("--surrogates beside --no-bootstrap", expected="one of them")
        targets = (result_file(out, "-o"), result_file(page, "--page"))
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
                console=console, as_json=as_json, force=force,
            )  # fmt: skip
        else:
            code = _diagnose(
                logs, holdout or [], vehicle, model, signals, dbc or [], targets, rate, seed=seed, level=level,
                surrogates=surrogates if bootstrap else 0, console=console, cached=cache, as_json=as_json, force=force,
            )  # fmt: skip
    if code:
        raise typer.Exit(code)


Targets = tuple[Path | None, Path | None]  # model file, page


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
    as_json: bool,
    force: bool,
) -> int:
    from aqualog.cli.console import told_if_interrupted
    from aqualog.cli.setup import prepare
    from aqualog.core.errors import ConfigError, ExitCode
    from aqualog.face.diagnose import diagnose
    from aqualog.face.drives import NothingUsableError, grouped
    from aqualog.face.paths import expand, list_files, refuse_existing

    if vehicle_file is None:
        raise ConfigError("no --vehicle", expected="a vehicle file: it is what the simulation believes")
    written = [p for p in targets if p is not None]
    setup = prepare(
        logs, map_file=map_file, dbc=dbc, targets=written, force=force, quiet=console.quiet, verbose=console.verbose,
        progress=console.progress, vehicle_file=vehicle_file, cached=cached, rate_hz=rate,
    )  # fmt: skip
    missing = next((p for p in expand(holdout) if not p.exists()), None)
    if missing is not None:
        raise ConfigError(
            "no such file or folder", where=f"--holdout {missing}", expected="a drive to measure the gain on"
        )
    others = [*expand(holdout), *list_files(holdout), *([model_file] if model_file is not None else [])]
    refuse_existing(written, force=True, sources=others)
    try:
        with console.hearing() as hear, told_if_interrupted("nothing was written"):
            result = diagnose(
                grouped(logs, setup.drive), setup.vehicle, holdout=grouped(holdout, setup.drive), model=model_file,
                seed=seed, level=level, surrogates=surrogates, views=targets[1] is not None, progress=hear,
            )  # fmt: skip
    except NothingUsableError:  # each reason was reported
        return int(ExitCode.NOTHING_USABLE)
    _finish(result, targets, console, as_json=as_json)
    return int(ExitCode.PARTIAL) if result.has_loss else int(ExitCode.DONE)


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
    as_json: bool,
    force: bool,
) -> int:
    """Diagnose a campaign's runs together, which show what no single drive does."""
    from aqualog.cli.campaigns import exit_code, open_campaign, run_campaign
    from aqualog.core.errors import ConfigError
    from aqualog.face.detect import model_of
    from aqualog.face.diagnose import diagnose
    from aqualog.face.paths import refuse_existing

    if strange:
        raise ConfigError(f"{strange[0]} does not apply to a campaign", expected="what a campaign takes: --help")
    campaign = open_campaign(inputs, vehicle=vehicle_file, signals=map_file, dbc=dbc)
    written = [p for p in targets if p is not None]
    campaign.check_targets(written, force=force)
    refuse_existing(written, force=True, sources=[model_file] if model_file is not None else [])
    known = model_of(model_file)
    runs = run_campaign(campaign, console)
    if runs.outcome.done:
        with console.hearing() as hear:
            result = diagnose(runs, model=known, seed=seed, level=level, surrogates=surrogates, progress=hear)
        _finish(result, targets, console, as_json=as_json)
    return exit_code(runs)


def _finish(result: Diagnosis, targets: Targets, console: Console, *, as_json: bool) -> None:
    """Write the files, then stdout, then the notes."""
    model, page = targets
    if model is not None:
        result = result.naming(model)
        result.write_model(model, force=True)
    if page is not None:
        result.write_page(page, force=True)
    console.data(result, as_json=as_json)
    for text in result.notes:
        console.note(text)
    for path in targets:
        if path is not None:
            console.note(f"written: {path}")
