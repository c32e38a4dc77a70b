"""Figure 3.8: where the data points of one period lie, and how densely."""

from __future__ import annotations

import numpy as np

from aqualog.core.records import BoolArray, FloatArray
from aqualog.figures.record import Axis, Figure, Finding, Line, Panel, Table, judged
from aqualog.figures.solid import TRACTION
from aqualog.figures.study import GATE_OFF, Case, drive, inputs
from aqualog.figures.timeline import COLOURS

__all__ = ["extreme_share", "make"]

WAVES = ("triangle", "sine", "ramp", "step")
_PERIOD = 8.0
_BINS = 24  # per axis
_EXTREME = 0.9  # of the largest deviation from the mean


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


def _panel(wave: str) -> Panel:
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


def make() -> Figure:
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
    c106 = Finding(
        "C106",
        "Triangle, sine and ramp spread the data evenly, sine and ramp somewhat denser at the extremes; the step "
        "concentrates them there.",
        f"share of the samples beyond {_EXTREME} of the largest deviation of the differential traction: triangle "
        "below sine and ramp, these below step, on both surfaces; in part: on one",
        "; ".join(
            f"{name}: " + ", ".join(f"{w} {100 * s[w]:.0f} %" for w in WAVES)
            for name, s in (("slope 30", dry), ("slope 10", low))
        ),
        judged(whole=all(in_order), part=any(in_order)),
        value=dry["sine"] / dry["triangle"],
    )
    return Figure(
        "3.8",
        "data points of one period under four waveforms",
        "Excitation of 250 N and 8 s at 1 m/s²; the last period on the dry road and the second one on the low "
        "surface. The area of a dot is the number of samples in its cell; light dots are the projections.",
        (
            *(_panel(w) for w in WAVES),
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
