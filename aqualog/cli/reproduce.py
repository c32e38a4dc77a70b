"""`aqualog reproduce`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from aqualog.cli.frame import Output, Run, command

__all__ = ["reproduce"]

_WIDTH = 90  # characters of a finding on a terminal; whole where it is kept or passed on


@command("out jobs json force")
def reproduce(
    run: Run,
    out: Annotated[
        Path, typer.Option("-o", "--out", help="Folder for the page and all that it rests on.", metavar="DIR")
    ],
) -> Output:
    """Reproduce the thesis: simulate its campaign, run everything, and judge each of its claims.

    Leaves one page (index.html) with the 36 figures and the 118 claims: what the thesis says, what comes out here with
    its uncertainty, by which criterion, and the verdict; the tables behind the figures, and the campaign with its
    results. Broken off, the same command goes on where it stopped. A few minutes on two cores.

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
    return Output(
        found, [f"the page is {written[-1]}"], text=found.text(width=_WIDTH) if sys.stdout.isatty() else None
    )  # fmt: skip
