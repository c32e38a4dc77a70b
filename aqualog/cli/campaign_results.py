"""What commands on campaigns share: the campaign as it was typed, its store, and the store brought up to date."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from aqualog.cli.apart import is_command
from aqualog.cli.console import Console, clean_line, told_if_interrupted
from aqualog.errors import ConfigError, ExitCode
from aqualog.face.campaign import is_campaign
from aqualog.face.paths import expand, list_files, refuse_existing
from aqualog.face.progress import Progress
from aqualog.places import has_kept_code

if TYPE_CHECKING:
    from aqualog.campaign.batch import BatchOutcome, Configured
    from aqualog.campaign.place import Address
    from aqualog.campaign.samples import CampaignData
    from aqualog.campaign.shard import Shard
    from aqualog.campaign.store import Store
    from aqualog.cli.console import Steps
    from aqualog.workers import Limits, WorkOn

__all__ = ["check_targets", "exit_code", "opened", "results", "store_of"]

_TOLD_AT_ONCE = 20


def opened(
    inputs: Sequence[str],
    *,
    vehicle: Path | None = None,
    map_file: Path | None = None,
    dbc: Sequence[Path] = (),
    thresholds: Path | None = None,
) -> Configured:
    """The campaign behind what was typed, read and checked completely.

    Raises
    ------
    ConfigError
        With all faults in one message; also for logs without a vehicle, and `--vehicle` beside a campaign.
    """
    from aqualog.config.configured import configure, configure_logs

    if is_campaign(inputs):
        if vehicle is not None:
            raise ConfigError("--vehicle beside a campaign", where=inputs[0], expected="it in the campaign's runs")
        return configure(Path(inputs[0]), map_file=map_file, dbc=dbc, thresholds=thresholds)
    if vehicle is None:
        raise ConfigError("no --vehicle", expected="a vehicle file, or a campaign file that names one")
    lists = list_files(inputs)
    return configure_logs(
        expand(inputs), vehicle, map_file=map_file, dbc=dbc, thresholds=thresholds, lists=tuple(lists)
    )  # fmt: skip


def store_of(configured: Configured, given: Address | None) -> Address:
    """Folder or URL of the results: the one given, else a folder beside the campaign file.

    Raises
    ------
    ConfigError
        For logs without a campaign file, which have no place of their own, and for a place that goes with this process.
    """
    if given is not None:
        from aqualog.campaign.place import address_of, is_of_process

        if is_command() and is_of_process(given):
            raise ConfigError(
                "is in the memory of this command and would end with it", where=str(given), expected="a folder or a URL"
            )
        return address_of(given)
    if configured.campaign.path.suffix.lower() != ".toml":
        raise ConfigError("logs without a campaign file have no place for results", expected="--store DIR")
    return configured.campaign.path.with_suffix(".store")


def check_targets(
    configured: Configured, targets: Sequence[Path], *, force: bool, store: Address | None = None
) -> None:  # fmt: skip
    """Refuse results that are in the way of something, that the campaign itself reads, or that lie in a store.

    Parameters
    ----------
    store : Path or str, optional
        Folder or URL of the results as it was typed, for one that is not there yet.

    Raises
    ------
    ConfigError
    """
    from aqualog.config.configured import files_of

    places = [store_of(configured, store)] if store is not None else []
    if configured.campaign.path.suffix.lower() == ".toml":
        places.append(store_of(configured, None))
    for target in targets:
        _refuse_in_store(target, [p for p in places if isinstance(p, Path)])
    refuse_existing(targets, force=force, sources=files_of(configured))


def results(
    configured: Configured,
    store: Address | None,
    *,
    console: Console,
    jobs: int | None = None,
    force: bool = False,
    shard: Shard | None = None,
    cluster: str | None = None,
    limits: Limits | None = None,
) -> tuple[CampaignData, BatchOutcome]:
    """Bring the store up to date and load it; every log that gives nothing is told on stderr.

    With `shard` the campaign is that shard's already.

    Raises
    ------
    ConfigError
        If the folder is none of a store.
    AqualogError
        If logs must be measured and the store cannot be written, or another batch writes there.
    """
    from aqualog.workers import NO_LIMITS, most_processes

    if jobs is not None and jobs > most_processes():
        console.note(f"--jobs {jobs}: {most_processes()} processes are the most on this machine")
    with console.steps() as steps:
        steps("looking at the logs")
        from aqualog.campaign.batch import run_batch
        from aqualog.campaign.samples import load_results
        from aqualog.campaign.store import Store

        if cluster is None and not has_kept_code():
            steps.clear()
            console.note("the first logs wait while the detectors are compiled, once after an installation")
        place = Store(store_of(configured, store), shard.name if shard is not None else "")
        _check_apart(configured, place)
        told: list[str] = []

        def tell(name: str, reason: str) -> None:
            told.append(name)
            if len(told) <= _TOLD_AT_ONCE:
                steps.clear()
                sys.stderr.write(f"error: {clean_line(_with_name(name, reason))}\n")

        with (
            told_if_interrupted("the logs that are done are kept, the same command goes on with the rest"),
            _elsewhere(cluster, limits or NO_LIMITS, steps) as elsewhere,
        ):
            outcome = run_batch(
                configured, place, jobs=jobs or os.cpu_count() or 1, force=force, limits=limits or NO_LIMITS,
                elsewhere=elsewhere, report=Progress(steps, "logs"), told=tell,
            )  # fmt: skip
        steps("loading the results")
        data = load_results(configured, place)
    if len(told) > _TOLD_AT_ONCE:
        sys.stderr.write(f"error: and {len(told) - _TOLD_AT_ONCE} more; all are in {place.at('manifest.json')}\n")
    return data, outcome


@contextmanager
def _elsewhere(address: str | None, limits: Limits, steps: Steps) -> Iterator[WorkOn | None]:
    if address is None:
        yield None
        return
    from aqualog.campaign.cluster import on_cluster

    with on_cluster(address, limits=limits, tell=lambda text: steps(f"{address}: {text}")) as work_on:
        yield work_on


def exit_code(outcome: BatchOutcome, data: CampaignData) -> int:
    """The contract's exit code for what came of the logs."""
    if not outcome.done:
        return int(ExitCode.NOTHING_USABLE)
    is_lossy = any(r.about["quality"]["truncated"] or r.about["quality"]["lost_in_files"] for r in data.done)
    return int(ExitCode.PARTIAL) if outcome.failed or is_lossy else int(ExitCode.DONE)


def _check_apart(configured: Configured, place: Store) -> None:
    from aqualog.config.configured import files_of

    if any(place.holds(p) for p in files_of(configured)):
        raise ConfigError("holds a source of this campaign", where=place.name, expected="a folder of its own")


def _refuse_in_store(target: Path, places: Sequence[Path]) -> None:
    from aqualog.campaign.store import Store

    above = [p for p in Path(os.path.realpath(target)).parents if Store(p).exists]
    inside = next((p for p in [*above, *places] if Store(p).holds(target)), None)
    if inside is not None:
        raise ConfigError("lies in a store of results", where=str(target), expected=f"a place outside {inside}")


def _with_name(name: str, reason: str) -> str:
    """A reason that says of which log it is, once."""
    short = f"{Path(name).name}: "
    if name in reason:
        return reason
    return f"{name}: {reason.removeprefix(short)}"
