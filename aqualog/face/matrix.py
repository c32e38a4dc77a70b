"""The test matrix of a campaign: what was driven, and what is missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.face.result import PathLike, Result, Writers, text_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.campaign.definition import Campaign
    from aqualog.report.sections import Report

__all__ = ["Matrix", "matrix"]


@dataclass(frozen=True, eq=False, repr=False)
class Matrix(Result):
    """What a campaign file says, held against the logs that exist."""

    campaign: Campaign
    parts: tuple[Any, ...]
    logs: int
    logs_there: int
    sources: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def has_loss(self) -> bool:  # type: ignore[override]
        """Whether a log is missing."""
        return self.logs_there < self.logs

    @cached_property
    def document(self) -> dict[str, Any]:
        """The JSON document of `aqualog inspect campaign.toml`."""
        from aqualog.report.campaign.matrix import matrix_document

        return matrix_document(self.campaign, *self.parts)

    def text(self) -> str:
        """Return the matrix as the command prints it."""
        from aqualog.report.text import report_text

        return report_text(self._report())

    def _report(self) -> Report:
        from aqualog.report.campaign.matrix import matrix_report

        return matrix_report(self.campaign, *self.parts)

    def headline(self) -> str:
        """Return the first lines of the matrix."""
        return "\n".join(self.text().split("\n")[:6])

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """The lists of the document, each as a table."""
        import polars as pl

        lists = {k: v for k, v in self.document.items() if _is_rows(v)}
        return {k: pl.DataFrame([_flat(row) for row in v], infer_schema_length=None) for k, v in lists.items()}

    def plot(self) -> go.Figure:
        """Return the number of runs of each configuration."""
        import plotly.graph_objects as go

        from aqualog.report.campaign.labels import group_text

        count: dict[str, int] = {}
        for run in self.campaign.runs:
            name = group_text(tuple((k, run.groups.get(k)) for k in self.campaign.keys))
            count[name] = count.get(name, 0) + 1
        made = go.Figure(go.Bar(x=list(count.values()), y=list(count), orientation="h"))
        made.update_layout(title=self.campaign.name, template="plotly_white")
        made.update_xaxes(title="runs")
        return made

    def files(self) -> Writers:
        """Return `matrix.json` and `matrix.txt`."""
        return {"matrix.json": self._json_file(), "matrix.txt": text_file(self.text)}


def matrix(path: PathLike) -> Matrix:
    """Check a campaign file, and count what was driven.

    Speeds that the campaign file does not give come from a store beside it, if a batch has made one. A missing log is
    not a fault of the matrix.

    Raises
    ------
    ConfigError
        With all faults of all files in one message.
    """
    from aqualog.campaign.definition import log_states
    from aqualog.campaign.matrix import campaign_matrix, speeds_of
    from aqualog.campaign.tables import lane_faults, stored_runs
    from aqualog.config.campaign import read_campaign
    from aqualog.config.vehicle import load_vehicle

    file = Path(path)
    read = read_campaign(file)
    campaign = read.campaign
    states = log_states(campaign, read.places)
    measured = stored_runs(campaign, file.with_suffix(".store"))
    ranges = {i: m.speeds for i, m in measured.items() if m.speeds}
    found = campaign_matrix(campaign, lambda index, run: speeds_of(run) or ranges.get(index, ()))
    lanes = lane_faults(campaign, measured, read.places)
    vehicles = {p.name: load_vehicle(p) for p in dict.fromkeys(r.vehicle for r in campaign.runs)}
    there = sum(s.size is not None for s in states)
    return Matrix(campaign, (found, states, vehicles, measured, lanes), len(states), there, (file,))


def _is_rows(value: Any) -> bool:
    return isinstance(value, Sequence) and bool(value) and all(isinstance(v, Mapping) for v in value)


def _flat(row: Mapping[str, Any]) -> dict[str, Any]:
    return {k: str(v) if isinstance(v, Mapping | list) else v for k, v in row.items()}
