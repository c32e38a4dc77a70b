"""`aq.slip_slope`: the slip slope of each driven wheel in one drive."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import FitError, SignalError
from aqualog.core.vehicle import Vehicle
from aqualog.face.arguments import number_of, text_of
from aqualog.face.drive import Drive, DriveLike, drive_of, sources_of, vehicle_needed
from aqualog.face.listener import Progress, listener
from aqualog.face.result import PathLike, Result, Writers, table, text_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.core.records import Remark
    from aqualog.detect.slip_slope.direct_records import DirectResult
    from aqualog.detect.slip_slope.regression import Line
    from aqualog.report.sections import Report

__all__ = ["SLIP_SLOPE_FILES", "SlipSlope", "slip_slope"]

SLIP_SLOPE_FILES = ("slip_slope.json", "slip_slope.csv", "slip_slope.html")


@dataclass(frozen=True, eq=False, repr=False)
class SlipSlope(Result):
    """Slip slope C_s/F_z [-] of each driven wheel, its interval, and whether it stayed the same.

    `slopes` holds the records, `file_notes` the sentences on files and signals, `checks` what does not fit among these.
    """

    drive: Drive
    vehicle: Vehicle
    slopes: DirectResult
    file_notes: tuple[str, ...] = ()
    checks: tuple[Remark, ...] = ()

    @cached_property
    def document(self) -> dict[str, Any]:
        from aqualog.report.drive.document import remark_rows
        from aqualog.report.slope import slope_document

        document = slope_document(self.slopes, log=self.drive.name, notes=self.file_notes)
        return {**document, "checks": remark_rows(self.checks)}

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`slopes` of the whole drive, `segments` of its parts, `recursive` and `samples`.

        The first two have the columns of slip_slope.csv. `samples` are those of the regression: place, t [s],
        traction coefficient mu [-], slip [-].
        """
        import polars as pl

        whole = [
            _row(p.place, (float(p.t[0]), float(p.t[-1])) if p.t.size else (math.nan, math.nan), p.seconds, p.line)
            for p in self.slopes.places
        ]
        parts = [_row(p.place, (s.start_s, s.end_s), s.seconds, s.line) for p in self.slopes.places for s in p.segments]
        recursive = [
            {"place": r.place, "slope": r.slope, "slope_sd": r.slope_sd, "learnt_s": r.seconds, "changes": r.alarms}
            for r in self.slopes.recursions or [p.recursion for p in self.slopes.places]
        ]
        samples = [
            pl.DataFrame({"t": p.t, "mu": p.mu, "slip": p.slip}).select(pl.lit(p.place).alias("place"), pl.all())
            for p in self.slopes.places
        ]
        return {
            "slopes": table(whole, _ROW, text=("place", "reason"), whole=("samples",)),
            "segments": table(parts, _ROW, text=("place", "reason"), whole=("samples",)),
            "recursive": table(recursive, "place slope slope_sd learnt_s changes", text=("place",), whole=("changes",)),
            "samples": pl.concat(samples) if samples else table([], "place t mu slip", text=("place",)),
        }

    @property
    def printed(self) -> Mapping[str, pl.DataFrame]:
        """The tables without `samples`."""
        return {n: t for n, t in self.tables.items() if n != "samples"}

    def _report(self) -> Report:
        from aqualog.report.slope import slope_report

        return slope_report(self.slopes, self.file_notes, self.checks)

    def headline(self) -> str:
        from aqualog.report.slope import slope_lines, way_sentence

        found = self.slopes
        return "\n".join(
            [
                f"{self.drive.title}, {found.vehicle_name}: {found.duration_s:.1f} s at {found.rate_hz:.6g} Hz",
                way_sentence(found),
                *(f"  {line}" for line in slope_lines(found)),
            ]
        )

    def plot(self) -> go.Figure:
        """Return slip over traction of each place, the slope over the session, and the time used."""
        from aqualog.report.figures import side_by_side
        from aqualog.report.slope_figures import slope_plots

        return side_by_side(list(slope_plots(self.slopes).values()))

    def files(self) -> Writers:
        """Return `slip_slope.json`, `slip_slope.csv` and `slip_slope.html`."""
        from aqualog.report.slope import slope_csv

        return {
            "slip_slope.json": self._json_file(),
            "slip_slope.csv": text_file(lambda: slope_csv(self.slopes)),
            "slip_slope.html": self._page(self.drive.title),
        }


_ROW = "place start_s end_s used_s samples slope slope_low slope_high offset offset_low offset_high reason"


def _row(place: str, span: tuple[float, float], seconds: float, line: Line) -> dict[str, Any]:
    offset = (line.offset, *line.offset_ci) if line.told else (math.nan,) * 3
    values = (place, *span, seconds, line.samples, line.slope, *line.slope_ci, *offset, line.reason)
    return dict(zip(_ROW.split(), values, strict=True))


def slip_slope(
    drive: DriveLike,
    vehicle: PathLike | Vehicle | None = None,
    *,
    method: str = "auto",
    traction: str = "auto",
    mu_max: float = 0.3,
    delay: float | None = None,
    progress: Progress = None,
) -> SlipSlope:
    """Estimate the slip slope C_s/F_z of each driven wheel.

    Slip is regressed on traction over straight, unbraked driving. The intervals are from blocks of the drive left out
    in turn.

    Parameters
    ----------
    drive : Drive, Signals, str, Path or several
        From `aq.read`, or files of ONE drive that need no signal map.
    vehicle : Vehicle, str or Path
        Without it that of the drive; one of them must be given, for it says which axle is driven.
    method : str
        `auto`, `axle` (driven against free wheels), `velocity` (against v_x) or `differential` (recursive only).
    traction : str
        `auto`, `torque` or `accelerometer` (one driven axle).
    mu_max : float
        Largest traction coefficient used, 0.02 to 1. [-]
    delay : float, optional
        By how much v_x is late against the wheels, -1 to 1; else it is estimated (`velocity` only). [s]
    progress : callable, optional
        Called with each step of the work, such as `print`.

    Raises
    ------
    LogError, SignalError, ConfigError
        SignalError also if the drive does not determine the slope.

    Examples
    --------
    >>> r = aq.slip_slope("drive.mf4", "car.toml")
    >>> r.tables["slopes"].select("place", "slope", "slope_low", "slope_high")
    """
    hear = listener(progress)
    one = drive_of(drive)
    car = vehicle_needed(vehicle, one)
    mu_max = number_of(mu_max, "mu_max", 0.02, 1.0)
    if delay is not None:
        delay = number_of(delay, "delay", -1.0, 1.0, "s")
    method, traction = text_of(method, "method"), text_of(traction, "traction")
    with one.reading():
        from aqualog.checks.look import look
        from aqualog.detect.slip_slope.direct import slip_slopes

        loaded = one.load(car, report=hear)
        hear.detail(f"{len(loaded.symbols)} signals, {loaded.frame.height} samples at {1e9 / loaded.dt_ns:g} Hz")
        changes = one.changes()
        hear("estimating")
        checks = look(loaded, car)
        try:
            found = slip_slopes(loaded, car, method=method, traction=traction, mu_max=mu_max, delay=delay)
        except (SignalError, FitError):
            for remark in checks:  # they often hold the cause, such as a wrong unit
                hear.note(remark.sentence)
            raise
    notes = (*loaded.quality.notes, *changes, *(r.sentence for r in checks))
    return SlipSlope(
        one, car, found, notes, checks, notes=(*notes, *found.notes), has_loss=loaded.quality.has_loss or bool(changes),
        sources=sources_of(one.sources, vehicle),
    )  # fmt: skip
