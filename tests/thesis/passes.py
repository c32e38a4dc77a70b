"""The car of the simulated passes and what is computed from a drive, for tests of the simulator."""

from dataclasses import replace

from aqualog.model.programme import SEDAN as DRIVEN
from aqualog.thesis.evidence.passes import resistance, slip_and_traction

__all__ = ["SEDAN", "resistance", "slip_and_traction"]

SEDAN = replace(DRIVEN, given=frozenset({"drivetrain", "mass"}))
