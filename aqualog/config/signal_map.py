"""Read and write signal maps as TOML."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from functools import partial
from pathlib import Path

from aqualog.align.mapping import EACH_ITS_OWN, Entry, SignalMap, SourceClock, entry_line, quoted, read_alike
from aqualog.config.reader import Faults, Key, Table, is_number, read
from aqualog.core.errors import listed
from aqualog.core.notation import ACCEPTED, SYMBOLS
from aqualog.core.units import is_unit, parse_unit
from aqualog.io.reader import CsvFormat, format_fault

__all__ = ["MAP_KEYS", "check_files", "load_signal_map", "map_text"]

_CLOCK = 'sources."FILE"'
MAP_KEYS = (
    Key("signals", "SIGNAL.channel", "text or list", "", "", "name of the channel, or names in order of "
            "preference; must be given; `SIGNAL = \"name\"` is short for it"),
    Key("signals", "SIGNAL.unit", "text", "", "the file's", "unit of the raw values, in place of the file's"),
    Key("signals", "SIGNAL.scale", "number", "", "1", "factor on the SI value; a negative one turns the sign",
        -1e12, 1e12),
    Key("signals", "SIGNAL.offset", "number", "SI", "0", "added after scaling", -1e12, 1e12),
    Key("signals", "SIGNAL.invalid", "list of numbers", "", "[]", "raw values that mean \"no value\""),
    Key("time", "channel", "text", "", "", "the column that holds the time"),
    Key("time", "unit", "text", "", "", "its unit: s, ms, us, ns, min or h"),
    Key("csv", "separator", "text", "", "found", "one sign, or `tab`, `comma`, `semicolon`, `space`; in "
            "`[csv.\"PATTERN\"]` for the files of that name alone"),
    Key("csv", "decimal", "text", "", "found", "`.` or `,`"),
    Key("csv", "encoding", "text", "", "found", "an encoding that Python knows, `cp1252`"),
    Key(_CLOCK, "offset_s", "number", "s", "0", "by how much the clock of this file is late; the name may be a "
            "pattern", -1e10, 1e10),
    Key(_CLOCK, "drift_ppm", "number", "ppm", "0", "by how much it runs fast", -1e5, 1e5),
    Key(_CLOCK, "at_s", "number", "s", "0", "stamp of the file's own clock at which the offset holds", -1e10, 1e10),
)  # fmt: skip
"""Every key of a signal map."""

_LONGEST = 60  # characters of a name that are shown

_TABLES = ("signals", "time", "csv", "sources")
_ENTRY_KEYS = tuple(k.name.removeprefix("SIGNAL.") for k in MAP_KEYS if k.table == "signals")
_NUMBERS = {n: k for n, k in zip(_ENTRY_KEYS, MAP_KEYS, strict=False) if k.kind == "number"}
_TIME_KEYS = tuple(k.name for k in MAP_KEYS if k.table == "time")
_CSV_KEYS = tuple(k.name for k in MAP_KEYS if k.table == "csv")
_CLOCK_KEYS = {k.name: k for k in MAP_KEYS if k.table == _CLOCK}


def load_signal_map(path: Path) -> SignalMap:
    """Read and check a signal map.

    Raises
    ------
    ConfigError
        With all faults of the file in one message.
    """
    file = read(path, "signal map")
    file.check_names(*_TABLES)
    signals, sources, time = (file.table(name) for name in ("signals", "sources", "time"))
    entries: dict[str, Entry] = {}
    for symbol in signals.values:
        if symbol not in SYMBOLS and symbol not in ACCEPTED:
            signals.unknown(symbol, [*SYMBOLS, *ACCEPTED])
            continue
        entry = _entry(signals, symbol)
        if entry is None:
            continue
        if twice := next((e for e in entries.values() if e.channel == entry.channel and read_alike(e, entry)), None):
            at = signals.line_of(twice.symbol)
            signals.add(
                symbol,
                f'{symbol} names channel "{entry.channel[0]}", as {twice.symbol} does{f" in line {at}" if at else ""}; '
                f"{EACH_ITS_OWN}",
            )
        entries[symbol] = entry
    clocks = {}
    for name in sources.values:
        values = sources.table(name).numbers(_CLOCK_KEYS)
        clocks[name] = SourceClock(**values)
    time.check_names(*_TIME_KEYS)
    channel = time.get("channel")
    if channel is not None and not isinstance(channel, str):
        time.add("channel", f"[time] channel = {str(channel)[:40]} is not a name")
    unit = time.get("unit")
    if unit is not None and not (isinstance(unit, str) and is_unit(unit) and parse_unit(unit).dimension == "time"):
        time.add("unit", f"[time] unit = {str(unit)[:40]!r} is no unit of time; use s, ms, us or ns")
    csv = _csv(file.table("csv"))
    file.faults.raise_if_any()
    return SignalMap(entries, clocks, channel, unit, str(path), csv)


def check_files(signal_map: SignalMap, files: Iterable[Path]) -> None:
    """Refuse a map with a table `[sources."NAME"]` or `[csv."NAME"]` that fits none of the files: it would do nothing.

    Parameters
    ----------
    files : iterable of Path
        All logs that are read with this map.

    Raises
    ------
    ConfigError
        With line and nearest name of each such table.
    """
    names = sorted({f.name for f in files})
    idle = signal_map.unmatched(names)
    if not idle or not names:
        return
    path = Path(signal_map.path or "signal map")
    file = read(path, "signal map") if path.is_file() else Table({}, Faults(path), lines=[])
    for table, name in idle:
        shown = f"{name[:_LONGEST]} ..." if len(name) > _LONGEST else name
        near = get_close_matches(name, names, n=1, cutoff=0.6)  # a suffix alone is no likeness
        told = f' (did you mean "{near[0]}"?)' if near else f"; the files are {listed(names, 4)}"
        at = file.line_of(f"{table}.{name}") or file.table(table).line_of(name)
        file.faults.add(f'[{table}."{shown}"] fits no file{told}', partial(int, at) if at else lambda: None)
    file.faults.raise_if_any()


def _csv(table: Table) -> dict[str, CsvFormat]:
    """Return the format of CSV files: of those that are named or match a pattern, and of all others (`*`)."""
    common = {k: v for k, v in table.values.items() if not isinstance(v, dict)}
    found = {}
    for name in (*(k for k, v in table.values.items() if isinstance(v, dict)), "*"):
        own = table.child("", common) if name == "*" else table.table(name)
        place = table if name == "*" else own
        for key, value in own.values.items():
            if key not in _CSV_KEYS:
                place.unknown(key, _CSV_KEYS)
            elif fault := format_fault(key, value):
                place.add(key, f"[csv] {fault}")
        if own.values:
            found[name] = CsvFormat.of({k: str(v) for k, v in {**common, **own.values}.items()})
    return found


def _entry(signals: Table, symbol: str) -> Entry | None:
    given = signals.get(symbol)
    table = signals.child(symbol, {"channel": given} if isinstance(given, str) else given)
    if not isinstance(table.values, dict) or "channel" not in table:
        signals.add(symbol, f'{symbol} names no channel; expected {symbol} = {{ channel = "..." }}')
        return None
    numbers = table.numbers(_NUMBERS, *_ENTRY_KEYS)
    channel = table.get("channel")
    names = tuple(channel) if isinstance(channel, list) else (channel,)
    if not names or not all(isinstance(n, str) and n for n in names):
        signals.add(symbol, f"{symbol}: channel = {channel!r} is not a name or a list of names")
        return None
    unit = table.get("unit")
    if unit is not None and not is_unit(str(unit)):
        signals.add(symbol, f'{symbol}: unknown unit "{unit}"')
        return None
    invalid = table.get("invalid", [])
    if not isinstance(invalid, list) or not all(is_number(i) for i in invalid):
        signals.add(symbol, f"{symbol}: invalid = {str(invalid)[:40]} is not a list of numbers")
        return None
    if numbers.get("scale") == 0.0:
        signals.add(symbol, f"{symbol}: scale = 0 would erase the signal")
    unit = None if unit is None else str(unit)
    return Entry(
        symbol, names, unit, **numbers, invalid=tuple(float(i) for i in invalid), line=signals.line_of(symbol) or 0
    )


def map_text(
    signal_map: SignalMap, *, comments: Iterable[str] = (), remarks: Mapping[str, str] | None = None,
    unmapped: Sequence[str] = (), waiting: Iterable[str] = (),
) -> str:  # fmt: skip
    """Return the TOML text of a signal map; reading it again gives the same map.

    `comments` stand at its head, `remarks` behind the lines of their signals, `unmapped` channels at its end. `waiting`
    are lines that wait for a value, as comments among the signals: what follows their closing brace stands above.
    """
    remarks = remarks or {}
    lines = [f"# {_one_line(c)}" for c in comments]
    if signal_map.time_channel or signal_map.time_unit:
        lines.append("[time]")
        if signal_map.time_channel:
            lines.append(f"channel = {quoted(signal_map.time_channel)}")
        if signal_map.time_unit:
            lines.append(f"unit = {quoted(signal_map.time_unit)}")
        lines.append("")
    for name, form in signal_map.csv.items():
        lines.append("[csv]" if name == "*" else f"[csv.{quoted(name)}]")
        lines += [f"{key} = {quoted(value)}" for key in _CSV_KEYS if (value := getattr(form, key))]
        lines.append("")
    lines.append("[signals]")
    for symbol, entry in signal_map.entries.items():
        remark = f"  # {_one_line(remarks[symbol])}" if symbol in remarks else ""
        lines.append(f"{entry_line(entry)}{remark}")
    for line in waiting:
        entry_text, _, why = line.partition("}: ")
        lines += [f"# {_one_line(why)}", f"# {_one_line(entry_text)}}}"]
    for name, clock in signal_map.clocks.items():
        lines += ["", f"[sources.{quoted(name)}]", f"offset_s = {clock.offset_s!r}"]
        if clock.drift_ppm or clock.at_s:
            lines += [f"drift_ppm = {clock.drift_ppm!r}", f"at_s = {clock.at_s!r}"]
    if unmapped:
        lines += ["", f"# not mapped, {len(unmapped)} channels:"]
        lines += [f"#   {_one_line(name)}" for name in unmapped]
    return "\n".join(lines) + "\n"


def _one_line(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)
