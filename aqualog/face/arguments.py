"""Arguments of the face, as users give them, and files of results that are there whole or not at all.

A wrong type is a TypeError that names the argument; a value that cannot be right is a ConfigError.
"""

from __future__ import annotations

import errno
import glob
import math
import os
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from aqualog.core.errors import AqualogError, ConfigError, LogError
from aqualog.io import atomic_write
from aqualog.io.open_log import LOG_SUFFIXES, sniff

__all__ = [
    "VEHICLE_HINT", "check_name", "expand", "file_of", "list_files", "names_of", "no_vehicle", "number_of",
    "refuse_existing", "text_of", "whole_number", "write_together", "write_whole", "writing",
]  # fmt: skip


_SHOWN = 60  # characters of a name that cannot be one


def names_of(given: object, what: str = "logs") -> list[str]:
    """Return one path or several as they were named."""
    if isinstance(given, str | Path):
        return [str(given)]
    if isinstance(given, bytes | bytearray | Mapping) or not isinstance(given, Iterable):
        raise TypeError(f"{what}: expected str or Path, one or several, not {type(given).__name__}")
    names = list(given)
    odd = next((n for n in names if not isinstance(n, str | Path)), None)
    if odd is not None or None in names:
        raise TypeError(f"{what}: expected str or Path, one or several; {type(odd).__name__} is among them")
    return [str(n) for n in names]


def file_of(given: object, what: str, other: str = "") -> Path:
    """Return a path that names a file; `other` is what could have been given in its place."""
    if not isinstance(given, str | Path):
        raise TypeError(f"{what}: expected str or Path{f' or {other}' if other else ''}, not {type(given).__name__}")
    path = Path(given)
    check_name(path)
    return path


def check_name(path: Path) -> None:
    """Refuse a name that no file can have: with a NUL character (ConfigError), or too long (AqualogError)."""
    shown = repr(str(path))[:_SHOWN]
    try:
        os.lstat(path)
    except ValueError as error:
        raise ConfigError(f"{shown} is no name of a file", expected="a name without NUL characters") from error
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise AqualogError(
                f"{shown}... is too long for the name of a file ({len(str(path))} characters)"
            ) from error


def text_of(given: object, what: str) -> str:
    """Return a text."""
    if not isinstance(given, str):
        raise TypeError(f"{what}: expected a text, not {type(given).__name__}")
    return given


def whole_number(given: object, what: str, low: int, high: int) -> int:
    """Return a whole number of a range."""
    if isinstance(given, bool) or not hasattr(given, "__index__"):
        raise TypeError(f"{what}: expected a whole number, not {type(given).__name__}")
    number = int(given.__index__())
    if not low <= number <= high:
        raise ConfigError(f"{what} = {number}", expected=f"{low} to {high}")
    return number


def number_of(given: object, what: str, low: float, high: float, unit: str = "") -> float:
    """Return a finite number of a range."""
    if isinstance(given, bool | str) or not hasattr(given, "__float__"):
        raise TypeError(f"{what}: expected a number, not {type(given).__name__}")
    number = float(given.__float__())
    if not (math.isfinite(number) and low <= number <= high):
        raise ConfigError(f"{what} = {number:g}", expected=f"{low:g} to {high:g} {unit}".rstrip())
    return number


def expand(names: Iterable[str]) -> list[Path]:
    """Files behind what the user typed: files, folders, globs, `@list.txt`.

    A folder that is a ROS 2 bag is one input; of any other folder, all logs in it (not below) by content. The same
    file twice counts once.

    Raises
    ------
    ConfigError
        If a glob or folder matches nothing, or a name is empty.
    """
    found: dict[str, Path] = {}
    for name in names:
        for path in _one(name):
            found.setdefault(os.path.realpath(path), path)
    return list(found.values())


def list_files(names: Iterable[str]) -> list[Path]:
    """The lists themselves among what the user typed: they are sources as the logs are that they name."""
    return [Path(name[1:]) for name in names if name.startswith("@")]


def _one(name: str) -> list[Path]:
    if name.startswith("@"):
        return _from_list(Path(name[1:]))
    if not name:  # it would be the folder in which the user happens to be
        raise ConfigError("a name is empty", expected="a log, folder or glob", hint="check the shell's variables")
    path = Path(name)
    check_name(path)
    if path.is_dir():
        return _from_folder(path)
    if not path.exists() and glob.has_magic(name):
        hits = sorted(Path(p) for p in glob.glob(name, recursive=True))  # noqa: PTH207 - absolute patterns too
        if not hits:
            raise ConfigError("nothing matches", where=name, hint="check the pattern")
        return [f for h in hits for f in (_from_folder(h) if h.is_dir() else [h])]
    return [path]


def _from_list(path: Path) -> list[Path]:
    try:
        lines = _text_of_list(path).splitlines()
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or error
        raise ConfigError(f"list of logs cannot be read ({why})", where=str(path)) from error
    names = [line.strip() for line in lines if line.strip() and not line.lstrip().startswith("#")]
    odd = next((n for n in names if n.startswith("@") or "\0" in n), None)
    if odd is not None:
        raise ConfigError(f"names {odd[:60]!r}", where=str(path), expected="files, folders and globs, one a line")
    base = path.parent
    return [p for n in names for p in _one(n if Path(n).is_absolute() else str(base / n))]


def _text_of_list(path: Path) -> str:
    """What a list says, if it has an end: of pipes only one of the shell, whose other end is there."""
    kind = path.stat().st_mode
    is_nameless = stat.S_ISFIFO(kind) and not Path(os.path.realpath(path)).exists()
    if not (stat.S_ISREG(kind) or stat.S_ISDIR(kind) or is_nameless):
        raise ConfigError("list of logs is a device or a pipe", where=str(path), expected="a text file")
    with path.open("rb") as file:
        data = file.read(_LARGEST_LIST + 1)
    if len(data) > _LARGEST_LIST:
        raise ConfigError(f"list of logs is larger than {_LARGEST_LIST // 1_000_000} MB", where=str(path))
    return data.decode("utf-8")


def _from_folder(path: Path) -> list[Path]:
    if _is_log(path):
        return [path]
    hits = [p for p in sorted(path.iterdir()) if p.is_file() and p.suffix.lower() in LOG_SUFFIXES and _is_log(p)]
    if not hits:
        raise ConfigError("no log in this folder", where=str(path), expected=" ".join(LOG_SUFFIXES))
    return hits


_LARGEST_LIST = 100_000_000  # [byte] a million names
# In a folder, text files that are no logs (README, notes, maps) stand beside them, so there the suffix is asked too.


def _is_log(path: Path) -> bool:
    try:
        sniff(path)
    except LogError:
        return False
    return True


VEHICLE_HINT = "name a vehicle file; `aqualog init LOG -o FOLDER` writes one to fill in"


def no_vehicle(other: str) -> ConfigError:
    """Return the error of a command that would be wrong with a default car; `other` takes the place of a file."""
    return ConfigError("no vehicle", expected=f"a vehicle file, or {other}", hint=VEHICLE_HINT)


_FORCE = "--force (from Python force=True) to overwrite, or another name"


def refuse_existing(paths: Iterable[Path], *, force: bool, sources: Iterable[Path] = (), hint: str = _FORCE) -> None:
    """Stop before any work if a result would overwrite something; a source is not overwritten even by force.

    A source that is a folder stands for the files in it. Nor may two results have one name.

    Raises
    ------
    ConfigError
        Naming the first file that exists.
    """
    own = {os.path.realpath(f) for s in sources for f in (s, *(s.iterdir() if s.is_dir() else ()))}
    targets: set[str] = set()
    for path in paths:
        check_name(path)
        real = os.path.realpath(path)
        if real in own:
            raise ConfigError("is a source of this very run", where=str(path), hint="another name for the result")
        if real in targets:
            raise ConfigError("is named for two results", where=str(path), hint="another name for one of them")
        targets.add(real)
        if path.is_dir():
            raise ConfigError("is a folder", where=str(path), expected="a file to write")
        if os.path.lexists(path) and not force:  # also a link that leads nowhere
            raise ConfigError("exists already", where=str(path), hint=hint)
        _check_folder(path)


def write_whole(path: Path, write: Callable[[Path], None]) -> None:
    """Write a file whole or not at all, see `aqualog.io.atomic_write.write_whole`; an AqualogError if that fails."""
    with writing(path):
        atomic_write.write_whole(path, write)


def write_together(files: Mapping[Path, Callable[[Path], None]]) -> None:
    """Write files whole, all of them or none; an AqualogError that names the file if one fails."""

    def named(path: Path, write: Callable[[Path], None], temporary: Path) -> None:
        with writing(path):
            write(temporary)

    with writing(next(iter(files)).parent if files else Path()):
        atomic_write.write_together({p: partial(named, p, write) for p, write in files.items()})


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Report an error of the system as an AqualogError: a result cannot be written."""
    try:
        yield
    except OSError as error:
        what = f"cannot be written ({error.strerror or error})"
        raise AqualogError(what, where=str(path), hint="another place for the result") from error


def _check_folder(path: Path) -> None:
    """The nearest folder above a result that exists: it must be one, and be writable."""
    folder = next((p for p in path.absolute().parents if os.path.lexists(p)), None)  # also a link that leads nowhere
    if folder is None or not folder.is_dir():
        raise ConfigError("cannot be made", where=str(path), expected=f"a folder; {folder} is no folder")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise ConfigError("cannot be written", where=str(path), hint=f"the permissions of {folder}")
