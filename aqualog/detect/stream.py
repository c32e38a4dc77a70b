"""All detectors over one drive: in one go, in pieces, or sample by sample, with the same result to the bit."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from aqualog.detect import cusum, joint, minor_spin_down, resistance, spin
from aqualog.detect.events import EventBuilder, Evidence
from aqualog.detect.needs import check_needs
from aqualog.detect.negative_force import HOLD as BRAKE_HOLD
from aqualog.detect.negative_force import began_free, hold_on, is_braking
from aqualog.detect.plausibility import implausible
from aqualog.detect.slip_slope.estimator import INACTIVE
from aqualog.detect.slip_slope.remarks import remarks
from aqualog.detect.slip_slope.watch import Memory, SlipSlopeWatch, pairs
from aqualog.features.stream import Features, FeatureStream
from aqualog.notation import SIDES, WHEELS, side_of
from aqualog.physics.load import G
from aqualog.physics.slip import slip_of_wheel_speed
from aqualog.types import BoolArray, DriveResult, Event, FloatArray, Signals, Track, Unavailable
from aqualog.vehicle import Vehicle

__all__ = ["DriveStream", "Piece", "detect_drive"]

MU_SPIN_UP = 0.07  # [-] thesis 2.1: above it, spin-up is that of another slippery road (C27)
A_Y_MINOR = 4.0  # [m/s^2] beyond, the inner wheels lose load enough to slow down on dry road too


@dataclass(frozen=True, slots=True)
class Piece:
    """What one piece of a drive gave: features and tracks of its samples, and the events that ended in it."""

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
        Symbols that the drive has at all. What is missing decides which detectors run (`unavailable`, `limited`).
    correct_yaw : bool
        As in `FeatureStream`.
    memory : Memory, optional
        What is known of the dry slip slope.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        dt_ns: int,
        available: Collection[str],
        *,
        correct_yaw: bool = True,
        memory: Memory | None = None,
    ) -> None:
        self.vehicle = vehicle
        self.dt_ns = dt_ns
        self.dt = dt_ns * 1e-9
        self._features = FeatureStream(vehicle, self.dt, available, correct_yaw=correct_yaw)
        self._available = self._features.available
        unavailable, limited = check_needs(vehicle, available, rate_hz=1e9 / dt_ns)
        self.unavailable: tuple[Unavailable, ...] = tuple(unavailable)
        self.limited: tuple[Unavailable, ...] = tuple(limited)
        self._off = {u.detector for u in unavailable}
        self._down = spin.SpinParams.make(-1.0, self.dt)
        self._up = spin.SpinParams.make(1.0, self.dt)
        self._minor = minor_spin_down.MinorParams.make(self.dt)
        self._resistance = resistance.alarm_params(self.dt)
        self._gate = resistance.gate_params(self.dt)
        self._spin_states = {(d, w): spin.initial_state() for d in ("spin_down", "spin_up") for w in WHEELS}
        self._minor_states = {s: minor_spin_down.initial_state() for s in SIDES}
        self._sums = {"resistance": cusum.initial_state(), "gate": cusum.initial_state()}
        self._holds: dict[str, int] = {}
        self._free: dict[tuple[str, str], tuple[bool, bool]] = {}
        self._builders: dict[tuple[str, str | None, str | None], EventBuilder] = {}
        self.memory = memory or Memory()
        self.slope_watches = (
            ()
            if "slip_slope_drop" in self._off
            else tuple(SlipSlopeWatch(vehicle, pair, self.dt, self.memory) for pair in pairs(vehicle))
        )

    def push(self, columns: Mapping[str, FloatArray]) -> Piece:
        """Take the next samples, any number from one on.

        Parameters
        ----------
        columns : mapping symbol -> array (n,)
            SI, NaN where missing.
        """
        f = dict(self._features.push(columns))
        braking = self._braking(f, columns)
        tracks: list[Track] = []
        events: list[Event] = []
        for run in (self._spin_downs, self._minor_spin_downs, self._spin_ups, self._resistances):
            new_tracks, new_events = run(f, braking)
            tracks += new_tracks
            events += new_events
        for watch in self.slope_watches:
            track, new_events = self._slope_drop(watch, f, braking)
            tracks.append(track)
            events += new_events
        if "joint_criteria" not in self._off:
            track, new_events = self._joint(f, braking, tracks)
            tracks.append(track)
            events += new_events
        return Piece(f, tuple(tracks), tuple(events))

    def finish(self) -> tuple[Event, ...]:
        """Events that were still going on when the drive ended."""
        return tuple(e for b in self._builders.values() for e in b.finish())

    # --- what acts on the wheels -------------------------------------------------------------------------------

    def _braking(self, f: Features, columns: Mapping[str, FloatArray]) -> dict[str, BoolArray]:
        weight = 0.25 * self.vehicle.mass * G
        result = {}
        for wheel in WHEELS:
            name = f"torque_{wheel}"
            torque = columns[name] / (self.vehicle.r_l(wheel) * weight) if name in self._available else None
            bits = is_braking(f["a_kin_slow"], f.get("brake_pressure"), torque)
            result[wheel] = self._hold(f"braking_{wheel}", bits, BRAKE_HOLD)
        return result

    def _hold(self, name: str, bits: BoolArray, seconds: float) -> BoolArray:
        out, self._holds[name] = hold_on(bits, self._holds.get(name, 0), seconds=seconds, dt=self.dt)
        return out

    def _wheels(self, f: Features) -> list[str]:
        return [w for w in WHEELS if f"v_w_{w}" in f]

    # --- single detectors --------------------------------------------------------------------------------------

    def _spin_downs(self, f: Features, braking: Mapping[str, BoolArray]) -> tuple[list[Track], list[Event]]:
        if "spin_down" in self._off:
            return [], []
        always = np.ones(f["v_x_hat"].size, dtype=bool)
        return self._spins("spin_down", self._down, self._wheels(f), f, braking, dict.fromkeys(WHEELS, always))

    def _spin_ups(self, f: Features, braking: Mapping[str, BoolArray]) -> tuple[list[Track], list[Event]]:
        if "spin_up" in self._off:
            return [], []
        always = np.ones(f["v_x_hat"].size, dtype=bool)
        with np.errstate(invalid="ignore"):
            allowed = {w: always if (mu := _traction(f, w)) is None else mu < MU_SPIN_UP for w in WHEELS}
        driven = [w for w in self._wheels(f) if w in self.vehicle.driven]
        return self._spins("spin_up", self._up, driven, f, braking, allowed)

    def _spins(
        self,
        detector: str,
        params: spin.SpinParams,
        wheels: list[str],
        f: Features,
        braking: Mapping[str, BoolArray],
        allowed: Mapping[str, BoolArray],
    ) -> tuple[list[Track], list[Event]]:
        tracks, events = [], []
        for wheel in wheels:
            g, bits, self._spin_states[detector, wheel] = spin.scan(
                params,
                self._spin_states[detector, wheel],
                f[f"a_w_delta_{wheel}"],
                f[f"v_w_delta_{wheel}"],
                f["v_x_hat"],
                allowed[wheel],
            )
            track = Track(detector, wheel, side_of(wheel), "m/s", g, params.cusum.h, bits)
            severity = _severity_down if detector == "spin_down" else _severity_up
            # only a spinning driven wheel has the water's resistance booked on it
            mu = _traction(f, wheel) if detector == "spin_up" else f.get(f"mu_{wheel}")
            events += self._events(track, self._wheel_evidence(wheel, f, braking, mu), severity)
            tracks.append(track)
        return tracks, events

    def _minor_spin_downs(self, f: Features, braking: Mapping[str, BoolArray]) -> tuple[list[Track], list[Event]]:
        tracks: list[Track] = []
        events: list[Event] = []
        if "minor_spin_down" in self._off:
            return tracks, events
        axle = self.vehicle.watched_axle
        with np.errstate(invalid="ignore"):
            is_upright = ~(np.abs(f["a_y_slow"]) > A_Y_MINOR)
        for side, pair in SIDES.items():
            watched = next(w for w in pair if w[0] == axle)
            other = next(w for w in pair if w[0] != axle)
            if f"v_w_{watched}" not in f or f"v_w_{other}" not in f:
                continue
            delta, var, bits, self._minor_states[side] = minor_spin_down.scan(
                self._minor,
                self._minor_states[side],
                f[f"a_w_delta_{watched}"],
                f[f"a_w_delta_{other}"],
                f[f"v_w_delta_{watched}"] - f["v_w_delta_common"],
                f["v_x_hat"],
                ~braking[watched] & is_upright,
            )
            track = Track("minor_spin_down", watched, side, "(m/s^2)^2", delta, self._minor.delta_min, bits)
            mu = f.get(f"mu_{watched}")
            evidence = {**self._wheel_evidence(watched, f, braking, mu), "variance_max": ("max", var)}
            events += self._events(track, evidence, _partial)
            tracks.append(track)
        return tracks, events

    def _slope_drop(
        self, watch: SlipSlopeWatch, f: dict[str, FloatArray], braking: Mapping[str, BoolArray]
    ) -> tuple[Track, list[Event]]:
        seen = watch.push(f, braking, f["yaw_rate_slow"])
        place, wheel = watch.pair.place, watch.pair.wheel
        f[f"slip_slope_{place}"] = np.where(seen.estimate.status < INACTIVE, seen.estimate.slope, np.nan)
        f[f"slip_slope_ref_{place}"] = seen.reference
        track = Track("slip_slope_drop", wheel, place, "-", seen.loss, watch.drop_threshold, seen.active)
        evidence: Evidence = {
            "v_x": ("first", f["v_x_hat"]),
            "slope_min": ("min", seen.estimate.slope),
            "slope_ref": ("first", seen.reference),
            "mu": ("first", seen.mu),
            "slip_max": ("max", np.abs(seen.slip)),
        }
        return track, self._events(track, evidence, _partial)

    def _resistances(self, f: Features, braking: Mapping[str, BoolArray]) -> tuple[list[Track], list[Event]]:
        if "resistance" in self._off:
            return [], []
        x = self._resistance_input(f, braking)
        g, bits, self._sums["resistance"] = cusum.scan(self._resistance, self._sums["resistance"], x)
        track = Track("resistance", None, None, "m/s", g, self._resistance.h, bits)
        evidence: Evidence = {
            "v_x": ("first", f["v_x_hat"]),
            "v_x_min": ("min", f["v_x_hat"]),
            "v_x_max": ("max", f["v_x_hat"]),
            "delta_a_x_max": ("max", _unbraked(f, braking)),
        }
        return [track], self._events(track, evidence, _partial)

    def _resistance_input(self, f: Features, braking: Mapping[str, BoolArray]) -> FloatArray:
        return resistance.trusted_measure(f["delta_a_x"], f["v_x_hat"], f["a_y_slow"], _any_wheel(braking))

    # --- joint detector ----------------------------------------------------------------------------------------

    def _joint(self, f: Features, braking: Mapping[str, BoolArray], tracks: list[Track]) -> tuple[Track, list[Event]]:
        x = self._resistance_input(f, braking)
        _, gate, self._sums["gate"] = cusum.scan(self._gate, self._sums["gate"], x)
        gate = self._hold("gate", gate, joint.GATE_HOLD)
        criteria = joint.wheel_criteria(
            [(t, self._began_free(t, braking)) for t in tracks if t.wheel is not None],
            {w: f[f"v_w_{w}"] for w in self._wheels(f)},
            {w: _traction(f, w) for w in WHEELS},
            f["v_x_hat"],
        )
        active = self._hold("joint", gate & (criteria.count > 0), joint.HOLD)
        statistic = np.where(np.isnan(x), np.nan, np.where(gate, criteria.count, 0.0))
        track = Track("joint_criteria", None, None, "-", statistic, 1.0, active)
        evidence: Evidence = {
            "v_x": ("first", f["v_x_hat"]),
            "slip_min": ("min", criteria.slip_min),
            "delta_a_x_max": ("max", _unbraked(f, braking)),
            **{f"criterion_{number}": ("any", bits & gate) for number, bits in criteria.met.items()},
            "criterion_5": ("any", next(t.active for t in tracks if t.detector == "resistance")),
            "full": ("any", criteria.is_full),
        }
        return track, self._events(track, evidence, _severity_joint)

    def _began_free(self, track: Track, braking: Mapping[str, BoolArray]) -> BoolArray:
        wheel = track.wheel or ""
        key = (track.detector, wheel)
        bits, self._free[key] = began_free(track.active, braking[wheel], self._free.get(key, (False, False)))
        return bits

    # --- events ------------------------------------------------------------------------------------------------

    def _wheel_evidence(
        self, wheel: str, f: Features, braking: Mapping[str, BoolArray], mu: FloatArray | None
    ) -> dict[str, Any]:
        slip = slip_of_wheel_speed(f[f"v_w_{wheel}"], f["v_x_hat"])
        evidence: dict[str, Any] = {
            "v_x": ("first", f["v_x_hat"]),
            "slip_min": ("min", slip),
            "slip_max": ("max", slip),
            "a_w_delta_min": ("min", f[f"a_w_delta_{wheel}"]),
            "a_w_delta_max": ("max", f[f"a_w_delta_{wheel}"]),
            "braking": ("any", braking[wheel]),
            "braking_at_start": ("at_start", braking[wheel]),
        }
        if mu is not None:
            evidence["mu"] = ("first", mu)
            evidence["mu_min"] = ("min", mu)
        return evidence

    def _events(self, track: Track, evidence: Evidence, severity: Callable[[Mapping[str, Any]], str]) -> list[Event]:
        key = (track.detector, track.wheel, track.side)
        if key not in self._builders:
            self._builders[key] = EventBuilder(
                track.detector,
                wheel=track.wheel,
                side=track.side,
                threshold=track.threshold,
                dt_ns=self.dt_ns,
                severity=severity,
            )
        return self._builders[key].push(track.active, track.statistic, evidence)


def _traction(f: Features, wheel: str) -> FloatArray | None:
    """Traction coefficient of a wheel without the water's resistance where that is known; None without torque."""
    return f.get(f"mu_res_{wheel}", f.get(f"mu_{wheel}"))


def _any_wheel(braking: Mapping[str, BoolArray]) -> BoolArray:
    return braking["fl"] | braking["fr"] | braking["rl"] | braking["rr"]


def _unbraked(f: Features, braking: Mapping[str, BoolArray]) -> FloatArray:
    """Resistance measure as evidence: what braking shows is not water's."""
    return np.where(_any_wheel(braking), np.nan, f["delta_a_x"])


def _partial(_: Mapping[str, Any]) -> str:
    return "partial"


def _severity_down(evidence: Mapping[str, Any]) -> str:
    return "full" if evidence.get("slip_min", 0.0) < joint.SLIP_FULL else "partial"


def _severity_up(evidence: Mapping[str, Any]) -> str:
    """Thesis 2.5, criterion 3: full and partial by the traction coefficient; partial where it is not known."""
    return "full" if evidence.get("mu_min", 1.0) < joint.MU_FULL else "partial"


def _severity_joint(evidence: Mapping[str, Any]) -> str:
    return "full" if evidence.get("full", False) else "partial"


def detect_drive(
    signals: Signals, vehicle: Vehicle, *, correct_yaw: bool = True, memory: Memory | None = None
) -> DriveResult:
    """Run all detectors over one drive.

    Parameters
    ----------
    signals : Signals
    vehicle : Vehicle
    correct_yaw : bool
        As in `FeatureStream`.
    memory : Memory, optional
        What is known of the dry slip slope; `slip_slope.history.remembered` adds what this drive has shown.

    Returns
    -------
    DriveResult
        Events in order of their beginning.
    """
    import polars as pl

    # a column without a single value is a signal that the drive does not have
    present = [s for s in signals.symbols if signals.frame[s].null_count() < signals.frame.height]
    stream = DriveStream(vehicle, signals.dt_ns, present, correct_yaw=correct_yaw, memory=memory)
    columns = {s: signals.array(s) for s in (present or ["v_x"])}
    piece = stream.push(columns)
    events = sorted(
        (*piece.events, *stream.finish()), key=lambda e: (e.start_s, e.detector, e.wheel or "", e.side or "")
    )
    slopes = tuple(w.summary() for w in stream.slope_watches)
    return DriveResult(
        signals=signals,
        features=pl.DataFrame(dict(piece.features)),
        tracks=piece.tracks,
        events=tuple(events),
        unavailable=stream.unavailable,
        limited=stream.limited,
        vehicle_name=vehicle.name,
        notes=(*implausible(signals, piece.features, vehicle), *remarks(slopes)),
        slopes=slopes,
    )
