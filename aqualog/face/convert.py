"""`aq.convert`: the aligned signals of one drive as one log."""

from __future__ import annotations

from pathlib import Path

from aqualog.core.errors import ConfigError
from aqualog.core.vehicle import Vehicle
from aqualog.face.arguments import file_of
from aqualog.face.drive import DriveLike, drive_of, vehicle_of
from aqualog.face.listener import Progress, listener
from aqualog.face.paths import refuse_existing, write_whole
from aqualog.face.result import PathLike

__all__ = ["check_target", "convert"]


def check_target(path: Path, *, decimal_comma: bool) -> str:
    """Return the suffix of a log to be written.

    Raises
    ------
    ConfigError
        If no log has that suffix, or if decimal commas are asked of another format than CSV.
    """
    from aqualog.io.write_log import check_suffix

    suffix = check_suffix(path)
    if decimal_comma and suffix != ".csv":
        raise ConfigError(f"decimal comma does not apply to {suffix}", where=str(path), expected="a .csv")
    return suffix


def convert(
    drive: DriveLike,
    path: PathLike,
    vehicle: PathLike | Vehicle | None = None,
    *,
    decimal_comma: bool = False,
    force: bool = False,
    progress: Progress = None,
) -> Path:
    """Write the aligned signals of one drive as one log, in SI units and with canonical names.

    Parameters
    ----------
    drive : Drive, Signals, str, Path or several
        From `aq.read`, or files of ONE drive that need no signal map.
    path : str or Path
        .mf4, .mcap, .csv or .parquet.
    vehicle : Vehicle, str or Path, optional
        For wheel speeds in km/h, steering wheel angles and torques.
    decimal_comma : bool
        Semicolons and decimal commas in a CSV file.
    force : bool
        Overwrite a file that exists; a source never.

    Raises
    ------
    LogError, SignalError, ConfigError

    Examples
    --------
    >>> aq.convert(aq.read("drive.mf4", map="map.toml"), "drive.parquet")
    """
    target, hear, one = file_of(path, "path"), listener(progress), drive_of(drive)
    suffix = check_target(target, decimal_comma=decimal_comma)
    refuse_existing([target], force=force, sources=one.sources)
    with one.reading():
        signals = one.load(vehicle_of(vehicle, one), report=hear)
        hear("writing")
        import numpy as np

        from aqualog.io.write_log import write_log
        from aqualog.report.drive.document import signal_groups

        t_ns = np.arange(signals.frame.height, dtype=np.int64) * signals.dt_ns
        write_whole(
            target,
            lambda p: write_log(
                p, t_ns, signal_groups(signals), suffix=suffix, start_ns=signals.start_ns, decimal_comma=decimal_comma
            ),
        )
    return target
