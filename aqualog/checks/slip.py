"""Which axle slips when the car accelerates, on either side: the driven one, or wheels are exchanged."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aqualog.checks.doubts import Change, Doubt, exchanged
from aqualog.checks.relations import Relation, changes, relate
from aqualog.checks.windows import Windows
from aqualog.core.notation import WHEELS
from aqualog.core.records import FloatArray

__all__ = ["AXLE", "in_turn", "is_of_wheels", "slip_doubts"]

SLIPPING = 0.5  # correlation from which the slip of an axle shows that it is driven
MOVING = 5.0  # [m/s]
COASTING = -0.3  # [m/s^2] slower, brakes may be on, which slow the front wheels more
ROLLING = 0.03  # [-] more is water or ice
DRIVEN = 0.1  # [m/s^2] changes of less show no drive
SLIP = 2e-4  # [-] changes of less are the resolution of wheel speeds
STRAIGHT = 0.05  # [rad/s] in a bend the paths of the axles differ, too
AXLE = {"f": "front", "r": "rear"}
_SIDE = {"l": "left", "r": "right"}
_DRIVETRAIN = {"f": "fwd", "r": "rwd"}


def slip_doubts(windows: Windows, torque: str, *, is_doubted: bool) -> Iterator[Doubt]:
    """Yield wheels of front and rear that look exchanged, or a drivetrain that is not that of the vehicle file.

    Parameters
    ----------
    torque : str
        Axle `f` or `r` that the torques drive; empty if they do not show it.
    is_doubted : bool
        Whether the torques contradict the vehicle file already.
    """
    if len(windows.wheels) < len(WHEELS) or windows.speed.size < 3:
        return
    slipping = {side: _slipping(windows, side) for side in _SIDE}
    axles = {side: axle for side, (axle, _) in slipping.items() if axle}
    if len(axles) < len(_SIDE):
        return
    car = windows.vehicle
    is_awd = car.knows_drivetrain and car.drivetrain == "awd"
    said = car.driven[0][0] if car.knows_drivetrain and not is_awd else ""
    driven = "" if is_awd else torque or said
    shown = ", ".join(f"{_SIDE[side]} {abs(found.r):.2f}" for side, (_, found) in slipping.items())
    if axles["l"] != axles["r"]:
        yield _one_side(axles, driven, shown)
    elif driven and not is_doubted and axles["l"] != driven:
        yield _both_sides(axles["l"], said, torque, shown)


def is_of_wheels(doubt: Doubt) -> bool:
    """Return whether a doubt says that wheels are exchanged."""
    return doubt.kind == "exchange" and doubt.signals[0].startswith("omega_")


def in_turn(doubt: Doubt) -> int:
    """Return which exchange of wheels is to be mended first.

    A driven wheel on the other axle brings its slip into the differences of left and right, so this comes first.
    Front against rear does not depend on left and right, and comes last.
    """
    is_along = all(symbol[-1] == change.of[-1] for symbol, change in doubt.ways[0].items())
    return 1 if not is_along else 0 if len(doubt.ways[0]) == len(_SIDE) else 2


def _one_side(axles: dict[str, str], driven: str, shown: str) -> Doubt:
    """Return the doubt on one side, where the two sides contradict each other."""
    wrong = [side for side, axle in axles.items() if axle != driven] if driven else list(axles)
    pairs = [(f"omega_f{side}", f"omega_r{side}") for side in wrong]
    told = " and ".join(f"the {AXLE[axle]} wheel on the {_SIDE[side]}" for side, axle in axles.items())
    what = (
        f"{' or '.join(' and '.join(p) for p in pairs)} look exchanged: when the car accelerates, {told} slip "
        f"(correlation {shown})"
    )
    return Doubt("exchange", tuple(n for p in pairs for n in p), what, ways=tuple(exchanged(*p) for p in pairs))


def _both_sides(slips: str, said: str, torque: str, shown: str) -> Doubt:
    """Return the doubt on all wheels; on the vehicle file or the torques, too, where only one of them speaks."""
    way: dict[str, Change] = exchanged("omega_fl", "omega_rl") | exchanged("omega_fr", "omega_rr")
    slip = f"the {AXLE[slips]} wheels slip when the car accelerates (correlation {shown})"
    if torque and said:
        what = f"the wheels of front and rear look exchanged: {slip}, but vehicle file and torques drive the other axle"
        return Doubt("exchange", tuple(way), what, ways=(way,))
    if torque:
        what = f"{slip}, but the torques drive the {AXLE[torque]} axle: the wheels of front and rear look exchanged"
        return Doubt("exchange", tuple(way), what, f"or these are the torques of the {AXLE[slips]} axle", (way,))
    what = f"the vehicle file says {_DRIVETRAIN[said]}, but {slip}"
    advice = (
        f'where the wheels of front and rear are exchanged; else drivetrain = "{_DRIVETRAIN[slips]}" or "awd" in the '
        "vehicle file, with the torques of that axle in the signal map"
    )
    return Doubt("drivetrain", ("drivetrain",), what, advice, (way,))


def _slipping(windows: Windows, side: str) -> tuple[str, Relation]:
    """Return the axle that slips on one side when the car accelerates, empty if none surely does, and how it shows."""
    step, front, rear = windows.step_s, windows.wheels[f"f{side}"], windows.wheels[f"r{side}"]
    gained = np.gradient(windows.speed, step)
    with np.errstate(invalid="ignore", divide="ignore"):
        slip: FloatArray = (rear - front) / front
        calm = (windows.speed > MOVING) & (gained > COASTING) & (np.abs(slip) < ROLLING)
        if "yaw_rate" in windows:
            calm &= np.abs(windows["yaw_rate"]) < STRAIGHT
    x, y = (changes(np.where(calm, z, np.nan), step) for z in (slip, gained))
    found = relate(x / SLIP, y / DRIVEN, step, least=1.0)
    if not found.is_sure or abs(found.r) < SLIPPING:
        return "", found
    return ("r" if found.r > 0.0 else "f"), found
