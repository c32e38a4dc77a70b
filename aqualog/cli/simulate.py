"""`aqualog simulate`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aqualog.cli.options import (
    Debug,
    Force,
    Json,
    Progress,
    Quiet,
    Verbose,
)  # fmt: skip

if TYPE_CHECKING:
    from aqualog.cli.console import Console

__all__ = ["simulate"]


def simulate(
    what: Annotated[
        list[str],
        typer.Argument(
            help="A scenario file, or the word campaign and the name of a programme.",
            metavar="SCENARIO | campaign NAME",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "-o", "--out", help="Log to write: .mf4, .mcap, .csv or .parquet; of a campaign: folder.", metavar="PATH"
        ),
    ],
    model: Annotated[
        Path | None, typer.Option("--model", help="Model file (TOML): effects on top of the base.", metavar="FILE")
    ] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", help="In place of the scenario's.", min=0, max=2**63 - 1, metavar="N")
    ] = None,
    jobs: Annotated[
        int | None, typer.Option("--jobs", help="Campaign: drives at a time.", min=1, max=1024, metavar="N")
    ] = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
    """Simulate one drive of a scenario file, or the drives of a measuring campaign.

    The log carries what a car's sensors see, and the truth in signals that begin with true_, which no detector reads.
    The same scenario, model and seed give the same log.

    \b
    Examples:
      aqualog simulate scenario.toml -o drive.mf4
      aqualog simulate scenario.toml --seed 7 -o drive.csv --json
      aqualog simulate scenario.toml --model model.toml -o drive.mcap
      aqualog simulate campaign thesis -o thesis --jobs 2
    """
    from aqualog.cli.console import Console, guarded

    with guarded(debug=debug):
        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        if what[0] == "campaign":
            code = _campaign(
                what[1:], out, jobs=jobs, force=force, console=console,
                strange={"--model": model is not None, "--seed": seed is not None, "--json": as_json},
            )  # fmt: skip
        else:
            code = _drive(what, out, model, seed, jobs=jobs, as_json=as_json, force=force, console=console)
    if code:
        raise typer.Exit(code)


def _campaign(
    names: list[str], out: Path, *, jobs: int | None, force: bool, console: Console, strange: dict[str, bool]
) -> int:
    from aqualog.core.errors import ConfigError, ExitCode

    if len(names) != 1:
        raise ConfigError(
            "campaign names no programme" if not names else "campaign takes one programme",
            expected="aqualog simulate campaign NAME -o DIR",
            hint="./campaign for a scenario file of that name",
        )
    given = next((option for option, is_given in strange.items() if is_given), None)
    if given is not None:
        raise ConfigError(f"{given} does not apply to a campaign", expected="-o, --jobs and --force")
    from aqualog.cli.console import told_if_interrupted
    from aqualog.face.simulate import simulate_campaign

    with console.hearing() as hear, told_if_interrupted(_INTERRUPTED):
        result = simulate_campaign(names[0], out, jobs=jobs, force=force, progress=hear)
    console.note(result.headline())
    if not result.has_loss:
        return int(ExitCode.DONE)
    return int(ExitCode.PARTIAL if result.outcome.made or result.outcome.kept else ExitCode.FAILED)


_INTERRUPTED = "the drives that are done stay, the same command goes on with the rest"


def _drive(
    names: list[str],
    out: Path,
    model_file: Path | None,
    seed: int | None,
    *,
    jobs: int | None,
    as_json: bool,
    force: bool,
    console: Console,
) -> int:
    from aqualog.config.scenario import vehicle_of
    from aqualog.core.errors import ConfigError, ExitCode
    from aqualog.face.paths import refuse_existing
    from aqualog.face.simulate import simulate
    from aqualog.io.write_log import check_suffix

    check_suffix(out)
    if len(names) > 1:
        raise ConfigError(f"{len(names)} scenarios", where=names[1], expected="one at a time")
    if jobs is not None:
        raise ConfigError("--jobs does not apply to one drive", expected="aqualog simulate campaign NAME --jobs N")
    path = Path(names[0])
    refuse_existing([out], force=force, sources=[path, *vehicle_of(path), *([model_file] if model_file else [])])
    with console.hearing() as hear:
        result = simulate(path, model=model_file, seed=seed, progress=hear).naming(out)
        hear("writing")
        result.write(out, force=True)
    if as_json:
        console.data(result, as_json=True)
    for text in result.notes:
        console.note(text)
    console.note(
        f"{len(result.channels)} signals of {result.scenario.duration_s:g} s (seed {result.made.seed}) are in {out}; "
        f"simulated {result.factor:.3g} times as fast as driven"
    )
    return int(ExitCode.DONE)
