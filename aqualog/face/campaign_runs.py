"""The runs of a campaign with their results, and what all of them say together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from aqualog.core.errors import ConfigError
from aqualog.core.judgement import VERDICTS
from aqualog.face.arguments import file_of, writing
from aqualog.face.campaign_inputs import CampaignInputs, split
from aqualog.face.listener import Counted, Progress, listener
from aqualog.face.result import PathLike, Result, Writers, document_head, rows_table

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.campaign.batch import BatchOutcome
    from aqualog.campaign.definition import Shard
    from aqualog.campaign.full_speed import FullSpeed
    from aqualog.campaign.means import MeanRow, ResistanceTable
    from aqualog.campaign.results import CampaignData
    from aqualog.campaign.slip_slope import SlopeTable
    from aqualog.campaign.spin_downs import SpinDownRow
    from aqualog.report.campaign.findings import Curve
    from aqualog.report.sections import Report

__all__ = ["BinnedResistance", "BinnedSlopes", "CampaignRuns", "check_table", "runs_of"]


_SUFFIXES = (".csv", ".parquet")


def check_table(path: Path) -> None:
    """Refuse a table in an unknown format, before any work."""
    if path.suffix.lower() not in _SUFFIXES:
        raise ConfigError(f'"{path.suffix}" is no format of a table', where=str(path), expected=" or ".join(_SUFFIXES))


@dataclass(frozen=True, eq=False, repr=False)
class _Binned(Result):
    name: str

    _NAME: ClassVar[str]

    @property
    def rows(self) -> pl.DataFrame:
        """The rows of the document; an interval `x_ci95` stands in two columns, `x_low` and `x_high`."""
        return _frame(self.document["rows"])

    def headline(self) -> str:
        lines = self.text().rstrip("\n").split("\n")
        return "\n".join([f"{self.name}: {len(self.document['rows'])} rows", *lines[:6]])

    def write(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the rows as one table: .csv or .parquet."""
        target = file_of(path, "path")
        check_table(target)
        return self._write_to(target, partial(_write, self.document["rows"], target.suffix.lower()), force=force)

    def files(self) -> Writers:
        """Return the document and its rows as CSV and Parquet."""
        rows = self.document["rows"]
        return {
            f"{self._NAME}.json": self._json_file(),
            **{f"{self._NAME}{s}": partial(_write, rows, s) for s in _SUFFIXES},
        }


@dataclass(frozen=True, eq=False, repr=False)
class BinnedSlopes(_Binned):
    """Slip slopes in bins of speed, and speeds of full aquaplaning."""

    slopes: SlopeTable
    speeds: Sequence[FullSpeed]
    spin_ups: Sequence[tuple[MeanRow, MeanRow]]
    spin_downs: Sequence[SpinDownRow]

    _NAME = "slip_slope"

    @cached_property
    def document(self) -> dict[str, Any]:
        from aqualog.report.campaign.bins import slope_document

        return slope_document(self.name, self.slopes, self.speeds, self.spin_ups, self.spin_downs)

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`rows`, `dry`, `full_aquaplaning`, `spin_ups` and `minor_spin_downs`."""
        names = ("dry", "full_aquaplaning", "spin_ups", "minor_spin_downs")
        return {"rows": self.rows, **{n: _frame(self.document[n]) for n in names}}

    def _report(self) -> Report:
        from aqualog.report.campaign.bins import slope_report

        return slope_report(self.slopes, self.speeds, self.spin_ups, self.spin_downs)

    def plot(self) -> go.Figure:
        """Return slip slope over speed with 95 % intervals, a line for each configuration and wheel."""
        from aqualog.report.campaign.findings import slope_curves

        return _curves(slope_curves(self.slopes), "slip slope C_s/F_z", self.name)


@dataclass(frozen=True, eq=False, repr=False)
class BinnedResistance(_Binned):
    """Mean resistance measures in bins of speed."""

    table: ResistanceTable

    _NAME = "resistance"

    @cached_property
    def document(self) -> dict[str, Any]:
        from aqualog.report.campaign.bins import resistance_document

        return resistance_document(self.name, self.table)

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`rows`."""
        return {"rows": self.rows}

    def _report(self) -> Report:
        from aqualog.report.campaign.bins import resistance_report

        return resistance_report(self.table)

    def plot(self) -> go.Figure:
        """Return the resistance measure over speed with 95 % intervals, a line for each configuration."""
        from aqualog.report.campaign.findings import resistance_curves

        return _curves(resistance_curves(self.table), "resistance measure [m/s²]", self.name)


def _frame(rows: Sequence[Mapping[str, Any]]) -> pl.DataFrame:
    from aqualog.report.campaign.bins import flat_rows

    return rows_table(flat_rows(rows))


def _write(rows: Sequence[Mapping[str, Any]], suffix: str, path: Path) -> None:
    """Write rows of a document as CSV or Parquet; a text that a spreadsheet would run is made harmless in CSV."""
    from aqualog.report.spreadsheet import csv_bytes

    if suffix == ".parquet":
        _frame(rows).write_parquet(path)
    else:
        path.write_bytes(csv_bytes(_frame(rows)))


def _curves(curves: Sequence[Curve], unit: str, title: str) -> go.Figure:
    import plotly.graph_objects as go

    from aqualog.report.campaign.labels import group_text

    made = go.Figure()
    for c in curves:
        points = [p for p in c.points if p.value == p.value]  # not NaN
        name = ", ".join(t for t in (group_text(c.group), c.place) if t)
        made.add_scatter(
            x=[p.v_kmh for p in points], y=[p.value for p in points], name=name, mode="lines+markers",
            error_y={"type": "data", "symmetric": False, "thickness": 1.2,
                     "array": [p.ci[1] - p.value for p in points],
                     "arrayminus": [p.value - p.ci[0] for p in points]},
        )  # fmt: skip
    made.update_layout(title=title, template="plotly_white")
    made.update_xaxes(title="speed [km/h]")
    made.update_yaxes(title=unit)
    return made


@dataclass(frozen=True, eq=False, repr=False)
class CampaignRuns(Result):
    """All runs of a campaign with their results.

    `data` gives access to runs and samples, `outcome` counts what came of the logs, `seconds` is the time it took.
    """

    campaign: CampaignInputs
    data: CampaignData
    outcome: BatchOutcome
    shard: Shard | None = None
    seconds: float = 0.0

    @cached_property
    def document(self) -> dict[str, Any]:
        return {
            **document_head(),
            "campaign": self.data.name,
            "store": self.data.store.name,
            "runs": len(self.data.runs),
            "made": self.outcome.made,
            "kept": self.outcome.kept,
            "failed": [{"log": name, "reason": reason} for name, reason in self.outcome.failed.items()],
            "verdicts": self._verdicts(),
            "episodes": sum(len(r.judgement.of("aquaplaning")) for r in self.data.done),
            "events": {d: n for d, (n, _) in self._counts().items()},
        }

    @property
    def runs(self) -> pl.DataFrame:
        """A row for each run, as `runs.parquet` of the store: state, configuration, range, events, quality."""
        from aqualog.campaign.tables import runs_table

        return runs_table(self.data.runs)

    @property
    def events(self) -> pl.DataFrame:
        """A row for each event of each run, as `events.parquet` of the store."""
        from aqualog.campaign.tables import events_table

        return events_table(self.data.runs)

    @property
    def episodes(self) -> pl.DataFrame:
        """A row for each episode of each run, as `episodes.parquet` of the store."""
        from aqualog.campaign.tables import episodes_table

        return episodes_table(self.data.runs)

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`runs`, `events` and `episodes`."""
        return {"runs": self.runs, "events": self.events, "episodes": self.episodes}

    def text(self) -> str:
        from aqualog.report.inputs import of_runs
        from aqualog.report.text import table
        from aqualog.report.values import counted

        able = {d: sum(d not in r.about["unavailable"] for r in self.data.done) for d in self._counts()}
        rows = [
            (d, str(n), f"{k} of {able[d]}") if able[d] else (d, "-", "no run can be judged")
            for d, (n, k) in self._counts().items()
        ]
        found = self._verdicts()
        wet = sum(len(r.judgement.of("aquaplaning")) for r in self.data.done)
        told = [
            (found["aquaplaning"], f"aquaplaning in {counted(found['aquaplaning'], 'run')}, {counted(wet, 'episode')}"),
            (found["none"], f"none in {counted(found['none'], 'run')}"),
            (found["cannot_be_judged"], f"{counted(found['cannot_be_judged'], 'run')} cannot be judged"),
        ]
        head = "; ".join(x for n, x in told if n)
        head += f"\n{doubt}" if (doubt := of_runs({r.name: r.checks for r in self.data.done})) else ""
        return f"{self._head()}\n{head}\n\n{table(('detector', 'events', 'runs with one'), rows)}\n"

    def headline(self) -> str:
        failed = [f"  failed: {name}: {reason}" for name, reason in self.outcome.failed.items()]
        return "\n".join([f"{self.data.name}: {self._head()}", *failed])

    def _head(self) -> str:
        from aqualog.report.values import counted

        o = self.outcome
        return f"{counted(o.done, 'log')} done ({o.made} now, {o.kept} before), {len(o.failed)} failed"

    def _verdicts(self) -> dict[str, int]:
        """Runs with results, by verdict."""
        found = [r.judgement.verdict for r in self.data.done]
        return {v: found.count(v) for v in VERDICTS}

    def _counts(self) -> dict[str, tuple[int, int]]:
        """Per detector: its events, and the runs that have one."""
        from aqualog.detect.registry import DETECTORS

        of = {d: [sum(e["detector"] == d for e in r.events) for r in self.data.done] for d in DETECTORS}
        return {d: (sum(x), sum(n > 0 for n in x)) for d, x in of.items()}

    def plot(self) -> go.Figure:
        """Return the share of runs with an event, by detector."""
        import plotly.graph_objects as go

        from aqualog.report.wording import detector_name

        counts, done = self._counts(), max(len(self.data.done), 1)
        made = go.Figure(go.Bar(x=[detector_name(d) for d in counts], y=[k / done for _, k in counts.values()]))
        made.update_layout(title=self.data.name, template="plotly_white")
        made.update_yaxes(title="share of runs with an event", range=[0.0, 1.0], tickformat=".0%")
        return made

    def files(self) -> Writers:
        """Return `campaign.json`, `runs.parquet`, `events.parquet` and `episodes.parquet`; the store stays."""
        return {
            "campaign.json": self._json_file(),
            "runs.parquet": self.runs.write_parquet,
            "events.parquet": self.events.write_parquet,
            "episodes.parquet": self.episodes.write_parquet,
        }

    def slip_slope(
        self,
        by: str | Sequence[str] = (),
        *,
        bin_width: float = 10.0,
        road: str = "wet",
        robust: bool = False,
        progress: Progress = None,
    ) -> BinnedSlopes:
        """Regress slip on traction in bins of speed for each configuration, and estimate the speed of full aquaplaning.

        Parameters
        ----------
        by : str or several
            Configuration keys, such as `tyre,pressure,water-depth`; default those that differ.
        bin_width : float
            Width of the speed bins. [km/h]
        road : str
            `wet`, `dry` or `both`.
        robust : bool
            Weigh outliers down (Huber [huber1981]).

        Raises
        ------
        ConfigError
        SignalError
            If no run's vehicle file says which axle is driven.
        """
        from aqualog.campaign.bins import plan
        from aqualog.campaign.driven import no_drivetrain, refuse_without_drivetrain
        from aqualog.campaign.full_speed import full_speeds
        from aqualog.campaign.means import spin_ups
        from aqualog.campaign.slip_slope import slip_slopes
        from aqualog.campaign.spin_downs import minor_spin_downs
        from aqualog.face.campaign_runs import BinnedSlopes

        data, hear = self.data, listener(progress)
        self.campaign.check_bins(by, bin_width=bin_width, road=road)
        lacking = no_drivetrain(data, "no slip slopes")
        refuse_without_drivetrain(data, "no slip slopes")
        hear("regressing")
        cells = plan(data, split(by), width_kmh=bin_width, road=road)
        slopes = slip_slopes(data, cells, robust=robust)
        hear("speeds of full aquaplaning")
        wet = cells if road != "dry" else plan(data, split(by), width_kmh=bin_width)
        speeds = full_speeds(data, wet, slopes if road != "dry" else slip_slopes(data, wet, robust=robust))
        ups = list(zip(spin_ups(data, wet), spin_ups(data, wet, residual=True), strict=True))
        return BinnedSlopes(
            data.name, slopes, speeds, ups, minor_spin_downs(data, wet),
            notes=() if lacking is None else (lacking.line(),), has_loss=self.has_loss, sources=self.sources,
        )  # fmt: skip

    def resistance(
        self,
        by: str | Sequence[str] = (),
        *,
        bin_width: float = 10.0,
        road: str = "wet",
        robust: bool = False,
        as_measured: bool = False,
        progress: Progress = None,
    ) -> BinnedResistance:
        """Average the resistance measure in bins of speed for each configuration.

        Parameters
        ----------
        by, bin_width, road, robust
            As of `slip_slope`.
        as_measured : bool
            Keep each run's own level on dry road, instead of taking it off.

        Raises
        ------
        ConfigError
        """
        from aqualog.campaign.bins import plan
        from aqualog.campaign.driven import refuse_without_drivetrain
        from aqualog.campaign.means import resistances
        from aqualog.face.campaign_runs import BinnedResistance

        self.campaign.check_bins(by, bin_width=bin_width, road=road)
        listener(progress)("averaging")
        cells = plan(self.data, split(by), width_kmh=bin_width, road=road)
        found = resistances(self.data, cells, relative=not as_measured, robust=robust)
        if not found.rows and not found.elsewhere:
            refuse_without_drivetrain(self.data, "no resistance")
        return BinnedResistance(self.data.name, found, has_loss=self.has_loss, sources=self.sources)

    def report(
        self,
        folder: PathLike,
        *,
        by: str | Sequence[str] = (),
        bin_width: float = 10.0,
        robust: bool = False,
        force: bool = False,
        progress: Progress = None,
    ) -> Path:
        """Write the campaign's page with a page for each run, all files or none, and return the page.

        An earlier report in the folder is replaced; `force` writes beside other files.

        Raises
        ------
        ConfigError
        """
        from aqualog.report.campaign.findings import find
        from aqualog.report.campaign.folder import write_report

        out, hear = file_of(folder, "folder"), listener(progress)
        self.campaign.check_report(out, force=force)
        chosen = self.campaign.check_bins(by, bin_width=bin_width)
        findings = find(self.data, chosen, robust=robust, report=hear)
        with writing(out):
            write_report(self.data, findings, out, report=Counted(hear, "pages of runs"))
        return out / "index.html"


def runs_of(
    campaign: CampaignInputs, data: CampaignData, outcome: BatchOutcome, shard: Shard | None, seconds: float
) -> CampaignRuns:
    """Return the runs of a batch that has just ended."""
    from aqualog.campaign.driven import no_drivetrain

    notes = [f"results are in {data.store.name}, {seconds:.0f} s"]
    if shard is not None:
        notes.append("the same without a shard makes the tables, when all parts are done")
    lacking = no_drivetrain(data, "what depends on the driven axle is not judged")
    notes += [] if lacking is None else [lacking.line()]
    lost = any(r.about["quality"]["truncated"] or r.about["quality"]["lost_in_files"] for r in data.done)
    return CampaignRuns(
        campaign, data, outcome, shard, seconds, notes=tuple(notes), has_loss=bool(outcome.failed or lost),
        sources=campaign.sources,
    )  # fmt: skip
