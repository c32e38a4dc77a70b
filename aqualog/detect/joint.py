"""Joint detector 1: resistance as gate, and at least one wheel criterion (thesis 2.5, Fig. 2.24)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.physics.slip import slip_of_wheel_speed
from aqualog.types import BoolArray, FloatArray, Track

__all__ = ["CRITERIA", "GATE_HOLD", "HOLD", "MU_FULL", "SLIP_FULL", "WheelCriteria", "wheel_criteria"]

GATE_HOLD = 1.0  # [s] the resistance gate stays open this long
HOLD = 0.5  # [s] a warning outlasts its criteria by this
SLIP_FULL = -0.25  # [-] a wheel that has lost a quarter of its speed has lost the road
MU_FULL = 0.02  # [-] what a spinning driven wheel still transmits at full aquaplaning
CRITERIA = {"spin_down": 1, "minor_spin_down": 2, "spin_up": 3}


@dataclass(frozen=True, slots=True)
class WheelCriteria:
    """Criteria 1 to 3 of any wheel without braking force, and how far it went."""

    met: Mapping[int, BoolArray]
    is_full: BoolArray
    slip_min: FloatArray

    @property
    def count(self) -> FloatArray:
        """How many of the three are met. (n,)"""
        return sum((bits.astype(np.float64) for bits in self.met.values()), np.zeros(self.is_full.size))


def wheel_criteria(
    tracks: Sequence[tuple[Track, BoolArray]],
    v_w: Mapping[str, FloatArray],
    mu: Mapping[str, FloatArray | None],
    v_x: FloatArray,
) -> WheelCriteria:
    """Criteria 1 to 3 from the tracks of the single detectors.

    Parameters
    ----------
    tracks : sequence of (Track, bool array (n,))
        Of this piece of the drive, with the detections that began without a braking force; those that are no wheel
        criterion are left aside.
    v_w, mu : mapping wheel -> array (n,)
        Centre-line wheel speed [m/s]; traction coefficient, None if not known [-].
    v_x : array (n,)
        Velocity. [m/s]

    Thesis: criteria 1, 2 and 3 of section 2.5 (C65-C67): none counts under a negative tyre force. A criterion that
    began without one stays when the driver brakes after it.
    """
    n = v_x.size
    met = {number: np.zeros(n, dtype=bool) for number in CRITERIA.values()}
    full = np.zeros(n, dtype=bool)
    slip_min = np.full(n, np.nan)
    for track, bits in tracks:
        if track.detector not in CRITERIA or track.wheel is None:
            continue
        met[CRITERIA[track.detector]] |= bits
        slip = slip_of_wheel_speed(v_w[track.wheel], v_x)
        traction = mu[track.wheel]
        with np.errstate(invalid="ignore"):
            if track.detector != "spin_up":
                full |= bits & (slip < SLIP_FULL)
            elif traction is not None:
                full |= bits & (traction < MU_FULL)
        slip_min = np.fmin(slip_min, np.where(bits, slip, np.nan))
    return WheelCriteria(met, full, slip_min)
