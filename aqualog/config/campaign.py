"""Campaign files: which logs were driven in which configuration."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aqualog.campaign.records import Campaign, Run
from aqualog.config.labels import read_csv
from aqualog.config.run_faults import RunFaults, RunKey, TableRun, TomlRun
from aqualog.config.table_faults import LineFaults
from aqualog.config.toml_file import TableFaults, load_toml
from aqualog.errors import ConfigError

__all__ = ["RUN_KEYS", "RunKey", "load_campaign"]

WEAR = ("new", "worn", "very_worn")
_TOP = ("name", "vehicle", "signals", "run", "runs")


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


def load_campaign(path: Path) -> Campaign:
    """Read and check a campaign file. Logs need not exist yet; vehicle, signal map and labels must.

    Raises
    ------
    ConfigError
        With all faults of the file, and of its table of runs, in one message.
    """
    document, text = load_toml(path, what="campaign file")
    faults = TableFaults(path, text)
    for name in document:
        if name not in _TOP:
            faults.unknown(name, _TOP)
    for name in ("name", "vehicle", "signals", "runs"):
        if name in document and not (isinstance(document[name], str) and document[name].strip()):
            faults.add(name, f"{name} = {str(document[name])[:40]!r} is not a text")
            document.pop(name)
    base = path.parent
    signals = _file(document.get("signals"), base, "signals", faults)
    vehicle = _file(document.get("vehicle"), base, "vehicle", faults)
    tables = document.get("run", [])
    if "run" in document and "runs" in document:
        faults.add("runs", "both [[run]] and runs; expected one of them")
    elif "run" not in document and "runs" not in document:
        faults.add("run", 'no runs; expected [[run]] tables or runs = "runs.csv"')
    if not isinstance(tables, list) or not all(isinstance(t, dict) for t in tables):
        faults.add("run", "run is not a list of [[run]] tables")
        tables = []
    runs: list[Run | None] = []
    for index, one in enumerate(tables):
        with faults.inside("run", index):
            runs.append(_run(one, base, vehicle, TomlRun(faults)))
    table = base / document["runs"] if isinstance(document.get("runs"), str) else None
    if table is not None:
        try:
            runs += _from_table(table, vehicle)
        except ConfigError as error:
            faults.add("runs", error.line())
    faults.raise_if_any()
    done = tuple(r for r in runs if r is not None)
    if not done:
        raise ConfigError("no run in it", where=str(path), expected="at least one log")
    return Campaign(str(document.get("name", path.stem)), path, signals, done, table)


def _from_table(path: Path, vehicle: Path | None) -> list[Run | None]:
    rows = read_csv(path, what="table of runs")
    faults = LineFaults(path)
    heading = [name.strip() for name in rows[0]] if rows else []
    for name in heading:
        if name not in RUN_KEYS and not name.startswith("x_"):
            faults.unknown(1, "column", name, RUN_KEYS)
    for name in {n for n in heading if heading.count(n) > 1}:
        faults.add(1, f"column {name} stands twice")
    runs: list[Run | None] = []
    for line, row in enumerate(rows[1:], 2):
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(heading):
            faults.add(line, f"{len(row)} cells, the heading has {len(heading)}")
            continue
        known = {n: c.strip() for n, c in zip(heading, row, strict=True) if n in RUN_KEYS or n.startswith("x_")}
        cells = {n: c for n, c in known.items() if c}
        runs.append(_run(cells, path.parent, vehicle, TableRun(faults, line)))
    faults.raise_if_any()
    return runs


def _run(table: Mapping[str, Any], base: Path, vehicle: Path | None, sink: RunFaults) -> Run | None:
    values: dict[str, float | str] = {}
    for name, value in table.items():
        key = RUN_KEYS.get(name)
        if key is None and not name.startswith("x_"):
            sink.unknown(name, list(RUN_KEYS))
        elif key is not None and key.kind == "number":
            number = sink.number(name, value, key)
            if number is not None:
                values[name] = number
        elif name.startswith("x_") and isinstance(value, int | float):
            values[name] = str(value)
        elif name == "log":
            continue
        elif not isinstance(value, str) or not value.strip() or not value.isprintable():
            sink.add(name, f"{name} = {str(value)[:40]!r} is not one line of text")
        elif name == "wear" and value not in WEAR:
            sink.add(name, f"wear = {value[:40]!r} is not one of {', '.join(WEAR)}")
        elif key is None or key.kind == "text":
            values[name] = value
    own = _file(table.get("vehicle"), base, "vehicle", sink) or vehicle
    labels = _file(table.get("labels"), base, "labels", sink)
    logs = _logs(table.get("log"), base)
    if not logs:
        sink.add("log" if "log" in table else "run", "a run names no log")
        return None
    if own is None:
        sink.add("run", "no vehicle, neither of the campaign nor of this run")
    start, end = values.get("lane_start_s"), values.get("lane_end_s")
    if ("lane_start_s" in table) != ("lane_end_s" in table):
        sink.add("lane_start_s" if start is not None else "lane_end_s", "lane_start_s and lane_end_s go together")
    lane = (start, end) if isinstance(start, float) and isinstance(end, float) else None
    if lane is not None and not lane[0] < lane[1]:
        sink.add("lane_end_s", f"lane_end_s = {lane[1]:g} is not after lane_start_s = {lane[0]:g}")
    return None if own is None else Run(logs, own, labels, lane, values)


def _logs(value: Any, base: Path) -> tuple[Path, ...]:
    names = value.split(";") if isinstance(value, str) else value
    if not isinstance(names, list) or not all(isinstance(n, str) and n.strip() and n.isprintable() for n in names):
        return ()
    return tuple(base / n.strip() for n in names)


def _file(name: Any, base: Path, key: str, sink: RunFaults | TableFaults) -> Path | None:
    """A file that must be there (else the fault is noted); None if it is not named."""
    if not isinstance(name, str) or not name.strip():
        return None
    path = base / name
    if not path.is_file():
        sink.add(key, f"{key} = {name[:80]!r}: there is no such file")
    return path
