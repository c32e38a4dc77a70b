"""`aqualog simulate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.frame import Output, Run, command

__all__ = ["simulate"]


@command("what out model:simulated seed jobs:drives json force")
def simulate(
    run: Run,
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
    seed: Annotated[
        int | None, typer.Option("--seed", help="In place of the scenario's.", min=0, max=2**63 - 1, metavar="N")
    ] = None,
) -> Output:
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
    if what[0] == "campaign":
        strange = {"--model": run.model is not None, "--seed": seed is not None, "--json": run.json}
        return _campaign(run, what[1:], out, strange)
    return _drive(run, what, out, seed)


def _campaign(run: Run, names: list[str], out: Path, strange: dict[str, bool]) -> Output:
    from aqualog.core.errors import ConfigError, ExitCode
    from aqualog.face.simulate import simulate_campaign

    if len(names) != 1:
        raise ConfigError(
            "campaign names no programme" if not names else "campaign takes one programme",
            expected="aqualog simulate campaign NAME -o DIR",
            hint="./campaign for a scenario file of that name",
        )
    given = next((option for option, is_given in strange.items() if is_given), None)
    if given is not None:
        raise ConfigError(f"{given} does not apply to a campaign", expected="-o, --jobs and --force")
    with run.hearing("the drives that are done stay, the same command goes on with the rest") as hear:
        result = simulate_campaign(names[0], out, jobs=run.jobs, force=run.force, progress=hear)
    lost = ExitCode.PARTIAL if result.outcome.made or result.outcome.kept else ExitCode.FAILED
    return Output(notes=[result.headline()], code=int(lost if result.has_loss else ExitCode.DONE))


def _drive(run: Run, names: list[str], out: Path, seed: int | None) -> Output:
    from aqualog.config.scenario import vehicle_of
    from aqualog.core.errors import ConfigError
    from aqualog.face.paths import refuse_existing
    from aqualog.face.simulate import simulate
    from aqualog.io.write_log import check_suffix

    check_suffix(out)
    if len(names) > 1:
        raise ConfigError(f"{len(names)} scenarios", where=names[1], expected="one at a time")
    if run.jobs is not None:
        raise ConfigError("--jobs does not apply to one drive", expected="aqualog simulate campaign NAME --jobs N")
    path = Path(names[0])
    given = [path, *vehicle_of(path), *([run.model] if run.model else [])]
    refuse_existing([out], force=run.force, sources=given)
    with run.hearing() as hear:
        result = simulate(path, model=run.model, seed=seed, progress=hear).naming(out)
        hear("writing")
        result.write(out, force=True)
    where = (
        f"{len(result.channels)} signals of {result.scenario.duration_s:g} s (seed {result.made.seed}) are in {out}; "
        f"simulated {result.factor:.3g} times as fast as driven"
    )
    return Output(result, [*result.notes, where])
