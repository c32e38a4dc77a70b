"""`aq.detect`: aquaplaning in one drive."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aqualog.core.errors import ConfigError, SignalError
from aqualog.core.records import DriveResult, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.face.arguments import file_of, text_of
from aqualog.face.drive import Drive, DriveLike, drive_of, vehicle_of
from aqualog.face.listener import Listener, Progress, listener
from aqualog.face.result import PathLike, Result, Writers, page_file

if TYPE_CHECKING:
    import plotly.graph_objects as go
    import polars as pl

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
    sources: tuple[Path, ...] = ()
    has_changed: bool = False
    memory: Memory | None = None
    drive_key: str = ""

    @property
    def notes(self) -> tuple[str, ...]:  # type: ignore[override]
        """Sentences on the log and on the judgement."""
        return (*self.drive_result.signals.quality.notes, *self.drive_result.notes)

    @property
    def has_loss(self) -> bool:  # type: ignore[override]
        """Whether a file was cut, lost samples or changed while it was read."""
        quality = self.drive_result.signals.quality
        return bool(quality.truncated or quality.lost_in_files or self.has_changed)

    @cached_property
    def document(self) -> dict[str, Any]:
        """The JSON document of `aqualog detect`."""
        from aqualog.report.drive.document import document

        return {**document(self.drive_result, log=self.drive.name), "model": _model_document(self.model)}

    @property
    def events(self) -> pl.DataFrame:
        """A row for each event: detector, wheel, side, start_s, end_s [s], severity, peak, threshold, evidence."""
        import polars as pl

        rows = [
            {**{k: v for k, v in e.items() if k != "evidence"}, "evidence": json.dumps(e["evidence"])}
            for e in self.document["events"]
        ]
        numbers = dict.fromkeys(("start_s", "end_s", "peak", "threshold"), pl.Float64)
        schema = {n: numbers.get(n, pl.String) for n in _EVENT_COLUMNS}
        return pl.DataFrame(rows, schema=schema)

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
        """`events`, `signals`, and where the samples were kept `features` and `tracks`."""
        found = {"events": self.events, "signals": self.signals}
        return {**found, "features": self.features, "tracks": self.tracks} if self.has_samples else found

    def text(self) -> str:
        """Return the table of events, and what could not be judged."""
        from aqualog.report.text import report_text

        return report_text(self._report())

    def _report(self) -> Report:
        from aqualog.report.drive.report import drive_report

        return drive_report(self.drive_result)

    def headline(self) -> str:
        """Return the verdict: how many events, the most important ones, and which detectors could not judge."""
        from aqualog.report.drive.report import verdict

        found, signals = verdict(self.drive_result), self.drive_result.signals
        rate = 1e9 / signals.step_ns
        lines = [
            f"{self.drive.title}, {self.drive_result.vehicle_name}: {signals.duration_s:.1f} s at {rate:g} Hz",
            found.headline,
            *(f"  {d}" for d in found.details[:4]),
        ]
        if found.not_judged:
            lines.append(f"  Not judged: {'; '.join(found.not_judged)}")
        return "\n".join(lines)

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

    def write(self, path: PathLike, *, force: bool = False) -> Path:
        """Write signals, statistics and detection bits as channels of a log: .mf4, .mcap, .csv or .parquet.

        Raises
        ------
        ConfigError
            If the suffix is not known, or the file exists and `force` is not given.
        """
        from aqualog.io.write_log import check_suffix

        suffix = check_suffix(file_of(path, "path"))
        self._check_samples()
        return self._write_to(path, lambda p: self._write(p, suffix), force=force)

    def _write(self, path: Path, suffix: str) -> None:
        import numpy as np

        from aqualog.io.write_log import write_log
        from aqualog.report.drive.document import result_groups

        signals = self.drive_result.signals
        t_ns = np.arange(signals.frame.height, dtype=np.int64) * signals.dt_ns
        write_log(path, t_ns, result_groups(self.drive_result), suffix=suffix, start_ns=signals.start_ns)

    def remember(self, history: PathLike) -> None:
        """Add the dry slip slopes of this drive to a history file; the same drive counts once.

        Raises
        ------
        ConfigError
            If the file is no history.
        """
        from aqualog.config.history import update_history
        from aqualog.detect.slip_slope.history import drive_key, remembered
        from aqualog.detect.slip_slope.watch import Memory

        memory = self.memory or Memory()
        key = self.drive_key or drive_key(self.drive_result.signals)
        name, slopes = memory.name(self.vehicle), self.drive_result.slopes
        update_history(file_of(history, "history"), lambda h: remembered(h, name, slopes, drive=key))


_EVENT_COLUMNS = (
    "detector", "wheel", "side", "start_s", "end_s", "severity", "peak", "threshold", "evidence",
)  # fmt: skip


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
        From `aq.read`, or files of ONE drive that need no signal map.
    vehicle : Vehicle, str or Path, optional
        Without it that of the drive, else a default car; detectors that need its mass are then not judged.
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

    Returns
    -------
    Detection

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
    settings = _settings(thresholds)
    known = model_of(model)
    asked = (("writing a log", whole), ("a model", known is not None), ("a history", history is not None))
    needs = ", ".join(n for n, is_asked in asked if is_asked)
    sources = (*one.sources, *(Path(x) for x in (vehicle, thresholds, model, history) if isinstance(x, str | Path)))
    notes: tuple[str, ...] = ()
    key = ""
    with one.reading():
        loaded = one.load_or_open(car, report=hear, note=hear.note, whole_for=needs)
        if isinstance(loaded, Signals):
            check_something_to_do(loaded.symbols, 1e9 / loaded.dt_ns, loaded.quality.notes, car, one.name)
            hear("detecting")
            if history is not None:
                from aqualog.detect.slip_slope.history import drive_key

                # what an earlier look at this very drive has left is not what it is compared with
                key = drive_key(loaded)
            result, notes = _whole(loaded, car, known, settings, memory, key, hear, samples=samples)
        else:
            from aqualog.face.detect_long import detect_in_windows

            grid = loaded.drive.plan.grid
            check_something_to_do(loaded.drive.plan.symbols, 1e9 / grid.dt_ns, loaded.drive.plan.notes, car, one.name)
            hear.detail(f"{grid.rows} samples at {1e9 / grid.dt_ns:g} Hz, gone through in windows")
            out = None if windows is None else file_of(windows, "windows")
            result = detect_in_windows(loaded, car, settings=settings, memory=memory, out=out, report=hear)
        changes = one.changes()
    result = replace(result, notes=(*notes, *result.notes, *changes))
    return Detection(one, car, result, known, sources, bool(changes), memory, key)


def _whole(
    loaded: Signals,
    vehicle: Vehicle,
    model: Model | None,
    settings: Settings | None,
    memory: Memory,
    key: str,
    hear: Listener,
    *,
    samples: bool,
) -> tuple[DriveResult, tuple[str, ...]]:
    """Detection in one go: the result, and what the model has to say."""
    from contextlib import nullcontext

    from aqualog.detect.stream import detect_drive

    hear.detail(f"{len(loaded.symbols)} signals, {loaded.frame.height} samples at {1e9 / loaded.dt_ns:g} Hz")
    for name, origin in loaded.origins.items():
        hear.detail(f"  {name}: {origin.file}:{origin.channel} [{origin.unit}] {origin.rate_hz:.4g} Hz")
    notes: tuple[str, ...] = ()
    if model is not None:
        from aqualog.diagnose.extended import extended_inputs

        loaded, vehicle, notes = extended_inputs(loaded, vehicle, model)
    with hear.slow("the detectors") if loaded.frame.height < _WHOLE_ROWS else nullcontext():
        known = replace(memory, history=memory.history.without(key))
        return detect_drive(loaded, vehicle, settings=settings, memory=known, samples=samples), notes


def model_of(model: PathLike | Model | None) -> Model | None:
    """Return the model behind an argument.

    Raises
    ------
    ConfigError
        If the file is no model.
    """
    if model is None:
        return None
    from aqualog.model.term import Model

    return model if isinstance(model, Model) else Model.read(file_of(model, "model", "aq.Model"))


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


def _settings(thresholds: PathLike | None) -> Settings | None:
    if thresholds is None:
        return None
    from aqualog.config.thresholds import load_settings

    return load_settings(file_of(thresholds, "thresholds"))


def check_something_to_do(
    symbols: Sequence[str], rate_hz: float, notes: Sequence[str], vehicle: Vehicle, name: str
) -> None:
    """Stop with one line if no detector can run.

    Raises
    ------
    SignalError
    """
    from aqualog.detect.registry import DETECTORS, check_needs

    unavailable, _ = check_needs(vehicle, symbols, rate_hz=rate_hz)
    if len(unavailable) < len(DETECTORS):
        return
    asked = ("omega_", "torque_", "a_x", "wheel speeds", "signals at")
    missing = dict.fromkeys(s for u in unavailable for s in u.missing if s.startswith(asked))
    raise SignalError(
        f"no detector can run: missing {', '.join(missing)}" + (f" ({notes[0]})" if notes else ""),
        where=name,
        expected="wheel speeds omega_fl ... omega_rr, or a_x with wheel torques",
        hint="`aqualog inspect LOG --write-map map.toml`, then the log with this signal map",
    )


def _model_document(model: Model | None) -> list[dict[str, Any]] | None:
    """The effects that the detectors allowed for; null without a model."""
    if model is None:
        return None
    return [
        {
            "effect": t.effect.name,
            "where": t.where,
            "parameters": dict(t.values),
            **({"knots": [list(k) for k in t.knots]} if t.knots else {}),
        }
        for t in model.terms
    ]
