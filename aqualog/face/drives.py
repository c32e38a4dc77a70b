"""Several drives: which files make which drive, and which of them can be used."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from aqualog.core.errors import AqualogError, ConfigError, SignalError
from aqualog.core.records import Signals
from aqualog.core.vehicle import Vehicle
from aqualog.face.arguments import expand, list_files, names_of
from aqualog.face.drive import Drive, DriveLike, drive_of
from aqualog.face.listener import Listener
from aqualog.face.result import PathLike
from aqualog.io.fingerprint import Contents, state_of

__all__ = [
    "DrivesLike", "Grouped", "Loaded", "NothingUsableError", "drives_of", "grouped", "load_drives", "repeated_of",
    "with_own_names",
]  # fmt: skip

DrivesLike = DriveLike | Sequence[DriveLike]
_Found = TypeVar("_Found")


class NothingUsableError(SignalError):
    """None of the drives can be used. `reasons` has a line for each; the listener has heard them."""

    is_heard = True

    def __init__(self, reasons: Sequence[str]) -> None:
        self.reasons = tuple(reasons)
        super().__init__(f"no drive can be used: {'; '.join(reasons)}")


class Grouped(list[Drive]):
    """Drives of files that were named; of the `named` files those that are there more than once count once."""

    named = 0

    @property
    def repeated(self) -> tuple[str, ...]:
        """A note on files that were named more than once, if there are any."""
        more = self.named - sum(len(d.paths) for d in self)
        return (f"{more} of {self.named} logs given more than once: each counts once",) if more else ()


def repeated_of(drives: Sequence[Drive]) -> tuple[str, ...]:
    """A note on logs that were given more than once, if there are any."""
    return drives.repeated if isinstance(drives, Grouped) else ()


class Loaded:
    """Signals of drives by name, and a line for each drive that cannot be used."""

    def __init__(self, drives: Sequence[Drive]) -> None:
        self._drives = {d.label: d for d in drives}
        self.signals: dict[str, Signals] = {}
        self.failed: dict[str, str] = {}

    @property
    def used(self) -> list[Drive]:
        """The drives whose signals are here."""
        return [d for name, d in self._drives.items() if name in self.signals]

    @property
    def files(self) -> list[str]:
        """The files of these drives, as they were named."""
        return [str(p) for d in self.used for p in d.paths]

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on the files that were read, each with the name of its drive."""
        return tuple(self._named(name, n) for name, s in self.signals.items() for n in s.quality.notes)

    @property
    def changes(self) -> tuple[str, ...]:
        """A note for each file that has changed since the drives were named."""
        return tuple(n for d in self._drives.values() for n in d.changes())

    @property
    def has_loss(self) -> bool:
        """Whether data of a drive were lost, or a drive cannot be used."""
        return bool(self.failed) or any(s.quality.has_loss for s in self.signals.values())

    def drop(self, name: str, reason: str) -> None:
        """Leave a drive out, for a reason that the user sees."""
        self.signals.pop(name, None)
        self.failed[name] = self._named(name, reason)

    def tried(self, work: Callable[[dict[str, Signals]], _Found], hear: Listener, unseen: Sequence[str] = ()) -> _Found:
        """Do the work with all drives, or with those that are left when it refuses one; report those left out.

        Raises
        ------
        NothingUsableError
            If none but `unseen` ones are left.
        """
        while any(n not in unseen for n in self.signals):
            try:
                result = work(self.signals)
            except SignalError as error:
                self.drop(error.where, error.line())
                if error.where not in self._drives:  # it concerns all of them
                    break
            else:
                self._report(hear)
                return result
        self._report(hear)
        raise NothingUsableError(list(self.failed.values()))

    def _report(self, hear: Listener) -> None:
        for name, reason in self.failed.items():
            hear.failed(name, reason)

    def _named(self, name: str, text: str) -> str:
        """Return the text with the drive's name before it, unless it bears the name already."""
        paths = self._drives[name].paths if name in self._drives else ()
        is_file = len(paths) == 1 and name in (paths[0].name, str(paths[0]))
        return text if (is_file and name in text) or text.startswith(f"{name}: ") or not paths else f"{name}: {text}"


def grouped(names: Iterable[PathLike], like: Drive | None = None) -> Grouped:
    """Group files by drive: those of a folder belong together, those of a glob or a list are a drive each.

    Parameters
    ----------
    names : iterable of str or Path
        Files, folders, globs, `@list.txt`; the same content counts once, under any name.
    like : Drive, optional
        How the files are read: signal map, databases, rate, vehicle, cache.

    Raises
    ------
    ConfigError
        If a glob or folder matches nothing.
    """
    base = like or Drive(())
    drives = Grouped()
    seen: dict[int, list[Path]] = {}
    contents = Contents()
    for name in map(str, names):
        found = expand([name])
        drives.named += len(found)
        paths = [p for p in found if _is_new(p, seen, contents)]
        own = list_files([name])
        if Path(name).is_dir():
            drives += [_like(base, paths, Path(name).name or name, own)] if paths else []
        else:
            drives += [_like(base, [p], p.name, own) for p in paths]
    return drives


def _is_new(path: Path, seen: dict[int, list[Path]], contents: Contents) -> bool:
    """Whether no file before holds the same; remembers it in `seen`, by size: only equal sizes are read."""
    try:
        alike = seen.setdefault(path.stat().st_size, [])
        known = {p.resolve() for p in alike}
        if path.resolve() in known or (alike and contents.of(path) in map(contents.of, alike)):
            return False
        alike.append(path)
    except OSError:  # whoever reads it says so
        pass
    return True


def _like(base: Drive, paths: Sequence[Path], label: str, lists: Sequence[Path]) -> Drive:
    before = state_of(paths)
    return replace(
        base, paths=tuple(paths), label=label, sources=(*paths, *lists), before=before, given=None, _loaded={}
    )  # fmt: skip


def drives_of(drives: DrivesLike, *, is_needed: bool = True) -> list[Drive]:
    """Return the drives behind an argument: each `Drive`, table of signals or inner list is one, files see `grouped`.

    Without `is_needed` there may be none.

    Raises
    ------
    ConfigError, LogError
    """
    if isinstance(drives, Grouped):
        return drives
    if isinstance(drives, bytes | Mapping) or not isinstance(drives, Drive | Signals | Path | Iterable):
        names_of(drives, "drives")  # says what was expected
    many = [drives] if isinstance(drives, Drive | Signals | str | Path) else list(drives)
    if not many and is_needed:
        raise ConfigError("no drive is named", expected="at least one file or aq.Drive")
    if all(isinstance(d, str | Path) for d in many):
        return grouped([d for d in many if isinstance(d, str | Path)])
    found: list[Drive] = []
    for i, one in enumerate(many, start=1):
        if isinstance(one, str | Path):
            found += grouped([one])
        else:
            drive = drive_of(one)
            paths, label = drive.paths, drive.label
            if not paths and label == "signals":
                label = f"drive {i}"
            elif paths and not label:
                label = paths[0].name if len(paths) == 1 else paths[0].parent.name
            found.append(replace(drive, label=label))
    return found


def with_own_names(*groups: Sequence[Drive]) -> tuple[list[Drive], ...]:
    """Return the groups with names that are unique over all of them: where two are the same, the path or a number.

    Raises
    ------
    ConfigError
        If the same files are given twice.
    """
    names = [d.label for drives in groups for d in drives]
    taken: set[str] = set()

    def own(drive: Drive) -> Drive:
        label = drive.label
        if names.count(label) > 1 and drive.paths:
            label = str(drive.paths[0])
            if label in taken:
                raise ConfigError("is given twice", where=label, expected="each drive once")
        number = 1
        while label in taken:
            number += 1
            label = f"{drive.label} ({number})"
        taken.add(label)
        return drive if label == drive.label else replace(drive, label=label)

    return tuple([own(d) for d in drives] for drives in groups)


def load_drives(drives: Sequence[Drive], vehicle: Vehicle, hear: Listener) -> Loaded:
    """Read all drives. One that cannot be read is left out with its reason; the others go on.

    Raises
    ------
    ConfigError
        Of the settings, which are those of all drives.
    """
    loaded = Loaded(drives)
    for drive in drives:
        name = drive.label

        def step(text: str, name: str = name) -> None:
            hear(f"{name}: {text}")

        try:
            loaded.signals[name] = drive.load(vehicle, report=step)
        except ConfigError:
            raise
        except (AqualogError, OSError) as error:
            loaded.drop(name, error.line() if isinstance(error, AqualogError) else str(error))
    return loaded
