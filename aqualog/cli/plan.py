"""`aqualog plan`."""

from __future__ import annotations

from typing import Annotated

import typer

from aqualog.cli.frame import Output, Run, command

__all__ = ["plan"]


@command("logs:campaign store jobs sample within vehicle:of_logs signals dbc thresholds json")
def plan(
    run: Run,
    sample: Annotated[
        int | None,
        typer.Option("--sample", help="Logs to measure; default 8, or 2 per process.", min=2, max=1000, metavar="K"),
    ] = None,
    within: Annotated[
        str | None,
        typer.Option(
            "--within", help="Report how many --shard are done in that time: 90s, 30min, 8h, 2d.", metavar="TIME"
        ),
    ] = None,
) -> Output:
    """Estimate what `aqualog batch` on a campaign will cost: time, memory, room in the store, shards.

    A few logs of every format, from the smallest to the largest, are measured in processes as the batch has them, into
    a store that is thrown away. What is in the campaign's store already is not counted. The interval (90 %) is from how
    the sample scatters; it knows nothing of a machine that is busier later. -v lists the sample.

    \b
    Examples:
      aqualog plan campaign.toml
      aqualog plan campaign.toml --jobs 16 --sample 32 --within 1h
      aqualog plan logs/*.mf4 --vehicle car.toml --store results --json
    """
    campaign = run.campaign()
    with run.hearing() as hear:
        found = campaign.plan(jobs=run.jobs, sample=sample, within=within, progress=hear)
    details = [
        f"  {', '.join(p.name for p in t.logs)}: {t.size / 1e6:.1f} MB, {t.wall_s:.2f} s, {t.cpu_s:.2f} s computing "
        f"{t.reason}"
        for t in (found.trial.tried if found.trial else ())
    ]
    return Output(found, found.notes, details)
