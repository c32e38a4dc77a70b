"""Prepare the regression of slip on traction: their sources, both without delay, and which samples are left out."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np

from aqualog.align.mapping import MAP_HINT
from aqualog.core.errors import ConfigError, SignalError
from aqualog.core.notation import AXLES, WHEELS
from aqualog.core.records import BoolArray, FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.detect.slip_slope import activation
from aqualog.detect.slip_slope.activation import Limits
from aqualog.features.stream import loads_of_car
from aqualog.physics.differential import differential_slip
from aqualog.physics.slip import V_MIN, wheel_slip
from aqualog.physics.traction import traction_coefficient, traction_of_one_axle

__all__ = [
    "BESIDE", "LEFT_OUT", "LIMITS", "METHODS", "TRACTIONS", "Method", "Place", "Reference", "TractionSource", "Way",
    "accelerometer_traction", "choose_way", "left_out", "mean_of", "over_free_wheels", "reference_of", "slip_of",
    "smoothed", "torque_traction",
]  # fmt: skip

LIMITS = Limits(a_x_max=6.0, a_y_max=1.0, yaw_rate_max=0.05)  # straighter than the estimator, which has less to lose
S_MAX = 0.05  # [-] slip about its median beyond which a wheel spins
MEDIAN_SQUARE = 0.455  # of a normal variable with variance 1; single bumps do not move it
TOO_LARGE, NEGATIVE, BESIDE = "traction beyond the limit", "brakes not known", "beside a stretch left out"
LEFT_OUT = (*activation.REASONS[1 : activation.SPINNING + 1], TOO_LARGE, NEGATIVE, BESIDE)
"""Why a sample was not used, in this order."""


class Place(NamedTuple):
    """A driven wheel or axle and what it is compared with."""

    name: str
    i: tuple[str, ...]  # driven
    j: tuple[str, ...]  # free, () against a velocity


class Reference(NamedTuple):
    """A reference velocity, and the slip that its delay would add: the third column of the regression."""

    v_x: FloatArray
    a_over_v: FloatArray  # [1/s]
    noise: FloatArray  # of a_over_v, standard deviation
    delay: float | None  # [s] known


def torque_traction(
    f: Mapping[str, FloatArray], columns: Mapping[str, FloatArray], vehicle: Vehicle, dt: float, width: int
) -> dict[str, FloatArray]:
    """Return signals as in the features, but without their filters' delays, which would look like a delay of v_x."""
    a_x = columns["a_x"] if "a_x" in columns else f["a_kin_slow"]
    loads = loads_of_car(vehicle, smoothed(a_x, width), f["a_y_slow"])
    found = {}
    for w, load in zip(WHEELS, loads, strict=True):
        if w in vehicle.driving:
            found[f"mu_{w}"] = traction_coefficient(
                smoothed(columns[f"torque_{w}"], width), load, np.gradient(f[f"v_line_{w}"], dt) / vehicle.r_e(w),
                arm=vehicle.arm(w), inertia=vehicle.turning_inertia(w), r_w=vehicle.rolling_resistance,
            )  # fmt: skip
    return found


def accelerometer_traction(f: Mapping[str, FloatArray], a_x: FloatArray, vehicle: Vehicle) -> dict[str, FloatArray]:
    """Return the traction of the driven wheels by the accelerometer; see `physics.traction.traction_of_one_axle`."""
    loads = loads_of_car(vehicle, a_x, f["a_y_slow"])
    driven = [i for i, w in enumerate(WHEELS) if w in vehicle.driven]
    free = [i for i, w in enumerate(WHEELS) if w not in vehicle.driven]
    one = WHEELS[free[0]]
    mu = traction_of_one_axle(
        a_x, f["a_kin_slow"], f["v_x_hat"], loads[driven], loads[free], mass=vehicle.mass,
        r_w=vehicle.rolling_resistance, drag_area=vehicle.drag_area, air_density=vehicle.air_density,
        free_wheel_mass=2.0 * vehicle.inertia(one) / vehicle.r_e(one) ** 2,
    )  # fmt: skip
    return {f"mu_{WHEELS[i]}": mu[row] for row, i in enumerate(driven)}


def over_free_wheels(f: Mapping[str, FloatArray], vehicle: Vehicle, dt: float) -> dict[str, FloatArray]:
    """Return the traction of the driven wheels less that of the free one on the same side, as their slip is (3.16).

    A free wheel has the traction that spins it and overcomes its rolling resistance.
    """
    loads = loads_of_car(vehicle, f["a_kin_slow"], f["a_y_slow"])
    found = {}
    for free, load in ((w, x) for w, x in zip(WHEELS, loads, strict=True) if w not in vehicle.driven):
        wheel = ("f" if free[0] == "r" else "r") + free[1]
        found[f"mu_{wheel}"] = f[f"mu_{wheel}"] - traction_coefficient(
            np.zeros_like(load), load, np.gradient(f[f"v_line_{free}"], dt) / vehicle.r_e(free), arm=vehicle.arm(free),
            inertia=vehicle.inertia(free), r_w=vehicle.rolling_resistance,
        )  # fmt: skip
    return found


def smoothed(x: FloatArray, width: int) -> FloatArray:
    """Return the centred mean; NaN where one of its samples is NaN. No delay: slip and traction stay together.

    Each mean uses its own samples alone, so that a piece of a drive gives the same means as the whole.
    """
    if x.size < width:
        return np.full_like(x, np.nan)
    good = np.isfinite(x)
    half = width // 2
    mean = np.full(x.size, np.nan)
    mean[half : x.size - half] = _sums(np.where(good, x, 0.0), width) / width
    mean[_near(~good, width)] = np.nan
    return mean


def _sums(x: FloatArray, width: int) -> FloatArray:
    """Sum `width` neighbours each; (n - width + 1,). Built of sums of 1, 2, 4 ... neighbours."""
    rows = x.size - width + 1
    total = np.zeros(rows)
    of, length, done = x, 1, 0
    while True:
        if width & length:
            total += of[done : done + rows]
            done += length
        if done == width:
            return total
        of, length = of[:-length] + of[length:], 2 * length


def _near(bad: BoolArray, width: int) -> BoolArray:
    """Flag where one of the samples of a centred mean is bad."""
    half = width // 2
    near: BoolArray = _sums(np.pad(bad.astype(np.float64), half), 2 * half + 1) > 0.5
    return near


def reference_of(
    v_x: FloatArray, f: Mapping[str, FloatArray], vehicle: Vehicle, dt: float, delay: float | None
) -> Reference:
    """Return the velocity, and what its delay would add: the acceleration of the driven wheels over their speed.

    The noise of the acceleration is half of the difference between left and right wheels.
    """
    axles = [(w, v) for w, v in AXLES.items() if v[0] in vehicle.driven]
    v = np.mean([mean_of(f, "v_line", wheels) for _, wheels in axles], axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        fast = np.where(v > V_MIN, v, np.nan)
    apart = [np.gradient(f[f"v_line_{left}"] - f[f"v_line_{right}"], dt) for _, (left, right) in axles]
    calm = (np.abs(f["yaw_rate_slow"]) < LIMITS.yaw_rate_max) & np.isfinite(fast) & np.isfinite(np.sum(apart, axis=0))
    variance = sum(float(np.median(d[calm] ** 2)) for d in apart) / MEDIAN_SQUARE if calm.any() else 0.0
    sd = 0.5 * math.sqrt(variance) / len(axles)
    return Reference(v_x, np.gradient(v, dt) / fast, sd / fast, delay)


def mean_of(f: Mapping[str, FloatArray], stem: str, wheels: Sequence[str]) -> FloatArray:
    """Average a feature over wheels."""
    mean: FloatArray = np.mean([f[f"{stem}_{w}"] for w in wheels], axis=0)
    return mean


def slip_of(place: Place, f: Mapping[str, FloatArray], v_x: FloatArray | None, vehicle: Vehicle) -> FloatArray:
    """Return the slip against the velocity (3.13), or without one against the free wheels (3.16)."""
    v_i = mean_of(f, "v_line", place.i)
    if v_x is None:
        return differential_slip(v_i, mean_of(f, "v_line", place.j))
    r_e = vehicle.r_e(place.i[0])
    return wheel_slip(v_i / r_e, v_x, r_e)


def left_out(
    place: Place,
    f: Mapping[str, FloatArray],
    mu: FloatArray,
    slip: FloatArray,
    braking: Mapping[str, BoolArray],
    *,
    width: int,
    mu_max: float,
    positive_only: bool,
) -> FloatArray:
    """Return 0 where a sample is used, else 1 + index into `LEFT_OUT`."""
    wheels = (*place.i, *place.j)
    reason = activation.inactive_reason(
        v_x=f["v_x_hat"], a_x=f["a_kin_slow"], a_y=f["a_y_slow"], yaw_rate=f["yaw_rate_slow"],
        a_w_delta=np.max([np.abs(f[f"a_w_delta_{w}"]) for w in wheels], axis=0),
        is_braking=np.any([braking[w] for w in wheels], axis=0), limits=LIMITS,
    )  # fmt: skip
    with np.errstate(invalid="ignore"):
        reason[(reason == 0) & (np.abs(mu) > mu_max)] = 1 + LEFT_OUT.index(TOO_LARGE)
        if positive_only:
            reason[(reason == 0) & (mu < 0.0)] = 1 + LEFT_OUT.index(NEGATIVE)
        level = float(np.nanmedian(slip[reason == 0])) if np.isfinite(slip[reason == 0]).any() else 0.0
        reason[(reason == 0) & (np.abs(slip - level) > S_MAX)] = activation.SPINNING
    reason[(reason == 0) & np.isnan(mu + slip)] = activation.MISSING
    # all samples of a mean must be usable driving; the traction limit is that of the mean itself
    bad = (reason > 0) & (reason <= activation.SPINNING)
    reason[(reason == 0) & _near(bad, width)] = 1 + LEFT_OUT.index(BESIDE)
    return reason


# --- sources of slip and traction -------------------------------------------------------------------------------------

Method = Literal["axle", "velocity", "differential"]
TractionSource = Literal["torque", "accelerometer"]
METHODS = ("auto", "axle", "velocity", "differential")
TRACTIONS = ("auto", "torque", "accelerometer")


class Way(NamedTuple):
    """Sources of slip and traction; `notes` are sentences on substitutes that were used."""

    method: Method
    traction: TractionSource
    notes: tuple[str, ...] = ()


def choose_way(
    vehicle: Vehicle, available: Collection[str], *, method: str = "auto", traction: str = "auto", where: str = ""
) -> Way:
    """Choose the method, or check the one asked for.

    Parameters
    ----------
    available : collection of str
        Symbols of the drive.
    method : str
        `axle`: driven against free wheel of the same side; `velocity`: against v_x, thesis (3.13); `differential`: both
        axles driven, recursive estimate only; `auto`.
    traction : str
        `torque`, `accelerometer` (one driven axle) or `auto`.
    where : str
        For the message.

    Raises
    ------
    ConfigError
        If the method does not exist for this car.
    SignalError
        If signals are missing.
    """
    have = set(available)
    if method not in METHODS:
        raise ConfigError(f'method "{method}"', expected=", ".join(METHODS))
    if traction not in TRACTIONS:
        raise ConfigError(f'traction "{traction}"', expected=", ".join(TRACTIONS))
    chosen = _method(vehicle, have, method, where)
    source, notes = _traction(vehicle, have, traction, where)
    return Way(chosen, source, notes)


def _method(vehicle: Vehicle, have: set[str], method: str, where: str) -> Method:
    is_awd = vehicle.drivetrain == "awd"
    if method == "axle" and is_awd:
        raise ConfigError(
            f"--method axle: {vehicle.name} drives all wheels, none rolls freely", expected="velocity or differential"
        )
    chosen: Method = "axle"
    if method == "velocity" or (method == "auto" and is_awd and "v_x" in have):
        chosen = "velocity"
    elif method == "differential" or is_awd:
        chosen = "differential"
    wheels = vehicle.driven if chosen == "velocity" else WHEELS
    omega = [f"omega_{w}" for w in wheels if f"omega_{w}" not in have]
    if omega:
        raise SignalError(
            f"no slip without wheel speeds: missing {', '.join(omega)}", where=where,
            expected=f"the speeds of {'the driven' if chosen == 'velocity' else 'all four'} wheels", hint=MAP_HINT,
        )  # fmt: skip
    if chosen == "velocity" and "v_x" not in have:
        raise SignalError(
            "no reference velocity: missing v_x", where=where, expected="v_x from GNSS or an optical sensor",
            hint="--method axle" if not is_awd else "--method differential",
        )  # fmt: skip
    return chosen


def _traction(vehicle: Vehicle, have: set[str], traction: str, where: str) -> tuple[TractionSource, tuple[str, ...]]:
    is_awd = vehicle.drivetrain == "awd"
    torque = [f"torque_{w}" for w in vehicle.driven if f"torque_{w}" not in have]
    if traction == "accelerometer" and is_awd:
        raise ConfigError(
            "--traction accelerometer: it does not show how much of the force each driven axle has", expected="torque"
        )
    if traction == "torque" or (traction == "auto" and (not torque or is_awd)):
        if torque:
            why = "; with all wheels driven an accelerometer cannot replace them" if is_awd else ""
            raise SignalError(
                f"no traction: missing {', '.join(torque)}{why}", where=where, expected="wheel or axle torques",
                hint=MAP_HINT if is_awd or "a_x" not in have else "--traction accelerometer",
            )  # fmt: skip
        return "torque", ()
    if "a_x" not in have:
        raise SignalError(
            f"no traction: missing {', '.join(torque)}, and a_x in their place", where=where,
            expected="wheel torques or an accelerometer", hint=MAP_HINT,
        )  # fmt: skip
    if traction == "accelerometer":
        return "accelerometer", ()
    return "accelerometer", (f"no wheel torque ({', '.join(torque)}): the traction is that of the accelerometer",)
