"""`aqualog inspect campaign.toml`: the test matrix."""

from __future__ import annotations

import json
import sys
from pathlib import Path

__all__ = ["inspect_campaign"]


def inspect_campaign(path: Path, *, as_json: bool) -> int:
    """Check the campaign, print its matrix and what is missing; exit code.

    Speeds that the campaign file does not tell are taken from a store beside it, if a batch has made one. A log that is
    missing is no fault of the matrix: it is told, and the code is that of inputs that failed; without any log there is
    nothing usable.
    """
    from aqualog.campaign.logs import log_states
    from aqualog.campaign.matrix import campaign_matrix, speeds_of
    from aqualog.campaign.measured import lane_faults, measured_runs
    from aqualog.cli.console import clean
    from aqualog.config.campaign import read_campaign
    from aqualog.config.vehicle import load_vehicle
    from aqualog.errors import ExitCode
    from aqualog.report.matrix_text import matrix_document, matrix_text

    read = read_campaign(path)
    campaign = read.campaign
    states = log_states(campaign, read.places)
    measured = measured_runs(campaign, path.with_suffix(".store"))
    ranges = {i: m.speeds for i, m in measured.items() if m.speeds}
    matrix = campaign_matrix(campaign, lambda index, run: speeds_of(run) or ranges.get(index, ()))
    lanes = lane_faults(campaign, measured, read.places)
    vehicles = {p.name: load_vehicle(p) for p in dict.fromkeys(r.vehicle for r in campaign.runs)}
    if as_json:
        document = matrix_document(campaign, matrix, states, vehicles, measured, lanes)
        sys.stdout.write(json.dumps(document, indent=1, allow_nan=False) + "\n")
    else:
        sys.stdout.write(clean(matrix_text(campaign, matrix, states, vehicles, measured, lanes)))
    there = sum(s.size is not None for s in states)
    if not there:
        return int(ExitCode.NOTHING_USABLE)
    return int(ExitCode.DONE) if there == len(states) else int(ExitCode.PARTIAL)
