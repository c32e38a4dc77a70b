"""The work of a campaign: each log with the car that drove it, and the key of its result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from aqualog.align.mapping import SignalMap, map_text
from aqualog.campaign.definition import Campaign, with_load
from aqualog.core.errors import AqualogError
from aqualog.core.vehicle import Vehicle
from aqualog.detect.stream import Settings
from aqualog.evaluate.labels import Label
from aqualog.io.fingerprint import Contents, Seen, hash_of, sources_stamp

__all__ = ["Configured", "Job", "code_stamp", "name_of", "plan_jobs", "result_key"]

_BEHIND = (
    "core", "physics", "guard", "io", "align", "features", "calibrate", "detect", "checks", "campaign/full_rate.py",
    "campaign/measure.py", "evaluate/labels.py",
)  # fmt: skip
"""Sources behind a result."""


@dataclass(frozen=True, slots=True)
class Configured:
    """A campaign with the content of its files: vehicles and labels by path, signal map, databases, settings.

    `beside` are files given beside the campaign's own: a map in place of its map, thresholds.
    """

    campaign: Campaign
    vehicles: Mapping[Path, Vehicle]
    labels: Mapping[Path, tuple[Label, ...]] = field(default_factory=dict)
    signal_map: SignalMap = field(default_factory=SignalMap)
    dbc: tuple[Path, ...] = ()
    settings: Settings = field(default_factory=Settings)
    beside: tuple[Path, ...] = ()


@dataclass(frozen=True, slots=True)
class Job:
    """A log with the car that drove it, and the runs (by index) that it serves. `reason` if it cannot be worked on.

    `seen` is the state of its files and databases, whose content `key` identifies.
    """

    key: str
    logs: tuple[Path, ...]
    vehicle: Vehicle
    runs: tuple[int, ...]
    reason: str = ""
    seen: Seen = ()


def plan_jobs(configured: Configured, contents: Contents) -> list[Job]:
    """Jobs of a campaign: runs on the same logs with the same car and load share one."""
    runs = configured.campaign.runs
    found: dict[tuple[tuple[Path, ...], str], list[int]] = {}
    cars: dict[tuple[tuple[Path, ...], str], Vehicle | str] = {}
    for index, run in enumerate(runs):
        car: Vehicle | str
        try:
            car = with_load(configured.vehicles[run.vehicle], run)
        except AqualogError as error:
            car = error.line()
        at = (run.logs, car if isinstance(car, str) else repr(car))
        found.setdefault(at, []).append(index)
        cars[at] = car
    return [_job(configured, contents, logs, cars[logs, said], indices) for (logs, said), indices in found.items()]


def _job(
    configured: Configured, contents: Contents, logs: tuple[Path, ...], car: Vehicle | str, indices: Sequence[int]
) -> Job:
    if isinstance(car, str):
        return Job("", logs, Vehicle(), tuple(indices), car)
    try:
        key = result_key(contents, logs, car, configured.signal_map, configured.dbc, configured.settings)
    except OSError as error:
        what = "there is no such file" if isinstance(error, FileNotFoundError) else error.strerror or str(error)
        return Job("", logs, car, tuple(indices), f"{error.filename or logs[0]}: {what}")
    return Job(key, logs, car, tuple(indices), seen=contents.seen((*logs, *configured.dbc)))


def name_of(campaign: Campaign, logs: Sequence[Path]) -> str:
    """Name of a drive as in the campaign file. Bytes of a file name that are no UTF-8, which no table could hold, are
    written out: `bad\\xff.parquet`."""
    base = campaign.path.parent
    told = "; ".join(str(p.relative_to(base)) if p.is_relative_to(base) else str(p) for p in logs)
    return in_utf8(told)


def in_utf8(text: str) -> str:
    """Text with the bytes of file names that are no UTF-8 written out."""
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


def result_key(
    contents: Contents, logs: Sequence[Path], vehicle: Vehicle, signal_map: SignalMap, dbc: Sequence[Path],
    settings: Settings,
) -> str:  # fmt: skip
    """Key under which the result of a drive is kept.

    Names of the `logs` count, since a map may ask for them; of the `vehicle`, with the run's load, also what is
    `given`, since that decides which detectors run.
    """
    files = [f"{p.name}:{contents.of(p)}" for p in (*logs, *dbc)]
    # sets and mappings have no order of their own
    values = {n: getattr(vehicle, n) for n in Vehicle.__slots__}
    plain = {n: sorted(v.items()) if isinstance(v, dict) else v for n, v in values.items() if n != "given"}
    car = repr(sorted(plain.items(), key=lambda item: item[0])) + repr(sorted(vehicle.given))
    return hash_of([code_stamp(), *files, car, map_text(signal_map), repr(settings)])


def code_stamp() -> str:
    """Hash of the source code behind a result: after a change of an equation all logs are measured again."""
    return sources_stamp(_BEHIND)
