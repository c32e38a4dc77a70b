"""One signal map for all drives of a folder.

A map is proposed for one or two drives of each set of loggers and channels, and the proposals are joined: channels that
bear other names in other drives become a list in order of preference. Differences that one map cannot express are
reported.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from aqualog.align.mapping import Entry, SignalMap, matching
from aqualog.align.overview import overview, rotated_channels
from aqualog.align.propose import Proposal, propose_map, words_of
from aqualog.campaign.propose_drives import Drive, LogFile
from aqualog.core.errors import AqualogError
from aqualog.core.notation import WHEELS
from aqualog.core.records import Channel
from aqualog.core.units import is_unit
from aqualog.io.base import ReadOptions
from aqualog.io.open_log import DriveLog

__all__ = ["MapProposal", "measures_wheels", "propose_signals"]

MOST_MISSING = 0.1  # share of drives that may lack a signal that the map names: those drives cannot be used then


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
    drives: Sequence[Drive], options: ReadOptions | None = None, report: Callable[[str], None] = lambda _: None
) -> MapProposal:
    """The map, from the data of up to two drives of each set of channels."""
    by_kind: dict[tuple[frozenset[tuple[str, str]], ...], list[Drive]] = {}
    for drive in drives:
        by_kind.setdefault(tuple(f.signature for f in drive.files), []).append(drive)
    kinds = sorted(by_kind.values(), key=lambda d: -len(d))
    notes: list[str] = []
    proposed: list[tuple[dict[str, Proposal], list[Drive]]] = []
    for number, members in enumerate(kinds[:12], 1):
        report(f"looking for signals in {number} of {len(kinds)} sets of channels")
        best: dict[str, Proposal] = {}
        for drive in (members[len(members) // 2], members[0])[: len(members)]:
            try:
                found, remarks = _proposals(drive.files, options)
            except AqualogError as error:
                notes.append(f"{drive.files[0].name}: {error.what}")
                continue
            notes += remarks
            if len(found) > len(best):
                best = found
        proposed.append((best, members))
    if len(kinds) > 1:
        notes.append(f"the drives have {len(kinds)} different sets of channels; {_sizes(kinds)}")
    return _joined(proposed, drives, notes)


def _sizes(kinds: Sequence[Sequence[Drive]]) -> str:
    parts = [f"{len(k)} as {k[0].files[0].name}" for k in kinds[:5]]
    return ", ".join(parts) + (f" and {len(kinds) - 5} sets more" if len(kinds) > 5 else "")


def _proposals(files: Sequence[LogFile], options: ReadOptions | None) -> tuple[dict[str, Proposal], list[str]]:
    """Proposed signals of one drive, and remarks on their channels."""
    with DriveLog([f.path for f in files], options) as log:
        channels: list[Channel] = list(log.read(log.channels()).values())
    origin = min((int(c.t_ns.min()) for c in channels if c.t_ns.size), default=0)
    views = [overview(c, origin_ns=origin) for c in channels if c.t_ns.size]
    rotated = rotated_channels(views)
    found = propose_map([c for c in channels if (c.info.file, c.info.path) not in rotated])
    remarks = {(v.file, v.path): v.remark for v in views if v.remark}
    odd = []
    for proposal in found.values():
        hits = matching([c.info for c in channels], proposal.entry.channel[0])
        remark = remarks.get((hits[0].file, hits[0].path), "") if hits else ""
        if remark and "constant" not in remark:
            odd.append(f"{proposal.entry.channel[0]}: {remark}")
    return found, odd


def _joined(
    proposed: Sequence[tuple[dict[str, Proposal], list[Drive]]], drives: Sequence[Drive], notes: list[str]
) -> MapProposal:
    entries: dict[str, Entry] = {}
    remarks: dict[str, str] = {}
    left_out: dict[str, str] = {}
    found: list[str] = []
    absent: dict[str, list[str]] = {}
    for symbol in dict.fromkeys(s for p, _ in proposed for s in p):
        own = [(p[symbol], members) for p, members in proposed if symbol in p]
        entry = _one_entry(symbol, [_by_name(symbol, p) for p, _ in own], notes)
        lacking, doubled = _without(entry, drives)
        is_rare = len(lacking) > MOST_MISSING * len(drives) and not symbol.startswith("omega_")
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
            remarks[symbol] = own[0][0].reason
    notes += [f"{', '.join(symbols)}: {told}" for told, symbols in absent.items()]
    missing = [f"omega_{w}" for w in WHEELS if f"omega_{w}" not in found]
    if missing:
        notes.insert(0, f"no channel looks like {', '.join(missing)}: aquaplaning cannot be detected without")
    if not any(s.startswith("torque_") for s in found):
        notes.append(
            "no torque of wheels or axles: traction and slip slope need one (a driveline torque with its scale)"
        )
    unmapped = _unmapped(drives, [e.channel for e in entries.values()] + [(s,) for s in found if s not in entries])
    speeds = [n for n in unmapped if "[" not in n and {"speed", "velocity"} & set(words_of(n)) and _is_road_speed(n)]
    if "v_x" not in found and "v_x" not in left_out:
        hint = (
            f"; {', '.join(speeds[:3])} may be it, but the file gives no unit: map it with its unit" if speeds else ""
        )
        notes.append(f"no v_x: slip refers to the free wheels, not to the road{hint}")
    return MapProposal(SignalMap(entries), remarks, left_out, tuple(dict.fromkeys(notes)), tuple(found), unmapped)


_NO_ROAD_SPEED = {"wheel", "whl", "engine", "fan", "wind", "accuracy", "limit", "motor", "rad"}


def _is_road_speed(name: str) -> bool:
    return not _NO_ROAD_SPEED & set(words_of(name))


def _unmapped(drives: Sequence[Drive], mapped: Sequence[tuple[str, ...]]) -> tuple[str, ...]:
    """Channels of any drive that no name of the map means; by their path where the name alone would be doubtful."""
    seen: dict[tuple[frozenset[tuple[str, str]], ...], None] = {}
    told: dict[str, None] = {}
    for drive in drives:
        key = tuple(f.signature for f in drive.files)
        if key in seen:
            continue
        seen[key] = None
        infos = [c for f in drive.files for c in f.channels]
        used: set[tuple[str, str]] = set()
        for wanted in mapped:  # of several names the first that hits is the one that is read
            hits = next(filter(None, (matching(infos, name) for name in wanted)), [])
            used |= {(c.file, c.path) for c in hits}
        names = Counter(c.name for c in infos)
        for info in infos:
            if (info.file, info.path) not in used:
                name = info.name if names[info.name] == 1 else info.path
                told[f"{name} [{info.unit}]" if info.unit else name] = None
    return tuple(told)


def _by_name(symbol: str, proposal: Proposal) -> Proposal:
    """A channel with the canonical name by that name alone, whatever group it stands in."""
    if proposal.reason != "its canonical name":
        return proposal
    return replace(proposal, entry=replace(proposal.entry, channel=(symbol,)))


def _is_canonical(symbol: str, entry: Entry) -> bool:
    return entry.channel == (symbol,) and entry.scale == 1.0


def _one_entry(symbol: str, proposals: Sequence[Proposal], notes: list[str]) -> Entry:
    """One line for the drives of all kinds; the most frequent kind decides where one map cannot express two."""
    first = proposals[0].entry
    channels = list(first.channel)
    unit = first.unit
    for entry in (p.entry for p in proposals[1:]):
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


def _without(entry: Entry, drives: Sequence[Drive]) -> tuple[list[Drive], list[Drive]]:
    """Drives without any channel of an entry, and those in which its name is not unique."""
    memory: dict[tuple[frozenset[tuple[str, str]], ...], int] = {}
    lacking, doubled = [], []
    for drive in drives:
        key = tuple(f.signature for f in drive.files)
        if key not in memory:
            infos = [c for f in drive.files for c in f.channels]
            memory[key] = len(next((m for name in entry.channel if (m := matching(infos, name))), []))
        if not memory[key]:
            lacking.append(drive)
        elif memory[key] > 1:
            doubled.append(drive)
    return lacking, doubled


def _some(drives: Sequence[Drive]) -> str:
    names = [d.files[0].name for d in drives[:3]]
    more = f" and {len(drives) - 3} more" if len(drives) > 3 else ""
    return f"{len(drives)} drive{'' if len(drives) == 1 else 's'} ({', '.join(names)}{more})"
