"""Sentences of a calibration: assumptions, parameters that cannot be identified, and data that would identify them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from aqualog.calibrate.balance import CLIMB_SD, Sample
from aqualog.calibrate.records import DriveFit, Parameter
from aqualog.core.intervals import NOWHERE, same_decimals
from aqualog.core.vehicle import Key

__all__ = [
    "GAIN_UNKNOWN", "NO_SLOPE", "RADIUS_SHORT", "cannot_tell", "contradictions", "kept", "left_out", "notes", "outside",
    "radius_unknown", "remark", "why_not",
]  # fmt: skip

GAIN_NOTED = 0.005  # [-]
CONTRADICTION = 0.05  # [-]
PLAUSIBLE_MASS = (500.0, 45000.0)  # [kg]
GAIN_UNKNOWN = (
    "mass and torque gain are one ratio in the balance of forces: a weighed car (--fix mass=KG) gives the gain, a "
    "gain known from a dynamometer (--fix torque_gain=X) gives the mass"
)

NO_SLOPE = "the drives do not show how force and acceleration go together, so their remainder is not identified either"
ACCELEROMETER = "scale of the accelerometer taken as true"

RADIUS_SHORT = "too little straight, unbraked driving above 30 km/h with all wheel speeds; five times 40 s are enough"


def why_not(name: str, value: float, half: float, limit: float, samples: Sequence[Sample], *, has_scale: bool) -> str:
    """Say why a parameter is not identified; empty where it is."""
    if name == "torque_gain" and not has_scale:
        return GAIN_UNKNOWN
    if math.isfinite(half) and value > 0.0 and half <= limit:
        return ""
    if name == "rolling_resistance":
        return (
            "rolling resistance and the accelerometer's offset form one sum; a longer drive, one with altitude, or one "
            "that ends where it began identifies the offset, --fix rolling_resistance=X gives it"
        )
    if name == "drag_area":
        v = np.concatenate([s.windows.v for s in samples]) * 3.6
        low, high = np.percentile(v, [5.0, 95.0])
        return (
            f"drag needs a spread of speeds, these are {low:.0f} to {high:.0f} km/h, and a wind counts as drag; drives "
            "from 40 to 130 km/h in both directions identify it, --fix drag_area=X gives it"
        )
    return "the forces hardly change; some accelerations of 1 m/s² and more, unbraked and straight, identify it"


def outside(key: Key) -> str:
    """Say that no car has such a value."""
    return f"the estimate is outside {key.low:g} to {key.high:g} {key.unit}: check units and signs of torque and a_x"


def kept(p: Parameter, *, alone: bool) -> str:
    """Say that the vehicle file's value stays, by itself or with its mass, and what the interval rests on."""
    why = "the vehicle file's value is kept" + (
        "" if alone else " with its mass: the estimate is that of the drives' mass"
    )
    return "; ".join(x for x in (why, p.remark) if x)


def contradictions(found: Sequence[Parameter], free: Mapping[str, float], *, accepted: bool) -> list[str]:
    """Say which values of the vehicle file the drives contradict, and what to do.

    Parameters
    ----------
    found : sequence of Parameter
        Whose interval excludes the file's value.
    free : mapping
        Values that the drives show with nothing kept, by name.
    accepted : bool
        Whether the estimates are written in place of the file's values.
    """
    said = []
    for p in found:
        value, low, high = same_decimals(p.value, p.ci95)
        unit = f" {p.unit}" if p.unit != "-" else ""
        text = (
            f"the vehicle file says {p.name} = {p.file_value:.5g}{unit}, but the drives show {value} "
            f"(95 % {low} to {high})"
        )
        if accepted:
            said.append(f"{text}: their value is taken")
        elif p.name == "mass":
            said.append(
                f"{text}: the file's value is kept. If the car was weighed, the torques are wrong: --fix "
                f"mass={p.file_value:.5g} gives a torque gain of {free['torque_gain'] * p.file_value / p.value:.3f}. "
                "If not, --accept takes the drives' values. Until then, drag area and rolling resistance are kept too"
            )
        else:
            taken, *_ = same_decimals(free.get(p.name, p.value), p.ci95)
            beside = "" if taken == value else f" beside the values that are kept; alone they show {taken}"
            said.append(f"{text}{beside}: the file's value is kept; --accept takes {taken}")
    return said


def remark(name: str, *, has_scale: bool, by_drive: bool, samples: Sequence[Sample]) -> str:
    """Say what an interval rests on."""
    parts = []
    if name in ("mass", "drag_area") and not has_scale:
        parts.append("torque taken as true within 2 % rms")
    if name in ("mass", "torque_gain") and has_scale:
        parts.append(ACCELEROMETER)
    if name in ("mass_per_gain", "torque_gain"):
        parts.append("inertias and radii as sure as the vehicle file says")
    if name == "drag_area":
        parts.append("with the air density of the vehicle file")
        parts.append("the part that goes with v²")
    if name == "rolling_resistance":
        parts.append("the constant part")
    if name == "rolling_resistance" and not all(s.offset.has_height for s in samples):
        parts.append(f"net climb of a drive taken as 0 ± {CLIMB_SD:g} m")
    wide = ["a steady wind of 3 m/s rms"]
    wide += ["a rise of rolling resistance with speed"] if name in ("drag_area", "rolling_resistance") else []
    wide += ["drives left out"] if by_drive else []
    listed = " and ".join(x for x in (", ".join(wide[:-1]), wide[-1]) if x)
    parts.append(f"{listed} {'are' if len(wide) > 1 else 'is'} in the interval")
    return "; ".join(parts)


def radius_unknown(*, ratio_known: bool) -> str:
    """Without a velocity."""
    if ratio_known:
        return "without v_x wheel speeds give only the ratio of the radii; a GNSS velocity gives their size"
    return "the wheel speeds of all four wheels are needed"


def left_out(seconds: Mapping[str, float]) -> str:
    """Return `braking 30 s, cornering 12 s`, longest first."""
    return ", ".join(f"{r} {s:.0f} s" for r, s in sorted(seconds.items(), key=lambda kv: -kv[1]) if s >= 0.5)


def cannot_tell(parameters: Sequence[Parameter], more: Sequence[str]) -> tuple[str, ...]:
    """Return one sentence for each parameter that is not identified, and others."""
    sentences: dict[str, list[str]] = {}
    for p in parameters:
        if not p.identified:
            sentences.setdefault(p.why_not, []).append(p.name)
    return (*(f"{', '.join(names)}: {why}" for why, names in sentences.items()), *more)


def notes(
    fits: Sequence[DriveFit], samples: Sequence[Sample], found: Mapping[str, float], fixed: Mapping[str, float],
    written: Mapping[str, tuple[float, Parameter]], *, by_drive: bool,
) -> list[str]:  # fmt: skip
    """Return what a reader should know of the result; `written` are the values that the vehicle file gets, by key."""
    said = []
    alone = float(np.median([f.mass for f in fits if math.isfinite(f.mass)] or [math.nan]))
    if {"mass", "torque_gain"} <= set(fixed) and abs(alone / fixed["mass"] - 1.0) > CONTRADICTION:
        said.append(
            f"the drives contradict what is given: with torque_gain = {fixed['torque_gain']:g} they show "
            f"{alone:.0f} kg, not {fixed['mass']:g}; give one of the two"
        )
    mass, gain = found.get("mass", math.nan), found.get("torque_gain", 1.0)
    shown, *_ = same_decimals(gain, written["torque_gain"][1].ci95 if "torque_gain" in written else NOWHERE)
    if (not PLAUSIBLE_MASS[0] < mass < PLAUSIBLE_MASS[1] and math.isfinite(mass)) or not 0.5 < gain < 2.0:
        said.append(
            f"a mass of {mass:.0f} kg with a torque gain of {shown} is hardly that of a "
            "car. Is the torque that of the motor, without the reduction? (scale in the signal map)"
        )
    if abs(gain - 1.0) > GAIN_NOTED:
        said.append(
            f"the torques are {shown} of what was read: torque_gain in the calibrated vehicle file "
            "corrects them on reading; a signal map that does so already must not do it twice"
            if "torque_gain" in written
            else f"the torques seem to be {shown} of what was read, but the drives do not identify it: "
            "the calibrated vehicle file keeps the torque_gain that it had"
        )
    if sum(math.isfinite(f.mass) for f in fits) > 1:
        masses = np.array([f.mass for f in fits if math.isfinite(f.mass)])
        said.append(
            f"the drives by themselves show {masses.min():.0f} to {masses.max():.0f} kg "
            f"(sd {masses.std(ddof=1):.0f} kg)"
        )
    if not by_drive:
        said.append(
            "fewer than four drives cannot show how drives differ: driver, load, driveline temperature and road are "
            "those of these drives"
        )
    if not all(s.offset.has_height for s in samples):
        said.append("no altitude: the balance of forces does not need the grade, but the offset includes it")
    late = [f for f in fits if abs(f.torque_lag_s) > 0.15]
    said += [f"{f.name}: torque is {f.torque_lag_s:+.2f} s late against the accelerometer; taken out" for f in late]
    return said
