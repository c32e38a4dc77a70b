"""`aqualog reproduce`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.options import Debug, Force, Jobs, Json, Progress, Quiet, Verbose

__all__ = ["reproduce"]

_WIDTH = 90  # characters of a finding on a terminal; whole where it is kept or passed on


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
    from aqualog.cli.console import Console, clean, guarded, told_if_interrupted
    from aqualog.core.errors import ExitCode
    from aqualog.face.thesis import check_reproduction, reproduce

    with guarded(debug=debug):
        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        check_reproduction(out, force=force)
        kept = "the campaign and its results stay, the same command goes on from there"
        with console.hearing() as hear, told_if_interrupted(kept):
            found = reproduce(out, jobs=jobs, progress=hear)
            hear("writing the page")
            written = found.save(out, force=True)
        if as_json or not sys.stdout.isatty():
            console.data(found, as_json=as_json)
        else:
            sys.stdout.write(clean(found.text(width=_WIDTH)))
        for number, reason in found.made.missing.items():
            sys.stderr.write(f"error: {clean(f'figure {number}: {reason}')}\n")
        console.note(f"the page is {written[-1]}")
        if found.has_loss:
            raise typer.Exit(int(ExitCode.PARTIAL))
