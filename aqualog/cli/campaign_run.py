"""`aqualog simulate campaign NAME`."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from aqualog.cli.console import Console, told_if_interrupted
from aqualog.errors import ConfigError, ExitCode
from aqualog.face.progress import Progress
from aqualog.io.write_log import SUFFIXES
from aqualog.model.campaign import simulate_campaign

__all__ = ["run_campaign"]


def run_campaign(name: str, folder: Path, *, jobs: int | None, force: bool, console: Console) -> int:
    """Simulate a programme; exit code. A run that fails is told and the others are made."""
    if folder.suffix.lower() in SUFFIXES:
        raise ConfigError("is the name of a log", where=str(folder), expected="a folder for the campaign")
    began = time.monotonic()
    with console.steps() as steps:
        report = Progress(steps, "drives")
        with told_if_interrupted("the drives that are done stay, the same command goes on with the rest"):
            outcome = simulate_campaign(name, folder, jobs=jobs or os.cpu_count() or 1, force=force, report=report)
    for run, reason in outcome.failed.items():
        sys.stderr.write(f"error: {run}: {reason}\n")
    kept = f", {outcome.kept} were there already" if outcome.kept else ""
    console.note(
        f"{outcome.made} drives simulated in {time.monotonic() - began:.0f} s{kept}"
        f"{f', {len(outcome.failed)} failed' if outcome.failed else ''}; the campaign is {folder / 'campaign.toml'}"
    )
    if not outcome.failed:
        return int(ExitCode.DONE)
    return int(ExitCode.PARTIAL) if outcome.made or outcome.kept else int(ExitCode.FAILED)
