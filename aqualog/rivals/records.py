"""Records of the rivals: their inputs, their description, and their results."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

from aqualog.core.records import BoolArray, Event, FloatArray, Track, Unavailable
from aqualog.core.vehicle import Vehicle
from aqualog.features.stream import Features

__all__ = ["Needs", "Rival", "RivalInputs", "RivalResult", "Severity", "always_partial"]

Needs = Callable[[Vehicle, Collection[str], float], tuple[str, ...]]
"""Vehicle, symbols of the drive, rate of the grid [Hz] -> what is missing, empty if the rival can run."""

Severity = Callable[[Mapping[str, Any]], str]
"""Evidence of an event -> `partial` or `full`."""


@dataclass(frozen=True, slots=True)
class RivalInputs:
    """A whole drive as input of the rivals.

    `features` as `FeatureStream.push` gives them; `columns` symbol -> array (n,), SI, NaN where missing, of
    `features.stream.INPUTS` alone; `braking` wheel -> bool array (n,), where a braking force acts; `dt` [s].
    """

    features: Features
    columns: Mapping[str, FloatArray]
    braking: Mapping[str, BoolArray]
    vehicle: Vehicle
    dt: float


@dataclass(frozen=True, slots=True)
class Rival:
    """One method of the prior art.

    `idea` in one sentence; `reference` number in the thesis' bibliography; `threshold` the default, in `unit`,
    positive: a larger one never means more alarms. `run` gives the tracks of a drive that has what it `needs`.
    """

    name: str
    title: str
    idea: str
    reference: str
    unit: str
    threshold: float
    needs: Needs
    run: Callable[[RivalInputs, float], tuple[Track, ...]]
    severity: Severity


@dataclass(frozen=True, slots=True)
class RivalResult:
    """All results of the rivals on one drive; events in order of their beginning."""

    tracks: tuple[Track, ...]
    events: tuple[Event, ...]
    unavailable: tuple[Unavailable, ...]


def always_partial(_: Mapping[str, Any]) -> str:
    """Return the severity of a method that does not distinguish partial from full aquaplaning."""
    return "partial"
