"""`aqualog detect` on a log that is longer than memory."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from aqualog.align.load import LoadedLong
from aqualog.core.records import DriveResult
from aqualog.core.vehicle import Vehicle
from aqualog.detect.long import detect_long
from aqualog.detect.slip_slope.watch import Memory
from aqualog.detect.stream import Settings
from aqualog.face.paths import write_whole
from aqualog.guard.reading import unfinished

__all__ = ["detect_in_windows"]


def detect_in_windows(
    loaded: LoadedLong,
    vehicle: Vehicle,
    *,
    settings: Settings | None,
    memory: Memory,
    out: Path | None,
    report: Callable[[str], None],
) -> DriveResult:
    """Run the detectors; with a folder for results their signals go into `signals.parquet` there, window by window.

    Raises
    ------
    OSError
        If the table cannot be written.
    """
    if out is None:
        with loaded.opened:
            return _run(loaded, vehicle, settings, memory, None, report)
    out.mkdir(parents=True, exist_ok=True)
    scratch = tempfile.TemporaryDirectory(prefix=".windows-", dir=out, ignore_cleanup_errors=True)
    with loaded.opened, scratch as folder, unfinished(Path(folder)):
        table = _Table(Path(folder))
        result = _run(loaded, vehicle, settings, memory, table.add, report)
        report("writing the table")
        write_whole(out / "signals.parquet", table.write)
    return result


def _run(
    loaded: LoadedLong,
    vehicle: Vehicle,
    settings: Settings | None,
    memory: Memory,
    keep: Callable[[DriveResult], None] | None,
    report: Callable[[str], None],
) -> DriveResult:
    return detect_long(
        loaded.drive, vehicle, settings=settings, memory=memory, faults=loaded.faults, keep=keep,
        pictured=keep is not None, tell=lambda share: report(f"detecting, {100.0 * share:.0f} %"),
    )  # fmt: skip


class _Table:
    """Windows as files of their own, which become one."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._parts: list[Path] = []
        self._rows = 0

    def add(self, window: DriveResult) -> None:
        """Write the next window."""
        import numpy as np

        from aqualog.io.write_log import write_log
        from aqualog.report.drive.document import result_groups

        n, dt_ns = window.signals.frame.height, window.signals.dt_ns
        t_ns = (self._rows + np.arange(n, dtype=np.int64)) * dt_ns
        path = self._folder / f"{len(self._parts):06d}.parquet"
        write_log(path, t_ns, result_groups(window), suffix=".parquet", start_ns=window.signals.start_ns)
        self._parts.append(path)
        self._rows += n

    def write(self, path: Path) -> None:
        """Join them, a row group each."""
        from aqualog.io.write_table import join_parquet

        join_parquet(path, self._parts)
