"""What a campaign is made of, and its store brought up to date."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ConfigError
from aqualog.face.arguments import names_of
from aqualog.face.listener import Listener
from aqualog.face.progress import Progress as Counted

if TYPE_CHECKING:
    from aqualog.campaign.batch import BatchOutcome
    from aqualog.campaign.definition import Shard
    from aqualog.campaign.jobs import Configured
    from aqualog.campaign.place import Address
    from aqualog.campaign.results import CampaignData
    from aqualog.guard.worker import Limits, WorkOn

__all__ = ["bring_up_to_date", "is_campaign", "refuse_in_store", "split"]


def is_campaign(inputs: Sequence[str]) -> bool:
    """Return whether a campaign file is named, and nothing else.

    Raises
    ------
    ConfigError
        If one stands among other inputs.
    """
    named = [i for i in inputs if i.lower().endswith(".toml")]
    if named and len(inputs) > 1:
        raise ConfigError("stands among other inputs", where=named[0], expected="one campaign file, or logs only")
    return bool(named)


def split(by: str | Sequence[str]) -> list[str]:
    """Return keys that stand in one text, with commas, or in several."""
    names = by.split(",") if isinstance(by, str) else names_of(by, "by")
    return [n.strip() for n in names if n.strip()]


def bring_up_to_date(
    configured: Configured,
    address: Address,
    hear: Listener,
    *,
    jobs: int | None,
    force: bool,
    shard: Shard | None,
    cluster: str | None,
    limits: Limits,
) -> tuple[CampaignData, BatchOutcome]:
    """Bring the store up to date and load it; with `shard` the campaign is that shard's already."""
    from aqualog.core.user_folders import has_kept_code
    from aqualog.guard.worker import most_processes

    if jobs is not None and jobs > most_processes():
        hear.note(f"jobs {jobs}: {most_processes()} processes are the most on this machine")
    hear("looking at the logs")
    from aqualog.campaign.batch import run_batch
    from aqualog.campaign.results import load_results
    from aqualog.campaign.store import Store

    if cluster is None and not has_kept_code():
        hear.note("the first logs wait while the detectors are compiled, once after an installation")
    place = Store(address, shard.name if shard is not None else "")
    _check_apart(configured, place)
    with _elsewhere(cluster, limits, hear) as elsewhere:
        outcome = run_batch(
            configured, place, jobs=jobs or os.cpu_count() or 1, force=force, limits=limits,
            elsewhere=elsewhere, report=Counted(hear, "logs"), told=hear.failed,
        )  # fmt: skip
    hear.settled(place.at("manifest.json"))
    hear("loading the results")
    return load_results(configured, place), outcome


@contextmanager
def _elsewhere(address: str | None, limits: Limits, hear: Callable[[str], None]) -> Iterator[WorkOn | None]:
    if address is None:
        yield None
        return
    from aqualog.campaign.cluster import on_cluster

    with on_cluster(address, limits=limits, tell=lambda text: hear(f"{address}: {text}")) as work_on:
        yield work_on


def _check_apart(configured: Configured, place: Any) -> None:
    from aqualog.config.configured import files_of

    if any(place.holds(p) for p in files_of(configured)):
        raise ConfigError("holds a source of this campaign", where=place.name, expected="a folder of its own")


def refuse_in_store(target: Path, places: Sequence[Path]) -> None:
    """Refuse a result that lies in a store of results: one of `places`, or one above it.

    Raises
    ------
    ConfigError
    """
    from aqualog.campaign.store import Store

    above = [p for p in Path(os.path.realpath(target)).parents if Store(p).exists]
    inside = next((p for p in [*above, *places] if Store(p).holds(target)), None)
    if inside is not None:
        raise ConfigError("lies in a store of results", where=str(target), expected=f"a place outside {inside}")
