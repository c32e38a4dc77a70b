"""Run the rivals over a drive."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np

from aqualog.core.errors import ConfigError
from aqualog.core.records import Event, Signals, Track, Unavailable
from aqualog.core.vehicle import Vehicle
from aqualog.detect.registry import RIVALS
from aqualog.detect.settings import Settings
from aqualog.detect.stream import DriveStream, in_order
from aqualog.features.stream import INPUTS

__all__ = ["RivalResult", "run_rivals"]


@dataclass(frozen=True, slots=True)
class RivalResult:
    """All results of the rivals on one drive; events in order of their beginning."""

    tracks: tuple[Track, ...]
    events: tuple[Event, ...]
    unavailable: tuple[Unavailable, ...]


def run_rivals(
    signals: Signals,
    vehicle: Vehicle,
    thresholds: Mapping[str, float] | None = None,
    names: Collection[str] | None = None,
) -> RivalResult:
    """Run rivals over one drive.

    Parameters
    ----------
    signals : Signals
        Truth and labels in it are not read.
    vehicle : Vehicle
    thresholds : mapping name -> float, optional
        In the unit of each rival, positive; those that are not named keep their default.
    names : collection of str, optional
        All by default.

    Raises
    ------
    ConfigError
        For an unknown name, or a threshold that is not positive and finite.
    """
    own = dict(thresholds or {})
    _check(own, [*own, *(RIVALS if names is None else names)])
    chosen = [r for r in RIVALS.values() if names is None or r.name in names]
    height = signals.frame.height
    present = [s for s in signals.symbols if s in INPUTS and signals.frame[s].null_count() < height]
    stream = DriveStream(vehicle, signals.dt_ns, present, settings=Settings(thresholds=own), detectors=chosen)
    if not stream.watches:
        return RivalResult((), (), stream.unavailable)
    piece = stream.push({s: signals.array(s) for s in (present or ["v_x"])})
    return RivalResult(piece.tracks, in_order((*piece.events, *stream.finish())), stream.unavailable)


def _check(thresholds: Mapping[str, float], names: Collection[str]) -> None:
    for name in names:
        if name not in RIVALS:
            near = get_close_matches(name, RIVALS, n=1)
            raise ConfigError(
                f"no rival {name!r}", expected=", ".join(RIVALS), hint=near[0] if near else "one of these names"
            )
    for name, value in thresholds.items():
        if not 0.0 < value < np.inf:
            raise ConfigError(
                f"threshold {value!r} is not positive", where=name, expected=f"a number above 0 in {RIVALS[name].unit}"
            )
