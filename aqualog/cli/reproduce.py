"""`aqualog reproduce`."""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aqualog.cli.options import Debug, Force, Jobs, Json, Progress, Quiet, Verbose

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aqualog.cli.console import Console
    from aqualog.reproduce.run import Conclusion, Made

__all__ = ["reproduce"]

_PAGE, _CLAIMS, _JSON, _CAMPAIGN, _TABLES = "index.html", "claims.csv", "reproduction.json", "campaign", "figures"


def reproduce(
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Folder for the page and all that it rests on.", metavar="DIR")
    ],
    jobs: Jobs = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
    """Reproduce the thesis: simulate its campaign, run everything, and judge each of its claims.

    Leaves one page (index.html) with the 36 figures and the 118 claims: what the thesis says, what comes out here with
    its uncertainty, by which criterion, and the verdict; the tables behind the figures, and the campaign with its
    results. Broken off, the same command goes on where it stopped. A few minutes on two cores.

    \b
    Examples:
      aqualog reproduce -o reproduction
      aqualog reproduce -o reproduction --jobs 8 --progress plain --json
    """  # fmt: skip
    from aqualog.cli.console import Console, guarded

    with guarded(debug=debug):
        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        code = _reproduce(out, jobs or os.cpu_count() or 1, as_json=as_json, force=force, console=console)
    if code:
        raise typer.Exit(code)


def _reproduce(out: Path, jobs: int, *, as_json: bool, force: bool, console: Console) -> int:
    from aqualog.cli.campaign_results import results
    from aqualog.cli.campaign_run import run_campaign
    from aqualog.cli.console import told_if_interrupted
    from aqualog.errors import AqualogError
    from aqualog.face.paths import refuse_existing, write_text
    from aqualog.face.progress import Progress as Shown

    began = time.monotonic()
    refuse_existing([out / name for name in (_PAGE, _CLAIMS, _JSON)], force=force)
    campaign = out / _CAMPAIGN
    quiet = _quieter(console)
    code = run_campaign("thesis", campaign, jobs=jobs, force=False, console=quiet)
    from aqualog.config.configured import configure

    data, outcome = results(configure(campaign / "campaign.toml"), None, console=quiet, jobs=jobs)
    if code or outcome.failed:
        raise AqualogError("the campaign is not whole", where=str(campaign), hint="the same command once more")
    with console.steps() as steps:
        from aqualog.figures.export import figure_csv
        from aqualog.reproduce.document import claims_csv, document
        from aqualog.reproduce.page import render_reproduction
        from aqualog.reproduce.run import conclude, make_all

        with told_if_interrupted("the campaign and its results stay, the same command goes on from there"):
            made = make_all(data, jobs=jobs, report=Shown(steps, "figures and checks"))
        steps("writing the page")
        conclusions = conclude(made)
        facts = _facts(len(data.runs))
        for figure in made.figures:
            write_text(out / _TABLES / f"{figure.stem}.csv", figure_csv(figure))
        whole = document(conclusions, made.figures, made.missing, {"conditions": facts})
        write_text(out / _CLAIMS, claims_csv(conclusions))
        write_text(out / _JSON, json.dumps(whole, indent=1, allow_nan=False) + "\n")
        write_text(out / _PAGE, render_reproduction(conclusions, made.figures, made.missing, facts))
    if as_json:
        sys.stdout.write(json.dumps(whole, indent=1, allow_nan=False) + "\n")
    else:
        _print(conclusions, made)
    console.note(f"the page is {out / _PAGE}, {time.monotonic() - began:.0f} s")
    return 3 if made.missing else 0


def _quieter(console: Console) -> Console:
    """Progress as asked for, but no notes of the steps between."""
    from dataclasses import replace

    return replace(console, verbose=False)


def _facts(drives: int) -> list[str]:
    """How it was made; the same words for the same version, so that the page is the same too."""
    from aqualog import __version__

    return [
        f"aqualog {__version__}; {drives} simulated drives of the thesis' test programme, logged as a series car's "
        "sensors see them, measured as any user's campaign.",
        "Single claims on more drives with seeds of their own, named with each check; nothing was tuned on them.",
        "Brush tyres on water with one anchor: full aquaplaning of a worn tyre at 1.3 mm near 118 km/h. One parameter "
        "set for all claims.",
    ]


def _print(conclusions: Sequence[Conclusion], made: Made) -> None:
    from textwrap import shorten

    from aqualog.report.text import table
    from aqualog.reproduce.document import counts_of

    width = 90 if sys.stdout.isatty() else 10_000
    rows = [
        (c.claim.id, c.verdict, shorten("; ".join(k.found for k in c.checks), width, placeholder=" ..."))
        for c in conclusions
    ]
    counts = ", ".join(f"{n} {verdict}" for verdict, n in counts_of(conclusions).items())
    sys.stdout.write(table(("claim", "verdict", "found"), rows) + f"\n{counts}; {len(made.figures)} figures\n")
    for number, reason in made.missing.items():
        sys.stderr.write(f"error: figure {number}: {reason}\n")
