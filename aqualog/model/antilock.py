"""Antilock brakes: each wheel's pressure falls when it is about to lock and comes back when it rolls again."""

from __future__ import annotations

from aqualog.core.compiled import compiled

__all__ = ["antilock"]

SLIP_RELEASE = 0.12  # [-] brake slip at which pressure is let go, about the peak of a tyre on any road (K)
SLIP_BUILD = 0.04  # [-] at which it comes back (K)
RELEASE_RATE = 9.0  # [1/s] of the whole torque: a valve empties a brake in about a tenth of a second (K)
BUILD_RATE = 2.5  # [1/s] stepwise build-up, on average (K)
V_OFF = 2.0  # [m/s] below, wheels may lock: 3-10 km/h on series cars (K)


@compiled
def antilock(released, releasing, row, omega_at, v_at, r_at, dt):  # type: ignore[no-untyped-def]
    """One step of a two-state controller per wheel, in place.

    `released` (4,) is the share of the brake torque that is held off, `releasing` (4,) 1 while it falls. `row` is the
    record of the step with wheel speeds, speeds over ground and radii from `omega_at`, `v_at`, `r_at` on. The cycle of
    3 to 10 Hz follows from rates, thresholds and the wheel's inertia.
    """
    for i in range(4):
        v = row[v_at + i]
        slip = 1.0 - row[omega_at + i] * row[r_at + i] / max(v, 0.1)
        if v < V_OFF or slip < SLIP_BUILD:
            releasing[i] = 0.0
        elif slip > SLIP_RELEASE:
            releasing[i] = 1.0
        if releasing[i] > 0.0:
            released[i] = min(released[i] + RELEASE_RATE * dt, 1.0)
        else:
            released[i] = max(released[i] - BUILD_RATE * dt, 0.0)
