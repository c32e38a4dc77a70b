"""One reader of settings files: keys as data, and all faults of a file in one message with line and nearest name."""

from __future__ import annotations

import csv
import difflib
import io
import math
import re
import tomllib
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

from aqualog.core.errors import ConfigError
from aqualog.io.user_file import read_small

__all__ = [
    "DEEPEST", "Faults", "Key", "Row", "Table", "is_number", "is_real", "quoted", "read", "read_csv",
    "reads_as_number", "tried",
]  # fmt: skip

LARGEST = 16 * 2**20  # [byte]
LARGEST_TABLE = 64 * 2**20  # [byte]
DEEPEST = 100  # levels of tables and lists that any file needs
_MOST_PARTS = 100  # parts of a dotted key; tomllib takes time with their square
_MOST_TOLD = 20  # faults of a file; each is looked for in the whole text
_MOST_LINES = 6  # of one fault
_LONGEST = 500  # characters of one fault; a cell may be of any length
_LONGEST_KEY = 60  # characters of an unknown key that are shown
_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+"""
_DEEP = re.compile(rf"""(?:^|[\[{{,])[ \t]*+{_PART}(?:\.[ \t]*+{_PART}){{{_MOST_PARTS}}}""", re.MULTILINE)
_HEADER = re.compile(r"""^\s*\[\[?\s*([A-Za-z_"'][^\[\],=]*?)\s*\]\]?\s*(#.*)?$""")

_MARKS = {
    "campaign file": ("run", "runs"), "signal map": ("signals", "sources"), "model file": ("term",),
    "vehicle file": ("drivetrain", "mass", "l_f", "l_r", "wheels"),
    "scenario file": ("speed_kmh", "profile", "lane"), "thresholds file": ("thresholds", "joint_cusum"),
}  # fmt: skip
"""Keys that show which file this is."""

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Key:
    """One key of a settings file: what the reader checks and the reference shows.

    `table` is the TOML table, empty for the top level. `default` is empty or None where the key must be given, or has
    no effect if it is left out. `low` and `high` bound numbers, in `unit`.
    """

    table: str
    name: str
    kind: str
    unit: str
    default: float | str | None
    meaning: str
    low: float = -math.inf
    high: float = math.inf

    @property
    def path(self) -> str:
        """`lane.start_s`."""
        return f"{self.table}.{self.name}" if self.table else self.name


class Bounded(Protocol):
    """Anything with the bounds of a number."""

    @property
    def low(self) -> float:
        """Lowest value."""

    @property
    def high(self) -> float:
        """Highest value."""

    @property
    def unit(self) -> str:
        """Unit of both."""


def read(path: Path, what: str) -> Table:
    """Parse a TOML file.

    Parameters
    ----------
    path : Path
        File.
    what : str
        What the file is to the user, e.g. `vehicle file`; used in errors.

    Raises
    ------
    ConfigError
        If the file is missing, not UTF-8 or not TOML.
    """
    text = _text_of(read_small(path, what=what, expected="a TOML file", largest=LARGEST), path, what, "a TOML file")
    if _DEEP.search(text):
        raise ConfigError(f"{what} has a key of more than {_MOST_PARTS} parts", where=str(path))
    try:
        document = tomllib.loads(text)
        if _has_endless_number(document):
            raise ValueError("an integer beyond 64 bits")
    except RecursionError as error:  # at some hundred levels, as it happens
        raise ConfigError(f"{what} is nested deeper than {DEEPEST} levels", where=str(path)) from error
    except ValueError as error:  # also numbers of thousands of digits
        raise ConfigError(f"{what} is not valid TOML: {_at_key(error, text)}", where=str(path)) from error
    kind = _kind_of(document, what)
    if kind != what:
        raise ConfigError(f"this is a {kind}", where=str(path), expected=f"a {what}")
    return Table(document, Faults(path), lines=text.splitlines())


def _kind_of(document: Mapping[str, Any], what: str) -> str:
    """Return what a file is by its keys: `what` if it has one of that, or where neither marks nor keys say."""
    # a campaign file names its map: `signals = "map.toml"`
    kinds = [k for k, marks in _MARKS.items() if any(n in document and _is_mark(n, document[n]) for n in marks)]
    return what if what not in _MARKS or what in kinds or not kinds else kinds[0]


def _is_mark(name: str, value: Any) -> bool:
    return name not in _MARKS["signal map"] or isinstance(value, dict)


def _at_key(error: ValueError, text: str) -> str:
    """What the parser says, with the line that it stumbled over."""
    at = re.search(r"\(at line (\d+), column \d+\)", str(error))
    if at is None:
        return str(error)
    line = text.split("\n")[int(at[1]) - 1].strip()
    shown = line if len(line) <= _LONGEST_KEY else f"{line[:_LONGEST_KEY]} ..."
    return f"{error}: {shown}" if line else str(error)


def read_csv(path: Path, what: str) -> list[list[str]]:
    """Read the rows of a small CSV file; errors as of `read`."""
    data = read_small(path, what=what, expected="a CSV file", largest=LARGEST_TABLE)
    try:
        return list(csv.reader(io.StringIO(_text_of(data, path, what, "a CSV file")), strict=True))
    except csv.Error as error:
        raise ConfigError(f"{what} is not CSV: {error}", where=str(path)) from error


def _text_of(data: bytes, path: Path, what: str, expected: str) -> str:
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")  # as a file of text is read
    except UnicodeDecodeError as error:
        raise ConfigError(f"{what} is not UTF-8 text", where=str(path), expected=expected) from error


def _has_endless_number(value: Any) -> bool:
    """Return whether it holds an integer that TOML does not allow, and that Python would refuse to print."""
    if isinstance(value, dict):
        return any(_has_endless_number(v) for v in value.values())
    if isinstance(value, list):
        return any(_has_endless_number(v) for v in value)
    return isinstance(value, int) and not -(2**63) <= value < 2**63


def tried(load: Callable[[Path], T], path: Path, faults: list[str]) -> T | None:
    """Return what a file says, or None with its faults noted."""
    try:
        return load(path)
    except ConfigError as error:
        faults.append(error.line())
        return None


def is_real(value: Any) -> bool:
    """Return whether a TOML value is a number, finite or infinite; NaN does not count."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and value == value


def is_number(value: Any) -> bool:
    """Return whether a TOML value is a finite number that a float can hold."""
    return is_real(value) and abs(value) < 1e300


def quoted(names: Iterable[str]) -> str:
    """`"left", "right"`."""
    return ", ".join(f'"{n}"' for n in names)


class Faults:
    """Collect the faults of one file, then raise them in one message; of very many it spells out the first."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._found: dict[str, list[int]] = {}
        self._untold = 0

    @property
    def is_full(self) -> bool:
        """Return whether further faults are only counted."""
        return len(self._found) == _MOST_TOLD

    def add(self, message: str, find_line: Callable[[], int | None] = lambda: None) -> None:
        """Note a fault; its line (from 1) is looked for only where it is spelt out. Equal ones become one."""
        if self.is_full and message not in self._found:
            self._untold += 1
            return
        lines = self._found.setdefault(message, [])
        line = find_line()
        if line:
            lines.append(line)

    def raise_if_any(self) -> None:
        """Raise one ConfigError with the faults."""
        if self._found:
            more = [f"and {self._untold} more"] if self._untold else []
            told = [f"{_lines_text(lines)}{message}" for message, lines in self._found.items()]
            raise ConfigError("; ".join([*told, *more]), where=str(self._path))


def _lines_text(lines: Sequence[int]) -> str:
    """`line 3: `, `lines 3, 4, 7: `, of many the first ones."""
    if not lines:
        return ""
    more = f" and {len(lines) - _MOST_LINES} more" if len(lines) > _MOST_LINES else ""
    return f"line{'s' if len(lines) > 1 else ''} {', '.join(map(str, lines[:_MOST_LINES]))}{more}: "


class Table:
    """One table of a TOML file, the file itself or a table in it, and where its keys stand.

    `values` is its content. After a fault each method returns what lets the reading go on.
    """

    def __init__(
        self, values: Mapping[str, Any], faults: Faults, *, lines: list[str], name: str = "", index: int | None = None,
        parent: Table | None = None,
    ) -> None:  # fmt: skip
        self.values = values
        self.faults = faults
        self.name = name
        self.lines = lines
        self._index, self._parent = index, parent

    def __contains__(self, name: str) -> bool:
        """Return whether a key is given."""
        return name in self.values

    def get(self, name: str, default: Any = None) -> Any:
        """Return the value of a key as it stands there."""
        return self.values.get(name, default)

    def line_of(self, key: str) -> int | None:
        """Return the line (from 1) of a key or table in this table, else of the table itself; None if not found."""
        begin, found = self._lines_of(key)
        if begin is None:  # written in braces, or with points
            if self._parent is None:
                return None
            own = self.name.removeprefix(f"{self._parent.name}.")
            return self._parent._lines_of(f"{own}.{key}")[1] or self._parent.line_of(own)
        return found or begin or None

    def _lines_of(self, key: str) -> tuple[int | None, int | None]:
        """Return the line (from 1) of this table's header, 0 of the file's, and that of a key or table in it."""
        headers = [(i, re.sub("[\"']", "", m[1])) for i, line in enumerate(self.lines) if (m := _HEADER.match(line))]
        own = [i for i, name in headers if name == self.name]
        index = self._index or 0
        begin = -1 if not self.name else own[index] if index < len(own) else None
        if begin is None:
            return None, None
        end = next((i for i, _ in headers if i > begin), len(self.lines))
        names = re.compile(rf"""^\s*["']?{re.escape(key)}["']?\s*[=.]""")
        body = (i for i in range(begin + 1, end) if names.match(self.lines[i]))
        child = f"{self.name}.{key}" if self.name else key
        tables = (i for i, name in headers if name == child)
        found = next(body, next(tables, None))
        return begin + 1, None if found is None else found + 1

    def add(self, key: str, message: str) -> None:
        """Note a fault at a key."""
        self.faults.add(message, lambda: self.line_of(key))

    def unknown(self, name: str, known: Iterable[str], *, what: str = "key", hint: str = "") -> None:
        """Note a name that does not exist, with the nearest one that does, else with the hint."""
        if self.faults.is_full:  # the nearest name takes its time
            self.faults.add("")
            return
        by_lower = {n.lower(): n for n in sorted(known)}
        near = difflib.get_close_matches(name[:_LONGEST_KEY].lower(), by_lower, n=1, cutoff=0.5)
        told = f' (did you mean "{by_lower[near[0]]}"?)' if near else f" ({hint})" if hint else ""
        shown = name if len(name) <= _LONGEST_KEY else f"{name[:_LONGEST_KEY]} ..."
        self.add(name, f'unknown {what} "{shown}"{told}')

    def check_names(self, *known: str) -> None:
        """Note every key that is not one of these."""
        for name in self.values:
            if name not in known:
                self.unknown(name, known)

    def number(self, name: str, of: Bounded) -> float | None:
        """Return a number within its bounds; None if it is not given, or with the fault noted."""
        if name not in self.values:
            return None
        value = self._number(name, of.unit)
        if value is not None and (not of.low <= value <= of.high or not abs(value) < 1e300):
            bounds = f"{of.low:g} ... {of.high:g} {of.unit}".rstrip()
            self.add(name, f"{self._path_of(name)} = {value:g} is outside {bounds}")
            return None
        return value

    def _path_of(self, name: str) -> str:
        """A key with the table that it stands in; of tables in a list the line says which one."""
        return f"{self.name}.{name}" if self.name and self._index is None else name

    def _number(self, name: str, unit: str) -> float | None:
        value = self.values[name]
        if is_real(value):
            return float(value)
        if isinstance(value, str) and reads_as_number(value.strip().replace(",", ".")):
            told = f'"{value[:40]}" is a text, not a number; write it without quotes, with a point'
        else:
            told = f"{repr(value)[:40]} is not a number"
        self.add(name, f"{self._path_of(name)} = {told}")
        return None

    def numbers(self, keys: Mapping[str, Bounded], *extra: str) -> dict[str, float]:
        """Return all numbers that are given and within their bounds; other names than `keys` and `extra` are faults."""
        self.check_names(*keys, *extra)
        found = {name: self.number(name, keys[name]) for name in self.values if name in keys}
        return {name: value for name, value in found.items() if value is not None}

    def choice(self, name: str, known: Collection[str], usual: str) -> str:
        """Return one of some words; `usual` if the key is not given."""
        value = self.get(name, usual)
        if isinstance(value, str) and value in known:
            return value
        self.add(name, f"{name} = {repr(value)[:40]} is not one of {quoted(known)}")
        return usual

    def table(self, name: str) -> Table:
        """Return a table in this one, empty if it is not given."""
        value = self.get(name, {})
        if not isinstance(value, dict):
            path = f"{self.name}.{name}" if self.name else name
            self.add(name, f"{name} is not a table; write [{path}]")
            value = {}
        return self.child(name, value)

    def child(self, name: str, values: Mapping[str, Any]) -> Table:
        """Return a table in this one whose values are at hand."""
        path = f"{self.name}.{name}" if self.name else name
        return Table(values, self.faults, lines=self.lines, name=path, parent=self)

    def tables(self, name: str) -> list[Table]:
        """Return the tables `[[name]]`."""
        given = self.get(name, [])
        if not isinstance(given, list) or not all(isinstance(t, dict) for t in given):
            self.add(name, f"{name} is not a list of tables; write [[{name}]]")
            given = []
        return [Table(t, self.faults, lines=self.lines, name=name, index=i, parent=self) for i, t in enumerate(given)]


class Row(Table):
    """One line of a table of cells, by the names of its columns; all values are texts."""

    def __init__(self, values: Mapping[str, str], faults: Faults, line: int) -> None:
        super().__init__(values, faults, lines=[])
        self._line = line

    def line_of(self, key: str) -> int:
        """Return the line of the row."""
        return self._line

    def add(self, key: str, message: str) -> None:
        """Note a fault in the row."""
        short = message if len(message) <= _LONGEST else f"{message[: _LONGEST // 2]} ... {message[-_LONGEST // 2 :]}"
        super().add(key, short)

    def _number(self, name: str, unit: str) -> float | None:
        text = self.values[name]
        try:
            value = math.nan if "_" in text else float(text)  # Python reads 1_9 as 19
        except ValueError:
            value = math.nan
        if not math.isnan(value):
            return value
        without = f" (in {unit}, without the unit)" if unit and text.lower().endswith(unit.lower()) else ""
        self.add(name, f"{name} = {text[:40]!r} is not a number{without}")
        return None


def reads_as_number(text: str) -> bool:
    """Return whether a text is a number, as Python writes it."""
    try:
        float(text)
    except ValueError:
        return False
    return True
