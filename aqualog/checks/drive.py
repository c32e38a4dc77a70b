"""Torques: do they drive the axles of the vehicle file, and do they explain the acceleration."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aqualog.checks.doubts import Doubt
from aqualog.checks.windows import EXTRA, Windows
from aqualog.core.notation import AXLES

__all__ = ["drive_doubts"]

LEAST_SAMPLES = 50
LEAST_DRIVE = 50.0  # [N m] of an axle, nine tenths of the drive below it: less shows no drivetrain
RESISTANCE = 0.3  # [m/s^2] median over a drive: more than any stretch of dry road makes
_AXLE = {"f": "front", "r": "rear"}


def drive_doubts(windows: Windows) -> Iterator[Doubt]:
    """Yield what is wrong with the torques or with the vehicle file."""
    yield from _resistance(windows)
    yield from _drivetrain(windows)


def _resistance(windows: Windows) -> Iterator[Doubt]:
    if EXTRA not in windows:
        return
    x = windows[EXTRA]
    x = x[np.isfinite(x)]
    if x.size < LEAST_SAMPLES or abs(float(np.median(x))) < RESISTANCE:
        return
    what = f"the resistance measure lies at {np.median(x):+.2f} m/s² in the middle of this drive"
    cause = "mass, wheel torque (gear ratio, sign, unit) and the offset of a_x"
    advice = f"check {cause} before you believe the resistance detector"
    yield Doubt("resistance", ("a_x",), what, advice, value=float(np.median(x)))


def _drivetrain(windows: Windows) -> Iterator[Doubt]:
    """Compare the axles that the torques drive with those in the vehicle file."""
    known = {a: x[np.isfinite(x)] for a in AXLES if (name := f"torque_{a}") in windows and (x := windows[name]).size}
    drive = {a: float(np.quantile(x, 0.9)) for a, x in known.items() if x.size >= LEAST_SAMPLES}
    most = max(drive.values(), default=0.0)
    if most < LEAST_DRIVE:
        return
    vehicle = windows.vehicle
    for axle, torque in drive.items():
        is_driven = f"{axle}l" in vehicle.driven
        if not is_driven and torque > 0.1 * most:
            told, better = f"are driven with up to {torque:.0f} N m", "awd"
        elif is_driven and torque < 0.02 * most:
            told, better = "are never driven", "rwd" if axle == "f" else "fwd"
        else:
            continue
        what = f"the vehicle file says {vehicle.drivetrain}, but the {_AXLE[axle]} wheels {told}"
        yield Doubt("drivetrain", ("drivetrain",), what, f'drivetrain = "{better}"?')
        return
