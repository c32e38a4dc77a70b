"""Prepare a drive for the rivals."""

from __future__ import annotations

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.detect.negative_force import HOLD, hold_on, is_braking
from aqualog.features.stream import INPUTS, Features, FeatureStream
from aqualog.physics.load import G
from aqualog.rivals.records import RivalInputs

__all__ = ["present_symbols", "rival_inputs"]


def present_symbols(signals: Signals) -> tuple[str, ...]:
    """Return symbols that rivals may read and that have a value at all; never truth or labels."""
    height = signals.frame.height
    return tuple(s for s in signals.symbols if s in INPUTS and signals.frame[s].null_count() < height)


def rival_inputs(signals: Signals, vehicle: Vehicle) -> RivalInputs:
    """Return features and raw columns of a whole drive; the features are those of the thesis' detectors."""
    present = present_symbols(signals)
    columns = {s: signals.array(s) for s in (present or ("v_x",))}
    features = FeatureStream(vehicle, signals.dt, present).push(columns)
    braking = {w: _braking(w, features, columns.get(f"torque_{w}"), vehicle, signals.dt) for w in WHEELS}
    return RivalInputs(features, columns, braking, vehicle, signals.dt)


def _braking(wheel: str, f: Features, torque: FloatArray | None, vehicle: Vehicle, dt: float) -> BoolArray:
    weight = 0.25 * vehicle.mass * G
    coefficient = None if torque is None else torque / (vehicle.r_l(wheel) * weight)
    bits = is_braking(f["a_kin_slow"], f.get("brake_pressure"), coefficient)
    return hold_on(np.ascontiguousarray(bits), 0, seconds=HOLD, dt=dt)[0]
