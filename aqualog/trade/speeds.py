"""The car's speed on the lane by two references: satellite or optical, and the free wheel on the dry side."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from aqualog.core.moments import Design
from aqualog.core.records import BoolArray, FloatArray, Signals
from aqualog.core.regression import estimate
from aqualog.core.vehicle import Vehicle
from aqualog.features.smoothing import earlier
from aqualog.trade.lane import mean_over
from aqualog.trade.run_checks import longest_gap

__all__ = ["DELAY_OPEN", "NO_V_X", "RADIUS_OF_SET", "RADIUS_OPEN", "RATIO_OF_SET", "Speeds", "lateness", "references"]

_SHARE = 0.9  # of the lane on which a reference must have a value
_V_LEAST = 3.0  # [m/s] below, no radius is learnt
_LEARN_S = 10.0  # [s] before the lane from which the delay of v_x is learnt
_MEAN_S = 0.5  # [s] of both speeds: noise in the wheel's rate would make the delay too small
_BLOCK_S = 2.0  # [s] within which errors belong together: a receiver's are correlated over half a second
_MOST_BLOCKS = 200  # in a long drive blocks are longer: every pair of them is looked at
_RATE_LEAST = 0.3  # [m/s²] of the rate's standard deviation: less may be noise
_LATE_MOST = 0.5  # [s] more is no delay of a receiver
_GAP_S = 0.1  # [s] a longer gap in v_x is remarked
_LATE_OPEN = 0.03  # [s] a delay that is less sure is not taken off; as `campaign.delay.HALF_MAX`
_BRAKES = 2e5  # [Pa] of the brakes, which make the free wheel slip
DELAY_OPEN = "the delay of v_x is not known: too even a speed before and on the lane"
NO_V_X = "no v_x in the log: the speed is that of the free wheel {}, with the vehicle file's radius"
RADIUS_OF_SET = "no v_x in the log: the speed is that of the free wheel {}, at its ratio to v_x in the set"
RADIUS_OPEN = "no v_x in the log, and no other run of its set shows the radius of its free wheel {}"
RATIO_OF_SET = "the delay of v_x is not known: the speed is the free wheel's, at its ratio to v_x in the set"
APART = 1.0 / 3.6  # [m/s] references that differ by more are remarked


class Speeds(NamedTuple):
    """Speed by the reference and by the other one (n,) [m/s], NaN where unknown; their names, the first empty where
    there is no speed. `notes`: what is to be said of them, or why a speed is missing. `late`: delay of `v_x` that was
    taken off, NaN if none was. [s] `wrong`: why they cannot both be right; empty if they can.
    """

    own: FloatArray
    other: FloatArray
    names: tuple[str, str]
    notes: tuple[str, ...] = ()
    late: float = math.nan
    wrong: str = ""


def references(
    signals: Signals, vehicle: Vehicle, axle: str, dry: str, on_lane: BoolArray, before: BoolArray, share: float
) -> Speeds:
    """Return the speeds of a run whose driven axle is `axle` and whose driven wheel on the dry side is `dry`.

    `share`: of the free wheel's speed, by which `v_x` may differ from it on the lane at the most. [-]

    `v_x` is the reference. The free wheel fills its gaps, with the ratio of both that the run shows about them. It
    stands for the speed where the lane has no `v_x`, by that ratio too, or by its radius where the log has no `v_x`.
    The radius is the vehicle file's; where the file has none, it is learnt from `v_x` before the lane. Without a free
    wheel `v_x` is needed on nine tenths of the lane. With one it shows by how much `v_x` is late, which is taken off.
    """
    v_x = signals.array("v_x")
    none = np.full_like(v_x, np.nan)
    seen = float(np.isfinite(v_x[on_lane]).mean())
    free, radius, note = _free(signals, vehicle, axle, dry, v_x, before)
    has_free = bool(free) and math.isfinite(radius) and np.isfinite(signals.array(free)[on_lane]).mean() >= _SHARE
    y = 0.5 * vehicle.track * (1.0 if dry.endswith("l") else -1.0)
    by_wheel = signals.array(free) * radius + np.nan_to_num(signals.array("yaw_rate")) * y if has_free else none
    if has_free and seen > 0.0:
        known = _known(signals, on_lane, before)
        late, unsure = _late(v_x, by_wheel, known, signals.dt)
        gap = longest_gap(v_x, _stretch(on_lane | before)) * signals.dt
        filled = f"v_x is missing for {gap:.2f} s: the free wheel {free} fills the gap" if gap > _GAP_S else ""
        v_x = earlier(v_x, late if math.isfinite(late) else 0.0, signals.dt)
        apart = float(np.nanmedian(np.abs(v_x - by_wheel)[on_lane]))
        more = f"v_x and {free} differ by {3.6 * apart:.1f} km/h on the lane" if apart > APART else ""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = float(np.nanmedian((v_x / by_wheel)[on_lane]))
        wrong = f"v_x is {ratio:.2f} times the speed of the free wheel {free} with a radius of {radius:.3f} m: "
        wrong = f"{wrong}check units, scales and wheels.r_e_{free[-2]}" if abs(ratio - 1.0) > share else ""
        own = np.where(np.isfinite(v_x), v_x, _at_ratio(v_x, by_wheel, known, signals.dt))
        return Speeds(
            own,
            by_wheel,
            ("v_x", free),
            tuple(x for x in (note, unsure, filled, "" if wrong else more) if x),
            late,
            wrong,
        )
    if has_free:
        own = _at_ratio(v_x, by_wheel, _known(signals, on_lane, before), signals.dt)
        what = f"no v_x on the lane: the speed is that of the free wheel {free}"
        what = what if np.isfinite(v_x).any() else NO_V_X.format(free)
        return Speeds(own, none, (free, ""), (what, *((note,) if note else ())))
    if seen >= _SHARE:
        return Speeds(v_x, none, ("v_x", ""), (note or "no free wheel on the dry side checks v_x",))
    lost = f"v_x is missing on {100.0 * (1.0 - seen):.0f} % of it" if seen else "no v_x"
    what = f"there is no speed on the lane: {lost}, and "
    if not free:
        return Speeds(none, none, ("", ""), (f"{what}all wheels are driven",))
    lack = note or f"{free} is not in the log"
    return Speeds(none, none, ("", ""), (what + lack,))


def _known(signals: Signals, on_lane: BoolArray, before: BoolArray) -> BoolArray:
    """Return the samples from which v_x and the free wheel are compared: to the lane's end, without brakes."""
    return _stretch(on_lane | before, round(_LEARN_S / signals.dt)) & ~(signals.array("brake_pressure") > _BRAKES)


def _stretch(of: BoolArray, more: int = 0) -> BoolArray:
    """Return all samples from the first to the last of some, and so many before."""
    places, out = np.flatnonzero(of), np.zeros_like(of)
    out[max(places[0] - more, 0) : places[-1] + 1] = True
    return out


def _at_ratio(v_x: FloatArray, by_wheel: FloatArray, known: BoolArray, dt: float) -> FloatArray:
    """Return the wheel's speed at its ratio to v_x, mean over 0.5 s, linear between; as it is without any v_x. [m/s]"""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = mean_over(np.where(known & (by_wheel > _V_LEAST), v_x / by_wheel, np.nan), _MEAN_S, dt)
    seen = np.flatnonzero(np.isfinite(ratio))
    return by_wheel * np.interp(np.arange(ratio.size), seen, ratio[seen]) if seen.size else by_wheel


def _late(v_x: FloatArray, by_wheel: FloatArray, known: BoolArray, dt: float) -> tuple[float, str]:
    """Return by how much v_x is late against the speed of a free wheel [s], or NaN and a note where that is open."""
    late, half = lateness(v_x, by_wheel, known, dt)
    if abs(late) > _LATE_MOST:  # however wide the interval: so long a delay bends the fit
        return math.nan, f"v_x is late by {late:.1f} s against the free wheel: check the clocks (`aqualog align`)"
    if not half <= _LATE_OPEN:
        return math.nan, DELAY_OPEN
    return late, ""


def lateness(v_x: FloatArray, by_wheel: FloatArray, known: BoolArray, dt: float) -> tuple[float, float]:
    """Return by how much a speed is late against a wheel that rolls freely, and half of its 95 % interval. [s]

    Parameters
    ----------
    v_x, by_wheel : array (n,)
        The speed, and that of the wheel with any radius, `dt` [s] apart. [m/s]
    known : bool array (n,)
        Samples without brakes, the wheel on dry road.

    Least squares of v_x over the wheel's speed, its third power (radii grow with v²) and its rate, of means over 0.5 s.
    Errors within a block belong together: CR2 [bell2002], with its few degrees of freedom. NaN with less than three
    blocks, or an even speed.

    Source: derived.
    """
    v, w = (mean_over(x, _MEAN_S, dt) for x in (v_x, by_wheel))
    rate = np.gradient(w, dt)
    place = np.flatnonzero(known & np.isfinite(v + w + rate) & (v > _V_LEAST))
    y, w, rate = v[place], w[place], rate[place]
    if y.size * dt < 3.0 * _BLOCK_S or rate.std() < _RATE_LEAST:
        return math.nan, math.nan
    x = np.array([w, w**3 / w.max() ** 2, -rate * (y.sum() / w.sum())])
    block = place // max(round(_BLOCK_S / dt), v_x.size // _MOST_BLOCKS, 1)
    fit = estimate(Design(x, y, block, place, (False,) * 3, (False,) * 3))
    return float(fit.value[2]), float(fit.half[2])


def _free(
    signals: Signals, vehicle: Vehicle, axle: str, dry: str, v_x: FloatArray, before: BoolArray
) -> tuple[str, float, str]:
    """Return the free wheel on the dry side (empty: all are driven), its radius [m], and a note on that."""
    if vehicle.drivetrain == "awd":
        return "", math.nan, "all wheels are driven: no free wheel checks v_x"
    other = "r" if axle == "f" else "f"
    name = f"omega_{other}{dry[1]}"
    origin = signals.origins.get(name)
    # a speed in km/h became rad/s with the very radius, so it is right with any
    is_known = f"wheels.r_e_{other}" in vehicle.given or (origin is not None and "/h" in origin.unit)
    if is_known:
        return name, vehicle.r_e(name[-2:]), ""
    omega = signals.array(name)
    usable = before & (omega > 1.0) & (v_x > _V_LEAST)
    lack = f"the vehicle file has no wheels.r_e_{other}"
    if usable.sum() < 2:
        return name, math.nan, lack
    radius = float(v_x[usable].sum() / omega[usable].sum())
    return name, radius, f"{lack}: the radius of {name} is learnt from v_x before the lane"
