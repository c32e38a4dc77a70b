"""Read files into the table of signals, or into the windows of a drive that does not fit into memory."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from aqualog.align.mapping import Entry, SignalMap, resolve
from aqualog.align.table import build_signals
from aqualog.align.windows import LongDrive, NotInPiecesError, long_drive
from aqualog.core.errors import SignalError
from aqualog.core.records import ChannelInfo, FileFaults, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.io.open_log import DriveLog
from aqualog.io.reader import Part, ReadOptions

if TYPE_CHECKING:
    from aqualog.align.cache import SignalCache

__all__ = ["LONG", "LoadedLong", "find_channels", "load_drive", "load_signals", "read_options", "read_signals"]

_Read = TypeVar("_Read")
LONG = 15_000_000  # samples of all signals together, from which a drive is long: as a whole it needs about 1 GB
_NAMED = 3  # files in a note


class LoadedLong(NamedTuple):
    """A long drive and what its files lost; `opened` closes them."""

    drive: LongDrive
    faults: tuple[FileFaults, ...]
    opened: ExitStack


def read_options(signal_map: SignalMap, dbc: Sequence[Path] = ()) -> ReadOptions:
    """Return what readers need to know of a signal map."""
    return ReadOptions(tuple(dbc), signal_map.time_channel, signal_map.time_unit, signal_map.csv)


def load_signals(
    paths: Sequence[Path],
    *,
    vehicle: Vehicle,
    signal_map: SignalMap | None = None,
    dbc: Sequence[Path] = (),
    rate_hz: float | None = None,
    wanted: Callable[[str], bool] | None = None,
    report: Callable[[str], None] = lambda _: None,
    cache: SignalCache | None = None,
) -> Signals:
    """Read the files of one drive and bring their signals onto one grid.

    Only channels that the map (or a canonical name) asks for are decoded.

    Parameters
    ----------
    paths : sequence of Path
        Files of one drive.
    vehicle : Vehicle
        For wheel speeds in km/h and steering wheel angles.
    signal_map : SignalMap, optional
    dbc : sequence of Path
        Databases for raw CAN frames.
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
    signal_map = signal_map or SignalMap()

    def read() -> Signals:
        with DriveLog(paths, read_options(signal_map, dbc)) as log:
            report(f"listing channels of {len(paths)} file{'s' if len(paths) > 1 else ''}")
            found = find_channels(log, signal_map, wanted or (lambda _: True))
            return read_signals(log, found, signal_map=signal_map, vehicle=vehicle, rate_hz=rate_hz, report=report)

    return read() if wanted is not None else _kept(cache, paths, vehicle, signal_map, dbc, rate_hz, report, read)


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
    """Open a drive: as a whole, or window by window if it is long.

    Parameters
    ----------
    paths, vehicle, signal_map, dbc, rate_hz, report, cache
        As of `load_signals`.
    note : callable
        Called with the reason why a long drive is read as a whole.
    whole_for : str
        Name of the feature that needs the whole drive; empty without one.
    least : int
        Samples of all signals together from which a drive is long.

    Raises
    ------
    LogError, SignalError, ConfigError
    """
    signal_map = signal_map or SignalMap()
    options = read_options(signal_map, dbc)

    def read() -> Signals | LoadedLong:
        with ExitStack() as stack:
            log = stack.enter_context(DriveLog(paths, options))
            report(f"listing channels of {len(paths)} file{'s' if len(paths) > 1 else ''}")
            found = find_channels(log, signal_map)
            reason = f"{whole_for} works on whole drives only" if whole_for else ""
            if sum(info.count for _, info in found.values()) >= least:
                if not reason:
                    try:
                        loaded = _in_windows(log, found, options, stack, signal_map, vehicle, rate_hz, report)
                        return loaded._replace(opened=stack.pop_all())
                    except NotInPiecesError as error:
                        reason = str(error)
                note(f"the drive is read as a whole, which needs much memory: {reason}")
                log = stack.enter_context(DriveLog(paths, options))
            return read_signals(log, found, signal_map=signal_map, vehicle=vehicle, rate_hz=rate_hz, report=report)

    return _kept(cache, paths, vehicle, signal_map, dbc, rate_hz, report, read)


def _in_windows(
    log: DriveLog,
    found: Mapping[str, tuple[Entry, ChannelInfo]],
    options: ReadOptions,
    opened: ExitStack,
    signal_map: SignalMap,
    vehicle: Vehicle,
    rate_hz: float | None,
    report: Callable[[str], None],
) -> LoadedLong:
    wanted = [info for _, info in found.values()]
    total = max(sum(info.count for info in wanted), 1)
    first = iter([log])
    again = ExitStack()
    opened.push(again)

    def parts() -> list[Part]:
        # what a reader has lost is counted once, in the first pass
        return (next(first, None) or again.enter_context(DriveLog(log.paths, options))).parts(wanted)

    def tell(done: int) -> None:
        report(f"going through the signals, {100 * done // total} %")

    drive = long_drive(found, parts, signal_map=signal_map, vehicle=vehicle, rate_hz=rate_hz, tell=tell)
    return LoadedLong(drive, (*log.faults, *idle_files(log, found)), opened)


def _kept(
    cache: SignalCache | None,
    paths: Sequence[Path],
    vehicle: Vehicle,
    signal_map: SignalMap,
    dbc: Sequence[Path],
    rate_hz: float | None,
    report: Callable[[str], None],
    read: Callable[[], _Read],
) -> _Read | Signals:
    """Return the signals of a drive from the cache; else read them and keep the table if it is whole."""
    if cache is None:
        return read()
    report("looking into the cache")
    key = cache.key(paths, vehicle, signal_map, dbc, rate_hz)
    signals = cache.get(key) if key is not None else None
    if signals is not None:
        return signals
    found = read()
    if key is not None and isinstance(found, Signals):
        cache.put(key, found)
    return found


def read_signals(
    log: DriveLog,
    found: Mapping[str, tuple[Entry, ChannelInfo]],
    *,
    signal_map: SignalMap,
    vehicle: Vehicle,
    rate_hz: float | None,
    report: Callable[[str], None],
) -> Signals:
    """Build the table of channels that `find_channels` has found in an open log."""
    report(f"reading {len(found)} channels")
    channels = log.read(info for _, info in found.values())
    faults = [*log.faults, *idle_files(log, found)]
    log.close()
    report("aligning")
    mapped = {s: (entry, channels[info.file, info.path]) for s, (entry, info) in found.items()}
    return build_signals(mapped, signal_map=signal_map, vehicle=vehicle, file_faults=faults, rate_hz=rate_hz)


def idle_files(log: DriveLog, found: Mapping[str, tuple[Entry, ChannelInfo]]) -> list[FileFaults]:
    """Return a note on files of a drive that hold none of its signals: one for all of them, or no note."""
    used = {info.file for _, info in found.values()}
    idle = [path.name for path in log.paths if path.name not in used]
    if not idle:
        return []
    names = ", ".join(idle[:_NAMED]) + (f" and {len(idle) - _NAMED} more" if len(idle) > _NAMED else "")
    give = "gives" if len(idle) == 1 else "give"
    return [FileFaults(notes=(f"{names} {give} none of the signals (`aqualog inspect` lists what is in a log)",))]


def find_channels(
    log: DriveLog, signal_map: SignalMap, wanted: Callable[[str], bool] = lambda _: True
) -> dict[str, tuple[Entry, ChannelInfo]]:
    """Find the channels of a drive that are signals, by symbol.

    Raises
    ------
    SignalError
        If no channel is a signal, or the map names one that the log does not hold.
    """
    channels = log.channels()  # first: what is damaged is told then
    notes = [n for f in log.faults for n in f.notes if f.truncated or f.lost_samples or "CAN frames" in n]
    try:
        found = {s: hit for s, hit in resolve(channels, signal_map).items() if wanted(s)}
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
    return SignalError(
        f"none of {channels} channels is a signal that aqualog knows by name"
        + (f" ({notes[0]})" if notes else "")
        + ": missing omega_fl, omega_fr, omega_rl, omega_rr (wheel speeds), a_x and wheel torques",
        where=", ".join(p.name for p in paths),
        hint="`aqualog inspect LOG --write-map map.toml`, then the log with this signal map",
    )
