"""Figures 3.1 and 3.3: the brush as a curve of traction over slip, on several surfaces and scaled."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from aqualog.model.scenario import SURFACES
from aqualog.physics.surface import series_slope
from aqualog.thesis.catalogue import figure_of
from aqualog.thesis.claims import judge
from aqualog.thesis.evidence.brush import slip_of_traction, traction
from aqualog.thesis.figures.timeline import COLOURS
from aqualog.thesis.record import Axis, Figure, Line, Panel, Table

__all__ = ["FIGURES"]

_TYRE_SLOPE, _TYRE_MU = 30.0, 1.0  # on dry asphalt
_NAMES = {"asphalt": "dry asphalt", "snow": "snow on asphalt", "snow_on_ice": "snow on ice", "wet_ice": "wet ice"}
_SHOWN = 0.10  # largest slip that is drawn [-]


def figure_3_01() -> Figure:
    """Curves of the brush with the ground's yield in series with the tread."""
    slopes = {n: float(series_slope(np.array(_TYRE_SLOPE), compliance=SURFACES[n].compliance)) for n in _NAMES}
    mus = {n: SURFACES[n].mu or _TYRE_MU for n in _NAMES}
    s = np.linspace(0.0, _SHOWN, 401)
    curves = {n: traction(s, slope=slopes[n], mu_max=mus[n]) for n in _NAMES}
    # where the linear part has given way: 90 % of the friction is used
    bends = {n: float(slip_of_traction(np.array([0.9 * mus[n]]), slope=slopes[n], mu_max=mus[n])[0]) for n in _NAMES}

    ratios = [max(slopes[a], slopes[b]) / min(slopes[a], slopes[b]) for a, b in combinations(_NAMES, 2)]
    snows = max(mus["snow"], mus["snow_on_ice"]) / min(mus["snow"], mus["snow_on_ice"]) - 1.0
    snow_slopes = max(slopes["snow"], slopes["snow_on_ice"]) / min(slopes["snow"], slopes["snow_on_ice"]) - 1.0
    outcome = (
        f"slopes {', '.join(f'{slopes[n]:.0f}' for n in _NAMES)}: least ratio {min(ratios):.2f}; snow on asphalt and "
        f"on ice: friction {100 * snows:.0f} % apart, slopes {100 * snow_slopes:.0f} %, bends at "
        f"{100 * bends['snow']:.1f} and {100 * bends['snow_on_ice']:.1f} % slip"
    )
    whole = min(ratios) > 1.15 and snows < 0.10 and snow_slopes > 0.25
    c81 = judge("C81.figure", outcome, whole=whole, part=min(ratios) > 1.15, value=min(ratios))

    # the curve's own slope near zero against the law of springs in series
    small = np.array([1e-6])
    error = max(
        abs(
            float(traction(small, slope=slopes[n], mu_max=mus[n])[0]) / 1e-6
            * (1.0 / _TYRE_SLOPE + SURFACES[n].compliance) - 1.0
        )
        for n in _NAMES
    )  # fmt: skip
    yields = [n for n in _NAMES if SURFACES[n].compliance > 0.0]
    drops = all(slopes[n] < _TYRE_SLOPE for n in yields)
    outcome = (
        f"largest deviation {100 * error:.4f} %; slope {', '.join(f'{slopes[n]:.0f}' for n in yields)} of "
        f"{_TYRE_SLOPE:.0f} where the ground yields"
    )
    c82 = judge("C82.figure", outcome, whole=error < 1e-3 and drops, part=drops, value=error)
    lines = tuple(
        Line(label, 100.0 * s, curves[n], colour=c) for (n, label), c in zip(_NAMES.items(), COLOURS, strict=False)
    )
    rows = tuple((label, f"{mus[n]:.2f}", f"{slopes[n]:.1f}", f"{100 * bends[n]:.1f}") for n, label in _NAMES.items())
    return figure_of(
        "3.1",
        (Panel("Traction coefficient over slip", Axis("slip", "%"), Axis("traction coefficient"), lines),),
        (c81, c82),
        (Table("Curves", ("surface", "friction [-]", "slip slope [-]", "slip at 90 % of the friction [%]"), rows),),
    )


_FRONT, _REAR, _MU = 30.0, 24.0, 1.0
_RATIO = _REAR / _FRONT  # lambda of (3.17)
_POINTS = (0.02, 0.12)  # traction coefficients of front and rear axle in the example
_EQUAL = 0.12  # of the front axle, where the transformed slips shall be equal


def figure_3_03() -> Figure:
    """Both curves, the rear one as it is and scaled by lambda and rho, with the slope between two working points."""
    s = np.linspace(0.0, 0.03, 301)
    rear = traction(s, slope=_REAR, mu_max=_MU)
    front = traction(s, slope=_FRONT, mu_max=_MU)
    s_f = float(slip_of_traction(np.array([_POINTS[0]]), slope=_FRONT, mu_max=_MU)[0])
    s_r = float(slip_of_traction(np.array([_POINTS[1]]), slope=_REAR, mu_max=_MU)[0])
    rho = (1.0 - s_f) / (1.0 - s_r)  # v_R / v_F with v = v_x / (1 - s)
    scaled_s, scaled_mu = rho * s, rho * rear / _RATIO

    initial = float(scaled_mu[1] / scaled_s[1])
    s_delta, mu_delta = s_f - rho * s_r, _POINTS[0] - rho * _POINTS[1] / _RATIO
    chord = mu_delta / s_delta
    # the same slip on both axles: the remaining slip for an estimate of the slope
    s_r_equal = float(slip_of_traction(np.array([_EQUAL * _RATIO]), slope=_REAR, mu_max=_MU)[0])
    s_f_equal = float(slip_of_traction(np.array([_EQUAL]), slope=_FRONT, mu_max=_MU)[0])
    rho_equal = (1.0 - s_f_equal) / (1.0 - s_r_equal)
    left = abs(s_f_equal - rho_equal * s_r_equal)
    initial_error, chord_error = abs(initial / _FRONT - 1.0), abs(chord / _FRONT - 1.0)
    outcome = f"initial slope {initial:.2f}, slope between the points {chord:.1f}, front tyre {_FRONT:.0f}"
    whole = initial_error < 0.01 and chord_error < 0.15
    fields = {"flatter": 100 * chord_error, "left": 100 * left}
    c92 = judge("C92.figure", outcome, whole=whole, part=initial_error < 0.01, value=chord, fields=fields)
    first = (
        Line("rear tyre", 100.0 * s, rear, colour=COLOURS[1]),
        Line("rear working point", np.array([100.0 * s_r]), np.array([_POINTS[1]]), colour=COLOURS[1], mode="markers",
             size=10.0),
    )  # fmt: skip
    second = (
        Line("front tyre", 100.0 * s, front, colour=COLOURS[0]),
        Line("rear tyre, scaled", 100.0 * scaled_s, scaled_mu, colour=COLOURS[1], dash="dash"),
        Line("front working point", np.array([100.0 * s_f]), np.array([_POINTS[0]]), colour=COLOURS[0], mode="markers",
             size=10.0),
        Line("rear working point, scaled", np.array([100.0 * rho * s_r]), np.array([rho * _POINTS[1] / _RATIO]),
             colour=COLOURS[1], mode="markers", size=10.0),
        Line("differential slip and traction", 100.0 * np.array([s_f, rho * s_r, rho * s_r]),
             np.array([_POINTS[0], _POINTS[0], rho * _POINTS[1] / _RATIO]), colour=COLOURS[2], dash="dot"),
    )  # fmt: skip
    return figure_of(
        "3.3",
        (
            Panel("Rear curve", Axis("rear slip", "%"), Axis("traction coefficient", limits=(0.0, 0.8)), first),
            Panel(
                "Front curve and scaled rear curve",
                Axis("front slip, scaled rear slip", "%"),
                Axis("traction coefficient, scaled", limits=(0.0, 0.8)),
                second,
            ),
        ),
        (c92,),
        (
            Table(
                "The example",
                ("", "slip [%]", "traction [-]"),
                (
                    ("front", f"{100 * s_f:.4f}", f"{_POINTS[0]:.4f}"),
                    ("rear, scaled", f"{100 * rho * s_r:.4f}", f"{rho * _POINTS[1] / _RATIO:.4f}"),
                    ("difference", f"{100 * s_delta:.4f}", f"{mu_delta:.4f}"),
                ),
            ),
        ),
        rho=rho,
    )


FIGURES = {"3.1": figure_3_01, "3.3": figure_3_03}
