"""Drives to evaluate, from a campaign or from logs named on the command line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from aqualog.align.mapping import SignalMap
from aqualog.campaign.definition import Run, with_load
from aqualog.campaign.jobs import Configured
from aqualog.config.configured import files_of
from aqualog.config.labels import load_labels
from aqualog.config.signal_map import load_signal_map
from aqualog.config.vehicle import load_vehicle
from aqualog.core.errors import ConfigError
from aqualog.evaluate.drives import LogSource
from aqualog.evaluate.labels import Label
from aqualog.face.paths import expand, list_files

__all__ = ["Inputs", "campaign_inputs", "log_inputs"]


@dataclass(frozen=True, slots=True)
class Inputs:
    """What is evaluated: `keys` by which it can be grouped, `files` that no result may overwrite."""

    name: str
    sources: tuple[LogSource, ...]
    keys: tuple[str, ...]
    files: tuple[Path, ...]


def campaign_inputs(configured: Configured) -> Inputs:
    """Drives of a campaign; runs on the same log are one drive with several lanes."""
    campaign = configured.campaign
    of_log: dict[tuple[Path, ...], list[Run]] = {}
    for run in campaign.runs:
        of_log.setdefault(run.logs, []).append(run)
    sources = tuple(_source(logs, runs, configured) for logs, runs in of_log.items())
    return Inputs(campaign.name, sources, campaign.keys, files_of(configured))


def log_inputs(
    inputs: Sequence[str], vehicle: Path | None, map_file: Path | None, dbc: Sequence[Path], labels: Path | None
) -> Inputs:
    """Logs, each a drive of its own.

    Raises
    ------
    ConfigError, LogError
    """
    if vehicle is None:
        raise ConfigError("no vehicle", expected="a vehicle file, or a campaign file that names one")
    paths = expand(inputs)
    if not paths:
        raise ConfigError("no log is named", expected="a campaign file, or at least one log")
    car = load_vehicle(vehicle)
    signal_map = load_signal_map(map_file) if map_file else SignalMap()
    given = _labels(labels, paths)
    sources = tuple(
        LogSource(str(p), (p,), car, signal_map, tuple(dbc), given.get(p), groups={"vehicle": car.name}) for p in paths
    )  # fmt: skip
    name = ", ".join(str(p) for p in paths) if len(paths) <= 2 else f"{paths[0].parent} ({len(paths)} logs)"
    named = (p for p in (vehicle, map_file, labels) if p)  # of labels in a folder, all that are in it
    return Inputs(name, sources, ("vehicle",), (*paths, *list_files(inputs), *dbc, *named))


def _source(logs: tuple[Path, ...], runs: Sequence[Run], configured: Configured) -> LogSource:
    first, base = runs[0], configured.campaign.path.parent
    named = [configured.labels[r.labels] for r in runs if r.labels is not None]
    return LogSource(
        name="; ".join(str(p.relative_to(base)) if p.is_relative_to(base) else str(p) for p in logs),
        paths=logs,
        vehicle=with_load(configured.vehicles[first.vehicle], first),
        signal_map=configured.signal_map,
        dbc=configured.dbc,
        labels=tuple(dict.fromkeys(x for labels in named for x in labels)) if named else None,
        lanes=tuple(sorted({r.lane for r in runs if r.lane is not None})),
        groups=first.groups,
    )


def _labels(path: Path | None, logs: Sequence[Path]) -> dict[Path, tuple[Label, ...]]:
    """Labels of each log: from a folder by the log's name, or from one file."""
    if path is None:
        return {}
    if path.is_dir():
        files = {log: path / f"{log.stem}.csv" for log in logs}
        missing = [f.name for f in files.values() if not f.is_file()]
        if missing:
            raise ConfigError(f"no {', '.join(missing[:5])} in it", where=str(path), expected="one CSV for each log")
        return {log: load_labels(f) for log, f in files.items()}
    labels = load_labels(path)
    if labels and len(logs) > 1:
        raise ConfigError(
            f"one labels file for {len(logs)} logs", where=str(path), expected="a folder with one CSV for each log",
            hint="a file without lines serves all: no water",
        )  # fmt: skip
    return dict.fromkeys(logs, labels)
