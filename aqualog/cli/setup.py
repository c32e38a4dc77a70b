"""What every command does first: inputs found, results not in the way, configuration read."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from aqualog.align.mapping import SignalMap
from aqualog.cli.console import Console
from aqualog.cli.files import expand, list_files, refuse_existing
from aqualog.config.signal_map import load_signal_map
from aqualog.config.vehicle import load_vehicle
from aqualog.vehicle import Vehicle

__all__ = ["Setup", "prepare"]


@dataclass(frozen=True, slots=True)
class Setup:
    """Inputs and configuration of one run; `sources` are all files that no result may overwrite."""

    console: Console
    paths: list[Path]
    signal_map: SignalMap
    vehicle: Vehicle
    sources: tuple[Path, ...]


def prepare(
    logs: Sequence[str],
    *,
    map_file: Path | None,
    dbc: Sequence[Path],
    targets: Iterable[Path],
    force: bool,
    quiet: bool,
    verbose: bool,
    progress: str,
    vehicle_file: Path | None = None,
) -> Setup:
    """Check everything that can be checked before any log is opened.

    Parameters
    ----------
    logs : sequence of str
        As typed.
    map_file, vehicle_file : Path, optional
        Without them: canonical names, default car.
    dbc, targets : paths
        Databases; results to be written. A source is never a target.

    Raises
    ------
    ConfigError, LogError
    """
    console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
    paths = expand(logs)
    own = (*paths, *list_files(logs), *dbc, *(p for p in (map_file, vehicle_file) if p))
    refuse_existing(targets, force=force, sources=own)
    signal_map = load_signal_map(map_file) if map_file else SignalMap()
    vehicle = load_vehicle(vehicle_file) if vehicle_file else Vehicle()
    return Setup(console, paths, signal_map, vehicle, own)
