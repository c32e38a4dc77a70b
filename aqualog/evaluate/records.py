"""Result of one drive: small records that can be added up and stored as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from aqualog.evaluate.match import Cell, Hit

__all__ = ["DetectorRun", "RunRecord", "record_from_json", "record_to_json"]

_HITS = ("full", "partial", "wheel_full", "wheel_partial", "own")


@dataclass(frozen=True, slots=True)
class DetectorRun:
    """One detector on one drive.

    `full` and `partial` are episodes of the car; `wheel_full` and `wheel_partial` those of the wheels that the detector
    names, matched with its events on that wheel; `own` those of the label with the detector's name. `false_alarms` are
    times at which an event began outside water [s]; `on_water` counts events on water that began outside aquaplaning;
    `cells` is the column of the confusion table.
    """

    full: tuple[Hit, ...] = ()
    partial: tuple[Hit, ...] = ()
    wheel_full: tuple[Hit, ...] = ()
    wheel_partial: tuple[Hit, ...] = ()
    own: tuple[Hit, ...] = ()
    false_alarms: tuple[float, ...] = ()
    on_water: int = 0
    cells: Mapping[str, Cell] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class RunRecord:
    """One drive under all detectors.

    `dry_s` [s] and `dry_m` [m] are time and way outside water (and the second after it); `wet_s` is the time on water
    without aquaplaning. `detectors` holds those that could run, `unavailable` the others; `is_lossy` if the
    log was cut or damaged.
    """

    name: str
    groups: Mapping[str, str]
    duration_s: float
    dry_s: float
    dry_m: float
    wet_s: float
    detectors: Mapping[str, DetectorRun]
    unavailable: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    is_lossy: bool = False


def record_to_json(record: RunRecord) -> dict[str, Any]:
    """Return a record as JSON values; NaN becomes null."""
    return {
        "name": record.name,
        "groups": dict(record.groups),
        **{k: getattr(record, k) for k in ("duration_s", "dry_s", "dry_m", "wet_s")},
        "unavailable": list(record.unavailable),
        "notes": list(record.notes),
        "is_lossy": record.is_lossy,
        "detectors": {name: _detector_to_json(d) for name, d in record.detectors.items()},
    }


def record_from_json(raw: Mapping[str, Any]) -> RunRecord:
    """Read the record that `record_to_json` wrote."""
    return RunRecord(
        name=raw["name"],
        groups=raw["groups"],
        duration_s=raw["duration_s"],
        dry_s=raw["dry_s"],
        dry_m=raw["dry_m"],
        wet_s=raw["wet_s"],
        detectors={name: _detector_from_json(d) for name, d in raw["detectors"].items()},
        unavailable=tuple(raw["unavailable"]),
        notes=tuple(raw["notes"]),
        is_lossy=raw["is_lossy"],
    )


def _detector_to_json(d: DetectorRun) -> dict[str, Any]:
    return {
        **{k: [_hit_to_json(h) for h in getattr(d, k)] for k in _HITS},
        "false_alarms": list(d.false_alarms),
        "on_water": d.on_water,
        "cells": {row: [c.episodes, c.hit, c.events, c.seconds] for row, c in d.cells.items()},
    }


def _detector_from_json(raw: Mapping[str, Any]) -> DetectorRun:
    return DetectorRun(
        **{k: tuple(_hit_from_json(h) for h in raw[k]) for k in _HITS},
        false_alarms=tuple(raw["false_alarms"]),
        on_water=raw["on_water"],
        cells={row: Cell(*values) for row, values in raw["cells"].items()},
    )


def _hit_to_json(h: Hit) -> list[Any]:
    return [h.found, None if math.isnan(h.latency) else round(h.latency, 6), h.before]


def _hit_from_json(raw: list[Any]) -> Hit:
    return Hit(raw[0], math.nan if raw[1] is None else raw[1], raw[2])
