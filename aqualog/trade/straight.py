"""The straight aquaplaning test of one run: the speed at which the wet driven wheel turns 15 % faster than the dry one.

The car runs with one side in water and the other one dry, under full throttle in a fixed gear.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from aqualog.core.notation import AXLES
from aqualog.core.records import BoolArray, FloatArray, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.trade.lane import Side, Span, mean_over, no_lane, spans_of, tracks_of, wet_side_of
from aqualog.trade.limits import StraightLimits, defaults
from aqualog.trade.plausible import wrong_speed
from aqualog.trade.run_checks import Looked, look
from aqualog.trade.speeds import Speeds, references

__all__ = ["LEVELS", "StraightRun", "crossing", "slip_of", "straight_run", "straight_runs"]

LEVELS = {"v_05": 0.05, "v_10": 0.10, "v_15": 0.15, "v_50": 0.50}
"""Slips at which speeds are read. [-] That of `v_15` is the limit in use."""
_V_LEAST = 3.0  # [m/s] below, a yaw rate says nothing about the wheels' speeds
_SIDE_S = 0.1  # [s] of the mean that shows the wet side
_SLIP_LEAST = 0.03  # [-] a wheel that turns faster by less does not show the wet side
_RATE_LEAST = 10.0  # [Hz] slower, a slip that lasts 0.1 s falls between two samples
_SHOWN_HZ = 50.0  # of the curve that is kept
_DELAY_S = 0.1  # [s] of a receiver, as an example
_OTHER: dict[Side, Side] = {"left": "right", "right": "left"}


@dataclass(frozen=True, slots=True)
class StraightRun:
    """One run over the lane, judged by itself; what the set must say comes from `validity.against_set`.

    Attributes
    ----------
    speeds, speeds_other : mapping
        Speed at each slip of `LEVELS`, over the reference and over the other one. [m/s] NaN where not reached.
    reference, other : str
        `v_x`, or the dry free wheel (`omega_rr`); empty where there is no other.
    v_bound : float
        Highest speed on the lane, so long before its end that 15 % could still last, if they were not reached, by the
        reference: the speed of 15 % lies above. [m/s] Else NaN.
    reasons : tuple of str
        Why the run is not valid, each a sentence without a full stop.
    notes : tuple of str
        What could not be checked.
    a_x : float
        Mean acceleration before the crossing, by the speed. [m/s²]
    yaw_rate : float
        Largest size of the yaw rate on the lane before the crossing. [rad/s]
    ratio : float
        q, the dry second's ratio of the dry wheel's speed to the wet one's. [-]
    t_15 : float
        Time of the crossing from the log's first sample. [s] NaN without one.
    wet_side, axle
        Side in water; driven axle that is compared, `f` or `r`.
    lane : (float, float), optional
        [s]
    curve : (array, array)
        Speed [m/s] and slip [-] on the lane, at most 50 a second.
    late : float
        By how much `v_x` was late, which is taken off. [s] NaN if nothing was.
    wet : float
        Share of the acceleration's time on the lane.
    """

    speeds: Mapping[str, float] = field(default_factory=dict)
    speeds_other: Mapping[str, float] = field(default_factory=dict)
    reference: str = ""
    other: str = ""
    v_bound: float = math.nan
    reasons: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    a_x: float = math.nan
    yaw_rate: float = math.nan
    ratio: float = math.nan
    t_15: float = math.nan
    wet_side: Side | None = None
    axle: str = ""
    lane: Span | None = None
    curve: tuple[FloatArray, FloatArray] = field(default=(np.zeros(0), np.zeros(0)), compare=False, repr=False)
    late: float = math.nan
    wet: float = 1.0

    @property
    def is_censored(self) -> bool:
        """Whether 15 % were not reached before the lane's end."""
        return math.isfinite(self.v_bound)

    @property
    def v(self) -> float:
        """Speed of 15 % slip; of a censored run the speed that it is above. [m/s] NaN without either."""
        return self.v_bound if self.is_censored else self.speeds.get("v_15", math.nan)

    @property
    def valid(self) -> bool:
        """Whether the run counts; a censored one does."""
        return not self.reasons and math.isfinite(self.v)


def straight_runs(
    signals: Signals, vehicle: Vehicle, limits: StraightLimits | None = None, *, lane: Span | None = None,
    depths: tuple[float, float] | None = None,
) -> tuple[StraightRun, ...]:  # fmt: skip
    """Evaluate every run over a lane in a drive; without a lane one record that says so.

    Parameters
    ----------
    signals : Signals
        Wheel speeds are needed, `v_x`, `yaw_rate`, torques, `gear` used where the log has them.
    vehicle : Vehicle
        Driven axle, track and effective radii.
    limits : StraightLimits, optional
        Default: those of `limits.toml`.
    lane : (float, float), optional
        Begin and end of the lane [s], in place of the log's own label.
    depths : (float, float), optional
        Water in the left and right track [m], in place of the log's own.

    Source: tyre tests of Auto Express [autoexpress2023]; [maleska2021] for the influence of load, pressure and depth.
    """
    spans = spans_of(signals, lane)
    if not spans:
        return (StraightRun(reasons=(no_lane(signals),)),)
    return tuple(straight_run(signals, vehicle, span, limits, depths=depths) for span in spans)


def straight_run(
    signals: Signals, vehicle: Vehicle, span: Span, limits: StraightLimits | None = None, *,
    depths: tuple[float, float] | None = None,
) -> StraightRun:  # fmt: skip
    """Evaluate the run over one lane, see `straight_runs`. Never an error: what is missing stands in `reasons`."""
    limits = limits or defaults().straight
    axle = _axle(vehicle)
    bare = StraightRun(axle=axle, lane=span)
    lacking = _lacking(signals, vehicle, axle)
    if lacking:
        return replace(bare, reasons=lacking)
    t, dt = signals.array("t"), signals.dt
    on_lane: BoolArray = (t >= span[0]) & (t <= span[1])
    dry_end = span[0] - limits.dry_gap
    before: BoolArray = (t >= dry_end - limits.dry) & (t < dry_end)
    if not on_lane.any():
        what = f"the lane ({span[0]:.1f} to {span[1]:.1f} s) lies outside the log ({t[0]:.1f} to {t[-1]:.1f} s)"
        return replace(bare, reasons=(what,))
    side, notes = _side(signals, span, depths, axle, before, on_lane)
    if side is None:
        return replace(bare, reasons=notes)
    wet, dry = (f"{axle}{s[0]}" for s in (side, _OTHER[side]))
    speeds = references(signals, vehicle, axle, dry, on_lane, before, limits.v_x_share)
    if not speeds.names[0]:
        return replace(bare, wet_side=side, reasons=speeds.notes, notes=notes)
    yaw_term = _yaw_term(signals, vehicle, speeds.own, side)
    raw, ratio = slip_of(signals.array(f"omega_{wet}"), signals.array(f"omega_{dry}"), yaw_term, before)
    if not math.isfinite(ratio) or before.sum() * dt < 0.5 * limits.dry:
        what = (
            f"less than {0.5 * limits.dry:g} s of dry road with wheel speeds; {limits.dry:g} s needed, up to "
            f"{limits.dry_gap:g} s before the lane"
        )
        return replace(bare, wet_side=side, reasons=(what,), notes=notes)
    slip, lasts = mean_over(raw, limits.slip_mean, dt), max(1, round(limits.slip_lasts / dt))
    levels = {n: crossing(slip, on_lane, limits.slip if n == "v_15" else s, lasts) for n, s in LEVELS.items()}
    at = levels["v_15"]
    driven = np.where(on_lane & np.isfinite(speeds.own), speeds.own, -np.inf)
    highest, is_reached = int(np.argmax(driven)), math.isfinite(at)
    # a crossing nearer to the lane's end would not last, or its mean would hold dry road
    lane, late = np.flatnonzero(on_lane), lasts + round(0.5 * limits.slip_mean / dt)
    bound = float(driven[lane[: max(lane.size - late, 1)]].max())
    stop = at if is_reached else float(highest)
    other = crossing(-slip, on_lane & (np.arange(t.size) <= stop), limits.slip / (1.0 + limits.slip), lasts)
    wrong = f"the other driven wheel, on the {_OTHER[side]}, slipped by {limits.level}: wrong side declared?"
    torque = np.asarray(np.sum([signals.array(f"torque_{w}") for w in vehicle.driven], axis=0), dtype=np.float64)
    seen = look(signals, Looked(span, raw, speeds.own, stop, is_reached, torque), limits)
    every = max(1, round(1.0 / (_SHOWN_HZ * dt)))
    return StraightRun(
        {n: _read(speeds.own, k) for n, k in levels.items()},
        {n: _read(speeds.other, k) for n, k in levels.items()} if speeds.names[1] else {},
        *speeds.names, math.nan if is_reached else bound,
        (*((wrong,) if math.isfinite(other) else ()), *_no_speed(signals, before, speeds.wrong), *seen.reasons),
        (*notes, *speeds.notes, *seen.notes, *_remarks(signals, span, speeds, seen.a_x)), seen.a_x, seen.yaw_rate,
        ratio, _read(t, at), side, axle, span, (speeds.own[on_lane][::every], slip[on_lane][::every]), speeds.late,
        seen.wet,
    )  # fmt: skip


def _no_speed(signals: Signals, before: BoolArray, wrong: str) -> tuple[str, ...]:
    """Return why `v_x` is not the car's speed."""
    why = wrong_speed(signals, before) or wrong
    return (why,) if why else ()


def _remarks(signals: Signals, span: Span, speeds: Speeds, a_x: float) -> tuple[str, ...]:
    """Return what a reader should know of the log's end, and of a delay that nothing shows."""
    out = []
    if float(signals.array("t")[-1]) < span[1] + 0.5 * signals.dt:
        out.append("the log ends on the lane")
    if speeds.names == ("v_x", "") and math.isfinite(a_x):
        out.append(
            f"the delay of v_x is not known: {_DELAY_S:g} s would make it {3.6 * _DELAY_S * a_x:.1f} km/h too low"
        )
    return tuple(out)


def slip_of(
    omega_wet: FloatArray, omega_dry: FloatArray, yaw_term: FloatArray, before: BoolArray
) -> tuple[FloatArray, float]:
    """Slip of the wet driven wheel against the dry one.

    Parameters
    ----------
    omega_wet, omega_dry : array (n,)
        Wheel speeds. [rad/s]
    yaw_term : array (n,)
        yaw_rate track / v, positive where the wet wheel runs outside. [-]
    before : bool array (n,)
        The dry second before the lane.

    Returns
    -------
    s : array (n,)
        omega_wet / omega_dry q - 1 - yaw_term. [-]
    q : float
        Makes the mean of s over the dry second 0; NaN if less than half of it is usable.

    Limits: wheels that turn alike, straight on, give 0; the wet wheel 15 % faster gives 0.15.

    Source: derived; axes of ISO 8855 [iso8855_2011].
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        quotient = np.where(omega_dry > 1.0, omega_wet / omega_dry, np.nan)
    usable = before & np.isfinite(quotient) & np.isfinite(yaw_term) & (omega_wet > 1.0)
    if usable.sum() < max(0.5 * before.sum(), 2):
        return np.full(quotient.shape, np.nan), math.nan
    q = (1.0 + float(yaw_term[usable].mean())) / float(quotient[usable].mean())
    return quotient * q - 1.0 - yaw_term, q


def crossing(slip: FloatArray, on_lane: BoolArray, level: float, lasts: int) -> float:
    """Return the place of the first upward crossing of a level that lasts, in samples, linear between two; else NaN.

    `lasts` counts the known samples from the crossing on that must be at the level or above it, up to the lane's end.
    A slip that is there from the lane's first sample on has crossed before it: abrupt, or where the label is late.
    """
    known = np.flatnonzero(np.isfinite(slip))
    on = np.flatnonzero(on_lane[known])
    if not on.size:
        return math.nan
    s = slip[known[: on[-1] + 1]]
    high = s >= level
    for k in np.flatnonzero(high & ~np.concatenate([[False], high[:-1]])).tolist():
        end = max(k + lasts, int(on[0]) + 1)
        if high[k:end].all() and end <= s.size:
            j = max(k - 1, 0)
            share = (level - s[j]) / (s[k] - s[j]) if j < k else 0.0
            return float(known[j] + share * (known[k] - known[j]))
    return math.nan


def _axle(vehicle: Vehicle) -> str:
    if vehicle.drivetrain == "awd":
        return "r" if vehicle.torque_split_rear > 0.5 else "f"
    return vehicle.drivetrain[0]


def _lacking(signals: Signals, vehicle: Vehicle, axle: str) -> tuple[str, ...]:
    """Return why a run cannot be evaluated at all."""
    if not vehicle.knows_drivetrain:
        return ("the vehicle file does not say which axle is driven (drivetrain)",)
    missing = [f"omega_{w}" for w in AXLES[axle] if not np.isfinite(signals.array(f"omega_{w}")).any()]
    if missing:
        return (f"{' and '.join(missing)} {'are' if len(missing) > 1 else 'is'} not in the log",)
    if 1.0 / signals.dt < _RATE_LEAST:
        return (f"{1.0 / signals.dt:.3g} samples a second, at least {_RATE_LEAST:g} needed",)
    return ()


def _side(
    signals: Signals, span: Span, depths: tuple[float, float] | None, axle: str, before: BoolArray, on_lane: BoolArray
) -> tuple[Side | None, tuple[str, ...]]:
    """Return the wet side and notes, or None and why it is not known.

    It is that of the depths, else that of the wheel that turns faster on the lane.
    """
    tracks = tracks_of(signals, span, depths)
    if tracks is not None:
        side = wet_side_of(*tracks)
        told = " and ".join(f"{1e3 * d:.1f}" for d in tracks)
        return side, () if side else (f"no side is dry beside a wet one: {told} mm of water left and right",)
    left, right = (signals.array(f"omega_{w}") for w in AXLES[axle])
    with np.errstate(divide="ignore", invalid="ignore"):
        quotient = np.where((left > 1.0) & (right > 1.0), left / right, np.nan)
    quotient = mean_over(quotient, _SIDE_S, signals.dt)
    dry, wet = quotient[before & np.isfinite(quotient)], quotient[on_lane & np.isfinite(quotient)]
    unknown = ("the wet side is not known: no depth of the left and right track, and both wheels turn alike",)
    if dry.size < 2 or wet.size < 2:
        return None, unknown
    away = np.log(wet / float(dry.mean()))
    most = float(away[np.argmax(np.abs(away))])
    if abs(most) < _SLIP_LEAST:
        return None, unknown
    faster: Side = "left" if most > 0.0 else "right"
    return faster, (f"the {faster} side is taken as the wet one, because its driven wheel turns faster on the lane",)


def _yaw_term(signals: Signals, vehicle: Vehicle, speed: FloatArray, side: Side) -> FloatArray:
    """Return yaw_rate track / v, positive where the wet wheel runs outside; 0 without a yaw rate. [-]

    Across a gap the speed is linear: so small a term does not lose a slip.
    """
    yaw, known = np.nan_to_num(signals.array("yaw_rate")), np.flatnonzero(np.isfinite(speed))
    speed = np.interp(np.arange(speed.size), known, speed[known])
    outside = 1.0 if side == "right" else -1.0
    return outside * yaw * vehicle.track / np.maximum(speed, _V_LEAST)


def _read(v: FloatArray, place: float) -> float:
    """Return the value between two samples."""
    if not math.isfinite(place):
        return math.nan
    k = min(int(place), v.size - 2)
    return float(v[k] + (place - k) * (v[k + 1] - v[k]))
