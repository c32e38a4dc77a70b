"""`aq.inspect` and `aq.doctor`: what a log holds, and what is wrong with it; the test matrix of a campaign."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ExitCode
from aqualog.core.vehicle import Vehicle
from aqualog.face.drive import DriveLike, drive_of, vehicle_of
from aqualog.face.listener import Progress, listener
from aqualog.face.result import PathLike, Result, Writers, bars, document_head, rows_table, text_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.align.mapping import SignalMap
    from aqualog.align.overview import ChannelOverview
    from aqualog.align.propose import Proposal
    from aqualog.campaign.definition import Campaign
    from aqualog.doctor.findings import Examination
    from aqualog.face.drive import Drive
    from aqualog.report.sections import Report

__all__ = ["Contents", "Health", "Matrix", "doctor", "exit_code", "inspect", "matrix"]


_MOST_SHOWN = 12  # channels without a signal that are named in the text
_HEADER = ("channel", "unit", "samples", "Hz", "from s", "to s", "min", "max", "gaps", "faults", "signal?")


@dataclass(frozen=True, eq=False, repr=False)
class Contents(Result):
    """The channels of one drive's files, and the signals that they look like.

    `unmapped` are the channels, `name [unit]`, that look like no signal. `goes_on`: of each file that goes on with a
    recording, the file that begins it and has the channels.
    """

    drive: Drive
    formats: tuple[str, ...]
    overviews: tuple[ChannelOverview, ...]
    proposals: Mapping[str, Proposal]
    absolute: frozenset[str]
    unmapped: tuple[str, ...] = ()
    goes_on: Mapping[str, str] = field(default_factory=dict)

    @property
    def exit_code(self) -> ExitCode:
        """Exit code of the command."""
        if self.has_loss:
            return ExitCode.PARTIAL
        return ExitCode.DONE if self.overviews else ExitCode.NOTHING_USABLE

    @property
    def map(self) -> SignalMap:
        """The proposed signal map, which `aq.read` takes; a guess from names, units and data."""
        return replace(self.drive.signal_map, entries={s: p.entry for s, p in self.proposals.items()})

    @cached_property
    def document(self) -> dict[str, Any]:
        return {
            **document_head(),
            "files": [{"file": str(p), "format": f} for p, f in zip(self.drive.paths, self.formats, strict=True)],
            "channels": [_plain(dataclasses.asdict(o)) for o in self.overviews],
            "proposed": {
                s: {
                    "channel": p.entry.channel[0],
                    "unit": p.entry.unit,
                    "scale": p.entry.scale,
                    "reason": p.reason,
                    "doubt": list(p.doubt),
                }
                for s, p in self.proposals.items()
            },
            "unmapped": list(self.unmapped),
            "notes": list(self.notes),
        }

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`channels` and `proposed`."""
        channels = [{k: v for k, v in c.items() if not isinstance(v, dict)} for c in self.document["channels"]]
        own = self.document["proposed"].items()
        proposed = [{"signal": s, **p, "doubt": ", ".join(p["doubt"])} for s, p in own]
        return {"channels": rows_table(channels), "proposed": rows_table(proposed)}

    def text(self) -> str:
        from aqualog.report.text import table
        from aqualog.report.values import CELL, NOTE, counted, cut

        lines = []
        by_channel = {p.entry.channel[0]: s for s, p in self.proposals.items()}
        for path, kind in zip(self.drive.paths, self.formats, strict=True):
            own = [o for o in self.overviews if o.file == path.name]
            clock = "absolute time" if path.name in self.absolute else "a clock of its own"
            begin = self.goes_on.get(path.name)
            what = f"goes on with {cut(begin, CELL)}" if begin else f"{counted(len(own), 'channel')}, {clock}"
            lines.append(f"{cut(path.name, CELL)}: {kind.upper()}, {what}")
            if own:
                rows = [_row(o, by_channel) for o in own]
                lines += [table(_HEADER, rows), ""]
        lines += self._proposed()
        if self.notes:
            lines += ["", "notes:", *(f"  {cut(n, NOTE)}" for n in self.notes)]
        return "\n".join(lines) + "\n"

    def _proposed(self) -> list[str]:
        from aqualog.report.values import CELL, cut

        if not self.proposals:
            return ["no channel looks like a signal that aqualog knows"]
        own = self.proposals.items()
        shown = ", ".join(cut(n, CELL) for n in self.unmapped[:_MOST_SHOWN])
        more = ", ..." if len(self.unmapped) > _MOST_SHOWN else ""
        return [
            "proposed signals:",
            *(f"  {s} = {proposal_words(p)}" for s, p in own),
            *([f"not mapped, {len(self.unmapped)} channels: {shown}{more}"] if self.unmapped else []),
        ]

    def headline(self) -> str:
        head = f"{self.drive.title}: {len(self.overviews)} channels"
        return "\n".join([head, *self._proposed()[:6]])

    def plot(self) -> go.Figure:
        """Return over which time each channel has samples."""
        import plotly.graph_objects as go

        made = go.Figure(
            go.Bar(
                base=[o.start_s for o in self.overviews], x=[o.end_s - o.start_s for o in self.overviews],
                y=[f"{o.file}: {o.path}" for o in self.overviews], orientation="h",
                text=[f"{o.rate_hz:.4g} Hz" for o in self.overviews],
            )
        )  # fmt: skip
        made.update_layout(title=self.drive.title, template="plotly_white", height=120 + 22 * len(self.overviews))
        made.update_xaxes(title="time [s]")
        return made

    def files(self) -> Writers:
        """Return `inspect.json` and the proposed `map.toml`."""

        def map_file() -> str:
            from aqualog.config.signal_map import map_text

            comment = f"proposed for {', '.join(p.name for p in self.drive.paths)}: check every line"
            remarks = {s: p.remark for s, p in self.proposals.items()}
            return map_text(self.map, comments=[comment], remarks=remarks, unmapped=self.unmapped)

        return {"inspect.json": self._json_file(), "map.toml": text_file(map_file)}

    def write_map(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the proposed signal map: read it before you use it."""
        return self._write_as("map.toml", path, force=force)


def inspect(drive: DriveLike, *, progress: Progress = None) -> Contents:
    """List what the files of one drive hold, and propose which channel is which signal.

    Parameters
    ----------
    drive : Drive, str, Path or several
        From `aq.read`, or files of ONE drive.
    progress : callable, optional
        Called with each step of the work, such as `print`.

    Raises
    ------
    LogError
        If nothing can be read.

    Examples
    --------
    >>> contents = aq.inspect("drive.mf4")
    >>> aq.read("drive.mf4", map=contents.map)
    """
    from aqualog.align.load import read_options
    from aqualog.align.overview import find_mounting
    from aqualog.align.propose import look_at
    from aqualog.align.propose_map import unmapped_names
    from aqualog.io.open_log import DriveLog

    one, hear = drive_of(drive), listener(progress)
    with one.reading(), DriveLog(one.paths, read_options(one.signal_map, one.dbc)) as log:
        hear("reading")
        channels, lost = log.read_readable()
        formats, faults, goes_on = log.formats, log.faults, log.goes_on
        hear("looking at the channels")
        found, proposals = look_at(channels)
    remarks = [*lost, *((p.name, n) for p, f in zip(one.paths, faults, strict=True) for n in f.notes)]
    changes = one.changes()
    notes = [*(n if n.startswith(f"{name}: ") else f"{name}: {n}" for name, n in remarks), *find_mounting(found)]
    damaged = changes or lost or any(f.truncated or f.lost_samples for f in faults)
    return Contents(
        one,
        tuple(formats),
        tuple(found),
        proposals,
        frozenset(c.info.file for c in channels if c.absolute),
        tuple(unmapped_names([c.info for c in channels], [p.entry.channel for p in proposals.values()])),
        goes_on,
        notes=(*notes, *changes),
        has_loss=bool(damaged),
        sources=one.sources,
    )


def proposal_words(p: Proposal) -> str:
    """Return channel, unit, factor and reason of a proposal in one line."""
    from aqualog.report.values import CELL, NOTE, cut

    unit = f" [{p.entry.unit}]" if p.entry.unit else ""
    scale = f" * {p.entry.scale:g}" if p.entry.scale != 1.0 else ""
    return f"{cut(p.entry.channel[0], CELL)}{unit}{scale}  ({cut(p.remark, NOTE)})"


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _row(o: ChannelOverview, by_channel: dict[str, str]) -> tuple[str, ...]:
    gaps = f"{o.gaps} (to {o.longest_gap_s:.2g} s)" if o.gaps else "-"
    symbol = by_channel.get(o.path) or by_channel.get(f"{o.file}:{o.path}") or ""
    numbers = (f"{o.start_s:.2f}", f"{o.end_s:.2f}", f"{o.low:.6g}", f"{o.high:.6g}")
    return (o.path, o.unit or "-", str(o.samples), f"{o.rate_hz:.4g}", *numbers, gaps, _faults(o), symbol)


def _faults(o: ChannelOverview) -> str:
    counts = {n.replace("_", "-"): getattr(o.faults, n) for n in type(o.faults).KINDS if n != "pauses"}
    counts["not finite"] = o.not_finite
    text = ", ".join(f"{n} {name}" for name, n in counts.items() if n)
    return ", ".join(t for t in (text, o.remark) if t) or "-"


@dataclass(frozen=True, eq=False, repr=False)
class Health(Result):
    """What is wrong with the files of one drive."""

    drive: Drive
    examination: Examination

    @property
    def exit_code(self) -> ExitCode:
        """Exit code of the command."""
        return exit_code(self.examination)

    @cached_property
    def document(self) -> dict[str, Any]:
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

    def _report(self) -> Report:
        from aqualog.report.examination import examination_report

        return examination_report(self.examination)

    def plot(self) -> go.Figure:
        """Return how many findings each file has, by weight."""
        import plotly.graph_objects as go

        made = go.Figure()
        files = [f.file for f in self.examination.files]
        for level in ("unreadable", "lost", "left_out", "mended", "doubt"):
            own = [f.file for f in self.examination.findings if f.level == level]
            made.add_bar(x=files, y=[own.count(f) for f in files], name=level)
        made.update_layout(title=self.drive.title, barmode="stack", template="plotly_white")
        made.update_yaxes(title="findings")
        return made

    def files(self) -> Writers:
        """Return `doctor.json`, `doctor.txt` and `doctor.html`."""
        return {
            "doctor.json": self._json_file(), "doctor.txt": text_file(self.text),
            "doctor.html": self._page(self.drive.title),
        }  # fmt: skip

    def write_page(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the page; return its path."""
        return self._write_as("doctor.html", path, force=force)


def exit_code(found: Examination) -> ExitCode:
    """Return the exit code: a loss counts more than the absence of signals in the rest, as with `inspect`."""
    if found.is_unreadable:
        return ExitCode.FAILED
    if found.has_loss and any(f.samples for f in found.files):
        return ExitCode.PARTIAL
    if not found.ready:  # as `detect` ends
        return ExitCode.NOTHING_USABLE
    return ExitCode.PARTIAL if found.has_loss else ExitCode.DONE


def doctor(drive: DriveLike, vehicle: PathLike | Vehicle | None = None, *, progress: Progress = None) -> Health:
    """Report what is wrong with the files of one drive, what was lost, and what to do.

    Every file is read to its end. A file that cannot be read is a finding, not an error. Without a map and wheel speeds
    signals are guessed as `aq.detect` guesses them, and a finding says so.

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
    from aqualog.align.mapping import MAP_HINT
    from aqualog.doctor.examine import examine
    from aqualog.doctor.findings import Finding
    from aqualog.face.guess import guessed

    one, note = guessed(drive_of(drive))
    with one.reading():
        found = examine(
            list(one.paths), vehicle=vehicle_of(vehicle, one), signal_map=one.signal_map, dbc=one.dbc,
            report=listener(progress),
        )  # fmt: skip
    if note:
        own = Finding("doubt", "guessed", "", "", *note.partition(". ")[::2])
        found = replace(found, findings=(own, *found.findings), hint=MAP_HINT)
    return Health(one, found, has_loss=found.has_loss, sources=one.sources)


@dataclass(frozen=True, eq=False, repr=False)
class Matrix(Result):
    """What a campaign file says, held against the logs that exist."""

    campaign: Campaign
    parts: tuple[Any, ...]
    logs: int
    logs_there: int

    @cached_property
    def document(self) -> dict[str, Any]:
        from aqualog.report.campaign.matrix import matrix_document

        return matrix_document(self.campaign, *self.parts)

    def _report(self) -> Report:
        from aqualog.report.campaign.matrix import matrix_report

        return matrix_report(self.campaign, *self.parts)

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """The lists of the document, each as a table."""
        return {
            k: rows_table({n: str(x) if isinstance(x, Mapping | list) else x for n, x in row.items()} for row in v)
            for k, v in self.document.items()
            if isinstance(v, Sequence) and v and all(isinstance(row, Mapping) for row in v)
        }

    def plot(self) -> go.Figure:
        """Return the number of runs of each configuration."""
        from aqualog.report.campaign.labels import group_text

        count: dict[str, int] = {}
        for run in self.campaign.runs:
            name = group_text(tuple((k, run.groups.get(k)) for k in self.campaign.keys))
            count[name] = count.get(name, 0) + 1
        return bars(self.campaign.name, list(count), list(count.values()), "runs")

    def files(self) -> Writers:
        """Return `matrix.json` and `matrix.txt`."""
        return {"matrix.json": self._json_file(), "matrix.txt": text_file(self.text)}


def matrix(path: PathLike) -> Matrix:
    """Check a campaign file, and count what was driven.

    Speeds that the campaign file does not give come from a store beside it, if a batch has made one. A missing log is
    not a fault of the matrix.

    Raises
    ------
    ConfigError
        With all faults of all files in one message.
    """
    from aqualog.campaign.definition import log_states
    from aqualog.campaign.matrix import campaign_matrix, speeds_of
    from aqualog.campaign.tables import lane_faults, stored_runs
    from aqualog.config.campaign import read_campaign
    from aqualog.config.vehicle import load_vehicle

    file = Path(path)
    read = read_campaign(file)
    campaign = read.campaign
    states = log_states(campaign, read.places)
    measured = stored_runs(campaign, file.with_suffix(".store"))
    ranges = {i: m.speeds for i, m in measured.items() if m.speeds}
    found = campaign_matrix(campaign, lambda index, run: speeds_of(run) or ranges.get(index, ()))
    lanes = lane_faults(campaign, measured, read.places)
    vehicles = {p.name: load_vehicle(p) for p in dict.fromkeys(r.vehicle for r in campaign.runs)}
    there = sum(s.size is not None for s in states)
    parts = (found, states, vehicles, measured, lanes)
    return Matrix(campaign, parts, len(states), there, has_loss=there < len(states), sources=(file,))
