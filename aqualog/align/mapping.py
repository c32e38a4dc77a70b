"""Which channel is which signal, as data and not as code."""

from __future__ import annotations

import difflib
import json
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase

from aqualog.core.errors import ConfigError, SignalError, listed
from aqualog.core.notation import ACCEPTED, SYMBOLS, WHEELS
from aqualog.core.records import ChannelInfo
from aqualog.core.vehicle import Vehicle
from aqualog.io.reader import CsvFormat

__all__ = [
    "EACH_ITS_OWN", "MAP_HINT", "OF_SEPARATE_DRIVES", "Entry", "SignalMap", "SourceClock", "align_command",
    "channel_id", "entry_line", "map_text", "matching", "quoted", "read_alike", "resolve", "separate_drives",
    "values_read",
]  # fmt: skip


MAP_HINT = "`aqualog init LOG -o FOLDER` writes a signal map; then the log with --signals FOLDER/map.toml"
"""What to try where signals are missing and there is no map."""

EACH_ITS_OWN = "name one channel each in a signal map; `aqualog inspect LOG` lists them"
"""What to try where signals and channels do not go together one by one."""

OTHER_FILES = "the folder, if its files are one drive; else another map; `aqualog inspect LOG` lists the channels"
"""What to try where a file lacks much of what the map names."""

SHOWN = 2  # missing channels that are shown with what the file has


@dataclass(frozen=True, slots=True)
class Entry:
    """One line of a signal map: SI value = scale * to_SI(raw) + offset.

    `channel` may be a list in order of preference. `unit` overrides what the file says. `invalid` are raw values that
    mean "no value" (error codes). `line`: where it stands in its file; 0 if it stands in none.
    """

    symbol: str
    channel: tuple[str, ...]
    unit: str | None = None
    scale: float = 1.0
    offset: float = 0.0
    invalid: tuple[float, ...] = ()
    line: int = field(default=0, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class SourceClock:
    """Correction of one source's clock: t = t_file - offset_s - drift_ppm * 1e-6 * (t_file - at_s).

    A positive offset means that the source is late. `at_s` is the stamp on the file's own clock for which the offset
    holds; it matters only with a drift.
    """

    offset_s: float = 0.0
    drift_ppm: float = 0.0
    at_s: float = 0.0


@dataclass(frozen=True, slots=True)
class SignalMap:
    """A signal map; the empty map accepts canonical names only. A drive may lack the signals in `optional`."""

    entries: Mapping[str, Entry] = field(default_factory=dict)
    clocks: Mapping[str, SourceClock] = field(default_factory=dict)
    time_channel: str | None = None
    time_unit: str | None = None
    path: str = ""
    csv: Mapping[str, CsvFormat] = field(default_factory=dict)
    optional: frozenset[str] = frozenset()

    @property
    def hint(self) -> str:
        """What to try where signals are missing."""
        named = "`aqualog inspect LOG` lists what the log has; the signal map must name these"
        return named if self.entries else MAP_HINT

    def clock_of(self, file: str) -> SourceClock:
        """Return the clock correction of a file, by name or glob pattern."""
        return next((c for pattern, c in self.clocks.items() if _names(pattern, file)), SourceClock())

    def unmatched(self, files: Iterable[str]) -> list[tuple[str, str]]:
        """Return table and name of all that the map says of files, as `("sources", "gps.csv")`, and fits none."""
        names = list(files)
        clocks = [("sources", n) for n in self.clocks if not any(_names(n, f) for f in names)]
        forms = [("csv", n) for n in self.csv if n != "*" and not any(fnmatchcase(f, n) for f in names)]
        return [*forms, *clocks]

    def joins(self, file: str) -> bool:
        """Return whether the map gives the offset of this file's clock."""
        return any(_names(pattern, file) for pattern in self.clocks)


def _names(pattern: str, file: str) -> bool:
    return fnmatchcase(file, pattern) or file.rsplit(".", 1)[0] == pattern


def align_command(logs: Sequence[str], map_path: str = "", dbc: Sequence[str] = ()) -> str:
    """Return what to type where the clocks of files of one drive disagree; `dbc` are those the logs were read with."""
    signals = f" --signals {shlex.quote(map_path)}" if map_path else ""
    signals += "".join(f" --dbc {shlex.quote(d)}" for d in dbc)
    out = "clocks.toml" if map_path.endswith("map.toml") else "map.toml"
    return (
        f"`aqualog align {' '.join(shlex.quote(log) for log in logs)}{signals} --write-map {out}`, "
        f"then the command again with --signals {out}"
    )


def entry_line(entry: Entry) -> str:
    """Return an entry as a line of a signal map (TOML): `a_y = { channel = "LatAcc", scale = -1.0 }`."""
    names = [quoted(c) for c in entry.channel]
    parts = [f"channel = {names[0]}" if len(names) == 1 else f"channel = [{', '.join(names)}]"]
    if entry.unit is not None:
        parts.append(f"unit = {quoted(entry.unit)}")
    if entry.scale != 1.0:
        parts.append(f"scale = {entry.scale!r}")
    if entry.offset != 0.0:
        parts.append(f"offset = {entry.offset!r}")
    if entry.invalid:
        parts.append(f"invalid = [{', '.join(repr(i) for i in entry.invalid)}]")
    return f"{entry.symbol} = {{ {', '.join(parts)} }}"


def quoted(text: str) -> str:
    """Return a text as TOML writes it."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")  # a JSON string is a TOML basic string


def channel_id(info: ChannelInfo) -> str:
    """Return `file:path`, unique within a drive of several files."""
    return f"{info.file}:{info.path}"


def map_text(signal_map: SignalMap) -> str:
    """Return all of a map that signals depend on, for keys. Order counts: the first pattern that fits a clock holds."""
    entries, clocks = tuple(signal_map.entries.items()), tuple(signal_map.clocks.items())
    return repr((entries, clocks, signal_map.time_channel, signal_map.time_unit, tuple(signal_map.csv.items())))


def values_read(vehicle: Vehicle) -> tuple[float, ...]:
    """Return all of a vehicle that its signals depend on, for keys: radii [m], steering ratio, torque gain."""
    return (*(vehicle.r_e(w) for w in WHEELS), vehicle.steering_ratio, vehicle.torque_gain)


_SHARED = ("pressure_", "water_depth")
"""Signals of which one measured value may stand for both wheels, or both sides."""


def read_alike(one: Entry, other: Entry) -> bool:
    """Return whether two entries would give one channel twice: at the same scale, and not as one value for both wheels.

    Such a line is a slip: wheels that never differ. Two of one kind, as `omega_fl` and `omega_fr`, are one at any scale
    or unit. Axles may share a torque by a scale, each a part of it.
    """
    if one.symbol.startswith("torque_") and other.symbol.startswith("torque_"):
        is_pair = len(one.symbol) == len(other.symbol) == len("torque_fl") and one.symbol[7] == other.symbol[7]
        return not is_pair and (one.unit, one.scale) == (other.unit, other.scale) and one.scale == 1.0
    if any(one.symbol.startswith(s) and other.symbol.startswith(s) for s in _SHARED):
        return False
    return one.symbol[:-2] == other.symbol[:-2] or (one.unit, one.scale) == (other.unit, other.scale)


def resolve(
    channels: Sequence[ChannelInfo], signal_map: SignalMap, apart: str = ""
) -> dict[str, tuple[Entry, ChannelInfo]]:
    """Find the channel of every mapped symbol, and of every canonical name that needs no map.

    A map entry matches a channel by `file:path`, by path, by the end of a path after a separator, or by name. It must
    match exactly one channel. `apart`: why files with the same channels are not one recording.

    Raises
    ------
    SignalError
        If a mapped channel is missing or ambiguous; all faults in one message.
    ConfigError
        If two signals read one channel.
    """
    found: dict[str, tuple[Entry, ChannelInfo]] = {}
    faults: list[str] = []
    missing: list[str] = []
    doubled = 0
    if not channels:  # the reader knows why: one reason, not a fault for each line of the map
        return {}
    for symbol, entry in signal_map.entries.items():
        matches = next((m for m in (matching(channels, c) for c in entry.channel) if m), [])
        if len(matches) == 1:
            found[symbol] = (entry, matches[0])
        elif not matches and symbol not in signal_map.optional:
            missing.append(entry.channel[0])
            if len(missing) > SHOWN:
                continue
            faults.append(f"{_place(entry)}no channel {_quoted(entry.channel)}{_nearest(entry.channel, channels)}")
        elif matches:
            faults.append(f"{_place(entry)}channel {_quoted(entry.channel)} is ambiguous: {_listed(matches)}")
            doubled += len({m.file for m in matches}) > 1
    for symbol in (*SYMBOLS, *ACCEPTED):
        if symbol in signal_map.entries:
            continue
        matches = [c for c in channels if c.name == symbol]
        if len(matches) == 1:
            found[symbol] = (Entry(symbol, (matches[0].path,)), matches[0])
        elif len(matches) > 1:
            faults.append(f"{symbol}: several channels bear this name: {_listed(matches)}")
            doubled += len({m.file for m in matches}) > 1
    if doubled >= OF_SEPARATE_DRIVES:
        raise separate_drives(doubled, (c.file for c in channels), apart)
    if len(missing) > SHOWN:
        faults.append(f"{len(missing) - SHOWN} more of the map's channels are missing: {listed(missing[SHOWN:], 3)}")
    if faults:
        raise SignalError(
            "; ".join(faults), where=signal_map.path or (channels[0].file if channels else ""),
            hint=EACH_ITS_OWN if len(missing) <= SHOWN else OTHER_FILES,
        )  # fmt: skip
    _refuse_twice(found, signal_map)
    return found


def _refuse_twice(found: Mapping[str, tuple[Entry, ChannelInfo]], signal_map: SignalMap) -> None:
    """Raise ConfigError if two signals read the same channel, under whatever names."""
    by_channel: dict[str, list[Entry]] = {}
    for symbol, (entry, info) in found.items():
        same = by_channel.setdefault(channel_id(info), [])
        if (other := next((e for e in same if read_alike(e, entry)), None)) is not None:
            raise ConfigError(
                f"{other.symbol} and {symbol} read the same channel, {channel_id(info)}",
                where=signal_map.path or info.file, hint=EACH_ITS_OWN,
            )  # fmt: skip
        same.append(entry)


OF_SEPARATE_DRIVES = 3
"""Signals with one name in several files from which these are of separate drives."""


def separate_drives(names: int, files: Iterable[str], apart: str = "") -> SignalError:
    """Return the error for files whose channels bear the same names; `apart` says why they are not one recording."""
    return SignalError(
        f"several channels bear the same {names} names: these look like separate drives"
        + (f" ({apart})" if apart else ""),
        where=", ".join(dict.fromkeys(files)),
        expected="the files of ONE drive",
        hint="run them one by one, or all by `aqualog campaign init FOLDER` and `aqualog batch`",
    )


def matching(channels: Iterable[ChannelInfo], wanted: str) -> list[ChannelInfo]:
    """Return the channels that a name of the map may mean: the most specific kind of match with any hit."""
    listed = list(channels)
    for test in (
        lambda c: channel_id(c) == wanted,
        lambda c: c.path == wanted,
        lambda c: _ends_with_path(channel_id(c), wanted),
        lambda c: c.name == wanted,
    ):
        hits = [c for c in listed if test(c)]
        if hits:
            return hits
    return []


def _ends_with_path(path: str, wanted: str) -> bool:
    return path.endswith(wanted) and len(path) > len(wanted) and path[-len(wanted) - 1] in "./:"


def _place(entry: Entry) -> str:
    return f"{f'line {entry.line}: ' if entry.line else ''}{entry.symbol}: "


def _quoted(names: Sequence[str]) -> str:
    return " or ".join(f'"{n}"' for n in names)


def _listed(matches: Sequence[ChannelInfo]) -> str:
    return listed([channel_id(m) + (f" [{m.unit}]" if m.unit else "") for m in matches], 4)


def _nearest(wanted: Sequence[str], channels: Sequence[ChannelInfo]) -> str:
    names = sorted({c.path for c in channels} | {c.name for c in channels})
    near = difflib.get_close_matches(wanted[0], names, n=1, cutoff=0.5)
    if near:
        return f' (nearest: "{near[0]}")'
    files = listed(list(dict.fromkeys(c.file for c in channels)), 3)
    return f" in {files}, which has {listed(names, 6)}"
