"""`aq.Campaign`: many drives in known configurations, and what all of them say together."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ConfigError
from aqualog.face.arguments import file_of, names_of, number_of, text_of, whole_number
from aqualog.face.campaign_runs import CampaignRuns
from aqualog.face.campaign_store import bring_up_to_date, is_campaign, refuse_in_store, split
from aqualog.face.listener import Progress, listener
from aqualog.face.paths import expand, list_files, refuse_existing
from aqualog.face.result import PathLike

if TYPE_CHECKING:
    import polars as pl

    from aqualog.campaign.jobs import Configured
    from aqualog.campaign.place import Address
    from aqualog.face.matrix import Matrix
    from aqualog.face.plan import BatchPlan
    from aqualog.face.propose import Proposal
    from aqualog.face.simulate import SimulatedCampaign

__all__ = ["Campaign"]


class Campaign:
    """A campaign file, or logs of which each is a drive of its own. Nothing is measured before `run`.

    Parameters
    ----------
    inputs : str, Path or several
        A campaign file (TOML), or logs: files, folders, globs, `@list.txt`.
    vehicle : str or Path, optional
        Vehicle file; needed for logs. A campaign file names its own.
    map : str or Path, optional
        Signal map, in place of the campaign's.
    dbc : sequence of paths
        CAN databases for raw frames.
    thresholds : str or Path, optional
        Thresholds of the detectors.
    store : str or Path, optional
        Folder or URL for the results of each log; default beside the campaign file: NAME.store.

    Raises
    ------
    ConfigError
        With all faults of all files in one message.

    Examples
    --------
    >>> runs = aq.Campaign("campaign.toml").run(jobs=8)
    >>> runs.slip_slope(by="tyre").rows
    """

    def __init__(
        self,
        inputs: PathLike | Sequence[PathLike],
        *,
        vehicle: PathLike | None = None,
        map: PathLike | None = None,
        dbc: PathLike | Sequence[PathLike] = (),
        thresholds: PathLike | None = None,
        store: PathLike | None = None,
    ) -> None:
        from aqualog.config.configured import configure, configure_logs

        names = names_of(inputs)
        if not names:
            raise ConfigError("no log is named", expected="a campaign file, or at least one log")
        databases = [file_of(p, "dbc") for p in names_of(dbc, "dbc")]
        map_file = None if map is None else file_of(map, "map")
        limits = None if thresholds is None else file_of(thresholds, "thresholds")
        if is_campaign(names):
            if vehicle is not None:
                raise ConfigError("vehicle beside a campaign", where=names[0], expected="it in the campaign's runs")
            found = configure(file_of(names[0], "inputs"), map_file=map_file, dbc=databases, thresholds=limits)
        elif vehicle is None:
            raise ConfigError("no vehicle", expected="a vehicle file, or a campaign file that names one")
        else:
            found = configure_logs(
                expand(names), file_of(vehicle, "vehicle"), map_file=map_file, dbc=databases, thresholds=limits,
                lists=tuple(list_files(names)),
            )  # fmt: skip
        self.inputs = tuple(names)
        self.configured: Configured = found
        self._store = None if store is None else names_of(store, "store")[0]

    @staticmethod
    def propose(
        folder: PathLike,
        out: PathLike = "campaign.toml",
        *,
        vehicle: PathLike | None = None,
        dbc: PathLike | Sequence[PathLike] = (),
        force: bool = False,
        progress: Progress = None,
    ) -> Proposal:
        """Look at every log in a folder and below it, and propose a campaign file; `Proposal.write` writes it.

        Parameters
        ----------
        folder : str or Path
            With logs in it or below it.
        out : str or Path
            The campaign file; runs.csv, map.toml and vehicle.toml go beside it.
        vehicle : str or Path, optional
            Vehicle file of all runs; without it one to fill is proposed.
        dbc : paths, optional
            CAN databases for raw frames.
        force : bool
            Overwrite files that exist.

        Raises
        ------
        ConfigError
            If no log can be read, or a file is in the way.
        """
        from aqualog.face.propose import propose

        return propose(folder, out, vehicle=vehicle, dbc=dbc, force=force, progress=progress)

    @staticmethod
    def simulate(
        programme: str, folder: PathLike, *, jobs: int | None = None, force: bool = False, progress: Progress = None
    ) -> SimulatedCampaign:
        """Simulate the drives of a programme, `thesis` or `situations`, into a folder.

        See `aqualog.face.simulate.simulate_campaign`; the campaign is `.campaign` of what is returned.

        Examples
        --------
        >>> aq.Campaign.simulate("thesis", "thesis", jobs=8).campaign.run()
        """
        from aqualog.face.simulate import simulate_campaign

        return simulate_campaign(programme, folder, jobs=jobs, force=force, progress=progress)

    @property
    def name(self) -> str:
        """Name of the campaign."""
        return self.configured.campaign.name

    @property
    def keys(self) -> tuple[str, ...]:
        """Keys by which the runs can be grouped."""
        return self.configured.campaign.keys

    @property
    def store(self) -> Address:
        """Folder or URL of the results: the one given, else a folder beside the campaign file.

        Raises
        ------
        ConfigError
            For logs without a campaign file, which have no place of their own.
        """
        if self._store is not None:
            from aqualog.campaign.place import address_of

            return address_of(self._store)
        path = self.configured.campaign.path
        if path.suffix.lower() != ".toml":
            raise ConfigError(
                "logs without a campaign file have no place for results", expected="a folder or URL as store"
            )
        return path.with_suffix(".store")

    @property
    def sources(self) -> tuple[Path, ...]:
        """All files that the campaign reads, which no result may overwrite."""
        from aqualog.config.configured import files_of

        return files_of(self.configured)

    @property
    def runs(self) -> pl.DataFrame:
        """A row for each run: log and what the campaign says of it."""
        import polars as pl

        runs = self.configured.campaign.runs
        rows = [{"log": "; ".join(map(str, r.logs)), "vehicle": str(r.vehicle), **r.values} for r in runs]
        return pl.DataFrame(rows, infer_schema_length=None)

    def check_bins(self, by: str | Sequence[str] = (), *, bin_width: float = 10.0, road: str = "wet") -> Any:
        """Check keys and bins before any work, and return the plan that they make.

        Raises
        ------
        ConfigError
        """
        from aqualog.campaign.bins import check_plan

        bin_width = number_of(bin_width, "bin_width", 1.0, 100.0, "km/h")
        return check_plan(self.configured.campaign, split(by), width_kmh=bin_width, road=road)

    def check_targets(self, targets: Sequence[Path], *, force: bool) -> None:
        """Refuse results that are in the way of something, that the campaign reads, or that lie in a store.

        Raises
        ------
        ConfigError
        """
        places = [self.store] if self._store is not None else []
        if self.configured.campaign.path.suffix.lower() == ".toml":
            places.append(self.configured.campaign.path.with_suffix(".store"))
        for target in targets:
            refuse_in_store(target, [p for p in places if isinstance(p, Path)])
        refuse_existing(targets, force=force, sources=self.sources)

    def check_report(self, folder: Path, *, force: bool) -> None:
        """Refuse a folder for the report that holds other files, or files that the campaign reads.

        Raises
        ------
        ConfigError
        """
        from aqualog.campaign.jobs import name_of
        from aqualog.report.campaign.folder import check_folder, targets_of

        check_folder(folder, force=force)
        campaign = self.configured.campaign
        self.check_targets(targets_of(folder, [name_of(campaign, r.logs) for r in campaign.runs]), force=True)

    def matrix(self) -> Matrix:
        """Return the test matrix: what was driven how often and how fast, and what is missing.

        Raises
        ------
        ConfigError
            For logs without a campaign file.
        """
        from aqualog.face.matrix import matrix

        path = self.configured.campaign.path
        if path.suffix.lower() != ".toml":
            raise ConfigError("logs without a campaign file have no test matrix", expected="a campaign file (TOML)")
        return matrix(path)

    def plan(
        self,
        *,
        jobs: int | None = None,
        sample: int | None = None,
        within: str | None = None,
        progress: Progress = None,
    ) -> BatchPlan:
        """Estimate what `run` will cost, from a sample of the logs: time, memory, room in the store.

        Parameters
        ----------
        jobs : int, optional
            Logs at a time; default one per core.
        sample : int, optional
            Logs to measure; default 8, or two for each process.
        within : str, optional
            A time such as `30min` or `8h`: how many shards end within it.

        Raises
        ------
        ConfigError, FitError
        """
        from aqualog.face.plan import plan

        return plan(self, jobs=jobs, sample=sample, within=within, progress=progress)

    def run(
        self,
        *,
        jobs: int | None = None,
        force: bool = False,
        shard: str | None = None,
        cluster: str | None = None,
        limit_s: float | None = None,
        limit_mb: int | None = None,
        progress: Progress = None,
    ) -> CampaignRuns:
        """Measure every log that is new or has changed, keep the results in the store, and load them all.

        Parameters
        ----------
        jobs : int, optional
            Logs at a time; default one per core.
        force : bool
            Measure all logs again.
        shard : str, optional
            `3/8`: only the third of eight parts, for several machines on one store.
        cluster : str, optional
            Address of a dask scheduler whose workers do the work.
        limit_s : float, optional
            Longest time for one log. [s]
        limit_mb : int, optional
            Most memory for one process. [MB]
        progress : callable, optional
            Called with each step of the work, such as `print`.

        Raises
        ------
        ConfigError
            If the folder is not a store.
        AqualogError
            If the store cannot be written, or another batch writes there.
        """
        from aqualog.campaign.definition import part_of, shard_of
        from aqualog.guard.worker import Limits

        began = time.monotonic()
        if jobs is not None:
            jobs = whole_number(jobs, "jobs", 1, 1024)
        if limit_s is not None:
            limit_s = number_of(limit_s, "limit_s", 1.0, 1e9, "s")
        if limit_mb is not None:
            limit_mb = whole_number(limit_mb, "limit_mb", 300, 10**9)
        if cluster is not None and jobs is not None:
            raise ConfigError("jobs beside cluster", expected="as many as there are workers")
        if cluster is not None and not text_of(cluster, "cluster").strip():
            raise ConfigError("cluster is empty", expected="tcp://host:8786")
        part = None if shard is None else shard_of(text_of(shard, "shard"))
        configured = self.configured
        if part is not None:
            configured = replace(configured, campaign=part_of(configured.campaign, part))
        if not configured.campaign.runs:  # a matrix of shards may have more parts than there are logs
            from aqualog.campaign.batch import BatchOutcome
            from aqualog.campaign.results import CampaignData
            from aqualog.campaign.store import Store

            return CampaignRuns(self, CampaignData(configured, Store(self.store), ()), BatchOutcome(0, 0, {}), part)
        data, outcome = bring_up_to_date(
            configured, self.store, listener(progress), jobs=jobs, force=force, shard=part, cluster=cluster,
            limits=Limits(limit_s, limit_mb),
        )  # fmt: skip
        return CampaignRuns(self, data, outcome, part, time.monotonic() - began)

    def __repr__(self) -> str:
        return f"campaign {self.name}: {len(self.configured.campaign.runs)} runs, keys {', '.join(self.keys) or 'none'}"
