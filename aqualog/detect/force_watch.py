"""Watch forces that dry road cannot explain: resistance of the vehicle, forces in tie rods and steering."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from aqualog.calibrate import online
from aqualog.core.notation import side_of
from aqualog.core.records import BoolArray, Event, FloatArray, Track
from aqualog.core.vehicle import Vehicle
from aqualog.detect import cusum, joint, resistance, tie_rod
from aqualog.detect.events import EventBook
from aqualog.detect.negative_force import hold_on
from aqualog.detect.scene import Scene
from aqualog.detect.thresholds import Thresholds

__all__ = ["ResistanceWatch", "TieRodWatch"]

FREEZE = 2.0  # [s] after a wheel has left the road's speed nothing is learnt as dry


class ResistanceWatch:
    """Resistance measure, its offset on dry road, its alarm and the gate of the joint detector.

    Parameters
    ----------
    dt : float
        [s]
    thresholds : Thresholds
    learns : bool
        Whether to subtract the offset that dry driving shows (a drifting accelerometer, wind).
    """

    def __init__(self, dt: float, thresholds: Thresholds, *, learns: bool = True) -> None:
        self._dt = dt
        self._alarm = resistance.alarm_params(dt, thresholds.resistance)
        self._gate = resistance.gate_params(dt, thresholds.joint_criteria)
        self._online = online.OnlineParams.make(dt) if learns else None
        self._offset = online.initial_state()
        self._sums = {"alarm": cusum.initial_state(), "gate": cusum.initial_state()}
        self._frozen = self._open = 0

    def push(
        self, scene: Scene, book: EventBook, suspicion: BoolArray
    ) -> tuple[Track, list[Event], FloatArray, BoolArray, dict[str, FloatArray]]:
        """Return track, closed events, trusted measure [m/s²], gate, and features of the next piece.

        `suspicion` (n,): a wheel or the slip slope suggests that this is not dry road; the offset is frozen then.
        """
        f = scene.f
        frozen, self._frozen = hold_on(suspicion, self._frozen, seconds=FREEZE, dt=self._dt)
        measure, features = f["delta_a_x"], {}
        if self._online is not None:
            usable = resistance.usable_for_offset(
                measure, f["v_x_hat"], f["a_kin_slow"], f["a_y_slow"], scene.is_braking
            )
            offset, self._offset = online.scan(self._online, self._offset, usable, f["v_x_hat"], frozen)
            features["delta_a_x_offset"] = offset
            measure = measure - offset
        x = resistance.trusted_measure(measure, f["v_x_hat"], f["a_y_slow"], scene.is_braking)
        g, bits, self._sums["alarm"] = cusum.scan(self._alarm, self._sums["alarm"], x)
        _, gate, self._sums["gate"] = cusum.scan(self._gate, self._sums["gate"], x)
        gate, self._open = hold_on(gate, self._open, seconds=joint.GATE_HOLD, dt=self._dt)
        track = Track("resistance", None, None, "m/s", g, self._alarm.h, bits)
        evidence: dict[str, Any] = {
            "v_x": ("first", f["v_x_hat"]),
            "v_x_min": ("min", f["v_x_hat"]),
            "v_x_max": ("max", f["v_x_hat"]),
            "delta_a_x_max": ("max", np.where(scene.is_braking, np.nan, measure)),
        }
        return track, book.take(track, evidence, _partial), x, gate, features


class TieRodWatch:
    """Forces in the tie rods, wheel by wheel; the torque at the steering without them."""

    def __init__(self, vehicle: Vehicle, dt: float, thresholds: Thresholds) -> None:
        self._vehicle = vehicle
        self._params = tie_rod.params(dt, thresholds.tie_rod)
        self._sums: dict[str, cusum.CusumState] = {}

    def push(self, scene: Scene, book: EventBook) -> tuple[list[Track], list[Event]]:
        """Return tracks and closed events of the next piece."""
        f = scene.f
        tracks: list[Track] = []
        events: list[Event] = []
        for wheel in ("fl", "fr"):
            if f"tie_rod_hat_{wheel}" in f:
                braking = scene.braking[wheel]
                self._one(f"tie_rod_{{}}_{wheel}", "tie_rod", wheel, scene, braking, book, tracks, events)
        if not tracks and "steering_hat" in f:
            self._one("steering_{}", "steering_torque", None, scene, scene.is_braking, book, tracks, events)
        return tracks, events

    def _one(
        self,
        name: str,
        section: str,
        wheel: str | None,
        scene: Scene,
        braking: BoolArray,
        book: EventBook,
        tracks: list[Track],
        events: list[Event],
    ) -> None:
        f = scene.f
        measured, modelled = f[name.format("meas")], f[name.format("hat")]
        table: Mapping[str, tuple[float, ...]] = getattr(self._vehicle, section)
        sigma = table.get("sigma", (tie_rod.SIGMA[section],))[0]
        z = tie_rod.scaled_residual(measured, modelled, f["v_x_hat"], f["a_y_slow"], braking, sigma=sigma)
        state = self._sums.get(name, cusum.initial_state())
        g, bits, self._sums[name] = cusum.scan(self._params, state, z)
        track = Track("tie_rod", wheel, side_of(wheel) if wheel else None, "s", g, self._params.h, bits)
        residual = measured - modelled
        stem = "force_residual" if section == "tie_rod" else "torque_residual"
        evidence: dict[str, Any] = {
            "v_x": ("first", f["v_x_hat"]),
            f"{stem}_min": ("min", residual),
            f"{stem}_max": ("max", residual),
            "from_steering_torque": ("any", np.full(z.size, section != "tie_rod")),
        }
        tracks.append(track)
        events += book.take(track, evidence, _partial)


def _partial(_: Mapping[str, Any]) -> str:
    return "partial"
