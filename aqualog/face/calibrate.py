"""`aq.calibrate`: what detectors must know of a car, from its dry drives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ConfigError
from aqualog.core.vehicle import Vehicle
from aqualog.face.arguments import number_of, text_of
from aqualog.face.drive import Drive, sources_of, vehicle_needed
from aqualog.face.drives import DrivesLike, drives_of, load_drives, repeated_of, with_own_names
from aqualog.face.listener import Progress, listener
from aqualog.face.result import PathLike, Result, Writers, bars, flat, rows_table, text_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.calibrate.records import Calibration as Found
    from aqualog.checks.several import OfDrives
    from aqualog.core.records import Signals
    from aqualog.report.sections import Report

__all__ = ["Calibration", "calibrate"]


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Result):
    """Parameters of a car with 95 % intervals, and what the drives do not determine.

    `found` holds the records, `drives` the drives that were used, `before` the vehicle that was given,
    `checks` what does not fit among the signals.
    """

    drives: tuple[Drive, ...]
    before: Vehicle
    found: Found
    file_notes: tuple[str, ...] = ()
    checks: OfDrives = ()

    @cached_property
    def vehicle(self) -> Vehicle:
        """The car with the calibrated values, as `write_vehicle` writes it."""
        from aqualog.calibrate.derive import calibrated

        return calibrated(self.before, self.found.parameters, self.found.transfers, self.found.spread)

    @cached_property
    def document(self) -> dict[str, Any]:
        from aqualog.report.calibration import calibration_document
        from aqualog.report.drive.document import drive_remark_rows

        logs = [str(p) for d in self.drives for p in d.paths]
        document = calibration_document(self.found, logs=logs, notes=self.file_notes)
        return {**document, "checks": drive_remark_rows(self.checks)}

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`parameters`, `drives` and `residuals`.

        `residuals` are those of the force balance in windows: drive, v [m/s], force [N], before and after [m/s²].
        """
        import polars as pl

        drives = [{k: v for k, v in d.items() if k != "left_out_s"} for d in self.document["drives"]]
        residuals = [
            pl.DataFrame({n: getattr(d, n) for n in ("v", "force", "before", "after")}).select(
                pl.lit(d.name).alias("drive"), pl.all()
            )
            for d in self.found.drives
        ]
        return {
            "parameters": rows_table(flat(p) for p in self.document["parameters"]),
            "drives": rows_table(flat(d) for d in drives),
            **({"residuals": pl.concat(residuals)} if residuals else {}),
            **({"passes": rows_table(flat(p) for p in self.document["passes"])} if self.found.passes else {}),
        }

    @property
    def printed(self) -> Mapping[str, pl.DataFrame]:
        """The tables without `residuals`."""
        return {n: t for n, t in self.tables.items() if n != "residuals"}

    def _report(self) -> Report:
        from aqualog.report.calibration import calibration_report

        return calibration_report(self.found, self.file_notes, tuple(r for _, r in self.checks))

    def headline(self) -> str:
        from aqualog.report.calibration import estimated, parameter_cells

        found = self.found
        known = [p for p in found.parameters if p.identified]
        # an offset of each drive follows: the tables have it
        rows = [parameter_cells(p) for p in known if "[" not in p.name]
        values = [f"{name} {value} {'' if unit == '–' else f'{unit} '}({interval or 'given'})"
                  for name, value, interval, unit, *_ in rows]  # fmt: skip
        not_found = ", ".join(p.name for p in found.parameters if not p.identified and "[" not in p.name)
        return "\n".join(
            [
                f"{found.vehicle_name}: {estimated(found)}; value (95 %)",
                *("  " + "; ".join(values[i : i + 2]) for i in range(0, len(values), 2)),
                *([f"  not determined: {not_found}"] if not_found else []),
            ]
        )

    def plot(self) -> go.Figure:
        """Return the residual of the force balance before and after, over speed and over wheel force.

        Of passes over water, the speed at which each lost a wheel.
        """
        from aqualog.report.calibration import balance_residuals
        from aqualog.report.figures import side_by_side

        if self.found.passes:
            lost = [3.6 * p.v_lost for p in self.found.passes if p.v_lost > 0.0]
            named = [p.name for p in self.found.passes if p.v_lost > 0.0]
            return bars("Passes that lost a front wheel", named, lost, "km/h")
        return side_by_side(balance_residuals(self.found))

    def files(self) -> Writers:
        """Return `calibration.json`, `calibrated.toml` and `calibration.html`."""
        from aqualog.config.vehicle import calibrated_toml

        title = f"{self.found.vehicle_name}, {len(self.drives)} drives"
        return {
            "calibration.json": self._json_file(),
            "calibrated.toml": text_file(lambda: calibrated_toml(self.before, self.found)),
            "calibration.html": self._page(title),
        }

    def write_vehicle(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the vehicle file with the calibrated values, each with its interval and where it comes from."""
        return self._write_as("calibrated.toml", path, force=force)

    def write_page(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the page with tables and residuals (HTML)."""
        return self._write_as("calibration.html", path, force=force)


def calibrate(
    drives: DrivesLike,
    vehicle: PathLike | Vehicle | None = None,
    *,
    fix: Mapping[str, float] | None = None,
    accept: bool = False,
    wet: bool = False,
    progress: Progress = None,
) -> Calibration:
    """Estimate what detectors must know of a car from its dry drives, or how its tyres float from wet ones.

    Mass, rolling resistance, drag area, effective radii, torque gain, accelerometer offset, and the polynomials of tie
    rods and steering. The drives must be dry and with the same load; four or more show how drives differ.

    Parameters
    ----------
    drives : Drive, Signals, str, Path or several
        Each `Drive` and each file is a drive; the files of a folder are one drive. A drive that cannot be read is left
        out, and `progress` hears why.
    vehicle : Vehicle, str or Path
        Without it that of the first drive; one of them must be given, for it says which axle is driven.
    fix : mapping, optional
        Values that are known: `mass` [kg], `torque_gain` [-], `drag_area` [m²], `rolling_resistance` [-]. With `wet`:
        `tread` [mm] and `pressure` [bar, gauge], which must be given, and `depth` of the water [mm] where logs lack it.
    accept : bool
        Take estimates in place of values that the vehicle file gives and their intervals exclude; else those stay.
    wet : bool
        Fit the law of water (`v_anchor`, `contact_exponent`) to passes over water from partial to full aquaplaning.
    progress : callable, optional
        Called with each step of the work, such as `print`.

    Raises
    ------
    LogError, SignalError, FitError, ConfigError
        SignalError if no drive can be used, FitError if none has straight, unbraked, dry driving.

    Examples
    --------
    >>> r = aq.calibrate(["dry1.mf4", "dry2.mf4"], "car.toml", fix={"mass": 1482.0})
    >>> r.write_vehicle("calibrated.toml")
    >>> aq.detect("wet.mf4", r.vehicle)
    """
    from aqualog.calibrate.derive import check_fixed
    from aqualog.trade.water_law import calibrate_wet, check_known

    hear = listener(progress)
    if not isinstance(fix, Mapping | None):
        raise TypeError(f"fix: expected a mapping of name to value, not {type(fix).__name__}")
    fixed = {text_of(n, "fix"): number_of(v, f"fix {n}", -1e9, 1e9) for n, v in (fix or {}).items()}
    if wet:
        if accept:
            raise ConfigError("accept does not apply to passes over water", expected="wet or accept")
        check_known(fixed)
    else:
        check_fixed(fixed)
    named = drives_of(drives)
    (all_drives,) = with_own_names(named)
    car = vehicle_needed(vehicle, all_drives[0] if all_drives else None)
    loaded = load_drives(all_drives, car, hear)
    hear("estimating")

    def work(signals: dict[str, Signals]) -> Found:
        from aqualog.calibrate.run import calibrate as run

        if wet:
            return calibrate_wet(list(signals.values()), list(signals), car, fixed)
        return run(list(signals.values()), list(signals), car, fixed, accept=accept)

    found = loaded.tried(work, hear)
    from aqualog.checks.several import look_at_all, sentences

    # mass and torque gain are what is estimated
    checks = look_at_all(loaded.signals, car, but=("torque", "resistance"))
    used, notes = tuple(loaded.used), (*repeated_of(named), *loaded.notes, *loaded.changes, *sentences(checks))
    return Calibration(
        used, car, found, notes, checks, notes=(*notes, *found.notes),
        has_loss=loaded.has_loss or bool(loaded.changes) or (not wet and len(found.drives) < len(used)),
        sources=sources_of((p for d in all_drives for p in d.sources), vehicle),
    )  # fmt: skip
