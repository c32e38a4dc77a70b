"""What a stored result depends on, as one key: content of the log, car, map, settings, and the code behind it."""

from __future__ import annotations

import errno
import hashlib
import os
import stat
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from aqualog.align.mapping import SignalMap
from aqualog.detect.stream import Settings
from aqualog.vehicle import Vehicle

__all__ = ["Contents", "Seen", "change_since", "code_stamp", "result_key"]

Seen = tuple[tuple[str, int, int], ...]
"""Files with size and time of change."""

_BEHIND = (
    "physics", "io", "align", "features", "calibrate", "detect", "campaign/measure.py", "compiled.py", "errors.py",
    "intervals.py", "notation.py", "types.py", "units.py", "vehicle.py",
)  # fmt: skip
_LENGTH = 32  # hexadecimal digits of a key: 128 bit


class Contents:
    """Hashes of files, remembered as long as size and time of change stay; `known` maps path -> [size, mtime, hash]."""

    def __init__(self, known: Any = None) -> None:
        # it comes from a file: what is not as it should be is not known
        self.known: dict[str, list[int | str]] = (
            {k: v for k, v in known.items() if _is_entry(v)} if isinstance(known, dict) else {}
        )
        self.has_changed = False

    def of(self, path: Path) -> str:
        """Hash of a file, or of the files in a folder (a ROS 2 bag).

        Raises
        ------
        OSError
            If it cannot be read, also for a device or a pipe, which has no end or no content of its own.
        """
        if path.is_dir():
            return _hash(f"{p.relative_to(path)}:{self.of(p)}" for p in _files(path))
        state = path.stat()
        if not stat.S_ISREG(state.st_mode):
            raise OSError(errno.EINVAL, "is a device or a pipe; expected a log", str(path))
        name = os.path.realpath(path)
        entry = self.known.get(name)
        if entry and entry[:2] == [state.st_size, state.st_mtime_ns]:
            return str(entry[2])
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        self.known[name] = [state.st_size, state.st_mtime_ns, digest]
        self.has_changed = True
        return digest

    def seen(self, paths: Iterable[Path]) -> Seen:
        """The files behind `paths`, in the state in which they were hashed."""
        files = [f for p in paths for f in _files(p)]
        entries = (self.known.get(os.path.realpath(f), [-1, -1]) for f in files)
        return tuple((str(f), int(e[0]), int(e[1])) for f, e in zip(files, entries, strict=True))


def change_since(paths: Sequence[Path], seen: Seen) -> str:
    """What has become of files since they were hashed; empty if their content is still what the key stands for."""
    try:
        states = [(str(f), f.stat()) for p in paths for f in _files(p)]
    except OSError as error:
        return f"{error.filename}: {error.strerror} while it was read"
    now = tuple((name, state.st_size, state.st_mtime_ns) for name, state in states)
    if now == seen:
        return ""
    name = min(set(now) ^ set(seen), default=(", ".join(map(str, paths)),))[0]
    return f"{name}: changed while it was read. Try: run the batch again"


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
    return _hash([code_stamp(), *files, _told(vehicle), _told_map(signal_map), repr(settings)])


@cache
def code_stamp() -> str:
    """Hash of the sources that a result rests on: after a change of an equation all is measured anew."""
    package = Path(__file__).resolve().parents[1]
    paths = [
        p for name in _BEHIND for p in ([package / name] if name.endswith(".py") else (package / name).rglob("*.py"))
    ]
    return _hash(f"{p.relative_to(package)}:{hashlib.sha256(p.read_bytes()).hexdigest()}" for p in sorted(paths))


def _files(path: Path) -> list[Path]:
    return [p for p in sorted(path.rglob("*")) if p.is_file()] if path.is_dir() else [path]


def _is_entry(entry: Any) -> bool:
    return isinstance(entry, list) and [type(x) for x in entry] == [int, int, str]


def _told(vehicle: Vehicle) -> str:
    # sets and mappings have no order of their own
    values = {n: getattr(vehicle, n) for n in Vehicle.__slots__}
    plain = {n: sorted(v.items()) if isinstance(v, dict) else v for n, v in values.items() if n != "given"}
    return repr(sorted(plain.items(), key=lambda item: item[0])) + repr(sorted(vehicle.given))


def _told_map(signal_map: SignalMap) -> str:
    return repr(
        (
            sorted(signal_map.entries.items()), sorted(signal_map.clocks.items()), signal_map.time_channel,
            signal_map.time_unit,
        )
    )  # fmt: skip


def _hash(parts: Iterable[str]) -> str:
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:_LENGTH]
