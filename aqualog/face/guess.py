"""A signal map for a drive that comes without one: what `inspect` proposes, used at once and said."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from aqualog.core.errors import AqualogError
from aqualog.core.notation import WHEELS
from aqualog.core.records import Signals
from aqualog.face.listener import Listener

if TYPE_CHECKING:
    from collections.abc import Mapping

    from aqualog.align.load import LoadedLong
    from aqualog.align.propose import Proposal
    from aqualog.core.vehicle import Vehicle
    from aqualog.face.drive import Drive

__all__ = ["guessed", "load_or_guess"]

_NAMED = 3  # signals in the note


def load_or_guess(
    drive: Drive, vehicle: Vehicle, hear: Listener, *, whole_for: str = ""
) -> tuple[Drive, Signals | LoadedLong, tuple[str, ...]]:
    """Load a drive as `Drive.load_or_open` does; without a map and wheel speeds by guessed signals, with a note on it.

    A drive that is too long for memory is not guessed at.

    Raises
    ------
    LogError, SignalError, ConfigError
        As without a guess, where nothing more is found.
    """
    from aqualog.align.load import NothingMappedError

    def load(one: Drive) -> Signals | LoadedLong:
        return one.load_or_open(vehicle, report=hear, note=hear.note, whole_for=whole_for)

    if drive.given is not None or drive.signal_map.entries:
        return drive, load(drive), ()
    loaded: Signals | LoadedLong | None = None
    try:
        loaded = load(drive)
    except NothingMappedError:
        hear("guessing which channel is which signal")
        found = _guesses(drive)
        if not found:
            raise
    else:
        if not isinstance(loaded, Signals) or all(f"omega_{w}" in loaded.symbols for w in WHEELS):
            return drive, loaded, ()
        hear("guessing which channel is which signal")
        found = _guesses(drive)
        if not any(s.startswith("omega_") for s in found):
            return drive, loaded, ()
    own = _with(drive, found)
    try:
        return own, load(own), (_note(found),)
    except AqualogError:
        if loaded is None:
            raise
        return drive, loaded, ()  # what is guessed does not go together: what is known does


def guessed(drive: Drive) -> tuple[Drive, str]:
    """Return the drive with the map that `load_or_guess` would take, and the note on it, without loading it.

    As it is, with an empty note, where nothing is guessed.
    """
    if drive.given is not None or drive.signal_map.entries:
        return drive, ""
    try:
        known, found = _proposals(drive)
    except AqualogError:
        return drive, ""
    is_wheel = [s.startswith("omega_") for s in found]
    return (_with(drive, found), _note(found)) if any(is_wheel) or (found and not known) else (drive, "")


def _with(drive: Drive, found: Mapping[str, Proposal]) -> Drive:
    entries = {s: p.entry for s, p in found.items()}
    return replace(drive, signal_map=replace(drive.signal_map, entries=entries), _loaded={})


def _guesses(drive: Drive) -> Mapping[str, Proposal]:
    """Return the proposals that need a map, as `_proposals`."""
    return _proposals(drive)[1]


def _proposals(drive: Drive) -> tuple[frozenset[str], Mapping[str, Proposal]]:
    """Return the signals that need no map, and the proposals that do.

    None if the log cannot be read, is too long for memory, or has all wheel speeds by name.

    Raises
    ------
    SignalError
        If the files are those of several drives.
    """
    from aqualog.align.load import LONG, read_options
    from aqualog.align.propose import CANONICAL, look_at
    from aqualog.align.propose_map import check_one_drive
    from aqualog.io.open_log import DriveLog

    try:
        with drive.reading(), DriveLog(drive.paths, read_options(drive.signal_map, drive.dbc)) as log:
            names = {c.name for c in log.channels()}
            if sum(c.count for c in log.channels()) >= LONG or all(f"omega_{w}" in names for w in WHEELS):
                return frozenset(), {}
            channels, _ = log.read_readable()
            apart = log.apart
    except AqualogError:
        return frozenset(), {}
    proposals = look_at(channels).proposals
    found = {s: p for s, p in proposals.items() if p.reason != CANONICAL}
    check_one_drive([(c.info.file, c.info.path) for c in channels], found.values(), apart)
    return frozenset(proposals.keys() - found.keys()), found


def _note(found: Mapping[str, Proposal]) -> str:
    some = [f"{s} = {p.entry.channel[0]}" for s, p in list(found.items())[:_NAMED]]
    more = ", ..." if len(found) > _NAMED else ""
    doubt = [s for s, p in found.items() if p.doubt]
    unsure = f"; the units of {', '.join(doubt)} are in doubt" if doubt else ""
    return (
        f"no signal map: {len(found)} signals are guessed from names, units and data "
        f"({', '.join(some)}{more}){unsure}. `aqualog init LOG -o FOLDER` writes them down to check"
    )
