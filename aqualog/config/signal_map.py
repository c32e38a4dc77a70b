"""Read and write signal maps as TOML."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from aqualog.align.mapping import Entry, SignalMap, SourceClock
from aqualog.config.file_key import FileKey
from aqualog.config.toml_file import Faults, is_number, load_toml
from aqualog.core.notation import ACCEPTED, SYMBOLS
from aqualog.core.units import is_unit, parse_unit
from aqualog.io.csv_format import CsvFormat, format_fault

__all__ = ["MAP_KEYS", "load_signal_map", "map_text"]

_CLOCK = 'sources."FILE"'
MAP_KEYS = (
    FileKey("signals", "SIGNAL.channel", "text or list", "", "", "name of the channel, or names in order of "
            "preference; must be given; `SIGNAL = \"name\"` is short for it"),
    FileKey("signals", "SIGNAL.unit", "text", "", "the file's", "unit of the raw values, in place of the file's"),
    FileKey("signals", "SIGNAL.scale", "number", "", "1", "factor on the SI value; a negative one turns the sign"),
    FileKey("signals", "SIGNAL.offset", "number", "SI", "0", "added after scaling"),
    FileKey("signals", "SIGNAL.invalid", "list of numbers", "", "[]", "raw values that mean \"no value\""),
    FileKey("time", "channel", "text", "", "", "the column that holds the time"),
    FileKey("time", "unit", "text", "", "", "its unit: s, ms, us, ns, min or h"),
    FileKey("csv", "separator", "text", "", "found", "one sign, or `tab`, `comma`, `semicolon`, `space`; in "
            "`[csv.\"PATTERN\"]` for the files of that name alone"),
    FileKey("csv", "decimal", "text", "", "found", "`.` or `,`"),
    FileKey("csv", "encoding", "text", "", "found", "an encoding that Python knows, `cp1252`"),
    FileKey(_CLOCK, "offset_s", "number", "s", "0", "by how much the clock of this file is late; the name may be a "
            "pattern"),
    FileKey(_CLOCK, "drift_ppm", "number", "ppm", "0", "by how much it runs fast"),
    FileKey(_CLOCK, "at_s", "number", "s", "0", "stamp of the file's own clock at which the offset holds"),
)  # fmt: skip
"""Every key of a signal map."""

_TABLES = ("signals", "time", "csv", "sources")
_ENTRY_KEYS = tuple(k.name.removeprefix("SIGNAL.") for k in MAP_KEYS if k.table == "signals")
_TIME_KEYS = tuple(k.name for k in MAP_KEYS if k.table == "time")
_CSV_KEYS = tuple(k.name for k in MAP_KEYS if k.table == "csv")
_CLOCK_KEYS = tuple(k.name for k in MAP_KEYS if k.table == _CLOCK)


def load_signal_map(path: Path) -> SignalMap:
    """Read and check a signal map.

    Raises
    ------
    ConfigError
        With all faults of the file in one message.
    """
    document, text = load_toml(path, what="signal map")
    faults = Faults(path, text)
    for name in document:
        if name not in _TABLES:
            faults.unknown(name, _TABLES)
    entries = {}
    for symbol, table in _table(document, "signals", faults).items():
        if symbol not in SYMBOLS and symbol not in ACCEPTED:
            faults.unknown(symbol, [*SYMBOLS, *ACCEPTED])
            continue
        entry = _entry(symbol, table, faults)
        if entry is not None:
            entries[symbol] = entry
    clocks = {name: _clock(name, t, faults) for name, t in _table(document, "sources", faults).items()}
    time = _table(document, "time", faults)
    for key in time:
        if key not in _TIME_KEYS:
            faults.unknown(key, _TIME_KEYS)
    channel = time.get("channel")
    if channel is not None and not isinstance(channel, str):
        faults.add("channel", f"[time] channel = {str(channel)[:40]} is not a name")
    unit = time.get("unit")
    if unit is not None and not (isinstance(unit, str) and is_unit(unit) and parse_unit(unit).dimension == "time"):
        faults.add("unit", f"[time] unit = {str(unit)[:40]!r} is no unit of time; use s, ms, us or ns")
    csv = _csv(_table(document, "csv", faults), faults)
    faults.raise_if_any()
    return SignalMap(entries, clocks, channel, unit, str(path), csv)


def _table(document: dict[str, Any], name: str, faults: Faults) -> dict[str, Any]:
    table = document.get(name, {})
    if isinstance(table, dict):
        return table
    faults.add(name, f"{name} is not a table")
    return {}


def _csv(table: dict[str, Any], faults: Faults) -> dict[str, CsvFormat]:
    """Return the format of CSV files: of those that are named or match a pattern, and of all others (`*`)."""
    common = {k: v for k, v in table.items() if not isinstance(v, dict)}
    found = {}
    for name, own in (*((k, v) for k, v in table.items() if isinstance(v, dict)), ("*", common)):
        for key, value in own.items():
            if key not in _CSV_KEYS:
                faults.unknown(key, _CSV_KEYS)
            elif fault := format_fault(key, value):
                faults.add(key, f"[csv] {fault}")
        if own:
            found[name] = CsvFormat.of({k: str(v) for k, v in {**common, **own}.items()})
    return found


def _entry(symbol: str, table: Any, faults: Faults) -> Entry | None:
    if isinstance(table, str):
        table = {"channel": table}
    if not isinstance(table, dict) or "channel" not in table:
        faults.add(symbol, f'{symbol} names no channel; expected {symbol} = {{ channel = "..." }}')
        return None
    for key in table:
        if key not in _ENTRY_KEYS:
            faults.unknown(key, _ENTRY_KEYS)
    channel = table["channel"]
    names = tuple(channel) if isinstance(channel, list) else (channel,)
    if not names or not all(isinstance(n, str) and n for n in names):
        faults.add(symbol, f"{symbol}: channel = {channel!r} is not a name or a list of names")
        return None
    unit = table.get("unit")
    if unit is not None and not is_unit(str(unit)):
        faults.add(symbol, f'{symbol}: unknown unit "{unit}"')
        return None
    big = 1e12
    scale = faults.number({"scale": table.get("scale", 1.0)}, "scale", low=-big, high=big, unit="")
    offset = faults.number({"offset": table.get("offset", 0.0)}, "offset", low=-big, high=big, unit="")
    invalid = table.get("invalid", [])
    if not isinstance(invalid, list) or not all(is_number(i) for i in invalid):
        faults.add(symbol, f"{symbol}: invalid = {str(invalid)[:40]} is not a list of numbers")
        return None
    if scale is None or offset is None:
        return None
    if scale == 0.0:
        faults.add(symbol, f"{symbol}: scale = 0 would erase the signal")
    return Entry(symbol, names, None if unit is None else str(unit), scale, offset, tuple(float(i) for i in invalid))


def _clock(name: str, table: Any, faults: Faults) -> SourceClock:
    if not isinstance(table, dict):
        faults.add(name, f"sources.{name} is not a table")
        return SourceClock()
    for key in table:
        if key not in _CLOCK_KEYS:
            faults.unknown(key, _CLOCK_KEYS)
    offset = faults.number({"offset_s": table.get("offset_s", 0.0)}, "offset_s", low=-1e10, high=1e10, unit="s")
    drift = faults.number({"drift_ppm": table.get("drift_ppm", 0.0)}, "drift_ppm", low=-1e5, high=1e5, unit="ppm")
    at = faults.number({"at_s": table.get("at_s", 0.0)}, "at_s", low=-1e10, high=1e10, unit="s")
    return SourceClock(offset or 0.0, drift or 0.0, at or 0.0)


def map_text(signal_map: SignalMap, *, comments: Iterable[str] = (), remarks: Mapping[str, str] | None = None) -> str:
    """Return the TOML text of a signal map, with remarks behind its lines; reading it again gives the same map."""
    remarks = remarks or {}
    lines = [f"# {_one_line(c)}" for c in comments]
    if signal_map.time_channel or signal_map.time_unit:
        lines.append("[time]")
        if signal_map.time_channel:
            lines.append(f"channel = {_quote(signal_map.time_channel)}")
        if signal_map.time_unit:
            lines.append(f"unit = {_quote(signal_map.time_unit)}")
        lines.append("")
    for name, form in signal_map.csv.items():
        lines.append("[csv]" if name == "*" else f"[csv.{_quote(name)}]")
        lines += [f"{key} = {_quote(value)}" for key in _CSV_KEYS if (value := getattr(form, key))]
        lines.append("")
    lines.append("[signals]")
    for symbol, entry in signal_map.entries.items():
        remark = f"  # {_one_line(remarks[symbol])}" if symbol in remarks else ""
        lines.append(f"{symbol} = {_entry_text(entry)}{remark}")
    for name, clock in signal_map.clocks.items():
        lines += ["", f"[sources.{_quote(name)}]", f"offset_s = {clock.offset_s!r}"]
        if clock.drift_ppm or clock.at_s:
            lines += [f"drift_ppm = {clock.drift_ppm!r}", f"at_s = {clock.at_s!r}"]
    return "\n".join(lines) + "\n"


def _one_line(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)


def _quote(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")  # a JSON string is a TOML basic string


def _entry_text(entry: Entry) -> str:
    names = [_quote(c) for c in entry.channel]
    parts = [f"channel = {names[0]}" if len(names) == 1 else f"channel = [{', '.join(names)}]"]
    if entry.unit is not None:
        parts.append(f"unit = {_quote(entry.unit)}")
    if entry.scale != 1.0:
        parts.append(f"scale = {entry.scale!r}")
    if entry.offset != 0.0:
        parts.append(f"offset = {entry.offset!r}")
    if entry.invalid:
        parts.append(f"invalid = [{', '.join(repr(i) for i in entry.invalid)}]")
    return "{ " + ", ".join(parts) + " }"
