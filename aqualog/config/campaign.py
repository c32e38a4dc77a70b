"""Read campaign files: which logs were driven in which configuration.

All faults of the file, of its table of runs and of the files that they name are reported at once, before any log is
opened. A missing log is no fault of the file: the other logs can be analysed, and `campaign.definition` reports it.
"""

from __future__ import annotations

import os
import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import date, datetime, time
from pathlib import Path
from typing import Any, NamedTuple

from aqualog.campaign.definition import Campaign, Run, near_name
from aqualog.campaign.run_table import as_point, decimal_sign, read_table
from aqualog.config.labels import load_labels
from aqualog.config.reader import Faults, Key, Row, Table, read
from aqualog.config.signal_map import load_signal_map
from aqualog.config.vehicle import load_vehicle
from aqualog.core.errors import ConfigError, LogError

__all__ = ["CAMPAIGN_KEYS", "RUN_KEYS", "CampaignFile", "load_campaign", "read_campaign"]

WEAR = ("new", "worn", "very_worn")
CAMPAIGN_KEYS = (
    Key("", "name", "text", "", "the file's name", "name of the campaign"),
    Key("", "vehicle", "path", "", "", "vehicle file of all runs; a run may name its own"),
    Key("", "signals", "path", "", "", "signal map of all logs"),
    Key("", "runs", "path", "", "", "table of the runs (CSV); this or `[[run]]` must be given"),
    Key("", "run", "tables", "", "", "`[[run]]` tables in the file itself, in place of `runs`"),
)
"""Keys of the campaign file itself; those of a run are `RUN_KEYS`."""

_ALL = (
    Key("run", "log", "path", "", "", "the log; must be given; several files of one drive as a list, or with "
        "; between them"),
    Key("run", "tyre", "text", "", "", "name of the tyre"),
    Key("run", "tread_depth_mm", "number", "mm", "", "tread depth", 0.0, 50.0),
    Key("run", "wear", "text", "", "", "new, worn or very_worn"),
    Key("run", "pressure_front_bar", "number", "bar", "", "gauge pressure of the tyres, front", 0.2, 20.0),
    Key("run", "pressure_rear_bar", "number", "bar", "", "gauge pressure of the tyres, rear", 0.2, 20.0),
    Key("run", "water_depth_mm", "number", "mm", "", "water on the lane; 0 is a dry run", 0.0, 200.0),
    Key("run", "water_depth_left_mm", "number", "mm", "", "water in the left track", 0.0, 200.0),
    Key("run", "load_front_kg", "number", "kg", "", "load over the front axle", -5000.0, 50000.0),
    Key("run", "load_rear_kg", "number", "kg", "", "load over the rear axle", -5000.0, 50000.0),
    Key("run", "manoeuvre", "text", "", "", "what was driven"),
    Key("run", "vehicle", "path", "", "", "vehicle file of this run, in place of the campaign's"),
    Key("run", "lane_start_s", "number", "s", "", "when the lane began, from the log's first sample", -1e7, 1e7),
    Key("run", "lane_end_s", "number", "s", "", "when it ended", -1e7, 1e7),
    Key("run", "labels", "path", "", "", "labels file"),
)  # fmt: skip
RUN_KEYS = {k.name: k for k in _ALL}


@dataclass(frozen=True, slots=True)
class CampaignFile:
    """A campaign and the place of each run: `runs.csv: line 4`, or the name of the file alone."""

    campaign: Campaign
    places: tuple[str, ...]


def load_campaign(path: Path) -> Campaign:
    """Read and check a campaign file. Logs need not exist yet; vehicle, signal map and labels must exist and be valid.

    Raises
    ------
    ConfigError
        With all faults of the file, of its table of runs and of the files that they name, in one message.
    """
    return read_campaign(path).campaign


def read_campaign(path: Path) -> CampaignFile:
    """Read and check a campaign file like `load_campaign`, and keep the place of each run."""
    try:
        file = read(path, "campaign file")
    except ConfigError as error:
        if "escape" in error.what.lower() or "Unescaped" in error.what:
            raise ConfigError(error.what, where=error.where, hint="/ in place of \\ in paths") from error
        raise
    file.check_names(*(k.name for k in CAMPAIGN_KEYS))
    texts = {n: _one_line(file, n) for n in ("name", "vehicle", "signals", "runs")}
    named = _NamedFiles(path.parent)
    signals = named.find(texts["signals"], "signals", file)
    vehicle = named.find(texts["vehicle"], "vehicle", file)
    if "run" in file and "runs" in file:
        file.add("runs", "both [[run]] and runs; expected one of them")
    elif "run" not in file and "runs" not in file:
        file.add("run", 'no runs; expected [[run]] tables or runs = "runs.csv"')
    found: list[_Read] = []
    tables = file.tables("run")
    heads = [i for i, line in enumerate(file.lines, 1) if re.match(r"\s*\[\[\s*[\"']?run[\"']?\s*\]\]", line)]
    for index, table in enumerate(tables):
        place = f"{path.name}: line {heads[index]}" if len(heads) == len(tables) else path.name
        found.append(_Read(_run(table, named, vehicle), table, place))
    _check_twice(found)
    _check_spelling(found)
    runs = _beside(path.parent, texts["runs"]) if texts["runs"] else None
    if runs is not None:
        try:
            found = _from_table(runs, named if runs.parent == named.base else _NamedFiles(runs.parent), vehicle)
        except ConfigError as error:
            file.add("runs", error.line())
    file.faults.raise_if_any()
    done = [(r.run, r.place) for r in found if r.run is not None]
    if not done:
        raise ConfigError("no run in it", where=str(runs or path), expected="at least one log")
    campaign = Campaign(texts["name"] or path.stem, path, signals, tuple(r for r, _ in done), runs)
    return CampaignFile(campaign, tuple(place for _, place in done))


class _Read(NamedTuple):
    """A run, None with its faults noted; its keys, and its place: `runs.csv: line 4`."""

    run: Run | None
    table: Table
    place: str


def _one_line(file: Table, name: str) -> str | None:
    value: str | None = file.get(name)
    if name not in file or _is_line(value):
        return value
    is_text = isinstance(value, str) and value.strip()
    wrong = f"is not one line of text{_escape_hint(value)}" if is_text else "is not a text"
    file.add(name, f"{name} = {str(value)[:40]!r} {wrong}")
    return None


def _is_line(value: Any) -> bool:
    return isinstance(value, str) and bool(value.strip()) and value.isprintable()


def _escape_hint(value: Any) -> str:
    """Return a hint: in double quotes a path of Windows loses backslashes, as in `\\temp`, which then holds a tab."""
    return "; a \\ in quotes is an escape, write / in paths" if re.search(r"[\t\b\n\r\f]", str(value)) else ""


def _from_table(path: Path, named: _NamedFiles, vehicle: Path | None) -> list[_Read]:
    table = read_table(path, key="log")
    faults = Faults(path)
    head = Row({}, faults, table.line)
    heading = table.heading
    for column, name in enumerate(heading, 1):
        if not name and any(len(cells) >= column and cells[column - 1] for _, cells in table.rows):
            head.add("", f"column {column} has no name")
        elif name == "x_":
            head.add("", "column x_ has no name behind x_")
        elif name and name not in RUN_KEYS and not name.startswith("x_"):
            head.unknown(name, RUN_KEYS, what="column", hint="columns of your own begin with x_")
    for name in dict.fromkeys(n for n in heading if n and heading.count(n) > 1):
        head.add("", f"column {name} stands twice")
    if heading and "log" not in heading:
        head.add("", "no column log; expected one that names the log of each run")
        faults.raise_if_any()
    numeric = [i for i, name in enumerate(heading) if name in RUN_KEYS and RUN_KEYS[name].kind == "number"]
    sign = decimal_sign((c[i] for _, c in table.rows for i in numeric if i < len(c)), table.separator)
    if sign == "?":
        faults.add("some numbers have a decimal comma, others a point; expected one sign in all of them")
    found: list[_Read] = []
    for line, row in table.rows:
        if len(row) != len(heading):
            is_comma = table.separator == "," and len(row) > len(heading)
            hint = " (a decimal comma? then ; between the cells)" if is_comma else ""
            Row({}, faults, line).add("", f"{len(row)} cells, the heading has {len(heading)}{hint}")
            continue
        turned = as_point([row[i] for i in numeric]) if sign != "." else [row[i] for i in numeric]
        cells = {
            **dict(zip(heading, row, strict=True)),
            **{heading[i]: c for i, c in zip(numeric, turned, strict=True)},
        }
        known = {n: c for n, c in cells.items() if c and (n in RUN_KEYS or n.startswith("x_"))}
        table_row = Row(known, faults, line)
        found.append(_Read(_run(table_row, named, vehicle), table_row, f"{path.name}: line {line}"))
    _check_twice(found)
    _check_spelling(found)
    faults.raise_if_any()
    return found


def _run(table: Table, named: _NamedFiles, vehicle: Path | None) -> Run | None:
    values: dict[str, float | str] = {}
    for name, value in table.values.items():
        key = RUN_KEYS.get(name)
        if key is None and not name.startswith("x_"):
            table.unknown(name, RUN_KEYS)
        elif key is not None and key.kind == "number":
            number = table.number(name, key)
            if number is not None:
                values[name] = number
        elif name.startswith("x_") and isinstance(value, bool | int | float | date | datetime | time):
            values[name] = _plain(value)
        elif name == "log":
            continue
        elif not _is_line(value):
            table.add(name, f"{name} = {str(value)[:40]!r} is not one line of text{_escape_hint(value)}")
        elif name == "wear" and value not in WEAR:
            table.add(name, f"wear = {value[:40]!r} is not one of {', '.join(WEAR)}")
        elif key is None or key.kind == "text":
            values[name] = value
    own = named.find(table.get("vehicle"), "vehicle", table) or vehicle
    labels = named.find(table.get("labels"), "labels", table)
    logs = _logs(table, named.base)
    if own is None:
        table.add("run", "no vehicle, neither of the campaign nor of this run")
    start, end = values.get("lane_start_s"), values.get("lane_end_s")
    if ("lane_start_s" in table) != ("lane_end_s" in table):
        table.add("lane_start_s" if start is not None else "lane_end_s", "lane_start_s and lane_end_s go together")
    lane = (start, end) if isinstance(start, float) and isinstance(end, float) else None
    if lane is not None and not lane[0] < lane[1]:
        table.add("lane_end_s", f"lane_end_s = {lane[1]:g} is not after lane_start_s = {lane[0]:g}")
    elif lane is not None and lane[1] <= 0.0:
        table.add("lane_end_s", f"lane_end_s = {lane[1]:g} is before the log's first sample, from which it counts")
    return None if own is None or not logs else Run(logs, own, labels, lane, values)


def _plain(value: Any) -> str:
    """Return a TOML value as a grouping key: 60 and 60.0 are one."""
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    return str(value).lower() if isinstance(value, bool) else str(value)


def _logs(table: Table, base: Path) -> tuple[Path, ...]:
    """Return the files of one drive; () with the fault noted if the names are not valid."""
    value = table.get("log")
    names = value.split(";") if isinstance(value, str) else value
    if isinstance(value, str) and not value.strip():
        names = None
    if isinstance(names, list) and isinstance(value, str):
        names = [n for n in names if n.strip()]
    if not isinstance(names, list) or not names or not all(isinstance(n, str) and n.strip() for n in names):
        table.add("log" if value is not None else "run", "a run names no log")
        return ()
    if not all(n.isprintable() for n in names):
        table.add("log", f"log = {str(value)[:60]!r} is not printable text{_escape_hint(value)}")
        return ()
    paths = tuple(_beside(base, n.strip()) for n in names)
    for path, name in zip(paths, names, strict=True):
        wrong = _no_log(path, name.strip())
        if wrong:
            table.add("log", f"log = {name.strip()[:80]!r} {wrong}")
    bare = [p.name for p in paths]
    for name in dict.fromkeys(n for n in bare if bare.count(n) > 1):
        table.add("log", f"two files of one drive are both called {name[:80]!r}; rename one of them")
    return paths


def _no_log(path: Path, name: str) -> str:
    """Say why a name cannot be that of a log; empty if it can, whether or not the file exists."""
    if os.path.isdir(path):  # noqa: PTH112 - a path that is too long is no fault of the system
        from aqualog.io.open_log import sniff

        try:
            sniff(path)
        except LogError:
            return "is a folder without a ROS 2 bag; a run names its files one by one"
    elif os.path.exists(path) and not os.path.isfile(path):  # noqa: PTH110, PTH113
        return "is a device or a pipe, no log"
    elif any(c in name for c in "*?") and not os.path.exists(path):  # noqa: PTH110
        return "is a pattern; a run names its files one by one (`aqualog campaign init FOLDER` lists a folder)"
    elif name.startswith("@") and not os.path.exists(path):  # noqa: PTH110
        return "is a list; a run names its files one by one"
    return ""


def _beside(base: Path, name: str) -> Path:
    """Return a path relative to `base`; backslashes of Windows are understood on other systems, too."""
    path = base / name
    return base / name.replace("\\", "/") if "\\" in name and not os.path.exists(path) else path  # noqa: PTH110


_CHECKS: dict[str, Callable[[Path], object]] = {
    "vehicle": load_vehicle, "signals": load_signal_map, "labels": load_labels,
}  # fmt: skip


class _NamedFiles:
    """Read and check the files that a campaign names, each once."""

    def __init__(self, base: Path) -> None:
        self.base = base
        self._seen: set[tuple[str, Path]] = set()

    def find(self, name: Any, key: str, table: Table) -> Path | None:
        """Return the file; None if no file is named. Its faults are noted where it is named first."""
        if not _is_line(name):
            return None
        path = _beside(self.base, name.strip())
        if (key, path) in self._seen:
            return path
        self._seen.add((key, path))
        if not os.path.isfile(path):  # noqa: PTH113
            near = near_name(path)
            told = "there is no such file" + (f' (did you mean "{near}"?)' if near else "")
            table.add(key, f"{key} = {name[:80]!r}: {'is a folder; a file is needed' if path.is_dir() else told}")
            return path
        try:
            _CHECKS[key](path)
        except ConfigError as error:
            table.add(key, f"{key} = {name[:80]!r}: {error.line()}")
        return path


def _check_spelling(found: Sequence[_Read]) -> None:
    """Note tyres that differ from a more frequent one in case, blanks and hyphens only: they would be sets apart."""
    named = [(str(r.run.values["tyre"]), r) for r in found if r.run is not None and "tyre" in r.run.values]
    count = Counter(name for name, _ in named)
    usual = {_folded(name): name for name, _ in reversed(count.most_common())}
    for name, one in named:
        if name != (other := usual[_folded(name)]):
            told = f'another tyre differs in case, blanks or hyphens only (did you mean "{other[:80]}"?)'
            one.table.add("tyre", f"tyre = {name[:80]!r}: {told}")


def _folded(name: str) -> str:
    """Return a name without case, blanks and hyphens; between two digits one stays: 1-1 and 11 are two tyres."""
    plain = unicodedata.normalize("NFKC", name).casefold()
    return re.sub(r"(?<!\d)[\s_-]+|[\s_-]+(?!\d)", "", re.sub(r"[\s_-]+", " ", plain))


def _check_twice(found: Sequence[_Read]) -> None:
    """Note a drive that is in two runs, and would count twice, unless each run is another stretch of it."""
    by_logs: dict[tuple[str, ...], list[tuple[Run, _Read]]] = {}
    for one in found:
        if one.run is not None:
            key = tuple(sorted(os.path.normcase(os.path.normpath(p)) for p in one.run.logs))
            by_logs.setdefault(key, []).append((one.run, one))
    for several in by_logs.values():
        if len(several) == 1:
            continue
        name = several[0][0].logs[0].name
        for (run, one), (_, before) in zip(several[1:], several, strict=False):
            if run.lane is None or several[0][0].lane is None:
                one.table.add("log", f"log {name!r} stands in {before.place} too; runs of one log need lane times each")
        laned = sorted(((r.lane, read_) for r, read_ in several if r.lane is not None), key=lambda x: x[0])
        for (lane, one), (previous, other) in zip(laned[1:], laned, strict=False):
            if lane[0] < previous[1]:
                one.table.add("lane_start_s", f"the lane overlaps with that in {other.place}, of the same log {name!r}")
