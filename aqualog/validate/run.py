"""Hold measured drives against their simulation: boundaries over time and in cross plots, limits of speed, ratings."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from aqualog.align.mapping import MAP_HINT
from aqualog.core.errors import SignalError
from aqualog.core.records import BoolArray, FloatArray, Signals
from aqualog.core.vehicle import Vehicle
from aqualog.diagnose.channels import block_means, block_step, channel_values
from aqualog.diagnose.drive import A_Y_MAX, RECOVERY_S, Drive, prepare
from aqualog.diagnose.hypotheses import simulated
from aqualog.diagnose.inputs import V_MIN
from aqualog.model.effects import EFFECTS
from aqualog.model.term import Model, Term
from aqualog.trade.plausible import wrong_speed
from aqualog.validate.boundary import beyond
from aqualog.validate.rating import LEAST_SAMPLES, rating
from aqualog.validate.records import PLOTS, SIGNALS, Judged, Limit, Plan, Plot, Rated, Spread, Trace, Validity, Worst
from aqualog.validate.sensors import late_velocity, offsets
from aqualog.validate.spread import spread_of

__all__ = ["trace_of", "validate"]

BINS = 24  # of a plot that is not over time
LEAST_IN_BIN = 10  # blocks
BRIDGED_S = 0.5  # [s] shorter stretches within part no stretch beyond
LONGEST_S = 60.0  # [s] of a rated stretch
MOVES = 6.0  # times the built-in eps_y from the least to the greatest value of a stretch that is rated
LEAST_VALID = 1.0 / 3.6  # [m/s] a range of speed that counts as valid, at least; and a fifth of what was driven
OFTEN = 0.1  # of a drive with so fast curves that little else is left
LEAST_BEYOND_S = 2.0  # [s] more than the agreed share allows, before a part of the speeds is not valid


def validate(
    drives: Sequence[tuple[str, Signals]],
    vehicle: Vehicle,
    *,
    model: Model,
    plan: Plan,
    progress: Callable[[str], None] = lambda _: None,
) -> Validity:
    """Judge whether the simulation of a car is valid on measured drives.

    Parameters
    ----------
    drives : sequence of (name, Signals)
    vehicle : Vehicle
        What the simulation believes.
    model : Model
        Effects on top of it.
    plan : Plan
        Plots with their tolerances.
    progress : callable
        Hears each step.

    Raises
    ------
    SignalError
        If a drive cannot be used or holds nothing to compare. Its `where` names the drive.
    """
    traces = []
    for name, signals in drives:
        if wrong := wrong_speed(signals, np.ones(signals.frame.height, dtype=bool)):
            raise SignalError(wrong, where=name, hint=MAP_HINT)
        progress(f"{name}: simulating")
        traces.append(trace_of(prepare(signals, vehicle, name, judges_afloat=True), model, signals))
    if not any(t.judged.any() for t in traces):
        raise SignalError(
            f"none of {sum(t.duration_s for t in traces):.0f} s can be judged: {_why_not(*drives[0])}",
            where=drives[0][0], hint=MAP_HINT,
        )  # fmt: skip
    spread = {s: w for s in SIGNALS if s not in plan.given and (w := spread_of(traces, s))}
    plan = replace(plan, plots=tuple(_widened(p, spread) for p in plan.plots))
    progress("judging")
    off = {p: [_off(t, p) for t in traces] for p in plan.plots if p.x == "t" and any(p.y in t.measured for t in traces)}
    crossed = (_cross(p, traces) for p in plan.plots if p.x != "t")
    judged = (*(_over_time(p, traces, o) for p, o in off.items()), *(j for j in crossed if j is not None))
    all_in = [_all_within(t, [o[i] for o in off.values()]) for i, t in enumerate(traces)]
    seconds = sum(float(t.judged.sum()) * t.step for t in traces)
    within = sum(float(w[t.judged].sum()) * t.step for t, w in zip(traces, all_in, strict=True))
    worst = [(j.worst, _weight(j.worst, j.plot)) for j in judged if j.worst is not None]
    notes = [f"{t.name}: {n}" for t in traces for n in t.notes]
    lateral = [s for s in ("a_y", "yaw_rate") if any(s in t.measured for t in traces)]
    if lateral:
        what = "is judged" if len(lateral) == 1 else "are judged"
        notes.append(f"{' and '.join(lateral)} {what} with an assumed cornering stiffness: no key of the file sets it")
    return Validity(
        tuple(traces), plan, within / seconds if seconds else math.nan, seconds, sum(t.duration_s for t in traces),
        judged, max(worst, key=lambda x: x[1])[0] if worst else None, _limits(traces, all_in, plan.agreed),
        _rated(traces), spread, tuple(notes),
    )  # fmt: skip


def _why_not(name: str, signals: Signals) -> str:
    """Why no part of a drive can be judged, by what is most often the reason."""
    turning = np.abs(signals.array("v_x") * signals.array("yaw_rate"))
    most = float(np.nanquantile(turning, 1.0 - OFTEN)) if np.isfinite(turning).any() else 0.0
    if most > A_Y_MAX:
        return f"v_x times yaw_rate is {most:.0f} m/s² and more in a tenth of it: is one of their units wrong?"
    return f"it needs driving above {3.6 * V_MIN:.0f} km/h without braking hard or gaps"


def trace_of(drive: Drive, model: Model, signals: Signals) -> Trace:
    """Measured and simulated signals of a prepared drive, in blocks of 0.1 s.

    Raises
    ------
    SignalError
        If nothing can be compared.
    """
    wet = _wet(drive, signals)
    model, taken_off = _with_sensors(drive, model, signals, wet)
    shown = simulated(drive, model)
    sides = []
    for columns in (drive.columns, shown):
        channels = channel_values(columns, drive.channels, drive.vehicle, dt=drive.dt)
        by_name = dict(zip(drive.channels, channels, strict=True))
        own = {n: by_name[n] for n in SIGNALS if n in by_name and (drive.vehicle.tie_rod or "tie_rod" not in n)}
        if "force_balance" in by_name:
            own["a_x"] = by_name["force_balance"]
        if "steer_angle" in drive.present:  # else the gyro leads the simulation
            own |= {n: block_means(columns[n], drive.dt) for n in ("a_y", "yaw_rate") if n in drive.present}
        sides.append({n: own[n] for n in SIGNALS if n in own})
    if not sides[0]:
        raise SignalError(
            "nothing to compare with the simulation", where=drive.name,
            expected="wheel torques with a_x, wheel speeds, or a steering angle with a_y or yaw_rate",
        )  # fmt: skip
    if not drive.vehicle.tie_rod and any("tie_rod" in n for n in drive.channels):
        taken_off.append("tie-rod forces are left out: the vehicle file has no [tie_rod] (`aqualog calibrate`)")
    return Trace(
        drive.name, block_step(drive.dt), drive.duration_s, sides[0], sides[1], drive.coordinates, drive.mask,
        block_means(wet.astype(np.float64), drive.dt) > 0.0, (*drive.notes, *taken_off),
    )  # fmt: skip


def _with_sensors(drive: Drive, model: Model, signals: Signals, wet: BoolArray) -> tuple[Model, list[str]]:
    """The model with the constant errors of the drive's sensors, and a note on each."""
    dry = np.convolve(wet, np.ones(round(RECOVERY_S / drive.dt) + 1))[: wet.size] < 0.5
    notes = []
    is_known = any(t.effect.name == "signal_delay" and t.place == "v_x" for t in model.terms)
    late = 0.0 if is_known else late_velocity(drive, signals.array("v_x"), dry)
    if math.isnan(late):
        notes.append("a delay of v_x would show as slip: no free wheel, or too even a speed, to find it by")
    elif late:
        model = Model((*model.terms, Term(EFFECTS["signal_delay"], {"delay": late}, "v_x")))
        notes.append(f"v_x comes {abs(late):.3f} s {'late' if late > 0.0 else 'early'}, by the free wheels: taken off")
    if found := offsets(drive, model, dry):
        model = Model((*model.terms, *found))
        steer, gyro, a_y = (x for t in found for x in t.values.values())
        of, units = ("road wheels", "yaw_rate", "a_y"), ("deg", "deg/s", "m/s²")
        each = zip(of, (math.degrees(steer), math.degrees(gyro), a_y), units, strict=True)
        said = ", ".join(f"{name} {x:+.2f} {unit}" for name, x, unit in each if abs(x) >= 0.005)
        notes += [f"offsets taken off: {said}"] if said else []
    return model, notes


def _wet(drive: Drive, signals: Signals) -> BoolArray:
    t = drive.course.t
    wet = np.zeros(t.size, dtype=bool)
    for lane in drive.course.lanes:
        wet |= (t >= lane.start) & (t < lane.end)
    if "on_water" in drive.present:
        wet |= np.nan_to_num(signals.array("on_water")) > 0.5
    return wet


def _widened(plot: Plot, spread: dict[str, Spread]) -> Plot:
    """The plot with the tolerance that the repetitions give, if they do."""
    if plot.y not in spread:
        return plot
    return replace(plot, tolerance=replace(plot.tolerance, y_offset=spread[plot.y].y_offset, y_gain=0.0))


# --- over time -------------------------------------------------------------------------------------------------------


def _off(trace: Trace, plot: Plot) -> FloatArray:
    """How far each block is beyond the boundaries over time; NaN where it is not judged. (m,)"""
    if plot.y not in trace.measured:
        return np.full(trace.judged.shape, np.nan)
    measured = np.where(trace.judged, trace.measured[plot.y], np.nan)
    t = trace.over["t"]
    return beyond(t, trace.simulated[plot.y], plot.tolerance, t, measured)


def _over_time(plot: Plot, traces: Sequence[Trace], off: Sequence[FloatArray]) -> Judged:
    every = np.concatenate(off)
    good = np.isfinite(every)
    worst = max(_stretches(plot.y, traces, off), key=lambda w: _weight(w, plot), default=None)
    seconds = sum(float(np.isfinite(o).sum()) * t.step for t, o in zip(traces, off, strict=True))
    return Judged(plot, int(good.sum()), int((every[good] == 0.0).sum()), seconds, worst)


def _all_within(trace: Trace, off: Sequence[FloatArray]) -> BoolArray:
    """Blocks in which no signal is beyond. (m,)"""
    out = np.ones(trace.judged.shape, dtype=bool)
    for o in off:
        out &= ~(np.nan_to_num(o) != 0.0)
    return out


def _stretches(signal: str, traces: Sequence[Trace], off: Sequence[FloatArray]) -> list[Worst]:
    """Stretches beyond the boundaries, one each where short returns do not part them."""
    out = []
    for trace, o in zip(traces, off, strict=True):
        at = np.flatnonzero(np.nan_to_num(o) != 0.0)
        if not at.size:
            continue
        cuts = np.flatnonzero(np.diff(at) * trace.step > BRIDGED_S) + 1
        for part in np.split(at, cuts):
            peak = float(o[part[np.argmax(np.abs(o[part]))]])
            t = trace.over["t"]
            out.append(Worst(trace.name, signal, peak, float(t[part[0]]), float(t[part[-1]]) + trace.step))
    return out


def _weight(w: Worst, plot: Plot) -> float:
    """Peak over the tolerance, times the square root of the length: a spike does not go before a stretch."""
    scale = plot.tolerance.y_offset or 1.0
    return abs(w.by) / scale * math.sqrt(w.end_s - w.start_s)


# --- cross plots -----------------------------------------------------------------------------------------------------


def _cross(plot: Plot, traces: Sequence[Trace]) -> Judged | None:
    """Means over bins of x, of all drives: one curve of the simulation, and the measurement within its boundaries."""
    own = [t for t in traces if plot.y in t.measured and plot.x in t.over]
    if not own:
        return None
    three = ([t.over[plot.x] for t in own], [t.measured[plot.y] for t in own], [t.simulated[plot.y] for t in own])
    x, measured, shown = (np.concatenate([a[t.judged] for t, a in zip(own, x, strict=True)]) for x in three)
    good = np.isfinite(x) & np.isfinite(measured) & np.isfinite(shown)
    x, measured, shown = x[good], measured[good], shown[good]
    if x.size < 2 * LEAST_IN_BIN:
        return None
    low, high = np.quantile(x, [0.01, 0.99])
    # what the plot goes over must vary by more than its tolerance
    if not high - low > 4.0 * plot.tolerance.x_offset:
        return None
    at = np.clip(((x - low) / (high - low) * BINS).astype(int), 0, BINS - 1)
    n = np.bincount(at, minlength=BINS)
    full = n >= LEAST_IN_BIN
    mean_x, mean_m, mean_s = (np.bincount(at, w, BINS)[full] / n[full] for w in (x, measured, shown))
    off = beyond(mean_x, mean_s, plot.tolerance, mean_x, mean_m)
    seconds = float(n[full].sum()) * own[0].step
    return Judged(plot, off.size, int((off == 0.0).sum()), seconds, None, mean_x, mean_s, mean_m)


# --- limits and ratings ----------------------------------------------------------------------------------------------


def _limits(traces: Sequence[Trace], within: Sequence[BoolArray], agreed: float) -> tuple[Limit, ...]:
    """From which speed on the simulation is not valid, dry and on water."""
    out = []
    for name, wet in (("dry", False), ("on water", True)):
        at = [t.judged & (t.wet == wet) for t in traces]
        v = np.concatenate([t.over["v_x"][a] for t, a in zip(traces, at, strict=True)])
        bad = np.concatenate([~w[a] for w, a in zip(within, at, strict=True)])
        if v.size:
            out.append(_limit(name, v, bad, agreed, traces[0].step))
    return tuple(out)


def _limit(condition: str, v: FloatArray, bad: BoolArray, agreed: float, step: float) -> Limit:
    """The range of high speeds with the most time beyond what the agreed share allows."""
    order = np.argsort(v, kind="stable")
    v, bad = v[order], bad[order]
    tail = np.cumsum((bad.astype(np.float64) - (1.0 - agreed))[::-1])[::-1] * step
    i = int(np.argmax(tail))
    low, high, seconds = float(v[0]), float(v[-1]), v.size * step
    if v[i] - low < max(0.2 * (high - low), LEAST_VALID):
        i = 0  # what is left below is no range of its own
    if tail[i] < LEAST_BEYOND_S and 1.0 - bad.mean() >= agreed:
        return Limit(condition, math.nan, low, high, float(1.0 - bad.mean()), seconds)
    return Limit(condition, float(v[i]), low, high, float(1.0 - bad[i:].mean()), seconds)


def _rated(traces: Sequence[Trace]) -> tuple[Rated, ...]:
    """Ratings of the signals that move: of one that only rustles, phase and slope would be those of its noise.

    The measured curve alone says whether it moves: with tolerances of a plan or of repetitions, two models of one car
    would be rated on different stretches.
    """
    out = []
    least = {p.y: MOVES * p.tolerance.y_offset for p in PLOTS if p.x == "t"}
    for signal in SIGNALS:
        found, seconds = [], []
        for trace in (t for t in traces if signal in t.measured):
            a, b = trace.measured[signal], trace.simulated[signal]
            good = trace.judged & np.isfinite(a) & np.isfinite(b)
            edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(np.int8), [0]])))
            for i, j in _pieces(edges, round(LONGEST_S / trace.step)):
                if j - i >= LEAST_SAMPLES and np.ptp(a[i:j]) > least[signal]:
                    r = rating(a[i:j], b[i:j])
                    found.append((r.total, r.corridor, r.phase, r.magnitude, r.slope, r.late * trace.step))
                    seconds.append((j - i) * trace.step)
        if found:
            out.append(Rated(signal, sum(seconds), *np.average(found, axis=0, weights=seconds).tolist()))
    return tuple(out)


def _pieces(edges: NDArray[np.int64], most: int) -> list[tuple[int, int]]:
    """Stretches of the samples, long ones in even parts: the method is one for events of seconds."""
    out = []
    for i, j in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        cuts = np.linspace(i, j, max(1, -(-(j - i) // most)) + 1).round().astype(int).tolist()
        out += list(pairwise(cuts))
    return out
