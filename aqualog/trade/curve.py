"""The curved aquaplaning test of one pass: lateral acceleration on a circle before a trough of water and in it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from aqualog.core.records import BoolArray, FloatArray, Signals
from aqualog.trade.lane import Span, mean_over, no_lane, spans_of
from aqualog.trade.limits import CurveLimits, defaults
from aqualog.trade.plausible import wrong_curve, wrong_speed

__all__ = ["CurvePass", "curve_pass", "curve_passes"]

KMH = 1.0 / 3.6
_A_Y_LEAST = 0.5  # [m/s²] less is no curve


@dataclass(frozen=True, slots=True)
class CurvePass:
    """One pass through the trough.

    Attributes
    ----------
    v_entry : float
        Speed at the trough, mean of the dry second before. [m/s]
    a_y_dry, a_y_least, a_y_mean : float
        Lateral acceleration towards the centre of the circle: mean of the dry second, least (of the mean over 0.1 s)
        and mean in the trough. [m/s²]
    radius : float
        Of the path in the dry second, v^2 / a_y. [m]
    off : float
        a_y less v_x times yaw_rate in the dry second, towards the centre: an offset of the sensor, or the body's roll.
        [m/s²] NaN without a yaw rate.
    per_delay : float
        By how much `a_y_mean` grows with a delay of a_y: what lasts from dry road enters the trough. [m/s² per s]
    steer : float
        Largest change of the steering angle in the trough, relative to the dry second. [-] NaN without a steering
        angle.
    reasons, notes : tuple of str
        Why the pass is not valid; what could not be checked.
    lane : (float, float), optional
        [s]
    """

    v_entry: float = math.nan
    a_y_dry: float = math.nan
    a_y_least: float = math.nan
    a_y_mean: float = math.nan
    radius: float = math.nan
    off: float = math.nan
    per_delay: float = math.nan
    steer: float = math.nan
    reasons: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    lane: Span | None = None

    @property
    def valid(self) -> bool:
        """Whether the pass counts."""
        return not self.reasons


def curve_passes(
    signals: Signals, limits: CurveLimits | None = None, *, lane: Span | None = None, radius: float | None = None
) -> tuple[CurvePass, ...]:
    """Evaluate every pass in a drive; without a lane one record that says so.

    Parameters
    ----------
    signals : Signals
        `a_y` and a speed are needed; without `v_x` that of the wheels does not do, since they slip.
    limits : CurveLimits, optional
        Default: those of `limits.toml`.
    lane : (float, float), optional
        Begin and end of the trough [s], in place of the log's own label.
    radius : float, optional
        Of the circle. [m] With it the dry lateral acceleration is checked against v^2 / R.

    Source: lateral aquaplaning test of tirestesting.com; Auto Express tyre tests [autoexpress2023].
    """
    spans = spans_of(signals, lane)
    if not spans:
        return (CurvePass(reasons=(no_lane(signals),)),)
    return tuple(curve_pass(signals, span, limits, radius=radius) for span in spans)


def curve_pass(
    signals: Signals, span: Span, limits: CurveLimits | None = None, *, radius: float | None = None
) -> CurvePass:
    """Evaluate the pass over one lane, see `curve_passes`. Never an error: what is missing stands in `reasons`."""
    limits = limits or defaults().curve
    bare = CurvePass(lane=span)
    t, dt = signals.array("t"), signals.dt
    v, a_y = signals.array("v_x"), signals.array("a_y")
    missing = [n for n, x in (("v_x", v), ("a_y", a_y)) if not np.isfinite(x).any()]
    if missing:
        what = f"{' and '.join(missing)} {'are' if len(missing) > 1 else 'is'} not in the log"
        return replace(bare, reasons=(what,))
    inside: BoolArray = (t >= span[0]) & (t <= span[1])
    before: BoolArray = (t >= span[0] - limits.dry) & (t < span[0])
    if inside.sum() * dt < limits.least_time:
        return replace(bare, reasons=(f"{inside.sum() * dt:.2f} s in the trough, {limits.least_time:g} s needed",))
    if before.sum() * dt < 0.5 * limits.dry:
        what = f"less than {0.5 * limits.dry:g} s of dry road before the trough, {limits.dry:g} s needed"
        return replace(bare, reasons=(what,))
    lost = [n for n, x in (("v_x", v), ("a_y", a_y)) if np.isfinite(x[before]).mean() < 0.5]
    lost += ["a_y"] if "a_y" not in lost and np.isfinite(a_y[inside]).mean() < 0.9 else []
    if lost:
        return replace(bare, reasons=(f"{' and '.join(lost)} {'is' if len(lost) == 1 else 'are'} missing there",))
    a_y_dry = float(np.nanmean(a_y[before]))
    inwards = 1.0 if a_y_dry >= 0.0 else -1.0
    mean = mean_over(inwards * a_y, limits.a_y_mean, dt)[inside]
    yaw, a_y_mean = signals.array("yaw_rate")[before], float(np.nanmean(inwards * a_y[inside]))
    turning = float(np.nanmean(v[before] * yaw)) if np.isfinite(v[before] * yaw).any() else math.nan
    found = replace(
        bare,
        v_entry=float(np.nanmean(v[before])),
        a_y_dry=abs(a_y_dry),
        a_y_least=float(np.nanmin(mean)) if np.isfinite(mean).any() else math.nan,
        a_y_mean=a_y_mean,
        off=abs(a_y_dry) - inwards * turning,
        per_delay=(abs(a_y_dry) - a_y_mean) / (inside.sum() * dt),
        radius=float(np.nanmean(v[before])) ** 2 / max(abs(a_y_dry), 1e-9),
    )
    return _checked(found, signals, v, before, inside, limits, radius)


def _checked(
    found: CurvePass, signals: Signals, v: FloatArray, before: BoolArray, inside: BoolArray, limits: CurveLimits,
    radius: float | None,
) -> CurvePass:  # fmt: skip
    reasons: list[str] = []
    notes: list[str] = []
    if found.a_y_dry < _A_Y_LEAST:
        reasons.append(f"{found.a_y_dry:.2f} m/s² before the trough: no curve")
    if radius is not None and found.a_y_dry >= _A_Y_LEAST:
        wanted = found.v_entry**2 / radius
        if abs(found.a_y_dry - wanted) > limits.a_y_share * wanted:
            reasons.append(
                f"{found.a_y_dry:.2f} m/s² before the trough; {3.6 * found.v_entry:.0f} km/h on {radius:g} m give "
                f"{wanted:.2f}"
            )
    reasons += [why for why in (wrong_speed(signals, before), wrong_curve(signals, before)) if why]
    change = float(np.nanmax(v[before]) - np.nanmin(v[before])) * 3.6
    if change > limits.v_change:
        reasons.append(f"the speed changes by {change:.1f} km/h in the second before, at most {limits.v_change:g}")
    steer = signals.array("steer_angle")
    if not (np.isfinite(steer[before]).any() and np.isfinite(steer[inside]).any()):
        notes.append("no steering angle: whether it stayed constant is not checked")
        return replace(found, reasons=tuple(reasons), notes=tuple(notes))
    dry = float(np.nanmean(steer[before]))
    smooth = mean_over(steer, limits.a_y_mean, signals.dt)[inside]
    away = np.abs((smooth if np.isfinite(smooth).any() else steer[inside]) - dry)
    share = float(np.nanmax(away)) / abs(dry) if dry else math.inf
    if share > limits.steer:
        told = f"changes by {100 * share:.0f} %" if share < 10.0 else "grows more than tenfold"
        reasons.append(f"the steering angle {told} in the trough: it is not constant")
    return replace(found, steer=share, reasons=tuple(reasons), notes=tuple(notes))
