"""Joint detector 1: the resistance opens a gate, and at least one other criterion is met (thesis 2.5, Fig. 2.24)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aqualog.core.records import BoolArray, FloatArray, Track
from aqualog.detect.wheel_watch import MU_FULL, SLIP_FULL
from aqualog.physics.slip import slip_of_wheel_speed

__all__ = ["CRITERIA", "GATED", "GATE_HOLD", "HOLD", "SLOPE", "Criteria", "criteria"]

GATE_HOLD = 1.0  # [s] the resistance gate stays open this long
HOLD = 0.5  # [s] a warning outlasts its criteria by this
CRITERIA = {"spin_down": 1, "minor_spin_down": 2, "spin_up": 3, "slip_slope_drop": 4, "resistance": 5}
SLOPE = 4
GATED = (1, 2, 3, 4)  # one of these must be met while the gate is open; 5 needs no gate


@dataclass(frozen=True, slots=True)
class Criteria:
    """Which criteria are met, and how far each wheel has lost contact; arrays (n,)."""

    met: Mapping[int, BoolArray]
    is_full: BoolArray
    slip_min: FloatArray

    def behind(self, gate: BoolArray, slope: BoolArray) -> dict[int, BoolArray]:
        """Return the criteria that count: 1 to 4 behind the gate, 4 also where water may cause a lost slope."""
        return {
            k: bits if k not in GATED else bits & gate & slope if k == SLOPE else bits & gate
            for k, bits in self.met.items()
        }


def criteria(
    tracks: Sequence[tuple[Track, BoolArray]],
    v_w: Mapping[str, FloatArray],
    mu: Mapping[str, FloatArray | None],
    v_x: FloatArray,
) -> Criteria:
    """Evaluate criteria 1 to 5 from the tracks of the single detectors.

    Parameters
    ----------
    tracks : sequence of (Track, bool array (n,))
        Of this piece of the drive. Tracks of wheels come with the detections that began without a braking force;
        tracks of other detectors are ignored.
    v_w, mu : mapping wheel -> array (n,)
        Centre-line wheel speed [m/s]; traction coefficient, None if not known [-].
    v_x : array (n,)
        Velocity. [m/s]

    Thesis: section 2.5 (C65-C69). 1 to 3 do not count under a negative tyre force; a detection that began without it
    stays when the driver brakes after it. 4: slope below half of the dry one, tyre driven, wheel acceleration calm.
    """
    n = v_x.size
    met = {number: np.zeros(n, dtype=bool) for number in CRITERIA.values()}
    full = np.zeros(n, dtype=bool)
    slip_min = np.full(n, np.nan)
    for track, bits in tracks:
        if track.detector not in CRITERIA:
            continue
        met[CRITERIA[track.detector]] |= bits
        if track.wheel is None or track.detector not in ("spin_down", "minor_spin_down", "spin_up"):
            continue
        slip = slip_of_wheel_speed(v_w[track.wheel], v_x)
        traction = mu[track.wheel]
        with np.errstate(invalid="ignore"):
            if track.detector != "spin_up":
                full |= bits & (slip < SLIP_FULL)
            elif traction is not None:
                full |= bits & (traction < MU_FULL)
        slip_min = np.fmin(slip_min, np.where(bits, slip, np.nan))
    return Criteria(met, full, slip_min)
