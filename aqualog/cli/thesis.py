"""The simulation, and the thesis made again."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from aqualog.cli.frame import BATCH_BROKEN_OFF, Output, Run, command

if TYPE_CHECKING:
    pass

__all__ = ["figures", "reproduce", "simulate"]

_WIDTH = {"figures": 100, "reproduce": 90}
"""Characters of a line of a finding on a terminal; it is one line where it is kept or passed on."""


@command("what out:simulated model:simulated seed jobs:drives json force")
def simulate(run: Run, what: list[str], out: Path, seed: int | None) -> Output:
    """Simulate one drive of a scenario file, or the drives of a measuring campaign.

    The log carries what a car's sensors see, and the truth in signals that begin with true_, which no detector reads.
    The same scenario, model and seed give the same log.

    \b
    Examples:
      aqualog simulate scenario.toml -o drive.mf4
      aqualog simulate scenario.toml --seed 7 -o drive.csv --json
      aqualog simulate scenario.toml --model model.toml -o drive.mcap
      aqualog simulate campaign thesis -o thesis --jobs 2
      aqualog simulate campaign straight-test -o straight
    """
    if what[0] == "campaign":
        strange = {"--model": run.model is not None, "--seed": seed is not None, "--json": run.json}
        return _campaign(run, what[1:], out, strange)
    return _drive(run, what, out, seed)


def _campaign(run: Run, names: list[str], out: Path, strange: dict[str, bool]) -> Output:
    from aqualog.core.errors import ConfigError, ExitCode
    from aqualog.face.campaign import Campaign

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
        result = Campaign.simulate(names[0], out, jobs=run.jobs, force=run.force, progress=hear)
    lost = ExitCode.PARTIAL if result.outcome.made or result.outcome.kept else ExitCode.FAILED
    return Output(notes=[result.headline()], code=int(lost if result.has_loss else ExitCode.DONE))


def _drive(run: Run, names: list[str], out: Path, seed: int | None) -> Output:
    from aqualog.config.scenario import vehicle_of
    from aqualog.core.errors import ConfigError
    from aqualog.face.arguments import refuse_existing
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


@command("numbers out:figures campaign store dbc formats jobs data force")
def figures(run: Run, numbers: list[str], out: Path, campaign: Path | None, formats: str) -> Output:
    """Make figures of the thesis again, from runs, with what they say about its claims.

    Each figure leaves a page to look at and the table that is drawn, figure_3_06.html and .csv; more than one also
    figures.html with all of them. The verdicts go to stdout.

    With --campaign, the figures of chapter 2 are made from its runs, and name those that they used; logs without
    results are measured first, as by `aqualog batch`. A figure for which the campaign has not the runs is not made, and
    says why; the others are (exit code 3). 2.3 to 2.7 and 2.10 to 2.20 need a campaign.

    \b
    Examples:
      aqualog figures 3.6 -o figures
      aqualog figures 2.25 3.9 -o figures --force
      aqualog figures 2 -o figures --campaign campaign.toml
      aqualog figures 2.17 -o figures --campaign campaign.toml --format html,csv,svg
      aqualog figures 3 -o figures --json
      aqualog figures W.1 -o figures
      aqualog figures all -o figures --progress plain
    """
    from aqualog.core.errors import ConfigError, ExitCode
    from aqualog.face.thesis import check_formats, figures

    wanted = check_formats(formats.split(","))
    if campaign is None and (run.store is not None or run.dbc):
        option = "--store" if run.store is not None else "--dbc"
        raise ConfigError(f"{option} without --campaign", expected="--campaign campaign.toml")
    if campaign is not None and campaign.suffix.lower() != ".toml":
        raise ConfigError("is no campaign file", where=str(campaign), expected="--campaign campaign.toml")
    own = None if campaign is None else run.campaign([str(campaign)])
    with run.hearing(BATCH_BROKEN_OFF if own else "") as hear:
        found = figures(numbers, own, out=out, formats=wanted, force=run.force, jobs=run.jobs, progress=hear)
    pages = ", ".join(p.name for p in found.written if p.suffix == ".html")
    notes = [f"{len(found.written)} files are in {out}" + (f": {pages}" if pages else "")] if found.written else []
    text = found.text(width=_WIDTH["figures"]) if sys.stdout.isatty() else None
    if not found.made:
        return Output(found, notes, text=text, code=int(ExitCode.NOTHING_USABLE))
    if found.runs is None or found.not_made:
        return Output(found, notes, text=text)
    return run.of_runs(found.runs, result=found, notes=notes, text=text)


@command("out:reproduction jobs data force")
def reproduce(run: Run, out: Path) -> Output:
    """Reproduce the thesis: simulate its campaign, run everything, and judge each of its claims.

    Leaves one page (index.html) with the 36 figures and the 118 claims: what the thesis says, what comes out here with
    its uncertainty, by which criterion, and the verdict; the tables behind the figures, and the campaign with its
    results. One more figure, W.1, holds the simulator against what others have published. Broken off, the same command
    goes on where it stopped. A few minutes on two cores.

    \b
    Examples:
      aqualog reproduce -o reproduction
      aqualog reproduce -o reproduction --jobs 8 --progress plain --json
    """
    from aqualog.face.thesis import check_reproduction, reproduce

    check_reproduction(out, force=run.force)
    with run.hearing("the campaign and its results stay, the same command goes on from there") as hear:
        found = reproduce(out, jobs=run.jobs, progress=hear)
        hear("writing the page")
        written = found.save(out, force=True)
    for number, reason in found.made.missing.items():
        run.console.error(f"figure {number}: {reason}")
    text = found.text(width=_WIDTH["reproduce"]) if sys.stdout.isatty() else None
    return Output(found, [f"the page is {written[-1]}"], text=text)
