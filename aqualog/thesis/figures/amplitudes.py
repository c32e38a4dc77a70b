"""Figure 3.10: excitation in proportion to the axle forces, or as a traction coefficient."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aqualog.thesis.catalogue import figure_of
from aqualog.thesis.claims import DIFFERENCE, Check, Verdict, judge, judged, limits
from aqualog.thesis.evidence.half_car import LOW_SLOPE, SUV, Case, drive
from aqualog.thesis.figures.timeline import (
    COLOURS,
    detected_s,
    is_falling,
    listed,
    settled_slopes,
    slope_after,
    slope_panel,
    tangent_table,
)
from aqualog.thesis.record import Figure, Table, seconds

__all__ = ["FIGURES"]

RELATIVE, RELATIVE_A = (0.2, 0.4, 0.6, 0.8), (0.5, 1.0, 1.5)
MU, MU_A = (0.01, 0.03, 0.05, 0.07), (0.0, 0.5, 1.0)
WAVES = ("triangle", "sine")
_DASHES = ("dot", "dash", "solid")
_END = 10.0
_RANGE = limits("range", "C113.figure")  # [s] "just 1 s"
_RIGID_MU = 1e3  # friction with which the brush is a straight line


Times = dict[tuple[float, float], float]
"""Detection times [s] by amplitude and acceleration."""


@dataclass(frozen=True, slots=True)
class _Kind:
    """A kind of amplitude: its symbol and words, and the values that are driven."""

    symbol: str
    words: str
    amplitudes: tuple[float, ...]
    accelerations: tuple[float, ...]


_KINDS = {
    "relative": _Kind("A_rel", "share of the axle forces", RELATIVE, RELATIVE_A),
    "mu": _Kind("mu_Amp", "traction coefficient", MU, MU_A),
}


def cases(wave: str, kind: str) -> dict[tuple[float, float], Case]:
    """Runs by amplitude and acceleration."""
    k = _KINDS[kind]
    return {(A, a): Case(wave, A, kind, 8.0, a_x=a) for A in k.amplitudes for a in k.accelerations}


def _least_force(runs: Iterable[Case]) -> float:
    """Smallest axle force of runs, but for their first 2 s. [N]"""
    drives = [(d, d.t > -8.0) for d in map(drive, runs)]
    return min(float(min(d.F_x_f[past].min(), d.F_x_r[past].min())) for d, past in drives)


def _over_both(verdicts: dict[str, Verdict]) -> tuple[Verdict, str]:
    """Verdict over both waveforms, since the thesis does not name the one it shows: in part where they differ. Each is
    named then."""
    found = set(verdicts.values())
    if len(found) == 1:
        return found.pop(), ""
    return DIFFERENCE, "; " + ", ".join(f"{w} {v}" for w, v in verdicts.items())


def _ratio(times: Sequence[float]) -> float:
    """Largest over smallest detection time; infinite if a drop was not found."""
    return float("inf") if np.any(np.isnan(times)) else float(max(times) / min(times))


_CAUSES = {
    "as it is": {},
    "no load transfer": {"car": SUV._replace(h_cg=0.0)},
    "straight tyre curve": {"car": SUV._replace(mu=_RIGID_MU), "low_mu": _RIGID_MU},
    "neither": {"car": SUV._replace(h_cg=0.0, mu=_RIGID_MU), "low_mu": _RIGID_MU},
}


def figure_3_10() -> Figure:
    """Estimates under triangles of both kinds, with the sine in the findings."""
    times = {kind: {w: {k: detected_s(c) for k, c in cases(w, kind).items()} for w in WAVES} for kind in _KINDS}
    mu = times["mu"]
    # the causes of the acceleration's influence are switched off one by one
    causes = {
        A: {name: [detected_s(replace(Case("sine", A, "mu", 8.0, a_x=a), **off)) for a in MU_A]  # type: ignore[arg-type]
            for name, off in _CAUSES.items()}
        for A in (0.03, 0.07)
    }  # fmt: skip
    panels, tables = [], []
    for name, kind in _KINDS.items():
        hues = dict(zip(kind.amplitudes, COLOURS, strict=False))
        dashes = dict(zip(kind.accelerations, _DASHES, strict=True))
        drawn = {
            f"{kind.symbol} {A:g}, {a:g} m/s²": (case, hues[A], dashes[a])
            for (A, a), case in cases("triangle", name).items()
        }
        title = f"Estimated slope: amplitude as a {kind.words}"
        panels.append(slope_panel(title, drawn, t_end=_END, is_split=True))
        tables += [_times_table(w, kind, times[name][w]) for w in WAVES]
    at = {A: {w: [mu[w][A, a] for a in MU_A] for w in WAVES} for A in (0.03, 0.07)}
    sines = {f"sine of {0.07:g}, {a:g} m/s^2": Case("sine", 0.07, "mu", a_x=a) for a in MU_A}
    return figure_of(
        "3.10",
        panels,
        (_c110(times["relative"]), _c111(mu, causes), _c112(at[0.03]), _c113(at[0.07])),
        (*tables, *(_cause_table(A, c) for A, c in causes.items()), tangent_table(sines)),
    )


def _c110(times: dict[str, Times]) -> Check:
    falls_with_amplitude = [is_falling([times[w][A, a] for A in RELATIVE]) for w in WAVES for a in RELATIVE_A]
    falls_with_a = [is_falling([times[w][A, a] for a in RELATIVE_A]) for w in WAVES for A in RELATIVE]
    least = _least_force(c for w in WAVES for c in cases(w, "relative").values())
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


def _c111(times: dict[str, Times], causes: dict[float, dict[str, list[float]]]) -> Check:
    ratios = {w: {A: _ratio([times[w][A, a] for a in MU_A]) for A in (0.07, 0.03)} for w in WAVES}
    most = {w: max(r.values()) for w, r in ratios.items()}
    verdict, whose = _over_both({w: judged(whole=x < 1.3, part=x < 2.0) for w, x in most.items()})
    left = {A: {n: _ratio(t) for n, t in c.items()} for A, c in causes.items()}
    least = _least_force(cases("triangle", "mu").values())
    outcome = (
        "; ".join(
            f"{w} of {A:g}: {listed([times[w][A, a] for a in MU_A])} s, ratio {_number(r)}"
            for w in WAVES
            for A, r in ratios[w].items()
        )
        + f"; smallest axle force {least:.0f} N{whose}"
    )
    fields = {"causes": ", ".join(f"{n} {_number(left[0.07][n])} / {_number(left[0.03][n])}" for n in _CAUSES)}
    return judge("C111.figure", outcome, verdict=verdict, value=ratios["sine"][0.07], fields=fields)


def _c112(times: dict[str, list[float]]) -> Check:
    below = {w: [not np.isnan(t) and t < 2.0 for t in ts] for w, ts in times.items()}
    verdict, whose = _over_both({w: judged(whole=all(b), part=b[-1]) for w, b in below.items()})
    outcome = "; ".join(f"{w}: {listed(ts)} s" for w, ts in times.items()) + whose
    # prediction error at the peak of 0.03 on the front axle, with the rear's share of the same force
    mu_delta = 0.03 * (1.0 + SUV.l_r / SUV.l_f)
    fields = {"error": 1e3 * (mu_delta * (1.0 / LOW_SLOPE - 1.0 / SUV.slope_f))}
    return judge("C112.figure", outcome, verdict=verdict, value=times["sine"][-1], fields=fields)


def _c113(times: dict[str, list[float]]) -> Check:
    slopes = {w: [slope_after(Case(w, 0.07, "mu", a_x=a), 2.0) for a in MU_A] for w in WAVES}
    right = {
        w: [
            _RANGE[0] <= t <= _RANGE[1] and abs(s / LOW_SLOPE - 1.0) <= 0.15
            for t, s in zip(times[w], slopes[w], strict=True)
        ]
        for w in WAVES
    }
    verdict, whose = _over_both({w: judged(whole=all(r), part=any(r)) for w, r in right.items()})
    mu, tangent, estimated = settled_slopes(Case("sine", 0.07, "mu", a_x=1.0))
    outcome = (
        "; ".join(
            f"{w}: {listed(times[w])} s, slope {' / '.join(f'{s:.1f}' for s in slopes[w])} after 2 s" for w in WAVES
        )
        + whose
    )
    fields = {"tangent": tangent, "mu": mu, "estimated": estimated}
    return judge("C113.figure", outcome, verdict=verdict, value=times["sine"][-1], fields=fields)


def _number(ratio: float) -> str:
    return "– (not always found)" if np.isinf(ratio) else f"{ratio:.2f}"


def _times_table(wave: str, kind: _Kind, times: Times) -> Table:
    return Table(
        f"Detection time [s], {wave}, amplitude as a {kind.words}",
        (kind.symbol, *(f"{a:g} m/s^2" for a in kind.accelerations)),
        tuple((f"{A:g}", *(seconds(times[A, a]) for a in kind.accelerations)) for A in kind.amplitudes),
    )


def _cause_table(amplitude: float, times: dict[str, list[float]]) -> Table:
    return Table(
        "Detection time [s] over the acceleration with its causes switched off, sine, traction coefficient "
        f"{amplitude:g}",
        ("half-car", *(f"{a:g} m/s^2" for a in MU_A), "longest / shortest"),
        tuple((n, *(seconds(t) for t in ts), _number(_ratio(ts))) for n, ts in times.items()),
    )


FIGURES = {"3.10": figure_3_10}
