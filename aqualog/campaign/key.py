"""What a stored result depends on, as one key: content of the log, car, map, settings, and the code behind it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path

from aqualog.align.mapping import SignalMap
from aqualog.detect.stream import Settings
from aqualog.vehicle import Vehicle

__all__ = ["Contents", "code_stamp", "result_key"]

_BEHIND = ("physics", "io", "align", "features", "detect", "campaign/measure.py", "units.py", "notation.py")
_LENGTH = 32  # hexadecimal digits of a key: 128 bit


class Contents:
    """Hashes of files, remembered as long as size and time of change stay; `known` maps path -> [size, mtime, hash]."""

    def __init__(self, known: dict[str, list[int | str]] | None = None) -> None:
        self.known = dict(known or {})
        self.has_changed = False

    def of(self, path: Path) -> str:
        """Hash of a file, or of the files in a folder (a ROS 2 bag).

        Raises
        ------
        OSError
            If it cannot be read.
        """
        if path.is_dir():
            parts = [f"{p.relative_to(path)}:{self.of(p)}" for p in sorted(path.rglob("*")) if p.is_file()]
            return _hash(parts)
        state = path.stat()
        name = str(path.resolve())
        entry = self.known.get(name)
        if entry and entry[:2] == [state.st_size, state.st_mtime_ns]:
            return str(entry[2])
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        self.known[name] = [state.st_size, state.st_mtime_ns, digest]
        self.has_changed = True
        return digest


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
