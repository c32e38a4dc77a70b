"""The checks of several drives of one car: one sentence for a fault that many of them have."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping

from aqualog.checks.look import look
from aqualog.core.records import Remark, Signals
from aqualog.core.vehicle import Vehicle

__all__ = ["OfDrives", "distinct", "look_at_all", "sentences"]

_NUMBER = re.compile(r"[-+]?\d+(?:[.,]\d+)*")

OfDrives = tuple[tuple[str, Remark], ...]
"""Remarks with the names of their drives."""


def look_at_all(drives: Mapping[str, Signals], vehicle: Vehicle, *, but: Collection[str] = ()) -> OfDrives:
    """Return what does not fit in drives, by name; without the kinds of remarks that the caller finds better itself."""
    return tuple((name, r) for name, signals in drives.items() for r in look(signals, vehicle) if r.kind not in but)


def distinct(found: OfDrives) -> list[tuple[tuple[str, ...], Remark]]:
    """Return each remark once, as its first drive has it, with the names of all its drives.

    Remarks that differ only in their numbers are one.
    """
    names: dict[tuple[str, tuple[str, ...], str], list[str]] = {}
    first: dict[tuple[str, tuple[str, ...], str], Remark] = {}
    for name, remark in found:
        key = (remark.kind, remark.signals, _NUMBER.sub("", remark.sentence))
        names.setdefault(key, []).append(name)
        first.setdefault(key, remark)
    return [(tuple(dict.fromkeys(names[key])), remark) for key, remark in first.items()]


def sentences(found: OfDrives) -> list[str]:
    """Return a sentence for each fault, of the first drive that has it."""
    names: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    said: dict[tuple[str, tuple[str, ...]], str] = {}
    for name, remark in found:
        key = (remark.kind, remark.signals)
        names.setdefault(key, []).append(name)
        said.setdefault(key, f"{name}: {remark.sentence}")
    return [s + (f" (and in {n - 1} more)" if (n := len(names[key])) > 1 else "") for key, s in said.items()]
