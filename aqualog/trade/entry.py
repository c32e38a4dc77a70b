"""One run, pass or stop of a test, with the configuration in which it was driven."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from aqualog.campaign.bins import Group
from aqualog.trade.braking import Stop
from aqualog.trade.curve import CurvePass
from aqualog.trade.onset import Onset
from aqualog.trade.straight import StraightRun

__all__ = ["KMH", "UNPLANNED", "Entry", "Kind", "Record"]

Kind = Literal["straight", "curve", "braking"]
Record = StraightRun | CurvePass | Stop
KMH = 3.6  # [km/h per m/s]
UNPLANNED: Group = (("x_run", "in no run of the campaign"),)
"""The set of logs that no run names: nobody has said that their tyre is that of a planned set."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One run, pass or stop.

    `number` counts those of a log from 1 on. `order` is its place among all of the test, in the order in which they
    were driven. `of_set` are reasons that come from comparing it with its set.
    """

    log: str
    number: int
    order: float
    group: Group
    tyre: str
    found: Record
    onset: Onset | None = None
    of_set: tuple[str, ...] = ()

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why it does not count."""
        return (*self.found.reasons, *self.of_set)

    @property
    def valid(self) -> bool:
        """Whether it counts."""
        return self.found.valid and not self.of_set

    @property
    def is_censored(self) -> bool:
        """Whether its value is only known to lie above `value`."""
        return isinstance(self.found, StraightRun) and self.found.is_censored

    @property
    def value(self) -> float:
        """Speed of 15 % slip [km/h], or braking force coefficient [-]; a pass of a curve has none."""
        if isinstance(self.found, StraightRun):
            return KMH * self.found.v
        return self.found.bfc if isinstance(self.found, Stop) else math.nan
