"""What commands on campaigns share: the campaign as it was typed, and its runs brought up to date."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from aqualog.cli.console import Console, told_if_interrupted
from aqualog.core.errors import ConfigError, ExitCode
from aqualog.guard.command import is_command

if TYPE_CHECKING:
    from aqualog.face.campaign import Campaign, CampaignRuns

__all__ = ["exit_code", "open_campaign", "run_campaign"]


def open_campaign(
    inputs: Sequence[str],
    *,
    vehicle: Path | None = None,
    signals: Path | None = None,
    dbc: Sequence[Path] | None = None,
    thresholds: Path | None = None,
    store: str | None = None,
) -> Campaign:
    """Read and check a campaign completely.

    Raises
    ------
    ConfigError
        With all faults in one message; also for a store that would end with this process.
    """
    from aqualog.face.campaign import Campaign

    if store is not None and is_command():
        from aqualog.campaign.place import is_of_process

        if is_of_process(store):
            raise ConfigError(
                "is in the memory of this command and would end with it", where=store, expected="a folder or a URL"
            )
    return Campaign(list(inputs), vehicle=vehicle, map=signals, dbc=dbc or (), thresholds=thresholds, store=store)


def run_campaign(campaign: Campaign, console: Console, *, jobs: int | None = None) -> CampaignRuns:
    """Measure what is new, as `aqualog batch` does; every log that gives no result is reported on stderr."""
    with console.hearing() as hear, told_if_interrupted(INTERRUPTED):
        return campaign.run(jobs=jobs, progress=hear)


INTERRUPTED = "the logs that are done are kept, the same command goes on with the rest"


def exit_code(runs: CampaignRuns) -> int:
    """Return the contract's exit code for what came of the logs."""
    if not runs.outcome.done:
        return int(ExitCode.NOTHING_USABLE)
    return int(ExitCode.PARTIAL) if runs.has_loss else int(ExitCode.DONE)
