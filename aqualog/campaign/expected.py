"""Slip slope and contact that the tyre and water model predicts, and the contact that belongs to a measured slope."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from aqualog.campaign.definition import loads_of
from aqualog.campaign.results import RunInfo
from aqualog.core.notation import SIDES, WHEELS
from aqualog.core.records import FloatArray
from aqualog.core.vehicle import Vehicle
from aqualog.model.plant import P_NOMINAL
from aqualog.model.tyre import P_REFERENCE, TYRES, Tyre
from aqualog.physics.contact import contact_share, slip_stiffness_ratio
from aqualog.physics.load import G, wheel_loads
from aqualog.physics.rolling import load_factor, pressure_factor
from aqualog.physics.tyre_brush import brush_parts
from aqualog.physics.water import residual_film

__all__ = ["LINEAR", "Expected", "contact_of", "expected", "expected_of_runs", "friction_of", "tangent_of"]

LINEAR = (math.inf, math.inf)  # friction (dry, wet) of a brush that never slides: its slope is the tangent (2.2)
_THETA = np.linspace(0.0, 2.5, 1001)  # C |s| / (3 mu F_z); at a slope of 28 and mu 0.8 a slip of 0.2
_L = np.linspace(0.02, 1.0, 197)
_TOLD_BY = (
    "tyre", "pressure_front_bar", "pressure_rear_bar", "water_depth_mm", "water_depth_left_mm", "load_front_kg",
    "load_rear_kg",
)  # fmt: skip
NO_WEDGE = 1e5  # [m/s] above it, no speed of full aquaplaning is reported


@dataclass(frozen=True, slots=True)
class Expected:
    """Of one wheel at one speed: `contact` L [-]; `slope` and `slope_dry`, slip slopes over F_z [-]: the slope of the
    brush's regression line over the given traction range, or its tangent at zero slip without a range; NaN with a
    `reason` where a run lacks data.
    """

    contact: float = float("nan")
    slope: float = float("nan")
    slope_dry: float = float("nan")
    reason: str = ""


def expected(
    info: RunInfo, wheel: str, v: float, *, wet: bool = True, mu_range: tuple[float, float] | None = None
) -> Expected:
    """Expectation for a wheel of a run at constant speed `v` [m/s] on even water, or off it.

    Parameters
    ----------
    info : RunInfo
        Must give the tyre (one of the model's), and on water also the depth and the pressures.
    mu_range : (float, float), optional
        Traction over which the measured slope was estimated. The slopes are then those of a regression line over that
        range, because the brush's curve bends (E22). A fit over 0.03 to 0.26 gives a tenth less than the slope at zero
        slip.

    L = 1 - (v / v_full)^n; on the rear axle in the water that the front wheel of its side leaves. Slope: the vehicle
    file's value times the factors of tyre, pressure and load, and L² (2.2). The contact does not fluctuate here; the
    mean of L² over uneven water is lower near full aquaplaning. Load transfer by the acceleration is neglected.
    """
    tyre = TYRES.get(str(info.run.values.get("tyre", "")))
    if tyre is None:
        return Expected(reason=f"tyre not known to the model: {info.run.values.get('tyre', 'not given')}")
    p = _pressure(info, wheel)
    if p is None:
        return Expected(reason="the tyre pressure is not given")
    car = info.vehicle
    nominal = car.slip_slope_f if wheel[0] == "f" else car.slip_slope_r
    dry = nominal * tyre.slip_slope_factor * float(pressure_factor(np.array(p), p_ref=P_REFERENCE, p_nominal=P_NOMINAL))
    F_z = _load(car, wheel)
    before = F_z - 0.5 * G * loads_of(info.run)[0 if wheel[0] == "f" else 1]
    dry *= float(load_factor(np.array(F_z), F_z_ref=before, sensitivity=tyre.load_sensitivity))
    mu_max = car.mu_max * tyre.mu_factor
    chord_dry = _chord(dry, 1.0, mu_max, mu_range)
    if not wet:
        return Expected(1.0, chord_dry, chord_dry)
    found = _contact(info, wheel, v, tyre)
    if isinstance(found, str):
        return Expected(slope_dry=chord_dry, reason=found)
    slope = _chord(dry, found, mu_max * tyre.wet_friction, mu_range)
    reason = "" if np.isfinite(slope) else "the remaining contact cannot carry such a traction"
    return Expected(found, slope, chord_dry, reason)


def _chord(slope: float, L: float, mu_max: float, mu_range: tuple[float, float] | None) -> float:
    """Slope of the brush between two tractions; at zero slip without them. NaN where the contact cannot carry them."""
    if mu_range is None:
        return slope * float(slip_stiffness_ratio(np.array(L)))
    return slope * float(_shares(np.array([L]), mu_max, mu_range)[0])


def _shares(L: FloatArray, mu_max: float, mu_range: tuple[float, float]) -> FloatArray:
    """Regression slope of the shortened contact over the tangent of the full one, (m,).

    NaN where L cannot carry the traction, or the range is empty. The secant over the range stands for the regression
    line: 1 % off for L >= 0.8, up to 6 % for 0.5, by how the traction is spread; 0.007 of L at most (D).

    Depends on the traction over the friction only: the brush's force over mu F_z is a function of C s / (3 mu F_z).
    """
    low, high = mu_range
    if not math.isfinite(mu_max):
        return slip_stiffness_ratio(L)
    found = np.full(L.size, np.nan)
    if not low < high:
        return found
    rows = _carried() if L is _L else _carried_by(L)
    k = np.flatnonzero(max(-low, high) <= mu_max * rows[:, -1])
    at_low, at_high = (math.copysign(1.0, x) * _slips_at(rows, k, abs(x) / mu_max) for x in mu_range)
    found[k] = (high - low) / (3.0 * mu_max * (at_high - at_low))
    return found


def _slips_at(rows: FloatArray, k: NDArray[np.intp], force: float) -> FloatArray:
    """Of rows k of forces that grow over `_THETA`, the slip at which each is `force`, linear between."""
    i, after = np.zeros_like(k), np.full_like(k, _THETA.size - 1)
    while (after - i > 1).any():  # bisection: force[i] <= force < force[after], or the last of all
        middle = (i + after) // 2
        is_below = rows[k, middle] <= force
        i, after = np.where(is_below, middle, i), np.where(is_below, after, middle)
    step = rows[k, after] - rows[k, i]
    share = np.divide(force - rows[k, i], step, out=np.ones(k.size), where=step > 0.0)
    return np.asarray(_THETA[i] + np.minimum(share, 1.0) * (_THETA[after] - _THETA[i]))


def _carried_by(L: FloatArray) -> FloatArray:
    """Force over mu F_z (m, n) of contacts L at the slips `_THETA`."""
    stuck, slid = brush_parts(_THETA[None, :], L[:, None])
    return np.asarray(stuck + slid, dtype=np.float64)


_carried = cache(lambda: _carried_by(_L))


def tangent_of(chord: FloatArray, mu_max: float, mu_range: tuple[float, float]) -> FloatArray:
    """Slip slope at zero slip of a full contact whose regression over `mu_range` gave `chord`. [-] NaN if it slides."""
    return np.asarray(chord / _shares(np.ones(1), mu_max, mu_range)[0], dtype=np.float64)


def contact_of(share: FloatArray, mu_max: float, mu_range: tuple[float, float]) -> FloatArray:
    """Contact L [-] whose regression slope over `mu_range` is `share` times the full contact's tangent at zero slip.

    Parameters
    ----------
    share : array
        Slope on water over the dry tangent (`tangent_of`), > 0. [-]
    mu_max : float
        Friction on the wet road; infinite for (2.2) itself, L = sqrt(share). [-]
    mu_range : (float, float)
        Traction over which the slope was regressed, low < high. [-]

    L is at least the contact that carries the traction at all. Above 1, which is scatter, L grows with sqrt(share), so
    that a mean over many is not cut. NaN where no contact carries the traction. Inverts the regression slope by a table
    in steps of 0.005. A brush with a rigid carcass and even friction is assumed. (2.2), L², is its limit at small
    traction, since the curve of a shortened contact bends sooner than that of a full one (2.1).
    """
    known = _shares(_L, mu_max, mu_range)
    good = np.isfinite(known)
    if not good.any():
        return np.full_like(share, np.nan)
    L = np.interp(share, known[good], _L[good])
    return np.asarray(np.where(share > known[-1], np.sqrt(np.maximum(share / known[-1], 1.0)), L), dtype=np.float64)


def friction_of(infos: Sequence[RunInfo]) -> tuple[float, float]:
    """Friction of the tread (dry, wet), mean of the runs: the vehicle file's mu_max times the model's factors of the
    tyre; for a tyre unknown to the model, those of its worn summer tyre. [-]
    """
    tyres = [TYRES.get(str(i.run.values.get("tyre", "")), Tyre("unknown")) for i in infos]
    dry = [i.vehicle.mu_max * t.mu_factor for i, t in zip(infos, tyres, strict=True)]
    wet = [x * t.wet_friction for x, t in zip(dry, tyres, strict=True)]
    return float(np.mean(dry)), float(np.mean(wet))


def expected_of_runs(
    infos: Sequence[RunInfo], wheels: Sequence[str], v: float, *, wet: bool = True,
    mu_range: tuple[float, float] | None = None,
) -> Expected:  # fmt: skip
    """Mean over runs and wheels of one cell, or the reason for none; runs of one configuration are computed once."""
    different = {(repr(i.vehicle), *(i.run.values.get(k) for k in _TOLD_BY)): i for i in infos}.values()
    all_of_them = [
        expected(i, w, v, wet=wet, mu_range=mu_range) for i in different for w in wheels if w in i.vehicle.driven
    ]
    if not all_of_them:
        return Expected(reason="no driven wheel")
    reason = next((e.reason for e in all_of_them if e.reason), "")
    contact, slope, dry = np.mean([(e.contact, e.slope, e.slope_dry) for e in all_of_them], axis=0)
    return Expected(float(contact), float(slope), float(dry), reason)


def _contact(info: RunInfo, wheel: str, v: float, tyre: Tyre) -> float | str:
    side = next(s for s, wheels in SIDES.items() if wheel in wheels)
    depth = info.run.values.get("water_depth_mm")
    if side == "left":
        depth = info.run.values.get("water_depth_left_mm", depth)
    if not isinstance(depth, float):
        return "the water depth is not given"
    film = depth * 1e-3
    if wheel[0] == "r":
        front = _share(info, "f" + wheel[1], v, film, tyre)
        if isinstance(front, str):
            return front
        film = float(residual_film(np.array(film), np.array(front), h_track=tyre.h_track))
    return _share(info, wheel, v, film, tyre)


def _share(info: RunInfo, wheel: str, v: float, film: float, tyre: Tyre) -> float | str:
    p = _pressure(info, wheel)
    if p is None:
        return "the tyre pressure is not given"
    F_z = np.array([_load(info.vehicle, wheel)])
    v_full = tyre.full_speed(np.array([film]), F_z, p=p)
    if float(v_full[0]) > NO_WEDGE:
        return 1.0
    return float(contact_share(np.array([v]), v_full, exponent=tyre.contact_exponent)[0])


def _load(car: Vehicle, wheel: str) -> float:
    """Static load of a wheel. [N]"""
    zero: FloatArray = np.zeros(1)
    loads = wheel_loads(zero, zero, mass=car.mass, l_f=car.l_f, l_r=car.l_r, h_cg=car.h_cg, track=car.track)
    return float(loads[WHEELS.index(wheel), 0])


def _pressure(info: RunInfo, wheel: str) -> float | None:
    bar = info.run.values.get("pressure_front_bar" if wheel[0] == "f" else "pressure_rear_bar")
    return bar * 1e5 if isinstance(bar, float) else None
