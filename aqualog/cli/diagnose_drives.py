"""Drives of `diagnose`: which files make which drive, and what could not be read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from aqualog.errors import AqualogError, ConfigError
from aqualog.face.paths import expand

if TYPE_CHECKING:
    from aqualog.cli.console import Steps
    from aqualog.cli.setup import Setup
    from aqualog.types import Signals

__all__ = ["Drives", "check_apart", "check_once", "find_drives", "load_drives"]

Named = list[tuple[str, list[Path]]]


class Drives:
    """Drives by name, and a line for each that gives nothing."""

    def __init__(self, files: Named) -> None:
        self._files = dict(files)
        self.loaded: dict[str, Signals] = {}
        self.failed: list[str] = []

    def drop(self, name: str, line: str) -> None:
        """A drive is not used, for a reason that is told."""
        self.loaded.pop(name, None)
        self.failed.append(self._of(name, line))

    @property
    def notes(self) -> tuple[str, ...]:
        """What there is to know of the files that were read."""
        return tuple(self._of(name, n) for name, s in self.loaded.items() for n in s.quality.notes)

    @property
    def is_lossy(self) -> bool:
        """Whether data of a drive that was read were lost."""
        return any(s.quality.truncated or s.quality.lost_in_files for s in self.loaded.values())

    def _of(self, name: str, text: str) -> str:
        """The text with the drive's name before it, unless the drive is one file that the text names already."""
        paths = self._files[name]
        is_file = len(paths) == 1 and name in (paths[0].name, str(paths[0]))
        return text if is_file and name in text else f"{name}: {text}"


def find_drives(logs: Sequence[str], holdout: Sequence[str]) -> tuple[Named, Named]:
    """Drives to diagnose and drives held out, with names that are unique over both.

    A folder's files belong together, those of a glob or a list do not; the same file counts once in each.

    Raises
    ------
    ConfigError
        If nothing is there.
    """
    both = [_grouped(logs), _grouped(holdout)]
    names = [n for drives in both for n, _ in drives]
    told, unseen = ([(n if names.count(n) == 1 else str(paths[0]), paths) for n, paths in drives] for drives in both)
    return told, unseen


def check_apart(drives: Named, unseen: Named) -> None:
    """No file may be diagnosed and held out: a gain on what was fitted is none.

    Raises
    ------
    ConfigError
    """
    own = {p.resolve() for _, paths in drives for p in paths}
    twice = next((p for _, paths in unseen for p in paths if p.resolve() in own), None)
    if twice is not None:
        raise ConfigError("is diagnosed and held out", where=str(twice), expected="other drives after --holdout")


def check_once(logs: Sequence[str], drives: Named) -> list[str]:
    """A note for files that are given more than once, of which each counts once."""
    given = [p.resolve() for a in logs for p in expand([a])]
    more = len(given) - len({p.resolve() for _, paths in drives for p in paths})
    return [f"{more} of {len(given)} logs given more than once: each counts once"] if more else []


def load_drives(drives: Named, setup: Setup, dbc: Sequence[Path], rate: float | None, steps: Steps) -> Drives:
    """Read all drives; one that cannot be read is told and the others go on.

    Raises
    ------
    ConfigError
        Of the options, which are those of all drives.
    """
    from aqualog.align.load import load_signals

    given = Drives(drives)
    for name, paths in drives:

        def tell(step: str, name: str = name) -> None:
            steps(f"{name}: {step}")

        try:
            given.loaded[name] = load_signals(
                paths,
                vehicle=setup.vehicle,
                signal_map=setup.signal_map,
                dbc=list(dbc),
                rate_hz=rate,
                report=tell,
                cache=setup.cache,
            )
        except ConfigError:
            raise
        except (AqualogError, OSError) as error:
            given.drop(name, error.line() if isinstance(error, AqualogError) else str(error))
    return given


def _grouped(arguments: Sequence[str]) -> Named:
    drives: Named = []
    seen: set[Path] = set()
    for argument in arguments:
        paths = [p for p in expand([argument]) if p.resolve() not in seen]
        seen |= {p.resolve() for p in paths}
        if Path(argument).is_dir():
            drives += [(Path(argument).name or argument, paths)] if paths else []
        else:
            drives += [(p.name, [p]) for p in paths]
    return drives
