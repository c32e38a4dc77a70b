"""`aqualog batch`."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aqualog.cli.options import Dbc, Debug, Force, Inputs, Jobs, Json, Progress, Quiet, Signals, Vehicle, Verbose

if TYPE_CHECKING:
    from aqualog.campaign.batch import BatchOutcome
    from aqualog.campaign.samples import CampaignData
    from aqualog.cli.console import Console

__all__ = ["batch"]


def batch(
    inputs: Inputs,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--out",
            "--store",
            help="Folder for the results; default beside the campaign file: NAME.store.",
            metavar="DIR",
        ),
    ] = None,
    vehicle: Vehicle = None,
    signals: Signals = None,
    dbc: Dbc = None,
    thresholds: Annotated[
        Path | None, typer.Option("--thresholds", help="Thresholds file; default: built in.", metavar="FILE")
    ] = None,
    jobs: Jobs = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
    """Run every log of a campaign through the detectors and keep the results.

    Only what is new is done: a log is measured again when its content, its vehicle, the signal map, the thresholds or
    aqualog's own equations have changed. A log that cannot be read is told and the others go on; an interrupt or a kill
    loses nothing that is finished. --force measures all again. One batch at a time writes to a folder; --jobs makes at
    most four processes per core.

    The folder opens by itself: runs.parquet, events.parquet, samples/*.parquet (polars, DuckDB), manifest.json.

    \b
    Examples:
      aqualog batch campaign.toml
      aqualog batch campaign.toml -o results --jobs 8 --progress plain
      aqualog batch logs/*.mf4 --vehicle car.toml -o results
      duckdb -c "select tyre, avg(events_joint_criteria) from 'campaign.store/runs.parquet' group by tyre"
    """  # fmt: skip
    from aqualog.cli.console import Console, guarded

    with guarded(debug=debug):
        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        code = _batch(
            inputs, out, vehicle, signals, dbc or [], thresholds, jobs, as_json=as_json, force=force, console=console
        )
    if code:
        raise typer.Exit(code)


def _batch(
    inputs: list[str],
    out: Path | None,
    vehicle: Path | None,
    map_file: Path | None,
    dbc: list[Path],
    thresholds: Path | None,
    jobs: int | None,
    *,
    as_json: bool,
    force: bool,
    console: Console,
) -> int:
    from aqualog.cli.campaign_results import exit_code, opened, results, store_of

    began = time.monotonic()
    configured = opened(inputs, vehicle=vehicle, map_file=map_file, dbc=dbc, thresholds=thresholds)
    data, outcome = results(configured, out, console=console, jobs=jobs, force=force)
    folder = store_of(configured, out)
    if as_json:
        sys.stdout.write(json.dumps(_document(data, outcome, folder), indent=1, allow_nan=False) + "\n")
    else:
        sys.stdout.write(_text(data, outcome))
    console.note(f"results are in {folder}, {time.monotonic() - began:.0f} s")
    return exit_code(outcome, data)


def _document(data: CampaignData, outcome: BatchOutcome, folder: Path) -> dict[str, object]:
    from aqualog import __version__

    return {
        "schema_version": 1,
        "tool_version": __version__,
        "campaign": data.name,
        "store": str(folder),
        "runs": len(data.runs),
        "made": outcome.made,
        "kept": outcome.kept,
        "failed": [{"log": name, "reason": reason} for name, reason in outcome.failed.items()],
        "events": {d: n for d, (n, _) in _counts(data).items()},
    }


def _counts(data: CampaignData) -> dict[str, tuple[int, int]]:
    """Per detector: its events, and the runs that have one."""
    from aqualog.detect.needs import DETECTORS

    of = {d: [sum(e["detector"] == d for e in r.events) for r in data.done] for d in DETECTORS}
    return {d: (sum(x), sum(n > 0 for n in x)) for d, x in of.items()}


def _text(data: CampaignData, outcome: BatchOutcome) -> str:
    from aqualog.report.text import table

    rows = [(d, str(n), f"{k} of {len(data.done)}") for d, (n, k) in _counts(data).items()]
    head = f"{outcome.done} logs done ({outcome.made} now, {outcome.kept} before), {len(outcome.failed)} failed"
    return f"{head}\n\n{table(('detector', 'events', 'runs with one'), rows)}\n"
