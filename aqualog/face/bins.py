"""Slip slope and resistance over speed, for each configuration of a campaign."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ConfigError
from aqualog.face.arguments import file_of
from aqualog.face.listener import Listener
from aqualog.face.result import PathLike, Result, Writers

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.campaign.full_speed import FullSpeed
    from aqualog.campaign.means import MeanRow, ResistanceTable
    from aqualog.campaign.slip_slope import SlopeTable
    from aqualog.campaign.spin_downs import SpinDownRow
    from aqualog.face.campaign_runs import CampaignRuns
    from aqualog.report.campaign.findings import Curve
    from aqualog.report.sections import Report

__all__ = ["BinnedResistance", "BinnedSlopes", "binned_resistance", "binned_slopes", "check_table"]

_SUFFIXES = (".csv", ".parquet")


def check_table(path: Path) -> None:
    """Refuse a table in an unknown format, before any work.

    Raises
    ------
    ConfigError
    """
    if path.suffix.lower() not in _SUFFIXES:
        raise ConfigError(f'"{path.suffix}" is no format of a table', where=str(path), expected=" or ".join(_SUFFIXES))


@dataclass(frozen=True, eq=False, repr=False)
class _Binned(Result):
    campaign: CampaignRuns

    _NAME = ""

    @property
    def notes(self) -> tuple[str, ...]:  # type: ignore[override]
        """No notes: reasons stand in the rows."""
        return ()

    @property
    def has_loss(self) -> bool:  # type: ignore[override]
        """Whether a log failed, was cut or lost samples."""
        return self.campaign.has_loss

    @property
    def sources(self) -> tuple[Path, ...]:  # type: ignore[override]
        """All files that the campaign reads."""
        return self.campaign.sources

    @property
    def rows(self) -> pl.DataFrame:
        """The rows of the document; an interval `x_ci95` stands in two columns, `x_low` and `x_high`."""
        return _frame(self.document["rows"])

    def text(self) -> str:
        """Return the tables that the command prints."""
        from aqualog.report.text import report_text

        return report_text(self._report())

    @abstractmethod
    def _report(self) -> Report:
        """The sections of text and notebook."""

    def headline(self) -> str:
        """Return the first lines of the table."""
        lines = self.text().rstrip("\n").split("\n")
        return "\n".join([f"{self.campaign.data.name}: {len(self.document['rows'])} rows", *lines[:6]])

    def write(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the rows as one table: .csv or .parquet.

        Raises
        ------
        ConfigError
        """
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
        """The JSON document of `aqualog bin-slipslope`."""
        from aqualog.report.campaign.bins import slope_document

        return slope_document(self.campaign.data.name, self.slopes, self.speeds, self.spin_ups, self.spin_downs)

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

        return _curves(slope_curves(self.slopes), "slip slope C_s/F_z", self.campaign.data.name)


@dataclass(frozen=True, eq=False, repr=False)
class BinnedResistance(_Binned):
    """Mean resistance measures in bins of speed."""

    table: ResistanceTable

    _NAME = "resistance"

    @cached_property
    def document(self) -> dict[str, Any]:
        """The JSON document of `aqualog bin-resistance`."""
        from aqualog.report.campaign.bins import resistance_document

        return resistance_document(self.campaign.data.name, self.table)

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

        return _curves(resistance_curves(self.table), "resistance measure [m/s²]", self.campaign.data.name)


def binned_slopes(
    runs: CampaignRuns, by: Sequence[str], *, bin_width: float, road: str, robust: bool, hear: Listener
) -> BinnedSlopes:
    """Return slip slopes and speeds of full aquaplaning; see `CampaignRuns.slip_slope`."""
    data = runs.data
    runs.campaign.check_bins(by, bin_width=bin_width, road=road)
    hear("regressing")
    from aqualog.campaign.bins import plan
    from aqualog.campaign.full_speed import full_speeds
    from aqualog.campaign.means import spin_ups
    from aqualog.campaign.slip_slope import slip_slopes
    from aqualog.campaign.spin_downs import minor_spin_downs

    cells = plan(data, by, width_kmh=bin_width, road=road)
    slopes = slip_slopes(data, cells, robust=robust)
    hear("speeds of full aquaplaning")
    wet = cells if road != "dry" else plan(data, by, width_kmh=bin_width)
    speeds = full_speeds(data, wet, slopes if road != "dry" else slip_slopes(data, wet, robust=robust))
    ups = list(zip(spin_ups(data, wet), spin_ups(data, wet, residual=True), strict=True))
    return BinnedSlopes(runs, slopes, speeds, ups, minor_spin_downs(data, wet))


def binned_resistance(
    runs: CampaignRuns,
    by: Sequence[str],
    *,
    bin_width: float,
    road: str,
    robust: bool,
    relative: bool,
    hear: Listener,
) -> BinnedResistance:
    """Return mean resistance measures; see `CampaignRuns.resistance`."""
    runs.campaign.check_bins(by, bin_width=bin_width, road=road)
    hear("averaging")
    from aqualog.campaign.bins import plan
    from aqualog.campaign.means import resistances

    cells = plan(runs.data, by, width_kmh=bin_width, road=road)
    return BinnedResistance(runs, resistances(runs.data, cells, relative=relative, robust=robust))


def _frame(rows: Sequence[Mapping[str, Any]]) -> pl.DataFrame:
    import polars as pl

    from aqualog.report.campaign.bins import flat_rows

    return pl.DataFrame(flat_rows(rows), infer_schema_length=None)


def _write(rows: Sequence[Mapping[str, Any]], suffix: str, path: Path) -> None:
    """Write rows of a document as CSV or Parquet; a text that a spreadsheet would run is made harmless in CSV."""
    import polars as pl

    from aqualog.report.campaign.bins import flat_rows
    from aqualog.report.campaign.folder import safe_cell

    if suffix == ".parquet":
        _frame(rows).write_parquet(path)
        return
    plain = [{k: safe_cell(v) if isinstance(v, str) else v for k, v in row.items()} for row in flat_rows(rows)]
    pl.DataFrame(plain, infer_schema_length=None).write_csv(path)


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
