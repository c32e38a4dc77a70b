"""Keep the dry slip slope of a car between drives: finite periods per configuration."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.core.records import Signals, SlopeSummary
from aqualog.core.vehicle import Vehicle

__all__ = [
    "History", "Memory", "Period", "Rule", "check_configuration", "drive_key", "history_from_json", "history_to_json",
    "reference", "remembered",
]  # fmt: skip

Rule = Literal["max", "robust"]
KEPT_PERIODS = 20  # of 30 s of valid estimates each: ten minutes of good driving, a few hours on the road
SCHEMA_VERSION = 1
PLACES = ("left", "right", "axle")
MOST_NAME = 200  # characters of a configuration
SLOPES = (1.0, 300.0)  # bounds of the estimator


@dataclass(frozen=True, slots=True)
class Period:
    """Slip slope over one finite period of valid estimates: largest, mean [-], and its length [s].

    `drive` names its drive, so that a drive that is analysed again does not count twice.
    """

    largest: float
    mean: float
    seconds: float
    drive: str = ""


@dataclass(frozen=True, slots=True)
class History:
    """Periods by configuration (tyre, pressure, load: any text) and place (`left`, `right`), oldest first."""

    periods: Mapping[str, Mapping[str, tuple[Period, ...]]] = field(default_factory=dict)

    def of(self, configuration: str, place: str) -> tuple[Period, ...]:
        """Return the periods of one configuration at one place."""
        return tuple(self.periods.get(configuration, {}).get(place, ()))

    def with_periods(self, configuration: str, place: str, new: Sequence[Period]) -> History:
        """Return the history with the newest periods of a drive; the oldest ones drop out."""
        places = {p: tuple(v) for p, v in self.periods.get(configuration, {}).items()}
        places[place] = (*places.get(place, ()), *new)[-KEPT_PERIODS:]
        return History({**self.periods, configuration: places})

    def without(self, drive: str) -> History:
        """Return the history without a drive."""
        return History(
            {
                configuration: {
                    place: tuple(p for p in periods if p.drive != drive) for place, periods in places.items()
                }
                for configuration, places in self.periods.items()
            }
        )


@dataclass(frozen=True, slots=True)
class Memory:
    """Prior knowledge of the dry slope, and the rule for the comparison."""

    history: History = field(default_factory=History)
    configuration: str = ""
    rule: Rule = "robust"

    def name(self, vehicle: Vehicle) -> str:
        """Return the configuration under which this drive is remembered."""
        return self.configuration or vehicle.name


def reference(periods: Sequence[Period], *, rule: Rule = "robust") -> float:
    """Return the dry slope to compare the current one with.

    Parameters
    ----------
    periods : sequence of Period
    rule : "max" or "robust"
        "max": the largest estimate of all periods, as in the thesis; one estimate that was too high keeps the
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


def remembered(history: History, configuration: str, slopes: Sequence[SlopeSummary], *, drive: str = "") -> History:
    """Return the history with the periods of a drive at each place; earlier ones of the same drive are replaced."""
    history = history.without(drive) if drive else history
    for slope in slopes:
        if slope.periods:
            history = history.with_periods(configuration, slope.place, [Period(*p, drive) for p in slope.periods])
    return history


def drive_key(signals: Signals) -> str:
    """Return a name of a drive by its measurements: start, length, rate and wheel speeds. 16 hexadecimal digits."""
    digest = hashlib.sha256(repr((signals.start_ns, signals.frame.height, signals.dt_ns)).encode())
    for name in (n for n in signals.symbols if n.startswith("omega_")):
        digest.update(signals.array(name).tobytes())
    return digest.hexdigest()[:16]


def history_to_json(history: History) -> dict[str, Any]:
    """As a JSON document."""
    return {
        "schema_version": SCHEMA_VERSION,
        "slip_slope_history": {
            configuration: {
                place: [{"max": p.largest, "mean": p.mean, "seconds": p.seconds, "drive": p.drive} for p in periods]
                for place, periods in sorted(places.items())
            }
            for configuration, places in sorted(history.periods.items())
        },
    }


def history_from_json(document: Any, *, where: str) -> History:
    """Read a history from a JSON document.

    Raises
    ------
    ConfigError
        Names the entry that is not valid in a history.
    """
    if not isinstance(document, dict) or not isinstance(document.get("slip_slope_history"), dict):
        raise ConfigError("is no slip-slope history", where=where, expected='an object with "slip_slope_history"')
    version = document.get("schema_version")
    if version != SCHEMA_VERSION or isinstance(version, bool):
        raise ConfigError("is of another version", where=where, expected=f"schema_version {SCHEMA_VERSION}")
    found: dict[str, dict[str, tuple[Period, ...]]] = {}
    for configuration, places in document["slip_slope_history"].items():
        if not isinstance(places, dict) or not all(isinstance(v, list) for v in places.values()):
            raise ConfigError(f"configuration {configuration[:60]!r} holds no places with periods", where=where)
        odd = next((p for p in places if p not in PLACES), None)
        if odd is not None:
            raise ConfigError(f"place {odd[:60]!r} of {configuration[:60]!r}", where=where, expected=", ".join(PLACES))
        check_configuration(configuration, where=where)
        found[configuration] = {
            place: tuple(_period(p, f"{configuration}/{place}", where) for p in periods)[-KEPT_PERIODS:]
            for place, periods in places.items()
        }
    return History(found)


def check_configuration(name: str, *, where: str = "") -> None:
    """Refuse a name that no file can hold.

    Raises
    ------
    ConfigError
    """
    if len(name) > MOST_NAME or not name.isprintable():
        raise ConfigError(
            f"configuration {name[:40]!r}", where=where, expected=f"a line of up to {MOST_NAME} printable characters"
        )


def _period(entry: Any, name: str, where: str) -> Period:
    values = [_positive(entry.get(k)) for k in ("max", "mean", "seconds")] if isinstance(entry, dict) else []
    drive = entry.get("drive", "") if isinstance(entry, dict) else ""
    if len(values) == 3 and isinstance(drive, str) and len(drive) <= 64 and drive.isprintable():
        largest, mean, seconds = values
        # the mean is a running sum: it may lie above the largest value by its rounding
        if SLOPES[0] <= mean <= 1.000001 * largest and largest <= SLOPES[1] and 0.0 < seconds <= 1e6:
            return Period(largest, mean, seconds, drive)
    raise ConfigError(
        f"a period of {name[:60]} is {str(entry)[:80]}", where=where,
        expected=f"max >= mean within {SLOPES[0]:g} ... {SLOPES[1]:g}, seconds > 0",
    )  # fmt: skip


def _positive(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.inf
