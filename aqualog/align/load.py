"""Read files into the table of signals, or into the windows of a drive that does not fit into memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from aqualog.align.mapping import MAP_HINT, SignalMap, resolve
from aqualog.align.table import Found, build_signals
from aqualog.align.windows import LongDrive, NotInPiecesError, long_drive
from aqualog.core.errors import ConfigError, SignalError, listed
from aqualog.core.records import FileFaults, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.io.open_log import DriveLog
from aqualog.io.reader import Part, ReadOptions

if TYPE_CHECKING:
    from aqualog.align.cache import SignalCache

__all__ = [
    "LONG", "LoadedLong", "NothingMappedError", "find_channels", "load_drive", "load_signals", "read_options",
    "read_signals",
]  # fmt: skip

_Read = TypeVar("_Read")
LONG = 15_000_000  # samples of all signals together, from which a drive is long: as a whole it needs about 1 GB
_NAMED = 3  # files in a note


class NothingMappedError(SignalError):
    """A drive has channels, but none of them is a signal."""


class LoadedLong(NamedTuple):
    """A long drive and what its files lost; `opened` closes them."""

    drive: LongDrive
    faults: tuple[FileFaults, ...]
    opened: ExitStack


def read_options(signal_map: SignalMap, dbc: Sequence[Path] = ()) -> ReadOptions:
    """Return what readers need to know of a signal map."""
    return ReadOptions(
        tuple(dbc), signal_map.time_channel, signal_map.time_unit, signal_map.csv, tuple(signal_map.clocks)
    )


class _Request(NamedTuple):
    """What to read, and how; `report` is called with the name of each step."""

    paths: Sequence[Path]
    vehicle: Vehicle
    signal_map: SignalMap
    dbc: Sequence[Path]
    rate_hz: float | None
    report: Callable[[str], None]

    def opened(self, stack: ExitStack) -> DriveLog:
        return stack.enter_context(DriveLog(self.paths, read_options(self.signal_map, self.dbc)))

    def found(self, log: DriveLog, wanted: Callable[[str], bool] = lambda _: True) -> Found:
        self.report(f"listing channels of {len(self.paths)} file{'s' if len(self.paths) > 1 else ''}")
        return find_channels(log, self.signal_map, wanted)

    def read(self, log: DriveLog, found: Found) -> Signals:
        return read_signals(
            log, found, signal_map=self.signal_map, vehicle=self.vehicle, rate_hz=self.rate_hz, report=self.report,
            dbc=[str(d) for d in self.dbc],
        )  # fmt: skip

    def in_windows(self, log: DriveLog, found: Found, stack: ExitStack) -> LoadedLong:
        wanted = [info for _, info in found.values()]
        total = max(sum(info.count for info in wanted), 1)
        first = iter([log])
        again = stack.enter_context(ExitStack())

        def parts() -> list[Part]:
            # what a reader has lost is counted once, in the first pass
            return (next(first, None) or self.opened(again)).parts(wanted)

        drive = long_drive(
            found, parts, signal_map=self.signal_map, vehicle=self.vehicle, rate_hz=self.rate_hz,
            dbc=[str(d) for d in self.dbc],
            tell=lambda done: self.report(f"going through the signals, {100 * done // total} %"),
        )  # fmt: skip
        return LoadedLong(drive, (*log.faults, *idle_files(log, found)), stack)

    def kept(self, cache: SignalCache | None, read: Callable[[], _Read]) -> _Read | Signals:
        """The signals from the cache; else read them and keep the table if it is whole."""
        if cache is None:
            return read()
        self.report("looking into the cache")
        key = cache.key(self.paths, self.vehicle, self.signal_map, self.dbc, self.rate_hz)
        signals = cache.get(key) if key is not None else None
        if signals is not None:
            return signals
        found = read()
        if key is not None and isinstance(found, Signals):
            cache.put(key, found)
        return found


def load_signals(
    paths: Sequence[Path], *, vehicle: Vehicle, signal_map: SignalMap | None = None, dbc: Sequence[Path] = (),
    rate_hz: float | None = None, wanted: Callable[[str], bool] | None = None,
    report: Callable[[str], None] = lambda _: None, cache: SignalCache | None = None,
) -> Signals:  # fmt: skip
    """Read the files of one drive and bring their signals onto one grid.

    Only channels that the map (or a canonical name) asks for are decoded.

    Parameters
    ----------
    paths, dbc
        Files of one drive; databases for raw CAN frames.
    vehicle : Vehicle
        For wheel speeds in km/h and steering wheel angles.
    rate_hz : float, optional
        Grid rate; default that of the wheel speeds.
    wanted : callable, optional
        Which symbols are of interest; default all.
    report : callable
        Called with the name of each step.
    cache : SignalCache, optional
        Looked up first, and given the result; not used if only some symbols are wanted.

    Raises
    ------
    LogError, SignalError, ConfigError
    """
    request = _Request(paths, vehicle, signal_map or SignalMap(), dbc, rate_hz, report)

    def read() -> Signals:
        with ExitStack() as stack:
            log = request.opened(stack)
            return request.read(log, request.found(log, wanted or (lambda _: True)))

    return read() if wanted is not None else request.kept(cache, read)


def load_drive(
    paths: Sequence[Path],
    *,
    vehicle: Vehicle,
    signal_map: SignalMap | None = None,
    dbc: Sequence[Path] = (),
    rate_hz: float | None = None,
    report: Callable[[str], None] = lambda _: None,
    note: Callable[[str], None] = lambda _: None,
    whole_for: str = "",
    least: int = LONG,
    cache: SignalCache | None = None,
) -> Signals | LoadedLong:
    """Open a drive: as a whole, or window by window if it is long. Parameters and errors as of `load_signals`, and

    Parameters
    ----------
    note : callable
        Called with the reason why a long drive is read as a whole.
    whole_for : str
        Name of the feature that needs the whole drive; empty without one.
    least : int
        Samples of all signals together from which a drive is long.
    """
    request = _Request(paths, vehicle, signal_map or SignalMap(), dbc, rate_hz, report)

    def read() -> Signals | LoadedLong:
        with ExitStack() as stack:
            log = request.opened(stack)
            found = request.found(log)
            reason = f"{whole_for} works on whole drives only" if whole_for else ""
            if sum(info.count for _, info in found.values()) >= least:
                if not reason:
                    try:
                        loaded = request.in_windows(log, found, stack)
                        return loaded._replace(opened=stack.pop_all())
                    except NotInPiecesError as error:
                        reason = str(error)
                note(f"the drive is read as a whole, which needs much memory: {reason}")
                log = request.opened(stack)
            return request.read(log, found)

    return request.kept(cache, read)


def read_signals(
    log: DriveLog, found: Found, *, signal_map: SignalMap, vehicle: Vehicle, rate_hz: float | None,
    report: Callable[[str], None], dbc: Sequence[str] = (),
) -> Signals:  # fmt: skip
    """Build the table of channels that `find_channels` has found in an open log."""
    report(f"reading {len(found)} channels")
    channels = log.read(info for _, info in found.values())
    faults = [*log.faults, *idle_files(log, found)]
    log.close()
    report("aligning")
    mapped = {s: (entry, channels[info.file, info.path]) for s, (entry, info) in found.items()}
    return build_signals(mapped, signal_map=signal_map, vehicle=vehicle, file_faults=faults, rate_hz=rate_hz, dbc=dbc)


def idle_files(log: DriveLog, found: Found) -> list[FileFaults]:
    """Return a note on files of a drive that hold none of its signals: one for all of them, or no note."""
    used = {info.file for _, info in found.values()}
    idle = [path.name for path in log.paths if log.goes_on.get(path.name, path.name) not in used]
    if not idle:
        return []
    give = "gives" if len(idle) == 1 else "give"
    note = f"{listed(idle, _NAMED)} {give} none of the signals (`aqualog inspect` lists what is in a log)"
    return [FileFaults(notes=(note,))]


def find_channels(log: DriveLog, signal_map: SignalMap, wanted: Callable[[str], bool] = lambda _: True) -> Found:
    """Find the channels of a drive that are signals, by symbol.

    Raises
    ------
    SignalError
        If no channel is a signal, or the map names one that the log does not hold.
    """
    channels = log.channels()  # first: what is damaged is told then
    notes = [n for f in log.faults for n in f.notes if f.truncated or f.lost_samples or "CAN frames" in n]
    if signal_map.time_channel and all(any("no time channel" in n for n in f.notes) for f in log.faults):
        what = f'no column is called "{signal_map.time_channel}"'
        raise ConfigError(what, where="[time] channel", expected="a column of the log", hint="`aqualog inspect LOG`")
    try:
        found = {s: hit for s, hit in resolve(channels, signal_map, log.apart).items() if wanted(s)}
    except SignalError as error:
        if not notes:
            raise
        raise SignalError(f"{error.what} ({notes[0]})", where=error.where, hint=error.hint) from error
    if not found:
        count = len(channels)
        # without any signal, whatever was left out is the reason
        raise _nothing_mapped(log.paths, count, notes if notes or count else [n for f in log.faults for n in f.notes])
    return found


def _nothing_mapped(paths: Sequence[Path], channels: int, notes: Sequence[str]) -> SignalError:
    if not channels:
        frames = next((n for n in notes if "raw CAN frames" in n), "")
        hint = "--dbc FILE with the database of this car" if frames else "the recording may have ended at once"
        told = frames or (notes[0] if notes else "")
        return SignalError(
            "holds no channel" + (f" ({told})" if told else ""), where=", ".join(p.name for p in paths),
            expected="measured signals", hint=f"{hint}; `aqualog inspect LOG`",
        )  # fmt: skip
    return NothingMappedError(
        f"none of {channels} channels is a signal that aqualog knows by name" + (f" ({notes[0]})" if notes else ""),
        where=", ".join(p.name for p in paths),
        expected="names as omega_fl, omega_fr, omega_rl, omega_rr (wheel speeds), a_x and torque_fl, or a signal map",
        hint=MAP_HINT,
    )
