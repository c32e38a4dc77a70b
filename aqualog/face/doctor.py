"""`aq.doctor`: what is wrong with a log, what was lost of it, and what to do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ExitCode
from aqualog.core.vehicle import Vehicle
from aqualog.face.drive import DriveLike, drive_of, vehicle_of
from aqualog.face.listener import Progress, listener
from aqualog.face.result import PathLike, Result, Writers, text_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.doctor.findings import Examination
    from aqualog.face.drive import Drive
    from aqualog.report.sections import Report

__all__ = ["Health", "doctor", "exit_code"]


@dataclass(frozen=True, eq=False, repr=False)
class Health(Result):
    """What is wrong with the files of one drive."""

    drive: Drive
    examination: Examination
    sources: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def has_loss(self) -> bool:  # type: ignore[override]
        """Whether data was lost."""
        return self.examination.has_loss

    @property
    def exit_code(self) -> ExitCode:
        """Exit code of the command."""
        return exit_code(self.examination)

    @cached_property
    def document(self) -> dict[str, Any]:
        """The JSON document of `aqualog doctor`."""
        from aqualog.report.examination import examination_document

        return examination_document(self.examination)

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`findings` and `files`."""
        import polars as pl

        from aqualog.doctor.findings import FileState, Finding

        records = {"findings": Finding, "files": FileState}
        return {
            n: pl.DataFrame(self.document[n], None if self.document[n] else [f.name for f in fields(kind)],
                            infer_schema_length=None)
            for n, kind in records.items()
        }  # fmt: skip

    def text(self) -> str:
        """Return what the command prints."""
        from aqualog.report.text import report_text

        return report_text(self._report())

    def _report(self) -> Report:
        from aqualog.report.examination import examination_report

        return examination_report(self.examination)

    def headline(self) -> str:
        """Return the most serious findings."""
        return "\n".join(self.text().rstrip("\n").split("\n")[:7])

    def plot(self) -> go.Figure:
        """Return how many findings each file has, by weight."""
        import plotly.graph_objects as go

        made = go.Figure()
        files = [f.file for f in self.examination.files]
        for level in ("unreadable", "lost", "mended", "doubt"):
            own = [f.file for f in self.examination.findings if f.level == level]
            made.add_bar(x=files, y=[own.count(f) for f in files], name=level)
        made.update_layout(title=self.drive.title, barmode="stack", template="plotly_white")
        made.update_yaxes(title="findings")
        return made

    def files(self) -> Writers:
        """Return `doctor.json` and `doctor.txt`."""
        return {"doctor.json": self._json_file(), "doctor.txt": text_file(self.text)}


def exit_code(found: Examination) -> ExitCode:
    """Return the exit code: a loss counts more than the absence of signals in the rest, as with `inspect`."""
    if found.is_unreadable:
        return ExitCode.FAILED
    if found.has_loss and any(f.samples for f in found.files):
        return ExitCode.PARTIAL
    if any(f.kind == "no_signals" for f in found.findings):
        return ExitCode.NOTHING_USABLE
    return ExitCode.PARTIAL if found.has_loss else ExitCode.DONE


def doctor(drive: DriveLike, vehicle: PathLike | Vehicle | None = None, *, progress: Progress = None) -> Health:
    """Report what is wrong with the files of one drive, what was lost, and what to do.

    Every file is read to its end. A file that cannot be read is a finding, not an error.

    Parameters
    ----------
    drive : Drive, str, Path or several
        From `aq.read`, or files of ONE drive that need no signal map.
    vehicle : Vehicle, str or Path, optional
        Without it that of the drive, else a default car.
    progress : callable, optional
        Called with each step of the work, such as `print`.

    Examples
    --------
    >>> aq.doctor("drive.mf4").tables["findings"]
    """
    from aqualog.doctor.examine import examine

    one = drive_of(drive)
    with one.reading():
        found = examine(
            list(one.paths), vehicle=vehicle_of(vehicle, one), signal_map=one.signal_map, dbc=one.dbc,
            report=listener(progress),
        )  # fmt: skip
    return Health(one, found, one.sources)
