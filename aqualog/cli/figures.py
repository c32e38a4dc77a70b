"""`aqualog figures`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aqualog.cli.options import Debug, Force, Json, Progress, Quiet, Verbose

if TYPE_CHECKING:
    from aqualog.cli.console import Console
    from aqualog.figures.record import Figure

__all__ = ["figures"]

_ALL_ON_ONE = "figures.html"


def figures(
    numbers: Annotated[
        list[str],
        typer.Argument(
            help="Figures of the thesis by number (3.6), by chapter (2, 3), or all.",
            metavar="NUMBER...",
            show_default=False,
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for pages and tables.", metavar="DIR")],
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    progress: Progress = "auto",
    debug: Debug = False,
) -> None:
    """Make figures of the thesis again, from runs, with what they say about its claims.

    Each figure leaves a page to look at and the table that is drawn, figure_3_06.html and .csv; more than one also
    figures.html with all of them. The verdicts go to stdout.

    \b
    Examples:
      aqualog figures 3.6 -o figures
      aqualog figures 2.25 3.9 -o figures --force
      aqualog figures 3 -o figures --json
      aqualog figures all -o figures --progress plain
    """  # fmt: skip
    from aqualog.cli.console import Console, guarded

    with guarded(debug=debug):
        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        _figures(numbers, out, as_json=as_json, force=force, console=console)


def _figures(asked: list[str], out: Path, *, as_json: bool, force: bool, console: Console) -> None:
    import time

    from aqualog.cli.files import refuse_existing, write_text
    from aqualog.figures.catalogue import chosen, make
    from aqualog.figures.export import figure_csv
    from aqualog.figures.page import render_figures
    from aqualog.figures.record import stem_of

    numbers = chosen(asked)
    names = [f"{stem_of(n)}{suffix}" for n in numbers for suffix in (".html", ".csv")]
    if len(numbers) > 1:
        names.append(_ALL_ON_ONE)
    refuse_existing([out / n for n in names], force=force)
    out.mkdir(parents=True, exist_ok=True)
    made: list[Figure] = []
    with console.steps() as steps:
        for i, number in enumerate(numbers):
            steps(f"figure {number} ({i + 1} of {len(numbers)})")
            began = time.monotonic()
            figure = make(number)
            made.append(figure)
            title = f"Figure {number}: {figure.title}"
            write_text(out / f"{figure.stem}.csv", figure_csv(figure))
            write_text(out / f"{figure.stem}.html", render_figures([figure], title=title))
            console.detail(f"figure {number}: {len(figure.findings)} findings in {time.monotonic() - began:.1f} s")
        if len(made) > 1:
            steps("one page of all")
            write_text(out / _ALL_ON_ONE, render_figures(made, title=f"{len(made)} figures of the thesis"))
    _print(made, [str(out / n) for n in names], as_json=as_json)
    console.note(f"{len(names)} files are in {out}: {', '.join(n for n in names if n.endswith('.html'))} and tables")


def _print(made: list[Figure], files: list[str], *, as_json: bool) -> None:
    from aqualog.figures.export import document

    if as_json:
        sys.stdout.write(json.dumps(document(made, files), indent=1, allow_nan=False) + "\n")
        return
    from textwrap import shorten

    from aqualog.report.text import table

    # whole where it is kept or passed on, one line each where it is looked at
    width = 100 if sys.stdout.isatty() else 10_000
    found = [(f, c) for f in made for c in f.findings]
    rows = [(c.claim, f.number, c.verdict, shorten(c.found, width, placeholder=" ...")) for f, c in found]
    sys.stdout.write(table(("claim", "figure", "verdict", "found"), rows) + "\n")
