"""Figures 3.6 to 3.8: four waveforms of excitation, their estimates, cost and data."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from aqualog.core.records import BoolArray, FloatArray
from aqualog.detect.slip_slope.tuning import TUNING
from aqualog.model.excitation import force_rate, waveform
from aqualog.thesis.catalogue import figure_of
from aqualog.thesis.claims import Check, judge, limit, limits
from aqualog.thesis.evidence.half_car import GATE_OFF, RATE_HZ, SUV, Case, drive, estimate, inputs, is_used, slope_at
from aqualog.thesis.figures.brush_curves import TRACTION
from aqualog.thesis.figures.timeline import (
    COLOURS,
    TIME,
    detected_s,
    false_alarms_of,
    settled_slopes,
    slope_panel,
    tangent_table,
)
from aqualog.thesis.record import Axis, Figure, Line, Panel, Table, seconds

__all__ = ["FIGURES"]

WAVES = ("triangle", "sine", "ramp", "step")
PHASES = int(limit("phases", "C104.figure_phase"))
_STYLES = {w: (c, "solid") for w, c in zip(WAVES, COLOURS, strict=False)}
_END = 12.0  # [s] of what is drawn
_STEP_RANGE = limits("step_range")  # [s] "approximately 1 s"
_OTHERS = limit("others")  # [s] "above 2 s"


def _case(wave: str, a_x: float) -> Case:
    return Case(wave, 250.0, "force", 8.0, a_x=a_x, tuning=GATE_OFF)


def _c104_phase() -> tuple[Check, Table]:
    times = {w: [detected_s(replace(_case(w, 1.0), phase=k / PHASES)) for k in range(PHASES)] for w in WAVES}
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
    times = {w: detected_s(_case(w, 1.0)) for w in WAVES}
    still = {w: detected_s(_case(w, 0.0)) for w in WAVES}
    false = false_alarms_of(_case(w, a) for w in WAVES for a in (0.0, 1.0))
    step, ramp, others = times["step"], times["ramp"], [times["triangle"], times["sine"]]
    in_order = step < ramp < min(others)
    mu, slope, estimated = settled_slopes(_case("sine", 1.0))
    constant = _case("sine", 0.0)
    d, e = drive(constant), estimate(constant)
    # largest prediction error of the sine that a slope of 30 would show in the first half period
    swing = float(np.nanmax(np.abs(e.innovation[(d.t > 0.0) & (d.t <= 0.5 * constant.period)])))
    outcome = (
        "at 1 m/s^2 "
        + ", ".join(f"{w} {seconds(times[w])} s" for w in ("step", "ramp", "sine", "triangle"))
        + "; at constant speed "
        + ", ".join(f"{w} {seconds(still[w])}" for w in ("step", "ramp", "sine", "triangle"))
        + f"; false alarms before the change: {false}"
    )
    whole = in_order and _STEP_RANGE[0] <= step <= _STEP_RANGE[1] and ramp > _OTHERS
    fields = {"swing": 1e3 * swing, "drift": 1e3 * TUNING.zeta, "late": slope_at(d, e, _END), "end": _END,
              "slope": slope, "mu": mu, "estimated": estimated}  # fmt: skip
    value = None if np.isnan(step) else step
    c104 = judge("C104.figure", outcome, whole=whole, part=in_order, value=value, fields=fields)
    by_phase, phases = _c104_phase()
    panels = [
        slope_panel(f"Estimated slope, {title}", {w: (_case(w, a), *s) for w, s in _STYLES.items()}, t_end=_END)
        for a, title in ((1.0, "1 m/s²"), (0.0, "constant speed, 20 m/s"))
    ]
    found = {f"{w}, {a:g} m/s^2": _case(w, a) for a, t in ((1.0, times), (0.0, still)) for w in WAVES if t[w] == t[w]}
    return figure_of("3.6", panels, (c104, by_phase), (phases, tangent_table(found)))


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


@dataclass(frozen=True, slots=True)
class _Felt:
    """What passengers may feel of a waveform, against the run without excitation.

    `rate` of the force [N/s], infinite at a jump; `jump` its largest change in one sample [N]; `dry` and `after` the
    largest change of the acceleration before and after the surface's [m/s²]; `v` [km/h] and `a` [m/s²] the largest
    change of the velocity and of its mean slope on the dry road; `mu` the largest traction coefficient [-].
    """

    rate: float
    jump: float
    dry: float
    after: float
    v: float
    a: float
    mu: float


def felt_of(wave: str) -> _Felt:
    """What passengers may feel of a waveform."""
    t = np.arange(0.0, 2.0 * _GATED_PERIOD, 1.0 / RATE_HZ)
    d, plain = drive(_gated(wave)), drive(_gated(""))
    change, past, dry = d.a_x - plain.a_x, d.t >= _SETTLED, d.t < 0.0
    return _Felt(
        force_rate(wave, amplitude=_AMPLITUDE, period=_GATED_PERIOD),
        float(_AMPLITUDE * np.abs(np.diff(waveform(wave, t, period=_GATED_PERIOD))).max()),
        float(np.abs(change)[past & dry].max()),
        float(np.abs(change)[d.t > 0.0].max()),
        3.6 * float(np.abs(d.v_x - plain.v_x)[dry].max()),
        abs(float(change[dry].mean())),
        float(max(np.abs(d.mu_f[past]).max(), np.abs(d.mu_r[past]).max())),
    )


_SITUATIONS = {
    "blind split 0.6, constant speed": (0.0, 0.6),
    "blind split 0.6, 1 m/s^2": (1.0, 0.6),
    "split 0.3, constant speed": (0.0, 0.3),
}


def _c105() -> Check:
    times = {w: detected_s(_gated(w)) for w in WAVES}
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
    felt = {w: felt_of(w) for w in WAVES}
    step, smooth = felt["step"], [felt[w] for w in _SMOOTH]
    largest = max(f.mu for f in felt.values())
    ratio, blip = step.jump / max(f.jump for f in smooth), step.dry / max(*(f.dry for f in smooth), 1e-9)
    used = ", ".join(f"{w} {f.mu:.3f}" for w, f in felt.items())
    used += f"; on the low surface {largest / 0.4:.0%} of its friction"
    jumped = (
        f"step: jump of 2 A = {step.jump:.0f} N ({step.jump * SUV.r_l_f:.0f} N m per axle) in one sample; others "
        + ", ".join(f"{w} {felt[w].rate:.0f} N/s" for w in _SMOOTH)
        + f"; acceleration left over {blip:.0f} times as large"
    )
    holds = {w: f.v < _LIMIT_V and f.a < _LIMIT_A for w, f in felt.items()}
    kept = (
        f"velocity within {', '.join(f'{w} {f.v:.3f}' for w, f in felt.items())} km/h, mean acceleration within "
        f"{max(f.a for f in felt.values()):.4f} m/s²; at one moment at most "
        + ", ".join(f"{w} {1e3 * f.dry:.1f}" for w, f in felt.items())
        + f"e-3 m/s², after the change {', '.join(f'{1e3 * f.after:.1f}' for f in felt.values())}e-3"
    )
    most = max(f.v for f in felt.values())
    checks = [
        judge("C97.figure", kept, whole=all(holds.values()), part=all(holds[w] for w in _SMOOTH), value=most),
        # the first half of the claim is out of reach here, so that the second alone cannot reproduce it
        judge("C99.figure", used, part=largest <= _LIMIT_MU, value=largest),
        judge("C107.figure", jumped, whole=ratio > 10.0 and blip > 1.0, part=ratio > 10.0, value=ratio),
    ]
    table = Table(
        "Comfort",
        ("waveform", "largest rate [N/s]", "change in 10 ms [N]", "left in a_x, dry [1e-3 m/s^2]",
         "largest traction [-]"),
        tuple(
            (w, "jump" if np.isinf(f.rate) else f"{f.rate:.0f}", f"{f.jump:.1f}", f"{1e3 * f.dry:.2f}", f"{f.mu:.3f}")
            for w, f in felt.items()
        ),
    )  # fmt: skip
    return checks, table


def figure_3_07() -> Figure:
    """Estimates with their idle spans; availability, comfort and the friction that is used."""
    c96, availability = _c96()
    felt, comfort = _comfort()
    forces = []
    for w, (colour, _) in _STYLES.items():
        t = drive(_gated(w)).t
        t = t[(t >= -2.0) & (t <= _GATED_END)]
        forces.append(Line(w, t, _AMPLITUDE * waveform(w, t, period=_GATED_PERIOD), colour=colour))
    cases = {w: (_gated(w), *s) for w, s in _STYLES.items()}
    panels = (
        slope_panel("Estimated slope", cases, t_end=_GATED_END, is_split=True),
        Panel("Excitation force of the front axle", TIME, Axis("F_exc", "N"), tuple(forces)),
    )
    return figure_of("3.7", panels, (_c105(), c96, *felt), (availability, comfort))


_PERIOD = 8.0
_BINS = 24  # per axis
_EXTREME = limit("extreme", "C106.figure")  # of the largest deviation from the mean
_STARTS = {"slope 30": -_PERIOD, "slope 10": _PERIOD}  # [s]; on the low surface the second period: wheels have settled


def _points(wave: str) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Time, front slip, differential slip and traction of a run, (n,)."""
    case = Case(wave, 250.0, "force", _PERIOD, a_x=1.0, tuning=GATE_OFF)
    d = drive(case)
    s_delta, mu_i, rho_mu_j = inputs(d, case.car)
    return d.t, d.s_f, s_delta, mu_i - rho_mu_j


def _period_from(t: FloatArray, start: float) -> BoolArray:
    return (t >= start - 1e-9) & (t < start + _PERIOD - 1e-9)


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
    for (name, start), colour in zip(_STARTS.items(), COLOURS, strict=False):
        where = _period_from(t, start)
        x, y, z, count = _binned(100.0 * s_f[where], 100.0 * s_delta[where], mu_delta[where])
        lines.append(Line(name, x, y, z=z, count=count, colour=colour, mode="markers", group=name))
        walls = (_LIMITS[0][1], _LIMITS[1][1], _LIMITS[2][0])
        for k, (axis, wall) in enumerate(zip(("s_F", "s_delta", TRACTION.label), walls, strict=True)):
            flat = [x, y, z]
            flat[k] = np.full_like(x, wall)
            lines.append(
                Line(f"{name}, projected on {axis}", flat[0], flat[1], z=flat[2], count=count, colour=colour,
                     mode="markers", opacity=0.25, group=name, in_legend=False)
            )  # fmt: skip
    slip, differential = (Axis(n, "%", limits=r) for n, r in zip(("s_F", "s_delta"), _LIMITS, strict=False))
    return Panel(wave, slip, differential, tuple(lines), Axis(TRACTION.label, limits=_LIMITS[2]))


def figure_3_08() -> Figure:
    """Clouds of four waveforms, with the distribution over the differential traction."""
    shares: dict[str, dict[str, float]] = {name: {} for name in _STARTS}
    lines = []
    edges = np.linspace(0.0, 1.0, 21)
    for wave, colour in zip(WAVES, COLOURS, strict=False):
        t, _, _, mu_delta = _points(wave)
        for name, start in _STARTS.items():
            shares[name][wave] = extreme_share(mu_delta[_period_from(t, start)])
        dry = mu_delta[_period_from(t, -_PERIOD)]
        away = np.abs(dry - dry.mean())
        count, _ = np.histogram(away / away.max(), bins=edges)
        lines.append(Line(wave, 0.5 * (edges[1:] + edges[:-1]), 100.0 * count / away.size, colour=colour,
                          mode="lines+markers"))  # fmt: skip
    in_order = [
        s["triangle"] < min(s["sine"], s["ramp"]) and max(s["sine"], s["ramp"]) < s["step"] for s in shares.values()
    ]
    outcome = "; ".join(f"{n}: " + ", ".join(f"{w} {100 * x:.0f} %" for w, x in s.items()) for n, s in shares.items())
    high, low = shares.values()
    c106 = judge("C106.figure", outcome, whole=all(in_order), part=any(in_order), value=high["sine"] / high["triangle"])
    away_axis, share_axis = Axis("|mu_delta - mean| over its maximum"), Axis("share of the samples", "%")
    spread = Panel("Distribution over the differential traction, dry", away_axis, share_axis, tuple(lines))
    ideal = dict(zip(WAVES, (0.1, 1.0 - 2.0 / np.pi * np.arcsin(0.9), 0.4, 1.0), strict=True))
    table = Table(
        "Share of the samples at the extremes [%]",
        ("waveform", *shares, "by hand, without the wheels' response"),
        tuple((w, *(f"{100 * x[w]:.1f}" for x in (high, low, ideal))) for w in WAVES),
    )
    return figure_of("3.8", (*(_cloud(w) for w in WAVES), spread), (c106,), (table,))


FIGURES = {"3.6": figure_3_06, "3.7": figure_3_07, "3.8": figure_3_08}
