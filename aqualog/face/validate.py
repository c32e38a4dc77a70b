"""`aq.validate`: whether the simulation of a car is valid on measured drives, and why not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import AqualogError, ConfigError
from aqualog.core.vehicle import Vehicle
from aqualog.face.arguments import file_of, text_of
from aqualog.face.detect import model_of
from aqualog.face.diagnose import Diagnosis, diagnose
from aqualog.face.drive import sources_of, vehicle_needed
from aqualog.face.drives import DrivesLike, drives_of, load_drives, repeated_of, with_own_names
from aqualog.face.listener import Progress, listener
from aqualog.face.result import PathLike, Result, Writers, flat, table

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.core.records import Signals
    from aqualog.model.term import Model
    from aqualog.report.sections import Report
    from aqualog.validate.records import Validity

__all__ = ["Validation", "validate"]


@dataclass(frozen=True, eq=False, repr=False)
class Validation(Result):
    """Whether the simulation is valid: share within the boundaries, limits of speed, ratings, and why.

    `found` holds the records, `method` the one that the sentence goes by, `why` the diagnosis of the same drives.
    """

    found: Validity
    method: str
    logs: tuple[str, ...]
    vehicle_name: str
    why: Diagnosis | None = None

    @cached_property
    def document(self) -> dict[str, Any]:
        from aqualog.report.validation import validation_document

        return validation_document(
            self.found, method=self.method, vehicle=self.vehicle_name, logs=self.logs, notes=self.notes,
            why=None if self.why is None else self.why.document,
        )  # fmt: skip

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`plots` with their boundaries, `limits` of speed, `ratings`, and `drives`."""
        d = self.document
        plots = [{**flat(r), "worst_drive": None, **flat(r["worst"] or {}, "worst_")} for r in d["plots"]]
        limits = [
            {**x, "driven_low_kmh": x["driven_kmh"][0], "driven_high_kmh": x["driven_kmh"][1], "valid": int(x["valid"])}
            for x in d["limits"]
        ]
        return {
            "plots": table(
                plots,
                "y x unit x_unit points within within_share judged_s x_offset x_gain y_offset y_gain tolerance_from "
                "worst_drive worst_by worst_start_s worst_end_s repeated_drives t_factor scatter noise",
                text=("y", "x", "unit", "x_unit", "tolerance_from", "worst_drive"),
                whole=("points", "within", "repeated_drives"),
            ),
            "limits": table(
                limits, "condition valid not_above_kmh driven_low_kmh driven_high_kmh within_share judged_s",
                text=("condition",), whole=("valid",),
            ),
            "ratings": table(
                d["ratings"], "signal rating corridor phase magnitude slope delay_s judged_s", text=("signal",)
            ),
            "drives": table(d["drives"], "name duration_s judged_s", text=("name",)),
        }  # fmt: skip

    def _report(self) -> Report:
        from aqualog.report.validation import validation_report

        return validation_report(self.found, self.document)

    def headline(self) -> str:
        why = self.document["diagnosis"]
        return "\n".join([self.document["sentence"], *([f"Why: {why['sentence']}"] if why else [])])

    def plot(self) -> go.Figure:
        """Return each signal over time with its boundaries."""
        from aqualog.report.figures import side_by_side
        from aqualog.report.validation_figures import validation_figures

        return side_by_side([f for n, f in validation_figures(self.found).items() if n.startswith("time-")])

    def files(self) -> Writers:
        """Return `validation.json` and `validation.html`."""
        title = f"{self.vehicle_name}, {', '.join(Path(p).name for p in self.logs[:3])}"
        return {"validation.json": self._json_file(), "validation.html": self._page(title)}

    def write_page(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the page to exactly this path."""
        return self._write_as("validation.html", path, force=force)


def validate(
    drives: DrivesLike,
    vehicle: PathLike | Vehicle | None = None,
    *,
    method: str = "boundary",
    boundaries: PathLike | None = None,
    model: PathLike | Model | None = None,
    why: bool = True,
    progress: Progress = None,
) -> Validation:
    """Judge whether the simulation of a car is valid on measured drives.

    By the methods of ISO 19364 [iso19364_2016] and ISO/TS 18571 [iso18571_2024], on another test than theirs.

    Parameters
    ----------
    drives : Drive, Signals, str, Path or several
        Each `Drive` and each file is a drive. Three or more that repeat each other give the tolerances by their spread.
    vehicle : Vehicle, str or Path
        What the simulation believes. Without it that of the first drive.
    method : str
        `boundary` (ISO 19364) or `18571`: which one the sentence goes by. The document has both.
    boundaries : str or Path, optional
        Tolerances of the cross plots (TOML); built in: aqualog's own.
    model : Model, str or Path, optional
        Effects on top of the base simulation.
    why : bool
        Diagnose the same drives too, which takes about a minute.
    progress : callable, optional
        Called with each step of the work, such as `print`.

    Raises
    ------
    LogError, SignalError, ConfigError
        SignalError if no drive can be used.

    Examples
    --------
    >>> r = aq.validate(["monday.mf4", "tuesday.mf4", "friday.mf4"], "car.toml", why=False)
    >>> r.document["sentence"], r.tables["limits"]
    """
    from aqualog.report.validation import METHODS

    hear = listener(progress)
    if text_of(method, "method") not in METHODS:
        raise ConfigError(f'method "{method}"', expected=" or ".join(METHODS))
    plan = _plan(boundaries)
    named = drives_of(drives)
    (own,) = with_own_names(named)
    car = vehicle_needed(vehicle, own[0] if own else None)
    known = model_of(model, car, hear)
    loaded = load_drives(own, car, hear)

    def work(signals: dict[str, Signals]) -> Validity:
        from aqualog.model.term import Model
        from aqualog.validate.run import validate as run

        return run(list(signals.items()), car, model=known or Model(), plan=plan, progress=hear)

    found = loaded.tried(work, hear)
    notes: Sequence[str] = (*loaded.notes, *loaded.changes, *found.notes)
    notes = (*repeated_of(named), *notes)
    cause = None
    if why:
        try:
            cause = diagnose(loaded.used, car, model=known, views=False, progress=hear)
        except AqualogError as error:  # validity stands without it
            notes = (*notes, f"why: {error.line()}")
    return Validation(
        found, method, tuple(str(p) for d in loaded.used for p in d.paths), car.name, cause, notes=tuple(notes),
        has_loss=loaded.has_loss or bool(loaded.changes),
        sources=sources_of((p for d in own for p in d.sources), vehicle, model, boundaries),
    )  # fmt: skip


def _plan(boundaries: PathLike | None) -> Any:
    from aqualog.config.boundary import load_boundaries
    from aqualog.validate.records import Plan

    return Plan() if boundaries is None else load_boundaries(file_of(boundaries, "boundaries"))
