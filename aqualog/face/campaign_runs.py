"""The runs of a campaign with their results, and what all of them say together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.face.arguments import file_of
from aqualog.face.campaign_store import split
from aqualog.face.listener import Progress, listener
from aqualog.face.progress import Progress as Counted
from aqualog.face.result import PathLike, Result, Writers

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.campaign.batch import BatchOutcome
    from aqualog.campaign.definition import Shard
    from aqualog.campaign.results import CampaignData
    from aqualog.face.bins import BinnedResistance, BinnedSlopes
    from aqualog.face.campaign import Campaign

__all__ = ["CampaignRuns"]


@dataclass(frozen=True, eq=False, repr=False)
class CampaignRuns(Result):
    """All runs of a campaign with their results.

    `data` gives access to runs and samples, `outcome` counts what came of the logs, `seconds` is the time it took.
    """

    campaign: Campaign
    data: CampaignData
    outcome: BatchOutcome
    shard: Shard | None = None
    seconds: float = 0.0

    @property
    def notes(self) -> tuple[str, ...]:  # type: ignore[override]
        """Where the results are, and what a shard leaves to do."""
        notes = (f"results are in {self.data.store.name}, {self.seconds:.0f} s",)
        if self.shard is None:
            return notes
        return (*notes, "the same without a shard makes the tables, when all parts are done")

    @property
    def sources(self) -> tuple[Path, ...]:  # type: ignore[override]
        """All files that the campaign reads."""
        return self.campaign.sources

    @property
    def has_loss(self) -> bool:  # type: ignore[override]
        """Whether a log failed, was cut or lost samples."""
        lost = any(r.about["quality"]["truncated"] or r.about["quality"]["lost_in_files"] for r in self.data.done)
        return bool(self.outcome.failed or lost)

    @cached_property
    def document(self) -> dict[str, Any]:
        """The JSON document of `aqualog batch`."""
        from aqualog import __version__

        return {
            "schema_version": 1,
            "tool_version": __version__,
            "campaign": self.data.name,
            "store": self.data.store.name,
            "runs": len(self.data.runs),
            "made": self.outcome.made,
            "kept": self.outcome.kept,
            "failed": [{"log": name, "reason": reason} for name, reason in self.outcome.failed.items()],
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
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`runs` and `events`."""
        return {"runs": self.runs, "events": self.events}

    def text(self) -> str:
        """Return how many logs are done, and the events of each detector."""
        from aqualog.report.text import table

        rows = [(d, str(n), f"{k} of {len(self.data.done)}") for d, (n, k) in self._counts().items()]
        return f"{self._head()}\n\n{table(('detector', 'events', 'runs with one'), rows)}\n"

    def headline(self) -> str:
        """Return how many logs are done and failed."""
        failed = [f"  failed: {name}: {reason}" for name, reason in self.outcome.failed.items()]
        return "\n".join([f"{self.data.name}: {self._head()}", *failed])

    def _head(self) -> str:
        o = self.outcome
        return f"{o.done} logs done ({o.made} now, {o.kept} before), {len(o.failed)} failed"

    def _counts(self) -> dict[str, tuple[int, int]]:
        """Per detector: its events, and the runs that have one."""
        of = {d: [sum(e["detector"] == d for e in r.events) for r in self.data.done] for d in _detectors()}
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
        """Return `campaign.json`, `runs.parquet` and `events.parquet`; the store itself stays where it is."""
        return {
            "campaign.json": self._json_file(),
            "runs.parquet": self.runs.write_parquet,
            "events.parquet": self.events.write_parquet,
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
        """
        from aqualog.face.bins import binned_slopes

        return binned_slopes(self, split(by), bin_width=bin_width, road=road, robust=robust, hear=listener(progress))

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
        from aqualog.face.bins import binned_resistance

        return binned_resistance(
            self, split(by), bin_width=bin_width, road=road, robust=robust, relative=not as_measured,
            hear=listener(progress),
        )  # fmt: skip

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
        """Write the campaign's page with a page for each run, and return the page.

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
        write_report(self.data, findings, out, report=Counted(hear, "pages of runs"))
        return out / "index.html"


def _detectors() -> Sequence[str]:
    from aqualog.detect.registry import DETECTORS

    return DETECTORS
