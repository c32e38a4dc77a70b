"""`aqualog diagnose`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aqualog.cli.frame import Output, Run, command

if TYPE_CHECKING:
    from aqualog.face.diagnose import Diagnosis

__all__ = ["diagnose"]


@command(
    "logs:diagnosed vehicle:believed model:known signals dbc holdout out page level seed surrogates bootstrap rate "
    "cache json force"
)
def diagnose(
    run: Run,
    holdout: Annotated[
        list[str] | None,
        typer.Option(
            "--holdout",
            help="Drive on which the gain is measured and nothing is fitted; may be repeated.",
            metavar="LOG",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Extended model: a file that --model takes.", metavar="FILE")
    ] = None,
    page: Annotated[
        Path | None, typer.Option("--page", help="Page with the pictures before and after (HTML).", metavar="FILE")
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
) -> Output:
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
    from aqualog.core.errors import ConfigError
    from aqualog.face.campaign_store import is_campaign

    if surrogates is not None and not bootstrap:
        raise ConfigError("--surrogates beside --no-bootstrap", expected="one of them")
    if not is_campaign(run.logs):
        drawn = surrogates if bootstrap else 0
        return _drives(run, holdout or [], out, page, {"level": level, "seed": seed, "surrogates": drawn})
    strange = {
        "--holdout": bool(holdout),
        "--rate": run.rate is not None,
        "--no-bootstrap": not bootstrap,
        "--cache": run.cache is True,
    }
    given = next((option for option, is_given in strange.items() if is_given), None)
    if given is not None:
        raise ConfigError(f"{given} does not apply to a campaign", expected="what a campaign takes: --help")
    return _campaign(run, out, page, {"level": level, "seed": seed, "surrogates": surrogates})


def _drives(run: Run, holdout: list[str], out: Path | None, page: Path | None, options: dict[str, Any]) -> Output:
    from aqualog.core.errors import ConfigError, ExitCode
    from aqualog.face.diagnose import diagnose
    from aqualog.face.drives import NothingUsableError, grouped
    from aqualog.face.paths import expand, list_files

    run.need_vehicle("it is what the simulation believes")
    unseen = expand(holdout)
    others = [*unseen, *list_files(holdout), *([run.model] if run.model is not None else [])]
    drive = run.drive([p for p in (out, page) if p is not None], others=others)
    missing = next((p for p in unseen if not p.exists()), None)
    if missing is not None:
        raise ConfigError(
            "no such file or folder", where=f"--holdout {missing}", expected="a drive to measure the gain on"
        )
    try:
        with run.hearing("nothing was written") as hear:
            result = diagnose(
                grouped(run.logs, drive), drive.vehicle, holdout=grouped(holdout, drive), model=run.model,
                views=page is not None, progress=hear, **options,
            )  # fmt: skip
    except NothingUsableError:  # each reason was reported
        return Output(code=int(ExitCode.NOTHING_USABLE))
    return Output(*_written(result, out, page))


def _campaign(run: Run, out: Path | None, page: Path | None, options: dict[str, Any]) -> Output:
    """Diagnose a campaign's runs together, which show what no single drive does."""
    from aqualog.face.detect import model_of
    from aqualog.face.diagnose import diagnose
    from aqualog.face.paths import refuse_existing

    campaign = run.campaign()
    targets = [p for p in (out, page) if p is not None]
    campaign.check_targets(targets, force=run.force)
    refuse_existing(targets, force=True, sources=[run.model] if run.model is not None else [])
    known = model_of(run.model)
    runs = run.measured(campaign)
    if not runs.outcome.done:
        return run.of_runs(runs)
    with run.hearing() as hear:
        result = diagnose(runs, model=known, progress=hear, **options)
    result, notes = _written(result, out, page)
    return run.of_runs(runs, result=result, notes=notes)


def _written(result: Diagnosis, model: Path | None, page: Path | None) -> tuple[Diagnosis, list[str]]:
    """Write the files; return the result, which then names its model file, and its notes."""
    if model is not None:
        result = result.naming(model)
        result.write_model(model, force=True)
    if page is not None:
        result.write_page(page, force=True)
    return result, [*result.notes, *(f"written: {path}" for path in (model, page) if path is not None)]
