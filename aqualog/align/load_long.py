"""From files to the windows of a drive, for logs that do not fit into memory as a whole."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from aqualog.align.load import find_channels, read_options, read_signals
from aqualog.align.mapping import SignalMap
from aqualog.align.windows import LongDrive, NotInPiecesError, long_drive
from aqualog.io.base import Part
from aqualog.io.open_log import DriveLog
from aqualog.types import FileFaults, Signals
from aqualog.vehicle import Vehicle

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
) -> Signals | LoadedLong:
    """A drive as a whole, or one that is long to be gone through in windows.

    Parameters
    ----------
    paths, vehicle, signal_map, dbc, rate_hz, report
        As of `load_signals`.
    note : callable
        Told why a long drive is read as a whole.
    whole_for : str
        What needs the whole of it, if anything does.
    least : int
        Samples of all signals together from which a drive is long.

    Raises
    ------
    LogError, SignalError, ConfigError
    """
    signal_map = signal_map or SignalMap()
    options = read_options(signal_map, dbc)
    opened = ExitStack()
    with ExitStack() as stack:
        stack.push(opened)
        log = opened.enter_context(DriveLog(paths, options))
        report(f"listing channels of {len(paths)} file{'s' if len(paths) > 1 else ''}")
        found = find_channels(log, signal_map)
        wanted = [info for _, info in found.values()]
        total = sum(info.count for info in wanted)
        reason = whole_for and f"{whole_for} works on whole drives only"
        if total >= least and not reason:
            first = iter([log])

            def parts() -> list[Part]:
                # what a reader has lost is counted once, in the first pass
                again = next(first, None) or opened.enter_context(DriveLog(paths, options))
                return again.parts(wanted)

            def tell(done: int) -> None:
                report(f"going through the signals, {100 * done // max(total, 1)} %")

            try:
                drive = long_drive(found, parts, signal_map=signal_map, vehicle=vehicle, rate_hz=rate_hz, tell=tell)
                faults = tuple(log.faults)
                stack.pop_all()
                return LoadedLong(drive, faults, opened)
            except NotInPiecesError as error:
                reason = str(error)
                log = opened.enter_context(DriveLog(paths, options))
        if total >= least:
            note(f"the drive is read as a whole, which needs much memory: {reason}")
        return read_signals(log, found, signal_map=signal_map, vehicle=vehicle, rate_hz=rate_hz, report=report)
