"""Read campaign files: which logs were driven in which configuration.

All faults of the file, of its table of runs and of the files that they name are reported at once, before any log is
opened. A missing log is no fault of the file: the other logs can be analysed, and `aqualog.campaign.logs` reports it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

from aqualog.campaign.logs import near_name
from aqualog.campaign.records import Campaign, Run
from aqualog.campaign.run_table import RunTable, as_point, decimal_sign, read_table
from aqualog.config.file_key import FileKey
from aqualog.config.labels import load_labels
from aqualog.config.run_faults import RunFaults, RunKey, TableRun, TomlRun, check_twice
from aqualog.config.signal_map import load_signal_map
from aqualog.config.table_faults import LineFaults
from aqualog.config.toml_file import TableFaults, load_toml
from aqualog.config.vehicle import load_vehicle
from aqualog.core.errors import ConfigError, LogError

__all__ = ["CAMPAIGN_KEYS", "RUN_KEYS", "CampaignFile", "RunKey", "load_campaign", "read_campaign"]

WEAR = ("new", "worn", "very_worn")
CAMPAIGN_KEYS = (
    FileKey("", "name", "text", "", "the file's name", "name of the campaign"),
    FileKey("", "vehicle", "path", "", "", "vehicle file of all runs; a run may name its own"),
    FileKey("", "signals", "path", "", "", "signal map of all logs"),
    FileKey("", "runs", "path", "", "", "table of the runs (CSV); this or `[[run]]` must be given"),
    FileKey("", "run", "tables", "", "", "`[[run]]` tables in the file itself, in place of `runs`"),
)
"""Keys of the campaign file itself; those of a run are `RUN_KEYS`."""
_TOP = tuple(k.name for k in CAMPAIGN_KEYS)


_ALL = (
    RunKey("log", "path", "the log; must be given; several files of one drive as a list, or with ; between them"),
    RunKey("tyre", "text", "name of the tyre"),
    RunKey("tread_depth_mm", "number", "tread depth", "mm", 0.0, 50.0),
    RunKey("wear", "text", "new, worn or very_worn"),
    RunKey("pressure_front_bar", "number", "inflation pressure, front", "bar", 0.2, 20.0),
    RunKey("pressure_rear_bar", "number", "inflation pressure, rear", "bar", 0.2, 20.0),
    RunKey("water_depth_mm", "number", "water on the lane; 0 is a dry run", "mm", 0.0, 200.0),
    RunKey("water_depth_left_mm", "number", "water in the left track", "mm", 0.0, 200.0),
    RunKey("load_front_kg", "number", "load over the front axle", "kg", -5000.0, 50000.0),
    RunKey("load_rear_kg", "number", "load over the rear axle", "kg", -5000.0, 50000.0),
    RunKey("manoeuvre", "text", "what was driven"),
    RunKey("vehicle", "path", "vehicle file of this run, in place of the campaign's"),
    RunKey("lane_start_s", "number", "when the lane began, from the log's first sample", "s", -1e7, 1e7),
    RunKey("lane_end_s", "number", "when it ended", "s", -1e7, 1e7),
    RunKey("labels", "path", "labels file"),
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
    document, text = _document(path)
    faults = TableFaults(path, text)
    for name in document:
        if name not in _TOP:
            faults.unknown(name, _TOP)
    for name in ("name", "vehicle", "signals", "runs"):
        if name in document and not (isinstance(document[name], str) and document[name].strip()):
            faults.add(name, f"{name} = {str(document[name])[:40]!r} is not a text")
            document.pop(name)
        elif name in document and not document[name].isprintable():
            faults.add(name, f"{name} = {document[name][:40]!r} is not one line of text{_escape_hint(document[name])}")
            document.pop(name)
    named = _NamedFiles(path.parent)
    signals = named.find(document.get("signals"), "signals", faults)
    vehicle = named.find(document.get("vehicle"), "vehicle", faults)
    tables = document.get("run", [])
    if "run" in document and "runs" in document:
        faults.add("runs", "both [[run]] and runs; expected one of them")
    elif "run" not in document and "runs" not in document:
        faults.add("run", 'no runs; expected [[run]] tables or runs = "runs.csv"')
    if not isinstance(tables, list) or not all(isinstance(t, dict) for t in tables):
        faults.add("run", "run is not a list of [[run]] tables")
        tables = []
    found: list[tuple[Run | None, RunFaults]] = []
    heads = [i for i, line in enumerate(text.splitlines(), 1) if re.match(r"\s*\[\[\s*[\"']?run[\"']?\s*\]\]", line)]
    for index, one in enumerate(tables):
        place = f"{path.name}: line {heads[index]}" if len(heads) == len(tables) else path.name
        sink = TomlRun(faults, index, place)
        found.append((_run(one, named, vehicle, sink), sink))
    check_twice(found)
    table = _beside(path.parent, document["runs"]) if isinstance(document.get("runs"), str) else None
    if table is not None:
        try:
            found = _from_table(table, named if table.parent == named.base else _NamedFiles(table.parent), vehicle)
        except ConfigError as error:
            faults.add("runs", error.line())
    faults.raise_if_any()
    done = [(run, sink.place) for run, sink in found if run is not None]
    if not done:
        raise ConfigError("no run in it", where=str(table or path), expected="at least one log")
    campaign = Campaign(str(document.get("name", path.stem)), path, signals, tuple(r for r, _ in done), table)
    return CampaignFile(campaign, tuple(place for _, place in done))


def _document(path: Path) -> tuple[dict[str, Any], str]:
    try:
        return load_toml(path, what="campaign file")
    except ConfigError as error:
        if "escape" in error.what.lower() or "Unescaped" in error.what:
            raise ConfigError(error.what, where=error.where, hint="/ in place of \\ in paths") from error
        raise


def _escape_hint(value: Any) -> str:
    """Return a hint: in double quotes a path of Windows loses backslashes, as in `\\temp`, which then holds a tab."""
    return "; a \\ in quotes is an escape, write / in paths" if re.search(r"[\t\b\n\r\f]", str(value)) else ""


def _from_table(path: Path, named: _NamedFiles, vehicle: Path | None) -> list[tuple[Run | None, RunFaults]]:
    table = read_table(path, key="log")
    faults = LineFaults(path)
    heading = table.heading
    for column, name in enumerate(heading, 1):
        if not name and any(len(cells) >= column and cells[column - 1] for _, cells in table.rows):
            faults.add(table.line, f"column {column} has no name")
        elif name == "x_":
            faults.add(table.line, "column x_ has no name behind x_")
        elif name and name not in RUN_KEYS and not name.startswith("x_"):
            faults.unknown(table.line, "column", name, RUN_KEYS, hint="columns of your own begin with x_")
    for name in dict.fromkeys(n for n in heading if n and heading.count(n) > 1):
        faults.add(table.line, f"column {name} stands twice")
    if heading and "log" not in heading:
        faults.add(table.line, "no column log; expected one that names the log of each run")
        faults.raise_if_any()
    numeric = [i for i, name in enumerate(heading) if name in RUN_KEYS and RUN_KEYS[name].kind == "number"]
    sign = decimal_sign((c[i] for _, c in table.rows for i in numeric if i < len(c)), table.separator)
    if sign == "?":
        faults.add(None, "some numbers have a decimal comma, others a point; expected one sign in all of them")
    found: list[tuple[Run | None, RunFaults]] = []
    for line, row in table.rows:
        if len(row) != len(heading):
            faults.add(line, f"{len(row)} cells, the heading has {len(heading)}{_cells_hint(row, table)}")
            continue
        turned = as_point([row[i] for i in numeric]) if sign != "." else [row[i] for i in numeric]
        cells = {
            **dict(zip(heading, row, strict=True)),
            **{heading[i]: c for i, c in zip(numeric, turned, strict=True)},
        }
        known = {n: c for n, c in cells.items() if c and (n in RUN_KEYS or n.startswith("x_"))}
        sink = TableRun(faults, line, f"{path.name}: line {line}")
        found.append((_run(known, named, vehicle, sink), sink))
    check_twice(found)
    faults.raise_if_any()
    return found


def _cells_hint(row: tuple[str, ...], table: RunTable) -> str:
    is_comma = table.separator == "," and len(row) > len(table.heading)
    return " (a decimal comma? then ; between the cells)" if is_comma else ""


def _run(table: Mapping[str, Any], named: _NamedFiles, vehicle: Path | None, sink: RunFaults) -> Run | None:
    values: dict[str, float | str] = {}
    for name, value in table.items():
        key = RUN_KEYS.get(name)
        if key is None and not name.startswith("x_"):
            sink.unknown(name, list(RUN_KEYS))
        elif key is not None and key.kind == "number":
            number = sink.number(name, value, key)
            if number is not None:
                values[name] = number
        elif name.startswith("x_") and isinstance(value, bool | int | float | date | datetime | time):
            values[name] = _plain(value)
        elif name == "log":
            continue
        elif not isinstance(value, str) or not value.strip() or not value.isprintable():
            sink.add(name, f"{name} = {str(value)[:40]!r} is not one line of text{_escape_hint(value)}")
        elif name == "wear" and value not in WEAR:
            sink.add(name, f"wear = {value[:40]!r} is not one of {', '.join(WEAR)}")
        elif key is None or key.kind == "text":
            values[name] = value
    own = named.find(table.get("vehicle"), "vehicle", sink) or vehicle
    labels = named.find(table.get("labels"), "labels", sink)
    logs = _logs(table.get("log"), named.base, sink)
    if own is None:
        sink.add("run", "no vehicle, neither of the campaign nor of this run")
    start, end = values.get("lane_start_s"), values.get("lane_end_s")
    if ("lane_start_s" in table) != ("lane_end_s" in table):
        sink.add("lane_start_s" if start is not None else "lane_end_s", "lane_start_s and lane_end_s go together")
    lane = (start, end) if isinstance(start, float) and isinstance(end, float) else None
    if lane is not None and not lane[0] < lane[1]:
        sink.add("lane_end_s", f"lane_end_s = {lane[1]:g} is not after lane_start_s = {lane[0]:g}")
    elif lane is not None and lane[1] <= 0.0:
        sink.add("lane_end_s", f"lane_end_s = {lane[1]:g} is before the log's first sample, from which it counts")
    return None if own is None or not logs else Run(logs, own, labels, lane, values)


def _plain(value: Any) -> str:
    """Return a TOML value as a grouping key: 60 and 60.0 are one."""
    if isinstance(value, float) and value.is_integer() and abs(value) < 1e15:
        return str(int(value))
    return str(value).lower() if isinstance(value, bool) else str(value)


def _logs(value: Any, base: Path, sink: RunFaults) -> tuple[Path, ...]:
    """Return the files of one drive; () with the fault noted if the names are not valid."""
    names = value.split(";") if isinstance(value, str) else value
    if isinstance(value, str) and not value.strip():
        names = None
    if isinstance(names, list) and isinstance(value, str):
        names = [n for n in names if n.strip()]
    if not isinstance(names, list) or not names or not all(isinstance(n, str) and n.strip() for n in names):
        sink.add("log" if value is not None else "run", "a run names no log")
        return ()
    if not all(n.isprintable() for n in names):
        sink.add("log", f"log = {str(value)[:60]!r} is not printable text{_escape_hint(value)}")
        return ()
    paths = tuple(_beside(base, n.strip()) for n in names)
    for path, name in zip(paths, names, strict=True):
        wrong = _no_log(path, name.strip())
        if wrong:
            sink.add("log", f"log = {name.strip()[:80]!r} {wrong}")
    bare = [p.name for p in paths]
    for name in dict.fromkeys(n for n in bare if bare.count(n) > 1):
        sink.add("log", f"two files of one drive are both called {name[:80]!r}; rename one of them")
    return paths


def _no_log(path: Path, name: str) -> str:
    """Say why a name cannot be that of a log; empty if it can, whether or not the file exists."""
    if os.path.isdir(path):  # noqa: PTH112 - a path that is too long is no fault of the system
        from aqualog.io.sniff import sniff

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

    def find(self, name: Any, key: str, sink: RunFaults | TableFaults) -> Path | None:
        """Return the file; None if no file is named. Its faults are noted where it is named first."""
        if not isinstance(name, str) or not name.strip() or not name.isprintable():
            return None
        path = _beside(self.base, name.strip())
        if (key, path) in self._seen:
            return path
        self._seen.add((key, path))
        if not os.path.isfile(path):  # noqa: PTH113
            near = near_name(path)
            told = f' (did you mean "{near}"?)' if near else ""
            sink.add(key, f"{key} = {name[:80]!r}: there is no such file{told}")
            return path
        try:
            _CHECKS[key](path)
        except ConfigError as error:
            sink.add(key, f"{key} = {name[:80]!r}: {error.line()}")
        return path
