"""Figure 3.7: the same with a minimum of differential traction; benefit and cost of excitation."""

from __future__ import annotations

import numpy as np

from aqualog.figures.record import (
    Axis,
    Figure,
    Finding,
    Line,
    Panel,
    Table,
    judged,
    seconds,
)
from aqualog.figures.study import RATE_HZ, SUV, Case, drive, estimate, is_used
from aqualog.figures.timeline import COLOURS, SLOPE, TIME, detection_time, estimate_lines, true_slope
from aqualog.model.excitation import force_rate, waveform

__all__ = ["make", "used_share"]

WAVES = ("triangle", "sine", "ramp", "step")
_SMOOTH = WAVES[:3]
_AMPLITUDE, _PERIOD = 250.0, 10.0  # [N], [s]
_END = 16.0
_LIMIT_MU = 0.2  # traction that excitation shall not reach (thesis 3.3)
_LIMIT_A = 0.01  # [m/s^2]
_SETTLED = -8.0  # [s] two seconds after the run began


def _case(wave: str, a_x: float = 1.0, nu: float = 0.6) -> Case:
    return Case(wave, _AMPLITUDE, "force", _PERIOD, a_x=a_x, nu=nu)


def used_share(case: Case) -> tuple[float, float]:
    """Shares of the samples of a run that update the slope, and in which the data determine it well enough to move."""
    e = estimate(case)
    return float(np.mean(is_used(e))), float(np.mean(e.status == 0.0))


def _rate(wave: str) -> float:
    return force_rate(wave, amplitude=_AMPLITUDE, period=_PERIOD)


def _jump(wave: str) -> float:
    """Largest change of the force from one sample to the next. [N]"""
    t = np.arange(0.0, 2.0 * _PERIOD, 1.0 / RATE_HZ)
    return float(_AMPLITUDE * np.abs(np.diff(waveform(wave, t, period=_PERIOD))).max())


def _left_over(wave: str) -> tuple[float, float]:
    """Remaining influence of the excitation on the acceleration, against the run without: before and after the change.
    [m/s²]"""
    d, plain = drive(_case(wave)), drive(_case(""))
    difference = np.abs(d.a_x - plain.a_x)
    before = (d.t >= _SETTLED) & (d.t < 0.0)
    return float(difference[before].max()), float(difference[d.t > 0.0].max())


def _most_traction(wave: str) -> float:
    d = drive(_case(wave))
    past = d.t >= _SETTLED
    return float(max(np.abs(d.mu_f[past]).max(), np.abs(d.mu_r[past]).max()))


def make() -> Figure:
    """Estimates with their idle spans; availability, comfort and the friction that is used."""
    times = {w: detection_time(_case(w)) for w in WAVES}
    idle = {w: 1.0 - used_share(_case(w))[0] for w in WAVES}
    has_idle = all(idle[w] > 0.02 for w in _SMOOTH)
    c105 = Finding(
        "C105",
        "The minimum of differential traction, needed with measured signals, makes spans without active estimation.",
        "under triangle, sine and ramp more than 2 % of the samples are not used; in part: under some",
        ", ".join(f"{w} {100 * idle[w]:.0f} %" for w in WAVES) + " of the samples idle; drop found after "
        + ", ".join(f"{seconds(times[w])}" for w in WAVES) + " s",
        judged(whole=has_idle, part=any(idle[w] > 0.02 for w in _SMOOTH)),
        value=min(idle[w] for w in _SMOOTH),
    )  # fmt: skip
    situations = {
        "blind split 0.6, constant speed": (0.0, 0.6),
        "blind split 0.6, 1 m/s^2": (1.0, 0.6),
        "split 0.3, constant speed": (0.0, 0.3),
    }
    shares = {n: (used_share(_case("", a, nu)), used_share(_case("sine", a, nu))) for n, (a, nu) in situations.items()}
    told = {n: (without[1], with_[1]) for n, (without, with_) in shares.items()}
    used = {n: (without[0], with_[0]) for n, (without, with_) in shares.items()}
    first = "blind split 0.6, constant speed"
    c96 = Finding(
        "C96",
        "Long constant speed or equal slip make a slope estimate impossible; excitation cures the availability.",
        "blind split at constant speed: less than 5 % of the samples used without excitation, more than 50 % with "
        "the sine; in part: more with it",
        "; ".join(
            f"{n}: used {100 * used[n][0]:.0f} -> {100 * used[n][1]:.0f} %, slope determined {100 * told[n][0]:.0f} -> "
            f"{100 * told[n][1]:.0f} %"
            for n in situations
        ),
        judged(whole=used[first][0] < 0.05 and used[first][1] > 0.5, part=used[first][1] > used[first][0]),
        "Determined: the last 20 s hold enough variation to separate slope and offset. Where load transfer or another "
        "split lifts the differential traction above the minimum, samples are used without excitation as well, but "
        "they all lie in one place: the slope stays as it was taken.",
        used[first][1] - used[first][0],
    )
    left = {w: _left_over(w) for w in WAVES}
    smooth_left = max(left[w][0] for w in _SMOOTH)
    c97 = Finding(
        "C97",
        "One axle gains what the other loses: the acceleration stays as the driver requested.",
        f"all four waveforms leave less than {_LIMIT_A:g} m/s² against the run without excitation, on the dry road; "
        "in part: all but the step",
        "dry: " + ", ".join(f"{w} {1e3 * left[w][0]:.1f}" for w in WAVES) + "e-3 m/s^2; after the change: "
        + ", ".join(f"{1e3 * left[w][1]:.1f}" for w in WAVES) + "e-3",
        judged(whole=max(left[w][0] for w in WAVES) < _LIMIT_A, part=smooth_left < _LIMIT_A),
        "That the sum stays is how the torques are made; the remainder is the wheels' inertia when their slips change, "
        "under the step a short blip.",
        smooth_left,
    )  # fmt: skip
    most = {w: _most_traction(w) for w in WAVES}
    c99 = Finding(
        "C99",
        "Amplitude and rate stay so small that passengers feel nothing and the friction is not used critically (mu "
        "<= 0.2).",
        f"largest traction coefficient of both axles at most {_LIMIT_MU} under every waveform at 1 m/s², "
        "and a passenger to ask; in part: the first only",
        ", ".join(f"{w} {most[w]:.3f}" for w in WAVES) + f"; on the low surface {max(most.values()) / 0.4:.0%} of its "
        "friction",
        # the first half of the claim is out of reach here, so that the second alone cannot bear it out
        judged(whole=False, part=max(most.values()) <= _LIMIT_MU),
        "No simulation can show whether passengers feel it: C107 gives the rates.",
        max(most.values()),
    )  # fmt: skip
    jumps = {w: _jump(w) for w in WAVES}
    ratio = jumps["step"] / max(jumps[w] for w in _SMOOTH)
    blip = left["step"][0] / max(smooth_left, 1e-9)
    c107 = Finding(
        "C107",
        "The step is at its maximum at once; its torque jump can be felt, loads the drive train and may pass the "
        "friction.",
        "force changes within one sample by more than 10 times what the others do, and more acceleration is left "
        "over than by any of them; in part: the first only",
        f"step: jump of 2 A = {jumps['step']:.0f} N ({jumps['step'] * SUV.r_l_f:.0f} N m per axle) in one sample; "
        "others "
        + ", ".join(f"{w} {_rate(w):.0f} N/s" for w in _SMOOTH)
        + f"; acceleration left over {blip:.0f} times as large",
        judged(whole=ratio > 10.0 and blip > 1.0, part=ratio > 10.0),
        "Peak forces are the same under all waveforms, so that the step passes the friction only by the wheels' "
        "overshoot; here nothing slides.",
        ratio,
    )
    lines: list[Line] = []
    for w, c in zip(WAVES, COLOURS, strict=False):
        lines += estimate_lines(w, _case(w), colour=c, t_end=_END, is_split=True)
    forces: list[Line] = []
    for w, c in zip(WAVES, COLOURS, strict=False):
        d = drive(_case(w))
        span = (d.t >= -2.0) & (d.t <= _END)
        forces.append(Line(w, d.t[span], _AMPLITUDE * waveform(w, d.t[span], period=_PERIOD), colour=c))
    return Figure(
        "3.7",
        "slope estimates with a minimum of differential traction",
        "Excitation of 250 N and 10 s at 1 m/s²; samples below a differential traction of 0.01 are not used. Thin "
        "and light: not estimating.",
        (
            Panel("Estimated slope", TIME, SLOPE, (*lines, true_slope(_END))),
            Panel("Excitation force of the front axle", TIME, Axis("F_exc", "N"), tuple(forces)),
        ),
        (c105, c96, c97, c99, c107),
        (
            Table(
                "Availability: share of the samples of a run (30 s) that are used, and that determine the slope",
                ("situation", "used, without [%]", "used, sine [%]", "determined, without [%]", "determined, sine [%]"),
                tuple(
                    (n, f"{100 * used[n][0]:.0f}", f"{100 * used[n][1]:.0f}", f"{100 * told[n][0]:.0f}",
                     f"{100 * told[n][1]:.0f}")
                    for n in situations
                ),
            ),
            Table(
                "Comfort",
                ("waveform", "largest rate [N/s]", "change in 10 ms [N]", "left in a_x, dry [1e-3 m/s^2]",
                 "largest traction [-]"),
                tuple(
                    (w, "jump" if np.isinf(r := _rate(w)) else f"{r:.0f}", f"{jumps[w]:.1f}",
                     f"{1e3 * left[w][0]:.2f}", f"{most[w]:.3f}")
                    for w in WAVES
                ),
            ),
        ),
    )  # fmt: skip
