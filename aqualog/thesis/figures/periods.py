"""Figures 3.9 and 3.11: the period of the excitation, and the parameters of filter and change detection."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aqualog.detect.slip_slope.tuning import TUNING
from aqualog.thesis.catalogue import figure_of
from aqualog.thesis.claims import Check, judge
from aqualog.thesis.evidence.half_car import GATE_OFF, Case, adaption_time, drive, estimate, first_alarm, inputs
from aqualog.thesis.figures.timeline import COLOURS, detected_s, false_alarms_of, listed, slope_after, slope_panel, told
from aqualog.thesis.record import Axis, Figure, Line, Panel, Table, seconds

__all__ = ["FIGURES"]

OCTAVES = (64.0, 32.0, 16.0, 8.0, 4.0, 2.0)
PANELS: dict[str, Case] = {
    "sine, minimum of differential traction": Case("sine", tuning=TUNING, t_end=30.0),
    "triangle, every sample": Case("triangle", tuning=GATE_OFF, t_end=30.0),
}
_FINE = tuple(float(2.0 ** (k / 4.0)) for k in range(25))  # 1 to 64 s
_END = 16.0
_VARIANTS = {
    "as tuned": (1.0, 1.0), "zeta halved": (0.5, 1.0), "zeta doubled": (2.0, 1.0), "h halved": (1.0, 0.5),
    "h doubled": (1.0, 2.0),
}  # fmt: skip


def _times(case: Case, periods: tuple[float, ...], zeta: float = 1.0, h: float = 1.0) -> list[float]:
    """Detection times over the period, with drift and threshold scaled. [s]"""
    tuning = case.tuning._replace(zeta=zeta * case.tuning.zeta, h=h * case.tuning.h)
    return [detected_s(replace(case, period=p, tuning=tuning)) for p in periods]


def _fastest(periods: tuple[float, ...], times: list[float]) -> float:
    """Period of the shortest detection time; NaN without a detection. [s]"""
    return float("nan") if np.all(np.isnan(times)) else periods[int(np.nanargmin(times))]


def _falls_and_rises(times: list[float]) -> bool:
    """Over the octaves each time is shorter than the one before down to 8 s, and longer from there; all are found."""
    k = OCTAVES.index(8.0)
    return bool(np.all(np.diff(times[: k + 1]) < 0.0) and np.all(np.diff(times[k:]) > 0.0))


def _at_alarm(case: Case) -> tuple[float, float, float]:
    """Detection time, size of the differential traction there, and adaption time; NaN without an alarm."""
    d, e = drive(case), estimate(case)
    t = first_alarm(d, e)
    if np.isnan(t):
        return t, t, t
    _, mu_i, rho_mu_j = inputs(d, case.car)
    k = int(np.searchsorted(d.t, t - 1e-6))
    return t, float(abs(mu_i[k] - e.beta[k] * rho_mu_j[k])), adaption_time(d, e)


def figure_3_09() -> Figure:
    """Estimates over six octaves of the period, and the detection time over a finer grid."""
    short = {n: n.split(",")[0] for n in PANELS}
    octaves = {n: _times(c, OCTAVES) for n, c in PANELS.items()}
    best = {n: _fastest(OCTAVES, t) for n, t in octaves.items()}
    fine = {n: {v: _times(c, _FINE, *k) for v, k in _VARIANTS.items()} for n, c in PANELS.items()}
    fine_best = {n: {v: _fastest(_FINE, t) for v, t in f.items()} for n, f in fine.items()}
    outcome = (
        "; ".join(
            f"{short[n]}: {listed(octaves[n])} s, least at {_period(best[n])} (finer grid: "
            f"{_period(fine_best[n]['as tuned'])})"
            for n in PANELS
        )
        + f" for {' / '.join(f'{p:g}' for p in OCTAVES)} s"
    )
    first = "; ".join(f"{short[n]} down to {_period(_first_half(fine[n]['as tuned']))}" for n in PANELS)
    whole, part = all(map(_falls_and_rises, octaves.values())), all(b == 8.0 for b in best.values())
    value = best["sine, minimum of differential traction"]
    c108 = judge("C108.figure", outcome, whole=whole, part=part, value=value, fields={"first": first})
    spreads = [_spread(list(b.values())) for b in fine_best.values()]
    moved = [s > 1.4 for s in spreads]
    outcome = "; ".join(
        f"{short[n]}: " + ", ".join(f"{v} {_period(p)}" for v, p in fine_best[n].items()) for n in PANELS
    )
    optimum = judge("C108.figure_tuning", outcome, whole=all(moved), part=any(moved), value=max(spreads))
    alarms = {n: [_at_alarm(replace(c, period=p)) for p in OCTAVES] for n, c in PANELS.items()}
    c109 = _c109(short, alarms)
    panels = [
        slope_panel(
            f"Estimated slope: {n}",
            {f"{p:g} s": (replace(c, period=p), hue, "solid") for p, hue in zip(OCTAVES, COLOURS, strict=True)},
            t_end=_END, is_split=c.tuning is TUNING,
        )
        for n, c in PANELS.items()
    ]  # fmt: skip
    for n, f in fine.items():
        curves = tuple(
            Line(v, np.array(_FINE), np.array(t), colour=colour, mode="lines+markers", size=5.0,
                 width=3.0 if v == "as tuned" else 1.5)
            for (v, t), colour in zip(f.items(), COLOURS, strict=False)
        )  # fmt: skip
        axes = Axis("period", "s", log_base=2), Axis("detection time", "s")
        panels.append(Panel(f"Detection time: {n}", *axes, curves))
    header = ("period [s]", "drop found [s]", "|mu_delta| there [-]", "adaption time [s]")
    tables = [
        Table(f"Adaption: {n}", header, tuple(
            (f"{p:g}", seconds(t), "–" if np.isnan(mu) else f"{mu:.4f}", seconds(a))
            for p, (t, mu, a) in zip(OCTAVES, rows, strict=True)
        ))
        for n, rows in alarms.items()
    ]  # fmt: skip
    return figure_of("3.9", panels, (c108, optimum, c109), tables)


def _c109(short: dict[str, str], alarms: dict[str, list[tuple[float, float, float]]]) -> Check:
    differ = {n: _difference([a[2] for a in rows]) for n, rows in alarms.items()}
    found = {n: _difference([a[0] for a in rows]) for n, rows in alarms.items()}
    slowest = max((a[2] for rows in alarms.values() for a in rows if not np.isnan(a[2])), default=0.0)
    outcome = (
        "; ".join(
            f"{short[n]}: {listed([a[2] for a in rows])} s, ratio {_spread([a[2] for a in rows]):.0f}, apart by "
            f"{differ[n]:.2f} s and detection by {found[n]:.2f} s"
            for n, rows in alarms.items()
        )
        + f"; none above {slowest:.1f} s"
    )
    less = [differ[n] < found[n] for n in alarms]
    value, fields = max(differ.values()), {"why": _why_adaption(alarms)}
    return judge("C109.figure", outcome, whole=all(less), part=any(less), value=value, fields=fields)


def _first_half(times: list[float]) -> float:
    """Shortest period on the finer grid whose first half wave finds the drop. [s]"""
    return min((p for p, t in zip(_FINE, times, strict=True) if t <= 0.5 * p), default=float("nan"))


def _period(p: float) -> str:
    return "none" if np.isnan(p) else f"{p:.2g} s"


def _difference(values: list[float]) -> float:
    """Largest less smallest of the available ones; infinite if all are missing."""
    known = [v for v in values if not np.isnan(v)]
    return max(known) - min(known) if known else float("inf")


def _spread(values: list[float]) -> float:
    """Largest over smallest of the available ones; infinite if one of them is zero or all are missing."""
    known = [v for v in values if not np.isnan(v)]
    return max(known) / min(known) if known and min(known) > 0.0 else float("inf")


def _why_adaption(alarms: dict[str, list[tuple[float, float, float]]]) -> str:
    """How the adaption time goes with the differential traction at the alarm."""
    rows = [a for of in alarms.values() for a in of if not np.isnan(a[2])]
    if len(rows) < 2:
        return "Hardly any run finds the drop, so a comparison is not possible."
    rows.sort(key=lambda a: a[1])
    half = len(rows) // 2
    small, large = rows[:half], rows[-half:]
    return (
        "After the reset the filter adapts as fast as the differential traction allows: the half of the runs with "
        f"the smaller one at the alarm (up to {small[-1][1]:.3f}) takes {np.mean([a[2] for a in small]):.2f} s on "
        f"average, the other half {np.mean([a[2] for a in large]):.2f} s. Without noise all are short against the "
        "time that the drop takes to be found; the ratio is then not meaningful."
    )


Q = (0.1, 1.0, 10.0, 100.0, 1e3, 1e4)
_NEAR = Q[:4]
THRESHOLDS = (0.5, 1.0, 2.0)
_TUNED = Case("triangle", 250.0, "force", 8.0, a_x=1.0)
_CHANGE = 0.2
_DASHES = ("dot", "solid", "dash")


def _tuned_case(q: float, h: float) -> Case:
    """The tuning with its process noise and threshold scaled; the uncertainty after an alarm stays as it is."""
    return replace(_TUNED, tuning=TUNING._replace(q_k=q * TUNING.q_k, h=h * TUNING.h))


def _change(times: list[float]) -> float:
    """Largest over smallest less one; infinite if some found the drop and others did not, zero if none did."""
    found = [t for t in times if not np.isnan(t)]
    if not found:
        return 0.0
    return float("inf") if len(found) < len(times) else max(found) / min(found) - 1.0


def figure_3_11() -> Figure:
    """Estimates over both parameters, and the detection times of all pairs."""
    times = {(q, h): detected_s(_tuned_case(q, h)) for q in Q for h in THRESHOLDS}
    false = false_alarms_of(_tuned_case(q, h) for q in Q for h in THRESHOLDS)
    by_q_near = _change([times[q, 1.0] for q in _NEAR])
    by_q = _change([times[q, 1.0] for q in Q])
    by_h = _change([times[1.0, h] for h in THRESHOLDS])
    known = replace(_TUNED, tuning=TUNING._replace(sd_k=0.0))
    outcome = (
        f"over q_k {_percent(by_q_near)} (to 10000 times: {_percent(by_q)}), over h {_percent(by_h)}; false alarms: "
        f"{false}"
    )
    fields = {"q_k": TUNING.q_k, "known": told(known), "tuned": told(_TUNED),
              "fast": slope_after(_tuned_case(1e4, 1.0), 2.0), "slow": slope_after(_TUNED, 2.0)}  # fmt: skip
    whole, part = by_q_near > _CHANGE and by_h > _CHANGE, by_h > _CHANGE and by_q > _CHANGE
    c114 = judge("C114.figure", outcome, whole=whole, part=part, value=by_h, fields=fields)
    over_q = {f"q_k x {q:g}": (_tuned_case(q, 1.0), c, "solid") for q, c in zip(Q, COLOURS, strict=True)}
    over_h = {
        f"h x {h:g}, q_k x {q:g}": (_tuned_case(q, h), c, dash)
        for h, dash in zip(THRESHOLDS, _DASHES, strict=True)
        for q, c in ((1.0, COLOURS[1]), (1e3, COLOURS[4]))
    }
    curves = tuple(
        Line(f"h x {h:g}", np.array(Q), np.array([times[q, h] for q in Q]), colour=c, mode="lines+markers", dash=dash)
        for h, c, dash in zip(THRESHOLDS, COLOURS, _DASHES, strict=False)
    )
    panels = (
        slope_panel("Estimated slope over the process noise", over_q, t_end=_END, is_split=True),
        slope_panel("Estimated slope over the threshold", over_h, t_end=_END, is_split=True),
        Panel("Detection time", Axis("q_k over the tuning's", log_base=10), Axis("detection time", "s"), curves),
    )
    table = Table(
        "Detection time [s]",
        ("q_k over the tuning's", *(f"h x {h:g}" for h in THRESHOLDS)),
        tuple((f"{q:g}", *(seconds(times[q, h]) for h in THRESHOLDS)) for q in Q),
    )
    return figure_of("3.11", panels, (c114,), (table,), q_k=TUNING.q_k, h=TUNING.h)


def _percent(change: float) -> str:
    return "from found to not found" if np.isinf(change) else f"{100 * change:.0f} %"


FIGURES = {"3.9": figure_3_09, "3.11": figure_3_11}
