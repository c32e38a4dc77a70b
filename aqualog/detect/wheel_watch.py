"""Watch wheels that leave the road's speed: large spin-downs, spin-ups and minor spin-downs of a drive."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from aqualog.core.notation import SIDES, WHEELS, side_of
from aqualog.core.records import BoolArray, Event, FloatArray, Track
from aqualog.core.vehicle import Vehicle
from aqualog.detect import minor_spin_down, spin
from aqualog.detect.events import EventBook
from aqualog.detect.scene import Scene, traction
from aqualog.physics.slip import slip_of_wheel_speed

__all__ = ["MU_FULL", "SLIP_FULL", "MinorWatch", "SpinWatch"]

MU_SPIN_UP = 0.07  # [-] thesis 2.1: above it, spin-up is that of another slippery road (C27)
A_Y_MINOR = 4.0  # [m/s^2] beyond, the inner wheels lose load enough to slow down on dry road too
SLIP_FULL = -0.25  # [-] a wheel that has lost a quarter of its speed has lost the road
MU_FULL = 0.02  # [-] what a spinning driven wheel still transmits at full aquaplaning


class SpinWatch:
    """Spin-downs of all wheels or spin-ups of the driven ones.

    Parameters
    ----------
    detector : `spin_down` or `spin_up`
    vehicle : Vehicle
    dt : float
        [s]
    threshold : float
        Of the speed lost or gained. [m/s]
    """

    def __init__(self, detector: str, vehicle: Vehicle, dt: float, threshold: float) -> None:
        self._detector = detector
        self._is_up = detector == "spin_up"
        self._wheels = vehicle.driven if self._is_up else WHEELS
        self._params = spin.SpinParams.make(1.0 if self._is_up else -1.0, dt, threshold)
        self._states = {w: spin.initial_state() for w in self._wheels}

    def push(self, scene: Scene, book: EventBook) -> tuple[list[Track], list[Event]]:
        """Return tracks and closed events of the next piece."""
        f = scene.f
        tracks, events = [], []
        for wheel in scene.wheels:
            if wheel not in self._wheels:
                continue
            g, bits, self._states[wheel] = spin.scan(
                self._params, self._states[wheel], f[f"a_w_delta_{wheel}"], f[f"v_w_delta_{wheel}"], f["v_x_hat"],
                self._allowed(scene, wheel),
            )  # fmt: skip
            track = Track(self._detector, wheel, side_of(wheel), "m/s", g, self._params.cusum.h, bits)
            # only a spinning driven wheel has the water's resistance booked on it
            mu = traction(f, wheel) if self._is_up else f.get(f"mu_{wheel}")
            events += book.take(track, _evidence(scene, wheel, mu), _severity_up if self._is_up else _severity_down)
            tracks.append(track)
        return tracks, events

    def _allowed(self, scene: Scene, wheel: str) -> BoolArray:
        mu = traction(scene.f, wheel) if self._is_up else None
        if mu is None:
            return np.ones(scene.size, dtype=bool)
        with np.errstate(invalid="ignore"):
            return mu < MU_SPIN_UP


class MinorWatch:
    """Minor spin-downs of the watched axle, side by side.

    `features` of the last piece: the variances of all wheels that are compared, `variance_fl` ... [(m/s²)^2].

    Parameters
    ----------
    vehicle : Vehicle
    dt : float
        [s]
    threshold : float
        Of the difference of variances. [(m/s²)^2]
    """

    def __init__(self, vehicle: Vehicle, dt: float, threshold: float) -> None:
        self._axle = vehicle.watched_axle
        self._params = minor_spin_down.MinorParams.make(dt, threshold)
        self._states = {s: minor_spin_down.initial_state() for s in SIDES}
        self.features: dict[str, FloatArray] = {}

    def push(self, scene: Scene, book: EventBook) -> tuple[list[Track], list[Event]]:
        """Return tracks and closed events of the next piece."""
        f = scene.f
        tracks: list[Track] = []
        events: list[Event] = []
        with np.errstate(invalid="ignore"):
            is_upright = ~(np.abs(f["a_y_slow"]) > A_Y_MINOR)
        for side, pair in SIDES.items():
            watched = next(w for w in pair if w[0] == self._axle)
            other = next(w for w in pair if w[0] != self._axle)
            if watched not in scene.wheels or other not in scene.wheels:
                continue
            delta, var, bits, self._states[side] = minor_spin_down.scan(
                self._params, self._states[side], f[f"a_w_delta_{watched}"], f[f"a_w_delta_{other}"],
                f[f"v_w_delta_{watched}"] - f["v_w_delta_common"], f["v_x_hat"],
                ~scene.braking[watched] & is_upright,
            )  # fmt: skip
            self.features |= {f"variance_{watched}": var, f"variance_{other}": var - delta}
            track = Track("minor_spin_down", watched, side, "(m/s^2)^2", delta, self._params.delta_min, bits)
            evidence = {**_evidence(scene, watched, f.get(f"mu_{watched}")), "variance_max": ("max", var)}
            events += book.take(track, evidence, _partial)
            tracks.append(track)
        return tracks, events


def _evidence(scene: Scene, wheel: str, mu: FloatArray | None) -> dict[str, Any]:
    f, braking = scene.f, scene.braking[wheel]
    slip = slip_of_wheel_speed(f[f"v_w_{wheel}"], f["v_x_hat"])
    evidence: dict[str, Any] = {
        "v_x": ("first", f["v_x_hat"]),
        "slip_min": ("min", slip),
        "slip_max": ("max", slip),
        "a_w_delta_min": ("min", f[f"a_w_delta_{wheel}"]),
        "a_w_delta_max": ("max", f[f"a_w_delta_{wheel}"]),
        "braking": ("any", braking),
        "braking_at_start": ("at_start", braking),
    }
    if mu is not None:
        evidence["mu"] = ("first", mu)
        evidence["mu_min"] = ("min", mu)
    return evidence


def _partial(_: Mapping[str, Any]) -> str:
    return "partial"


def _severity_down(evidence: Mapping[str, Any]) -> str:
    return "full" if evidence.get("slip_min", 0.0) < SLIP_FULL else "partial"


def _severity_up(evidence: Mapping[str, Any]) -> str:
    """Apply thesis 2.5, criterion 3: full and partial by the traction coefficient; partial where it is unknown."""
    return "full" if evidence.get("mu_min", 1.0) < MU_FULL else "partial"
