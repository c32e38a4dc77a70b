"""`aqualog bin-slipslope` and `aqualog bin-resistance`: one quantity over speed, for each configuration."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aqualog.cli.frame import Output, Run, command

if TYPE_CHECKING:
    from aqualog.cli.console import Heard
    from aqualog.face.bins import BinnedResistance, BinnedSlopes
    from aqualog.face.campaign_runs import CampaignRuns

__all__ = ["bin_resistance", "bin_slipslope"]


@command("logs:campaign by width road robust store vehicle:of_logs signals dbc table jobs json force")
def bin_slipslope(run: Run, by: str, width: float, road: str, robust: bool, table: Path | None) -> Output:
    """Slip slope over speed for each configuration, and the speed of full aquaplaning.

    Slip is regressed on traction in bins of speed; the 95 % intervals treat a run, not a sample, as the unit, and are
    given with three runs or more. Beside each slope: the contact that is left against dry road, and what the model
    expects. Logs that have no results yet are run first, as `aqualog batch` does. The delay of v_x is estimated and
    taken off. --by side puts the wheels of a side together.

    JSON: rows, dry, delays, full_aquaplaning (from the slopes, from minor and from full spin-downs), spin_ups,
    minor_spin_downs.

    \b
    Examples:
      aqualog bin-slipslope campaign.toml
      aqualog bin-slipslope campaign.toml --by tyre,pressure --road both
      aqualog bin-slipslope campaign.toml --by water-depth,side --bin-width 20 --robust
      aqualog bin-slipslope campaign.toml --json | jq '.full_aquaplaning[] | select(.v_full_kmh)'
      aqualog bin-slipslope campaign.toml --store results -o slopes.csv
    """

    def find(runs: CampaignRuns, hear: Heard) -> BinnedSlopes:
        return runs.slip_slope(by, bin_width=width, road=road, robust=robust, progress=hear)

    return _binned(run, find, by, width, road, table)


@command("logs:campaign by width road robust as_measured store vehicle:of_logs signals dbc table jobs json force")
def bin_resistance(
    run: Run,
    by: str,
    width: float,
    road: str,
    robust: bool,
    table: Path | None,
    as_measured: Annotated[
        bool, typer.Option("--as-measured", help="Do not take off each run's own level on dry road.")
    ] = False,
) -> Output:
    """Mean resistance measure over speed for each configuration.

    The acceleration that the torques should give less the one that is measured, less the run's own level on dry road
    before the lane (at least a second of it). The 95 % intervals treat a run, not a sample, as the unit, and are given
    with three runs or more. Logs that have no results yet are run first, as `aqualog batch` does.

    \b
    Examples:
      aqualog bin-resistance campaign.toml
      aqualog bin-resistance campaign.toml --by tyre,water-depth --json
      aqualog bin-resistance campaign.toml --by load --bin-width 20 --robust -o resistance.csv
      aqualog bin-resistance campaign.toml --road both --as-measured
    """

    def find(runs: CampaignRuns, hear: Heard) -> BinnedResistance:
        return runs.resistance(by, bin_width=width, road=road, robust=robust, as_measured=as_measured, progress=hear)

    return _binned(run, find, by, width, road, table)


def _binned(
    run: Run,
    find: Callable[[CampaignRuns, Heard], BinnedSlopes | BinnedResistance],
    by: str,
    width: float,
    road: str,
    table: Path | None,
) -> Output:
    """Bring the campaign up to date and find what is asked for, if any of its logs gives a result."""
    from aqualog.face.bins import check_table

    if table is not None:
        check_table(table)
    campaign = run.campaign()
    campaign.check_bins(by, bin_width=width, road=road)
    campaign.check_targets([table] if table is not None else [], force=run.force)
    runs = run.measured(campaign)
    if not runs.outcome.done:
        return run.of_runs(runs)
    with run.hearing() as hear:
        found = find(runs, hear)
    if table is not None:
        found.write(table, force=True)
    return run.of_runs(runs, result=found, notes=[] if table is None else [f"the table is {table}"])
