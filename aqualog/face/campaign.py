"""`aq.Campaign`: many drives in known configurations, and what all of them say together."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from aqualog.core.errors import ConfigError
from aqualog.face.arguments import file_of, number_of, text_of, whole_number
from aqualog.face.campaign_inputs import CampaignInputs
from aqualog.face.campaign_runs import CampaignRuns, runs_of
from aqualog.face.listener import Counted, Listener, Progress, listener
from aqualog.face.result import PathLike

if TYPE_CHECKING:
    from aqualog.campaign.batch import BatchOutcome
    from aqualog.campaign.results import CampaignData
    from aqualog.face.inspect import Matrix
    from aqualog.face.plan import BatchPlan
    from aqualog.face.propose import Proposal
    from aqualog.guard.worker import Limits, WorkOn
    from aqualog.model.campaign import CampaignOutcome

__all__ = ["Campaign", "SimulatedCampaign"]


class Campaign(CampaignInputs):
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

    @staticmethod
    def propose(
        folder: PathLike,
        out: PathLike = "campaign.toml",
        *,
        vehicle: PathLike | None = None,
        dbc: PathLike | Sequence[PathLike] = (),
        force: bool = False,
        progress: Progress = None,
    ) -> Proposal[Campaign]:
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

        return propose(Campaign, folder, out, vehicle=vehicle, dbc=dbc, force=force, progress=progress)

    @staticmethod
    def simulate(
        programme: str, folder: PathLike, *, jobs: int | None = None, force: bool = False, progress: Progress = None
    ) -> SimulatedCampaign:
        """Simulate the drives of a programme into a folder, with vehicle files and a campaign file.

        A folder in which the same programme was begun is completed. A drive that fails is left out, and `progress`
        hears why.

        Parameters
        ----------
        programme : str
            `thesis` (the measuring campaign of the thesis), `thesis-drawn` (the same, each run on tyres drawn from what
            is known of the law of water), `situations` (46 situations, most without water), or a tyre test:
            `straight-test`, `curve-test`, `braking-test`.
        folder : str or Path
            It is made if it does not exist.
        jobs : int, optional
            Drives at a time; default one per core.
        force : bool
            Simulate all drives again.
        progress : callable, optional
            Called with each step of the work, such as `print`.

        Raises
        ------
        ConfigError
            If there is no such programme, or the folder holds something else.

        Examples
        --------
        >>> aq.Campaign.simulate("thesis", "thesis", jobs=8).campaign.run()
        """
        from aqualog.io.write_log import SUFFIXES
        from aqualog.model.campaign import simulate_campaign

        began, hear, out = time.monotonic(), listener(progress), file_of(folder, "folder")
        if out.suffix.lower() in SUFFIXES:
            raise ConfigError("is the name of a log", where=str(out), expected="a folder for the campaign")
        processes = os.cpu_count() or 1 if jobs is None else whole_number(jobs, "jobs", 1, 1024)
        outcome = simulate_campaign(programme, out, jobs=processes, force=force, report=Counted(hear, "drives"))
        for name, reason in outcome.failed.items():
            hear.failed(name, reason)
        return SimulatedCampaign(out, outcome, time.monotonic() - began)

    def matrix(self) -> Matrix:
        """Return the test matrix: what was driven how often and how fast, and what is missing.

        Raises
        ------
        ConfigError
            For logs without a campaign file.
        """
        from aqualog.face.inspect import matrix

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

        began, hear = time.monotonic(), listener(progress)
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

            data = CampaignData(configured, Store(self.store), ())
            return runs_of(self, data, BatchOutcome(0, 0, {}), part, 0.0)
        from aqualog.core.user_folders import has_kept_code
        from aqualog.guard.worker import most_processes

        if jobs is not None and jobs > most_processes():
            hear.note(f"jobs {jobs}: {most_processes()} processes are the most on this machine")
        hear("looking at the logs")
        from aqualog.campaign.batch import run_batch
        from aqualog.campaign.results import load_results
        from aqualog.campaign.store import Store
        from aqualog.config.configured import files_of

        if cluster is None and not has_kept_code():
            hear.note("the first logs wait while the detectors are compiled, once after an installation")
        store = Store(self.store, part.name if part is not None else "")
        if any(store.holds(p) for p in files_of(configured)):
            raise ConfigError("holds a source of this campaign", where=store.name, expected="a folder of its own")
        limits = Limits(limit_s, limit_mb)
        with _workers_at(cluster, limits, hear) as elsewhere:
            outcome = run_batch(
                configured, store, jobs=jobs or os.cpu_count() or 1, force=force, limits=limits,
                elsewhere=elsewhere, report=Counted(hear, "logs"), told=hear.failed,
            )  # fmt: skip
        hear.settled(store.at("manifest.json"))
        hear("loading the results")
        data = load_results(configured, store)
        outcome = _without_disputed(outcome, data, hear)
        return runs_of(self, data, outcome, part, time.monotonic() - began)


def _without_disputed(outcome: BatchOutcome, data: CampaignData, hear: Listener) -> BatchOutcome:
    """Report runs whose lane differs from their log's own water; those that share less than a half have no result."""
    lost = {r.name: r.reason for r in data.runs if r.state == "failed" and r.name not in outcome.failed}
    for name, reason in lost.items():
        hear.failed(name, reason)
    told = [f"{r.name}: {r.dispute}" for r in data.done if r.dispute]
    if told:
        hear.note(f"lane times beside the on_water of {len(told)} of {len(data.runs)} runs, which count: {told[0]}")
    gone = len(lost.keys() - {r.name for r in data.done})
    kept = max(outcome.kept - gone, 0)
    made = outcome.made - (gone - (outcome.kept - kept))
    return replace(outcome, made=made, kept=kept, failed={**outcome.failed, **lost})


@contextmanager
def _workers_at(address: str | None, limits: Limits, hear: Callable[[str], None]) -> Iterator[WorkOn | None]:
    if address is None:
        yield None
        return
    from aqualog.campaign.cluster import on_cluster

    with on_cluster(address, limits=limits, tell=lambda text: hear(f"{address}: {text}")) as work_on:
        yield work_on


@dataclass(frozen=True)
class SimulatedCampaign:
    """A simulated campaign in a folder: `outcome` counts the drives made, kept and failed; `seconds` it took."""

    folder: Path
    outcome: CampaignOutcome
    seconds: float

    @property
    def path(self) -> Path:
        """The campaign file."""
        return self.folder / "campaign.toml"

    @property
    def campaign(self) -> Campaign:
        """The campaign, to run."""
        return Campaign(self.path)

    @property
    def has_loss(self) -> bool:
        """Whether a drive failed."""
        return bool(self.outcome.failed)

    def headline(self) -> str:
        """Return how many drives were simulated, and where the campaign is."""
        o = self.outcome
        kept = f", {o.kept} were there already" if o.kept else ""
        failed = f", {len(o.failed)} failed" if o.failed else ""
        return f"{o.made} drives simulated in {self.seconds:.0f} s{kept}{failed}; the campaign is {self.path}"

    def __repr__(self) -> str:
        return self.headline()
