"""Fit of the free numbers of the law of water to the published points: `python -m tests.model.water_fit`.

Each point counts by its deviation over its tolerance, as `published.toml` has both. What the points do not say comes
from the thesis, and is written here with its spread: the anchor, the growth of minor spin-downs, the film in the track.
It prints what `aqualog.model.water_numbers` holds.
"""

from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from aqualog.model.published import Condition, compared, full_speed, rms, tyre_of
from aqualog.model.tyre import TYRES
from aqualog.model.water_numbers import NAMES

KMH = 1 / 3.6
# from elsewhere: value and standard deviation
ELSEWHERE = {
    "v_anchor": (120.5 * KMH, 1.5 * KMH),  # 3 of 4 front wheels at half speed in 0.5 s at 118 km/h (C16), by simulation
    "aspect_exponent": (0.45, 0.07),  # k: 0.5 by Horne's formula of 1986, 0.4 by the load in USF's (K)
    "contact_exponent": (4.0, 0.7),  # minor spin-downs grow in number from 98 to 106 km/h (C15); 4-6 by half the slope
    "h_track": (0.5e-3, 0.15e-3),  # below the least depth tested, 0.6 mm (D)
    "h_film": (0.5e-3, 0.2e-3),  # C_D of 0.7 (K)
}
LATER, LATER_SD = 16.0, 4.0  # [km/h] new tyres than worn ones in 5 to 8 mm: 13 to 20 in tests


def tyre(x, scale):
    return replace(TYRES["worn_summer"], **dict(zip(NAMES, x * scale, strict=True)))


def residuals(x, scale):
    t = tyre(x, scale)
    out = [row.deviation / row.point.tolerance for row in compared(t)]
    for depth in (5.0, 8.0):
        new, worn = (Condition(depth, tread, 1.9, 4000.0) for tread in (7.8, 1.6))
        later = full_speed(tyre_of(new, t), new, "spin-down") - full_speed(tyre_of(worn, t), worn, "spin-down")
        out.append((later - LATER) / LATER_SD)
    # Horne's root of the pressure at one aspect
    out.append((t.pressure_exponent + 0.5 * t.aspect_exponent - 0.5) / 0.05)
    return np.array(out + [(getattr(t, n) - value) / sd for n, (value, sd) in ELSEWHERE.items()])


def fit():
    """Return values and covariance of the numbers, by least squares."""
    scale = np.array([getattr(TYRES["worn_summer"], n) for n in NAMES])
    found = least_squares(residuals, np.ones(scale.size), diff_step=1e-2, bounds=(0.2, 3.0), args=(scale,))
    return found.x * scale, np.linalg.inv(found.jac.T @ found.jac) * np.outer(scale, scale), found.fun


if __name__ == "__main__":
    value, covariance, left = fit()
    sd = np.sqrt(np.diag(covariance))
    for n, x, s in zip(NAMES, value, sd, strict=True):
        print(f"{n:18s} {x:.5g} +- {s:.2g}")
    print(np.array2string(covariance / np.outer(sd, sd), precision=2, separator=", ", suppress_small=True))
    rows = compared(replace(TYRES["worn_summer"], **dict(zip(NAMES, value, strict=True))))
    speeds = [r for r in rows if r.point.quantity == "full_speed"]
    print(f"rms of the speeds {rms(speeds):.1f} km/h, all over tolerance {rms(rows, scaled=True):.2f}; ", end="")
    print(f"{sum(r.is_inside for r in rows)} of {len(rows)} inside; chi2 {left @ left:.1f}")
