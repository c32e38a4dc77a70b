"""Runs whose vehicle file does not say which axle is driven: what is not estimated, and what their torques propose."""

from __future__ import annotations

from aqualog.campaign.results import CampaignData, RunInfo
from aqualog.core.errors import SignalError

__all__ = ["no_drivetrain", "proposed_drivetrain", "refuse_without_drivetrain"]

_EXPECTED = 'drivetrain = "rwd", "fwd" or "awd" in the vehicle file'


def proposed_drivetrain(info: RunInfo) -> str:
    """What the torques of a run's log show of its driven axle; empty where they show nothing."""
    return "; ".join(c.sentence for c in info.checks if c.kind == "drivetrain")


def no_drivetrain(data: CampaignData, what: str) -> SignalError | None:
    """Say of how many runs `what` is missing and why, with where to put the axle; None if all runs have it."""
    lacking = [r for r in data.done if not r.vehicle.knows_drivetrain]
    if not lacking:
        return None
    files = ", ".join(dict.fromkeys(r.run.vehicle.name for r in lacking))
    proposed = next((p for r in lacking if (p := proposed_drivetrain(r))), "")
    return SignalError(
        f"{what} for {len(lacking)} of {len(data.done)} runs: no file says which axle is driven", where=files,
        expected=_EXPECTED, hint=proposed,
    )  # fmt: skip


def refuse_without_drivetrain(data: CampaignData, what: str) -> None:
    """SignalError if no run's vehicle file says which axle is driven, so that nothing would be left."""
    error = no_drivetrain(data, what)
    if error is not None and not any(r.vehicle.knows_drivetrain for r in data.done):
        raise error
