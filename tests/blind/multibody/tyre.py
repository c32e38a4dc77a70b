"""TMeasy tyre: the curve by its slope, its peak and its slide, in a slip generalised over both directions (Rill 2012).

On water two laws of this world alone: a lift that grows as a smooth step of speed, and a drag with the film's momentum.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from aqualog.core.compiled import part

__all__ = ["LAW", "load_factor", "lost_share", "tmeasy", "water_push"]

PEAK_X, PEAK_Y = 0.09, 0.16  # slip and slip angle [rad] of the peak
SLIDE = 4.5  # slip of full sliding over that of the peak
SLIDE_SHARE = 0.83  # force then, over the peak's
AQUA_H = 1.2e-3  # [m] of an even film
# full aquaplaning [m/s] in it, exponents of film and load; begin and width of the step over v / full and its power (0:
# smooth); drag [N] at 2 mm and 25 m/s (0: momentum), its exponents of film and speed; that of the slope over the contact
LAW = np.array([33.0, 0.16, 0.25, 0.3, 0.72, 0.0, 0.0, 1.0, 2.0, 2.0])


@part
def tmeasy(s_x, s_y, F_z, mu, slope_x, slope_y):
    """Forces along and across [N] of slips; slopes are dF/ds / F_z at the origin."""
    if F_z <= 1.0 or mu <= 1e-4:
        return 0.0, 0.0
    # a peak as far out as the friction asks for, so that the curve has no turning point before it
    peak_x, peak_y = max(PEAK_X, 1.9 * mu / slope_x), max(PEAK_Y, 1.9 * mu / slope_y)
    n_x, n_y = s_x / peak_x, s_y / peak_y
    s = sqrt(n_x * n_x + n_y * n_y)
    if s < 1e-12:
        return slope_x * F_z * s_x, slope_y * F_z * s_y
    c, d = n_x / s, n_y / s
    rise_x, rise_y = slope_x * peak_x * c, slope_y * peak_y * d
    rise = sqrt(rise_x * rise_x + rise_y * rise_y)  # of F / F_z at the origin, per generalised slip
    if s < 1.0:
        F = rise * s / (1.0 + s * (s + rise / mu - 2.0))
    elif s < SLIDE:
        x = (s - 1.0) / (SLIDE - 1.0)
        F = mu * (1.0 - (1.0 - SLIDE_SHARE) * x * x * (3.0 - 2.0 * x))
    else:
        F = mu * SLIDE_SHARE
    # at small slips each direction has its own slope, at large ones the force opposes the slip
    blend = min(s, 1.0)
    e_x, e_y = rise_x / rise, rise_y / rise
    e_x, e_y = e_x + (c - e_x) * blend, e_y + (d - e_y) * blend
    norm = sqrt(e_x * e_x + e_y * e_y)
    return F * F_z * e_x / norm, F * F_z * e_y / norm


@part
def load_factor(F_z, F_ref, law):
    """Slope over that at the reference load: Rill's parabola of the force's slope over the load, divided by the load."""
    return max(1.0 + law * (F_z / F_ref - 1.0), 0.2)


@part
def lost_share(v, film, F_z, F_ref, law):
    """Share of the contact that a film [m] lifts, 0 to 1; `law` as `LAW`."""
    if film < 2e-5:
        return 0.0
    full = law[0] * (AQUA_H / film) ** law[1] * (max(F_z, 200.0) / F_ref) ** law[2]
    x = (v / full - law[3]) / law[4]
    x = min(max(x, 0.0), 1.0)
    lost = x ** law[5] if law[5] > 0.0 else x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
    return lost * min(film / 1.5e-4, 1.0)


@part
def water_push(v, film, law):
    """Drag of a film on one wheel [N]: momentum of what 0.19 m of tread push aside, a part of it thrown."""
    if law[6] > 0.0:
        return law[6] * (film / 2e-3) ** law[7] * (v / 25.0) ** law[8]
    return 1000.0 * 0.19 * film * v * v * (0.36 + 0.2 * film / (film + 1e-3))
