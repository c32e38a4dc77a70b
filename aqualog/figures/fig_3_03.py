"""Figure 3.3: the rear tyre's curve, scaled onto the front one."""

from __future__ import annotations

import numpy as np

from aqualog.figures.curves import slip_of_traction, traction
from aqualog.figures.record import Axis, Figure, Finding, Line, Panel, Table, judged
from aqualog.figures.timeline import COLOURS

__all__ = ["make"]

_FRONT, _REAR, _MU = 30.0, 24.0, 1.0
_RATIO = _REAR / _FRONT  # lambda of (3.17)
_POINTS = (0.02, 0.12)  # traction coefficients of front and rear axle in the example
_EQUAL = 0.12  # of the front axle, where the transformed slips shall be equal


def make() -> Figure:
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
    c92 = Finding(
        "C92",
        "Scaled by slope ratio and speed ratio, the rear curve lies on the front one; the front slope is read from "
        "differential slip and traction as long as the scaled slips differ.",
        "initial slope of the scaled curve within 1 % of the front one; slope between both working points within 15 "
        "%; in part: the first only",
        f"initial slope {initial:.2f}, slope between the points {chord:.1f}, front tyre {_FRONT:.0f}",
        judged(whole=initial_error < 0.01 and chord_error < 0.15, part=initial_error < 0.01),
        f"The straight line between both points of the bent curve is {100 * chord_error:.0f} % flatter than the "
        "initial slope. With front and rear traction in the ratio of the slopes the differential slip is "
        f"{100 * left:.4f} %, too small for an estimate.",
        chord,
    )
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
    return Figure(
        "3.3",
        "scaling of the slip curves",
        f"Brush tyres of slip slope {_FRONT:.0f} in front and {_REAR:.0f} at the rear (lambda = {_RATIO:.1f}), "
        f"friction {_MU:.1f}; traction coefficients {_POINTS[0]:g} and {_POINTS[1]:g}, which give rho = {rho:.4f}.",
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
    )
