"""Figures 3.6 to 3.8: four waveforms of excitation, their estimates, cost and data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aqualog.core.records import BoolArray, FloatArray
from aqualog.detect.slip_slope.tuning import TUNING
from aqualog.model.excitation import force_rate, waveform
from aqualog.thesis.catalogue import figure_of
from aqualog.thesis.claims import Check, judge, limit, limits
from aqualog.thesis.evidence.half_car import GATE_OFF, RATE_HZ, SUV, Case, drive, estimate, inputs, is_used
from aqualog.thesis.figures.splits import TRACTION
from aqualog.thesis.figures.timeline import (
    COLOURS,
    SLOPE,
    TIME,
    detection_time,
    estimate_lines,
    false_alarms_of,
    settled_slopes,
    slope_after,
    tangent_table,
    true_slope,
)
from aqualog.thesis.record import Axis, Figure, Line, Panel, Table, seconds

__all__ = ["FIGURES"]

WAVES = ("triangle", "sine", "ramp", "step")
PHASES = int(limit("phases", "C104.figure_phase"))
_END = 12.0  # [s] of what is drawn
_STEP_RANGE = limits("step_range")  # [s] "approximately 1 s"
_OTHERS = limit("others")  # [s] "above 2 s"


def _case(wave: str, a_x: float) -> Case:
    return Case(wave, 250.0, "force", 8.0, a_x=a_x, tuning=GATE_OFF)


def phase_times(wave: str) -> list[float]:
    """Detection times at 1 m/s² with the change at eight phases of the excitation. [s]"""
    return [detection_time(replace(_case(wave, 1.0), phase=k / PHASES)) for k in range(PHASES)]


def _c104_phase() -> tuple[Check, Table]:
    times = {w: phase_times(w) for w in WAVES}
    mean = {w: float(np.mean(t)) for w, t in times.items()}  # NaN if a drop was not found
    in_order = mean["step"] < mean["ramp"] < min(mean["triangle"], mean["sine"])
    outcome = "mean (shortest to longest) at 1 m/s²: " + ", ".join(
        f"{w} {mean[w]:.2f} ({min(times[w]):.2f} to {max(times[w]):.2f}) s" for w in reversed(WAVES)
    )
    value = None if np.isnan(mean["step"]) else mean["step"]
    whole = in_order and _STEP_RANGE[0] <= mean["step"] <= _STEP_RANGE[1] and mean["ramp"] > _OTHERS
    finding = judge("C104.figure_phase", outcome, whole=whole, part=in_order, value=value)
    table = Table(
        "Detection time [s] at 1 m/s² over the phase at the change",
        ("phase [period]", *WAVES),
        tuple((f"{k}/{PHASES}", *(seconds(times[w][k]) for w in WAVES)) for k in range(PHASES)),
    )
    return finding, table


def figure_3_06() -> Figure:
    """Estimates at 1 m/s² (caption) and at constant speed (text, E20)."""
    times = {w: detection_time(_case(w, 1.0)) for w in WAVES}
    still = {w: detection_time(_case(w, 0.0)) for w in WAVES}
    false = false_alarms_of(_case(w, a) for w in WAVES for a in (0.0, 1.0))
    step, ramp, others = times["step"], times["ramp"], [times["triangle"], times["sine"]]
    in_order = step < ramp < min(others)
    mu, slope, estimated = settled_slopes(_case("sine", 1.0))
    swing = _swing(0.0)
    late = slope_after(_case("sine", 0.0), _END)
    outcome = (
        "at 1 m/s^2 "
        + ", ".join(f"{w} {seconds(times[w])} s" for w in ("step", "ramp", "sine", "triangle"))
        + "; at constant speed "
        + ", ".join(f"{w} {seconds(still[w])}" for w in ("step", "ramp", "sine", "triangle"))
        + f"; false alarms before the change: {false}"
    )
    whole = in_order and _STEP_RANGE[0] <= step <= _STEP_RANGE[1] and ramp > _OTHERS
    fields = {
        "swing": 1e3 * swing,
        "drift": 1e3 * TUNING.zeta,
        "late": late,
        "end": _END,
        "slope": slope,
        "mu": mu,
        "estimated": estimated,
    }
    c104 = judge(
        "C104.figure", outcome, whole=whole, part=in_order, value=None if np.isnan(step) else step, fields=fields
    )
    by_phase, phases = _c104_phase()
    panels = []
    for a_x, title in ((1.0, "1 m/s²"), (0.0, "constant speed, 20 m/s")):
        lines: list[Line] = []
        for w, c in zip(WAVES, COLOURS, strict=False):
            lines += estimate_lines(w, _case(w, a_x), colour=c, t_end=_END)
        panels.append(Panel(f"Estimated slope, {title}", TIME, SLOPE, (*lines, true_slope(_END))))
    return figure_of(
        "3.6",
        tuple(panels),
        (c104, by_phase),
        (
            phases,
            tangent_table(
                {
                    f"{w}, {a:g} m/s^2": _case(w, a)
                    for a, t in ((1.0, times), (0.0, still))
                    for w in WAVES
                    if not np.isnan(t[w])
                }
            ),
        ),
    )


def _swing(a_x: float) -> float:
    """Largest prediction error of the sine that a slope of 30 would show in the first half period. [-]"""
    case = _case("sine", a_x)
    d, e = drive(case), estimate(case)
    first = (d.t > 0.0) & (d.t <= 0.5 * case.period)
    return float(np.nanmax(np.abs(e.innovation[first])))


_SMOOTH = WAVES[:3]
_AMPLITUDE, _GATED_PERIOD = 250.0, 10.0  # [N], [s]
_GATED_END = 16.0
_LIMIT_MU = limit("limit_mu", "C99.figure")  # traction that excitation shall not reach (thesis 3.3)
_LIMIT_A, _LIMIT_V = limit("limit_a", "C97.figure"), limit("limit_v", "C97.figure")  # [m/s^2], [km/h]
_SETTLED = -8.0  # [s] two seconds after the run began


def _gated(wave: str, a_x: float = 1.0, nu: float = 0.6) -> Case:
    return Case(wave, _AMPLITUDE, "force", _GATED_PERIOD, a_x=a_x, nu=nu)


def used_share(case: Case) -> tuple[float, float]:
    """Shares of the samples of a run that update the slope, and in which the data determine it well enough to move."""
    e = estimate(case)
    return float(np.mean(is_used(e))), float(np.mean(e.status == 0.0))


def _rate(wave: str) -> float:
    return force_rate(wave, amplitude=_AMPLITUDE, period=_GATED_PERIOD)


def _jump(wave: str) -> float:
    """Largest change of the force from one sample to the next. [N]"""
    t = np.arange(0.0, 2.0 * _GATED_PERIOD, 1.0 / RATE_HZ)
    return float(_AMPLITUDE * np.abs(np.diff(waveform(wave, t, period=_GATED_PERIOD))).max())


def _left_over(wave: str) -> tuple[float, float]:
    """Remaining influence of the excitation on the acceleration, against the run without: before and after the change.
    [m/s²]"""
    d, plain = drive(_gated(wave)), drive(_gated(""))
    difference = np.abs(d.a_x - plain.a_x)
    before = (d.t >= _SETTLED) & (d.t < 0.0)
    return float(difference[before].max()), float(difference[d.t > 0.0].max())


def _drift(wave: str) -> tuple[float, float]:
    """Largest change of the velocity [km/h] and of its mean slope [m/s²] against the run without, on the dry road."""
    d, plain = drive(_gated(wave)), drive(_gated(""))
    dry = d.t < 0.0
    return 3.6 * float(np.abs(d.v_x - plain.v_x)[dry].max()), abs(float((d.a_x - plain.a_x)[dry].mean()))


def _most_traction(wave: str) -> float:
    d = drive(_gated(wave))
    past = d.t >= _SETTLED
    return float(max(np.abs(d.mu_f[past]).max(), np.abs(d.mu_r[past]).max()))


_SITUATIONS = {
    "blind split 0.6, constant speed": (0.0, 0.6),
    "blind split 0.6, 1 m/s^2": (1.0, 0.6),
    "split 0.3, constant speed": (0.0, 0.3),
}


def _c105() -> Check:
    times = {w: detection_time(_gated(w)) for w in WAVES}
    idle = {w: 1.0 - used_share(_gated(w))[0] for w in WAVES}
    is_idle = [idle[w] > 0.02 for w in _SMOOTH]
    shares = ", ".join(f"{w} {100 * idle[w]:.0f} %" for w in WAVES)
    found = ", ".join(seconds(times[w]) for w in WAVES)
    outcome = f"{shares} of the samples idle; drop found after {found} s"
    return judge("C105.figure", outcome, whole=all(is_idle), part=any(is_idle), value=min(idle[w] for w in _SMOOTH))


def _c96() -> tuple[Check, Table]:
    """Shares of the samples that are used, and that determine the slope, without and with the sine. [%]"""
    rows = {}
    for name, (a, nu) in _SITUATIONS.items():
        plain, sine = used_share(_gated("", a, nu)), used_share(_gated("sine", a, nu))
        rows[name] = [100.0 * x for x in (plain[0], sine[0], plain[1], sine[1])]
    outcome = "; ".join(
        "{}: used {:.0f} -> {:.0f} %, slope determined {:.0f} -> {:.0f} %".format(n, *r) for n, r in rows.items()
    )
    without, with_ = rows["blind split 0.6, constant speed"][:2]
    more = 0.01 * with_ - 0.01 * without
    table = Table(
        "Availability: share of the samples of a run (30 s) that are used, and that determine the slope",
        ("situation", "used, without [%]", "used, sine [%]", "determined, without [%]", "determined, sine [%]"),
        tuple((n, *(f"{x:.0f}" for x in r)) for n, r in rows.items()),
    )
    return judge("C96.figure", outcome, whole=without < 5.0 and with_ > 50.0, part=with_ > without, value=more), table


def _comfort() -> tuple[list[Check], Table]:
    """C97, C99 and C107, with what passengers may feel of each waveform."""
    left = {w: _left_over(w) for w in WAVES}
    most = {w: _most_traction(w) for w in WAVES}
    jumps = {w: _jump(w) for w in WAVES}
    smooth_left = max(left[w][0] for w in _SMOOTH)
    largest = max(most.values())
    ratio, blip = jumps["step"] / max(jumps[w] for w in _SMOOTH), left["step"][0] / max(smooth_left, 1e-9)
    dry, after = (", ".join(f"{n}{1e3 * left[w][k]:.1f}" for w, n in zip(WAVES, names, strict=True))
                  for k, names in ((0, [f"{w} " for w in WAVES]), (1, [""] * len(WAVES))))  # fmt: skip
    used = ", ".join(f"{w} {x:.3f}" for w, x in most.items())
    used += f"; on the low surface {largest / 0.4:.0%} of its friction"
    others = ", ".join(f"{w} {_rate(w):.0f} N/s" for w in _SMOOTH)
    felt = (
        f"step: jump of 2 A = {jumps['step']:.0f} N ({jumps['step'] * SUV.r_l_f:.0f} N m per axle) in one sample; "
        f"others {others}; acceleration left over {blip:.0f} times as large"
    )
    drift = {w: _drift(w) for w in WAVES}
    holds = {w: v < _LIMIT_V and a < _LIMIT_A for w, (v, a) in drift.items()}
    kept = (
        f"velocity within {', '.join(f'{w} {v:.3f}' for w, (v, _) in drift.items())} km/h, mean acceleration within "
        f"{max(a for _, a in drift.values()):.4f} m/s²; at one moment at "
        f"most {dry}e-3 m/s², after the change {after}e-3"
    )
    smooth = all(holds[w] for w in _SMOOTH)
    checks = [
        judge("C97.figure", kept, whole=all(holds.values()), part=smooth, value=max(v for v, _ in drift.values())),
        # the first half of the claim is out of reach here, so that the second alone cannot reproduce it
        judge("C99.figure", used, part=largest <= _LIMIT_MU, value=largest),
        judge("C107.figure", felt, whole=ratio > 10.0 and blip > 1.0, part=ratio > 10.0, value=ratio),
    ]
    table = Table(
        "Comfort",
        ("waveform", "largest rate [N/s]", "change in 10 ms [N]", "left in a_x, dry [1e-3 m/s^2]",
         "largest traction [-]"),
        tuple(
            (w, "jump" if np.isinf(r := _rate(w)) else f"{r:.0f}", f"{jumps[w]:.1f}", f"{1e3 * left[w][0]:.2f}",
             f"{most[w]:.3f}") for w in WAVES
        ),
    )  # fmt: skip
    return checks, table


def figure_3_07() -> Figure:
    """Estimates with their idle spans; availability, comfort and the friction that is used."""
    c96, availability = _c96()
    felt, comfort = _comfort()
    lines: list[Line] = []
    forces: list[Line] = []
    for w, c in zip(WAVES, COLOURS, strict=False):
        lines += estimate_lines(w, _gated(w), colour=c, t_end=_GATED_END, is_split=True)
        d = drive(_gated(w))
        span = (d.t >= -2.0) & (d.t <= _GATED_END)
        forces.append(Line(w, d.t[span], _AMPLITUDE * waveform(w, d.t[span], period=_GATED_PERIOD), colour=c))
    panels = (
        Panel("Estimated slope", TIME, SLOPE, (*lines, true_slope(_GATED_END))),
        Panel("Excitation force of the front axle", TIME, Axis("F_exc", "N"), tuple(forces)),
    )
    return figure_of("3.7", panels, (_c105(), c96, *felt), (availability, comfort))


_PERIOD = 8.0
_BINS = 24  # per axis
_EXTREME = limit("extreme", "C106.figure")  # of the largest deviation from the mean


def _points(wave: str) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Time, front slip, differential slip and traction of a run, (n,)."""
    case = Case(wave, 250.0, "force", _PERIOD, a_x=1.0, tuning=GATE_OFF)
    d = drive(case)
    s_delta, mu_i, rho_mu_j = inputs(d, case.car)
    return d.t, d.s_f, s_delta, mu_i - rho_mu_j


def _dry(t: FloatArray) -> BoolArray:
    return (t >= -_PERIOD - 1e-9) & (t < -1e-9)


def _low(t: FloatArray) -> BoolArray:
    # the second period on the low surface: the wheels have settled
    return (t >= _PERIOD - 1e-9) & (t < 2.0 * _PERIOD - 1e-9)


def extreme_share(mu_delta: FloatArray) -> float:
    """Share of the samples further from the mean than 0.9 of the largest distance."""
    away = np.abs(mu_delta - mu_delta.mean())
    return float(np.mean(away > _EXTREME * away.max()))


def _binned(x: FloatArray, y: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Means and counts of the samples in each occupied cell of a grid over all three axes."""
    points = np.column_stack((x, y, z))
    low, high = points.min(axis=0), points.max(axis=0)
    cells = np.minimum((_BINS * (points - low) / np.maximum(high - low, 1e-12)).astype(np.int64), _BINS - 1)
    _, inverse, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    inverse = inverse.ravel()
    means = [np.bincount(inverse, weights=points[:, k]) / count for k in range(3)]
    return means[0], means[1], means[2], count.astype(np.float64)


_LIMITS = ((0.2, 2.0), (-0.5, 0.8), (-0.04, 0.06))  # front slip [%], differential slip [%] and traction


def _cloud(wave: str) -> Panel:
    t, s_f, s_delta, mu_delta = _points(wave)
    lines = []
    for name, where, colour in (("slope 30", _dry(t), COLOURS[0]), ("slope 10", _low(t), COLOURS[1])):
        x, y, z, count = _binned(100.0 * s_f[where], 100.0 * s_delta[where], mu_delta[where])
        lines.append(Line(name, x, y, z=z, count=count, colour=colour, mode="markers", group=name))
        for k, (shadow, wall) in enumerate(
            (("projected on s_F", _LIMITS[0][1]), ("projected on s_delta", _LIMITS[1][1]),
             ("projected on mu_delta", _LIMITS[2][0]))
        ):  # fmt: skip
            flat = [x, y, z]
            flat[k] = np.full_like(x, wall)
            lines.append(
                Line(f"{name}, {shadow}", flat[0], flat[1], z=flat[2], count=count, colour=colour, mode="markers",
                     opacity=0.25, group=name, in_legend=False)
            )  # fmt: skip
    return Panel(
        wave,
        Axis("s_F", "%", limits=_LIMITS[0]),
        Axis("s_delta", "%", limits=_LIMITS[1]),
        tuple(lines),
        Axis(TRACTION.label, limits=_LIMITS[2]),
    )


def figure_3_08() -> Figure:
    """Clouds of four waveforms, with the distribution over the differential traction."""
    dry, low = {}, {}
    lines = []
    edges = np.linspace(0.0, 1.0, 21)
    for wave, colour in zip(WAVES, COLOURS, strict=False):
        t, _, _, mu_delta = _points(wave)
        dry[wave], low[wave] = extreme_share(mu_delta[_dry(t)]), extreme_share(mu_delta[_low(t)])
        away = np.abs(mu_delta[_dry(t)] - mu_delta[_dry(t)].mean())
        share, _ = np.histogram(away / away.max(), bins=edges)
        lines.append(Line(wave, 0.5 * (edges[1:] + edges[:-1]), 100.0 * share / away.size, colour=colour,
                          mode="lines+markers"))  # fmt: skip
    in_order = [s["triangle"] < min(s["sine"], s["ramp"]) and max(s["sine"], s["ramp"]) < s["step"] for s in (dry, low)]
    outcome = "; ".join(
        f"{name}: " + ", ".join(f"{w} {100 * s[w]:.0f} %" for w in WAVES)
        for name, s in (("slope 30", dry), ("slope 10", low))
    )
    c106 = judge("C106.figure", outcome, whole=all(in_order), part=any(in_order), value=dry["sine"] / dry["triangle"])
    return figure_of(
        "3.8",
        (
            *(_cloud(w) for w in WAVES),
            Panel(
                "Distribution over the differential traction, dry",
                Axis("|mu_delta - mean| over its maximum"),
                Axis("share of the samples", "%"),
                tuple(lines),
            ),
        ),
        (c106,),
        (
            Table(
                "Share of the samples at the extremes [%]",
                ("waveform", "slope 30", "slope 10", "by hand, without the wheels' response"),
                tuple(
                    (w, f"{100 * dry[w]:.1f}", f"{100 * low[w]:.1f}", f"{100 * ideal:.1f}")
                    for w, ideal in zip(WAVES, (0.1, 1.0 - 2.0 / np.pi * np.arcsin(0.9), 0.4, 1.0), strict=True)
                ),
            ),
        ),
    )


FIGURES = {"3.6": figure_3_06, "3.7": figure_3_07, "3.8": figure_3_08}
