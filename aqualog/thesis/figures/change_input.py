"""Figure 3.2: input of the change detection, prediction error or prediction error in the slip's direction."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import FloatArray
from aqualog.detect.slip_slope.tuning import TUNING
from aqualog.physics.differential import differential_traction
from aqualog.report.theme import THRESHOLD
from aqualog.thesis.catalogue import figure_of
from aqualog.thesis.claims import judge, limit
from aqualog.thesis.evidence.half_car import HIGH_SLOPE, LOW_SLOPE, RATE_HZ, SUV, Case, drive, estimated, inputs
from aqualog.thesis.figures.timeline import COLOURS, TIME
from aqualog.thesis.record import Axis, Figure, Line, Panel, Table

__all__ = ["FIGURES"]

_CASE = Case("sine", 250.0, "force", 4.0, a_x=0.0, t_end=10.0)
_RADIUS_ERROR = 0.005  # of the front axle, as the estimator believes it
_AFTER = limit("after", "C90.figure")  # [s] sums are compared this long after the change
# a filter that does not learn the new road: slope and ratio are held, the offset is learnt as ever, no alarm resets
_HELD = TUNING._replace(q_k=0.0, sd_k=0.0, q_beta=0.0, sd_beta=0.0, h=1e9, tau_fade=np.inf)


def sums(nu: FloatArray, used: FloatArray) -> FloatArray:
    """Sum of (3.24) over a signal (n,), clamped at zero (E11), where `used`; in seconds. [s]"""
    g, out = 0.0, np.zeros(nu.size)
    for i in range(nu.size):
        if used[i]:
            g = max(0.0, g + (nu[i] - TUNING.zeta) / RATE_HZ)
        out[i] = g
    return out


def _held_filter(error: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Time, prediction error, differential slip, its estimated offset, differential traction, whether used; (n,)."""
    d = drive(_CASE)
    believed = SUV._replace(r_e_f=SUV.r_e_f * (1.0 + error))
    s_delta, mu_i, rho_mu_j = inputs(d, believed)
    e = estimated(_HELD, s_delta, mu_i, rho_mu_j)
    # the offset before the sample's own update, as the estimator takes it
    offset = np.concatenate(([0.0], e.offset[:-1]))
    mu_delta = differential_traction(mu_i, rho_mu_j, rho=np.ones_like(mu_i), beta=e.beta)
    return d.t, e.innovation, s_delta, offset, mu_delta, np.asarray(e.status <= 1.0, dtype=np.float64)


def _sums(error: float) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Time (n,) [s], and by its input the sum (n,) [s] where the front radius is wrong by a share."""
    t, innovation, s_delta, offset, mu_delta, used = _held_filter(error)
    directions = {"s_delta": s_delta, "s_delta - delta_hat": s_delta - offset, "mu_delta": mu_delta}
    found = {"epsilon": np.maximum(sums(innovation, used), sums(-innovation, used))}
    return t, found | {f"sgn({n}) epsilon": sums(np.sign(x) * innovation, used) for n, x in directions.items()}


def figure_3_02() -> Figure:
    """Geometry of the prediction error, and the sums over a run with sign-alternating excitation."""
    (t, right), (_, wrong) = _sums(0.0), _sums(_RADIUS_ERROR)
    k = int(np.searchsorted(t, _AFTER - 1e-6))
    by_slip, by_offset, by_traction = list(right)[1:]
    at, off = ({n: float(g[k]) for n, g in of.items()} for of in (right, wrong))
    plain, adapted, raw, corrected = at["epsilon"], at[by_offset], off[by_slip], off[by_offset]
    peak = float(right["epsilon"][: k + 1].max())
    outcome = (
        f"adapted {1e3 * adapted:.1f}e-3 s, plain {1e3 * plain:.1f}e-3 s (at most {1e3 * peak:.1f}e-3 s), threshold "
        f"{1e3 * TUNING.h:.0f}e-3 s"
    )
    whole = adapted > TUNING.h and adapted > 3.0 * peak
    c90 = judge("C90.figure", outcome, whole=whole, part=adapted > peak, value=adapted / max(peak, 1e-12))
    outcome = (
        f"sgn(s_delta) {1e3 * raw:.1f}e-3 s, sgn(s_delta - delta_hat) {1e3 * corrected:.1f}e-3 s, sgn(mu_delta) "
        f"{1e3 * off[by_traction]:.1f}e-3 s; without an error {1e3 * adapted:.1f}e-3 s"
    )
    whole, part = raw >= 0.9 * adapted, corrected >= 0.9 * adapted
    e12 = judge("C90.figure_offset", outcome, whole=whole, part=part, value=raw / adapted)
    past = t >= -2.0 - 1e-9
    drawn = (
        ("epsilon (3.23)", right["epsilon"], COLOURS[1], "solid"),
        ("sgn(s_delta - delta_hat) epsilon (3.25)", right[by_offset], COLOURS[0], "solid"),
        *((f"radius 0.5 % wrong: {n}", wrong[n], COLOURS[i], dash)
          for n, i, dash in ((by_slip, 4, "dash"), (by_offset, 2, "dot"), (by_traction, 3, "dashdot"))),
    )  # fmt: skip
    lines = [Line(name, t[past], 1e3 * g[past], colour=c, dash=dash) for name, g, c, dash in drawn]
    ends = np.array([-2.0, _CASE.t_end])
    lines.append(Line("threshold", ends, np.full(2, 1e3 * TUNING.h), colour=THRESHOLD, width=1.0, dash="dash"))
    table = Table(
        f"Sums {_AFTER:g} s after the change [1e-3 s]",
        ("input", "radii right", f"radius {100 * _RADIUS_ERROR:g} % wrong"),
        tuple((n, f"{1e3 * at[n]:.2f}", f"{1e3 * off[n]:.2f}") for n in right),
    )
    panels = (_geometry(), Panel("Sums g over time", TIME, Axis("g", "1e-3 s"), tuple(lines)))
    return figure_of("3.2", panels, (c90, e12), (table,))


def _geometry() -> Panel:
    """Lines of the old and the new slope through the origin, and the prediction error of a point on both sides."""
    s = np.array([-0.6, 0.6])
    lines = [
        Line(f"slope held by the filter, {HIGH_SLOPE:.0f}", s, 0.01 * s * HIGH_SLOPE, colour=COLOURS[0]),
        Line(f"slope of the road, {LOW_SLOPE:.0f}", s, 0.01 * s * LOW_SLOPE, colour=COLOURS[1]),
    ]
    for mu, sign, name in ((0.045, 1.0, "> 0"), (-0.045, -1.0, "< 0")):
        y, h = 100.0 * mu / LOW_SLOPE, 100.0 * mu / HIGH_SLOPE  # [%]
        label = f"s_delta {name}: epsilon {name}, nu = sgn(s_delta) epsilon > 0"
        lines.append(
            Line(label, np.array([h, y]), np.array([mu, mu]), colour=COLOURS[2] if sign > 0 else COLOURS[3],
                 mode="lines+markers", dash="dot")
        )  # fmt: skip
    return Panel(
        "Prediction error in the plane of differential slip and traction",
        Axis("differential slip s_delta", "%"),
        Axis("differential traction mu_delta", limits=(-0.09, 0.09)),
        tuple(lines),
    )


FIGURES = {"3.2": figure_3_02}
