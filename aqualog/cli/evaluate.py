"""`aqualog evaluate`."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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

if TYPE_CHECKING:
    from aqualog.cli.console import Console
    from aqualog.detect.joint_cusum import JointCusumParams
    from aqualog.evaluate.drives import LogSource
    from aqualog.evaluate.run import Evaluation

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
    from aqualog.cli.console import guarded

    with guarded(debug=debug):
        code = _evaluate(
            inputs, vehicle, signals, dbc or [], labels, by, thresholds, tune, out, rivals=rivals, roc=roc,
            as_json=as_json, force=force, quiet=quiet, verbose=verbose, progress=progress,
        )  # fmt: skip
    if code:
        raise typer.Exit(code)


def _evaluate(
    inputs: list[str],
    vehicle_file: Path | None,
    map_file: Path | None,
    dbc: list[Path],
    labels: Path | None,
    by: str,
    thresholds_file: Path | None,
    tune_file: Path | None,
    out: Path | None,
    *,
    rivals: bool,
    roc: bool,
    as_json: bool,
    force: bool,
    quiet: bool,
    verbose: bool,
    progress: str,
) -> int:
    from aqualog.campaign.records import group_keys
    from aqualog.cli.console import Console, clean, told_if_interrupted
    from aqualog.cli.evaluate_inputs import campaign_inputs, is_campaign, log_inputs
    from aqualog.errors import ExitCode
    from aqualog.evaluate.judge import ODD_LABELS
    from aqualog.face.paths import refuse_existing
    from aqualog.report.evaluation_words import notes_of

    console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
    given = (
        campaign_inputs(Path(inputs[0]), vehicle_file, map_file, dbc, labels)
        if is_campaign(inputs)
        else log_inputs(inputs, vehicle_file, map_file, dbc, labels)
    )
    own = [*given.files, *(p for p in (thresholds_file,) if p)]
    refuse_existing([p for p in (tune_file, out) if p], force=force, sources=own)
    keys = group_keys([k.strip() for k in by.split(",") if k.strip()], given.keys)
    console.detail(f"{len(given.sources)} drives of {given.name}")
    with console.steps() as steps:
        from aqualog.config.settings import load_settings
        from aqualog.config.thresholds import load_thresholds
        from aqualog.detect.thresholds import DEFAULT
        from aqualog.evaluate.run import evaluate as evaluate_drives
        from aqualog.evaluate.run import tune as tune_drives

        start, of_rivals = load_thresholds(thresholds_file) if thresholds_file else (DEFAULT, {})
        sources = given.sources
        if thresholds_file is not None:
            joint = load_settings(thresholds_file).joint_cusum
            sources = tuple(replace(s, joint=joint) for s in sources)
        work = tune_drives if tune_file else evaluate_drives
        with told_if_interrupted("nothing was written"):
            result = work(
                sources, thresholds=start, rivals=of_rivals if rivals else None, with_roc=roc, report=steps
            )  # fmt: skip
        steps("writing")
        if result.records:
            _write(result, given.name, keys, tune_file, out, sources[0].joint)
    for name, reason in result.failed.items():
        sys.stderr.write(f"error: {clean(reason if name in reason else f'{name}: {reason}')}\n")
    if not result.records:
        return int(ExitCode.NOTHING_USABLE)
    _print(result, keys, as_json=as_json)
    for text in notes_of(result.records):
        if ODD_LABELS in text:
            console.note(text)
        else:
            console.detail(f"note: {text}")
    if out is not None:
        console.note(f"the page is {out}")
    if tune_file is not None:
        console.note(f"the thresholds are in {tune_file}")
    is_lossy = any(r.is_lossy for r in result.records)
    is_late = _tell_late_labels(result, given.sources, console)
    return int(ExitCode.PARTIAL) if result.failed or is_lossy or is_late else int(ExitCode.DONE)


def _tell_late_labels(result: Evaluation, sources: tuple[LogSource, ...], console: Console) -> bool:
    """Whether labels of a drive begin after its log has ended, which left them out; told by drive, as those cut are."""
    from aqualog.cli.console import clean
    from aqualog.evaluate.labels import after

    ends = {r.name: r.duration_s for r in result.records}
    of_drives = {s.name: after(s.labels or (), ends[s.name]) for s in sources if s.name in ends}
    late = {name: sorted({x.start_s for x in labels}) for name, labels in of_drives.items()}
    for name, starts in late.items():
        if starts:
            what = "a label begins" if len(starts) == 1 else f"{len(starts)} labels begin"
            told = f"{name}: {what} after the log's end at {ends[name]:g} s, at {starts[0]:g} s; left out"
            sys.stderr.write(f"error: {clean(told)}\n")
    for s in sources:
        end = ends.get(s.name, math.inf)
        if any(x.start_s < end < x.end_s for x in s.labels or ()):
            console.detail(f"note: {s.name}: labels are cut where the log ends, at {end:g} s")
    return any(late.values())


def _write(
    result: Evaluation,
    title: str,
    keys: tuple[str, ...],
    tune_file: Path | None,
    out: Path | None,
    joint: JointCusumParams,
) -> None:
    from aqualog.config.settings import joint_text
    from aqualog.config.thresholds import thresholds_text
    from aqualog.face.paths import write_text, write_whole
    from aqualog.report.evaluation_page import write_evaluation_page

    if tune_file is not None and result.tuning is not None:
        about = [
            f"proposed on {len(result.tuning.tuned_on)} drives of {title}, reported on {len(result.records)} others:",
            result.tuning.rule,
        ]
        write_text(tune_file, thresholds_text(result.thresholds, result.rivals, comments=about) + joint_text(joint))
    if out is not None:
        write_whole(out, lambda p: write_evaluation_page(result, p, title=title, by=keys))


def _print(result: Evaluation, keys: tuple[str, ...], *, as_json: bool) -> None:
    from aqualog.cli.console import clean

    if as_json:
        from aqualog.report.evaluation_document import evaluation_document

        sys.stdout.write(json.dumps(evaluation_document(result, by=keys), indent=1, allow_nan=False) + "\n")
        return
    from aqualog.report.evaluation_text import evaluation_text

    sys.stdout.write(clean(evaluation_text(result, by=keys)))
