"""What the slip slope of this car on dry road is: finite periods per configuration, kept between drives."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from aqualog.errors import ConfigError
from aqualog.types import SlopeSummary

__all__ = ["History", "Period", "Rule", "history_from_json", "history_to_json", "reference", "remembered"]

Rule = Literal["max", "robust"]
KEPT_PERIODS = 20  # of 30 s of valid estimates each: ten minutes of good driving, a few hours on the road
SCHEMA_VERSION = 1


@dataclass(frozen=True, slots=True)
class Period:
    """Slip slope over one finite period of valid estimates: largest, mean [-], and how long it was [s]."""

    largest: float
    mean: float
    seconds: float


@dataclass(frozen=True, slots=True)
class History:
    """Periods by configuration (tyre, pressure, load: any text) and place (`left`, `right`), oldest first."""

    periods: Mapping[str, Mapping[str, tuple[Period, ...]]] = field(default_factory=dict)

    def of(self, configuration: str, place: str) -> tuple[Period, ...]:
        """Periods of one configuration at one place."""
        return tuple(self.periods.get(configuration, {}).get(place, ()))

    def with_periods(self, configuration: str, place: str, new: Sequence[Period]) -> History:
        """The history with the newest periods of a drive; the oldest ones drop out."""
        places = {p: tuple(v) for p, v in self.periods.get(configuration, {}).items()}
        places[place] = (*places.get(place, ()), *new)[-KEPT_PERIODS:]
        return History({**self.periods, configuration: places})


def reference(periods: Sequence[Period], *, rule: Rule = "robust") -> float:
    """Dry slope that the actual one is compared with.

    Parameters
    ----------
    periods : sequence of Period
    rule : "max" or "robust"
        "max": the largest estimate of all periods, as the thesis has it; one estimate that was too high keeps the
        detector alarmed for the whole memory. "robust": the upper quartile of the periods' means.

    Returns
    -------
    slope : float
        NaN without any period. [-]

    Thesis: section 2.3 on the history, criterion 4 in 2.5 (C56, C68).
    """
    if not periods:
        return math.nan
    if rule == "max":
        return max(p.largest for p in periods)
    return float(np.quantile([p.mean for p in periods], 0.75))


def remembered(history: History, configuration: str, slopes: Sequence[SlopeSummary]) -> History:
    """The history with what a drive has shown at each place."""
    for slope in slopes:
        if slope.periods:
            history = history.with_periods(configuration, slope.place, [Period(*p) for p in slope.periods])
    return history


def history_to_json(history: History) -> dict[str, Any]:
    """As a JSON document."""
    return {
        "schema_version": SCHEMA_VERSION,
        "slip_slope_history": {
            configuration: {
                place: [{"max": p.largest, "mean": p.mean, "seconds": p.seconds} for p in periods]
                for place, periods in sorted(places.items())
            }
            for configuration, places in sorted(history.periods.items())
        },
    }


def history_from_json(document: Any, *, where: str) -> History:
    """From a JSON document.

    Raises
    ------
    ConfigError
        Naming the entry that is not what a history holds.
    """
    if not isinstance(document, dict) or not isinstance(document.get("slip_slope_history"), dict):
        raise ConfigError("is no slip-slope history", where=where, expected='an object with "slip_slope_history"')
    if document.get("schema_version") != SCHEMA_VERSION:
        raise ConfigError("is of another version", where=where, expected=f"schema_version {SCHEMA_VERSION}")
    found: dict[str, dict[str, tuple[Period, ...]]] = {}
    for configuration, places in document["slip_slope_history"].items():
        if not isinstance(places, dict) or not all(isinstance(v, list) for v in places.values()):
            raise ConfigError(f"configuration {configuration!r} holds no places with periods", where=where)
        found[configuration] = {
            place: tuple(_period(p, f"{configuration}/{place}", where) for p in periods)[-KEPT_PERIODS:]
            for place, periods in places.items()
        }
    return History(found)


def _period(entry: Any, name: str, where: str) -> Period:
    values: list[Any] = [entry.get(k) for k in ("max", "mean", "seconds")] if isinstance(entry, dict) else []
    good = len(values) == 3 and all(
        isinstance(v, int | float) and not isinstance(v, bool) and math.isfinite(v) and v > 0.0 for v in values
    )
    if not good:
        raise ConfigError(f"a period of {name} is {entry!r}"[:200], where=where, expected="max, mean, seconds > 0")
    return Period(*(float(v) for v in values))
