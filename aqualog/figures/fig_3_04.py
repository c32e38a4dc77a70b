"""Figure 3.4: differential traction over front slip and differential slip, on a dry and on a snowy road."""

from __future__ import annotations

import numpy as np

from aqualog.figures.curves import split
from aqualog.figures.record import Figure, Finding, Panel, Table, judged
from aqualog.figures.solid import (
    DIFFERENCE,
    DRY,
    FRONT_SLIP,
    SNOW,
    TRACTION,
    forces,
    initial_slope,
    sheet,
    split_lines,
)

__all__ = ["make"]

_NU = 0.3
_AT = 0.005  # differential slip at which both lines are compared [-]


def make() -> Figure:
    """Two surfaces with a line of fixed split each, and their projection."""
    slopes = {r.name: initial_slope(r, _NU) for r in (DRY, SNOW)}
    errors = [abs(slopes[r.name] / r.slope - 1.0) for r in (DRY, SNOW)]
    heights = []
    for road in (DRY, SNOW):
        p = split(road, forces(road), _NU)
        order = np.argsort(p.s_delta)
        heights.append(float(np.interp(_AT, p.s_delta[order], p.mu_delta[order])))
    ratio = heights[0] / heights[1]
    c93 = Finding(
        "C93",
        "Projected on differential slip and traction, the lines of a fixed split differ clearly; their "
        "initial slope is the slip slope.",
        "initial slope of each projected line within 1 % of the front tyre's slip slope, and the lines at least a "
        f"factor 2 apart at {100 * _AT:g} % differential slip; in part: slopes only",
        f"initial slopes {slopes['dry']:.2f} and {slopes['snowy']:.2f} (tyres {DRY.slope:.0f} and {SNOW.slope:.0f}); "
        f"at {100 * _AT:g} % the dry line is {ratio:.1f} times as high",
        judged(whole=max(errors) < 0.01 and ratio > 2.0, part=max(errors) < 0.01),
        value=max(errors),
    )
    solid = tuple(
        split_lines(r, _NU, name=f"nu = {_NU}, {r.name}", colour=r.colour, dash=d)
        for r, d in ((DRY, "solid"), (SNOW, "dot"))
    )
    flat = tuple(
        split_lines(r, _NU, name=f"nu = {_NU}, {r.name}", colour=r.colour, dash=d, is_solid=False)
        for r, d in ((DRY, "solid"), (SNOW, "dot"))
    )
    return Figure(
        "3.4",
        "differential traction over front slip and differential slip",
        f"Brush tyres, axle loads 40/60: friction {DRY.mu_max:.1f} and slip slope {DRY.slope:.0f} (dry), "
        f"{SNOW.mu_max:.1f} and {SNOW.slope:.0f} (snowy), the same on both axles. Lines: {100 * _NU:.0f} % of the "
        "force on the rear axle.",
        (
            Panel("Surfaces and lines of a fixed split", FRONT_SLIP, DIFFERENCE, solid, TRACTION,
                  (sheet(DRY), sheet(SNOW))),
            Panel("Projection", DIFFERENCE, TRACTION, flat),
        ),
        (c93,),
        (
            Table(
                "Lines of the fixed split",
                ("road", "slip slope [-]", "initial slope [-]", f"mu_delta at {100 * _AT:g} % [-]"),
                tuple(
                    (r.name, f"{r.slope:.1f}", f"{slopes[r.name]:.3f}", f"{h:.4f}")
                    for r, h in zip((DRY, SNOW), heights, strict=True)
                ),
            ),
        ),
    )  # fmt: skip
