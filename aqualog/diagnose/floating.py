"""Samples in which a wheel floats or nearly floats, and whose residual is not judged.

A wheel that has lost its grip is bistable. Unknown differences of the water decide whether and when it spins down in a
puddle, and when it recovers. Its speed can then be tens of m/s away from the simulation. This is chance, not an error
of the model, and it also happens in drives without any hidden effect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.channels import centre_line_speeds
from aqualog.model.effects import EFFECTS
from aqualog.model.follow import Course, follow
from aqualog.model.term import Model, Term

__all__ = ["RESERVED", "floating"]

# slip of a wheel beyond its grip: a wet tyre's force has its largest value at 0.08 to 0.2 (D: 3 mu / C), and driving
# without floating needs a fifth of that
BEYOND_GRIP = 0.05
# times its own lost contact with which the simulation must still hold on: it goes with the fourth power of the speed of
# full aquaplaning, which sources give as 118 (thesis), 95 (PAVDRN, K) and 88 km/h (Gallaway, K) at 1.3 mm
RESERVE = 2.0
# [s] a wheel that stood takes up speed again within one (D: 33 m/s in 0.65 s), but the led car has been turned by it,
# nobody steers it back, and its yaw dies out in a few
RECOVERY_S = 5.0
RESERVED = (Model(), Model((Term(EFFECTS["contact_loss"], {"gain": RESERVE}),)))
V_LEAST = 4.0  # [m/s] under the slip


def floating(
    columns: Mapping[str, FloatArray], v: FloatArray, vehicle: Vehicle, course: Course,
    models: Sequence[Model] = RESERVED,
) -> BoolArray:  # fmt: skip
    """Samples (n,) in which a wheel may float. All False on a dry course.

    Parameters
    ----------
    columns : mapping of array (n,)
        Measured signals; wheels that are not logged are taken from the simulation alone.
    v : array (n,)
        Measured velocity. [m/s]
    vehicle : Vehicle
    course : Course
        The simulation is led along it.
    models : sequence of Model
        Of it: as it is, and with twice the lost contact.

    A span begins where a wheel loses its grip, measured or in any simulation. It ends when the stretch of water is
    over and the car has recovered. A wheel that floats a little less also floats a little later.
    """
    out: BoolArray = np.zeros(v.shape, dtype=bool)
    if not course.lanes:
        return out
    for shown in (columns, *(follow(vehicle, course, m) for m in models)):
        if all(f"omega_{w}" in shown for w in WHEELS):
            speed = shown.get("v_x", v)
            # over a speed that is not too small: a standing car does not slip
            slip = (centre_line_speeds(shown, vehicle) - speed) / np.maximum(speed, V_LEAST)
            out |= np.abs(slip).max(axis=0) > BEYOND_GRIP
    left_out = out.copy()
    for lane in course.lanes:
        first = np.flatnonzero(out & (course.t >= lane.start) & (course.t < lane.end))
        if first.size:
            left_out |= (course.t >= course.t[first[0]]) & (course.t < lane.end + RECOVERY_S)
    return left_out
