"""A log prepared for diagnosis: inputs of the simulation, measured signals to compare, and samples left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from aqualog.align.mapping import MAP_HINT
from aqualog.core.errors import SignalError
from aqualog.core.notation import AXLES, WHEELS
from aqualog.core.records import BoolArray, FloatArray, Signals
from aqualog.core.units import is_unit, parse_unit
from aqualog.core.vehicle import Vehicle
from aqualog.diagnose import inputs
from aqualog.diagnose.channels import block_means, block_step, centre_line_speeds, channels_of
from aqualog.features.stream import INPUTS, FeatureStream
from aqualog.model.effects import EFFECTS
from aqualog.model.follow import FOLLOW_RATE, Course, follow
from aqualog.model.scenario import Lane
from aqualog.model.term import Model, Term

__all__ = ["ON_WATER", "RESERVED", "Drive", "floating", "led_by", "on_water", "prepare", "rolling_under", "stretches"]

ON_WATER = " s on water "  # in the note on time that is not judged
LITTLE = 0.5  # share of the time on water that is judged, below which a note says so
BESIDE_S = 1.0  # [s] before and after what is left out
BEHIND_S = 1.0  # [s] after a stretch of water, in which the rear axle and the speed still have it
LEAST_RATE_HZ = 5.0
GAP_S = 0.25  # [s] longer gaps are not bridged
FROZEN_S = 5.0  # [s] longer, a signal does not stay the same
A_Y_MAX = 4.0  # [m/s^2] beyond, tyres are far from straight running
A_X_MAX = 6.0  # [m/s^2]
# [m/s^3] at steeper torque the samples show clocks, filters and tyre lag: 10 ms are 0.1 m/s^2
JERK_MAX, JERK_S = 10.0, 0.1
SHIFT_JERK, SHIFT_S = 2.0, 1.0  # [m/s^3] of a torque that falls away and comes back, and the most time between [s]
SETTLES_S = 2.0  # [s] after a gear shift, until the body no longer pitches (K)
SHIFTS_MOST = 0.3  # [-] of the drive: beyond, the torque is noisy
FORCE_MIN = 0.02  # [m/s^2] of drive: a car that is driven is not braked
BRAKES, LONG_AGO_S = -0.8, 60.0  # [m/s^2], [s] braking, and when it has been long ago
# [m/s^2] of all wheels that are not driven, and of a car without such, when brakes are on (K)
BRAKED, BRAKED_ALL = 0.03, 0.4
WHILE_S = -15.0  # [s] in place of it while braking: far enough to act as it does after it, or not at all
ROLLS_OUT = 0.15  # [m/s^2] a slope of 1.5 %, so that a road does not count as a brake
# slip of a wheel beyond its grip: a wet tyre's force has its largest value at 0.08 to 0.2 (D: 3 mu / C), and driving
# without floating needs a fifth of that
BEYOND_GRIP = 0.05
# times its own lost contact with which the simulation must still hold on: it goes with the fourth power of the speed of
# full aquaplaning, which sources give as 118 (thesis), 95 (PAVDRN, K) and 88 km/h (Gallaway, K) at 1.3 mm
RESERVE = 2.0
# [s] a wheel that stood takes up speed again within one (D: 33 m/s in 0.65 s), but the led car has been turned by it,
# and its yaw dies out in a few
RECOVERY_S = 5.0
RESERVED = (Model(), Model((Term(EFFECTS["contact_loss"], {"gain": RESERVE}),)))
V_LEAST = 4.0  # [m/s] under the slip
SPINS = 0.15  # slip of a wheel on dry road that its tyre no longer holds


@dataclass(frozen=True, slots=True)
class Drive:
    """One drive: `course` for the simulation, `columns` measured (n,), `mask` (m,) of usable blocks of 0.1 s. `speed`
    (n,) is the measured speed without noise [m/s]; that of the course leads it by the lag of the simulation.
    `coordinates` (m,): quantities that a remaining error may depend on. `untorqued`: the log has no torque, the one
    that the base model needs for the measured speed replaces it, and the force balance is not judged. `settling` (m,):
    blocks in and behind a gear shift, or where a motor may slow a car whose torque is not known: they show a road, but
    no effect (`calm`)."""

    name: str
    dt: float
    vehicle: Vehicle
    course: Course
    speed: FloatArray
    columns: Mapping[str, FloatArray]
    channels: tuple[str, ...]
    mask: BoolArray
    settling: BoolArray
    coordinates: Mapping[str, FloatArray]
    present: frozenset[str]
    untorqued: bool
    duration_s: float
    notes: tuple[str, ...]

    @property
    def used_s(self) -> float:
        """Usable driving. [s]"""
        return float(self.mask.sum()) * block_step(self.dt)


def prepare(signals: Signals, vehicle: Vehicle, name: str, *, judges_afloat: bool = False) -> Drive:
    """Signals of one drive as input and measurement; SignalError if the log has neither velocity nor four wheel speeds,
    or nothing to compare, or is too short or too slow.

    Left out, with a second on either side: standstill and creeping, gaps, strong cornering, braking where the brakes'
    torque is not in the log, a frozen accelerometer; with 0.1 s: jumps of the torque. And where a wheel may float,
    unless it is judged there, too (`judges_afloat`).
    """
    present = frozenset(s for s in signals.symbols if _is_measured(signals, s))
    dt, n = signals.dt, signals.frame.height
    if n * dt < inputs.LEAST_S:
        least = f"{inputs.LEAST_S:.0f} s at the least"
        raise SignalError(f"{n * dt:.0f} s of drive", where=name, expected=least, hint="a longer drive")
    if dt * LEAST_RATE_HZ > 1.001:
        raise SignalError(
            f"signals at {1.0 / dt:.3g} Hz", where=name, expected=f"{LEAST_RATE_HZ:g} Hz or more",
            hint="the log before it was thinned; check the unit of its time and --rate",
        )  # fmt: skip
    channels = channels_of(present, vehicle)
    if not channels:
        lacks = "accelerometer or wheel speeds, and a velocity"
        raise SignalError("nothing to compare", where=name, expected=lacks, hint=MAP_HINT)
    vehicle = _as_known(vehicle, signals)
    columns = {s: signals.array(s) for s in present}
    notes = _silent(signals, present)
    v, bad = _bridged(_velocity(columns, vehicle, dt, present), dt)
    torqued = "force_balance" in channels
    bridged = {s: _bridged(columns[s], dt) for s in sorted(present)}
    filled = {s: x for s, (x, _) in bridged.items()}
    shows_road = np.zeros(n, dtype=bool)
    needed = ("a_x", "v_x", "omega_", *(("torque_",) if torqued else ()))
    for gaps in (own for s, (_, own) in bridged.items() if s.startswith(needed)):
        bad |= gaps
    if torqued:
        # signals have the file's torque gain already: it is applied on reading
        logged = np.array([filled.get(f"torque_{w}", np.zeros(n)) for w in WHEELS])
        told = [signals.origins[f"torque_{w}"].rate_hz for w in vehicle.driven if f"torque_{w}" in signals.origins]
        moves = filled["a_x"] if "a_x" in filled else np.gradient(v, dt)
        torque = inputs.quiet_torque(logged, dt, min(told, default=None))
        torque = inputs.confirmed_torque(torque, moves, dt, 1.0 / (vehicle.mass * vehicle.r_e("fl")))
    else:
        logged = torque = inputs.needed_torque(v, vehicle, dt)
        torques = {f"torque_{w}" for w in vehicle.driven}
        lacks = ", ".join(sorted(torques - present)) if torques & present else "wheel torque"
        notes.append(f"no {lacks} in the log: the torque is the one that the model needs for the measured speed")
    speed = inputs.quiet_speed(v, dt)
    t = np.arange(n, dtype=np.float64) * dt
    steer = inputs.road_wheel_angle(filled, v, vehicle, dt, most=1.2 * A_Y_MAX)
    measured = Course(
        t, torque, steer, speed, _lanes(filled, dt), has_rods="tie_rod_fl" in channels, position=np.cumsum(v) * dt
    )
    course = _without_lag(measured, led := follow(vehicle, measured, Model()))
    floats = floating(filled, v, vehicle, course)
    bad |= v < inputs.V_MIN
    if not judges_afloat:
        bad |= floats
        if _slides(led, vehicle).any():
            bad |= _slides(follow(vehicle, course, Model()), vehicle)
    if "a_x" in filled:
        bad |= inputs.lasting(np.diff(filled["a_x"], prepend=np.nan) == 0.0, FROZEN_S, dt)
    bad |= np.abs(np.gradient(speed, dt)) > A_X_MAX
    if "yaw_rate" in filled:
        bad |= np.abs(v * filled["yaw_rate"]) > A_Y_MAX
    # friction brakes are at every wheel: the torque of one axle cannot hold them
    every_wheel, pressed = torqued and all(f"torque_{w}" in filled for w in WHEELS), filled.get("brake_pressure")
    if pressed is not None and not (every_wheel and inputs.brakes_in_torque(pressed, torque, v, vehicle, dt)):
        bad |= pressed > inputs.BRAKE_PRESSURE
        why = "the logged torque explains too little of it" if every_wheel else "its torque is not in the log"
        notes.append(f"braking is left out: {why}")
    if not torqued:
        bad |= np.gradient(speed, dt) > inputs.A_MOST
        # a motor slows the car too, at wheels that nobody knows, and presses no brake
        slowed = inputs.smooth(np.gradient(speed, dt), dt, inputs.SPEED_S) < -inputs.roll_out(v, vehicle) - ROLLS_OUT
        if {"a_x", "brake_pressure"} <= filled.keys():
            shows_road |= _widened(slowed, BESIDE_S, dt)
            notes.append("only driving and rolling out are used, except for a road: what slows the car is not known")
        else:
            bad |= slowed
            notes.append("only driving and rolling out are used: the torque that slows the car is not known")
    elif "brake_pressure" not in filled:
        unlogged = "" if every_wheel else "the torque is that of one axle: brakes are not in the log"
        wet = _widened(floats | (_depth(course) > 0.0), BESIDE_S, dt)
        if every_wheel and inputs.brakes_unlogged(torque, v, wet, vehicle, dt):
            unlogged = "the car slows down more than its torque explains (brakes, more drag, or a trailer)"
        if unlogged:
            bad |= torque.sum(axis=0) < FORCE_MIN * vehicle.mass * vehicle.arm("fl")
            notes.append(f"{unlogged}, driven stretches are used")
    left_out = _widened(bad, BESIDE_S, dt) | _widened(np.abs(_jerk(logged, vehicle, dt)) > JERK_MAX, JERK_S, dt)
    mask = block_means(left_out.astype(np.float64), dt) == 0.0
    shows_road |= _shifting(_jerk(torque, vehicle, dt), dt)
    settling = block_means(shows_road.astype(np.float64), dt) > 0.0
    return Drive(
        name, dt, vehicle, course, speed, filled, channels, mask, mask & settling,
        _coordinates(filled, course, speed, v, dt, _braked(filled, torque, vehicle)), present, not torqued, n * dt,
        (*notes, *_judged_on_water(mask, course, dt)),
    )  # fmt: skip


def calm(drive: Drive) -> Drive:
    """The drive without gear shifts and what swings behind them, and without what may slow it unknown."""
    return replace(drive, mask=drive.mask & ~drive.settling)


def _judged_on_water(mask: BoolArray, course: Course, dt: float) -> list[str]:
    """A note where most of the water is left out: no effect there is not what the drive shows."""
    water_s, judged_s = on_water(mask, course, dt)
    if judged_s >= LITTLE * water_s:
        return []
    return [f"of {water_s:.0f}{ON_WATER}{judged_s:.0f} s are judged: in the rest a wheel may float"]


def on_water(mask: BoolArray, course: Course, dt: float) -> tuple[float, float]:
    """Time on water, and the part of it that is judged. [s]"""
    wet = block_means((_depth(course) > 0.0).astype(np.float64), dt) > 0.0
    water_s, judged_s = (float(x.sum()) * block_step(dt) for x in (wet, wet & mask))
    return water_s, judged_s


def led_by(drive: Drive, model: Model) -> Drive:
    """The drive with a target speed with which the simulation of a model, not the file's car, meets the measured speed:
    0.2 m/s² of drag shift it by 0.7 m/s, at which the drag is 5 % off."""
    measured = replace(drive.course, v_x=drive.speed)
    return replace(drive, course=_without_lag(measured, follow(drive.vehicle, measured, model.of(drive.name))))


def rolling_under(drive: Drive, model: Model) -> Drive:
    """The drive without what is left out where a wheel floats in the simulation of a model."""
    floats = floating({}, drive.speed, drive.vehicle, drive.course, (model,))
    rolls = block_means(_widened(floats, BESIDE_S, drive.dt).astype(np.float64), drive.dt) == 0.0
    return replace(drive, mask=drive.mask & rolls, settling=drive.settling & rolls)


def _slides(led: Mapping[str, FloatArray], vehicle: Vehicle) -> BoolArray:
    """Samples in which the simulated car is turned back or one of its wheels spins: it shows nothing of the other."""
    v = led["v_x"]
    slip = (centre_line_speeds(led, vehicle) - v) / np.maximum(v, V_LEAST)
    return np.asarray((led["slides"] > 0.0) | (np.abs(slip).max(axis=0) > SPINS))


def _without_lag(course: Course, led: Mapping[str, FloatArray]) -> Course:
    """The course with a target speed that makes the simulated speed, `led` along it with a lag, meet the measured one:
    a lagging copy of its noise would look like a delayed signal."""
    return replace(course, v_x=course.v_x + led["nudge"] / FOLLOW_RATE)


def _is_measured(signals: Signals, symbol: str) -> bool:
    """Whether a signal has values; a yaw rate that keeps one beside an a_y that does not, or that a_y, is dead."""
    values = signals.frame[symbol].n_unique() - (signals.frame[symbol].null_count() > 0)
    beside = {"yaw_rate": "a_y", "a_y": "yaw_rate"}.get(symbol, "")
    return bool(values > 1 or (values == 1 and (beside not in signals.symbols or signals.frame[beside].n_unique() < 3)))


def _silent(signals: Signals, present: frozenset[str]) -> list[str]:
    """Signals of the log that never have a value, or a dead one, with the signals that depend on them."""
    silent = [s for s in signals.symbols if s not in present]
    lost = any(s.startswith("omega_") for s in silent) or 0 < sum(f"omega_{w}" in present for w in WHEELS) < len(WHEELS)
    out = [f"{', '.join(silent)}: no value, or the same one, in the whole drive"] if silent else []
    return [*out, "not all four wheel speeds: the slip of the wheels is not judged"] if lost else out


def _as_known(vehicle: Vehicle, signals: Signals) -> Vehicle:
    """The vehicle without radii where the log gives wheel speeds in km/h: the file's radii convert them back, whatever
    their values."""
    wheels = [o for n, o in signals.origins.items() if n.startswith("omega_")]
    if not any(is_unit(o.unit) and parse_unit(o.unit).dimension == "speed" for o in wheels):
        return vehicle
    return replace(vehicle, given=vehicle.given - {f"wheels.r_e_{axle}" for axle in AXLES})


def _velocity(columns: Mapping[str, FloatArray], vehicle: Vehicle, dt: float, present: frozenset[str]) -> FloatArray:
    if "v_x" in columns:
        return columns["v_x"]
    if not all(f"omega_{w}" in columns for w in WHEELS):
        inputs = {s: x for s, x in columns.items() if s in INPUTS}
        return FeatureStream(vehicle, dt, tuple(present)).push(inputs)["v_x_hat"]
    # wheels that are not driven roll nearly without slip
    free = [w for w in WHEELS if w not in vehicle.driven] or list(WHEELS)
    return np.asarray(np.mean([columns[f"omega_{w}"] * vehicle.r_e(w) for w in free], axis=0))


def _bridged(x: FloatArray, dt: float) -> tuple[FloatArray, BoolArray]:
    """A signal with its gaps bridged by straight lines, and the samples in long ones."""
    good = np.isfinite(x)
    if good.all() or not good.any():
        return np.where(good, x, 0.0), ~good
    where = np.flatnonzero(good)
    is_long = np.diff(where, prepend=-1, append=2 * x.size) * dt > GAP_S  # of the gap before each, and of the last one
    return np.interp(np.arange(x.size), where, x[where]), ~good & is_long[np.cumsum(good)]


def _lanes(columns: Mapping[str, FloatArray], dt: float) -> tuple[Lane, ...]:
    """Stretches of water by their labels: each stretch with its mean depths."""
    both = columns.get("water_depth")
    told = [x for n in ("left", "right") if (x := columns.get(f"water_depth_{n}", both)) is not None]
    if not told:
        return ()
    left, right = told[0], told[-1]
    wet: BoolArray = np.maximum(left, right) > 1e-5
    # each step of a depth that is logged in steps makes a stretch
    ends = np.diff(wet.astype(np.int8)) != 0
    change = ends | (np.abs(np.diff(left)) > 5e-5) | (np.abs(np.diff(right)) > 5e-5)
    if change.sum() > 398:  # measured depths that vary: mean of each wet stretch
        change = ends
    return tuple(
        Lane(
            a * dt, b * dt, in_metres=False, depth_left=float(left[a:b].mean()), depth_right=float(right[a:b].mean()),
            irregularity_left=0.0, irregularity_right=0.0,
        )
        for a, b in pairwise([0, *(np.flatnonzero(change) + 1).tolist(), wet.size]) if b > a and wet[a]
    )  # fmt: skip


def _depth(course: Course) -> FloatArray:
    """Mean depth of the water under both sides, 0 on dry road. (n,) [m]"""
    out = np.zeros_like(course.t)
    for lane in course.lanes:
        out[(course.t >= lane.start) & (course.t < lane.end)] = 0.5 * (lane.depth_left + lane.depth_right)
    return out


def _jerk(torque: FloatArray, vehicle: Vehicle, dt: float) -> FloatArray:
    """How fast the drive's share of the acceleration rises, over 0.1 s. (n,) [m/s³]"""
    a = torque.sum(axis=0) / (vehicle.mass * vehicle.arm("fl"))
    k = max(1, round(0.5 * JERK_S / dt))
    padded = np.pad(a, k, mode="edge")
    return np.asarray((padded[2 * k :] - padded[: -2 * k]) / (2 * k * dt))


def _shifting(jerk: FloatArray, dt: float) -> BoolArray:
    """Where a gear is shifted, (n,): the torque falls away and comes back, and body and driveline swing for a while.

    `jerk` (n,) as of `_jerk`, positive where the torque drives more. [m/s³]
    """
    at = np.arange(jerk.size)
    fell = np.maximum.accumulate(np.where(jerk < -SHIFT_JERK, at, -jerk.size))
    back = (jerk > SHIFT_JERK) & ((at - fell) * dt < SHIFT_S)
    ends = np.zeros(jerk.size + 1)
    np.add.at(ends, fell[back], 1.0)
    np.add.at(ends, np.minimum(at[back] + round(SETTLES_S / dt), jerk.size), -1.0)
    shifting = np.cumsum(ends[:-1]) > 0.5
    return np.asarray(shifting & (shifting.mean() < SHIFTS_MOST))


def _widened(bad: BoolArray, by: float, dt: float) -> BoolArray:
    """True samples and those within `by` seconds of them."""
    k = max(1, round(by / dt))
    return np.convolve(bad.astype(np.float64), np.ones(2 * k + 1), "same") > 0.5


def _braked(columns: Mapping[str, FloatArray], torque: FloatArray, vehicle: Vehicle) -> BoolArray | None:
    """Where the brakes are on (n,), by their pressure or by the torque of wheels: of those that nothing else slows, or
    of all beyond what an engine slows; None where the log has neither."""
    if "brake_pressure" in columns:
        return np.asarray(columns["brake_pressure"] > inputs.BRAKE_PRESSURE)
    if not all(f"torque_{w}" in columns for w in WHEELS):
        return None
    rolling = [i for i, w in enumerate(WHEELS) if w not in vehicle.driven]
    pull = torque[rolling or slice(None)].sum(axis=0)
    released, least = (float(np.median(pull)), BRAKED) if rolling else (0.0, BRAKED_ALL)
    on = pull < released - least * vehicle.mass * vehicle.arm("fl")
    return np.asarray(on) if on.any() else None


def _coordinates(
    columns: Mapping[str, FloatArray], course: Course, speed: FloatArray, v: FloatArray, dt: float,
    braked: BoolArray | None,
) -> dict[str, FloatArray]:  # fmt: skip
    """Coordinates without the noise of the channels: a function of a noisy one would correlate with its noise.
    `braked` (n,): where the brakes are on, if known."""
    out = {
        "t": course.t,
        "v_x": speed,
        "torque": course.torque.sum(axis=0),
        "position": np.cumsum(v) * dt,
        # without smoothing, most of the change would be noise of the velocity
        "a_x": np.gradient(inputs.smooth(v, dt, inputs.SPEED_S), dt),
    }
    if course.lanes:
        out["water_depth"] = _depth(course)
    if "yaw_rate" in columns:
        turning = inputs.smooth(columns["yaw_rate"], dt, inputs.SPEED_S)
        out |= {"a_y": speed * turning, "yaw_rate": turning}
    slowing = out["a_x"] < BRAKES if braked is None else braked
    if slowing.any():
        last = np.maximum.accumulate(np.where(slowing, course.t, course.t[0] - LONG_AGO_S))
        # what lingers may act while braking, too, or begin with a jump where the brakes are let off
        out["since_braking"] = np.where(slowing, WHILE_S, np.minimum(course.t - last, LONG_AGO_S))
    if "steer_angle" in columns:
        out["steer_angle"] = course.steer
    if "ambient_temperature" in columns:
        out["ambient_temperature"] = columns["ambient_temperature"]
    return {n: block_means(x, dt) for n, x in out.items()}


def stretches(drive: Drive) -> npt.NDArray[np.int64]:
    """Number of the stretch of water under the car or just behind it, from 1 on; 0 on dry road. (m,)"""
    wet = drive.coordinates.get("water_depth", np.zeros(drive.mask.size))[: drive.mask.size] > 0.0
    k = round(BEHIND_S / block_step(drive.dt))
    late = np.convolve(wet.astype(np.float64), np.ones(k + 1), "full")[: wet.size] > 0.5
    begins = np.diff(late.astype(np.int64), prepend=0) > 0
    return np.where(late, np.cumsum(begins), 0)


def floating(
    columns: Mapping[str, FloatArray], v: FloatArray, vehicle: Vehicle, course: Course,
    models: Sequence[Model] = RESERVED,
) -> BoolArray:  # fmt: skip
    """Samples (n,) in which a wheel may float, and whose residual is not judged; all False on a dry course.

    Chance decides whether and when a wheel without grip spins down, and when it recovers: no error of the model. A span
    begins where a wheel loses its grip, measured (`columns` (n,), at the velocity `v` [m/s]) or in the simulation of
    any of `models`. It ends when the stretch of water is over and the car has recovered.
    """
    out: BoolArray = np.zeros(v.shape, dtype=bool)
    for shown in (columns, *(follow(vehicle, course, m) for m in models)) if course.lanes else ():
        if all(f"omega_{w}" in shown for w in WHEELS):
            speed = shown.get("v_x", v)
            # over a speed that is not too small: a standing car does not slip
            slip = (centre_line_speeds(shown, vehicle) - speed) / np.maximum(speed, V_LEAST)
            out |= np.abs(slip).max(axis=0) > BEYOND_GRIP
    left_out = out.copy()
    for lane in course.lanes:
        first = np.flatnonzero(out & (course.t >= lane.start) & (course.t < lane.end))
        if first.size:
            left_out |= (course.t >= course.t[first[0]]) & (course.t < lane.end + RECOVERY_S)
    return left_out
