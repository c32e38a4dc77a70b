"""What may come of a file that a user writes: what it says, or a `ConfigError` with one line; and work with it after that."""

import math
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from aqualog.align.load import load_signals
from aqualog.align.mapping import SignalMap
from aqualog.core.errors import AqualogError, ConfigError
from aqualog.core.records import Signals
from aqualog.core.vehicle import Vehicle

__all__ = ["LOG", "check_error", "check_finite", "drive", "folder_with", "loaded"]

LONGEST_LINE = 30_000  # all faults of a file are told at once


@contextmanager
def folder_with(files: Mapping[str, bytes]) -> Iterator[Path]:
    """A folder with these files, which nobody changes."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for at, data in files.items():
            (folder / at).write_bytes(data)
        yield folder
        for at, data in files.items():
            assert (folder / at).read_bytes() == data, f"{at} was changed"
        assert {p.name for p in folder.iterdir()} == set(files), "files were left behind"


def loaded(load: Callable[[Path], Any], path: Path, *names: str) -> Any:
    """What a file says, or None if it is refused as it should be: it is named, or one of the files that it names."""
    try:
        return load(path)
    except ConfigError as error:
        check_error(error, next((n for n in names if n in error.line()), path.name))
        return None


def check_error(error: AqualogError, name: str = "") -> None:
    """One line, which names the file."""
    line = error.line()
    assert name in line, f"the file is not named: {line[:200]}"
    assert "\n" not in line
    assert len(line) < LONGEST_LINE, f"an error of {len(line)} characters"
    assert error.what, "an error that says nothing"


def check_finite(record: Any, where: str = "") -> None:
    """No number of a record is NaN or beyond a float; lists and records within as well."""
    if isinstance(record, float):
        assert math.isfinite(record), f"{where} is {record}"
    elif isinstance(record, Mapping):
        for key, value in record.items():
            check_finite(value, f"{where}.{key}")
    elif isinstance(record, list | tuple):
        for value in record:
            check_finite(value, where)
    elif is_dataclass(record):
        for f in fields(record):
            check_finite(getattr(record, f.name), f"{where}.{f.name}")


def _log() -> bytes:
    t = np.arange(400) * 0.01
    v = 80.0 + 8.0 * np.sin(t)
    names = ["Zeit", "v_Referenz", "ax", "Gierrate", "Lenkradwinkel", "VL", "VR", "HL", "HR", "MA"]
    columns = [t, v, 2.2 * np.cos(t), 0.1 * np.sin(t), 3.0 * np.sin(t), *(v / 3.6 / 0.317 + 0.01 * k for k in range(4)), 90.0 + 9.0 * np.cos(t)]  # fmt: skip
    rows = [",".join(f"{c[k]:.5f}" for c in columns) for k in range(len(t))]
    return "\n".join([",".join(names), *rows, ""]).encode()


LOG = _log()  # a drive of four seconds under a logger's own names
NAMES = {
    "v_x": ("v_Referenz", "km/h"), "a_x": ("ax", "m/s^2"), "yaw_rate": ("Gierrate", "rad/s"),
    "steering_wheel_angle": ("Lenkradwinkel", "deg"), "omega_fl": ("VL", "rad/s"), "omega_fr": ("VR", "rad/s"),
    "omega_rl": ("HL", "rad/s"), "omega_rr": ("HR", "rad/s"), "torque_r": ("MA", "N*m"),
}  # fmt: skip


@cache
def drive() -> Signals:
    """The signals of `LOG`."""
    from aqualog.align.mapping import Entry

    entries = {symbol: Entry(symbol, (name,), unit) for symbol, (name, unit) in NAMES.items()}
    with folder_with({"log.csv": LOG}) as folder:
        return load_signals([folder / "log.csv"], vehicle=Vehicle(), signal_map=SignalMap(entries, {}, "Zeit", "s"))
