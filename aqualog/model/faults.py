"""Faults of sensors and buses: values that are missing or stand still for a while."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

import numpy as np

from aqualog.core.records import FloatArray

__all__ = ["FAULT_KINDS", "FaultKind", "SensorFault", "with_faults"]

FaultKind = Literal["missing", "frozen"]
FAULT_KINDS: tuple[FaultKind, ...] = ("missing", "frozen")


@dataclass(frozen=True, slots=True)
class SensorFault:
    """A signal, or all of a bus message by the name of its group, fails from `start_s` to before `end_s`.

    `missing`: no value (NaN); `frozen`: the last value before; without one, missing.
    """

    where: str
    start_s: float
    end_s: float
    kind: FaultKind = "missing"


def with_faults(x: FloatArray, t: FloatArray, faults: Collection[SensorFault], *, names: Collection[str]) -> FloatArray:
    """Put the faults that name a signal (its own name, its group's) into it: signal (n,) at the times t (n,) [s].

    A signal without faults is returned unchanged.
    """
    for fault in faults:
        if fault.where not in names:
            continue
        out = (t >= fault.start_s) & (t < fault.end_s)
        before = int(np.searchsorted(t, fault.start_s)) - 1
        x = np.where(out, x[before] if fault.kind == "frozen" and before >= 0 else np.nan, x)
    return x
