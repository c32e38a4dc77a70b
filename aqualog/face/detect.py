"""`aq.detect`: aquaplaning in one drive."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ConfigError, SignalError
from aqualog.core.records import DriveResult, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.face.arguments import file_of, refuse_existing, text_of, write_whole
from aqualog.face.drive import Drive, DriveLike, drive_of, sources_of, vehicle_of
from aqualog.face.guess import load_or_guess
from aqualog.face.listener import Listener, Progress, listener
from aqualog.face.result import PathLike, Result, Writers, flat, page_file, rows_table, table, text_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

    from aqualog.align.load import LoadedLong
    from aqualog.detect.slip_slope.watch import Memory
    from aqualog.detect.stream import Settings
    from aqualog.model.term import Model
    from aqualog.report.sections import Report

__all__ = ["DETECT_FILES", "Detection", "detect", "model_of"]

DETECT_FILES = ("events.json", "signals.parquet", "report.html")

_WHOLE_ROWS = 200_000  # of a drive up to this length, what takes long is the compiler


@dataclass(frozen=True, eq=False, repr=False)
class Detection(Result):
    """What the detectors found in one drive.

    `drive_result` holds the records, `model` the effects that the detectors allowed for (None without a model).
    """

    drive: Drive
    vehicle: Vehicle
    drive_result: DriveResult
    model: Model | None = None
    memory: Memory | None = None
    drive_key: str = ""

    @cached_property
    def document(self) -> dict[str, Any]:
        from aqualog.report.drive.document import document

        effects = None if self.model is None else [
            {"effect": t.effect.name, "where": t.where, "parameters": dict(t.values),
             **({"knots": [list(k) for k in t.knots]} if t.knots else {})}
            for t in self.model.terms
        ]  # fmt: skip
        return {**document(self.drive_result, log=self.drive.name), "model": effects}

    @property
    def events(self) -> pl.DataFrame:
        """A row for each event: detector, wheel, side, start_s, end_s [s], severity, peak, threshold, evidence."""
        rows = [{**e, "evidence": json.dumps(e["evidence"])} for e in self.document["events"]]
        return table(
            rows, "detector wheel side start_s end_s severity peak threshold evidence",
            text=("detector", "wheel", "side", "severity", "evidence"),
        )  # fmt: skip

    @property
    def verdict(self) -> str:
        """`aquaplaning`, `none`, or `cannot_be_judged`: then `drive_result.judgement.missing` names what is missing."""
        return self.drive_result.judgement.verdict

    @property
    def episodes(self) -> pl.DataFrame:
        """A row for each episode, detections that belong together; `events` are rows of the table of events."""
        rows = [
            {**e, **{n: ", ".join(map(str, e[n])) for n in ("wheels", "decided_by", "events")}}
            for e in self.document["episodes"]
        ]
        return table(
            rows, "kind start_s end_s wheels axle side severity v_x_kmh decided_by delta_a_x_max slip_min slip_max "
            "distance_m events", text=("kind", "wheels", "axle", "side", "severity", "decided_by", "events"),
        )  # fmt: skip

    @property
    def signals(self) -> pl.DataFrame:
        """The signals on one time base: `t` [s] and a column for each, SI."""
        return self.drive_result.signals.frame

    @property
    def has_samples(self) -> bool:
        """Whether features and statistics of every sample were kept."""
        rows, found = self.signals.height, self.drive_result
        return found.features.height == (rows if found.features.width else 0) and all(
            t.statistic.size == rows for t in found.tracks
        )

    def _check_samples(self) -> None:
        if not self.has_samples:
            raise ConfigError(
                "features and statistics of the samples were not kept", where=self.drive.title,
                expected="aq.detect(..., samples=True)",
            )  # fmt: skip

    @property
    def features(self) -> pl.DataFrame:
        """What the detectors looked at, with `t` [s]; see `DriveResult`."""
        self._check_samples()
        return self.signals.select("t").hstack(self.drive_result.features)

    @property
    def tracks(self) -> pl.DataFrame:
        """Statistic and detection bit of each detector over `t` [s]."""
        import polars as pl

        from aqualog.report.drive.document import track_name

        self._check_samples()
        columns: dict[str, Any] = {"t": self.signals["t"]}
        for track in self.drive_result.tracks:
            columns[track_name(track)] = track.statistic
            columns[f"{track_name(track)}_bit"] = track.active
        return pl.DataFrame(columns)

    @property
    def tables(self) -> Mapping[str, pl.DataFrame]:
        """`events`, `episodes`, `signals`, and where the samples were kept `features` and `tracks`."""
        found = {"events": self.events, "episodes": self.episodes, "signals": self.signals}
        return {**found, "features": self.features, "tracks": self.tracks} if self.has_samples else found

    @property
    def printed(self) -> Mapping[str, pl.DataFrame]:
        """`episodes`, `events` with speed and evidence in words, `slip_slope`, `not_judged`: what detectors miss."""
        import polars as pl

        from aqualog.report.values import ordinary
        from aqualog.report.wording import evidence_parts, speed_kmh

        found = self.drive_result.events
        words = [ordinary("; ".join(evidence_parts(e.evidence))) for e in found]
        speeds = pl.Series("v_x_kmh", [speed_kmh(e) for e in found], pl.Float64)
        lacking = [*self.document["unavailable"], *self.document["limited"]]
        return {
            "episodes": self.episodes,
            "events": self.events.drop("evidence").with_columns(speeds, pl.Series("evidence", words, pl.String)),
            "slip_slope": rows_table(
                {k.replace(" ", "_"): v for k, v in flat(s).items()} for s in self.document["slip_slope"]
            ),
            "not_judged": rows_table(lacking),
        }

    def _report(self) -> Report:
        from aqualog.report.drive.report import drive_report

        return drive_report(self.drive_result)

    def headline(self) -> str:
        from aqualog.report.drive.judged import headline, lines_of, margin_lines
        from aqualog.report.drive.report import lacking

        found, signals = self.drive_result, self.drive_result.signals
        rate, lacks = 1e9 / signals.step_ns, lacking(found)
        return "\n".join([
            f"{self.drive.title}, {found.vehicle_name}: {signals.duration_s:.1f} s at {rate:g} Hz",
            headline(
                found.judgement, doubted=bool(found.checks), margin=found.margin, duration_s=signals.duration_s
            ),
            *(f"  {line}" for line in (*lines_of(found.judgement, 4), *margin_lines(found.margin))),
            *([f"  Not judged: {'; '.join(lacks)}"] if lacks else []),
        ])  # fmt: skip

    def plot(self) -> go.Figure:
        """Return the panels of the page: speeds, detectors, differences, accelerations, statistics, slopes."""
        from aqualog.report.drive.panels import drive_rows
        from aqualog.report.drive.stack import rows_figure

        self._check_samples()
        signals = self.drive_result.signals
        return rows_figure(drive_rows(self.drive_result), signals.frame.height, signals.dt)

    def files(self) -> Writers:
        """Return `events.json`, `signals.parquet` and `report.html`.

        The table only of a drive that was read whole; without samples only the events.
        """
        from aqualog.report.drive.report import drive_page

        files = {
            "events.json": self._json_file(),
            "signals.parquet": lambda path: self._write(path, ".parquet"),
            "report.html": page_file(lambda: drive_page(self.drive_result, title=self.drive.title)),
        }
        if self.drive_result.signals.full is not None:
            del files["signals.parquet"]
        return files if self.has_samples else {"events.json": files["events.json"]}

    def write(self, path: PathLike, *, layouts: bool = False, force: bool = False) -> Path:
        """Write signals, features, statistics and detection bits as channels of a log: .mf4, .mcap, .csv or .parquet.

        The first two hold the episodes and events, too: as event blocks of MDF and as messages `foxglove.Event`. With
        `layouts` PATH.plotjuggler.xml is written beside it, and beside an MCAP file PATH.foxglove.json.
        """
        from aqualog.io.write_log import check_suffix
        from aqualog.report.drive.document import result_groups
        from aqualog.report.layouts import layout_texts

        target = file_of(path, "path")
        suffix = check_suffix(target)
        self._check_samples()
        groups = result_groups(self.drive_result, features=True)
        beside = layout_texts(target, groups) if layouts else {}
        refuse_existing([target, *beside], force=force, sources=self.sources)
        for file, text in beside.items():
            write_whole(file, text_file(text))
        return self._write_to(path, lambda p: _write_log(self.drive_result, p, suffix, features=True), force=force)

    def _write(self, path: Path, suffix: str) -> None:
        _write_log(self.drive_result, path, suffix)

    def remember(self, history: PathLike) -> None:
        """Add the dry slip slopes of this drive to a history file; the same drive counts once."""
        from aqualog.config.history import update_history
        from aqualog.detect.slip_slope.history import drive_key, remembered
        from aqualog.detect.slip_slope.watch import Memory

        memory = self.memory or Memory()
        key = self.drive_key or drive_key(self.drive_result.signals)
        name, slopes = memory.name(self.vehicle), self.drive_result.slopes
        update_history(file_of(history, "history"), lambda h: remembered(h, name, slopes, drive=key))


def detect(
    drive: DriveLike,
    vehicle: PathLike | Vehicle | None = None,
    *,
    thresholds: PathLike | None = None,
    model: PathLike | Model | None = None,
    history: PathLike | None = None,
    configuration: str = "",
    reference: str = "robust",
    windows: PathLike | None = None,
    whole: bool = False,
    samples: bool = True,
    progress: Progress = None,
) -> Detection:
    """Detect aquaplaning in one drive.

    Parameters
    ----------
    drive : Drive, Signals, str, Path or several
        From `aq.read`, or files of ONE drive. Without a signal map and without wheel speeds of canonical names,
        signals are guessed as `aq.inspect` proposes them, and a note says so.
    vehicle : Vehicle, str or Path, optional
        Without it that of the drive, else radii of a default car; what needs mass or drivetrain is then not judged.
    thresholds : str or Path, optional
        Thresholds of the detectors, as `aq.evaluate(..., tune=True)` proposes them.
    model : Model, str or Path, optional
        Effects that the car is known to have, as `aq.diagnose` writes them.
    history : str or Path, optional
        Dry slip slopes of this car from earlier drives. It is read here; `Detection.remember` adds to it.
    configuration : str
        What the dry slope belongs to: tyre, pressure, load, in any words; default the vehicle's name.
    reference : str
        Dry slope of the history: `robust` (upper quartile of the periods' means) or `max` (as the thesis).
    windows : str or Path, optional
        Folder for `signals.parquet` of a drive that is too long for memory: its samples are written while it is read.
    whole : bool
        Read a long drive as a whole all the same, which `Detection.write` needs.
    samples : bool
        Keep the features and statistics of every sample; without them less memory is needed and nothing is drawn.
    progress : callable, optional
        Called with each step of the work, such as `print`.

    Raises
    ------
    LogError, SignalError, ConfigError

    Examples
    --------
    >>> r = aq.detect("drive.mf4", "car.toml")
    >>> r.events.filter(pl.col("severity") == "full")
    >>> r.save("out")
    """
    hear = listener(progress)
    one = drive_of(drive)
    car = vehicle_of(vehicle, one)
    memory = _memory(history, configuration, reference)
    settings = None
    if thresholds is not None:
        from aqualog.config.thresholds import load_settings

        settings = load_settings(file_of(thresholds, "thresholds"))
    known = model_of(model, car, hear)
    asked = (("writing a log", whole), ("a model", known is not None), ("a history", history is not None))
    needs = ", ".join(n for n, is_asked in asked if is_asked)
    key = ""
    with one.reading():
        hint = one.signal_map.hint
        one, loaded, guessed = load_or_guess(one, car, hear, whole_for=needs)
        if isinstance(loaded, Signals):
            check_something_to_do(loaded.symbols, 1e9 / loaded.dt_ns, loaded.quality.notes, car, one.name, hint)
            hear("detecting")
            past = memory
            if history is not None:
                from aqualog.detect.slip_slope.history import drive_key

                # what an earlier look at this very drive has left is not what it is compared with
                key = drive_key(loaded)
                past = replace(memory, history=memory.history.without(key))
            result = _whole(loaded, car, known, settings, past, hear, samples=samples)
        else:
            plan = loaded.drive.plan
            check_something_to_do(plan.symbols, 1e9 / plan.grid.dt_ns, plan.notes, car, one.name, hint)
            hear.detail(f"{plan.grid.rows} samples at {1e9 / plan.grid.dt_ns:g} Hz, gone through in windows")
            out = None if windows is None else file_of(windows, "windows")
            result = _in_windows(loaded, car, settings, memory, out, hear)
        changes = one.changes()
    result = replace(result, notes=(*guessed, *result.notes, *changes))
    quality = result.signals.quality
    return Detection(
        one, car, result, known, memory, key, notes=(*quality.notes, *result.notes),
        has_loss=quality.has_loss or bool(changes),
        sources=sources_of(one.sources, vehicle, thresholds, model, history),
    )  # fmt: skip


def _whole(
    signals: Signals, vehicle: Vehicle, model: Model | None, settings: Settings | None, memory: Memory, hear: Listener,
    *, samples: bool,
) -> DriveResult:  # fmt: skip
    """Detection in one go; its notes begin with those of the model."""
    from contextlib import nullcontext

    from aqualog.detect.stream import detect_drive

    hear.detail(f"{len(signals.symbols)} signals, {signals.frame.height} samples at {1e9 / signals.dt_ns:g} Hz")
    for name, origin in signals.origins.items():
        hear.detail(f"  {name}: {origin.file}:{origin.channel} [{origin.unit}] {origin.rate_hz:.4g} Hz")
    notes: tuple[str, ...] = ()
    if model is not None:
        from aqualog.diagnose.extended import extended_inputs

        signals, vehicle, notes = extended_inputs(signals, vehicle, model)
    with hear.slow("the detectors") if signals.frame.height < _WHOLE_ROWS else nullcontext():
        found = detect_drive(signals, vehicle, settings=settings, memory=memory, samples=samples)
    return replace(found, notes=(*notes, *found.notes))


def _in_windows(
    opened: LoadedLong, vehicle: Vehicle, settings: Settings | None, memory: Memory, out: Path | None, hear: Listener
) -> DriveResult:
    """Detection on a drive that is longer than memory.

    With a folder `out`, its signals go into `signals.parquet` there: each window as a file, which are then joined.
    """
    from contextlib import ExitStack

    from aqualog.detect.long import detect_long

    parts: list[Path] = []
    rows = 0

    def keep(window: DriveResult) -> None:
        nonlocal rows
        parts.append(folder / f"{len(parts):06d}.parquet")
        _write_log(window, parts[-1], ".parquet", first_row=rows)
        rows += window.signals.frame.height

    with opened.opened, ExitStack() as scratch:
        if out is not None:
            from aqualog.guard.reading import unfinished

            out.mkdir(parents=True, exist_ok=True)
            made = tempfile.TemporaryDirectory(prefix=".windows-", dir=out, ignore_cleanup_errors=True)
            folder = Path(scratch.enter_context(made))
            scratch.enter_context(unfinished(folder))
        result = detect_long(
            opened.drive, vehicle, settings=settings, memory=memory, faults=opened.faults,
            keep=None if out is None else keep, pictured=out is not None,
            tell=lambda share: hear(f"detecting, {100.0 * share:.0f} %"),
        )  # fmt: skip
        if out is not None:
            from aqualog.io.write_table import join_parquet

            hear("writing the table")
            write_whole(out / "signals.parquet", lambda path: join_parquet(path, parts))
    return result


def _write_log(found: DriveResult, path: Path, suffix: str, *, first_row: int = 0, features: bool = False) -> None:
    """Write signals, statistics and detection bits, the first of which stand in `first_row` of the drive."""
    import numpy as np

    from aqualog.io.write_log import write_log
    from aqualog.report.drive.document import result_events, result_groups

    signals = found.signals
    t_ns = (first_row + np.arange(signals.frame.height, dtype=np.int64)) * signals.dt_ns
    write_log(
        path, t_ns, result_groups(found, features=features), suffix=suffix, start_ns=signals.start_ns,
        events=result_events(found),
    )  # fmt: skip


def model_of(model: PathLike | Model | None, car: Vehicle | None = None, hear: Listener | None = None) -> Model | None:
    """Return the model behind an argument, with a note where it was found on another car."""
    if model is None:
        return None
    from aqualog.model.term import Model

    found = model if isinstance(model, Model) else Model.read(file_of(model, "model", "aq.Model"))
    if car is not None and hear is not None and found.car not in ("", car.name):
        hear.note(f'the model was found on "{found.car}", and the vehicle file is of "{car.name}"')
    return found


def _memory(history: PathLike | None, configuration: str, reference: str) -> Memory:
    """What is known of the dry slope before the drive."""
    from aqualog.config.history import check_history_file, load_history
    from aqualog.detect.slip_slope.history import History, check_configuration
    from aqualog.detect.slip_slope.watch import Memory

    if text_of(reference, "reference") not in ("robust", "max"):
        raise ConfigError(f"reference {reference[:40]!r}", expected="robust or max")
    check_configuration(text_of(configuration, "configuration"))
    known = History()
    if history is not None:
        file = file_of(history, "history")
        check_history_file(file)
        known = load_history(file)
    return Memory(known, configuration.strip(), "max" if reference == "max" else "robust")


def check_something_to_do(
    symbols: Sequence[str], rate_hz: float, notes: Sequence[str], vehicle: Vehicle, name: str, hint: str
) -> None:
    """Stop with one line, a SignalError, if no detector can run: what is missing, and rates of what is there."""
    from aqualog.detect.registry import DETECTORS, check_needs

    unavailable, _ = check_needs(vehicle, symbols, rate_hz=rate_hz)
    if len(unavailable) < len(DETECTORS):
        return
    lacks = dict.fromkeys(s for u in unavailable for s in u.missing)
    rates = {"wheel speeds": "omega_fl", "signals at": "a_x"}
    asked = ("omega_", "torque", "a_x", *(rate for rate, signal in rates.items() if signal not in lacks))
    missing = [s for s in lacks if s.startswith(asked)]
    if all(" Hz or more" in s for s in missing):
        hint = "a faster log; the unit of its time, and what was logged more slowly than the rest"
        notes = (f"the log has {rate_hz:.3g} Hz", *notes)
    raise SignalError(
        f"no detector can run: missing {', '.join(missing)}" + (f" ({notes[0]})" if notes else ""),
        where=name,
        expected="wheel speeds omega_fl ... omega_rr, or a_x with wheel torques",
        hint=hint,
    )
