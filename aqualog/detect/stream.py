"""Run all detectors over one drive: in one go, in pieces, or sample by sample, with the same result to the bit."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from aqualog.core.records import DriveResult, Event, FloatArray, Signals, Track, Unavailable
from aqualog.core.vehicle import Vehicle
from aqualog.detect.events import EventBook
from aqualog.detect.force_watch import ResistanceWatch, TieRodWatch
from aqualog.detect.joint_cusum import JointCusumParams
from aqualog.detect.joint_watch import JointCriteriaWatch, JointCusumWatch, SlopeJudge
from aqualog.detect.needs import check_needs
from aqualog.detect.plausibility import Plausibility
from aqualog.detect.scene import BrakeWatch, Scene
from aqualog.detect.slip_slope.estimator import INACTIVE
from aqualog.detect.slip_slope.remarks import remarks
from aqualog.detect.slip_slope.watch import Memory, SlipSlopeWatch, pairs
from aqualog.detect.thresholds import DEFAULT, Thresholds
from aqualog.detect.wheel_watch import MinorWatch, SpinWatch
from aqualog.features.stream import Features, FeatureStream

__all__ = ["DriveStream", "Piece", "Settings", "detect_drive", "in_order"]

PIECE = 20_000  # samples that go through at once: some hundred arrays of 160 kB, which a cache holds


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the detectors.

    `correct_yaw` as in `FeatureStream`. `learns_offset`: the offset of the resistance measure on dry road is estimated
    and subtracted. `joint_cusum`: scales of joint detector 2, whose threshold is that of `thresholds`.
    """

    thresholds: Thresholds = DEFAULT
    correct_yaw: bool = True
    learns_offset: bool = True
    joint_cusum: JointCusumParams = field(default_factory=JointCusumParams)


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
    vehicle : Vehicle
    dt_ns : int
        Sample time. [ns]
    available : collection of str
        Symbols of the drive. Missing ones decide which detectors run (`unavailable`, `limited`).
    settings : Settings
    memory : Memory, optional
        Prior knowledge of the dry slip slope.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        dt_ns: int,
        available: Collection[str],
        *,
        settings: Settings | None = None,
        memory: Memory | None = None,
    ) -> None:
        settings = settings or Settings()
        self.vehicle = vehicle
        self.dt_ns = dt_ns
        self.dt = dt = dt_ns * 1e-9
        self._features = FeatureStream(vehicle, dt, available, correct_yaw=settings.correct_yaw)
        self._available = self._features.available
        unavailable, limited = check_needs(vehicle, available, rate_hz=1e9 / dt_ns)
        self.unavailable: tuple[Unavailable, ...] = tuple(unavailable)
        self.limited: tuple[Unavailable, ...] = tuple(limited)
        off = {u.detector for u in unavailable}
        t = settings.thresholds
        self._book = EventBook(dt_ns)
        self._brakes = BrakeWatch(vehicle, dt)
        self._wheels: list[SpinWatch | MinorWatch] = []
        if "spin_down" not in off:
            self._wheels.append(SpinWatch("spin_down", vehicle, dt, t.spin_down))
        if "minor_spin_down" not in off:
            self._wheels.append(MinorWatch(vehicle, dt, t.minor_spin_down))
        if "spin_up" not in off:
            self._wheels.append(SpinWatch("spin_up", vehicle, dt, t.spin_up))
        self.memory = memory or Memory()
        self.slope_watches: tuple[SlipSlopeWatch, ...] = ()
        if "slip_slope_drop" not in off:
            self.slope_watches = tuple(
                SlipSlopeWatch(vehicle, pair, dt, self.memory, loss=t.slip_slope_drop) for pair in pairs(vehicle)
            )
        self._resistance = None if "resistance" in off else ResistanceWatch(dt, t, learns=settings.learns_offset)
        self._tie_rods = None if "tie_rod" in off else TieRodWatch(vehicle, dt, t)
        self._judge = SlopeJudge(dt)
        self._joint = None if "joint_criteria" in off else JointCriteriaWatch(dt)
        self._sum = None if "joint_cusum" in off else JointCusumWatch(dt, settings.joint_cusum, t.joint_cusum)

    def push(self, columns: Mapping[str, FloatArray]) -> Piece:
        """Take the next samples, one or more.

        Parameters
        ----------
        columns : mapping symbol -> array (n,)
            SI, NaN where missing.
        """
        f = dict(self._features.push(columns))
        known = {s: columns[s] for s in self._available}
        scene = Scene(f, self._brakes.push(f, known))
        tracks: list[Track] = []
        events: list[Event] = []
        for watch in self._wheels:
            new_tracks, new_events = watch.push(scene, self._book)
            tracks += new_tracks
            events += new_events
            if isinstance(watch, MinorWatch):
                f |= watch.features
        for slope in self.slope_watches:
            track, new_events = self._slope_drop(slope, scene, f)
            tracks.append(track)
            events += new_events
        if self._resistance is not None:
            suspicion = np.any([np.zeros(scene.size, dtype=bool), *(t.active for t in tracks)], axis=0)
            track, new_events, x, gate, features = self._resistance.push(scene, self._book, suspicion)
            tracks.append(track)
            events += new_events
            f |= features
        if self._tie_rods is not None:
            new_tracks, new_events = self._tie_rods.push(scene, self._book)
            tracks += new_tracks
            events += new_events
        single = tuple(tracks)
        if self._joint is not None or self._sum is not None:
            may_be_water = self._judge.push(scene, single, x)
        if self._joint is not None:
            track, new_events, features = self._joint.push(scene, single, x, gate, may_be_water, self._book)
            tracks.append(track)
            events += new_events
            f |= features
        if self._sum is not None:
            track, new_events, features = self._sum.push(scene, single, x, gate, may_be_water, self._book)
            tracks.append(track)
            events += new_events
            f |= features
        return Piece(f, tuple(tracks), tuple(events))

    def finish(self) -> tuple[Event, ...]:
        """Return events that are open at the end of the drive."""
        return self._book.finish()

    def _slope_drop(self, watch: SlipSlopeWatch, scene: Scene, f: dict[str, FloatArray]) -> tuple[Track, list[Event]]:
        seen = watch.push(f, scene.braking, f["yaw_rate_slow"])
        place, wheel = watch.pair.place, watch.pair.wheel
        f[f"slip_slope_{place}"] = np.where(seen.estimate.status < INACTIVE, seen.estimate.slope, np.nan)
        f[f"slip_slope_ref_{place}"] = seen.reference
        track = Track("slip_slope_drop", wheel, place, "-", seen.loss, watch.drop_threshold, seen.active)
        evidence: dict[str, Any] = {
            "v_x": ("first", f["v_x_hat"]),
            "slope_min": ("min", seen.estimate.slope),
            "slope_ref": ("first", seen.reference),
            "mu": ("first", seen.mu),
            "slip_max": ("max", np.abs(seen.slip)),
        }
        return track, self._book.take(track, evidence, _partial)


def _partial(_: Mapping[str, Any]) -> str:
    return "partial"


def in_order(events: Iterable[Event]) -> tuple[Event, ...]:
    """Sort events by their beginning."""
    return tuple(sorted(events, key=lambda e: (e.start_s, e.detector, e.wheel or "", e.side or "")))


class _Gathered:
    """Collect features and tracks of the pieces of a drive in arrays of the whole; or tracks by name alone."""

    def __init__(self, rows: int, *, samples: bool) -> None:
        self._rows = rows
        self._samples = samples
        self._at = 0
        self.features: dict[str, FloatArray] = {}
        self.tracks: tuple[Track, ...] = ()

    def add(self, piece: Piece, n: int) -> None:
        """Take the next piece, of n samples."""
        if self._samples and n == self._rows:
            self.features, self.tracks = dict(piece.features), piece.tracks
            return
        if self._at == 0:
            rows = self._rows if self._samples else 0
            self.features = {k: np.empty(rows, x.dtype) for k, x in piece.features.items()} if rows else {}
            self.tracks = tuple(
                replace(t, statistic=np.empty(rows), active=np.empty(rows, dtype=bool)) for t in piece.tracks
            )
        here = slice(self._at, self._at + n)
        self._at += n
        if not self._samples:
            return
        for name, x in piece.features.items():
            self.features[name][here] = x
        for whole, part in zip(self.tracks, piece.tracks, strict=True):
            whole.statistic[here], whole.active[here] = part.statistic, part.active


def detect_drive(
    signals: Signals,
    vehicle: Vehicle,
    *,
    settings: Settings | None = None,
    memory: Memory | None = None,
    samples: bool = True,
) -> DriveResult:
    """Run all detectors over one drive.

    Parameters
    ----------
    signals : Signals
    vehicle : Vehicle
    settings : Settings
    memory : Memory, optional
        Prior knowledge of the dry slip slope; `slip_slope.history.remembered` adds what this drive has shown.
    samples : bool
        Whether to keep features and tracks with all their samples; without them the result has them empty.

    Returns
    -------
    DriveResult
        Events in order of their beginning.
    """
    import polars as pl

    # a column without a single value is a signal that the drive does not have
    present = [s for s in signals.symbols if signals.frame[s].null_count() < signals.frame.height]
    stream = DriveStream(vehicle, signals.dt_ns, present, settings=settings, memory=memory)
    columns = {s: signals.array(s) for s in (present or ["v_x"])}
    plausibility = Plausibility(present, vehicle, signals.dt)
    gathered = _Gathered(signals.frame.height, samples=samples)
    found: list[Event] = []
    for at in range(0, max(signals.frame.height, 1), PIECE):
        part = {s: x[at : at + PIECE] for s, x in columns.items()}
        piece = stream.push(part)
        plausibility.push(part, piece.features)
        found += piece.events
        gathered.add(piece, min(PIECE, signals.frame.height - at))
    events = in_order((*found, *stream.finish()))
    slopes = tuple(w.summary() for w in stream.slope_watches)
    return DriveResult(
        signals=signals,
        features=pl.DataFrame(gathered.features),
        tracks=gathered.tracks,
        events=events,
        unavailable=stream.unavailable,
        limited=stream.limited,
        vehicle_name=vehicle.name,
        notes=(*plausibility.notes(), *remarks(slopes)),
        slopes=slopes,
    )
