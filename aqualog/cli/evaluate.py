"""`aqualog evaluate`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.options import (
    CarOfLogs,
    Dbc,
    Debug,
    Force,
    Inputs,
    Json,
    Progress,
    Quiet,
    Signals,
    Thresholds,
    Verbose,
)

__all__ = ["evaluate"]


def evaluate(
    inputs: Inputs,
    vehicle: CarOfLogs = None,
    signals: Signals = None,
    dbc: Dbc = None,
    labels: Annotated[
        Path | None,
        typer.Option(
            "--labels",
            help="Labels (CSV start_s,end_s,effect,wheel), or a folder with NAME.csv for each log NAME; without lines: "
            "no water.",
            metavar="FILE",
        ),
    ] = None,
    by: Annotated[
        str,
        typer.Option("--by", help="Tables by configuration: tyre,depth,pressure,manoeuvre,... of the campaign."),
    ] = "",
    rivals: Annotated[bool, typer.Option("--rivals", help="Also the methods of the prior art.")] = False,
    roc: Annotated[bool, typer.Option("--roc", help="Also at thresholds from a quarter to four times.")] = False,
    thresholds: Thresholds = None,
    tune: Annotated[
        Path | None,
        typer.Option(
            "--tune",
            help="Propose thresholds on some drives, report them on the others, and write them here.",
            metavar="FILE",
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Page (HTML).", metavar="FILE")] = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
    """Compare what the detectors find with what was there: recall, latency, false alarms, confusion.

    What was there comes from a labels file, from the truth in a simulated log, from the signal on_water, or from the
    lane's times in the campaign. A log that cannot be read is named; the others are evaluated.

    \b
    Examples:
      aqualog evaluate campaign.toml -o evaluation.html
      aqualog evaluate campaign.toml --by tyre,depth --rivals --roc -o evaluation.html
      aqualog evaluate campaign.toml --tune thresholds.toml
      aqualog evaluate drive.mf4 --vehicle car.toml --labels labels.csv --json
      aqualog evaluate dry/*.mf4 --vehicle car.toml --labels dry.csv
    """
    from aqualog.cli.console import Console, clean, guarded, told_if_interrupted
    from aqualog.core.errors import ExitCode
    from aqualog.evaluate.judge import ODD_LABELS
    from aqualog.face.evaluate import evaluate, inputs_of
    from aqualog.face.paths import refuse_existing

    with guarded(debug=debug):
        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        given = inputs_of(inputs, vehicle, map=signals, dbc=dbc or (), labels=labels)
        own = [*given.files, *(p for p in (thresholds,) if p)]
        refuse_existing([p for p in (tune, out) if p], force=force, sources=own)
        with console.hearing() as hear, told_if_interrupted("nothing was written"):
            found = evaluate(
                inputs, vehicle, labels=labels, map=signals, dbc=dbc or (), by=by, rivals=rivals, roc=roc,
                thresholds=thresholds, tune=tune is not None, progress=hear,
            )  # fmt: skip
        has_records = bool(found.evaluation.records)
        if tune is not None and has_records and found.evaluation.tuning is not None:
            found.write_thresholds(tune, force=True)
        if out is not None and has_records:
            found.write_page(out, force=True)
        for name, reason in found.evaluation.failed.items():
            sys.stderr.write(f"error: {clean(reason if name in reason else f'{name}: {reason}')}\n")
        if not has_records:
            raise typer.Exit(int(ExitCode.NOTHING_USABLE))
        console.data(found, as_json=as_json)
        for text in found.notes:
            if ODD_LABELS in text:
                console.note(text)
            else:
                console.detail(f"note: {text}")
        if out is not None:
            console.note(f"the page is {out}")
        if tune is not None:
            console.note(f"the thresholds are in {tune}")
        for name, text in found.late.items():
            sys.stderr.write(f"error: {clean(f'{name}: {text}')}\n")
        for text in found.cut:
            console.detail(f"note: {text}")
        if found.has_loss:
            raise typer.Exit(int(ExitCode.PARTIAL))
