"""Antilock brakes: each wheel's pressure falls when it is about to lock and comes back when it rolls again."""

from __future__ import annotations

from aqualog.core.compiled import part
from aqualog.model.state import AT

__all__ = ["antilock"]

SLIP_RELEASE = 0.12  # [-] brake slip at which pressure is let go, about the peak of a tyre on any road (K)
SLIP_BUILD = 0.04  # [-] at which it comes back (K)
RELEASE_RATE = 9.0  # [1/s] of the whole torque: a valve empties a brake in about a tenth of a second (K)
BUILD_RATE = 2.5  # [1/s] stepwise build-up, on average (K)
V_OFF = 2.0  # [m/s] below, wheels may lock: 3-10 km/h on series cars (K)


@part
def antilock(m, dt):  # type: ignore[no-untyped-def]
    """One step of a two-state controller per wheel, in place, by the speeds that the step recorded.

    `m.released` (4,) is the share of the brake torque that is held off, `m.releasing` (4,) 1 while it falls. The cycle
    of 3 to 10 Hz follows from rates, thresholds and the wheel's inertia.
    """
    for i in range(4):
        v = m.out[AT.v_along + i]
        slip = 1.0 - m.out[AT.omega + i] * m.out[AT.r_e + i] / max(v, 0.1)
        if v < V_OFF or slip < SLIP_BUILD:
            m.releasing[i] = 0.0
        elif slip > SLIP_RELEASE:
            m.releasing[i] = 1.0
        if m.releasing[i] > 0.0:
            m.released[i] = min(m.released[i] + RELEASE_RATE * dt, 1.0)
        else:
            m.released[i] = max(m.released[i] - BUILD_RATE * dt, 0.0)
