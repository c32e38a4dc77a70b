"""`aqualog evaluate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.frame import Output, Run, command

__all__ = ["evaluate"]


@command("logs:campaign vehicle:of_logs signals dbc labels by rivals roc thresholds tune out json force")
def evaluate(
    run: Run,
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
    tune: Annotated[
        Path | None,
        typer.Option(
            "--tune",
            help="Propose thresholds on some drives, report them on the others, and write them here.",
            metavar="FILE",
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Page (HTML).", metavar="FILE")] = None,
) -> Output:
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
    from aqualog.core.errors import ExitCode
    from aqualog.evaluate.judge import ODD_LABELS
    from aqualog.face.evaluate import evaluate, inputs_of
    from aqualog.face.paths import refuse_existing

    given = inputs_of(run.logs, run.vehicle, map=run.signals, dbc=run.dbc, labels=labels)
    own = [*given.files, *(p for p in (run.thresholds,) if p)]
    refuse_existing([p for p in (tune, out) if p], force=run.force, sources=own)
    with run.hearing("nothing was written") as hear:
        found = evaluate(
            run.logs, run.vehicle, labels=labels, map=run.signals, dbc=run.dbc, by=by, rivals=rivals, roc=roc,
            thresholds=run.thresholds, tune=tune is not None, progress=hear,
        )  # fmt: skip
    has_records = bool(found.evaluation.records)
    if tune is not None and has_records and found.evaluation.tuning is not None:
        found.write_thresholds(tune, force=True)
    if out is not None and has_records:
        found.write_page(out, force=True)
    for name, reason in found.evaluation.failed.items():
        run.console.error(reason if name in reason else f"{name}: {reason}")
    if not has_records:
        return Output(code=int(ExitCode.NOTHING_USABLE))
    for name, reason in found.late.items():
        run.console.error(f"{name}: {reason}")
    odd = [n for n in found.notes if ODD_LABELS in n]
    written = [f"the page is {out}"] if out is not None else []
    written += [f"the thresholds are in {tune}"] if tune is not None else []
    details = [f"note: {n}" for n in (*found.notes, *found.cut) if n not in odd]
    return Output(found, [*odd, *written], details)
