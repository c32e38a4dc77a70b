"""`aq.thesis`: the figures of the thesis made again, and its claims judged."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import cached_property, partial
from operator import methodcaller
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import AqualogError, ConfigError
from aqualog.core.units import displayed_text, displayed_unit
from aqualog.face.arguments import file_of, refuse_existing, write_whole
from aqualog.face.campaign import Campaign
from aqualog.face.campaign_runs import CampaignRuns
from aqualog.face.listener import Counted, Listener, Progress, listener
from aqualog.face.result import PathLike, Result, Writers, bars, rows_table, text_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.thesis.claims import Check, Conclusion
    from aqualog.thesis.evidence.campaign import Evidence
    from aqualog.thesis.image import Pictures
    from aqualog.thesis.record import Figure
    from aqualog.thesis.run import Made

__all__ = ["FORMATS", "FUNCTIONS", "Figures", "Reproduction", "figure", "figures", "reproduce"]

FORMATS = ("html", "csv", "png", "svg")
FUNCTIONS = tuple(n for n in __all__ if n.islower())

_ALL_ON_ONE = "figures.html"
_WHOLE = 10_000  # characters: no sentence of a finding is longer
_PAGE, _CLAIMS, _JSON, _CAMPAIGN, _TABLES = "index.html", "claims.csv", "reproduction.json", "campaign", "figures"


@dataclass(frozen=True, eq=False, repr=False)
class Figures(Result):
    """Figures of the thesis with what they say about its claims.

    `made` holds the figures, `not_made` the reason for each that could not be made. `formats` are those that `save`
    writes; PNG and SVG need the extra `images` and Chromium.
    """

    made: tuple[Figure, ...]
    not_made: Mapping[str, str]
    formats: tuple[str, ...] = ("html", "csv")
    written: tuple[Path, ...] = ()
    runs: CampaignRuns | None = None

    @property
    def document(self) -> dict[str, Any]:
        from aqualog.thesis.export import figures_document

        return figures_document(self.made, [str(p) for p in self.written], self.not_made)

    @property
    def findings(self) -> list[tuple[Figure, Check]]:
        """What each figure says about each of its claims."""
        return [(f, c) for f in self.made for c in f.checks]

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`findings`, and the table behind each figure under its number."""
        from io import StringIO

        import polars as pl

        from aqualog.thesis.export import figure_csv

        rows = [{"figure": f["figure"], **{k: v if k != "ci95" else str(v) for k, v in c.items()}}
                for f in self.document["figures"] for c in f["findings"]]  # fmt: skip
        drawn = {f.number: pl.read_csv(StringIO(figure_csv(f)), infer_schema_length=None) for f in self.made}
        return {"findings": rows_table(rows), **drawn}

    @property
    def printed(self) -> Mapping[str, pl.DataFrame]:
        """`findings`; a table behind a figure is a file of its own."""
        return {"findings": self.tables["findings"]}

    def text(self, *, width: int = _WHOLE) -> str:
        """Return claim, figure, verdict and finding, which goes on below after `width` characters."""
        from aqualog.report.text import table

        has_values = any(c.ci95 is not None for _, c in self.findings)
        rows = [
            (c.name, f.number, c.verdict, *((_value(c),) if has_values else ()), displayed_text(c.found))
            for f, c in self.findings
        ]
        head = ("claim", "figure", "verdict", *(("value, 95 %",) if has_values else ()), "found")
        return table(head, rows, most=_WHOLE, wrapped={len(head) - 1: width}) + "\n" if rows else ""

    def headline(self) -> str:
        return "\n".join(
            [*(f"figure {f.number}: {f.title}" for f in self.made[:3]), *self.text(width=90).split("\n")[2:6]]
        )

    def plot(self) -> go.Figure:
        """Return all panels in one figure."""
        from aqualog.report.figures import side_by_side
        from aqualog.thesis.draw import panel_figure

        return side_by_side([panel_figure(p) for f in self.made for p in f.panels])

    def files(self) -> Writers:
        """Return a page and a table for each figure, and one page of all if there are several."""
        from aqualog.thesis.export import figure_csv
        from aqualog.thesis.page import render_figures

        files: dict[str, Any] = {}
        for f in self.made:
            if "html" in self.formats:
                title = f"Figure {f.number}: {f.title}"
                files[f"{f.stem}.html"] = text_file(partial(render_figures, [f], title=title))
            if "csv" in self.formats:
                files[f"{f.stem}.csv"] = text_file(partial(figure_csv, f))
        if len(self.made) > 1 and "html" in self.formats:
            title = f"{len(self.made)} figures of the thesis"
            files[_ALL_ON_ONE] = text_file(partial(render_figures, self.made, title=title))
        return files

    def save(self, folder: PathLike, *, force: bool = False) -> tuple[Path, ...]:
        """Write pages, tables and pictures into a folder, each whole or not at all.

        Raises
        ------
        ConfigError
            If a file exists already and `force` is not given.
        AqualogError
            For pictures without the extra `images`, or without Chromium.
        """
        from aqualog.thesis.image import image_names

        out = file_of(folder, "folder")
        suffixes = [s for s in ("png", "svg") if s in self.formats]
        names = [*self.files(), *(n for f in self.made for s in suffixes for n in image_names(f, s))]
        refuse_existing([out / n for n in names], force=force, sources=self.sources)
        with _pictures(self.formats) as pictures:
            drawn = [p for f in self.made for p in _drawn(f, out, self.formats, pictures)]
        return (*super().save(folder, force=force), *drawn)


def figure(number: str | float, campaign: PathLike | Campaign | CampaignRuns | None = None) -> Figures:
    """Make one figure of the thesis again.

    Parameters
    ----------
    number : str
        `"2.25"`, `"3.6"`.
    campaign : CampaignRuns, Campaign, str or Path, optional
        Make it from these runs; figures 2.3 to 2.7 and 2.10 to 2.20 need a campaign.

    Raises
    ------
    ConfigError
        If there is no such figure, it needs a campaign, or the campaign lacks the runs for it.

    Examples
    --------
    >>> aq.thesis.figure("3.6").plot()
    """
    found = figures([str(number)], campaign)
    if not found.made:
        raise ConfigError("; ".join(f"figure {n} is not made: {why}" for n, why in found.not_made.items()))
    return found


def figures(
    numbers: str | Sequence[str],
    campaign: PathLike | Campaign | CampaignRuns | None = None,
    *,
    out: PathLike | None = None,
    formats: Sequence[str] = ("html", "csv"),
    force: bool = False,
    jobs: int | None = None,
    progress: Progress = None,
) -> Figures:
    """Make figures of the thesis again, with what they say about its claims.

    Parameters
    ----------
    numbers : str or several
        By number (`3.6`), by chapter (`2`, `3`), or `all`.
    campaign : CampaignRuns, Campaign, str or Path, optional
        Make them from these runs. Logs that have no results yet are measured first.
    out : str or Path, optional
        Folder in which each figure is written as soon as it is made.
    formats : sequence of str
        Any of `html`, `csv`, `png`, `svg`.
    force : bool
        Overwrite files that exist.
    jobs : int, optional
        Logs at a time; default one per core.
    progress : callable, optional
        Called with each step of the work, such as `print`.

    Raises
    ------
    ConfigError
    """
    from aqualog.thesis.catalogue import chosen

    hear = listener(progress)
    asked = [numbers] if isinstance(numbers, str) else list(numbers)
    wanted = check_formats(formats)
    chosen_numbers = _to_make(asked, chosen(asked), hear, has_campaign=campaign is not None)
    folder = None if out is None else Path(out)
    own = campaign if isinstance(campaign, Campaign | CampaignRuns | None) else Campaign(campaign)
    sources = () if own is None else own.sources
    if folder is not None:
        _refuse(chosen_numbers, folder, wanted, sources, force=force)
    runs = own.run(jobs=jobs, progress=hear) if isinstance(own, Campaign) else own
    evidence = None
    if runs is not None:
        from aqualog.thesis.evidence.campaign import Evidence

        evidence = Evidence(runs.data)
    made, not_made, written = _make_all(chosen_numbers, folder, evidence, wanted, hear)
    found = Figures(made, not_made, wanted, tuple(written), runs, has_loss=bool(not_made), sources=sources)
    if folder is not None and len(made) > 1 and "html" in wanted:
        hear("one page of all")
        write_whole(folder / _ALL_ON_ONE, found.files()[_ALL_ON_ONE])
        found = replace(found, written=(*written, folder / _ALL_ON_ONE))
    return found


def check_formats(formats: Sequence[str]) -> tuple[str, ...]:
    """Return the formats in their order; an unknown one, or no format at all, is a ConfigError."""
    asked = [f.strip().lower() for f in formats if f.strip()]
    if not asked or set(asked) - set(FORMATS):
        raise ConfigError(
            f'format "{",".join(formats)[:60]}"', expected=f"one or more of {','.join(FORMATS)}, with commas"
        )
    return tuple(f for f in FORMATS if f in asked)


def _to_make(asked: Sequence[str], numbers: tuple[str, ...], hear: Listener, *, has_campaign: bool) -> tuple[str, ...]:
    """Without a campaign a chapter means those of its figures that need none; a number that needs one is an error."""
    from aqualog.thesis.catalogue import needs_campaign

    left = [n for n in numbers if not has_campaign and needs_campaign(n)]
    typed = [n for n in left if any("." in a and a.replace(".0", ".") == n for a in asked)]
    if typed:
        raise ConfigError(
            f"figure {', '.join(typed)}: made from the runs of a campaign", expected="--campaign campaign.toml",
            hint="`aqualog simulate campaign thesis -o DIR`, then --campaign DIR/campaign.toml; or `aqualog reproduce`",
        )  # fmt: skip
    if left:
        hear.note(f"{len(left)} figures need --campaign and are left out: {', '.join(left)}")
    return tuple(n for n in numbers if n not in left)


def _refuse(numbers: Sequence[str], out: Path, formats: Sequence[str], sources: Sequence[Path], *, force: bool) -> None:
    """Before anything is computed: refuse files that exist. Pictures bear letters that are known only later."""
    from aqualog.thesis.record import stem_of

    paths = [out / f"{stem_of(n)}.{f}" for n in numbers for f in formats]
    paths += [out / f"{stem_of(n)}_a.{f}" for n in numbers for f in formats if f in ("png", "svg")]
    if len(numbers) > 1 and "html" in formats:
        paths.append(out / _ALL_ON_ONE)
    refuse_existing(paths, force=force, sources=sources)


def _make_all(
    numbers: Sequence[str], out: Path | None, evidence: Evidence | None, formats: tuple[str, ...], hear: Listener
) -> tuple[tuple[Figure, ...], dict[str, str], list[Path]]:
    """Figures that could be made, why the others could not, and the files written."""
    from aqualog.thesis.evidence.selection import NotInCampaign
    from aqualog.thesis.run import make

    made: list[Figure] = []
    not_made: dict[str, str] = {}
    written: list[Path] = []
    with _pictures(formats if out is not None else ()) as pictures:
        for i, number in enumerate(numbers):
            hear(f"figure {number} ({i + 1} of {len(numbers)})")
            began = time.monotonic()
            try:
                found = make(number, evidence)
            except NotInCampaign as error:
                not_made[number] = error.what
                hear.failed(f"figure {number} is not made", error.what)
                continue
            made.append(found)
            if out is not None:
                for name, write in Figures((found,), {}, formats).files().items():
                    write_whole(out / name, write)
                    written.append(out / name)
                written += _drawn(found, out, formats, pictures)
            hear.detail(f"figure {number}: {len(found.checks)} findings in {time.monotonic() - began:.1f} s")
    return tuple(made), not_made, written


def _pictures(formats: Sequence[str]) -> AbstractContextManager[Pictures | None]:
    """One browser for all pictures; None where none is asked for."""
    from aqualog.thesis.image import FORMATS as PICTURES
    from aqualog.thesis.image import Pictures

    return Pictures() if set(formats) & set(PICTURES) else nullcontext()


def _drawn(found: Figure, out: Path, formats: Sequence[str], pictures: Pictures | None) -> list[Path]:
    """Write the pictures of a figure."""
    from aqualog.thesis.image import image_names

    written = []
    for suffix in ("png", "svg"):
        if pictures is None or suffix not in formats:
            continue
        names = image_names(found, suffix)
        for name, picture in zip(names, pictures.draw(found, suffix), strict=True):
            write_whole(out / name, methodcaller("write_bytes", picture))
            written.append(out / name)
    return written


def _value(c: Check) -> str:
    """The number judged with its interval, if it has one."""
    if c.value is None or c.ci95 is None:
        return "–"
    return f"{c.value:.3g} [{c.ci95[0]:.3g}, {c.ci95[1]:.3g}] {displayed_unit(c.unit)}".strip()


@dataclass(frozen=True, eq=False, repr=False)
class Reproduction(Result):
    """All claims of the thesis with their checks and verdicts, and all figures.

    `folder` holds the campaign, which `save` does not copy.
    """

    conclusions: tuple[Conclusion, ...]
    made: Made
    facts: tuple[str, ...]
    folder: Path

    @cached_property
    def document(self) -> dict[str, Any]:
        from aqualog.thesis.export import claims_document

        return claims_document(self.conclusions, self.made.figures, self.made.missing, {"conditions": list(self.facts)})

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`claims`: a row for each check of each claim."""
        from io import StringIO

        import polars as pl

        from aqualog.thesis.export import claims_csv

        return {"claims": pl.read_csv(StringIO(claims_csv(self.conclusions)), infer_schema_length=None)}

    def text(self, *, width: int = _WHOLE) -> str:
        """Return claim, verdict and finding, and how many there are of each verdict; lines as in `Figures.text`."""
        from aqualog.report.text import table

        rows = [(c.claim.id, c.verdict, displayed_text("; ".join(k.found for k in c.checks))) for c in self.conclusions]
        listed = table(("claim", "verdict", "found"), rows, most=_WHOLE, wrapped={2: width})
        return f"{listed}\n{self.headline()}\n"

    def headline(self) -> str:
        from aqualog.thesis.export import counts_of

        counts = ", ".join(f"{n} {verdict}" for verdict, n in counts_of(self.conclusions).items())
        return f"{counts}; {len(self.made.figures)} figures"

    def plot(self) -> go.Figure:
        """Return how many claims there are of each verdict."""
        from aqualog.thesis.export import counts_of

        counts = counts_of(self.conclusions)
        return bars("Claims of the thesis", list(counts), list(counts.values()), "claims")

    def files(self) -> Writers:
        """Return the page, the claims as CSV, the document, and the tables behind the figures."""
        from aqualog.thesis.export import claims_csv, figure_csv
        from aqualog.thesis.page import render_reproduction

        page = partial(render_reproduction, self.conclusions, self.made.figures, self.made.missing, list(self.facts))
        return {
            **{f"{_TABLES}/{f.stem}.csv": text_file(partial(figure_csv, f)) for f in self.made.figures},
            _CLAIMS: text_file(partial(claims_csv, self.conclusions)),
            _JSON: self._json_file(),
            _PAGE: text_file(page),
        }


def reproduce(folder: PathLike, *, jobs: int | None = None, progress: Progress = None) -> Reproduction:
    """Simulate the campaign of the thesis, run everything, and judge each of its claims.

    Broken off, the same call goes on where it stopped. A few minutes on two cores.

    Parameters
    ----------
    folder : str or Path
        For the campaign and its results; `Reproduction.save` writes the page there or elsewhere.
    jobs : int, optional
        Processes; default one per core.
    progress : callable, optional
        Called with each step of the work, such as `print`.

    Raises
    ------
    AqualogError
        If a drive of the campaign cannot be simulated or measured.
    """
    from aqualog.thesis.run import conclude, make_all

    hear, out, processes = listener(progress), file_of(folder, "folder"), jobs or os.cpu_count() or 1
    campaign = out / _CAMPAIGN
    simulated = Campaign.simulate("thesis", campaign, jobs=processes, progress=hear)
    runs = simulated.campaign.run(jobs=processes, progress=hear)
    if simulated.has_loss or runs.outcome.failed:
        raise AqualogError("the campaign is not whole", where=str(campaign), hint="the same command once more")
    made = make_all(runs.data, jobs=processes, report=Counted(hear, "figures and checks"))
    return Reproduction(conclude(made), made, _facts(len(runs.data.runs)), out, has_loss=bool(made.missing))


def check_reproduction(folder: PathLike, *, force: bool) -> None:
    """Refuse a folder that holds an earlier reproduction, before any work."""
    refuse_existing([Path(folder) / name for name in (_PAGE, _CLAIMS, _JSON)], force=force)


def _facts(drives: int) -> tuple[str, ...]:
    """How it was made; the same words for the same version, so that the page is the same too."""
    from aqualog import __version__

    return (
        f"aqualog {__version__}; {drives} simulated drives of the thesis' test programme, logged as a series car's "
        "sensors see them, measured as any user's campaign.",
        "Single claims on more drives with seeds of their own, named with each check; nothing was tuned on them.",
        "Brush tyres on water with one anchor: full aquaplaning of a worn tyre at 1.3 mm near 118 km/h. One parameter "
        "set for all claims.",
    )
