"""Read files into the windows of a drive, for logs that do not fit into memory as a whole."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from aqualog.align.load import find_channels, idle_files, kept, read_options, read_signals
from aqualog.align.mapping import Entry, SignalMap
from aqualog.align.windows import LongDrive, NotInPiecesError, long_drive
from aqualog.core.records import ChannelInfo, FileFaults, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.io.base import Part, ReadOptions
from aqualog.io.open_log import DriveLog

if TYPE_CHECKING:
    from aqualog.align.cache import SignalCache

__all__ = ["LONG", "LoadedLong", "load_drive"]

LONG = 15_000_000  # samples of all signals together, from which a drive is long: as a whole it needs about 1 GB


class LoadedLong(NamedTuple):
    """A long drive and what its files lost; `opened` closes them."""

    drive: LongDrive
    faults: tuple[FileFaults, ...]
    opened: ExitStack


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

    return kept(cache, paths, vehicle, signal_map, dbc, rate_hz, report, read)


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
