"""Detect tie-rod forces that dry road cannot explain, by a CUSUM."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from aqualog.core.notation import AXLES
from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.detect import cusum
from aqualog.detect.cusum import CusumParams
from aqualog.detect.detector import Detector, Found, Needs, Output, Scene, Setup, missing_drivetrain

__all__ = ["SIGMA", "TIE_ROD", "TieRodWatch", "params", "scaled_residual"]

THRESHOLD = 0.4  # [s]
# [N, N m] scatter of a good model on dry road, where none is given (K)
SIGMA = {"tie_rod": 60.0, "steering_torque": 0.5}
SHARE = 0.10  # of the modelled force: a coarse model is off in proportion too (thesis 2.4)
CLIP = 12.0  # [-] a kerb shows more for a moment than a spin-down ever does
V_MIN = 8.0  # [m/s]
A_Y_MAX = 4.0  # [m/s^2] beyond, the lateral force is out of the range in which the polynomial was found


def params(dt: float, threshold: float = THRESHOLD) -> CusumParams:
    """Drift of four scatters, so that neither the model's error nor early partial aquaplaning raises an alarm (C60)."""
    return CusumParams(4.0, threshold, 3.0 * threshold, dt)


def scaled_residual(
    measured: FloatArray, modelled: FloatArray, v_x: FloatArray, a_y: FloatArray, is_braking: BoolArray, *, sigma: float
) -> FloatArray:
    """Return measured minus modelled force over the scatter that it has on dry road.

    Parameters
    ----------
    measured, modelled : array (n,)
        Tie-rod force [N] or steering torque [N·m], low-passed alike.
    v_x : array (n,)
        [m/s]
    a_y : array (n,)
        Low-passed. [m/s²]
    is_braking : bool array (n,)
        A braking force acts on this wheel: brake forces pull at the rods too.
    sigma : float
        Scatter on dry road, > 0. [N, N m]

    Returns
    -------
    z : array (n,)
        |measured - modelled| / (sigma + 0.1 |modelled|), at most 12; 0 where the model does not hold, NaN where a
        signal is missing. [-]

    Thesis: section 2.4 (C59-C63). The amount counts, not the sign: the design of the axle decides whether a resisting
    wheel presses or pulls its rod.
    """
    with np.errstate(invalid="ignore"):
        z = np.minimum(np.abs(measured - modelled) / (sigma + SHARE * np.abs(modelled)), CLIP)
        holds = (v_x > V_MIN) & (np.abs(a_y) < A_Y_MAX) & ~is_braking
    return np.where(np.isnan(z), np.nan, np.where(holds, z, 0.0))


class TieRodWatch:
    """Forces in the tie rods, wheel by wheel; the torque at the steering without them."""

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._params = params(setup.dt, setup.threshold)
        self._sums: dict[str, cusum.CusumState] = {}

    def push(self, scene: Scene) -> Output:
        """Take the next piece: a track per tie rod, or one of the steering. [s]"""
        rods = [w for w in AXLES["f"] if f"tie_rod_hat_{w}" in scene.f]
        found = [self._one(f"tie_rod_{{}}_{w}", "tie_rod", w, scene, scene.braking[w]) for w in rods]
        if not found and "steering_hat" in scene.f:
            found = [self._one("steering_{}", "steering_torque", None, scene, scene.is_braking)]
        return Output(tuple(found))

    def _one(self, name: str, section: str, wheel: str | None, scene: Scene, braking: BoolArray) -> Found:
        f = scene.f
        measured, modelled = f[name.format("meas")], f[name.format("hat")]
        table: Mapping[str, tuple[float, ...]] = getattr(self._setup.vehicle, section)
        sigma = table.get("sigma", (SIGMA[section],))[0]
        z = scaled_residual(measured, modelled, f["v_x_hat"], f["a_y_slow"], braking, sigma=sigma)
        g, bits, self._sums[name] = cusum.scan(self._params, self._sums.get(name, cusum.initial_state()), z)
        residual = measured - modelled
        stem = "force_residual" if section == "tie_rod" else "torque_residual"
        evidence: dict[str, Any] = {
            "v_x": ("first", f["v_x_hat"]),
            f"{stem}_min": ("min", residual),
            f"{stem}_max": ("max", residual),
            "from_steering_torque": ("any", np.full(z.size, section != "tie_rod")),
        }
        return self._setup.track(g, bits, wheel=wheel), evidence


def _needs(vehicle: Vehicle, have: Collection[str], rate_hz: float) -> Needs:
    """Name what is missing to compare tie-rod forces, or else the steering torque, with their model."""
    rods = [f"tie_rod_{w}" for w in AXLES["f"]]
    front = [f"torque_{w}" for w in AXLES["f"] if w in vehicle.driven and f"torque_{w}" not in have]
    motion = [*(s for s in ("a_y", "yaw_rate") if s not in have), *front, *missing_drivetrain(vehicle)]
    if any(r in have for r in rods):
        model = [] if vehicle.tie_rod else ["vehicle.tie_rod (aqualog calibrate)"]
    elif "steering_torque" in have:
        model = [] if vehicle.steering_torque else ["vehicle.steering_torque (aqualog calibrate)"]
    else:
        model = rods
    return Needs((*model, *motion), tuple(r for r in rods if r not in have))


TIE_ROD = Detector(
    name="tie_rod",
    title="Tie-rod force",
    unit="s",
    meaning="sum of the tie-rod residual over its scatter, beyond four of it",
    statistic="sum of the tie-rod residual beyond its scatter",
    threshold=THRESHOLD,
    needs=_needs,
    start=TieRodWatch,
)
