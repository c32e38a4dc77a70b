"""`aqualog simulate`."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
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
    from aqualog.model.scenario import Scenario
    from aqualog.model.simulate import Simulation
    from aqualog.model.term import Model

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
    from aqualog.errors import ConfigError

    if len(names) != 1:
        raise ConfigError(
            "campaign names no programme" if not names else "campaign takes one programme",
            expected="aqualog simulate campaign NAME -o DIR",
            hint="./campaign for a scenario file of that name",
        )
    given = next((option for option, is_given in strange.items() if is_given), None)
    if given is not None:
        raise ConfigError(f"{given} says nothing to a campaign", expected="-o, --jobs and --force")
    from aqualog.cli.campaign_run import run_campaign

    return run_campaign(names[0], out, jobs=jobs, force=force, console=console)


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
    from aqualog.errors import ConfigError, ExitCode
    from aqualog.face.paths import refuse_existing, write_whole
    from aqualog.io.write_log import check_suffix

    suffix = check_suffix(out)
    if len(names) > 1:
        raise ConfigError(f"{len(names)} scenarios", where=names[1], expected="one at a time")
    if jobs is not None:
        raise ConfigError("--jobs says nothing to one drive", expected="aqualog simulate campaign NAME --jobs N")
    path = Path(names[0])
    refuse_existing([out], force=force, sources=[path, *vehicle_of(path), *([model_file] if model_file else [])])
    with console.steps() as steps:
        steps("reading")
        scenario, model = _read(path, model_file, seed)
        result, factor = _simulated(scenario, model, console, steps)
        steps("writing")
        from aqualog.model.log import write_simulation

        comment = _comment(path, scenario, model_file)
        write_whole(out, lambda p: write_simulation(p, result, suffix=suffix, comment=comment))
    signals = [n for g in result.measured for n in g.columns]
    if as_json:
        _print(out, scenario, signals, factor)
    for lane in (n for n in scenario.lanes if not n.in_metres and n.start >= scenario.duration_s):
        console.note(f"the lane from {lane.start:g} s begins after the drive, which ends at {scenario.duration_s:g} s")
    for group in result.measured:
        console.detail(f"  {group.name}: {group.t.size} samples")
    console.note(
        f"{len(signals)} signals of {scenario.duration_s:g} s (seed {scenario.seed}) are in {out}; "
        f"simulated {factor:.3g} times as fast as driven"
    )
    return int(ExitCode.DONE)


def _read(path: Path, model_file: Path | None, seed: int | None) -> tuple[Scenario, Model]:
    from dataclasses import replace

    from aqualog.config.scenario import load_scenario
    from aqualog.model.term import Model

    scenario = load_scenario(path)
    if seed is not None:
        scenario = replace(scenario, seed=seed)
    if model_file is None:
        return scenario, Model()
    from aqualog.config.model import load_model

    return scenario, load_model(model_file)


def _simulated(
    scenario: Scenario, model: Model, console: Console, steps: Callable[[str], None]
) -> tuple[Simulation, float]:
    """The drive, and how many times faster than real it was, apart from the compiling that a first run needs."""
    import time
    from dataclasses import replace

    steps("preparing")
    with console.told_if_slow("the simulation"):
        from aqualog.model.simulate import simulate as run

        run(replace(scenario, duration_s=min(scenario.duration_s, 0.2)))
    steps(f"simulating {scenario.duration_s:g} s")
    start = time.perf_counter()
    result = run(scenario, model)
    return result, scenario.duration_s / max(time.perf_counter() - start, 1e-9)


def _comment(path: Path, scenario: Scenario, model_file: Path | None) -> str:
    from aqualog import __version__

    model = f", model {model_file.stem}" if model_file else ""
    return f"simulated by aqualog {__version__}: scenario {path.stem}{model}, seed {scenario.seed}"


def _print(out: Path, scenario: Scenario, signals: list[str], factor: float) -> None:
    from aqualog import __version__

    document = {
        "schema_version": 1,
        "tool_version": __version__,
        "log": str(out),
        "duration_s": scenario.duration_s,
        "sample_rate_hz": scenario.rate_hz,
        "seed": scenario.seed,
        "signals": signals,
        "real_time_factor": float(f"{factor:.4g}"),
    }
    sys.stdout.write(json.dumps(document, indent=1, allow_nan=False) + "\n")
