"""Torques and brakes: do they drive the axles of the vehicle file, do they explain the acceleration."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np

from aqualog.checks.doubts import Change, Doubt
from aqualog.checks.driven import LEAST_DRIVE, STILL, drives, shown
from aqualog.checks.relations import changes
from aqualog.checks.slip import AXLE, slip_doubts
from aqualog.checks.windows import EXTRA, PRESSURES, Windows
from aqualog.core.intervals import half_width
from aqualog.core.notation import AXLES
from aqualog.core.records import BoolArray, FloatArray, Remark
from aqualog.core.vehicle import KEYS, Vehicle

__all__ = ["drive_doubts", "may_be_water"]

LEAST_SAMPLES = 50  # of the measure
RESISTANCE = 0.3  # [m/s^2] median over a drive: more than any stretch of dry road makes
IMPOSSIBLE = 2.5  # [m/s^2] median over a drive: 7 mm of water under all wheels at 100 km/h cost 1.5 (D)
GAIN_OFF = 0.10  # of the torque gain, or of the mass: more than fuel, load and a driveline's losses
SPINS = 0.1  # of the speed by which a wheel is faster or slower than the others
MOVING = 5.0  # [m/s]
BRAKED = 3e5  # [Pa] from which the detectors take a wheel for braked
ROLLING = -0.3  # [m/s^2] a car that slows down less is not braked
PUSHED = 0.2  # [m/s^2] by the torque: driving, and surely no braking that the torque does not hold
HARD, LEAST_HARD = -2.5, 4  # [m/s²] more than motors that brake do on most cars (K); windows of half a second
TINY = 1000.0  # [Pa] brakes have a hundred times that before they slow a car
BLOCK = 20  # windows, 10 s: grade and wind last as long
LEAST_BLOCKS = 10
PASSENGER = 2500.0  # [kg] of a car whose tyres have at most `HIGHEST` (K)
HIGHEST = 3.5e5  # [Pa] of a passenger car's tyres, gauge; usual are 1.5 to 3.5 bar (K)
AIR = 101_325.0  # [Pa]
SPREAD = 0.2  # [m/s^2] standard deviation of what the torque gives: less shows no gain


def drive_doubts(windows: Windows) -> Iterator[Doubt]:
    """Yield what is wrong with the torques or with the vehicle file."""
    yield from _brakes(windows)
    yield from _tyre_pressures(windows)
    gains = list(_gain(windows))
    yield from gains or _resistance(windows)
    wrong = list(_drivetrain(windows))
    yield from wrong
    driven = [a for a, torque in drives(_torques(windows)).items() if torque > LEAST_DRIVE]
    yield from slip_doubts(windows, driven[0] if len(driven) == 1 else "", is_doubted=bool(wrong))


def may_be_water(remarks: Iterable[Remark]) -> bool:
    """Whether the resistance measure of a drive is one that water can make."""
    return all(abs(r.value) <= IMPOSSIBLE for r in remarks if r.kind == "resistance")


def _brakes(windows: Windows) -> Iterator[Doubt]:
    if "brake_pressure" not in windows or windows.speed.size < BLOCK:
        return
    with np.errstate(invalid="ignore"):
        is_rolling = (windows.speed > MOVING) & (np.gradient(windows.speed, windows.step_s) > ROLLING)
        hard = np.gradient(windows.speed, windows.step_s) < HARD
        highest = float(np.nanmax(windows["brake_pressure"][hard], initial=-np.inf))
    if hard.sum() >= LEAST_HARD and 0.0 < highest < TINY:
        what = f"brake_pressure is {highest:.3g} Pa at most while the car slows down by {-HARD:g} m/s² and more"
        yield Doubt("scale", ("brake_pressure",), what, "is it in bar? In Pa, brakes have 1e6 and more", value=highest)
        return
    pressure = windows["brake_pressure"][is_rolling]
    pressure = pressure[np.isfinite(pressure)]
    if pressure.size < BLOCK or (middle := float(np.median(pressure))) <= BRAKED:
        return
    what = f"brake_pressure is {1e-5 * middle:.1f} bar or more for half of the time in which the car does not slow down"
    advice = "check its channel, unit and offset: what a braked wheel does is no aquaplaning"
    yield Doubt("channel", ("brake_pressure",), what, advice, value=middle)


def _tyre_pressures(windows: Windows) -> Iterator[Doubt]:
    """Doubt pressures that are a passenger car's only with that of the air; of a heavier vehicle nobody knows."""
    car = windows.vehicle
    known = {s: x[np.isfinite(x)] for s in PRESSURES if s in windows for x in [windows[s]]}
    middle = {s: float(np.median(x)) for s, x in known.items() if x.size}
    high = {s: p for s, p in middle.items() if HIGHEST < p <= HIGHEST + AIR}
    if not high or len(high) < len(middle) or "mass" not in car.given or car.mass > PASSENGER:
        return
    most = max(high.values())
    what = f"the tyre pressures look absolute: up to {1e-5 * most:.1f} bar, where cars have 1.5 to 3.5 bar gauge"
    advice = "if the sensors count the air's pressure, take it off; a loaded car may have more than is usual"
    yield Doubt("channel", tuple(high), what, advice, ({s: Change(offset=AIR) for s in high},), most)


def _resistance(windows: Windows) -> Iterator[Doubt]:
    if EXTRA not in windows:
        return
    x = windows[EXTRA]
    x = x[np.isfinite(x)]
    if x.size < LEAST_SAMPLES or abs(float(np.median(x))) < RESISTANCE:
        return
    what = f"the resistance measure lies at {np.median(x):+.2f} m/s² in the middle of this drive"
    cause = "mass, wheel torque (gear ratio, sign, unit) and the offset of a_x"
    advice = f"unless most of it was on water, check {cause} before you believe the resistance detector"
    yield Doubt("resistance", ("a_x",), what, advice, value=float(np.median(x)))


def _gain(windows: Windows) -> Iterator[Doubt]:
    """Compare what accelerates the car with what the torques would: a_x = gain F / m - drag v^2 - level.

    The level holds the rolling resistance and the accelerometer's offset; a_x has no grade in it (E2).
    """
    car = windows.vehicle
    axles = [a for a in AXLES if f"torque_{a}" in windows]
    if "mass" not in car.given or "a_x" not in windows or not axles or windows.speed.size < 3:
        return
    v, a_x = windows.speed, windows["a_x"]
    inertia = sum(2.0 * car.turning_inertia(f"{a}l") / car.r_e(f"{a}l") for a in AXLES)
    force = np.sum([windows[f"torque_{a}"] / car.arm(f"{a}l") for a in axles], axis=0)
    pushed = (force - inertia / car.arm("fl") * np.gradient(v, windows.step_s)) / car.mass
    with np.errstate(invalid="ignore"):
        good = (v > MOVING) & (pushed > PUSHED) & np.isfinite(a_x)
        for wheel in windows.wheels.values():  # the torque of a wheel that spins moves the wheel
            good &= ~(np.abs(wheel - v) > SPINS * v)
    if "yaw_rate" in windows:
        with np.errstate(invalid="ignore"):
            good &= np.abs(v * windows["yaw_rate"]) < 1.5
    # over seconds: what holds the car back for longer, as water does where the driver pushes against it, is no gain
    x, drag, y = (changes(np.where(good, z, np.nan), windows.step_s) for z in (pushed, v**2, a_x))
    found = _slope(x, drag, y, good & np.isfinite(x + drag + y))
    if found is None:
        return
    gain, half = found
    if abs(gain - 1.0) - half < GAIN_OFF:
        return
    low, high = gain - half, gain + half
    what = (
        f"the torques explain the acceleration with a gain of {gain:.2f} (95 % {low:.2f} to {high:.2f}), not of 1, "
        f"with a mass of {car.mass:.0f} kg"
    )
    if gain < 0.0:
        advice = "check the sign of the torques in the signal map"
    elif low < 0.0:
        advice = "check which wheels the torques of the signal map belong to, and their time"
    else:
        advice = _gain_advice(gain, car, axles)
    yield Doubt("torque", ("torque_gain", "mass"), what, advice, value=gain, ci95=(low, high))


def _gain_advice(gain: float, car: Vehicle, axles: list[str]) -> str:
    """Return what to write into the vehicle file; beyond its limits the map is wrong, not the car."""
    values = {"torque_gain": gain * car.torque_gain, "mass": car.mass / gain}
    if all(KEYS[n].low <= x <= KEYS[n].high for n, x in values.items()):
        own = f"torque_gain = {values['torque_gain']:.3g}, or mass = {values['mass']:.0f}"
        loaded = "unless a load or a trailer explains it, " if gain < 1.0 else ""
        return f"{loaded}in the vehicle file {own}; `aqualog calibrate` estimates them"
    size = f"{1.0 / gain:.3g} times too large" if gain < 1.0 else f"{gain:.3g} times too small"
    names = " and ".join(f"torque_{a}" for a in axles)
    return f"check unit and scale of {names} in the map: {'it is' if len(axles) == 1 else 'they are'} {size}"


def _slope(x: FloatArray, drag: FloatArray, y: FloatArray, good: BoolArray) -> tuple[float, float] | None:
    """Regress y on x, drag and a level; the slope of x and half of its 95 % interval, by blocks left out in turn."""
    block = np.flatnonzero(good) // BLOCK
    labels, block = np.unique(block, return_inverse=True)
    if labels.size < LEAST_BLOCKS or float(x[good].std()) < SPREAD:
        return None
    table = np.column_stack([x[good], drag[good] / float(np.abs(drag[good]).max()), np.ones(block.size), y[good]])
    products = table[:, :, None] * table[:, None, :]
    sums = np.zeros((labels.size, 4, 4))
    np.add.at(sums, block, products)
    whole = sums.sum(axis=0)

    def solved(total: FloatArray) -> float:
        return float(np.linalg.lstsq(total[:3, :3], total[:3, 3], rcond=1e-10)[0][0])

    slope = solved(whole)
    without = np.array([solved(whole - s) for s in sums])
    n = labels.size
    sd = math.sqrt((n - 1.0) / n * float(((without - without.mean()) ** 2).sum()))
    return slope, half_width(sd, n - 1.0)


def _torques(windows: Windows) -> dict[str, FloatArray]:
    """Return the torques of the axles that the log has. [N·m]"""
    return {a: windows[name] for a in AXLES if (name := f"torque_{a}") in windows}


def _drivetrain(windows: Windows) -> Iterator[Doubt]:
    """Compare the axles that the torques drive with those in the vehicle file; propose them where it says none."""
    torques = _torques(windows)
    drive = drives(torques)
    most = max(drive.values(), default=0.0)
    vehicle = windows.vehicle
    if not vehicle.knows_drivetrain:
        seen, line = shown(torques)
        if line:
            what = f"no vehicle file says which axle is driven, but {seen}"
            yield Doubt("drivetrain", ("drivetrain",), what, f"in the vehicle file {line}")
        return
    for axle, torque in drive.items():
        is_driven = f"{axle}l" in vehicle.driven
        if not is_driven and torque > 0.1 * most:
            told, better = f"are driven with up to {torque:.0f} N m", "awd"
        elif is_driven and torque < STILL * most:
            told, better = "are never driven", "rwd" if axle == "f" else "fwd"
        else:
            continue
        what = f"the vehicle file says {vehicle.drivetrain}, but the {AXLE[axle]} wheels {told}"
        yield Doubt("drivetrain", ("drivetrain",), what, f'drivetrain = "{better}"?')
        return
