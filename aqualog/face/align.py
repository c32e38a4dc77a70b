"""`aq.align`: the clocks of several loggers of one drive."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.align.mapping import SignalMap
from aqualog.core.errors import AqualogError, ConfigError, SignalError
from aqualog.core.vehicle import Vehicle
from aqualog.face.arguments import names_of, number_of, text_of
from aqualog.face.drive import Drive, read, vehicle_of
from aqualog.face.listener import Listener, Progress, listener
from aqualog.face.result import PathLike, Result, Writers, flat, rows_table, text_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.align.clock import ClockFit
    from aqualog.align.quantity import Quantity
    from aqualog.report.sections import Report

__all__ = ["Alignment", "align", "check_quantity"]


@dataclass(frozen=True, eq=False, repr=False)
class Alignment(Result):
    """Clock offset, drift and scale of each source against a reference.

    `fits` and `refused` have an entry for each source that could and could not be aligned, `left_out` for each file
    without the quantity. `compared` are the samples, that of the reference first; `before` is the map that was given.
    """

    compared: tuple[Quantity, ...]
    fits: Mapping[str, ClockFit]
    refused: Mapping[str, AqualogError]
    quantity: str
    before: SignalMap
    left_out: Mapping[str, AqualogError]

    @property
    def offsets(self) -> dict[str, float]:
        """By how much each source is late against the reference. [s]"""
        return {file: fit.taken_s for file, fit in self.fits.items()}

    @cached_property
    def map(self) -> SignalMap:
        """The signal map with the clocks that were found, for `aq.read(..., map=...)`."""
        from aqualog.align.mapping import SourceClock

        clocks = dict(self.before.clocks)
        for file, fit in self.fits.items():
            drift = fit.drift_ppm if fit.drift_significant else 0.0
            clocks[file] = SourceClock(round(fit.taken_s, 6), round(drift, 3), round(fit.mid_ns * 1e-9, 3))
        return replace(self.before, clocks=clocks)

    @cached_property
    def document(self) -> dict[str, Any]:
        from aqualog.report.alignment import alignment_document

        return alignment_document(self.compared, {**self.fits, **self.refused}, self.quantity, self.left_out)

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`sources`: a row for each, columns as the fields of `ClockFit`, intervals as `..._low` and `..._high`."""
        return {"sources": rows_table(flat(s) for s in self.document["sources"])}

    def _report(self) -> Report:
        from aqualog.report.alignment import alignment_report

        return alignment_report(self.compared, {**self.fits, **self.refused}, self.quantity, self.left_out)

    def headline(self) -> str:
        reference = self.compared[0]
        lines = [f"{self.quantity.replace('_', ' ')} against {reference.file} ({reference.label})"]
        for file, fit in self.fits.items():
            low, high = fit.slip_offset_ci95 if fit.has_slip else fit.offset_ci95
            drift = f", drift {fit.drift_ppm:+.0f} ppm" if fit.drift_significant else ""
            lines.append(f"  {file}: {fit.taken_s:+.4f} s (95 %: {low:+.4f} ... {high:+.4f}){drift}")
        lines += [f"  {file}: refused: {e.what}" for file, e in self.refused.items()]
        return "\n".join([*lines, *(f"  {file}: left out: {e.what}" for file, e in self.left_out.items())])

    def plot(self) -> go.Figure:
        """Return the quantity of all sources on the clock of the reference, and each source less the reference."""
        from aqualog.report.alignment import alignment_figures
        from aqualog.report.figures import plotly_figure, side_by_side

        if not self.fits:
            sentence = {"text": "; ".join(e.what for e in self.refused.values()), "showarrow": False}
            return plotly_figure({"data": [], "layout": {"annotations": [sentence]}})
        found = [(c, self.fits[c.file]) for c in self.compared[1:] if c.file in self.fits]
        return side_by_side(alignment_figures(self.compared[0], found, self.quantity), columns=1)

    def files(self) -> Writers:
        """Return `alignment.json`, and `map.toml` if any source was aligned."""
        from aqualog.config.signal_map import map_text

        files = {"alignment.json": self._json_file()}
        return {**files, **({"map.toml": text_file(lambda: map_text(self.map))} if self.fits else {})}

    def write_map(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the signal map with the clocks that were found; a ConfigError if no source was aligned."""
        if not self.fits:
            raise ConfigError("no clock was found", where=str(path), expected="at least one source that matches")
        return self._write_as("map.toml", path, force=force)


def align(
    reference: Drive | PathLike | Iterable[PathLike],
    *sources: PathLike,
    quantity: str = "speed",
    channels: Mapping[str, str] | None = None,
    map: PathLike | SignalMap | None = None,
    vehicle: PathLike | Vehicle | None = None,
    dbc: PathLike | Iterable[PathLike] = (),
    max_offset_s: float = 10.0,
    start_offset_s: float | None = None,
    progress: Progress = None,
) -> Alignment:
    """Find the clock offset (and drift) between sources from a quantity that both carry.

    A positive offset means that the source is late against the reference. A weak or ambiguous match is refused. Where
    the clocks have nothing in common, both are first taken to begin at the same moment.

    Parameters
    ----------
    reference : str, Path, several of them, or Drive
        The file whose clock counts. Of several, and of a drive from `aq.read`, the first file.
    *sources : str or Path
        The other files.
    quantity : str
        `speed` or `yaw_rate`.
    channels : mapping, optional
        Name of a file to the channel in it, where names do not show which one it is.
    map : str, Path or SignalMap, optional
        Which channel is which signal; `Alignment.map` keeps it and adds the clocks.
    vehicle : Vehicle, str or Path, optional
        For wheel speeds.
    dbc : str, Path or several
        CAN databases for raw frames.
    max_offset_s : float
        Search range, 0.1 to 3600. [s]
    start_offset_s : float, optional
        Rough offset of clocks that are far apart. [s]
    progress : callable, optional
        Called with each step of the work, such as `print`.

    Raises
    ------
    LogError, SignalError, ConfigError

    Examples
    --------
    >>> r = aq.align("wheels.csv", "gps.csv")
    >>> drive = aq.read(["wheels.csv", "gps.csv"], map=r.map)
    """
    check_quantity(quantity)
    max_offset_s = number_of(max_offset_s, "max_offset_s", 0.1, 3600.0, "s")
    if start_offset_s is not None:
        start_offset_s = number_of(start_offset_s, "start_offset_s", -1e12, 1e12, "s")
    if not isinstance(channels, Mapping | None):
        raise TypeError(f"channels: expected a mapping of file to channel, not {type(channels).__name__}")
    hear = listener(progress)
    if isinstance(reference, Drive):
        if sources or map is not None or dbc != ():
            raise ConfigError(
                "files, map or dbc beside a drive", expected='them in aq.read(["a.csv", "b.csv"], map=...)'
            )
        drive = reference
    else:
        first = names_of(reference)
        drive = read([*first, *names_of(sources)], map, vehicle, dbc=dbc)
    if len(drive.paths) < 2:
        raise ConfigError("align compares different files", expected="a reference and at least one other file")
    files = [p.name for p in drive.paths]
    for file, channel in (channels or {}).items():
        if file not in files or not channel:
            raise ConfigError(
                f'channel "{file}={channel}"', expected=f"FILE=CHANNEL with FILE one of {', '.join(files)}"
            )
    with drive.reading():
        compared, left_out = _compared(drive, vehicle_of(vehicle, drive), quantity, channels or {}, hear)
        fits: dict[str, ClockFit] = {}
        refused: dict[str, AqualogError] = {}
        for source in compared[1:]:
            hear(f"comparing {source.file} with {compared[0].file}")
            try:
                fits[source.file] = _compare(compared[0], source, quantity, max_offset_s, start_offset_s)
            except AqualogError as error:
                refused[source.file] = error
    for file, refusal in refused.items():
        hear.failed(file, refusal.line())
    notes = list(drive.changes())
    if files[0] in left_out:
        notes.append(f"{files[0]} carries no {quantity.replace('_', ' ')}: {compared[0].file} is the reference")
    return Alignment(
        tuple(compared), fits, refused, quantity, drive.signal_map, left_out, notes=tuple(notes),
        has_loss=bool(refused or left_out or notes), sources=drive.sources,
    )  # fmt: skip


def check_quantity(quantity: str) -> None:
    """Refuse a quantity that is not known."""
    from aqualog.align.quantity import QUANTITIES

    if text_of(quantity, "quantity") not in QUANTITIES:
        raise ConfigError(f'quantity "{quantity[:60]}"', expected=" or ".join(QUANTITIES))


def _compared(
    drive: Drive, vehicle: Vehicle, quantity: str, channels: Mapping[str, str], hear: Listener
) -> tuple[list[Quantity], dict[str, AqualogError]]:
    """Return the quantity of each file that carries it, and of the others why they are left out."""
    from aqualog.align.load import read_options
    from aqualog.align.quantity import find_quantity
    from aqualog.io.open_log import DriveLog

    with DriveLog(list(drive.paths), read_options(drive.signal_map, list(drive.dbc))) as log:
        hear("reading")
        found = log.read(log.channels())
    compared: list[Quantity] = []
    left_out: dict[str, AqualogError] = {}
    for name in (p.name for p in drive.paths if p.name not in log.goes_on):
        own = [c for (file, _), c in found.items() if file == name]
        try:
            compared.append(
                find_quantity(
                    own, quantity=quantity, signal_map=drive.signal_map, vehicle=vehicle, named=channels.get(name)
                )
            )
        except SignalError as error:
            if name in channels:  # asked for by name
                raise
            left_out[name] = error
    if len(compared) < 2:
        one = SignalError("parts of one recording, on one clock", where=drive.name, expected="another logger's file")
        raise next(iter(left_out.values()), one)
    return compared, left_out


def _compare(
    reference: Quantity, source: Quantity, quantity: str, max_offset: float, start_offset: float | None
) -> ClockFit:
    from aqualog.align.clock import estimate_clock

    if start_offset is None:
        apart = reference.absolute != source.absolute or not (
            source.t_ns[0] <= reference.t_ns[-1] and reference.t_ns[0] <= source.t_ns[-1]
        )
        start_offset = float(source.t_ns[0] - reference.t_ns[0]) * 1e-9 if apart else 0.0
    return estimate_clock(
        reference.t_ns, reference.x, source.t_ns, source.x, max_offset_s=max_offset, start_offset_s=start_offset,
        quantity="v_x" if quantity == "speed" else quantity,
    )  # fmt: skip
