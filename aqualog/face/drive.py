"""`aq.read` and `aq.convert`: the files of one drive, the signals in them, and these as one log."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.align.mapping import SignalMap, values_read
from aqualog.core.errors import AqualogError, ConfigError, LogError, SignalError
from aqualog.core.records import Signals
from aqualog.core.vehicle import Vehicle
from aqualog.face.arguments import (
    expand,
    file_of,
    list_files,
    names_of,
    no_vehicle,
    number_of,
    refuse_existing,
    write_whole,
)
from aqualog.face.cache import cache_of_user
from aqualog.face.listener import Progress, listener
from aqualog.face.result import PathLike, printable
from aqualog.io.fingerprint import Seen, changed_files, state_of

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.align.cache import SignalCache
    from aqualog.align.load import LoadedLong

__all__ = [
    "Drive", "DriveLike", "check_target", "convert", "drive_of", "read", "sources_of", "vehicle_needed", "vehicle_of",
]  # fmt: skip

Logs = PathLike | Iterable[PathLike]


@dataclass(frozen=True, eq=False, repr=False)
class Drive:
    """One drive: its files, how to read them, and the signals once they are asked for.

    The files are decoded when the signals are needed. Wheel speeds in km/h, steering wheel angles and torques need
    the vehicle; another vehicle reads them anew. `before` is the state of the files when the drive was named. With
    `correct_offsets` the signals are less what they show at standstill.
    """

    paths: tuple[Path, ...]
    signal_map: SignalMap = field(default_factory=SignalMap)
    dbc: tuple[Path, ...] = ()
    rate_hz: float | None = None
    vehicle: Vehicle | None = None
    cache: SignalCache | None = None
    sources: tuple[Path, ...] = ()
    before: Seen = ()
    given: Signals | None = None
    label: str = ""
    correct_offsets: bool = False
    _loaded: dict[Any, Signals] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The files as they were named, with commas."""
        return self.label or ", ".join(str(p) for p in self.paths)

    @property
    def title(self) -> str:
        """The same, short."""
        paths = self.paths
        return self.name if len(paths) <= 2 else f"{paths[0].parent.name or paths[0].name} ({len(paths)} files)"

    @property
    def signals(self) -> Signals:
        """All signals on one time base, SI; with a default car if the drive was read without a vehicle."""
        return self.load(self.vehicle or Vehicle())

    @property
    def frame(self) -> pl.DataFrame:
        """The signals as a table: `t` [s] and a column for each signal, SI."""
        return self.signals.frame

    @property
    def _how(self) -> dict[str, Any]:
        return {"signal_map": self.signal_map, "dbc": self.dbc, "rate_hz": self.rate_hz, "cache": self.cache}

    def load(self, vehicle: Vehicle, *, report: Callable[[str], None] = lambda _: None) -> Signals:
        """Read the signals with the radii, steering ratio and torque gain of a vehicle; a second call reads nothing.

        Raises
        ------
        LogError, SignalError, ConfigError
        """
        if self.given is not None:
            return self.given
        key = values_read(vehicle)
        if key not in self._loaded:
            from aqualog.align.load import load_signals

            self._loaded[key] = self._mended(
                load_signals(self.paths, vehicle=vehicle, report=report, **self._how), vehicle
            )
        return self._loaded[key]

    def load_or_open(
        self,
        vehicle: Vehicle,
        *,
        report: Callable[[str], None] = lambda _: None,
        note: Callable[[str], None] = lambda _: None,
        whole_for: str = "",
    ) -> Signals | LoadedLong:
        """Read the signals, or open a drive that is too long for memory to go through it in windows.

        `whole_for` names what needs the whole drive, if anything does; `note` hears why a long drive is read whole.

        Raises
        ------
        LogError, SignalError, ConfigError
        """
        key = values_read(vehicle)
        if self.given is not None or key in self._loaded:
            return self.load(vehicle)
        from aqualog.align.load import load_drive

        needs = ", ".join(n for n in (whole_for, "the correction of offsets" if self.correct_offsets else "") if n)
        found = load_drive(self.paths, vehicle=vehicle, report=report, note=note, whole_for=needs, **self._how)
        if isinstance(found, Signals):
            found = self._loaded[key] = self._mended(found, vehicle)
        return found

    def _mended(self, signals: Signals, vehicle: Vehicle) -> Signals:
        if not self.correct_offsets:
            return signals
        from aqualog.checks.correct import without_offsets

        return without_offsets(signals, vehicle)

    def changes(self) -> tuple[str, ...]:
        """Return a note for each file that has changed since the drive was named."""
        return tuple(
            f"{Path(name).name}: changed while it was read; look at it again when it stays as it is"
            for name in changed_files(self.paths, self.before)
        )

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Report an error within as a change of the log, if the log has changed.

        Raises
        ------
        LogError
            In place of an error of reading.
        """
        try:
            yield
        except Exception as error:
            names = changed_files(self.paths, self.before)
            if not names or (isinstance(error, AqualogError) and not isinstance(error, LogError | SignalError)):
                raise
            what = error.what if isinstance(error, AqualogError) else str(error) or type(error).__name__
            hint = "again, when it stays as it is"
            raise LogError(f"changed while it was read ({what})", where=names[0], hint=hint) from error

    def plot(self) -> go.Figure:
        """Return the signals over time, a row for each unit."""
        from aqualog.report.drive.panels import signals_figure

        return signals_figure(self.signals, self.title)

    def write(self, path: PathLike, *, decimal_comma: bool = False, force: bool = False) -> Path:
        """Write the aligned signals as one log, as `aqualog convert` does: .mf4, .mcap, .csv or .parquet."""
        return convert(self, path, decimal_comma=decimal_comma, force=force)

    def __repr__(self) -> str:
        try:
            s = self.signals
            head = f"{self.title}: {s.duration_s:.1f} s at {1e9 / s.step_ns:g} Hz, {len(s.symbols)} signals"
            lines = [head, f"  {', '.join(s.symbols)}", *(f"  note: {n}" for n in s.quality.notes[:3])]
        except AqualogError as error:  # a repr shows what there is
            lines = [f"{self.title}: cannot be read", f"  {error.line()}"]
        return "\n".join(printable(line) for line in lines)

    def _repr_html_(self) -> str:
        text = f"<pre>{escape(repr(self))}</pre>"
        try:
            return f"{text}{self.frame._repr_html_()}"
        except AqualogError:
            return text


DriveLike = Drive | Signals | PathLike | Sequence[PathLike]


def read(
    logs: Logs,
    map: PathLike | SignalMap | None = None,
    vehicle: PathLike | Vehicle | None = None,
    *,
    dbc: Logs = (),
    rate_hz: float | None = None,
    cache: bool = False,
    correct_offsets: bool = False,
) -> Drive:
    """Name the files of one drive and how to read them.

    The files must exist and the settings must be right; the samples are decoded when they are needed.

    Parameters
    ----------
    logs : str, Path or several
        Files of ONE drive: files, folders, globs, `@list.txt`. MDF, MCAP, ROS bag, CSV or Parquet.
    map : str, Path or SignalMap, optional
        Which channel is which signal. Logs with canonical names need none.
    vehicle : str, Path or Vehicle, optional
        For wheel speeds in km/h, steering wheel angles and torques. The vehicle of a later call counts more.
    dbc : str, Path or several
        CAN databases for raw frames.
    rate_hz : float, optional
        Rate of the time base [Hz], 0.1 to 100000; default that of the wheel speeds.
    cache : bool
        Keep the aligned signals for the next look at the same files.
    correct_offsets : bool
        Take off what `a_x`, `a_y` and `yaw_rate` show at standstill, where that is surely no slope of a road.

    Raises
    ------
    ConfigError, LogError

    Examples
    --------
    >>> drive = aq.read("drive.mf4", map="map.toml", vehicle="car.toml")
    >>> drive.frame.select("t", "v_x")
    """
    if rate_hz is not None:
        rate_hz = number_of(rate_hz, "rate_hz", 0.1, 100_000.0, "Hz")
    names = names_of(logs)
    paths = tuple(expand(names))
    if not paths:
        raise ConfigError("no log is named", expected="at least one file of a drive")
    for path in paths:
        if not path.exists():
            raise LogError("no such file or folder", where=str(path), expected="a log")
    databases = tuple(file_of(n, "dbc") for n in names_of(dbc, "dbc"))
    if map is not None and not isinstance(map, SignalMap):
        from aqualog.config.signal_map import load_signal_map

        signal_map = load_signal_map(file_of(map, "map", "SignalMap"))
    else:
        signal_map = map or SignalMap()
    if signal_map.clocks or signal_map.csv:
        from aqualog.config.signal_map import check_files

        check_files(signal_map, paths)
    return Drive(
        paths, signal_map, databases, rate_hz, None if vehicle is None else vehicle_of(vehicle),
        cache_of_user() if cache else None, sources_of((*paths, *list_files(names), *databases), map, vehicle),
        state_of(list(paths)), correct_offsets=correct_offsets,
    )  # fmt: skip


def check_target(path: Path, *, decimal_comma: bool) -> str:
    """Return the suffix of a log to be written, and refuse decimal commas in another format than CSV."""
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


def drive_of(drive: DriveLike) -> Drive:
    """Return the drive behind an argument: a drive, signals in memory, or files that need no map."""
    if isinstance(drive, Drive):
        return drive
    if isinstance(drive, Signals):
        return Drive((), given=drive, label=", ".join(drive.files) or "signals")
    return read(drive)


def vehicle_of(vehicle: PathLike | Vehicle | None, drive: Drive | None = None) -> Vehicle:
    """Return the vehicle behind an argument; without one that of the drive, else a default car."""
    if vehicle is None:
        return (drive.vehicle if drive is not None else None) or Vehicle()
    return vehicle if isinstance(vehicle, Vehicle) else Vehicle.read(file_of(vehicle, "vehicle", "aq.Vehicle"))


def vehicle_needed(vehicle: PathLike | Vehicle | None, drive: Drive | None = None) -> Vehicle:
    """Return the vehicle behind an argument, or that of the drive; a default car would make the work wrong."""
    if vehicle is None and (drive is None or drive.vehicle is None):
        raise no_vehicle('aq.Vehicle.read("car.toml")')
    return vehicle_of(vehicle, drive)


def sources_of(files: Iterable[Path], *others: object) -> tuple[Path, ...]:
    """Return the files that no result may overwrite: those of the drives, and each other argument that is a path."""
    return (*dict.fromkeys(files), *(Path(x) for x in others if isinstance(x, str | Path)))
