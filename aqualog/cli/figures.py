"""`aqualog figures`."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aqualog.cli.options import Dbc, Debug, Force, Jobs, Json, Progress, Quiet, StoreOption, Verbose

if TYPE_CHECKING:
    from collections.abc import Sequence

    from aqualog.campaign.batch import Configured
    from aqualog.cli.console import Console
    from aqualog.figures.evidence import Evidence
    from aqualog.figures.image import Pictures
    from aqualog.figures.record import Figure, Finding

__all__ = ["figures"]

_ALL_ON_ONE = "figures.html"
_FORMATS = ("html", "csv", "png", "svg")
_WHOLE = 10_000  # characters: no sentence of a finding is longer


def figures(
    numbers: Annotated[
        list[str],
        typer.Argument(
            help="Figures of the thesis by number (3.6), by chapter (2, 3), or all.",
            metavar="NUMBER...",
            show_default=False,
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for pages, tables and pictures.", metavar="DIR")],
    campaign: Annotated[
        Path | None,
        typer.Option("--campaign", help="Make them from the runs of this campaign.", metavar="CAMPAIGN.toml"),
    ] = None,
    store: StoreOption = None,
    dbc: Dbc = None,
    formats: Annotated[
        str, typer.Option("--format", help="Any of html,csv,png,svg; pictures need the extra images.", metavar="LIST")
    ] = "html,csv",
    jobs: Jobs = None,
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
      aqualog figures all -o figures --progress plain
    """  # fmt: skip
    from aqualog.cli.console import Console, guarded

    with guarded(debug=debug):
        console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
        code = _figures(
            numbers, out, campaign=campaign, store=store, dbc=dbc or [], formats=_formats(formats), jobs=jobs,
            as_json=as_json, force=force, console=console,
        )  # fmt: skip
    raise typer.Exit(code)


def _formats(text: str) -> tuple[str, ...]:
    from aqualog.errors import ConfigError

    asked = [f.strip().lower() for f in text.split(",") if f.strip()]
    wrong = [f for f in asked if f not in _FORMATS]
    if wrong or not asked:
        raise ConfigError(f'--format "{text[:60]}"', expected=f"one or more of {','.join(_FORMATS)}, with commas")
    return tuple(f for f in _FORMATS if f in asked)


def _figures(
    asked: list[str],
    out: Path,
    *,
    campaign: Path | None,
    store: str | None,
    dbc: Sequence[Path],
    formats: Sequence[str],
    jobs: int | None,
    as_json: bool,
    force: bool,
    console: Console,
) -> int:
    from contextlib import nullcontext

    from aqualog.errors import ConfigError, ExitCode
    from aqualog.figures.catalogue import chosen
    from aqualog.figures.image import FORMATS, Pictures

    numbers = _to_make(asked, chosen(asked), campaign is not None, console)
    if store is not None and campaign is None:
        raise ConfigError("--store without --campaign", expected="--campaign campaign.toml")
    if dbc and campaign is None:
        raise ConfigError("--dbc without --campaign", expected="--campaign campaign.toml")
    configured = None if campaign is None else _opened(campaign, dbc)
    _refuse(numbers, out, formats, configured, force=force)
    evidence, code = (None, 0) if configured is None else _evidence(configured, store, jobs, console)
    with Pictures() if set(formats) & set(FORMATS) else nullcontext() as pictures:
        made, not_made, names = _make_all(numbers, out, evidence, formats, pictures, console)
    _print(made, not_made, [str(out / n) for n in names], as_json=as_json)
    pages = ", ".join(n for n in names if n.endswith(".html"))
    console.note(f"{len(names)} files are in {out}" + (f": {pages}" if pages else ""))
    if not made:
        return int(ExitCode.NOTHING_USABLE)
    return int(ExitCode.PARTIAL) if not_made else code


def _to_make(asked: list[str], numbers: tuple[str, ...], has_campaign: bool, console: Console) -> tuple[str, ...]:
    """Without a campaign a chapter means those of its figures that need none; a number that needs one is an error."""
    from aqualog.errors import ConfigError
    from aqualog.figures.catalogue import needs_campaign

    left = [n for n in numbers if not has_campaign and needs_campaign(n)]
    typed = [n for n in left if any("." in a and a.replace(".0", ".") == n for a in asked)]
    if typed:
        raise ConfigError(
            f"figure {', '.join(typed)}: made from the runs of a campaign", expected="--campaign campaign.toml",
            hint="`aqualog simulate campaign thesis -o DIR`, then --campaign DIR/campaign.toml; or `aqualog reproduce`",
        )  # fmt: skip
    if left:
        console.note(f"{len(left)} figures need --campaign and are left out: {', '.join(left)}")
    return tuple(n for n in numbers if n not in left)


def _refuse(
    numbers: Sequence[str], out: Path, formats: Sequence[str], configured: Configured | None, *, force: bool
) -> None:
    """Before anything is computed: refuse files that are there. Pictures bear letters that are known only later."""
    from aqualog.config.configured import files_of
    from aqualog.face.paths import refuse_existing
    from aqualog.figures.record import stem_of

    paths = [out / f"{stem_of(n)}.{f}" for n in numbers for f in formats]
    paths += [out / f"{stem_of(n)}_a.{f}" for n in numbers for f in formats if f in ("png", "svg")]
    if len(numbers) > 1 and "html" in formats:
        paths.append(out / _ALL_ON_ONE)
    refuse_existing(paths, force=force, sources=() if configured is None else files_of(configured))


def _opened(campaign: Path, dbc: Sequence[Path]) -> Configured:
    from aqualog.cli.campaign_results import opened
    from aqualog.errors import ConfigError

    if campaign.suffix.lower() != ".toml":
        raise ConfigError("is no campaign file", where=str(campaign), expected="--campaign campaign.toml")
    return opened([str(campaign)], dbc=dbc)


def _evidence(configured: Configured, store: str | None, jobs: int | None, console: Console) -> tuple[Evidence, int]:
    """The campaign's results, brought up to date, and the exit code that its logs give."""
    from aqualog.cli.campaign_results import exit_code, results
    from aqualog.figures.evidence import Evidence

    data, outcome = results(configured, store, console=console, jobs=jobs)
    return Evidence(data), exit_code(outcome, data)


def _make_all(
    numbers: Sequence[str],
    out: Path,
    evidence: Evidence | None,
    formats: Sequence[str],
    pictures: Pictures | None,
    console: Console,
) -> tuple[list[Figure], dict[str, str], list[str]]:
    """Figures that could be made, why the others could not, and the files written."""
    import time

    from aqualog.cli.console import clean
    from aqualog.face.paths import write_text
    from aqualog.figures.catalogue import make
    from aqualog.figures.page import render_figures
    from aqualog.figures.selection import NotInCampaign

    made: list[Figure] = []
    not_made: dict[str, str] = {}
    names: list[str] = []
    out.mkdir(parents=True, exist_ok=True)
    with console.steps() as steps:
        for i, number in enumerate(numbers):
            steps(f"figure {number} ({i + 1} of {len(numbers)})")
            began = time.monotonic()
            try:
                figure = make(number, evidence)
            except NotInCampaign as error:
                not_made[number] = error.what
                steps.clear()
                sys.stderr.write(f"error: {clean(f'figure {number} is not made: {error.what}')}\n")
                continue
            made.append(figure)
            names += _write(figure, out, formats, pictures)
            console.detail(f"figure {number}: {len(figure.findings)} findings in {time.monotonic() - began:.1f} s")
        if len(made) > 1 and "html" in formats:
            steps("one page of all")
            write_text(out / _ALL_ON_ONE, render_figures(made, title=f"{len(made)} figures of the thesis"))
            names.append(_ALL_ON_ONE)
    return made, not_made, names


def _write(figure: Figure, out: Path, formats: Sequence[str], pictures: Pictures | None) -> list[str]:
    """Write a figure in all formats; names of the files."""
    from aqualog.face.paths import write_text
    from aqualog.figures.export import figure_csv
    from aqualog.figures.image import image_names
    from aqualog.figures.page import render_figures
    from aqualog.io.whole import write_whole

    names = []
    for suffix in formats:
        if suffix == "html":
            write_text(
                out / f"{figure.stem}.html", render_figures([figure], title=f"Figure {figure.number}: {figure.title}")
            )
            names.append(f"{figure.stem}.html")
        elif suffix == "csv":
            write_text(out / f"{figure.stem}.csv", figure_csv(figure))
            names.append(f"{figure.stem}.csv")
        elif pictures is not None:
            for name, picture in zip(image_names(figure, suffix), pictures.draw(figure, suffix), strict=True):
                write_whole(out / name, lambda path, content=picture: path.write_bytes(content))  # type: ignore[misc]
                names.append(name)
    return names


def _print(made: list[Figure], not_made: dict[str, str], files: list[str], *, as_json: bool) -> None:
    from aqualog.figures.export import document

    if as_json:
        sys.stdout.write(json.dumps(document(made, files, not_made), indent=1, allow_nan=False) + "\n")
        return
    from textwrap import shorten

    from aqualog.report.text import table

    # whole where it is kept or passed on, one line each where it is looked at
    width = 100 if sys.stdout.isatty() else _WHOLE
    found = [(f, c) for f in made for c in f.findings]
    has_values = any(c.ci95 is not None for _, c in found)
    rows = [
        (
            c.claim,
            f.number,
            c.verdict,
            *((_value(c),) if has_values else ()),
            shorten(c.found, width, placeholder=" ..."),
        )
        for f, c in found
    ]
    if rows:
        head = ("claim", "figure", "verdict", *(("value, 95 %",) if has_values else ()), "found")
        sys.stdout.write(table(head, rows, most=_WHOLE) + "\n")


def _value(c: Finding) -> str:
    """The number judged with its interval, if it has one."""
    if c.value is None or c.ci95 is None:
        return "–"
    return f"{c.value:.3g} [{c.ci95[0]:.3g}, {c.ci95[1]:.3g}] {c.unit}".strip()
