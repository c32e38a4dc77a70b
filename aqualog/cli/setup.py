"""What every command does first: inputs found, results not in the way, configuration read."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from aqualog.align.mapping import SignalMap
from aqualog.cli.console import Console
from aqualog.config.signal_map import load_signal_map
from aqualog.core.errors import ConfigError
from aqualog.core.vehicle import Vehicle
from aqualog.face.drive import Drive
from aqualog.face.paths import expand, list_files, refuse_existing
from aqualog.io.content import state_of

if TYPE_CHECKING:
    from aqualog.align.cache import SignalCache

__all__ = ["Setup", "prepare", "result_file"]


@dataclass(frozen=True, slots=True)
class Setup:
    """Inputs and configuration of one run; the sources of `drive` are all files that no result may overwrite."""

    console: Console
    drive: Drive
    vehicle: Vehicle


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
    cached: bool | None = False,
    rate_hz: float | None = None,
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
    cached : bool, optional
        Whether signals are kept; None: if AQUALOG_CACHE is set.
    rate_hz : float, optional
        Rate of the time base.

    Raises
    ------
    ConfigError, LogError
    """
    console = Console.make(quiet=quiet, verbose=verbose, progress=progress)
    paths = expand(logs)
    before = state_of(paths)
    own = (*paths, *list_files(logs), *dbc, *(p for p in (map_file, vehicle_file) if p))
    refuse_existing(targets, force=force, sources=own)
    signal_map = load_signal_map(map_file) if map_file else SignalMap()
    vehicle = Vehicle.read(vehicle_file) if vehicle_file else Vehicle()
    drive = Drive(
        tuple(paths), signal_map, tuple(dbc), rate_hz, vehicle, _cache(cached, console), tuple(own), before
    )  # fmt: skip
    return Setup(console, drive, vehicle)


def result_file(name: str | None, option: str) -> Path | None:
    """Return the file that an option names; None without the option.

    Raises
    ------
    ConfigError
        If the name is empty.
    """
    if name is not None and not name.strip():
        raise ConfigError(f"{option} is empty", expected="a file to write")
    return None if name is None else Path(name)


def _cache(cached: bool | None, console: Console) -> SignalCache | None:
    if cached is False or (cached is None and not os.environ.get("AQUALOG_CACHE")):
        return None
    from aqualog.align.cache import SignalCache, cache_folder, cache_limit

    try:
        folder = cache_folder()
    except RuntimeError:
        console.detail("there is no home folder to keep signals in; AQUALOG_CACHE names another")
        return None
    return SignalCache(folder, limit=cache_limit(), tell=console.detail)
