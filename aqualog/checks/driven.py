"""Which axle the torques of a log show to be driven, and what to say where the vehicle file does not say it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from aqualog.core.errors import SignalError
from aqualog.core.notation import AXLES
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle

__all__ = ["LEAST_DRIVE", "STILL", "drives", "no_drivetrain", "shown"]

LEAST_SAMPLES = 20
LEAST_DRIVE = 50.0  # [N m] of an axle, nine tenths of the drive below it: less shows no drivetrain
STILL = 0.02  # of the other axle's drive: less is no drive


def drives(torques: Mapping[str, FloatArray]) -> dict[str, float]:
    """Return the drive of each axle that has a torque: nine tenths of the log are below it. [N·m]

    `torques`: sums of the wheels of an axle, by axle, arrays (n,). Empty where no axle reaches `LEAST_DRIVE`.
    """
    known = {a: x[np.isfinite(x)] for a, x in torques.items()}
    found = {a: float(np.quantile(x, 0.9)) for a, x in known.items() if x.size >= LEAST_SAMPLES}
    return found if max(found.values(), default=0.0) >= LEAST_DRIVE else {}


def shown(torques: Mapping[str, FloatArray]) -> tuple[str, str]:
    """Return what the torques of the axles show, and the line to propose; empty where they show nothing.

    `torque_r moves, torque_f does not` and `drivetrain = "rwd"?`. A proposal, never an assumption: an axle whose
    torque is not in the log may be driven too.
    """
    found = drives(torques)
    if not found:
        return "", ""
    most = max(found.values())
    moving = [a for a in AXLES if found.get(a, 0.0) > STILL * most]
    one = {"f": "fwd", "r": "rwd"}
    if len(moving) == 2:
        return "torque_f and torque_r move", 'drivetrain = "awd"?'
    (axle,) = moving
    other = "r" if axle == "f" else "f"
    if other in found:
        return f"torque_{axle} moves, torque_{other} does not", f'drivetrain = "{one[axle]}"?'
    return f"torque_{axle} moves, torque_{other} is not in the log", f'drivetrain = "{one[axle]}" or "awd"?'


def no_drivetrain(
    vehicle: Vehicle, columns: Mapping[str, FloatArray], what: str = "", *, where: str = ""
) -> SignalError:
    """Return the error of work that needs the driven axle, with what the log's torques show.

    Parameters
    ----------
    columns : mapping symbol -> array (n,)
        Signals of the drive.
    what : str
        What is not estimated, if the caller does not say it.
    where : str
        The drive.
    """
    names = {a: [f"torque_{w}" for w in wheels if f"torque_{w}" in columns] for a, wheels in AXLES.items()}
    sums: dict[str, FloatArray] = {a: np.sum([columns[n] for n in own], axis=0) for a, own in names.items() if own}
    seen, line = shown(sums)
    said = f"the vehicle {vehicle.name} does not say which axle is driven"
    return SignalError(
        f"{what}: {said}" if what else said, where=where,
        expected='drivetrain = "rwd", "fwd" or "awd" in the vehicle file', hint=f"{seen}: {line}" if line else "",
    )  # fmt: skip
