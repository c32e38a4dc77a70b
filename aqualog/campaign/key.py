"""One key for everything that a stored result depends on: content of the log, car, map, settings, code."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from aqualog.align.mapping import SignalMap, map_text
from aqualog.core.vehicle import Vehicle
from aqualog.detect.stream import Settings
from aqualog.io.content import Contents, Seen, change_since, hash_of, sources_stamp

__all__ = ["Contents", "Seen", "change_since", "code_stamp", "result_key"]

_BEHIND = (
    "core",
    "physics",
    "guard",
    "io",
    "align",
    "features",
    "calibrate",
    "detect",
    "campaign/measure.py",
    "campaign/thin.py",
)


def result_key(
    contents: Contents, logs: Sequence[Path], vehicle: Vehicle, signal_map: SignalMap, dbc: Sequence[Path],
    settings: Settings,
) -> str:  # fmt: skip
    """Key under which the result of a drive is kept.

    Parameters
    ----------
    logs : sequence of Path
        Files of the drive; their names count, since a map may ask for them.
    vehicle : Vehicle
        With the run's load; `given` decides which detectors run.
    """
    files = [f"{p.name}:{contents.of(p)}" for p in (*logs, *dbc)]
    return hash_of([code_stamp(), *files, _told(vehicle), map_text(signal_map), repr(settings)])


def code_stamp() -> str:
    """Hash of the source code behind a result: after a change of an equation all logs are measured again."""
    return sources_stamp(_BEHIND)


def _told(vehicle: Vehicle) -> str:
    # sets and mappings have no order of their own
    values = {n: getattr(vehicle, n) for n in Vehicle.__slots__}
    plain = {n: sorted(v.items()) if isinstance(v, dict) else v for n, v in values.items() if n != "given"}
    return repr(sorted(plain.items(), key=lambda item: item[0])) + repr(sorted(vehicle.given))
