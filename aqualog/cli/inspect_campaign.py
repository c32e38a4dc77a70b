"""`aqualog inspect campaign.toml`: the test matrix."""

from __future__ import annotations

from pathlib import Path

from aqualog.cli.console import Console

__all__ = ["inspect_campaign"]


def inspect_campaign(path: Path, *, as_json: bool) -> int:
    """Check the campaign, print its matrix and what is missing; exit code.

    A missing log counts as an input that failed; without any log nothing is usable.
    """
    from aqualog.core.errors import ExitCode
    from aqualog.face.matrix import matrix

    found = matrix(path)
    Console().data(found, as_json=as_json)
    if not found.logs_there:
        return int(ExitCode.NOTHING_USABLE)
    return int(ExitCode.PARTIAL) if found.has_loss else int(ExitCode.DONE)
