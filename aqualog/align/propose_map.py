"""Propose one signal map for several drives, or for one.

One or two drives of each set of loggers and channels are looked at, and the proposals are joined: channels that bear
other names in other drives become a list in order of preference. What one map cannot express is reported.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from aqualog.align.mapping import OF_SEPARATE_DRIVES, Entry, SignalMap, matching, separate_drives
from aqualog.align.propose import CANONICAL, NOT_A_VALUE, Proposal, look_at, words_of
from aqualog.core.errors import AqualogError, listed
from aqualog.core.notation import WHEELS
from aqualog.core.records import ChannelInfo
from aqualog.core.units import is_unit, parse_unit
from aqualog.io.open_log import DriveLog
from aqualog.io.reader import ReadOptions

__all__ = [
    "LogFile", "MapProposal", "check_one_drive", "lacking_notes", "measures_wheels", "propose_signals",
    "unmapped_names",
]  # fmt: skip

MOST_MISSING = 0.1  # share of drives that may lack a signal that the map names: those drives cannot be used then


@dataclass(frozen=True, slots=True)
class LogFile:
    """A readable log; `name` is what messages call it, such as its path below a folder, with /."""

    path: Path
    name: str
    channels: tuple[ChannelInfo, ...]

    @property
    def signature(self) -> frozenset[tuple[str, str]]:
        """Names and units of its channels."""
        return frozenset((c.path, c.unit) for c in self.channels)


_Files = Sequence[LogFile]  # of one drive
_Kinds = Mapping[tuple[frozenset[tuple[str, str]], ...], Sequence[_Files]]  # drives by their sets of channels


@dataclass(frozen=True, slots=True)
class MapProposal:
    """A map for all drives. `needed`: whether a map is needed; not if all channels have canonical names.

    `left_out` maps signals that only some drives hold to the reason; `notes` are differences between drives;
    `unmapped` are the channels, `name [unit]`, that are no signal.
    """

    signal_map: SignalMap
    remarks: Mapping[str, str]
    left_out: Mapping[str, str]
    notes: tuple[str, ...]
    found: tuple[str, ...]
    unmapped: tuple[str, ...] = ()

    @property
    def needed(self) -> bool:
        """Whether a drive needs the map."""
        return bool(self.signal_map.entries)


def measures_wheels(log: LogFile, options: ReadOptions | None = None) -> bool:
    """Whether a file holds wheel speeds; False where it cannot be read."""
    try:
        proposals = _proposals((log,), options)[0]
    except AqualogError:
        return False
    return any(f"omega_{w}" in proposals for w in WHEELS)


def propose_signals(
    drives: Sequence[Sequence[LogFile]], options: ReadOptions | None = None,
    report: Callable[[str], None] = lambda _: None, *, most_missing: float = MOST_MISSING,
) -> MapProposal:  # fmt: skip
    """Propose the map, from the data of up to two drives of each set of channels.

    Parameters
    ----------
    drives : sequence of sequences of LogFile
        The files of each drive.
    options : ReadOptions, optional
    report : callable
        Called with each step.
    most_missing : float
        Share of the drives that may lack a signal of the map.
    """
    kinds: dict[tuple[frozenset[tuple[str, str]], ...], list[_Files]] = {}
    for files in drives:
        kinds.setdefault(tuple(f.signature for f in files), []).append(files)
    notes: list[str] = []
    proposed: list[dict[str, Proposal]] = []
    by_size = sorted(kinds.values(), key=lambda members: -len(members))
    for number, members in enumerate(by_size[:12], 1):
        report(f"looking for signals in {number} of {len(kinds)} sets of channels")
        best: dict[str, Proposal] = {}
        for files in (members[len(members) // 2], members[0])[: len(members)]:
            try:
                found, remarks = _proposals(files, options)
            except AqualogError as error:
                notes.append(f"{files[0].name}: {error.what}")
                continue
            notes += remarks
            if len(found) > len(best):
                best = found
        proposed.append(best)
    if len(kinds) > 1:
        sizes = ", ".join(f"{len(k)} as {k[0][0].name}" for k in by_size[:5])
        more = f" and {len(kinds) - 5} sets more" if len(kinds) > 5 else ""
        notes.append(f"the drives have {len(kinds)} different sets of channels; {sizes}{more}")
    return _joined(proposed, drives, kinds, most_missing, notes)


def _proposals(files: _Files, options: ReadOptions | None) -> tuple[dict[str, Proposal], list[str]]:
    """Return the proposed signals of one drive, and remarks on their channels."""
    with DriveLog([f.path for f in files], options) as log:
        channels = list(log.read(log.channels()).values())
    found, proposals = look_at(channels)
    remarks = {(v.file, v.path): v.remark for v in found if v.remark}
    odd = []
    for proposal in proposals.values():
        hits = matching([c.info for c in channels], proposal.entry.channel[0])
        remark = remarks.get((hits[0].file, hits[0].path), "") if hits else ""
        if remark and "constant" not in remark:
            odd.append(f"{proposal.entry.channel[0]}: {remark}")
    return proposals, odd


def _joined(
    proposed: Sequence[dict[str, Proposal]], drives: Sequence[_Files], kinds: _Kinds, most_missing: float,
    notes: list[str],
) -> MapProposal:  # fmt: skip
    entries: dict[str, Entry] = {}
    remarks: dict[str, str] = {}
    left_out: dict[str, str] = {}
    found: list[str] = []
    absent: dict[str, list[str]] = {}
    for symbol in dict.fromkeys(s for p in proposed for s in p):
        own = [p[symbol] for p in proposed if symbol in p]
        # a channel with the canonical name by that name alone, whatever group it stands in
        by_name = [replace(p.entry, channel=(symbol,)) if p.reason == CANONICAL else p.entry for p in own]
        entry = _one_entry(symbol, by_name, notes)
        lacking, doubled = _without(entry, drives, kinds)
        is_rare = len(lacking) > most_missing * len(drives) and not symbol.startswith("omega_")
        if is_rare and not _is_canonical(symbol, entry):
            left_out[symbol] = f"{_entry_words(entry)}: not in {_some(lacking)}"
            continue
        if lacking:
            mapped = "" if _is_canonical(symbol, entry) else "; a drive that lacks a mapped channel fails"
            absent.setdefault(f"not in {_some(lacking)}{mapped}", []).append(symbol)
        if doubled:
            notes.append(f"{symbol}: {_entry_words(entry)} stands for several channels in {_some(doubled)}")
        found.append(symbol)
        if not _is_canonical(symbol, entry):
            entries[symbol] = entry
            remarks[symbol] = own[0].remark
    notes += [f"{', '.join(symbols)}: {told}" for told, symbols in absent.items()]
    unmapped = _unmapped(kinds, [e.channel for e in entries.values()] + [(s,) for s in found if s not in entries])
    notes[:0] = lacking_notes([*found, *left_out], unmapped)
    return MapProposal(SignalMap(entries), remarks, left_out, tuple(dict.fromkeys(notes)), tuple(found), unmapped)


def check_one_drive(channels: Iterable[tuple[str, str]], proposals: Iterable[Proposal], apart: str = "") -> None:
    """Raise a SignalError if several files bear the same names: (file, path) of all channels, and what is proposed.

    `apart`: why files with the same channels are not one recording.
    """
    files: dict[str, set[str]] = {}
    for file, path in channels:
        files.setdefault(path, set()).add(file)
    names = [p.entry.channel[0] for p in proposals]
    doubled = [n for n in names if any(len(files.get(x, ())) > 1 for x in (n, n.partition(":")[2]))]
    if len(doubled) >= OF_SEPARATE_DRIVES:
        raise separate_drives(len(doubled), sorted(set().union(*files.values())), apart)


def lacking_notes(found: Collection[str], unmapped: Sequence[str]) -> list[str]:
    """Return sentences on the signals that a drive lacks, by the symbols that are found; the gravest first."""
    notes = []
    missing = [f"omega_{w}" for w in WHEELS if f"omega_{w}" not in found]
    if missing:
        notes.append(f"no channel looks like {', '.join(missing)}: aquaplaning cannot be detected without")
    if not any(s.startswith("torque_") for s in found):
        torques = (n for n, dimension in _dimensions(unmapped) if dimension == "torque")
        motors = [n for n in torques if MOTOR & set(words_of(n.partition(" [")[0]))]
        own = f": {', '.join(motors[:3])}" if motors else ""
        notes.append(
            f"no torque of wheels or axles: traction and slip slope need one (a driveline torque with its scale{own})"
        )

    if "v_x" not in found:
        notes.append(f"no v_x: slip refers to the free wheels, not to the road{_speed_hint(unmapped)}")
    return notes


def _speed_hint(unmapped: Sequence[str]) -> str:
    """Name the channels, `name [unit]`, that may be the speed over ground: those with a unit of speed first."""
    speeds, bare = [], []
    for name, dimension in _dimensions(unmapped):
        words = set(words_of(name.partition(" [")[0]))
        if not {"speed", "velocity", "spd", "geschwindigkeit"} & words or (_NO_ROAD_SPEED | NOT_A_VALUE) & words:
            continue
        if dimension == "speed":
            speeds.append(name)
        elif not dimension:
            bare.append(name)
    if speeds:
        return f"; {', '.join(speeds[:3])} may be it: map it if it is not made from the wheels"
    return f"; {', '.join(bare[:3])} may be it, but the file gives no unit: map it with its unit" if bare else ""


def _dimensions(channels: Sequence[str]) -> list[tuple[str, str]]:
    """Each `name [unit]` with the dimension of its unit: empty where it has none, `?` where none knows it."""
    units = [(n, n.removesuffix("]").partition(" [")[2]) for n in channels]
    return [(n, "" if not u else parse_unit(u).dimension if is_unit(u) else "?") for n, u in units]


MOTOR = {"motor", "mot", "engine", "eng", "machine", "antrieb"}
"""Words of a motor's channels."""
_NO_ROAD_SPEED = {
    "wheel", "whl", "engine", "fan", "wind", "accuracy", "limit", "motor", "rad", "set", "cruise", "ui", "steer",
}  # fmt: skip


def _unmapped(kinds: _Kinds, mapped: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
    """Channels of any drive that no name of the map means."""
    return tuple(dict.fromkeys(n for members in kinds.values() for n in unmapped_names(
        [c for f in members[0] for c in f.channels], mapped
    )))  # fmt: skip


def unmapped_names(infos: Sequence[ChannelInfo], mapped: Iterable[Sequence[str]]) -> list[str]:
    """Return `name [unit]` of the channels that no name of a map means; the path where the name alone is doubtful.

    Parameters
    ----------
    infos : sequence of ChannelInfo
        All channels of one drive.
    mapped : iterable of sequences of str
        Names of each signal's channel; of several the first that hits is the one that is read.
    """
    used: set[tuple[str, str]] = set()
    for wanted in mapped:
        hits = next(filter(None, (matching(infos, name) for name in wanted)), [])
        used |= {(c.file, c.path) for c in hits}
    names = Counter(c.name for c in infos)
    rest = [i for i in infos if (i.file, i.path) not in used]
    shown = [i.name if names[i.name] == 1 else i.path for i in rest]
    return [f"{name} [{i.unit}]" if i.unit else name for name, i in zip(shown, rest, strict=True)]


def _is_canonical(symbol: str, entry: Entry) -> bool:
    return entry.channel == (symbol,) and entry.scale == 1.0


def _one_entry(symbol: str, proposals: Sequence[Entry], notes: list[str]) -> Entry:
    """One line for the drives of all kinds; the most frequent kind decides where one map cannot express two."""
    first = proposals[0]
    channels = list(first.channel)
    unit = first.unit
    for entry in proposals[1:]:
        new = [c for c in entry.channel if c not in channels]
        if not new and (entry.unit, entry.scale) == (first.unit, first.scale):
            continue
        # without a unit in the map each file's own is taken
        if entry.scale != first.scale or not all(e is None or is_unit(e) for e in (entry.unit, unit)):
            notes.append(f"{symbol}: {_entry_words(entry)} would need another scale or unit than {_entry_words(first)}")
            continue
        if entry.unit != unit:
            unit = None
        channels += new
    return replace(first, channel=tuple(channels), unit=None if channels == [symbol] else unit)


def _entry_words(entry: Entry) -> str:
    scale = f" * {entry.scale:g}" if entry.scale != 1.0 else ""
    return f"{' or '.join(entry.channel)}{f' [{entry.unit}]' if entry.unit else ''}{scale}"


def _without(entry: Entry, drives: Sequence[_Files], kinds: _Kinds) -> tuple[list[_Files], list[_Files]]:
    """Drives without any channel of an entry, and those in which its name is not unique."""
    hits = {}
    for kind, members in kinds.items():
        infos = [c for f in members[0] for c in f.channels]
        hits[kind] = len(next((m for name in entry.channel if (m := matching(infos, name))), []))
    counts = [hits[tuple(f.signature for f in files)] for files in drives]
    lacking = [files for files, n in zip(drives, counts, strict=True) if n == 0]
    return lacking, [files for files, n in zip(drives, counts, strict=True) if n > 1]


def _some(drives: Sequence[_Files]) -> str:
    names = listed([files[0].name for files in drives], 3)
    return f"{len(drives)} drive{'' if len(drives) == 1 else 's'} ({names})"
