"""What every command does first: inputs found, results not in the way, configuration read."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from aqualog.align.mapping import SignalMap
from aqualog.cli.console import Console
from aqualog.cli.files import expand, list_files, refuse_existing
from aqualog.config.signal_map import load_signal_map
from aqualog.config.vehicle import load_vehicle
from aqualog.errors import AqualogError, LogError, SignalError
from aqualog.io.content import Seen, changed_files, state_of
from aqualog.vehicle import Vehicle

if TYPE_CHECKING:
    from aqualog.align.cache import SignalCache

__all__ = ["Setup", "prepare"]


@dataclass(frozen=True, slots=True)
class Setup:
    """Inputs and configuration of one run; `sources` are all files that no result may overwrite.

    `cache` is None where signals are not to be kept. `before` is the state of the logs before they were opened.
    """

    console: Console
    paths: list[Path]
    signal_map: SignalMap
    vehicle: Vehicle
    sources: tuple[Path, ...]
    cache: SignalCache | None = None
    before: Seen = ()

    def changes(self) -> tuple[str, ...]:
        """A note for each file of the logs that is not as it was when the command began."""
        return tuple(
            f"{Path(name).name}: changed while it was read; look at it again when it stays as it is"
            for name in changed_files(self.paths, self.before)
        )

    @contextmanager
    def reading(self) -> Iterator[None]:
        """What goes wrong within may be of a log that has changed, which is said then.

        Raises
        ------
        LogError
            In place of an error of reading.
        """
        try:
            yield
        except Exception as error:
            names = changed_files(self.paths, self.before)
            if not names or (isinstance(error, AqualogError) and not isinstance(error, LogError | SignalError)):
                raise
            what = error.what if isinstance(error, AqualogError) else str(error) or type(error).__name__
            hint = "again, when it stays as it is"
            raise LogError(f"changed while it was read ({what})", where=names[0], hint=hint) from error


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
    vehicle = load_vehicle(vehicle_file) if vehicle_file else Vehicle()
    return Setup(console, paths, signal_map, vehicle, own, _cache(cached, console), before)


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
