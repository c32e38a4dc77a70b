"""Wet braking of one stop: the mean braking force coefficient between two speeds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aqualog.core.notation import WHEELS
from aqualog.core.records import BoolArray, FloatArray, Signals
from aqualog.physics.load import G
from aqualog.trade.lane import Span, depth_of, mean_over, spans_of
from aqualog.trade.limits import BrakingLimits, defaults
from aqualog.trade.plausible import wrong_speed
from aqualog.trade.run_checks import longest_gap

__all__ = ["NO_WATER", "Conditions", "Stop", "bfc_of", "stop_between", "stops"]

NO_WATER = "nothing says that the road was wet: no on_water, no water depth in the log or the campaign"
_MEAN_S = 0.1  # [s] of the yaw rate and of the deceleration
_EDGE_S = 0.05  # [s] by which a lane's label may miss a stop's ends
_BEFORE_S = 1.0  # [s] of rolling before the stop
_STANDS, _FAST = 1.0, 15.0 / 3.6  # [rad/s] a wheel that turns by less stands; [m/s] below, ABS lets it
_ZERO_CELSIUS = 273.15  # [K]


@dataclass(frozen=True, slots=True)
class Conditions:
    """What the campaign says of a stop; NaN where it does not: water depth [m], temperature [degC], macrotexture depth
    [m].
    """

    water_depth: float = math.nan
    temperature: float = math.nan
    texture: float = math.nan


@dataclass(frozen=True, slots=True)
class Stop:
    """One stop.

    Attributes
    ----------
    v_from, v_to : float
        [m/s]
    distance : float
        Way between both speeds, integral of the speed. [m]
    bfc : float
        Braking force coefficient (v_from^2 - v_to^2) / (2 d g). [-]
    bfc_20 : float
        The same at the reference temperature. [-] NaN without a temperature.
    temperature, water_depth, texture : float
        [degC], [m], [m]; NaN where not known.
    start_s, end_s : float
        When it passed both speeds. [s]
    reasons, notes : tuple of str
    """

    v_from: float = math.nan
    v_to: float = math.nan
    distance: float = math.nan
    bfc: float = math.nan
    bfc_20: float = math.nan
    temperature: float = math.nan
    water_depth: float = math.nan
    texture: float = math.nan
    start_s: float = math.nan
    end_s: float = math.nan
    reasons: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def valid(self) -> bool:
        """Whether the stop counts."""
        return not self.reasons and math.isfinite(self.bfc)


def stops(
    signals: Signals, limits: BrakingLimits | None = None, *, v_from: float, v_to: float,
    conditions: Conditions | None = None, lane: Span | None = None,
) -> tuple[Stop, ...]:  # fmt: skip
    """Evaluate every stop in a drive; without one a record that says so.

    Parameters
    ----------
    signals : Signals
        `v_x` is needed: wheel speeds slip in a stop.
    v_from, v_to : float
        Speeds between which it is measured. [m/s]
    conditions : Conditions, optional
        What the campaign says.
    lane : (float, float), optional
        Wet stretch [s] according to the campaign.
    """
    limits = limits or defaults().braking
    v = signals.array("v_x")
    if not np.isfinite(v).any():
        return (Stop(v_from, v_to, reasons=("v_x is not in the log: wheel speeds slip in a stop",)),)
    places = stop_between(v, v_from, v_to)
    none = f"no stop from {3.6 * v_from:.0f} to {3.6 * v_to:.0f} km/h in the log"
    if not places:
        low, high = 3.6 * np.nanmin(v), 3.6 * np.nanmax(v)
        what = f"{none}: v_x goes from {low:.0f} to {high:.0f} km/h; --from and --to take other speeds"
        return (Stop(v_from, v_to, reasons=(what,)),)
    found = [_stop(signals, v, p, v_from, v_to, limits, conditions or Conditions(), lane) for p in places]
    braked = [s for s in found if (v_from - v_to) / (s.end_s - s.start_s) >= limits.decel_least]
    if not braked:
        a, at = max(((v_from - v_to) / (s.end_s - s.start_s), s.start_s) for s in found)
        what = f"{none}: between these it slows down by {a:.1f} m/s² on average (from {at:.1f} s on), "
        what += f"a stop by {limits.decel_least:g} m/s² or more; --limits with braking.decel_least takes another value"
        return (Stop(v_from, v_to, reasons=(what,)),)
    return tuple(braked)


def stop_between(v: FloatArray, v_from: float, v_to: float) -> list[tuple[float, float]]:
    """Return places (in samples, linear between two) at which a speed falls below `v_from`, then below `v_to`.

    Of several falls below `v_from` the last one before counts. NaN breaks nothing: it is passed over.
    """
    good = np.flatnonzero(np.isfinite(v))
    x = v[good]
    found: list[tuple[float, float]] = []
    begin = math.nan
    for k in range(1, x.size):
        if x[k - 1] > v_from >= x[k]:
            begin = _place(good, x, k, v_from)
        if x[k - 1] > v_to >= x[k] and math.isfinite(begin):
            found.append((begin, _place(good, x, k, v_to)))
            begin = math.nan
    return found


def _place(good: np.ndarray, x: FloatArray, k: int, level: float) -> float:
    share = (x[k - 1] - level) / (x[k - 1] - x[k])
    return float(good[k - 1] + share * (good[k] - good[k - 1]))


def bfc_of(v_from: float, v_to: float, distance: float) -> float:
    """Return the braking force coefficient of a stop: speeds [m/s], way between them [m].

    Limits: 80 to 20 km/h in 33.0 m give 0.715; a deceleration of g gives 1.

    Source: energy over weight and way; derived.
    """
    return (v_from**2 - v_to**2) / (2.0 * distance * G) if distance > 0.0 else math.nan


def _stop(
    signals: Signals, v: FloatArray, place: tuple[float, float], v_from: float, v_to: float, limits: BrakingLimits,
    conditions: Conditions, lane: Span | None,
) -> Stop:  # fmt: skip
    t, dt = signals.array("t"), signals.dt
    start, end = (float(np.interp(p, np.arange(t.size), t)) for p in place)
    inside: BoolArray = (t > start) & (t < end) & np.isfinite(v)
    at, speed = np.array([start, *t[inside], end]), np.array([v_from, *v[inside], v_to])
    distance = float(np.sum(0.5 * (speed[1:] + speed[:-1]) * np.diff(at)))
    bfc = bfc_of(v_from, v_to, distance)
    temperature = _temperature(signals, (t >= start) & (t <= end), conditions)
    depth, dry = _water(signals, (start, end), conditions, lane)
    at_reference = bfc + limits.temperature * (temperature - limits.temperature_reference)
    stop = Stop(v_from, v_to, distance, bfc, at_reference, temperature, depth, conditions.texture, start, end)
    reasons = list(_reasons(signals, v, stop, (t >= start) & (t <= end), dt, limits))
    notes = []
    if dry:
        reasons.append(dry)
    elif math.isnan(depth):
        notes.append("the water depth is not known")
    elif not limits.depth_low <= 1e3 * depth <= limits.depth_high:
        reasons.append(f"{1e3 * depth:.1f} mm of water, {limits.depth_low:g} to {limits.depth_high:g} mm expected")
    if math.isnan(temperature):
        notes.append("no temperature: the coefficient is that of the day")
    elif math.isnan(conditions.temperature):
        notes.append("the temperature is that of the air, where the wetted road's belongs (x_temperature_c)")
    if math.isnan(conditions.texture):
        notes.append("no macrotexture depth (x_texture_mm) in the campaign")
    elif not limits.texture_low <= 1e3 * conditions.texture <= limits.texture_high:
        reasons.append(
            f"a macrotexture of {1e3 * conditions.texture:.2f} mm, {limits.texture_low:g} to {limits.texture_high:g} "
            "mm expected"
        )
    return replace(stop, reasons=tuple(reasons), notes=tuple(notes))


def _reasons(
    signals: Signals, v: FloatArray, stop: Stop, inside: BoolArray, dt: float, limits: BrakingLimits
) -> Sequence[str]:
    reasons = []
    gap = longest_gap(v, inside) * dt
    if gap > limits.lost:
        reasons.append(f"the speed is missing for {gap:.2f} s")
    decel = -np.gradient(mean_over(v, _MEAN_S, dt), dt)[inside] if v.size > 2 else np.zeros(0)
    mean = (stop.v_from - stop.v_to) / (stop.end_s - stop.start_s)
    weak = np.isfinite(decel) & (decel < limits.dip * mean)
    longest = longest_gap(np.where(weak, np.nan, 0.0), np.ones(weak.size, dtype=np.bool_)) * dt
    if longest > limits.dip_lasts:
        reasons.append(
            f"the deceleration stays below {100 * limits.dip:.0f} % of its mean for {longest:.2f} s: the brake was let "
            "go"
        )
    reasons += _of_brakes(signals, v, stop, inside, limits)
    yaw = mean_over(signals.array("yaw_rate"), _MEAN_S, dt)[inside]
    if np.isfinite(yaw).any() and float(np.nanmax(np.abs(yaw))) > limits.yaw_rate:
        most = float(np.nanmax(np.abs(yaw)))
        reasons.append(f"the yaw rate reaches {most:.2f} rad/s, at most {limits.yaw_rate:g} allowed")
    return reasons


def _of_brakes(
    signals: Signals, v: FloatArray, stop: Stop, inside: BoolArray, limits: BrakingLimits
) -> Sequence[str]:  # fmt: skip
    """Why a stop is not one with ABS at full pressure, by the wheel speeds and the pressure that the log has."""
    t, reasons = signals.array("t"), []
    if wrong := wrong_speed(signals, (t >= stop.start_s - _BEFORE_S) & (t < stop.start_s)):
        reasons.append(wrong)
    if stop.bfc > limits.bfc_most:
        reasons.append(f"a coefficient of {stop.bfc:.2f}: no tyre has more than {limits.bfc_most:g}; check v_x's unit")
    fast = inside & (v > _FAST)
    for wheel in WHEELS:
        stands = fast & (np.abs(signals.array(f"omega_{wheel}")) < _STANDS)
        longest = longest_gap(np.where(stands, np.nan, 0.0), inside) * signals.dt
        if longest > limits.locked:
            reasons.append(f"wheel {wheel} stands for {longest:.2f} s: ABS did not control it")
            break
    pressure = mean_over(signals.array("brake_pressure"), _MEAN_S, signals.dt)[inside]
    if (pressure > 0.0).any():
        highest = np.fmax.accumulate(pressure)
        longest = (
            longest_gap(np.where(pressure < limits.dip * highest, np.nan, 0.0), np.isfinite(pressure)) * signals.dt
        )
        if longest > limits.dip_lasts:
            share = 100.0 * float(np.nanmin(pressure / highest))
            reasons.append(f"the brake pressure falls to {share:.0f} % for {longest:.2f} s: the brake was let go")
    return reasons


def _temperature(signals: Signals, inside: BoolArray, conditions: Conditions) -> float:
    """Return the wetted road's temperature by the campaign (K, [unece_r117_2011]), else the air's by the log. [degC]"""
    if math.isfinite(conditions.temperature):
        return conditions.temperature
    seen = signals.array("ambient_temperature")[inside]
    return float(np.nanmean(seen)) - _ZERO_CELSIUS if np.isfinite(seen).any() else math.nan


def _water(signals: Signals, span: Span, conditions: Conditions, lane: Span | None) -> tuple[float, str]:
    """Return the water depth [m], NaN if not known, and why the stop is not one on water; empty if it is.

    The depth is the log's, which was measured in this stop, else the campaign's.
    """
    seen = depth_of(signals, span)
    depth = seen if math.isfinite(seen) else conditions.water_depth
    spans = spans_of(signals, lane)
    if spans:
        is_within = any(a - _EDGE_S <= span[0] and span[1] <= b + _EDGE_S for a, b in spans)
        return depth, "" if is_within else "the car was not on water all the way"
    return depth, "" if depth > 0.0 else NO_WATER
