"""Figure 3.1: one tyre on four surfaces."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from aqualog.figures.curves import slip_of_traction, traction
from aqualog.figures.record import Axis, Figure, Finding, Line, Panel, Table, judged
from aqualog.figures.timeline import COLOURS
from aqualog.model.surface import SURFACES
from aqualog.physics.surface import series_slope

__all__ = ["make"]

_TYRE_SLOPE, _TYRE_MU = 30.0, 1.0  # on dry asphalt
_NAMES = {"asphalt": "dry asphalt", "snow": "snow on asphalt", "snow_on_ice": "snow on ice", "wet_ice": "wet ice"}
_SHOWN = 0.10  # largest slip that is drawn [-]


def make() -> Figure:
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
    c81 = Finding(
        "C81",
        "The four surfaces differ clearly; both snow curves reach almost the same friction with different "
        "slopes and bends.",
        "slopes differ by > 15 % in every pair; the snow curves' friction by < 10 %, their slopes by > 25 %; in "
        "part: the first only",
        f"slopes {', '.join(f'{slopes[n]:.0f}' for n in _NAMES)}: least ratio {min(ratios):.2f}; snow on asphalt and "
        f"on ice: friction {100 * snows:.0f} % apart, slopes {100 * snow_slopes:.0f} %, bends at "
        f"{100 * bends['snow']:.1f} and {100 * bends['snow_on_ice']:.1f} % slip",
        judged(whole=min(ratios) > 1.15 and snows < 0.10 and snow_slopes > 0.25, part=min(ratios) > 1.15),
        "Friction and yield of snow and ice were set after this very figure: it shows that the model can "
        "distinguish the surfaces, not that real roads behave so.",
        min(ratios),
    )

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
    c82 = Finding(
        "C82",
        "A layer that yields is a stiffness in series with the bristles: the slope drops.",
        "slope of every curve at zero slip within 0.1 % of 1 / (1 / C_tyre + 1 / C_ground), lower wherever the "
        "ground yields",
        f"largest deviation {100 * error:.4f} %; slope {', '.join(f'{slopes[n]:.0f}' for n in yields)} of "
        f"{_TYRE_SLOPE:.0f} where the ground yields",
        judged(whole=error < 1e-3 and drops, part=drops),
        value=error,
    )
    lines = tuple(
        Line(label, 100.0 * s, curves[n], colour=c) for (n, label), c in zip(_NAMES.items(), COLOURS, strict=False)
    )
    rows = tuple((label, f"{mus[n]:.2f}", f"{slopes[n]:.1f}", f"{100 * bends[n]:.1f}") for n, label in _NAMES.items())
    return Figure(
        "3.1",
        "one tyre on different surfaces",
        f"Brush tyre of slip slope {_TYRE_SLOPE:.0f} and friction {_TYRE_MU:.1f} on dry asphalt; the ground's yield "
        "is in series with the tread. The thesis shows measurements of a rear tyre.",
        (Panel("Traction coefficient over slip", Axis("slip", "%"), Axis("traction coefficient"), lines),),
        (c81, c82),
        (
            Table(
                "Curves", ("surface", "friction [-]", "slip slope [-]", "slip at 90 % of the friction [%]"), rows
            ),
        ),
    )  # fmt: skip
