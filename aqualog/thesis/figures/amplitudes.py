"""Figure 3.10: excitation in proportion to the axle forces, or as a traction coefficient."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aqualog.thesis.catalogue import figure_of
from aqualog.thesis.claims import DIFFERENCE, Check, Verdict, judge, judged, limits
from aqualog.thesis.evidence.half_car import LOW_SLOPE, SUV, Case, drive
from aqualog.thesis.figures.timeline import (
    COLOURS,
    SLOPE,
    TIME,
    detection_time,
    estimate_lines,
    is_falling,
    listed,
    settled_slopes,
    slope_after,
    tangent_table,
    true_slope,
)
from aqualog.thesis.record import Figure, Line, Panel, Table, seconds

__all__ = ["FIGURES"]

RELATIVE, RELATIVE_A = (0.2, 0.4, 0.6, 0.8), (0.5, 1.0, 1.5)
MU, MU_A = (0.01, 0.03, 0.05, 0.07), (0.0, 0.5, 1.0)
WAVES = ("triangle", "sine")
_DASHES = ("dot", "dash", "solid")
_END = 10.0
_RANGE = limits("range", "C113.figure")  # [s] "just 1 s"
_RIGID_MU = 1e3  # friction with which the brush is a straight line


def cases(wave: str, kind: str) -> dict[tuple[float, float], Case]:
    """Runs by amplitude and acceleration."""
    amplitudes, accelerations = (RELATIVE, RELATIVE_A) if kind == "relative" else (MU, MU_A)
    return {(A, a): Case(wave, A, kind, 8.0, a_x=a) for A in amplitudes for a in accelerations}


def _both(verdicts: dict[str, Verdict]) -> Verdict:
    """Verdict over both waveforms, since the thesis does not name the one it shows: in part where they differ."""
    found = set(verdicts.values())
    return found.pop() if len(found) == 1 else DIFFERENCE


def _whose(verdicts: dict[str, Verdict]) -> str:
    return "" if len(set(verdicts.values())) == 1 else "; " + ", ".join(f"{w} {v}" for w, v in verdicts.items())


def _ratio(times: Sequence[float]) -> float:
    """Largest over smallest detection time; infinite if a drop was not found."""
    return float("inf") if np.any(np.isnan(times)) else float(max(times) / min(times))


_CAUSES = {
    "as it is": {},
    "no load transfer": {"car": SUV._replace(h_cg=0.0)},
    "straight tyre curve": {"car": SUV._replace(mu=_RIGID_MU), "low_mu": _RIGID_MU},
    "neither": {"car": SUV._replace(h_cg=0.0, mu=_RIGID_MU), "low_mu": _RIGID_MU},
}


def _without_causes(wave: str, amplitude: float) -> dict[str, list[float]]:
    """Detection times over the acceleration with the causes of its influence switched off one by one."""
    return {
        name: [detection_time(replace(Case(wave, amplitude, "mu", 8.0, a_x=a), **off)) for a in MU_A]  # type: ignore[arg-type]
        for name, off in _CAUSES.items()
    }


def figure_3_10() -> Figure:
    """Estimates under triangles of both kinds, with the sine in the findings."""
    relative = {w: {k: detection_time(c) for k, c in cases(w, "relative").items()} for w in WAVES}
    mu = {w: {k: detection_time(c) for k, c in cases(w, "mu").items()} for w in WAVES}
    causes = {A: _without_causes("sine", A) for A in (0.03, 0.07)}
    panels = []
    for kind, symbol in (("relative", "A_rel"), ("mu", "mu_Amp")):
        lines: list[Line] = []
        found = cases("triangle", kind)
        hues = dict(zip(sorted({A for A, _ in found}), COLOURS, strict=False))
        dashes = dict(zip(sorted({a for _, a in found}), _DASHES, strict=True))
        for (A, a), case in found.items():
            name = f"{symbol} {A:g}, {a:g} m/s²"
            lines += estimate_lines(name, case, colour=hues[A], dash=dashes[a], t_end=_END, is_split=True)
        what = "share of the axle forces" if kind == "relative" else "traction coefficient"
        panels.append(Panel(f"Estimated slope: amplitude as a {what}", TIME, SLOPE, (*lines, true_slope(_END))))
    return figure_of(
        "3.10",
        tuple(panels),
        (
            _c110(relative),
            _c111(mu, causes),
            _c112({w: [mu[w][0.03, a] for a in MU_A] for w in WAVES}),
            _c113({w: [mu[w][0.07, a] for a in MU_A] for w in WAVES}),
        ),
        (
            *(_times_table(w, "relative", "A_rel", relative[w]) for w in WAVES),
            *(_times_table(w, "mu", "mu_Amp", mu[w]) for w in WAVES),
            *(_cause_table(A, c) for A, c in causes.items()),
            tangent_table({f"sine of {0.07:g}, {a:g} m/s^2": Case("sine", 0.07, "mu", a_x=a) for a in MU_A}),
        ),
    )


def _c110(times: dict[str, dict[tuple[float, float], float]]) -> Check:
    falls_with_amplitude = [is_falling([times[w][A, a] for A in RELATIVE]) for w in WAVES for a in RELATIVE_A]
    falls_with_a = [is_falling([times[w][A, a] for a in RELATIVE_A]) for w in WAVES for A in RELATIVE]
    least = min(
        float(min(d.F_x_f[d.t > -8.0].min(), d.F_x_r[d.t > -8.0].min()))
        for w in WAVES
        for c in cases(w, "relative").values()
        for d in (drive(c),)
    )
    outcome = (
        "; ".join(
            f"{w} at {' / '.join(f'{a:g}' for a in RELATIVE_A)} m/s^2: "
            + ", ".join(f"A_rel {A:g}: {listed([times[w][A, a] for a in RELATIVE_A])}" for A in RELATIVE)
            for w in WAVES
        )
        + f" s; smallest axle force {least:.0f} N"
    )
    whole = all(falls_with_amplitude) and all(falls_with_a) and least > 0.0
    return judge("C110.figure", outcome, whole=whole, part=all(falls_with_amplitude) or all(falls_with_a), value=least)


def _c111(times: dict[str, dict[tuple[float, float], float]], causes: dict[float, dict[str, list[float]]]) -> Check:
    ratios = {w: {A: _ratio([times[w][A, a] for a in MU_A]) for A in (0.07, 0.03)} for w in WAVES}
    verdicts = {w: judged(whole=max(r.values()) < 1.3, part=max(r.values()) < 2.0) for w, r in ratios.items()}
    verdict = _both(verdicts)
    left = {A: {n: _ratio(t) for n, t in c.items()} for A, c in causes.items()}
    least = min(min(float(d.F_x_f[d.t > -8.0].min()), float(d.F_x_r[d.t > -8.0].min()))
                for c in cases("triangle", "mu").values() for d in (drive(c),))  # fmt: skip
    outcome = (
        "; ".join(
            f"{w} of {A:g}: {listed([times[w][A, a] for a in MU_A])} s, ratio {_number(r)}"
            for w in WAVES
            for A, r in ratios[w].items()
        )
        + f"; smallest axle force {least:.0f} N{_whose(verdicts)}"
    )
    fields = {"causes": ", ".join(f"{n} {_number(left[0.07][n])} / {_number(left[0.03][n])}" for n in _CAUSES)}
    return judge("C111.figure", outcome, verdict=verdict, value=_known(ratios["sine"][0.07]), fields=fields)


def _c112(times: dict[str, list[float]]) -> Check:
    below = {w: [not np.isnan(t) and t < 2.0 for t in ts] for w, ts in times.items()}
    verdicts = {w: judged(whole=all(b), part=b[-1]) for w, b in below.items()}
    verdict = _both(verdicts)
    outcome = "; ".join(f"{w}: {listed(ts)} s" for w, ts in times.items()) + f"{_whose(verdicts)}"
    fields = {"error": 1e3 * _largest_error()}
    return judge("C112.figure", outcome, verdict=verdict, value=_known(times["sine"][-1]), fields=fields)


def _largest_error() -> float:
    """Prediction error at the peak of 0.03 on the front axle, with the rear's share of the same force. [-]"""
    mu_delta = 0.03 * (1.0 + SUV.l_r / SUV.l_f)
    return mu_delta * (1.0 / LOW_SLOPE - 1.0 / SUV.slope_f)


def _c113(times: dict[str, list[float]]) -> Check:
    slopes = {w: [slope_after(Case(w, 0.07, "mu", a_x=a), 2.0) for a in MU_A] for w in WAVES}
    right = {
        w: [
            _RANGE[0] <= t <= _RANGE[1] and abs(s / LOW_SLOPE - 1.0) <= 0.15
            for t, s in zip(times[w], slopes[w], strict=True)
        ]
        for w in WAVES
    }
    verdicts = {w: judged(whole=all(r), part=any(r)) for w, r in right.items()}
    verdict = _both(verdicts)
    mu, tangent, estimated = settled_slopes(Case("sine", 0.07, "mu", a_x=1.0))
    outcome = (
        "; ".join(
            f"{w}: {listed(times[w])} s, slope {' / '.join(f'{s:.1f}' for s in slopes[w])} after 2 s" for w in WAVES
        )
        + f"{_whose(verdicts)}"
    )
    fields = {"tangent": tangent, "mu": mu, "estimated": estimated}
    return judge("C113.figure", outcome, verdict=verdict, value=_known(times["sine"][-1]), fields=fields)


def _known(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _number(ratio: float) -> str:
    return "– (not always found)" if np.isinf(ratio) else f"{ratio:.2f}"


def _times_table(wave: str, kind: str, symbol: str, times: dict[tuple[float, float], float]) -> Table:
    accelerations = RELATIVE_A if kind == "relative" else MU_A
    amplitudes = RELATIVE if kind == "relative" else MU
    return Table(
        f"Detection time [s], {wave}, amplitude as a "
        f"{'share of the axle forces' if kind == 'relative' else 'traction coefficient'}",
        (symbol, *(f"{a:g} m/s^2" for a in accelerations)),
        tuple((f"{A:g}", *(seconds(times[A, a]) for a in accelerations)) for A in amplitudes),
    )


def _cause_table(amplitude: float, times: dict[str, list[float]]) -> Table:
    return Table(
        "Detection time [s] over the acceleration with its causes switched off, sine, traction coefficient "
        f"{amplitude:g}",
        ("half-car", *(f"{a:g} m/s^2" for a in MU_A), "longest / shortest"),
        tuple((n, *(seconds(t) for t in ts), _number(_ratio(ts))) for n, ts in times.items()),
    )


FIGURES = {"3.10": figure_3_10}
