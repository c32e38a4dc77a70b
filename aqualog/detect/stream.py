"""Run all detectors over one drive: in one go, in pieces, or sample by sample, with the same result to the bit."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches

import numpy as np

from aqualog.checks.drive import may_be_water
from aqualog.checks.look import Checks
from aqualog.core.errors import ConfigError
from aqualog.core.notation import WHEELS
from aqualog.core.records import DriveResult, Event, FloatArray, Signals, SlopeSummary, Track, Unavailable
from aqualog.core.vehicle import Vehicle
from aqualog.detect.braking import BrakeWatch
from aqualog.detect.detector import Detector, Scene, Settings, Setup
from aqualog.detect.episodes import Way
from aqualog.detect.events import EventBook
from aqualog.detect.margin.watch import MARGIN, Least
from aqualog.detect.registry import OWN, RIVALS, all_of, check_needs, running_order
from aqualog.detect.slip_slope.history import Memory
from aqualog.detect.slip_slope.watch import DropWatch, remarks
from aqualog.detect.verdict import JOINT, Unjudged, judge
from aqualog.features.stream import INPUTS, Features, FeatureStream

__all__ = [
    "ROWS", "DriveStream", "Piece", "RivalResult", "Settings", "Through", "detect_drive", "in_order", "run_rivals",
]  # fmt: skip

ROWS = 20_000  # samples that go through at once, 3 min at 100 Hz: some hundred arrays of 160 kB, which a cache holds


@dataclass(frozen=True, slots=True)
class Piece:
    """Result of one piece of a drive: features and tracks of its samples, and the events that ended in it."""

    features: Features
    tracks: tuple[Track, ...]
    events: tuple[Event, ...]


class DriveStream:
    """Feature and detector recursions of one drive with their state.

    Parameters
    ----------
    dt_ns : int
        Sample time. [ns]
    available : collection of str
        Symbols of the drive. Missing ones decide which detectors run (`unavailable`, `limited`).
    memory : Memory, optional
        Prior knowledge of the dry slip slope.
    detectors : iterable of Detector, optional
        The thesis' own by default.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        dt_ns: int,
        available: Collection[str],
        *,
        settings: Settings | None = None,
        memory: Memory | None = None,
        detectors: Iterable[Detector] | None = None,
    ) -> None:
        settings = settings or Settings()
        self.dt_ns = dt_ns
        self.dt = dt = dt_ns * 1e-9
        self.memory = memory or Memory()
        self._features = FeatureStream(vehicle, dt, available, correct_yaw=settings.correct_yaw)
        self._available = self._features.available
        chosen = tuple(all_of(*OWN) if detectors is None else detectors)
        unavailable, limited = check_needs(vehicle, available, rate_hz=1e9 / dt_ns, detectors=chosen)
        self.unavailable: tuple[Unavailable, ...] = tuple(unavailable)
        self.limited: tuple[Unavailable, ...] = tuple(limited)
        off = {u.detector for u in unavailable}
        self._book = EventBook(dt_ns)
        self._brakes = BrakeWatch(vehicle, dt)
        self.watches = {
            d: d.start(Setup(d, vehicle, dt, settings.thresholds.get(d.name, d.threshold), settings, self.memory))
            for d in running_order(chosen)
            if d.name not in off
        }

    def push(self, columns: Mapping[str, FloatArray]) -> Piece:
        """Take the next samples, one or more.

        Parameters
        ----------
        columns : mapping symbol -> array (n,)
            SI, NaN where missing.
        """
        f = self._features.push(columns)
        known = {s: columns[s] for s in self._available}
        scene = Scene(f, self._brakes.push(f, known), known)
        events: list[Event] = []
        for detector, watch in self.watches.items():
            output = watch.push(scene)
            for track, evidence in output.found:
                events += self._book.take(track, evidence, detector.severity, detector.explain)
            scene = scene.after(output)
        return Piece(scene.f, scene.tracks, tuple(events))

    def finish(self) -> tuple[Event, ...]:
        """Return events that are open at the end of the drive."""
        return self._book.finish()

    @property
    def slopes(self) -> tuple[SlopeSummary, ...]:
        """Return how the slip slope was estimated so far, place by place."""
        drops = (w for w in self.watches.values() if isinstance(w, DropWatch))
        return tuple(w.summary() for drop in drops for w in drop.watches)


def in_order(events: Iterable[Event]) -> tuple[Event, ...]:
    """Sort events by their beginning."""
    return tuple(sorted(events, key=lambda e: (e.start_s, e.detector, e.wheel or "", e.side or "")))


class Through:
    """The one way through a drive: piece by piece through all detectors, with what is checked and gathered beside."""

    def __init__(
        self, vehicle: Vehicle, dt_ns: int, present: Sequence[str], settings: Settings | None, memory: Memory | None,
        *, is_checked: bool = True,
    ) -> None:  # fmt: skip
        self._stream = DriveStream(vehicle, dt_ns, present, settings=settings, memory=memory)
        self._checks = Checks(present, vehicle, self._stream.dt) if is_checked else None
        self._vehicle = vehicle
        is_free = vehicle.knows_drivetrain and "brake_pressure" in present
        self._rolling = tuple(w for w in WHEELS if is_free and w not in vehicle.driven)
        self._events: list[Event] = []
        self._way = Way(self._stream.dt)
        self._least = Least(self._stream.dt)
        self._judged = 0
        self._unjudged = Unjudged(self._stream.dt)

    def push(self, columns: Mapping[str, FloatArray]) -> Piece:
        """Take the next samples; as `DriveStream.push`."""
        piece = self._stream.push(columns)
        if self._checks is not None:
            self._checks.push(columns, piece.features)
        self._events += piece.events
        self._way.push(piece.features["v_x_hat"])
        self._least.push(piece.features, next((t for t in piece.tracks if t.detector == MARGIN.name), None))
        if joint := [~np.isnan(t.statistic) for t in piece.tracks if t.detector in JOINT]:
            self._judged += max(int(np.count_nonzero(j)) for j in joint)
            self._unjudged.push(columns, np.logical_or.reduce(joint))
        return piece

    def result(self, signals: Signals, features: Mapping[str, FloatArray], tracks: tuple[Track, ...]) -> DriveResult:
        """Return the result of the whole drive, with its signals, features and tracks as given."""
        import polars as pl

        stream = self._stream
        slopes = stream.slopes
        checks = self._checks.remarks(signals.origins) if self._checks is not None else ()
        events = in_order((*self._events, *stream.finish()))
        judgement = judge(
            events, stream.unavailable, [d.name for d in stream.watches], judged_s=self._judged * stream.dt,
            way=self._way.between, is_possible=may_be_water(checks), rolling=self._rolling,
        )  # fmt: skip
        return DriveResult(
            signals=signals,
            features=pl.DataFrame(features),
            tracks=tracks,
            events=events,
            unavailable=stream.unavailable,
            limited=stream.limited,
            vehicle_name=self._vehicle.name,
            notes=(*(r.sentence for r in checks), *filter(None, [self._unjudged.note()]), *remarks(slopes)),
            slopes=slopes,
            checks=checks,
            judgement=judgement,
            margin=self._least.result(),
        )


def detect_drive(
    signals: Signals,
    vehicle: Vehicle,
    *,
    settings: Settings | None = None,
    memory: Memory | None = None,
    samples: bool = True,
    is_checked: bool = True,
) -> DriveResult:
    """Run all detectors over one drive.

    Parameters
    ----------
    memory : Memory, optional
        Prior knowledge of the dry slip slope; `slip_slope.history.remembered` adds what this drive has shown.
    samples : bool
        Whether to keep features and tracks with all their samples; without them the result has them empty.
    is_checked : bool
        Whether to look if the inputs fit each other: a simulation needs no such look.

    Returns
    -------
    DriveResult
        Events in order of their beginning.
    """
    # a column without a single value is a signal that the drive does not have
    rows = signals.frame.height
    present = [s for s in signals.symbols if signals.frame[s].null_count() < rows]
    through = Through(vehicle, signals.dt_ns, present, settings, memory, is_checked=is_checked)
    columns = {s: signals.array(s) for s in (present or ["v_x"])}
    kept = rows if samples else 0
    features: dict[str, FloatArray] = {}
    tracks: tuple[Track, ...] = ()
    for at in range(0, max(rows, 1), ROWS):
        piece = through.push({s: x[at : at + ROWS] for s, x in columns.items()})
        if at == 0:
            features = {name: np.empty(kept, x.dtype) for name, x in piece.features.items()} if samples else {}
            tracks = tuple(
                replace(t, statistic=np.empty(kept), active=np.empty(kept, dtype=bool)) for t in piece.tracks
            )
        if samples:
            here = slice(at, at + ROWS)
            for name, x in piece.features.items():
                features[name][here] = x
            for whole, part in zip(tracks, piece.tracks, strict=True):
                whole.statistic[here], whole.active[here] = part.statistic, part.active
    return through.result(signals, features, tracks)


@dataclass(frozen=True, slots=True)
class RivalResult:
    """All results of the rivals on one drive; events in order of their beginning."""

    tracks: tuple[Track, ...]
    events: tuple[Event, ...]
    unavailable: tuple[Unavailable, ...]


def run_rivals(
    signals: Signals,
    vehicle: Vehicle,
    thresholds: Mapping[str, float] | None = None,
    names: Collection[str] | None = None,
) -> RivalResult:
    """Run rivals over one drive.

    Parameters
    ----------
    signals : Signals
        Truth and labels in it are not read.
    thresholds : mapping name -> float, optional
        In the unit of each rival, positive; those that are not named keep their default.
    names : collection of str, optional
        All by default.

    Raises
    ------
    ConfigError
        For an unknown name, or a threshold that is not positive and finite.
    """
    own = dict(thresholds or {})
    for name in (*own, *(RIVALS if names is None else names)):
        if name not in RIVALS:
            near = get_close_matches(name, RIVALS, n=1)
            hint = near[0] if near else "one of these names"
            raise ConfigError(f"no rival {name!r}", expected=", ".join(RIVALS), hint=hint)
    for name, value in own.items():
        if not 0.0 < value < np.inf:
            unit = RIVALS[name].unit
            raise ConfigError(
                f"threshold {value!r} is not positive", where=name, expected=f"a number above 0 in {unit}"
            )
    chosen = [r for r in RIVALS.values() if names is None or r.name in names]
    height = signals.frame.height
    present = [s for s in signals.symbols if s in INPUTS and signals.frame[s].null_count() < height]
    stream = DriveStream(vehicle, signals.dt_ns, present, settings=Settings(thresholds=own), detectors=chosen)
    if not stream.watches:
        return RivalResult((), (), stream.unavailable)
    piece = stream.push({s: signals.array(s) for s in (present or ["v_x"])})
    return RivalResult(piece.tracks, in_order((*piece.events, *stream.finish())), stream.unavailable)
