"""Read TOML files, and report all faults at once with line and nearest valid name."""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from aqualog.core.errors import ConfigError
from aqualog.io.small_file import read_small

__all__ = ["DEEPEST", "Faults", "TableFaults", "is_number", "is_real", "line_of", "load_toml"]

LARGEST = 16 * 2**20  # [byte]
DEEPEST = 100  # levels of tables and lists that any file needs
_MOST_PARTS = 100  # parts of a dotted key; tomllib takes time with their square
_MOST_TOLD = 20  # faults of a file; each is looked for in the whole text
_LONGEST_KEY = 60  # characters of an unknown key that are shown
_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+"""
_DEEP = re.compile(rf"""(?:^|[\[{{,])[ \t]*+{_PART}(?:\.[ \t]*+{_PART}){{{_MOST_PARTS}}}""", re.MULTILINE)
_HEADER = re.compile(r"""^\s*\[\[?\s*["']?([A-Za-z_][\w.-]*)["']?\s*\]\]?\s*(#.*)?$""")


def load_toml(path: Path, *, what: str) -> tuple[dict[str, Any], str]:
    """Parse a TOML file.

    Parameters
    ----------
    path : Path
        File.
    what : str
        What the file is to the user, e.g. `vehicle file`; used in errors.

    Returns
    -------
    document, text

    Raises
    ------
    ConfigError
        If the file is missing, not UTF-8 or not TOML.
    """
    data = read_small(path, what=what, expected="a TOML file", largest=LARGEST)
    try:
        text = data.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")  # as a file of text is read
    except UnicodeDecodeError as error:
        raise ConfigError(f"{what} is not UTF-8 text", where=str(path), expected="a TOML file") from error
    if _DEEP.search(text):
        raise ConfigError(f"{what} has a key of more than {_MOST_PARTS} parts", where=str(path))
    try:
        document = tomllib.loads(text)
        if _has_endless_number(document):
            raise ValueError("an integer beyond 64 bits")
        return document, text
    except RecursionError as error:  # at some hundred levels, as it happens
        raise ConfigError(f"{what} is nested deeper than {DEEPEST} levels", where=str(path)) from error
    except ValueError as error:  # also numbers of thousands of digits
        raise ConfigError(f"{what} is not valid TOML: {error}", where=str(path)) from error


def _has_endless_number(value: Any) -> bool:
    """Return whether it holds an integer that TOML does not allow, and that Python would refuse to print."""
    if isinstance(value, dict):
        return any(_has_endless_number(v) for v in value.values())
    if isinstance(value, list):
        return any(_has_endless_number(v) for v in value)
    return isinstance(value, int) and not -(2**63) <= value < 2**63


def line_of(text: str, key: str) -> int | None:
    """Return the line (from 1) of a key or table; None where it cannot be determined."""
    for number, line in enumerate(text.splitlines(), 1):
        stripped = line.lstrip()
        if stripped.startswith((key, f'"{key}"', f"[{key}", f"[[{key}")):
            return number
    return None


def is_real(value: Any) -> bool:
    """Return whether a TOML value is a number, finite or infinite; NaN does not count."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and value == value


def is_number(value: Any) -> bool:
    """Return whether a TOML value is a finite number that a float can hold."""
    return is_real(value) and abs(value) < 1e300


class Faults:
    """Collect the faults of one file, then raise them in one message; of very many it lists the first."""

    def __init__(self, path: Path, text: str) -> None:
        self._path = path
        self._text = text
        self._found: list[str] = []
        self._untold = 0

    def add(self, key: str, message: str) -> None:
        """Note a fault at a key."""
        if len(self._found) == _MOST_TOLD:
            self._untold += 1
            return
        line = self._line(key)
        self._found.append(f"line {line}: {message}" if line else message)

    def _line(self, key: str) -> int | None:
        return line_of(self._text, key.rsplit(".", maxsplit=1)[-1])

    def unknown(self, key: str, known: Iterable[str]) -> None:
        """Note a key that does not exist, with the nearest one that does."""
        if len(self._found) == _MOST_TOLD:
            self._untold += 1
            return
        near = difflib.get_close_matches(key[:_LONGEST_KEY], sorted(known), n=1, cutoff=0.5)
        shown = key if len(key) <= _LONGEST_KEY else f"{key[:_LONGEST_KEY]} ..."
        self.add(key, f'unknown key "{shown}"' + (f' (did you mean "{near[0]}"?)' if near else ""))

    def number(self, table: Mapping[str, Any], key: str, *, low: float, high: float, unit: str) -> float | None:
        """Return a number within its bounds, or None with the fault noted."""
        value: Any = table.get(key)
        if not is_real(value):
            self.add(key, f"{key} = {str(value)[:40]} is not a number")
            return None
        if not low <= value <= high or not is_number(value):
            self.add(key, f"{key} = {value:g} is outside {low:g} ... {high:g} {unit}".rstrip())
            return None
        return float(value)

    def raise_if_any(self) -> None:
        """Raise one ConfigError with the faults."""
        if self._found:
            more = [f"and {self._untold} more"] if self._untold else []
            raise ConfigError("; ".join([*self._found, *more]), where=str(self._path))


class TableFaults(Faults):
    """Collect faults of a file with several tables: the line of a key is looked up in the current table."""

    def __init__(self, path: Path, text: str) -> None:
        super().__init__(path, text)
        self._lines = text.splitlines()
        self._table, self._index = "", 0

    @contextmanager
    def inside(self, table: str, index: int = 0) -> Iterator[None]:
        """Faults within are those of the table, the `index`-th of that name."""
        before = self._table, self._index
        self._table, self._index = table, index
        try:
            yield
        finally:
            self._table, self._index = before

    def _line(self, key: str) -> int | None:
        """Line of a key of the table, or of a table."""
        headers = [(i, m[1]) for i, line in enumerate(self._lines) if (m := _HEADER.match(line))]
        here = -1
        if self._table:
            own = [i for i, name in headers if name == self._table]
            here = own[self._index] if self._index < len(own) else -1
        end = next((i for i, _ in headers if i > here), len(self._lines))
        if not self._table or here >= 0:
            for i in range(here + 1, end):
                if _names(self._lines[i], key):
                    return i + 1
        named = next((i for i, name in headers if name == key != self._table), here)
        if named >= 0:
            return named + 1
        inline = (i for i, line in enumerate(self._lines) if self._table and _names(line, self._table))
        return next((i + 1 for i in inline), None)


def _names(line: str, key: str) -> bool:
    return re.match(rf"""^\s*["']?{re.escape(key)}["']?\s*[=.]""", line) is not None
